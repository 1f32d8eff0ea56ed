//! Robots: a chain of frames in the Khalil–Kleinfinger or the distal Denavit–Hartenberg convention.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::frame_row::{Convention, FrameRow, Key, Part};
use crate::text::error::{InputError, Source, suggest};
use crate::text::item::Item;
use crate::text::quantity::{Dimension, Units};
use crate::text::section::{Document, Section};
use crate::text::stem;

/// How a joint moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum JointKind {
    /// It turns about z.
    Revolute,
    /// It slides along z.
    Prismatic,
    /// It does not move: a frame and no more.
    Fixed,
}

impl JointKind {
    const NAMES: [&str; 3] = ["revolute", "prismatic", "fixed"];

    /// The name of the kind in robot files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Revolute => "revolute",
            Self::Prismatic => "prismatic",
            Self::Fixed => "fixed",
        }
    }

    /// What the position of the joint measures; nothing for a fixed one.
    #[must_use]
    pub fn dimension(self) -> Dimension {
        match self {
            Self::Revolute => Dimension::Angle,
            Self::Prismatic => Dimension::Length,
            Self::Fixed => Dimension::None,
        }
    }
}

/// A joint with its frame.
#[derive(Debug, Clone, PartialEq)]
pub struct JointRow {
    /// The name, also of the joint's column in the data.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// Its frame, relative to the one before.
    pub frame: FrameRow,
    /// The factor on the joint's reading, not 0.
    pub gain: f64,
    /// The lower and the upper limit of the reading \[rad\] or \[m\].
    pub limits: Option<[f64; 2]>,
    /// The reading where the data have no column for the joint \[rad\] or \[m\].
    pub value: Option<f64>,
}

/// A robot: the frames from its base to its tool, in metres and radians.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotFile {
    /// The file it came from.
    pub path: PathBuf,
    /// The name of the robot; the file's, if it gives none.
    pub name: String,
    /// What the parameters of a frame mean.
    pub convention: Convention,
    /// Frame 0.
    pub base: FrameRow,
    /// Frames 1 to n.
    pub joints: Vec<JointRow>,
    /// Frame n + 1.
    pub tool: FrameRow,
}

impl RobotFile {
    /// Reads a robot file.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or is not a robot file.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, InputError> {
        Self::from_source(&Source::read(path)?)
    }

    /// Reads the text of a robot file; `path` is for messages.
    ///
    /// # Errors
    ///
    /// The text is not a robot file.
    pub fn parse(text: &str, path: impl Into<PathBuf>) -> Result<Self, InputError> {
        Self::from_source(&Source::new(text, path))
    }

    fn from_source(source: &Source) -> Result<Self, InputError> {
        if source.text.trim().is_empty() {
            return Err(source
                .error("this robot file is empty; expected `convention` and [[joint]] tables")
                .with_help("describe the robot, or check that the right file is named"));
        }
        let document = Document::parse(source)?;
        let mut root = document.root().titled("this robot file");
        let name = match root.get("name") {
            Some(item) => item.string()?.value,
            None => stem(&source.path),
        };
        let convention = convention(&root.require(
            "convention",
            "expected \"khalil-kleinfinger\" or \"denavit-hartenberg\"",
        )?)?;
        let units = root.units()?;
        let base = frame_table(&mut root, "base", convention, Part::Base, &units)?;
        let mut joints = Vec::new();
        let mut names = BTreeSet::new();
        for mut table in root.tables("joint")? {
            let moving = joints
                .iter()
                .filter(|j: &&JointRow| j.kind != JointKind::Fixed)
                .count();
            let joint = joint(
                &mut table,
                [joints.len() + 1, moving + 1],
                convention,
                &units,
            )?;
            if !names.insert(joint.name.clone()) {
                let at = table.get("name").map_or(table.span(), |item| item.span());
                let message = format!("a second joint is called `{}`", joint.name);
                return Err(source
                    .error_at(at, message)
                    .with_help("give every joint its own name"));
            }
            table.finish()?;
            joints.push(joint);
        }
        let tool = frame_table(&mut root, "tool", convention, Part::Tool, &units)?;
        root.finish()?;
        if joints.iter().all(|joint| joint.kind == JointKind::Fixed) {
            let found = match joints.len() {
                0 => "this robot has no joints".to_owned(),
                n => format!("all {n} joints of this robot are fixed"),
            };
            return Err(source
                .error(format!("{found}; expected at least one that moves"))
                .with_help("add a [[joint]] with type = \"revolute\" or \"prismatic\""));
        }
        Ok(Self {
            path: source.path.clone(),
            name,
            convention,
            base,
            joints,
            tool,
        })
    }

    /// The number of joints that move.
    #[must_use]
    pub fn moving_joints(&self) -> usize {
        let moving = |joint: &&JointRow| joint.kind != JointKind::Fixed;
        self.joints.iter().filter(moving).count()
    }
}

