//! The kinematic regressor: how the tool moves when a parameter does.

use super::frame::{LocalFrame, MAX_WIDTH};
use super::serial::Robot;
use truing::manifold::Pose;
use truing::nalgebra::{Matrix3xX, Vector3};

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

impl Default for Twist {
    fn default() -> Self {
        Self {
            angular: Vector3::zeros(),
            linear: Vector3::zeros(),
        }
    }
}

/// The tool pose and ∂(tool pose)/∂(parameters), one twist a parameter.
#[derive(Debug, Clone)]
pub struct Regressor {
    /// base_from_tool.
    pub tool: Pose<f64>,
    /// One twist for each parameter of the robot, in their order.
    pub twists: Vec<Twist>,
}

impl Default for Regressor {
    fn default() -> Self {
        Self {
            tool: Pose::identity(),
            twists: Vec::new(),
        }
    }
}

impl Regressor {
    /// The 6 × Np matrix, as position rows at the tool origin (3 × Np) and rotation rows (3 × Np).
    pub fn matrices(&self) -> (Matrix3xX<f64>, Matrix3xX<f64>) {
        let position: Vec<_> = self
            .twists
            .iter()
            .map(|t| t.at(&self.tool.translation))
            .collect();
        let rotation: Vec<_> = self.twists.iter().map(|t| t.angular).collect();
        (
            Matrix3xX::from_columns(&position),
            Matrix3xX::from_columns(&rotation),
        )
    }

    /// Velocity of a tool point when joint number `joint` moves at unit speed: that of its θ (or r)
    /// column times the gain.
    pub fn joint_velocity(
        &self,
        robot: &Robot,
        parameters: &[f64],
        joint: usize,
        point: &Vector3<f64>,
    ) -> Vector3<f64> {
        let joint = &robot.joints()[joint];
        self.twists[joint.offset_parameter].at(point) * parameters[joint.gain_parameter]
    }

    /// Angular velocity of the tool when joint number `joint` moves at unit speed.
    pub fn joint_turn(&self, robot: &Robot, parameters: &[f64], joint: usize) -> Vector3<f64> {
        let joint = &robot.joints()[joint];
        self.twists[joint.offset_parameter].angular * parameters[joint.gain_parameter]
    }
}

/// What computes a regressor: the seam at which analytic columns replace automatic ones, for every
/// kind of constraint at once.
pub trait DifferentiateChain: Send + Sync {
    /// Writes the tool pose and one twist a parameter at the joint values `q`, in the units of the joints.
    fn regressor(&self, robot: &Robot, parameters: &[f64], q: &[f64], out: &mut Regressor);
}

/// Frame-wise automatic differentiation, the default.
///
/// Each frame is a small function of four to six parameters; `num-dual` differentiates *that*, and
/// the chain rule carries the twists to the reference frame. It costs about three times the plain
/// forward kinematics, where differentiating the whole chain costs tens of times.
#[derive(Debug, Clone, Copy, Default)]
pub struct FrameWise;

impl DifferentiateChain for FrameWise {
    fn regressor(&self, robot: &Robot, parameters: &[f64], q: &[f64], out: &mut Regressor) {
        out.twists
            .resize(robot.parameters().len(), Twist::default());
        let mut pose = Pose::<f64>::identity();
        let mut local = LocalFrame {
            pose: Pose::identity(),
            twists: [(Vector3::zeros(), Vector3::zeros()); MAX_WIDTH],
        };
        for frame in robot.frames() {
            let range = frame.parameters.clone();
            frame.differentiate(
                &parameters[range.clone()],
                frame.joint.map_or(0.0, |j| q[j]),
                &mut local,
            );
            for (twist, (omega, v)) in out.twists[range].iter_mut().zip(&local.twists) {
                twist.angular = pose.rotation * omega;
                twist.linear = pose.rotation * v - twist.angular.cross(&pose.translation);
            }
            pose = Pose {
                translation: pose.rotation * local.pose.translation + pose.translation,
                rotation: pose.rotation * local.pose.rotation,
            };
        }
        out.tool = pose;
    }
}
