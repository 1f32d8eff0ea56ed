//! Gross outliers neither move a robust estimate nor go unnamed: fits, pose graphs, simulated touches.

#[path = "support/puma.rs"]
mod puma;

use puma::{Scene, What, puma, table};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use truing::manifold::{PlanarPose, Plane, Pose2, Vector};
use truing::nalgebra::Vector2;
use truing::{
    Batch, Constraint, Covariance, LeastSquares, Linearization, Loss, Noise, Problem, Scalar,
    Settings, Solution, Termination, Var, Views, adapt_loss, solve, solve_adaptive,
    solve_graduated,
};
use truing_robot::identify::Choice;
use truing_robot::{Arm, Calibration, Outcome};

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Every loss with a scale, at 95 % efficiency, and two of Barron's between them.
fn losses() -> Vec<Loss> {
    let mut all = Loss::EFFICIENT.to_vec();
    all.push(Loss::barron(0.5, 1.2).unwrap());
    all.push(Loss::barron(-5.0, 2.0).unwrap());
    all
}

fn redescending() -> impl Iterator<Item = Loss> {
    losses().into_iter().filter(Loss::redescends)
}

#[track_caller]
fn graduated(problem: &Problem) -> Solution {
    let solution = solve_graduated(problem, &Settings::default()).unwrap();
    assert!(solution.termination.converged(), "{}", solution.termination);
    solution
}

/// One observation of y = a + b t.
struct OnLine {
    t: f64,
    y: f64,
}

impl Constraint for OnLine {
    type Vars = (Vector,);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (p,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = p[0] + p[1] * self.t - T::from(self.y);
    }
}

/// Observations with noise 0.1, the last `bad` of 100 of them on another line altogether.
fn observations(seed: u64, bad: usize) -> Vec<OnLine> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let one = |k: usize| {
        let t = rng.random_range(0.0..10.0);
        let y = if k < 100 - bad {
            1.0 + 0.5 * t
        } else {
            20.0 - 1.5 * t + rng.random_range(-3.0..3.0)
        };
        OnLine {
            t,
            y: y + 0.1 * normal(&mut rng),
        }
    };
    (0..100).map(one).collect()
}

fn line(observations: impl IntoIterator<Item = OnLine>, loss: Loss) -> (Problem, Var<Vector>) {
    let mut problem = Problem::new();
    let p = problem.add_variable::<Vector>("line", &vec![0.0, 0.0]);
    let mut batch = Batch::new("observations")
        .noise(Noise::isotropic(0.1).unwrap())
        .loss(loss);
    for observation in observations {
        batch.push((p,), observation);
    }
    problem.add_block(batch);
    (problem, p)
}

/// Intercept and slope of least squares in closed form, with their standard deviations.
fn least_squares(observations: &[OnLine]) -> ([f64; 2], [f64; 2]) {
    let n = observations.len() as f64;
    let mean = |f: fn(&OnLine) -> f64| observations.iter().map(f).sum::<f64>() / n;
    let (t, y) = (mean(|o| o.t), mean(|o| o.y));
    let spread: f64 = observations.iter().map(|o| (o.t - t).powi(2)).sum();
    let product: f64 = observations.iter().map(|o| (o.t - t) * (o.y - y)).sum();
    let slope = product / spread;
    let deviations = [0.1 * (1.0 / n + t * t / spread).sqrt(), 0.1 / spread.sqrt()];
    ([y - slope * t, slope], deviations)
}

