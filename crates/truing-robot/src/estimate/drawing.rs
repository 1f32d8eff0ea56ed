//! How far a robot may be from its drawing: what the data barely see stays near nominal.

use super::job::Job;
use crate::doubt::Doubt;
use crate::error::Error;
use crate::identify::Choice;
use crate::model::Assembly;
use crate::robot::Unit;
use crate::unknown::State;
use std::collections::BTreeMap;
use truing::Solution;

/// A prior about nominal: robot, parameter, standard deviation.
pub(crate) type Prior = (usize, usize, f64);

/// Where a robot stands may be less known than its links by this factor, and its tool by the other.
const OF_BASE: f64 = 10.0;
const OF_TOOL: f64 = 3.0;

/// Weights of priors that are off by less than this factor are as good as right.
const CLOSE: f64 = 1.5;

/// So often the noise and the size of the errors are asked again.
const ROUNDS: usize = 6;

/// The size of the errors is that of so many parameters at least.
const LEAST: f64 = 3.0;

/// Sizes of errors beside the drawing's are not below this, nor above its inverse.
const SMALLEST: f64 = 1e-3;

/// Residuals so many times smaller than the stated noise are rounding: nothing is held then.
const EXACT: f64 = 1e-5;

impl Job {
    /// The priors of manufacturing size of all estimated parameters that the file gives none for.
    ///
    /// With τ the part of the robot's dimensions, an angle is off by τ \[rad\], a gain by τ, a length by τ times the
    /// robot's reach, or τ times itself if it is longer. A parameter that stands for others, which are held, has
    /// their share too: σ² = τ² + Σ (w τ)², so that it makes no difference which of them is estimated.
    pub fn drawing(&self, choices: &[Choice], layout: &Assembly) -> Vec<Prior> {
        let Some(part) = self.estimate.drawing else {
            return Vec::new();
        };
        let reach = self.reach();
        let mut squares: BTreeMap<usize, f64> = BTreeMap::new();
        let mut all = Vec::new();
        for (robot, arm) in self.arms.iter().enumerate() {
            let first = layout.robot(robot).column();
            let (base, tool) = (arm.robot.base_parameters(), arm.robot.tool_parameters());
            for (k, parameter) in arm.robot.parameters().iter().enumerate() {
                let unit = match parameter.unit() {
                    Unit::Radian | Unit::One => 1.0,
                    Unit::Meter => reach.max(parameter.nominal.abs()),
                    Unit::Other(_) => continue,
                };
                let place = if base.contains(&k) {
                    OF_BASE
                } else if tool.contains(&k) {
                    OF_TOOL
                } else {
                    1.0
                };
                let size = part * unit * place;
                match &choices[first + k] {
                    Choice::Estimated => {
                        *squares.entry(first + k).or_default() += size * size;
                        all.push((robot, k, first + k));
                    }
                    Choice::Regrouped(into) | Choice::Anchor(into) if !base.contains(&k) => {
                        for (column, weight) in into {
                            *squares.entry(*column).or_default() += (weight * size).powi(2);
                        }
                    }
                    _ => {}
                }
            }
        }
        let given = |r: usize, p: usize| {
            self.estimate
                .priors
                .iter()
                .any(|(a, b, _)| (*a, *b) == (r, p))
        };
        all.retain(|(robot, k, _)| !given(*robot, *k));
        let size = |(robot, k, column): (usize, usize, usize)| (robot, k, squares[&column].sqrt());
        all.into_iter().map(size).collect()
    }

