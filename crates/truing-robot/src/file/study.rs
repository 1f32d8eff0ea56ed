//! Study files: which robot, how wrong, what is measured, and the methods that are to recover it.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::Path;

use super::estimate::EstimateSpec;
use super::robots::{RobotRef, robots};
use super::simulation::{ErrorSpec, SimulationSpec, constraint, errors};
use crate::plugin::Registry;
use crate::text::error::suggest;
use crate::text::{Dimension, Document, InputError, Item, Section, Source, Spanned, Units};

/// What is measured in one part of a study.
#[derive(Debug, Clone)]
pub struct CaseSpec {
    /// The name, different from those of the others.
    pub name: String,
    /// What is measured, at least one.
    pub constraints: Vec<SimulationSpec>,
    /// Where the table is in the file, in bytes.
    pub span: Range<usize>,
}

/// Where a method of a study starts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum StartKind {
    /// As a calibration does.
    #[default]
    Auto,
    /// At the nominal robot as the file gives it, wherever it stands.
    Nominal,
    /// At the true robot: what the data allow, if no start were wrong.
    Truth,
}

/// A way to estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct MethodSpec {
    /// The name, different from those of the others.
    pub name: String,
    /// Other equations, by the name that a plugin gives them.
    pub form: Option<Spanned<String>>,
    /// Where it starts.
    pub start: StartKind,
    /// What to estimate, and how: `[estimate]` with the keys of `[[method]]` in place of its own.
    pub estimate: EstimateSpec,
    /// Where the table is in the file, in bytes.
    pub span: Range<usize>,
}

/// A study file.
#[derive(Debug, Clone)]
pub struct StudyFile {
    /// The file and its text.
    pub source: Source,
    /// The seed of all random numbers.
    pub seed: u64,
    /// How many robots are drawn for each case and tool error.
    pub trials: usize,
    /// The robots, at least one.
    pub robots: Vec<RobotRef>,
    /// How far the true robots are from nominal. The word "identifiable" stands for the parameters
    /// that a case estimates.
    pub errors: ErrorSpec,
    /// Mean initial tool errors to which the errors are scaled \[m\]; none to take them as they are.
    pub tool_errors: Vec<Spanned<f64>>,
    /// What is measured, at least one.
    pub cases: Vec<CaseSpec>,
    /// How it is estimated, at least one.
    pub methods: Vec<MethodSpec>,
    /// How many fresh configurations judge an estimate.
    pub configurations: usize,
    /// Errors on fresh configurations up to which a robot counts as recovered \[m\]; none for the default.
    pub tolerance: Option<f64>,
}

impl StudyFile {
    /// Reads a study file.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or is not a study file.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, InputError> {
        Self::read_with(path, &Registry::default())
    }

    /// Reads a study file, which may also name what plugins add.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn read_with(path: impl AsRef<Path>, registry: &Registry) -> Result<Self, InputError> {
        Self::from_source(Source::read(path)?, registry)
    }

    /// Reads the text of a study file; other files are found relative to `path`.
    ///
    /// # Errors
    ///
    /// The text is not a study file.
    pub fn parse(text: &str, path: impl Into<std::path::PathBuf>) -> Result<Self, InputError> {
        Self::from_source(Source::new(text, path), &Registry::default())
    }

    fn from_source(source: Source, registry: &Registry) -> Result<Self, InputError> {
        if source.text.trim().is_empty() {
            return Err(source
                .error("this study file is empty; expected [robot], [[case]] and [[method]]")
                .with_help("describe the study, or check that the right file is named"));
        }
        let document = Document::parse(&source)?;
        let mut root = document.root().titled("this study file");
        let seed = root.integer("seed")?.map_or(0, |seed| seed.value as u64);
        let trials = count(&mut root, "trials", 100)?;
        let configurations = count(&mut root, "configurations", 100)?;
        let tolerance = root
            .get("tolerance")
            .map(|item| item.positive(Dimension::Length, &Units::SI))
            .transpose()?;
        let robots = robots(&mut root, source.folder())?;
        let (errors, tool_errors) = match root.table("errors")? {
            Some(table) => levels(table.titled("[errors]"))?,
            None => {
                return Err(root
                    .error("there is no [errors]; expected how wrong the robots are")
                    .with_help(
                        "add [errors] with tool_error = [\"0.1 m\"], or `angle` and `length`",
                    ));
            }
        };
        let mut cases: Vec<CaseSpec> = Vec::new();
        for table in root.tables("case")? {
            cases.push(case(table, &source, &robots, registry)?);
        }
        let methods = methods(&mut root)?;
        root.finish()?;
        if cases.is_empty() {
            return Err(source
                .error("there is no [[case]]; expected at least one")
                .with_help("add a [[case]] with its `name` and a [[case.constraint]]"));
        }
        if methods.is_empty() {
            return Err(source
                .error("there is no [[method]]; expected at least one")
                .with_help("add [[method]] with name = \"Levenberg-Marquardt\""));
        }
        let named = cases.iter().map(|case| (&case.name, &case.span));
        different(named, "case", &source)?;
        let named = methods.iter().map(|method| (&method.name, &method.span));
        different(named, "method", &source)?;
        Ok(Self {
            seed,
            trials,
            robots,
            errors,
            tool_errors,
            cases,
            methods,
            configurations,
            tolerance,
            source,
        })
    }
}