fn convention(item: &Item<'_>) -> Result<Convention, InputError> {
    let text = item.string()?.value;
    let found = Convention::NAMES.iter().find(|(name, _)| *name == text);
    found.map(|&(_, convention)| convention).ok_or_else(|| {
        let names = Convention::NAMES.map(|(name, _)| name);
        item.wrong_type("\"khalil-kleinfinger\" or \"denavit-hartenberg\"")
            .with_help(suggest(&text, &names))
    })
}

fn frame_table(
    root: &mut Section<'_>,
    key: &str,
    convention: Convention,
    part: Part,
    units: &Units,
) -> Result<FrameRow, InputError> {
    let Some(table) = root.table(key)? else {
        return Ok(FrameRow::default());
    };
    let mut table = table.titled(format!("[{key}]"));
    let row = frame(&mut table, convention, part, units)?;
    table.finish()?;
    Ok(row)
}

/// The parameters of a frame; one that only another convention or frame has is explained.
fn frame(
    table: &mut Section<'_>,
    convention: Convention,
    part: Part,
    units: &Units,
) -> Result<FrameRow, InputError> {
    let keys = convention.keys(part);
    let mut row = FrameRow::default();
    for &key in keys {
        if let Some(item) = table.get(key.name()) {
            *row.get_mut(key) = item.in_units(key.dimension(), units)?;
        }
    }
    for key in Key::ALL.into_iter().filter(|key| !keys.contains(key)) {
        let Some(item) = table.peek(key.name()) else {
            continue;
        };
        let names: Vec<&str> = keys.iter().map(|key| key.name()).collect();
        let message = format!(
            "{} has no such parameter in the {} convention; it has {}",
            table.title(),
            convention.name(),
            names.join(", ")
        );
        let help = match (convention, key) {
            (Convention::KhalilKleinfinger, Key::A) => "the distance along x is called `d` here",
            (Convention::DenavitHartenberg, Key::R) => "the distance along z is called `d` here",
            _ => "remove it: the frames next to it can express the same",
        };
        return Err(item.error(message).with_help(help));
    }
    Ok(row)
}

fn joint(
    table: &mut Section<'_>,
    [number, moving]: [usize; 2],
    convention: Convention,
    units: &Units,
) -> Result<JointRow, InputError> {
    let name = table.get("name");
    let kind = joint_kind(&table.require("type", "expected revolute, prismatic or fixed")?)?;
    // Data count the joints that move: `q2` is the second of these.
    let name = match name {
        Some(item) => item.name_text()?.value,
        None if kind == JointKind::Fixed => format!("fixed{number}"),
        None => format!("q{moving}"),
    };
    let mut frame = frame(table, convention, Part::Joint, units)?;
    if kind == JointKind::Fixed {
        for key in ["gain", "limits"] {
            if let Some(item) = table.peek(key) {
                let error = item.error("a fixed joint does not move and has none");
                return Err(error.with_help("remove it, or change the `type` of the joint"));
            }
        }
        // A joint that is parked for good: where it is parked is part of its frame.
        if let Some(item) = table.get("value") {
            let quantity = item.quantity()?.value;
            match (quantity.dimension, convention) {
                (Some(Dimension::Angle), _) => frame.theta += quantity.value,
                (Some(_), Convention::KhalilKleinfinger) => frame.r += quantity.value,
                (Some(_), Convention::DenavitHartenberg) => frame.d += quantity.value,
                (None, _) if quantity.value == 0.0 => {}
                (None, _) => {
                    let error = item.error("a fixed joint may turn or slide; expected a unit");
                    return Err(
                        error.with_help("write where it is parked like \"20 deg\" or \"0.3 m\"")
                    );
                }
            }
        }
    }
    let gain = match table.get("gain") {
        Some(item) => match item.number()?.value {
            0.0 => {
                let error = item.error("found 0; expected a factor that is not 0");
                return Err(error.with_help("use type = \"fixed\" for a joint that does not move"));
            }
            gain => gain,
        },
        None => 1.0,
    };
    let limits = match table.get("limits") {
        Some(item) => Some(limits(&item, kind.dimension(), units)?),
        None => None,
    };
    let value = match table.get("value") {
        _ if kind == JointKind::Fixed => None,
        Some(item) => Some(item.in_units(kind.dimension(), units)?),
        None => None,
    };
    Ok(JointRow {
        name,
        kind,
        frame,
        gain,
        limits,
        value,
    })
}

fn joint_kind(item: &Item<'_>) -> Result<JointKind, InputError> {
    let text = item.string()?.value;
    match text.as_str() {
        "revolute" => Ok(JointKind::Revolute),
        "prismatic" => Ok(JointKind::Prismatic),
        "fixed" => Ok(JointKind::Fixed),
        _ => Err(item
            .wrong_type("\"revolute\", \"prismatic\" or \"fixed\"")
            .with_help(suggest(&text, &JointKind::NAMES))),
    }
}

