//! Checking measurements that stand in memory, once, before anything is computed from them.

use crate::error::Error;
use crate::measurement::{MeasurementSet, TargetKind};
use crate::robot::Arm;
use std::collections::BTreeMap;

/// Checks all sets of a calibration; rows may be brought to the form that equations expect.
///
/// # Errors
/// Names the set, and the row where it is one, with what was found and what was expected.
pub fn check_sets(
    arms: &[Arm],
    sets: &mut [MeasurementSet],
    held_out: Vec<&mut MeasurementSet>,
    validate: &mut [MeasurementSet],
    notes: &mut Vec<String>,
) -> Result<(), Error> {
    if arms.is_empty() || sets.is_empty() {
        return Err(Error::calibration(
            format!(
                "found {} robots and {} sets of measurements; expected at least one of each",
                arms.len(),
                sets.len()
            ),
            "add a robot, and measurements of it",
        ));
    }
    let mut names: BTreeMap<String, ()> = BTreeMap::new();
    let mut targets: BTreeMap<(usize, String), (TargetKind, String)> = BTreeMap::new();
    for set in sets.iter().chain(validate.iter()) {
        if names.insert(set.name.clone(), ()).is_some() {
            let message = format!("two sets of measurements are called `{}`", set.name);
            return Err(Error::calibration(message, "give each a name of its own"));
        }
    }
    for set in sets.iter_mut().chain(held_out).chain(validate) {
        check(arms, set, notes)?;
        for key in set.targets() {
            let known = targets
                .entry(key.clone())
                .or_insert_with(|| (set.kind.targets(), set.name.clone()));
            if known.0 != set.kind.targets() {
                let message = format!(
                    "the target `{}` is a point in one of `{}` and `{}`, and a body with an orientation in the other",
                    key.1, known.1, set.name
                );
                return Err(Error::calibration(message, "give the two different names"));
            }
        }
    }
    Ok(())
}

/// What is wrong with a set, and what to do.
fn wrong(set: &MeasurementSet, row: Option<usize>, found: &str, help: &str) -> Error {
    let row = row.map_or_else(String::new, |row| format!(", row {row}"));
    Error::calibration(format!("`{}`{row}: {found}", set.name), help)
}

fn check(arms: &[Arm], set: &mut MeasurementSet, notes: &mut Vec<String>) -> Result<(), Error> {
    if set.tools.len() != set.kind.tools() {
        let found = format!(
            "found {} tools; a {} is measured with {}",
            set.tools.len(),
            set.kind.name(),
            set.kind.tools()
        );
        return Err(wrong(set, None, &found, "give the set as many tools"));
    }
    let rows = set.len();
    for k in 0..set.tools.len() {
        let tool = &set.tools[k];
        let Some(arm) = arms.get(tool.robot) else {
            let found = format!("is of robot number {}, of {}", tool.robot, arms.len());
            let help = "robots are numbered from 0, in the order of the calibration";
            return Err(wrong(set, None, &found, help));
        };
        if tool.q.len() != rows {
            let found = format!(
                "found {} postures of the second tool for {rows} of the first",
                tool.q.len()
            );
            return Err(wrong(set, None, &found, "give one of each a measurement"));
        }
        let robot = &arm.robot;
        let (joints, columns) = (robot.joints().len(), robot.columns().len());
        for (row, q) in tool.q.iter().enumerate() {
            let complete = robot.complete(&vec![0.0; robot.given()]).len();
            if q.len() != joints + columns && q.len() != complete {
                let further = match columns {
                    0 => String::new(),
                    n => format!(" and {n} further columns"),
                };
                let found = format!(
                    "found {} joint values for the {joints} joints{further} of {}",
                    q.len(),
                    arm.title()
                );
                return Err(wrong(set, Some(row), &found, "give one number for each"));
            }
            if let Some(joint) = q.iter().position(|q| !q.is_finite()) {
                let readings = robot.joints().iter().map(|joint| &joint.name);
                let names = readings.chain(robot.columns().iter().map(|column| &column.name));
                let name = names.map(String::as_str).nth(joint).unwrap_or("derived");
                let found = format!("the value of joint `{name}` is {}", q[joint]);
                return Err(wrong(
                    set,
                    Some(row),
                    &found,
                    "correct it, or leave the row out",
                ));
            }
        }
        let complete = |q: &Vec<f64>| robot.complete(q).into_owned();
        let completed: Vec<Vec<f64>> = tool.q.iter().map(complete).collect();
        set.readings.tools[k].q = completed;
    }
    let counts = [
        (
            "rows of what was read",
            count(set.values.width(), set.values.as_slice(), rows),
        ),
        ("group labels", set.groups.of_row.len()),
        (
            "standard deviations",
            count(set.sigma.width(), set.sigma.as_slice(), rows),
        ),
    ];
    for (what, found) in counts {
        if found != rows {
            let found = format!("found {found} {what} for {rows} postures");
            return Err(wrong(set, None, &found, "give one of each a measurement"));
        }
    }
    let widths = [
        (
            "numbers in a row",
            set.values.width(),
            set.kind.columns().len(),
        ),
        (
            "standard deviations in a row",
            set.sigma.width(),
            set.kind.measurands().len(),
        ),
    ];
    for (what, found, expected) in widths {
        if found != expected {
            let found = format!("found {found} {what}; a {} has {expected}", set.kind.name());
            return Err(wrong(set, None, &found, "give what the kind reads"));
        }
    }
    if let Some(row) = set
        .groups
        .of_row
        .iter()
        .position(|g| *g >= set.groups.len())
    {
        let found = format!(
            "is of group number {}, of {}",
            set.groups.of_row[row],
            set.groups.len()
        );
        return Err(wrong(set, Some(row), &found, "name every group"));
    }
    check_numbers(set, notes)
}

/// Rows of numbers; rows of no numbers are as many as there have to be.
fn count(width: usize, numbers: &[f64], rows: usize) -> usize {
    numbers.len().checked_div(width).unwrap_or(rows)
}

fn check_numbers(set: &mut MeasurementSet, notes: &mut Vec<String>) -> Result<(), Error> {
    let mut changed = 0;
    for row in 0..set.len() {
        let read = set.values.row(row);
        if let Some(k) = read.iter().position(|x| !x.is_finite()) {
            let found = format!("`{}` is {}", set.kind.columns()[k].name, read[k]);
            return Err(wrong(
                set,
                Some(row),
                &found,
                "correct it, or leave the row out",
            ));
        }
        let sigma = set.sigma.row(row);
        if let Some(sigma) = sigma.iter().find(|sigma| !ordinary(**sigma)) {
            let found =
                format!("a standard deviation of {sigma:e}; expected one of ordinary size above 0");
            return Err(wrong(
                set,
                Some(row),
                &found,
                "write the standard deviation of one measurement",
            ));
        }
        let kind = set.kind.clone();
        match kind.check_row(set.readings.values.row_mut(row)) {
            Ok(true) => changed += 1,
            Ok(false) => {}
            Err((found, help)) => return Err(wrong(set, Some(row), &found, &help)),
        }
    }
    if changed > 0 {
        notes.push(format!("`{}`: {changed} {}", set.name, set.kind.changed()));
    }
    Ok(())
}

/// Whether a standard deviation can weigh a measurement: not zero, nor so small or large that weights overflow.
pub fn ordinary(sigma: f64) -> bool {
    (1e-12..=1e12).contains(&sigma)
}
