//! Writing robots: the file that reads back as exactly the same robot.

use std::fmt::Write;

use super::frame_row::{Convention, FrameRow, Key, Part};
use super::joint_kind::JointKind;
use super::table::{GRAVITY, Mass, Reading, RobotFile};

impl RobotFile {
    /// The robot as the text of a robot file, in metres and radians.
    ///
    /// Every number is written with the fewest digits that read back as the same number.
    /// `header_comment` comes first, as a comment; it may have several lines, or be empty.
    #[must_use]
    pub fn to_toml(&self, header_comment: &str) -> String {
        let mut out = String::new();
        for line in header_comment.lines() {
            let line: String = line
                .chars()
                .map(|c| if c.is_control() { ' ' } else { c })
                .collect();
            out.push_str(format!("# {line}").trim_end());
            out.push('\n');
        }
        if !out.is_empty() {
            out.push('\n');
        }
        text(&mut out, "name", &self.name);
        text(&mut out, "convention", self.convention.name());
        out.push_str("units = { angle = \"rad\", length = \"m\" }\n");
        if self.gravity != GRAVITY {
            line(&mut out, "gravity", &list(&self.gravity));
        }
        for input in &self.inputs {
            let _ = write!(out, "\n[inputs.{}]\n", quoted(&input.name));
            if let Some(range) = input.range {
                line(&mut out, "range", &list(&range));
            }
            if let Some(value) = input.value {
                number(&mut out, "value", value);
            }
        }
        out.push_str("\n[base]\n");
        self.frame(&mut out, &self.base, Part::Base, 0);
        for (k, joint) in self.joints.iter().enumerate() {
            out.push_str("\n[[joint]]\n");
            text(&mut out, "name", &joint.name);
            text(&mut out, "type", joint.kind.name());
            self.frame(&mut out, &joint.frame, Part::Joint, k + 1);
            mass(&mut out, joint.mass);
            if joint.kind == JointKind::Fixed {
                continue;
            }
            match &joint.reading {
                Reading::Own => {}
                Reading::Of(name) => text(&mut out, "reading", name),
                Reading::None => text(&mut out, "reading", "none"),
            }
            let usual = joint.reading != Reading::None;
            if !joint.models.is_empty() || joint.gain.is_some() != usual {
                let gain = joint.gain.map(|_| "gain");
                let models = joint.models.iter().map(|model| model.text.as_str());
                let models: Vec<String> = gain.into_iter().chain(models).map(quoted).collect();
                line(&mut out, "model", &format!("[{}]", models.join(", ")));
            }
            if let Some(gain) = joint.gain.filter(|gain| *gain != 1.0) {
                number(&mut out, "gain", gain);
            }
            for model in &joint.models {
                let parameters = model.model.parameters(joint.kind);
                for (parameter, value) in parameters.iter().zip(&model.values) {
                    number(&mut out, &key(&parameter.name), *value);
                }
            }
            if let Some(limits) = joint.limits {
                line(&mut out, "limits", &list(&limits));
            }
            if let Some(value) = joint.value {
                number(&mut out, "value", value);
            }
        }
        out.push_str("\n[tool]\n");
        let last = self.joints.len() + 1;
        self.frame(&mut out, &self.tool, Part::Tool, last);
        mass(&mut out, self.tool_mass);
        out
    }

    fn frame(&self, out: &mut String, row: &FrameRow, part: Part, number_of: usize) {
        if let Some((_, custom)) = self.custom.iter().find(|(n, _)| *n == number_of) {
            text(out, "convention", &custom.name);
            let parameters = custom.model.parameters();
            for (parameter, value) in parameters.iter().zip(&custom.values) {
                number(out, &key(&parameter.name), *value);
            }
            return;
        }
        if let Some(convention) = row.convention {
            text(out, "convention", convention.name());
        }
        let convention = row.convention.unwrap_or(self.convention);
        if convention == Convention::General {
            line(out, "xyz", &list(&row.general.xyz));
            line(out, "rpy", &list(&row.general.rpy));
            if part == Part::Joint {
                line(out, "axis", &list(&row.general.axis));
            }
        }
        for &key in convention.keys(part) {
            let value = row.get(key);
            if !(key == Key::Beta || Key::SMALL.contains(&key)) || value != 0.0 {
                number(out, key.name(), value);
            }
        }
    }
}

fn mass(out: &mut String, mass: Option<Mass>) {
    if let Some(mass) = mass {
        number(out, "mass", mass.mass);
        line(out, "center_of_mass", &list(&mass.center));
    }
}

/// A list of floats.
fn list(numbers: &[f64]) -> String {
    let numbers: Vec<String> = numbers.iter().map(|x| float(*x)).collect();
    format!("[{}]", numbers.join(", "))
}

/// A key, in quotes where it needs them.
fn key(name: &str) -> String {
    let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !name.is_empty() && name.chars().all(bare) {
        name.to_owned()
    } else {
        quoted(name)
    }
}

fn line(out: &mut String, key: &str, value: &str) {
    out.push_str(key);
    out.push_str(" = ");
    out.push_str(value);
    out.push('\n');
}

fn number(out: &mut String, key: &str, value: f64) {
    line(out, key, &float(value));
}

/// A TOML float: Rust's shortest form is one, but for the spelling of NaN.
fn float(value: f64) -> String {
    if value.is_nan() {
        "nan".to_owned()
    } else {
        format!("{value:?}")
    }
}

/// A TOML text in double quotes, escaped.
fn text(out: &mut String, key: &str, value: &str) {
    line(out, key, &quoted(value));
}

