//! What calibration files can name: the built-in kinds, and what plugins add.

use crate::measurement::kinds;
use crate::measurement::{Kind, Method};
use crate::robot::{DifferentiateChain, Models, NamedFrameModel, NamedJointModel};
use crate::text::loss::NamedLoss;
use std::sync::Arc;

/// What else files may name than this crate has.
///
/// Everything in it is optional; several plugins live together, and what comes first is found first.
pub trait Plugin: Send + Sync {
    /// Kinds of measurement: `kind = "…"`.
    fn kinds(&self) -> Vec<Arc<dyn Kind>> {
        Vec::new()
    }

    /// Other equations for kinds of measurement: `method = "…"`.
    fn methods(&self) -> Vec<Arc<dyn Method>> {
        Vec::new()
    }

    /// Models of joints in robot files: `model = ["gain", "…"]`.
    fn joint_models(&self) -> Vec<NamedJointModel> {
        Vec::new()
    }

    /// Models of frames in robot files: `convention = "…"` in the table of a joint.
    fn frame_models(&self) -> Vec<NamedFrameModel> {
        Vec::new()
    }

    /// Closed-form columns of the regressor: `jacobian = "analytic"`.
    fn analytic(&self) -> Option<Arc<dyn DifferentiateChain>> {
        None
    }

    /// Robust losses: `loss = "…"`.
    fn losses(&self) -> Vec<NamedLoss> {
        Vec::new()
    }
}

/// What files can name, looked up by name.
#[derive(Clone)]
pub struct Registry {
    kinds: Vec<Arc<dyn Kind>>,
    methods: Vec<Arc<dyn Method>>,
    analytic: Option<Arc<dyn DifferentiateChain>>,
    losses: Vec<NamedLoss>,
    models: Models,
}

impl Default for Registry {
    /// What this crate has itself.
    fn default() -> Self {
        Self {
            kinds: kinds::built_in(),
            methods: Vec::new(),
            analytic: None,
            losses: Vec::new(),
            models: Models::default(),
        }
    }
}

impl Registry {
    /// What this crate has, and what plugins add to it.
    pub fn with(plugins: &[&dyn Plugin]) -> Self {
        let mut registry = Self::default();
        for plugin in plugins {
            registry.kinds.extend(plugin.kinds());
            registry.methods.extend(plugin.methods());
            registry.analytic = registry.analytic.or_else(|| plugin.analytic());
            registry.losses.extend(plugin.losses());
            registry.models.joints.extend(plugin.joint_models());
            registry.models.frames.extend(plugin.frame_models());
        }
        registry
    }

    /// All kinds, the built-in ones first.
    pub fn kinds(&self) -> &[Arc<dyn Kind>] {
        &self.kinds
    }

    /// The kind of a name.
    pub fn kind(&self, name: &str) -> Option<&Arc<dyn Kind>> {
        self.kinds.iter().find(|kind| kind.name() == name)
    }

    /// All methods.
    pub fn methods(&self) -> &[Arc<dyn Method>] {
        &self.methods
    }

    /// The method of a name for a kind.
    pub fn method(&self, name: &str, kind: &str) -> Option<&Arc<dyn Method>> {
        let mut methods = self.methods.iter();
        methods.find(|method| method.name() == name && method.kinds().contains(&kind))
    }

    /// Closed-form columns of the regressor, if a plugin has them.
    pub fn analytic(&self) -> Option<&Arc<dyn DifferentiateChain>> {
        self.analytic.as_ref()
    }

    /// Models of joints and frames.
    pub fn models(&self) -> &Models {
        &self.models
    }

    /// Losses beside the framework's own.
    pub fn losses(&self) -> &[NamedLoss] {
        &self.losses
    }
}
