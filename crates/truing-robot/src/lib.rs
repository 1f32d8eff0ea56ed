//! Geometric robot calibration on the [`truing`] estimation framework.
//!
//! A [`Robot`] is a chain of frames with named parameters; a [`Calibration`] holds robots and sets of
//! measurements in any mixture and estimates what they can identify. What can be measured is open: a
//! [`Kind`](measurement::Kind) of measurement is one type, the [`kinds`] here are eight of them, and a
//! [`Plugin`] hands more to files by name.
//!
//! Positions by a tracker and a ball bar at an anchor that nobody measured, together:
//!
//! ```
//! use truing::nalgebra::Vector3;
//! use truing_robot::robot::{Convention, FrameRow, JointKind, JointRow, RobotFile};
//! use truing_robot::{Calibration, Robot, kinds};
//!
//! let arm = |links: [f64; 3]| {
//!     let mut file = RobotFile::new("arm", Convention::KhalilKleinfinger);
//!     for (k, d) in links.into_iter().enumerate() {
//!         let frame = FrameRow { alpha: 1.5 * k as f64, d, ..FrameRow::default() };
//!         file.joints.push(JointRow::new(format!("q{}", k + 1), JointKind::Revolute, frame));
//!     }
//!     file.tool.d = 0.3;
//!     Robot::new(&file)
//! };
//! let truth = arm([0.0, 0.401, 0.299]);
//! let q: Vec<Vec<f64>> = (0..60).map(|i| (1..=3).map(|k| ((i * k * k) as f64 * 0.7).sin() * 2.0).collect()).collect();
//! let at: Vec<Vector3<f64>> = q.iter().map(|q| truth.forward(&truth.nominal(), q).translation).collect();
//! let lengths: Vec<f64> = at.iter().map(|p| (p - Vector3::new(0.5, 0.2, 0.9)).norm()).collect();
//! let outcome = Calibration::of(arm([0.0, 0.4, 0.3]))
//!     .measured(kinds::position("tracker", q[..30].to_vec(), &at[..30]))
//!     .measured(kinds::ball_bar("bar", q[30..].to_vec(), &lengths[30..], None))
//!     .estimating(&["d2", "d3"])
//!     .calibrate()?;
//! assert!((outcome.result.parameter("d2").unwrap().estimate - 0.401).abs() < 1e-9);
//! # Ok::<(), truing_robot::Error>(())
//! ```

pub mod check;
pub mod doubt;
mod error;
pub mod estimate;
pub mod file;
pub mod identify;
pub mod judge;
pub mod load;
pub mod measurement;
pub mod model;
mod plugin;
mod questions;
pub mod result;
pub mod robot;
mod run;
pub mod simulate;
pub mod start;
pub mod study;
pub mod text;
pub mod unknown;

pub use error::Error;
pub use estimate::{Calibration, Estimate};
pub use measurement::{MeasurementSet, kinds};
pub use plugin::{Plugin, Registry};
pub use robot::{Arm, Robot};
pub use run::Outcome;
