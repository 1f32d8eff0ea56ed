//! The PUMA 560 of the examples, true robots near it, and simulated measurements of them of every
//! kind.

#![allow(dead_code, reason = "each test file uses what it needs")]

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::path::{Path, PathBuf};
use truing_robot::Robot;
use truing_robot::file::ErrorSpec;
use truing_robot::identify::{Choice, default_preference, in_order, select};
use truing_robot::kinds;
use truing_robot::measurement::Groups;
use truing_robot::measurement::{Sampling, sample};
use truing_robot::model::{Assembly, Owner};
use truing_robot::robot::{Derivatives, RobotFile, Unit};
use truing_robot::simulate::perturbed;
use truing_robot::start::start;
use truing_robot::unknown::{State, Value};
use truing_robot::{Arm, Calibration, MeasurementSet, Outcome};

use truing::manifold::{Plane, Plane3, Point3, Pose, Pose3};
use truing::nalgebra::Vector3;

/// A file of the example.
pub fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../examples/puma560")
        .join(name)
}

/// The nominal PUMA 560 on its generic base, with its generic tool.
pub fn puma() -> Robot {
    Robot::new(&RobotFile::read(example("puma560.toml")).unwrap())
}

/// The PUMA 560 with a text of its file replaced.
#[track_caller]
pub fn puma_with(from: &str, to: &str) -> Robot {
    let text = std::fs::read_to_string(example("puma560.toml")).unwrap();
    assert!(text.contains(from), "puma560.toml has no `{from}`");
    Robot::new(&RobotFile::parse(&text.replacen(from, to, 1), "puma560.toml").unwrap())
}

/// The Stanford arm, its third joint sliding, on a generic base and with a generic tool.
pub fn stanford() -> Robot {
    let text = r#"
        convention = "khalil-kleinfinger"
        units = { angle = "deg", length = "m" }
        name = "Stanford"
        base = { theta = 17.0, r = 0.4 }
        tool = { alpha = 17.0, d = 0.12, theta = 23.0, r = 0.08 }
        joint = [
            { name = "q1", type = "revolute", alpha = 11.0, d = 0.15, theta = 5.0, r = 0.25 },
            { name = "q2", type = "revolute", alpha = -90.0, r = 0.154 },
            { name = "q3", type = "prismatic", alpha = 90.0, limits = [0.15, 1.0] },
            { name = "q4", type = "revolute" },
            { name = "q5", type = "revolute", alpha = -90.0 },
            { name = "q6", type = "revolute", alpha = 90.0 },
        ]
    "#;
    Robot::new(&RobotFile::parse(text, "stanford.toml").unwrap())
}

/// Two PUMAs, `left` and `right`, that reach into each other's workspace.
pub fn two_pumas() -> Vec<Arm> {
    let right = puma_with(
        "theta = 17.0\nr = 0.4\n\n[[joint]]\nname = \"waist\"\ntype = \"revolute\"\nalpha = 11.0\nd = 0.15",
        "theta = 40.0\nr = 0.35\n\n[[joint]]\nname = \"waist\"\ntype = \"revolute\"\nalpha = -9.0\nd = 0.9",
    );
    [("left", puma()), ("right", right)]
        .map(|(name, robot)| Arm {
            name: name.into(),
            robot,
        })
        .into()
}

/// A plane that the PUMA reaches everywhere above its base.
pub fn table() -> Plane<f64> {
    let normal = Vector3::new(0.05, -0.02, 1.0).normalize();
    Plane {
        normal,
        distance: 0.35,
    }
}

/// Errors of up to ±0.3°, ±1 mm and, for gains, ±0.001.
pub fn errors() -> ErrorSpec {
    ErrorSpec {
        angle: 0.3_f64.to_radians(),
        length: 1e-3,
        gain: 1e-3,
        ..ErrorSpec::default()
    }
}

/// What is measured, without its rows.
#[derive(Debug, Clone)]
pub enum What {
    /// Poses in the reference frame.
    Pose,
    /// Positions of the tool origin in the reference frame.
    Position,
    /// Positions of a point on the tool in a tracker's frame, neither of them known.
    TrackedPosition,
    /// Touches of a known plane.
    KnownPlane(Plane<f64>),
    /// Touches of planes that are estimated.
    UnknownPlane(Vec<Plane<f64>>),
    /// Visits of points that are estimated \[m\].
    SamePoint(Vec<Vector3<f64>>),
    /// Visits of locations that are estimated.
    SameLocation(Vec<Pose<f64>>),
    /// A known distance between the tools of two robots \[m\].
    TwoArms(f64),
    /// A known distance between two postures of one robot \[m\].
    TwoPostures(f64),
    /// A distance between the tools of two robots that is estimated \[m\].
    TwoArmsUnknown(f64),
}

/// Robots as they truly are, and what was measured of them.
#[derive(Clone)]
pub struct Scene {
    /// The nominal robots.
    pub arms: Vec<Arm>,
    /// Everything as it truly is.
    pub truth: State,
    /// The measurements.
    pub sets: Vec<MeasurementSet>,
    seed: u64,
}

impl Scene {
    /// Robots that are as their tables say.
    pub fn nominal(arms: Vec<Arm>, seed: u64) -> Self {
        let truth = State::of(arms.iter().map(|arm| arm.robot.nominal()).collect());
        Self {
            arms,
            truth,
            sets: Vec::new(),
            seed,
        }
    }