/// 40 % of the observations lie on another line: the estimate is that of the others in closed form,
/// and exactly those are named.
#[test]
fn a_line_is_found_beside_another_one() {
    for loss in redescending() {
        for seed in 0..10 {
            let (mut good, bad) = (observations(seed, 40), 40);
            good.truncate(100 - bad);
            let (expected, sigma) = least_squares(&good);
            let (problem, p) = line(observations(seed, bad), loss);
            let solution = graduated(&problem);
            let found = solution.values.get(p);
            for k in 0..2 {
                let off = (found[k] - expected[k]).abs();
                assert!(
                    off < 2.0 * sigma[k],
                    "{loss:?}, seed {seed}: {found:?} {expected:?}"
                );
            }
            let far = |o: &OnLine| (o.y - expected[0] - expected[1] * o.t).abs() > 0.5;
            let named = |k: usize| solution.outliers.iter().any(|o| o.item == k);
            for (k, o) in observations(seed, bad).iter().enumerate() {
                if k < 100 - bad {
                    assert!(
                        !named(k) || (o.y - expected[0] - expected[1] * o.t).abs() > 0.3,
                        "{loss:?}, seed {seed}: {k}"
                    );
                } else if far(o) {
                    assert!(named(k), "{loss:?}, seed {seed}: {k}");
                }
            }
            assert!(solution.to_string().contains("set aside as outliers"));
        }
    }
}

/// The order of the observations and the unit they are in do not matter.
#[test]
fn order_and_units_do_not_matter() {
    for loss in redescending() {
        let (problem, p) = line(observations(1, 30), loss);
        let expected = graduated(&problem).values.get(p);
        let (reversed, p) = line(observations(1, 30).into_iter().rev(), loss);
        let turned = graduated(&reversed).values.get(p);

        let mut scaled = Problem::new();
        let q = scaled.add_variable::<Vector>("line", &vec![0.0, 0.0]);
        let noise = Noise::isotropic(100.0).unwrap();
        let mut batch = Batch::new("observations").noise(noise).loss(loss);
        for o in observations(1, 30) {
            let (t, y) = (o.t, 1e3 * o.y);
            batch.push((q,), OnLine { t, y });
        }
        scaled.add_block(batch);
        let scaled = graduated(&scaled).values.get(q);
        for k in 0..2 {
            approx::assert_relative_eq!(turned[k], expected[k], max_relative = 1e-7);
            approx::assert_relative_eq!(1e-3 * scaled[k], expected[k], max_relative = 1e-7);
        }
    }
}

/// y = a exp(−b t) + c.
struct Decay {
    t: f64,
    y: f64,
}

impl Constraint for Decay {
    type Vars = (Vector,);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (p,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = p[0] * (-p[1] * self.t).exp() + p[2] - T::from(self.y);
    }
}

/// A curve with 40 % of its points far above it, all on one side: the truth is within 4 σ of the fit
/// of the good points alone.
#[test]
fn a_curve_is_found_under_outliers_on_one_side() {
    let truth = [2.0, 0.7, 0.3];
    for loss in redescending() {
        for seed in 0..10 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let make = |loss: Loss| {
                let mut problem = Problem::new();
                let p = problem.add_variable::<Vector>("curve", &vec![1.0, 1.0, 0.0]);
                let noise = Noise::isotropic(0.01).unwrap();
                (problem, p, Batch::new("points").noise(noise).loss(loss))
            };
            let (mut all, p, mut points) = make(loss);
            let (mut clean, _, mut good) = make(Loss::Trivial);
            for k in 0..200 {
                let t = f64::from(k) * 0.025;
                let y = truth[0] * (-truth[1] * t).exp() + truth[2] + 0.01 * normal(&mut rng);
                if rng.random::<f64>() < 0.4 {
                    let y = y + rng.random_range(0.3..3.0);
                    points.push((p,), Decay { t, y });
                } else {
                    points.push((p,), Decay { t, y });
                    good.push((p,), Decay { t, y });
                }
            }
            all.add_block(points);
            clean.add_block(good);
            let found = graduated(&all).values.get(p);
            let clean_solution = solve(&clean, &Settings::default()).unwrap();
            let sigma = Covariance::at(&clean, &clean_solution.values)
                .unwrap()
                .std_devs(p);
            for k in 0..3 {
                let off = (found[k] - truth[k]).abs() / sigma[k];
                assert!(off < 4.0, "{loss:?}, seed {seed}: {k} by {off:.1} σ");
            }
        }
    }
}

