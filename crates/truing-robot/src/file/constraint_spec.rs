//! The tables `[[constraint]]` and `[[validate]]` of a calibration file.

use std::ops::Range;
use std::path::{Path, PathBuf};

use super::constraint_values::{
    columns, distance, frame_guess, holdout, plane, rows, sigma, target_guess, two_robots,
    two_targets,
};
use super::error::{InputError, one_of, suggest};
use super::item::Item;
use super::loss::loss;
use super::quantity::{Quantity, Units};
use super::section::{Section, Spanned, Spans};
use super::selection::Selection;
use truing::Loss;

/// What was measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// The pose of a tool.
    Pose,
    /// The position of a point on a tool.
    Position,
    /// A touch on a plane that is known.
    KnownPlane,
    /// A touch on a plane that is estimated.
    UnknownPlane,
    /// Touches of one point that is estimated.
    SamePoint,
    /// Visits of one location (position and orientation) that is estimated.
    SameLocation,
    /// The distance between two tool points.
    Distance,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 7] = [
        Self::Pose,
        Self::Position,
        Self::KnownPlane,
        Self::UnknownPlane,
        Self::SamePoint,
        Self::SameLocation,
        Self::Distance,
    ];

    /// The name of the kind in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Pose => "pose",
            Self::Position => "position",
            Self::KnownPlane => "known-plane",
            Self::UnknownPlane => "unknown-plane",
            Self::SamePoint => "same-point",
            Self::SameLocation => "same-location",
            Self::Distance => "distance",
        }
    }

    /// The kind with this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// Whether its residual has rotations.
    #[must_use]
    pub fn has_rotation(self) -> bool {
        matches!(self, Self::Pose | Self::SameLocation)
    }

    pub(super) fn read(item: &Item<'_>) -> Result<Self, InputError> {
        let name = item.string()?.value;
        Self::from_name(&name).ok_or_else(|| {
            let names = Self::ALL.map(Self::name);
            item.wrong_type(&one_of(&names))
                .with_help(suggest(&name, &names))
        })
    }
}

/// The kinds that can name a tool point of one robot.
const TOUCHED: [Kind; 7] = [
    Kind::Pose,
    Kind::Position,
    Kind::KnownPlane,
    Kind::UnknownPlane,
    Kind::SamePoint,
    Kind::SameLocation,
    Kind::Distance,
];

/// The keys that only some kinds have.
const KEYS_OF_KINDS: [(&str, &[Kind]); 9] = [
    ("target", &TOUCHED),
    ("target_guess", &TOUCHED),
    ("frame", &[Kind::Pose, Kind::Position]),
    ("frame_guess", &[Kind::Pose, Kind::Position]),
    (
        "group",
        &[Kind::UnknownPlane, Kind::SamePoint, Kind::SameLocation],
    ),
    ("plane", &[Kind::KnownPlane]),
    ("distance", &[Kind::Distance]),
    ("robots", &[Kind::Distance]),
    ("targets", &[Kind::Distance]),
];

/// One standard deviation of a measurement, positive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SigmaSpec {
    /// One number for all rows: a length, or a bare number in m (and in rad for the rotation of a
    /// pose).
    Single(Quantity),
    /// The two parts of a pose.
    Pose {
        /// Of the position \[m\].
        position: f64,
        /// Of the rotation \[rad\].
        rotation: f64,
    },
}

/// A known plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PlaneSpec {
    /// normal · p = distance.
    NormalDistance {
        /// The normal, not zero and not necessarily of length one.
        normal: [f64; 3],
        /// The distance from the origin, in lengths of the normal \[m\].
        distance: f64,
    },
    /// The paper's form, not all zero \[1/m\].
    Paper {
        /// Coefficient of x.
        a: f64,
        /// Coefficient of y.
        b: f64,
        /// Coefficient of z.
        c: f64,
    },
}

