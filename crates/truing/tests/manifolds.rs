//! Every kind of variable obeys the laws of a manifold, at random and at special values.
//!
//! The laws (x ⊞ 0 = x, (x ⊞ δ) ⊟ x = δ, x ⊞ (y ⊟ x) = y, unit derivative at δ = 0) are those of
//! Hertzberg et al. 2013, "Integrating generic sensor fusion algorithms with sound state
//! representations", checked by `truing::check::variable`.

use proptest::array::{uniform2, uniform3, uniform6};
use proptest::prelude::*;
use std::f64::consts::PI;
use truing::autodiff::{partials, seed};
use truing::check;
use truing::manifold::{
    Direction3, PlanarPose, Plane, Plane3, Point3, Pose, Pose2, Pose3, Rotation3, Vector, so3,
};
use truing::nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use truing::{Dual, Variable};

/// Values are of size ten at most and rotations pass through a quaternion twice: a few hundred ε.
const TOLERANCE: f64 = 1e-12;
/// No partial derivative here is of a variable with more than six degrees of freedom.
const WIDTH: usize = 6;

#[track_caller]
fn assert_laws<V: Variable>(x: &V::Value, delta: &[f64]) {
    if let Err(broken) = check::variable::<V>(x, delta, TOLERANCE) {
        panic!("at {x:?}: {broken}");
    }
}

/// ∂(x ⊞ δ)/∂δ at zero by dual numbers against central differences, in the stored numbers.
///
/// With h = 1e-5 the differences are good to h² + ε |x| / h < 1e-9 for numbers of size ten.
#[track_caller]
fn assert_derivative_at_zero<V: Variable>(x: &V::Value) {
    let x = V::store(x);
    let dim = V::tangent_dim(x.len());
    let duals: Vec<Dual<WIDTH>> = (0..dim).map(|k| seed(0.0, k)).collect();
    let mut moved = vec![Dual::<WIDTH>::from(0.0); x.len()];
    V::plus(&x, &duals, &mut moved);
    let h = 1e-5;
    for k in 0..dim {
        let shifted = |step: f64| {
            let mut delta = vec![0.0; dim];
            delta[k] = step;
            let mut y = vec![0.0; x.len()];
            V::plus(&x, &delta, &mut y);
            y
        };
        for (i, (up, down)) in shifted(h).into_iter().zip(shifted(-h)).enumerate() {
            let difference = (up - down) / (2.0 * h);
            let dual = partials(&moved[i])[k];
            assert!(
                (dual - difference).abs() < 1e-9,
                "∂x[{i}]/∂δ[{k}] at {x:?} is {dual}, central differences say {difference}"
            );
        }
    }
}

fn rotation(omega: [f64; 3]) -> Matrix3<f64> {
    so3::exp_matrix(&omega)
}

fn pose(translation: [f64; 3], omega: [f64; 3]) -> Pose<f64> {
    Pose::new(rotation(omega), translation.into())
}

/// Vectors with a norm below `limit`, of all sizes down to nothing.
fn shorter_than(limit: f64) -> impl Strategy<Value = [f64; 3]> {
    (uniform3(-1.0..1.0_f64), 0.0..limit).prop_filter_map("no direction", |(v, length)| {
        let norm = Vector3::from(v).norm();
        (norm > 1e-3).then(|| v.map(|c| c / norm * length))
    })
}

fn unit_vector() -> impl Strategy<Value = Vector3<f64>> {
    shorter_than(1.0).prop_filter_map("too short", |v| Vector3::from(v).try_normalize(1e-6))
}

