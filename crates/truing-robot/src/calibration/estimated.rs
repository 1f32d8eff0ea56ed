//! The estimate of a calibration alone, for those who estimate thousands of times.

use super::run::Calibration;
use super::select::Choice;
use super::state::{Column, State};
use crate::error::Error;
use truing::Solution;

/// Whether the nominal robot is registered before the estimate.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Registration {
    /// Always, as the baseline that improvements are compared with.
    Always,
    /// Only where an estimate may have to start there: the robot does not stand where its file says.
    #[default]
    IfFar,
    /// Never: the estimate starts at nominal.
    Never,
}

/// An estimate without its reports.
#[derive(Debug, Clone)]
pub struct Estimated {
    /// The estimated state.
    pub state: State,
    /// Every column of the Jacobian.
    pub columns: Vec<Column>,
    /// What became of each.
    pub choices: Vec<Choice>,
    /// The solution of the least-squares problem.
    pub solution: Solution,
}

impl Calibration {
    /// The estimate of [`Calibration::run`] alone, without baseline, validation, covariance and reports.
    ///
    /// # Errors
    /// As [`Calibration::run`].
    pub fn estimate_only(&self, registration: Registration) -> Result<Estimated, Error> {
        let (calibration, _) = self.without_small_groups()?;
        let solved = calibration.solve_checked(registration, &mut Vec::new(), &|_| ())?;
        Ok(Estimated {
            state: solved.estimated,
            columns: solved.assembly.columns,
            choices: solved.choices,
            solution: solved.solution,
        })
    }
}
