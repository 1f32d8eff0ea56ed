//! The values of the keys of a `[[constraint]]` table, each with its own rules.

use super::holdout::Holdout;
use crate::measurement::{Kind, Measurand, TargetKind};
use crate::plugin::Registry;
use crate::robot::Unit;
use crate::text::error::{one_of, short};
use crate::text::{Dimension, InputError, Item, Section, Selection, Spanned, Units};
use truing::manifold::Pose;

/// What may be written for the dimension of a measurand.
fn dimension(measurand: &Measurand) -> Dimension {
    match measurand.unit {
        Unit::Meter => Dimension::Length,
        Unit::Radian => Dimension::Angle,
        _ => Dimension::None,
    }
}

/// `"0.1 mm"`, `1e-4`, or `{ position = "0.1 mm", rotation = "0.2 mrad" }`: one standard deviation a
/// measurand. A single quantity is that of the first; a bare number in m is that of all, each in its own
/// unit.
pub(super) fn sigma(
    item: &Item<'_>,
    kind: &dyn Kind,
    units: &Units,
) -> Result<Vec<Option<f64>>, InputError> {
    let measurands = kind.measurands();
    let first = dimension(&measurands[0]);
    if !item.is_table() {
        let quantity = item.positive_quantity()?;
        quantity.expect(first).map_err(|error| item.refuse(error))?;
        let bare = quantity.dimension.is_none() && units.factor(first) == Units::SI.factor(first);
        let value = item.in_units(first, units)?;
        let others = bare.then_some(value);
        let rest = measurands[1..].iter().map(|_| others);
        return Ok(std::iter::once(Some(value)).chain(rest).collect());
    }
    if measurands.len() == 1 {
        let message = format!(
            "found a table; expected {first}: measurements of kind {} have no rotation",
            kind.name()
        );
        return Err(item.error(message).with_help(match first {
            Dimension::Length => "write one length, like sigma = \"0.1 mm\"",
            Dimension::Angle => "write one angle, like sigma = \"0.1 mrad\"",
            Dimension::None => "write one number, like sigma = 0.5",
        }));
    }
    let mut table = item.table()?;
    let mut sigma = Vec::new();
    for measurand in measurands {
        let dimension = dimension(measurand);
        let expected = format!("expected {dimension}");
        let item = table.require(measurand.name, &expected)?;
        sigma.push(Some(item.positive(dimension, units)?));
    }
    table.finish()?;
    Ok(sigma)
}

/// The keys of a kind in calibration files that not all kinds have.
pub(super) fn keys(kind: &dyn Kind) -> Vec<&'static str> {
    let mut keys = kind.keys().to_vec();
    if kind.has_frame() {
        keys.extend(["frame", "frame_guess"]);
    }
    if kind.grouping().is_some() {
        keys.push("group");
    }
    if kind.tools() > 1 {
        keys.extend(["robots", "targets"]);
    }
    keys
}

/// The keys of a kind in simulation files that not all kinds have.
pub(super) fn scene_keys(kind: &dyn Kind) -> Vec<&'static str> {
    let mut keys = kind.scene_keys().to_vec();
    if kind.has_frame() {
        keys.extend(["frame", "frame_pose"]);
    }
    keys.push(if kind.tools() > 1 {
        "robots"
    } else {
        "target_position"
    });
    keys
}

/// A key that exists, but not for this kind, is not "unknown": the error says whose it is.
pub(super) fn refuse_other_keys(
    table: &Section<'_>,
    kind: &dyn Kind,
    registry: &Registry,
    keys: fn(&dyn Kind) -> Vec<&'static str>,
) -> Result<(), InputError> {
    let own = keys(kind);
    let kinds = || registry.kinds().iter();
    for key in kinds().flat_map(|kind| keys(&**kind)) {
        let Some(item) = table.peek(key).filter(|_| !own.contains(&key)) else {
            continue;
        };
        let names: Vec<&str> = kinds()
            .filter(|kind| keys(&***kind).contains(&key))
            .map(|kind| kind.name())
            .collect();
        let message = format!(
            "this is a {} constraint; only {} takes this key",
            kind.name(),
            one_of(&names)
        );
        return Err(item
            .error(message)
            .with_help("remove the key, or change the `kind`"));
    }
    Ok(())
}

/// `robots = ["left", "right"]`.
pub(super) fn two_robots(
    table: &mut Section<'_>,
) -> Result<Option<[Spanned<String>; 2]>, InputError> {
    let Some(item) = table.get("robots") else {
        return Ok(None);
    };
    if table.peek("robot").is_some() {
        return Err(item
            .error("there is also `robot`; expected one of the two keys")
            .with_help("use `robots` for two robots, `robot` for one in two postures"));
    }
    let [first, second] = item.list_of("the names of two robots")?;
    let (first, second) = (first.name_text()?, second.name_text()?);
    if first.value == second.value {
        let message = format!("found `{}` twice; expected two robots", short(&first.value));
        let help = "use `robot` for one robot in two postures";
        return Err(item.error(message).with_help(help));
    }
    Ok(Some([first, second]))
}

