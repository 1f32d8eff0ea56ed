//! The values of the keys of a `[[constraint]]` table, each with its own rules.

use super::constraint_spec::{DistanceSpec, Holdout, Kind, PlaneSpec, SigmaSpec};
use super::error::{InputError, short, suggest};
use super::item::Item;
use super::quantity::{Dimension, Quantity, Units};
use super::section::{Section, Spanned};
use super::selection::Selection;

/// A quantity of this dimension, in m, rad or 1, that is more than zero.
pub(super) fn positive(
    item: &Item<'_>,
    dimension: Dimension,
    units: &Units,
) -> Result<f64, InputError> {
    let value = item.in_units(dimension, units)?;
    if value > 0.0 {
        return Ok(value);
    }
    Err(not_positive(item, value))
}

/// A quantity of any dimension that is more than zero.
pub(super) fn positive_quantity(item: &Item<'_>) -> Result<Quantity, InputError> {
    let quantity = item.quantity()?.value;
    if quantity.value > 0.0 {
        return Ok(quantity);
    }
    Err(not_positive(item, quantity.value))
}

fn not_positive(item: &Item<'_>, value: f64) -> InputError {
    item.error(format!("found {value}; expected more than 0"))
        .with_help("write a positive number, or leave the key out")
}

/// `"0.1 mm"`, `1e-4`, or `{ position = "0.1 mm", rotation = "0.2 mrad" }`.
pub(super) fn sigma(item: &Item<'_>, kind: Kind, units: &Units) -> Result<SigmaSpec, InputError> {
    if !item.is_table() {
        let quantity = positive_quantity(item)?;
        quantity
            .expect(Dimension::Length)
            .map_err(|error| item.refuse(error))?;
        if quantity.dimension.is_none() && units.length != Units::SI.length {
            let value = item.in_units(Dimension::Length, units)?;
            let dimension = Some(Dimension::Length);
            return Ok(SigmaSpec::Single(Quantity { value, dimension }));
        }
        return Ok(SigmaSpec::Single(quantity));
    }
    if !kind.has_rotation() {
        let message = format!(
            "found a table; expected a length: measurements of kind {} have no rotation",
            kind.name()
        );
        return Err(item
            .error(message)
            .with_help("write one length, like sigma = \"0.1 mm\""));
    }
    let mut table = item.table()?;
    let position = table.require("position", "expected a length")?;
    let rotation = table.require("rotation", "expected an angle")?;
    let sigma = SigmaSpec::Pose {
        position: positive(&position, Dimension::Length, units)?,
        rotation: positive(&rotation, Dimension::Angle, units)?,
    };
    table.finish()?;
    Ok(sigma)
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

/// `target_guess = [x, y, z]`.
pub(super) fn target_guess(
    table: &mut Section<'_>,
    units: &Units,
) -> Result<Option<[Quantity; 3]>, InputError> {
    guess(table, "target_guess", "target")?
        .map(|item| point(&item, units))
        .transpose()
}

/// `[x, y, z]`, lengths.
pub(super) fn point(item: &Item<'_>, units: &Units) -> Result<[Quantity; 3], InputError> {
    let mut point = [Quantity::bare(0.0); 3];
    let items: [Item<'_>; 3] = item.list_of("[x, y, z]")?;
    for (coordinate, item) in point.iter_mut().zip(&items) {
        *coordinate = Quantity::bare(item.in_units(Dimension::Length, units)?);
    }
    Ok(point)
}

/// `frame_guess = [x, y, z, qw, qx, qy, qz]`, the quaternion brought to length one.
pub(super) fn frame_guess(
    table: &mut Section<'_>,
    units: &Units,
) -> Result<Option<[f64; 7]>, InputError> {
    guess(table, "frame_guess", "frame")?
        .map(|item| pose(&item, units))
        .transpose()
}

/// `[x, y, z, qw, qx, qy, qz]`, the quaternion brought to length one.
pub(super) fn pose(item: &Item<'_>, units: &Units) -> Result<[f64; 7], InputError> {
    let items: [Item<'_>; 7] = item.list_of("[x, y, z, qw, qx, qy, qz]")?;
    let mut pose = [0.0; 7];
    for (i, (number, item)) in pose.iter_mut().zip(&items).enumerate() {
        let dimension = if i < 3 {
            Dimension::Length
        } else {
            Dimension::None
        };
        *number = item.in_units(dimension, units)?;
    }
    let quaternion = &mut pose[3..];
    let norm = quaternion.iter().fold(0.0f64, |norm, q| norm.hypot(*q));
    if !(0.9..1.1).contains(&norm) {
        return Err(item
            .error(format!("the quaternion has length {norm}; expected 1"))
            .with_help("the order is x, y, z, qw, qx, qy, qz"));
    }
    for number in quaternion {
        *number /= norm;
    }
    Ok(pose)
}

/// `{ normal = [0, 0, 1], distance = 0.4 }` or `{ a = 0.3, b = -0.5, c = -1.1 }`.
pub(super) fn plane(
    table: &mut Section<'_>,
    kind: Kind,
    units: &Units,
) -> Result<Option<PlaneSpec>, InputError> {
    if kind != Kind::KnownPlane {
        return Ok(None);
    }
    // A method may have a plane of its own.
    if table.peek("method").is_some() && table.peek("plane").is_none() {
        return Ok(None);
    }
    let item = table.require("plane", &format!("expected {PLANE_FORMS}"))?;
    plane_of(&item, units).map(Some)
}

/// The two forms of a plane.
pub(super) const PLANE_FORMS: &str = "{ normal = [0, 0, 1], distance = 0.4 } or { a, b, c }";

/// A plane in one of its two forms.
pub(super) fn plane_of(item: &Item<'_>, units: &Units) -> Result<PlaneSpec, InputError> {
    if !item.is_table() {
        return Err(item
            .wrong_type(PLANE_FORMS)
            .with_help("write the plane as a table, in one of the two forms"));
    }
    let mut table = item.table()?;
    let paper = ["a", "b", "c"];
    let by_paper = paper.iter().any(|key| table.peek(key).is_some());
    let by_normal = ["normal", "distance"]
        .iter()
        .any(|key| table.peek(key).is_some());
    if by_paper && by_normal {
        return Err(item
            .error(format!(
                "found both forms of a plane; expected {PLANE_FORMS}"
            ))
            .with_help("keep either `normal` and `distance`, or `a`, `b` and `c`"));
    }
    let (plane, normal) = if by_paper {
        let mut normal = [0.0; 3];
        for (number, key) in normal.iter_mut().zip(paper) {
            // One over a length.
            *number = table.require(key, "expected a number")?.number()?.value / units.length;
        }
        let [a, b, c] = normal;
        (PlaneSpec::Paper { a, b, c }, normal)
    } else {
        let items: [Item<'_>; 3] = table
            .require("normal", "expected [x, y, z]")?
            .list_of("[x, y, z]")?;
        let mut normal = [0.0; 3];
        for (number, item) in normal.iter_mut().zip(&items) {
            *number = item.number()?.value;
        }
        let distance = table.require("distance", "expected a length")?;
        let distance = distance.in_units(Dimension::Length, units)?;
        (PlaneSpec::NormalDistance { normal, distance }, normal)
    };
    table.finish()?;
    // What is not zero must also have a length that is neither zero nor infinite.
    let norm = normal.iter().fold(0.0f64, |norm, n| norm.hypot(*n));
    if norm.is_normal() {
        return Ok(plane);
    }
    Err(item
        .error("the plane has no direction; expected a normal that is not zero")
        .with_help("write the normal of the plane, like [0, 0, 1]"))
}

/// `0.116`, `"116 mm"` or `"estimate"`.
pub(super) fn distance(
    table: &mut Section<'_>,
    kind: Kind,
    units: &Units,
) -> Result<Option<DistanceSpec>, InputError> {
    if kind != Kind::Distance {
        return Ok(None);
    }
    let item = table.require("distance", "expected a length or \"estimate\"")?;
    if let Some(word) = item.as_str().map(str::trim)
        && word.starts_with(|c: char| c.is_alphabetic())
    {
        return match word {
            "estimate" => Ok(Some(DistanceSpec::Estimate)),
            _ => Err(item
                .wrong_type("a length or \"estimate\"")
                .with_help(suggest(word, &["estimate"]))),
        };
    }
    let value = item.in_units(Dimension::Length, units)?;
    if value > 0.0 {
        return Ok(Some(DistanceSpec::Value(value)));
    }
    Err(item
        .error(format!("found {value}; expected more than 0"))
        .with_help("two points that meet are a `same-point`; balls that touch are the sum of their radii apart"))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holdout_counts_modulo() {
        let holdout = Holdout {
            every: 10,
            rows: vec![0, 3, 7],
        };
        let held: Vec<usize> = (0..20).filter(|&row| holdout.holds_out(row)).collect();
        assert_eq!(held, [0, 3, 7, 10, 13, 17]);
        let odd = Holdout {
            every: 0,
            rows: vec![0],
        };
        assert!(!odd.holds_out(3));
    }
}
