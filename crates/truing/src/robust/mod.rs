//! Robust estimation: losses in the linearisation, relaxed problems, graduated non-convexity, the
//! adaptive loss, outliers.

mod adaptive;
mod graduated;
mod outlier;
mod relaxed;
mod weighing;

pub use adaptive::{Adapted, adapt_loss, solve_adaptive};
pub use graduated::{solve_graduated, solve_graduated_from};
pub use outlier::{Outlier, Weight};
pub use relaxed::Relaxed;
pub(crate) use weighing::Weighing;
