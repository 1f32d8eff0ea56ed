//! Models of frames: each one generic function of a few parameters and the displacement of its joint.
//!
//! A new frame model is a new implementation of [`FrameModel`]; its derivatives come from automatic
//! differentiation of that one function.

use super::frame_row::GeneralFrame;
use super::twist::{Twist, twist_in_reference};
use super::unit::ModelParameter;
use std::fmt;
use std::sync::Arc;
use truing::manifold::Pose;
use truing::nalgebra::{Matrix3, Vector3};
use truing::{Dual, Scalar, autodiff, value};

/// A frame transform as a function of its parameters and the displacement of its joint, from outside.
pub trait FrameModel: fmt::Debug + Send + Sync + 'static {
    /// Its parameters, at most seven.
    fn parameters(&self) -> Vec<ModelParameter>;

    /// base_from_frame of one frame, from its parameters in their order and the displacement [rad or m], zero
    /// where no joint moves it.
    fn transform<T: Scalar>(&self, p: &[T], displacement: T) -> Pose<T>;
}

/// A [`FrameModel`] of any type.
pub trait AnyFrameModel: fmt::Debug + Send + Sync {
    /// Its parameters.
    fn parameters(&self) -> Vec<ModelParameter>;
    /// The transform.
    fn value(&self, p: &[f64], displacement: f64) -> Pose<f64>;
    /// The transform with its derivatives by the parameters, then by the displacement.
    fn differentiate(&self, p: &[f64], displacement: f64) -> LocalFrame;
}

impl<M: FrameModel> AnyFrameModel for M {
    fn parameters(&self) -> Vec<ModelParameter> {
        let parameters = FrameModel::parameters(self);
        assert!(parameters.len() < MAX_WIDTH, "at most seven parameters");
        parameters
    }

    fn value(&self, p: &[f64], displacement: f64) -> Pose<f64> {
        self.transform(p, displacement)
    }

    fn differentiate(&self, p: &[f64], displacement: f64) -> LocalFrame {
        let n = p.len();
        let mut x = [0.0; MAX_WIDTH];
        x[..n].copy_from_slice(p);
        x[n] = displacement;
        let mut local = LocalFrame::default();
        let twists = &mut local.twists;
        local.pose = differentiate(
            &x,
            |x| self.transform(&x[..n], x[n]),
            |k, omega, v| twists[k] = (omega, v),
        );
        local
    }
}

/// A frame of a table: a function of its parameters alone, to one of which the displacement was added.
pub(super) trait TableFrame {
    /// parent_from_frame.
    fn transform<T: Scalar>(p: &[T]) -> Pose<T>;
}

/// Frame 0 of Khalil–Kleinfinger; parameters θ, r.
pub(super) struct Base;

/// Khalil–Kleinfinger frame; parameters α, d, θ, r, then β if there are five.
pub(super) struct KhalilKleinfinger;

/// Distal Denavit–Hartenberg frame; parameters θ, d, a, α, then β if there are five.
pub(super) struct DenavitHartenberg;

impl TableFrame for KhalilKleinfinger {
    #[inline(always)]
    fn transform<T: Scalar>(p: &[T]) -> Pose<T> {
        let (alpha, d, theta, r) = (p[0], p[1], p[2], p[3]);
        let (sin_alpha, cos_alpha) = alpha.sin_cos();
        let (sin_theta, cos_theta) = theta.sin_cos();
        let zero = T::zero();
        if let Some(beta) = p.get(4) {
            let (sin_beta, cos_beta) = beta.sin_cos();
            // Columns of Rot(y, β) · Rot(x, α).
            let x = Vector3::new(cos_beta, zero, -sin_beta);
            let y = Vector3::new(sin_beta * sin_alpha, cos_alpha, cos_beta * sin_alpha);
            let z = Vector3::new(sin_beta * cos_alpha, -sin_alpha, cos_beta * cos_alpha);
            return Pose {
                rotation: Matrix3::new(
                    x.x * cos_theta + y.x * sin_theta,
                    y.x * cos_theta - x.x * sin_theta,
                    z.x,
                    y.y * sin_theta,
                    y.y * cos_theta,
                    z.y,
                    x.z * cos_theta + y.z * sin_theta,
                    y.z * cos_theta - x.z * sin_theta,
                    z.z,
                ),
                translation: Vector3::new(d * x.x + r * z.x, r * z.y, d * x.z + r * z.z),
            };
        }
        Pose {
            rotation: Matrix3::new(
                cos_theta,
                -sin_theta,
                zero,
                cos_alpha * sin_theta,
                cos_alpha * cos_theta,
                -sin_alpha,
                sin_alpha * sin_theta,
                sin_alpha * cos_theta,
                cos_alpha,
            ),
            translation: Vector3::new(d, -(r * sin_alpha), r * cos_alpha),
        }
    }
}