/// The second pose as measured from the first.
struct Between(PlanarPose<f64>);

impl Constraint for Between {
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

fn planar(x: f64, y: f64, angle: f64) -> PlanarPose<f64> {
    PlanarPose {
        translation: Vector2::new(x, y),
        angle,
    }
}

/// A square driven three times, 120 poses, closed where places come back; a third of the closures are
/// wrong. Odometry counts in full, closures under a redescending loss: the poses stay where the right
/// closures alone put them.
#[test]
fn wrong_loop_closures_do_not_bend_a_pose_graph() {
    const POSES: usize = 120;
    let truth: Vec<PlanarPose<f64>> = (0..POSES)
        .map(|k| {
            let (side, step) = ((k / 10) % 4, (k % 10) as f64);
            let angle = side as f64 * std::f64::consts::FRAC_PI_2;
            let corner = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]][side];
            planar(
                corner[0] + step * angle.cos(),
                corner[1] + step * angle.sin(),
                angle,
            )
        })
        .collect();
    let between = |a: PlanarPose<f64>, b: PlanarPose<f64>| {
        let d = b.translation - a.translation;
        let (sin, cos) = a.angle.sin_cos();
        planar(
            cos * d.x + sin * d.y,
            cos * d.y - sin * d.x,
            b.angle - a.angle,
        )
    };
    for seed in 0..3 {
        let solved = |with_wrong: bool, loss: Loss| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut problem = Problem::new();
            let mut poses: Vec<Var<Pose2>> = Vec::new();
            let sigmas = [0.01, 0.01, 0.002];
            let noise = Noise::diagonal(&sigmas).unwrap();
            let mut odometry = Batch::new("odometry").noise(noise.clone());
            let mut at = truth[0];
            for (k, pose) in truth.iter().enumerate() {
                if k > 0 {
                    let mut z = between(truth[k - 1], *pose);
                    z.translation += 0.01 * Vector2::new(normal(&mut rng), normal(&mut rng));
                    z.angle += 0.002 * normal(&mut rng);
                    let (sin, cos) = at.angle.sin_cos();
                    at.translation += Vector2::new(
                        cos * z.translation.x - sin * z.translation.y,
                        sin * z.translation.x + cos * z.translation.y,
                    );
                    at.angle += z.angle;
                    poses.push(problem.add_variable::<Pose2>(format!("x{k}"), &at));
                    odometry.push((poses[k - 1], poses[k]), Between(z));
                } else {
                    poses.push(problem.add_variable::<Pose2>("x0", &at));
                }
            }
            problem.fix(poses[0]);
            problem.add_block(odometry);
            let mut closures = Batch::new("closures").noise(noise).loss(loss);
            let mut wrong = Vec::new();
            for k in (40..POSES).step_by(2) {
                let mut z = between(truth[k - 40], truth[k]);
                z.translation += 0.01 * Vector2::new(normal(&mut rng), normal(&mut rng));
                z.angle += 0.002 * normal(&mut rng);
                let other = rng.random_range(0..k);
                if k % 3 == 0 {
                    // The place is taken for another one.
                    if with_wrong && truth[other].translation != truth[k].translation {
                        wrong.push(closures.constraints().len());
                        closures.push((poses[other], poses[k]), Between(planar(0.0, 0.0, 0.0)));
                    }
                } else {
                    closures.push((poses[k - 40], poses[k]), Between(z));
                }
            }
            problem.add_block(closures);
            let solution = graduated(&problem);
            let at: Vec<_> = poses.iter().map(|p| solution.values.get(*p)).collect();
            (at, wrong, solution)
        };
        let (expected, ..) = solved(false, Loss::Trivial);
        let (squared, ..) = solved(true, Loss::Trivial);
        let off = |a: &[PlanarPose<f64>]| {
            let apart = |(a, b): (&PlanarPose<f64>, &PlanarPose<f64>)| {
                (a.translation - b.translation).norm()
            };
            a.iter().zip(&expected).map(apart).fold(0.0, f64::max)
        };
        assert!(off(&squared) > 1.0, "the wrong closures do no harm");
        for loss in [Loss::GemanMcClure(5.0), Loss::Tukey(8.0)] {
            let (robust, wrong, solution) = solved(true, loss);
            assert!(off(&robust) < 0.01, "seed {seed}: {}", off(&robust));
            let named: Vec<usize> = solution.outliers.iter().map(|o| o.item).collect();
            assert_eq!(named, wrong, "seed {seed}");
        }
    }
}

