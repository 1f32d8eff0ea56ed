//! The robots that files name.

use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::text::error::{one_of, suggest};
use crate::text::{InputError, Section, Source, Spanned};

/// A robot of a calibration, and the file that describes it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RobotRef {
    /// The name, empty for a single `[robot]`.
    pub name: String,
    /// The robot file; whether it exists is not checked here.
    pub file: PathBuf,
    /// The place of the file's name, in bytes.
    pub span: Range<usize>,
}

/// `[robot]`, or `[robots.left]` and others.
pub(super) fn robots(root: &mut Section<'_>, folder: &Path) -> Result<Vec<RobotRef>, InputError> {
    let one = root.get("robot");
    let several = root.get("robots");
    match (one, several) {
        (Some(_), Some(several)) => Err(several
            .error("there is also [robot]; expected one of the two")
            .with_help("write [robot] for one robot, [robots.NAME] for several")),
        (Some(one), None) => {
            let table = one.table()?.titled("[robot]");
            Ok(vec![robot(table, String::new(), folder)?])
        }
        (None, Some(several)) => {
            let mut robots = Vec::new();
            for item in several.table()?.entries() {
                let name = item.name().to_owned();
                let plain = |c: char| c.is_alphanumeric() || c == '_' || c == '-';
                if name.is_empty() || !name.chars().all(plain) {
                    return Err(item
                        .error("this name cannot be put before a parameter's")
                        .with_help("use letters, digits, `_` and `-`"));
                }
                let table = item.table()?.titled(format!("[robots.{name}]"));
                robots.push(robot(table, name, folder)?);
            }
            if robots.is_empty() {
                return Err(several
                    .error("found no robots; expected at least one")
                    .with_help("add a table [robots.left] with `file = …`"));
            }
            Ok(robots)
        }
        (None, None) => Err(root
            .error("there is no [robot]; expected the file that describes the robot")
            .with_help("add [robot] with file = \"robot.toml\"")),
    }
}

fn robot(mut table: Section<'_>, name: String, folder: &Path) -> Result<RobotRef, InputError> {
    let file = table.require("file", "expected the name of a robot file")?;
    let file = file.name_text()?;
    table.finish()?;
    Ok(RobotRef {
        name,
        file: folder.join(file.value),
        span: file.span,
    })
}

/// Checks the robots of a constraint, and names both where there are just two to measure between.
pub(super) fn name_robots(
    one: &mut Option<Spanned<String>>,
    two: &mut Option<[Spanned<String>; 2]>,
    tools: usize,
    span: Range<usize>,
    source: &Source,
    robots: &[RobotRef],
) -> Result<(), InputError> {
    let names: Vec<&str> = robots.iter().map(|robot| robot.name.as_str()).collect();
    let single = names == [""];
    for name in one.iter().chain(two.iter().flatten()) {
        if single {
            return Err(source
                .error_at(
                    name.span.clone(),
                    format!(
                        "there is one [robot], without a name; found `{}`",
                        name.value
                    ),
                )
                .with_help("remove the key, or name the robots in [robots.NAME]"));
        }
        if !names.contains(&name.value.as_str()) {
            let message = format!(
                "there is no robot `{}`; expected {}",
                name.value,
                one_of(&names)
            );
            return Err(source
                .error_at(name.span.clone(), message)
                .with_help(suggest(&name.value, &names)));
        }
    }
    if names.len() < 2 || one.is_some() || two.is_some() {
        return Ok(());
    }
    if let (2, [first, second]) = (tools, names.as_slice()) {
        let name = |name: &str| Spanned::new(name.to_owned(), span.clone());
        *two = Some([name(first), name(second)]);
        return Ok(());
    }
    let message = format!(
        "this does not say which robot it is about: {}",
        one_of(&names)
    );
    Err(source.error_at(span, message).with_help(match tools {
        2 => "add robots = [\"…\", \"…\"], or robot = \"…\" for two postures",
        _ => "add robot = \"…\"",
    }))
}
