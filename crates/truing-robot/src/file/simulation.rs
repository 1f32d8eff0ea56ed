//! Simulation files: which robots, their errors, what is measured.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::Path;

use super::RobotRef;
use super::calibration::{name_robots, robots};
use super::constraint_spec::{Kind, PlaneSpec, SigmaSpec};
use super::constraint_values::{PLANE_FORMS, plane_of, point, pose, sigma, two_robots};
use super::error::{InputError, Source, one_of, suggest};
use super::item::Item;
use super::quantity::{Dimension, Quantity, Units};
use super::section::{Document, Section, Spanned, Spans};

/// How far the true robots are from nominal.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ErrorSpec {
    /// Size of random errors of angles \[rad\].
    pub angle: f64,
    /// Size of random errors of lengths \[m\].
    pub length: f64,
    /// Size of random errors of gains.
    pub gain: f64,
    /// Whether random errors are normal with that standard deviation; otherwise uniform between
    /// minus and plus that size.
    pub normal: bool,
    /// Names and patterns of the parameters that have random errors; "all" by default.
    pub parameters: Vec<Spanned<String>>,
    /// Names and patterns of the parameters that have none.
    pub fixed: Vec<Spanned<String>>,
    /// Errors that are given, by name or pattern; they replace the random ones.
    pub given: Vec<(Spanned<String>, Quantity)>,
}

/// Planes or points of a simulated constraint.
#[derive(Debug, Clone, PartialEq)]
pub enum PlacesSpec<T> {
    /// So many, drawn within reach of the robot.
    Random(usize),
    /// These.
    Listed(Vec<T>),
}

/// A set of measurements to simulate.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulationSpec {
    /// The name of the constraint.
    pub name: String,
    /// What is measured.
    pub kind: Kind,
    /// The name of the data file in the output folder.
    pub data: Spanned<String>,
    /// How many measurements, of each plane or point.
    pub count: usize,
    /// Noise; none by default.
    pub sigma: Option<SigmaSpec>,
    /// The robot that measures, where there are several.
    pub robot: Option<Spanned<String>>,
    /// The two robots of a distance.
    pub robots: Option<[Spanned<String>; 2]>,
    /// The tool point, if it is not the tool origin.
    pub target: Option<Spanned<String>>,
    /// Where it is in the tool frame \[m\].
    pub target_position: [f64; 3],
    /// The sensor's frame, if it is not the reference frame.
    pub frame: Option<Spanned<String>>,
    /// Where the sensor is: x, y, z \[m\] and the unit quaternion w, x, y, z.
    pub frame_pose: [f64; 7],
    /// The plane of a `known-plane`; none to draw it within reach of the robot.
    pub plane: Option<PlaneSpec>,
    /// The planes of an `unknown-plane`.
    pub planes: PlacesSpec<PlaneSpec>,
    /// The distance of planes that are drawn from the origin \[m\]; none for planes through a point
    /// within reach.
    pub plane_distance: Option<f64>,
    /// The points of a `same-point` \[m\].
    pub points: PlacesSpec<[f64; 3]>,
    /// The locations of a `same-location`: x, y, z \[m\] and the unit quaternion w, x, y, z.
    pub locations: PlacesSpec<[f64; 7]>,
    /// The distance of a `distance` \[m\].
    pub distance: f64,
    /// Where the table and the values of its keys are in the file.
    pub spans: Spans,
}

/// A simulation file.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulationFile {
    /// The file and its text.
    pub source: Source,
    /// The seed of all random numbers.
    pub seed: u64,
    /// The robots, at least one.
    pub robots: Vec<RobotRef>,
    /// How far the true robots are from nominal.
    pub errors: ErrorSpec,
    /// What is measured, at least one.
    pub constraints: Vec<SimulationSpec>,
}

