//! Drawing a measurement: a posture anywhere, or one that satisfies a condition exactly.

use super::at::At;
use crate::error::Error;
use crate::robot::Regressor;
use crate::robot::posture::{self, Posed};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use truing::Variable;
use truing::manifold::Pose;
use truing::nalgebra::{DMatrix, DVector, Vector3};

/// A row of a condition on tools: its value [m or rad], and its derivatives by the position and by the
/// rotation of each tool (a turn by a small rotation vector about the reference axes).
#[derive(Debug, Clone)]
pub struct ConditionRow {
    /// Zero where the condition holds.
    pub value: f64,
    /// By position and rotation, one pair a tool.
    pub by: Vec<(Vector3<f64>, Vector3<f64>)>,
}

impl ConditionRow {
    /// A row about the position of one tool.
    pub fn at(value: f64, by: Vector3<f64>) -> Self {
        Self {
            value,
            by: vec![(by, Vector3::zeros())],
        }
    }

    /// A row about the rotation of one tool.
    pub fn turned(value: f64, by: Vector3<f64>) -> Self {
        Self {
            value,
            by: vec![(Vector3::zeros(), by)],
        }
    }

    /// The three rows of tip = point.
    pub fn point(tip: &Vector3<f64>, point: &Vector3<f64>) -> [Self; 3] {
        std::array::from_fn(|k| Self::at(tip[k] - point[k], Vector3::ith(k, 1.0)))
    }
}

/// One measurement being drawn.
pub struct Draw<'a> {
    /// The set, with everything as it truly is.
    pub at: At<'a>,
    /// The group that is drawn for.
    pub group: usize,
    /// Standard deviations of the noise, one a measurand; zero for none.
    pub noise: &'a [f64],
    pub(crate) limits: &'a [[f64; 2]],
    /// Postures of all tools near which every second one is looked for.
    pub(crate) near: &'a [Vec<f64>],
    pub(crate) rng: &'a mut ChaCha8Rng,
    pub(crate) attempt: usize,
    /// The posture found, of all tools one after another.
    pub(crate) posture: Vec<f64>,
}

impl Draw<'_> {
    /// Three independent numbers of mean 0 and standard deviation 1.
    pub fn normal(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.rng.sample(StandardNormal))
    }

    /// The noise of a measurand that has one row, drawn.
    pub fn error(&mut self, measurand: usize) -> f64 {
        self.normal().x * self.noise[measurand]
    }

    /// The true value of an unknown of the group.
    ///
    /// # Panics
    /// If the kind has no such unknown, or of another type.
    #[track_caller]
    pub fn own<V: Variable>(&self, name: &str) -> V::Value
    where
        V::Value: 'static,
    {
        match self.at.own_as::<V>(self.group, name) {
            Some(value) => value.clone(),
            None => panic!("there is no unknown `{name}` of this type"),
        }
    }

    /// The name of the group, for messages.
    pub fn group_name(&self) -> &str {
        &self.at.readings.groups.names[self.group]
    }

    /// Puts the tools anywhere between the joint limits (or, every second time, near given postures); where
    /// they are then, with their targets, in the reference frame.
    pub fn anywhere(&mut self) -> Vec<Pose<f64>> {
        self.posture = start(self.limits, self.near, self.attempt, self.rng);
        self.tools(&self.posture)
    }

    fn tools(&self, posture: &[f64]) -> Vec<Pose<f64>> {
        let mut first = 0;
        let tools = self.at.readings.tools.iter().enumerate();
        tools
            .map(|(k, tool)| {
                let robot = &self.at.arms[tool.robot].robot;
                let q = &posture[first..first + robot.given()];
                first += q.len();
                let flange = robot.forward(&self.at.state.robots[tool.robot], q);
                flange.compose(&self.at.target(k))
            })
            .collect()
    }

    /// Puts the tools where a condition holds exactly; `what` names it where it cannot be reached. Of
    /// starting postures `tries` are taken at most: 400 are many.
    ///
    /// # Errors
    /// If none of them leads there.
    pub fn reach(
        &mut self,
        what: &str,
        tries: usize,
        condition: impl Fn(&[Pose<f64>]) -> Vec<ConditionRow>,
    ) -> Result<(), Error> {
        let posed: Vec<Posed<'_>> = (0..self.at.readings.tools.len())
            .map(|k| {
                let robot = self.at.readings.tools[k].robot;
                Posed {
                    robot: &self.at.arms[robot].robot,
                    parameters: &self.at.state.robots[robot],
                    target: self.at.target(k).translation,
                }
            })
            .collect();
        let targets: Vec<Pose<f64>> = (0..posed.len()).map(|k| self.at.target(k)).collect();
        let on_joints = |q: &[f64]| by_joints(&posed, &targets, q, &condition);
        for attempt in 0..tries {
            let start = start(self.limits, self.near, attempt, self.rng);
            // Data may lie outside the limits a robot file gives: those postures count too.
            let limits: Vec<[f64; 2]> = self
                .limits
                .iter()
                .zip(&start)
                .map(|([l, u], q)| [l.min(*q), u.max(*q)])
                .collect();
            if let Some(q) = posture::satisfy(start, &limits, on_joints) {
                self.posture = q;
                return Ok(());
            }
        }
        Err(Error::Unreachable {
            message: format!(
                "`{}`: none of {tries} starting postures leads the robot to {what}",
                self.at.readings.name
            ),
            help:
                "check the robot table, where the plane, point or location is, the units and the joint limits"
                    .into(),
        })
    }
}

