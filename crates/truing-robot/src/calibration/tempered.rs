//! A calibration's problem, tempered: touches measured in joint space, parameters drawn to a centre.

use super::assembly::{Assembly, PlaneVar};
use super::measurement::{Arm, Measured, MeasurementSet};
use crate::kinematics::{
    Convention, DifferentiateChain, FrameWise, JointKind, ParameterKind, Regressor, Robot,
};
use std::cell::RefCell;
use std::sync::Arc;
use truing::manifold::{Plane, Plane3, Point3, Vector};
use truing::nalgebra::{Matrix3x2, Vector3};
use truing::{
    Error, LeastSquares, Linearization, Problem, StepBounds, Structure, Values, Var, Variable,
    autodiff,
};

/// Touches of planes of one set: their residual depends on the joints by h = ‖∂r/∂q‖, and
/// e = h̄ · r / √(h² + (f·h̄)²) is, but for a constant, how far the joints are from a touch.
///
/// With r alone an arm that shrinks, or whose axes turn parallel, gains: its touches are near any
/// plane. Measured in joint space they are as far from it as before (Sampson 1982, "Fitting conic
/// sections to very scattered data", does so with curves).
pub(super) struct Touches<'a> {
    robot: &'a Robot,
    /// Joint values of every touch.
    q: &'a [Vec<f64>],
    /// The plane that each touches, or the one that all do.
    planes: Vec<Var<Plane3>>,
    of_row: &'a [usize],
    known: Plane<f64>,
    parameters: Var<Vector>,
    target: Option<Var<Point3>>,
    /// First row of the residual.
    first: usize,
    /// Unit of each joint: one, or a length where it slides.
    units: Vec<f64>,
    /// Place of each parameter in the chain: what is nearer to the base moves what is nearer to the tool.
    order: Vec<usize>,
    /// h̄ \[m/rad\].
    mean: f64,
}

/// h² may not get smaller than the square of this part of its mean: touches where no joint moves the
/// tool off the plane would weigh infinitely.
const FLOOR: f64 = 0.2;

impl<'a> Touches<'a> {
    /// The touches of planes among the sets, with h̄ at `x`; `length` is what a radian is worth.
    pub fn of(
        arms: &'a [Arm],
        sets: &'a [MeasurementSet],
        assembly: &Assembly,
        x: &Values,
        length: f64,
    ) -> Vec<Self> {
        let mut all = Vec::new();
        for (k, set) in sets.iter().enumerate() {
            let none = Plane {
                normal: Vector3::zeros(),
                distance: 0.0,
            };
            let (known, planes, of_row): (_, Vec<Var<Plane3>>, &[usize]) = match &set.measured {
                Measured::KnownPlane(plane) => (*plane, Vec::new(), &[]),
                Measured::UnknownPlane(groups) => {
                    let planes =
                        (0..groups.names.len()).map_while(|g| match assembly.plane(k, g) {
                            PlaneVar::Plane(plane) => Some(*plane),
                            PlaneVar::Coordinates(..) => None,
                        });
                    (none, planes.collect(), &groups.of_row)
                }
                _ => continue,
            };
            let robot = &arms[set.robot].robot;
            let unit = |kind| {
                if kind == JointKind::Prismatic {
                    length
                } else {
                    1.0
                }
            };
            let mut touches = Self {
                robot,
                q: &set.q,
                planes,
                of_row,
                known,
                parameters: assembly.robot(set.robot),
                target: set
                    .target
                    .as_ref()
                    .and_then(|name| assembly.target(set.robot, name)),
                first: assembly.problem.block_rows(k).start,
                units: robot.joints().iter().map(|j| unit(j.kind)).collect(),
                order: (0..robot.parameters().len())
                    .map(|p| place(robot, p))
                    .collect(),
                mean: 0.0,
            };
            let mut regressor = Regressor::default();
            let squares: f64 = (0..set.len())
                .map(|row| touches.slope(row, x, &mut regressor).1)
                .sum();
            touches.mean = (squares / set.len().max(1) as f64).sqrt();
            if touches.mean > 0.0 {
                all.push(touches);
            }
        }
        all
    }

    fn plane(&self, row: usize, x: &Values) -> Plane<f64> {
        match self.of_row.get(row) {
            Some(group) => x.get(self.planes[*group]),
            None => self.known,
        }
    }

    /// The tool point of a touch, and h².
    fn slope(&self, row: usize, x: &Values, regressor: &mut Regressor) -> (Vector3<f64>, f64) {
        let q = &self.q[row];
        FrameWise.regressor(self.robot, x.raw(self.parameters), q, regressor);
        let target = self.target.map_or_else(Vector3::zeros, |var| x.get(var));
        let tip = regressor.tool.apply(&target);
        let normal = self.plane(row, x).normal;
        let joints = self.robot.joints().iter().zip(&self.units);
        let slope = |(joint, unit): (&crate::kinematics::Joint, &f64)| {
            (unit * normal.dot(&regressor.twists[joint.offset_parameter].at(&tip))).powi(2)
        };
        (tip, joints.map(slope).sum())
    }

