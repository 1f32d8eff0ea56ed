//! Every kind of constraint has the same Jacobian however it is differentiated, also at zero.
//!
//! Frame-wise automatic differentiation (the default), automatic differentiation of the whole
//! chain, central differences of each constraint and central differences of the whole problem
//! share less and less code. Residuals of exactly zero, identities and vanishing angles are where
//! dual numbers go wrong: each has its own test.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;
use truing::manifold::{Plane, Plane3, Point3, Pose, Pose3, Vector, so3};
use truing::nalgebra::Vector3;
use truing::{Batch, Constraint, LeastSquares, Linearization, Problem, check};
use truing_planar::{
    ClassicalPose, ClassicalPosition, CoefficientsUnknown, FrameLink, GeneralisedModel,
    KnownCoefficients, PositionLink, VectorProducts,
};
use truing_robot::Robot;
use truing_robot::kinds::{
    AnchorLength, BodyPose, Distance, KnownPlane, MeasuredPose, Position, PostureDistance,
    SamePoint, UnknownPlane,
};
use truing_robot::robot::JointKind;
use truing_robot::robot::RobotFile;
use truing_robot::robot::{Chain, Derivatives};

/// Both ways are exact but for rounding: some thousand operations on numbers of size one.
const EXACT: f64 = 1e-12;

/// Central differences with h = 6e-6 leave h²/6 times the third derivative and ε/h: 1e-9 where
/// lengths and readings are of size one, with room for angles that a gain multiplies by three.
const DIFFERENCES: f64 = 1e-7;

/// A column that vanishes in theory (the tool's θ, where the target is on its axis) holds rounding
/// alone; it is compared to this instead of its own norm. Others are of size one.
const SMALL_COLUMN: f64 = 0.1;

/// Revolute, parallel revolute, fixed, prismatic and parallel prismatic joints.
const KHALIL_KLEINFINGER: &str = r#"
convention = "khalil-kleinfinger"
base = { theta = 0.3, r = 0.4 }
tool = { alpha = 0.3, d = 0.12, theta = 0.4, r = 0.08 }
joint = [
    { type = "revolute", alpha = 0.2, d = 0.15, theta = 0.1, r = 0.25 },
    { type = "revolute", alpha = -1.5707963267948966, r = 0.2435 },
    { type = "revolute", d = 0.4318, r = -0.0934 },
    { type = "fixed", alpha = 0.7, d = -0.1, theta = 0.2, r = 0.1 },
    { type = "prismatic", alpha = 1.5707963267948966, d = -0.0203, r = 0.4331 },
    { type = "prismatic", d = 0.1, theta = -0.4, beta = 0.1, r = 0.05 },
    { type = "revolute", alpha = 1.5707963267948966, d = 0.03, gain = -1.0 },
]
"#;

/// The same kinds of joints in the distal convention.
const DENAVIT_HARTENBERG: &str = r#"
convention = "denavit-hartenberg"
base = { theta = -0.2, d = 0.3, a = 0.7, alpha = 0.1 }
tool = { theta = 0.5, d = 0.1, a = 0.05, alpha = -0.2 }
joint = [
    { type = "revolute", theta = 0.2, d = 0.5, alpha = -1.5707963267948966 },
    { type = "revolute", d = 0.1, a = 0.43 },
    { type = "fixed", theta = 0.4, d = -0.2, a = 0.1, alpha = 0.3 },
    { type = "prismatic", theta = -0.1, d = 0.3, a = -0.02, alpha = 1.5707963267948966 },
    { type = "prismatic", d = 0.1, a = 0.04, beta = 0.2 },
    { type = "revolute", d = 0.2, alpha = 0.6, gain = 1.5 },
]
"#;