/// A text in double quotes, escaped.
fn quoted(value: &str) -> String {
    let mut quoted = String::from("\"");
    for c in value.chars() {
        match c {
            '"' => quoted.push_str("\\\""),
            '\\' => quoted.push_str("\\\\"),
            '\n' => quoted.push_str("\\n"),
            '\t' => quoted.push_str("\\t"),
            c if c.is_control() => {
                // Writing to a String cannot fail.
                let _ = write!(quoted, "\\u{:04X}", u32::from(c));
            }
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use crate::robot::frame_row::{Convention, FrameRow, GeneralFrame};
    use crate::robot::joint_kind::JointKind;
    use crate::robot::table::{JointRow, RobotFile};
    use std::path::PathBuf;

    fn robot(convention: Convention) -> RobotFile {
        let frame = |s: f64| match convention {
            Convention::KhalilKleinfinger => FrameRow {
                alpha: 0.1 * s,
                d: 1.0 / 3.0,
                theta: -1e-17,
                r: 1e21,
                beta: if s > 2.0 { f64::MIN_POSITIVE } else { 0.0 },
                ..FrameRow::default()
            },
            Convention::DenavitHartenberg => FrameRow {
                alpha: -0.0,
                d: 0.1 + 0.2,
                theta: f64::MAX,
                beta: 5e-324,
                a: s.sqrt(),
                ..FrameRow::default()
            },
            Convention::General => FrameRow {
                general: GeneralFrame {
                    xyz: [0.1 + 0.2, -s, 1e-300],
                    rpy: [s.sqrt(), -0.0, 3.0],
                    small: [0.0, 1e-17, s, 0.0, -s / 3.0, 0.1],
                    ..GeneralFrame::default()
                },
                ..FrameRow::default()
            },
        };
        let joint = |name: &str, kind, s| JointRow::new(name, kind, frame(s));
        let base = match convention {
            Convention::KhalilKleinfinger => FrameRow {
                theta: 0.7,
                r: 0.4,
                ..FrameRow::default()
            },
            Convention::DenavitHartenberg => FrameRow {
                theta: 0.7,
                ..FrameRow::default()
            },
            Convention::General => frame(0.5),
        };
        RobotFile {
            path: PathBuf::from("r.toml"),
            base,
            joints: vec![
                JointRow {
                    gain: Some(-1.0),
                    limits: Some([-2.0, 1e-300]),
                    ..joint("q1", JointKind::Revolute, 1.0)
                },
                joint("flange", JointKind::Fixed, 2.0),
                JointRow {
                    value: Some(0.25),
                    ..joint("q3", JointKind::Prismatic, 3.0)
                },
            ],
            tool: frame(4.0),
            ..RobotFile::new("a \"b\" \\ \n\t\u{1}\u{7f}é", convention)
        }
    }

    const ALL: [Convention; 3] = [
        Convention::KhalilKleinfinger,
        Convention::DenavitHartenberg,
        Convention::General,
    ];

    #[test]
    fn write_then_read_is_the_same_robot_to_the_last_bit() {
        for convention in ALL {
            let robot = robot(convention);
            let text = robot.to_toml("Calibrated.\r\nSecond line\u{1}\n\n");
            let again = RobotFile::parse(&text, "r.toml").unwrap();
            assert_eq!(again, robot);
            assert_eq!(again.to_toml("x"), robot.to_toml("x"));
        }
    }

    /// Models of joints, masses, inputs and frames of another convention come back as they were.
    #[test]
    fn models_come_back_to_the_last_bit() {
        let text = r#"
            name = "m"
            convention = "kk"
            gravity = [0, 3.3, -9.2]
            inputs = { tau2 = { range = [-50, 50.5], value = 0.1 }, "t 1" = { value = 3 } }
            tool = { mass = 1.5, center_of_mass = [0, 0, 0.1] }
            joint = [
                { type = "revolute", model = ["gain", "harmonics(2)", "linear(t 1)"], gain = 1.001, cos1 = 0.1, sin2 = 3e-5 },
                { name = "q2", type = "revolute", model = ["harmonics(1)", "compliance(tau2)"], compliance = 1e-6, mass = 17.4 },
                { type = "revolute", reading = "q2", model = ["gain", "gravity(4, 5)"], gravity_4 = 0.25, gain = -1 },
                { type = "prismatic", reading = "none", model = ["coupling(q1)"], coupling_q1 = 0.01 },
                { type = "revolute", convention = "urdf", xyz = [1, 2, 3], rpy = [0.1, 0.2, 0.3], axis = [0, 1, 1], rx = 0.01 },
            ]
        "#;
        let robot = RobotFile::parse(text, "r.toml").unwrap();
        let again = RobotFile::parse(&robot.to_toml(""), "r.toml").unwrap();
        assert_eq!(again, robot);
        assert_eq!(robot.joints[0].models[0].values, [0.1, 0.0, 0.0, 3e-5]);
        assert_eq!(
            (robot.joints[1].gain, robot.joints[2].gain),
            (None, Some(-1.0))
        );
    }

    #[test]
    fn defaults_are_left_out_and_main_values_written() {
        let text = robot(Convention::KhalilKleinfinger).to_toml("");
        assert!(text.starts_with("name = "));
        let base = text.split("[base]").nth(1).unwrap();
        assert!(base.starts_with("\ntheta = 0.7\nr = 0.4\n\n[[joint]]\n"));
        assert_eq!(text.matches("beta").count(), 2);
        assert_eq!(text.matches("gain").count(), 1);
    }

    #[test]
    fn a_robot_that_is_not_finite_is_written_as_toml_and_refused_when_read() {
        let mut robot = robot(Convention::KhalilKleinfinger);
        robot.tool.d = f64::NAN;
        let error = RobotFile::parse(&robot.to_toml(""), "r.toml").unwrap_err();
        assert!(error.message.contains("finite"), "{error}");
    }
}