impl SimulationFile {
    /// Reads a simulation file.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or is not a simulation file.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, InputError> {
        Self::from_source(Source::read(path)?)
    }

    /// Reads the text of a simulation file; other files are found relative to `path`.
    ///
    /// # Errors
    ///
    /// The text is not a simulation file.
    pub fn parse(text: &str, path: impl Into<std::path::PathBuf>) -> Result<Self, InputError> {
        Self::from_source(Source::new(text, path))
    }

    /// The error of `message` at `span` (bytes) of this file.
    #[must_use]
    pub fn error_at(&self, span: Range<usize>, message: impl Into<String>) -> InputError {
        self.source.error_at(span, message)
    }

    fn from_source(source: Source) -> Result<Self, InputError> {
        if source.text.trim().is_empty() {
            return Err(source
                .error("this simulation file is empty; expected [robot] and [[constraint]]")
                .with_help("describe the simulation, or check that the right file is named"));
        }
        let document = Document::parse(&source)?;
        let mut root = document.root().titled("this simulation file");
        let seed = root.integer("seed")?.map_or(0, |seed| seed.value as u64);
        let robots = robots(&mut root, source.folder())?;
        let errors = match root.table("errors")? {
            Some(table) => errors_with_given(table.titled("[errors]"))?,
            None => ErrorSpec::default(),
        };
        let mut constraints: Vec<SimulationSpec> = Vec::new();
        let mut used = BTreeSet::new();
        for table in root.tables("constraint")? {
            let spec = constraint(table, &source, &robots, true)?;
            if !used.insert(spec.data.value.clone()) {
                let message = format!("`{}` is written by two constraints", spec.data.value);
                return Err(source
                    .error_at(spec.data.span, message)
                    .with_help("give each constraint a data file of its own"));
            }
            constraints.push(spec);
        }
        if constraints.is_empty() {
            return Err(root
                .error("there is no [[constraint]]; expected at least one")
                .with_help("add a [[constraint]] with its `kind`, `data` and `count`"));
        }
        root.finish()?;
        Ok(Self {
            source,
            seed,
            robots,
            errors,
            constraints,
        })
    }
}

/// The most measurements that a constraint makes.
const MOST: usize = 1_000_000;

/// A size of zero or more.
fn size(item: &Item<'_>, dimension: Dimension) -> Result<f64, InputError> {
    let value = item.in_units(dimension, &Units::SI)?;
    if value >= 0.0 {
        return Ok(value);
    }
    Err(item
        .error(format!("found {value}; expected 0 or more"))
        .with_help("write it without a sign"))
}

/// Sizes and distribution of random errors, and which parameters have them.
pub(super) fn errors(table: &mut Section<'_>) -> Result<ErrorSpec, InputError> {
    let mut spec = ErrorSpec::default();
    for (key, dimension, value) in [
        ("angle", Dimension::Angle, &mut spec.angle),
        ("length", Dimension::Length, &mut spec.length),
        ("gain", Dimension::None, &mut spec.gain),
    ] {
        if let Some(item) = table.get(key) {
            *value = size(&item, dimension)?;
        }
    }
    if let Some(word) = table.string("distribution")? {
        spec.normal = match word.value.as_str() {
            "normal" => true,
            "uniform" => false,
            other => {
                let words = ["uniform", "normal"];
                let message = format!("found `{other}`; expected \"uniform\" or \"normal\"");
                let wrong = match table.peek("distribution") {
                    Some(item) => item.error(message),
                    None => table.error(message),
                };
                return Err(wrong.with_help(suggest(other, &words)));
            }
        };
    }
    spec.parameters = table
        .string_or_list("parameters")?
        .unwrap_or_else(|| vec![Spanned::new("all".to_owned(), table.span())]);
    spec.fixed = table.string_or_list("fixed")?.unwrap_or_default();
    Ok(spec)
}

fn errors_with_given(mut table: Section<'_>) -> Result<ErrorSpec, InputError> {
    let mut spec = errors(&mut table)?;
    if let Some(mut given) = table.table("given")? {
        for item in given.entries() {
            let name = Spanned::new(item.name().to_owned(), item.key_span());
            spec.given.push((name, item.quantity()?.value));
        }
    }
    table.finish()?;
    Ok(spec)
}

