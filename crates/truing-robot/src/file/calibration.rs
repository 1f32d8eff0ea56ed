//! Calibration files: which robots, what to estimate, from which constraints.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::constraint::ConstraintSpec;
use super::estimate::EstimateSpec;
use super::robots::{RobotRef, name_robots, robots};
use crate::plugin::Registry;
use crate::text::{Document, InputError, Section, Source, stem};

/// A calibration file: what to estimate, from which constraints.
#[derive(Debug, Clone)]
pub struct CalibrationFile {
    /// The file and its text.
    pub source: Source,
    /// The robots, at least one, in the order of the file.
    pub robots: Vec<RobotRef>,
    /// What to estimate, and how.
    pub estimate: EstimateSpec,
    /// What to estimate from, at least one.
    pub constraints: Vec<ConstraintSpec>,
    /// What to validate with; never used in the estimate.
    pub validate: Vec<ConstraintSpec>,
}

impl CalibrationFile {
    /// Reads a calibration file.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or is not a calibration file.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, InputError> {
        Self::read_with(path, &Registry::default())
    }

    /// Reads a calibration file, which may also name what plugins add.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn read_with(path: impl AsRef<Path>, registry: &Registry) -> Result<Self, InputError> {
        Self::from_source(Source::read(path)?, registry)
    }

    /// Reads the text of a calibration file; other files are found relative to `path`.
    ///
    /// # Errors
    ///
    /// The text is not a calibration file.
    pub fn parse(text: &str, path: impl Into<PathBuf>) -> Result<Self, InputError> {
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
                .error("this calibration file is empty; expected [robot] and [[constraint]]")
                .with_help("describe the calibration, or check that the right file is named"));
        }
        let document = Document::parse(&source)?;
        let mut root = document.root().titled("this calibration file");
        let robots = robots(&mut root, source.folder())?;
        let estimate = match root.table("estimate")? {
            Some(table) => EstimateSpec::read(table.titled("[estimate]"))?,
            None => EstimateSpec::default(),
        };
        let mut constraints = constraints(&mut root, "constraint", &source, &robots, registry)?;
        let mut validate = constraints_without_holdout(&mut root, &source, &robots, registry)?;
        root.finish()?;
        if constraints.is_empty() {
            return Err(source
                .error("there is no [[constraint]]; expected at least one")
                .with_help("add a [[constraint]] with its `kind` and `data`"));
        }
        name_all(&mut constraints, BTreeSet::new(), &source)?;
        // Rows held out are reported next to the validation data, under the constraint's name.
        let held_out = constraints.iter().filter(|spec| spec.holdout.is_some());
        let held_out = held_out.map(|spec| spec.name.clone()).collect();
        name_all(&mut validate, held_out, &source)?;
        Ok(Self {
            robots,
            estimate,
            constraints,
            validate,
            source,
        })
    }
}

fn constraints(
    root: &mut Section<'_>,
    key: &str,
    source: &Source,
    robots: &[RobotRef],
    registry: &Registry,
) -> Result<Vec<ConstraintSpec>, InputError> {
    let mut specs = Vec::new();
    for table in root.tables(key)? {
        let mut spec = ConstraintSpec::read(table, source.folder(), registry)?;
        let span = spec.spans.table();
        name_robots(
            &mut spec.robot,
            &mut spec.robots,
            spec.kind.tools(),
            span,
            source,
            robots,
        )?;
        specs.push(spec);
    }
    Ok(specs)
}

fn constraints_without_holdout(
    root: &mut Section<'_>,
    source: &Source,
    robots: &[RobotRef],
    registry: &Registry,
) -> Result<Vec<ConstraintSpec>, InputError> {
    let specs = constraints(root, "validate", source, robots, registry)?;
    match specs.iter().find(|spec| spec.holdout.is_some()) {
        None => Ok(specs),
        Some(spec) => Err(source
            .error_at(
                spec.span_of("holdout"),
                "`holdout`: rows of [[validate]] are never used in the estimate",
            )
            .with_help("remove it, or use `rows` to take some of the rows")),
    }
}

