//! Whether the calibrated robot predicts what it was not estimated from.

use super::clusters::{clusters, postures};
use super::errors::Fitted;
use super::figures::ToolEverywhere;
use super::foresight::{Foreseer, Foresight, Place};
use super::leave_out::{Comparison, LinearModel};
use super::uncertainty::Judged;
use crate::doubt::{Doubt, Forecast};
use crate::error::Error;
use crate::estimate::Job;
use crate::identify::Choice;
use crate::measurement::MeasurementSet;
use crate::model::Assembly;

/// Clusters of postures a set is divided into, at most, and regions.
const CLUSTERS: usize = 20;
const REGIONS: usize = 4;

/// So many standard errors are no chance, one-sided at 5 %.
const BEYOND_CHANCE: f64 = 1.645;

/// At the postures that were measured these are enough, one-sided at 10 %: leaving out has asked already.
const LIKELY: f64 = 1.28;

/// Where the tool is asked for far from what was measured, fewer standard errors than these are too few.
const WILD: f64 = 0.5;

/// A change of the robot is one of its size if this part of it is, and residuals contradict it: joints that slide do
/// not grow along.
const MOSTLY: f64 = 0.5;

/// The same where lengths have grown beyond chance, at this level.
const PARTLY: f64 = 0.3;
const UNLIKELY: f64 = 0.01;

/// Fewer different postures than this part of the rows are worth saying.
const REPEATED: f64 = 0.5;

impl Job {
    /// Doubts from leaving clusters of postures out, from rows that were not used, and from the tool all over the joints'
    /// ranges.
    pub fn doubt_forecast(
        &self,
        fitted: &Fitted,
        assembly: &Assembly,
        choices: &[Choice],
        judged: &Judged,
        doubts: &mut Vec<Doubt>,
    ) -> Result<Vec<ToolEverywhere>, Error> {
        self.doubt_repetitions(choices, doubts);
        let model = LinearModel::new(self, judged, &fitted.registered)?;
        let left_out = model.leave_out(CLUSTERS);
        if left_out.comparison.clusters() < 2 {
            doubts.push(Doubt::OnePosture);
            return Ok(Vec::new());
        }
        // What is wrong in the same way in near postures shows where whole regions are left out.
        let regions = model.leave_out(REGIONS);
        let foreseer = Foreseer {
            job: self,
            fitted,
            assembly,
            choices,
            judged,
        };
        // Rows that were not used have the first word on what was measured.
        let unused_are_better = self.unused_are_better(fitted)?;
        if !unused_are_better {
            doubts.extend(doubt_of(&left_out.comparison));
            let measured = foreseer.foresee(&model.free, &[&left_out], Place::Measured);
            let unsure = measured.iter().filter(|here| here.gain < LIKELY);
            doubts.extend(unsure.map(|here| self.elsewhere(here, Place::Measured, true)));
        }
        // Touches see a part of the tool only; bounds say what the covariance does not.
        let misfit = judged.misfit().is_some();
        let blind = foreseer.is_scale_free() && self.estimate.bounds.is_empty();
        let least = if blind && (misfit || !unused_are_better) {
            LIKELY
        } else {
            WILD
        };
        let everywhere = foreseer.foresee(&model.free, &[&left_out, &regions], Place::Everywhere);
        for tool in &everywhere {
            let grown = tool.grown;
            let likely = grown.p_value < UNLIKELY && grown.share > PARTLY;
            if likely || (misfit && grown.share > MOSTLY) {
                doubts.push(Doubt::Grown {
                    robot: self.arms[tool.robot].title().to_owned(),
                    factor: grown.factor,
                    share: grown.share,
                });
            }
            if tool.gain < BEYOND_CHANCE {
                doubts.push(self.elsewhere(tool, Place::Everywhere, tool.gain < least));
            }
        }
        let tool = |tool: &Foresight| ToolEverywhere {
            robot: self.arms[tool.robot].name.clone(),
            expected: tool.expected,
            bound: tool.bound,
            nominal: tool.nominal(),
            change: tool.change,
        };
        Ok(everywhere.iter().map(tool).collect())
    }

    /// Rows of one posture count once: measured again, it says nothing of another.
    fn doubt_repetitions(&self, choices: &[Choice], doubts: &mut Vec<Doubt>) {
        let (mut all, mut different) = (0, 0);
        for set in &self.sets {
            let postures = postures(&self.arms, set);
            all += set.len() * set.dim();
            different += postures * set.dim();
            if (postures as f64) < REPEATED * set.len() as f64 {
                doubts.push(Doubt::Duplicated {
                    set: set.name.clone(),
                    rows: set.len(),
                    postures,
                });
            }
        }
        let unknowns = choices.iter().filter(|c| **c == Choice::Estimated).count();
        let (all, different) = (
            all + self.estimate.priors.len(),
            different + self.estimate.priors.len(),
        );
        if different <= unknowns && all > unknowns {
            doubts.push(Doubt::Unchecked { rows: different });
        }
    }

    /// Whether rows that were not used, all together, are predicted better than by the registered nominal robot, beyond
    /// chance; not if there are none. A set that is worse is a doubt of its own.
    fn unused_are_better(&self, fitted: &Fitted) -> Result<bool, Error> {
        let mut unused = Comparison::default();
        for (_, set) in self.held_out.iter().filter(|(_, set)| !set.is_empty()) {
            let calibrated = self.residuals(set, &fitted.estimated)?;
            let registered = self.residuals(set, &fitted.registered)?;
            unused.append(self.compared(set, &calibrated, &registered));
        }
        for set in &self.validate {
            let calibrated = self.fitted_residuals(set, &fitted.estimated)?;
            let registered = self.fitted_residuals(set, &fitted.registered)?;
            unused.append(self.compared(set, &calibrated, &registered));
        }
        Ok(unused.gain() > BEYOND_CHANCE)
    }

    /// Residuals of one robot beside another's, cluster after cluster of a set's postures.
    fn compared(&self, set: &MeasurementSet, of: &[f64], other: &[f64]) -> Comparison {
        let clusters = clusters(&self.arms, set, CLUSTERS);
        let mut squares = vec![(0.0, 0.0); clusters.iter().max().map_or(0, |last| last + 1)];
        // By the first thing that is measured, as errors are: others have other units.
        let rows = set.kind.measurands()[0].rows;
        let pairs = of
            .chunks_exact(set.dim())
            .zip(other.chunks_exact(set.dim()));
        for (cluster, (a, b)) in clusters.iter().zip(pairs) {
            let square = |r: &[f64]| r[..rows].iter().map(|r| r * r).sum::<f64>();
            squares[*cluster].0 += square(a);
            squares[*cluster].1 += square(b);
        }
        Comparison::of(squares.into_iter())
    }

    fn elsewhere(&self, tool: &Foresight, place: Place, fatal: bool) -> Doubt {
        Doubt::Elsewhere {
            robot: self.arms[tool.robot].title().to_owned(),
            expected: tool.expected,
            nominal: tool.nominal(),
            gain: tool.gain,
            measured: place == Place::Measured,
            fatal,
        }
    }
}

/// A doubt unless the calibrated robot is the better one beyond chance.
fn doubt_of(comparison: &Comparison) -> Option<Doubt> {
    let gain = comparison.gain();
    let forecast = if gain > BEYOND_CHANCE {
        return None;
    } else if gain < -BEYOND_CHANCE {
        Forecast::Worse
    } else {
        Forecast::Chance
    };
    Some(Doubt::Prediction {
        forecast,
        ratio: comparison.ratio(),
        gain,
        clusters: comparison.clusters(),
    })
}
