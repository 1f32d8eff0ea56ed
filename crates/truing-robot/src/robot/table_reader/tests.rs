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
    assert_eq!(waist.gain, Some(1.0));
    assert_eq!(slide.name, "q2");
    assert_eq!(slide.value, Some(0.05));
    assert_eq!(robot.moving_joints(), 2);
}

#[test]
fn the_distal_convention_has_its_own_parameters() {
    let text = "convention = 'dh'\n[base]\na = 1\nalpha = 2\n[[joint]]\ntype = 'revolute'\nd = 3\n";
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
fn models_name_what_is_there() {
    let text = |model: &str| {
        format!(
            "convention = 'kk'\n[[joint]]\nname = 'a'\ntype = 'revolute'\n[[joint]]\nname = 'b'\ntype = 'revolute'\n\
             model = ['gain', {model}]\n"
        )
    };
    for (model, words) in [
        (
            "'harmonics(1)', 'harmonics(2)'",
            "`cos1`, which the joint has already",
        ),
        (
            "'gravity(1, 3, 1)'",
            "`gravity_1`, which the joint has already",
        ),
        ("'linear(a)'", "`a` is what a joint reads"),
        ("'backlash(a)'", "`a` is what a joint reads"),
        ("'coupling(c)'", "no joint with a reading"),
        ("'compliance'", "nothing has a mass"),
        ("'gravity(4)'", "no frame 4"),
        ("'harmonics'", "expected it like `harmonics(2)`"),
        ("'harmonic(2)'", "expected `gain`"),
    ] {
        let error = error(&text(model));
        assert!(error.message.contains(words), "{model}: {error}");
        assert!(error.help.is_some(), "{model}: {error}");
    }
    for model in [
        "'harmonics(2)'",
        "'linear(t)'",
        "'coupling(a)'",
        "'gravity(3)'",
    ] {
        assert!(RobotFile::parse(&text(model), "r.toml").is_ok(), "{model}");
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
