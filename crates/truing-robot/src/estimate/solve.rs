//! From a state to the estimate: registration, where to start, and the least-squares problem.

use super::drawing::Prior;
use super::job::Job;
use super::search::left;
use crate::doubt::{Doubt, SearchEnd};
use crate::error::Error;
use crate::identify::{Choice, in_order, select};
use crate::measurement::MeasurementSet;
use crate::model::{Assembly, Owner};
use crate::start::{start, start_eliminated};
use crate::unknown::State;
use std::time::Instant;
use truing::{LeastSquares, Settings, Solution, Termination, Values};
use truing::{solve_from, solve_graduated, solve_graduated_from};

impl Job {
    /// Where the estimate starts. A base far from where its file puts it is where the registration
    /// found it. Otherwise the file knows better: a registration that the data hardly determine may wander.
    pub fn near(&self, begin: &State, registered: &State) -> Result<State, Error> {
        let off = self.misfit(begin)?;
        let far = off > FAR * self.reach() && self.misfit(registered)? < 0.5 * off;
        Ok(if far { registered } else { begin }.clone())
    }

    /// The nominal robot with frames, base, tool points, planes and points estimated.
    ///
    /// Where a plane or point is out of reach of the robot as its file places it, positions and poses
    /// place it first.
    pub fn register(&self, begin: &State) -> Result<(State, Solution), Error> {
        let preference = &self.estimate.preference;
        let layout = Assembly::new(&self.arms, &self.sets, begin, &self.estimate.derivatives)?;
        let bases: Vec<Vec<usize>> = self
            .arms
            .iter()
            .map(|arm| arm.robot.base_parameters())
            .collect();
        let wanted = in_order(&layout, preference, |owner| match owner {
            Owner::Parameter { robot, parameter } => {
                bases[*robot].contains(parameter) && self.wants(*robot, *parameter)
            }
            _ => true,
        });
        let derivatives = &self.estimate.derivatives;
        let choices = match select(&self.arms, &self.sets, begin, derivatives, &wanted, &[]) {
            Err(Error::Unreachable { message, help }) => {
                let seen = |set: &&MeasurementSet| set.kind.has_frame();
                let sets: Vec<MeasurementSet> = self.sets.iter().filter(seen).cloned().collect();
                if sets.is_empty() || sets.len() == self.sets.len() {
                    return Err(Error::Unreachable { message, help });
                }
                let placing = Self {
                    sets,
                    ..self.clone()
                };
                let nominal = start(&self.arms, &placing.sets, self.nominal(), &State::default());
                let placed = placing.register(&nominal)?.0.robots;
                let begin = start(&self.arms, &self.sets, placed, &State::default());
                let choices = select(&self.arms, &self.sets, &begin, derivatives, &wanted, &[])?;
                let (_, state, solution) = self.solve_columns(&begin, &choices, false)?;
                return Ok((state, solution));
            }
            choices => choices?,
        };
        let (_, state, solution) = self.solve_columns(begin, &choices, false)?;
        Ok((state, solution))
    }

    /// Where the estimate starts: near a state, inside the bounds, with what is not estimated at
    /// nominal.
    pub fn starting_state(&self, near: &State, choices: &[Choice], layout: &Assembly) -> State {
        let mut robots = self.nominal();
        for (c, column) in layout.columns.iter().enumerate() {
            if let (Choice::Estimated, Owner::Parameter { robot, parameter }) =
                (&choices[c], &column.owner)
            {
                robots[*robot][*parameter] = near.robots[*robot][*parameter];
            }
        }
        for (robot, parameter, lower, upper) in &self.estimate.bounds {
            let nominal = self.arms[*robot].robot.parameters()[*parameter].nominal;
            let value = &mut robots[*robot][*parameter];
            *value = value.max(nominal + lower).min(nominal + upper);
        }
        if robots == near.robots {
            return near.clone();
        }
        start(&self.arms, &self.sets, robots, &State::default())
    }

