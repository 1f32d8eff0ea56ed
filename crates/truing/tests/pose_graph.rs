//! Pose graphs: relative poses, directions and planes seen from poses recover where the poses were.
//!
//! The constraints are defined here, each in about ten lines, as any user would.

use proptest::array::{uniform2, uniform3};
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use truing::manifold::{Direction3, PlanarPose, Plane, Plane3, Pose, Pose2, Pose3, Rotation3, so3};
use truing::nalgebra::{Matrix3, Vector2, Vector3};
use truing::{
    Batch, Constraint, Method, Noise, Problem, Scalar, Settings, Solution, Var, Variable, Views,
};

/// The second pose as measured from the first; r = ᵃ(pᵦ − pₐ) − z and the difference of angles.
struct Between2(PlanarPose<f64>);

impl Constraint for Between2 {
    type Vars = (Pose2, Pose2);
    const DIM: usize = 3;
    fn residual<T: Scalar>(&self, (a, b): Views<'_, Self, T>, r: &mut [T]) {
        let (sin, cos) = (a.angle.sin(), a.angle.cos());
        let d = b.translation - a.translation;
        r[0] = cos * d.x + sin * d.y - self.0.translation.x;
        r[1] = cos * d.y - sin * d.x - self.0.translation.y;
        let turn = b.angle - a.angle - self.0.angle;
        r[2] = turn.sin().atan2(turn.cos());
    }
}

/// The second pose as measured from the first; r = the pose between measurement and model, (m, rad).
struct Between3(Pose<f64>);

impl Constraint for Between3 {
    type Vars = (Pose3, Pose3);
    const DIM: usize = 6;
    fn residual<T: Scalar>(&self, (a, b): Views<'_, Self, T>, r: &mut [T]) {
        let error = self.0.lift().inverse().compose(&a.inverse().compose(&b));
        r[..3].copy_from_slice(error.translation.as_slice());
        r[3..].copy_from_slice(so3::log_matrix(&error.rotation).as_slice());
    }
}

/// The second orientation as measured from the first; r = log(Zᵀ Rₐᵀ Rᵦ) [rad].
struct BetweenRotations(Matrix3<f64>);

impl Constraint for BetweenRotations {
    type Vars = (Rotation3, Rotation3);
    const DIM: usize = 3;
    fn residual<T: Scalar>(&self, (a, b): Views<'_, Self, T>, r: &mut [T]) {
        let error = self.0.map(T::from).transpose() * a.transpose() * b;
        r.copy_from_slice(so3::log_matrix(&error).as_slice());
    }
}

/// A direction far away (a star, gravity) as seen in a rotated frame; r = Rᵀ n − z.
struct Sighting(Vector3<f64>);

impl Constraint for Sighting {
    type Vars = (Rotation3, Direction3);
    const DIM: usize = 3;
    fn residual<T: Scalar>(&self, (rotation, n): Views<'_, Self, T>, r: &mut [T]) {
        let seen = rotation.transpose() * n - self.0.map(T::from);
        r.copy_from_slice(seen.as_slice());
    }
}

/// A wall as seen from a pose: its normal and distance in that frame, minus those measured.
struct Wall(Plane<f64>);

impl Constraint for Wall {
    type Vars = (Pose3, Plane3);
    const DIM: usize = 4;
    fn residual<T: Scalar>(&self, (pose, wall): Views<'_, Self, T>, r: &mut [T]) {
        let normal = pose.rotation.transpose() * wall.normal - self.0.normal.map(T::from);
        r[..3].copy_from_slice(normal.as_slice());
        // The distance of the frame's origin from the wall, on the other side of the sign.
        r[3] = -wall.signed_distance(&pose.translation) - self.0.distance;
    }
}

/// Two walls at a known distance along their normals and a known difference of normals.
struct BetweenWalls {
    normals: Vector3<f64>,
    distance: f64,
}

impl Constraint for BetweenWalls {
    type Vars = (Plane3, Plane3);
    const DIM: usize = 4;
    fn residual<T: Scalar>(&self, (a, b): Views<'_, Self, T>, r: &mut [T]) {
        let normals = b.normal - a.normal - self.normals.map(T::from);
        r[..3].copy_from_slice(normals.as_slice());
        r[3] = b.distance - a.distance - self.distance;
    }
}

/// The angle between two directions by its cosine and its sine's vector: r = (a · b, a × b) − z.
struct BetweenDirections([f64; 4]);

impl BetweenDirections {
    fn exact(a: &Vector3<f64>, b: &Vector3<f64>) -> Self {
        let cross = a.cross(b);
        Self([a.dot(b), cross.x, cross.y, cross.z])
    }
}

