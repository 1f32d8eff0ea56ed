//! Rotations: exponential, logarithm and the functions behind them, differentiable everywhere.
//!
//! All are written as functions of the *squared* angle with a Taylor branch near zero, so that
//! dual numbers see the right derivative also at exactly zero, where `sqrt` has none.

use crate::scalar::{Scalar, value};
use nalgebra::{Matrix3, Vector3};

/// Below this squared angle the Taylor branch is taken; its truncation error is under 1e-17.
const SMALL: f64 = 1e-4;

/// sin(√s) / √s, smooth at s = 0.
pub fn sinc<T: Scalar>(s: T) -> T {
    if value(s) < SMALL {
        // 1 − s/6 + s²/120 − s³/5040
        s * (s * (s * (-1.0 / 5040.0) + 1.0 / 120.0) - 1.0 / 6.0) + 1.0
    } else {
        let angle = s.sqrt();
        angle.sin() / angle
    }
}

/// cos(√s), smooth at s = 0.
pub fn cosine<T: Scalar>(s: T) -> T {
    if value(s) < SMALL {
        // 1 − s/2 + s²/24 − s³/720
        s * (s * (s * (-1.0 / 720.0) + 1.0 / 24.0) - 0.5) + 1.0
    } else {
        s.sqrt().cos()
    }
}

/// atan2(√s, w) / √s for s = |v|² of a unit vector (w, v): the angle over its sine, smooth at s = 0, w > 0.
pub fn angle_over_sine<T: Scalar>(s: T, w: T) -> T {
    if value(s) < SMALL && value(w) > 0.0 {
        // atan(t)/t/w with t² = s/w²: 1 − t²/3 + t⁴/5 − t⁶/7 + t⁸/9
        let t2 = s / (w * w);
        (t2 * (t2 * (t2 * (t2 * (1.0 / 9.0) - 1.0 / 7.0) + 0.2) - 1.0 / 3.0) + 1.0) / w
    } else {
        let sine = s.sqrt();
        sine.atan2(w) / sine
    }
}

/// Unit quaternion (w, x, y, z) of the rotation vector ω: (cos |ω|/2, ω/2 · sinc(|ω|/2)).
pub fn exp_quaternion<T: Scalar>(omega: &[T]) -> [T; 4] {
    let [x, y, z] = [omega[0], omega[1], omega[2]];
    let quarter = (x * x + y * y + z * z) * 0.25;
    let half_sinc = sinc(quarter) * 0.5;
    [cosine(quarter), x * half_sinc, y * half_sinc, z * half_sinc]
}

/// Rotation vector of a unit quaternion (w, x, y, z); the shorter way round, angle in [0, π].
pub fn log_quaternion<T: Scalar>(q: &[T]) -> Vector3<T> {
    let sign = if value(q[0]) < 0.0 { -1.0 } else { 1.0 };
    let (w, v) = (
        q[0] * sign,
        Vector3::new(q[1] * sign, q[2] * sign, q[3] * sign),
    );
    let s = v.x * v.x + v.y * v.y + v.z * v.z;
    let scale = angle_over_sine(s, w) * 2.0;
    v.map(|c| c * scale)
}

