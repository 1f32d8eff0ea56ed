//! Simulation files: which robots, their errors, what is measured.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::Path;

use super::constraint::kind_of;
use super::constraint_values::{refuse_other_keys, scene_keys, sigma, two_robots};
use super::robots::{RobotRef, name_robots, robots};
use crate::measurement::{Kind, Scene};
use crate::plugin::Registry;
use crate::text::error::suggest;
use crate::text::{
    Dimension, Document, InputError, Quantity, Section, Source, Spanned, Spans, Units,
};
use std::sync::Arc;
use truing::manifold::Pose;
use truing::nalgebra::Vector3;

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

/// A set of measurements to simulate.
#[derive(Debug, Clone)]
pub struct SimulationSpec {
    /// The name of the constraint.
    pub name: String,
    /// What is measured.
    pub kind: Arc<dyn Kind>,
    /// The name of the data file in the output folder.
    pub data: Spanned<String>,
    /// How many measurements, of each group.
    pub count: usize,
    /// Noise, one standard deviation a measurand; none by default.
    pub sigma: Vec<Option<f64>>,
    /// The robot that measures, where there are several.
    pub robot: Option<Spanned<String>>,
    /// The two robots of a kind between two tools.
    pub robots: Option<[Spanned<String>; 2]>,
    /// The target, if it is not the tool itself.
    pub target: Option<Spanned<String>>,
    /// Where it is in the tool frame.
    pub target_position: Pose<f64>,
    /// The sensor's frame, if it is not the reference frame.
    pub frame: Option<Spanned<String>>,
    /// Where the sensor is.
    pub frame_pose: Pose<f64>,
    /// Where the unknowns of the kind truly are.
    pub scene: Scene,
    /// Where the table and the values of its keys are in the file.
    pub spans: Spans,
}

/// A simulation file.
#[derive(Debug, Clone)]
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
        Self::read_with(path, &Registry::default())
    }

    /// Reads a simulation file, which may also name what plugins add.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn read_with(path: impl AsRef<Path>, registry: &Registry) -> Result<Self, InputError> {
        Self::from_source(Source::read(path)?, registry)
    }

    /// Reads the text of a simulation file; other files are found relative to `path`.
    ///
    /// # Errors
    ///
    /// The text is not a simulation file.
    pub fn parse(text: &str, path: impl Into<std::path::PathBuf>) -> Result<Self, InputError> {
        Self::from_source(Source::new(text, path), &Registry::default())
    }

    /// The error of `message` at `span` (bytes) of this file.
    #[must_use]
    pub fn error_at(&self, span: Range<usize>, message: impl Into<String>) -> InputError {
        self.source.error_at(span, message)
    }

    fn from_source(source: Source, registry: &Registry) -> Result<Self, InputError> {
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
            let spec = constraint(table, &source, &robots, registry, true)?;
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

/// Sizes and distribution of random errors, and which parameters have them.
pub(super) fn errors(table: &mut Section<'_>) -> Result<ErrorSpec, InputError> {
    let mut spec = ErrorSpec::default();
    for (key, dimension, value) in [
        ("angle", Dimension::Angle, &mut spec.angle),
        ("length", Dimension::Length, &mut spec.length),
        ("gain", Dimension::None, &mut spec.gain),
    ] {
        if let Some(item) = table.get(key) {
            *value = item.size(dimension)?;
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

/// A `[[constraint]]`; one that is not `written` has no data file, and its kind for a name.
pub(super) fn constraint(
    mut table: Section<'_>,
    source: &Source,
    robots: &[RobotRef],
    registry: &Registry,
    written: bool,
) -> Result<SimulationSpec, InputError> {
    let item = table.require("kind", "expected what is measured, like \"position\"")?;
    let kind = kind_of(&item, registry)?;
    refuse_other_keys(&table, &*kind, registry, scene_keys)?;
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
    let sigma = match table.get("sigma") {
        Some(item) => sigma(&item, &*kind, &Units::SI)?,
        None => vec![None; kind.measurands().len()],
    };
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
    name_robots(
        &mut one,
        &mut two,
        kind.tools(),
        spans.table(),
        source,
        robots,
    )?;
    let target = table
        .get("target")
        .map(|item| item.name_text())
        .transpose()?;
    let target_position = match table.get("target_position") {
        Some(item) => item.point(&Units::SI)?,
        None => Vector3::zeros(),
    };
    let frame = table
        .get("frame")
        .map(|item| item.name_text())
        .transpose()?;
    let frame_pose = match table.get("frame_pose") {
        Some(item) => item.pose(&Units::SI)?,
        None => Pose::identity(),
    };
    let scene = kind.scene(&mut table)?;
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
        target_position: Pose {
            translation: target_position,
            ..Pose::identity()
        },
        frame,
        frame_pose,
        scene,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::SceneGroups;
    use truing::manifold::Point3;

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
        let [planes, points] = [0, 1].map(|k| &file.constraints[k].scene.groups);
        assert!(matches!(planes, SceneGroups::Drawn(2)));
        let SceneGroups::Given(points) = points else {
            panic!("points are listed");
        };
        let point = points[0][0].get::<Point3>();
        assert_eq!(point, Some(&Vector3::new(0.1, 0.02, 0.0)));
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
