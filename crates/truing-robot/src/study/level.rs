//! Errors scaled to a mean initial tool error.

use super::cases::{Case, Study};
use super::draw::{self, Stream};
use crate::error::Error;
use crate::text::Spanned;

/// Errors of a case at a level, the same factor for all trials.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scaled {
    /// By which the errors of the study file are multiplied.
    pub factor: f64,
    /// Mean over trials and random configurations of the distance between the tools of the true and
    /// of the nominal robot \[m\].
    pub tool_error: f64,
}

/// How close the mean tool error comes to what was asked for, relative.
const CLOSE: f64 = 1e-6;

/// So many trials tell the mean well enough.
const ENOUGH: usize = 1000;

/// The directions of the errors of a trial, and nominal tools to compare with.
struct Trial {
    errors: Vec<Vec<f64>>,
    postures: Vec<Vec<Vec<f64>>>,
}

/// The factor by which the mean tool error over the trials (the first thousand, if there are more) becomes the level; 1 without a level.
///
/// # Errors
/// If no factor does.
pub(super) fn scale(
    study: &Study,
    case: &Case,
    number: usize,
    level: Option<&Spanned<f64>>,
) -> Result<Scaled, Error> {
    let trials: Vec<Trial> = (0..study.trials.min(ENOUGH))
        .map(|trial| {
            let stream = Stream {
                seed: study.seed,
                level: number,
                trial,
            };
            Trial {
                errors: draw::errors(study, case, stream),
                postures: draw::postures(study, stream),
            }
        })
        .collect();
    let mean = |factor: f64| -> f64 {
        let each = trials.iter().map(|trial| tool_error(study, trial, factor));
        each.sum::<f64>() / trials.len() as f64
    };
    let Some(level) = level else {
        let tool_error = mean(1.0);
        return Ok(Scaled {
            factor: 1.0,
            tool_error,
        });
    };
    solve(&mean, level.value).ok_or_else(|| {
        let message = format!(
            "no size of the errors makes the mean tool error {} m in the case `{}`",
            level.value, case.name
        );
        study
            .source
            .error_at(level.span.clone(), message)
            .with_help("ask for a smaller one, or let more parameters have errors")
            .into()
    })
}

/// Mean distance between true and nominal tools of a trial \[m\].
fn tool_error(study: &Study, trial: &Trial, factor: f64) -> f64 {
    let robots = draw::robots(study, &trial.errors, factor);
    let (mut sum, mut count) = (0.0, 0);
    for (r, arm) in study.arms.iter().enumerate() {
        let nominal = arm.robot.nominal();
        for q in &trial.postures[r] {
            let truly = arm.robot.forward(&robots[r], q).translation;
            sum += (truly - arm.robot.forward(&nominal, q).translation).norm();
            count += 1;
        }
    }
    sum / f64::from(count.max(1))
}

/// The smallest factor found with mean(factor) = level: doubling until it is bracketed, then false
/// position (the Illinois variant).
fn solve(mean: &impl Fn(f64) -> f64, level: f64) -> Option<Scaled> {
    const SMALL: f64 = 1e-6;
    let slope = mean(SMALL) / SMALL;
    if !(slope > 0.0 && slope.is_finite()) {
        return None;
    }
    let (mut low, mut high) = ((0.0, -level), (0.0, -level));
    let mut factor = level / slope;
    for _ in 0..20 {
        high = (factor, mean(factor) - level);
        if high.1 >= 0.0 {
            break;
        }
        low = high;
        factor *= 2.0;
    }
    if high.1.is_nan() || high.1 < 0.0 {
        return None;
    }
    let mut side = 0;
    for _ in 0..100 {
        let factor = (low.0 * high.1 - high.0 * low.1) / (high.1 - low.1);
        let off = mean(factor) - level;
        if off.abs() <= CLOSE * level {
            return Some(Scaled {
                factor,
                tool_error: off + level,
            });
        }
        // An end that stays is given half its weight.
        if off < 0.0 {
            if side == -1 {
                high.1 *= 0.5;
            }
            (low, side) = ((factor, off), -1);
        } else {
            if side == 1 {
                low.1 *= 0.5;
            }
            (high, side) = ((factor, off), 1);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::solve;

    #[test]
    fn the_factor_is_found_where_there_is_one() {
        // Saturates at 2, like a robot whose angles are wrong at random.
        let mean = |s: f64| 2.0 * s / (1.0 + s);
        for level in [1e-6, 0.1, 1.0, 1.9] {
            let scaled = solve(&mean, level).unwrap();
            assert!((mean(scaled.factor) - level).abs() <= 1e-6 * level);
            assert_eq!(scaled.tool_error, mean(scaled.factor));
        }
        assert!(solve(&mean, 2.5).is_none());
        assert!(solve(&|_| 0.0, 0.1).is_none());
    }
}