/// A point in the plane seen turned and moved.
struct Seen {
    at: [f64; 2],
    seen: [f64; 2],
}

impl Constraint for Seen {
    type Vars = (Vector,);
    const DIM: usize = 2;
    fn residual<T: Scalar>(&self, (p,): Views<'_, Self, T>, r: &mut [T]) {
        let (c, s) = (p[2].cos(), p[2].sin());
        r[0] = c * self.at[0] - s * self.at[1] + p[0] - T::from(self.seen[0]);
        r[1] = s * self.at[0] + c * self.at[1] + p[1] - T::from(self.seen[1]);
    }
}

fn seen(loss: Loss, weight: f64) -> (Problem, Batch<Seen>) {
    let mut problem = Problem::new();
    let p = problem.add_variable::<Vector>("motion", &vec![0.1, -0.2, 0.3]);
    let mut batch = Batch::new("points")
        .noise(Noise::diagonal(&[0.2, 0.5]).unwrap())
        .loss(loss)
        .weight(weight)
        .unwrap();
    for (at, seen) in [
        ([1.0, 0.0], [1.1, 0.1]),
        ([0.0, 2.0], [-0.4, 1.8]),
        ([1.0, 1.0], [3.0, -1.0]),
        ([-2.0, 1.0], [4.0, 9.0]),
    ] {
        batch.push((p,), Seen { at, seen });
    }
    (problem, batch)
}

/// The gradient of a linearisation is that of the cost, by central differences, whatever is left of the
/// second-order correction; and along the residual J̃ᵀJ̃ is the cost's second derivative where it is convex.
#[test]
fn the_gradient_is_exact_under_every_loss() {
    for loss in losses() {
        for relaxation in [1.0, 1.7] {
            let (mut problem, batch) = seen(loss, 2.5);
            problem.add_block(batch);
            let relaxed = problem.relaxed(relaxation);
            let x = problem.initial();
            let mut lin = Linearization::new(problem.structure());
            relaxed.linearize(x, &mut lin);
            let mut r = vec![0.0; problem.rows()];
            approx::assert_relative_eq!(relaxed.residual(x, &mut r), lin.cost);
            for column in 0..3 {
                let mut cost = |h: f64| {
                    let mut delta = [0.0; 3];
                    delta[column] = h;
                    relaxed.residual(&problem.plus(x, &delta), &mut r)
                };
                let difference = (cost(1e-6) - cost(-1e-6)) / 2e-6;
                let gradient = lin.gradient(column);
                assert!(
                    (gradient - difference).abs() < 1e-6 * (1.0 + gradient.abs()),
                    "{loss:?}: {gradient} {difference}"
                );
            }
        }
    }
    // One residual x/σ on the line: the Hessian of ½ρ(x²) is ψ′(x).
    let x = 0.8_f64;
    for loss in losses() {
        let mut problem = Problem::new();
        let p = problem.add_variable::<Vector>("x", &vec![x, 0.0]);
        problem.fix_component(p, 1);
        let mut batch = Batch::new("x").loss(loss);
        batch.push((p,), OnLine { t: 0.0, y: 0.0 });
        problem.add_block(batch);
        let mut lin = Linearization::new(problem.structure());
        problem.linearize(problem.initial(), &mut lin);
        let hessian: f64 = lin.column(0).map(|(_, j)| j * j).sum();
        let cost = |x: f64| 0.5 * loss.evaluate(x * x).0;
        let h = 1e-4;
        let second = (cost(x + h) - 2.0 * cost(x) + cost(x - h)) / (h * h);
        assert!(
            (hessian - second).abs() < 1e-6,
            "{loss:?}: {hessian} {second}"
        );
    }
}