/// The most trials, and the most configurations, of a study: more is a slip of the hand.
const MOST: usize = 1_000_000;

fn count(root: &mut Section<'_>, key: &str, default: usize) -> Result<usize, InputError> {
    let Some(item) = root.get(key) else {
        return Ok(default);
    };
    match item.integer()?.value {
        number if (1..=MOST).contains(&number) => Ok(number),
        number => Err(item
            .error(format!("found {number}; expected 1 to {MOST}"))
            .with_help(format!("write a number of {key}, like {default}"))),
    }
}

fn different<'a>(
    named: impl Iterator<Item = (&'a String, &'a Range<usize>)>,
    what: &str,
    source: &Source,
) -> Result<(), InputError> {
    let mut taken = BTreeSet::new();
    for (name, span) in named {
        if !taken.insert(name) {
            let message = format!("a second {what} is called `{name}`");
            return Err(source
                .error_at(span.clone(), message)
                .with_help("give each its own name"));
        }
    }
    Ok(())
}

fn levels(mut table: Section<'_>) -> Result<(ErrorSpec, Vec<Spanned<f64>>), InputError> {
    let mut spec = errors(&mut table)?;
    if table.peek("parameters").is_none() {
        spec.parameters = vec![Spanned::new("identifiable".to_owned(), table.span())];
    }
    let mut levels: Vec<Spanned<f64>> = Vec::new();
    if let Some(item) = table.get("tool_error") {
        let list = if item.is_list() {
            item.list("a list of lengths")?
        } else {
            vec![item.clone()]
        };
        for level in list {
            let value = level.positive(Dimension::Length, &Units::SI)?;
            levels.push(Spanned::new(value, level.span()));
        }
        if levels.is_empty() || levels.len() > usize::from(u16::MAX) {
            return Err(item
                .error(format!(
                    "found {} lengths; expected at least one",
                    levels.len()
                ))
                .with_help(
                    "write mean tool errors, like [\"0.1 m\", \"0.2 m\"], or leave the key out",
                ));
        }
        let sizes = ["angle", "length", "gain"];
        if sizes.iter().all(|key| table.peek(key).is_none()) {
            (spec.angle, spec.length) = (1.0, 1.0);
        } else if spec.angle + spec.length + spec.gain == 0.0 {
            return Err(item
                .error("all sizes of errors are zero; expected one that can be scaled to it")
                .with_help(
                    "write the ratio of errors, like angle = \"1 rad\" and length = \"1 m\"",
                ));
        }
    }
    let said = ["angle", "length", "gain"];
    if levels.is_empty() && said.iter().all(|key| table.peek(key).is_none()) {
        return Err(table
            .error("[errors] does not say how wrong the robots are; expected `tool_error`, or sizes of errors")
            .with_help("add tool_error = [\"0.1 m\"], or `angle` and `length`"));
    }
    table.finish()?;
    Ok((spec, levels))
}

fn case(
    mut table: Section<'_>,
    source: &Source,
    robots: &[RobotRef],
    registry: &Registry,
) -> Result<CaseSpec, InputError> {
    let span = table.span();
    let name = table.require("name", "expected what the case is called")?;
    let name = name.name_text()?.value;
    let mut constraints: Vec<SimulationSpec> = Vec::new();
    for inner in table.tables("constraint")? {
        let inner = inner.titled("[[case.constraint]]");
        let mut spec = constraint(inner, source, robots, registry, false)?;
        let stem = spec.name.clone();
        let mut number = 1;
        while constraints.iter().any(|other| other.name == spec.name) {
            number += 1;
            spec.name = format!("{stem}-{number}");
        }
        constraints.push(spec);
    }
    if constraints.is_empty() {
        return Err(table
            .error(format!(
                "the case `{name}` has no constraint; expected at least one"
            ))
            .with_help("add a [[case.constraint]] with its `kind` and `count`"));
    }
    table.finish()?;
    Ok(CaseSpec {
        name,
        constraints,
        span,
    })
}

fn methods(root: &mut Section<'_>) -> Result<Vec<MethodSpec>, InputError> {
    let shared = root.table("estimate")?;
    // Read by itself, for an error in it not to be an error of every method.
    if let Some(table) = root.table("estimate")? {
        EstimateSpec::read(table.titled("[estimate]"))?;
    }
    let mut methods = Vec::new();
    for mut table in root.tables("method")? {
        let span = table.span();
        let name = table.require("name", "expected what the method is called")?;
        let name = name.name_text()?.value;
        let form = table
            .get("method")
            .map(|item| item.name_text())
            .transpose()?;
        let start = match table.get("start") {
            Some(item) => start(&item)?,
            None => StartKind::default(),
        };
        let own = ["name", "method", "start"];
        let merged = table.over(shared.as_ref(), &own);
        let estimate = EstimateSpec::read(table.with(&merged, &own))?;
        methods.push(MethodSpec {
            name,
            form,
            start,
            estimate,
            span,
        });
    }
    Ok(methods)
}

fn start(item: &Item<'_>) -> Result<StartKind, InputError> {
    let words = ["auto", "nominal", "truth"];
    match item.string()?.value.as_str() {
        "auto" => Ok(StartKind::Auto),
        "nominal" => Ok(StartKind::Nominal),
        "truth" => Ok(StartKind::Truth),
        other => Err(item
            .wrong_type("\"auto\", \"nominal\" or \"truth\"")
            .with_help(suggest(other, &words))),
    }
}
