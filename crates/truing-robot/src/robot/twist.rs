//! Motions of rigid bodies.

use truing::manifold::Pose;
use truing::nalgebra::Vector3;

/// A unit change of a parameter moves the point p at `linear + angular × p`.
///
/// Both vectors are in frame −1, the fixed reference frame: a spatial twist about its origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Twist {
    /// Angular velocity, per unit of the parameter.
    pub angular: Vector3<f64>,
    /// Velocity of the point at the origin, per unit of the parameter.
    pub linear: Vector3<f64>,
}

impl Twist {
    /// Velocity of a point that moves with the tool.
    #[inline]
    pub fn at(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.linear + self.angular.cross(point)
    }
}

impl Twist {
    /// The twist of so many units.
    #[inline]
    pub fn times(&self, factor: f64) -> Self {
        Self {
            angular: self.angular * factor,
            linear: self.linear * factor,
        }
    }
}

impl Default for Twist {
    fn default() -> Self {
        Self {
            angular: Vector3::zeros(),
            linear: Vector3::zeros(),
        }
    }
}

/// A twist in a frame's parent, ω and the velocity at the parent's origin, as one about the origin of the reference
/// frame.
#[inline]
pub(super) fn twist_in_reference(
    parent: &Pose<f64>,
    (omega, v): &(Vector3<f64>, Vector3<f64>),
) -> Twist {
    let angular = parent.rotation * omega;
    Twist {
        angular,
        linear: parent.rotation * v - angular.cross(&parent.translation),
    }
}