    /// Robots with random [`errors`] in the parameters that are `chosen` by robot and number.
    pub fn perturbed(arms: Vec<Arm>, seed: u64, chosen: impl Fn(usize, usize) -> bool) -> Self {
        let mut scene = Self::nominal(arms, seed);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        for (r, arm) in scene.arms.iter().enumerate() {
            scene.truth.robots[r] = perturbed(&arm.robot, &errors(), |p| chosen(r, p), &mut rng);
        }
        scene
    }

    /// The same robots, measured with other random numbers from here on.
    #[must_use]
    pub fn seeded(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// Adds `count` measurements (of each plane or point) with noise of `sigma` \[m; rad for
    /// rotations\].
    pub fn measure(mut self, what: &What, count: usize, sigma: f64) -> Self {
        let k = self.sets.len();
        let none = Vec::new;
        let unnamed = [""; 0];
        let apart = |length: f64| Value::number("distance", Unit::Meter, length);
        let two_arms = |known| kinds::distance("", none(), none(), known);
        let (template, values): (MeasurementSet, Vec<Value>) = match what {
            What::Pose => (kinds::pose("", none(), &[]), none_of()),
            What::Position => (kinds::position("", none(), &[]), none_of()),
            What::TrackedPosition => {
                let turned =
                    Pose::from_quaternion(Vector3::new(3.0, -0.5, 0.2), [0.0, 0.0, 0.6, 0.8]);
                self.truth.set_frame("tracker", turned);
                let reflector = Vector3::new(0.02, -0.03, 0.1);
                self.truth.set_target(0, "reflector", reflector);
                let set = kinds::position("", none(), &[]);
                (set.frame("tracker").target("reflector"), none_of())
            }
            What::KnownPlane(plane) => (kinds::known_plane("", none(), *plane), none_of()),
            What::UnknownPlane(listed) => (
                kinds::unknown_plane("", none(), unnamed),
                listed.iter().map(|p| Value::of::<Plane3>(*p)).collect(),
            ),
            What::SamePoint(listed) => (
                kinds::same_point("", none(), unnamed),
                listed.iter().map(|p| Value::of::<Point3>(*p)).collect(),
            ),
            What::SameLocation(listed) => (
                kinds::same_location("", none(), unnamed),
                listed.iter().map(|p| Value::of::<Pose3>(*p)).collect(),
            ),
            What::TwoArms(length) => (two_arms(Some(*length)), vec![apart(*length)]),
            What::TwoArmsUnknown(length) => (two_arms(None), vec![apart(*length)]),
            What::TwoPostures(length) => (
                kinds::posture_distance("", none(), none(), Some(*length)),
                vec![apart(*length)],
            ),
        };
        let mut template = template;
        template.readings.name = format!("{}-{}", template.kind.name(), k + 1);
        if template.kind.grouping().is_some() {
            template.readings.groups = Groups {
                names: (1..=values.len()).map(|g| g.to_string()).collect(),
                of_row: Vec::new(),
            };
        }
        if let Some(unknown) = template.kind.unknowns().first() {
            for (group, value) in template.groups.names.iter().zip(values) {
                self.truth
                    .set_own(&template.name, group, unknown.name, value);
            }
        }
        let noise = vec![sigma; template.kind.measurands().len()];
        let sampling = Sampling {
            count,
            noise: Some(&noise),
            near: None,
        };
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(k as u64 + 1);
        let set = sample(&self.arms, &template, &self.truth, &sampling, &mut rng).unwrap();
        self.sets.push(set);
        self
    }

    /// The calibration of these measurements, of everything but the gains unless they are asked for.
    pub fn calibration(&self, gains: bool) -> Calibration {
        let calibration = Calibration::new(self.arms.clone(), self.sets.clone());
        if gains {
            calibration
        } else {
            calibration.fixing(&["gains"])
        }
    }

    /// The same with nothing held near nominal: what the measurements alone say.
    pub fn free(&self) -> Calibration {
        let mut calibration = self.calibration(false);
        calibration.estimate.drawing = None;
        calibration
    }

    /// Calibrates; see [`calibration`](Self::calibration).
    #[track_caller]
    pub fn calibrate(&self, gains: bool) -> Outcome {
        self.calibration(gains).run(&|_| {}).unwrap()
    }

    /// What becomes of each of the robots' parameters, those `wanted` by robot and name; the
    /// preferred come first, the rest in the default order.
    pub fn choices(
        &self,
        preferred: &[(usize, usize)],
        wanted: impl Fn(usize, &str) -> bool,
    ) -> Vec<(String, Choice)> {
        let nominal = self.arms.iter().map(|arm| arm.robot.nominal()).collect();
        let begin = start(&self.arms, &self.sets, nominal, &State::default());
        let derivatives = Derivatives::default();
        let layout = Assembly::new(&self.arms, &self.sets, &begin, &derivatives).unwrap();
        let mut preference = preferred.to_vec();
        let rest = default_preference(&self.arms);
        preference.extend(rest.into_iter().filter(|p| !preferred.contains(p)));
        let columns = in_order(&layout, &preference, |owner| match owner {
            Owner::Parameter { robot, parameter } => wanted(
                *robot,
                &self.arms[*robot].robot.parameters()[*parameter].name,
            ),
            _ => true,
        });
        let choices = select(&self.arms, &self.sets, &begin, &derivatives, &columns, &[]).unwrap();
        layout
            .columns
            .iter()
            .zip(choices)
            .filter(|(column, _)| matches!(column.owner, Owner::Parameter { .. }))
            .map(|(column, choice)| (column.name.clone(), choice))
            .collect()
    }
}

/// The values of a kind that has no unknowns.
fn none_of() -> Vec<Value> {
    Vec::new()
}
