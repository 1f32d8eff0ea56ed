//! The structural question about a robot alone: what would kinds of measurements identify?

use super::identify::Question;
use super::measurement::{Arm, Groups, Measured, MeasurementSet};
use super::names::Names;
use super::select::{SEED, default_preference};
use super::state::State;
use crate::constraint::Derivatives;
use crate::error::Error;
use crate::file::{InputError, Kind, Source, Spanned};
use crate::kinematics::{ParameterKind, Robot};
use crate::posture;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use truing::manifold::{Plane, Pose};
use truing::nalgebra::Vector3;

/// One thing to be measured, of which nothing is known yet but its kind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Asked {
    /// Of this kind; planes, points and distances within reach, drawn at random.
    Kind(Kind),
    /// Touches of this plane (unit normal), which is known.
    KnownPlane(Plane<f64>),
}

/// The question what a robot's parameters measurements of some kinds would identify.
#[derive(Debug, Clone)]
pub struct RobotQuestion {
    /// The robot.
    pub robot: Robot,
    /// What is measured, in order.
    pub asked: Vec<Asked>,
    /// Names and patterns of the parameters in question; all but the gains if there are none.
    pub parameters: Vec<String>,
    /// Those of them that are fixed.
    pub fixed: Vec<String>,
    /// Those kept first.
    pub preference: Vec<String>,
    /// The sensor frame of positions and poses, estimated; none for the reference frame.
    pub frame: Option<String>,
    /// The tool point, estimated; none for the tool origin.
    pub target: Option<String>,
    /// Seed of everything random.
    pub seed: u64,
}

impl RobotQuestion {
    /// About all parameters but the gains, in the reference frame and at the tool origin.
    pub fn new(robot: Robot, asked: Vec<Asked>) -> Self {
        Self {
            robot,
            asked,
            parameters: Vec::new(),
            fixed: Vec::new(),
            preference: Vec::new(),
            frame: None,
            target: None,
            seed: SEED,
        }
    }

    /// The question with everything random drawn.
    ///
    /// # Errors
    /// If a name or pattern means no parameter.
    pub fn question(&self) -> Result<Question, Error> {
        let arms = vec![Arm::only(self.robot.clone())];
        let count = self.robot.parameters().len();
        let gain = |p: usize| self.robot.parameters()[p].kind == ParameterKind::Gain;
        let mut wanted: Vec<bool> = match self.parameters.is_empty() {
            true => (0..count).map(|p| !gain(p)).collect(),
            false => vec![false; count],
        };
        for p in self.find(&arms, &self.parameters, "--parameters")? {
            wanted[p] = true;
        }
        for p in self.find(&arms, &self.fixed, "--fixed")? {
            wanted[p] = false;
        }
        let mut preference: Vec<(usize, usize)> = Vec::new();
        let own = self.find(&arms, &self.preference, "--preference")?;
        let own = own.into_iter().map(|p| (0, p));
        let mut usual = default_preference(&arms);
        // The paper's lists name the joint's parameter where the base's does the same.
        for (base, joint) in self.robot.aligned_with_base() {
            let place = |p: usize| usual.iter().position(|key| *key == (0, p));
            if let (Some(a), Some(b)) = (place(base), place(joint)) {
                usual.swap(a, b);
            }
        }
        for key in own.chain(usual) {
            if !preference.contains(&key) {
                preference.push(key);
            }
        }
        let mut draw = Draw {
            robot: &self.robot,
            limits: posture::limits(&self.robot),
            rng: ChaCha8Rng::seed_from_u64(self.seed),
        };
        let mut state = State {
            robots: vec![self.robot.nominal()],
            ..State::default()
        };
        if let Some(name) = &self.frame {
            let turn: [f64; 4] = std::array::from_fn(|_| draw.rng.sample(StandardNormal));
            let length = turn.iter().map(|x| x * x).sum::<f64>().sqrt();
            let pose = Pose::from_quaternion(draw.direction() * 2.0, turn.map(|x| x / length));
            state.frames.insert(name.clone(), pose);
        }
        if let Some(name) = &self.target {
            let point = draw.direction() * 0.1;
            state.targets.insert((0, name.clone()), point);
        }
        let sets = (0..self.asked.len())
            .map(|k| self.set(k, &mut draw, &mut state))
            .collect();
        Ok(Question {
            arms,
            sets,
            state,
            wanted: vec![wanted],
            preference,
            with_prior: Vec::new(),
            derivatives: Derivatives::default(),
            seed: self.seed,
            warnings: Vec::new(),
        })
    }

    /// The parameters that names and patterns mean, in their order.
    fn find(&self, arms: &[Arm], texts: &[String], from: &str) -> Result<Vec<usize>, InputError> {
        let mut found = Vec::new();
        for text in texts {
            let source = Source::new(text, from);
            let names = Names {
                source: &source,
                arms,
            };
            let keys = names.find(&Spanned::new(text.clone(), 0..text.len()))?;
            found.extend(keys.into_iter().map(|(_, p)| p));
        }
        Ok(found)
    }