proptest! {
    #[test]
    fn vectors_obey_the_laws(x in uniform6(-10.0..10.0), delta in uniform6(-3.0..3.0)) {
        assert_laws::<Vector>(&x.to_vec(), &delta);
        assert_derivative_at_zero::<Vector>(&x.to_vec());
    }

    #[test]
    fn points_obey_the_laws(x in uniform3(-10.0..10.0), delta in uniform3(-3.0..3.0)) {
        assert_laws::<Point3>(&x.into(), &delta);
        assert_derivative_at_zero::<Point3>(&x.into());
    }

    #[test]
    fn rotations_obey_the_laws(omega in shorter_than(PI), delta in shorter_than(3.0)) {
        assert_laws::<Rotation3>(&rotation(omega), &delta);
        assert_derivative_at_zero::<Rotation3>(&rotation(omega));
    }

    #[test]
    fn poses_obey_the_laws(
        t in uniform3(-10.0..10.0),
        omega in shorter_than(PI),
        dt in uniform3(-3.0..3.0),
        turn in shorter_than(3.0),
    ) {
        let delta = [dt, turn].concat();
        assert_laws::<Pose3>(&pose(t, omega), &delta);
        assert_derivative_at_zero::<Pose3>(&pose(t, omega));
    }

    #[test]
    fn planar_poses_obey_the_laws(
        t in uniform2(-10.0..10.0_f64),
        angle in -PI..PI,
        dt in uniform2(-3.0..3.0),
        turn in -3.0..3.0,
    ) {
        // Angles near ±π are visited below: there x ⊞ 0 and x may be written with either sign.
        let x = PlanarPose { translation: Vector2::from(t), angle };
        assert_laws::<Pose2>(&x, &[dt[0], dt[1], turn]);
        if PI - angle.abs() > 1e-4 {
            assert_derivative_at_zero::<Pose2>(&x);
        }
    }

    #[test]
    fn directions_obey_the_laws(n in unit_vector(), delta in shorter_than(3.0)) {
        assert_laws::<Direction3>(&n, &delta[..2]);
        assert_derivative_at_zero::<Direction3>(&n);
    }

    #[test]
    fn planes_obey_the_laws(
        normal in unit_vector(),
        distance in -10.0..10.0,
        turn in shorter_than(3.0),
        shift in -3.0..3.0,
    ) {
        let x = Plane { normal, distance };
        assert_laws::<Plane3>(&x, &[turn[0], turn[1], shift]);
        assert_derivative_at_zero::<Plane3>(&x);
    }

    /// A constraint such as a prior differentiates ⊟ away from zero too.
    ///
    /// The curvature of the logarithm grows like 1/(π − |ω|): with |ω| below 2.5, h = 1e-5 leaves
    /// h² · |log'''| < 1e-8.
    #[test]
    fn the_derivative_of_minus_far_from_zero_is_that_of_central_differences(
        origin in shorter_than(PI),
        turn in shorter_than(2.5),
        axis in 0..3_usize,
    ) {
        let origin = Rotation3::store(&rotation(origin));
        let mut x = vec![0.0; 4];
        Rotation3::plus(&origin, &turn, &mut x);
        let mut step = [Dual::<1>::from(0.0); 3];
        step[axis] = seed(0.0, 0);
        let (mut moved, mut log) = ([Dual::<1>::from(0.0); 4], [Dual::<1>::from(0.0); 3]);
        Rotation3::plus(&x, &step, &mut moved);
        Rotation3::minus(&moved, &origin, &mut log);
        let h = 1e-5;
        let shifted = |size: f64| {
            let mut delta = [0.0; 3];
            delta[axis] = size;
            let (mut moved, mut log) = ([0.0; 4], [0.0; 3]);
            Rotation3::plus(&x, &delta, &mut moved);
            Rotation3::minus(&moved, &origin, &mut log);
            log
        };
        let (up, down) = (shifted(h), shifted(-h));
        for i in 0..3 {
            let difference = (up[i] - down[i]) / (2.0 * h);
            prop_assert!((partials(&log[i])[0] - difference).abs() < 1e-8);
        }
    }
}

/// Steps of all sizes along every axis of the tangent, zero included.
fn steps(dim: usize) -> Vec<Vec<f64>> {
    let mut steps = vec![vec![0.0; dim]];
    for k in 0..dim {
        for size in [1e-300, 1e-12, -1e-9, 0.00999, 0.0101, -0.5, 2.9] {
            let mut step = vec![0.0; dim];
            step[k] = size;
            steps.push(step);
        }
    }
    steps
}

