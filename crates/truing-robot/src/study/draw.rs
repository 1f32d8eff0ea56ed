//! What a trial draws: true robots, places, measurements, fresh configurations.

use super::cases::{Case, Study};
use crate::error::Error;
use crate::measurement::{MeasurementSet, Sampling, sample};
use crate::robot::posture;
use crate::simulate::{noise, perturbed, template};
use crate::unknown::State;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// What random numbers are for.
#[derive(Debug, Clone, Copy)]
pub(super) enum Purpose {
    /// The errors of the true robots.
    Robots,
    /// Planes, points, locations and measurements.
    Measurements,
    /// Postures in which tools are compared.
    Postures,
    /// The example on which a study is checked before it runs.
    Example,
}

/// A stream of random numbers of its own.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stream {
    pub seed: u64,
    pub level: usize,
    pub trial: usize,
}

impl Stream {
    /// Bits 56–63: the purpose; 48–55: the attempt; 32–47: the tool error; 0–31: the trial.
    pub fn rng(self, purpose: Purpose, attempt: usize) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let high = ((purpose as u64) << 24) | ((attempt as u64) << 16) | self.level as u64;
        rng.set_stream((high << 32) | self.trial as u64);
        rng
    }
}

/// How often places are drawn anew that a robot cannot reach often enough.
const ATTEMPTS: usize = 20;

/// What is measured in a trial.
pub(super) struct Drawn {
    /// Robots, planes, points, frames and tool points as they truly are.
    pub truth: State,
    /// The measurements.
    pub sets: Vec<MeasurementSet>,
    /// Others without noise, which the estimate does not see.
    pub fresh: Vec<MeasurementSet>,
}

/// The random errors of every robot, of the sizes in the study file.
pub(super) fn errors(study: &Study, case: &Case, stream: Stream) -> Vec<Vec<f64>> {
    let mut rng = stream.rng(Purpose::Robots, 0);
    let robots = study.arms.iter().zip(&case.chosen);
    robots
        .map(|(arm, chosen)| {
            let values = perturbed(&arm.robot, &study.errors, |k| chosen[k], &mut rng);
            let nominal = arm.robot.nominal();
            values.iter().zip(nominal).map(|(v, n)| v - n).collect()
        })
        .collect()
}

/// Nominal parameters plus `factor` times the errors.
pub(super) fn robots(study: &Study, errors: &[Vec<f64>], factor: f64) -> Vec<Vec<f64>> {
    let each = study.arms.iter().zip(errors);
    each.map(|(arm, errors)| {
        let nominal = arm.robot.nominal();
        let sums = nominal.iter().zip(errors).map(|(n, e)| n + factor * e);
        sums.collect()
    })
    .collect()
}

/// Random postures of every robot, in which tools are compared.
pub(super) fn postures(study: &Study, stream: Stream) -> Vec<Vec<Vec<f64>>> {
    let mut rng = stream.rng(Purpose::Postures, 0);
    let each = study.arms.iter().map(|arm| posture::limits(&arm.robot));
    each.map(|limits| {
        (0..study.configurations)
            .map(|_| posture::random(&limits, &mut rng))
            .collect()
    })
    .collect()
}

/// Draws places and measurements of the true robots; the number of attempts that led to places out
/// of reach comes along, and nothing else if all did.
///
/// # Errors
/// Whatever else is wrong with a constraint.
pub(super) fn measurements(
    study: &Study,
    case: &Case,
    robots: &[Vec<f64>],
    stream: Stream,
    purpose: Purpose,
) -> Result<(Option<Drawn>, usize), Error> {
    for attempt in 0..ATTEMPTS {
        let mut rng = stream.rng(purpose, attempt);
        match attempt_at(study, case, robots, &mut rng) {
            Ok(drawn) => return Ok((Some(drawn), attempt)),
            Err(Error::Unreachable { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    Ok((None, ATTEMPTS))
}

fn attempt_at(
    study: &Study,
    case: &Case,
    robots: &[Vec<f64>],
    rng: &mut ChaCha8Rng,
) -> Result<Drawn, Error> {
    let mut truth = State::of(robots.to_vec());
    let (mut sets, mut fresh) = (Vec::new(), Vec::new());
    for spec in &case.constraints {
        let empty = template(&study.source, &study.arms, spec, &mut truth, rng)?;
        let groups = empty.groups.len().max(1);
        let mut drawn = |count: usize, noise: Option<&[f64]>| {
            let sampling = Sampling {
                count,
                noise,
                near: None,
            };
            sample(&study.arms, &empty, &truth, &sampling, rng)
        };
        sets.push(drawn(spec.count, Some(&noise(spec)))?);
        fresh.push(drawn(study.configurations.div_ceil(groups), None)?);
    }
    Ok(Drawn { truth, sets, fresh })
}