/// All three conventions in one chain, every model of joints, a reading of another joint and a passive joint.
const MODELS: &str = r#"
convention = "khalil-kleinfinger"
base = { theta = 0.3, r = 0.4 }
tool = { alpha = 0.3, d = 0.12, theta = 0.4, r = 0.08 }
inputs = { load = { range = [-1.0, 1.0] }, side = { range = [-1.0, 1.0] } }
joint = [
    { type = "revolute", alpha = 0.2, d = 0.15, r = 0.25, model = ["gain", "harmonics(2)", "backlash(side)"] },
    { type = "revolute", convention = "urdf", xyz = [0.1, 0.2, 0.3], rpy = [0.4, -0.5, 0.6], axis = [1, 2, -1], model = ["gain", "gravity(3, 5)", "compliance(load)"] },
    { type = "revolute", convention = "denavit-hartenberg", d = 0.1, a = 0.43, alpha = 0.6, model = ["gain", "coupling(q2)"], coupling_q2 = -1.0 },
    { type = "prismatic", convention = "urdf", xyz = [0.0, 0.1, 0.0], axis = [0, 1, 1], model = ["gain", "linear(load)", "harmonics(1)"] },
    { type = "revolute", alpha = 1.5707963267948966, d = 0.03, gain = -1.0, model = ["gain", "compliance"] , mass = 2.0, center_of_mass = [0.1, 0.0, 0.05] },
    { type = "revolute", alpha = -1.5707963267948966, d = 0.2, reading = "q3" },
    { type = "fixed", convention = "urdf", rpy = [0.1, 0.0, 0.2] },
]
"#;

fn read(text: &str) -> Robot {
    Robot::new(&RobotFile::parse(text, "robot.toml").unwrap())
}

/// The robot with all angles of its table at zero: every axis is parallel to the one before.
fn without_angles(robot: &Robot) -> Robot {
    let mut file = robot.with_parameters(&robot.nominal());
    let rows = file.joints.iter_mut().map(|joint| &mut joint.frame);
    for row in rows.chain([&mut file.base, &mut file.tool]) {
        (row.alpha, row.theta, row.beta) = (0.0, 0.0, 0.0);
    }
    Robot::new(&file)
}

/// A robot, where it stands and what its tool carries.
#[derive(Clone)]
struct Arm {
    robot: Robot,
    parameters: Vec<f64>,
    target: Vector3<f64>,
    postures: Vec<Vec<f64>>,
}

impl Arm {
    /// At its nominal parameters, measuring with the tool origin.
    fn nominal(robot: Robot, mut reading: impl FnMut(JointKind) -> f64) -> Self {
        let mut posture = || {
            robot
                .joints()
                .iter()
                .map(|joint| reading(joint.kind))
                .collect()
        };
        let postures = (0..POSTURES).map(|_| posture()).collect();
        Self {
            parameters: robot.nominal(),
            robot,
            target: Vector3::zeros(),
            postures,
        }
    }

    fn chain(&self, derivatives: &Derivatives) -> Arc<Chain> {
        Chain::with(self.robot.clone(), derivatives.clone())
    }

    fn tool(&self, posture: usize) -> Pose<f64> {
        self.robot
            .forward(&self.parameters, &self.postures[posture])
    }

    fn tip(&self, posture: usize) -> Vector3<f64> {
        self.tool(posture).apply(&self.target)
    }
}

/// Postures of each arm: every problem below has a measurement for each.
const POSTURES: usize = 4;

/// A point at which all kinds of constraints are differentiated, with what they measured there.
struct Scene {
    arm: Arm,
    /// The other arm of distances.
    other: Arm,
    /// A sensor's pose in the reference frame.
    sensor: Pose<f64>,
    /// The normal of the plane that each posture touches.
    normals: [Vector3<f64>; POSTURES],
    /// What is added to each exact measurement: lengths [m], turns [rad].
    errors: [Vector3<f64>; POSTURES],
}

fn vector(random: &mut ChaCha8Rng, size: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| random.random_range(-size..size))
}

impl Scene {
    /// Everything at random: sensor, targets and planes, errors up to half a metre and half a radian.
    fn random(arm: &Robot, other: &Robot, random: &mut ChaCha8Rng) -> Self {
        let mut place = |robot: &Robot| {
            let mut arm = Arm::nominal(robot.clone(), |_| random.random_range(-3.0..3.0));
            arm.parameters
                .iter_mut()
                .for_each(|x| *x += random.random_range(-0.3..0.3));
            arm.target = vector(random, 0.3);
            arm
        };
        let (arm, other) = (place(arm), place(other));
        let turn = so3::exp_matrix(vector(random, 1.5).as_slice());
        Self {
            arm,
            other,
            sensor: Pose::new(turn, vector(random, 1.0)),
            normals: std::array::from_fn(|_| vector(random, 1.0).normalize()),
            errors: std::array::from_fn(|_| vector(random, 0.5)),
        }
    }

