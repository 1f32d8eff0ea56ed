//! What the rows of a measurement's residual are.

use crate::robot::Unit;

/// A quantity that is measured: some rows of the residual, with their unit and noise.
///
/// Its error, as a person reads it, is the Euclidean length of its rows, or the signed number where
/// it has one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurand {
    /// Its name: `position`, `rotation`, `length`.
    pub name: &'static str,
    /// The unit of its rows.
    pub unit: Unit,
    /// How many rows of the residual it has.
    pub rows: usize,
    /// The standard deviation of each row where none is given. Estimates depend only on ratios of
    /// standard deviations.
    pub sigma: f64,
}

impl Measurand {
    /// A position \[m\], with 0.1 mm in each direction, as a good tracker has.
    pub const POSITION: Self = Self {
        name: "position",
        unit: Unit::Meter,
        rows: 3,
        sigma: 1e-4,
    };

    /// A rotation \[rad\], with 0.1 mrad about each axis.
    pub const ROTATION: Self = Self {
        name: "rotation",
        unit: Unit::Radian,
        rows: 3,
        sigma: 1e-4,
    };

    /// A signed length \[m\], with 0.1 mm.
    pub const LENGTH: Self = Self {
        name: "length",
        unit: Unit::Meter,
        rows: 1,
        sigma: 1e-4,
    };

    /// Its error in the rows of a residual that belong to it.
    pub fn error(&self, rows: &[f64]) -> f64 {
        match rows {
            [signed] => *signed,
            rows => rows.iter().map(|e| e * e).sum::<f64>().sqrt(),
        }
    }
}