/// Rotation vectors where exponential, logarithm or quaternion change their branch.
fn special_turns() -> Vec<[f64; 3]> {
    let mut turns = vec![[0.0; 3], [1e-160, 0.0, 0.0]];
    for angle in [1e-9, 0.02, PI / 2.0, PI - 1e-9, PI] {
        for axis in [
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [-1.0, 0.0, 0.0],
            [0.0, -1.0, 0.0],
            [0.0, 0.0, -1.0],
            [0.6, 0.0, -0.8],
        ] {
            turns.push(axis.map(|c| c * angle));
        }
    }
    turns
}

fn special_directions() -> Vec<Vector3<f64>> {
    let mut directions = Vec::new();
    for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
        directions.extend([axis, -axis]);
    }
    // On the equator with either zero, and just off the pole at which the basis jumps.
    directions.push(Vector3::new(0.6, 0.8, -0.0));
    directions.push(Vector3::new(1e-9, -1e-9, -1.0).normalize());
    directions
}

#[test]
fn rotations_obey_the_laws_at_the_identity_and_at_half_turns() {
    for turn in special_turns() {
        for step in steps(3) {
            assert_laws::<Rotation3>(&rotation(turn), &step);
        }
        assert_derivative_at_zero::<Rotation3>(&rotation(turn));
    }
}

#[test]
fn poses_obey_the_laws_at_the_identity_and_at_half_turns() {
    for turn in special_turns() {
        for step in steps(6) {
            assert_laws::<Pose3>(&pose([0.0; 3], turn), &step);
        }
        assert_derivative_at_zero::<Pose3>(&pose([0.0; 3], turn));
    }
}

#[test]
fn directions_obey_the_laws_along_every_axis() {
    for direction in special_directions() {
        for step in steps(2) {
            assert_laws::<Direction3>(&direction, &step);
        }
        assert_derivative_at_zero::<Direction3>(&direction);
    }
}

#[test]
fn planes_obey_the_laws_through_the_origin_and_across_every_axis() {
    for normal in special_directions() {
        let x = Plane {
            normal,
            distance: 0.0,
        };
        for step in steps(3) {
            assert_laws::<Plane3>(&x, &step);
        }
        assert_derivative_at_zero::<Plane3>(&x);
    }
}

#[test]
fn planar_poses_obey_the_laws_at_half_turns() {
    for angle in [0.0, PI, -PI, PI - 1e-9, 1e-9 - PI, 5.0 * PI] {
        let x = PlanarPose {
            translation: Vector2::zeros(),
            angle,
        };
        for step in steps(3) {
            assert_laws::<Pose2>(&x, &step);
        }
    }
}

#[test]
fn an_angle_that_passes_a_half_turn_comes_in_on_the_other_side() {
    let almost = Pose2::store(&PlanarPose {
        translation: Vector2::zeros(),
        angle: PI - 0.1,
    });
    let mut moved = vec![0.0; 3];
    Pose2::plus(&almost, &[0.0, 0.0, 0.3], &mut moved);
    // π − 0.1 + 0.3 − 2π; a few ε of π remain.
    assert!((moved[2] - (0.2 - PI)).abs() < 1e-14);
}

#[test]
fn a_step_of_a_quarter_turn_goes_where_geometry_says() {
    // The identity turned by π/2 about z carries x to y.
    let mut q = vec![0.0; 4];
    Rotation3::plus(&[1.0, 0.0, 0.0, 0.0], &[0.0, 0.0, PI / 2.0], &mut q);
    let image = Rotation3::load(&q) * Vector3::x();
    assert!((image - Vector3::y()).norm() < 1e-15);
    // A direction moves by the length of the step, whatever its basis.
    for n in special_directions() {
        let mut moved = vec![0.0; 3];
        Direction3::plus(n.as_slice(), &[0.3, -0.4], &mut moved);
        let angle = n.cross(&Vector3::from_column_slice(&moved)).norm().asin();
        assert!((angle - 0.5).abs() < 1e-14, "{n:?} moved by {angle}");
    }
}