    /// Nominal robots, tool origins, a sensor at the reference frame and measurements without error.
    fn exact(arm: Arm, other: Arm) -> Self {
        let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()];
        let errors = [Vector3::zeros(); POSTURES];
        Self {
            arm,
            other,
            sensor: Pose::identity(),
            normals: [x, y, z, -z],
            errors,
        }
    }

    /// One problem a kind, each with a measurement for each posture.
    fn problems(&self, derivatives: &Derivatives) -> Vec<Problem> {
        vec![
            self.position(derivatives),
            self.measured_pose(derivatives),
            self.known_plane(derivatives),
            self.unknown_plane(derivatives),
            self.same_point(derivatives),
            self.distance(derivatives),
            self.posture_distance(derivatives),
            self.ball_bar(derivatives),
            self.body_pose(derivatives),
        ]
    }

    /// One problem an equation of the paper's plugin, each with a row for each posture.
    fn papers(&self, derivatives: &Derivatives) -> Vec<Problem> {
        let (arm, chain) = (&self.arm, self.arm.chain(derivatives));
        let posture = |i: usize| arm.postures[i % POSTURES].clone();
        let begin = || {
            let mut problem = Problem::new();
            let robot = problem.add_variable::<Vector>("robot", &arm.parameters);
            let target = problem.add_variable::<Point3>("target", &arm.target);
            (problem, robot, target)
        };
        // Where the posture is, but for the error; in the sensor's frame.
        let read = |i: usize| {
            let turn = so3::exp_matrix(self.errors[i].as_slice());
            let seen = Pose::new(arm.tool(i).rotation * turn, arm.tip(i) + self.errors[i]);
            self.sensor.inverse().compose(&seen)
        };
        let mut problems = Vec::new();
        for full in [false, true] {
            let (mut problem, robot, target) = begin();
            let sensor = problem.add_variable::<Pose3>("sensor", &self.sensor);
            let variables = (robot, sensor, target);
            problems.push(if full {
                with_each(problem, "classical pose", |i| {
                    let measured = read(i);
                    let (chain, q) = (chain.clone(), posture(i));
                    (variables, ClassicalPose { chain, q, measured })
                })
            } else {
                with_each(problem, "classical position", |i| {
                    let measured = read(i).translation;
                    let (chain, q) = (chain.clone(), posture(i));
                    (variables, ClassicalPosition { chain, q, measured })
                })
            });
        }
        let (problem, robot, target) = begin();
        problems.push(with_each(problem, "known coefficients", |i| {
            let coefficients = self.normals[i].into();
            let (chain, q) = (chain.clone(), posture(i));
            let constraint = KnownCoefficients {
                chain,
                q,
                coefficients,
            };
            ((robot, target), constraint)
        }));
        let (mut problem, robot, target) = begin();
        let plane = problem.add_variable::<Vector>("plane", &self.normals[0].as_slice().to_vec());
        problems.push(with_each(problem, "unknown coefficients", |i| {
            let (chain, q) = (chain.clone(), posture(i));
            ((robot, target, plane), CoefficientsUnknown { chain, q })
        }));
        let (problem, robot, target) = begin();
        problems.push(with_each(problem, "position link", |i| {
            let (chain, q_a, q_b) = (chain.clone(), posture(i), posture(i + 1));
            ((robot, target), PositionLink { chain, q_a, q_b })
        }));
        let (problem, robot, target) = begin();
        problems.push(with_each(problem, "frame link", |i| {
            let (chain, q_a, q_b) = (chain.clone(), posture(i), posture(i + 1));
            ((robot, target), FrameLink { chain, q_a, q_b })
        }));
        let (problem, robot, target) = begin();
        problems.push(with_each(problem, "vector products", |i| {
            let q = [0, 1, 2, 3].map(|k| posture(i + k));
            let (chain, area) = (chain.clone(), 1.0);
            ((robot, target), VectorProducts { chain, q, area })
        }));
        problems
    }

    fn position(&self, derivatives: &Derivatives) -> Problem {
        let (arm, chain) = (&self.arm, self.arm.chain(derivatives));
        let mut problem = Problem::new();
        let robot = problem.add_variable::<Vector>("robot", &arm.parameters);
        let sensor = problem.add_variable::<Pose3>("sensor", &self.sensor);
        let target = problem.add_variable::<Point3>("target", &arm.target);
        with_each(problem, "position", |i| {
            let seen = self.sensor.rotation.transpose() * (arm.tip(i) - self.sensor.translation);
            let measured = seen + self.errors[i];
            (
                (robot, sensor, target),
                Position {
                    chain: chain.clone(),
                    q: arm.postures[i].clone(),
                    measured,
                },
            )
        })
    }

    fn measured_pose(&self, derivatives: &Derivatives) -> Problem {
        let (arm, chain) = (&self.arm, self.arm.chain(derivatives));
        let mut problem = Problem::new();
        let robot = problem.add_variable::<Vector>("robot", &arm.parameters);
        let sensor = problem.add_variable::<Pose3>("sensor", &self.sensor);
        let target = problem.add_variable::<Point3>("target", &arm.target);
        with_each(problem, "pose", |i| {
            let away = self.sensor.rotation.transpose();
            let turn = so3::exp_matrix(self.errors[i].as_slice());
            let measured = Pose {
                rotation: away * arm.tool(i).rotation * turn,
                translation: away * (arm.tip(i) - self.sensor.translation) + self.errors[i],
            };
            (
                (robot, sensor, target),
                MeasuredPose {
                    chain: chain.clone(),
                    q: arm.postures[i].clone(),
                    measured,
                },
            )
        })
    }

    /// The plane that posture `i` touches, but for the error.
    fn plane(&self, i: usize) -> Plane<f64> {
        let through_origin = Plane {
            normal: self.normals[i],
            distance: 0.0,
        };
        let distance = through_origin.signed_distance(&self.arm.tip(i)) - self.errors[i].x;
        Plane {
            distance,
            ..through_origin
        }
    }

    fn ball_bar(&self, derivatives: &Derivatives) -> Problem {
        let (arm, chain) = (&self.arm, self.arm.chain(derivatives));
        let at = Vector3::new(0.3, -0.2, 0.9);
        let mut problem = Problem::new();
        let robot = problem.add_variable::<Vector>("robot", &arm.parameters);
        let target = problem.add_variable::<Point3>("target", &arm.target);
        let anchor = problem.add_variable::<Point3>("anchor", &at);
        with_each(problem, "ball bar", |i| {
            let constraint = AnchorLength {
                chain: chain.clone(),
                q: arm.postures[i].clone(),
                length: length(&(arm.tip(i) - at)) - self.errors[i].x,
            };
            ((robot, target, anchor), constraint)
        })
    }

    /// The body stands on the target, turned as the sensor is.
    fn body_pose(&self, derivatives: &Derivatives) -> Problem {
        let (arm, chain) = (&self.arm, self.arm.chain(derivatives));
        let on_tool = Pose::new(self.sensor.rotation, arm.target);
        let mut problem = Problem::new();
        let robot = problem.add_variable::<Vector>("robot", &arm.parameters);
        let sensor = problem.add_variable::<Pose3>("sensor", &self.sensor);
        let body = problem.add_variable::<Pose3>("body", &on_tool);
        with_each(problem, "body pose", |i| {
            let away = self.sensor.rotation.transpose();
            let turn = so3::exp_matrix(self.errors[i].as_slice());
            let placed = arm.tool(i).compose(&on_tool);
            let measured = Pose {
                rotation: away * placed.rotation * turn,
                translation: away * (placed.translation - self.sensor.translation) + self.errors[i],
            };
            let constraint = BodyPose {
                chain: chain.clone(),
                q: arm.postures[i].clone(),
                measured,
            };
            ((robot, sensor, body), constraint)
        })
    }

    fn known_plane(&self, derivatives: &Derivatives) -> Problem {
        let (arm, chain) = (&self.arm, self.arm.chain(derivatives));
        let mut problem = Problem::new();
        let robot = problem.add_variable::<Vector>("robot", &arm.parameters);
        let target = problem.add_variable::<Point3>("target", &arm.target);
        with_each(problem, "known plane", |i| {
            let (q, plane) = (arm.postures[i].clone(), self.plane(i));
            (
                (robot, target),
                KnownPlane {
                    chain: chain.clone(),
                    q,
                    plane,
                },
            )
        })
    }

    fn unknown_plane(&self, derivatives: &Derivatives) -> Problem {
        let (arm, chain) = (&self.arm, self.arm.chain(derivatives));
        let mut problem = Problem::new();
        let robot = problem.add_variable::<Vector>("robot", &arm.parameters);
        let target = problem.add_variable::<Point3>("target", &arm.target);
        let planes: [_; POSTURES] = std::array::from_fn(|i| {
            problem.add_variable::<Plane3>(format!("plane {i}"), &self.plane(i))
        });
        with_each(problem, "unknown plane", |i| {
            let q = arm.postures[i].clone();
            (
                (robot, target, planes[i]),
                UnknownPlane {
                    chain: chain.clone(),
                    q,
                },
            )
        })
    }

    fn same_point(&self, derivatives: &Derivatives) -> Problem {
        let (arm, chain) = (&self.arm, self.arm.chain(derivatives));
        let mut problem = Problem::new();
        let robot = problem.add_variable::<Vector>("robot", &arm.parameters);
        let target = problem.add_variable::<Point3>("target", &arm.target);
        let points: [_; POSTURES] = std::array::from_fn(|i| {
            problem.add_variable::<Point3>(format!("point {i}"), &(arm.tip(i) - self.errors[i]))
        });
        with_each(problem, "same point", |i| {
            let q = arm.postures[i].clone();
            (
                (robot, target, points[i]),
                SamePoint {
                    chain: chain.clone(),
                    q,
                },
            )
        })
    }

    fn distance(&self, derivatives: &Derivatives) -> Problem {
        let (a, b) = (&self.arm, &self.other);
        let (chain_a, chain_b) = (a.chain(derivatives), b.chain(derivatives));
        let mut problem = Problem::new();
        let robot_a = problem.add_variable::<Vector>("robot a", &a.parameters);
        let target_a = problem.add_variable::<Point3>("target a", &a.target);
        let robot_b = problem.add_variable::<Vector>("robot b", &b.parameters);
        let target_b = problem.add_variable::<Point3>("target b", &b.target);
        let distances: [_; POSTURES] = std::array::from_fn(|i| {
            let distance = length(&(a.tip(i) - b.tip(i))) - self.errors[i].x;
            problem.add_variable::<Vector>(format!("distance {i}"), &vec![distance])
        });
        with_each(problem, "distance", |i| {
            let (q_a, q_b) = (a.postures[i].clone(), b.postures[i].clone());
            let constraint = Distance {
                a: chain_a.clone(),
                b: chain_b.clone(),
                q_a,
                q_b,
            };
            (
                (robot_a, target_a, robot_b, target_b, distances[i]),
                constraint,
            )
        })
    }

    fn posture_distance(&self, derivatives: &Derivatives) -> Problem {
        let (arm, chain) = (&self.arm, self.arm.chain(derivatives));
        let next = |i: usize| (i + 1) % POSTURES;
        let mut problem = Problem::new();
        let robot = problem.add_variable::<Vector>("robot", &arm.parameters);
        let target = problem.add_variable::<Point3>("target", &arm.target);
        let distances: [_; POSTURES] = std::array::from_fn(|i| {
            let distance = length(&(arm.tip(i) - arm.tip(next(i)))) - self.errors[i].x;
            problem.add_variable::<Vector>(format!("distance {i}"), &vec![distance])
        });
        with_each(problem, "posture distance", |i| {
            let (q_a, q_b) = (arm.postures[i].clone(), arm.postures[next(i)].clone());
            (
                (robot, target, distances[i]),
                PostureDistance {
                    chain: chain.clone(),
                    q_a,
                    q_b,
                },
            )
        })
    }
}

