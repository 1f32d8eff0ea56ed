//! The structural twin of a calibration: the same constraints at random postures that satisfy them
//! exactly, where rank is a property of the robot and not of the noise.

use super::assembly::State;
use super::measurement::{Arm, Groups, Measured, MeasurementSet, Sigma};
use crate::error::Error;
use crate::kinematics::Regressor;
use crate::posture::{self, Posed};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use truing::Loss;
use truing::manifold::Pose;
use truing::nalgebra::{DMatrix, DVector, Vector3};

/// Seed of the random postures: the same data always give the same answer.
const SEED: u64 = 1996;

/// How many postures each group of a set gets, so that all of a set together have about this many rows.
const POSTURES: usize = 120;

/// Sets like the given ones, at random postures that satisfy their constraints exactly at `state`.
///
/// Half of the starts are drawn between the joint limits, half near the data's own postures, so
/// that a plane in a corner of the workspace is reached too.
///
/// # Errors
/// If a plane, point or distance is out of reach of the robot.
pub fn structural_twin(
    arms: &[Arm],
    sets: &[MeasurementSet],
    state: &State,
) -> Result<Vec<MeasurementSet>, Error> {
    sets.iter()
        .enumerate()
        .map(|(k, set)| {
            let mut rng = ChaCha8Rng::seed_from_u64(SEED + k as u64);
            twin(arms, k, set, state, &mut rng)
        })
        .collect()
}

fn twin(
    arms: &[Arm],
    k: usize,
    set: &MeasurementSet,
    state: &State,
    rng: &mut ChaCha8Rng,
) -> Result<MeasurementSet, Error> {
    let arm = &arms[set.robot];
    let posed = Posed {
        robot: &arm.robot,
        parameters: &state.robots[set.robot],
        target: state.target(set),
    };
    let sensor = state.sensor(set);
    let limits = posture::limits(&arm.robot);
    let draw = Draw {
        set,
        limits: &limits,
    };
    let mut q = Vec::new();
    let measured = match &set.measured {
        Measured::Position(_) => {
            let mut points = Vec::new();
            for _ in 0..POSTURES {
                let posture = draw.start(&set.q, 0, rng);
                let tip = arm
                    .robot
                    .forward(posed.parameters, &posture)
                    .apply(&posed.target);
                points.push(sensor.inverse().apply(&tip));
                q.push(posture);
            }
            Measured::Position(points)
        }
        Measured::Pose(_) => {
            let mut poses = Vec::new();
            for _ in 0..POSTURES {
                let posture = draw.start(&set.q, 0, rng);
                let tool = arm.robot.forward(posed.parameters, &posture);
                let seen = sensor.inverse().compose(&tool);
                let tip = sensor.inverse().apply(&tool.apply(&posed.target));
                poses.push(Pose {
                    translation: tip,
                    ..seen
                });
                q.push(posture);
            }
            Measured::Pose(poses)
        }
        Measured::KnownPlane(plane) => {
            for _ in 0..POSTURES {
                q.push(draw.exact(&set.q, rng, "its plane", |q| {
                    on_plane(&posed, plane.normal, plane.distance, q)
                })?);
            }
            Measured::KnownPlane(*plane)
        }
        Measured::UnknownPlane(groups) => Measured::UnknownPlane(grouped(
            groups,
            |g, near, of_row| {
                let plane = state.planes[k][g];
                q.push(draw.exact(near, rng, &groups.names[g], |q| {
                    on_plane(&posed, plane.normal, plane.distance, q)
                })?);
                of_row.push(g);
                Ok(())
            },
            set,
        )?),
        Measured::SamePoint(groups) => Measured::SamePoint(grouped(
            groups,
            |g, near, of_row| {
                let point = state.points[k][g];
                q.push(draw.exact(near, rng, &groups.names[g], |q| at_point(&posed, &point, q))?);
                of_row.push(g);
                Ok(())
            },
            set,
        )?),
        Measured::Distance {
            other,
            q_b,
            distance,
        } => {
            let b = other.unwrap_or(set.robot);
            let target_b = if other.is_some() {
                Vector3::zeros()
            } else {
                posed.target
            };
            let posed_b = Posed {
                robot: &arms[b].robot,
                parameters: &state.robots[b],
                target: target_b,
            };
            let joined: Vec<Vec<f64>> = set
                .q
                .iter()
                .zip(q_b)
                .map(|(a, b)| [a.clone(), b.clone()].concat())
                .collect();
            let both = [limits.clone(), posture::limits(&arms[b].robot)].concat();
            let draw = Draw { set, limits: &both };
            let n = limits.len();
            let length = state.distances[k];
            let mut second = Vec::new();
            for _ in 0..POSTURES {
                let posture = draw.exact(&joined, rng, "the distance", |q| {
                    apart(&posed, &posed_b, length, n, q)
                })?;
                q.push(posture[..n].to_vec());
                second.push(posture[n..].to_vec());
            }
            Measured::Distance {
                other: *other,
                q_b: second,
                distance: *distance,
            }
        }
    };
    Ok(MeasurementSet {
        sigma: vec![set.sigma.first().copied().unwrap_or_else(Sigma::default); q.len()],
        q,
        measured,
        loss: Loss::Trivial,
        origin: None,
        ..set.clone()
    })
}

