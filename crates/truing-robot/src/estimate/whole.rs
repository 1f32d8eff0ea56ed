//! The estimate of a calibration: start, registration, what can be estimated, the solution.

use super::drawing::{Held, Prior};
use super::job::Job;
use super::solve::FAR;
use super::stage::Stage;
use super::words::shortened;
use crate::doubt::Doubt;
use crate::error::Error;
use crate::identify::{Choice, in_order, select};
use crate::model::{Assembly, Owner};
use crate::start::start;
use crate::unknown::State;
use truing::Solution;

/// Whether the nominal robot is registered before the estimate.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Registration {
    /// Always, as the baseline that improvements are compared with.
    Always,
    /// Only where an estimate may have to start there: the robot does not stand where its file says.
    #[default]
    IfFar,
    /// Never: the estimate starts at nominal.
    Never,
}

/// What the estimate leaves for the reports.
pub(crate) struct Solved {
    pub begin: State,
    pub registered: State,
    pub estimated: State,
    pub assembly: Assembly,
    pub choices: Vec<Choice>,
    pub solution: Solution,
    /// The priors of manufacturing size.
    pub held: Vec<Prior>,
    /// Their size as a part of the robots' dimensions; none where nothing is held.
    pub part: Option<f64>,
}

impl Job {
    /// Start, registration, selection, estimate.
    pub fn solve_checked(
        &self,
        registration: Registration,
        doubts: &mut Vec<Doubt>,
        watch: &dyn Fn(Stage),
    ) -> Result<Solved, Error> {
        let derivatives = &self.estimate.derivatives;
        let begin = start(&self.arms, &self.sets, self.nominal(), &State::default());

        watch(Stage::Registering);
        let layout = Assembly::new(&self.arms, &self.sets, &begin, derivatives)?;
        let off = self.misfit(&begin)?;
        let mut registered = begin.clone();
        if registration == Registration::Always
            || (registration == Registration::IfFar && off > FAR * self.reach())
        {
            let solution;
            (registered, solution) = self.register(&begin)?;
            if !solution.termination.converged() {
                doubts.push(Doubt::note(format!(
                    "the registration of the nominal robot, with which it is compared, did not converge: {}",
                    solution.termination
                )));
            }
        }

        let near = self.near(&begin, &registered)?;

        watch(Stage::Identifying);
        let wanted = in_order(&layout, &self.estimate.preference, |owner| match owner {
            Owner::Parameter { robot, parameter } => self.wants(*robot, *parameter),
            _ => true,
        });
        let priors: Vec<usize> = self
            .estimate
            .priors
            .iter()
            .map(|(robot, parameter, _)| layout.robot(*robot).column() + parameter)
            .collect();
        let choices = select(&self.arms, &self.sets, &near, derivatives, &wanted, &priors)?;
        let rows = layout.problem.rows();
        // What the structure allows: with too few rows, which of it these data excite is chance.
        let unknowns = choices
            .iter()
            .filter(|c| matches!(c, Choice::Estimated | Choice::Unexcited))
            .count();
        // A prior counts for a parameter that is estimated, or would be without it.
        let counts = |c: &&usize| matches!(choices[**c], Choice::Estimated | Choice::Unexcited);
        let idle: Vec<String> = priors
            .iter()
            .filter(|c| !counts(c))
            .map(|c| layout.columns[*c].name.clone())
            .collect();
        let priors = priors.iter().filter(counts).count();
        if !idle.is_empty() && priors == 0 {
            doubts.push(Doubt::note(format!(
                "no prior has an effect: {} are not estimated",
                shortened(&idle)
            )));
        }
        if rows + priors < unknowns {
            return Err(Error::calibration(
                format!(
                    "found {rows} measured values for {unknowns} unknowns (parameters, frames, tool points, planes and \
                     points together); expected at least as many values"
                ),
                "measure more configurations, or estimate fewer parameters (`parameters`, `fixed`)",
            ));
        }
        if rows + priors == unknowns {
            doubts.push(Doubt::Unchecked { rows });
        }

        watch(Stage::Estimating);
        let near = match &self.estimate.from {
            Some(robots) => start(&self.arms, &self.sets, robots.clone(), &State::default()),
            None => near,
        };
        let from = self.starting_state(&near, &choices, &layout);
        let Held {
            assembly,
            state: estimated,
            solution,
            held,
            part,
        } = self.solve_held(&from, &choices, &layout, doubts)?;
        Ok(Solved {
            begin,
            registered,
            estimated,
            assembly,
            choices,
            solution,
            held,
            part,
        })
    }
}