/// A length with the sums in the order of the constraints, so that exact means exact.
fn length(v: &Vector3<f64>) -> f64 {
    (v.x * v.x + v.y * v.y + v.z * v.z).sqrt()
}

/// The problem with one constraint for each posture.
fn with_each<C: Constraint>(
    mut problem: Problem,
    name: &str,
    constraint: impl Fn(usize) -> (<C::Vars as truing::Vars>::Handles, C),
) -> Problem {
    let mut batch = Batch::new(name);
    for i in 0..POSTURES {
        let (variables, constraint) = constraint(i);
        batch.push(variables, constraint);
    }
    problem.add_block(batch);
    problem
}

fn linearize(problem: &Problem) -> Linearization {
    let mut lin = Linearization::new(problem.structure());
    problem.linearize(problem.initial(), &mut lin);
    lin
}

#[track_caller]
fn assert_agree(
    problem: &Problem,
    what: &str,
    found: &Linearization,
    reference: &Linearization,
    tolerance: f64,
) {
    for worst in check::compare(found, reference) {
        let (a, b) = worst.entries;
        assert!(
            worst.relative <= tolerance || (a - b).abs() <= tolerance * SMALL_COLUMN,
            "{what}: {}, {}: {a} against {b}, {:.1e}",
            problem.describe_row(worst.row),
            problem.describe_column(worst.column),
            worst.relative
        );
    }
    for (row, (a, b)) in found.residual.iter().zip(&reference.residual).enumerate() {
        assert!(
            (a - b).abs() <= EXACT,
            "{what}: r of {} is {a} against {b}",
            problem.describe_row(row)
        );
    }
}

