//! Drawing measurements: postures that satisfy their constraints exactly, or exactly but for noise.

use crate::calibration::{Arm, Groups, Measured, MeasurementSet, Sigma, State};
use crate::error::Error;
use crate::kinematics::Regressor;
use crate::posture::{self, Posed};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use truing::Loss;
use truing::manifold::{Pose, so3};
use truing::nalgebra::{DMatrix, DVector, Vector3};

/// How a set of measurements is drawn.
#[derive(Debug, Clone, Copy)]
pub struct Sampling<'a> {
    /// How many measurements of each group (of the whole set for kinds without groups).
    pub count: usize,
    /// Noise added to what is measured.
    pub noise: Option<Sigma>,
    /// Postures near which every second one is looked for; none to draw all between the joint limits.
    pub near: Option<&'a MeasurementSet>,
}

/// Draws a set like `set` (its kind, groups, frame and tool point; its rows do not matter) of robots
/// and planes, points and frames as in `state`, `k` being its number there.
///
/// Touches, visits and distances are found by solving the inverse kinematics for the place that the
/// noise moved the contact to; a posture that is not found is never returned.
///
/// # Errors
/// If a plane, point or distance is out of reach.
pub fn sample(
    arms: &[Arm],
    k: usize,
    set: &MeasurementSet,
    state: &State,
    sampling: &Sampling<'_>,
    rng: &mut ChaCha8Rng,
) -> Result<MeasurementSet, Error> {
    let arm = &arms[set.robot];
    let limits = posture::limits(&arm.robot);
    let posed = Posed {
        robot: &arm.robot,
        parameters: &state.robots[set.robot],
        target: state.target(set),
    };
    let mut sampler = Sampler {
        name: &set.name,
        // A location leaves no joint free: few starts lead there.
        attempts: match set.measured {
            Measured::SameLocation(_) => 2_000,
            _ => 400,
        },
        limits: &limits,
        rng,
    };
    let near = |group: Option<usize>| -> Vec<Vec<f64>> {
        let Some(near) = sampling.near else {
            return Vec::new();
        };
        let Some(groups) = near.measured.groups() else {
            return near.q.clone();
        };
        near.q
            .iter()
            .zip(&groups.of_row)
            .filter(|(_, g)| group.is_none_or(|h| **g == h))
            .map(|(q, _)| q.clone())
            .collect()
    };
    let noise = sampling.noise.unwrap_or(Sigma {
        position: 0.0,
        rotation: 0.0,
    });
    let mut q = Vec::new();
    let measured = match &set.measured {
        Measured::Position(_) | Measured::Pose(_) => {
            let sensor = state.sensor(set).inverse();
            let near = near(None);
            let mut poses = Vec::new();
            for attempt in 0..sampling.count {
                let posture = sampler.start(&near, attempt);
                let tool = arm.robot.forward(posed.parameters, &posture);
                let tip =
                    sensor.apply(&tool.apply(&posed.target)) + sampler.normal() * noise.position;
                let turn = so3::exp_matrix((sampler.normal() * noise.rotation).as_slice());
                poses.push(Pose {
                    rotation: sensor.rotation * tool.rotation * turn,
                    translation: tip,
                });
                q.push(posture);
            }
            match &set.measured {
                Measured::Pose(_) => Measured::Pose(poses),
                _ => Measured::Position(poses.into_iter().map(|pose| pose.translation).collect()),
            }
        }
        Measured::KnownPlane(plane) => {
            let near = near(None);
            for _ in 0..sampling.count {
                let distance = plane.distance + sampler.normal().x * noise.position;
                q.push(sampler.exact(&near, "its plane", |q| {
                    on_plane(&posed, plane.normal, distance, q)
                })?);
            }
            Measured::KnownPlane(*plane)
        }
        Measured::UnknownPlane(groups) => {
            for (g, name) in groups.names.iter().enumerate() {
                let (plane, near) = (state.planes[k][g], near(Some(g)));
                let what = format!("plane `{name}`");
                for _ in 0..sampling.count {
                    let distance = plane.distance + sampler.normal().x * noise.position;
                    q.push(sampler.exact(&near, &what, |q| {
                        on_plane(&posed, plane.normal, distance, q)
                    })?);
                }
            }
            Measured::UnknownPlane(in_turn(groups, sampling.count))
        }
        Measured::SamePoint(groups) => {
            for (g, name) in groups.names.iter().enumerate() {
                let near = near(Some(g));
                let what = format!("point `{name}`");
                for _ in 0..sampling.count {
                    let point = state.points[k][g] + sampler.normal() * noise.position;
                    q.push(sampler.exact(&near, &what, |q| at_point(&posed, &point, q))?);
                }
            }
            Measured::SamePoint(in_turn(groups, sampling.count))
        }
        Measured::SameLocation(groups) => {
            for (g, name) in groups.names.iter().enumerate() {
                let near = near(Some(g));
                let what = format!("location `{name}`");
                for _ in 0..sampling.count {
                    let location = state.locations[k][g];
                    let turn = so3::exp_matrix((sampler.normal() * noise.rotation).as_slice());
                    let location = Pose {
                        translation: location.translation + sampler.normal() * noise.position,
                        rotation: location.rotation * turn,
                    };
                    q.push(sampler.exact(&near, &what, |q| at_location(&posed, &location, q))?);
                }
            }
            Measured::SameLocation(in_turn(groups, sampling.count))
        }
        Measured::Distance {
            other, distance, ..
        } => {
            let b = other.unwrap_or(set.robot);
            let target_b = state.second_target(set);
            let posed_b = Posed {
                robot: &arms[b].robot,
                parameters: &state.robots[b],
                target: target_b,
            };
            let both = [limits.clone(), posture::limits(&arms[b].robot)].concat();
            let near: Vec<Vec<f64>> = match sampling.near.map(|near| (near, &near.measured)) {
                Some((near, Measured::Distance { q_b, .. })) => near
                    .q
                    .iter()
                    .zip(q_b)
                    .map(|(a, b)| [a.clone(), b.clone()].concat())
                    .collect(),
                _ => Vec::new(),
            };
            sampler.limits = &both;
            let n = limits.len();
            let mut second = Vec::new();
            for _ in 0..sampling.count {
                let length = state.distances[k] + sampler.normal().x * noise.position;
                let posture = sampler.exact(&near, "the distance", |q| {
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
    // What has no noise is weighted as by default.
    let usual = set.sigma.first().copied().unwrap_or_default();
    let or_usual = |noise: f64, usual: f64| if noise > 0.0 { noise } else { usual };
    let sigma = Sigma {
        position: or_usual(noise.position, usual.position),
        rotation: or_usual(noise.rotation, usual.rotation),
    };
    Ok(MeasurementSet {
        sigma: vec![sigma; q.len()],
        q,
        measured,
        loss: Loss::Trivial,
        origin: None,
        ..set.clone()
    })
}

/// `count` rows of each group, group after group.
fn in_turn(groups: &Groups, count: usize) -> Groups {
    let of_row = (0..groups.names.len())
        .flat_map(|g| std::iter::repeat_n(g, count))
        .collect();
    Groups {
        names: groups.names.clone(),
        of_row,
    }
}

struct Sampler<'a> {
    name: &'a str,
    /// Starting postures before a place counts as out of reach.
    attempts: usize,
    limits: &'a [[f64; 2]],
    rng: &'a mut ChaCha8Rng,
}

impl Sampler<'_> {
    fn normal(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.rng.sample(StandardNormal))
    }

    /// A start: anywhere between the limits, or (for odd tries) within half a radian of a near posture.
    fn start(&mut self, near: &[Vec<f64>], attempt: usize) -> Vec<f64> {
        if attempt.is_multiple_of(2) || near.is_empty() {
            return posture::random(self.limits, self.rng);
        }
        let base = &near[self.rng.random_range(0..near.len())];
        base.iter()
            .zip(self.limits)
            .map(|(q, [l, u])| (q + self.rng.random_range(-0.5..0.5)).clamp(l.min(*q), u.max(*q)))
            .collect()
    }

    fn exact(
        &mut self,
        near: &[Vec<f64>],
        what: &str,
        mut condition: impl FnMut(&[f64]) -> (DVector<f64>, DMatrix<f64>),
    ) -> Result<Vec<f64>, Error> {
        for attempt in 0..self.attempts {
            let start = self.start(near, attempt);
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
                "`{}`: none of {} starting postures leads the robot to {what}",
                self.name, self.attempts
            ),
            help:
                "check the robot table, where the plane, point or location is, the units and the joint limits"
                    .into(),
        })
    }
}

