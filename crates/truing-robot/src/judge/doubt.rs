//! What makes a result doubtful.

use super::errors::Fitted;
use super::figures::SetResult;
use super::uncertainty::Uncertainty;
use crate::doubt::Doubt;
use crate::estimate::Job;
use crate::estimate::words::shortened;
use crate::identify::Choice;
use crate::model::{Assembly, Owner};
use crate::robot::Unit;
use crate::unknown::State;
use truing::step::ActiveAt;
use truing::{ActiveLimit, Solution};

impl Job {
    pub fn warn(
        &self,
        fitted: &Fitted,
        sets: &[SetResult],
        validation: &[SetResult],
        doubts: &mut Vec<Doubt>,
    ) {
        let reach = self.reach();
        for set in validation {
            let Some(after) = &set.after else { continue };
            // Registration may have made the nominal robot worse: it is as good as the better of both.
            let (best, registered) = match (&set.before, &set.registered) {
                (Some(before), Some(registered)) if before.rms < registered.rms => {
                    (before.rms, false)
                }
                (_, Some(registered)) => (registered.rms, true),
                _ => continue,
            };
            if after.rms > best + NOTHING * reach {
                doubts.push(Doubt::HeldOutWorse {
                    set: set.name.clone(),
                    calibrated: after.rms,
                    nominal: best,
                    registered,
                    fatal: after.rms > WORSE * best,
                });
            }
            if after.rms > ABSURD * reach {
                doubts.push(Doubt::Absurd {
                    set: set.name.clone(),
                    error: after.rms,
                    reach,
                });
            }
        }
        for (set, result) in self.sets.iter().zip(sets) {
            let far = result
                .registered
                .as_ref()
                .is_some_and(|e| e.rms > ELSEWHERE * reach);
            if far && set.frame.is_none() && set.kind.has_frame() && result.unit == "m" {
                doubts.push(Doubt::note(format!(
                    "`{}` lies {:.2} m RMS from the registered nominal robot; if its readings are in a sensor's own frame, \
                     say so: frame = \"tracker\"",
                    set.name,
                    result.registered.as_ref().map_or(0.0, |e| e.rms)
                )));
            }
        }
        for (arm, (nominal, estimate)) in self
            .arms
            .iter()
            .zip(fitted.nominal.robots.iter().zip(&fitted.estimated.robots))
        {
            let lengths = arm
                .robot
                .parameters()
                .iter()
                .zip(nominal.iter().zip(estimate));
            // Where a robot stands and what tool it has may be quite unknown; its links are not.
            let robot = &arm.robot;
            let placed = [robot.base_parameters(), robot.tool_parameters()].concat();
            let lengths = lengths
                .enumerate()
                .filter(|(k, (p, _))| p.unit() == Unit::Meter && !placed.contains(k));
            let (mut total, mut change) = (0.0, 0.0);
            for (_, (_, (nominal, estimate))) in lengths {
                total += nominal.abs();
                change += (estimate - nominal) * (estimate - nominal);
            }
            if change.sqrt() > (DEFORMED * total).max(SLIGHT * reach) {
                doubts.push(Doubt::Deformed {
                    robot: arm.title().to_owned(),
                    change: change.sqrt(),
                    total,
                });
            }
        }
    }

    /// Parameters that moved far, and those of them that the data hardly determine.
    pub fn doubt_moves(
        &self,
        estimated: &State,
        assembly: &Assembly,
        uncertainty: &Uncertainty,
        doubts: &mut Vec<Doubt>,
    ) {
        let (mut weak, mut far) = (Vec::new(), Vec::new());
        let reach = self.reach();
        for (r, arm) in self.arms.iter().enumerate() {
            let first = assembly.robot(r).column();
            for (k, parameter) in arm.robot.parameters().iter().enumerate() {
                let change = estimated.robots[r][k] - parameter.nominal;
                let sigma = uncertainty.std_dev(first + k);
                let (limit, text): (f64, &dyn Fn(f64) -> String) = match parameter.unit() {
                    Unit::Radian => (0.1, &|x| format!("{:.2}°", x.to_degrees())),
                    Unit::Meter => (0.05 * reach, &|x| format!("{:.1} mm", x * 1e3)),
                    Unit::One => (0.05, &|x| format!("{x:.3}")),
                    // Of models: how far is far depends on what they are multiplied with.
                    Unit::Other(_) => continue,
                };
                let sign = if change < 0.0 { "−" } else { "+" };
                let name = arm.parameter_name(k);
                if change.abs() > 0.1 * limit && sigma > WEAK * change.abs() {
                    weak.push(format!(
                        "{name} {sign}{} ± {}",
                        text(change.abs()),
                        text(sigma)
                    ));
                } else if change.abs() > limit {
                    far.push(format!("{name} {sign}{}", text(change.abs())));
                }
            }
        }
        if !weak.is_empty() {
            doubts.push(Doubt::note(format!(
                "moved far although the data determine it only weakly: {}; measure in more varied postures, or add a `prior`",
                shortened(&weak)
            )));
        }
        if !far.is_empty() {
            doubts.push(Doubt::note(format!(
                "far from nominal: {}; the robot file may be wrong there",
                shortened(&far)
            )));
        }
    }

