//! What a run is doing.

/// What a run is doing, for those who watch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Deciding what can be estimated.
    Identifying,
    /// Estimating frames, tool points, planes and points with the nominal robot.
    Registering,
    /// Estimating the robot.
    Estimating,
    /// Predicting rows that were not used.
    Validating,
}

impl Stage {
    /// In words.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Identifying => "deciding what can be estimated",
            Self::Registering => "registering the nominal robot",
            Self::Estimating => "estimating",
            Self::Validating => "validating",
        }
    }
}
