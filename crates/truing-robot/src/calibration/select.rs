//! Which columns can be estimated: structure first, then what the data excite.

use super::assembly::Assembly;
use super::measurement::{Arm, Measured, MeasurementSet};
use super::result::Status;
use super::start::tips;
use super::state::{Column, Owner, State};
use crate::constraint::Derivatives;
use crate::error::Error;
use crate::kinematics::{ParameterKind, Unit};
use crate::posture;
use crate::simulate::{Sampling, sample};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use truing::identifiability::{ColumnStatus, base_columns};
use truing::nalgebra::{DMatrix, DVector};
use truing::{LeastSquares, Linearization, step};

/// What is left of a scaled column at configurations that satisfy the constraints exactly: true
/// rank keeps about 1e-2, a dependent column about 1e-16; tables written to five digits in between.
pub(super) const STRUCTURE: f64 = 1e-5;

/// What is left of a scaled column at the data's own configurations, below which they do not move it.
const EXCITATION: f64 = 1e-7;

/// What is left of a parameter's scaled column at the data's own configurations, above which it is
/// kept before all others.
const EXCITED_WELL: f64 = 0.3;

/// A robot's parameter that the data leave uncertain by more than this [m, rad or 1], even if those
/// preferred to it were known, is not determined at all.
const WEAKEST: f64 = 1.0;

/// How many rows of measurements each set of the structural twin has, about.
pub(super) const POSTURES: usize = 120;

/// How many rows each group of a set has at least.
pub(super) const LEAST: usize = 12;

/// Seed of the structural twin, unless another is asked for.
pub(super) const SEED: u64 = 1996;

/// The structural twin of a calibration: sets like the given ones, at random postures that satisfy
/// their constraints exactly at `state`, where rank is a property of the robot and not of the noise.
/// Half of the postures start between the joint limits, half near the data's own, so that a plane
/// in a corner of the workspace is reached too. Each group has `least` rows or more. The same data and seed always give the same twin.
pub(super) fn structural_twin(
    arms: &[Arm],
    sets: &[MeasurementSet],
    state: &State,
    seed: u64,
    least: usize,
) -> Result<Vec<MeasurementSet>, Error> {
    let twin = |(k, set): (usize, &MeasurementSet)| {
        let groups = set
            .measured
            .groups()
            .map_or(1, |groups| groups.names.len().max(1));
        let sampling = Sampling {
            count: POSTURES.div_ceil(groups).max(least),
            noise: None,
            near: Some(set),
        };
        let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_add(k as u64));
        // Structure knows no noise: all sets weigh the same.
        let set = MeasurementSet {
            sigma: Vec::new(),
            ..set.clone()
        };
        match sample(arms, k, &set, state, &sampling, &mut rng) {
            Err(Error::Unreachable { message, help }) => {
                match moved_into_reach(arms, &set, state) {
                    Some(set) => sample(arms, k, &set, state, &sampling, &mut rng),
                    None => Err(Error::Unreachable { message, help }),
                }
            }
            sampled => sampled,
        }
    };
    sets.iter().enumerate().map(twin).collect()
}

/// How far from a known plane the touches may lie on average, as the robot of the file sees them, in
/// sums of the robot's lengths: a robot that is wrong, and not the plane.
const WRONG_ROBOT: f64 = 1.0;

/// A set of touches with its known plane moved along its normal to where the robot believes to have
/// touched: what is identifiable depends on the direction of a plane, not on its place.
fn moved_into_reach(arms: &[Arm], set: &MeasurementSet, state: &State) -> Option<MeasurementSet> {
    let Measured::KnownPlane(mut plane) = set.measured else {
        return None;
    };
    let (arm, parameters) = (&arms[set.robot], &state.robots[set.robot]);
    let tips = tips(arm, set, parameters, &state.target(set));
    let off = tips
        .iter()
        .map(|tip| plane.signed_distance(tip))
        .sum::<f64>()
        / tips.len() as f64;
    let lengths = arm.robot.parameters().iter().zip(parameters);
    let size: f64 = lengths
        .filter(|(p, _)| p.unit() == Unit::Meter)
        .map(|(_, length)| length.abs())
        .sum();
    if off.is_nan() || off.abs() > WRONG_ROBOT * size {
        return None;
    }
    plane.distance += off;
    Some(MeasurementSet {
        measured: Measured::KnownPlane(plane),
        ..set.clone()
    })
}

/// What becomes of a column in the estimate.
#[derive(Debug, Clone, PartialEq)]
pub enum Choice {
    /// Not asked for.
    Fixed,
    /// Estimated.
    Estimated,
    /// Nothing measured depends on it.
    NoEffect,
    /// A combination of estimated columns, as (column, coefficient).
    Regrouped(Vec<(usize, f64)>),
    /// The same, but for the scale, which the data leave free: this parameter, held, anchors it.
    Anchor(Vec<(usize, f64)>),
    /// The structure would allow it, these data do not determine it.
    Unexcited,
}