    /// What is measured as a set without rows; its plane, point or distance goes into the state.
    fn set(&self, k: usize, draw: &mut Draw<'_>, state: &mut State) -> MeasurementSet {
        let groups = |name: &str| Groups {
            names: vec![name.to_owned()],
            of_row: Vec::new(),
        };
        let (mut planes, mut points, mut length) = (Vec::new(), Vec::new(), 0.0);
        let mut locations = Vec::new();
        let measured = match self.asked[k] {
            Asked::KnownPlane(plane) => Measured::KnownPlane(plane),
            Asked::Kind(Kind::KnownPlane) => Measured::KnownPlane(draw.plane()),
            Asked::Kind(Kind::UnknownPlane) => {
                planes.push(draw.plane());
                Measured::UnknownPlane(groups("plane"))
            }
            Asked::Kind(Kind::SamePoint) => {
                points.push(draw.point());
                Measured::SamePoint(groups("point"))
            }
            Asked::Kind(Kind::SameLocation) => {
                // One location is reached in few postures: it takes several.
                const LOCATIONS: usize = 8;
                locations = (0..LOCATIONS).map(|_| draw.location()).collect();
                Measured::SameLocation(Groups {
                    names: (1..=LOCATIONS).map(|n| n.to_string()).collect(),
                    of_row: Vec::new(),
                })
            }
            Asked::Kind(Kind::Position) => Measured::Position(Vec::new()),
            Asked::Kind(Kind::Pose) => Measured::Pose(Vec::new()),
            Asked::Kind(Kind::Distance) => {
                length = draw.distance();
                Measured::Distance {
                    other: None,
                    q_b: Vec::new(),
                    distance: Some(length),
                }
            }
        };
        state.planes.push(planes);
        state.points.push(points);
        state.locations.push(locations);
        state.distances.push(length);
        let mut set = MeasurementSet::new(self.name(k), 0, Vec::new(), measured);
        if matches!(set.measured, Measured::Position(_) | Measured::Pose(_)) {
            set.frame.clone_from(&self.frame);
        }
        set.target.clone_from(&self.target);
        set
    }

    /// The kind, numbered where there are several of it.
    fn name(&self, k: usize) -> String {
        let kind = |asked: &Asked| match asked {
            Asked::Kind(kind) => kind.name(),
            Asked::KnownPlane(_) => Kind::KnownPlane.name(),
        };
        let own = kind(&self.asked[k]);
        let same = |asked: &&Asked| kind(asked) == own;
        if self.asked.iter().filter(same).count() == 1 {
            return own.to_owned();
        }
        let number = self.asked[..=k].iter().filter(same).count();
        format!("{own}-{number}")
    }
}

/// Draws places in the middle of the workspace, which many postures reach.
struct Draw<'a> {
    robot: &'a Robot,
    limits: Vec<[f64; 2]>,
    rng: ChaCha8Rng,
}

impl Draw<'_> {
    fn tips(&mut self) -> Vec<Vector3<f64>> {
        const TIPS: usize = 31;
        let nominal = self.robot.nominal();
        (0..TIPS)
            .map(|_| {
                let q = posture::random(&self.limits, &mut self.rng);
                self.robot.forward(&nominal, &q).translation
            })
            .collect()
    }

    fn direction(&mut self) -> Vector3<f64> {
        let v: Vector3<f64> = Vector3::from_fn(|_, _| self.rng.sample(StandardNormal));
        v.try_normalize(1e-12).unwrap_or_else(Vector3::z)
    }

    /// A plane with as many random tips on one side as on the other.
    fn plane(&mut self) -> Plane<f64> {
        let normal = self.direction();
        let along = self.tips().iter().map(|tip| normal.dot(tip)).collect();
        Plane {
            normal,
            distance: median(along),
        }
    }

    /// The random tip that is nearest to all others.
    fn point(&mut self) -> Vector3<f64> {
        let tips = self.tips();
        let far = |a: &Vector3<f64>| tips.iter().map(|b| (a - b).norm()).sum::<f64>();
        let nearest = tips.iter().min_by(|a, b| far(a).total_cmp(&far(b)));
        nearest.copied().unwrap_or_default()
    }

    /// Where the tool is in a posture from which all directions are free.
    fn location(&mut self) -> Pose<f64> {
        let nominal = self.robot.nominal();
        let q = posture::dexterous(self.robot, &nominal, &mut self.rng);
        self.robot.forward(&nominal, &q)
    }

    /// The median distance of two random tips.
    fn distance(&mut self) -> f64 {
        let (a, b) = (self.tips(), self.tips());
        median(a.iter().zip(&b).map(|(a, b)| (a - b).norm()).collect())
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or_default()
}
