//! A set of measurements with robots, frames and tool points as they are in a state.

use super::readings::Readings;
use crate::robot::{Arm, Unit};
use crate::unknown::{State, Value};
use truing::Variable;
use truing::manifold::Pose;
use truing::nalgebra::Vector3;

/// What a set read, with robots, frames and tool points as they are in a state.
#[derive(Clone, Copy)]
pub struct At<'a> {
    /// The robots.
    pub arms: &'a [Arm],
    /// What was read.
    pub readings: &'a Readings,
    /// Where everything is.
    pub state: &'a State,
}

impl At<'_> {
    /// What was read in a row.
    pub fn values(&self, row: usize) -> &[f64] {
        self.readings.values.row(row)
    }

    /// The rows of a group.
    pub fn rows(&self, group: usize) -> Vec<usize> {
        self.readings.groups.rows(group).collect()
    }

    /// The tool point or body of tool number `tool`, in the tool frame; the tool itself by default.
    pub fn target(&self, tool: usize) -> Pose<f64> {
        let tool = &self.readings.tools[tool];
        let named = tool.target.as_ref();
        named
            .and_then(|name| self.state.body(tool.robot, name))
            .unwrap_or_else(Pose::identity)
    }

    /// Where tool number `tool` was in a row, in the reference frame, without its target.
    pub fn flange(&self, tool: usize, row: usize) -> Pose<f64> {
        let tool = &self.readings.tools[tool];
        let robot = &self.arms[tool.robot].robot;
        robot.forward(&self.state.robots[tool.robot], &tool.q[row])
    }

    /// Where the tool point of tool number `tool` was in a row, in the reference frame \[m\].
    pub fn tip(&self, tool: usize, row: usize) -> Vector3<f64> {
        self.flange(tool, row).apply(&self.target(tool).translation)
    }

    /// The tool points of a group in the reference frame \[m\].
    pub fn tips(&self, group: usize) -> Vec<Vector3<f64>> {
        let rows = self.readings.groups.rows(group);
        rows.map(|row| self.tip(0, row)).collect()
    }

    /// All tool points in the reference frame \[m\].
    pub fn all_tips(&self) -> Vec<Vector3<f64>> {
        (0..self.readings.len())
            .map(|row| self.tip(0, row))
            .collect()
    }

    /// The sensor's pose in the reference frame.
    pub fn sensor(&self) -> Pose<f64> {
        let frame = self.readings.frame.as_ref();
        frame
            .and_then(|name| self.state.frame(name))
            .unwrap_or_else(Pose::identity)
    }

    /// The value of an unknown of a group.
    pub fn own(&self, group: usize, name: &str) -> Option<&Value> {
        let groups = &self.readings.groups;
        self.state
            .own(&self.readings.name, &groups.names[group], name)
    }

    /// The value of an unknown of a group, of that type.
    pub fn own_as<V: Variable>(&self, group: usize, name: &str) -> Option<&V::Value>
    where
        V::Value: 'static,
    {
        self.own(group, name)?.get::<V>()
    }

    /// The sum of all lengths of the (first) robot \[m\].
    pub fn size(&self) -> f64 {
        let robot = self.readings.tools[0].robot;
        let parameters = self.arms[robot].robot.parameters();
        let lengths = parameters.iter().zip(&self.state.robots[robot]);
        lengths
            .filter(|(p, _)| p.unit() == Unit::Meter)
            .map(|(_, length)| length.abs())
            .sum()
    }
}
