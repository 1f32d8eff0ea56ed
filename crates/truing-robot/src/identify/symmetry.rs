//! The symmetries behind missing dimensions: motions of a robot as a whole, and growing, that
//! measurements cannot see.
//!
//! A symmetry moves every tool point p by t + ω × p + s·p. What that does to the residuals is ∂r/∂p
//! times it, whatever the kind of measurement; the constraints cannot see it if planes, points,
//! distances, sensor frames and tool points, which are estimated too, take it up.

use super::compressed::{STRUCTURE, compressed};
use super::twin::POSTURES;
use crate::error::Error;
use crate::measurement::MeasurementSet;
use crate::model::{Assembly, Owner};
use crate::robot::serial::MOTIONS;
use crate::robot::{
    Arm, Derivatives, DifferentiateChain, FrameWise, Regressor, Robot, Twist, posture,
};
use crate::unknown::State;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::fmt;
use std::sync::Arc;
use truing::identifiability::{ColumnStatus, base_columns, eliminate};
use truing::nalgebra::{DMatrix, DVector, Vector3};

/// One dimension of what the constraints cannot see.
#[derive(Debug, Clone, PartialEq)]
pub struct Symmetry {
    /// What moves.
    pub motion: Motion,
    /// The robot that it moves alone; none for all robots together.
    pub robot: Option<String>,
}

/// A motion of a robot as a whole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// Along a unit vector.
    Translation(Vector3<f64>),
    /// About a unit vector.
    Rotation(Vector3<f64>),
    /// All lengths grow alike.
    Scale,
}

impl fmt::Display for Symmetry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.motion {
            Motion::Translation(along) => write!(f, "translation along {}", direction(&along))?,
            Motion::Rotation(about) => write!(f, "rotation about {}", direction(&about))?,
            Motion::Scale => f.write_str("scale")?,
        }
        match &self.robot {
            Some(robot) => write!(f, " of {robot} alone"),
            None => Ok(()),
        }
    }
}

/// A direction in words: an axis by its letter, others by components.
pub fn direction(v: &Vector3<f64>) -> String {
    let rounded = v.map(|x| (x * 100.0).round() / 100.0 + 0.0);
    for (k, letter) in ["x", "y", "z"].iter().enumerate() {
        let rest = (0..3).filter(|i| *i != k).all(|i| v[i].abs() < 1e-9);
        if rest && v[k] > 0.0 {
            return (*letter).to_owned();
        }
    }
    format!("({:.2}, {:.2}, {:.2})", rounded.x, rounded.y, rounded.z)
}

/// What the constraints cannot see, from sets that satisfy them exactly; of `wanted` columns, those
/// that are not a robot's take motions up, and a robot's must be able to grow for its scale to be free.
///
/// # Errors
/// If the sets cannot be assembled.
pub fn symmetries(
    arms: &[Arm],
    sets: &[MeasurementSet],
    state: &State,
    wanted: &[usize],
) -> Result<Vec<Symmetry>, Error> {
    if arms
        .iter()
        .any(|arm| arm.robot.parameters().len() < MOTIONS)
    {
        return Ok(Vec::new());
    }
    let motions = Derivatives::Regressor(Arc::new(Motions));
    // Kinds that are differentiated through the regressor see the motions there, others in the robot itself.
    let moved = arms.iter().zip(&state.robots).map(|(arm, own)| Arm {
        name: arm.name.clone(),
        robot: arm.robot.moved_as_a_whole(own),
    });
    let moved: Vec<Arm> = moved.collect();
    let assembly = Assembly::new(&moved, sets, state, &motions)?;
    let others: Vec<usize> = wanted
        .iter()
        .copied()
        .filter(|c| !matches!(assembly.columns[*c].owner, Owner::Parameter { .. }))
        .collect();
    let mut columns = others.clone();
    for robot in 0..arms.len() {
        let first = assembly.robot(robot).column();
        columns.extend(first..first + MOTIONS);
    }
    let seen = compressed(&assembly, &columns);
    let (others, seen) = seen.columns_range_pair(..others.len(), others.len()..);
    let (others, seen) = (others.into_owned(), seen.into_owned());
    let left = eliminate(&seen, &others, STRUCTURE);

    // A robot alone first, then all of them together.
    let mut found = Vec::new();
    let mut alone: Option<Blind> = None;
    let grows: Vec<bool> = (0..arms.len())
        .map(|robot| can_grow(arms, robot, sets, state, wanted, &assembly))
        .collect();
    if arms.len() > 1 {
        for (robot, arm) in arms.iter().enumerate() {
            let own = |m: &DMatrix<f64>| m.columns(robot * MOTIONS, MOTIONS).into_owned();
            let blind = Blind::new(&own(&left), &own(&seen), grows[robot]);
            let name = Some(arm.name.clone());
            found.extend(blind.motions().into_iter().map(|motion| Symmetry {
                motion,
                robot: name.clone(),
            }));
            alone = Some(match alone {
                None => blind,
                Some(before) => before.also(&blind),
            });
        }
    }
    let together = |m: &DMatrix<f64>| {
        let parts = (0..arms.len()).map(|robot| m.columns(robot * MOTIONS, MOTIONS));
        parts.fold(DMatrix::zeros(m.nrows(), MOTIONS), |sum, part| sum + part)
    };
    let all = Blind::new(
        &together(&left),
        &together(&seen),
        grows.iter().all(|grows| *grows),
    );
    let new = match &alone {
        Some(alone) => all.beyond(alone),
        None => all,
    };
    found.extend(new.motions().into_iter().map(|motion| Symmetry {
        motion,
        robot: None,
    }));
    Ok(found)
}