/// A start: anywhere between the limits, or (for odd tries) within half a radian of a near posture.
fn start(limits: &[[f64; 2]], near: &[Vec<f64>], attempt: usize, rng: &mut ChaCha8Rng) -> Vec<f64> {
    if attempt.is_multiple_of(2) || near.is_empty() {
        return posture::random(limits, rng);
    }
    let base = &near[rng.random_range(0..near.len())];
    base.iter()
        .zip(limits)
        .map(|(q, [l, u])| (q + rng.random_range(-0.5..0.5)).clamp(l.min(*q), u.max(*q)))
        .collect()
}

/// The rows of a condition, and their derivatives by the joints of all tools.
fn by_joints(
    posed: &[Posed<'_>],
    targets: &[Pose<f64>],
    q: &[f64],
    condition: &impl Fn(&[Pose<f64>]) -> Vec<ConditionRow>,
) -> (DVector<f64>, DMatrix<f64>) {
    let mut first = 0;
    let (mut tools, mut moves, mut turns) = (Vec::new(), Vec::new(), Vec::new());
    for (posed, target) in posed.iter().zip(targets) {
        let own = &q[first..first + posed.robot.given()];
        let mut regressor = Regressor::default();
        let (tip, moved) = posed.tip(own, &mut regressor);
        let turned = posed.turns(own, &regressor);
        for number in 0..own.len() {
            turns.push(turned.fixed_view::<3, 1>(0, number).into_owned());
            moves.push(moved.fixed_view::<3, 1>(0, number).into_owned());
        }
        tools.push(Pose {
            rotation: regressor.tool.rotation * target.rotation,
            translation: tip,
        });
        first += own.len();
    }
    let rows = condition(&tools);
    let tool_of: Vec<usize> = posed
        .iter()
        .enumerate()
        .flat_map(|(k, posed)| vec![k; posed.robot.given()])
        .collect();
    let values = DVector::from_iterator(rows.len(), rows.iter().map(|row| row.value));
    let jacobian = DMatrix::from_fn(rows.len(), q.len(), |row, joint| {
        let (by_position, by_rotation) = rows[row].by[tool_of[joint]];
        by_position.dot(&moves[joint]) + by_rotation.dot(&turns[joint])
    });
    (values, jacobian)
}
