//! What r and J cost beside r alone, for each way to differentiate: a PUMA 560 with 37 parameters.
//!
//!     cargo bench --bench linearize [-- --quick]
//!
//! All rows of a table are measured in turn in the same run, so that a machine that is busy or slow
//! is so for all of them; the times are medians. Residuals alone go through the same batches as
//! residuals with Jacobians.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;
use truing::manifold::{Plane, Plane3, Point3, Pose, Pose3, Vector};
use truing::nalgebra::Vector3;
use truing::{Batch, Constraint, LeastSquares, Linearization, Problem, Vars};
use truing_planar::GeneralisedModel;
use truing_robot::Robot;
use truing_robot::kinds::{MeasuredPose, Position, UnknownPlane};
use truing_robot::robot::RobotFile;
use truing_robot::robot::{Chain, Derivatives};

/// Khalil, Lemoine & Gautier 1996, section IV, with a generic base and tool.
const PUMA: &str = r#"
convention = "khalil-kleinfinger"
units = { angle = "deg" }
base = { theta = 17, r = 0.4 }
tool = { alpha = 17, d = 0.12, theta = 23, r = 0.08 }
joint = [
    { type = "revolute", alpha = 11, d = 0.15, theta = 5, r = 0.25 },
    { type = "revolute", alpha = -90, r = 0.2435 },
    { type = "revolute", d = 0.4318, r = -0.0934 },
    { type = "revolute", alpha = 90, d = -0.0203, r = 0.4331 },
    { type = "revolute", alpha = -90 },
    { type = "revolute", alpha = 90 },
]
"#;

/// Configurations in a problem: r and J together stay in the second-level cache.
const CONFIGURATIONS: usize = 200;

/// The ways to differentiate, the default first.
fn ways() -> [(&'static str, Derivatives); 4] {
    let analytic = Derivatives::Regressor(Arc::new(GeneralisedModel));
    [
        ("r and J, frame-wise AD", Derivatives::default()),
        ("r and J, analytic columns", analytic),
        ("r and J, whole-chain AD in chunks", Derivatives::WholeChain),
        ("r and J, central differences", Derivatives::Numeric),
    ]
}

/// A problem with one constraint for each of some random configurations.
fn problem<C: Constraint>(
    derivatives: Derivatives,
    add_variables: impl Fn(&mut Problem, &Robot) -> <C::Vars as Vars>::Handles,
    constraint: impl Fn(&Arc<Chain>, Vec<f64>) -> C,
) -> Problem {
    let file = RobotFile::parse(PUMA, "puma560.toml").expect("the robot above is one");
    let chain = Chain::with(Robot::new(&file), derivatives);
    assert_eq!(chain.robot.parameters().len(), 37);
    let mut random = ChaCha8Rng::seed_from_u64(560);
    let mut problem = Problem::new();
    let variables = add_variables(&mut problem, &chain.robot);
    let mut batch = Batch::new("measurements");
    for _ in 0..CONFIGURATIONS {
        let q = (0..6).map(|_| random.random_range(-2.5..2.5)).collect();
        batch.push(variables, constraint(&chain, q));
    }
    problem.add_block(batch);
    problem
}

fn unknown_plane(derivatives: Derivatives) -> Problem {
    problem(
        derivatives,
        |problem, robot| {
            let plane = Plane {
                normal: Vector3::new(0.2, -0.3, 0.9),
                distance: 0.4,
            };
            (
                problem.add_variable::<Vector>("robot", &robot.nominal()),
                problem.add_variable::<Point3>("target", &Vector3::zeros()),
                problem.add_variable::<Plane3>("plane", &plane),
            )
        },
        |chain, q| UnknownPlane {
            chain: chain.clone(),
            q,
        },
    )
}

fn position(derivatives: Derivatives) -> Problem {
    problem(
        derivatives,
        |problem, robot| {
            (
                problem.add_variable::<Vector>("robot", &robot.nominal()),
                problem.add_variable::<Pose3>("sensor", &Pose::identity()),
                problem.add_variable::<Point3>("target", &Vector3::zeros()),
            )
        },
        |chain, q| Position {
            chain: chain.clone(),
            q,
            measured: Vector3::new(0.5, 0.2, 0.7),
        },
    )
}

fn pose(derivatives: Derivatives) -> Problem {
    problem(
        derivatives,
        |problem, robot| {
            (
                problem.add_variable::<Vector>("robot", &robot.nominal()),
                problem.add_variable::<Pose3>("sensor", &Pose::identity()),
                problem.add_variable::<Point3>("target", &Vector3::zeros()),
            )
        },
        |chain, q| MeasuredPose {
            chain: chain.clone(),
            measured: chain.robot.forward(&chain.robot.nominal(), &q),
            q,
        },
    )
}

/// Nanoseconds a configuration, the median over `repetitions` of each task, taken in turn.
fn medians(tasks: &mut [Box<dyn FnMut()>], repetitions: usize) -> Vec<f64> {
    let mut times = vec![Vec::with_capacity(repetitions); tasks.len()];
    for _ in 0..repetitions {
        for (task, times) in tasks.iter_mut().zip(&mut times) {
            let start = Instant::now();
            task();
            times.push(start.elapsed().as_secs_f64() * 1e9 / CONFIGURATIONS as f64);
        }
    }
    let median = |mut times: Vec<f64>| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    };
    times.into_iter().map(median).collect()
}

fn table(title: &str, make: impl Fn(Derivatives) -> Problem, repetitions: usize) {
    let alone = make(Derivatives::default());
    let mut r = vec![0.0; alone.rows()];
    let mut names = vec!["r alone"];
    let mut tasks: Vec<Box<dyn FnMut()>> = vec![Box::new(move || {
        black_box(alone.residual(black_box(alone.initial()), &mut r));
        black_box(&r);
    })];
    for (name, derivatives) in ways() {
        let problem = make(derivatives);
        let mut lin = Linearization::new(problem.structure());
        names.push(name);
        tasks.push(Box::new(move || {
            problem.linearize(black_box(problem.initial()), &mut lin);
            black_box(&lin.values);
        }));
    }
    let times = medians(&mut tasks, repetitions);
    println!("{title:<34} {:>10} {:>8}", "ns a conf.", "ratio");
    for (name, time) in names.iter().zip(&times) {
        println!("{name:<34} {time:>10.0} {:>8.2}", time / times[0]);
    }
    println!();
}

fn main() {
    let quick = std::env::args().any(|argument| argument == "--quick");
    let repetitions = if quick { 50 } else { 2000 };
    table(
        "unknown plane, 37 + 3 + 3 columns",
        unknown_plane,
        repetitions,
    );
    table("position, 37 + 6 + 3 columns", position, repetitions);
    table("pose, 37 + 6 + 3 columns", pose, repetitions);
}
