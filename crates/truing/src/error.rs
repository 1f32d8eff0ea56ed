//! What can be wrong with a problem before it is solved.

/// Why there is no usable point. Not converging is not an error: it is a
/// [`Termination`](crate::Termination).
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The problem has no residual rows.
    #[error("the problem has no residual rows; add constraints with `Problem::add` or `add_block`")]
    NoRows,
    /// Nothing is free to be estimated.
    #[error("all {columns} columns are fixed; free at least one variable or component")]
    NothingFree {
        /// Number of columns.
        columns: usize,
    },
    /// A residual is NaN or infinite at the start.
    #[error(
        "the residual of {row} is {value} at the starting point; give a starting value at which the model is defined"
    )]
    NotFinite {
        /// Which row, in words.
        row: String,
        /// What it is.
        value: f64,
    },
    /// A derivative is NaN or infinite.
    #[error(
        "the derivative of {row} with respect to {column} is {value}; the model is not differentiable there"
    )]
    DerivativeNotFinite {
        /// Which row, in words.
        row: String,
        /// Which column, in words.
        column: String,
        /// What it is.
        value: f64,
    },
    /// A noise model or loss that cannot be.
    #[error("found {found}, expected {expected}")]
    Noise {
        /// What was given.
        found: String,
        /// What is accepted.
        expected: String,
    },
    /// A bound is empty.
    #[error(
        "bounds of {column}: [{lower}, {upper}] hold no number; the lower one must not be above the upper one, and neither NaN"
    )]
    Bounds {
        /// Which column, in words.
        column: String,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// A linear limit that cannot be.
    #[error(
        "the linear limit `{name}`, between {lower} and {upper}, holds nowhere; the lower one must not be above the upper one, and coefficients must be finite"
    )]
    Limit {
        /// Its name.
        name: String,
        /// Lower limit.
        lower: f64,
        /// Upper limit.
        upper: f64,
    },
    /// No point keeps all limits.
    #[error(
        "no point was found that keeps all limits: the linear limits {limits} and the bounds contradict each other, or what they leave free is fixed; widen one"
    )]
    Infeasible {
        /// Names of the linear limits.
        limits: String,
    },
    /// The columns are linearly dependent where they must not be.
    #[error(
        "{column} cannot be told apart from the columns before it: {pivot:.1e} of it is left, {threshold:.1e} is needed; fix it or add measurements that determine it"
    )]
    RankDeficient {
        /// Which column, in words.
        column: String,
        /// Length of what is left of the scaled column.
        pivot: f64,
        /// What would have sufficed.
        threshold: f64,
    },
    /// There are more unknowns than rows.
    #[error("{columns} unknowns but only {rows} residual rows; add measurements or fix parameters")]
    Underdetermined {
        /// Residual rows.
        rows: usize,
        /// Free columns.
        columns: usize,
    },
    /// A parameter vector of another length than the problem has free columns.
    #[error("{found} parameters were given, the problem has {expected} free columns")]
    Parameters {
        /// How many were given.
        found: usize,
        /// How many there are.
        expected: usize,
    },
    /// A curved variable is where the tangent at its starting value ends.
    #[error(
        "`{variable}` is too far from its starting value to be described by the tangent there; start closer, or use this crate's own solvers, which do not need it"
    )]
    Chart {
        /// The variable.
        variable: String,
    },
    /// argmin's executor stopped: a checkpoint could not be written or an observer failed.
    #[error("the executor stopped: {0}")]
    Executor(String),
}
