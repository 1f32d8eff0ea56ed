//! What was read, as plain data.

use super::groups::{Groups, Rows};
use std::path::PathBuf;
use truing::Loss;
use truing::manifold::Pose;

/// Where the rows of a set were read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Origin {
    /// The data file.
    pub path: PathBuf,
    /// The line of every row, from 1.
    pub lines: Vec<usize>,
    /// The number of every row in the file, from 0, as `rows` counts in calibration files.
    pub rows: Vec<usize>,
}

/// A tool that a set is measured with: a robot, where its joints were, and the point or body on it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tool {
    /// Which robot.
    pub robot: usize,
    /// Joint values, one row a measurement.
    pub q: Vec<Vec<f64>>,
    /// The tool point, or the body on the tool, where it is not the tool itself; estimated.
    pub target: Option<String>,
    /// Where to start its estimate, in the tool frame.
    pub guess: Option<Pose<f64>>,
}

/// What a set of measurements read, whatever it means.
#[derive(Debug, Clone)]
pub struct Readings {
    /// Name, for reports; no two sets of a calibration have the same.
    pub name: String,
    /// The tools: one, or two where something between two tools was measured.
    pub tools: Vec<Tool>,
    /// What was read, in the columns of the kind [m, rad, or as the kind says].
    pub values: Rows,
    /// The groups of rows.
    pub groups: Groups,
    /// Standard deviations of every row, one a measurand of the kind.
    pub sigma: Rows,
    /// The loss.
    pub loss: Loss,
    /// The sensor's frame, where it is not the reference frame; estimated.
    pub frame: Option<String>,
    /// Where to start its estimate.
    pub frame_guess: Option<Pose<f64>>,
    /// Where every row was read, for messages; none for measurements that are not of a file.
    pub origin: Option<Origin>,
}

impl Readings {
    /// The (first) tool.
    pub fn tool(&self) -> &Tool {
        &self.tools[0]
    }

    /// Joint values of the (first) tool.
    pub fn q(&self) -> &[Vec<f64>] {
        &self.tools[0].q
    }

    /// The tool points and bodies that the set names, as (robot, name), each once.
    pub fn targets(&self) -> Vec<(usize, String)> {
        let mut all = Vec::new();
        for tool in &self.tools {
            if let Some(name) = &tool.target {
                let key = (tool.robot, name.clone());
                if !all.contains(&key) {
                    all.push(key);
                }
            }
        }
        all
    }

    /// Whether the set measures with a robot.
    pub fn is_of(&self, robot: usize) -> bool {
        self.tools.iter().any(|tool| tool.robot == robot)
    }

    /// Number of measurements.
    pub fn len(&self) -> usize {
        self.tools[0].q.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Some of the rows, in the given order. Groups keep their names and numbers.
    #[must_use]
    pub fn rows(&self, rows: &[usize]) -> Self {
        fn pick<T: Clone>(all: &[T], rows: &[usize]) -> Vec<T> {
            rows.iter().map(|row| all[*row].clone()).collect()
        }
        let tool = |tool: &Tool| Tool {
            q: pick(&tool.q, rows),
            ..tool.clone()
        };
        Self {
            tools: self.tools.iter().map(tool).collect(),
            values: self.values.pick(rows),
            groups: Groups {
                names: self.groups.names.clone(),
                of_row: pick(&self.groups.of_row, rows),
            },
            sigma: self.sigma.pick(rows),
            origin: self.origin.as_ref().map(|origin| Origin {
                path: origin.path.clone(),
                lines: pick(&origin.lines, rows),
                rows: pick(&origin.rows, rows),
            }),
            ..self.clone()
        }
    }
}
