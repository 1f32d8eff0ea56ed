//! The generalised differential model: the regressor's columns in closed form.

use truing::manifold::Pose;
use truing::nalgebra::Vector3;
use truing_robot::Robot;
use truing_robot::robot::{
    Convention, DifferentiateChain, FrameWise, JointKind, ParameterKind, Regressor, Twist,
};

/// The columns of the 6 × Np Jacobian of equation (2), in closed form.
///
/// With P the tool origin and all vectors in frame −1, rows (position; rotation):
///
/// | column | position | rotation |
/// | --- | --- | --- |
/// | dⱼ | x′ⱼ, the x axis after Rot(y, βⱼ) | 0 |
/// | rⱼ | zⱼ | 0 |
/// | αⱼ | x′ⱼ × (P − Oⱼ₋₁) | x′ⱼ |
/// | θⱼ | zⱼ × (P − Oⱼ) | zⱼ |
/// | βⱼ | yⱼ₋₁ × (P − Oⱼ₋₁) | yⱼ₋₁ |
/// | Kⱼ | qⱼ · column of θⱼ, or of rⱼ if joint j slides | likewise |
/// | other parameters of the joint | the slope of its displacement · the same column | likewise |
///
/// Each is the velocity of a turn about an axis or of a shift along it, and is written as a spatial
/// twist, so every tool point is a cross product away. The distal convention has the same columns
/// about its own axes: θⱼ and dⱼ about zⱼ₋₁, αⱼ and aⱼ about xⱼ, βⱼ about yⱼ.
///
/// Source: Khalil, Lemoine & Gautier 1996, equation (2) and its references 7, 12, 14.
#[derive(Debug, Clone, Copy, Default)]
pub struct GeneralisedModel;

impl DifferentiateChain for GeneralisedModel {
    fn regressor(&self, robot: &Robot, parameters: &[f64], q: &[f64], out: &mut Regressor) {
        if !is_by_table(robot) {
            // Frames that no table of the paper has are differentiated by themselves.
            return FrameWise.regressor(robot, parameters, q, out);
        }
        out.twists
            .resize(robot.parameters().len(), Twist::default());
        out.motions.clear();
        let row = robot.complete(q);
        let mut parent = Pose::<f64>::identity();
        for frame in robot.frames() {
            let range = frame.own_parameters();
            let displacement = frame.displacement(parameters, &row);
            let local = frame.transform(&parameters[range.clone()], displacement);
            let pose = parent.compose(&local);
            let kinds = robot.parameters()[range.clone()].iter().map(|p| p.kind);
            let of = |kind: ParameterKind| {
                let mut values = kinds.clone().zip(&parameters[range.clone()]);
                values.find(|(k, _)| *k == kind).map_or(0.0, |(_, v)| *v)
            };
            let slides =
                (frame.motion.as_ref()).is_some_and(|motion| motion.kind == JointKind::Prismatic);
            let axes = if frame.convention() == Some(Convention::DenavitHartenberg) {
                let turned = if slides { 0.0 } else { displacement };
                Axes::distal(&parent, &pose, of(ParameterKind::Theta) + turned)
            } else {
                Axes::modified(&parent, &pose, of(ParameterKind::Beta))
            };
            for k in range {
                out.twists[k] = match robot.parameters()[k].kind {
                    ParameterKind::Alpha => axes.x.turn(),
                    ParameterKind::LengthX => axes.x.shift(),
                    ParameterKind::LengthZ => axes.z.shift(),
                    ParameterKind::Beta => axes.y.turn(),
                    _ => axes.z.turn(),
                };
            }
            if let Some(motion) = &frame.motion {
                let moved = if slides {
                    axes.z.shift()
                } else {
                    axes.z.turn()
                };
                let twists = &mut out.twists;
                motion.by_parameters(parameters, &row, |k, slope| twists[k] = moved.times(slope));
                out.motions.push(moved);
            }
            parent = pose;
        }
        out.tool = parent;
    }
}

/// Whether all frames are of a Denavit–Hartenberg table, by whichever convention.
fn is_by_table(robot: &Robot) -> bool {
    let mut frames = robot.frames().iter();
    frames.all(|frame| !matches!(frame.convention(), None | Some(Convention::General)))
}

/// An axis in space.
struct Axis {
    direction: Vector3<f64>,
    point: Vector3<f64>,
}

impl Axis {
    /// Unit angular velocity about the axis: a point p moves at direction × (p − point).
    fn turn(&self) -> Twist {
        Twist {
            angular: self.direction,
            linear: self.point.cross(&self.direction),
        }
    }

    /// Unit velocity along the axis.
    fn shift(&self) -> Twist {
        Twist {
            angular: Vector3::zeros(),
            linear: self.direction,
        }
    }
}

/// The axes about and along which the parameters of one frame move the tool.
struct Axes {
    x: Axis,
    y: Axis,
    z: Axis,
}

impl Axes {
    /// Rot(y, β) · Rot(x, α) · Trans(x, d) · Rot(z, θ) · Trans(z, r).
    fn modified(parent: &Pose<f64>, frame: &Pose<f64>, beta: f64) -> Self {
        let column = |k: usize| parent.rotation.column(k).into_owned();
        let (sin, cos) = beta.sin_cos();
        Self {
            x: Axis {
                direction: column(0) * cos - column(2) * sin,
                point: parent.translation,
            },
            y: Axis {
                direction: column(1),
                point: parent.translation,
            },
            z: Axis {
                direction: frame.rotation.column(2).into_owned(),
                point: frame.translation,
            },
        }
    }

    /// Rot(z, θ) · Trans(z, d) · Trans(x, a) · Rot(x, α) · Rot(y, β), `theta` with the joint's part.
    fn distal(parent: &Pose<f64>, frame: &Pose<f64>, theta: f64) -> Self {
        let column = |k: usize| parent.rotation.column(k).into_owned();
        let (sin, cos) = theta.sin_cos();
        Self {
            x: Axis {
                direction: column(0) * cos + column(1) * sin,
                point: frame.translation,
            },
            y: Axis {
                direction: frame.rotation.column(1).into_owned(),
                point: frame.translation,
            },
            z: Axis {
                direction: column(2),
                point: parent.translation,
            },
        }
    }
}
