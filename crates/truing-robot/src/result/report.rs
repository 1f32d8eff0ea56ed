//! Putting a result together.

use super::calibration_result::{
    CalibrationResult, ComponentEstimate, FrameEstimate, LocationEstimate, ParameterResult,
    PlaneEstimate, PointEstimate, TargetEstimate, TerminationReport, UnknownEstimate,
};
use crate::doubt::Doubt;
use crate::error::Error;
use crate::estimate::Job;
use crate::identify::{Choice, Status};
use crate::judge::doubt::multiplier;
use crate::judge::{ErrorSummary, Outlier, SetResult, Statistics, ToolEverywhere, Uncertainty};
use crate::measurement::MeasurementSet;
use crate::model::{Assembly, Owner, errors_of};
use crate::unknown::{Key, Own, Shape, State, Value};
use truing::Solution;

/// What sets of measurements brought.
#[derive(Default)]
struct OwnEstimates {
    planes: Vec<PlaneEstimate>,
    points: Vec<PointEstimate>,
    locations: Vec<LocationEstimate>,
    distances: Vec<(String, f64)>,
    unknowns: Vec<UnknownEstimate>,
}

/// Puts the result together.
pub(crate) struct Report<'a> {
    pub job: &'a Job,
    pub assembly: &'a Assembly,
    pub choices: &'a [Choice],
    pub uncertainty: Option<&'a Uncertainty>,
    pub statistics: Option<&'a Statistics>,
    pub drawing: Option<f64>,
}

