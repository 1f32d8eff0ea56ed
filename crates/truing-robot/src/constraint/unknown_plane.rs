//! A touch of the tool point on a plane that is estimated.

use super::{Chain, reference_or_regressor, regressor_at, write_block, write_tip};
use std::sync::Arc;
use truing::manifold::{Plane3, Point3, Vector};
use truing::nalgebra::{SMatrix, Vector3};
use truing::{Constraint, Jacobian, Point, Scalar, Variable, Views, autodiff};

/// A tool point on an unknown plane: r = normal · p − distance \[m\], p = base_from_tool · target.
///
/// Variables: robot parameters, the target in the tool frame, the plane. One row.
#[derive(Clone)]
pub struct UnknownPlane {
    /// The robot.
    pub chain: Arc<Chain>,
    /// Joint values.
    pub q: Vec<f64>,
}

impl Constraint for UnknownPlane {
    type Vars = (Vector, Point3, Plane3);
    const DIM: usize = 1;

    fn residual<T: Scalar>(&self, (robot, target, plane): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = plane.signed_distance(&self.chain.tip(robot, &self.q, &target));
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, target, _) = at.views();
        let stored = at.raw(2);
        let regressor = regressor_at(at, source, &self.chain, parameters, &self.q);
        let tip = regressor.tool.apply(&target);
        let (value, gradient): ([f64; 1], SMatrix<f64, 1, 6>) =
            autodiff::small(&[tip.x, tip.y, tip.z, 0.0, 0.0, 0.0], |x, out| {
                let mut moved = [x[0]; 4];
                Plane3::plus(stored, &x[3..6], &mut moved);
                out[0] = Plane3::view(&moved).signed_distance(&Vector3::new(x[0], x[1], x[2]));
            });
        r.copy_from_slice(&value);
        write_tip(
            j,
            0,
            1,
            regressor,
            &tip,
            &gradient.fixed_columns::<3>(0).into_owned(),
        );
        write_block(j, 2, &gradient.fixed_columns::<3>(3).into_owned());
    }
}