/// normal · tip − distance = 0, one row.
fn on_plane(
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
fn at_point(posed: &Posed<'_>, point: &Vector3<f64>, q: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
    let (tip, j) = posed.tip(q, &mut Regressor::default());
    (DVector::from_column_slice((tip - point).as_slice()), j)
}

/// tip − position = 0 and log(R_tool · Rᵀ) = 0, six rows [m, rad].
fn at_location(posed: &Posed<'_>, location: &Pose<f64>, q: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
    let mut regressor = Regressor::default();
    let (tip, j) = posed.tip(q, &mut regressor);
    let off = so3::log_matrix(&(regressor.tool.rotation * location.rotation.transpose()));
    let mut r = DVector::zeros(6);
    r.rows_mut(0, 3).copy_from(&(tip - location.translation));
    r.rows_mut(3, 3).copy_from(&off);
    let mut rows = DMatrix::zeros(6, q.len());
    rows.rows_mut(0, 3).copy_from(&j);
    for c in 0..q.len() {
        // To first order in the angle that is left: enough for Newton's steps to end at zero.
        let turn = regressor.joint_turn(posed.robot, posed.parameters, c);
        rows.view_mut((3, c), (3, 1)).copy_from(&turn);
    }
    (r, rows)
}

/// ‖tip_a − tip_b‖ − distance = 0, one row over the joints of both, the first `n` those of a.
fn apart(
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