    /// The estimate beside what its file said beforehand: priors and bounds.
    pub fn doubt_limits(
        &self,
        estimated: &State,
        solution: &Solution,
        assembly: &Assembly,
        choices: &[Choice],
        doubts: &mut Vec<Doubt>,
    ) {
        let is_estimated =
            |r: usize, k: usize| choices[assembly.robot(r).column() + k] == Choice::Estimated;
        let beyond: Vec<String> = self
            .estimate
            .priors
            .iter()
            .filter(|(r, k, _)| is_estimated(*r, *k))
            .filter_map(|(r, k, sigma)| {
                let nominal = self.arms[*r].robot.parameters()[*k].nominal;
                let times = (estimated.robots[*r][*k] - nominal).abs() / sigma;
                let name = self.arms[*r].parameter_name(*k);
                (times > BEYOND).then(|| format!("{name} by {times:.1} σ"))
            })
            .collect();
        if !beyond.is_empty() {
            doubts.push(Doubt::note(format!(
                "the data contradict the `prior`: {}; the prior is too tight, or the measurements have errors that are \
                 not in the model",
                shortened(&beyond)
            )));
        }
        // With by how much the cost would fall over the width of the interval.
        let mut at_bounds: Vec<(f64, String)> = self
            .estimate
            .bounds
            .iter()
            .filter(|(r, k, ..)| is_estimated(*r, *k))
            .filter_map(|(r, k, lower, upper)| {
                let side = self.at_bound(*r, *k, estimated.robots[*r][*k])?;
                let column = assembly.robot(*r).column() + k;
                let pull = multiplier(solution, column).map_or(0.0, f64::abs) * (upper - lower);
                let name = self.arms[*r].parameter_name(*k);
                Some((pull, format!("{name} ({side})")))
            })
            .collect();
        at_bounds.sort_by(|a, b| b.0.total_cmp(&a.0));
        let at_bounds: Vec<String> = at_bounds.into_iter().map(|(_, text)| text).collect();
        if !at_bounds.is_empty() {
            let hardest = if at_bounds.len() > 1 {
                " (the strongest pull first)"
            } else {
                ""
            };
            doubts.push(Doubt::note(format!(
                "ended at a bound, beyond which the data would go{hardest}: {}",
                shortened(&at_bounds)
            )));
        }
    }
}

/// What is held or not determined: the scale, columns that these data do not excite.
pub(crate) fn doubt_choices(assembly: &Assembly, choices: &[Choice], doubts: &mut Vec<Doubt>) {
    let named = |wanted: &dyn Fn(&Choice) -> bool| -> Vec<String> {
        let columns = choices.iter().zip(&assembly.columns);
        let named = columns.filter(|(choice, _)| wanted(choice));
        named.map(|(_, column)| column.name.clone()).collect()
    };
    let anchors = named(&|choice| matches!(choice, Choice::Anchor(_)));
    if !anchors.is_empty() {
        doubts.push(Doubt::note(format!(
            "these data leave the scale free: a robot with all lengths longer fits as well; held by {} at nominal \
             ({})",
            anchors.join(", "),
            scale_remedy(assembly, choices)
        )));
    }
    let still = named(&|choice| *choice == Choice::Unexcited);
    for (c, column) in assembly.columns.iter().enumerate() {
        if let (Choice::Unexcited, Owner::Frame(name)) = (&choices[c], &column.owner) {
            doubts.push(Doubt::FrameUndetermined {
                frame: name.clone(),
                component: column.name.clone(),
            });
        }
    }
    let wanted = |c: &usize| matches!(assembly.columns[*c].owner, Owner::Parameter { .. });
    let robots: Vec<&Choice> = (0..choices.len())
        .filter(wanted)
        .map(|c| &choices[c])
        .collect();
    if !robots.contains(&&Choice::Estimated) && robots.contains(&&Choice::Unexcited) {
        doubts.push(Doubt::NothingDetermined);
    }
    if !still.is_empty() {
        doubts.push(Doubt::note(format!(
            "not determined by these data, held at the start (`unexcited`): {}; measure in more varied postures",
            shortened(&still)
        )));
    }
}

/// What would determine the scale, or what it cannot be told from.
fn scale_remedy(assembly: &Assembly, choices: &[Choice]) -> String {
    let instruments: Vec<String> = assembly
        .columns
        .iter()
        .zip(choices)
        .filter(|(column, choice)| {
            let own = matches!(column.owner, Owner::Own { .. }) && !column.owner.is_local();
            own && **choice == Choice::Estimated
        })
        .map(|(column, _)| column.name.clone())
        .collect();
    if instruments.is_empty() {
        "a tracker position or a known distance would determine it".to_owned()
    } else {
        format!(
            "it may be that of {}, which is estimated instead; a known distance would tell them apart",
            instruments.join(", ")
        )
    }
}

/// Rows that were not used may be predicted worse than by the registered nominal robot by this
/// factor before the result is distrusted: where a robot is nearly nominal, chance decides.
const WORSE: f64 = 1.1;

/// Errors on rows that were not used may be this part of the robot's reach.
const ABSURD: f64 = 0.05;

/// Lengths that moved by less in all than this part of the reach are no deformation.
const SLIGHT: f64 = 0.05;

/// Errors that differ by less than this part of the reach do not differ: a millionth is beyond any robot.
const NOTHING: f64 = 1e-6;

/// Readings that lie farther from the registered robot than this part of its reach are of another frame.
const ELSEWHERE: f64 = 0.2;

/// The lengths of a robot's links may move by this share of their sum: no drawing is that wrong, but an
/// arm that collapses onto a point moves by as much as it is long.
const DEFORMED: f64 = 0.1;

/// A parameter whose standard deviation is more than this part of its change is weakly determined.
const WEAK: f64 = 1.0 / 3.0;

/// An estimate further from nominal than so many standard deviations of its prior contradicts it.
const BEYOND: f64 = 4.0;

/// The multiplier of a column's bound, if it is active.
pub(crate) fn multiplier(solution: &Solution, column: usize) -> Option<f64> {
    let of_column = |limit: &&ActiveLimit| limit.limit == ActiveAt::Column(column);
    let limit = solution.limits.iter().find(of_column)?;
    Some(limit.multiplier)
}
