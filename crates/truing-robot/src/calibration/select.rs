//! Which columns can be estimated: structure first, then what the data excite.

use super::assembly::{Assembly, Owner, State};
use super::measurement::{Arm, Measured, MeasurementSet};
use crate::constraint::Derivatives;
use crate::error::Error;
use crate::simulate::{Sampling, sample};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use truing::identifiability::{ColumnStatus, base_columns};
use truing::nalgebra::DMatrix;
use truing::{LeastSquares, Linearization, step};

/// What is left of a scaled column at configurations that satisfy the constraints exactly: true
/// rank keeps about 1e-2, a dependent column about 1e-16; tables written to five digits in between.
const STRUCTURE: f64 = 1e-5;

/// What is left of a scaled column at the data's own configurations, below which they do not move it.
const EXCITATION: f64 = 1e-7;

/// What is left of a parameter's scaled column at the data's own configurations, above which it is
/// kept before all others.
const EXCITED_WELL: f64 = 0.3;

/// A robot's parameter that the data leave uncertain by more than this [m, rad or 1], even if those
/// preferred to it were known, is worse determined than by any drawing.
const WEAKEST: f64 = 0.1;

/// How many rows of measurements each set of the structural twin has, about.
const POSTURES: usize = 120;

/// The structural twin of a calibration: sets like the given ones, at random postures that satisfy
/// their constraints exactly at `state`, where rank is a property of the robot and not of the noise.
/// Half of the postures start between the joint limits, half near the data's own, so that a plane
/// in a corner of the workspace is reached too. The same data always give the same twin.
fn structural_twin(
    arms: &[Arm],
    sets: &[MeasurementSet],
    state: &State,
) -> Result<Vec<MeasurementSet>, Error> {
    let twin = |(k, set): (usize, &MeasurementSet)| {
        let groups = match &set.measured {
            Measured::UnknownPlane(groups) | Measured::SamePoint(groups) => {
                groups.names.len().max(1)
            }
            _ => 1,
        };
        let sampling = Sampling {
            count: POSTURES.div_ceil(groups).max(12),
            noise: None,
            near: Some(set),
        };
        let mut rng = ChaCha8Rng::seed_from_u64(1996 + k as u64);
        sample(arms, k, set, state, &sampling, &mut rng)
    };
    sets.iter().enumerate().map(twin).collect()
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
    /// The structure would allow it, these data do not determine it.
    Unexcited,
}

/// The Jacobian of an assembly, compressed to the triangle of its QR: same column geometry, few rows.
fn compressed(assembly: &Assembly, wanted: &[usize]) -> DMatrix<f64> {
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
    let data = Assembly::new(arms, sets, state, derivatives)?;
    let twin = Assembly::new(
        arms,
        &structural_twin(arms, sets, state)?,
        state,
        derivatives,
    )?;
    let mut choices = vec![Choice::Fixed; data.columns.len()];
    let order: Vec<usize> = (0..wanted.len()).collect();
    for (status, column) in base_columns(&compressed(&twin, wanted), &order, STRUCTURE)
        .into_iter()
        .zip(wanted)
    {
        choices[*column] = match status {
            ColumnStatus::Identifiable => Choice::Estimated,
            ColumnStatus::NoEffect => Choice::NoEffect,
            ColumnStatus::Regrouped(into) => {
                Choice::Regrouped(into.into_iter().map(|(k, c)| (wanted[k], c)).collect())
            }
        };
    }
    let mut kept: Vec<usize> = wanted
        .iter()
        .copied()
        .filter(|c| choices[*c] == Choice::Estimated)
        .collect();
    // Where the data leave a choice that the structure does not, a parameter of which little is left
    // is the last to be kept: in place of another it would have to move far.
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
            let weak = robot && !with_prior.contains(&column) && left * WEAKEST < 1.0;
            left <= EXCITATION * triangle.column(*k).norm() || weak
        });
        match dark {
            Some(k) => choices[kept.remove(k)] = Choice::Unexcited,
            None => break,
        }
    }
    Ok(choices)
}

/// Columns in the order of preference: planes, points and distances first (whatever they cost the
/// robot is gauge), then sensor frames and tool points, then the robots' parameters.
pub fn in_order(
    assembly: &Assembly,
    preference: &[(usize, usize)],
    wanted: impl Fn(&Owner) -> bool,
) -> Vec<usize> {
    let rank = |owner: &Owner| match owner {
        Owner::Plane(..) | Owner::Point(..) | Owner::Distance(_) => (0, 0),
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
