//! Vector products of points in one plane, reference 9 of the paper.

use std::sync::Arc;
use truing::manifold::{Point3, Vector};
use truing::nalgebra::Vector3;
use truing::{Constraint, Jacobian, Point, Scalar, Views};
use truing_robot::Error;
use truing_robot::measurement::Equations;
use truing_robot::robot::chain::reference_or_regressor;
use truing_robot::robot::{Chain, Regressor};

/// Four touches of one plane: the vector product of two of its normals is zero.
///
/// With u = P₂ − P₁, v = P₃ − P₁ and w = P₄ − P₁, the normals u × v and v × w of the plane are
/// parallel, (u × v) × (v × w) = v · ((u × v) · w) = 0, and as v is not zero, (u × v) · w = 0. The row
/// is that product over `area`, the length of u × v at the start: the height of P₄ above the other
/// three \[m\].
///
/// Variables: robot parameters, the target in the tool frame. One row; the plane is eliminated.
/// Unlike the original, no term of second order is neglected. The noise of a row is taken for that of
/// its fourth touch; the three that all rows of a plane share have theirs too, so σ₀ comes out above one
/// and standard deviations are approximate: Truing's own `unknown-plane` estimates the plane instead.
#[derive(Clone)]
pub struct VectorProducts {
    /// The robot.
    pub chain: Arc<Chain>,
    /// Joint values of the four touches.
    pub q: [Vec<f64>; 4],
    /// What the product is divided by \[m²\].
    pub area: f64,
}

/// (u × v) · w / area.
fn height<T: Scalar>(tips: &[Vector3<T>; 4], area: f64) -> T {
    let [u, v, w] = [1, 2, 3].map(|k| tips[k] - tips[0]);
    let normal = Vector3::new(
        u.y * v.z - u.z * v.y,
        u.z * v.x - u.x * v.z,
        u.x * v.y - u.y * v.x,
    );
    (normal.x * w.x + normal.y * w.y + normal.z * w.z) / T::from(area)
}

#[derive(Default)]
struct Four([Regressor; 4]);

impl Constraint for VectorProducts {
    type Vars = (Vector, Point3);
    const DIM: usize = 1;

    fn residual<T: Scalar>(&self, (robot, target): Views<'_, Self, T>, r: &mut [T]) {
        let tips = std::array::from_fn(|k| self.chain.tip(robot, &self.q[k], &target));
        r[0] = height(&tips, self.area);
    }

    /// ∂/∂P₂ = v × w, ∂/∂P₃ = w × u, ∂/∂P₄ = u × v, and ∂/∂P₁ minus their sum.
    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, target) = at.views();
        let Four(regressors) = at.memory::<Four>();
        for (regressor, q) in regressors.iter_mut().zip(&self.q) {
            source.regressor(&self.chain.robot, parameters, q, regressor);
        }
        let tips: [Vector3<f64>; 4] = std::array::from_fn(|k| regressors[k].tool.apply(&target));
        r[0] = height(&tips, self.area);
        let [u, v, w] = [1, 2, 3].map(|k| tips[k] - tips[0]);
        let by = [v.cross(&w), w.cross(&u), u.cross(&v)].map(|g| g / self.area);
        let gradients = [-(by[0] + by[1] + by[2]), by[0], by[1], by[2]];
        for (column, entry) in j.block_mut(0).iter_mut().enumerate() {
            *entry = (0..4)
                .map(|k| gradients[k].dot(&regressors[k].twists[column].at(&tips[k])))
                .sum();
        }
        let by_target: Vector3<f64> = (0..4)
            .map(|k| regressors[k].tool.rotation.transpose() * gradients[k])
            .sum();
        j.block_mut(1).copy_from_slice(by_target.as_slice());
    }
}

/// Three touches that span a plane well, and the length of the vector product between them: the two
/// that are farthest from the middle and from each other, and the one farthest from their line.
fn widest(tips: &[Vector3<f64>]) -> Option<([usize; 3], f64)> {
    let farthest = |size: &dyn Fn(&Vector3<f64>) -> f64| {
        (0..tips.len()).max_by(|a, b| size(&tips[*a]).total_cmp(&size(&tips[*b])))
    };
    let middle = tips.iter().sum::<Vector3<f64>>() / tips.len().max(1) as f64;
    let a = farthest(&|p| (p - middle).norm())?;
    let b = farthest(&|p| (p - tips[a]).norm())?;
    let along = tips[b] - tips[a];
    let c = farthest(&|p| along.cross(&(p - tips[a])).norm())?;
    let area = along.cross(&(tips[c] - tips[a])).norm();
    (area > 0.0 && area.is_finite()).then_some(([a, b, c], area))
}

pub(crate) fn add(on: &mut Equations<'_>) -> Result<(), Error> {
    let tool = on.tools[0].clone();
    let point = tool.point();
    let robot = on.problem.initial().get(tool.robot);
    let target = on.problem.initial().get(point);
    let readings = on.readings;
    let mut constraints = Vec::new();
    for (g, name) in readings.groups.names.iter().enumerate() {
        let rows: Vec<usize> = readings.groups.rows(g).collect();
        let tips: Vec<Vector3<f64>> = rows
            .iter()
            .map(|row| tool.chain.tip(&robot, &readings.q()[*row], &target))
            .collect();
        let Some(([a, b, c], area)) = widest(&tips) else {
            return Err(Error::Calibration {
                message: format!(
                    "`{}`: the touches of plane `{name}` lie in one line",
                    readings.name
                ),
                help: "touch the plane at places that span it, or leave it out with `rows`".into(),
            });
        };
        for (k, row) in rows.iter().enumerate() {
            if [a, b, c].contains(&k) {
                continue;
            }
            let constraint = VectorProducts {
                chain: tool.chain.clone(),
                q: [a, b, c, k].map(|k| on.q(0, rows[k])),
                area,
            };
            constraints.push(Ok(((tool.robot, point), constraint, on.noise(*row)?)));
        }
    }
    let block = on.block(constraints.into_iter())?;
    on.problem.add_block(block);
    Ok(())
}
