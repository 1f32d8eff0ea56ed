//! Figures about measurements: errors, tests, outliers, tools, in the shape of `result.json`.

use crate::measurement::MeasurementSet;
use crate::model::errors_of;
use serde::Serialize;
use std::collections::BTreeMap;

/// Size of a set's errors over its measurements.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ErrorSummary {
    /// Root mean square.
    pub rms: f64,
    /// Mean of the absolute values.
    pub mean: f64,
    /// Largest absolute value.
    pub max: f64,
    /// The same of what else was measured, by name: `rotation` \[rad\] for poses.
    #[serde(flatten)]
    pub more: BTreeMap<&'static str, ErrorSummary>,
}

impl ErrorSummary {
    /// Summary of errors; zeros for none.
    pub fn of(errors: &[f64]) -> Self {
        let n = errors.len().max(1) as f64;
        Self {
            rms: (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt(),
            mean: errors.iter().map(|e| e.abs()).sum::<f64>() / n,
            max: errors.iter().fold(0.0, |m, e| m.max(e.abs())),
            more: BTreeMap::new(),
        }
    }

    /// Summary of the residuals of a set: of the first that it measures, and of what else it does.
    pub fn of_residuals(set: &MeasurementSet, residuals: &[f64]) -> Self {
        let measurands = set.kind.measurands().iter().enumerate();
        let mut all = measurands.map(|(k, m)| (m.name, Self::of(&errors_of(set, k, residuals))));
        let (_, first) = all.next().unwrap_or(("", Self::of(&[])));
        Self {
            more: all.collect(),
            ..first
        }
    }

    /// The rotation errors \[rad\], for poses.
    pub fn rotation(&self) -> Option<&Self> {
        self.more.get("rotation")
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
    /// Unit of the errors.
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
    /// Unit of the errors.
    pub unit: &'static str,
    /// Whether errors have a sign.
    pub signed: bool,
    /// With the registered nominal robot : lengths, or signed numbers such as distances from a plane.
    pub registered: Vec<f64>,
    /// With the calibrated robot.
    pub calibrated: Vec<f64>,
}

/// What a tool is expected to be off all over the ranges of its joints, after the best rigid motion \[m\].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ToolEverywhere {
    /// The robot; empty if there is only one.
    pub robot: String,
    /// Expected RMS error of the calibrated tool.
    pub expected: f64,
    /// What this RMS error is below with a probability of 95 %.
    pub bound: f64,
    /// Expected RMS error of the nominal tool.
    pub nominal: f64,
    /// RMS distance between both.
    pub change: f64,
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
