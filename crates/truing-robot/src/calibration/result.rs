//! Results, in the shape of `result.json`.

use serde::Serialize;

/// Size of a set's errors over its measurements.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ErrorSummary {
    /// Root mean square.
    pub rms: f64,
    /// Mean of the absolute values.
    pub mean: f64,
    /// Largest absolute value.
    pub max: f64,
    /// The same of the rotation errors \[rad\], for poses.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation: Option<Box<ErrorSummary>>,
}

impl ErrorSummary {
    /// Summary of errors; zeros for none.
    pub fn of(errors: &[f64]) -> Self {
        let n = errors.len().max(1) as f64;
        Self {
            rms: (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt(),
            mean: errors.iter().map(|e| e.abs()).sum::<f64>() / n,
            max: errors.iter().fold(0.0, |m, e| m.max(e.abs())),
            rotation: None,
        }
    }

    /// Errors of lengths from residuals, `dim` a measurement: signed distances of one row, Euclidean
    /// lengths of three, and of six the lengths of the first three.
    pub fn lengths(residuals: &[f64], dim: usize) -> Vec<f64> {
        if dim == 1 {
            return residuals.to_vec();
        }
        let length = |r: &[f64]| r[..3.min(dim)].iter().map(|e| e * e).sum::<f64>().sqrt();
        residuals.chunks_exact(dim).map(length).collect()
    }

    /// Summary of residuals, `dim` a measurement: Euclidean lengths of three, signed distances of
    /// one, and of six the first three with the last three as rotation.
    pub fn of_residuals(residuals: &[f64], dim: usize) -> Self {
        let lengths = |first: usize, last: usize| -> Vec<f64> {
            residuals
                .chunks_exact(dim)
                .map(|r| r[first..last].iter().map(|e| e * e).sum::<f64>().sqrt())
                .collect()
        };
        match dim {
            1 => Self::of(residuals),
            6 => Self {
                rotation: Some(Box::new(Self::of(&lengths(3, 6)))),
                ..Self::of(&lengths(0, 3))
            },
            _ => Self::of(&lengths(0, dim)),
        }
    }
}

/// Errors of one set of measurements.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SetResult {
    /// Name.
    pub name: String,
    /// Kind.
    pub kind: String,
    /// Number of measurements.
    pub count: usize,
    /// Number of residual rows.
    pub rows: usize,
    /// With the nominal model as the files give it; none where a frame, plane or point has no given value.
    pub before: Option<ErrorSummary>,
    /// With the nominal robot, only sensor frames, base, tool points, planes and points estimated.
    pub registered: Option<ErrorSummary>,
    /// With the calibrated robot.
    pub after: Option<ErrorSummary>,
    /// Unit of the lengths.
    pub unit: &'static str,
}

/// Errors of every measurement of a set, for plots.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorSeries {
    /// Name of the set.
    pub name: String,
    /// Kind of the set.
    pub kind: String,
    /// Whether the rows were kept out of the estimate.
    pub held_out: bool,
    /// With the registered nominal robot \[m\]: lengths, or signed distances from a plane.
    pub registered: Vec<f64>,
    /// With the calibrated robot \[m\].
    pub calibrated: Vec<f64>,
}

/// What became of a parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// Estimated from the data.
    Estimated,
    /// Not asked for.
    Fixed,
    /// Nothing that was measured depends on it.
    NoEffect,
    /// Its effect is taken over by others.
    Regrouped,
    /// The structure would allow it, these data do not determine it.
    Unexcited,
    /// Free to choose, since it only moves along what was touched, or scales everything: held at nominal.
    Held,
}

impl Status {
    /// The name in files.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Estimated => "estimated",
            Self::Fixed => "fixed",
            Self::NoEffect => "no-effect",
            Self::Regrouped => "regrouped",
            Self::Unexcited => "unexcited",
            Self::Held => "held",
        }
    }
}

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

/// An estimated tool point, in the tool frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetEstimate {
    /// Name.
    pub name: String,
    /// Its robot; empty if there is only one.
    pub robot: String,
    /// Position \[m\].
    pub position: [f64; 3],
    /// Standard deviations \[m\].
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
    /// Number of visits.
    pub count: usize,
    /// Position in the reference frame \[m\].
    pub position: [f64; 3],
    /// RMS distance of its visits \[m\].
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