    /// The estimate: from a state, with parameters held near nominal, or from where a search finds that it should start.
    pub fn estimate_columns(
        &self,
        from: &State,
        choices: &[Choice],
        held: &[Prior],
        deadline: Option<Instant>,
        doubts: &mut Vec<Doubt>,
    ) -> Result<(Assembly, State, Solution), Error> {
        // What is looked for far away is not held.
        let assembly = self.columns_assembled(from, choices, true, &[])?;
        let Some(found) = self.far_start(from, &assembly, choices, deadline)? else {
            return self.solve_assembled(self.columns_assembled(from, choices, true, held)?, true);
        };
        let settings = Settings {
            timeout: deadline.map(left),
            ..self.estimate.settings.clone()
        };
        let initial = assembly.problem.initial();
        // What the search is sure of is a minimum already, which a graduation would leave.
        let mut solution = if found.sure {
            solve_from(&assembly.problem, &found.values, &settings)?
        } else {
            solve_graduated_from(&assembly.problem, &found.values, &settings)?
        };
        let mut r = vec![0.0; assembly.problem.rows()];
        solution.initial_cost = assembly.problem.residual(initial, &mut r);
        solution.iterations += found.iterations;
        solution.evaluations.residual += found.evaluations.residual;
        solution.evaluations.jacobian += found.evaluations.jacobian;
        let end = match (found.stopped, found.sure) {
            (true, _) => SearchEnd::Stopped,
            (false, false) => SearchEnd::Unsure,
            (false, true) => SearchEnd::Found,
        };
        if end != SearchEnd::Found || found.starts > 0 {
            doubts.push(Doubt::FarStart {
                starts: found.starts,
                rms: found.rms,
                end,
            });
        }
        let mut state = assembly.state(&solution.values);
        start_eliminated(&self.arms, &self.sets, &mut state);
        Ok((assembly, state, solution))
    }

    /// Estimates the chosen columns from a state. The registration takes no bounds and priors.
    fn solve_columns(
        &self,
        from: &State,
        choices: &[Choice],
        full: bool,
    ) -> Result<(Assembly, State, Solution), Error> {
        let assembly = self.columns_assembled(from, choices, full, &[])?;
        self.solve_assembled(assembly, full)
    }

    /// The minimum near a solution.
    pub fn solve_near(
        &self,
        assembly: Assembly,
        settings: &Settings,
    ) -> Result<(Assembly, State, Solution), Error> {
        let initial = assembly.problem.initial();
        let solution = solve_from(&assembly.problem, initial, settings)?;
        let mut state = assembly.state(&solution.values);
        start_eliminated(&self.arms, &self.sets, &mut state);
        Ok((assembly, state, solution))
    }

    fn solve_assembled(
        &self,
        assembly: Assembly,
        full: bool,
    ) -> Result<(Assembly, State, Solution), Error> {
        if assembly.problem.free().is_empty() {
            if full {
                return Err(Error::calibration(
                    "nothing is left to estimate",
                    "free some parameters (`parameters`, `fixed`) or add measurements that depend on them",
                ));
            }
            let values = assembly.problem.initial().clone();
            let mut state = assembly.state(&values);
            start_eliminated(&self.arms, &self.sets, &mut state);
            return Ok((assembly, state, unchanged(values)));
        }
        let solution = if full {
            solve_graduated(&assembly.problem, &self.estimate.settings)?
        } else {
            let settings = Settings {
                interrupt: self.estimate.settings.interrupt.clone(),
                ..Settings::default()
            };
            solve_graduated(&assembly.problem, &settings)?
        };
        let mut state = assembly.state(&solution.values);
        start_eliminated(&self.arms, &self.sets, &mut state);
        Ok((assembly, state, solution))
    }
}

/// Errors above this part of its reach: the robot does not stand where its file says.
pub const FAR: f64 = 0.05;

/// The solution of a problem in which nothing is free.
fn unchanged(values: Values) -> Solution {
    Solution {
        values,
        termination: Termination::Gradient {
            value: 0.0,
            tolerance: 0.0,
        },
        cost: 0.0,
        initial_cost: 0.0,
        iterations: 0,
        evaluations: truing::solver::Evaluations::default(),
        limits: Vec::new(),
        linear_solver: "",
        linear_solver_reason: String::new(),
        blocks: Vec::new(),
        outliers: Vec::new(),
    }
}
