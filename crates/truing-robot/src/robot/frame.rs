//! Frame transforms: each one generic function of a few parameters and one joint value.
//!
//! A new frame model is a new implementation of [`FrameModel`]; its derivatives come from
//! automatic differentiation of that one function.

use truing::manifold::Pose;
use truing::nalgebra::{Matrix3, Vector3};
use truing::{Dual, Scalar, autodiff, value};

/// A frame transform as a function of its parameters and one joint value.
pub(crate) trait FrameModel {
    /// base_from_frame of one frame, from its parameters in their order and the joint value.
    fn transform<T: Scalar>(p: &[T], q: f64) -> Pose<T>;
}

/// Joint kinds as constants of a type.
pub(crate) const FIXED: u8 = 0;
pub(crate) const REVOLUTE: u8 = 1;
pub(crate) const PRISMATIC: u8 = 2;

/// Khalil–Kleinfinger frame; parameters α, d, θ, r, then β if `BETA`, then K if it moves.
pub(crate) struct KhalilKleinfinger<const BETA: bool, const JOINT: u8>;

impl<const BETA: bool, const JOINT: u8> FrameModel for KhalilKleinfinger<BETA, JOINT> {
    #[inline]
    fn transform<T: Scalar>(p: &[T], q: f64) -> Pose<T> {
        let (alpha, d) = (p[0], p[1]);
        let (mut theta, mut r) = (p[2], p[3]);
        if JOINT == REVOLUTE {
            theta += p[4 + usize::from(BETA)] * q;
        }
        if JOINT == PRISMATIC {
            r += p[4 + usize::from(BETA)] * q;
        }
        let (sin_alpha, cos_alpha) = alpha.sin_cos();
        let (sin_theta, cos_theta) = theta.sin_cos();
        let zero = T::zero();
        if BETA {
            let (sin_beta, cos_beta) = p[4].sin_cos();
            // Columns of Rot(y, β) · Rot(x, α).
            let x = Vector3::new(cos_beta, zero, -sin_beta);
            let y = Vector3::new(sin_beta * sin_alpha, cos_alpha, cos_beta * sin_alpha);
            let z = Vector3::new(sin_beta * cos_alpha, -sin_alpha, cos_beta * cos_alpha);
            Pose {
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
            }
        } else {
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
}

/// Frame 0 of Khalil–Kleinfinger; parameters θ, r.
pub(crate) struct KhalilKleinfingerBase;

impl FrameModel for KhalilKleinfingerBase {
    fn transform<T: Scalar>(p: &[T], _: f64) -> Pose<T> {
        let (sin, cos) = p[0].sin_cos();
        let (zero, one) = (T::zero(), T::one());
        Pose {
            rotation: Matrix3::new(cos, -sin, zero, sin, cos, zero, zero, zero, one),
            translation: Vector3::new(zero, zero, p[1]),
        }
    }
}

/// Distal Denavit–Hartenberg frame; parameters θ, d, a, α, then β if `BETA`, then K if it moves.
pub(crate) struct DenavitHartenberg<const BETA: bool, const JOINT: u8>;

impl<const BETA: bool, const JOINT: u8> FrameModel for DenavitHartenberg<BETA, JOINT> {
    #[inline]
    fn transform<T: Scalar>(p: &[T], q: f64) -> Pose<T> {
        let (mut theta, mut d) = (p[0], p[1]);
        let (a, alpha) = (p[2], p[3]);
        if JOINT == REVOLUTE {
            theta += p[4 + usize::from(BETA)] * q;
        }
        if JOINT == PRISMATIC {
            d += p[4 + usize::from(BETA)] * q;
        }
        let (sin_theta, cos_theta) = theta.sin_cos();
        let (sin_alpha, cos_alpha) = alpha.sin_cos();
        let mut x = Vector3::new(cos_theta, sin_theta, T::zero());
        let y = Vector3::new(-(sin_theta * cos_alpha), cos_theta * cos_alpha, sin_alpha);
        let mut z = Vector3::new(sin_theta * sin_alpha, -(cos_theta * sin_alpha), cos_alpha);
        let translation = Vector3::new(a * cos_theta, a * sin_theta, d);
        if BETA {
            let (sin_beta, cos_beta) = p[4].sin_cos();
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

/// Most parameters a frame has.
pub(crate) const MAX_WIDTH: usize = 6;

/// A frame transform at one joint value with its derivatives, as twists in the parent frame.
pub(crate) struct LocalFrame {
    pub pose: Pose<f64>,
    /// ω and the velocity of the point at the parent's origin, one pair a parameter.
    pub twists: [(Vector3<f64>, Vector3<f64>); MAX_WIDTH],
}

/// Differentiates one frame with `W` partials: dT · T⁻¹ = (ω×, v).
#[inline]
pub(crate) fn differentiate<M: FrameModel, const W: usize>(
    p: &[f64],
    q: f64,
    out: &mut LocalFrame,
) {
    let duals: [Dual<W>; W] = std::array::from_fn(|k| autodiff::seed(p[k], k));
    let pose = M::transform(&duals, q);
    out.pose = Pose {
        rotation: pose.rotation.map(value),
        translation: pose.translation.map(value),
    };
    // One pass an entry and not a parameter: each dual number's partials are read once.
    let r = &out.pose.rotation;
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
        out.twists[k] = (omega, moved - omega.cross(&out.pose.translation));
    }
}
