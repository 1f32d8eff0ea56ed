//! Writing robots: the file that reads back as exactly the same robot.

use std::fmt::Write;

use super::frame_row::{FrameRow, Key, Part};
use super::table::{JointKind, RobotFile};

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
        out.push_str("\n[base]\n");
        self.frame(&mut out, &self.base, Part::Base);
        for joint in &self.joints {
            out.push_str("\n[[joint]]\n");
            text(&mut out, "name", &joint.name);
            text(&mut out, "type", joint.kind.name());
            self.frame(&mut out, &joint.frame, Part::Joint);
            if joint.kind == JointKind::Fixed {
                continue;
            }
            if joint.gain != 1.0 {
                number(&mut out, "gain", joint.gain);
            }
            if let Some([lower, upper]) = joint.limits {
                let (lower, upper) = (float(lower), float(upper));
                line(&mut out, "limits", &format!("[{lower}, {upper}]"));
            }
            if let Some(value) = joint.value {
                number(&mut out, "value", value);
            }
        }
        out.push_str("\n[tool]\n");
        self.frame(&mut out, &self.tool, Part::Tool);
        out
    }

    fn frame(&self, out: &mut String, row: &FrameRow, part: Part) {
        for &key in self.convention.keys(part) {
            let value = row.get(key);
            if key != Key::Beta || value != 0.0 {
                number(out, key.name(), value);
            }
        }
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
    line(out, key, &quoted);
}

#[cfg(test)]
mod tests {
    use crate::robot::frame_row::{Convention, FrameRow};
    use crate::robot::table::{JointKind, JointRow, RobotFile};
    use std::path::PathBuf;

    fn robot(convention: Convention) -> RobotFile {
        let frame = |s: f64| match convention {
            Convention::KhalilKleinfinger => FrameRow {
                alpha: 0.1 * s,
                d: 1.0 / 3.0,
                theta: -1e-17,
                r: 1e21,
                beta: if s > 2.0 { f64::MIN_POSITIVE } else { 0.0 },
                a: 0.0,
            },
            Convention::DenavitHartenberg => FrameRow {
                alpha: -0.0,
                d: 0.1 + 0.2,
                theta: f64::MAX,
                r: 0.0,
                beta: 5e-324,
                a: s.sqrt(),
            },
        };
        let joint = |name: &str, kind, s| JointRow {
            name: name.to_owned(),
            kind,
            frame: frame(s),
            gain: 1.0,
            limits: None,
            value: None,
        };
        RobotFile {
            path: PathBuf::from("r.toml"),
            name: "a \"b\" \\ \n\t\u{1}\u{7f}é".to_owned(),
            convention,
            base: FrameRow {
                theta: 0.7,
                r: if convention == Convention::KhalilKleinfinger {
                    0.4
                } else {
                    0.0
                },
                ..FrameRow::default()
            },
            joints: vec![
                JointRow {
                    gain: -1.0,
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
        }
    }

    #[test]
    fn write_then_read_is_the_same_robot_to_the_last_bit() {
        for convention in [Convention::KhalilKleinfinger, Convention::DenavitHartenberg] {
            let robot = robot(convention);
            let text = robot.to_toml("Calibrated.\r\nSecond line\u{1}\n\n");
            let again = RobotFile::parse(&text, "r.toml").unwrap();
            assert_eq!(again, robot);
            assert_eq!(again.to_toml("x"), robot.to_toml("x"));
        }
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
