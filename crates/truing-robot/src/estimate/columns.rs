//! The problem of an estimate: the chosen columns free, bounds and priors.

use super::drawing::Prior;
use super::job::Job;
use crate::error::Error;
use crate::identify::Choice;
use crate::model::Assembly;
use crate::unknown::State;

impl Job {
    /// The problem at a state with the chosen columns free; if it is a `full` one with bounds and priors, among them
    /// those by which parameters are held near nominal.
    pub fn columns_assembled(
        &self,
        from: &State,
        choices: &[Choice],
        full: bool,
        held: &[Prior],
    ) -> Result<Assembly, Error> {
        let mut assembly = Assembly::new(&self.arms, &self.sets, from, &self.estimate.derivatives)?;
        let free: Vec<usize> = (0..choices.len())
            .filter(|c| choices[*c] == Choice::Estimated)
            .collect();
        assembly.free_only(&free);
        if full {
            for (robot, parameter, lower, upper) in &self.estimate.bounds {
                let var = assembly.robot(*robot);
                let nominal = self.arms[*robot].robot.parameters()[*parameter].nominal;
                let (lower, upper) = (nominal + lower, nominal + upper);
                assembly
                    .problem
                    .bound_component(var, *parameter, lower, upper);
            }
            for (robot, parameter, sigma) in self.estimate.priors.iter().chain(held) {
                let var = assembly.robot(*robot);
                if choices[var.column() + parameter] == Choice::Estimated {
                    let nominal = self.arms[*robot].robot.nominal();
                    assembly
                        .problem
                        .prior_components(var, &nominal, &[(*parameter, *sigma)])?;
                }
            }
        }
        Ok(assembly)
    }
}
