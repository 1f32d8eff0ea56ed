//! Planes touched and points visited too few times to say anything.

use super::job::Job;
use super::words::shortened;
use crate::error::Error;
use crate::measurement::{Groups, MeasurementSet};
use crate::text::InputError;

impl Job {
    /// Leaves out planes with fewer than four touches and points visited once: any robot fits them.
    pub fn without_small_groups(&self) -> Result<(Self, Vec<String>), Error> {
        let mut warnings = Vec::new();
        let mut calibration = self.clone();
        for (k, set) in calibration.sets.iter_mut().enumerate() {
            let Some((small, warning)) = small_groups(set)? else {
                continue;
            };
            warnings.push(warning);
            *set = keep_groups(set, &small);
            for (of, held) in &mut calibration.held_out {
                if *of == k {
                    *held = keep_groups(held, &small);
                }
            }
        }
        for set in &mut calibration.validate {
            if let Some((small, warning)) = small_groups(set)? {
                warnings.push(warning);
                *set = keep_groups(set, &small);
            }
        }
        calibration.held_out.retain(|(_, set)| !set.is_empty());
        Ok((calibration, warnings))
    }
}

/// The groups of a set that have too few rows, and a warning; an error if all of them have.
fn small_groups(set: &MeasurementSet) -> Result<Option<(Vec<usize>, String)>, Error> {
    let Some(grouping) = set.kind.grouping() else {
        return Ok(None);
    };
    let (groups, group, least) = (&set.groups, grouping.group, grouping.least);
    let rows = grouping.rows[1];
    let counts = groups.counts();
    let small: Vec<usize> = (0..counts.len()).filter(|g| counts[*g] < least).collect();
    let Some(first) = small.first() else {
        return Ok(None);
    };
    let message = match small.as_slice() {
        [only] => format!(
            "`{}`: {group} `{}` has {}; expected at least {least}, for fewer fit any robot",
            set.name,
            groups.names[*only],
            number_of(counts[*only], grouping.rows)
        ),
        _ => {
            let listed: Vec<String> = small
                .iter()
                .map(|g| format!("`{}` ({})", groups.names[*g], counts[*g]))
                .collect();
            format!(
                "`{}`: {} {group}s have too few {rows}: {}; expected at least {least} each, for fewer fit any robot",
                set.name,
                small.len(),
                shortened(&listed)
            )
        }
    };
    if small.len() < counts.len() {
        return Ok(Some((small, format!("{message}; left out"))));
    }
    let help = format!("measure each at least {least} times, or group by another column");
    Err(match &set.origin {
        None => Error::calibration(message, help),
        Some(origin) => {
            let error = InputError::new(&origin.path, message).with_help(help);
            let row = groups.of_row.iter().position(|g| g == first);
            match row {
                Some(row) => error.with_line(origin.lines[row]),
                None => error,
            }
            .into()
        }
    })
}

/// "1 touch", "2 touches".
fn number_of(count: usize, [one, several]: [&str; 2]) -> String {
    format!("{count} {}", if count == 1 { one } else { several })
}

/// A set without some of its groups; the others are numbered anew.
fn keep_groups(set: &MeasurementSet, without: &[usize]) -> MeasurementSet {
    let groups = &set.groups;
    let kept: Vec<usize> = (0..groups.len()).filter(|g| !without.contains(g)).collect();
    let rows: Vec<usize> = (0..set.len())
        .filter(|row| kept.contains(&groups.of_row[*row]))
        .collect();
    let place = |row: &usize| kept.iter().position(|k| *k == groups.of_row[*row]);
    let mut of = set.rows(&rows);
    of.readings.groups = Groups {
        names: kept.iter().map(|g| groups.names[*g].clone()).collect(),
        of_row: rows.iter().filter_map(place).collect(),
    };
    of
}
