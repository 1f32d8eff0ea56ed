//! Robots: frames, joints and their named parameters.

use super::chain_frame::Frame;
use super::frame_row::{Convention, Key};
use super::joint_kind::JointKind;
use super::table::RobotFile;
use super::twist::Twist;
use super::unit::Unit;
use std::borrow::Cow;
use truing::Scalar;
use truing::manifold::Pose;
use truing::nalgebra::{Matrix3, Vector3};

/// What a parameter is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ParameterKind {
    /// Twist angle between neighbouring axes, about x.
    Alpha,
    /// Length along x (Khalil–Kleinfinger d, distal a).
    LengthX,
    /// Joint angle offset, about z.
    Theta,
    /// Length along z (Khalil–Kleinfinger r, distal d).
    LengthZ,
    /// Extra angle for near-parallel axes, about y.
    Beta,
    /// Transmission gain K of a joint.
    Gain,
    /// One of the six numbers of a general frame's small transform.
    Small(u8),
    /// Of a frame model from outside.
    Custom,
    /// Of a joint model.
    Model,
}

/// One parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Name, e.g. `theta3`.
    pub name: String,
    /// What it is.
    pub kind: ParameterKind,
    /// Number of its frame: 0 is the base, 1 … n the joints, n + 1 the tool.
    pub frame: usize,
    /// Nominal value [m, rad or as its unit says].
    pub nominal: f64,
    pub(super) unit: Unit,
}

impl Parameter {
    /// Its unit.
    pub fn unit(&self) -> Unit {
        self.unit
    }
}

/// One joint with a reading of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Name, by which data files give its column.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// Limits of its value [rad or m].
    pub limits: Option<[f64; 2]>,
    /// Value where data have no column for it.
    pub value: Option<f64>,
    /// Number of its frame.
    pub frame: usize,
    /// Number of the parameter that moves what the joint does: θ, or r if it slides; of a general frame the one
    /// nearest to that; none of a frame from outside.
    pub offset_parameter: Option<usize>,
}

/// A further column of the data that joints are a function of.
#[derive(Debug, Clone, PartialEq)]
pub struct InputColumn {
    /// Its name.
    pub name: String,
    /// Whether only its sign counts.
    pub sign: bool,
    /// Between which values it is drawn in simulations.
    pub range: [f64; 2],
    /// Its value where the data have no such column.
    pub value: Option<f64>,
}

/// What is derived from the readings with the nominal parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Derived {
    /// The arm of gravity that a mass at the origin of a frame has on the joint of another: joint, frame.
    GravityArm(usize, usize),
    /// The torque of gravity on the joint of a frame.
    GravityTorque(usize),
}

/// A serial robot: base, joints, tool, and its named parameters with nominal values.
///
/// Frame j − 1 from frame j is one transform of a [`Convention`], or of a model from outside; the chain is
/// base_from_tool = T₀ · T₁(δ₁) ⋯ Tₙ(δₙ) · Tₙ₊₁ with displacements δ that are sums of joint models. The
/// parameter vector holds everything that `"all"` means: four parameters a frame (frame 0 of
/// Khalil–Kleinfinger has θ and r only, a general frame six), β where the axis is nominally parallel to the one
/// before, the gain K of every moving joint, and those of its models.
///
/// Joint values are given as rows: the readings of the [`joints`](Self::joints) in order, then the further
/// [`columns`](Self::columns). What is derived from them comes behind ([`complete`](Self::complete)).
#[derive(Debug, Clone)]
pub struct Robot {
    pub(super) name: String,
    pub(super) convention: Convention,
    pub(super) frames: Vec<Frame>,
    pub(super) joints: Vec<Joint>,
    pub(super) columns: Vec<InputColumn>,
    pub(super) derived: Vec<Derived>,
    pub(super) parameters: Vec<Parameter>,
    pub(super) file: RobotFile,
    /// Where parameters are the motions of the robot as a whole: its own ones.
    pub(super) moved: Option<Vec<f64>>,
}

/// Three translations, three rotations about the origin, and growth: the motions of a robot as a whole.
pub(crate) const MOTIONS: usize = 7;

impl Robot {
    /// The name in its file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The frame convention.
    pub fn convention(&self) -> Convention {
        self.convention
    }

    /// The frames: base, joints (moving or not), tool.
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// The joints that have readings of their own, in order.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// Further columns of the data that joints are a function of.
    pub fn columns(&self) -> &[InputColumn] {
        &self.columns
    }

    /// How many frames move.
    pub fn motions(&self) -> usize {
        self.frames.iter().filter(|f| f.motion.is_some()).count()
    }