/// The keys that only some kinds have.
const KEYS_OF_KINDS: [(&str, &[Kind]); 10] = [
    (
        "target_position",
        &[
            Kind::Pose,
            Kind::Position,
            Kind::KnownPlane,
            Kind::UnknownPlane,
            Kind::SamePoint,
            Kind::SameLocation,
        ],
    ),
    ("frame", &[Kind::Pose, Kind::Position]),
    ("frame_pose", &[Kind::Pose, Kind::Position]),
    ("plane", &[Kind::KnownPlane]),
    ("planes", &[Kind::UnknownPlane]),
    ("plane_distance", &[Kind::KnownPlane, Kind::UnknownPlane]),
    ("points", &[Kind::SamePoint]),
    ("locations", &[Kind::SameLocation]),
    ("distance", &[Kind::Distance]),
    ("robots", &[Kind::Distance]),
];

/// A `[[constraint]]`; one that is not `written` has no data file, and its kind for a name.
pub(super) fn constraint(
    mut table: Section<'_>,
    source: &Source,
    robots: &[RobotRef],
    written: bool,
) -> Result<SimulationSpec, InputError> {
    let kind = Kind::read(&table.require("kind", "expected what is measured, like \"position\"")?)?;
    for (key, kinds) in KEYS_OF_KINDS {
        if let (false, Some(item)) = (kinds.contains(&kind), table.peek(key)) {
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
    let data = if written {
        data_file(&mut table)?
    } else {
        Spanned::new(kind.name().to_owned(), table.span())
    };
    let count = table.require("count", "expected how many measurements")?;
    let number = count.integer()?.value;
    if !(1..=MOST).contains(&number) {
        return Err(count
            .error(format!("found {number}; expected 1 to {MOST}"))
            .with_help("say how many measurements to make"));
    }
    let sigma = table
        .get("sigma")
        .map(|item| sigma(&item, kind, &Units::SI))
        .transpose()?;
    let name = match table.get("name") {
        Some(item) => item.name_text()?.value,
        None => Path::new(&data.value)
            .file_stem()
            .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned()),
    };
    let robot = table
        .get("robot")
        .map(|item| item.name_text())
        .transpose()?;
    let mut two = two_robots(&mut table)?;
    let mut one = robot;
    let spans = table.spans();
    name_robots(&mut one, &mut two, kind, spans.table(), source, robots)?;
    let target = table
        .get("target")
        .map(|item| item.name_text())
        .transpose()?;
    let target_position = match table.get("target_position") {
        Some(item) => point(&item, &Units::SI)?.map(|c| c.value),
        None => [0.0; 3],
    };
    let frame = table
        .get("frame")
        .map(|item| item.name_text())
        .transpose()?;
    let frame_pose = match table.get("frame_pose") {
        Some(item) => pose(&item, &Units::SI)?,
        None => [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
    };
    let drawn = |item: &Item<'_>| item.as_str() == Some("random");
    let plane = if kind == Kind::KnownPlane {
        let forms = format!("\"random\", {PLANE_FORMS}");
        let item = table.require("plane", &format!("expected {forms}"))?;
        if drawn(&item) {
            None
        } else if item.is_table() {
            Some(plane_of(&item, &Units::SI)?)
        } else {
            let word = item.as_str().unwrap_or_default();
            return Err(item
                .wrong_type(&forms)
                .with_help(suggest(word, &["random"])));
        }
    } else {
        None
    };
    let planes = places(
        &mut table,
        "planes",
        "a number of planes, or a list of planes",
        |item| plane_of(item, &Units::SI),
    )?;
    let plane_distance = match table.get("plane_distance") {
        Some(item) if plane.is_some() || matches!(planes, PlacesSpec::Listed(_)) => {
            return Err(item
                .error("the planes are given; expected planes that are drawn")
                .with_help("write plane = \"random\", or planes = 1; or remove this key"));
        }
        Some(item) => Some(size(&item, Dimension::Length)?),
        None => None,
    };
    let points = places(
        &mut table,
        "points",
        "a number of points, or a list of points",
        |item| Ok(point(item, &Units::SI)?.map(|c| c.value)),
    )?;
    let locations = places(
        &mut table,
        "locations",
        "a number of locations, or a list of locations",
        |item| pose(item, &Units::SI),
    )?;
    let distance = if kind == Kind::Distance {
        size(
            &table.require("distance", "expected a length")?,
            Dimension::Length,
        )?
    } else {
        0.0
    };
    table.finish()?;
    Ok(SimulationSpec {
        name,
        kind,
        data,
        count: number,
        sigma,
        robot: one,
        robots: two,
        target,
        target_position,
        frame,
        frame_pose,
        plane,
        planes,
        plane_distance,
        points,
        locations,
        distance,
        spans,
    })
}

fn data_file(table: &mut Section<'_>) -> Result<Spanned<String>, InputError> {
    let data = table.require("data", "expected the name of the CSV file to write")?;
    let file = data.name_text()?;
    let path = Path::new(&file.value);
    if path.file_name() != Some(path.as_os_str()) {
        return Err(data.error("this is not a plain file name").with_help(
            "data are written into the output folder: write only a name, like \"touches.csv\"",
        ));
    }
    Ok(file)
}

fn places<T>(
    table: &mut Section<'_>,
    key: &str,
    expected: &str,
    one: impl Fn(&Item<'_>) -> Result<T, InputError>,
) -> Result<PlacesSpec<T>, InputError> {
    let Some(item) = table.get(key) else {
        return Ok(PlacesSpec::Random(1));
    };
    if item.is_list() {
        let listed = item
            .list(expected)?
            .iter()
            .map(one)
            .collect::<Result<Vec<T>, _>>()?;
        if listed.is_empty() {
            return Err(item
                .error(format!("found an empty list; expected {expected}"))
                .with_help("write 1 or more, or leave the key out for one"));
        }
        return Ok(PlacesSpec::Listed(listed));
    }
    let number = item.integer().map_err(|_| item.wrong_type(expected))?.value;
    if number == 0 {
        return Err(item
            .error(format!("found 0; expected {expected}"))
            .with_help("write 1 or more"));
    }
    Ok(PlacesSpec::Random(number))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<SimulationFile, InputError> {
        SimulationFile::parse(&format!("[robot]\nfile = 'r.toml'\n{text}"), "s.toml")
    }

    #[test]
    fn errors_and_places_are_read() {
        let file = read(
            "[errors]\nangle = '1 mrad'\nlength = 0.001\ndistribution = 'normal'\ngiven = { theta2 = '1 deg' }\n\
             [[constraint]]\nkind = 'unknown-plane'\ndata = 't.csv'\ncount = 4\nplanes = 2\n\
             [[constraint]]\nkind = 'same-point'\ndata = 'p.csv'\ncount = 3\npoints = [[0.1, '20 mm', 0]]",
        )
        .unwrap();
        assert_eq!(
            (file.errors.angle, file.errors.length, file.errors.normal),
            (1e-3, 1e-3, true)
        );
        assert_eq!(file.errors.given[0].0.value, "theta2");
        assert_eq!(file.constraints[0].planes, PlacesSpec::Random(2));
        assert_eq!(
            file.constraints[1].points,
            PlacesSpec::Listed(vec![[0.1, 0.02, 0.0]])
        );
        assert_eq!(file.constraints[1].name, "p");
    }

    #[test]
    fn mistakes_are_explained() {
        let constraint = "[[constraint]]\nkind = 'position'\n";
        for (text, words) in [
            ("", "there is no [[constraint]]"),
            ("[errors]\nangle = -1\n", "expected 0 or more"),
            (
                "[errors]\ndistribution = 'even'\n",
                "\"uniform\" or \"normal\"",
            ),
            (
                &format!("{constraint}data = '../x.csv'\ncount = 1"),
                "not a plain file name",
            ),
            (&format!("{constraint}data = 'x.csv'\ncount = 0"), "found 0"),
            (
                &format!("{constraint}data = 'x.csv'\ncount = 1\nplanes = 2"),
                "only `unknown-plane` takes this key",
            ),
            (
                &format!(
                    "{constraint}data = 'x.csv'\ncount = 1\n{constraint}data = 'x.csv'\ncount = 1"
                ),
                "two constraints",
            ),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.to_string().contains(words), "{error}");
        }
    }
}
