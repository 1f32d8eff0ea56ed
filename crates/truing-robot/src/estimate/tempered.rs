//! A calibration's problem, tempered: touches measured in joint space, parameters drawn to a centre.

use super::touches::Touches;
use std::cell::RefCell;
use std::sync::Arc;
use truing::manifold::Vector;
use truing::{Error, LeastSquares, Linearization, Problem, StepBounds, Structure, Values, Var};

/// A parameter drawn to a place: the row weight · (x − centre).
#[derive(Debug, Clone, Copy)]
pub struct Pull {
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
pub struct Tempered<'a> {
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
    use crate::measurement::kinds;
    use crate::model::{Assembly, Owner};
    use crate::robot::{Arm, Derivatives, Robot, RobotFile};
    use crate::start::start;
    use crate::unknown::State;
    use truing::check;
    use truing::manifold::Plane;
    use truing::nalgebra::Vector3;

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
            let known = Plane {
                normal: Vector3::new(0.3, -0.5, 0.8).normalize(),
                distance: 0.2,
            };
            let positions = vec![Vector3::new(0.1, 0.2, 0.3); q.len()];
            let planes = (0..20).map(|k| (k % 2).to_string());
            let arms = [Arm::only(robot)];
            let sets = [
                kinds::unknown_plane("unknown", q.clone(), planes).target("tip"),
                kinds::known_plane("known", q.clone(), known),
                kinds::position("seen", q, &positions),
            ];
            let mut known = State::default();
            known.set_target(0, "tip", Vector3::new(0.1, -0.2, 0.15));
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
