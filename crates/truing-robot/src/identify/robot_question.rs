//! The structural question about a robot alone: what would kinds of measurements identify?

use super::order::default_preference;
use super::question::Question;
use super::twin::SEED;
use crate::error::Error;
use crate::measurement::{Groups, Kind, MeasurementSet, Places, Rows, TargetKind};
use crate::robot::{Arm, Derivatives, ParameterKind, Robot, names};
use crate::text::{InputError, Source};
use crate::unknown::{Key, State, Value};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::sync::Arc;
use truing::manifold::{Pose, Pose3};
use truing::nalgebra::Vector3;

/// One thing to be measured, of which nothing is known yet but its kind.
#[derive(Debug, Clone)]
pub struct Asked {
    /// Its kind.
    pub kind: Arc<dyn Kind>,
    /// Whether its constants are drawn at random within reach, as its unknowns are; otherwise they are
    /// those of the kind.
    pub drawn: bool,
}

impl Asked {
    /// Measurements of a kind; planes, points and distances within reach, drawn at random.
    pub fn kind(kind: Arc<dyn Kind>) -> Self {
        Self { kind, drawn: true }
    }

    /// Measurements of a kind with its constants, such as a plane that is known.
    pub fn given(kind: impl Kind) -> Self {
        Self {
            kind: Arc::new(kind),
            drawn: false,
        }
    }
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
        // Where a joint's parameter does what the base's does, it is the joint's that is named as lost.
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
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let mut state = State::of(vec![self.robot.nominal()]);
        if let Some(name) = &self.frame {
            let turn: [f64; 4] = std::array::from_fn(|_| rng.sample(StandardNormal));
            let length = turn.iter().map(|x| x * x).sum::<f64>().sqrt();
            let place = direction(&mut rng) * 2.0;
            state.set_frame(name, Pose::from_quaternion(place, turn.map(|x| x / length)));
        }
        if let Some(name) = &self.target {
            let point = direction(&mut rng) * 0.1;
            let bodies = self.asked.iter().any(|asked| is_body(&*asked.kind));
            if bodies {
                let pose = Pose {
                    translation: point,
                    ..Pose::identity()
                };
                state.set(Key::Target(0, name.clone()), Value::of::<Pose3>(pose));
            } else {
                state.set_target(0, name, point);
            }
        }
        let sets = (0..self.asked.len())
            .map(|k| self.set(k, &mut rng, &mut state))
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
            let keys = names::find(arms, text).map_err(|unknown| {
                let source = Source::new(text, from);
                source
                    .error_at(0..text.len(), unknown.message)
                    .with_help(unknown.help)
            })?;
            found.extend(keys.into_iter().map(|(_, p)| p));
        }
        Ok(found)
    }

    /// What is measured as a set without rows; its unknowns go into the state.
    fn set(&self, k: usize, rng: &mut ChaCha8Rng, state: &mut State) -> MeasurementSet {
        let asked = &self.asked[k];
        let nominal = self.robot.nominal();
        let mut places = Places {
            robot: &self.robot,
            parameters: &nominal,
            target: Vector3::zeros(),
            middle: true,
            rng,
        };
        let mut kind = asked.kind.clone();
        let names = match kind.grouping() {
            None => vec![String::new()],
            Some(grouping) if grouping.asked == 1 => vec![grouping.group.to_owned()],
            Some(grouping) => (1..=grouping.asked).map(|n| n.to_string()).collect(),
        };
        let name = self.name(k);
        for group in &names {
            if !asked.drawn && kind.unknowns().is_empty() {
                continue;
            }
            let placed = asked.kind.place(&mut places);
            for (unknown, value) in kind.unknowns().iter().zip(placed.values) {
                state.set_own(&name, group, unknown.name, value);
            }
            if let (true, Some(drawn)) = (asked.drawn, placed.kind) {
                kind = drawn;
            }
        }
        let columns = kind.columns().len();
        let body = is_body(&*kind);
        let framed = kind.has_frame();
        let mut set = MeasurementSet::of(name, kind, Vec::new(), Rows::new(columns));
        set.readings.groups = Groups {
            names,
            of_row: Vec::new(),
        };
        if framed {
            set.readings.frame.clone_from(&self.frame);
        }
        let bodies = self.asked.iter().any(|asked| is_body(&*asked.kind));
        for tool in &mut set.tools {
            // A point and a body cannot have one name.
            tool.target = self.target.clone().filter(|_| body || !bodies);
        }
        set
    }

    /// The kind, numbered where there are several of it.
    fn name(&self, k: usize) -> String {
        let own = self.asked[k].kind.name();
        let same = |asked: &&Asked| asked.kind.name() == own;
        if self.asked.iter().filter(same).count() == 1 {
            return own.to_owned();
        }
        let number = self.asked[..=k].iter().filter(same).count();
        format!("{own}-{number}")
    }
}

fn is_body(kind: &dyn Kind) -> bool {
    kind.targets() == TargetKind::Body
}

fn direction(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    let v: Vector3<f64> = Vector3::from_fn(|_, _| rng.sample(StandardNormal));
    v.try_normalize(1e-12).unwrap_or_else(Vector3::z)
}