    /// e / r, and √(h² + (f·h̄)²), for a touch.
    fn factor(&self, square: f64) -> (f64, f64) {
        let length = (square + (FLOOR * self.mean).powi(2)).sqrt();
        (self.mean / length, length)
    }

    /// Turns residuals r into e.
    fn residual(&self, x: &Values, r: &mut [f64]) {
        let mut regressor = Regressor::default();
        for row in 0..self.q.len() {
            let (_, square) = self.slope(row, x, &mut regressor);
            r[self.first + row] *= self.factor(square).0;
        }
    }

    /// Turns r and J into e and ∂e = h̄/H · ∂r − r · h̄/H³ · ½∂(h²), with
    /// ½∂(h²)/∂b = Σₖ (n·uₖ) ∂(n·uₖ)/∂b over the joints k, uₖ the velocity of the tool point.
    ///
    /// The velocity uₖ moves with parameter b by ω × u, ω that of the one nearer to the base and u that
    /// of the other; with the tool point by ωₖ × R; with the plane by ∂n.
    fn linearize(
        &self,
        x: &Values,
        lin: &mut Linearization,
        entry: &dyn Fn(usize, usize) -> usize,
    ) {
        let mut regressor = Regressor::default();
        // (n·uₖ) n, uₖ and k, for every joint.
        let mut joints: Vec<(Vector3<f64>, Vector3<f64>, usize)> = Vec::new();
        let first = self.parameters.column();
        for row in 0..self.q.len() {
            let (tip, square) = self.slope(row, x, &mut regressor);
            let (factor, length) = self.factor(square);
            let at = self.first + row;
            let r = lin.residual[at];
            let normal = self.plane(row, x).normal;
            joints.clear();
            joints.extend(
                self.robot
                    .joints()
                    .iter()
                    .zip(&self.units)
                    .map(|(joint, unit)| {
                        let k = joint.offset_parameter;
                        let u = regressor.twists[k].at(&tip);
                        (normal * (unit * unit * normal.dot(&u)), u, k)
                    }),
            );
            let bend = r * factor / (length * length);
            let mut put = |column: usize, half: f64| {
                let value = &mut lin.values[entry(column, at)];
                *value = *value * factor - bend * half;
            };
            for (b, twist) in regressor.twists.iter().enumerate() {
                let u = twist.at(&tip);
                let half: f64 = joints
                    .iter()
                    .map(|(weight, own, k)| {
                        weight.dot(&if self.order[b] < self.order[*k] {
                            twist.angular.cross(own)
                        } else {
                            regressor.twists[*k].angular.cross(&u)
                        })
                    })
                    .sum();
                put(first + b, half);
            }
            if let Some(target) = self.target {
                for c in 0..3 {
                    let axis = regressor.tool.rotation.column(c);
                    let half = |(weight, _, k): &(Vector3<f64>, Vector3<f64>, usize)| {
                        weight.dot(&regressor.twists[*k].angular.cross(&axis))
                    };
                    put(target.column() + c, joints.iter().map(half).sum());
                }
            }
            if let Some(group) = self.of_row.get(row) {
                let plane = self.planes[*group];
                let turned = normal_by_tangent(x.raw(plane));
                for c in 0..3 {
                    let by = match c {
                        2 => 0.0,
                        _ => joints
                            .iter()
                            .map(|(weight, u, _)| weight.dot(&normal) * u.dot(&turned.column(c)))
                            .sum(),
                    };
                    put(plane.column() + c, by);
                }
            }
            lin.residual[at] *= factor;
        }
    }
}

/// ∂n/∂δ of a plane's normal by its two tilts, at δ = 0.
fn normal_by_tangent(stored: &[f64]) -> Matrix3x2<f64> {
    let (_, jacobian) = autodiff::small::<3, 3>(&[0.0; 3], |delta, out| {
        let mut moved = [delta[0]; 4];
        Plane3::plus(stored, delta, &mut moved);
        out.copy_from_slice(Plane3::view(&moved).normal.as_slice());
    });
    jacobian.fixed_columns::<2>(0).into_owned()
}

/// Place of a parameter's motion in the chain, from the base on.
fn place(robot: &Robot, parameter: usize) -> usize {
    let p = &robot.parameters()[parameter];
    let modified = robot.convention() == Convention::KhalilKleinfinger;
    let within = match (p.kind, modified) {
        (ParameterKind::Beta, true) => 0,
        (ParameterKind::Alpha, true) => 1,
        (ParameterKind::LengthX, true) => 2,
        // A joint moves about or along the axis of its frame's θ and r, which commute.
        (ParameterKind::Theta | ParameterKind::LengthZ | ParameterKind::Gain, true) => 3,
        (ParameterKind::Theta | ParameterKind::LengthZ | ParameterKind::Gain, false) => 0,
        (ParameterKind::LengthX, false) => 1,
        (ParameterKind::Alpha, false) => 2,
        (ParameterKind::Beta, false) => 3,
    };
    p.frame * 4 + within
}

