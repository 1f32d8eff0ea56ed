//! The estimate of a calibration alone, for those who estimate thousands of times.

use super::calibration::Calibration;
use super::job::Job;
use super::whole::Registration;
use crate::error::Error;
use crate::identify::Choice;
use crate::model::Column;
use crate::unknown::State;
use truing::Solution;

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
        let (job, _) = Job::of(self)?.without_small_groups()?;
        let solved = job.solve_checked(registration, &mut Vec::new(), &|_| ())?;
        Ok(Estimated {
            state: solved.estimated,
            columns: solved.assembly.columns,
            choices: solved.choices,
            solution: solved.solution,
        })
    }
}