impl PlaneSpec {
    /// Unit normal and distance along it \[m\].
    #[must_use]
    pub fn normalised(self) -> ([f64; 3], f64) {
        let (normal, distance) = match self {
            Self::NormalDistance { normal, distance } => (normal, distance),
            // a·x + b·y + c·z + 1 = 0.
            Self::Paper { a, b, c } => ([a, b, c], -1.0),
        };
        let length = normal.iter().fold(0.0f64, |norm, n| norm.hypot(*n));
        (normal.map(|n| n / length), distance / length)
    }
}

/// The distance of a `distance` constraint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DistanceSpec {
    /// It is known, more than zero \[m\].
    Value(f64),
    /// It is estimated.
    Estimate,
}

/// Rows kept out of the estimate: those whose number modulo `every` is one of `rows`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Holdout {
    /// The length of the pattern \[rows\].
    pub every: usize,
    /// The rows of the pattern held out, from 0, ascending; neither none nor all of them.
    pub rows: Vec<usize>,
}

impl Holdout {
    /// Whether the row with this number, counted from 0 after selection, is held out.
    #[must_use]
    pub fn holds_out(&self, row: usize) -> bool {
        row.checked_rem(self.every)
            .is_some_and(|rest| self.rows.binary_search(&rest).is_ok())
    }
}

/// A set of measurements of one kind, with its data file.
#[derive(Debug, Clone, PartialEq)]
pub struct ConstraintSpec {
    /// The name, different from those of the others; by default the name of the data file.
    pub name: String,
    /// What was measured.
    pub kind: Kind,
    /// The data file; whether it exists is not checked here.
    pub data: PathBuf,
    /// One standard deviation of the measurements.
    pub sigma: Option<SigmaSpec>,
    /// How residuals count.
    pub loss: Loss,
    /// Other equations for the same measurements, by the name that a plugin gives them.
    pub method: Option<Spanned<String>>,
    /// The robot that measured, where there are several.
    pub robot: Option<Spanned<String>>,
    /// The two robots of a `distance` between robots.
    pub robots: Option<[Spanned<String>; 2]>,
    /// The point on the tool that was measured, estimated; the tool origin by default.
    pub target: Option<Spanned<String>>,
    /// The points on the tools of the two robots of a `distance`, estimated.
    pub targets: Option<[Spanned<String>; 2]>,
    /// Where to start the estimate of the point, in the tool frame, lengths or bare numbers \[m\].
    pub target_guess: Option<[Quantity; 3]>,
    /// The sensor frame the measurements are in, estimated; the world by default.
    pub frame: Option<Spanned<String>>,
    /// Where to start the estimate of the frame: x, y, z \[m\] and the unit quaternion w, x, y, z.
    pub frame_guess: Option<[f64; 7]>,
    /// The columns that group the rows; empty for the default of the kind.
    pub group: Vec<String>,
    /// The plane of a `known-plane` constraint.
    pub plane: Option<PlaneSpec>,
    /// The distance of a `distance` constraint.
    pub distance: Option<DistanceSpec>,
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
    pub(super) fn read(mut table: Section<'_>, folder: &Path) -> Result<Self, InputError> {
        let kinds = one_of(&Kind::ALL.map(Kind::name));
        let kind = Kind::read(&table.require("kind", &format!("expected {kinds}"))?)?;
        refuse_keys_of_other_kinds(&mut table, kind)?;
        let data = table.require("data", "expected the name of a CSV file")?;
        let units = table.units()?;
        let spec = Self {
            name: table
                .get("name")
                .map(|item| item.name_text())
                .transpose()?
                .map_or_else(String::new, |name| name.value),
            kind,
            data: folder.join(data.name_text()?.value),
            sigma: table
                .get("sigma")
                .map(|item| sigma(&item, kind, &units))
                .transpose()?,
            loss: match table.get("loss") {
                Some(item) => loss(&item)?,
                None => Loss::Trivial,
            },
            method: name(&mut table, "method")?,
            robot: name(&mut table, "robot")?,
            robots: two_robots(&mut table)?,
            target: name(&mut table, "target")?,
            targets: two_targets(&mut table)?,
            target_guess: target_guess(&mut table, &units)?,
            frame: name(&mut table, "frame")?,
            frame_guess: frame_guess(&mut table, &units)?,
            group: group(&mut table)?,
            plane: plane(&mut table, kind, &units)?,
            distance: distance(&mut table, kind, &units)?,
            columns: columns(&mut table)?,
            units,
            rows: rows(&mut table)?,
            holdout: holdout(&mut table)?,
            spans: table.spans(),
        };
        table.finish()?;
        Ok(spec)
    }
}

