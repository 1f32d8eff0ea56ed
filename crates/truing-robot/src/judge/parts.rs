//! What rows that were not used say of models of joints.

use super::errors::Fitted;
use crate::doubt::Doubt;
use crate::error::Error;
use crate::estimate::{Job, Registration};
use crate::identify::Choice;
use crate::model::Assembly;

impl Job {
    /// Says which parts of the models of joints do not pay: without them, rows that were not used are predicted as well
    /// or better. Each part is held at nominal in turn, and all else is estimated again.
    pub fn doubt_models(
        &self,
        fitted: &Fitted,
        assembly: &Assembly,
        choices: &[Choice],
        doubts: &mut Vec<Doubt>,
    ) -> Result<(), Error> {
        if self.held_out.iter().all(|(_, set)| set.is_empty()) {
            return Ok(());
        }
        for (robot, arm) in self.arms.iter().enumerate() {
            let first = assembly.robot(robot).column();
            for (names, parameters) in arm.robot.model_parts() {
                let estimated = |k: &usize| choices[first + k] == Choice::Estimated;
                if !parameters.iter().any(estimated) {
                    continue;
                }
                let mut without = self.clone();
                for k in parameters {
                    without.estimate.wanted[robot][k] = false;
                }
                let Ok(solved) =
                    without.solve_checked(Registration::IfFar, &mut Vec::new(), &|_| ())
                else {
                    continue;
                };
                if !solved.solution.termination.converged() {
                    continue;
                }
                // The mean logarithm of the ratio of errors, over all measurements: it has no unit.
                let (mut sum, mut count) = (0.0, 0.0);
                for (_, set) in self.held_out.iter().filter(|(_, set)| !set.is_empty()) {
                    let with = self.errors(set, &fitted.estimated)?.rms;
                    let ratio = self.errors(set, &solved.estimated)?.rms / with;
                    sum += set.len() as f64 * ratio.ln();
                    count += set.len() as f64;
                }
                let change = (sum / count).exp() - 1.0;
                if change <= 0.0 {
                    let patterns: Vec<String> = names
                        .iter()
                        .map(|name| arm.prefixed(&format!("{name}_*")))
                        .collect();
                    doubts.push(Doubt::note(format!(
                        "the parameters {} do not pay: without them, rows that were not used are predicted {:.1} % better; leave them out \
                         (`fixed = [\"{}\"]`), or measure in more varied postures",
                        patterns.join(", "),
                        -change * 100.0,
                        patterns.join("\", \"")
                    )));
                }
            }
        }
        Ok(())
    }
}
