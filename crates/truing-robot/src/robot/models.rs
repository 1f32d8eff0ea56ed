//! Models of joints and frames that robot files can name.

use super::frame::{AnyFrameModel, FrameModel};
use super::joint_model::{AnyJointModel, NamedJointModel, built_in};
use std::fmt;
use std::sync::Arc;

/// A frame model that files can name: `convention = "…"` in the table of a joint.
#[derive(Clone)]
pub struct NamedFrameModel {
    /// Its name.
    pub name: &'static str,
    /// The model.
    pub model: Arc<dyn AnyFrameModel>,
}

impl NamedFrameModel {
    /// A frame model under its name.
    pub fn new(name: &'static str, model: impl FrameModel) -> Self {
        Self {
            name,
            model: Arc::new(model),
        }
    }
}

impl fmt::Debug for NamedFrameModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "NamedFrameModel({})", self.name)
    }
}

/// The models that robot files can name.
#[derive(Debug, Clone)]
pub struct Models {
    /// Of joints, beside `gain`.
    pub joints: Vec<NamedJointModel>,
    /// Of frames, beside the conventions.
    pub frames: Vec<NamedFrameModel>,
}

impl Default for Models {
    /// What this crate has itself.
    fn default() -> Self {
        Self {
            joints: built_in(),
            frames: Vec::new(),
        }
    }
}

/// A joint model in a robot's table.
#[derive(Debug, Clone)]
pub struct ModelRow {
    /// As it is written: `harmonics(2)`.
    pub text: String,
    /// The model.
    pub model: Arc<dyn AnyJointModel>,
    /// The values of its parameters.
    pub values: Vec<f64>,
}

impl PartialEq for ModelRow {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text && self.values == other.values
    }
}

/// A frame of a model from outside in a robot's table.
#[derive(Debug, Clone)]
pub struct CustomFrame {
    /// The name of the model.
    pub name: String,
    /// The model.
    pub model: Arc<dyn AnyFrameModel>,
    /// The values of its parameters.
    pub values: Vec<f64>,
}

impl PartialEq for CustomFrame {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name && self.values == other.values
    }
}