fn limits(item: &Item<'_>, dimension: Dimension, units: &Units) -> Result<[f64; 2], InputError> {
    let [lower, upper] = item.list_of("[lower, upper]")?;
    let limits = [
        lower.in_units(dimension, units)?,
        upper.in_units(dimension, units)?,
    ];
    if limits[0] < limits[1] {
        return Ok(limits);
    }
    Err(item
        .error("the lower limit is not below the upper one; expected [lower, upper]")
        .with_help("swap the limits, or leave them out"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    const PUMA: &str = r#"
name = "PUMA 560"
convention = "khalil-kleinfinger"
units = { angle = "deg", length = "m" }

[base]
theta = 17.0
r = "400 mm"

[[joint]]
name = "waist"
type = "revolute"
alpha = 90
d = 0.15
theta = "0.1 rad"
limits = [-180.0, "90 deg"]

[[joint]]
type = "prismatic"
gain = -1
value = "5 cm"

[tool]
alpha = 17.0
"#;

    fn error(text: &str) -> InputError {
        RobotFile::parse(text, "r.toml").unwrap_err()
    }

    #[test]
    fn a_robot_is_read_in_metres_and_radians() {
        let robot = RobotFile::parse(PUMA, "dir/r.toml").unwrap();
        assert_eq!(robot.name, "PUMA 560");
        assert_eq!(robot.base.theta, 17f64.to_radians());
        assert_eq!(robot.base.r, 0.4);
        let [waist, slide] = robot.joints.as_slice() else {
            panic!("two joints");
        };
        assert_eq!(waist.name, "waist");
        assert_eq!(waist.frame.alpha, PI / 2.0);
        assert_eq!(waist.frame.theta, 0.1);
        assert_eq!(waist.limits, Some([-PI, PI / 2.0]));
        assert_eq!(waist.gain, 1.0);
        assert_eq!(slide.name, "q2");
        assert_eq!(slide.value, Some(0.05));
        assert_eq!(robot.moving_joints(), 2);
    }

    #[test]
    fn the_distal_convention_has_its_own_parameters() {
        let text =
            "convention = 'dh'\n[base]\na = 1\nalpha = 2\n[[joint]]\ntype = 'revolute'\nd = 3\n";
        let robot = RobotFile::parse(text, "arm.toml").unwrap();
        assert_eq!(robot.convention, Convention::DenavitHartenberg);
        assert_eq!(robot.name, "arm");
        assert_eq!((robot.base.a, robot.base.alpha), (1.0, 2.0));
        assert_eq!(robot.joints[0].frame.d, 3.0);
        let wrong = error(&text.replace("d = 3", "r = 3"));
        assert_eq!(wrong.line, Some(7));
        assert!(wrong.message.contains("theta, d, a, alpha, beta"));
    }

    #[test]
    fn byte_order_marks_and_crlf_do_not_matter() {
        let text = format!("\u{feff}{}", PUMA.replace('\n', "\r\n"));
        let robot = RobotFile::parse(&text, "r.toml").unwrap();
        assert_eq!(robot, RobotFile::parse(PUMA, "r.toml").unwrap());
        let wrong = error(&text.replace("d = 0.15", "d = 'x'"));
        assert_eq!(wrong.line, Some(14));
    }

    #[test]
    fn mistakes_are_located_and_explained() {
        for (from, to, line, words) in [
            ("khalil-kleinfinger", "khalil", 3, "convention"),
            ("convention", "conv", 0, "no `convention`"),
            ("\"deg\"", "\"degree\"", 4, "not a unit"),
            ("theta = 17.0", "alpha = 17.0", 7, "theta, r"),
            (
                "\"400 mm\"",
                "\"4 deg\"",
                8,
                "found an angle; expected a length",
            ),
            ("\"revolute\"", "\"revolut\"", 12, "expected \"revolute\""),
            ("d = 0.15", "d = nan", 14, "finite"),
            ("d = 0.15", "a = 0.15", 14, "khalil-kleinfinger"),
            ("d = 0.15", "dd = 0.15", 14, "unknown key `dd`"),
            ("[-180.0,", "[270,", 16, "lower"),
            ("[-180.0,", "[1, 2,", 16, "list of 3"),
            ("gain = -1", "gain = 0", 20, "not 0"),
            ("\"prismatic\"", "\"fixed\"", 20, "fixed"),
            ("\"waist\"", "\"q2\"", 18, "second joint"),
            ("[tool]", "[tol]", 23, "unknown key `tol`"),
            ("[[joint]]", "[joint]", 18, "`joint` is there twice"),
        ] {
            assert!(PUMA.contains(from), "{from}");
            let error = error(&PUMA.replacen(from, to, 1));
            assert!(error.message.contains(words), "{to}: {error}");
            if line > 0 {
                assert_eq!(error.line, Some(line), "{to}: {error}");
            }
        }
    }

    #[test]
    fn a_robot_must_move() {
        assert!(error("").message.contains("empty"));
        assert!(error(" \n# nothing\n").message.contains("no `convention`"));
        assert!(error("convention = 'kk'").message.contains("no joints"));
        let fixed = "convention = 'kk'\n[[joint]]\ntype = 'fixed'\n";
        assert!(error(fixed).message.contains("all 1 joints"));
    }
}
