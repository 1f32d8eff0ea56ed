//! What can be wrong with a calibration.

use crate::text::InputError;

/// Why a calibration or simulation cannot be done.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An input file is wrong.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The least-squares problem has no usable point.
    #[error(transparent)]
    Problem(#[from] truing::Error),
    /// The files are right, each by itself, but together they cannot be calibrated from.
    #[error("{message}")]
    Calibration {
        /// What was found and what was expected.
        message: String,
        /// What to do.
        help: String,
    },
    /// No posture satisfies a condition.
    #[error("{message}")]
    Unreachable {
        /// What was looked for, and how often.
        message: String,
        /// What to do.
        help: String,
    },
}

impl Error {
    pub(crate) fn calibration(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Calibration {
            message: message.into(),
            help: help.into(),
        }
    }
}
