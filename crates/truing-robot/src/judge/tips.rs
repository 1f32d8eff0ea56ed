//! Tool points at postures, and how parameters and rigid motions move them.

use super::errors::Fitted;
use crate::model::{Assembly, Owner};
use crate::robot::{DifferentiateChain, FrameWise, Regressor, Robot};
use truing::nalgebra::{DMatrix, Vector3};

/// Tool points of a robot: of the estimated robot, of the nominal one, the derivatives of
/// the first by some columns (3 × points, columns), and by the tool point if that is estimated too
/// (3 × points, 3).
pub(super) struct Tips {
    pub estimated: Vec<Vector3<f64>>,
    pub nominal: Vec<Vector3<f64>>,
    pub derivatives: DMatrix<f64>,
    pub by_point: Option<DMatrix<f64>>,
}

/// The tool points of a robot at postures.
pub(super) fn tips(
    chain: &Robot,
    postures: &[Vec<f64>],
    target: Option<&String>,
    fitted: &Fitted,
    assembly: &Assembly,
    columns: &[usize],
    robot: usize,
) -> Tips {
    let (estimated, nominal) = (&fitted.estimated, &fitted.nominal);
    let mut regressor = Regressor::default();
    // The point on the tool is that of the estimate for both robots.
    let point = target
        .and_then(|name| estimated.target(robot, name))
        .unwrap_or_default();
    let (mut tips, mut before, mut rows) = (Vec::new(), Vec::new(), Vec::new());
    let mut turns = Vec::new();
    for q in postures {
        FrameWise.regressor(chain, &estimated.robots[robot], q, &mut regressor);
        let tip = regressor.tool.apply(&point);
        rows.extend(
            columns
                .iter()
                .map(|column| match &assembly.columns[*column].owner {
                    Owner::Parameter { parameter, .. } => regressor.twists[*parameter].at(&tip),
                    _ => Vector3::zeros(),
                }),
        );
        tips.push(tip);
        turns.push(regressor.tool.rotation);
        before.push(chain.forward(&nominal.robots[robot], q).apply(&point));
    }
    let derivatives = DMatrix::from_fn(3 * tips.len(), columns.len(), |row, column| {
        rows[row / 3 * columns.len() + column][row % 3]
    });
    let by_point = target.is_some().then(|| {
        DMatrix::from_fn(3 * tips.len(), 3, |row, axis| {
            turns[row / 3][(row % 3, axis)]
        })
    });
    Tips {
        estimated: tips,
        nominal: before,
        derivatives,
        by_point,
    }
}

/// Velocities of tool points in the rigid motions of space, in its growth if asked for, and in moves
/// of the point on the tool if that is estimated; one column a motion.
pub(super) fn motions(tips: &Tips, scaled: bool) -> DMatrix<f64> {
    let points = &tips.estimated;
    let center = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
    let of_space = if scaled { 7 } else { 6 };
    let count = of_space + tips.by_point.as_ref().map_or(0, DMatrix::ncols);
    DMatrix::from_fn(3 * points.len(), count, |row, motion| {
        if let (Some(axis), Some(by_point)) = (motion.checked_sub(of_space), &tips.by_point) {
            return by_point[(row, axis)];
        }
        let p = points[row / 3] - center;
        let velocity = match motion {
            0..3 => Vector3::ith(motion, 1.0),
            3..6 => Vector3::ith(motion - 3, 1.0).cross(&p),
            _ => p,
        };
        velocity[row % 3]
    })
}

/// What is left of columns after projection onto others.
pub(super) fn without(others: &DMatrix<f64>, columns: &DMatrix<f64>) -> DMatrix<f64> {
    let svd = others.clone().svd(true, false);
    let Some(u) = svd.u else {
        return columns.clone();
    };
    let largest = svd.singular_values.max();
    let mut left = columns.clone();
    for (k, value) in svd.singular_values.iter().enumerate() {
        if *value > 1e-9 * largest {
            let direction = u.column(k);
            let along = direction.transpose() * &left;
            left -= direction * along;
        }
    }
    left
}
