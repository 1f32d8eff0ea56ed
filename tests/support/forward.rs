//! A forward model of its own, to simulate with: products of 4 × 4 matrices, and what no calibration models.

use nalgebra::{Matrix3, Matrix4, Vector3};
use rand::Rng;
use truing::nalgebra;
use truing_robot::robot::{JointKind, RobotFile};

/// One frame in the convention of Khalil and Kleinfinger: Rot(y, beta) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r).
#[derive(Clone, Debug)]
pub struct Link {
    pub beta: f64,
    pub alpha: f64,
    pub d: f64,
    pub theta: f64,
    pub r: f64,
    pub joint: Option<JointKind>,
    pub limits: [f64; 2],
}

/// A robot as it truly is.
#[derive(Clone, Debug)]
pub struct Machine {
    pub links: Vec<Link>,
    pub effects: Vec<Effect>,
}

/// What moves joints beside their readings.
#[derive(Clone, Debug)]
pub enum Effect {
    /// A sine of the reading, so many times a turn, of this amplitude \[rad\], on every joint.
    Harmonic { times: f64, amplitude: f64 },
    /// Half of the play \[rad\], one way or the other.
    Backlash(f64),
    /// The shoulder and the elbow sag by so much \[rad\] when the arm is level.
    Elastic(f64),
    /// Gears turn by this share more.
    Gain(f64),
}

fn rotation(axis: usize, angle: f64) -> Matrix4<f64> {
    let (s, c) = angle.sin_cos();
    let mut m = Matrix4::identity();
    let (i, k) = ((axis + 1) % 3, (axis + 2) % 3);
    m[(i, i)] = c;
    m[(k, k)] = c;
    m[(i, k)] = -s;
    m[(k, i)] = s;
    m
}

fn translation(axis: usize, by: f64) -> Matrix4<f64> {
    let mut m = Matrix4::identity();
    m[(axis, 3)] = by;
    m
}

impl Machine {
    /// The robot of a file in the convention of Khalil and Kleinfinger.
    pub fn of(file: &RobotFile) -> Self {
        let link = |row: &truing_robot::robot::FrameRow, joint, limits| Link {
            beta: row.beta,
            alpha: row.alpha,
            d: row.d,
            theta: row.theta,
            r: row.r,
            joint,
            limits,
        };
        let mut links = vec![link(&file.base, None, [0.0; 2])];
        for joint in &file.joints {
            let limits = joint.limits.expect("simulated robots have limits");
            links.push(link(&joint.frame, Some(joint.kind), limits));
        }
        links.push(link(&file.tool, None, [0.0; 2]));
        Self {
            links,
            effects: Vec::new(),
        }
    }

    /// The same with every angle off by up to `angle` and every length by up to `length`; `beta` too where axes are parallel.
    pub fn off(&self, angle: f64, length: f64, rng: &mut impl Rng) -> Self {
        let mut machine = self.clone();
        let count = machine.links.len();
        for (k, link) in machine.links.iter_mut().enumerate() {
            let mut by = |size: f64| size * (2.0 * rng.random::<f64>() - 1.0);
            link.theta += by(angle);
            link.r += by(length);
            if k > 0 {
                link.alpha += by(angle);
                link.d += by(length);
            }
            let parallel = link.alpha.sin().abs() < 0.1;
            if (2..count - 1).contains(&k) && parallel {
                link.beta += by(angle);
            }
        }
        machine
    }

    /// A posture in the middle `part` of the joints' ranges, about `around` if that is given.
    pub fn posture(&self, part: f64, around: Option<&[f64]>, rng: &mut impl Rng) -> Vec<f64> {
        let joints = self.links.iter().filter(|link| link.joint.is_some());
        joints
            .enumerate()
            .map(|(k, link)| {
                let [lower, upper] = link.limits;
                let middle = around.map_or(0.5 * (lower + upper), |q| q[k]);
                middle + part * (upper - lower) * (rng.random::<f64>() - 0.5)
            })
            .collect()
    }

    /// Where every link's joint truly is at readings.
    fn displaced(&self, q: &[f64], rng: &mut impl Rng) -> Vec<f64> {
        let mut true_q = q.to_vec();
        for effect in &self.effects {
            for k in 0..q.len() {
                true_q[k] += match effect {
                    Effect::Harmonic { times, amplitude } => {
                        amplitude * (times * q[k] + 0.7 * k as f64).sin()
                    }
                    Effect::Backlash(play) if rng.random::<bool>() => 0.5 * play,
                    Effect::Backlash(play) => -0.5 * play,
                    Effect::Elastic(sag) if k == 1 => sag * q[1].cos(),
                    Effect::Elastic(sag) if k == 2 => 0.7 * sag * (q[1] + q[2]).cos(),
                    Effect::Elastic(_) => 0.0,
                    Effect::Gain(gain) => gain * q[k],
                };
            }
        }
        true_q
    }