/// A block of weight 3 is the block three times.
#[test]
fn a_weight_repeats_the_block() {
    for loss in losses() {
        let (mut once, batch) = seen(loss, 3.0);
        once.add_block(batch);
        let (mut thrice, batch) = seen(loss, 1.0);
        thrice.add_block(batch);
        for _ in 0..2 {
            thrice.add_block(seen(loss, 1.0).1);
        }
        let [a, b] = [&once, &thrice].map(|problem| {
            let mut lin = Linearization::new(problem.structure());
            problem.linearize(problem.initial(), &mut lin);
            let gradient = (0..3).map(|c| lin.gradient(c)).sum::<f64>();
            (lin.cost, gradient)
        });
        approx::assert_relative_eq!(a.0, b.0, max_relative = 1e-12);
        approx::assert_relative_eq!(a.1, b.1, max_relative = 1e-9);
        let [a, b] = [&once, &thrice].map(|problem| problem.weights(problem.initial())[0].clone());
        for (a, b) in a.iter().zip(&b) {
            approx::assert_relative_eq!(a.norm, b.norm, max_relative = 1e-12);
            approx::assert_relative_eq!(a.weight, b.weight, max_relative = 1e-12);
        }
    }
    let batch = Batch::<Seen>::new("points");
    assert!(batch.weight(0.0).is_err());
}

/// Relaxed without end, a problem is that of least squares.
#[test]
fn fully_relaxed_is_least_squares() {
    for loss in losses() {
        let (robust, p) = line(observations(3, 20), loss);
        let (plain, _) = line(observations(3, 20), Loss::Trivial);
        let mut lins = [robust.structure(), plain.structure()].map(Linearization::new);
        let view = robust.relaxed(f64::INFINITY);
        assert!(!view.is_robust() && robust.is_robust());
        view.linearize(robust.initial(), &mut lins[0]);
        plain.linearize(plain.initial(), &mut lins[1]);
        assert_eq!(lins[0].values, lins[1].values);
        assert_eq!(lins[0].residual, lins[1].residual);
        let outcome =
            truing::solver::run(&view, robust.initial().clone(), &Settings::default()).unwrap();
        let (expected, _) = least_squares(&observations(3, 20));
        for (found, expected) in outcome.point.get(p).iter().zip(expected) {
            approx::assert_relative_eq!(*found, expected, max_relative = 1e-9);
        }
    }
}

/// What is not a number is refused by name; what is absurdly large is just an outlier to a loss that can
/// bear it; and where everything is an outlier there is a solution, and it says so.
#[test]
fn hostile_measurements_end_in_words() {
    for loss in losses() {
        let with = |y: f64| {
            let mut all = observations(5, 0);
            all[17].y = y;
            line(all, loss)
        };
        for bad in [f64::NAN, f64::INFINITY] {
            let error = solve_graduated(&with(bad).0, &Settings::default()).unwrap_err();
            assert!(error.to_string().contains("constraint 17"), "{error}");
        }
        let (problem, p) = with(1e200);
        let solution = solve_graduated(&problem, &Settings::default());
        // Barron's with α > 0 lets the weighted residual grow without end, and so the norm that gradients
        // are compared with.
        let bears = !matches!(loss, Loss::Barron { alpha, .. } if alpha > 0.0);
        if loss.redescends() && bears {
            let solution = solution.unwrap();
            let found = solution.values.get(p);
            assert!(
                (found[1] - 0.5).abs() < 0.05,
                "{loss:?}: {found:?}, {}",
                solution.termination
            );
            assert_eq!(solution.outliers[0].item, 17);
        }
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let scattered = (0..30).map(|k| OnLine {
            t: f64::from(k),
            y: rng.random_range(-1e6..1e6),
        });
        let (problem, _) = line(scattered, loss);
        let solution = solve_graduated(&problem, &Settings::default()).unwrap();
        assert!(solution.outliers.len() > 20, "{loss:?}: {solution}");
        assert!(solution.cost.is_finite());
    }
}

