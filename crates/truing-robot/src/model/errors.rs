//! Errors of measurements in a state, as people read them.

use super::assembly::Assembly;
use crate::error::Error;
use crate::measurement::MeasurementSet;
use crate::robot::{Arm, Derivatives};
use crate::unknown::State;

/// Residuals of a set in a state by its kind's own equations, one chunk of `dim` a measurement.
///
/// # Errors
/// If the set cannot be assembled.
pub fn residuals(
    arms: &[Arm],
    set: &MeasurementSet,
    state: &State,
    derivatives: &Derivatives,
) -> Result<Vec<f64>, Error> {
    let assembly = Assembly::new(arms, &[set.plain()], state, derivatives)?;
    Ok(assembly.residuals(0, assembly.problem.initial()))
}

/// The errors of a measurand of a set, from its residuals: Euclidean lengths, or signed numbers where
/// it has one row.
pub fn errors_of(set: &MeasurementSet, measurand: usize, residuals: &[f64]) -> Vec<f64> {
    let measurands = set.kind.measurands();
    let first: usize = measurands[..measurand].iter().map(|m| m.rows).sum();
    let own = &measurands[measurand];
    residuals
        .chunks_exact(set.dim())
        .map(|rows| own.error(&rows[first..first + own.rows]))
        .collect()
}