/// Whether the residuals are as large as the stated noise makes them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GlobalTest {
    /// a-posteriori standard deviation of unit weight.
    pub sigma0: Option<f64>,
    /// Rows of measurements less the unknowns, of which priors take a share.
    pub degrees_of_freedom: f64,
    /// Sum of the squared residuals of the measurements in units of their standard deviations; none
    /// without redundancy and under robust losses.
    pub chi_square: Option<f64>,
    /// Two-sided: the probability of a sum at least as unusual, if model and noise are right.
    pub p_value: Option<f64>,
    /// Probability of a sum at least as large.
    pub p_too_large: Option<f64>,
    /// Probability of a sum at most as large.
    pub p_too_small: Option<f64>,
    /// Level of the verdict: so often a right model is blamed.
    pub level: f64,
    /// `as-expected`, `too-large` or `too-small`.
    pub verdict: Option<&'static str>,
    /// What to keep in mind.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub caveats: Vec<String>,
}

/// Two estimated unknowns that go up and down together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Correlated {
    /// The one.
    pub a: String,
    /// The other.
    pub b: String,
    /// Correlation, from −1 to 1.
    pub coefficient: f64,
}

/// A measurement that does not fit the others.
///
/// Where its set has a robust loss: one that the loss has set aside, which counts less than half, and
/// whose residual is one that normal noise exceeds once in a thousand measurements. Elsewhere: one that
/// is farther off than chance explains in so many.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outlier {
    /// Its set.
    pub constraint: String,
    /// Its file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Its line in the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line: Option<usize>,
    /// Its row in the data file, from 0, as `rows` counts.
    pub row: usize,
    /// Its error with the calibrated robot \[m\]: a length, or a signed distance from a plane.
    pub error: f64,
    /// Its residual in standard deviations of that residual, RMS over its values; none where unknowns
    /// cannot be told apart.
    pub standardised: Option<f64>,
    /// Probability of one so far off, of a single measurement.
    pub p_value: Option<f64>,
    /// Its weight under the loss, of 1; none without a robust loss.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weight: Option<f64>,
}

/// How well the tool of a robot is known where it was measured: standard deviations of the length of its
/// position's error, as seen by what measured (in its sensor's frame, or in the reference frame).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ToolUncertainty {
    /// The robot; empty if there is only one.
    pub robot: String,
    /// How many measurements.
    pub count: usize,
    /// Root mean square over them \[m\].
    pub rms: f64,
    /// The largest \[m\].
    pub worst: f64,
    /// Whether that is with parameters held that move the tool and that nothing measured, at what the
    /// file has: where the base stands, if what was touched or visited moves along with it; the scale.
    pub given_held: bool,
    /// Its set.
    pub constraint: String,
    /// Its file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Its line in the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line: Option<usize>,
    /// Its row in the data file, from 0, as `rows` counts.
    pub row: usize,
}

/// What is said of one measurement that was used.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasurementStatistics {
    /// Its set.
    pub constraint: String,
    /// Its file.
    pub file: Option<String>,
    /// Its line in the file.
    pub line: Option<usize>,
    /// Its row in the data file, from 0, as `rows` counts.
    pub row: usize,
    /// Number of its set.
    pub set: usize,
    /// Its number in the set, from 0.
    pub item: usize,
    /// The robot that measured.
    pub robot: usize,
    /// How many numbers it is.
    pub values: usize,
    /// Its error with the calibrated robot \[m\]: a length, or a signed distance.
    pub error: f64,
    /// Its residual in standard deviations of that residual, RMS over its values: 1 on average. None of
    /// equations that are about several measurements, and if nothing checks it.
    pub standardised: Option<f64>,
    /// Probability of one so far off, of a single measurement.
    pub p_value: Option<f64>,
    /// How many unknowns it decides, from 0 to `values`: how much the fit would miss it.
    pub leverage: Option<f64>,
    /// Cook's distance: how far the estimate would move without it, squared, in its own uncertainty.
    pub cook: Option<f64>,
    /// Standard deviation of the tool's position there \[m\], as [`ToolUncertainty`].
    pub tool_sigma: Option<f64>,
}

/// Everything a calibration found out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CalibrationResult {
    /// How the solver ended.
    pub termination: TerminationReport,
    /// Whether the result may be used.
    pub trusted: bool,
    /// What to know before using it.
    pub warnings: Vec<String>,
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
    /// Estimated degrees of freedom of robots, sensor frames and tool points together.
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
}