/// A key that exists, but not for this kind, is not "unknown": the error says whose it is.
fn refuse_keys_of_other_kinds(table: &mut Section<'_>, kind: Kind) -> Result<(), InputError> {
    for (key, kinds) in KEYS_OF_KINDS {
        if kinds.contains(&kind) {
            continue;
        }
        if let Some(item) = table.peek(key) {
            let names: Vec<&str> = kinds.iter().map(|kind| kind.name()).collect();
            let message = format!(
                "this is a {} constraint; only {} takes this key",
                kind.name(),
                one_of(&names)
            );
            return Err(item
                .error(message)
                .with_help("remove the key, or change the `kind`"));
        }
    }
    Ok(())
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
    use crate::file::CalibrationFile;

    fn read(lines: &str) -> Result<ConstraintSpec, InputError> {
        let text = format!("[robot]\nfile = 'r'\n[[constraint]]\ndata = 'd.csv'\n{lines}\n");
        let mut file = CalibrationFile::parse(&text, "c.toml")?;
        Ok(file.constraints.remove(0))
    }

    #[test]
    fn kinds_are_found_by_their_names() {
        for kind in Kind::ALL {
            assert_eq!(Kind::from_name(kind.name()), Some(kind));
        }
        assert_eq!(Kind::from_name("Pose"), None);
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
        let SigmaSpec::Pose { position, rotation } = spec.sigma.unwrap() else {
            panic!("two parts");
        };
        assert_eq!((position, rotation), (1e-4, 2e-4));
        assert_eq!(spec.target_guess.unwrap()[1].value, 0.01);
        let pose = [1.0, 2.0, 3.0, 0.0, 1.0, 0.0, 0.0];
        assert_eq!(spec.frame_guess, Some(pose));
        assert_eq!(spec.columns[0].0, "x");
        assert_eq!(spec.columns[1].1.value, "q_S");
        assert_eq!(spec.units.length, 1e-3);
        assert_eq!(spec.rows.unwrap().value.as_str(), "0:400");
        assert_eq!(spec.holdout.unwrap().rows, [0, 7]);
        assert_eq!(spec.loss, Loss::Trivial);

        let spec = read("kind = 'known-plane'\nplane = { normal = [0, 0, 2], distance = '4 mm' }");
        let plane = PlaneSpec::NormalDistance {
            normal: [0.0, 0.0, 2.0],
            distance: 4e-3,
        };
        assert_eq!(spec.unwrap().plane, Some(plane));
        let spec = read("kind = 'known-plane'\nplane = { a = 0.3, b = -0.5, c = -1.1 }");
        assert!(matches!(spec.unwrap().plane, Some(PlaneSpec::Paper { c, .. }) if c == -1.1));
        let spec = read("kind = 'same-point'\ngroup = 'point'\nsigma = 1e-4").unwrap();
        assert_eq!(spec.group, ["point"]);
        assert_eq!(spec.sigma, Some(SigmaSpec::Single(Quantity::bare(1e-4))));
        let spec = read("kind = 'distance'\ndistance = 'estimate'").unwrap();
        assert_eq!(spec.distance, Some(DistanceSpec::Estimate));
        let spec = read("kind = 'distance'\ndistance = '1 mm'").unwrap();
        assert_eq!(spec.distance, Some(DistanceSpec::Value(1e-3)));
    }

    #[test]
    fn mistakes_are_located_and_explained() {
        for (kind, text, words) in [
            ("pose", "plane = {}", "only `known-plane` takes this key"),
            (
                "position",
                "group = 'a'",
                "only `unknown-plane`, `same-point` or `same-location`",
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