impl TableFrame for Base {
    #[inline(always)]
    fn transform<T: Scalar>(p: &[T]) -> Pose<T> {
        let (sin, cos) = p[0].sin_cos();
        let (zero, one) = (T::zero(), T::one());
        Pose {
            rotation: Matrix3::new(cos, -sin, zero, sin, cos, zero, zero, zero, one),
            translation: Vector3::new(zero, zero, p[1]),
        }
    }
}

impl TableFrame for DenavitHartenberg {
    #[inline(always)]
    fn transform<T: Scalar>(p: &[T]) -> Pose<T> {
        let (theta, d, a, alpha) = (p[0], p[1], p[2], p[3]);
        let (sin_theta, cos_theta) = theta.sin_cos();
        let (sin_alpha, cos_alpha) = alpha.sin_cos();
        let mut x = Vector3::new(cos_theta, sin_theta, T::zero());
        let y = Vector3::new(-(sin_theta * cos_alpha), cos_theta * cos_alpha, sin_alpha);
        let mut z = Vector3::new(sin_theta * sin_alpha, -(cos_theta * sin_alpha), cos_alpha);
        let translation = Vector3::new(a * cos_theta, a * sin_theta, d);
        if let Some(beta) = p.get(4) {
            let (sin_beta, cos_beta) = beta.sin_cos();
            (x, z) = (
                Vector3::new(
                    x.x * cos_beta - z.x * sin_beta,
                    x.y * cos_beta - z.y * sin_beta,
                    -(z.z * sin_beta),
                ),
                Vector3::new(
                    x.x * sin_beta + z.x * cos_beta,
                    x.y * sin_beta + z.y * cos_beta,
                    z.z * cos_beta,
                ),
            );
        }
        Pose {
            rotation: Matrix3::from_columns(&[x, y, z]),
            translation,
        }
    }
}

/// Rot(z, c) · Rot(y, b) · Rot(x, a): roll, pitch and yaw about fixed axes, as URDF has them.
pub fn roll_pitch_yaw<T: Scalar>(a: T, b: T, c: T) -> Matrix3<T> {
    let ((sa, ca), (sb, cb), (sc, cc)) = (a.sin_cos(), b.sin_cos(), c.sin_cos());
    Matrix3::new(
        cc * cb,
        cc * sb * sa - sc * ca,
        cc * sb * ca + sc * sa,
        sc * cb,
        sc * sb * sa + cc * ca,
        sc * sb * ca - cc * sa,
        -sb,
        cb * sa,
        cb * ca,
    )
}

/// The rotation about a unit axis by an angle (Rodrigues): 1 + sin φ · [a] + (1 − cos φ) · [a]².
fn about<T: Scalar>(axis: &Vector3<f64>, angle: T) -> Matrix3<T> {
    let (sin, cos) = angle.sin_cos();
    let cross = axis.cross_matrix();
    let (first, second) = (cross.map(T::from), (cross * cross).map(T::from));
    Matrix3::identity().map(T::from) + first * sin + second * (T::one() - cos)
}

/// The general frame: a constant transform, a small one with parameters x, y, z, rx, ry, rz, and the motion of the
/// joint about or along any axis: C · Trans(x, y, z) · Rpy(rx, ry, rz) · M(δ). URDF has such frames, with
/// the small transform nominally none.
#[inline(never)]
pub(super) fn general<T: Scalar>(frame: &GeneralFrame, turns: bool, p: &[T], delta: T) -> Pose<T> {
    let [r, q, y] = frame.rpy;
    let constant = roll_pitch_yaw::<f64>(r, q, y).map(T::from);
    let axis = frame.axis();
    let motion = if turns {
        Pose {
            rotation: about(&axis, delta),
            translation: Vector3::from_element(T::zero()),
        }
    } else {
        Pose {
            rotation: Matrix3::identity().map(T::from),
            translation: axis.map(T::from) * delta,
        }
    };
    let small = Pose {
        rotation: roll_pitch_yaw(p[3], p[4], p[5]),
        translation: Vector3::new(p[0], p[1], p[2]),
    };
    let constant = Pose {
        rotation: constant,
        translation: Vector3::from(frame.xyz).map(T::from),
    };
    constant.compose(&small).compose(&motion)
}

