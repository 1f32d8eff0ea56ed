//! Whole problems come out the same with every linear algebra: an arm, pose graphs, limits.
//!
//! Public pose graphs are no part of the project: they are looked for in `TRUING_DATA`, or in
//! `shared/data` beside the checkout, and their tests report themselves ignored where they are absent.

use libtest_mimic::{Arguments, Failed, Trial};
use nalgebra::{SMatrix, SVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use truing::manifold::{PlanarPose, Pose, Pose2, Pose3, Vector};
use truing::nalgebra::{UnitQuaternion, Vector2, Vector3};
use truing::{
    Batch, Constraint, LinearLimit, LinearSolver, Method, Problem, Scalar, Settings, Solution, Var,
    Views,
};

const EVERY: [LinearSolver; 5] = [
    LinearSolver::Auto,
    LinearSolver::DenseQr,
    LinearSolver::DenseCholesky,
    LinearSolver::SparseCholesky,
    LinearSolver::SparseQr,
];

fn solve(problem: &Problem, method: Method, linear_solver: LinearSolver) -> Solution {
    let settings = Settings {
        method,
        linear_solver,
        ..Settings::default()
    };
    let solution = truing::solve(problem, &settings).unwrap();
    assert!(
        solution.termination.converged(),
        "{linear_solver:?}: {solution}"
    );
    solution
}

/// The tip of a planar arm, x = Σ lᵢ cos φᵢ and y = Σ lᵢ sin φᵢ with φᵢ = Σ (qₖ + θₖ), minus where
/// it was seen; lengths first, then offsets.
struct Tip {
    q: Vec<f64>,
    seen: [f64; 2],
}

fn tip<T: Scalar>(x: &[T], q: &[f64]) -> [T; 2] {
    let (mut angle, mut at) = (T::from(0.0), [T::from(0.0); 2]);
    for (i, q) in q.iter().enumerate() {
        angle += x[q_len(x) + i] + *q;
        at[0] += x[i] * angle.cos();
        at[1] += x[i] * angle.sin();
    }
    at
}

fn q_len<T>(x: &[T]) -> usize {
    x.len() / 2
}

impl Constraint for Tip {
    type Vars = (Vector,);
    const DIM: usize = 2;
    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        let at = tip(x, &self.q);
        for (r, (at, seen)) in r.iter_mut().zip(at.iter().zip(self.seen)) {
            *r = *at - seen;
        }
    }
}

fn an_arm_is_found() -> Result<(), Failed> {
    let truth = [0.5, 0.4, 0.3, 0.2, 0.02, -0.03, 0.05, 0.01];
    let start: Vec<f64> = (truth.iter().enumerate())
        .map(|(k, x)| x + 0.02 * f64::from(k as u8 % 3) - 0.02)
        .collect();
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let mut problem = Problem::new();
    let x = problem.add_variable::<Vector>("arm", &start);
    let mut batch = Batch::new("tips");
    for _ in 0..60 {
        let q: Vec<f64> = (0..4).map(|_| random.random_range(-2.0..2.0)).collect();
        let seen = tip(&truth, &q);
        batch.push((x,), Tip { q, seen });
    }
    problem.add_block(batch);
    for method in [Method::LevenbergMarquardt, Method::GaussNewton] {
        for asked in EVERY {
            let solution = solve(&problem, method, asked);
            for (found, truth) in solution.values.get(x).iter().zip(truth) {
                assert!((found - truth).abs() < 1e-12, "{asked:?}: {found} {truth}");
            }
            let by = solution.linear_solver;
            match asked {
                LinearSolver::Auto | LinearSolver::DenseQr => assert_eq!(by, "dense QR"),
                LinearSolver::DenseCholesky => assert_eq!(by, "dense Cholesky"),
                LinearSolver::SparseCholesky => assert_eq!(by, "sparse Cholesky"),
                LinearSolver::SparseQr => assert_eq!(by, "sparse QR"),
            }
            assert!(
                solution
                    .to_string()
                    .contains(&format!("steps by {by}: 8 columns"))
            );
        }
    }
    Ok(())
}

/// w (x − b).
struct Near(f64, f64);

impl Constraint for Near {
    type Vars = (Vector,);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = (x[0] - self.0) * self.1;
    }
}

/// w (y − x).
struct Smooth(f64);

