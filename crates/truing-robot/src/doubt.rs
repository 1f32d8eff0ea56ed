//! Doubts about a result, as data: what was found, in numbers, and whether it is fatal.

use serde::Serialize;

/// Whether rows that were not used are predicted better than by the registered nominal robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Forecast {
    /// Better, by more than chance.
    Better,
    /// No better than chance.
    Chance,
    /// Worse, by more than chance.
    Worse,
}

/// A wrong input that explains the data better than the robot's parameters do.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "input")]
pub enum Suspect {
    /// A joint's zero is elsewhere: its name and by how much \[rad\].
    ZeroOffset {
        /// The joint.
        joint: String,
        /// The offset \[rad\].
        offset: f64,
    },
    /// A joint counts the other way.
    Direction {
        /// The joint.
        joint: String,
    },
    /// Two joints have each other's column.
    Swapped {
        /// One.
        joint: String,
        /// The other.
        other: String,
    },
    /// Readings and joint values are a row apart.
    Shifted {
        /// The set.
        set: String,
        /// By so many rows.
        rows: i64,
    },
    /// A sensor's frame is left-handed.
    Mirrored {
        /// The set.
        set: String,
    },
    /// Joint values are in degrees.
    Degrees,
    /// Lengths are in another unit: so many times what they should be.
    Scale {
        /// The set.
        set: String,
        /// The factor.
        factor: f64,
    },
}

/// Something that makes a result doubtful.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
#[non_exhaustive]
pub enum Doubt {
    /// Rows that were held out are predicted worse than by the nominal robot \[m\].
    HeldOutWorse {
        /// The set.
        set: String,
        /// RMS error of the calibrated robot.
        calibrated: f64,
        /// RMS error of the better of nominal and registered robot.
        nominal: f64,
        /// Whether the registered one is the better.
        registered: bool,
        /// Whether it is too much for chance.
        fatal: bool,
    },
    /// Rows that were held out are predicted wrong by a part of the robot's size \[m\].
    Absurd {
        /// The set.
        set: String,
        /// RMS error.
        error: f64,
        /// The robot's reach.
        reach: f64,
    },
    /// Every cluster of postures was predicted from the others: no better than chance, or worse, than by the
    /// registered nominal robot.
    Prediction {
        /// What came out.
        forecast: Forecast,
        /// RMS errors, calibrated over registered.
        ratio: f64,
        /// The difference of the squares in standard errors.
        gain: f64,
        /// Clusters left out.
        clusters: usize,
    },
    /// All measurements are of the same posture, so nothing can be left out.
    OnePosture,
    /// The tool of a robot is not expected to be better than the nominal one, beyond chance \[m\].
    Elsewhere {
        /// The robot.
        robot: String,
        /// Expected RMS error of the calibrated tool.
        expected: f64,
        /// Expected RMS error of the nominal tool.
        nominal: f64,
        /// The difference of the squares in standard errors.
        gain: f64,
        /// At the postures that were measured; or all over the joints' ranges.
        measured: bool,
        /// Whether it is too much.
        fatal: bool,
    },
    /// The calibration changed the size of a robot, and little else.
    Grown {
        /// The robot.
        robot: String,
        /// Size of the calibrated robot over that of the nominal one.
        factor: f64,
        /// The part of the change of its tools that this explains, in squares.
        share: f64,
    },
    /// An input is probably wrong.
    Input {
        /// What.
        suspect: Suspect,
        /// RMS of the weighted residuals of the nominal robot as the files stand.
        before: f64,
        /// The same with this corrected.
        after: f64,
    },
    /// The lengths of a robot moved by a part of its size \[m\].
    Deformed {
        /// The robot.
        robot: String,
        /// By how much, in all.
        change: f64,
        /// Of what.
        total: f64,
    },
    /// The joints of the estimated robot hardly matter any more.
    Collapsed,
    /// Some unknowns cannot be told apart at the solution.
    Inseparable {
        /// What the covariance said.
        reason: String,
    },
    /// A sensor frame is not determined.
    FrameUndetermined {
        /// The frame.
        frame: String,
        /// A component that is not.
        component: String,
    },
    /// None of the parameters that were asked for is determined.
    NothingDetermined,
    /// There are as many unknowns as measured values.
    Unchecked {
        /// So many.
        rows: usize,
    },
    /// The nominal robot is far from the data; the search for a start.
    FarStart {
        /// Continuations that were tried.
        starts: usize,
        /// RMS of the weighted residuals at the best.
        rms: f64,
        /// How it ended.
        end: SearchEnd,
    },
    /// Residuals are larger than the stated noise explains.
    Misfit {
        /// Their size beside the stated noise.
        sigma0: f64,
        /// Probability of such residuals if model and noise are right.
        p_value: f64,
        /// What they go with, the strongest first.
        causes: Vec<Cause>,
    },
    /// Most rows of a set repeat others' postures.
    Duplicated {
        /// The set.
        set: String,
        /// Its rows.
        rows: usize,
        /// Different postures in them.
        postures: usize,
    },
    /// Something to know, in words.
    Note {
        /// The words.
        text: String,
    },
}

/// How the search for a start ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SearchEnd {
    /// At a start that fits.
    Found,
    /// At none that fits to the noise, nor two that agree.
    Unsure,
    /// By someone or by the time.
    Stopped,
}

/// What residuals go with, beyond chance.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cause {
    /// The set.
    pub set: String,
    /// What: `drift` or `harmonic`.
    pub what: &'static str,
    /// The joint, if it is one's.
    pub joint: Option<String>,
    /// The share of the squared residuals that it explains.
    pub share: f64,
    /// Probability of that by chance, over all that was tried.
    pub p_value: f64,
}

impl Doubt {
    /// Whether a result with this doubt must not be trusted.
    pub fn is_fatal(&self) -> bool {
        match self {
            Self::HeldOutWorse { fatal, .. } | Self::Elsewhere { fatal, .. } => *fatal,
            Self::FarStart { end, .. } => *end != SearchEnd::Found,
            Self::Absurd { .. }
            | Self::Prediction { .. }
            | Self::OnePosture
            | Self::Grown { .. }
            | Self::Input { .. }
            | Self::Deformed { .. }
            | Self::Collapsed
            | Self::Inseparable { .. }
            | Self::FrameUndetermined { .. }
            | Self::NothingDetermined
            | Self::Unchecked { .. } => true,
            Self::Misfit { .. } | Self::Duplicated { .. } | Self::Note { .. } => false,
        }
    }

    /// Something to know, in words.
    pub fn note(text: impl Into<String>) -> Self {
        Self::Note { text: text.into() }
    }
}
