//! Robots from their files.

use crate::file::RobotRef;
use crate::robot::{Arm, Models, Robot, RobotFile};
use crate::text::{InputError, Source};
use std::ops::Range;
use std::path::Path;

/// Reads robots from their files.
pub fn read_arms(
    robots: &[RobotRef],
    source: &Source,
    models: &Models,
) -> Result<Vec<Arm>, InputError> {
    let read = |robot: &RobotRef| {
        let file = RobotFile::read_with(&robot.file, models)
            .map_err(|error| shown_where_named(error, &robot.file, source, robot.span.clone()))?;
        Ok(Arm {
            name: robot.name.clone(),
            robot: Robot::new(&file),
        })
    };
    robots.iter().map(read).collect()
}

/// A file that is not there is an error of the file that names it; what is wrong inside stays there.
pub fn shown_where_named(
    error: InputError,
    path: &Path,
    source: &Source,
    span: Range<usize>,
) -> InputError {
    let found = if path.is_dir() {
        "is a folder; expected a file"
    } else if path.exists() {
        return error;
    } else {
        "does not exist"
    };
    source
        .error_at(span, format!("{} {found}", path.display()))
        .with_help("check the path: one inside a file is relative to that file's folder")
}
