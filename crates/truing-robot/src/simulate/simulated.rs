//! Simulated data as files.

use crate::measurement::{MeasurementSet, Tool};
use crate::robot::{Arm, RobotFile};
use crate::unknown::State;
use std::fmt::Write;

/// Simulated data, ready to be written.
#[derive(Debug, Clone)]
pub struct Simulated {
    /// The nominal robots.
    pub arms: Vec<Arm>,
    /// Robots, planes, points, frames and tool points as they truly are.
    pub truth: State,
    /// The measurements.
    pub sets: Vec<MeasurementSet>,
    /// Names of the data files, one a set.
    pub files: Vec<String>,
}

impl Simulated {
    /// The true robots, with their names in the simulation.
    pub fn true_robots(&self) -> Vec<(String, RobotFile)> {
        self.arms
            .iter()
            .zip(&self.truth.robots)
            .map(|(arm, values)| (arm.name.clone(), arm.robot.with_parameters(values)))
            .collect()
    }

    /// Set number `k` as CSV: joint columns, what was measured, groups; metres and radians.
    pub fn csv(&self, k: usize) -> String {
        let set = &self.sets[k];
        let prefixed = |robot: usize, suffix: &str| -> Vec<String> {
            let (arm, robot) = (&self.arms[robot].name, &self.arms[robot].robot);
            let joints = robot.joints().iter().map(|joint| &joint.name);
            let columns = robot.columns().iter().map(|column| &column.name);
            joints
                .chain(columns)
                .map(|name| {
                    if arm.is_empty() {
                        format!("{name}{suffix}")
                    } else {
                        format!("{arm}.{name}{suffix}")
                    }
                })
                .collect()
        };
        let first = set.tool().robot;
        let mut header = prefixed(first, "");
        for tool in &set.tools[1..] {
            let suffix = if tool.robot == first { "b" } else { "" };
            header.extend(prefixed(tool.robot, suffix));
        }
        let columns = set.kind.columns().iter().map(|column| column.name);
        let grouping = set.kind.grouping().map(|grouping| grouping.group);
        header.extend(columns.chain(grouping).map(str::to_owned));
        let mut text = header.join(",") + "\n";
        for row in 0..set.len() {
            let given = |tool: &Tool| {
                let given = self.arms[tool.robot].robot.given();
                tool.q[row][..given].to_vec()
            };
            let postures: Vec<f64> = set.tools.iter().flat_map(given).collect();
            let numbers = postures.iter().chain(set.values.row(row));
            let mut cells: Vec<String> = numbers.map(f64::to_string).collect();
            if grouping.is_some() {
                cells.push(set.groups.names[set.groups.of_row[row]].clone());
            }
            text += &(cells.join(",") + "\n");
        }
        text
    }

    /// A calibration file that reads the data, with the robots under `robot_files`.
    pub fn calibration_toml(&self, robot_files: &[String]) -> String {
        let quoted = |text: &str| format!("{text:?}");
        let mut out = String::new();
        for (arm, file) in self.arms.iter().zip(robot_files) {
            let title = if arm.name.is_empty() {
                "robot".to_owned()
            } else {
                format!("robots.{}", arm.name)
            };
            let _ = writeln!(out, "[{title}]\nfile = {}\n", quoted(file));
        }
        out.push_str("[estimate]\nparameters = [\"all\"]\n");
        for (set, data) in self.sets.iter().zip(&self.files) {
            let _ = writeln!(out, "\n[[constraint]]\nname = {}", quoted(&set.name));
            let _ = writeln!(
                out,
                "kind = \"{}\"\ndata = {}",
                set.kind.name(),
                quoted(data)
            );
            let first = set.tool().robot;
            let other = set.tools.iter().find(|tool| tool.robot != first);
            let name = |robot: usize| quoted(&self.arms[robot].name);
            match other {
                Some(other) => {
                    let names = [name(first), name(other.robot)];
                    let _ = writeln!(out, "robots = [{}]", names.join(", "));
                }
                None if self.arms.len() > 1 => {
                    let _ = writeln!(out, "robot = {}", name(first));
                }
                None => {}
            }
            for (key, value) in set.kind.written() {
                let _ = writeln!(out, "{key} = {value}");
            }
            if !set.is_empty() {
                let sigma = set.sigma.row(0);
                let _ = match (set.kind.measurands(), sigma) {
                    ([_], [sigma]) => writeln!(out, "sigma = {sigma:?}"),
                    (measurands, sigma) => {
                        let all = measurands.iter().zip(sigma);
                        let all: Vec<String> =
                            all.map(|(m, s)| format!("{} = {s:?}", m.name)).collect();
                        writeln!(out, "sigma = {{ {} }}", all.join(", "))
                    }
                };
            }
            for (key, value) in [("frame", &set.frame), ("target", &set.tool().target)] {
                if let Some(value) = value {
                    let _ = writeln!(out, "{key} = {}", quoted(value));
                }
            }
        }
        out
    }
}