    /// The pose of the tool at joints that are truly there.
    pub fn exact(&self, q: &[f64]) -> Matrix4<f64> {
        let mut pose = Matrix4::identity();
        let mut readings = q.iter();
        for link in &self.links {
            let (mut theta, mut r) = (link.theta, link.r);
            match link.joint {
                Some(JointKind::Revolute) => theta += readings.next().unwrap(),
                Some(JointKind::Prismatic) => r += readings.next().unwrap(),
                _ => {}
            }
            pose *= rotation(1, link.beta) * rotation(0, link.alpha) * translation(0, link.d);
            pose *= rotation(2, theta) * translation(2, r);
        }
        pose
    }

    /// The pose of the tool where the readings say so.
    pub fn pose(&self, q: &[f64], rng: &mut impl Rng) -> Matrix4<f64> {
        self.exact(&self.displaced(q, rng))
    }

    /// A point on the tool.
    pub fn point(&self, q: &[f64], on_tool: &Vector3<f64>, rng: &mut impl Rng) -> Vector3<f64> {
        let pose = self.pose(q, rng);
        (pose * on_tool.push(1.0)).xyz()
    }

    /// Readings near `q` at which conditions on the tool point hold, by Newton steps on the joints.
    ///
    /// What differs from one visit to the next (play) is drawn once, by a generator that starts anew.
    pub fn solve<R: Rng + Clone>(
        &self,
        q: &[f64],
        on_tool: &Vector3<f64>,
        conditions: impl Fn(&Vector3<f64>) -> Vec<f64>,
        rng: &R,
    ) -> Option<Vec<f64>> {
        let mut q = q.to_vec();
        let at = |q: &[f64]| conditions(&self.point(q, on_tool, &mut rng.clone()));
        for _ in 0..40 {
            let f = at(&q);
            let size = f.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            if size < 1e-12 {
                let joints = self.links.iter().filter(|l| l.joint.is_some());
                let inside = joints
                    .zip(&q)
                    .all(|(l, q)| (l.limits[0]..=l.limits[1]).contains(q));
                return inside.then_some(q);
            }
            let columns: Vec<Vec<f64>> = (0..q.len())
                .map(|k| {
                    let (mut up, mut down) = (q.clone(), q.clone());
                    up[k] += 1e-6;
                    down[k] -= 1e-6;
                    let (up, down) = (at(&up), at(&down));
                    up.iter().zip(&down).map(|(u, d)| (u - d) / 2e-6).collect()
                })
                .collect();
            let j = nalgebra::DMatrix::from_fn(f.len(), q.len(), |i, k| columns[k][i]);
            let jjt = &j * j.transpose();
            let y = jjt.lu().solve(&nalgebra::DVector::from_vec(f))?;
            let step = j.transpose() * y;
            let length = step.norm();
            let damped = if length > 0.5 { 0.5 / length } else { 1.0 };
            q.iter_mut()
                .zip(step.iter())
                .for_each(|(q, s)| *q -= damped * s);
        }
        None
    }
}

/// RMS distance of points after the rigid motion (and growth, if `scaled`) that fits best (Umeyama 1991).
pub fn misfit(from: &[Vector3<f64>], to: &[Vector3<f64>], scaled: bool) -> f64 {
    let n = from.len() as f64;
    let middle = |p: &[Vector3<f64>]| p.iter().sum::<Vector3<f64>>() / n;
    let (a, b) = (middle(from), middle(to));
    let h: Matrix3<f64> = from
        .iter()
        .zip(to)
        .map(|(p, q)| (q - b) * (p - a).transpose())
        .sum();
    let svd = h.svd(true, true);
    let (u, vt) = (svd.u.unwrap(), svd.v_t.unwrap());
    let sign = (u.determinant() * vt.determinant()).signum();
    let d = Vector3::new(1.0, 1.0, sign);
    let turn = u * Matrix3::from_diagonal(&d) * vt;
    let spread: f64 = from.iter().map(|p| (p - a).norm_squared()).sum();
    let growth = if scaled {
        svd.singular_values.dot(&d) / spread
    } else {
        1.0
    };
    let squares: f64 = from
        .iter()
        .zip(to)
        .map(|(p, q)| (turn * (p - a) * growth - (q - b)).norm_squared())
        .sum();
    (squares / n).sqrt()
}
