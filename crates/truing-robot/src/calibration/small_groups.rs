//! Planes touched and points visited too few times to say anything.

use super::doubt::shortened;
use super::measurement::{Measured, MeasurementSet};
use super::run::Calibration;
use crate::error::Error;
use crate::file::InputError;

impl Calibration {
    /// Leaves out planes with fewer than four touches and points visited once: any robot fits them.
    pub(super) fn without_small_groups(&self) -> Result<(Self, Vec<String>), Error> {
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
    let (groups, least, group, row) = match &set.measured {
        Measured::UnknownPlane(groups) => (groups, 4, "plane", "touches"),
        Measured::SamePoint(groups) => (groups, 2, "point", "visits"),
        Measured::SameLocation(groups) => (groups, 2, "location", "visits"),
        _ => return Ok(None),
    };
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
            number_of(counts[*only], row)
        ),
        _ => {
            let listed: Vec<String> = small
                .iter()
                .map(|g| format!("`{}` ({})", groups.names[*g], counts[*g]))
                .collect();
            format!(
                "`{}`: {} {group}s have too few {row}: {}; expected at least {least} each, for fewer fit any robot",
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

/// "1 touch", "2 touches": `plural` is one of the words used here.
fn number_of(count: usize, plural: &str) -> String {
    let word = match (count, plural) {
        (1, "touches") => "touch",
        (1, "visits") => "visit",
        _ => plural,
    };
    format!("{count} {word}")
}

/// A set without some of its groups; the others are numbered anew.
fn keep_groups(set: &MeasurementSet, without: &[usize]) -> MeasurementSet {
    let Some(groups) = set.measured.groups() else {
        return set.clone();
    };
    let kept: Vec<usize> = (0..groups.names.len())
        .filter(|g| !without.contains(g))
        .collect();
    let rows: Vec<usize> = (0..set.len())
        .filter(|row| kept.contains(&groups.of_row[*row]))
        .collect();
    let names = kept.iter().map(|g| groups.names[*g].clone()).collect();
    let mut set = set.rows(&rows);
    if let Some(groups) = set.measured.groups_mut() {
        groups.names = names;
        for g in &mut groups.of_row {
            *g = kept.iter().position(|k| k == g).unwrap_or_default();
        }
    }
    set
}
