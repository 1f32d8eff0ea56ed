#![doc = include_str!("../README.md")]

mod argmin_traits;
pub mod autodiff;
mod block;
pub mod check;
mod constraint;
mod error;
pub mod identifiability;
mod least_squares;
mod limits;
mod loss;
pub mod manifold;
mod noise;
mod prior;
mod problem;
mod robust;
mod scalar;
mod solution;
pub mod solver;
pub mod statistics;
pub mod step;
mod variable;

pub use block::{Batch, ConstraintBlock, PanelWriter};
pub use constraint::{Constraint, Jacobian, Point, Views};
pub use error::Error;
pub use least_squares::{
    LeastSquares, LinearBound, Linearization, StepBounds, Structure, check_finite,
};
pub use limits::LinearLimit;
pub use loss::Loss;
pub use noise::Noise;
pub use prior::Prior;
pub use problem::Problem;
pub use robust::{
    Adapted, Outlier, Relaxed, Weight, adapt_loss, solve_adaptive, solve_graduated,
    solve_graduated_from,
};
pub use scalar::{Dual, Scalar, value};
pub use solution::{BlockReport, Solution};
pub use solver::{ActiveLimit, Method, Settings, Termination, Tolerances, solve, solve_from};
pub use statistics::Covariance;
pub use step::LinearSolver;
pub use variable::{AnyVar, MAX_VARS, Slot, Values, Var, Variable, Vars};

pub use {argmin, nalgebra, num_dual};