/// All kinds, differentiated in all ways, are finite and agree.
#[track_caller]
fn assert_all_agree(scene: &Scene) {
    let [default, whole_chain, numeric] = [
        Derivatives::default(),
        Derivatives::WholeChain,
        Derivatives::Numeric,
    ]
    .map(|d| {
        let mut all = scene.problems(&d);
        all.extend(scene.papers(&d));
        all
    });
    assert_exact_agree(scene);
    for ((problem, whole_chain), numeric) in default.iter().zip(&whole_chain).zip(&numeric) {
        let lin = linearize(problem);
        // NaN is a difference too, so this covers the references.
        assert!(
            lin.values
                .iter()
                .chain(&lin.residual)
                .all(|x| x.is_finite()),
            "{lin:?}"
        );
        assert_agree(problem, "whole chain", &lin, &linearize(whole_chain), EXACT);
        assert_agree(problem, "numeric", &lin, &linearize(numeric), DIFFERENCES);
        let differences = check::central_differences(problem, problem.initial());
        assert_agree(
            problem,
            "central differences",
            &lin,
            &differences,
            DIFFERENCES,
        );
    }
}

/// The analytic columns are those of automatic differentiation, frame by frame and of the whole chain.
#[track_caller]
fn assert_exact_agree(scene: &Scene) {
    let analytic = Derivatives::Regressor(Arc::new(GeneralisedModel));
    let [analytic, default, whole_chain] =
        [analytic, Derivatives::default(), Derivatives::WholeChain].map(|d| {
            let mut all = scene.problems(&d);
            all.extend(scene.papers(&d));
            all
        });
    for ((problem, default), whole_chain) in analytic.iter().zip(&default).zip(&whole_chain) {
        let lin = linearize(problem);
        assert_agree(problem, "frame-wise", &lin, &linearize(default), EXACT);
        assert_agree(problem, "whole chain", &lin, &linearize(whole_chain), EXACT);
    }
}

