//! What solvers know at the current point.

use super::stop::{Termination, Tolerances};
use crate::error::Error;
use crate::least_squares::{LeastSquares, Linearization, StepBounds, check_finite};
use crate::step::{Bounded, StepSolver, kkt};

/// Times a column's norm that its scale may be before it fades.
const STALE: f64 = 1e6;
/// A relative decrease below which the difference of two costs is rounding in any case.
const ROUNDING: f64 = 1e-12;
/// What is left of a stale scale after a step.
const FADING: f64 = 0.9;

/// The linearisation at the current point, with its memory. Not kept in a checkpoint: made again.
#[derive(Clone)]
pub(super) struct Current {
    pub lin: Linearization,
    pub trial_residual: Vec<f64>,
    pub free: Vec<usize>,
    pub bounds: Option<StepBounds>,
    /// What the last bits of x change in r, at most: 8 ε times the longest column, each times the size
    /// of what it moves.
    pub rounding: f64,
    /// What the scales seen before still count at the next look: one, unless a step says otherwise.
    pub fading: f64,
}

impl Current {
    /// Checks the problem and linearises it at the start.
    pub fn start<O: LeastSquares>(problem: &O, x: &O::Point) -> Result<Self, Error> {
        let structure = problem.structure();
        if structure.rows == 0 {
            return Err(Error::NoRows);
        }
        let free = problem.free();
        if free.is_empty() {
            return Err(Error::NothingFree {
                columns: structure.cols(),
            });
        }
        let trial_residual = vec![0.0; structure.rows];
        let mut current = Self {
            lin: Linearization::new(structure),
            trial_residual,
            free,
            bounds: None,
            rounding: 0.0,
            fading: 1.0,
        };
        current.linearize(problem, x);
        check_finite(problem, &current.lin, &current.free)?;
        Ok(current)
    }

    /// r, J and the bounds on a step at x.
    pub fn linearize<O: LeastSquares>(&mut self, problem: &O, x: &O::Point) {
        problem.linearize(x, &mut self.lin);
        self.bounds = problem.step_bounds(x);
    }

    /// Whether a step can be taken from here, or none is needed: the cost is finite, and so are the
    /// free columns unless the cost is zero.
    pub fn usable(&self) -> bool {
        let finite = |column: &usize| self.lin.column(*column).all(|(_, j)| j.is_finite());
        self.lin.cost == 0.0 || (self.lin.cost.is_finite() && self.free.iter().all(finite))
    }

    /// The part of the cost that is rounding: r is known to what the last bits of x change in it.
    pub fn noise(&self) -> f64 {
        let residual = (2.0 * self.lin.cost).sqrt();
        (2.0 * self.rounding / residual).clamp(ROUNDING, 1.0)
    }

    /// Updates the column scales, factors, and looks whether this is it: the gradient is zero
    /// but for what active limits hold, or the residual is.
    ///
    /// Scales are the largest norms seen (Moré), but not for ever: columns seen where the cost was
    /// larger count as much less as the residual has shrunk since (`fading`), and those a million times
    /// longer than now fade with every step. Else far starts of polynomials and exponentials, whose
    /// columns shrink by any factor, stay damped by where they came from.
    pub fn look<O: LeastSquares>(
        &mut self,
        problem: &O,
        x: &O::Point,
        scale: &mut Vec<f64>,
        step: &mut Bounded<impl StepSolver>,
        tolerances: &Tolerances,
    ) -> Option<Termination> {
        scale.resize(self.free.len(), 0.0);
        let norm = self.lin.residual.iter().map(|r| r * r).sum::<f64>().sqrt();
        let sizes = problem.sizes(x);
        let (mut cosine, mut longest) = (0.0_f64, 0.0_f64);
        let gradient = kkt(&self.lin, &self.free, self.bounds.as_ref()).residual;
        for ((scale, column), gradient) in scale.iter_mut().zip(&self.free).zip(gradient) {
            let length = self.lin.column_norm(*column);
            longest = longest.max(length * sizes[*column]);
            let stale = if *scale > STALE * length { FADING } else { 1.0 };
            *scale = length.max(self.fading * stale * *scale);
            if length > 0.0 && norm > 0.0 {
                cosine = cosine.max(gradient.abs() / length / norm);
            }
        }
        self.fading = 1.0;
        step.factor(&self.lin, &self.free, &positive(scale));
        let rounding = 8.0 * f64::EPSILON * longest;
        self.rounding = rounding;
        if norm <= rounding {
            return Some(Termination::Residual {
                value: norm,
                tolerance: rounding,
            });
        }
        (cosine <= tolerances.gradient).then_some(Termination::Gradient {
            value: cosine,
            tolerance: tolerances.gradient,
        })
    }
}

/// Lengths by which columns can be divided: those of zero columns are one.
pub(super) fn positive(lengths: &[f64]) -> Vec<f64> {
    lengths
        .iter()
        .map(|length| if *length > 0.0 { *length } else { 1.0 })
        .collect()
}
