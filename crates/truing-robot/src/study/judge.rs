//! Whether an estimate is the true robot, up to what its measurements cannot see.

use super::cases::{Case, Study};
use super::draw::Drawn;
use crate::error::Error;
use crate::estimate::Estimated;
use crate::identify::Choice;
use crate::judge::ErrorSummary;
use crate::measurement::MeasurementSet;
use crate::measurement::fit::rigid_registration;
use crate::model::{Assembly, Owner, errors_of};
use crate::robot::{Derivatives, Unit};
use crate::unknown::State;
use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};
use truing::nalgebra::Vector3;

/// How a robot may be moved without its measurements changing; tools are compared after the best
/// such motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Symmetry {
    /// Not at all: something is measured in the reference frame.
    None,
    /// Turned and shifted.
    Rigid,
    /// Turned, shifted and scaled.
    Similarity,
}

/// RMS distance between tool points of an estimated and of the true robot in the same postures,
/// after the best motion of the symmetry \[m\].
pub fn tool_error(symmetry: Symmetry, estimated: &[Vector3<f64>], truth: &[Vector3<f64>]) -> f64 {
    // A registration would look for eigenvalues of what is not a number.
    if estimated.iter().any(|p| !p.iter().all(|x| x.is_finite())) {
        return f64::INFINITY;
    }
    let motion = rigid_registration(estimated, truth);
    let count = truth.len().max(1) as f64;
    let moved: Vec<Vector3<f64>> = match symmetry {
        Symmetry::None => estimated.to_vec(),
        Symmetry::Rigid => estimated.iter().map(|p| motion.apply(p)).collect(),
        Symmetry::Similarity => {
            let turned: Vec<Vector3<f64>> = estimated.iter().map(|p| motion.apply(p)).collect();
            let center = truth.iter().sum::<Vector3<f64>>() / count;
            let (mut along, mut size) = (0.0, 0.0);
            for (p, t) in turned.iter().zip(truth) {
                along += (p - center).dot(&(t - center));
                size += (p - center).norm_squared();
            }
            let scale = if size > 0.0 { along / size } else { 1.0 };
            turned
                .iter()
                .map(|p| center + (p - center) * scale)
                .collect()
        }
    };
    let squares = moved.iter().zip(truth).map(|(p, t)| (p - t).norm_squared());
    (squares.sum::<f64>() / count).sqrt()
}

/// What an estimate is worth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Judgement {
    /// RMS of the errors of fresh measurements [m].
    pub fresh: f64,
    /// RMS tool error on random configurations, up to the symmetry [m].
    pub tool: f64,
    /// RMS error of the estimated angles [rad] and lengths [m], where parameters can be compared.
    pub parameters: Option<(f64, f64)>,
}

/// Robots that move together: a distance or a sensor is between them.
#[derive(Debug, Clone)]
pub(super) struct Body {
    /// The robots.
    pub robots: Vec<usize>,
    /// Whether something of it is measured in the reference frame.
    pub pinned: bool,
}

/// The bodies of some sets of measurements.
pub(super) fn bodies(robots: usize, sets: &[MeasurementSet]) -> Vec<Body> {
    let mut of: Vec<usize> = (0..robots).collect();
    let mut join = |a: usize, b: usize| {
        let (from, to) = (of[a].max(of[b]), of[a].min(of[b]));
        of.iter_mut()
            .filter(|body| **body == from)
            .for_each(|body| *body = to);
    };
    for set in sets {
        let first = set.tool().robot;
        for tool in &set.tools[1..] {
            join(first, tool.robot);
        }
        for other in sets {
            if set.frame.is_some() && set.frame == other.frame {
                join(first, other.tool().robot);
            }
        }
    }
    let seen = |set: &&MeasurementSet| set.kind.has_frame() && set.frame.is_none();
    let pinned: BTreeSet<usize> = sets
        .iter()
        .filter(seen)
        .map(|set| of[set.tool().robot])
        .collect();
    let each = (0..robots).map(|body| Body {
        robots: (0..robots).filter(|r| of[*r] == body).collect(),
        pinned: pinned.contains(&body),
    });
    each.filter(|body| !body.robots.is_empty()).collect()
}

/// Judges an estimate by fresh measurements and by random postures.
///
/// # Errors
/// If the fresh measurements cannot be assembled.
pub(super) fn judge(
    study: &Study,
    case: &Case,
    drawn: &Drawn,
    postures: &[Vec<Vec<f64>>],
    estimated: &Estimated,
) -> Result<Judgement, Error> {
    let (state, truth) = (&estimated.state, &drawn.truth);
    let assembly = Assembly::new(&study.arms, &drawn.fresh, state, &Derivatives::default())?;
    let values = assembly.problem.initial();
    let mut errors = Vec::new();
    for (k, set) in drawn.fresh.iter().enumerate() {
        errors.extend(errors_of(set, 0, &assembly.residuals(k, values)));
    }
    // Of several bodies, each is moved by itself.
    let (mut squares, mut count) = (0.0, 0);
    for body in bodies(study.arms.len(), &drawn.sets) {
        let found = tips(study, &body, &drawn.sets, state, postures);
        let truly = tips(study, &body, &drawn.sets, truth, postures);
        let symmetry = match (body.pinned, case.scale_free) {
            (true, _) => Symmetry::None,
            (false, false) => Symmetry::Rigid,
            (false, true) => Symmetry::Similarity,
        };
        squares += tool_error(symmetry, &found, &truly).powi(2) * found.len() as f64;
        count += found.len();
    }
    Ok(Judgement {
        fresh: ErrorSummary::of(&errors).rms,
        tool: (squares / count.max(1) as f64).sqrt(),
        parameters: case.comparable.then(|| parameters(study, truth, estimated)),
    })
}