#[track_caller]
fn assert_exactly_zero(scene: &Scene, tolerance: f64) {
    for problem in scene.problems(&Derivatives::default()) {
        let mut r = vec![0.0; problem.rows()];
        problem.residual(problem.initial(), &mut r);
        assert!(
            r.iter().all(|r| r.abs() <= tolerance),
            "{}: {r:?}",
            problem.describe_row(0)
        );
    }
}

fn robots() -> [Robot; 2] {
    [read(KHALIL_KLEINFINGER), read(DENAVIT_HARTENBERG)]
}

#[test]
fn all_ways_agree_at_random_points() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let [kk, distal] = robots();
    for _ in 0..100 {
        assert_all_agree(&Scene::random(&kk, &distal, &mut random));
        assert_all_agree(&Scene::random(&distal, &kk, &mut random));
    }
}

/// A thousand parameter sets, each with four configurations, for every kind and equation.
#[test]
fn analytic_and_automatic_columns_agree_at_a_thousand_random_points() {
    let mut random = ChaCha8Rng::seed_from_u64(1996);
    let [kk, distal] = robots();
    for _ in 0..500 {
        assert_exact_agree(&Scene::random(&kk, &distal, &mut random));
        assert_exact_agree(&Scene::random(&distal, &kk, &mut random));
    }
}

