//! Sets of measurements, as plain data.

use super::form::Form;
use crate::kinematics::Robot;
use std::path::PathBuf;
use std::sync::Arc;
use truing::Loss;
use truing::manifold::{Plane, Pose};
use truing::nalgebra::Vector3;

/// A robot under its name in the calibration; empty if there is only one.
#[derive(Debug, Clone)]
pub struct Arm {
    /// The name, the prefix of its parameters.
    pub name: String,
    /// The robot.
    pub robot: Robot,
}

impl Arm {
    /// The only robot of a calibration.
    pub fn only(robot: Robot) -> Self {
        Self {
            name: String::new(),
            robot,
        }
    }

    /// A parameter's name with the arm's prefix: `theta3`, or `left.theta3`.
    pub fn parameter_name(&self, parameter: usize) -> String {
        let name = &self.robot.parameters()[parameter].name;
        if self.name.is_empty() {
            name.clone()
        } else {
            format!("{}.{name}", self.name)
        }
    }
}

/// Standard deviations of one measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sigma {
    /// Of lengths \[m\].
    pub position: f64,
    /// Of rotations \[rad\].
    pub rotation: f64,
}

impl Default for Sigma {
    /// 0.1 mm and 0.1 mrad, as a good tracker has. Estimates depend only on ratios of standard
    /// deviations; what counts as determined (1 m, 1 rad) depends on them as they are.
    fn default() -> Self {
        Self {
            position: 1e-4,
            rotation: 1e-4,
        }
    }
}

/// Rows that belong together: touches of one plane, visits of one point.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Groups {
    /// Names, in order of appearance.
    pub names: Vec<String>,
    /// The group of every row.
    pub of_row: Vec<usize>,
}

impl Groups {
    /// Groups rows by equal labels.
    pub fn by_label(labels: impl IntoIterator<Item = String>) -> Self {
        let mut groups = Self::default();
        for label in labels {
            let known = groups.names.iter().position(|name| *name == label);
            groups.of_row.push(known.unwrap_or(groups.names.len()));
            if known.is_none() {
                groups.names.push(label);
            }
        }
        groups
    }

    /// How many rows each group has.
    pub fn counts(&self) -> Vec<usize> {
        let mut counts = vec![0; self.names.len()];
        self.of_row.iter().for_each(|g| counts[*g] += 1);
        counts
    }
}

/// What was measured.
#[derive(Debug, Clone, PartialEq)]
pub enum Measured {
    /// Positions of a tool point \[m\].
    Position(Vec<Vector3<f64>>),
    /// Poses of the tool.
    Pose(Vec<Pose<f64>>),
    /// Touches of a known plane (unit normal).
    KnownPlane(Plane<f64>),
    /// Touches of planes that are estimated.
    UnknownPlane(Groups),
    /// Visits of points that are estimated.
    SamePoint(Groups),
    /// Visits of locations (positions with orientations) that are estimated.
    SameLocation(Groups),
    /// Distances between tool points.
    Distance {
        /// The other robot; none where one robot takes two postures.
        other: Option<usize>,
        /// Joint values of the other robot, or of the second posture.
        q_b: Vec<Vec<f64>>,
        /// The distance \[m\]; none where it is estimated.
        distance: Option<f64>,
    },
}

impl Measured {
    /// The groups of rows, for kinds that have any: planes, points or locations.
    pub fn groups(&self) -> Option<&Groups> {
        match self {
            Self::UnknownPlane(groups) | Self::SamePoint(groups) | Self::SameLocation(groups) => {
                Some(groups)
            }
            _ => None,
        }
    }

    /// The groups of rows, to be changed.
    pub fn groups_mut(&mut self) -> Option<&mut Groups> {
        match self {
            Self::UnknownPlane(groups) | Self::SamePoint(groups) | Self::SameLocation(groups) => {
                Some(groups)
            }
            _ => None,
        }
    }

    /// The name of the kind in files.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Position(_) => "position",
            Self::Pose(_) => "pose",
            Self::KnownPlane(_) => "known-plane",
            Self::UnknownPlane(_) => "unknown-plane",
            Self::SamePoint(_) => "same-point",
            Self::SameLocation(_) => "same-location",
            Self::Distance { .. } => "distance",
        }
    }
}

/// Where the rows of a set were read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Origin {
    /// The data file.
    pub path: PathBuf,
    /// The line of every row, from 1.
    pub lines: Vec<usize>,
    /// The number of every row in the file, from 0, as `rows` counts in calibration files.
    pub rows: Vec<usize>,
}

