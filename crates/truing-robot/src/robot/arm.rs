//! A robot under its name in a calibration.

use super::serial::Robot;

/// A robot under its name in the calibration; empty if there is only one.
#[derive(Debug, Clone)]
pub struct Arm {
    /// The name, the prefix of its parameters.
    pub name: String,
    /// The robot.
    pub robot: Robot,
}

impl Arm {
    /// The only robot of a calibration.
    pub fn only(robot: Robot) -> Self {
        Self {
            name: String::new(),
            robot,
        }
    }

    /// A robot beside others.
    pub fn named(name: impl Into<String>, robot: Robot) -> Self {
        Self {
            name: name.into(),
            robot,
        }
    }

    /// What messages call it: its name in the calibration, or that of its file.
    pub fn title(&self) -> &str {
        if self.name.is_empty() {
            self.robot.name()
        } else {
            &self.name
        }
    }

    /// A parameter's name with the arm's prefix: `theta3`, or `left.theta3`.
    pub fn parameter_name(&self, parameter: usize) -> String {
        self.prefixed(&self.robot.parameters()[parameter].name)
    }

    /// A name with the arm's prefix.
    pub(crate) fn prefixed(&self, name: &str) -> String {
        if self.name.is_empty() {
            name.to_owned()
        } else {
            format!("{}.{name}", self.name)
        }
    }
}
