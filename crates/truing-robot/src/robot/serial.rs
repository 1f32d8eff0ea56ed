//! Robots: frames, joints and their named parameters.

use super::frame::{
    DenavitHartenberg, FIXED, FrameModel, KhalilKleinfinger, KhalilKleinfingerBase, LocalFrame,
    PRISMATIC, REVOLUTE, differentiate,
};
use super::frame_row::{Convention, FrameRow};
use super::table::{JointKind, JointRow, RobotFile};
use std::ops::Range;
use truing::Scalar;
use truing::manifold::Pose;

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
}

/// Unit of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Radians.
    Radian,
    /// Metres.
    Meter,
    /// A ratio.
    One,
}

impl Unit {
    /// `rad`, `m` or `1`.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Radian => "rad",
            Self::Meter => "m",
            Self::One => "1",
        }
    }
}

/// One geometric parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Name, e.g. `theta3`.
    pub name: String,
    /// What it is.
    pub kind: ParameterKind,
    /// Number of its frame: 0 is the base, 1 … n the joints, n + 1 the tool.
    pub frame: usize,
    /// Nominal value [m or rad].
    pub nominal: f64,
}

impl Parameter {
    /// Its unit.
    pub fn unit(&self) -> Unit {
        match self.kind {
            ParameterKind::Alpha | ParameterKind::Theta | ParameterKind::Beta => Unit::Radian,
            ParameterKind::LengthX | ParameterKind::LengthZ => Unit::Meter,
            ParameterKind::Gain => Unit::One,
        }
    }
}

/// One moving joint.
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
    /// Number of the parameter its value adds to (θ, or r if it slides).
    pub offset_parameter: usize,
    /// Number of its gain.
    pub gain_parameter: usize,
}

type Differentiate = fn(&[f64], f64, &mut LocalFrame);

/// One frame of the chain.
#[derive(Debug, Clone)]
pub struct Frame {
    /// Its parameters in the robot's vector.
    pub parameters: Range<usize>,
    /// Number of the moving joint that moves it.
    pub joint: Option<usize>,
    model: Model,
}

/// Which frame function a frame is, resolved to a match and not a pointer so that forward
/// kinematics stay generic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Model {
    convention: Convention,
    base: bool,
    beta: bool,
    joint: JointKind,
}

macro_rules! dispatch {
    ($model:expr, $visit:ident) => {
        match ($model.convention, $model.beta, $model.joint) {
            _ if $model.base => $visit!(KhalilKleinfingerBase, 2),
            (Convention::KhalilKleinfinger, false, JointKind::Fixed) => $visit!(KhalilKleinfinger<false, FIXED>, 4),
            (Convention::KhalilKleinfinger, false, JointKind::Revolute) => $visit!(KhalilKleinfinger<false, REVOLUTE>, 5),
            (Convention::KhalilKleinfinger, false, JointKind::Prismatic) => $visit!(KhalilKleinfinger<false, PRISMATIC>, 5),
            (Convention::KhalilKleinfinger, true, JointKind::Fixed) => $visit!(KhalilKleinfinger<true, FIXED>, 5),
            (Convention::KhalilKleinfinger, true, JointKind::Revolute) => $visit!(KhalilKleinfinger<true, REVOLUTE>, 6),
            (Convention::KhalilKleinfinger, true, JointKind::Prismatic) => $visit!(KhalilKleinfinger<true, PRISMATIC>, 6),
            (Convention::DenavitHartenberg, false, JointKind::Fixed) => $visit!(DenavitHartenberg<false, FIXED>, 4),
            (Convention::DenavitHartenberg, false, JointKind::Revolute) => $visit!(DenavitHartenberg<false, REVOLUTE>, 5),
            (Convention::DenavitHartenberg, false, JointKind::Prismatic) => $visit!(DenavitHartenberg<false, PRISMATIC>, 5),
            (Convention::DenavitHartenberg, true, JointKind::Fixed) => $visit!(DenavitHartenberg<true, FIXED>, 5),
            (Convention::DenavitHartenberg, true, JointKind::Revolute) => $visit!(DenavitHartenberg<true, REVOLUTE>, 6),
            (Convention::DenavitHartenberg, true, JointKind::Prismatic) => $visit!(DenavitHartenberg<true, PRISMATIC>, 6),
        }
    };
}