    /// Numbers that a row is given with: readings, then columns.
    pub fn given(&self) -> usize {
        self.joints.len() + self.columns.len()
    }

    /// A row with what is derived from it behind, with the nominal parameters: the arms and torques of gravity. A row
    /// that has it stays as it is; of columns of which only the sign counts it is made ±1.
    #[inline]
    pub fn complete<'r>(&self, row: &'r [f64]) -> Cow<'r, [f64]> {
        if self.columns.is_empty() && self.derived.is_empty() {
            return Cow::Borrowed(row);
        }
        self.complete_with_columns(row)
    }

    #[inline(never)]
    fn complete_with_columns<'r>(&self, row: &'r [f64]) -> Cow<'r, [f64]> {
        let wanted = self.given() + self.derived.len();
        let further = row.iter().skip(self.joints.len()).zip(&self.columns);
        let mut rough = further.filter(|(x, column)| column.sign && ![-1.0, 0.0, 1.0].contains(*x));
        if row.len() == wanted && rough.next().is_none() {
            return Cow::Borrowed(row);
        }
        let mut row = row.to_vec();
        for (column, x) in self.columns.iter().zip(&mut row[self.joints.len()..]) {
            if column.sign && *x != 0.0 {
                *x = x.signum();
            }
        }
        if row.len() < wanted {
            row.resize(wanted, 0.0);
            let derived = self.derive(&row);
            row[self.given()..].copy_from_slice(&derived);
        }
        Cow::Owned(row)
    }

    /// What is derived from a row, in which it is still zero.
    fn derive(&self, row: &[f64]) -> Vec<f64> {
        let nominal = self.nominal();
        let mut poses = Vec::new();
        let mut motions = Vec::new();
        let mut pose = Pose::<f64>::identity();
        let mut twists = vec![Twist::default(); nominal.len()];
        for frame in &self.frames {
            let range = frame.own_parameters();
            let displacement = frame.displacement(&nominal, row);
            let own = &nominal[range.clone()];
            let moved;
            (pose, moved) = frame.differentiate(&pose, own, displacement, &mut twists[range]);
            motions.push(moved);
            poses.push(pose);
        }
        let g = Vector3::from(self.file.gravity);
        let down = g.try_normalize(0.0).unwrap_or_default();
        let one = |derived: &Derived| match *derived {
            Derived::GravityArm(joint, frame) => {
                down.dot(&motions[joint].at(&poses[frame].translation))
            }
            Derived::GravityTorque(joint) => {
                self.gravity_torque(joint, &g, &motions[joint], &poses)
            }
        };
        self.derived.iter().map(one).collect()
    }

    /// Σ m g · v over the masses from a joint on, v the velocity of their centres as the joint moves.
    fn gravity_torque(
        &self,
        joint: usize,
        g: &Vector3<f64>,
        motion: &Twist,
        poses: &[Pose<f64>],
    ) -> f64 {
        let joints = self.file.joints.iter().map(|joint| joint.mass);
        let masses = joints.chain([self.file.tool_mass]).enumerate();
        let beyond = masses.filter(|(k, _)| k + 1 >= joint);
        beyond
            .filter_map(|(k, mass)| Some((k + 1, mass?)))
            .map(|(frame, mass)| {
                let center = poses[frame].apply(&Vector3::from(mass.center));
                mass.mass * g.dot(&motion.at(&center))
            })
            .sum()
    }

    /// The slopes of all displacements by the readings, one after another for each moving frame.
    pub fn slopes(&self, parameters: &[f64], row: &[f64]) -> Vec<f64> {
        let row = self.complete(row);
        let readings = self.joints.len();
        let mut slopes = vec![0.0; self.motions() * readings];
        for motion in self.frames.iter().filter_map(|frame| frame.motion.as_ref()) {
            let first = motion.number * readings;
            motion.by_readings(parameters, &row, readings, |reading, slope| {
                slopes[first + reading] += slope;
            });
        }
        slopes
    }

    /// All parameters.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// The nominal parameter vector.
    pub fn nominal(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.nominal).collect()
    }

    /// Number of a parameter by name.
    pub fn parameter(&self, name: &str) -> Option<usize> {
        self.parameters.iter().position(|p| p.name == name)
    }

    /// The parts of all models of joints: the names of their parameters without the number of the frame, `cos2` and
    /// `sin2`, and which parameters of the robot these are, over all joints that have the part.
    pub fn model_parts(&self) -> Vec<(Vec<String>, Vec<usize>)> {
        let mut parts: Vec<(Vec<String>, Vec<usize>)> = Vec::new();
        for motion in self.frames.iter().filter_map(|frame| frame.motion.as_ref()) {
            for term in &motion.terms {
                let own = term.model.parameters(motion.kind);
                let last = own.len().checked_sub(1).map(|k| term.model.part(k));
                for part in 0..=last.unwrap_or(0) {
                    let of_part = (0..own.len()).filter(|k| term.model.part(*k) == part);
                    let (names, numbers) = of_part
                        .map(|k| (own[k].name.clone(), term.parameters.start + k))
                        .unzip();
                    match parts.iter_mut().find(|(known, _)| *known == names) {
                        Some((_, all)) => all.extend::<Vec<usize>>(numbers),
                        None => parts.push((names, numbers)),
                    }
                }
            }
        }
        parts
    }

    /// base_from_tool at a row of joint values, over any scalar.
    pub fn forward<T: Scalar>(&self, parameters: &[T], row: &[f64]) -> Pose<T> {
        match &self.moved {
            None => self.through_frames(parameters, row),
            Some(own) => self.through_motions(own, parameters, row),
        }
    }

    /// From where the robot is with its `own` parameters, moved as a whole.
    #[cold]
    #[inline(never)]
    fn through_motions<T: Scalar>(&self, own: &[f64], parameters: &[T], row: &[f64]) -> Pose<T> {
        let fixed: Vec<T> = own.iter().map(|p| T::from(*p)).collect();
        let pose = self.through_frames(&fixed, row);
        let [x, y, z, a, b, c, growth] = std::array::from_fn(|k| parameters[k] - own[k]);
        let one = T::one();
        // To first order, which is all that derivatives at the robot as it is see.
        let turn = Matrix3::new(one, -c, b, c, one, -a, -b, a, one);
        let place = pose.translation.map(|p| p * (growth + 1.0));
        Pose {
            rotation: turn * pose.rotation,
            translation: turn * place + Vector3::new(x, y, z),
        }
    }

    /// The same robot with, in place of its first parameters, its [`MOTIONS`] as a whole, from where it is with
    /// `own` parameters: derivatives there, of whatever is written over [`forward`](Self::forward), are those by
    /// the motions.
    pub(crate) fn moved_as_a_whole(&self, own: &[f64]) -> Self {
        Self {
            moved: Some(own.to_vec()),
            ..self.clone()
        }
    }

    #[inline]
    fn through_frames<T: Scalar>(&self, parameters: &[T], row: &[f64]) -> Pose<T> {
        let row = self.complete(row);
        let mut pose = Pose::identity();
        for frame in &self.frames {
            let own = &parameters[frame.own_parameters()];
            pose = frame.after(&pose, own, frame.displacement(parameters, &row));
        }
        pose
    }

    /// The six parameters that place the robot in its reference frame (θ₀, r₀, α₁, d₁, θ₁, r₁, and
    /// β₁ where it has one), under this convention's names.
    pub fn base_parameters(&self) -> Vec<usize> {
        (0..self.parameters.len())
            .filter(|k| {
                let (kind, frame) = self.khalil_frame(*k);
                frame <= 1 && !matches!(kind, ParameterKind::Gain | ParameterKind::Model)
            })
            .collect()
    }

    /// The tool's parameters.
    pub fn tool_parameters(&self) -> Vec<usize> {
        let last = self.frames.len() - 1;
        (0..self.parameters.len())
            .filter(|k| self.parameters[*k].frame == last)
            .collect()
    }

    /// A parameter's kind with the number of the frame it would have in Khalil–Kleinfinger's
    /// convention: distal row j holds θⱼ, rⱼ and dⱼ₊₁, αⱼ₊₁, βⱼ₊₁.
    fn khalil_frame(&self, parameter: usize) -> (ParameterKind, usize) {
        let p = &self.parameters[parameter];
        let before = matches!(
            p.kind,
            ParameterKind::Alpha | ParameterKind::LengthX | ParameterKind::Beta
        );
        let convention = self.frames[p.frame].convention();
        let shift = usize::from(convention == Some(Convention::DenavitHartenberg) && before);
        (p.kind, p.frame + shift)
    }

    /// Place of a parameter in the default order of preference: smaller is kept rather.
    ///
    /// Links first (joint after joint, gains last), then α₁, d₁, θ₁, then dₙ₊₁, then r₁, θ₀, r₀,
    /// then rₙ, then the rest of the tool: what a controller can easily be told comes before what
    /// merely places the robot or its tool.
    pub fn preference(&self, parameter: usize) -> (u8, usize) {
        use ParameterKind::{Alpha, Beta, Custom, Gain, LengthX, LengthZ, Model, Small, Theta};
        let n = self.frames.len() - 2;
        let (kind, frame) = self.khalil_frame(parameter);
        let within = match kind {
            Alpha => 0,
            LengthX => 1,
            Theta => 2,
            Beta => 3,
            LengthZ => 4,
            Gain => 5,
            Small(k) => usize::from(k),
            Custom | Model => 7,
        };
        match (kind, frame) {
            // A gain's column follows θ's where a joint hardly moves: after all links.
            (Gain, _) => (1, frame),
            // What a joint does beside turning follows what its frame does: after all of these.
            (Model, _) => (1, self.frames.len() + parameter),
            (_, f) if f > n + 1 => (7, within),
            (LengthX, f) if f == n + 1 => (3, 0),
            (LengthZ, f) if f == n + 1 => (6, 0),
            (Alpha, f) if f == n + 1 => (6, 1),
            (Theta, f) if f == n + 1 => (6, 2),
            (_, f) if f == n + 1 => (6, 3),
            (LengthZ, f) if f == n && n > 1 => (5, 0),
            (LengthZ, 1) => (4, 0),
            (Theta, 0) => (4, 1),
            (_, 0) => (4, 2),
            (_, 1) => (2, within),
            _ => (0, frame * 8 + within),
        }
    }

    /// Where the axis of joint 1 is nominally that of the reference frame (α₁ = d₁ = β₁ = 0): the
    /// pairs θ₀, θ₁ and r₀, r₁, each of which does what the other does. Empty elsewhere.
    pub fn aligned_with_base(&self) -> Vec<(usize, usize)> {
        use ParameterKind::{Alpha, Beta, LengthX, LengthZ, Theta};
        let of = |kind: ParameterKind, frame: usize| {
            (0..self.parameters.len()).find(|k| self.khalil_frame(*k) == (kind, frame))
        };
        let zero = |kind| of(kind, 1).is_none_or(|k| self.parameters[k].nominal.abs() < 1e-9);
        if ![Alpha, LengthX, Beta].into_iter().all(zero) {
            return Vec::new();
        }
        let pair = |kind| of(kind, 0).zip(of(kind, 1));
        [Theta, LengthZ].into_iter().filter_map(pair).collect()
    }

    /// All parameters in the default order of preference, those kept first first.
    pub fn default_preference(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.parameters.len()).collect();
        order.sort_by_key(|parameter| self.preference(*parameter));
        order
    }

    /// The robot's file with other parameter values: everything else stays as it was read.
    pub fn with_parameters(&self, values: &[f64]) -> RobotFile {
        let mut file = self.file.clone();
        let n = file.joints.len();
        for (number, frame) in self.frames.iter().enumerate() {
            let own = &values[frame.own_parameters()];
            if let Some((_, custom)) = file.custom.iter_mut().find(|(k, _)| *k == number) {
                custom.values.copy_from_slice(own);
            } else {
                let row = match number {
                    0 => &mut file.base,
                    k if k == n + 1 => &mut file.tool,
                    k => &mut file.joints[k - 1].frame,
                };
                for (k, value) in frame.own_parameters().zip(own) {
                    let kk = frame.convention() != Some(Convention::DenavitHartenberg);
                    if let Some(key) = key_of(self.parameters[k].kind, kk) {
                        *row.get_mut(key) = *value;
                    }
                }
            }
            let (Some(motion), Some(joint)) =
                (&frame.motion, file.joints.get_mut(number.wrapping_sub(1)))
            else {
                continue;
            };
            if let Some(gain) = motion.gain {
                joint.gain = Some(values[gain]);
            }
            for (term, model) in motion.terms.iter().zip(&mut joint.models) {
                model
                    .values
                    .copy_from_slice(&values[term.parameters.clone()]);
            }
        }
        file
    }
}

/// The key of a frame's parameter in its table.
fn key_of(kind: ParameterKind, kk: bool) -> Option<Key> {
    Some(match kind {
        ParameterKind::Alpha => Key::Alpha,
        ParameterKind::Theta => Key::Theta,
        ParameterKind::Beta => Key::Beta,
        ParameterKind::LengthX if kk => Key::D,
        ParameterKind::LengthX => Key::A,
        ParameterKind::LengthZ if kk => Key::R,
        ParameterKind::LengthZ => Key::D,
        ParameterKind::Small(k) => Key::SMALL[usize::from(k)],
        ParameterKind::Gain | ParameterKind::Custom | ParameterKind::Model => return None,
    })
}