/// Draws postures for each group in turn.
fn grouped(
    groups: &Groups,
    mut one: impl FnMut(usize, &[Vec<f64>], &mut Vec<usize>) -> Result<(), Error>,
    set: &MeasurementSet,
) -> Result<Groups, Error> {
    let each = POSTURES.div_ceil(groups.names.len().max(1)).max(12);
    let mut of_row = Vec::new();
    for g in 0..groups.names.len() {
        let near: Vec<Vec<f64>> = set
            .q
            .iter()
            .zip(&groups.of_row)
            .filter(|(_, h)| **h == g)
            .map(|(q, _)| q.clone())
            .collect();
        for _ in 0..each {
            one(g, &near, &mut of_row)?;
        }
    }
    Ok(Groups {
        names: groups.names.clone(),
        of_row,
    })
}

struct Draw<'a> {
    set: &'a MeasurementSet,
    limits: &'a [[f64; 2]],
}

impl Draw<'_> {
    /// A start: anywhere between the limits, or (for odd tries) near one of the data's postures.
    fn start(&self, near: &[Vec<f64>], attempt: usize, rng: &mut ChaCha8Rng) -> Vec<f64> {
        if attempt % 2 == 0 || near.is_empty() {
            return posture::random(self.limits, rng);
        }
        let base = &near[rng.random_range(0..near.len())];
        base.iter()
            .zip(self.limits)
            .map(|(q, [l, u])| (q + rng.random_range(-0.5..0.5)).clamp(l.min(*q), u.max(*q)))
            .collect()
    }

    fn exact(
        &self,
        near: &[Vec<f64>],
        rng: &mut ChaCha8Rng,
        what: &str,
        mut condition: impl FnMut(&[f64]) -> (DVector<f64>, DMatrix<f64>),
    ) -> Result<Vec<f64>, Error> {
        const ATTEMPTS: usize = 400;
        for attempt in 0..ATTEMPTS {
            let start = self.start(near, attempt, rng);
            // Data may lie outside the limits a robot file gives: those postures count too.
            let limits: Vec<[f64; 2]> = self
                .limits
                .iter()
                .zip(&start)
                .map(|([l, u], q)| [l.min(*q), u.max(*q)])
                .collect();
            if let Some(q) = posture::satisfy(start, &limits, &mut condition) {
                return Ok(q);
            }
        }
        Err(Error::Unreachable {
            message: format!(
                "`{}`: none of {ATTEMPTS} starting postures leads the nominal robot to {what}",
                self.set.name
            ),
            help: "check the robot table, the units of the joint columns and the joint limits"
                .into(),
        })
    }
}

/// normal · tip − distance = 0, one row.
pub fn on_plane(
    posed: &Posed<'_>,
    normal: Vector3<f64>,
    distance: f64,
    q: &[f64],
) -> (DVector<f64>, DMatrix<f64>) {
    let (tip, j) = posed.tip(q, &mut Regressor::default());
    let row = DMatrix::from_fn(1, q.len(), |_, c| {
        normal.dot(&Vector3::new(j[(0, c)], j[(1, c)], j[(2, c)]))
    });
    (DVector::from_element(1, normal.dot(&tip) - distance), row)
}

/// tip − point = 0, three rows.
pub fn at_point(
    posed: &Posed<'_>,
    point: &Vector3<f64>,
    q: &[f64],
) -> (DVector<f64>, DMatrix<f64>) {
    let (tip, j) = posed.tip(q, &mut Regressor::default());
    (DVector::from_column_slice((tip - point).as_slice()), j)
}

/// ‖tip_a − tip_b‖ − distance = 0, one row over the joints of both, the first `n` those of a.
pub fn apart(
    a: &Posed<'_>,
    b: &Posed<'_>,
    distance: f64,
    n: usize,
    q: &[f64],
) -> (DVector<f64>, DMatrix<f64>) {
    let mut regressor = Regressor::default();
    let (tip_a, j_a) = a.tip(&q[..n], &mut regressor);
    let (tip_b, j_b) = b.tip(&q[n..], &mut regressor);
    let between = tip_a - tip_b;
    let length = between.norm();
    let unit = if length > 0.0 {
        between / length
    } else {
        Vector3::x()
    };
    let row = DMatrix::from_fn(1, q.len(), |_, c| {
        let (j, c, sign) = if c < n {
            (&j_a, c, 1.0)
        } else {
            (&j_b, c - n, -1.0)
        };
        sign * unit.dot(&Vector3::new(j[(0, c)], j[(1, c)], j[(2, c)]))
    });
    (DVector::from_element(1, length - distance), row)
}
