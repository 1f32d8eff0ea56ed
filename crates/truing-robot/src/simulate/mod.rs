//! Simulating robots with known errors, and measurements of them.

mod sample;
mod scenario;

pub use sample::{Sampling, sample};
pub use scenario::{Simulated, perturbed, simulate};
pub(crate) use scenario::{noise, template};
