//! Drawing measurements: postures that satisfy their constraints exactly, or exactly but for noise.

use super::at::At;
use super::draw::Draw;
use super::groups::{Groups, Rows};
use super::readings::Tool;
use super::set::MeasurementSet;
use crate::error::Error;
use crate::robot::{Arm, posture};
use crate::unknown::State;
use rand_chacha::ChaCha8Rng;
use truing::Loss;

/// How a set of measurements is drawn.
#[derive(Debug, Clone, Copy)]
pub struct Sampling<'a> {
    /// How many measurements of each group.
    pub count: usize,
    /// Standard deviations of the noise added to what is measured, one a measurand; none for no noise.
    pub noise: Option<&'a [f64]>,
    /// Postures near which every second one is looked for; none to draw all between the joint limits.
    pub near: Option<&'a MeasurementSet>,
}

/// Draws a set like `set` (its kind, groups, frame and tool points; its rows do not matter) of robots
/// and unknowns as in `state`.
///
/// Touches, visits and distances are found by solving the inverse kinematics for the place that the
/// noise moved the contact to; a posture that is not found is never returned.
///
/// # Errors
/// If what is to be reached is out of reach.
pub fn sample(
    arms: &[Arm],
    set: &MeasurementSet,
    state: &State,
    sampling: &Sampling<'_>,
    rng: &mut ChaCha8Rng,
) -> Result<MeasurementSet, Error> {
    let limits: Vec<[f64; 2]> = set
        .tools
        .iter()
        .flat_map(|tool| posture::limits(&arms[tool.robot].robot))
        .collect();
    let measurands = set.kind.measurands();
    let none = vec![0.0; measurands.len()];
    let noise = sampling.noise.unwrap_or(&none);
    let mut postures = vec![Vec::new(); set.tools.len()];
    let mut values = Rows::new(set.kind.columns().len());
    for group in 0..set.groups.len() {
        let near = near(arms, sampling.near, group);
        let mut draw = Draw {
            at: At {
                arms,
                readings: &set.readings,
                state,
            },
            group,
            noise,
            limits: &limits,
            near: &near,
            rng: &mut *rng,
            attempt: 0,
            posture: Vec::new(),
        };
        for attempt in 0..sampling.count {
            draw.attempt = attempt;
            values.push(&set.kind.draw(&mut draw)?);
            let mut rest = &draw.posture[..];
            for (tool, postures) in set.tools.iter().zip(&mut postures) {
                let robot = &arms[tool.robot].robot;
                let (own, others) = rest.split_at(robot.given());
                postures.push(robot.complete(own).into_owned());
                rest = others;
            }
        }
    }
    // What has no noise is weighted as by default.
    let usual = (!set.sigma.as_slice().is_empty()).then(|| set.sigma.row(0));
    let sigma: Vec<f64> = (0..measurands.len())
        .map(|k| match usual {
            _ if noise[k] > 0.0 => noise[k],
            Some(usual) => usual[k],
            None => measurands[k].sigma,
        })
        .collect();
    let mut drawn = set.clone();
    let readings = &mut drawn.readings;
    let rows = sampling.count * set.groups.len();
    for (tool, q) in readings.tools.iter_mut().zip(postures) {
        tool.q = q;
    }
    readings.values = values;
    readings.groups = Groups {
        names: set.groups.names.clone(),
        of_row: (0..set.groups.len())
            .flat_map(|g| std::iter::repeat_n(g, sampling.count))
            .collect(),
    };
    readings.sigma = Rows::repeated(&sigma, rows);
    readings.loss = Loss::Trivial;
    readings.origin = None;
    Ok(drawn)
}

/// The postures of all tools in the rows of a group of a set, one after another.
fn near(arms: &[Arm], set: Option<&MeasurementSet>, group: usize) -> Vec<Vec<f64>> {
    let Some(set) = set else {
        return Vec::new();
    };
    let posture = |row: usize| {
        let tools = set.tools.iter();
        let given = |tool: &Tool| tool.q[row][..arms[tool.robot].robot.given()].to_vec();
        tools.flat_map(given).collect()
    };
    set.groups.rows(group).map(posture).collect()
}