/// Measurements of one kind, by one sensor, on one robot.
#[derive(Debug, Clone)]
pub struct MeasurementSet {
    /// Name, for reports.
    pub name: String,
    /// Which robot.
    pub robot: usize,
    /// Joint values, one row a measurement.
    pub q: Vec<Vec<f64>>,
    /// What was measured.
    pub measured: Measured,
    /// Standard deviations, one a row.
    pub sigma: Vec<Sigma>,
    /// The loss.
    pub loss: Loss,
    /// Other equations than this crate's for the same measurements.
    pub form: Option<Arc<dyn Form>>,
    /// The tool point, where it is not the tool origin; estimated.
    pub target: Option<String>,
    /// The tool point of the other robot of a distance; estimated.
    pub other_target: Option<String>,
    /// Where to start the estimate of `target`, in the tool frame \[m\].
    pub target_guess: Option<Vector3<f64>>,
    /// The sensor's frame, where it is not the reference frame; estimated.
    pub frame: Option<String>,
    /// Where to start its estimate.
    pub frame_guess: Option<Pose<f64>>,
    /// Where every row was read, for messages; none for measurements that are not of a file.
    pub origin: Option<Origin>,
}

impl MeasurementSet {
    /// A set with default noise on the tool origin, in the reference frame.
    pub fn new(
        name: impl Into<String>,
        robot: usize,
        q: Vec<Vec<f64>>,
        measured: Measured,
    ) -> Self {
        let sigma = vec![Sigma::default(); q.len()];
        Self {
            name: name.into(),
            robot,
            q,
            measured,
            sigma,
            loss: Loss::Trivial,
            form: None,
            target: None,
            other_target: None,
            target_guess: None,
            frame: None,
            frame_guess: None,
            origin: None,
        }
    }

    /// The same set measured at a tool point that is estimated.
    #[must_use]
    pub fn target(mut self, name: &str) -> Self {
        self.target = Some(name.to_owned());
        self
    }

    /// The same set measured in a sensor's frame that is estimated.
    #[must_use]
    pub fn frame(mut self, name: &str) -> Self {
        self.frame = Some(name.to_owned());
        self
    }

    /// The same set with other equations.
    #[must_use]
    pub fn form(mut self, form: Arc<dyn Form>) -> Self {
        self.form = Some(form);
        self
    }

    /// The same measurements with this crate's own equations, in which errors are reported.
    #[must_use]
    pub fn plain(&self) -> Self {
        Self {
            form: None,
            ..self.clone()
        }
    }

    /// The same measurements, weighed by their standard deviations alone: a robust loss weighs rows by
    /// how far an estimate is off.
    #[must_use]
    pub fn unweighted(&self) -> Self {
        Self {
            loss: Loss::Trivial,
            ..self.clone()
        }
    }

    /// The same set with another standard deviation of its lengths \[m\].
    #[must_use]
    pub fn sigma(mut self, position: f64) -> Self {
        for sigma in &mut self.sigma {
            sigma.position = position;
        }
        self
    }

    /// The tool points that the set names, as (robot, name).
    pub fn targets(&self) -> impl Iterator<Item = (usize, String)> {
        let other = match &self.measured {
            Measured::Distance { other, .. } => *other,
            _ => None,
        };
        let own = self.target.clone().map(|name| (self.robot, name));
        own.into_iter().chain(other.zip(self.other_target.clone()))
    }

    /// Number of measurements.
    pub fn len(&self) -> usize {
        self.q.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.q.is_empty()
    }

    /// Residual rows of each measurement.
    pub fn dim(&self) -> usize {
        match self.measured {
            Measured::Position(_) | Measured::SamePoint(_) => 3,
            Measured::Pose(_) | Measured::SameLocation(_) => 6,
            _ => 1,
        }
    }

    /// Some of the rows, in the given order. Groups keep their names and numbers.
    #[must_use]
    pub fn rows(&self, rows: &[usize]) -> Self {
        fn pick<T: Clone>(all: &[T], rows: &[usize]) -> Vec<T> {
            rows.iter().map(|row| all[*row].clone()).collect()
        }
        let groups = |g: &Groups| Groups {
            names: g.names.clone(),
            of_row: pick(&g.of_row, rows),
        };
        let measured = match &self.measured {
            Measured::Position(points) => Measured::Position(pick(points, rows)),
            Measured::Pose(poses) => Measured::Pose(pick(poses, rows)),
            Measured::KnownPlane(plane) => Measured::KnownPlane(*plane),
            Measured::UnknownPlane(g) => Measured::UnknownPlane(groups(g)),
            Measured::SamePoint(g) => Measured::SamePoint(groups(g)),
            Measured::SameLocation(g) => Measured::SameLocation(groups(g)),
            Measured::Distance {
                other,
                q_b,
                distance,
            } => Measured::Distance {
                other: *other,
                q_b: pick(q_b, rows),
                distance: *distance,
            },
        };
        Self {
            q: pick(&self.q, rows),
            measured,
            sigma: pick(&self.sigma, rows),
            origin: self.origin.as_ref().map(|origin| Origin {
                path: origin.path.clone(),
                lines: pick(&origin.lines, rows),
                rows: pick(&origin.rows, rows),
            }),
            ..self.clone()
        }
    }
}
