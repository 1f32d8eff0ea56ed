//! Results, in the shape of `result.json`.

use crate::doubt::Doubt;
use crate::identify::Status;
use crate::judge::{Correlated, GlobalTest, Outlier, SetResult, ToolEverywhere, ToolUncertainty};
use serde::Serialize;

/// One parameter of a robot.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterResult {
    /// Name, with the robot's prefix if there are several.
    pub name: String,
    /// `rad`, `m` or `1`.
    pub unit: &'static str,
    /// Nominal value.
    pub nominal: f64,
    /// Estimate; the nominal value where it is not estimated.
    pub estimate: f64,
    /// Standard deviation of the estimate, scaled by σ₀; none where it is not estimated.
    pub sigma: Option<f64>,
    /// What became of it.
    pub status: Status,
    /// For a regrouped parameter: which take over, with which coefficients.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub into: Option<Vec<(String, f64)>>,
    /// For a bounded parameter that ended at a bound.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_bound: Option<&'static str>,
    /// For one at a bound, its multiplier \[1/rad, 1/m or 1\]: by how much the cost would fall if the
    /// bound rose by one unit. Positive at an upper bound, negative at a lower one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub multiplier: Option<f64>,
}

/// An estimated sensor frame: its pose in the reference frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrameEstimate {
    /// Name.
    pub name: String,
    /// Position \[m\].
    pub position: [f64; 3],
    /// Unit quaternion (w, x, y, z).
    pub quaternion: [f64; 4],
    /// Standard deviations: x, y, z \[m\], rotation about the frame's own x, y, z \[rad\].
    pub sigma: Option<Vec<f64>>,
}

/// An estimated tool point or body on the tool, in the tool frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetEstimate {
    /// Name.
    pub name: String,
    /// Its robot; empty if there is only one.
    pub robot: String,
    /// Position \[m\].
    pub position: [f64; 3],
    /// Unit quaternion (w, x, y, z) of a body; none for a tool point.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quaternion: Option<[f64; 4]>,
    /// Standard deviations: x, y, z \[m\], and for a body rotation about its own x, y, z \[rad\].
    pub sigma: Option<Vec<f64>>,
}

/// An estimated plane.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlaneEstimate {
    /// Its set of measurements.
    pub constraint: String,
    /// Its group.
    pub group: String,
    /// Number of touches.
    pub count: usize,
    /// Unit normal.
    pub normal: [f64; 3],
    /// Distance from the origin along the normal \[m\].
    pub distance: f64,
    /// RMS distance of its touches \[m\].
    pub rms: f64,
}

/// An estimated point.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PointEstimate {
    /// Its set of measurements.
    pub constraint: String,
    /// Its group.
    pub group: String,
    /// Number of measurements.
    pub count: usize,
    /// Position in the reference frame \[m\].
    pub position: [f64; 3],
    /// RMS error of its measurements \[m\].
    pub rms: f64,
}

/// An estimated location: a position with an orientation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LocationEstimate {
    /// Its set of measurements.
    pub constraint: String,
    /// Its group.
    pub group: String,
    /// Number of visits.
    pub count: usize,
    /// Position in the reference frame \[m\].
    pub position: [f64; 3],
    /// Unit quaternion (w, x, y, z).
    pub quaternion: [f64; 4],
    /// RMS distance of its visits \[m\].
    pub rms: f64,
}

/// How the solver ended.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TerminationReport {
    /// Short name.
    pub kind: String,
    /// Whether it converged.
    pub converged: bool,
    /// In words, with the numbers.
    pub message: String,
}

/// An unknown that a set of measurements brought.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UnknownEstimate {
    /// Its set of measurements.
    pub constraint: String,
    /// Its group; empty where rows have no groups.
    pub group: String,
    /// Its name in the kind.
    pub name: String,
    /// Its components.
    pub components: Vec<ComponentEstimate>,
}