    /// The estimate with what the data barely see held near nominal.
    ///
    /// Priors are compared with the noise that the residuals have, not the stated one: without noise nothing is held.
    /// Where the errors that the data see well are larger than the priors say, these grow to their size.
    pub fn solve_held(
        &self,
        from: &State,
        choices: &[Choice],
        layout: &Assembly,
        doubts: &mut Vec<Doubt>,
    ) -> Result<Held, Error> {
        let drawing = self.drawing(choices, layout);
        let mut job = self.with_held(&drawing, 1.0, 1.0);
        let (mut assembly, mut state, mut solution) =
            job.estimate_columns(from, choices, doubts)?;
        let (mut noise, mut growth) = (1.0_f64, 1.0_f64);
        // Only what was found far from nominal is farther off than drawings are.
        let far = |doubt: &Doubt| matches!(doubt, Doubt::FarStart { .. });
        let largest = if doubts.iter().any(far) {
            1.0 / SMALLEST
        } else {
            1.0
        };
        for _ in 0..ROUNDS {
            if drawing.is_empty() || !solution.termination.converged() {
                break;
            }
            let sizes = self.sized(&drawing, growth);
            let mut unscaled = self.clone();
            unscaled.estimate.held.clone_from(&sizes);
            let Ok(judged) = unscaled.uncertainty(&state, choices) else {
                break;
            };
            let next = judged.uncertainty.factor();
            let (mut squares, mut seen) = (0.0, 0.0);
            for (robot, parameter, sigma) in &sizes {
                if self.is_of_link(*robot, *parameter) {
                    let column = assembly.robot(*robot).column() + parameter;
                    let nominal = self.arms[*robot].robot.parameters()[*parameter].nominal;
                    squares += ((state.robots[*robot][*parameter] - nominal) / sigma).powi(2);
                    seen += (1.0 - (judged.uncertainty.std_dev(column) / sigma).powi(2)).max(0.0);
                }
            }
            let larger = if seen > LEAST {
                (growth * (squares / seen).sqrt()).clamp(SMALLEST, largest)
            } else {
                growth
            };
            let same = |a: f64, b: f64| a < CLOSE * b && b < CLOSE * a;
            if same(next, noise) && same(larger, growth) || next < EXACT && noise < EXACT {
                break;
            }
            (noise, growth) = (next, larger);
            job = self.with_held(if noise < EXACT { &[] } else { &drawing }, noise, growth);
            let before = (
                solution.iterations,
                solution.evaluations,
                solution.initial_cost,
            );
            let near = job.columns_assembled(&state, choices, true)?;
            (assembly, state, solution) = job.solve_near(near)?;
            solution.iterations += before.0;
            solution.evaluations.residual += before.1.residual;
            solution.evaluations.jacobian += before.1.jacobian;
            solution.initial_cost = before.2;
        }
        let held = if noise < EXACT && noise > 0.0 {
            Vec::new()
        } else {
            self.sized(&drawing, growth)
        };
        Ok(Held {
            assembly,
            state,
            solution,
            held,
        })
    }

    /// Whether a parameter is of the links, not of the base or the tool.
    fn is_of_link(&self, robot: usize, parameter: usize) -> bool {
        let robot = &self.arms[robot].robot;
        !robot.base_parameters().contains(&parameter)
            && !robot.tool_parameters().contains(&parameter)
    }

    fn with_held(&self, drawing: &[Prior], noise: f64, growth: f64) -> Self {
        let mut job = self.clone();
        job.estimate.held = self.sized(drawing, growth);
        job.estimate
            .held
            .iter_mut()
            .for_each(|(_, _, sigma)| *sigma /= noise.max(EXACT));
        job
    }

    /// The priors so many times as large; where a robot stands is never better known.
    fn sized(&self, drawing: &[Prior], growth: f64) -> Vec<Prior> {
        let size = |(robot, parameter, sigma): &Prior| {
            let of_link = self.is_of_link(*robot, *parameter);
            (
                *robot,
                *parameter,
                sigma * if of_link { growth } else { growth.max(1.0) },
            )
        };
        drawing.iter().map(size).collect()
    }
}

/// The estimate with the priors that it was held by, as large as they were taken to be.
pub(crate) struct Held {
    pub assembly: Assembly,
    pub state: State,
    pub solution: Solution,
    pub held: Vec<Prior>,
}
