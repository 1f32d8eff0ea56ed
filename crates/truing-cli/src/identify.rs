//! `truing identify`.

use crate::args::Identify;
use crate::failure::Failure;
use crate::show_identify;
use crate::streams::{Ending, Streams};
use std::path::Path;
use std::sync::Arc;
use truing::manifold::Plane;
use truing_robot::file::CalibrationFile;
use truing_robot::identify::{Asked, Identification, RobotQuestion};
use truing_robot::kinds::KnownPlaneTouches;
use truing_robot::load::load_with;
use truing_robot::measurement::Kind;
use truing_robot::robot::RobotFile;
use truing_robot::text::{Document, InputError, Source, nearest};
use truing_robot::{Registry, Robot};

/// Answers what a calibration file, or kinds of measurements of a robot, identify.
pub fn run(arguments: &Identify, streams: &Streams) -> Result<Ending, Failure> {
    let answer = match file_kind(&arguments.file)? {
        FileKind::Calibration => calibration(arguments, &streams.registry)?,
        FileKind::Robot => robot(arguments, &streams.registry)?,
    };
    streams.say(&show_identify::answer(&answer));
    if streams.json {
        let json = serde_json::to_string_pretty(&answer).map_err(|e| {
            Failure::new(
                format!("cannot write the answer as JSON: {e}"),
                "report this with the file",
            )
        })?;
        streams.print(&(json + "\n"));
    }
    Ok(Ending::Good)
}

enum FileKind {
    Calibration,
    Robot,
}

/// What a file is, by its keys.
fn file_kind(path: &Path) -> Result<FileKind, InputError> {
    let source = Source::read(path)?;
    let document = Document::parse(&source)?;
    let root = document.root();
    let has = |keys: &[&str]| keys.iter().any(|key| root.peek(key).is_some());
    if has(&["case", "method"]) {
        return Err(source
            .error("this is a study file; expected a calibration or a robot")
            .with_help("name a calibration file, or the robot file and what would be measured"));
    }
    if has(&["errors", "seed"]) {
        return Err(source
            .error("this is a simulation file; expected a calibration or a robot")
            .with_help(
                "name the calibration that `truing simulate` wrote beside the data, or the robot file",
            ));
    }
    if has(&["robot", "robots", "constraint", "estimate"]) {
        return Ok(FileKind::Calibration);
    }
    if has(&["joint", "convention", "base", "tool"]) {
        return Ok(FileKind::Robot);
    }
    Err(source
        .error("this is neither a calibration ([robot], [[constraint]]) nor a robot ([[joint]])")
        .with_help("name a calibration file or a robot file"))
}

fn calibration(arguments: &Identify, registry: &Registry) -> Result<Identification, Failure> {
    let given = [
        ("--kind", !arguments.kinds.is_empty(), "constraints"),
        ("--plane", !arguments.planes.is_empty(), "constraints"),
        ("--planes", arguments.random_planes.is_some(), "constraints"),
        ("--frame", arguments.frame.is_some(), "constraints"),
        ("--target", arguments.target.is_some(), "constraints"),
        (
            "--parameters",
            !arguments.parameters.is_empty(),
            "[estimate]",
        ),
        ("--fixed", !arguments.fixed.is_empty(), "[estimate]"),
        (
            "--preference",
            !arguments.preference.is_empty(),
            "[estimate]",
        ),
    ];
    if let Some((flag, _, place)) = given.iter().find(|(_, given, _)| *given) {
        return Err(Failure::new(
            format!("{flag} is for a robot file; this is a calibration, whose {place} say it"),
            format!("change it in the calibration file, or ask about the robot file with {flag}"),
        )
        .about(&arguments.file));
    }
    let calibration = load_with(
        &CalibrationFile::read_with(&arguments.file, registry)?,
        registry,
    )?;
    let answer = calibration.identify(arguments.seed);
    answer.map_err(|e| Failure::from(e).about(&arguments.file))
}