/// In place of a robot's parameters, the motions of the robot as a whole: where a regressor has the
/// twists of the first seven parameters, this has those of the motions, and zeros for the rest.
struct Motions;

impl DifferentiateChain for Motions {
    fn regressor(&self, robot: &Robot, parameters: &[f64], q: &[f64], out: &mut Regressor) {
        FrameWise.regressor(robot, parameters, q, out);
        out.twists.fill(Twist::default());
        for k in 0..3 {
            out.twists[k].linear[k] = 1.0;
            out.twists[k + 3].angular[k] = 1.0;
        }
        // A tool point that is not the tool origin grows by a column of its own.
        out.twists[6].linear = out.tool.translation;
    }
}

/// Whether the wanted parameters of a robot can make it grow as a whole, wherever it then stands.
fn can_grow(
    arms: &[Arm],
    robot: usize,
    sets: &[MeasurementSet],
    state: &State,
    wanted: &[usize],
    assembly: &Assembly,
) -> bool {
    let (arm, parameters) = (&arms[robot].robot, &state.robots[robot]);
    let limits = posture::limits(arm);
    let mut rng = ChaCha8Rng::seed_from_u64(robot as u64);
    let own: Vec<usize> = (wanted.iter())
        .filter_map(|c| match assembly.columns[*c].owner {
            Owner::Parameter {
                robot: r,
                parameter,
            } if r == robot => Some(parameter),
            _ => None,
        })
        .collect();
    // The tool origin does not matter where only points on the tool are measured, which are estimated.
    let mut on_robot = sets
        .iter()
        .filter(|set| set.tool().robot == robot)
        .peekable();
    let points = on_robot.peek().is_some() && on_robot.all(|set| set.tool().target.is_some());
    let mut regressor = Regressor::default();
    let mut columns = vec![Vec::new(); own.len() + 6 + 3 + 1];
    for _ in 0..POSTURES / 4 {
        let q = posture::random(&limits, &mut rng);
        FrameWise.regressor(arm, parameters, &q, &mut regressor);
        let tool = &regressor.tool;
        let of_parameters = own.iter().map(|p| regressor.twists[*p]);
        let rigid = (0..6).map(|k| {
            let mut twist = Twist::default();
            match k {
                0..3 => twist.linear[k] = 1.0,
                _ => twist.angular[k - 3] = 1.0,
            }
            twist
        });
        let shift = (0..3).map(|k| Twist {
            linear: tool.rotation.column(k) * f64::from(u8::from(points)),
            angular: Vector3::zeros(),
        });
        let growing = Twist {
            linear: tool.translation,
            angular: Vector3::zeros(),
        };
        let twists = of_parameters.chain(rigid).chain(shift).chain([growing]);
        for (column, twist) in columns.iter_mut().zip(twists) {
            column.extend_from_slice(twist.at(&tool.translation).as_slice());
            column.extend_from_slice(twist.angular.as_slice());
        }
    }
    let columns: Vec<DVector<f64>> = columns.into_iter().map(DVector::from_vec).collect();
    let order: Vec<usize> = (0..columns.len()).collect();
    let status = base_columns(&DMatrix::from_columns(&columns), &order, STRUCTURE);
    status.last() != Some(&ColumnStatus::Identifiable)
}

/// A space of motions (t, ω, s) that the constraints cannot see, by an orthonormal basis.
struct Blind {
    basis: Vec<DVector<f64>>,
}

/// A component below this is none.
const NOTHING: f64 = 1e-4;

impl Blind {
    /// From what is `left` of the motions' columns `seen` after elimination.
    fn new(left: &DMatrix<f64>, seen: &DMatrix<f64>, grows: bool) -> Self {
        // A metre is as much as a radian and a doubling; a column that does nothing is not seen.
        let largest = seen.column_iter().map(|c| c.norm()).fold(0.0, f64::max);
        let scaled = left / largest.max(f64::MIN_POSITIVE);
        let mut basis = null_space(&scaled, STRUCTURE);
        if !grows {
            basis = without(&basis, 6);
        }
        Self { basis }
    }