impl Frame {
    /// parent_from_frame, from the frame's own parameters and its joint value.
    #[inline]
    pub fn transform<T: Scalar>(&self, p: &[T], q: f64) -> Pose<T> {
        macro_rules! visit {
            ($M:ty, $W:literal) => {
                <$M as FrameModel>::transform(p, q)
            };
        }
        dispatch!(self.model, visit)
    }

    #[inline]
    pub(crate) fn differentiate(&self, p: &[f64], q: f64, out: &mut LocalFrame) {
        macro_rules! visit {
            ($M:ty, $W:literal) => {
                differentiate::<$M, $W> as Differentiate
            };
        }
        let f = dispatch!(self.model, visit);
        f(p, q, out);
    }

    /// Number of its parameter of a kind, in the robot's vector.
    fn position(&self, kind: ParameterKind) -> Option<usize> {
        self.model
            .kinds()
            .iter()
            .position(|k| *k == kind)
            .map(|k| self.parameters.start + k)
    }
}

impl Model {
    /// The kinds of its parameters, in the order of its function.
    fn kinds(self) -> Vec<ParameterKind> {
        use ParameterKind::{Alpha, Beta, Gain, LengthX, LengthZ, Theta};
        if self.base {
            return vec![Theta, LengthZ];
        }
        let mut kinds = match self.convention {
            Convention::KhalilKleinfinger => vec![Alpha, LengthX, Theta, LengthZ],
            Convention::DenavitHartenberg => vec![Theta, LengthZ, LengthX, Alpha],
        };
        if self.beta {
            kinds.push(Beta);
        }
        if self.joint != JointKind::Fixed {
            kinds.push(Gain);
        }
        kinds
    }
}

/// A serial robot: base, joints, tool, and its named parameters with nominal values.
///
/// Frame j − 1 from frame j is one [`Convention`] transform; the chain is
/// base_from_tool = T₀ · T₁(q₁) ⋯ Tₙ(qₙ) · Tₙ₊₁. The parameter vector holds everything that `"all"`
/// means: four parameters a frame (frame 0 of Khalil–Kleinfinger has θ and r only), β where the axis
/// is nominally parallel to the one before, and the gain K of every moving joint.
#[derive(Debug, Clone)]
pub struct Robot {
    name: String,
    convention: Convention,
    frames: Vec<Frame>,
    joints: Vec<Joint>,
    parameters: Vec<Parameter>,
    file: RobotFile,
}

/// Axes closer to parallel than this \[rad\] get the extra angle β.
const PARALLEL: f64 = 0.02;

impl Robot {
    /// The robot that a file describes.
    pub fn new(file: &RobotFile) -> Self {
        let mut robot = Self {
            name: file.name.clone(),
            convention: file.convention,
            frames: Vec::new(),
            joints: Vec::new(),
            parameters: Vec::new(),
            file: file.clone(),
        };
        let n = file.joints.len();
        robot.push_frame(0, n, &file.base, None);
        for (j, row) in file.joints.iter().enumerate() {
            robot.push_frame(j + 1, n, &row.frame, Some(row));
        }
        robot.push_frame(n + 1, n, &file.tool, None);
        robot
    }

    fn push_frame(&mut self, number: usize, n: usize, row: &FrameRow, joint: Option<&JointRow>) {
        let kk = self.convention == Convention::KhalilKleinfinger;
        let joint_kind = joint.map_or(JointKind::Fixed, |row| row.kind);
        let base = kk && number == 0;
        let parallel = row.alpha.sin().abs() < PARALLEL && row.beta.sin().abs() < PARALLEL;
        let model = Model {
            convention: self.convention,
            base,
            beta: !base && (parallel || row.beta != 0.0),
            joint: joint_kind,
        };
        let start = self.parameters.len();
        for kind in model.kinds() {
            let nominal = match kind {
                ParameterKind::Alpha => row.alpha,
                ParameterKind::Theta => row.theta,
                ParameterKind::Beta => row.beta,
                ParameterKind::Gain => joint.map_or(1.0, |row| row.gain),
                ParameterKind::LengthX => {
                    if kk {
                        row.d
                    } else {
                        row.a
                    }
                }
                ParameterKind::LengthZ => {
                    if kk {
                        row.r
                    } else {
                        row.d
                    }
                }
            };
            let letter = match kind {
                ParameterKind::Alpha => "alpha",
                ParameterKind::Theta => "theta",
                ParameterKind::Beta => "beta",
                ParameterKind::Gain => "K",
                ParameterKind::LengthX => {
                    if kk {
                        "d"
                    } else {
                        "a"
                    }
                }
                ParameterKind::LengthZ => {
                    if kk {
                        "r"
                    } else {
                        "d"
                    }
                }
            };
            let name = match number {
                0 if !kk => format!("base_{letter}"),
                _ if !kk && number == n + 1 => format!("tool_{letter}"),
                _ => format!("{letter}{number}"),
            };
            self.parameters.push(Parameter {
                name,
                kind,
                frame: number,
                nominal,
            });
        }
        let mut frame = Frame {
            parameters: start..self.parameters.len(),
            joint: None,
            model,
        };
        if let Some(row) = joint.filter(|_| joint_kind != JointKind::Fixed) {
            let kind = if joint_kind == JointKind::Revolute {
                ParameterKind::Theta
            } else {
                ParameterKind::LengthZ
            };
            if let (Some(offset), Some(gain)) =
                (frame.position(kind), frame.position(ParameterKind::Gain))
            {
                frame.joint = Some(self.joints.len());
                self.joints.push(Joint {
                    name: row.name.clone(),
                    kind: joint_kind,
                    limits: row.limits,
                    value: row.value,
                    offset_parameter: offset,
                    gain_parameter: gain,
                });
            }
        }
        self.frames.push(frame);
    }

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