/// Gives each constraint a name of its own, none of those `taken`.
fn name_all(
    specs: &mut [ConstraintSpec],
    mut taken: BTreeSet<String>,
    source: &Source,
) -> Result<(), InputError> {
    for spec in specs.iter().filter(|spec| !spec.name.is_empty()) {
        if !taken.insert(spec.name.clone()) {
            let message = format!("`name`: a second one is called `{}`", spec.name);
            return Err(source
                .error_at(spec.span_of("name"), message)
                .with_help("give each its own name, or leave the names out"));
        }
    }
    for spec in specs.iter_mut().filter(|spec| spec.name.is_empty()) {
        let stem = match stem(&spec.data) {
            stem if stem.is_empty() => spec.kind.name().to_owned(),
            stem => stem,
        };
        let mut name = stem.clone();
        let mut number = 1;
        while !taken.insert(name.clone()) {
            number += 1;
            name = format!("{stem}-{number}");
        }
        spec.name = name;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "\
[robot]
file = \"arm.toml\"

[[constraint]]
kind = \"unknown-plane\"
data = \"touches.csv\"
sigma = \"0.1 mm\"
loss = \"huber(1.5)\"

[[validate]]
kind = \"position\"
data = \"data/tracker.csv\"
";

    const ARMS: &str = "\
[robots.right]
file = \"/abs/right.toml\"
[robots.left]
file = \"left.toml\"
[[constraint]]
kind = \"distance\"
data = \"d.csv\"
distance = 0.116
";

    fn error(text: &str) -> InputError {
        CalibrationFile::parse(text, "c.toml").unwrap_err()
    }

    #[test]
    fn files_are_found_next_to_the_calibration() {
        let file = CalibrationFile::parse(TEXT, "cell/c.toml").unwrap();
        assert_eq!(file.robots.len(), 1);
        assert_eq!(file.robots[0].name, "");
        assert_eq!(file.robots[0].file, Path::new("cell/arm.toml"));
        assert_eq!(&TEXT[file.robots[0].span.clone()], "\"arm.toml\"");
        assert_eq!(file.constraints[0].data, Path::new("cell/touches.csv"));
        assert_eq!(file.validate[0].data, Path::new("cell/data/tracker.csv"));
        assert_eq!(file.validate[0].name, "tracker");
        let span = file.constraints[0].span_of("sigma");
        let located = file.error_at(span, "too small");
        assert_eq!(located.to_string(), "cell/c.toml:7: too small");
        let missing = file.constraints[0].span_of("rows");
        assert_eq!(file.error_at(missing, "").line, Some(4));
        assert_eq!(file.estimate, EstimateSpec::default());
    }

    #[test]
    fn several_robots_have_names() {
        let file = CalibrationFile::parse(ARMS, "c.toml").unwrap();
        assert_eq!(file.robots[0].name, "right");
        assert_eq!(file.robots[0].file, Path::new("/abs/right.toml"));
        let [first, second] = file.constraints[0].robots.clone().unwrap();
        assert_eq!(
            (first.value.as_str(), second.value.as_str()),
            ("right", "left")
        );
        let text = format!("{ARMS}robots = ['left', 'right']\n");
        let file = CalibrationFile::parse(&text, "c.toml").unwrap();
        assert_eq!(
            file.constraints[0].robots.as_ref().unwrap()[0].value,
            "left"
        );
        let text = format!("{ARMS}robot = 'left'\n");
        let file = CalibrationFile::parse(&text, "c.toml").unwrap();
        assert_eq!(file.constraints[0].robots, None);
        for (line, words) in [
            ("robot = 'lift'", "there is no robot `lift`"),
            ("robots = ['left', 'left']", "twice"),
            ("robots = ['left']", "list of 1"),
            (
                "robots = ['left', 'right']\nrobot = 'left'",
                "one of the two keys",
            ),
        ] {
            let error = error(&format!("{ARMS}{line}\n"));
            assert_eq!(error.line, Some(9), "{error}");
            assert!(error.message.contains(words), "{error}");
        }
        let unclear = error(
            &ARMS
                .replace("distance\"", "pose\"")
                .replace("distance = 0.116", ""),
        );
        assert_eq!(unclear.line, Some(5));
        assert!(unclear.message.contains("which robot"), "{unclear}");
    }

    #[test]
    fn names_are_made_unique() {
        let one = "[[constraint]]\nkind = 'pose'\ndata = 'a/t.csv'\n";
        let held = "holdout = { every = 2, rows = [0] }\n";
        let named = "[[constraint]]\nkind = 'pose'\ndata = 'x.csv'\nname = 't-2'\n";
        let valid = "[[validate]]\nkind = 'pose'\ndata = 't.csv'\n";
        let text = format!("robot.file = 'r'\n{one}{one}{named}{one}{held}{valid}{valid}");
        let file = CalibrationFile::parse(&text, "c.toml").unwrap();
        let names = |specs: &[ConstraintSpec]| -> Vec<String> {
            specs.iter().map(|spec| spec.name.clone()).collect()
        };
        assert_eq!(names(&file.constraints), ["t", "t-3", "t-2", "t-4"]);
        assert_eq!(names(&file.validate), ["t", "t-2"]);
        let text = format!("robot.file = 'r'\n{named}{named}");
        assert_eq!(error(&text).line, Some(9));
    }

    #[test]
    fn mistakes_are_located_and_explained() {
        for (from, to, line, words) in [
            ("[robot]", "[robt]", 0, "there is no [robot]"),
            ("[robot]", "[robots]", 2, "expected a table"),
            ("[robot]", "[robots.'a.b']", 1, "before a parameter's"),
            (
                "[robot]",
                "[robots.a]\nfile = 'x'\n[robot]",
                1,
                "one of the two",
            ),
            ("file", "fil", 1, "[robot] has no `file`"),
            (
                "[[constraint]]",
                "[[constrain]]",
                4,
                "unknown key `constrain`",
            ),
            ("[[constraint]]", "[constraint]", 4, "found one table"),
            (
                "[[constraint]]",
                "[[validate]]",
                0,
                "there is no [[constraint]]",
            ),
            (
                "[[validate]]",
                "[validation]",
                10,
                "unknown key `validation`",
            ),
            ("sigma", "robot = 'x'\nsigma", 7, "without a name"),
            (
                "[[validate]]",
                "[[validate]]\nholdout = { every = 2, rows = [1] }",
                11,
                "never",
            ),
        ] {
            let error = error(&TEXT.replacen(from, to, 1));
            assert!(error.message.contains(words), "{to}: {error}");
            assert_eq!(error.line.unwrap_or(0), line, "{to}: {error}");
        }
        assert!(error("").message.contains("empty"));
        assert!(error("\u{feff}").message.contains("empty"));
    }
}
