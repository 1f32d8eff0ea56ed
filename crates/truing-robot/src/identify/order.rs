//! In which order columns are kept.

use crate::model::{Assembly, Owner};
use crate::robot::Arm;
use crate::unknown::Role;

/// Columns in the order of preference: what was touched and visited first (whatever it costs the
/// robot is gauge), then sensor frames and instruments, then tool points, then the robots' parameters.
pub fn in_order(
    assembly: &Assembly,
    preference: &[(usize, usize)],
    wanted: impl Fn(&Owner) -> bool,
) -> Vec<usize> {
    let rank = |owner: &Owner| match owner {
        Owner::Own {
            role: Role::Place, ..
        } => (0, 0),
        Owner::Frame(_) | Owner::Own { .. } => (1, 0),
        Owner::Target(..) => (2, 0),
        Owner::Parameter { robot, parameter } => (
            3,
            preference
                .iter()
                .position(|p| *p == (*robot, *parameter))
                .unwrap_or(usize::MAX),
        ),
        Owner::Constant => (4, 0),
    };
    let mut columns: Vec<usize> = (0..assembly.columns.len())
        .filter(|c| {
            assembly.columns[*c].owner != Owner::Constant && wanted(&assembly.columns[*c].owner)
        })
        .collect();
    columns.sort_by_key(|c| rank(&assembly.columns[*c].owner));
    columns
}

/// The default order of preference over all robots, as (robot, parameter).
pub fn default_preference(arms: &[Arm]) -> Vec<(usize, usize)> {
    let mut all: Vec<(usize, usize)> = arms
        .iter()
        .enumerate()
        .flat_map(|(r, arm)| (0..arm.robot.parameters().len()).map(move |p| (r, p)))
        .collect();
    all.sort_by_key(|(r, p)| {
        let (class, place) = arms[*r].robot.preference(*p);
        (class, *r, place)
    });
    all
}