/// Every tool point that is measured on a body, in every posture.
fn tips(
    study: &Study,
    body: &Body,
    sets: &[MeasurementSet],
    state: &State,
    postures: &[Vec<Vec<f64>>],
) -> Vec<Vector3<f64>> {
    let mut all = Vec::new();
    for r in &body.robots {
        let of_robot = sets.iter().filter(|set| set.tool().robot == *r);
        let mut names: BTreeSet<Option<&String>> =
            of_robot.map(|set| set.tool().target.as_ref()).collect();
        if names.is_empty() {
            names.insert(None);
        }
        for q in &postures[*r] {
            let tool = study.arms[*r].robot.forward(&state.robots[*r], q);
            for name in &names {
                let point = name.and_then(|name| state.target(*r, name));
                all.push(tool.apply(&point.unwrap_or_default()));
            }
        }
    }
    all
}

/// RMS errors of the estimated parameters: angles up to full turns [rad], lengths [m].
fn parameters(study: &Study, truth: &State, estimated: &Estimated) -> (f64, f64) {
    let (mut angles, mut lengths) = (Vec::new(), Vec::new());
    for (column, choice) in estimated.columns.iter().zip(&estimated.choices) {
        let (Owner::Parameter { robot, parameter }, Choice::Estimated) = (&column.owner, choice)
        else {
            continue;
        };
        let off = estimated.state.robots[*robot][*parameter] - truth.robots[*robot][*parameter];
        match study.arms[*robot].robot.parameters()[*parameter].unit() {
            Unit::Radian => angles.push((off + PI).rem_euclid(TAU) - PI),
            Unit::Meter => lengths.push(off),
            Unit::One | Unit::Other(_) => {}
        }
    }
    (
        ErrorSummary::of(&angles).rms,
        ErrorSummary::of(&lengths).rms,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::{Tool, kinds};
    use truing::manifold::{Pose, so3};

    fn cloud() -> Vec<Vector3<f64>> {
        let wave = |k: usize, f: f64| (f * k as f64).sin();
        (0..20)
            .map(|k| Vector3::new(wave(k, 1.0), 0.5 * wave(k, 1.7), 0.3 + wave(k, 2.9)))
            .collect()
    }

    #[test]
    fn motions_of_the_symmetry_are_no_errors() {
        let truth = cloud();
        let motion = Pose {
            rotation: so3::exp_matrix(&[0.3, -2.0, 0.7]),
            translation: Vector3::new(0.1, -0.4, 2.0),
        };
        let moved: Vec<_> = truth.iter().map(|p| motion.apply(p)).collect();
        let grown: Vec<_> = moved.iter().map(|p| p * 1.3).collect();
        let mirrored: Vec<_> = truth.iter().map(|p| Vector3::new(-p.x, p.y, p.z)).collect();
        for (symmetry, points, right) in [
            (Symmetry::None, &truth, true),
            (Symmetry::None, &moved, false),
            (Symmetry::Rigid, &moved, true),
            (Symmetry::Rigid, &grown, false),
            (Symmetry::Similarity, &grown, true),
            (Symmetry::Similarity, &mirrored, false),
        ] {
            let error = tool_error(symmetry, points, &truth);
            assert_eq!(error < 1e-12, right, "{symmetry:?}: {error}");
        }
        assert_eq!(
            tool_error(Symmetry::Rigid, &[truth[0] * f64::NAN], &truth[..1]),
            f64::INFINITY
        );
    }

    #[test]
    fn robots_that_are_measured_together_move_together() {
        let plane = |robot| kinds::unknown_plane("s", Vec::new(), [""; 0]).robot(robot);
        let second = Tool::default();
        let between = kinds::distance("s", Vec::new(), Vec::new(), None);
        let between = between.robot(2).second(second);
        let seen = kinds::position("s", Vec::new(), &[]).robot(1);
        let found = bodies(3, &[plane(0), between, seen.clone()]);
        assert_eq!(found.len(), 2);
        assert_eq!(
            (&found[0].robots[..], found[0].pinned),
            (&[0, 2][..], false)
        );
        assert_eq!((&found[1].robots[..], found[1].pinned), (&[1][..], true));
        let framed = [0, 1].map(|r| {
            let set = kinds::position("s", Vec::new(), &[]);
            set.robot(r).frame("tracker")
        });
        let found = bodies(2, &framed);
        assert_eq!((found.len(), found[0].pinned), (1, false));
    }
}