/// A parameter drawn to a place: the row weight · (x − centre).
#[derive(Debug, Clone, Copy)]
pub(super) struct Pull {
    /// The variable of the robot.
    pub robot: Var<Vector>,
    /// The parameter.
    pub parameter: usize,
    /// Where it is drawn to.
    pub center: f64,
    /// How strongly.
    pub weight: f64,
}

/// A problem with touches in joint space and some parameters drawn to a place, one more row each.
pub(super) struct Tempered<'a> {
    base: &'a Problem,
    touches: &'a [Touches<'a>],
    /// What is drawn where.
    pub pulls: Vec<Pull>,
    structure: Arc<Structure>,
    inner: RefCell<Linearization>,
}

impl<'a> Tempered<'a> {
    pub fn new(base: &'a Problem, touches: &'a [Touches<'a>], pulls: Vec<Pull>) -> Self {
        let own = LeastSquares::structure(base);
        let (mut starts, mut rows) = (vec![0], Vec::new());
        for column in 0..own.cols() {
            let range = own.column_starts[column]..own.column_starts[column + 1];
            rows.extend_from_slice(&own.row_indices[range]);
            let pulled = |p: &Pull| p.robot.column() + p.parameter == column;
            if let Some(k) = pulls.iter().position(pulled) {
                rows.push(own.rows + k);
            }
            starts.push(rows.len());
        }
        let structure = Arc::new(Structure {
            rows: own.rows + pulls.len(),
            column_starts: starts,
            row_indices: rows,
        });
        Self {
            base,
            touches,
            pulls,
            structure,
            inner: RefCell::new(Linearization::new(own)),
        }
    }

    /// The part of the cost that the pulls have.
    pub fn pulled(&self, x: &Values) -> f64 {
        let row = |p: &Pull| p.weight * (x.raw(p.robot)[p.parameter] - p.center);
        self.pulls.iter().map(|p| 0.5 * row(p).powi(2)).sum()
    }

    fn tail(&self, x: &Values, r: &mut [f64]) {
        for (r, p) in r.iter_mut().zip(&self.pulls) {
            *r = p.weight * (x.raw(p.robot)[p.parameter] - p.center);
        }
    }
}

impl LeastSquares for Tempered<'_> {
    type Point = Values;

    fn structure(&self) -> Arc<Structure> {
        self.structure.clone()
    }

    fn residual(&self, x: &Values, r: &mut [f64]) -> f64 {
        let rows = self.base.rows();
        self.base.residual(x, &mut r[..rows]);
        for touches in self.touches {
            touches.residual(x, r);
        }
        self.tail(x, &mut r[rows..]);
        0.5 * r.iter().map(|r| r * r).sum::<f64>()
    }

    fn linearize(&self, x: &Values, lin: &mut Linearization) {
        let mut inner = self.inner.borrow_mut();
        self.base.linearize(x, &mut inner);
        let own = inner.structure.clone();
        // The place of an entry: rows ascend in every column.
        let entry = |column: usize, row: usize| {
            let start = own.column_starts[column];
            let rows = &own.row_indices[start..own.column_starts[column + 1]];
            start + rows.partition_point(|r| *r < row)
        };
        for touches in self.touches {
            touches.linearize(x, &mut inner, &entry);
        }
        let rows = own.rows;
        lin.residual[..rows].copy_from_slice(&inner.residual);
        self.tail(x, &mut lin.residual[rows..]);
        lin.cost = 0.5 * lin.residual.iter().map(|r| r * r).sum::<f64>();
        for column in 0..own.cols() {
            let from = own.column_starts[column]..own.column_starts[column + 1];
            let to = self.structure.column_starts[column];
            lin.values[to..to + from.len()].copy_from_slice(&inner.values[from]);
        }
        for p in &self.pulls {
            let last = self.structure.column_starts[p.robot.column() + p.parameter + 1] - 1;
            lin.values[last] = p.weight;
        }
    }

    fn plus(&self, x: &Values, delta: &[f64]) -> Values {
        LeastSquares::plus(self.base, x, delta)
    }

    fn norm(&self, x: &Values) -> f64 {
        LeastSquares::norm(self.base, x)
    }

    fn sizes(&self, x: &Values) -> Vec<f64> {
        self.base.sizes(x)
    }

    fn free(&self) -> Vec<usize> {
        LeastSquares::free(self.base)
    }

