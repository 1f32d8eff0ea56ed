//! Simulating robots with known errors, and measurements of them.

mod scenario;
mod simulated;

pub(crate) use scenario::{noise, template};
pub use scenario::{perturbed, simulate, simulate_with};
pub use simulated::Simulated;