/// Interruption, time and iterations hold for all stages together, and progress counts on.
#[test]
fn limits_hold_over_all_stages() {
    let (problem, _) = line(observations(2, 40), Loss::Tukey(4.685));
    let all = graduated(&problem);
    assert!(all.iterations > 20 && all.evaluations.jacobian > 20);

    let mut settings = Settings::default();
    settings.tolerances.max_iterations = 10;
    let some = solve_graduated(&problem, &settings).unwrap();
    assert_eq!(some.termination, Termination::MaxIterations { limit: 10 });
    assert_eq!(some.iterations, 10);

    let told = Arc::new(Mutex::new(Vec::new()));
    let stop = Arc::new(AtomicBool::new(false));
    let (list, flag) = (told.clone(), stop.clone());
    let settings = Settings {
        interrupt: Some(stop),
        progress: Some(Arc::new(move |p| {
            let mut list = list.lock().unwrap();
            list.push(p.iteration);
            flag.store(p.iteration >= 12, Ordering::SeqCst);
        })),
        ..Settings::default()
    };
    let interrupted = solve_graduated(&problem, &settings).unwrap();
    assert_eq!(interrupted.termination, Termination::Interrupted);
    assert!((12..=15).contains(&interrupted.iterations));
    let told = told.lock().unwrap().clone();
    assert!(told.windows(2).all(|w| w[0] < w[1]), "{told:?}");
    // The cost is that of the loss as stated.
    let mut r = vec![0.0; problem.rows()];
    assert_eq!(
        interrupted.cost,
        problem.residual(&interrupted.values, &mut r)
    );

    let settings = Settings {
        timeout: Some(Duration::ZERO),
        ..Settings::default()
    };
    let late = solve_graduated(&problem, &settings).unwrap();
    assert_eq!(late.termination, Termination::Timeout { seconds: 0.0 });
}

/// The adaptive loss is least squares for normal noise and nearly Cauchy's for Cauchy noise, and then the
/// estimate is much better than that of least squares.
#[test]
fn the_adaptive_loss_follows_the_noise() {
    let mut errors = [0.0; 2];
    for seed in 0..5 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        for heavy in [false, true] {
            let all = (0..400).map(|_| {
                let t = rng.random_range(0.0..10.0);
                let noise = if heavy {
                    (std::f64::consts::PI * (rng.random::<f64>() - 0.5)).tan()
                } else {
                    normal(&mut rng)
                };
                let y = 1.0 + 0.5 * t + 0.1 * noise;
                OnLine { t, y }
            });
            let (mut problem, p) = line(all, Loss::Trivial);
            let squared = solve(&problem, &Settings::default()).unwrap().values.get(p);
            let adapted = solve_adaptive(&mut problem, 0, &Settings::default()).unwrap();
            assert!(adapted.settled, "{adapted:?}");
            let Loss::Barron { alpha, c } = adapted.loss else {
                panic!("{:?}", adapted.loss);
            };
            if heavy {
                assert!(alpha < 0.25, "{alpha}");
                errors[0] += (squared[1] - 0.5).abs();
                errors[1] += (adapted.solution.values.get(p)[1] - 0.5).abs();
            } else {
                assert!(alpha > 1.6 && (c - 1.0).abs() < 0.15, "{alpha} {c}");
            }
        }
    }
    assert!(errors[1] < 0.5 * errors[0], "{errors:?}");
    let prior = {
        let mut problem = Problem::new();
        let p = problem.add_variable::<Vector>("x", &vec![0.0]);
        problem.prior(p, &vec![0.0], 1.0).unwrap();
        problem.set_loss(0, adapt_loss(&[1.0])).unwrap_err()
    };
    assert!(prior.to_string().contains("prior on x"), "{prior}");
}

