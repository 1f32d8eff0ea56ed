//! Many starts, one budget.

use super::{Evaluations, Outcome, Settings, Termination, run};
use crate::error::Error;
use crate::least_squares::LeastSquares;
use std::time::{Duration, Instant};

/// What a search from many starts may cost at most. One start is always tried, and the start under
/// way when the budget is spent is finished, within its own limits.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Budget {
    /// Most starts; none for as many as there are.
    pub starts: Option<usize>,
    /// Most evaluations of the residual and of the Jacobian together; none for no limit.
    pub evaluations: Option<u64>,
    /// Longest time; none for no limit.
    pub time: Option<Duration>,
    /// Enough when the lowest minimum was reached from so many starts; none to go on to the end.
    pub agreeing: Option<usize>,
}

/// A minimum, and how many starts led to it.
#[derive(Debug, Clone)]
pub struct Minimum<P> {
    /// The solve that ended lowest in it.
    pub outcome: Outcome<P>,
    /// Number of starts that converged to this cost.
    pub starts: usize,
}

/// Why a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SearchEnd {
    /// All starts were tried.
    Starts,
    /// The evaluations were spent.
    Evaluations,
    /// The time was.
    Time,
    /// As many starts as asked for agree on the lowest minimum.
    Agreement,
    /// Someone stopped it.
    Interrupted,
}

/// The outcome of a search from many starts.
#[derive(Debug, Clone)]
pub struct Search<P> {
    /// The minima that were found, the lowest first; starts that did not converge are not among them.
    pub minima: Vec<Minimum<P>>,
    /// The lowest outcome, converged or not.
    pub best: Outcome<P>,
    /// Starts that were tried.
    pub starts: usize,
    /// Starts that converged nowhere.
    pub unconverged: usize,
    /// Starts at which the model has no value.
    pub unusable: usize,
    /// Evaluations of all starts together.
    pub evaluations: Evaluations,
    /// Why it ended.
    pub end: SearchEnd,
}

/// Costs closer than this, relative, belong to one minimum.
const SAME: f64 = 1e-6;

/// So many starts without a value, and none with one, and no other is expected to have one.
const HOPELESS: usize = 1000;

/// Solves from every start until the budget is spent, and keeps the minima apart by their cost.
///
/// A converged start beats one that did not converge at the same cost. Minima of the same cost
/// (symmetric ones, say) are counted as one. Starts come from the caller:
/// [`Problem::random_starts`](crate::Problem::random_starts) draws them.
///
/// # Errors
/// If no start is usable, or none of a thousand: the first start's error.
pub fn multi_start<O: LeastSquares>(
    problem: &O,
    starts: impl IntoIterator<Item = O::Point>,
    settings: &Settings,
    budget: &Budget,
) -> Result<Search<O::Point>, Error> {
    let began = Instant::now();
    let mut minima: Vec<Minimum<O::Point>> = Vec::new();
    let mut best: Option<Outcome<O::Point>> = None;
    let (mut tried, mut unconverged, mut unusable) = (0, 0, 0);
    let mut evaluations = Evaluations::default();
    let mut first_error = None;
    let mut end = SearchEnd::Starts;
    // Zero costs are compared with what the starts cost.
    let mut size = 0.0_f64;
    for start in starts {
        let first = tried == 0;
        if !first && budget.starts.is_some_and(|most| tried >= most) {
            break;
        }
        let spent = evaluations.residual + evaluations.jacobian;
        if !first && budget.evaluations.is_some_and(|most| spent >= most) {
            end = SearchEnd::Evaluations;
            break;
        }
        let left = budget.time.map(|time| time.saturating_sub(began.elapsed()));
        if !first && left.is_some_and(|left| left.is_zero()) {
            end = SearchEnd::Time;
            break;
        }
        let timeout = match (left, settings.timeout) {
            (Some(left), Some(own)) => Some(left.min(own)),
            (left, own) => left.or(own),
        };
        let settings = Settings {
            timeout,
            ..settings.clone()
        };
        tried += 1;
        let outcome = match run(problem, start, &settings) {
            Ok(outcome) => outcome,
            Err(error @ (Error::NotFinite { .. } | Error::DerivativeNotFinite { .. })) => {
                unusable += 1;
                // It took a look at least.
                evaluations.residual += 1;
                first_error.get_or_insert(error);
                if best.is_none() && unusable >= HOPELESS {
                    break;
                }
                continue;
            }
            Err(error) => return Err(error),
        };
        evaluations.residual += outcome.evaluations.residual;
        evaluations.jacobian += outcome.evaluations.jacobian;
        size = size.max(outcome.initial_cost);
        let interrupted = outcome.termination == Termination::Interrupted;
        let same = |a: f64, b: f64| (a - b).abs() <= SAME * (a.abs().max(b.abs()) + 1e-12 * size);
        if outcome.termination.converged() {
            match (minima.iter_mut()).find(|known| same(known.outcome.cost, outcome.cost)) {
                Some(known) => {
                    known.starts += 1;
                    if outcome.cost < known.outcome.cost {
                        known.outcome = outcome.clone();
                    }
                }
                None => minima.push(Minimum {
                    outcome: outcome.clone(),
                    starts: 1,
                }),
            }
        } else {
            unconverged += 1;
        }
        let better = best.as_ref().is_none_or(|best| {
            let rank = |o: &Outcome<O::Point>| !o.termination.converged();
            if same(best.cost, outcome.cost) {
                (rank(&outcome), outcome.cost) < (rank(best), best.cost)
            } else {
                outcome.cost < best.cost
            }
        });
        if better {
            best = Some(outcome);
        }
        if interrupted {
            end = SearchEnd::Interrupted;
            break;
        }
        let lowest = minima
            .iter()
            .min_by(|a, b| a.outcome.cost.total_cmp(&b.outcome.cost));
        if let (Some(enough), Some(lowest)) = (budget.agreeing, lowest)
            && lowest.starts >= enough
        {
            end = SearchEnd::Agreement;
            break;
        }
    }
    minima.sort_by(|a, b| a.outcome.cost.total_cmp(&b.outcome.cost));
    match best {
        Some(best) => Ok(Search {
            minima,
            best,
            starts: tried,
            unconverged,
            unusable,
            evaluations,
            end,
        }),
        None => Err(first_error.unwrap_or_else(|| {
            Error::Executor("there was no start to solve from; give at least one".into())
        })),
    }
}
