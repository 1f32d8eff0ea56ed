//! Putting a result together.

use super::assembly::Assembly;
use super::doubt::DISTRUST;
use super::measurement::Measured;
use super::result::{
    CalibrationResult, ErrorSummary, FrameEstimate, LocationEstimate, Outlier, ParameterResult,
    PlaneEstimate, PointEstimate, SetResult, Status, TargetEstimate, TerminationReport,
};
use super::run::Calibration;
use super::select::Choice;
use super::state::{Owner, State};
use super::statistics::Statistics;
use super::uncertainty::Uncertainty;
use crate::error::Error;
use truing::step::ActiveAt;
use truing::{ActiveLimit, Solution};

/// Puts the result together.
pub(super) struct Report<'a> {
    pub calibration: &'a Calibration,
    pub assembly: &'a Assembly,
    pub choices: &'a [Choice],
    pub uncertainty: Option<&'a Uncertainty>,
    pub statistics: Option<&'a Statistics>,
}

impl Report<'_> {
    /// Standard deviation of a column; none if it is not estimated or ended at a bound.
    fn sigma(&self, column: usize) -> Option<f64> {
        let sigma = self.uncertainty?.std_dev(column);
        (sigma.is_finite() && sigma > 0.0).then_some(sigma)
    }

    /// Standard deviations of a frame or tool point; none unless all its components are estimated:
    /// those of the others would be conditional on an arbitrary one.
    fn sigmas(&self, first: usize, n: usize) -> Option<Vec<f64>> {
        (first..first + n)
            .map(|column| self.sigma(column))
            .collect()
    }

    fn parameters(&self, state: &State, solution: &Solution) -> Vec<ParameterResult> {
        let arms = &self.calibration.arms;
        let mut results = Vec::new();
        for (column, info) in self.assembly.columns.iter().enumerate() {
            let Owner::Parameter { robot, parameter } = info.owner else {
                continue;
            };
            let p = &arms[robot].robot.parameters()[parameter];
            let columns = &self.assembly.columns;
            let status = self.choices[column].status(columns);
            let into = self.choices[column].taken_over(columns);
            let estimate = state.robots[robot][parameter];
            let at_bound = self
                .calibration
                .at_bound(robot, parameter, estimate)
                .filter(|_| status == Status::Estimated);
            results.push(ParameterResult {
                name: info.name.clone(),
                unit: p.unit().symbol(),
                nominal: p.nominal,
                estimate,
                sigma: self.sigma(column),
                status,
                into,
                at_bound,
                multiplier: at_bound.and(multiplier(solution, column)),
            });
        }
        results
    }

    pub fn make(
        &self,
        state: &State,
        solution: &Solution,
        constraints: Vec<SetResult>,
        validation: Vec<SetResult>,
        outliers: Vec<Outlier>,
        warnings: Vec<String>,
    ) -> Result<CalibrationResult, Error> {
        let calibration = self.calibration;
        let (mut planes, mut points) = (Vec::new(), Vec::new());
        let (mut locations, mut distances) = (Vec::new(), Vec::new());
        for (k, set) in calibration.sets.iter().enumerate() {
            let residuals = calibration.residuals(set, &calibration.own(k, state))?;
            let rms = |groups: &super::measurement::Groups, g: usize| {
                let own: Vec<f64> = residuals
                    .chunks_exact(set.dim())
                    .zip(&groups.of_row)
                    .filter(|(_, h)| **h == g)
                    .map(|(r, _)| {
                        r[..r.len().min(3)]
                            .iter()
                            .map(|e| e * e)
                            .sum::<f64>()
                            .sqrt()
                    })
                    .collect();
                (own.len(), ErrorSummary::of(&own).rms)
            };
            match &set.measured {
                Measured::UnknownPlane(groups) => {
                    for (g, plane) in state.planes[k].iter().enumerate() {
                        let (count, rms) = rms(groups, g);
                        planes.push(PlaneEstimate {
                            constraint: set.name.clone(),
                            group: groups.names[g].clone(),
                            count,
                            normal: plane.normal.into(),
                            distance: plane.distance,
                            rms,
                        });
                    }
                }
                Measured::SamePoint(groups) => {
                    for (g, point) in state.points[k].iter().enumerate() {
                        let (count, rms) = rms(groups, g);
                        points.push(PointEstimate {
                            constraint: set.name.clone(),
                            group: groups.names[g].clone(),
                            count,
                            position: (*point).into(),
                            rms,
                        });
                    }
                }
                Measured::SameLocation(groups) => {
                    for (g, location) in state.locations[k].iter().enumerate() {
                        let (count, rms) = rms(groups, g);
                        locations.push(LocationEstimate {
                            constraint: set.name.clone(),
                            group: groups.names[g].clone(),
                            count,
                            position: location.translation.into(),
                            quaternion: location.quaternion(),
                            rms,
                        });
                    }
                }
                Measured::Distance { distance: None, .. } => {
                    distances.push((set.name.clone(), state.distances[k]))
                }
                _ => {}
            }
        }
        let frames = state
            .frames
            .iter()
            .map(|(name, pose)| FrameEstimate {
                name: name.clone(),
                position: pose.translation.into(),
                quaternion: pose.quaternion(),
                sigma: self
                    .assembly
                    .frame(name)
                    .and_then(|var| self.sigmas(var.column(), 6)),
            })
            .collect();
        let targets = state
            .targets
            .iter()
            .map(|((robot, name), point)| TargetEstimate {
                name: name.clone(),
                robot: calibration.arms[*robot].name.clone(),
                position: (*point).into(),
                sigma: self
                    .assembly
                    .target(*robot, name)
                    .and_then(|var| self.sigmas(var.column(), 3)),
            })
            .collect();
        let identifiable = (0..self.choices.len())
            .filter(|c| self.choices[*c] == Choice::Estimated)
            .filter(|c| {
                matches!(
                    self.assembly.columns[*c].owner,
                    Owner::Parameter { .. } | Owner::Frame(_) | Owner::Target(..)
                )
            })
            .count();
        let termination = TerminationReport {
            kind: solution.termination.kind().to_owned(),
            converged: solution.termination.converged(),
            message: solution.termination.to_string(),
        };
        Ok(CalibrationResult {
            // Where unknowns cannot be told apart, the residual is small at many wrong robots.
            trusted: termination.converged && !warnings.iter().any(|w| w.starts_with(DISTRUST)),
            termination,
            warnings,
            iterations: solution.iterations,
            initial_cost: solution.initial_cost,
            cost: solution.cost,
            sigma0: self.uncertainty.map(|u| u.sigma0).filter(|s| s.is_finite()),
            constraints,
            validation,
            parameters: self.parameters(state, solution),
            frames,
            targets,
            planes,
            points,
            locations,
            distances,
            identifiable,
            condition: self.uncertainty.map(|u| u.covariance.condition()),
            statistics: self.statistics.map(|s| s.test.clone()),
            correlations: self
                .statistics
                .map(|s| s.correlations.clone())
                .unwrap_or_default(),
            outliers,
            tools: self.statistics.map(|s| s.tools.clone()).unwrap_or_default(),
        })
    }
}

/// The multiplier of a column's bound, if it is active.
pub(super) fn multiplier(solution: &Solution, column: usize) -> Option<f64> {
    let of_column = |limit: &&ActiveLimit| limit.limit == ActiveAt::Column(column);
    let limit = solution.limits.iter().find(of_column)?;
    Some(limit.multiplier)
}
