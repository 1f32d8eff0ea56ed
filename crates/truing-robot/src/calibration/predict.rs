//! Errors of measurements under the nominal, the registered and the calibrated robot.

use super::assembly::Assembly;
use super::measurement::{Measured, MeasurementSet};
use super::result::{ErrorSeries, ErrorSummary, SetResult};
use super::run::{Calibration, Fitted};
use super::select::in_order;
use super::start::start;
use super::state::{Owner, State};
use crate::error::Error;
use truing::{Settings, Values, solve_graduated};

impl Calibration {
    /// Errors of rows of set `k` (the set itself, or rows held out of it) in the three states.
    pub(super) fn summarise(
        &self,
        k: usize,
        set: &MeasurementSet,
        fitted: &Fitted,
    ) -> Result<SetResult, Error> {
        let errors = |state: &State| -> Result<ErrorSummary, Error> {
            self.errors(set, &self.own(k, state))
        };
        Ok(SetResult {
            name: set.name.clone(),
            kind: set.measured.kind().to_owned(),
            count: set.len(),
            rows: set.len() * set.dim(),
            before: if given(set) {
                Some(errors(&fitted.nominal)?)
            } else {
                None
            },
            registered: Some(errors(&fitted.registered)?),
            after: Some(errors(&fitted.estimated)?),
            unit: "m",
        })
    }

    /// The largest median error of a set of measurements in a state \[m\]: outliers do not count.
    pub(super) fn misfit(&self, state: &State) -> Result<f64, Error> {
        let mut largest = 0.0_f64;
        for (k, set) in self.sets.iter().enumerate() {
            let residuals = self.residuals(set, &self.own(k, state))?;
            let mut errors = ErrorSummary::lengths(&residuals, set.dim());
            errors.iter_mut().for_each(|e| *e = e.abs());
            errors.sort_by(f64::total_cmp);
            largest = largest.max(errors.get(errors.len() / 2).copied().unwrap_or_default());
        }
        Ok(largest)
    }

    /// A state with the planes, points and distances of set `k` alone.
    pub(super) fn own(&self, k: usize, state: &State) -> State {
        State {
            planes: vec![state.planes[k].clone()],
            points: vec![state.points[k].clone()],
            locations: vec![state.locations[k].clone()],
            distances: vec![state.distances[k]],
            ..state.clone()
        }
    }

    /// Errors of one set in a state whose planes, points and distances are this set's.
    fn errors(&self, set: &MeasurementSet, state: &State) -> Result<ErrorSummary, Error> {
        Ok(ErrorSummary::of_residuals(
            &self.residuals(set, state)?,
            set.dim(),
        ))
    }

    pub(super) fn residuals(&self, set: &MeasurementSet, state: &State) -> Result<Vec<f64>, Error> {
        let assembly = Assembly::new(
            &self.arms,
            &[set.plain()],
            state,
            &self.estimate.derivatives,
        )?;
        Ok(assembly.residuals(0, assembly.problem.initial()))
    }

    /// Errors of every measurement of set `k`, or of the rows held out of it.
    pub(super) fn series(
        &self,
        k: usize,
        set: &MeasurementSet,
        fitted: &Fitted,
        held_out: bool,
    ) -> Result<ErrorSeries, Error> {
        let lengths = |state: &State| -> Result<Vec<f64>, Error> {
            let residuals = self.residuals(set, &self.own(k, state))?;
            Ok(ErrorSummary::lengths(&residuals, set.dim()))
        };
        Ok(ErrorSeries {
            name: set.name.clone(),
            kind: set.measured.kind().to_owned(),
            held_out,
            registered: lengths(&fitted.registered)?,
            calibrated: lengths(&fitted.estimated)?,
        })
    }

    /// Errors of a set that only validates: what it alone knows of is fitted to it, robots stay.
    pub(super) fn validate_set(
        &self,
        set: &MeasurementSet,
        fitted: &Fitted,
    ) -> Result<SetResult, Error> {
        let sets = &[set.plain()];
        let errors = |state: &State| -> Result<ErrorSummary, Error> {
            let begin = start(&self.arms, sets, state.robots.clone(), state);
            let mut assembly = Assembly::new(&self.arms, sets, &begin, &self.estimate.derivatives)?;
            let free: Vec<usize> = in_order(&assembly, &[], |owner| match owner {
                Owner::Parameter { .. } | Owner::Constant => false,
                Owner::Frame(name) => !state.frames.contains_key(name),
                Owner::Target(robot, name) => !state.targets.contains_key(&(*robot, name.clone())),
                _ => true,
            });
            assembly.free_only(&free);
            let values: Values = if free.is_empty() {
                assembly.problem.initial().clone()
            } else {
                solve_graduated(&assembly.problem, &Settings::default())?.values
            };
            Ok(ErrorSummary::of_residuals(
                &assembly.residuals(0, &values),
                set.dim(),
            ))
        };
        let before = if given(set) {
            Some(self.errors(
                set,
                &start(
                    &self.arms,
                    sets,
                    fitted.nominal.robots.clone(),
                    &State::default(),
                ),
            )?)
        } else {
            None
        };
        Ok(SetResult {
            name: set.name.clone(),
            kind: set.measured.kind().to_owned(),
            count: set.len(),
            rows: set.len() * set.dim(),
            before,
            registered: Some(errors(&fitted.registered)?),
            after: Some(errors(&fitted.estimated)?),
            unit: "m",
        })
    }
}

/// Whether the files give everything a set's errors depend on.
fn given(set: &MeasurementSet) -> bool {
    let frame = set.frame.is_none() || set.frame_guess.is_some();
    let target = (set.target.is_none() || set.target_guess.is_some()) && set.other_target.is_none();
    let own = !matches!(
        set.measured,
        Measured::UnknownPlane(_)
            | Measured::SamePoint(_)
            | Measured::SameLocation(_)
            | Measured::Distance { distance: None, .. }
    );
    frame && target && own
}