/// Models, general frames and mixed chains: at random, and with all that is measured and read at zero.
#[test]
fn all_ways_agree_with_models_of_joints() {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let robot = read(MODELS);
    for scene in 0..40 {
        let mut scene = if scene % 4 == 3 {
            let at_zero = || Arm::nominal(robot.clone(), |_| 0.0);
            let mut scene = Scene::exact(at_zero(), at_zero());
            // Two tool points that coincide have no direction.
            scene.other.target = Vector3::new(0.1, 0.2, 0.3);
            scene
        } else {
            Scene::random(&robot, &robot, &mut random)
        };
        for arm in [&mut scene.arm, &mut scene.other] {
            for q in &mut arm.postures {
                q.extend(
                    robot
                        .columns()
                        .iter()
                        .map(|_| random.random_range(-1.0..1.0)),
                );
            }
        }
        let ways = [
            Derivatives::default(),
            Derivatives::WholeChain,
            Derivatives::Numeric,
        ];
        let [default, whole_chain, numeric] = ways.map(|d| scene.problems(&d));
        for ((problem, whole_chain), numeric) in default.iter().zip(&whole_chain).zip(&numeric) {
            let lin = linearize(problem);
            assert!(lin.values.iter().all(|x| x.is_finite()), "{lin:?}");
            assert_agree(problem, "whole chain", &lin, &linearize(whole_chain), EXACT);
            assert_agree(problem, "numeric", &lin, &linearize(numeric), DIFFERENCES);
        }
    }
}

#[test]
fn all_ways_agree_where_every_error_is_zero() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let [kk, distal] = robots();
    for (arm, other) in [(&kk, &distal), (&distal, &kk)] {
        for _ in 0..100 {
            let mut place =
                |robot: &Robot| Arm::nominal(robot.clone(), |_| random.random_range(-3.0..3.0));
            let scene = Scene::exact(place(arm), place(other));
            // Rᵀ R of a measured rotation is one but for a few ε; all else is zero to the last bit.
            assert_exactly_zero(&scene, 1e-15);
            assert_all_agree(&scene);
        }
    }
}

#[test]
fn all_ways_agree_where_every_angle_and_every_error_is_zero() {
    let [kk, distal] = robots().map(|robot| without_angles(&robot));
    for (arm, other) in [(&kk, &distal), (&distal, &kk)] {
        // Slides move, or all postures would be one.
        let place = |robot: &Robot| {
            let mut slide = 0.0;
            Arm::nominal(robot.clone(), |kind| {
                slide += 0.1;
                if kind == JointKind::Prismatic {
                    slide
                } else {
                    0.0
                }
            })
        };
        let scene = Scene::exact(place(arm), place(other));
        assert_exactly_zero(&scene, 0.0);
        assert_all_agree(&scene);
    }
}

#[test]
fn all_ways_agree_where_angles_are_zero_and_errors_are_not() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let [kk, distal] = robots().map(|robot| without_angles(&robot));
    for (arm, other) in [(&kk, &distal), (&distal, &kk)] {
        for _ in 0..20 {
            let mut scene = Scene::random(arm, other, &mut random);
            for arm in [&mut scene.arm, &mut scene.other] {
                arm.parameters = arm.robot.nominal();
                let moving = arm.robot.joints().iter();
                let slides: Vec<bool> = moving
                    .map(|joint| joint.kind == JointKind::Prismatic)
                    .collect();
                for q in arm
                    .postures
                    .iter_mut()
                    .flat_map(|q| q.iter_mut().zip(&slides))
                {
                    *q.0 *= f64::from(u8::from(*q.1));
                }
            }
            assert_all_agree(&scene);
        }
    }
}

/// A length has no derivative at zero; the direction of the difference decides, and there is none.
#[test]
fn the_distance_of_points_that_coincide_has_derivative_zero() {
    let [robot, _] = robots();
    let mut arm = Arm::nominal(robot, |_| 0.3);
    arm.target = Vector3::new(0.1, 0.2, 0.3);
    let scene = Scene::exact(arm.clone(), arm);
    for derivatives in [Derivatives::default(), Derivatives::WholeChain] {
        for problem in [
            scene.distance(&derivatives),
            scene.posture_distance(&derivatives),
        ] {
            let lin = linearize(&problem);
            for column in 0..problem.cols() {
                let name = problem.describe_column(column);
                let expected = if name.starts_with("`distance") {
                    -1.0
                } else {
                    0.0
                };
                assert!(lin.column(column).all(|(_, j)| j == expected), "{name}");
            }
        }
    }
}