impl Report<'_> {
    /// Standard deviation of a column; none if it is not estimated or ended at a bound.
    fn sigma(&self, column: usize) -> Option<f64> {
        let sigma = self.uncertainty?.std_dev(column);
        (sigma.is_finite() && sigma > 0.0).then_some(sigma)
    }

    /// Standard deviations of a frame or tool point; none unless all its components are estimated:
    /// those of the others would be conditional on an arbitrary one.
    fn sigmas(&self, key: &Key) -> Option<Vec<f64>> {
        let columns = self.assembly.unknown(key)?.columns();
        columns.map(|column| self.sigma(column)).collect()
    }

    fn frame(&self, name: &str, value: &Value, sigma: Option<Vec<f64>>) -> Option<FrameEstimate> {
        let Shape::Pose(pose) = value.shape() else {
            return None;
        };
        Some(FrameEstimate {
            name: name.to_owned(),
            position: pose.translation.into(),
            quaternion: pose.quaternion(),
            sigma,
        })
    }

    fn target(
        &self,
        robot: usize,
        name: &str,
        value: &Value,
        sigma: Option<Vec<f64>>,
    ) -> Option<TargetEstimate> {
        let (position, quaternion) = match value.shape() {
            Shape::Point(point) => (point, None),
            Shape::Pose(pose) => (pose.translation, Some(pose.quaternion())),
            _ => return None,
        };
        Some(TargetEstimate {
            name: name.to_owned(),
            robot: self.job.arms[robot].name.clone(),
            position: position.into(),
            quaternion,
            sigma,
        })
    }

    /// The unknowns that a set brought: by what they are, and all of them with their standard deviations.
    fn own(
        &self,
        set: &MeasurementSet,
        state: &State,
        all: &mut OwnEstimates,
    ) -> Result<(), Error> {
        let unknowns = set.kind.unknowns();
        let unknowns: Vec<_> = unknowns.iter().filter(|unknown| !unknown.known).collect();
        if unknowns.is_empty() {
            return Ok(());
        }
        let errors = errors_of(set, 0, &self.job.residuals(set, state)?);
        for (g, group) in set.groups.names.iter().enumerate() {
            let rows: Vec<f64> = set.groups.rows(g).map(|row| errors[row]).collect();
            let (count, rms) = (rows.len(), ErrorSummary::of(&rows).rms);
            for unknown in &unknowns {
                let Some(value) = state.own(&set.name, group, unknown.name) else {
                    continue;
                };
                let (constraint, group) = (set.name.clone(), group.clone());
                match value.shape() {
                    Shape::Plane(plane) => all.planes.push(PlaneEstimate {
                        constraint,
                        group,
                        count,
                        normal: plane.normal.into(),
                        distance: plane.distance,
                        rms,
                    }),
                    Shape::Point(point) => all.points.push(PointEstimate {
                        constraint,
                        group,
                        count,
                        position: point.into(),
                        rms,
                    }),
                    Shape::Pose(location) => all.locations.push(LocationEstimate {
                        constraint,
                        group,
                        count,
                        position: location.translation.into(),
                        quaternion: location.quaternion(),
                        rms,
                    }),
                    Shape::Numbers(numbers) => {
                        if let ("distance", [distance]) = (unknown.name, &numbers[..]) {
                            all.distances.push((constraint, *distance));
                        }
                    }
                }
            }
            for unknown in &unknowns {
                all.unknowns
                    .extend(self.unknown(set, group, unknown.name, state));
            }
        }
        Ok(())
    }

    /// An unknown of a group with its components; none where the equations left it out.
    fn unknown(
        &self,
        set: &MeasurementSet,
        group: &str,
        name: &str,
        state: &State,
    ) -> Option<UnknownEstimate> {
        let key = Key::Own(Own {
            set: set.name.clone(),
            group: group.to_owned(),
            name: name.to_owned(),
        });
        let value = state.get(&key)?;
        let columns = self.assembly.unknown(&key)?.columns();
        let numbers = match value.shape() {
            Shape::Numbers(numbers) => numbers,
            Shape::Point(point) => point.as_slice().to_vec(),
            _ => Vec::new(),
        };
        // Other coordinates of a method are not the unknown's.
        let components = value.components();
        if components.len() != columns.len() {
            return None;
        }
        let of = &self.assembly.columns;
        let component = |(k, column): (usize, usize)| ComponentEstimate {
            name: of[column].name.clone(),
            unit: components[k].unit.symbol(),
            estimate: numbers.get(k).copied(),
            sigma: self.sigma(column),
            status: self.choices[column].status(of),
        };
        Some(UnknownEstimate {
            constraint: set.name.clone(),
            group: group.to_owned(),
            name: name.to_owned(),
            components: columns.enumerate().map(component).collect(),
        })
    }

    fn parameters(&self, state: &State, solution: &Solution) -> Vec<ParameterResult> {
        let arms = &self.job.arms;
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
                .job
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
        doubts: Vec<Doubt>,
        everywhere: Vec<ToolEverywhere>,
    ) -> Result<CalibrationResult, Error> {
        let mut own = OwnEstimates::default();
        for set in &self.job.sets {
            self.own(set, state, &mut own)?;
        }
        let (mut frames, mut targets) = (Vec::new(), Vec::new());
        for (key, value) in state.iter() {
            let sigma = self.sigmas(key);
            match key {
                Key::Frame(name) => frames.extend(self.frame(name, value, sigma)),
                Key::Target(robot, name) => {
                    targets.extend(self.target(*robot, name, value, sigma));
                }
                Key::Own(_) => {}
            }
        }
        let identifiable = (0..self.choices.len())
            .filter(|c| self.choices[*c] == Choice::Estimated)
            .filter(|c| {
                let owner = &self.assembly.columns[*c].owner;
                !owner.is_local() && *owner != Owner::Constant
            })
            .count();
        let termination = TerminationReport {
            kind: solution.termination.kind().to_owned(),
            converged: solution.termination.converged(),
            message: solution.termination.to_string(),
        };
        Ok(CalibrationResult {
            // Where unknowns cannot be told apart, the residual is small at many wrong robots.
            trusted: termination.converged && !doubts.iter().any(Doubt::is_fatal),
            termination,
            warnings: doubts.iter().map(Doubt::to_string).collect(),
            doubts,
            iterations: solution.iterations,
            initial_cost: solution.initial_cost,
            cost: solution.cost,
            sigma0: self.uncertainty.map(|u| u.sigma0).filter(|s| s.is_finite()),
            constraints,
            validation,
            drawing: self.drawing,
            parameters: self.parameters(state, solution),
            frames,
            targets,
            planes: own.planes,
            points: own.points,
            locations: own.locations,
            distances: own.distances,
            unknowns: own.unknowns,
            identifiable,
            condition: self.uncertainty.map(|u| u.covariance.condition()),
            statistics: self.statistics.map(|s| s.test.clone()),
            correlations: self
                .statistics
                .map(|s| s.correlations.clone())
                .unwrap_or_default(),
            outliers,
            everywhere,
            tools: self.statistics.map(|s| s.tools.clone()).unwrap_or_default(),
        })
    }
}