impl Constraint for BetweenDirections {
    type Vars = (Direction3, Direction3);
    const DIM: usize = 4;
    fn residual<T: Scalar>(&self, (a, b): Views<'_, Self, T>, r: &mut [T]) {
        let cross = a.cross(&b);
        r.copy_from_slice(&[a.dot(&b), cross.x, cross.y, cross.z]);
        for (r, z) in r.iter_mut().zip(self.0) {
            *r -= z;
        }
    }
}

fn planar(x: f64, y: f64, angle: f64) -> PlanarPose<f64> {
    PlanarPose {
        translation: Vector2::new(x, y),
        angle,
    }
}

/// b as seen from a.
fn planar_between(a: &PlanarPose<f64>, b: &PlanarPose<f64>) -> PlanarPose<f64> {
    let d = b.translation - a.translation;
    let (sin, cos) = a.angle.sin_cos();
    planar(
        cos * d.x + sin * d.y,
        cos * d.y - sin * d.x,
        b.angle - a.angle,
    )
}

fn pose(translation: [f64; 3], omega: [f64; 3]) -> Pose<f64> {
    Pose::new(so3::exp_matrix(&omega), translation.into())
}

#[track_caller]
fn solve(problem: &Problem, method: Method) -> Solution {
    let settings = Settings {
        method,
        ..Settings::default()
    };
    let solution = truing::solve(problem, &settings).unwrap();
    assert!(solution.termination.converged(), "{}", solution.termination);
    solution
}

/// The largest distance of an estimate from its truth, in the tangent space [m, rad].
fn largest_error<V: Variable>(solution: &Solution, vars: &[Var<V>], truth: &[V::Value]) -> f64 {
    let mut largest = 0.0_f64;
    for (var, truth) in vars.iter().zip(truth) {
        let mut error = vec![0.0; var.tangent_dim()];
        V::minus(solution.values.raw(*var), &V::store(truth), &mut error);
        largest = error.iter().fold(largest, |m, e| m.max(e.abs()));
    }
    largest
}

/// Twice around a circle of 2 m, heading along it, so that angles pass ±π.
fn planar_truth() -> Vec<PlanarPose<f64>> {
    (0..16)
        .map(|i| {
            let turn = f64::from(i) * FRAC_PI_4;
            planar(2.0 * turn.cos(), 2.0 * turn.sin(), turn + FRAC_PI_2)
        })
        .collect()
}

#[test]
fn a_planar_pose_graph_with_its_first_pose_fixed_is_recovered() {
    let truth = planar_truth();
    let mut problem = Problem::new();
    let poses: Vec<Var<Pose2>> = truth
        .iter()
        .enumerate()
        .map(|(i, t)| {
            let off = if i == 0 { 0.0 } else { 0.2 * (i as f64).sin() };
            let start = planar(t.translation.x + off, t.translation.y - off, t.angle + off);
            problem.add_variable::<Pose2>(format!("pose {i}"), &start)
        })
        .collect();
    problem.fix(poses[0]);
    let mut batch = Batch::new("odometry and loops").noise(Noise::isotropic(0.01).unwrap());
    for (a, b) in (0..15)
        .map(|i| (i, i + 1))
        .chain([(0, 8), (3, 11), (15, 0)])
    {
        let seen = planar_between(&truth[a], &truth[b]);
        batch.push((poses[a], poses[b]), Between2(seen));
    }
    problem.add_block(batch);
    truing::assert_jacobian!(&problem, problem.initial());
    for method in [Method::LevenbergMarquardt, Method::GaussNewton] {
        let solution = solve(&problem, method);
        let error = largest_error(&solution, &poses, &truth);
        // Exact measurements: what is left is rounding.
        assert!(error < 1e-9, "{error:e} with {method:?}");
    }
}

/// A helix that rises 0.2 m per pose and rolls all the time.
fn spatial_truth() -> Vec<Pose<f64>> {
    (0..16)
        .map(|i| {
            let s = f64::from(i) * 0.8;
            pose(
                [2.0 * s.cos(), 2.0 * s.sin(), 0.25 * s],
                [0.3 * s.sin(), 0.2 * s, 0.5 - 0.1 * s],
            )
        })
        .collect()
}

fn perturbed(truth: &Pose<f64>, i: usize) -> Pose<f64> {
    let s = i as f64;
    let off = pose(
        [0.2 * s.sin(), 0.2 * s.cos(), -0.1],
        [0.1 * s.cos(), -0.15, 0.2 * s.sin()],
    );
    truth.compose(&off)
}