/// `targets = ["ball_left", "ball_right"]`.
pub(super) fn two_targets(
    table: &mut Section<'_>,
) -> Result<Option<[Spanned<String>; 2]>, InputError> {
    let Some(item) = table.get("targets") else {
        return Ok(None);
    };
    if table.peek("target").is_some() {
        return Err(item
            .error("there is also `target`; expected one of the two keys")
            .with_help("use `targets` for two robots, `target` for one in two postures"));
    }
    let [first, second] = item.list_of("the names of two tool points")?;
    Ok(Some([first.name_text()?, second.name_text()?]))
}

/// Finds the value of a guess, which makes sense only with the key it is a guess of.
fn guess<'a>(table: &mut Section<'a>, key: &str, of: &str) -> Result<Option<Item<'a>>, InputError> {
    let Some(item) = table.get(key) else {
        return Ok(None);
    };
    if table.peek(of).is_none() {
        return Err(item
            .error(format!("there is no `{of}` for this guess"))
            .with_help(format!("name what is estimated: {of} = \"a\"")));
    }
    Ok(Some(item))
}

/// `target_guess = [x, y, z]`; that of a body may have an orientation, `[x, y, z, qw, qx, qy, qz]`.
pub(super) fn target_guess(
    table: &mut Section<'_>,
    units: &Units,
    targets: TargetKind,
) -> Result<Option<Pose<f64>>, InputError> {
    let Some(item) = guess(table, "target_guess", "target")? else {
        return Ok(None);
    };
    let seven = || item.list("[x, y, z]").is_ok_and(|items| items.len() == 7);
    if targets == TargetKind::Body && item.is_list() && seven() {
        return item.pose(units).map(Some);
    }
    Ok(Some(Pose {
        translation: item.point(units)?,
        ..Pose::identity()
    }))
}

/// `frame_guess = [x, y, z, qw, qx, qy, qz]`, the quaternion brought to length one.
pub(super) fn frame_guess(
    table: &mut Section<'_>,
    units: &Units,
) -> Result<Option<Pose<f64>>, InputError> {
    guess(table, "frame_guess", "frame")?
        .map(|item| item.pose(units))
        .transpose()
}

/// `columns = { x = "s1x" }`.
pub(super) fn columns(
    table: &mut Section<'_>,
) -> Result<Vec<(String, Spanned<String>)>, InputError> {
    let Some(mut table) = table.table("columns")? else {
        return Ok(Vec::new());
    };
    let entries = table.entries();
    let columns = entries.iter();
    columns
        .map(|item| Ok((item.name().to_owned(), item.name_text()?)))
        .collect()
}

/// `rows = "0:400"`.
pub(super) fn rows(table: &mut Section<'_>) -> Result<Option<Spanned<Selection>>, InputError> {
    let Some(item) = table.get("rows") else {
        return Ok(None);
    };
    let text = item.string()?;
    let selection = Selection::parse(&text.value).map_err(|error| item.refuse(error))?;
    Ok(Some(Spanned::new(selection, text.span)))
}

/// `{ every = 10, rows = [0, 3, 7] }`.
pub(super) fn holdout(table: &mut Section<'_>) -> Result<Option<Holdout>, InputError> {
    let Some(item) = table.get("holdout") else {
        return Ok(None);
    };
    let mut table = item.table()?;
    let every = table.require("every", "expected an integer")?;
    let length = every.integer()?.value;
    if length == 0 {
        return Err(every
            .error("found 0; expected 1 or more")
            .with_help("write how many rows the pattern has, like every = 10"));
    }
    let list = table.require("rows", "expected a list of row numbers")?;
    table.finish()?;
    let mut rows = Vec::new();
    for item in list.list("a list of row numbers, like [0, 3, 7]")? {
        let row = item.integer()?.value;
        if row >= length {
            let message = format!("found row {row}; expected less than `every`, {length}");
            let help = "rows are counted from 0 within the pattern";
            return Err(item.error(message).with_help(help));
        }
        rows.push(row);
    }
    rows.sort_unstable();
    rows.dedup();
    if rows.is_empty() || rows.len() == length {
        let found = if rows.is_empty() {
            "no row"
        } else {
            "every row"
        };
        return Err(list
            .error(format!("{found} is held out; expected some, and not all"))
            .with_help("hold out some rows, or leave `holdout` out"));
    }
    Ok(Some(Holdout {
        every: length,
        rows,
    }))
}