impl Constraint for Smooth {
    type Vars = (Vector, Vector);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (x, y): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = (y[0] - x[0]) * self.0;
    }
}

/// A smoothed series that is not negative, rises nowhere faster than a given slope, and has a given
/// mean over its ends.
fn limits_are_kept_alike(n: usize, every: &[LinearSolver]) -> Result<(), Failed> {
    let mut problem = Problem::new();
    let series: Vec<Var<Vector>> = (0..n)
        .map(|i| problem.add_variable::<Vector>(format!("x{i}"), &vec![0.5]))
        .collect();
    for (i, x) in series.iter().enumerate() {
        let s = 0.11 * i as f64;
        problem.add("near", (*x,), Near(s.sin() + 0.3 * (3.0 * s).cos(), 1.0));
        problem.bound_component(*x, 0, -0.4, 1.0);
        if i > 0 {
            problem.add("smooth", (series[i - 1], *x), Smooth(1.5));
        }
        if i > 0 && i % 10 == 0 {
            let rise = LinearLimit::new(format!("rise {i}"));
            let rise = rise.term(*x, 0, 1.0).term(series[i - 1], 0, -1.0);
            problem.add_limit(rise.at_most(0.04));
        }
    }
    let mean = LinearLimit::new("mean of the ends");
    let mean = mean.term(series[0], 0, 0.5).term(series[n - 1], 0, 0.5);
    problem.add_limit(mean.at_least(0.1).at_most(0.1));
    let reference = solve(&problem, Method::LevenbergMarquardt, every[0]);
    let limits = reference.limits.len();
    assert!(limits > n / 5, "only {limits} limits are active");
    for &asked in &every[1..] {
        let solution = solve(&problem, Method::LevenbergMarquardt, asked);
        assert_eq!(solution.limits.len(), limits, "{asked:?}");
        for x in &series {
            let (found, expected) = (solution.values.get(*x)[0], reference.values.get(*x)[0]);
            assert!((-0.4..=1.0).contains(&found), "{asked:?}: {found}");
            assert!(
                (found - expected).abs() < 1e-10,
                "{asked:?}: {found}, {expected}"
            );
        }
        if asked == LinearSolver::Auto {
            assert_eq!(solution.linear_solver, "sparse Cholesky");
        }
    }
    Ok(())
}

/// g2o's error of a relative pose, e = (t, vec q) of Z⁻¹ A⁻¹ B, times the root W of its information.
struct Between3 {
    inverse: Pose<f64>,
    root: SMatrix<f64, 6, 6>,
}

impl Constraint for Between3 {
    type Vars = (Pose3, Pose3);
    const DIM: usize = 6;
    fn residual<T: Scalar>(&self, (a, b): Views<'_, Self, T>, r: &mut [T]) {
        let error = self.inverse.lift().compose(&a.inverse().compose(&b));
        let m = &error.rotation;
        // 4 w with w = cos of half the angle.
        let w = (m.trace() + 1.0).sqrt() * 2.0;
        let e = [
            error.translation.x,
            error.translation.y,
            error.translation.z,
            (m[(2, 1)] - m[(1, 2)]) / w,
            (m[(0, 2)] - m[(2, 0)]) / w,
            (m[(1, 0)] - m[(0, 1)]) / w,
        ];
        for (i, r) in r.iter_mut().enumerate() {
            *r = (i..6).fold(T::from(0.0), |sum, k| sum + e[k] * self.root[(i, k)]);
        }
    }
}

/// The same in the plane, e = (Rᵀ(t − z), angle).
struct Between2 {
    seen: PlanarPose<f64>,
    root: SMatrix<f64, 3, 3>,
}

impl Constraint for Between2 {
    type Vars = (Pose2, Pose2);
    const DIM: usize = 3;
    fn residual<T: Scalar>(&self, (a, b): Views<'_, Self, T>, r: &mut [T]) {
        let back = |angle: T, v: [T; 2]| {
            let (sin, cos) = (angle.sin(), angle.cos());
            [cos * v[0] + sin * v[1], cos * v[1] - sin * v[0]]
        };
        let d = b.translation - a.translation;
        let [x, y] = back(a.angle, [d.x, d.y]);
        let z = self.seen.translation;
        let [x, y] = back(T::from(self.seen.angle), [x - z.x, y - z.y]);
        let turn = b.angle - a.angle - self.seen.angle;
        let e = [x, y, turn.sin().atan2(turn.cos())];
        for (i, r) in r.iter_mut().enumerate() {
            *r = (i..3).fold(T::from(0.0), |sum, k| sum + e[k] * self.root[(i, k)]);
        }
    }
}