/// The rotation vector from a fixed rotation to the variable: log(fixedᵀ R).
struct TurnFrom(Matrix3<f64>);

impl truing::Constraint for TurnFrom {
    type Vars = (Rotation3,);
    const DIM: usize = 3;
    fn residual<T: truing::Scalar>(&self, (rotation,): truing::Views<'_, Self, T>, r: &mut [T]) {
        let from = self.0.transpose().map(T::from);
        r.copy_from_slice(so3::log_matrix(&(from * rotation)).as_slice());
    }
}

/// ∂ log(R₀ᵀ R exp δ)/∂δ is the inverse right Jacobian of SO(3), I + ½\[ω\]ₓ + c \[ω\]ₓ² with
/// c = 1/θ² − cot(θ/2)/(2θ) (Chirikjian 2011, section 10.8.6): ½ at zero has no place for 0/0, and at
/// half a turn nothing grows, though the rotation vector jumps to the other side there.
#[test]
fn the_rotation_vector_has_the_derivative_of_the_textbook_up_to_half_a_turn() {
    use truing::{LeastSquares, Linearization, Problem};
    let axes = [
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 0.0],
        [0.6, -0.8, 0.0],
        [2.0, -3.0, 6.0],
    ];
    for axis in axes.map(|a| Vector3::from(a).normalize()) {
        for angle in [0.0, 1e-12, 1e-6, 1e-3, 1.0, 3.0, PI - 1e-6, PI - 1e-12, PI] {
            let fixed = rotation([0.3, -0.2, 0.5]);
            let mut problem = Problem::new();
            let turned = fixed * rotation((axis * angle).into());
            let var = problem.add_variable::<Rotation3>("turned", &turned);
            problem.add("turn", (var,), TurnFrom(fixed));
            let mut lin = Linearization::new(problem.structure());
            problem.linearize(problem.initial(), &mut lin);
            let omega = Vector3::from_column_slice(&lin.residual);
            assert!((omega.norm() - angle).abs() < 1e-7, "{omega} at {angle}");
            let found = Matrix3::from_fn(|i, k| lin.values[3 * k + i]);
            let theta = omega.norm();
            let c = if theta < 1e-2 {
                1.0 / 12.0 + theta * theta / 720.0
            } else {
                1.0 / (theta * theta) - 1.0 / (2.0 * theta * (theta / 2.0).tan())
            };
            let cross = omega.cross_matrix();
            let expected = Matrix3::identity() + cross * 0.5 + cross * cross * c;
            assert!(
                (found - expected).amax() < 1e-7,
                "at {angle} about {axis}: {found} is not {expected}"
            );
        }
    }
}

/// The basis across a direction turns little where the direction does, on the equator too, and is orthonormal to rounding
/// next to the pole at which it jumps.
#[test]
fn the_basis_across_a_direction_is_continuous_but_at_one_pole() {
    for turn in 0..12 {
        let (s, c) = (f64::from(turn) * 0.53).sin_cos();
        for z in [-0.9, -1e-3, 0.0, 1e-3, 0.9] {
            let at = |z: f64| {
                let r = (1.0 - z * z).sqrt();
                Direction3::basis(&[r * c, r * s, z])
            };
            assert!((at(z + 1e-9) - at(z - 1e-9)).amax() < 1e-8, "{turn} {z}");
        }
        for off in [1e-3, 1e-8, 1e-150, 0.0] {
            let n = Vector3::new(off * c, off * s, -(1.0_f64 - off * off).sqrt());
            let basis = Direction3::basis(n.as_slice());
            let unit = basis.transpose() * basis - Matrix2::identity();
            assert!(
                unit.amax() < 1e-15 && (basis.transpose() * n).amax() < 1e-15,
                "{off:e}"
            );
        }
    }
}
