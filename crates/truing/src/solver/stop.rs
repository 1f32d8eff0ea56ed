//! When a solver stops, and how it says so.

use serde::{Deserialize, Serialize};

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Tolerances {
    /// Largest cosine of the angle between r and a free column of J: ‖Jᵢᵀr‖ / (‖Jᵢ‖ ‖r‖). Default 1e-12.
    pub gradient: f64,
    /// Relative decrease of the cost, both achieved and predicted; where the cost is known to fewer digits
    /// than this, what rounding leaves of it. Default 1e-14.
    pub cost: f64,
    /// Step relative to the point: ‖δ‖ ≤ step · (‖x‖ + step). Default 1e-14.
    pub step: f64,
    /// Most iterations (trial steps). Default 2000.
    pub max_iterations: u64,
}

impl Default for Tolerances {
    fn default() -> Self {
        Self {
            gradient: 1e-12,
            cost: 1e-14,
            step: 1e-14,
            max_iterations: 2000,
        }
    }
}

/// Why a solver stopped, with the measured value and the threshold.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Termination {
    /// The residual is orthogonal to every free column that is not held by a bound.
    Gradient {
        /// Largest cosine.
        value: f64,
        /// The threshold.
        tolerance: f64,
    },
    /// The residual is zero to rounding: smaller than what the last bits of x change in it.
    Residual {
        /// ‖r‖.
        value: f64,
        /// The threshold: 8 ε times the longest column of J, each times the size of what it moves.
        tolerance: f64,
    },
    /// The cost does not decrease any more.
    Cost {
        /// Relative decrease that the linear model promises.
        value: f64,
        /// The threshold.
        tolerance: f64,
    },
    /// The steps are down to rounding.
    Step {
        /// Length of the step relative to the point.
        value: f64,
        /// The threshold.
        tolerance: f64,
    },
    /// The iterations ran out.
    MaxIterations {
        /// How many were allowed.
        limit: u64,
    },
    /// The time ran out.
    Timeout {
        /// How many seconds were allowed.
        seconds: f64,
    },
    /// Someone stopped it.
    Interrupted,
    /// No damping makes a step that lowers the cost, far from any minimum the linear model sees.
    Stalled {
        /// The damping reached.
        lambda: f64,
        /// Relative decrease that the linear model still promises.
        promised: f64,
    },
    /// A Gauss–Newton step does not exist: a column depends on those before it.
    Singular {
        /// Which column, in words.
        column: String,
        /// What is left of the scaled column.
        pivot: f64,
        /// What would have sufficed.
        threshold: f64,
    },
    /// A Gauss–Newton step led to a point where the residual or a derivative is not finite.
    Diverged {
        /// The iteration.
        iteration: u64,
    },
}

impl Termination {
    /// Whether the point can be taken for a (local) minimum.
    pub fn converged(&self) -> bool {
        matches!(
            self,
            Self::Gradient { .. } | Self::Residual { .. } | Self::Cost { .. } | Self::Step { .. }
        )
    }

    /// A short name: `gradient`, `cost`, `step`, `max-iterations`, ….
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Gradient { .. } => "gradient",
            Self::Residual { .. } => "residual",
            Self::Cost { .. } => "cost",
            Self::Step { .. } => "step",
            Self::MaxIterations { .. } => "max-iterations",
            Self::Timeout { .. } => "timeout",
            Self::Interrupted => "interrupted",
            Self::Stalled { .. } => "stalled",
            Self::Singular { .. } => "singular",
            Self::Diverged { .. } => "diverged",
        }
    }
}

impl std::fmt::Display for Termination {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Gradient { value, tolerance } => {
                write!(
                    f,
                    "converged: the gradient is zero (largest cosine {value:.1e} ≤ {tolerance:.0e})"
                )
            }
            Self::Residual { value, tolerance } => {
                write!(
                    f,
                    "converged: the residual is zero to rounding (norm {value:.1e} ≤ {tolerance:.0e})"
                )
            }
            Self::Cost { value, tolerance } => {
                write!(
                    f,
                    "converged: the cost does not decrease any more (relative decrease {value:.1e} ≤ {tolerance:.0e})"
                )
            }
            Self::Step { value, tolerance } => {
                write!(
                    f,
                    "converged: the steps are down to rounding (relative length {value:.1e} ≤ {tolerance:.0e})"
                )
            }
            Self::MaxIterations { limit } => write!(
                f,
                "not converged: {limit} iterations were not enough; allow more (`max_iterations`) or start closer"
            ),
            Self::Timeout { seconds } => {
                write!(
                    f,
                    "not converged: {seconds} s were not enough; allow more time or start closer"
                )
            }
            Self::Interrupted => write!(
                f,
                "not converged: interrupted; the best point so far is kept"
            ),
            Self::Stalled { lambda, promised } => write!(
                f,
                "not converged: no step lowers the cost (damping {lambda:.0e}, promised decrease {promised:.1e}); \
                 the derivatives may be wrong or the model not smooth here"
            ),
            Self::Singular {
                column,
                pivot,
                threshold,
            } => write!(
                f,
                "not converged: {column} cannot be told apart from the columns before it ({pivot:.1e} of it is left, \
                 {threshold:.1e} is needed); fix it, or use Levenberg–Marquardt"
            ),
            Self::Diverged { iteration } => write!(
                f,
                "not converged: the step of iteration {iteration} led where the residual or a derivative is not finite; \
                 start closer, or use Levenberg–Marquardt"
            ),
        }
    }
}

/// argmin's status for a termination that may not have come yet.
pub(crate) fn status(termination: Option<&Termination>) -> argmin::core::TerminationStatus {
    use argmin::core::{TerminationReason, TerminationStatus};
    match termination {
        None => TerminationStatus::NotTerminated,
        Some(t) if t.converged() => {
            TerminationStatus::Terminated(TerminationReason::SolverConverged)
        }
        Some(t) => TerminationStatus::Terminated(TerminationReason::SolverExit(t.to_string())),
    }
}
