//! Kinds of measurement: all that the rest of the crate needs to know about one.

use super::at::At;
use super::draw::Draw;
use super::equations::Equations;
use super::measurand::Measurand;
use super::places::Places;
use crate::error::Error;
use crate::text::{Dimension, InputError, Section, Units};
use crate::unknown::{Unknown, Value};
use std::any::Any;
use std::fmt;
use std::sync::Arc;
use truing::manifold::{Plane, Pose};

/// A column of the data that a kind reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DataColumn {
    /// Its name.
    pub name: &'static str,
    /// What its numbers are.
    pub dimension: Dimension,
}

impl DataColumn {
    /// A column of lengths \[m\].
    pub const fn length(name: &'static str) -> Self {
        Self {
            name,
            dimension: Dimension::Length,
        }
    }

    /// A column of angles \[rad\].
    pub const fn angle(name: &'static str) -> Self {
        Self {
            name,
            dimension: Dimension::Angle,
        }
    }

    /// A column of plain numbers.
    pub const fn number(name: &'static str) -> Self {
        Self {
            name,
            dimension: Dimension::None,
        }
    }
}

/// How rows of a kind are grouped: all rows of a group share its unknowns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Grouping {
    /// What a group is, and the column of the data that tells one from another by default: `plane`.
    pub group: &'static str,
    /// What a row is, one and several: `["touch", "touches"]`.
    pub rows: [&'static str; 2],
    /// Groups of fewer rows say nothing, for they fit any robot.
    pub least: usize,
    /// Whether all rows are one group where the data have no such column.
    pub alone: bool,
    /// How many groups stand for the kind where one asks what it would identify.
    pub asked: usize,
    /// Whether each group more is a step of its own in what measurements identify.
    pub steps: bool,
}

/// Which targets a kind names with `target`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TargetKind {
    /// A point on the tool: three unknowns.
    Point,
    /// A body on the tool, with its orientation: six unknowns.
    Body,
}

/// What a sensor read of a tool in its own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Seen {
    /// The position of the tool point \[m\].
    Position(truing::nalgebra::Vector3<f64>),
    /// The pose of the body on the tool.
    Pose(Pose<f64>),
}

/// A plane that the rows of a kind touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Touched {
    /// It is known.
    Known(Plane<f64>),
    /// It is this unknown, of type [`Plane3`](truing::manifold::Plane3).
    Unknown(&'static str),
}

/// Where the unknowns of a simulated set truly are: drawn within reach, or given.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The kind with the constants that its table gave; none for the kind as it is.
    pub kind: Option<Arc<dyn Kind>>,
    /// The groups.
    pub groups: SceneGroups,
}

/// The groups of a simulated set.
#[derive(Debug, Clone)]
pub enum SceneGroups {
    /// So many, with unknowns drawn by [`Kind::place`].
    Drawn(usize),
    /// These, each with the values of its unknowns.
    Given(Vec<Vec<Value>>),
}

impl Scene {
    /// Groups whose unknowns are drawn.
    pub fn drawn(groups: usize) -> Self {
        Self {
            kind: None,
            groups: SceneGroups::Drawn(groups),
        }
    }

    /// Groups whose unknowns are given.
    pub fn given(values: Vec<Vec<Value>>) -> Self {
        Self {
            kind: None,
            groups: SceneGroups::Given(values),
        }
    }

    /// The same, of a kind with other constants.
    #[must_use]
    pub fn of(mut self, kind: impl Kind) -> Self {
        self.kind = Some(Arc::new(kind));
        self
    }
}

/// What a group's unknowns truly are, and the kind if its constants were drawn too.
#[derive(Default)]
pub struct Placed {
    /// The kind with the constants that were drawn; none for the kind as it is.
    pub kind: Option<Arc<dyn Kind>>,
    /// Values of the unknowns.
    pub values: Vec<Value>,
}

impl From<Vec<Value>> for Placed {
    fn from(values: Vec<Value>) -> Self {
        Self { kind: None, values }
    }
}

