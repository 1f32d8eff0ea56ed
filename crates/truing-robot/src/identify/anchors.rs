//! What anchors a scale that measurements leave free.

use super::compressed::{STRUCTURE, compressed};
use super::twin::POSTURES;
use crate::error::Error;
use crate::measurement::MeasurementSet;
use crate::measurement::kinds::posture_distance;
use crate::model::{Assembly, Owner};
use crate::robot::{Arm, Derivatives, Unit, posture};
use crate::unknown::{State, Value};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use truing::identifiability::{ColumnStatus, base_columns};
use truing::nalgebra::{DMatrix, DVector};

/// The name of a set that no calibration has.
const SCALE: &str = "\0scale";

/// The columns (their places in `wanted`) that are left out only because all lengths can grow
/// together: touches of unknown planes and points look the same for a robot of any size.
///
/// All lengths scaled by 1 + ε is a direction of the tangent. If the structural Jacobian sees of it
/// at most what planes, points, frames and bases take up, the scale is free; what a known distance between
/// two postures of a robot would then bring in, a distance being blind to all else that is free, is
/// the anchor.
pub fn scale_anchors(
    arms: &[Arm],
    twin_sets: &[MeasurementSet],
    state: &State,
    twin: &Assembly,
    structure: &DMatrix<f64>,
    wanted: &[usize],
    base: &[ColumnStatus],
) -> Result<Vec<usize>, Error> {
    let direction = twin.growth(state);
    let scale = DVector::from_iterator(wanted.len(), wanted.iter().map(|c| direction[*c]));
    // Growing about another point than the origin is growing and moving: the base takes that up.
    let bases: Vec<Vec<usize>> = arms.iter().map(|arm| arm.robot.base_parameters()).collect();
    let mut columns: Vec<DVector<f64>> = (0..wanted.len())
        .filter(|k| match &twin.columns[wanted[*k]].owner {
            Owner::Parameter { robot, parameter } => bases[*robot].contains(parameter),
            Owner::Target(..) => false,
            _ => true,
        })
        .map(|k| structure.column(k).into_owned())
        .collect();
    let seen = structure * &scale;
    let sizes = (0..wanted.len()).map(|k| structure.column(k).norm() * scale[k].abs());
    let rounding = 1e-9 * sizes.sum::<f64>();
    if seen.norm() > rounding {
        columns.push(seen);
        let order: Vec<usize> = (0..columns.len()).collect();
        let status = base_columns(&DMatrix::from_columns(&columns), &order, STRUCTURE);
        if status.last() == Some(&ColumnStatus::Identifiable) {
            return Ok(Vec::new());
        }
    }
    let identifiable = |status: &ColumnStatus| *status == ColumnStatus::Identifiable;
    let order: Vec<usize> = (0..wanted.len()).collect();
    let mut anchors = Vec::new();
    for (robot, arm) in arms.iter().enumerate() {
        let mut rng = ChaCha8Rng::seed_from_u64(robot as u64);
        let limits = posture::limits(&arm.robot);
        let mut draw = || {
            (0..POSTURES)
                .map(|_| posture::random(&limits, &mut rng))
                .collect()
        };
        let (q, q_b) = (draw(), draw());
        let known = posture_distance(SCALE, q, q_b, Some(0.0)).robot(robot);
        let sets = [twin_sets, &[known]].concat();
        let mut with = state.clone();
        let zero = Value::number("distance", Unit::Meter, 0.0);
        with.set_own(SCALE, "", "distance", zero);
        let known = Assembly::new(arms, &sets, &with, &Derivatives::default())?;
        let status = base_columns(&compressed(&known, wanted), &order, STRUCTURE);
        let new: Vec<usize> = (0..wanted.len())
            .filter(|k| identifiable(&status[*k]) && !identifiable(&base[*k]))
            .collect();
        if let [anchor] = new[..] {
            anchors.push(anchor);
        }
    }
    Ok(anchors)
}
