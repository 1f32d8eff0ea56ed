//! The tables `[[constraint]]` and `[[validate]]` of a calibration file.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::constraint_values::{
    columns, frame_guess, holdout, keys, refuse_other_keys, rows, sigma, target_guess, two_robots,
    two_targets,
};
use super::holdout::Holdout;
use crate::measurement::{Kind, Method};
use crate::plugin::Registry;
use crate::text::error::{one_of, suggest};
use crate::text::loss::loss;
use crate::text::{InputError, Item, Section, Selection, Spanned, Spans, Units, nearest};
use truing::Loss;
use truing::manifold::Pose;

/// The kind that a table names.
pub(crate) fn kind_of(item: &Item<'_>, registry: &Registry) -> Result<Arc<dyn Kind>, InputError> {
    let name = item.string()?.value;
    registry.kind(&name).cloned().ok_or_else(|| {
        let names = kind_names(registry);
        item.wrong_type(&one_of(&names))
            .with_help(suggest(&name, &names))
    })
}

/// The names of all kinds.
pub(crate) fn kind_names(registry: &Registry) -> Vec<&'static str> {
    registry.kinds().iter().map(|kind| kind.name()).collect()
}

/// A set of measurements of one kind, with its data file.
#[derive(Debug, Clone)]
pub struct ConstraintSpec {
    /// The name, different from those of the others; by default the name of the data file.
    pub name: String,
    /// What was measured, with the constants that its keys give.
    pub kind: Arc<dyn Kind>,
    /// The data file; whether it exists is not checked here.
    pub data: PathBuf,
    /// One standard deviation a measurand of the kind, where they are given.
    pub sigma: Vec<Option<f64>>,
    /// How residuals count.
    pub loss: Loss,
    /// Other equations for the same measurements.
    pub method: Option<Spanned<Arc<dyn Method>>>,
    /// The robot that measured, where there are several.
    pub robot: Option<Spanned<String>>,
    /// The two robots of a kind between two tools.
    pub robots: Option<[Spanned<String>; 2]>,
    /// The point or body on the tool that was measured, estimated; the tool itself by default.
    pub target: Option<Spanned<String>>,
    /// The points on the tools of two robots, estimated.
    pub targets: Option<[Spanned<String>; 2]>,
    /// Where to start the estimate of the target, in the tool frame.
    pub target_guess: Option<Pose<f64>>,
    /// The sensor frame the measurements are in, estimated; the world by default.
    pub frame: Option<Spanned<String>>,
    /// Where to start the estimate of the frame.
    pub frame_guess: Option<Pose<f64>>,
    /// The columns that group the rows; empty for the default of the kind.
    pub group: Vec<String>,
    /// The columns of the data, by what they are read as.
    pub columns: Vec<(String, Spanned<String>)>,
    /// The units of bare numbers, in this table and in columns whose header has none.
    pub units: Units,
    /// The rows to use; all by default.
    pub rows: Option<Spanned<Selection>>,
    /// The rows to keep out of the estimate.
    pub holdout: Option<Holdout>,
    /// Where the table and the values of its keys are in the file.
    pub spans: Spans,
}

impl ConstraintSpec {
    /// The place of the value of `key`, in bytes; that of the table if the key was left out.
    #[must_use]
    pub fn span_of(&self, key: &str) -> Range<usize> {
        self.spans.of(key)
    }

    /// Reads a table; `folder` is where the path of the data starts. The name may stay empty.
    pub(super) fn read(
        mut table: Section<'_>,
        folder: &Path,
        registry: &Registry,
    ) -> Result<Self, InputError> {
        let kinds = one_of(&kind_names(registry));
        let item = table.require("kind", &format!("expected {kinds}"))?;
        let kind = kind_of(&item, registry)?;
        refuse_other_keys(&table, &*kind, registry, keys)?;
        let data = table.require("data", "expected the name of a CSV file")?;
        let units = table.units()?;
        let method = method(&mut table, &*kind, registry)?;
        let kind = with_constants(&mut table, kind, method.as_ref(), &units)?;
        let spec = Self {
            name: table
                .get("name")
                .map(|item| item.name_text())
                .transpose()?
                .map_or_else(String::new, |name| name.value),
            data: folder.join(data.name_text()?.value),
            sigma: match table.get("sigma") {
                Some(item) => sigma(&item, &*kind, &units)?,
                None => vec![None; kind.measurands().len()],
            },
            loss: match table.get("loss") {
                Some(item) => loss(&item, registry.losses())?,
                None => Loss::Trivial,
            },
            method,
            robot: name(&mut table, "robot")?,
            robots: two_robots(&mut table)?,
            target: name(&mut table, "target")?,
            targets: two_targets(&mut table)?,
            target_guess: target_guess(&mut table, &units, kind.targets())?,
            frame: name(&mut table, "frame")?,
            frame_guess: frame_guess(&mut table, &units)?,
            group: group(&mut table)?,
            columns: columns(&mut table)?,
            units,
            rows: rows(&mut table)?,
            holdout: holdout(&mut table)?,
            spans: table.spans(),
            kind,
        };
        table.finish()?;
        Ok(spec)
    }
}

