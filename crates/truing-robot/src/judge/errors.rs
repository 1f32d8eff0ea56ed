//! Errors of measurements under the nominal, the registered and the calibrated robot.

use super::figures::{ErrorSeries, ErrorSummary, SetResult};
use crate::error::Error;
use crate::estimate::Job;
use crate::identify::in_order;
use crate::measurement::MeasurementSet;
use crate::model::{Assembly, Owner, errors_of, is_given};
use crate::start::start;
use crate::unknown::{Key, State};
use truing::{LeastSquares, Settings, Values, solve_graduated};

/// A set's residuals are summarised from these three states.
pub(crate) struct Fitted {
    pub nominal: State,
    pub registered: State,
    pub estimated: State,
}

impl Job {
    /// Errors of a set, or of rows held out of it, in the three states.
    pub fn summarise(&self, set: &MeasurementSet, fitted: &Fitted) -> Result<SetResult, Error> {
        let before = match is_given(set) {
            true => Some(self.errors(set, &fitted.nominal)?),
            false => None,
        };
        let registered = self.errors(set, &fitted.registered)?;
        let after = self.errors(set, &fitted.estimated)?;
        Ok(result_of(set, before, registered, after))
    }

    /// Residuals of all sets in a state, whitened, without losses.
    pub(super) fn whitened(&self, state: &State) -> Result<Vec<f64>, Error> {
        let sets: Vec<MeasurementSet> = self.sets.iter().map(MeasurementSet::unweighted).collect();
        let assembly = Assembly::new(&self.arms, &sets, state, &self.estimate.derivatives)?;
        let mut r = vec![0.0; assembly.problem.rows()];
        assembly
            .problem
            .residual(assembly.problem.initial(), &mut r);
        Ok(r)
    }

    /// Errors of one set in a state.
    pub(super) fn errors(
        &self,
        set: &MeasurementSet,
        state: &State,
    ) -> Result<ErrorSummary, Error> {
        Ok(ErrorSummary::of_residuals(
            set,
            &self.residuals(set, state)?,
        ))
    }

    /// Errors of every measurement of a set, or of the rows held out of it.
    pub fn series(
        &self,
        set: &MeasurementSet,
        fitted: &Fitted,
        held_out: bool,
    ) -> Result<ErrorSeries, Error> {
        let errors = |state: &State| -> Result<Vec<f64>, Error> {
            Ok(errors_of(set, 0, &self.residuals(set, state)?))
        };
        Ok(ErrorSeries {
            name: set.name.clone(),
            kind: set.kind.name().to_owned(),
            held_out,
            unit: set.kind.measurands()[0].unit.symbol(),
            signed: set.kind.measurands()[0].rows == 1,
            registered: errors(&fitted.registered)?,
            calibrated: errors(&fitted.estimated)?,
        })
    }

    /// Residuals of a set that only validates: what it alone knows of is fitted to it, robots stay.
    pub(super) fn fitted_residuals(
        &self,
        set: &MeasurementSet,
        state: &State,
    ) -> Result<Vec<f64>, Error> {
        let sets = &[set.plain()];
        let begin = start(&self.arms, sets, state.robots.clone(), state);
        let mut assembly = Assembly::new(&self.arms, sets, &begin, &self.estimate.derivatives)?;
        let free: Vec<usize> = in_order(&assembly, &[], |owner| match owner {
            Owner::Parameter { .. } | Owner::Constant => false,
            Owner::Frame(name) => state.frame(name).is_none(),
            Owner::Target(robot, name) => state.get(&Key::Target(*robot, name.clone())).is_none(),
            _ => true,
        });
        assembly.free_only(&free);
        let values: Values = if free.is_empty() {
            assembly.problem.initial().clone()
        } else {
            solve_graduated(&assembly.problem, &Settings::default())?.values
        };
        Ok(assembly.residuals(0, &values))
    }

    /// Errors of a set that only validates: what it alone knows of is fitted to it, robots stay.
    pub fn validate_set(&self, set: &MeasurementSet, fitted: &Fitted) -> Result<SetResult, Error> {
        let sets = &[set.plain()];
        let errors = |state: &State| -> Result<ErrorSummary, Error> {
            Ok(ErrorSummary::of_residuals(
                set,
                &self.fitted_residuals(set, state)?,
            ))
        };
        let before = match is_given(set) {
            true => {
                let nominal = fitted.nominal.robots.clone();
                let begin = start(&self.arms, sets, nominal, &State::default());
                Some(self.errors(set, &begin)?)
            }
            false => None,
        };
        let registered = errors(&fitted.registered)?;
        Ok(result_of(
            set,
            before,
            registered,
            errors(&fitted.estimated)?,
        ))
    }
}

fn result_of(
    set: &MeasurementSet,
    before: Option<ErrorSummary>,
    registered: ErrorSummary,
    after: ErrorSummary,
) -> SetResult {
    SetResult {
        name: set.name.clone(),
        kind: set.kind.name().to_owned(),
        count: set.len(),
        rows: set.len() * set.dim(),
        before,
        registered: Some(registered),
        after: Some(after),
        unit: set.kind.measurands()[0].unit.symbol(),
    }
}