fn spatial_graph(truth: &[Pose<f64>]) -> (Problem, Vec<Var<Pose3>>) {
    let mut problem = Problem::new();
    let poses: Vec<Var<Pose3>> = truth
        .iter()
        .enumerate()
        .map(|(i, t)| problem.add_variable::<Pose3>(format!("pose {i}"), &perturbed(t, i)))
        .collect();
    let noise = Noise::diagonal(&[0.01, 0.01, 0.01, 0.002, 0.002, 0.002]).unwrap();
    let mut batch = Batch::new("odometry and loops").noise(noise);
    for (a, b) in (0..15)
        .map(|i| (i, i + 1))
        .chain([(0, 8), (3, 11), (15, 0)])
    {
        let seen = truth[a].inverse().compose(&truth[b]);
        batch.push((poses[a], poses[b]), Between3(seen));
    }
    problem.add_block(batch);
    (problem, poses)
}

#[test]
fn a_pose_graph_with_a_prior_on_its_first_pose_is_recovered() {
    let truth = spatial_truth();
    let (mut problem, poses) = spatial_graph(&truth);
    problem.prior(poses[0], &truth[0], 1e-3).unwrap();
    truing::assert_jacobian!(&problem, problem.initial());
    for method in [Method::LevenbergMarquardt, Method::GaussNewton] {
        let error = largest_error(&solve(&problem, method), &poses, &truth);
        assert!(error < 1e-9, "{error:e} with {method:?}");
    }
}

#[test]
fn a_pose_graph_without_an_anchor_is_right_but_for_a_common_motion() {
    let truth = spatial_truth();
    let (problem, poses) = spatial_graph(&truth);
    let values = solve(&problem, Method::LevenbergMarquardt).values;
    let estimate: Vec<Pose<f64>> = poses.iter().map(|p| values.get(*p)).collect();
    for i in 1..truth.len() {
        let ours = estimate[0].inverse().compose(&estimate[i]);
        let theirs = truth[0].inverse().compose(&truth[i]);
        let error = theirs.inverse().compose(&ours);
        assert!(error.translation.amax() < 1e-9);
        assert!(so3::log_matrix(&error.rotation).amax() < 1e-9);
    }
}

#[test]
fn walls_seen_from_poses_are_mapped_with_them() {
    let truth = spatial_truth();
    let (mut problem, poses) = spatial_graph(&truth);
    problem.prior(poses[0], &truth[0], 1e-3).unwrap();
    let walls_truth = [
        ([1.0, 0.0, 0.0], 4.0),
        ([0.0, -0.6, 0.8], -3.0),
        ([0.0, 0.0, -1.0], 0.0),
    ]
    .map(|(normal, distance)| Plane {
        normal: Vector3::from(normal),
        distance,
    });
    let walls = walls_truth.map(|wall| {
        let mut start = vec![0.0; 4];
        Plane3::plus(&Plane3::store(&wall), &[0.3, -0.2, 0.5], &mut start);
        problem.add_variable::<Plane3>("wall", &Plane3::load(&start))
    });
    for (wall, truth_wall) in walls.into_iter().zip(walls_truth) {
        for (p, t) in poses.iter().zip(&truth).step_by(5) {
            let seen = Plane {
                normal: t.rotation.transpose() * truth_wall.normal,
                distance: truth_wall.distance - truth_wall.normal.dot(&t.translation),
            };
            problem.add("walls", (*p, wall), Wall(seen));
        }
    }
    truing::assert_jacobian!(&problem, problem.initial());
    let solution = solve(&problem, Method::LevenbergMarquardt);
    assert!(largest_error(&solution, &poses, &truth) < 1e-9);
    assert!(largest_error(&solution, &walls, &walls_truth) < 1e-9);
}

/// A problem with one constraint on two variables at the given values.
fn pair<A: Variable, B: Variable, C: Constraint<Vars = (A, B)>>(
    a: &A::Value,
    b: &B::Value,
    constraint: C,
) -> Problem {
    let mut problem = Problem::new();
    let a = problem.add_variable::<A>("a", a);
    let b = problem.add_variable::<B>("b", b);
    problem.add("between", (a, b), constraint);
    problem
}

/// Rotation vectors below 3 rad, away from half turns where the logarithm jumps.
fn turn() -> impl Strategy<Value = [f64; 3]> {
    uniform3(-1.7..1.7_f64)
}

fn unit_vector() -> impl Strategy<Value = Vector3<f64>> {
    uniform3(-1.0..1.0_f64).prop_filter_map("too short", |v| Vector3::from(v).try_normalize(0.1))
}