/// The upper root W of Ω = WᵀW, from the upper triangle in rows.
fn root<const N: usize>(upper: &[f64]) -> SMatrix<f64, N, N> {
    let mut omega = SMatrix::<f64, N, N>::zeros();
    let mut entries = upper.iter();
    for i in 0..N {
        for k in i..N {
            omega[(i, k)] = *entries.next().unwrap();
            omega[(k, i)] = omega[(i, k)];
        }
    }
    omega.cholesky().unwrap().l().transpose()
}

fn pose(numbers: &[f64]) -> Pose<f64> {
    let [qx, qy, qz, qw] = [numbers[3], numbers[4], numbers[5], numbers[6]];
    let q = UnitQuaternion::new_normalize(nalgebra::Quaternion::new(qw, qx, qy, qz));
    let rotation = q.to_rotation_matrix().into_inner();
    Pose::new(rotation, Vector3::new(numbers[0], numbers[1], numbers[2]))
}

fn planar(numbers: &[f64]) -> PlanarPose<f64> {
    PlanarPose {
        translation: Vector2::new(numbers[0], numbers[1]),
        angle: numbers[2],
    }
}

/// A pose graph in g2o format with its first pose fixed.
fn g2o(name: &str) -> Problem {
    let text = std::fs::read_to_string(data().join(name)).unwrap();
    let mut problem = Problem::new();
    let (mut spatial, mut flat) = (Vec::new(), Vec::new());
    let mut between3 = Batch::new("relative poses");
    let mut between2 = Batch::new("relative poses");
    for line in text.lines() {
        let mut words = line.split_whitespace();
        let kind = words.next().unwrap_or_default();
        let x: Vec<f64> = words.map(|word| word.parse().unwrap()).collect();
        let name = || format!("pose {}", x[0]);
        match kind {
            "VERTEX_SE3:QUAT" => {
                spatial.push(problem.add_variable::<Pose3>(name(), &pose(&x[1..])))
            }
            "VERTEX_SE2" => flat.push(problem.add_variable::<Pose2>(name(), &planar(&x[1..]))),
            "EDGE_SE3:QUAT" => between3.push(
                (spatial[x[0] as usize], spatial[x[1] as usize]),
                Between3 {
                    inverse: pose(&x[2..]).inverse(),
                    root: root(&x[9..]),
                },
            ),
            "EDGE_SE2" => between2.push(
                (flat[x[0] as usize], flat[x[1] as usize]),
                Between2 {
                    seen: planar(&x[2..]),
                    root: root(&x[5..]),
                },
            ),
            _ => {}
        }
    }
    if let Some(first) = spatial.first() {
        problem.fix(*first);
        problem.add_block(between3);
    }
    if let Some(first) = flat.first() {
        problem.fix(*first);
        problem.add_block(between2);
    }
    problem
}

fn data() -> PathBuf {
    let folder = match std::env::var_os("TRUING_DATA") {
        Some(folder) => PathBuf::from(folder),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
    };
    folder.join("g2o")
}

/// The optimum of g2o's objective, by each of these.
fn optimum(name: &str, cost: f64, tolerance: f64, asked: &[LinearSolver]) -> Result<(), Failed> {
    let problem = g2o(name);
    for asked in asked {
        let solution = solve(&problem, Method::LevenbergMarquardt, *asked);
        let found = solution.cost;
        assert!(
            (found - cost).abs() <= tolerance * cost,
            "{asked:?}: {found} {cost}"
        );
        if *asked == LinearSolver::Auto {
            assert_eq!(solution.linear_solver, "sparse Cholesky");
        }
    }
    Ok(())
}

