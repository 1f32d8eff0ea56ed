//! Inputs that are probably wrong: the simplest mistake that explains what was measured.

use crate::doubt::{Doubt, Suspect};
use crate::error::Error;
use crate::estimate::Job;
use crate::model::Assembly;
use crate::start::start;
use crate::unknown::State;
use std::f64::consts::{FRAC_PI_2, PI};
use truing::LeastSquares;

/// The nominal robot misses its data by this part of its reach before mistakes are looked for.
const FAR: f64 = 0.02;

/// A mistake explains the data if correcting it leaves so little of the residuals.
const EXPLAINED: f64 = 0.25;

impl Job {
    /// The simplest mistake in the files that brings the registered nominal robot near what was measured, where it is
    /// far as the files stand: every one of a list is tried, with the frames, tools and planes registered again.
    pub fn doubt_inputs(&self, registered: &State, doubts: &mut Vec<Doubt>) -> Result<(), Error> {
        if self.misfit(registered)? < FAR * self.reach() {
            return Ok(());
        }
        let before = self.weighted(registered)?;
        let mut best: Option<(f64, Suspect)> = None;
        for (suspect, job) in self.mistakes() {
            let begin = start(&job.arms, &job.sets, job.nominal(), &State::default());
            let Ok((state, _)) = job.register(&begin) else {
                continue;
            };
            let after = job.weighted(&state)?;
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

    /// RMS of the whitened residuals at a state.
    fn weighted(&self, state: &State) -> Result<f64, Error> {
        let sets: Vec<_> = self.sets.iter().map(|set| set.unweighted()).collect();
        let assembly = Assembly::new(&self.arms, &sets, state, &self.estimate.derivatives)?;
        let mut r = vec![0.0; assembly.problem.rows()];
        assembly
            .problem
            .residual(assembly.problem.initial(), &mut r);
        Ok((r.iter().map(|r| r * r).sum::<f64>() / r.len().max(1) as f64).sqrt())
    }

    /// This calibration with one mistake corrected, for every mistake of the list.
    fn mistakes(&self) -> Vec<(Suspect, Self)> {
        let mut all = Vec::new();
        for (robot, arm) in self.arms.iter().enumerate() {
            let joints = arm.robot.joints();
            let name = |k: usize| arm.prefixed(&joints[k].name);
            let read = |change: &dyn Fn(&mut Vec<f64>)| {
                let mut job = self.clone();
                for tool in job.sets.iter_mut().flat_map(|set| &mut set.readings.tools) {
                    if tool.robot == robot {
                        tool.q.iter_mut().for_each(change);
                    }
                }
                job
            };
            for k in 0..joints.len() {
                if joints[k].kind == crate::robot::JointKind::Revolute {
                    for offset in [FRAC_PI_2, -FRAC_PI_2, PI] {
                        let suspect = Suspect::ZeroOffset {
                            joint: name(k),
                            offset,
                        };
                        all.push((suspect, read(&|q| q[k] += offset)));
                    }
                }
                all.push((
                    Suspect::Direction { joint: name(k) },
                    read(&|q| q[k] = -q[k]),
                ));
                for other in 0..k {
                    let suspect = Suspect::Swapped {
                        joint: name(other),
                        other: name(k),
                    };
                    all.push((suspect, read(&|q| q.swap(other, k))));
                }
            }
            let largest = (self.sets.iter().flat_map(|set| &set.tools))
                .filter(|tool| tool.robot == robot)
                .flat_map(|tool| tool.q.iter().flatten())
                .fold(0.0_f64, |most, q| most.max(q.abs()));
            if largest > 2.0 * PI {
                all.push((
                    Suspect::Degrees,
                    read(&|q| q.iter_mut().for_each(|q| *q = q.to_radians())),
                ));
            }
        }
        for (s, set) in self.sets.iter().enumerate() {
            let seen =
                (0..set.len()).all(|row| set.kind.seen(set.readings.values.row(row)).is_some());
            if !seen || set.len() < 3 {
                continue;
            }
            for rows in [1_usize, set.len() - 1] {
                let mut job = self.clone();
                job.sets[s]
                    .readings
                    .tools
                    .iter_mut()
                    .for_each(|tool| tool.q.rotate_left(rows));
                let signed = if rows == 1 { 1 } else { -1 };
                all.push((
                    Suspect::Shifted {
                        set: set.name.clone(),
                        rows: signed,
                    },
                    job,
                ));
            }
            let changed = |change: &dyn Fn(&mut [f64])| {
                let mut job = self.clone();
                (0..set.len()).for_each(|row| change(job.sets[s].readings.values.row_mut(row)));
                job
            };
            if set.dim() == 3 {
                all.push((
                    Suspect::Mirrored {
                        set: set.name.clone(),
                    },
                    changed(&|row| row[0] = -row[0]),
                ));
            }
            for factor in [1e-3, 1e3, 0.0254, 1.0 / 0.0254] {
                let suspect = Suspect::Scale {
                    set: set.name.clone(),
                    factor,
                };
                all.push((
                    suspect,
                    changed(&|row| row[..3].iter_mut().for_each(|x| *x *= factor)),
                ));
            }
        }
        all
    }
}
