//! How far a robot may be from its drawing: what the data barely see stays near nominal.

use super::job::Job;
use super::search::left;
use crate::doubt::Doubt;
use crate::error::Error;
use crate::identify::Choice;
use crate::model::Assembly;
use crate::robot::Unit;
use crate::unknown::State;
use std::time::Instant;
use truing::{Settings, Solution};

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

/// What a prior changes by less than this part of a standard deviation is as good as unchanged.
const NEGLIGIBLE: f64 = 1e-2;

/// Residuals so many times smaller than the stated noise are rounding: nothing is held then.
const EXACT: f64 = 1e-5;

/// What a drawing says of one estimated parameter.
struct Drawn {
    robot: usize,
    parameter: usize,
    /// Standard deviation before the data are asked.
    sigma: f64,
    /// Whether it is of the links, not of the base or the tool.
    of_link: bool,
}

impl Drawn {
    /// The prior where drawings are off by `growth` times as much; where a robot stands is never better known.
    fn prior(&self, growth: f64) -> Prior {
        let growth = if self.of_link {
            growth
        } else {
            growth.max(1.0)
        };
        (self.robot, self.parameter, self.sigma * growth)
    }
}

/// The noise beside the stated one, and the size of errors beside the drawing's.
#[derive(Clone, Copy)]
struct Scales {
    noise: f64,
    growth: f64,
}

impl Scales {
    /// Whether all the same is held as with others.
    fn as_good_as(self, other: Self) -> bool {
        let close = |a: f64, b: f64| a < CLOSE * b && b < CLOSE * a;
        let exact = self.noise < EXACT && other.noise < EXACT;
        exact || (close(self.noise, other.noise) && close(self.growth, other.growth))
    }

    /// The priors, as sizes of errors.
    fn sizes(self, drawing: &[Drawn]) -> Vec<Prior> {
        if self.noise < EXACT {
            return Vec::new();
        }
        drawing
            .iter()
            .map(|drawn| drawn.prior(self.growth))
            .collect()
    }

    /// The same as they count in a problem whose measurements have the stated noise.
    fn weights(self, drawing: &[Drawn]) -> Vec<Prior> {
        let beside_noise = |(r, p, sigma): Prior| (r, p, sigma / self.noise);
        self.sizes(drawing).into_iter().map(beside_noise).collect()
    }
}

