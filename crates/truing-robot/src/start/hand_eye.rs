//! Robot–world and hand–eye calibration, A X = S B, in closed form: where a sensor stands and how what it sees is
//! mounted on the tool.

use crate::measurement::fit::{mean, nearest_rotation};
use truing::manifold::Pose;
use truing::nalgebra::{DMatrix, DVector, Matrix3, SMatrix, Vector3};

/// One reading: base_from_tool of the robot as it is, and what the sensor read, sensor_from_body.
pub type Pair = (Pose<f64>, Pose<f64>);

/// The sensor's pose S and the body's X with A X = S B in all pairs (A, B), in the sense of least squares: first
/// of rotations, then of positions.
///
/// Rotations: vec(R_S) = (R_B ⊗ R_A) vec(R_X), so that Σ R_B ⊗ R_A takes vec(R_X) to n · vec(R_S); both
/// come from its first singular vectors (Shah 2013, "Solving the robot-world/hand-eye calibration problem using
/// the Kronecker product"). Positions then are linear. `None` with fewer than three pairs, or where rotations are
/// about one axis only and leave the two undetermined.
pub fn hand_eye(pairs: &[Pair]) -> Option<(Pose<f64>, Pose<f64>)> {
    if pairs.len() < 3 {
        return None;
    }
    let mut sum = SMatrix::<f64, 9, 9>::zeros();
    for (a, b) in pairs {
        sum += b.rotation.kronecker(&a.rotation);
    }
    let svd = sum.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let first = svd.singular_values.imax();
    let mut rest = svd.singular_values;
    rest[first] = 0.0;
    // Where tools turn about one axis only, the second is as large.
    if rest.max() > (1.0 - NEAR) * svd.singular_values[first] {
        return None;
    }
    let body = rotation_of(v_t.row(first).transpose().as_slice());
    let sensor = rotation_of(u.column(first).as_slice());
    // R_A t_X − t_S = R_S t_B − t_A.
    let n = pairs.len();
    let mut left = DMatrix::zeros(3 * n, 6);
    let mut right = DVector::zeros(3 * n);
    for (k, (a, b)) in pairs.iter().enumerate() {
        left.view_mut((3 * k, 0), (3, 3)).copy_from(&a.rotation);
        left.view_mut((3 * k, 3), (3, 3))
            .copy_from(&-Matrix3::<f64>::identity());
        let off = sensor * b.translation - a.translation;
        right.rows_mut(3 * k, 3).copy_from(&off);
    }
    let x = left.svd(true, true).solve(&right, 1e-12).ok()?;
    let part = |first: usize| Vector3::new(x[first], x[first + 1], x[first + 2]);
    let pose = |rotation, first| Pose {
        rotation,
        translation: part(first),
    };
    Some((pose(sensor, 3), pose(body, 0)))
}

/// Singular values this near to each other, relative, are the same: rotations about one axis.
const NEAR: f64 = 1e-6;

/// The rotation that nine numbers, column after column, are a multiple of.
fn rotation_of(numbers: &[f64]) -> Matrix3<f64> {
    let m = Matrix3::from_column_slice(numbers);
    nearest_rotation(&(m * m.determinant().signum()))
}

/// The body's pose in a known sensor frame: the mean of A⁻¹ S B.
pub fn body_seen(sensor: &Pose<f64>, pairs: &[Pair]) -> Pose<f64> {
    average(
        pairs
            .iter()
            .map(|(a, b)| a.inverse().compose(&sensor.compose(b))),
    )
}

/// The sensor's pose where the body is known: the mean of A X B⁻¹.
pub fn sensor_of(body: &Pose<f64>, pairs: &[Pair]) -> Pose<f64> {
    average(
        pairs
            .iter()
            .map(|(a, b)| a.compose(body).compose(&b.inverse())),
    )
}

/// Mean position, and the rotation nearest to the mean of rotation matrices; the identity for none.
fn average(poses: impl Iterator<Item = Pose<f64>>) -> Pose<f64> {
    let poses: Vec<Pose<f64>> = poses.collect();
    if poses.is_empty() {
        return Pose::identity();
    }
    let rotations: Matrix3<f64> = poses.iter().map(|pose| pose.rotation).sum();
    let positions: Vec<Vector3<f64>> = poses.iter().map(|pose| pose.translation).collect();
    Pose {
        rotation: nearest_rotation(&rotations),
        translation: mean(&positions),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use truing::manifold::so3;

    fn pose(seed: f64) -> Pose<f64> {
        let wave = |f: f64| 2.5 * (f * seed + f).sin();
        Pose {
            rotation: so3::exp_matrix(&[wave(1.0), wave(1.7), wave(2.9)]),
            translation: Vector3::new(wave(3.1), wave(4.3), wave(5.9)),
        }
    }

    fn readings(sensor: &Pose<f64>, body: &Pose<f64>, tools: &[Pose<f64>]) -> Vec<Pair> {
        let seen = |a: &Pose<f64>| sensor.inverse().compose(&a.compose(body));
        tools.iter().map(|a| (*a, seen(a))).collect()
    }

    fn apart(a: &Pose<f64>, b: &Pose<f64>) -> f64 {
        let turned = (a.rotation - b.rotation).amax();
        turned.max((a.translation - b.translation).amax())
    }

    /// Whatever stands where, half turns included.
    #[test]
    fn exact_readings_give_sensor_and_body_exactly() {
        let half = Pose {
            rotation: Matrix3::from_diagonal(&Vector3::new(-1.0, -1.0, 1.0)),
            translation: Vector3::new(0.1, 0.2, 0.3),
        };
        let tools: Vec<Pose<f64>> = (0..8).map(|k| pose(f64::from(k))).collect();
        for (sensor, body) in [
            (pose(20.0), pose(31.0)),
            (half, pose(32.0)),
            (Pose::identity(), half),
            (half, Pose::identity()),
        ] {
            let pairs = readings(&sensor, &body, &tools);
            let (s, x) = hand_eye(&pairs).unwrap();
            assert!(apart(&s, &sensor) < 1e-12 && apart(&x, &body) < 1e-12);
            assert!(apart(&body_seen(&sensor, &pairs), &body) < 1e-12);
            assert!(apart(&sensor_of(&body, &pairs), &sensor) < 1e-12);
        }
    }

    /// Turns about one axis say nothing of what is along it.
    #[test]
    fn what_is_not_determined_is_none() {
        let about_z: Vec<Pose<f64>> = (0..8)
            .map(|k| Pose {
                rotation: so3::exp_matrix(&[0.0, 0.0, 0.3 * f64::from(k)]),
                translation: Vector3::new(0.1 * f64::from(k), 0.0, 0.0),
            })
            .collect();
        let pairs = readings(&pose(1.0), &pose(2.0), &about_z);
        assert!(hand_eye(&pairs).is_none());
        assert!(hand_eye(&pairs[..2]).is_none());
        let still = vec![pairs[0]; 5];
        assert!(hand_eye(&still).is_none());
    }
}
