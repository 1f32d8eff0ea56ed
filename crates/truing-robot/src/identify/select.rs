//! Which columns can be estimated: structure first, then what the data excite.

use super::anchors::scale_anchors;
use super::choice::Choice;
use super::compressed::{STRUCTURE, compressed};
use super::twin::{LEAST, SEED, structural_twin};
use crate::error::Error;
use crate::measurement::MeasurementSet;
use crate::model::{Assembly, Owner};
use crate::robot::{Arm, Derivatives, ParameterKind, Unit, posture};
use crate::unknown::State;
use truing::identifiability::{ColumnStatus, base_columns};

/// What is left of a scaled column at the data's own configurations, below which they do not move it.
const EXCITATION: f64 = 1e-7;

/// What is left of a scaled column at configurations that satisfy the constraints exactly, below which others are
/// preferred to it whatever the order says.
const WELL: f64 = 1e-3;

/// What is left of a parameter's scaled column at the data's own configurations, above which it is
/// kept before all others.
const EXCITED_WELL: f64 = 0.3;

/// A robot's parameter that the data leave uncertain by more than this [rad, 1 or reaches], even if those
/// preferred to it were known, is not determined at all.
const WEAKEST: f64 = 1.0;

/// Decides about every column; those `wanted` are visited in this order, the preferred first.
/// Columns `with_prior` may be as weakly determined by the data as they like.
///
/// # Errors
/// If the structural twin cannot be made, or a noise model is wrong.
pub fn select(
    arms: &[Arm],
    sets: &[MeasurementSet],
    state: &State,
    derivatives: &Derivatives,
    wanted: &[usize],
    with_prior: &[usize],
) -> Result<Vec<Choice>, Error> {
    let twin = structural_twin(arms, sets, state, SEED, LEAST)?;
    let choices = structure(arms, &twin, state, derivatives, wanted)?;
    excited(arms, sets, state, derivatives, choices, wanted, with_prior)
}

/// What the structure allows: every column decided about at sets that satisfy their constraints exactly.
pub fn structure(
    arms: &[Arm],
    twin_sets: &[MeasurementSet],
    state: &State,
    derivatives: &Derivatives,
    wanted: &[usize],
) -> Result<Vec<Choice>, Error> {
    let twin = Assembly::new(arms, twin_sets, state, derivatives)?;
    let mut choices = vec![Choice::Fixed; twin.columns.len()];
    let order: Vec<usize> = (0..wanted.len()).collect();
    let structure = compressed(&twin, wanted);
    // Preference is among equals: a column of which hardly anything is left would stand for others with huge
    // coefficients, and is the last to be kept.
    let well = base_columns(&structure, &order, WELL);
    let (well, hardly): (Vec<usize>, Vec<usize>) = order
        .iter()
        .partition(|k| well[**k] == ColumnStatus::Identifiable);
    let order: Vec<usize> = well.into_iter().chain(hardly).collect();
    let base = base_columns(&structure, &order, STRUCTURE);
    let anchors = scale_anchors(arms, twin_sets, state, &twin, &structure, wanted, &base)?;
    for (k, (status, column)) in base.into_iter().zip(wanted).enumerate() {
        choices[*column] = match status {
            ColumnStatus::Identifiable => Choice::Estimated,
            ColumnStatus::NoEffect => Choice::NoEffect,
            ColumnStatus::Regrouped(into) => {
                let into = into.into_iter().map(|(k, c)| (wanted[k], c)).collect();
                if anchors.contains(&k) {
                    Choice::Anchor(into)
                } else {
                    Choice::Regrouped(into)
                }
            }
        };
    }
    Ok(choices)
}

/// What these data leave of what the structure allows: the rest becomes [`Choice::Unexcited`].
pub fn excited(
    arms: &[Arm],
    sets: &[MeasurementSet],
    state: &State,
    derivatives: &Derivatives,
    mut choices: Vec<Choice>,
    wanted: &[usize],
    with_prior: &[usize],
) -> Result<Vec<Choice>, Error> {
    let plain: Vec<MeasurementSet> = sets.iter().map(MeasurementSet::unweighted).collect();
    let data = Assembly::new(arms, &plain, state, derivatives)?;
    let mut kept: Vec<usize> = wanted
        .iter()
        .copied()
        .filter(|c| choices[*c] == Choice::Estimated)
        .collect();
    // Where the data leave a choice that the structure does not: a joint that does not move says
    // nothing of its gain; and a parameter of which little is left is the last to be kept, since in
    // place of another it would have to move far.
    kept.sort_by_key(|column| match data.columns[*column].owner {
        Owner::Parameter { robot, parameter } => {
            let kind = arms[robot].robot.parameters()[parameter].kind;
            matches!(kind, ParameterKind::Gain | ParameterKind::Model)
        }
        _ => false,
    });
    let order: Vec<usize> = (0..kept.len()).collect();
    let status = base_columns(&compressed(&data, &kept), &order, EXCITED_WELL);
    let (well, hardly): (Vec<usize>, Vec<usize>) = order.iter().partition(|k| {
        let parameter = matches!(data.columns[kept[**k]].owner, Owner::Parameter { .. });
        !parameter || status[**k] == ColumnStatus::Identifiable
    });
    kept = well.iter().chain(&hardly).map(|k| kept[*k]).collect();
    let reach: Vec<f64> = arms.iter().map(|arm| posture::reach(&arm.robot)).collect();
    let size = |column: usize| match data.columns[column].owner {
        Owner::Parameter { robot, parameter } => {
            match arms[robot].robot.parameters()[parameter].unit() {
                Unit::Meter => reach[robot],
                _ => 1.0,
            }
        }
        _ => 1.0,
    };
    // Left out one by one, since leaving one out is what the next may need to be determined.
    loop {
        let triangle = compressed(&data, &kept);
        let dark = (0..kept.len()).find(|k| {
            let (left, column) = (triangle[(*k, *k)].abs(), kept[*k]);
            let robot = matches!(data.columns[column].owner, Owner::Parameter { .. });
            let weak = robot && left * WEAKEST * size(column) < 1.0;
            let unmoved = left <= EXCITATION * triangle.column(*k).norm();
            (unmoved || weak) && !with_prior.contains(&column)
        });
        match dark {
            Some(k) => choices[kept.remove(k)] = Choice::Unexcited,
            None => break,
        }
    }
    Ok(choices)
}
