//! The kinematic regressor: how the tool moves when a parameter does.

use super::serial::Robot;
use super::twist::Twist;
use truing::manifold::Pose;
use truing::nalgebra::{Matrix3xX, Vector3};

/// The tool pose and ∂(tool pose)/∂(parameters), one twist a parameter.
#[derive(Debug, Clone)]
pub struct Regressor {
    /// base_from_tool.
    pub tool: Pose<f64>,
    /// One twist for each parameter of the robot, in their order.
    pub twists: Vec<Twist>,
    /// One twist for each moving frame, of a unit displacement of its joint.
    pub motions: Vec<Twist>,
}

impl Default for Regressor {
    fn default() -> Self {
        Self {
            tool: Pose::identity(),
            twists: Vec::new(),
            motions: Vec::new(),
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

    /// Velocity of a tool point when the reading of joint number `joint` moves at unit speed, from the
    /// [`slopes`](Robot::slopes) of the displacements.
    pub fn joint_velocity(
        &self,
        robot: &Robot,
        slopes: &[f64],
        joint: usize,
        point: &Vector3<f64>,
    ) -> Vector3<f64> {
        self.by_joint(robot, slopes, joint, |motion| motion.at(point))
    }

    /// Angular velocity of the tool when the reading of joint number `joint` moves at unit speed.
    pub fn joint_turn(&self, robot: &Robot, slopes: &[f64], joint: usize) -> Vector3<f64> {
        self.by_joint(robot, slopes, joint, |motion| motion.angular)
    }

    fn by_joint(
        &self,
        robot: &Robot,
        slopes: &[f64],
        joint: usize,
        of: impl Fn(&Twist) -> Vector3<f64>,
    ) -> Vector3<f64> {
        let readings = robot.joints().len();
        let own = slopes.iter().skip(joint).step_by(readings);
        let moved = self.motions.iter().zip(own);
        moved
            .filter(|(_, slope)| **slope != 0.0)
            .fold(Vector3::zeros(), |sum, (motion, slope)| {
                sum + of(motion) * *slope
            })
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
        out.motions.clear();
        let row = robot.complete(q);
        let mut pose = Pose::<f64>::identity();
        for frame in robot.frames() {
            let range = frame.own_parameters();
            let displacement = frame.displacement(parameters, &row);
            let own = &parameters[range.clone()];
            let twists = &mut out.twists;
            let moved;
            (pose, moved) = frame.differentiate(&pose, own, displacement, &mut twists[range]);
            if let Some(motion) = &frame.motion {
                motion.by_parameters(parameters, &row, |k, slope| twists[k] = moved.times(slope));
                out.motions.push(moved);
            }
        }
        out.tool = pose;
    }
}
