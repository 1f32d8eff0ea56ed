//! The table of a study: a row a case, tool error and method.

use super::cases::Study;
use super::level::Scaled;
use serde::Serialize;
use std::collections::BTreeMap;

/// What a method made of a trial.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Outcome {
    pub recovered: bool,
    pub ended: &'static str,
    pub iterations: u64,
    pub residual_evaluations: u64,
    pub jacobian_evaluations: u64,
    pub fresh: f64,
    pub tool: f64,
    pub parameters: Option<(f64, f64)>,
}

impl Outcome {
    /// There was nothing to start from.
    pub fn refused() -> Self {
        Self {
            recovered: false,
            ended: "refused",
            iterations: 0,
            residual_evaluations: 0,
            jacobian_evaluations: 0,
            fresh: f64::INFINITY,
            tool: f64::INFINITY,
            parameters: None,
        }
    }
}

/// A trial: how often its places were drawn anew, and what each method made of it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Trial {
    pub redrawn: usize,
    /// None if its measurements are out of reach; none for a method that is not for the case.
    pub outcomes: Option<Vec<Option<Outcome>>>,
}

/// Mean, median and largest of some counts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Counts {
    /// Mean.
    pub mean: f64,
    /// Median.
    pub median: f64,
    /// Largest.
    pub max: u64,
}

/// A method on a case at one tool error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StudyRow {
    /// The case.
    pub case: String,
    /// The mean initial tool error that was asked for \[m\]; none where the errors are taken as they are.
    pub tool_error: Option<f64>,
    /// The mean initial tool error that was drawn \[m\].
    pub measured_tool_error: f64,
    /// The method.
    pub method: String,
    /// Errors on fresh configurations up to which a robot counts as recovered \[m\].
    pub tolerance: f64,
    /// Trials that were run.
    pub trials: usize,
    /// Trials in which the robot was recovered.
    pub recovered: usize,
    /// Their share of the trials that were run.
    pub share: Option<f64>,
    /// Iterations, over all trials that were run.
    pub iterations: Option<Counts>,
    /// Mean number of evaluations of the residual.
    pub residual_evaluations: Option<f64>,
    /// Mean number of evaluations of residual and Jacobian.
    pub jacobian_evaluations: Option<f64>,
    /// How many solves ended in which way.
    pub ended: BTreeMap<&'static str, usize>,
    /// Median over the trials of the RMS tool error on random configurations, up to the symmetries \[m\].
    pub final_tool_error: Option<f64>,
    /// Median over the trials of the RMS error of fresh measurements \[m\].
    pub final_residual: Option<f64>,
    /// Median over the recovered robots of the RMS error of estimated angles \[rad\].
    pub angle_error: Option<f64>,
    /// Median over the recovered robots of the RMS error of estimated lengths \[m\].
    pub length_error: Option<f64>,
    /// Times that planes or points were drawn anew since the robot could not reach them.
    pub redrawn: usize,
    /// Trials that were given up since none could be reached.
    pub out_of_reach: usize,
}

/// What a study found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StudyResult {
    /// The seed of all random numbers.
    pub seed: u64,
    /// Trials asked for, for each case and tool error.
    pub trials: usize,
    /// Whether all of them were run; otherwise someone stopped it.
    pub complete: bool,
    /// Case after case, tool error after tool error, method after method.
    pub rows: Vec<StudyRow>,
}

impl StudyResult {
    /// Puts trials together; those that are missing were not run.
    pub(super) fn of(study: &Study, scaled: &[Scaled], trials: &[Option<Trial>]) -> Self {
        let levels = study.levels.len().max(1);
        let mut rows = Vec::new();
        for (part, trials) in trials.chunks(study.trials).enumerate() {
            let (case, level) = (&study.cases[part / levels], study.levels.get(part % levels));
            for (m, method) in study.methods.iter().enumerate() {
                if case.forms[m].is_none() {
                    continue;
                }
                let made = || trials.iter().flatten();
                let outcomes: Vec<&Outcome> = made()
                    .filter_map(|trial| trial.outcomes.as_ref()?[m].as_ref())
                    .collect();
                let mut row = row(&outcomes);
                row.case.clone_from(&case.name);
                row.method.clone_from(&method.name);
                row.tool_error = level.map(|level| level.value);
                row.measured_tool_error = scaled[part].tool_error;
                row.tolerance = case.tolerance;
                row.redrawn = made().map(|trial| trial.redrawn).sum();
                row.out_of_reach = made().filter(|trial| trial.outcomes.is_none()).count();
                rows.push(row);
            }
        }
        Self {
            seed: study.seed,
            trials: study.trials,
            complete: trials.iter().all(Option::is_some),
            rows,
        }
    }
}

/// The row of some outcomes, without its names.
fn row(outcomes: &[&Outcome]) -> StudyRow {
    let recovered: Vec<&&Outcome> = outcomes.iter().filter(|o| o.recovered).collect();
    let mut ended = BTreeMap::new();
    for outcome in outcomes {
        *ended.entry(outcome.ended).or_insert(0) += 1;
    }
    let count = outcomes.len();
    let mean = |of: fn(&Outcome) -> u64| {
        (count > 0).then(|| outcomes.iter().map(|o| of(o)).sum::<u64>() as f64 / count as f64)
    };
    let over_all = |of: fn(&Outcome) -> f64| median(outcomes.iter().map(|o| of(o)).collect());
    let of_recovered = |of: fn((f64, f64)) -> f64| {
        median(
            recovered
                .iter()
                .filter_map(|o| o.parameters.map(of))
                .collect(),
        )
    };
    let iterations = mean(|o| o.iterations).and_then(|mean| {
        Some(Counts {
            mean,
            median: over_all(|o| o.iterations as f64)?,
            max: outcomes.iter().map(|o| o.iterations).max()?,
        })
    });
    StudyRow {
        case: String::new(),
        tool_error: None,
        measured_tool_error: 0.0,
        method: String::new(),
        tolerance: 0.0,
        trials: count,
        recovered: recovered.len(),
        share: (count > 0).then(|| recovered.len() as f64 / count as f64),
        iterations,
        residual_evaluations: mean(|o| o.residual_evaluations),
        jacobian_evaluations: mean(|o| o.jacobian_evaluations),
        ended,
        final_tool_error: over_all(|o| o.tool),
        final_residual: over_all(|o| o.fresh),
        angle_error: of_recovered(|p| p.0),
        length_error: of_recovered(|p| p.1),
        redrawn: 0,
        out_of_reach: 0,
    }
}

/// The median; none of nothing, and none where it is not finite.
fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    let median = match values.len() {
        0 => return None,
        n if n % 2 == 1 => values[middle],
        _ => 0.5 * (values[middle - 1] + values[middle]),
    };
    median.is_finite().then_some(median)
}
