//! A robot with a way to differentiate it, and what constraints on it share.
//!
//! A constraint on a robot differentiates only its small function of tool points, planes and frames, with
//! `num-dual` or in a line by hand; the chain rule through the [`Regressor`] does the rest, with
//! whichever [`Derivatives`] the robot's [`Chain`] was given.

use super::regressor::{DifferentiateChain, FrameWise, Regressor};
use super::serial::Robot;
use std::sync::Arc;
use truing::manifold::Pose;
use truing::nalgebra::{Matrix3, SMatrix, Vector3};
use truing::{Constraint, Jacobian, Point, Scalar, Vars, autodiff, value};

/// How a robot's constraints are differentiated.
#[derive(Clone)]
pub enum Derivatives {
    /// The chain rule through a regressor: frame-wise automatic differentiation, or a plugin's analytic columns.
    Regressor(Arc<dyn DifferentiateChain>),
    /// Automatic differentiation of the whole chain: the reference.
    WholeChain,
    /// Central differences: the second reference.
    Numeric,
}

impl Default for Derivatives {
    fn default() -> Self {
        Self::Regressor(Arc::new(FrameWise))
    }
}

/// A robot with a way to differentiate it; shared by all constraints on that robot.
#[derive(Clone)]
pub struct Chain {
    /// The robot.
    pub robot: Robot,
    /// How its constraints are differentiated.
    pub derivatives: Derivatives,
}

impl Chain {
    /// A robot with frame-wise automatic differentiation.
    pub fn new(robot: Robot) -> Arc<Self> {
        Self::with(robot, Derivatives::default())
    }

    /// A robot with other derivatives.
    pub fn with(robot: Robot, derivatives: Derivatives) -> Arc<Self> {
        Arc::new(Self { robot, derivatives })
    }

    /// Position of a tool point in the reference frame \[m\].
    pub fn tip<T: Scalar>(&self, parameters: &[T], q: &[f64], target: &Vector3<T>) -> Vector3<T> {
        self.robot.forward(parameters, q).apply(target)
    }
}

/// ‖v‖, with derivative zero instead of none at zero, where two points coincide.
pub fn norm<T: Scalar>(v: &Vector3<T>) -> T {
    let square = v.x * v.x + v.y * v.y + v.z * v.z;
    if value(square) == 0.0 {
        T::zero()
    } else {
        square.sqrt()
    }
}

/// Differentiates by automatic differentiation of the whole chain or numerically where the chain
/// asks for it; otherwise returns the regressor's source, for a constraint to write its own chain rule.
pub fn reference_or_regressor<'c, C: Constraint>(
    constraint: &C,
    chain: &'c Chain,
    at: &mut Point<'_, C::Vars>,
    r: &mut [f64],
    j: &mut Jacobian<'_>,
) -> Option<&'c dyn DifferentiateChain> {
    match &chain.derivatives {
        Derivatives::Regressor(regressor) => return Some(&**regressor),
        Derivatives::WholeChain => autodiff::forward(constraint, at, r, j),
        Derivatives::Numeric => autodiff::central_differences(constraint, at, r, j),
    }
    None
}

/// Writes ∂r/∂(robot parameters) = (∂r/∂tip) · (∂tip/∂parameters) and ∂r/∂target of one tool point;
/// `robot` and `target` are the places of their variables in the tuple, `gradient` is ∂r/∂tip.
#[inline]
pub fn write_tip<const ROWS: usize>(
    j: &mut Jacobian<'_>,
    robot: usize,
    target: usize,
    regressor: &Regressor,
    tip: &Vector3<f64>,
    gradient: &SMatrix<f64, ROWS, 3>,
) {
    let block = j.block_mut(robot);
    for (column, twist) in block.chunks_exact_mut(ROWS).zip(&regressor.twists) {
        let moved = gradient * twist.at(tip);
        column.copy_from_slice(moved.as_slice());
    }
    let columns = gradient * regressor.tool.rotation;
    j.block_mut(target).copy_from_slice(columns.as_slice());
}

/// Writes the block of columns of another variable.
pub fn write_block<const ROWS: usize, const COLS: usize>(
    j: &mut Jacobian<'_>,
    variable: usize,
    columns: &SMatrix<f64, ROWS, COLS>,
) {
    j.block_mut(variable).copy_from_slice(columns.as_slice());
}

/// The regressor at a configuration, in memory that the evaluation keeps.
pub fn regressor_at<'m, V: Vars>(
    at: &'m mut Point<'_, V>,
    source: &dyn DifferentiateChain,
    chain: &Chain,
    parameters: &[f64],
    q: &[f64],
) -> &'m mut Regressor {
    let regressor = at.memory::<Regressor>();
    source.regressor(&chain.robot, parameters, q, regressor);
    regressor
}

/// A tool point as a sensor sees it, seen = Rᵀ(p − t) with R and t the sensor's pose, and its
/// derivatives by p (3 × 3) and by the sensor's tangent (3 × 6).
///
/// ∂seen/∂p = Rᵀ, ∂seen/∂t = −Rᵀ, and ∂seen/∂ω = seen× because R moves to R·exp(ω).
pub fn seen_by(
    sensor: &Pose<f64>,
    tip: &Vector3<f64>,
) -> (Vector3<f64>, Matrix3<f64>, SMatrix<f64, 3, 6>) {
    let by_tip = sensor.rotation.transpose();
    let seen = by_tip * (tip - sensor.translation);
    let mut by_sensor = SMatrix::<f64, 3, 6>::zeros();
    by_sensor.fixed_columns_mut::<3>(0).copy_from(&-by_tip);
    by_sensor
        .fixed_columns_mut::<3>(3)
        .copy_from(&seen.cross_matrix());
    (seen, by_tip, by_sensor)
}
