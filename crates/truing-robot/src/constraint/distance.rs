//! The distance between two tool points: two arms touching, or one robot in two postures.

use super::{Chain, reference_or_regressor, write_block, write_tip};
use crate::kinematics::Regressor;
use std::sync::Arc;
use truing::manifold::{Point3, Vector};
use truing::nalgebra::{SMatrix, Vector3};
use truing::{Constraint, Jacobian, Point, Scalar, Views, autodiff, value};

/// The distance between tool points of two robots: r = ‖p_a − p_b‖ − distance \[m\].
///
/// Variables: parameters and target of robot a, those of robot b, and the distance as a vector of
/// one number (hold it where it is known). One row. Two spheres that touch are at the sum of their
/// radii.
#[derive(Clone)]
pub struct Distance {
    /// Robot a.
    pub a: Arc<Chain>,
    /// Robot b.
    pub b: Arc<Chain>,
    /// Joint values of robot a.
    pub q_a: Vec<f64>,
    /// Joint values of robot b.
    pub q_b: Vec<f64>,
}

/// ‖v‖, with derivative zero instead of none where the points coincide.
fn norm<T: Scalar>(v: &Vector3<T>) -> T {
    let square = v.x * v.x + v.y * v.y + v.z * v.z;
    if value(square) == 0.0 {
        T::zero()
    } else {
        square.sqrt()
    }
}

/// ‖a − b‖ − d with its gradient (1 × 7) in a, b and d.
fn gradient_of(a: &Vector3<f64>, b: &Vector3<f64>, d: f64) -> ([f64; 1], SMatrix<f64, 1, 7>) {
    autodiff::small(&[a.x, a.y, a.z, b.x, b.y, b.z, d], |x, out| {
        out[0] = norm(&(Vector3::new(x[0], x[1], x[2]) - Vector3::new(x[3], x[4], x[5]))) - x[6];
    })
}

#[derive(Default)]
struct Pair {
    a: Regressor,
    b: Regressor,
}

impl Constraint for Distance {
    type Vars = (Vector, Point3, Vector, Point3, Vector);
    const DIM: usize = 1;

    fn residual<T: Scalar>(&self, (a, target_a, b, target_b, d): Views<'_, Self, T>, r: &mut [T]) {
        let between = self.a.tip(a, &self.q_a, &target_a) - self.b.tip(b, &self.q_b, &target_b);
        r[0] = norm(&between) - d[0];
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.a, at, r, j) else {
            return;
        };
        let (a, target_a, b, target_b, d) = at.views();
        let pair = at.memory::<Pair>();
        source.regressor(&self.a.robot, a, &self.q_a, &mut pair.a);
        source.regressor(&self.b.robot, b, &self.q_b, &mut pair.b);
        let (tip_a, tip_b) = (pair.a.tool.apply(&target_a), pair.b.tool.apply(&target_b));
        let (value, gradient) = gradient_of(&tip_a, &tip_b, d[0]);
        r.copy_from_slice(&value);
        write_tip(
            j,
            0,
            1,
            &pair.a,
            &tip_a,
            &gradient.fixed_columns::<3>(0).into_owned(),
        );
        write_tip(
            j,
            2,
            3,
            &pair.b,
            &tip_b,
            &gradient.fixed_columns::<3>(3).into_owned(),
        );
        write_block(j, 4, &gradient.fixed_columns::<1>(6).into_owned());
    }
}

/// The distance between a tool point in two postures of one robot: r = ‖p(q_a) − p(q_b)‖ − distance \[m\].
///
/// Variables: robot parameters, the target in the tool frame, the distance as a vector of one
/// number. One row. A ball bar or a gauge block gives such data.
#[derive(Clone)]
pub struct PostureDistance {
    /// The robot.
    pub chain: Arc<Chain>,
    /// Joint values of the first posture.
    pub q_a: Vec<f64>,
    /// Joint values of the second posture.
    pub q_b: Vec<f64>,
}

impl Constraint for PostureDistance {
    type Vars = (Vector, Point3, Vector);
    const DIM: usize = 1;

    fn residual<T: Scalar>(&self, (robot, target, d): Views<'_, Self, T>, r: &mut [T]) {
        let between =
            self.chain.tip(robot, &self.q_a, &target) - self.chain.tip(robot, &self.q_b, &target);
        r[0] = norm(&between) - d[0];
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, target, d) = at.views();
        let pair = at.memory::<Pair>();
        source.regressor(&self.chain.robot, parameters, &self.q_a, &mut pair.a);
        source.regressor(&self.chain.robot, parameters, &self.q_b, &mut pair.b);
        let (tip_a, tip_b) = (pair.a.tool.apply(&target), pair.b.tool.apply(&target));
        let (value, gradient) = gradient_of(&tip_a, &tip_b, d[0]);
        r.copy_from_slice(&value);
        let by_a = gradient.fixed_columns::<3>(0).into_owned();
        let by_b = gradient.fixed_columns::<3>(3).into_owned();
        let twists = pair.a.twists.iter().zip(&pair.b.twists);
        for (entry, (a, b)) in j.block_mut(0).iter_mut().zip(twists) {
            *entry = (by_a * a.at(&tip_a) + by_b * b.at(&tip_b))[0];
        }
        write_block(
            j,
            1,
            &(by_a * pair.a.tool.rotation + by_b * pair.b.tool.rotation),
        );
        write_block(j, 2, &gradient.fixed_columns::<1>(6).into_owned());
    }
}
