//! The same point, reached in different postures.

use super::{Chain, reference_or_regressor, regressor_at, write_block, write_tip};
use std::sync::Arc;
use truing::manifold::{Point3, Vector};
use truing::nalgebra::{SMatrix, Vector3};
use truing::{Constraint, Jacobian, Point, Scalar, Views, autodiff};

/// A tool point at a point of space that is estimated: r = base_from_tool · target − point \[m\].
///
/// Variables: robot parameters, the target in the tool frame, the point. Three rows. All rows that
/// touched the same point share its variable ("position link", no external sensor).
#[derive(Clone)]
pub struct SamePoint {
    /// The robot.
    pub chain: Arc<Chain>,
    /// Joint values.
    pub q: Vec<f64>,
}

impl Constraint for SamePoint {
    type Vars = (Vector, Point3, Point3);
    const DIM: usize = 3;

    fn residual<T: Scalar>(&self, (robot, target, point): Views<'_, Self, T>, r: &mut [T]) {
        let tip = self.chain.tip(robot, &self.q, &target);
        for i in 0..3 {
            r[i] = tip[i] - point[i];
        }
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, target, point) = at.views();
        let regressor = regressor_at(at, source, &self.chain, parameters, &self.q);
        let tip = regressor.tool.apply(&target);
        let inputs = [tip.x, tip.y, tip.z, point.x, point.y, point.z];
        let (value, gradient): ([f64; 3], SMatrix<f64, 3, 6>) =
            autodiff::small(&inputs, |x, out| {
                let difference = Vector3::new(x[0], x[1], x[2]) - Vector3::new(x[3], x[4], x[5]);
                out.copy_from_slice(difference.as_slice());
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