/// A pose graph of 300 columns: every linear algebra, and nothing that fixes its frame.
fn a_floating_pose_graph_comes_out_alike() -> Result<(), Failed> {
    let mut random = ChaCha8Rng::seed_from_u64(6);
    let mut problem = Problem::new();
    let path: Vec<PlanarPose<f64>> = (0..100)
        .map(|i| {
            let turn = 0.2 * f64::from(i);
            planar(&[3.0 * turn.cos(), 3.0 * turn.sin(), (turn + 1.6).sin()])
        })
        .collect();
    let poses: Vec<Var<Pose2>> = (path.iter())
        .map(|t| {
            let mut off = || random.random_range(-0.05..0.05);
            let start = [
                t.translation.x + off(),
                t.translation.y + off(),
                t.angle + off(),
            ];
            problem.add_variable::<Pose2>("pose", &planar(&start))
        })
        .collect();
    let mut batch = Batch::new("relative poses");
    for i in 1..100_usize {
        for before in [1, 31] {
            let Some(from) = i.checked_sub(before) else {
                continue;
            };
            let (a, b) = (&path[from], &path[i]);
            let d = b.translation - a.translation;
            let (sin, cos) = a.angle.sin_cos();
            let mut noise = || random.random_range(-1e-3..1e-3);
            let seen = planar(&[
                cos * d.x + sin * d.y + noise(),
                cos * d.y - sin * d.x + noise(),
                b.angle - a.angle + noise(),
            ]);
            let root = SMatrix::from_diagonal(&SVector::from([100.0, 100.0, 300.0]));
            batch.push((poses[from], poses[i]), Between2 { seen, root });
        }
    }
    problem.add_block(batch);
    let reference = solve(&problem, Method::LevenbergMarquardt, LinearSolver::DenseQr).cost;
    for asked in EVERY {
        let solution = solve(&problem, Method::LevenbergMarquardt, asked);
        let cost = solution.cost;
        assert!(
            (cost - reference).abs() <= 1e-10 * reference,
            "{asked:?}: {cost}, {reference}"
        );
        assert!(
            solution.iterations < 20,
            "{asked:?}: {}",
            solution.iterations
        );
    }
    // Nothing damps Gauss–Newton: it says so, whichever it is.
    for linear_solver in EVERY {
        let settings = Settings {
            method: Method::GaussNewton,
            linear_solver,
            ..Settings::default()
        };
        let end = truing::solve(&problem, &settings).unwrap().termination;
        assert!(
            matches!(end, truing::Termination::Singular { .. }),
            "{linear_solver:?}: {end}"
        );
    }
    problem.fix(poses[0]);
    for asked in EVERY {
        let cost = solve(&problem, Method::GaussNewton, asked).cost;
        assert!(
            (cost - reference).abs() <= 1e-10 * reference,
            "{asked:?}: {cost}, {reference}"
        );
    }
    Ok(())
}

fn main() -> ExitCode {
    let absent = !data().is_dir();
    let sparse = [LinearSolver::Auto, LinearSolver::SparseQr];
    let tests = vec![
        Trial::test("an_arm_is_found", an_arm_is_found),
        Trial::test("limits_are_kept_alike", || {
            // Against the one that squares nothing.
            let every = [
                LinearSolver::DenseQr,
                LinearSolver::Auto,
                LinearSolver::DenseCholesky,
                LinearSolver::SparseCholesky,
                LinearSolver::SparseQr,
            ];
            limits_are_kept_alike(150, &every)
        }),
        Trial::test("thousands_of_limits_are_kept_alike", || {
            limits_are_kept_alike(3000, &[LinearSolver::SparseQr, LinearSolver::Auto])
        }),
        Trial::test(
            "a_floating_pose_graph_comes_out_alike",
            a_floating_pose_graph_comes_out_alike,
        ),
        // Figures of g2o's own objective, ½ Σ eᵀΩe, as the data's README gives them.
        Trial::test("manhattan_3500", move || {
            optimum("input_M3500_g2o.g2o", 68.956_475_5, 1e-8, &sparse)
        })
        .with_ignored_flag(absent),
        Trial::test("sphere_2500", move || {
            optimum("sphere2500.g2o", 363.574_834, 1e-8, &sparse[..1])
        })
        .with_ignored_flag(absent),
        Trial::test("parking_garage", move || {
            optimum("parking-garage.g2o", 0.619_345_29, 1e-7, &sparse[..1])
        })
        .with_ignored_flag(absent),
    ];
    libtest_mimic::run(&Arguments::from_args(), tests).exit_code()
}