    /// What neither of two sees.
    fn also(&self, other: &Self) -> Self {
        // (1 − P)v = 0 for both projectors.
        let rows = |blind: &Self| {
            let mut rest = DMatrix::identity(MOTIONS, MOTIONS);
            for v in &blind.basis {
                rest -= v * v.transpose();
            }
            rest
        };
        let (a, b) = (rows(self), rows(other));
        let both = DMatrix::from_fn(2 * MOTIONS, MOTIONS, |i, k| {
            if i < MOTIONS {
                a[(i, k)]
            } else {
                b[(i - MOTIONS, k)]
            }
        });
        Self {
            basis: null_space(&both, NOTHING),
        }
    }

    /// What this has beyond another.
    fn beyond(&self, other: &Self) -> Self {
        let mut known = other.basis.clone();
        let mut basis = Vec::new();
        for v in &self.basis {
            let mut rest = v.clone();
            for u in &known {
                rest.axpy(-u.dot(v), u, 1.0);
            }
            if rest.norm() > NOTHING {
                let unit = rest.normalize();
                known.push(unit.clone());
                basis.push(unit);
            }
        }
        Self { basis }
    }

    /// Translations, then rotations, then scale, each along and about as few directions as can be.
    fn motions(&self) -> Vec<Motion> {
        let mut rigid = self.basis.clone();
        let scale = rigid.iter().any(|v| v[6].abs() > NOTHING);
        if scale {
            rigid = without(&rigid, 6);
        }
        let mut straight = rigid.clone();
        for k in 3..6 {
            straight = without(&straight, k);
        }
        let part = |all: &[DVector<f64>], first: usize| -> Vec<Vector3<f64>> {
            let columns = all
                .iter()
                .map(|v| Vector3::new(v[first], v[first + 1], v[first + 2]));
            span(columns)
        };
        let along = part(&straight, 0).into_iter().map(Motion::Translation);
        let about = part(&rigid, 3).into_iter().map(Motion::Rotation);
        let scale = scale.then_some(Motion::Scale);
        along.chain(about).chain(scale).collect()
    }
}

/// An orthonormal basis of the vectors that a matrix takes to (almost) nothing.
fn null_space(matrix: &DMatrix<f64>, tolerance: f64) -> Vec<DVector<f64>> {
    let n = matrix.ncols();
    // Rows enough for a full set of right singular vectors.
    let square = matrix.clone().resize(matrix.nrows().max(n), n, 0.0);
    let svd = square.svd(false, true);
    let Some(v_t) = svd.v_t else {
        return Vec::new();
    };
    (0..n)
        .filter(|k| svd.singular_values[*k] < tolerance)
        .map(|k| v_t.row(k).transpose())
        .collect()
}

/// The subspace without a component: an orthonormal basis of it.
fn without(basis: &[DVector<f64>], component: usize) -> Vec<DVector<f64>> {
    let Some(first) = basis.first() else {
        return Vec::new();
    };
    let row = DMatrix::from_fn(1, basis.len(), |_, k| basis[k][component]);
    if row.norm() < NOTHING {
        return basis.to_vec();
    }
    let combine = |c: DVector<f64>| {
        let zero = DVector::zeros(first.len());
        basis.iter().zip(c.iter()).fold(zero, |mut sum, (v, c)| {
            sum.axpy(*c, v, 1.0);
            sum
        })
    };
    null_space(&row, NOTHING).into_iter().map(combine).collect()
}

/// An orthonormal basis of the span of vectors, along the axes of the frame where it can be.
fn span(vectors: impl Iterator<Item = Vector3<f64>>) -> Vec<Vector3<f64>> {
    let mut basis: Vec<Vector3<f64>> = Vec::new();
    for v in vectors {
        let rest = basis.iter().fold(v, |rest, u| rest - u * u.dot(&v));
        if rest.norm() > NOTHING {
            basis.push(rest.normalize());
        }
    }
    let clean = |v: Vector3<f64>| {
        let v = v.map(|x| if x.abs() < 1e-7 { 0.0 } else { x }).normalize();
        let sign = if v[v.iamax()] < 0.0 { -1.0 } else { 1.0 };
        (v * sign).map(|x| x + 0.0)
    };
    match basis.as_slice() {
        [a, b] => {
            // Across the normal: the axis that lies in the plane best, and what is square to it.
            let normal = a.cross(b);
            let axis = normal.iamin();
            let first = Vector3::ith(axis, 1.0) - normal * normal[axis];
            vec![clean(first), clean(normal.cross(&first))]
        }
        [_, _, _] => vec![Vector3::x(), Vector3::y(), Vector3::z()],
        other => other.iter().copied().map(clean).collect(),
    }
}
