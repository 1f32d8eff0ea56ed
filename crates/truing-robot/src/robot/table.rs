//! Robots as tables: a chain of frames from the base to the tool, with the models of its joints.

use super::frame_row::{Convention, FrameRow};
use super::joint_kind::JointKind;
use super::models::{CustomFrame, ModelRow};
use std::path::PathBuf;

/// Which reading moves a joint.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Reading {
    /// Its own.
    #[default]
    Own,
    /// That of another joint, by name.
    Of(String),
    /// None: other joints move it by their couplings.
    None,
}

/// A mass that gravity pulls at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mass {
    /// The mass \[kg\].
    pub mass: f64,
    /// Where its centre is, in the frame that it moves with \[m\].
    pub center: [f64; 3],
}

/// A joint with its frame.
#[derive(Debug, Clone, PartialEq)]
pub struct JointRow {
    /// The name, also of the joint's column in the data.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// Its frame, relative to the one before.
    pub frame: FrameRow,
    /// The factor on the joint's reading, not 0; none where the reading counts as it is.
    pub gain: Option<f64>,
    /// The lower and the upper limit of the reading \[rad\] or \[m\].
    pub limits: Option<[f64; 2]>,
    /// The reading where the data have no column for the joint \[rad\] or \[m\].
    pub value: Option<f64>,
    /// Which reading moves it.
    pub reading: Reading,
    /// What else moves it.
    pub models: Vec<ModelRow>,
    /// The mass that moves with it.
    pub mass: Option<Mass>,
}

impl JointRow {
    /// A joint with the usual model, at a frame.
    pub fn new(name: impl Into<String>, kind: JointKind, frame: FrameRow) -> Self {
        Self {
            name: name.into(),
            kind,
            frame,
            gain: (kind != JointKind::Fixed).then_some(1.0),
            limits: None,
            value: None,
            reading: Reading::Own,
            models: Vec::new(),
            mass: None,
        }
    }
}

/// A further column of the data that joints are a function of.
#[derive(Debug, Clone, PartialEq)]
pub struct InputRow {
    /// Its name.
    pub name: String,
    /// Between which values it is drawn in simulations; −1 and 1 by default.
    pub range: Option<[f64; 2]>,
    /// Its value where the data have no such column.
    pub value: Option<f64>,
}

/// A robot: the frames from its base to its tool, in metres and radians.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotFile {
    /// The file it came from.
    pub path: PathBuf,
    /// The name of the robot; the file's, if it gives none.
    pub name: String,
    /// What the parameters of a frame mean.
    pub convention: Convention,
    /// Frame 0.
    pub base: FrameRow,
    /// Frames 1 to n.
    pub joints: Vec<JointRow>,
    /// Frame n + 1.
    pub tool: FrameRow,
    /// The mass of the tool.
    pub tool_mass: Option<Mass>,
    /// Frames of models from outside, by number.
    pub custom: Vec<(usize, CustomFrame)>,
    /// Further columns of the data of which something is said.
    pub inputs: Vec<InputRow>,
    /// The acceleration of gravity in the reference frame \[m/s²\].
    pub gravity: [f64; 3],
}

/// Gravity where the reference frame stands upright \[m/s²\].
pub const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];

impl RobotFile {
    /// A robot without joints yet, in a convention: for tables made in programs.
    #[must_use]
    pub fn new(name: impl Into<String>, convention: Convention) -> Self {
        Self {
            path: PathBuf::new(),
            name: name.into(),
            convention,
            base: FrameRow::default(),
            joints: Vec::new(),
            tool: FrameRow::default(),
            tool_mass: None,
            custom: Vec::new(),
            inputs: Vec::new(),
            gravity: GRAVITY,
        }
    }

    /// The number of joints that move.
    #[must_use]
    pub fn moving_joints(&self) -> usize {
        let moving = |joint: &&JointRow| joint.kind != JointKind::Fixed;
        self.joints.iter().filter(moving).count()
    }
}
