//! Touches of planes, measured in joint space.

use crate::measurement::{MeasurementSet, Touched};
use crate::model::Assembly;
use crate::robot::{
    Arm, Convention, DifferentiateChain, FrameWise, JointKind, Motion, ParameterKind, Regressor,
    Robot, Twist,
};
use truing::manifold::{Plane, Plane3, Point3, Vector};
use truing::nalgebra::{Matrix3x2, Vector3};
use truing::{Linearization, Values, Var, Variable, autodiff};

/// Touches of planes of one set: their residual depends on the joints by h = ‖∂r/∂q‖, and
/// e = h̄ · r / √(h² + (f·h̄)²) is, but for a constant, how far the joints are from a touch.
///
/// With r alone an arm that shrinks, or whose axes turn parallel, gains: its touches are near any
/// plane. Measured in joint space they are as far from it as before (Sampson 1982, "Fitting conic
/// sections to very scattered data", does so with curves).
pub struct Touches<'a> {
    robot: &'a Robot,
    /// Joint values of every touch.
    q: &'a [Vec<f64>],
    /// The plane that each touches, or the one that all do.
    planes: Vec<Var<Plane3>>,
    of_row: &'a [usize],
    known: Plane<f64>,
    parameters: Var<Vector>,
    target: Option<Var<Point3>>,
    /// First row of the residual.
    first: usize,
    /// Unit of each moving frame's joint: one, or a length where it slides.
    units: Vec<f64>,
    /// Place of each moving frame's joint in the chain.
    places: Vec<usize>,
    /// Place of each parameter in the chain: what is nearer to the base moves what is nearer to the tool.
    order: Vec<usize>,
    /// h̄ \[m/rad\].
    mean: f64,
}

/// h² may not get smaller than the square of this part of its mean: touches where no joint moves the
/// tool off the plane would weigh infinitely.
const FLOOR: f64 = 0.2;

impl<'a> Touches<'a> {
    /// The touches of planes among the sets, with h̄ at `x`; `length` is what a radian is worth.
    pub fn of(
        arms: &'a [Arm],
        sets: &'a [MeasurementSet],
        assembly: &Assembly,
        x: &Values,
        length: f64,
    ) -> Vec<Self> {
        let mut all = Vec::new();
        for (k, set) in sets.iter().enumerate() {
            let none = Plane {
                normal: Vector3::zeros(),
                distance: 0.0,
            };
            let (known, planes, of_row): (_, Vec<Var<Plane3>>, &[usize]) = match set.kind.touched()
            {
                Some(Touched::Known(plane)) => (plane, Vec::new(), &[]),
                Some(Touched::Unknown(name)) => {
                    let var = |group: &String| assembly.own(&set.name, group, name)?.typed();
                    let planes = set.groups.names.iter().map_while(var);
                    (none, planes.collect(), &set.groups.of_row)
                }
                None => continue,
            };
            let tool = set.tool();
            let robot = &arms[tool.robot].robot;
            let unit = |kind| {
                if kind == JointKind::Prismatic {
                    length
                } else {
                    1.0
                }
            };
            let mut touches = Self {
                robot,
                q: &tool.q,
                planes,
                of_row,
                known,
                parameters: assembly.robot(tool.robot),
                target: tool
                    .target
                    .as_ref()
                    .and_then(|name| assembly.target(tool.robot, name)?.typed()),
                first: assembly.problem.block_rows(k).start,
                units: motions(robot).map(|(_, m)| unit(m.kind)).collect(),
                places: motions(robot)
                    .map(|(frame, _)| place_of_joint(robot, frame))
                    .collect(),
                order: (0..robot.parameters().len())
                    .map(|p| place(robot, p))
                    .collect(),
                mean: 0.0,
            };
            let mut regressor = Regressor::default();
            let squares: f64 = (0..set.len())
                .map(|row| touches.slope(row, x, &mut regressor).1)
                .sum();
            touches.mean = (squares / set.len().max(1) as f64).sqrt();
            if touches.mean > 0.0 {
                all.push(touches);
            }
        }
        all
    }

    fn plane(&self, row: usize, x: &Values) -> Plane<f64> {
        match self.of_row.get(row) {
            Some(group) => x.get(self.planes[*group]),
            None => self.known,
        }
    }

    /// The tool point of a touch, and h².
    fn slope(&self, row: usize, x: &Values, regressor: &mut Regressor) -> (Vector3<f64>, f64) {
        let q = &self.q[row];
        FrameWise.regressor(self.robot, x.raw(self.parameters), q, regressor);
        let target = self.target.map_or_else(Vector3::zeros, |var| x.get(var));
        let tip = regressor.tool.apply(&target);
        let normal = self.plane(row, x).normal;
        let joints = regressor.motions.iter().zip(&self.units);
        let slope = |(motion, unit): (&Twist, &f64)| (unit * normal.dot(&motion.at(&tip))).powi(2);
        (tip, joints.map(slope).sum())
    }

    /// e / r, and √(h² + (f·h̄)²), for a touch.
    fn factor(&self, square: f64) -> (f64, f64) {
        let length = (square + (FLOOR * self.mean).powi(2)).sqrt();
        (self.mean / length, length)
    }

    /// Turns residuals r into e.
    pub fn residual(&self, x: &Values, r: &mut [f64]) {
        let mut regressor = Regressor::default();
        for row in 0..self.q.len() {
            let (_, square) = self.slope(row, x, &mut regressor);
            r[self.first + row] *= self.factor(square).0;
        }
    }