/// A component of an unknown.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ComponentEstimate {
    /// Its full name.
    pub name: String,
    /// Its unit.
    pub unit: &'static str,
    /// The estimate; none for components of a plane or pose, whose place stands in the lists of these.
    pub estimate: Option<f64>,
    /// Standard deviation.
    pub sigma: Option<f64>,
    /// What became of it.
    pub status: Status,
}

/// Everything a calibration found out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CalibrationResult {
    /// How the solver ended.
    pub termination: TerminationReport,
    /// Whether the result may be used.
    pub trusted: bool,
    /// What to know before using it, in words.
    pub warnings: Vec<String>,
    /// The same as data, in the same order.
    pub doubts: Vec<Doubt>,
    /// Trial steps of the solver.
    pub iterations: u64,
    /// Cost ½Σρ at the start.
    pub initial_cost: f64,
    /// Cost at the end.
    pub cost: f64,
    /// a-posteriori standard deviation of unit weight.
    pub sigma0: Option<f64>,
    /// Sets that were used.
    pub constraints: Vec<SetResult>,
    /// Rows that were held out, and sets that only validate.
    pub validation: Vec<SetResult>,
    /// How far links and tool are off from their drawing, as a part of the robot's dimensions: so near nominal they were
    /// held. None where nothing was.
    pub drawing: Option<f64>,
    /// Every parameter of every robot.
    pub parameters: Vec<ParameterResult>,
    /// Sensor frames.
    pub frames: Vec<FrameEstimate>,
    /// Tool points.
    pub targets: Vec<TargetEstimate>,
    /// Planes.
    pub planes: Vec<PlaneEstimate>,
    /// Points.
    pub points: Vec<PointEstimate>,
    /// Locations.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub locations: Vec<LocationEstimate>,
    /// Estimated distances, as (constraint, metres).
    pub distances: Vec<(String, f64)>,
    /// Everything that sets of measurements brought and that is estimated, with standard deviations.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unknowns: Vec<UnknownEstimate>,
    /// Estimated degrees of freedom of robots, sensor frames, tool points and instruments
    /// together.
    pub identifiable: usize,
    /// Condition number of the Jacobian over everything estimated, columns scaled to unit length.
    pub condition: Option<f64>,
    /// Whether the residuals are as large as the stated noise makes them; none where unknowns cannot be
    /// told apart.
    pub statistics: Option<GlobalTest>,
    /// Pairs of unknowns with a correlation beyond ±0.9, the strongest first.
    pub correlations: Vec<Correlated>,
    /// Measurements that do not fit: set aside by robust losses, or farther off than chance explains at
    /// the 5 % level, over all of them together; the worst first.
    pub outliers: Vec<Outlier>,
    /// How well the tools are known.
    pub tools: Vec<ToolUncertainty>,
    /// What the tools are expected to be off all over the ranges of their joints.
    pub everywhere: Vec<ToolEverywhere>,
}

impl CalibrationResult {
    /// A parameter, by its name.
    pub fn parameter(&self, name: &str) -> Option<&ParameterResult> {
        self.parameters.iter().find(|p| p.name == name)
    }

    /// A set that was used, by its name.
    pub fn constraint(&self, name: &str) -> Option<&SetResult> {
        self.constraints.iter().find(|set| set.name == name)
    }

    /// Rows of a set that were held out, or a set that only validates, by its name.
    pub fn validated(&self, name: &str) -> Option<&SetResult> {
        self.validation.iter().find(|set| set.name == name)
    }

    /// A sensor frame, by its name.
    pub fn frame(&self, name: &str) -> Option<&FrameEstimate> {
        self.frames.iter().find(|frame| frame.name == name)
    }

    /// A component of an unknown that a set brought, by its full name: `tracker.scale`.
    pub fn unknown(&self, name: &str) -> Option<&ComponentEstimate> {
        let mut components = self.unknowns.iter().flat_map(|u| &u.components);
        components.find(|component| component.name == name)
    }
}