/// The kind with the constants of its keys, or with those that its method always has.
fn with_constants(
    table: &mut Section<'_>,
    kind: Arc<dyn Kind>,
    method: Option<&Spanned<Arc<dyn Method>>>,
    units: &Units,
) -> Result<Arc<dyn Kind>, InputError> {
    let Some(constants) = method.and_then(|method| method.value.constants()) else {
        return Ok(kind.read(table, units)?.unwrap_or(kind));
    };
    for key in kind.keys() {
        if let Some(item) = table.peek(key) {
            return Err(item
                .error(format!("this method has a {key} of its own"))
                .with_help("remove the key, or the `method`"));
        }
    }
    Ok(constants)
}

/// The method of a table for its kind.
fn method(
    table: &mut Section<'_>,
    kind: &dyn Kind,
    registry: &Registry,
) -> Result<Option<Spanned<Arc<dyn Method>>>, InputError> {
    let Some(item) = table.get("method") else {
        return Ok(None);
    };
    let text = item.name_text()?;
    if let Some(method) = registry.method(&text.value, kind.name()) {
        return Ok(Some(Spanned::new(method.clone(), text.span)));
    }
    let same = |method: &&Arc<dyn Method>| method.name() == text.value;
    let kinds: Vec<String> = (registry.methods().iter().filter(same))
        .flat_map(|method| method.kinds())
        .map(|kind| (*kind).to_owned())
        .collect();
    let message = if kinds.is_empty() {
        format!("there is no method `{}`", text.value)
    } else {
        format!(
            "the method `{}` is for {}, not for {}",
            text.value,
            crate::robot::names::listed(&kinds),
            kind.name()
        )
    };
    let names: Vec<&str> = (registry.methods().iter())
        .filter(|method| method.kinds().contains(&kind.name()))
        .map(|method| method.name())
        .collect();
    let help = match (nearest(&text.value, names.iter().copied()), &names[..]) {
        (Some(near), _) => format!("did you mean `{near}`?"),
        (None, []) => format!("leave `method` out: {} has none", kind.name()),
        (None, names) => format!("the methods for {} are {}", kind.name(), names.join(", ")),
    };
    Err(item.error(message).with_help(help))
}

fn name(table: &mut Section<'_>, key: &str) -> Result<Option<Spanned<String>>, InputError> {
    table.get(key).map(|item| item.name_text()).transpose()
}