    /// Turns r and J into e and ∂e = h̄/H · ∂r − r · h̄/H³ · ½∂(h²), with
    /// ½∂(h²)/∂b = Σₖ (n·uₖ) ∂(n·uₖ)/∂b over the joints k, uₖ the velocity of the tool point.
    ///
    /// The velocity uₖ moves with parameter b by ω × u, ω that of the one nearer to the base and u that
    /// of the other; with the tool point by ωₖ × R; with the plane by ∂n.
    pub fn linearize(
        &self,
        x: &Values,
        lin: &mut Linearization,
        entry: &dyn Fn(usize, usize) -> usize,
    ) {
        let mut regressor = Regressor::default();
        // (n·uₖ) n, uₖ and k, for every joint.
        let mut joints: Vec<(Vector3<f64>, Vector3<f64>, usize)> = Vec::new();
        let first = self.parameters.column();
        for row in 0..self.q.len() {
            let (tip, square) = self.slope(row, x, &mut regressor);
            let (factor, length) = self.factor(square);
            let at = self.first + row;
            let r = lin.residual[at];
            let normal = self.plane(row, x).normal;
            joints.clear();
            let motions = regressor.motions.iter().zip(&self.units).enumerate();
            joints.extend(motions.map(|(k, (motion, unit))| {
                let u = motion.at(&tip);
                (normal * (unit * unit * normal.dot(&u)), u, k)
            }));
            let bend = r * factor / (length * length);
            let mut put = |column: usize, half: f64| {
                let value = &mut lin.values[entry(column, at)];
                *value = *value * factor - bend * half;
            };
            for (b, twist) in regressor.twists.iter().enumerate() {
                let u = twist.at(&tip);
                let half: f64 = joints
                    .iter()
                    .map(|(weight, own, k)| {
                        weight.dot(&if self.order[b] < self.places[*k] {
                            twist.angular.cross(own)
                        } else {
                            regressor.motions[*k].angular.cross(&u)
                        })
                    })
                    .sum();
                put(first + b, half);
            }
            if let Some(target) = self.target {
                for c in 0..3 {
                    let axis = regressor.tool.rotation.column(c);
                    let half = |(weight, _, k): &(Vector3<f64>, Vector3<f64>, usize)| {
                        weight.dot(&regressor.motions[*k].angular.cross(&axis))
                    };
                    put(target.column() + c, joints.iter().map(half).sum());
                }
            }
            if let Some(group) = self.of_row.get(row) {
                let plane = self.planes[*group];
                let turned = normal_by_tangent(x.raw(plane));
                for c in 0..3 {
                    let by = match c {
                        2 => 0.0,
                        _ => joints
                            .iter()
                            .map(|(weight, u, _)| weight.dot(&normal) * u.dot(&turned.column(c)))
                            .sum(),
                    };
                    put(plane.column() + c, by);
                }
            }
            lin.residual[at] *= factor;
        }
    }
}

/// ∂n/∂δ of a plane's normal by its two tilts, at δ = 0.
fn normal_by_tangent(stored: &[f64]) -> Matrix3x2<f64> {
    let (_, jacobian) = autodiff::small::<3, 3>(&[0.0; 3], |delta, out| {
        let mut moved = [delta[0]; 4];
        Plane3::plus(stored, delta, &mut moved);
        out.copy_from_slice(Plane3::view(&moved).normal.as_slice());
    });
    jacobian.fixed_columns::<2>(0).into_owned()
}

/// The moving frames, with their numbers.
fn motions(robot: &Robot) -> impl Iterator<Item = (usize, &Motion)> {
    let frames = robot.frames().iter().enumerate();
    frames.filter_map(|(k, frame)| Some((k, frame.motion.as_ref()?)))
}

/// Places of a frame's motions in the chain, from the base on: so many a frame.
const PLACES: usize = 8;

/// Place of the motion of a frame's joint: about or along the axis of θ and r, which commute; last in a frame that
/// is not of a table.
fn place_of_joint(robot: &Robot, frame: usize) -> usize {
    let within = match robot.frames()[frame].convention() {
        Some(Convention::KhalilKleinfinger) => 3,
        Some(Convention::DenavitHartenberg) => 0,
        Some(Convention::General) | None => PLACES - 1,
    };
    frame * PLACES + within
}

/// Place of a parameter's motion in the chain, from the base on.
fn place(robot: &Robot, parameter: usize) -> usize {
    let p = &robot.parameters()[parameter];
    let modified = robot.frames()[p.frame].convention() == Some(Convention::KhalilKleinfinger);
    let within = match (p.kind, modified) {
        (ParameterKind::Beta, true) => 0,
        (ParameterKind::Alpha, true) => 1,
        (ParameterKind::LengthX, true) => 2,
        (ParameterKind::Theta | ParameterKind::LengthZ, true) => 3,
        (ParameterKind::Theta | ParameterKind::LengthZ, false) => 0,
        (ParameterKind::LengthX, false) => 1,
        (ParameterKind::Alpha, false) => 2,
        (ParameterKind::Beta, false) => 3,
        // Shifts first, then the turns from the outermost on.
        (ParameterKind::Small(k), _) => usize::from(if k < 3 { 0 } else { 6 - k }),
        (ParameterKind::Gain | ParameterKind::Model, _) => return place_of_joint(robot, p.frame),
        (ParameterKind::Custom, _) => 0,
    };
    p.frame * PLACES + within
}