impl Choice {
    /// What becomes of a robot's parameter, among these columns.
    pub fn status(&self, columns: &[Column]) -> Status {
        match self {
            Self::Fixed => Status::Fixed,
            Self::Estimated => Status::Estimated,
            Self::NoEffect => Status::NoEffect,
            Self::Unexcited => Status::Unexcited,
            Self::Anchor(_) => Status::Held,
            // What only planes, points and distances take over moves everything along.
            Self::Regrouped(into) => {
                let local = |(c, _): &(usize, f64)| columns[*c].owner.is_local();
                if into.iter().all(local) {
                    Status::Held
                } else {
                    Status::Regrouped
                }
            }
        }
    }

    /// What takes over, by name and coefficient.
    pub fn taken_over(&self, columns: &[Column]) -> Option<Vec<(String, f64)>> {
        let (Self::Regrouped(into) | Self::Anchor(into)) = self else {
            return None;
        };
        let named = |(c, w): &(usize, f64)| (columns[*c].name.clone(), *w);
        Some(into.iter().map(named).collect())
    }
}

/// The Jacobian of an assembly, compressed to the triangle of its QR: same column geometry, few rows.
pub(super) fn compressed(assembly: &Assembly, wanted: &[usize]) -> DMatrix<f64> {
    let mut lin = Linearization::new(assembly.problem.structure());
    assembly
        .problem
        .linearize(assembly.problem.initial(), &mut lin);
    let scale = vec![1.0; wanted.len()];
    let t = step::triangle(&lin, wanted, &scale);
    let n = wanted.len();
    DMatrix::from_fn(n, n, |i, k| if i <= k { t[(i, k)] } else { 0.0 })
}

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
pub(super) fn structure(
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
pub(super) fn excited(
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
            arms[robot].robot.parameters()[parameter].kind == ParameterKind::Gain
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
    // Left out one by one, since leaving one out is what the next may need to be determined.
    loop {
        let triangle = compressed(&data, &kept);
        let dark = (0..kept.len()).find(|k| {
            let (left, column) = (triangle[(*k, *k)].abs(), kept[*k]);
            let robot = matches!(data.columns[column].owner, Owner::Parameter { .. });
            let weak = robot && left * WEAKEST < 1.0;
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

/// The columns (their places in `wanted`) that are left out only because all lengths can grow
/// together: touches of unknown planes and points look the same for a robot of any size.
///
/// All lengths scaled by 1 + ε is a direction of the tangent. If the structural Jacobian sees of it
/// at most what planes, points, frames and bases take up, the scale is free; what a known distance between
/// two postures of a robot would then bring in, a distance being blind to all else that is free, is
/// the anchor.
fn scale_anchors(
    arms: &[Arm],
    twin_sets: &[MeasurementSet],
    state: &State,
    twin: &Assembly,
    structure: &DMatrix<f64>,
    wanted: &[usize],
    base: &[ColumnStatus],
) -> Result<Vec<usize>, Error> {
    let direction = twin.scale_direction(state);
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
        let measured = Measured::Distance {
            other: None,
            q_b,
            distance: Some(0.0),
        };
        let sets = [
            twin_sets,
            &[MeasurementSet::new("scale", robot, q, measured)],
        ]
        .concat();
        let mut with = state.clone();
        with.planes.push(Vec::new());
        with.points.push(Vec::new());
        with.locations.push(Vec::new());
        with.distances.push(0.0);
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

/// Columns in the order of preference: planes, points and distances first (whatever they cost the
/// robot is gauge), then sensor frames and tool points, then the robots' parameters.
pub fn in_order(
    assembly: &Assembly,
    preference: &[(usize, usize)],
    wanted: impl Fn(&Owner) -> bool,
) -> Vec<usize> {
    let rank = |owner: &Owner| match owner {
        Owner::Plane(..) | Owner::Point(..) | Owner::Location(..) | Owner::Distance(_) => (0, 0),
        Owner::Frame(_) => (1, 0),
        Owner::Target(..) => (2, 0),
        Owner::Parameter { robot, parameter } => (
            3,
            preference
                .iter()
                .position(|p| *p == (*robot, *parameter))
                .unwrap_or(usize::MAX),
        ),
        Owner::Constant => (4, 0),
    };
    let mut columns: Vec<usize> = (0..assembly.columns.len())
        .filter(|c| {
            assembly.columns[*c].owner != Owner::Constant && wanted(&assembly.columns[*c].owner)
        })
        .collect();
    columns.sort_by_key(|c| rank(&assembly.columns[*c].owner));
    columns
}

/// The default order of preference over all robots, as (robot, parameter).
pub fn default_preference(arms: &[Arm]) -> Vec<(usize, usize)> {
    let mut all: Vec<(usize, usize)> = arms
        .iter()
        .enumerate()
        .flat_map(|(r, arm)| (0..arm.robot.parameters().len()).map(move |p| (r, p)))
        .collect();
    all.sort_by_key(|(r, p)| {
        let (class, place) = arms[*r].robot.preference(*p);
        (class, *r, place)
    });
    all
}
