//! Values of everything a calibration knows, and whose columns of the Jacobian they are.

use super::measurement::{Measured, MeasurementSet};
use std::collections::BTreeMap;
use truing::manifold::{Plane, Pose};
use truing::nalgebra::Vector3;

/// Values of everything a calibration knows.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct State {
    /// Parameters of every robot.
    pub robots: Vec<Vec<f64>>,
    /// Sensor frames by name: their poses in the reference frame.
    pub frames: BTreeMap<String, Pose<f64>>,
    /// Tool points by robot and name, in the tool frame \[m\].
    pub targets: BTreeMap<(usize, String), Vector3<f64>>,
    /// Planes of every set, by group.
    pub planes: Vec<Vec<Plane<f64>>>,
    /// Points of every set, by group \[m\].
    pub points: Vec<Vec<Vector3<f64>>>,
    /// Locations of every set, by group.
    pub locations: Vec<Vec<Pose<f64>>>,
    /// Distances of every set \[m\]; zero for kinds that have none.
    pub distances: Vec<f64>,
}

impl State {
    /// The tool point of a set: its target, or the tool origin.
    pub fn target(&self, set: &MeasurementSet) -> Vector3<f64> {
        match &set.target {
            Some(name) => self
                .targets
                .get(&(set.robot, name.clone()))
                .copied()
                .unwrap_or_default(),
            None => Vector3::zeros(),
        }
    }

    /// The second tool point of a distance: the other robot's, or the same in its second posture.
    pub fn second_target(&self, set: &MeasurementSet) -> Vector3<f64> {
        match (&set.measured, &set.other_target) {
            (Measured::Distance { other: Some(b), .. }, Some(name)) => self
                .targets
                .get(&(*b, name.clone()))
                .copied()
                .unwrap_or_default(),
            (Measured::Distance { other: None, .. }, _) => self.target(set),
            _ => Vector3::zeros(),
        }
    }

    /// The sensor pose of a set: its frame, or the reference frame.
    pub fn sensor(&self, set: &MeasurementSet) -> Pose<f64> {
        set.frame
            .as_ref()
            .and_then(|name| self.frames.get(name))
            .copied()
            .unwrap_or_else(Pose::identity)
    }
}

/// Whose column of the Jacobian it is.
#[derive(Debug, Clone, PartialEq)]
pub enum Owner {
    /// Parameter of a robot.
    Parameter {
        /// The robot.
        robot: usize,
        /// The parameter.
        parameter: usize,
    },
    /// Component of a sensor frame.
    Frame(String),
    /// Component of a tool point.
    Target(usize, String),
    /// Component of a plane: set, group.
    Plane(usize, usize),
    /// Component of a point: set, group.
    Point(usize, usize),
    /// Component of a location: set, group.
    Location(usize, usize),
    /// Distance of a set.
    Distance(usize),
    /// Never estimated: the reference frame, the tool origin, a known distance, a group whose
    /// unknowns a form has eliminated.
    Constant,
}

impl Owner {
    /// Whether it belongs to what was touched or visited, and to no robot or sensor.
    pub fn is_local(&self) -> bool {
        matches!(
            self,
            Self::Plane(..) | Self::Point(..) | Self::Location(..) | Self::Distance(_)
        )
    }
}

/// A column of the Jacobian.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Whose it is.
    pub owner: Owner,
    /// Name, e.g. `left.theta3`, `tracker.x`, `wall.distance`.
    pub name: String,
}
