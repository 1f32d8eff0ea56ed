//! How sure an estimate is: covariance, correlations, the size of the residuals, outliers, predictions.
//!
//! [`Covariance`] is made first; everything else asks it.
//!
//! | question | answer |
//! | --- | --- |
//! | how far off may this unknown be? | [`Covariance::std_devs`], [`Covariance::block`] |
//! | which unknowns go up and down together? | [`Covariance::strongest_correlations`] |
//! | are the residuals as large as the noise models say? | [`Covariance::chi_square`] |
//! | which measurements do not fit, and which decide alone? | [`Residuals`] |
//! | how far off may a function of the unknowns be? | [`Covariance::predict`], [`Covariance::propagate`] |
//! | and under a robust loss? | [`Covariance::robust`] |
//!
//! All of it is first order: the model is replaced by its linearisation at the solution, and is as
//! right as the model is straight over a few standard deviations. Errors that are not in the model
//! are in no standard deviation.

mod chi_square;
mod correlation;
mod covariance;
mod prediction;
mod residuals;
mod robust;

pub use chi_square::{ChiSquareTest, Verdict};
pub use correlation::Correlation;
pub use covariance::Covariance;
pub use prediction::Prediction;
pub use residuals::{ConstraintResidual, Residuals, Scale};
pub use robust::{Influence, huber_sigma0};