impl Job {
    /// What drawings say of all estimated parameters that the file gives no prior for.
    ///
    /// With τ the part of the robot's dimensions, an angle is off by τ \[rad\], a gain by τ, a length by τ times the
    /// robot's reach, or τ times itself if it is longer. A parameter that stands for others, which are held, has
    /// their share too: σ² = τ² + Σ (w τ)², so that it makes no difference which of them is estimated.
    fn drawing(&self, choices: &[Choice], layout: &Assembly) -> Vec<Drawn> {
        let Some(part) = self.estimate.drawing else {
            return Vec::new();
        };
        let reach = self.reach();
        let mut squares = vec![0.0; choices.len()];
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
                let (of_base, of_tool) = (base.contains(&k), tool.contains(&k));
                let place = match (of_base, of_tool) {
                    (true, _) => OF_BASE,
                    (_, true) => OF_TOOL,
                    _ => 1.0,
                };
                let size = part * unit * place;
                let given = |(r, p, _): &Prior| (*r, *p) == (robot, k);
                match &choices[first + k] {
                    Choice::Estimated => {
                        squares[first + k] += size * size;
                        if !self.estimate.priors.iter().any(given) {
                            all.push((robot, k, first + k, !of_base && !of_tool));
                        }
                    }
                    Choice::Regrouped(into) | Choice::Anchor(into) if !of_base => {
                        for (column, weight) in into {
                            squares[*column] += (weight * size).powi(2);
                        }
                    }
                    _ => {}
                }
            }
        }
        let drawn = |(robot, parameter, column, of_link): (_, _, usize, _)| Drawn {
            robot,
            parameter,
            sigma: squares[column].sqrt(),
            of_link,
        };
        all.into_iter().map(drawn).collect()
    }

    /// The estimate with what the data barely see held near nominal.
    ///
    /// Priors are compared with the noise that the residuals have, not the stated one: without noise nothing is held.
    /// Their size is what makes the data most likely (MacKay 1992): τ² ← Σ δ² / Σ (1 − σ²/τ²), never above the drawing's
    /// but where the robot was found far from it. Each round starts at the solution of the one before; iterations and
    /// time are those that the settings allow, in all.
    pub fn solve_held(
        &self,
        from: &State,
        choices: &[Choice],
        layout: &Assembly,
        doubts: &mut Vec<Doubt>,
    ) -> Result<Held, Error> {
        let settings = &self.estimate.settings;
        let deadline = settings.timeout.map(|t| Instant::now() + t);
        let drawing = self.drawing(choices, layout);
        let mut scales = Scales {
            noise: 1.0,
            growth: 1.0,
        };
        let held = scales.weights(&drawing);
        let (mut assembly, mut state, mut solution) =
            self.estimate_columns(from, choices, &held, deadline, doubts)?;
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
            let Some((next, matters)) =
                self.seen(&state, choices, &assembly, &drawing, scales, largest)
            else {
                break;
            };
            let iterations = settings
                .tolerances
                .max_iterations
                .saturating_sub(solution.iterations);
            if next.as_good_as(scales) || iterations == 0 {
                break;
            }
            scales = next;
            if !matters {
                break;
            }
            let mut settings = Settings {
                timeout: deadline.map(left),
                ..settings.clone()
            };
            settings.tolerances.max_iterations = iterations;
            let near = self.columns_assembled(&state, choices, true, &scales.weights(&drawing))?;
            let before = solution;
            (assembly, state, solution) = self.solve_near(near, &settings)?;
            solution.iterations += before.iterations;
            solution.evaluations.residual += before.evaluations.residual;
            solution.evaluations.jacobian += before.evaluations.jacobian;
            solution.initial_cost = before.initial_cost;
        }
        let held = scales.sizes(&drawing);
        Ok(Held {
            assembly,
            state,
            solution,
            part: self
                .estimate
                .drawing
                .filter(|_| !held.is_empty())
                .map(|part| part * scales.growth),
            held,
        })
    }

    /// The noise that the residuals have, and the size of errors that makes the data most likely, with whether it moves
    /// any estimate by a part of its σ worth a solution; none where unknowns cannot be told apart.
    fn seen(
        &self,
        state: &State,
        choices: &[Choice],
        assembly: &Assembly,
        drawing: &[Drawn],
        scales: Scales,
        largest: f64,
    ) -> Option<(Scales, bool)> {
        let sizes = scales.sizes(drawing);
        let covered = self.covariance(state, choices, &sizes).ok()?;
        let noise = if covered.sigma0.is_finite() {
            covered.sigma0
        } else {
            1.0
        };
        let (mut squares, mut seen) = (0.0, 0.0);
        for (robot, parameter, sigma) in drawing
            .iter()
            .zip(&sizes)
            .filter(|(drawn, _)| drawn.of_link)
            .map(|(_, prior)| *prior)
        {
            let column = assembly.robot(robot).column() + parameter;
            let nominal = self.arms[robot].robot.parameters()[parameter].nominal;
            squares += ((state.robots[robot][parameter] - nominal) / sigma).powi(2);
            seen += (1.0 - (covered.covariance.std_dev(column) * noise / sigma).powi(2)).max(0.0);
        }
        let growth = if seen > LEAST {
            (scales.growth * (squares / seen).sqrt()).clamp(SMALLEST, largest)
        } else {
            scales.growth
        };
        let next = Scales { noise, growth };
        // A prior moves an estimate by about (σ/τ) σ, with σ as the noise makes it or as it was stated.
        let matters = drawing.iter().any(|drawn| {
            let (robot, parameter, sigma) = drawn.prior(growth.min(scales.growth));
            let column = assembly.robot(robot).column() + parameter;
            covered.covariance.std_dev(column) * noise.max(1.0 / noise) > NEGLIGIBLE * sigma
        });
        Some((next, matters))
    }
}

/// The estimate with the priors that it was held by, as large as they were taken to be.
pub(crate) struct Held {
    pub assembly: Assembly,
    pub state: State,
    pub solution: Solution,
    pub held: Vec<Prior>,
    /// Their size as a part of the robots' dimensions; none where nothing is held.
    pub part: Option<f64>,
}
