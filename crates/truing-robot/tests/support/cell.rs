//! A calibration cell in a folder of its own: a robot, readings of its tool and a calibration file.

#![allow(dead_code, reason = "each test file uses what it needs")]

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::{Path, PathBuf};
use truing_robot::Robot;
use truing_robot::robot::RobotFile;

/// A robot like the PUMA 560, its wrist out of line so that nothing is singular.
pub const ROBOT: &str = r#"name = "PUMA 560"
convention = "khalil-kleinfinger"
units = { angle = "deg", length = "m" }

[base]
theta = 17.0
r = 0.4

[[joint]]
name = "waist"
type = "revolute"
alpha = 11.0
d = 0.15
theta = 5.0
r = 0.25
limits = [-160.0, 160.0]

[[joint]]
name = "shoulder"
type = "revolute"
alpha = -90.0
r = 0.15

[[joint]]
name = "elbow"
type = "revolute"
d = 0.43
theta = 90.0

[[joint]]
name = "roll"
type = "revolute"
alpha = -90.0
d = 0.02
r = 0.43

[[joint]]
name = "pitch"
type = "revolute"
alpha = 90.0

[[joint]]
name = "yaw"
type = "revolute"
alpha = -90.0

[tool]
alpha = 17.0
d = 0.12
theta = 23.0
r = 0.08
"#;

/// What to estimate: everything, from positions of the tool.
pub const CALIBRATION: &str = r#"[robot]
file = "robot.toml"

[[constraint]]
kind = "position"
data = "tracker.csv"
sigma = "0.05 mm"
"#;

/// The joints of [`ROBOT`] as a header.
pub const JOINTS: &str = "waist,shoulder,elbow,roll,pitch,yaw";

/// A reading: joint values [rad] and what the tracker saw [m].
#[derive(Debug, Clone)]
pub struct Reading {
    /// Joint values.
    pub q: Vec<f64>,
    /// Position of the tool.
    pub position: [f64; 3],
    /// Its unit quaternion (w, x, y, z).
    pub quaternion: [f64; 4],
}

/// The parameters of the robot that was measured: nominal, each off by up to 1 mm or 1 mrad; gains
/// are what they are.
pub fn true_parameters(robot: &Robot, seed: u64) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let parameters = robot.parameters().iter();
    parameters
        .map(|p| {
            let gain = p.name.starts_with('K') || p.name.starts_with("beta");
            let size = if gain { 0.0 } else { 1e-3 };
            p.nominal + size * random.random_range(-1.0..1.0)
        })
        .collect()
}

/// Readings of a robot with these parameters at random postures, with errors of up to `noise` \[m\].
pub fn measure(
    robot: &Robot,
    parameters: &[f64],
    count: usize,
    noise: f64,
    seed: u64,
) -> Vec<Reading> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut readings = Vec::new();
    for _ in 0..count {
        let q: Vec<f64> = robot
            .joints()
            .iter()
            .map(|_| random.random_range(-2.5..2.5))
            .collect();
        let pose = robot.forward(parameters, &q);
        let mut off = || noise * random.random_range(-1.0..=1.0);
        readings.push(Reading {
            position: [0, 1, 2].map(|i| pose.translation[i] + off()),
            quaternion: pose.quaternion(),
            q,
        });
    }
    readings
}

/// Numbers as cells of a row, exactly.
pub fn cells(numbers: &[f64]) -> String {
    let cells: Vec<String> = numbers.iter().map(|x| format!("{x:?}")).collect();
    cells.join(",")
}

/// Readings as CSV with a row of `cells` made from each.
pub fn table<'r>(
    header: &str,
    readings: impl IntoIterator<Item = &'r Reading>,
    row: impl Fn(&Reading) -> Vec<f64>,
) -> String {
    let mut text = format!("{header}\n");
    for reading in readings {
        text += &cells(&row(reading));
        text += "\n";
    }
    text
}

/// Readings as positions: `waist,…,yaw,x,y,z`.
pub fn positions<'r>(readings: impl IntoIterator<Item = &'r Reading>) -> String {
    table(&format!("{JOINTS},x,y,z"), readings, |r| {
        [&r.q[..], &r.position].concat()
    })
}

/// A folder with `robot.toml`, `tracker.csv` (40 positions) and `calibration.toml`.
pub struct Cell {
    folder: tempfile::TempDir,
}

impl Cell {
    /// A cell whose calibration converges.
    pub fn new() -> Self {
        let cell = Self::empty();
        cell.write("robot.toml", ROBOT);
        cell.write("calibration.toml", CALIBRATION);
        cell.write("tracker.csv", positions(&cell.readings(40)));
        cell
    }

    /// An empty folder.
    pub fn empty() -> Self {
        let folder = tempfile::Builder::new()
            .prefix("truing-cell-")
            .tempdir()
            .unwrap();
        Self { folder }
    }

    /// The nominal robot.
    pub fn robot(&self) -> Robot {
        Robot::new(&RobotFile::parse(ROBOT, "robot.toml").unwrap())
    }

    /// Readings of the true robot to 0.05 mm.
    pub fn readings(&self, count: usize) -> Vec<Reading> {
        let robot = self.robot();
        measure(&robot, &true_parameters(&robot, 1), count, 5e-5, 2)
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// The path of a file of the cell.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), content).unwrap();
    }

    /// The text of a file.
    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    /// Replaces a text that is in a file once or more, the first time it comes.
    #[track_caller]
    pub fn edit(&self, name: &str, from: &str, to: &str) {
        let text = self.read(name);
        assert!(text.contains(from), "{name} has no `{from}`");
        self.write(name, text.replacen(from, to, 1));
    }

    /// Adds lines to the end of a file.
    pub fn append(&self, name: &str, lines: &str) {
        self.write(name, self.read(name) + lines);
    }

    /// The paths of all files and folders of the cell, in order.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut found = Vec::new();
        let mut folders = vec![self.folder.path().to_owned()];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path.clone());
                }
                found.push(path);
            }
        }
        found.sort();
        found
    }
}