fn group(table: &mut Section<'_>) -> Result<Vec<String>, InputError> {
    let Some(item) = table.get("group") else {
        return Ok(Vec::new());
    };
    let names = item.string_or_list()?;
    if names.is_empty() {
        return Err(item
            .error("found an empty list; expected the names of columns")
            .with_help("leave `group` out for the default column"));
    }
    Ok(names.into_iter().map(|name| name.value).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::calibration::CalibrationFile;
    use crate::measurement::kinds::{Distances, KnownPlaneTouches};
    use truing::nalgebra::Vector3;

    fn read(lines: &str) -> Result<ConstraintSpec, InputError> {
        let text = format!("[robot]\nfile = 'r'\n[[constraint]]\ndata = 'd.csv'\n{lines}\n");
        let mut file = CalibrationFile::parse(&text, "c.toml")?;
        Ok(file.constraints.remove(0))
    }

    #[test]
    fn every_key_is_read() {
        let spec = read(
            "kind = 'pose'\nname = 'a'\nsigma = { position = '0.1 mm', rotation = '0.2 mrad' }\n\
             target = 's1'\ntarget_guess = [0, '10 mm', 1000]\nframe = 'tracker'\n\
             frame_guess = [1000, 2e3, '3 m', 0.0, 1.01, 0, 0]\ncolumns = { x = 's1x', q1 = 'q_S' }\n\
             units = { length = 'mm' }\nrows = '0:400'\nholdout = { every = 10, rows = [7, 0, 7] }",
        )
        .unwrap();
        assert_eq!(spec.name, "a");
        assert_eq!(spec.sigma, [Some(1e-4), Some(2e-4)]);
        let guess = spec.target_guess.unwrap();
        assert_eq!(guess.translation, Vector3::new(0.0, 0.01, 1.0));
        let frame = spec.frame_guess.unwrap();
        assert_eq!(frame.translation, Vector3::new(1.0, 2.0, 3.0));
        assert_eq!(frame.quaternion(), [0.0, 1.0, 0.0, 0.0]);
        assert_eq!(spec.columns[0].0, "x");
        assert_eq!(spec.columns[1].1.value, "q_S");
        assert_eq!(spec.units.length, 1e-3);
        assert_eq!(spec.rows.unwrap().value.as_str(), "0:400");
        assert_eq!(spec.holdout.unwrap().rows, [0, 7]);
        assert_eq!(spec.loss, Loss::Trivial);
        let body = "kind = 'pose'\ntarget = 'b'\ntarget_guess = [0, 0, 1, 0, 0, 1, 0]";
        let body = read(body).unwrap().target_guess.unwrap();
        assert_eq!(body.quaternion(), [0.0, 0.0, 1.0, 0.0]);

        let plane = |text: &str| {
            let spec = read(&format!("kind = 'known-plane'\nplane = {text}")).unwrap();
            spec.kind.downcast::<KnownPlaneTouches>().unwrap().plane
        };
        let given = plane("{ normal = [0, 0, 2], distance = '4 mm' }");
        assert_eq!((given.normal, given.distance), (Vector3::z(), 2e-3));
        // a·x + b·y + c·z + 1 = 0.
        let given = plane("{ a = 0, b = -2, c = 0 }");
        assert_eq!((given.normal, given.distance), (-Vector3::y(), -0.5));
        let spec = read("kind = 'same-point'\ngroup = 'point'\nsigma = 1e-4").unwrap();
        assert_eq!(spec.group, ["point"]);
        assert_eq!(spec.sigma, [Some(1e-4)]);
        let distance = |text: &str| {
            let spec = read(&format!("kind = 'distance'\ndistance = {text}")).unwrap();
            spec.kind.downcast::<Distances>().unwrap().distance
        };
        assert_eq!(distance("'estimate'"), None);
        assert_eq!(distance("'1 mm'"), Some(1e-3));
    }

    /// A single quantity is that of the first measurand, a bare number that of all.
    #[test]
    fn one_sigma_may_stand_for_several() {
        let sigma = |text: &str| {
            read(&format!("kind = 'pose'\nsigma = {text}"))
                .unwrap()
                .sigma
        };
        assert_eq!(sigma("'0.1 mm'"), [Some(1e-4), None]);
        assert_eq!(sigma("1e-4"), [Some(1e-4), Some(1e-4)]);
        assert_eq!(read("kind = 'pose'").unwrap().sigma, [None, None]);
    }

    #[test]
    fn mistakes_are_located_and_explained() {
        for (kind, text, words) in [
            ("pose", "plane = {}", "only `known-plane` takes this key"),
            (
                "position",
                "group = 'a'",
                "only `unknown-plane`, `same-point`, `same-location` or `ball-bar`",
            ),
            ("unknown-plane", "frame = 's'", "only `pose` or `position`"),
            ("pose", "targets = ['a', 'b']", "only `distance`"),
            (
                "distance",
                "targets = ['a', 'b']\ntarget = 's'\ndistance = 1",
                "also `target`",
            ),
            ("pose", "robots = ['a', 'b']", "only `distance`"),
            ("pose", "sgima = 1", "unknown key `sgima` in [[constraint]]"),
            ("pose", "data2 = 'x'", "unknown key"),
            ("pose", "name = ' '", "empty text"),
            ("pose", "sigma = 0", "more than 0"),
            ("pose", "sigma = -1e-3", "more than 0"),
            ("pose", "sigma = inf", "finite"),
            (
                "pose",
                "sigma = '1 deg'",
                "found an angle; expected a length",
            ),
            ("pose", "sigma = { position = 1 }", "has no `rotation`"),
            (
                "pose",
                "sigma = { position = 1, rotation = '1 mm' }",
                "expected an angle",
            ),
            (
                "pose",
                "sigma = { position = 1, rotation = 1, x = 1 }",
                "unknown key `x`",
            ),
            (
                "position",
                "sigma = { position = 1, rotation = 1 }",
                "no rotation",
            ),
            ("pose", "sigma = [1, 2]", "expected a number"),
            ("pose", "loss = 'cauchi(1)'", "`geman-mcclure` or `barron`"),
            ("pose", "loss = 1", "expected a text"),
            ("pose", "target_guess = [0, 0, 0]", "there is no `target`"),
            ("pose", "target_guess = [0, 0]\ntarget = 's'", "list of 2"),
            (
                "pose",
                "target_guess = [0, 0, '1 deg']\ntarget = 's'",
                "an angle",
            ),
            (
                "pose",
                "frame_guess = [0, 0, 0, 0, 0, 0, 0]\nframe = 'f'",
                "length 0",
            ),
            ("pose", "frame_guess = [0, 0, 0]\nframe = 'f'", "list of 3"),
            (
                "pose",
                "frame_guess = [0, 0, 0, '1 m', 0, 0, 0]\nframe = 'f'",
                "a length",
            ),
            ("same-point", "group = []", "empty list"),
            ("known-plane", "plane = 1", "expected { normal"),
            ("known-plane", "plane = {}", "has no `normal`"),
            ("known-plane", "plane = { a = 1, b = 1 }", "has no `c`"),
            (
                "known-plane",
                "plane = { a = 0, b = 0, c = 0 }",
                "no direction",
            ),
            (
                "known-plane",
                "plane = { normal = [0, 0, 0], distance = 1 }",
                "no direction",
            ),
            (
                "known-plane",
                "plane = { normal = [0, 0, 1], a = 1 }",
                "both forms",
            ),
            (
                "known-plane",
                "plane = { normal = [0, 0, 1], distance = '1 deg' }",
                "an angle",
            ),
            (
                "known-plane",
                "plane = { normal = [0, 0, nan], distance = 1 }",
                "finite",
            ),
            ("distance", "distance = -1", "more than 0"),
            ("distance", "distance = 0", "more than 0"),
            ("distance", "distance = 'estimated'", "\"estimate\""),
            ("distance", "distance = '1 deg'", "an angle"),
            ("pose", "columns = { x = 1 }", "expected a text"),
            ("pose", "rows = '0:4:2'", "one colon"),
            ("pose", "rows = 'a = 1'", "no meaning"),
            ("pose", "rows = 5", "expected a text"),
            ("pose", "holdout = { every = 0, rows = [0] }", "1 or more"),
            (
                "pose",
                "holdout = { every = 2, rows = [2] }",
                "less than `every`",
            ),
            (
                "pose",
                "holdout = { every = 2, rows = [0, 1] }",
                "every row",
            ),
            ("pose", "holdout = { every = 2, rows = [] }", "no row"),
            ("pose", "holdout = { every = 2 }", "has no `rows`"),
            ("pose", "holdout = { every = 2, rows = [-1] }", "an integer"),
        ] {
            let error = read(&format!("{text}\nkind = '{kind}'")).unwrap_err();
            assert_eq!(error.line, Some(5), "{text}: {error}");
            assert!(error.message.contains(words), "{text}: {error}");
        }
        let error = read("kind = 'known_plane'").unwrap_err();
        assert_eq!(error.help.as_deref(), Some("did you mean `known-plane`?"));
        assert!(
            read("kind = 'known-plane'")
                .unwrap_err()
                .message
                .contains("no `plane`")
        );
        assert!(
            read("kind = 'distance'")
                .unwrap_err()
                .message
                .contains("no `distance`")
        );
        assert!(read("").unwrap_err().message.contains("no `kind`"));
    }
}