/// Hamilton product of two quaternions (w, x, y, z).
pub fn quaternion_product<T: Scalar>(a: &[T], b: &[T]) -> [T; 4] {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

/// Rotation matrix of a unit quaternion (w, x, y, z).
pub fn quaternion_matrix<T: Scalar>(q: &[T]) -> Matrix3<T> {
    let [w, x, y, z] = [q[0], q[1], q[2], q[3]];
    let one = T::one();
    Matrix3::new(
        one - (y * y + z * z) * 2.0,
        (x * y - w * z) * 2.0,
        (x * z + w * y) * 2.0,
        (x * y + w * z) * 2.0,
        one - (x * x + z * z) * 2.0,
        (y * z - w * x) * 2.0,
        (x * z - w * y) * 2.0,
        (y * z + w * x) * 2.0,
        one - (x * x + y * y) * 2.0,
    )
}

/// Unit quaternion (w, x, y, z) of a rotation matrix, by Shepperd's method: the largest of the
/// four squared components is taken first, so that no small number is divided by.
pub fn matrix_quaternion<T: Scalar>(m: &Matrix3<T>) -> [T; 4] {
    let one = T::one();
    let (a, b, c) = (m[(0, 0)], m[(1, 1)], m[(2, 2)]);
    let candidates = [
        one + a + b + c,
        one + a - b - c,
        one - a + b - c,
        one - a - b + c,
    ];
    let mut largest = 0;
    for i in 1..4 {
        if value(candidates[i]) > value(candidates[largest]) {
            largest = i;
        }
    }
    let root = candidates[largest].sqrt();
    let scale = root.recip() * 0.5;
    let first = root * 0.5;
    match largest {
        0 => [
            first,
            (m[(2, 1)] - m[(1, 2)]) * scale,
            (m[(0, 2)] - m[(2, 0)]) * scale,
            (m[(1, 0)] - m[(0, 1)]) * scale,
        ],
        1 => [
            (m[(2, 1)] - m[(1, 2)]) * scale,
            first,
            (m[(0, 1)] + m[(1, 0)]) * scale,
            (m[(0, 2)] + m[(2, 0)]) * scale,
        ],
        2 => [
            (m[(0, 2)] - m[(2, 0)]) * scale,
            (m[(0, 1)] + m[(1, 0)]) * scale,
            first,
            (m[(1, 2)] + m[(2, 1)]) * scale,
        ],
        _ => [
            (m[(1, 0)] - m[(0, 1)]) * scale,
            (m[(0, 2)] + m[(2, 0)]) * scale,
            (m[(1, 2)] + m[(2, 1)]) * scale,
            first,
        ],
    }
}

/// Rotation vector of a rotation matrix, angle in [0, π].
pub fn log_matrix<T: Scalar>(m: &Matrix3<T>) -> Vector3<T> {
    log_quaternion(&matrix_quaternion(m))
}

/// Rotation matrix of the rotation vector ω \[rad\].
pub fn exp_matrix<T: Scalar>(omega: &[T]) -> Matrix3<T> {
    quaternion_matrix(&exp_quaternion(omega))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Dual;
    use approx::assert_relative_eq;
    use nalgebra::SVector;

    fn seeded(v: [f64; 3]) -> [Dual<3>; 3] {
        std::array::from_fn(|i| {
            let mut d = Dual::<3>::from(v[i]);
            d.eps = num_dual::Derivative::some(SVector::<f64, 3>::from_fn(|k, _| {
                f64::from(u8::from(k == i))
            }));
            d
        })
    }

    fn gradient(d: Dual<3>) -> [f64; 3] {
        let eps = d
            .eps
            .unwrap_generic(nalgebra::Const::<3>, nalgebra::Const::<1>);
        [eps[0], eps[1], eps[2]]
    }

    #[test]
    fn log_inverts_exp_with_unit_derivative_also_at_zero() {
        for v in [
            [0.0; 3],
            [1e-9, 0.0, -1e-9],
            [0.3, -0.2, 0.1],
            [1.0, 2.0, -1.5],
            [0.0, 0.0, 3.1],
        ] {
            let q = exp_quaternion(&seeded(v));
            let back = log_quaternion(&q);
            for i in 0..3 {
                assert_relative_eq!(value(back[i]), v[i], epsilon = 1e-14);
                for (k, g) in gradient(back[i]).iter().enumerate() {
                    assert_relative_eq!(*g, f64::from(u8::from(k == i)), epsilon = 1e-12);
                }
            }
        }
    }

    #[test]
    fn exp_agrees_with_nalgebra() {
        for v in [[0.0; 3], [0.3, -0.2, 0.1], [2.0, -1.0, 1.0]] {
            let ours = exp_matrix(&v);
            let theirs = nalgebra::Rotation3::from_scaled_axis(Vector3::from(v));
            assert_relative_eq!(ours, *theirs.matrix(), epsilon = 1e-14);
            assert_relative_eq!(log_matrix(&ours), Vector3::from(v), epsilon = 1e-13);
        }
    }

    #[test]
    fn log_of_half_turns_is_finite_and_right() {
        for axis in [
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.6, 0.0, 0.8],
        ] {
            let v = Vector3::from(axis) * std::f64::consts::PI;
            let back = log_matrix(&exp_matrix(v.as_slice()));
            assert_relative_eq!(back.norm(), std::f64::consts::PI, epsilon = 1e-12);
            assert_relative_eq!(
                back.normalize().dot(&Vector3::from(axis)).abs(),
                1.0,
                epsilon = 1e-12
            );
        }
    }

    #[test]
    fn taylor_branches_join_smoothly() {
        for s in [0.99e-4, 1.01e-4_f64] {
            assert_relative_eq!(sinc(s), s.sqrt().sin() / s.sqrt(), epsilon = 1e-15);
            assert_relative_eq!(cosine(s), s.sqrt().cos(), epsilon = 1e-15);
            let w = (1.0 - s).sqrt();
            assert_relative_eq!(
                angle_over_sine(s, w),
                s.sqrt().asin() / s.sqrt(),
                epsilon = 1e-15
            );
        }
    }
}