    fn step_bounds(&self, x: &Values) -> Option<StepBounds> {
        self.base.step_bounds(x)
    }

    fn describe_row(&self, row: usize) -> String {
        if row < self.base.rows() {
            self.base.describe_row(row)
        } else {
            format!("pull {}", row - self.base.rows())
        }
    }

    fn describe_column(&self, column: usize) -> String {
        self.base.describe_column(column)
    }

    fn describe_limit(&self, row: usize) -> String {
        self.base.describe_limit(row)
    }

    fn feasible(&self, x: &Values) -> Result<Values, Error> {
        self.base.feasible(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::{Groups, Owner, State, start};
    use crate::constraint::Derivatives;
    use crate::file::RobotFile;
    use truing::check;

    const MODIFIED: &str = r#"
convention = "khalil-kleinfinger"
base = { theta = 0.3, r = 0.4 }
tool = { alpha = 0.3, d = 0.12, theta = 0.4, r = 0.08 }
joint = [
    { type = "revolute", alpha = 0.2, d = 0.15, theta = 0.1, r = 0.25 },
    { type = "revolute", alpha = -1.57, r = 0.2435 },
    { type = "revolute", d = 0.4318, r = -0.0934 },
    { type = "prismatic", alpha = 1.57, d = -0.0203, r = 0.4331 },
    { type = "revolute", alpha = 1.5, d = 0.03, gain = -1.0 },
]
"#;

    const DISTAL: &str = r#"
convention = "denavit-hartenberg"
base = { theta = -0.2, d = 0.3, a = 0.7, alpha = 0.1 }
tool = { theta = 0.5, d = 0.1, a = 0.05, alpha = -0.2 }
joint = [
    { type = "revolute", theta = 0.2, d = 0.5, alpha = -1.57 },
    { type = "revolute", d = 0.1, a = 0.43 },
    { type = "prismatic", theta = -0.1, d = 0.3, a = -0.02, alpha = 1.57 },
    { type = "revolute", d = 0.2, alpha = 0.6 },
]
"#;

    /// Central differences are good to about ten digits of the largest entries.
    #[test]
    fn the_jacobian_is_that_of_the_residual() {
        for text in [MODIFIED, DISTAL] {
            let robot = Robot::new(&RobotFile::parse(text, "robot.toml").unwrap());
            let n = robot.joints().len();
            let q: Vec<Vec<f64>> = (0..20)
                .map(|k| (0..n).map(|j| (1.7 * (k * n + j) as f64).sin()).collect())
                .collect();
            let groups = Groups::by_label((0..20).map(|k| (k % 2).to_string()));
            let known = Plane {
                normal: Vector3::new(0.3, -0.5, 0.8).normalize(),
                distance: 0.2,
            };
            let positions = q.iter().map(|_| Vector3::new(0.1, 0.2, 0.3)).collect();
            let arms = [Arm::only(robot)];
            let sets = [
                MeasurementSet::new("unknown", 0, q.clone(), Measured::UnknownPlane(groups))
                    .target("tip"),
                MeasurementSet::new("known", 0, q.clone(), Measured::KnownPlane(known)),
                MeasurementSet::new("seen", 0, q, Measured::Position(positions)),
            ];
            let mut known = State::default();
            known
                .targets
                .insert((0, "tip".into()), Vector3::new(0.1, -0.2, 0.15));
            let nominal = arms[0].robot.nominal();
            let state = start(&arms, &sets, vec![nominal], &known);
            let assembly = Assembly::new(&arms, &sets, &state, &Derivatives::default()).unwrap();
            let x = assembly.problem.initial();
            let touches = Touches::of(&arms, &sets, &assembly, x, 0.7);
            assert_eq!(touches.len(), 2);
            let pulls = (0..4)
                .map(|parameter| Pull {
                    robot: assembly.robot(0),
                    parameter,
                    center: 0.1,
                    weight: 3.0,
                })
                .collect();
            let tempered = Tempered::new(&assembly.problem, &touches, pulls);
            for worst in check::jacobian(&tempered, x) {
                let (a, b) = worst.entries;
                let held = assembly.columns[worst.column].owner == Owner::Constant;
                // Rows are weighted by a sigma of 0.1 mm: entries are of size 1e4.
                assert!(held || (a - b).abs() < 1e-4, "{worst:?}");
            }
            let mut r = vec![0.0; LeastSquares::structure(&tempered).rows];
            let mut lin = Linearization::new(LeastSquares::structure(&tempered));
            let cost = tempered.residual(x, &mut r);
            tempered.linearize(x, &mut lin);
            assert!((cost - lin.cost).abs() < 1e-9 * cost);
            assert!(
                r.iter()
                    .zip(&lin.residual)
                    .all(|(a, b)| (a - b).abs() < 1e-9 * (1.0 + a.abs()))
            );
        }
    }
}