/// A frame's transform as a function of everything, its derivatives known.
#[inline(never)]
pub(super) fn lifted<T: Scalar>(model: &Arc<dyn AnyFrameModel>, p: &[T], delta: T) -> Pose<T> {
    let mut numbers = [0.0; MAX_WIDTH];
    numbers.iter_mut().zip(p).for_each(|(x, p)| *x = value(*p));
    let local = model.differentiate(&numbers[..p.len()], value(delta));
    // First order in what the numbers carry along: dT = (ω×, v) · T.
    let mut rotation = local.pose.rotation.map(T::from);
    let mut translation = local.pose.translation.map(T::from);
    for (k, x) in p.iter().chain([&delta]).enumerate() {
        let (omega, v) = &local.twists[k];
        let off = *x - T::from(value(*x));
        let turned = omega.cross_matrix() * local.pose.rotation;
        let moved = v + omega.cross(&local.pose.translation);
        rotation += turned.map(T::from) * off;
        translation += moved.map(T::from) * off;
    }
    Pose {
        rotation,
        translation,
    }
}

/// Most numbers a frame is a function of: its parameters and the displacement.
pub(crate) const MAX_WIDTH: usize = 8;

/// A frame transform with its derivatives, as twists in the parent frame.
#[derive(Debug, Clone)]
pub struct LocalFrame {
    /// parent_from_frame.
    pub pose: Pose<f64>,
    /// ω and the velocity of the point at the parent's origin, one pair a number.
    pub twists: [(Vector3<f64>, Vector3<f64>); MAX_WIDTH],
}

impl Default for LocalFrame {
    fn default() -> Self {
        Self {
            pose: Pose::identity(),
            twists: [(Vector3::zeros(), Vector3::zeros()); MAX_WIDTH],
        }
    }
}

/// Differentiates one frame by `W` numbers: dT · T⁻¹ = (ω×, v), told one by one; parent_from_frame comes back.
#[inline(always)]
fn differentiate<const W: usize>(
    p: &[f64; W],
    transform: impl Fn(&[Dual<W>]) -> Pose<Dual<W>>,
    mut tell: impl FnMut(usize, Vector3<f64>, Vector3<f64>),
) -> Pose<f64> {
    let duals: [Dual<W>; W] = std::array::from_fn(|k| autodiff::seed(p[k], k));
    let pose = transform(&duals);
    let local = Pose {
        rotation: pose.rotation.map(value),
        translation: pose.translation.map(value),
    };
    // One pass an entry and not a parameter: each dual number's partials are read once.
    let r = &local.rotation;
    let mut omega = [[0.0; 3]; W];
    for column in 0..3 {
        let entry = |row: usize| autodiff::partials(&pose.rotation[(row, column)]);
        let (d0, d1, d2) = (entry(0), entry(1), entry(2));
        let (r0, r1, r2) = (r[(0, column)], r[(1, column)], r[(2, column)]);
        for k in 0..W {
            omega[k][0] += d2[k] * r1;
            omega[k][1] += d0[k] * r2;
            omega[k][2] += d1[k] * r0;
        }
    }
    let dp: [_; 3] = std::array::from_fn(|i| autodiff::partials(&pose.translation[i]));
    for k in 0..W {
        let omega = Vector3::from(omega[k]);
        let moved = Vector3::new(dp[0][k], dp[1][k], dp[2][k]);
        tell(k, omega, moved - omega.cross(&local.translation));
    }
    local
}

/// Differentiates one frame by `W` numbers, its parent being at `parent`: their twists in the reference frame, and
/// where the frame is.
#[inline(always)]
pub(super) fn differentiate_after<const W: usize>(
    parent: &Pose<f64>,
    p: &[f64; W],
    transform: impl Fn(&[Dual<W>]) -> Pose<Dual<W>>,
    twists: &mut [Twist],
) -> Pose<f64> {
    let twists = &mut twists[..W];
    let local = differentiate(p, transform, |k, omega, v| {
        twists[k] = twist_in_reference(parent, &(omega, v));
    });
    parent.compose(&local)
}