fn robot(arguments: &Identify, registry: &Registry) -> Result<Identification, Failure> {
    let robot = Robot::new(&RobotFile::read_with(&arguments.file, registry.models())?);
    let mut question = RobotQuestion::new(robot, asked(arguments, registry)?);
    question.parameters.clone_from(&arguments.parameters);
    question.fixed.clone_from(&arguments.fixed);
    question.preference.clone_from(&arguments.preference);
    question.frame.clone_from(&arguments.frame);
    question.target.clone_from(&arguments.target);
    question.seed = arguments.seed.unwrap_or(question.seed);
    let answer = question.question().and_then(|question| question.answer());
    answer.map_err(|e| Failure::from(e).about(&arguments.file))
}

/// The kinds whose planes the arguments are about.
const KNOWN: &str = "known-plane";
const UNKNOWN: &str = "unknown-plane";

/// What would be measured, in the order asked: given planes where their kind is, or last.
fn asked(arguments: &Identify, registry: &Registry) -> Result<Vec<Asked>, Failure> {
    let mut names: Vec<&str> = Vec::new();
    for name in &arguments.kinds {
        let name = kind(name, registry)?.name();
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let mut given: Vec<Asked> = Vec::new();
    for text in &arguments.planes {
        given.push(Asked::given(KnownPlaneTouches {
            plane: plane(text)?,
            ..KnownPlaneTouches::default()
        }));
    }
    if !given.is_empty() && !names.contains(&KNOWN) {
        names.push(KNOWN);
    }
    let random = usize::from(arguments.random_planes.unwrap_or(1));
    let known_only = names.contains(&KNOWN) && given.is_empty();
    let unknown = names.contains(&UNKNOWN);
    if arguments.random_planes.is_some() && !unknown && !known_only {
        names.push(UNKNOWN);
    }
    if names.is_empty() {
        return Err(Failure::new(
            "it is not said what would be measured",
            format!(
                "add for instance --kind position; the kinds are {}",
                all_names(registry).join(", ")
            ),
        )
        .about(&arguments.file));
    }
    let mut asked = Vec::new();
    for name in names {
        let count = match name {
            UNKNOWN => random,
            KNOWN if unknown => 1,
            KNOWN => random,
            _ => 1,
        };
        if name == KNOWN && !given.is_empty() {
            asked.append(&mut given);
            continue;
        }
        let kind = kind(name, registry)?;
        asked.extend(std::iter::repeat_n(Asked::kind(kind.clone()), count));
    }
    Ok(asked)
}

fn all_names(registry: &Registry) -> Vec<&'static str> {
    registry.kinds().iter().map(|kind| kind.name()).collect()
}

fn kind<'r>(name: &str, registry: &'r Registry) -> Result<&'r Arc<dyn Kind>, Failure> {
    registry.kind(name).ok_or_else(|| {
        let names = all_names(registry);
        Failure::new(
            format!("--kind: there is no kind `{name}`"),
            match nearest(name, names.iter().copied()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("the kinds are {}", names.join(", ")),
            },
        )
    })
}

/// `NX,NY,NZ,D`: the points p with n·p = d; the normal need not be of length one.
fn plane(text: &str) -> Result<Plane<f64>, Failure> {
    let refuse = |what: &str| {
        Failure::new(
            format!("--plane: found `{text}`; expected {what}"),
            "write nx,ny,nz,d for the plane nx·x + ny·y + nz·z = d in metres, like --plane 0,0,1,0.4",
        )
    };
    let numbers: Vec<f64> = text
        .split(',')
        .map(|part| part.trim().parse())
        .collect::<Result<_, _>>()
        .map_err(|_| refuse("four numbers"))?;
    let [x, y, z, distance] = numbers[..] else {
        return Err(refuse("four numbers"));
    };
    let length = x.hypot(y).hypot(z);
    let [x, y, z, distance] = [x, y, z, distance].map(|number| number / length);
    if [x, y, z, distance].iter().any(|number| !number.is_finite()) {
        return Err(refuse("finite numbers and a normal that is not zero"));
    }
    Ok(Plane {
        normal: [x, y, z].into(),
        distance,
    })
}
