//! Inputs that are probably wrong: the simplest mistake that explains what was measured.

use crate::doubt::{Doubt, Suspect};
use crate::error::Error;
use crate::estimate::Job;
use crate::measurement::{MeasurementSet, Seen};
use crate::robot::{Arm, JointKind};
use crate::start::start;
use crate::unknown::State;
use std::f64::consts::{FRAC_PI_2, PI};

/// The nominal robot misses its data by this part of its reach before mistakes are looked for.
const FAR: f64 = 0.02;

/// A mistake explains the data if correcting it leaves so little of the residuals.
const EXPLAINED: f64 = 0.25;

/// So many rows of a set show a mistake.
const ENOUGH: usize = 300;

impl Job {
    /// The simplest mistake in the files that brings the registered nominal robot near what was measured, where it is
    /// far as the files stand: every one of a list is tried, with the frames, tools and planes registered again.
    pub fn doubt_inputs(&self, registered: &State, doubts: &mut Vec<Doubt>) -> Result<(), Error> {
        if self.misfit(registered)? < FAR * self.reach() {
            return Ok(());
        }
        let few = self.thinned();
        let before = rms(&few.whitened(registered)?);
        let mut best: Option<(f64, Suspect)> = None;
        for (suspect, correct) in self.mistakes() {
            let mut job = self.clone();
            correct(&mut job.sets);
            let job = job.thinned();
            let begin = start(&job.arms, &job.sets, job.nominal(), &State::default());
            let Ok((state, _)) = job.register(&begin) else {
                continue;
            };
            let after = rms(&job.whitened(&state)?);
            if after < EXPLAINED * before && best.as_ref().is_none_or(|(least, _)| after < *least) {
                best = Some((after, suspect));
            }
        }
        if let Some((after, suspect)) = best {
            doubts.push(Doubt::Input {
                suspect,
                before,
                after,
            });
        }
        Ok(())
    }

    /// The same with few rows of sets that have no groups, which need all of theirs.
    fn thinned(&self) -> Self {
        let mut job = self.clone();
        for set in job
            .sets
            .iter_mut()
            .filter(|set| set.kind.grouping().is_none())
        {
            let every = set.len().div_ceil(ENOUGH).max(1);
            let rows: Vec<usize> = (0..set.len()).step_by(every).collect();
            *set = set.rows(&rows);
        }
        job
    }

    /// Every mistake of the list, with what corrects it.
    fn mistakes(&self) -> Vec<(Suspect, Correction)> {
        let mut all: Vec<(Suspect, Correction)> = Vec::new();
        for (robot, arm) in self.arms.iter().enumerate() {
            let joints = arm.robot.joints();
            let name = |k: usize| arm.prefixed(&joints[k].name);
            for (k, joint) in joints.iter().enumerate() {
                if joint.kind == JointKind::Revolute {
                    for offset in [FRAC_PI_2, -FRAC_PI_2, PI] {
                        let suspect = Suspect::ZeroOffset {
                            joint: name(k),
                            offset,
                        };
                        all.push((suspect, read(arm, robot, move |q| q[k] += offset)));
                    }
                }
                let suspect = Suspect::Direction { joint: name(k) };
                all.push((suspect, read(arm, robot, move |q| q[k] = -q[k])));
                for other in 0..k {
                    let suspect = Suspect::Swapped {
                        joint: name(other),
                        other: name(k),
                    };
                    all.push((suspect, read(arm, robot, move |q| q.swap(other, k))));
                }
            }
            let turns = self.sets.iter().flat_map(|set| &set.tools);
            let turns = turns
                .filter(|tool| tool.robot == robot)
                .flat_map(|tool| &tool.q);
            let largest = turns
                .flat_map(|q| q.iter().zip(joints))
                .filter(|(_, joint)| joint.kind == JointKind::Revolute)
                .fold(0.0_f64, |most, (q, _)| most.max(q.abs()));
            if largest > 2.0 * PI {
                let revolute: Vec<usize> = (0..joints.len())
                    .filter(|k| joints[*k].kind == JointKind::Revolute)
                    .collect();
                let degrees = move |q: &mut [f64]| {
                    revolute.iter().for_each(|k| q[*k] = q[*k].to_radians());
                };
                all.push((Suspect::Degrees, read(arm, robot, degrees)));
            }
        }
        for (s, set) in self.sets.iter().enumerate() {
            if set.len() < 3 || !(0..set.len()).all(|row| reads_a_place(set, row)) {
                continue;
            }
            for rows in [1, -1] {
                let suspect = Suspect::Shifted {
                    set: set.name.clone(),
                    rows,
                };
                let correct = move |sets: &mut [MeasurementSet]| {
                    for tool in &mut sets[s].readings.tools {
                        match rows {
                            1 => tool.q.rotate_left(1),
                            _ => tool.q.rotate_right(1),
                        }
                    }
                };
                all.push((suspect, Box::new(correct)));
            }
            if set.dim() == 3 {
                let suspect = Suspect::Mirrored {
                    set: set.name.clone(),
                };
                all.push((suspect, values(s, |place| place[0] = -place[0])));
            }
            for factor in [1e-3, 1e3, 0.0254, 1.0 / 0.0254] {
                let suspect = Suspect::Scale {
                    set: set.name.clone(),
                    factor,
                };
                all.push((
                    suspect,
                    values(s, move |place| place.iter_mut().for_each(|x| *x *= factor)),
                ));
            }
        }
        all
    }
}

/// What corrects a mistake in the sets of a calibration.
type Correction = Box<dyn Fn(&mut [MeasurementSet])>;

/// A correction of what a robot's joints read. What was derived from that is derived again.
fn read(arm: &Arm, robot: usize, change: impl Fn(&mut [f64]) + 'static) -> Correction {
    let given = arm.robot.given();
    Box::new(move |sets| {
        let tools = sets.iter_mut().flat_map(|set| &mut set.readings.tools);
        for q in tools
            .filter(|tool| tool.robot == robot)
            .flat_map(|tool| &mut tool.q)
        {
            q.truncate(given);
            change(q);
        }
    })
}

/// A correction of the places that a set's rows begin with.
fn values(set: usize, change: impl Fn(&mut [f64]) + 'static) -> Correction {
    Box::new(move |sets| {
        for row in 0..sets[set].len() {
            change(&mut sets[set].readings.values.row_mut(row)[..3]);
        }
    })
}

/// Whether a row begins with the place that a sensor saw.
fn reads_a_place(set: &MeasurementSet, row: usize) -> bool {
    let values = set.readings.values.row(row);
    let place = match set.kind.seen(values) {
        Some(Seen::Position(place)) => place,
        Some(Seen::Pose(pose)) => pose.translation,
        None => return false,
    };
    values.get(..3) == Some(place.as_slice())
}

fn rms(r: &[f64]) -> f64 {
    (r.iter().map(|r| r * r).sum::<f64>() / r.len().max(1) as f64).sqrt()
}
