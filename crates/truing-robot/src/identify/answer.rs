//! What measurements identify, in the shape that `truing identify --json` prints.

use super::choice::Status;
use serde::Serialize;
use truing::identifiability::Observability;

/// What becomes of one column that was asked about.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Identified {
    /// Name of the parameter, or of a component of a sensor frame or tool point (`tracker.x`).
    pub name: String,
    /// What becomes of it.
    pub status: Status,
    /// For a regrouped or held one: which take over, with which coefficients.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub into: Option<Vec<(String, f64)>>,
}

/// The singular values between which the rank was decided.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gap {
    /// The smallest that counts.
    pub last_kept: f64,
    /// The largest that does not; none if all count.
    pub first_dropped: Option<f64>,
    /// How many times smaller it is; none if it is zero or there is none.
    pub ratio: Option<f64>,
}

impl Gap {
    /// The gap after `rank` of the singular values, the largest first.
    pub fn after(rank: usize, singular_values: &[f64]) -> Option<Self> {
        let last_kept = *singular_values.get(rank.checked_sub(1)?)?;
        let first_dropped = singular_values.get(rank).copied();
        let ratio = first_dropped.filter(|d| *d > 0.0).map(|d| last_kept / d);
        Some(Self {
            last_kept,
            first_dropped,
            ratio,
        })
    }
}

/// Observability indices of the estimated columns.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "UPPERCASE")]
pub struct Indices {
    /// Geometric mean of the singular values over √(number of measurements).
    pub o1: f64,
    /// Smallest over largest singular value.
    pub o2: f64,
    /// Smallest singular value.
    pub o3: f64,
    /// Its square over the largest.
    pub o4: f64,
    /// One over the sum of the inverses.
    pub o5: f64,
}

impl From<Observability> for Indices {
    fn from(o: Observability) -> Self {
        let Observability { o1, o2, o3, o4, o5 } = o;
        Self { o1, o2, o3, o4, o5 }
    }
}

/// How columns were scaled.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scaling {
    /// For singular values.
    pub singular_values: &'static str,
    /// For observability indices.
    pub observability: &'static str,
    /// RMS distance of the tools from their mean, over random postures \[m\].
    pub characteristic_length: f64,
}

/// The rank by what the columns belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct RankOf {
    /// Parameters of robots.
    pub robots: usize,
    /// Components of sensor frames.
    pub frames: usize,
    /// Components of tool points.
    pub tool_points: usize,
    /// Components of properties of instruments.
    #[serde(skip_serializing_if = "none")]
    pub instruments: usize,
}

/// What one constraint more adds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// Its name.
    pub constraint: String,
    /// Its kind.
    pub kind: String,
    /// The rank with it and those before it.
    pub rank: usize,
    /// How much it adds.
    pub adds: usize,
    /// The symmetries that are left.
    pub symmetries: Vec<String>,
}

/// What the data themselves say, at their own configurations.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DataAnswer {
    /// Number of measurements.
    pub measurements: usize,
    /// How many of the columns the data determine: the rank without those that are `unexcited`.
    pub rank: usize,
    /// Columns that the structure would allow and these data do not determine.
    pub unexcited: Vec<String>,
    /// Of the columns that the structure allows, at the data's configurations.
    pub singular_values: Vec<f64>,
    /// Between those that the data determine and the rest.
    pub gap: Option<Gap>,
}

/// What measurements identify.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Identification {
    /// How many columns were asked about: parameters of robots, sensor frames and tool points.
    pub columns: usize,
    /// How many of them can be estimated, by structure.
    pub rank: usize,
    /// The same by what they belong to.
    pub rank_of: RankOf,
    /// Degrees of freedom of planes, points, locations and unknown distances that are estimated beside them.
    pub beside: usize,
    /// What becomes of every parameter, then of components of sensor frames and tool points.
    pub parameters: Vec<Identified>,
    /// What the constraints cannot see, one entry a dimension.
    pub symmetries: Vec<String>,
    /// What moves and grows with the robot: sensor frames, and sets of planes, points, locations and unknown distances.
    pub together_with: Vec<String>,
    /// The rank after each constraint.
    pub steps: Vec<Step>,
    /// Of the structural Jacobian of the columns asked about, planes, points, locations and distances
    /// eliminated; the largest first.
    pub singular_values: Vec<f64>,
    /// Between the smallest singular value that counts and the largest that does not.
    pub gap: Option<Gap>,
    /// How many measurements the observability indices are of.
    pub measurements: usize,
    /// Of the estimated columns: at the data's configurations, or at random ones where there are no data.
    pub observability: Option<Indices>,
    /// How columns were scaled.
    pub scaling: Scaling,
    /// What the data say, where there are some.
    pub data: Option<DataAnswer>,
    /// What to know.
    pub warnings: Vec<String>,
}

/// Whether a count is zero.
#[allow(clippy::trivially_copy_pass_by_ref)]
fn none(count: &usize) -> bool {
    *count == 0
}
