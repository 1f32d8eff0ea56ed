//! Whether the calibrated robot predicts what it was not estimated from.

use super::clusters::clusters;
use super::errors::Fitted;
use super::figures::ToolEverywhere;
use super::foresight::Place;
use super::leave_out::LeaveOut;
use super::uncertainty::Judged;
use crate::doubt::{Doubt, Forecast};
use crate::error::Error;
use crate::estimate::Job;
use crate::identify::Choice;
use crate::model::Assembly;

/// Clusters of postures a set is divided into, at most, and regions.
const CLUSTERS: usize = 20;
const REGIONS: usize = 4;

/// So many standard errors are no chance, one-sided at 5 %.
const BEYOND_CHANCE: f64 = 1.645;

/// Where the tool is asked for far from what was measured, fewer standard errors than these are too few.
const WILD: f64 = 0.5;

/// At the postures that were measured these are enough, one-sided at 10 %: leaving out has asked already.
const LIKELY: f64 = 1.28;

/// A change of the robot is one of its size if this part of it is.
const MOSTLY: f64 = 0.5;

/// The same where lengths have grown beyond chance.
const PARTLY: f64 = 0.3;

/// Level at which lengths have not grown by chance.
const UNLIKELY: f64 = 0.01;

/// Fewer different postures than this part of the rows are worth saying.
const REPEATED: f64 = 0.5;

impl Job {
    /// Doubts from leaving clusters of postures out, and from the tool all over the joints' ranges.
    pub fn doubt_forecast(
        &self,
        fitted: &Fitted,
        assembly: &Assembly,
        choices: &[Choice],
        judged: &Judged,
        doubts: &mut Vec<Doubt>,
    ) -> Result<Vec<ToolEverywhere>, Error> {
        let mut rows = self.estimate.priors.len();
        for set in &self.sets {
            let postures = clusters(&self.arms, set, set.len())
                .into_iter()
                .max()
                .map_or(0, |last| last + 1);
            rows += postures * set.dim();
            if (postures as f64) < REPEATED * set.len() as f64 {
                doubts.push(Doubt::Duplicated {
                    set: set.name.clone(),
                    rows: set.len(),
                    postures,
                });
            }
        }
        // Measured again, a posture says nothing of another: only different ones check unknowns.
        let unknowns = choices.iter().filter(|c| **c == Choice::Estimated).count();
        let all: usize = self.sets.iter().map(|set| set.len() * set.dim()).sum();
        if rows <= unknowns && all > unknowns {
            doubts.push(Doubt::Unchecked { rows });
        }
        let left_out = self.leave_out(judged, &fitted.registered, CLUSTERS)?;
        let count = left_out.clusters.len();
        if count < 2 {
            doubts.push(Doubt::OnePosture);
            return Ok(Vec::new());
        }
        let (gain, ratio) = (left_out.gain(), left_out.ratio());
        let forecast = match gain {
            gain if gain > BEYOND_CHANCE => Forecast::Better,
            gain if gain < -BEYOND_CHANCE => Forecast::Worse,
            _ => Forecast::Chance,
        };
        if forecast != Forecast::Better {
            doubts.push(Doubt::Prediction {
                forecast,
                ratio,
                gain,
                clusters: count,
            });
        }
        // What is wrong in the same way in near postures shows where whole regions are left out.
        let regions = self.leave_out(judged, &fitted.registered, REGIONS)?;
        let all = [left_out, regions];
        let mut tools = Vec::new();
        let foresee = |left_out: &[LeaveOut], place| {
            self.foresee(fitted, assembly, choices, judged, left_out, place)
        };
        for here in foresee(&all[..1], Place::Measured) {
            if here.gain < LIKELY {
                doubts.push(Doubt::Elsewhere {
                    robot: self.arms[here.robot].title().to_owned(),
                    expected: here.expected,
                    nominal: here.nominal(),
                    gain: here.gain,
                    measured: true,
                    fatal: true,
                });
            }
        }
        for foresight in foresee(&all, Place::Everywhere) {
            let robot = self.arms[foresight.robot].title().to_owned();
            tools.push(ToolEverywhere {
                robot: self.arms[foresight.robot].name.clone(),
                expected: foresight.expected,
                bound: foresight.bound,
                nominal: foresight.nominal(),
                change: foresight.change,
            });
            // Joints that slide do not grow along: they contradict it.
            let grown = foresight.grown;
            let likely = grown.p_value < UNLIKELY && grown.share > PARTLY;
            if likely || (grown.misfit && grown.share > MOSTLY) {
                doubts.push(Doubt::Grown {
                    robot: robot.clone(),
                    factor: foresight.grown.factor,
                    share: foresight.grown.share,
                });
            }
            if foresight.gain < BEYOND_CHANCE {
                doubts.push(Doubt::Elsewhere {
                    robot,
                    expected: foresight.expected,
                    nominal: foresight.nominal(),
                    gain: foresight.gain,
                    measured: false,
                    // Touches that do not fit show a part of what is wrong.
                    fatal: foresight.gain < if foresight.blind { LIKELY } else { WILD },
                });
            }
        }
        Ok(tools)
    }
}
