//! What makes a result doubtful, in words.

use super::measurement::Measured;
use super::result::SetResult;
use super::run::{Calibration, Fitted};
use crate::kinematics::Unit;

impl Calibration {
    pub(super) fn warn(
        &self,
        fitted: &Fitted,
        sets: &[SetResult],
        validation: &[SetResult],
        warnings: &mut Vec<String>,
    ) {
        for set in validation {
            if let (Some(registered), Some(after)) = (&set.registered, &set.after)
                && after.rms > registered.rms + NOTHING
            {
                let distrust = if after.rms > WORSE * registered.rms {
                    DISTRUST
                } else {
                    ""
                };
                warnings.push(format!(
                        "{distrust}the calibrated robot predicts `{}` worse than the registered nominal one: {:.4} mm \
                         against {:.4} mm RMS on rows that were not used",
                        set.name,
                        after.rms * 1e3,
                        registered.rms * 1e3
                    ));
            }
        }
        for (set, result) in self.sets.iter().zip(sets) {
            let far = result.registered.as_ref().is_some_and(|e| e.rms > 0.2);
            if far
                && set.frame.is_none()
                && matches!(set.measured, Measured::Position(_) | Measured::Pose(_))
            {
                warnings.push(format!(
                    "`{}` lies {:.2} m RMS from the registered nominal robot; if its readings are in a sensor's own frame, \
                     say so: frame = \"tracker\"",
                    set.name,
                    result.registered.as_ref().map_or(0.0, |e| e.rms)
                ));
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
            if change.sqrt() > (DEFORMED * total).max(SLIGHT) {
                warnings.push(format!(
                    "{DISTRUST}the lengths of {} moved by {:.0} mm in all, of {total:.3} m: the data do not determine \
                     them; add a `prior` about nominal, or measurements that do",
                    if arm.name.is_empty() { arm.robot.name() } else { &arm.name },
                    change.sqrt() * 1e3
                ));
            }
        }
        let mut moved = Vec::new();
        for (arm, (nominal, estimate)) in self
            .arms
            .iter()
            .zip(fitted.nominal.robots.iter().zip(&fitted.estimated.robots))
        {
            for (parameter, (nominal, estimate)) in nominal.iter().zip(estimate).enumerate() {
                let change = estimate - nominal;
                let (limit, text) = match arm.robot.parameters()[parameter].unit() {
                    Unit::Radian => (0.1, format!("{:+.2}°", change.to_degrees())),
                    Unit::Meter => (0.05, format!("{:+.1} mm", change * 1e3)),
                    Unit::One => (0.05, format!("{change:+.3}")),
                };
                if change.abs() > limit {
                    moved.push(format!("{} {text}", arm.parameter_name(parameter)));
                }
            }
        }
        if !moved.is_empty() {
            warnings.push(format!(
                "far from nominal: {}; the data may determine this only weakly (see σ), or the robot file may be wrong",
                shortened(&moved)
            ));
        }
    }
}

/// How a warning starts that makes a result untrusted.
pub(super) const DISTRUST: &str = "not to be trusted: ";

/// Rows that were not used may be predicted worse than by the registered nominal robot by this
/// factor before the result is distrusted: where a robot is nearly nominal, chance decides.
const WORSE: f64 = 1.1;

/// Lengths that moved by less in all \[m\] are no deformation, whatever a robot's size.
const SLIGHT: f64 = 0.05;

/// Errors that differ by less [m] do not differ: a micrometre is beyond any robot.
const NOTHING: f64 = 1e-6;

/// The lengths of a robot's links may move by this share of their sum: no drawing is that wrong, but an
/// arm that collapses onto a point moves by as much as it is long.
const DEFORMED: f64 = 0.1;

/// A list in words, its first eight entries if it is longer.
pub(super) fn shortened(all: &[String]) -> String {
    match all.get(8..) {
        None | Some([]) => all.join(", "),
        Some(rest) => format!("{} and {} more", all[..8].join(", "), rest.len()),
    }
}
