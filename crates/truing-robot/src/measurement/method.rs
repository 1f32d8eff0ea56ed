//! Methods: other equations for a kind of measurement, `method = "…"` in files.

use super::at::At;
use super::equations::Equations;
use super::kind::Kind;
use super::readings::Readings;
use crate::error::Error;
use crate::unknown::Value;
use std::fmt;
use std::sync::Arc;

/// A way to write the equations of a set of measurements: `method = "…"` in calibration files.
///
/// What was measured, what it can identify and how errors are reported do not depend on it; the
/// equations that are solved do.
pub trait Method: fmt::Debug + Send + Sync {
    /// Its name in files.
    fn name(&self) -> &'static str;

    /// The names of the kinds that it is for.
    fn kinds(&self) -> &'static [&'static str];

    /// Whether it can write these measurements; says in words why not.
    ///
    /// # Errors
    /// What stands in the way.
    fn check(&self, kind: &dyn Kind, readings: &Readings) -> Result<(), String>;

    /// Adds the equations of a set to the problem, as one block of the set's name.
    ///
    /// # Errors
    /// If a standard deviation is not positive and finite, or an unknown cannot be written.
    fn equations(&self, kind: &dyn Kind, on: &mut Equations<'_>) -> Result<(), Error>;

    /// Whether the unknowns of a kind are eliminated from its equations.
    fn eliminates(&self, _kind: &dyn Kind) -> bool {
        false
    }

    /// The kind with the constants that the method always has, where files need not say them.
    fn constants(&self) -> Option<Arc<dyn Kind>> {
        None
    }

    /// The coordinates in which it has an unknown of a kind, where they are not the kind's.
    fn chart(&self, _kind: &dyn Kind, _unknown: &str) -> Option<Arc<dyn Chart>> {
        None
    }
}

/// Other coordinates of an unknown, which are estimated in its place.
pub trait Chart: Send + Sync {
    /// The unknown's starting value, with the robot as it is.
    fn start(&self, at: &At<'_>, group: usize) -> Value;

    /// The coordinates of a value.
    ///
    /// # Errors
    /// If it has none.
    fn coordinates(&self, value: &Value) -> Result<Value, Error>;

    /// The value with these coordinates.
    fn value(&self, coordinates: &Value) -> Value;

    /// The derivative of the coordinates of a value by ε where all lengths grow by 1 + ε.
    fn growth(&self, value: &Value) -> Vec<f64>;
}