    /// The moving joints, in order.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
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

    /// base_from_tool at the joint values `q`, over any scalar.
    pub fn forward<T: Scalar>(&self, parameters: &[T], q: &[f64]) -> Pose<T> {
        let mut pose: Option<Pose<T>> = None;
        for frame in &self.frames {
            let local = frame.transform(
                &parameters[frame.parameters.clone()],
                frame.joint.map_or(0.0, |j| q[j]),
            );
            pose = Some(match pose {
                None => local,
                Some(pose) => pose.compose(&local),
            });
        }
        pose.unwrap_or_else(Pose::identity)
    }

    /// The six parameters that place the robot in its reference frame (θ₀, r₀, α₁, d₁, θ₁, r₁, and
    /// β₁ where it has one), under this convention's names.
    pub fn base_parameters(&self) -> Vec<usize> {
        (0..self.parameters.len())
            .filter(|k| {
                self.khalil_frame(*k).1 <= 1 && self.parameters[*k].kind != ParameterKind::Gain
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
        let shift = usize::from(self.convention == Convention::DenavitHartenberg && before);
        (p.kind, p.frame + shift)
    }

    /// Place of a parameter in the default order of preference: smaller is kept rather.
    ///
    /// Links first (joint after joint, gains last), then α₁, d₁, θ₁, then dₙ₊₁, then r₁, θ₀, r₀,
    /// then rₙ, then the rest of the tool: what a controller can easily be told comes before what
    /// merely places the robot or its tool.
    pub fn preference(&self, parameter: usize) -> (u8, usize) {
        use ParameterKind::{Alpha, Beta, Gain, LengthX, LengthZ, Theta};
        let n = self.frames.len() - 2;
        let (kind, frame) = self.khalil_frame(parameter);
        let within = match kind {
            Alpha => 0,
            LengthX => 1,
            Theta => 2,
            Beta => 3,
            LengthZ => 4,
            Gain => 5,
        };
        match (kind, frame) {
            // A gain's column follows θ's where a joint hardly moves: after all links.
            (Gain, _) => (1, frame),
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
        let kk = self.convention == Convention::KhalilKleinfinger;
        let mut file = self.file.clone();
        let n = file.joints.len();
        for (parameter, value) in self.parameters.iter().zip(values) {
            let mut gain = 1.0;
            let (row, gain) = match parameter.frame {
                0 => (&mut file.base, &mut gain),
                f if f == n + 1 => (&mut file.tool, &mut gain),
                f => {
                    let joint = &mut file.joints[f - 1];
                    (&mut joint.frame, &mut joint.gain)
                }
            };
            match parameter.kind {
                ParameterKind::Alpha => row.alpha = *value,
                ParameterKind::Theta => row.theta = *value,
                ParameterKind::Beta => row.beta = *value,
                ParameterKind::LengthX if kk => row.d = *value,
                ParameterKind::LengthX => row.a = *value,
                ParameterKind::LengthZ if kk => row.r = *value,
                ParameterKind::LengthZ => row.d = *value,
                ParameterKind::Gain => *gain = *value,
            }
        }
        file
    }
}
