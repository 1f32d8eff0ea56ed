//! Closed forms that fit planes, points and rigid motions to points.

use truing::manifold::{Plane, Pose};
use truing::nalgebra::{Matrix3, Vector3};

/// The mean of points; the origin for none.
pub fn mean(points: &[Vector3<f64>]) -> Vector3<f64> {
    points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64
}

/// The plane with the least sum of squared distances: through the mean, across the direction of
/// least spread. Its normal points away from the origin. With fewer than three points, one of the
/// planes through them.
pub fn best_fit_plane(points: &[Vector3<f64>]) -> Plane<f64> {
    let center = mean(points);
    let scatter: Matrix3<f64> = points
        .iter()
        .map(|p| (p - center) * (p - center).transpose())
        .sum();
    let eigen = scatter.symmetric_eigen();
    let smallest = eigen.eigenvalues.imin();
    let mut normal: Vector3<f64> = eigen.eigenvectors.column(smallest).into_owned();
    let found = normal.norm() > 0.5;
    if !found {
        normal = Vector3::z();
    }
    if normal.dot(&center) < 0.0 {
        normal = -normal;
    }
    Plane {
        normal,
        distance: normal.dot(&center),
    }
}

/// The rigid motion with the least Σ‖to − motion(from)‖² (Arun, Huang & Blostein 1987).
pub fn rigid_registration(from: &[Vector3<f64>], to: &[Vector3<f64>]) -> Pose<f64> {
    let (from_center, to_center) = (mean(from), mean(to));
    let covariance: Matrix3<f64> = from
        .iter()
        .zip(to)
        .map(|(f, t)| (t - to_center) * (f - from_center).transpose())
        .sum();
    let rotation = nearest_rotation(&covariance);
    Pose {
        rotation,
        translation: to_center - rotation * from_center,
    }
}

/// The rotation nearest to a matrix: U · diag(1, 1, ±1) · Vᵀ of its singular value decomposition.
pub fn nearest_rotation(m: &Matrix3<f64>) -> Matrix3<f64> {
    let svd = m.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        return Matrix3::identity();
    };
    let mut flip = Matrix3::identity();
    if (u * v_t).determinant() < 0.0 {
        flip[(2, 2)] = -1.0;
    }
    u * flip * v_t
}
