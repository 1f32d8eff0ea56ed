//! Position link and frame link, reference 7 of the paper: the same point, or the same location,
//! reached in different configurations, without any external sensor.

use crate::classical::{orientation_error, orientation_error_by_turn};
use std::sync::Arc;
use truing::manifold::{Point3, Vector};
use truing::nalgebra::SMatrix;
use truing::{Constraint, Jacobian, Noise, Point, Scalar, Views};
use truing_robot::Error;
use truing_robot::measurement::{Equations, Groups};
use truing_robot::robot::chain::{reference_or_regressor, write_block};
use truing_robot::robot::{Chain, Regressor};

/// The same point in two configurations: r = P(q_b) − P(q_a) \[m\].
///
/// Variables: robot parameters, the target in the tool frame. Three rows; the point itself is
/// eliminated.
#[derive(Clone)]
pub struct PositionLink {
    /// The robot.
    pub chain: Arc<Chain>,
    /// Joint values of the first configuration.
    pub q_a: Vec<f64>,
    /// Joint values of the second configuration.
    pub q_b: Vec<f64>,
}

#[derive(Default)]
struct Pair {
    a: Regressor,
    b: Regressor,
}

impl Constraint for PositionLink {
    type Vars = (Vector, Point3);
    const DIM: usize = 3;

    fn residual<T: Scalar>(&self, (robot, target): Views<'_, Self, T>, r: &mut [T]) {
        let off =
            self.chain.tip(robot, &self.q_b, &target) - self.chain.tip(robot, &self.q_a, &target);
        r.copy_from_slice(off.as_slice());
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, target) = at.views();
        let Pair { a, b } = at.memory::<Pair>();
        source.regressor(&self.chain.robot, parameters, &self.q_a, a);
        source.regressor(&self.chain.robot, parameters, &self.q_b, b);
        let (tip_a, tip_b) = (a.tool.apply(&target), b.tool.apply(&target));
        r.copy_from_slice((tip_b - tip_a).as_slice());
        let twists = a.twists.iter().zip(&b.twists);
        for (column, (a, b)) in j.block_mut(0).chunks_exact_mut(3).zip(twists) {
            column.copy_from_slice((b.at(&tip_b) - a.at(&tip_a)).as_slice());
        }
        write_block(j, 1, &(b.tool.rotation - a.tool.rotation));
    }
}

/// The same location in two configurations: position rows P(q_b) − P(q_a) \[m\], rotation rows the
/// orientation error ½ Σ aₖ × bₖ between the tool's axes \[rad\].
///
/// Variables: robot parameters, the target in the tool frame. Six rows; the location itself is
/// eliminated.
#[derive(Clone)]
pub struct FrameLink {
    /// The robot.
    pub chain: Arc<Chain>,
    /// Joint values of the first configuration.
    pub q_a: Vec<f64>,
    /// Joint values of the second configuration.
    pub q_b: Vec<f64>,
}

impl Constraint for FrameLink {
    type Vars = (Vector, Point3);
    const DIM: usize = 6;

    fn residual<T: Scalar>(&self, (robot, target): Views<'_, Self, T>, r: &mut [T]) {
        let a = self.chain.robot.forward(robot, &self.q_a);
        let b = self.chain.robot.forward(robot, &self.q_b);
        let off = b.apply(&target) - a.apply(&target);
        let turn = orientation_error(&a.rotation, &b.rotation);
        for i in 0..3 {
            r[i] = off[i];
            r[i + 3] = turn[i];
        }
    }

    /// A turn of the first frame has minus the transposed effect of a turn of the second.
    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, target) = at.views();
        let Pair { a, b } = at.memory::<Pair>();
        source.regressor(&self.chain.robot, parameters, &self.q_a, a);
        source.regressor(&self.chain.robot, parameters, &self.q_b, b);
        let (tip_a, tip_b) = (a.tool.apply(&target), b.tool.apply(&target));
        let by_b = orientation_error_by_turn(&a.tool.rotation, &b.tool.rotation);
        let by_a = by_b.transpose();
        r[..3].copy_from_slice((tip_b - tip_a).as_slice());
        r[3..].copy_from_slice(orientation_error(&a.tool.rotation, &b.tool.rotation).as_slice());
        let twists = a.twists.iter().zip(&b.twists);
        for (column, (a, b)) in j.block_mut(0).chunks_exact_mut(6).zip(twists) {
            column[..3].copy_from_slice((b.at(&tip_b) - a.at(&tip_a)).as_slice());
            column[3..].copy_from_slice((by_b * b.angular - by_a * a.angular).as_slice());
        }
        let mut by_target = SMatrix::<f64, 6, 3>::zeros();
        by_target
            .fixed_rows_mut::<3>(0)
            .copy_from(&(b.tool.rotation - a.tool.rotation));
        write_block(j, 1, &by_target);
    }
}

/// Each later visit of a group with its first one. The difference of two visits has the noise of both;
/// that all share the noise of the first is left out of account, as in the original, so standard
/// deviations come out a little too small: Truing's own `same-point` estimates the point instead.
fn pairs(groups: &Groups) -> impl Iterator<Item = (usize, usize)> + '_ {
    let first = |g: usize| groups.of_row.iter().position(|h| *h == g).unwrap_or(0);
    let rows = groups.of_row.iter().enumerate();
    rows.map(move |(row, g)| (first(*g), row))
        .filter(|(first, row)| first != row)
}

pub(crate) fn add_points(on: &mut Equations<'_>) -> Result<(), Error> {
    let tool = on.tools[0].clone();
    let sigma = |row: usize| on.readings.sigma.row(row)[0];
    let constraints = pairs(&on.readings.groups).map(|(a, b)| {
        let constraint = PositionLink {
            chain: tool.chain.clone(),
            q_a: on.q(0, a),
            q_b: on.q(0, b),
        };
        let noise = Noise::isotropic(sigma(a).hypot(sigma(b)))?;
        Ok(((tool.robot, tool.point()), constraint, noise))
    });
    let block = on.block(constraints)?;
    on.problem.add_block(block);
    Ok(())
}

pub(crate) fn add_locations(on: &mut Equations<'_>) -> Result<(), Error> {
    let tool = on.tools[0].clone();
    let sigma = |row: usize| on.readings.sigma.row(row);
    let constraints = pairs(&on.readings.groups).map(|(a, b)| {
        let constraint = FrameLink {
            chain: tool.chain.clone(),
            q_a: on.q(0, a),
            q_b: on.q(0, b),
        };
        let both = |k: usize| sigma(a)[k].hypot(sigma(b)[k]);
        let (p, r) = (both(0), both(1));
        let noise = Noise::diagonal(&[p, p, p, r, r, r])?;
        Ok(((tool.robot, tool.point()), constraint, noise))
    });
    let block = on.block(constraints)?;
    on.problem.add_block(block);
    Ok(())
}