proptest! {
    // The logarithm's third derivative grows towards half turns: errors are kept within 2.6 rad,
    // where central differences (h = 6e-6) are good to 1e-7 of the column.
    #[test]
    fn between_poses_the_jacobian_is_right(
        t in uniform2(uniform3(-2.0..2.0_f64)),
        omega in uniform2(turn()),
        error in uniform3(-1.5..1.5_f64),
    ) {
        let (a, b) = (pose(t[0], omega[0]), pose(t[1], omega[1]));
        let exact = a.inverse().compose(&b);
        let problem = pair(&a, &b, Between3(exact));
        truing::assert_jacobian!(&problem, problem.initial());
        let problem = pair(&a, &b, Between3(exact.compose(&pose(t[0], error))));
        truing::assert_jacobian!(&problem, problem.initial());
    }

    #[test]
    fn between_rotations_the_jacobian_is_right(
        omega in uniform2(turn()),
        error in uniform3(-1.5..1.5_f64),
    ) {
        let [a, b] = omega.map(|omega| so3::exp_matrix(&omega));
        let exact = a.transpose() * b;
        let problem = pair(&a, &b, BetweenRotations(exact));
        truing::assert_jacobian!(&problem, problem.initial());
        let problem = pair(&a, &b, BetweenRotations(exact * so3::exp_matrix(&error)));
        truing::assert_jacobian!(&problem, problem.initial());
    }

    #[test]
    fn between_planar_poses_the_jacobian_is_right(
        t in uniform2(uniform2(-2.0..2.0_f64)),
        angles in uniform2(-3.1..3.1_f64),
        error in -3.0..3.0_f64,
    ) {
        let a = planar(t[0][0], t[0][1], angles[0]);
        let b = planar(t[1][0], t[1][1], angles[1]);
        let exact = planar_between(&a, &b);
        let problem = pair(&a, &b, Between2(exact));
        truing::assert_jacobian!(&problem, problem.initial());
        let off = planar(exact.translation.x, 1.0, exact.angle + error);
        let problem = pair(&a, &b, Between2(off));
        truing::assert_jacobian!(&problem, problem.initial());
    }

    #[test]
    fn between_directions_the_jacobian_is_right(a in unit_vector(), b in unit_vector()) {
        for constraint in [
            BetweenDirections::exact(&a, &b),
            BetweenDirections([0.5, -0.1, 0.2, 0.3]),
            BetweenDirections::exact(&a, &a),
        ] {
            let problem = pair(&a, &b, constraint);
            truing::assert_jacobian!(&problem, problem.initial());
        }
        let problem = pair(&a, &a, BetweenDirections::exact(&a, &a));
        truing::assert_jacobian!(&problem, problem.initial());
    }

    #[test]
    fn between_a_rotation_and_a_direction_the_jacobian_is_right(
        omega in turn(),
        n in unit_vector(),
        seen in unit_vector(),
    ) {
        let rotation = so3::exp_matrix(&omega);
        for seen in [seen, rotation.transpose() * n] {
            let problem = pair(&rotation, &n, Sighting(seen));
            truing::assert_jacobian!(&problem, problem.initial());
        }
    }

    #[test]
    fn between_planes_the_jacobian_is_right(
        normals in uniform2(unit_vector()),
        distances in uniform2(-3.0..3.0_f64),
    ) {
        let [a, b] = [0, 1].map(|i| Plane { normal: normals[i], distance: distances[i] });
        for (normals, distance) in [
            (b.normal - a.normal, b.distance - a.distance),
            (Vector3::zeros(), 0.1),
        ] {
            let problem = pair(&a, &b, BetweenWalls { normals, distance });
            truing::assert_jacobian!(&problem, problem.initial());
        }
    }

    #[test]
    fn a_prior_on_a_pose_has_the_right_jacobian(
        t in uniform3(-2.0..2.0_f64),
        omega in turn(),
        error in uniform3(-1.5..1.5_f64),
    ) {
        let x = pose(t, omega);
        for mean in [x, x.compose(&pose([0.1, -0.2, 0.3], error))] {
            let mut problem = Problem::new();
            let var = problem.add_variable::<Pose3>("x", &x);
            problem.prior(var, &mean, 0.1).unwrap();
            truing::assert_jacobian!(&problem, problem.initial());
        }
    }
}

#[test]
fn at_the_identity_with_no_error_the_jacobian_is_right() {
    let identity = Pose::identity();
    let problem = pair(&identity, &identity, Between3(identity));
    truing::assert_jacobian!(&problem, problem.initial());
    let rotation = Matrix3::identity();
    let problem = pair(&rotation, &rotation, BetweenRotations(rotation));
    truing::assert_jacobian!(&problem, problem.initial());
    for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
        for n in [axis, -axis] {
            let problem = pair(&rotation, &n, Sighting(n));
            truing::assert_jacobian!(&problem, problem.initial());
            let wall = Plane {
                normal: n,
                distance: 0.0,
            };
            let problem = pair(&identity, &wall, Wall(wall));
            truing::assert_jacobian!(&problem, problem.initial());
        }
    }
}