/// A PUMA with errors in what touches of one plane identify, and 150 touches with 0.1 mm noise.
fn touches(seed: u64) -> (Scene, Calibration) {
    let robot = puma();
    let kept: Vec<String> = Scene::nominal(vec![Arm::only(puma())], 3)
        .measure(&What::UnknownPlane(vec![table()]), 60, 0.0)
        .choices(&[], |_, name| !name.starts_with('K'))
        .into_iter()
        .filter(|(_, choice)| *choice == Choice::Estimated)
        .map(|(name, _)| name)
        .collect();
    let scene = Scene::perturbed(vec![Arm::only(puma())], seed, |_, p| {
        kept.contains(&robot.parameters()[p].name)
    });
    let scene = scene.measure(&What::UnknownPlane(vec![table()]), 150, 1e-4);
    let calibration = scene.calibration(false);
    (scene, calibration)
}

/// The same with a share of the touches one to five centimetres off the plane, and which.
fn corrupted(scene: &Scene, calibration: &Calibration, seed: u64) -> (Calibration, Vec<usize>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut corrupted = calibration.clone();
    let mut rows = Vec::new();
    for (row, q) in corrupted.sets[0].tools[0].q.iter_mut().enumerate() {
        if rng.random::<f64>() < 0.3 {
            let side = if rng.random::<bool>() { 1.0 } else { -1.0 };
            let plane = Plane {
                distance: table().distance + side * rng.random_range(0.01..0.05),
                ..table()
            };
            let off = What::UnknownPlane(vec![plane]);
            let bad = scene.clone().seeded(1000 * seed + row as u64);
            q.clone_from(&bad.measure(&off, 1, 0.0).sets[1].tools[0].q[0]);
            rows.push(row);
        }
    }
    (corrupted, rows)
}

/// Largest difference of two estimates, in standard deviations of the first.
fn apart(clean: &Outcome, other: &Outcome) -> f64 {
    let pairs = clean.result.parameters.iter().zip(&other.result.parameters);
    pairs
        .filter_map(|(a, b)| Some((a.estimate - b.estimate).abs() / a.sigma?))
        .fold(0.0, f64::max)
}

/// With 30 % of the touches centimetres off, the estimate stays within 2 σ of that without them, σ being
/// that of the clean estimate, in every parameter, and all of them are named and hardly any other.
#[test]
fn gross_touches_do_not_move_a_robot() {
    for loss in [
        Loss::Cauchy(2.385),
        Loss::Tukey(4.685),
        Loss::Welsch(2.985),
        Loss::GemanMcClure(3.787),
    ] {
        for seed in 1..=4 {
            let (scene, mut calibration) = touches(seed);
            let clean = calibration.run(&|_| {}).unwrap();
            calibration.sets[0].loss = loss;
            let (corrupted, rows) = corrupted(&scene, &calibration, seed);
            let robust = corrupted.run(&|_| {}).unwrap();
            let off = apart(&clean, &robust);
            let named: Vec<usize> = robust.result.outliers.iter().map(|o| o.row).collect();
            let good = named.iter().filter(|row| !rows.contains(row)).count();
            println!(
                "{loss:?}, seed {seed}: {off:.2} σ, {} of {} named and {good} good ones, σ₀ {:?}, trusted {}",
                named.len() - good,
                rows.len(),
                robust.result.sigma0,
                robust.result.trusted
            );
            assert!(off < 2.0, "{loss:?}, seed {seed}: {off:.2} σ");
            assert!(rows.iter().all(|row| named.contains(row)), "{named:?}");
            assert!(good <= 2, "{named:?}");
            assert!(robust.result.trusted, "{:?}", robust.result.warnings);
        }
    }
}