/// A kind of measurement: everything that the rest of the crate needs to know about it.
///
/// A value of the type is a kind with its constants, such as the plane that is touched; what was
/// read stands in [`Readings`](super::Readings). The kinds in [`kinds`](crate::kinds) use nothing that one from
/// outside could not. A kind is handed to files by name through
/// [`Plugin::kinds`](crate::Plugin::kinds), and to sets in memory as it is.
///
/// Only a name, the measurands and the equations are required: what was not written is answered as for
/// a kind without unknowns, keys and groups.
pub trait Kind: Any + fmt::Debug + Send + Sync {
    /// Its name in files and reports.
    fn name(&self) -> &'static str;

    /// What is measured: the rows of the residual, with units and usual noise.
    fn measurands(&self) -> &'static [Measurand];

    /// Adds the equations of a set to the problem, as one block.
    ///
    /// # Errors
    /// If a standard deviation is not positive and finite.
    fn equations(&self, on: &mut Equations<'_>) -> Result<(), Error>;

    /// The columns of the data that it reads.
    fn columns(&self) -> &'static [DataColumn] {
        &[]
    }

    /// Checks what was read in a row, and brings it to the form that equations expect; whether it changed
    /// anything worth a note.
    ///
    /// # Errors
    /// What is wrong with the row, and what to do.
    fn check_row(&self, _row: &mut [f64]) -> Result<bool, (String, String)> {
        Ok(false)
    }

    /// What to say of rows that [`check_row`](Self::check_row) changed.
    fn changed(&self) -> &'static str {
        "rows were corrected"
    }

    /// How its rows are grouped; none for rows without groups.
    fn grouping(&self) -> Option<Grouping> {
        None
    }

    /// How many tools measure together: one, or two.
    fn tools(&self) -> usize {
        1
    }

    /// What `target` names.
    fn targets(&self) -> TargetKind {
        TargetKind::Point
    }

    /// Whether a sensor with a frame of its own may have read it.
    fn has_frame(&self) -> bool {
        false
    }

    /// The keys of its own in calibration files.
    fn keys(&self) -> &'static [&'static str] {
        &[]
    }

    /// Reads its keys in a calibration file; none where it stays as it is.
    ///
    /// # Errors
    /// What is wrong with a key, at its place.
    fn read(
        &self,
        _table: &mut Section<'_>,
        _units: &Units,
    ) -> Result<Option<Arc<dyn Kind>>, InputError> {
        Ok(None)
    }

    /// Its keys and their values as a calibration file has them.
    fn written(&self) -> Vec<(&'static str, String)> {
        Vec::new()
    }

    /// The unknowns of each group.
    fn unknowns(&self) -> Vec<Unknown> {
        Vec::new()
    }

    /// Starting values of a group's unknowns, in their order, with the robot as it is.
    fn start(&self, _at: &At<'_>, _group: usize) -> Vec<Value> {
        Vec::new()
    }

    /// What a sensor saw of the tool in a row, from which its frame and the target are registered.
    fn seen(&self, _row: &[f64]) -> Option<Seen> {
        None
    }

    /// The plane that rows touch, if they do.
    fn touched(&self) -> Option<Touched> {
        None
    }

    /// The same kind with constants that the robot as it is can reach; none if there is nothing to move
    /// or it is too far off. What is identifiable depends on the direction of a plane, say, not on its place.
    fn within_reach(&self, _at: &At<'_>) -> Option<Arc<dyn Kind>> {
        None
    }

    /// The keys of its own in simulation files.
    fn scene_keys(&self) -> &'static [&'static str] {
        &[]
    }

    /// Reads its keys in a simulation file.
    ///
    /// # Errors
    /// What is wrong with a key, at its place.
    fn scene(&self, _table: &mut Section<'_>) -> Result<Scene, InputError> {
        Ok(Scene::drawn(1))
    }

    /// Draws what a group's unknowns truly are, within reach of the robot.
    fn place(&self, _places: &mut Places<'_>) -> Placed {
        Placed::default()
    }

    /// Draws a measurement: puts the tools somewhere, and returns what is read there, in its columns.
    ///
    /// # Errors
    /// If what is to be reached is out of reach.
    fn draw(&self, draw: &mut Draw<'_>) -> Result<Vec<f64>, Error>;
}

impl dyn Kind {
    /// The kind as its own type, if it is of that.
    pub fn downcast<K: Kind>(&self) -> Option<&K> {
        (self as &dyn Any).downcast_ref()
    }

    /// Whether its measurements have a rotation.
    pub fn has_rotation(&self) -> bool {
        self.measurands().len() > 1
    }
}
