//! Other equations for the same measurements, and where they come from: what a plugin adds to
//! calibrations.

use super::assembly::PlaneVar;
use super::measurement::{Measured, MeasurementSet};
use crate::constraint::Chain;
use crate::error::Error;
use crate::file::Kind;
use crate::kinematics::DifferentiateChain;
use std::sync::Arc;
use truing::manifold::{Plane, Point3, Pose3, Vector};
use truing::nalgebra::Vector3;
use truing::{Problem, Var};

/// The variables that the equations of a set may be about.
pub struct Parts<'a> {
    /// The robot that measured, with its way to be differentiated.
    pub chain: &'a Arc<Chain>,
    /// Its parameters.
    pub robot: Var<Vector>,
    /// The tool point; held where it is the tool origin.
    pub target: Var<Point3>,
    /// The sensor's pose; held where it is the reference frame.
    pub sensor: Var<Pose3>,
    /// Planes, by group; in the form's own coordinates, if it has any.
    pub planes: &'a [PlaneVar],
    /// Points, by group.
    pub points: &'a [Var<Point3>],
    /// Locations, by group.
    pub locations: &'a [Var<Pose3>],
}

/// A way to write the equations of a set of measurements: `method = "…"` in calibration files.
///
/// What was measured, what it can identify and how errors are reported do not depend on it; the
/// equations that are solved do.
pub trait Form: std::fmt::Debug + Send + Sync {
    /// Its name in files.
    fn name(&self) -> &'static str;

    /// Whether it can write these measurements; says in words why not.
    ///
    /// # Errors
    /// What stands in the way.
    fn check(&self, set: &MeasurementSet) -> Result<(), String>;

    /// Adds the equations of a set to a problem, as one block of the set's name.
    ///
    /// # Errors
    /// If a standard deviation is not positive and finite, or a plane cannot be written.
    fn add(
        &self,
        set: &MeasurementSet,
        parts: &Parts<'_>,
        problem: &mut Problem,
    ) -> Result<(), Error>;

    /// Whether planes, points and locations are eliminated from its equations.
    fn eliminates(&self, _measured: &Measured) -> bool {
        false
    }

    /// The coordinates in which it has planes, where they are not unit normal and distance.
    fn chart(&self) -> Option<&dyn PlaneChart> {
        None
    }
}

/// Coordinates of planes, three numbers that are estimated.
pub trait PlaneChart {
    /// The plane to start from, fitted to touches \[m\].
    fn fit(&self, touches: &[Vector3<f64>]) -> Plane<f64>;

    /// The coordinates of a plane.
    ///
    /// # Errors
    /// If it has none.
    fn coordinates(&self, plane: &Plane<f64>) -> Result<[f64; 3], Error>;

    /// The plane with these coordinates.
    fn plane(&self, coordinates: &[f64]) -> Plane<f64>;

    /// The derivative of the coordinates by ε where all lengths grow by 1 + ε.
    fn scaled(&self, plane: &Plane<f64>) -> [f64; 3];
}

/// What else calibration files may ask for than this crate has.
pub trait Plugin: Send + Sync {
    /// Closed-form columns of the regressor: `jacobian = "analytic"`.
    fn analytic(&self) -> Option<Arc<dyn DifferentiateChain>> {
        None
    }

    /// The methods it has, with the kinds they are for.
    fn methods(&self) -> Vec<(&'static str, Kind)> {
        Vec::new()
    }

    /// A method for a kind.
    fn form(&self, _method: &str, _kind: Kind) -> Option<Arc<dyn Form>> {
        None
    }

    /// The plane of a method whose plane is always the same.
    fn fixed_plane(&self, _method: &str) -> Option<Plane<f64>> {
        None
    }
}

impl MeasurementSet {
    /// Whether its equations leave out the planes, points or locations that its errors are reported with.
    pub(super) fn eliminates(&self) -> bool {
        self.form
            .as_ref()
            .is_some_and(|form| form.eliminates(&self.measured))
    }
}
