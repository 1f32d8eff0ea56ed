//! A touch of the tool point on a plane that is known.

use super::{Chain, reference_or_regressor, regressor_at, write_tip};
use std::sync::Arc;
use truing::manifold::{Plane, Point3, Vector};
use truing::nalgebra::{SMatrix, Vector3};
use truing::{Constraint, Jacobian, Point, Scalar, Views, autodiff};

/// A tool point on a known plane: r = normal · p − distance \[m\], p = base_from_tool · target.
///
/// Variables: robot parameters, the target in the tool frame. One row.
#[derive(Clone)]
pub struct KnownPlane {
    /// The robot.
    pub chain: Arc<Chain>,
    /// Joint values.
    pub q: Vec<f64>,
    /// The plane in the reference frame, its normal of unit length.
    pub plane: Plane<f64>,
}

fn model<T: Scalar>(tip: &Vector3<T>, plane: &Plane<f64>, r: &mut [T]) {
    let lifted = Plane {
        normal: plane.normal.map(T::from),
        distance: T::from(plane.distance),
    };
    r[0] = lifted.signed_distance(tip);
}

impl Constraint for KnownPlane {
    type Vars = (Vector, Point3);
    const DIM: usize = 1;

    fn residual<T: Scalar>(&self, (robot, target): Views<'_, Self, T>, r: &mut [T]) {
        model(&self.chain.tip(robot, &self.q, &target), &self.plane, r);
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, target) = at.views();
        let regressor = regressor_at(at, source, &self.chain, parameters, &self.q);
        let tip = regressor.tool.apply(&target);
        let (value, gradient): ([f64; 1], SMatrix<f64, 1, 3>) =
            autodiff::small(&[tip.x, tip.y, tip.z], |x, out| {
                model(&Vector3::from(*x), &self.plane, out)
            });
        r.copy_from_slice(&value);
        write_tip(j, 0, 1, regressor, &tip, &gradient);
    }
}
