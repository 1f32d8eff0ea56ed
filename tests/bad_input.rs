//! Whatever is wrong with the files a user gives, one message says where it is, what was found, what
//! was expected and what to do; the exit status is 2 and nothing is written.

#[path = "support/cell.rs"]
mod cell;

use cell::{Cell, Reading, cells, positions, table};

/// What the program said of bad input.
struct Refusal {
    text: String,
    error: serde_json::Value,
}

/// Calibrates into the folder `out`, which must be refused and leave the cell as it was; the words
/// are the same with `--json`, and on standard output they are JSON.
#[track_caller]
fn refused(cell: &Cell) -> Refusal {
    refused_with(cell, &["calibrate", "calibration.toml", "--output", "out"])
}

#[track_caller]
fn refused_with(cell: &Cell, arguments: &[&str]) -> Refusal {
    let before = cell.files();
    let plain = cell.run(arguments);
    println!("{}", plain.stderr);
    assert_eq!(plain.status, 2, "{}", plain.stderr);
    assert_eq!(plain.stdout, "");
    let json = cell.run(&[arguments, &["--json"]].concat());
    assert_eq!(json.status, 2);
    assert_eq!(json.stderr, plain.stderr);
    assert_eq!(cell.files(), before, "nothing is written");

    let text = plain.stderr;
    let error = json.json()["error"].clone();
    let message = error["message"].as_str().unwrap();
    assert!(!message.contains('\n'), "one line: {message}");
    assert!(text.contains(message), "whole, on one line: {text}");
    assert!(!error["help"].as_str().unwrap().is_empty(), "{text}");
    assert!(text.contains(error["help"].as_str().unwrap()), "{text}");
    for internal in ["\u{1b}", "Os {", "Error", "Some(", "panicked", "NaN", "::"] {
        assert!(!text.contains(internal), "`{internal}` in {text}");
    }
    if let Some(file) = error["file"].as_str() {
        let place = match error["line"].as_u64() {
            Some(line) => format!("{file}:{line}:"),
            None => format!("{file}:"),
        };
        assert_eq!(text.matches(&place).count(), 1, "`{place}` once: {text}");
    }
    Refusal { text, error }
}

impl Refusal {
    /// The place is this file and line; a file as a whole has line 0.
    #[track_caller]
    fn at(self, file: &str, line: u64) -> Self {
        assert_eq!(self.error["file"], file, "{}", self.text);
        let found = self.error["line"].as_u64().unwrap_or(0);
        assert_eq!(found, line, "{}", self.text);
        self
    }

    /// The message has these words.
    #[track_caller]
    fn says(self, words: &[&str]) -> Self {
        let message = self.error["message"].as_str().unwrap();
        for word in words {
            assert!(message.contains(word), "`{word}` is not in {}", self.text);
        }
        self
    }

    /// The advice has these words.
    #[track_caller]
    fn advises(self, words: &str) -> Self {
        let help = self.error["help"].as_str().unwrap();
        assert!(help.contains(words), "`{words}` is not in {}", self.text);
        self
    }

    /// The text shows this line of the file.
    #[track_caller]
    fn shows(self, line: &str) -> Self {
        assert!(self.text.contains(line), "`{line}` is not in {}", self.text);
        self
    }
}

/// A cell with another line in place of one of `calibration.toml`.
#[track_caller]
fn with(from: &str, to: &str) -> Cell {
    let cell = Cell::new();
    cell.edit("calibration.toml", from, to);
    cell
}

/// A cell with more lines at the end of `calibration.toml`, which belong to its constraint.
fn with_key(lines: &str) -> Cell {
    let cell = Cell::new();
    cell.append("calibration.toml", lines);
    cell
}

/// A cell with an `[estimate]` table, on lines 4 and following.
fn with_estimate(lines: &str) -> Cell {
    with(
        "[[constraint]]",
        &format!("[estimate]\n{lines}\n\n[[constraint]]"),
    )
}

/// A cell with one cell of the data replaced: line counted from 1, column from 0.
fn with_cell(line: usize, column: usize, content: &str) -> Cell {
    let cell = Cell::new();
    let text = cell.read("tracker.csv");
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let mut cells: Vec<&str> = lines[line - 1].split(',').collect();
    cells[column] = content;
    lines[line - 1] = cells.join(",");
    cell.write("tracker.csv", lines.join("\n"));
    cell
}

// Files.

#[test]
fn a_missing_calibration_file_is_named() {
    refused(&Cell::empty())
        .at("calibration.toml", 0)
        .says(&["this file does not exist"])
        .advises("check the path");
}

#[test]
fn a_missing_robot_file_is_shown_where_it_is_named() {
    let cell = with("robot.toml", "arms/puma.toml");
    refused(&cell)
        .at("calibration.toml", 2)
        .says(&["arms/puma.toml", "does not exist"])
        .shows("file = \"arms/puma.toml\"")
        .advises("relative to that file's folder");
}

#[test]
fn a_missing_data_file_is_shown_where_it_is_named() {
    refused(&with("tracker.csv", "trakcer.csv"))
        .at("calibration.toml", 6)
        .says(&["trakcer.csv", "does not exist"])
        .shows("data = \"trakcer.csv\"")
        .advises("check the path");
}

#[test]
fn a_folder_in_place_of_a_file_is_said() {
    let cell = with("tracker.csv", ".");
    refused(&cell)
        .at("calibration.toml", 6)
        .says(&["is a folder; expected a file"]);
    refused_with(&cell, &["calibrate", ".", "--output", "out"])
        .at(".", 0)
        .says(&["is a folder; expected a file"]);
}

#[test]
fn an_empty_file_is_said() {
    for (file, words) in [
        ("calibration.toml", "expected [robot] and [[constraint]]"),
        ("robot.toml", "expected `convention` and [[joint]]"),
        ("tracker.csv", "expected a header and rows"),
    ] {
        for content in ["", "\n\n", "\u{feff}"] {
            let cell = Cell::new();
            cell.write(file, content);
            refused(&cell).at(file, 0).says(&["is empty", words]);
        }
    }
}

#[test]
fn text_that_is_not_utf_8_is_said_with_its_line() {
    let cell = with_cell(3, 0, "1.0");
    let mut bytes = cell.read("tracker.csv").into_bytes();
    let second = bytes.iter().position(|byte| *byte == b'\n').unwrap() + 1;
    bytes[second] = 0xe9;
    cell.write("tracker.csv", &bytes);
    refused(&cell)
        .at("tracker.csv", 2)
        .says(&["0xe9", "expected UTF-8"])
        .advises("save the file as UTF-8");

    let cell = Cell::new();
    let utf16 = cell
        .read("tracker.csv")
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect();
    cell.write("tracker.csv", [vec![0xff, 0xfe], utf16].concat());
    refused(&cell)
        .at("tracker.csv", 1)
        .says(&["found UTF-16 text"]);
}

// TOML.

#[test]
fn bad_toml_is_shown_with_its_line() {
    refused(&with("data = \"tracker.csv\"", "data = tracker.csv"))
        .at("calibration.toml", 6)
        .says(&["`tracker.csv`", "text in quotes"])
        .shows("data = tracker.csv")
        .advises("\"tracker.csv\"");
    refused(&with("[robot]", "[robot"))
        .at("calibration.toml", 1)
        .says(&["not TOML"])
        .shows("[robot");
    refused(&with_key("name = "))
        .at("calibration.toml", 8)
        .says(&["not TOML"])
        .shows("name =");
    let cell = Cell::new();
    cell.edit("robot.toml", "d = 0.15\n", "d = 0,15\n");
    refused(&cell)
        .at("robot.toml", 13)
        .says(&["not TOML"])
        .shows("d = 0,15")
        .advises("decimal point");
}

#[test]
fn an_unknown_key_is_shown_with_the_nearest_known_one() {
    refused(&with("sigma", "sgima"))
        .at("calibration.toml", 7)
        .says(&["unknown key `sgima` in [[constraint]]"])
        .shows("sgima = ")
        .advises("did you mean `sigma`?");
    refused(&with("[robot]", "[robot]\nspeed = 1"))
        .at("calibration.toml", 2)
        .says(&["unknown key `speed` in [robot]"])
        .advises("`file`");
    let cell = Cell::new();
    cell.edit("robot.toml", "limits", "limit");
    refused(&cell)
        .at("robot.toml", 16)
        .says(&["unknown key `limit`"])
        .advises("did you mean `limits`?");
}

#[test]
fn a_missing_key_is_said_with_what_belongs_there() {
    refused(&with("kind = \"position\"\n", ""))
        .at("calibration.toml", 4)
        .says(&["[[constraint]] has no `kind`", "`position`"])
        .advises("add a line `kind = …`");
    refused(&with("file = \"robot.toml\"", ""))
        .at("calibration.toml", 1)
        .says(&["[robot] has no `file`"]);
    refused(&with("[robot]\nfile = \"robot.toml\"\n", ""))
        .at("calibration.toml", 0)
        .says(&["there is no [robot]"])
        .advises("add [robot]");
}

#[test]
fn an_unknown_kind_is_said_with_the_known_ones() {
    refused(&with("\"position\"", "\"unknow-plane\""))
        .at("calibration.toml", 5)
        .says(&[
            "unknow-plane",
            "`known-plane`",
            "`unknown-plane`",
            "`distance`",
        ])
        .shows("kind = \"unknow-plane\"")
        .advises("did you mean");
}

#[test]
fn a_key_of_another_kind_is_said_to_be_so() {
    refused(&with_key(
        "plane = { normal = [0, 0, 1], distance = 0.4 }\n",
    ))
    .at("calibration.toml", 8)
    .says(&["`plane`", "only `known-plane` takes this key"])
    .advises("change the `kind`");
}

#[test]
fn a_plane_without_a_direction_is_refused() {
    let cell = with_key("plane = { normal = [0, 0, 0], distance = 0.4 }\n");
    cell.edit("calibration.toml", "\"position\"", "\"known-plane\"");
    refused(&cell)
        .at("calibration.toml", 8)
        .says(&["normal that is not zero"])
        .advises("[0, 0, 1]");
    let cell = with_key("plane = { a = 0, b = 0, c = 0 }\n");
    cell.edit("calibration.toml", "\"position\"", "\"known-plane\"");
    refused(&cell).at("calibration.toml", 8).says(&["not zero"]);
}

#[test]
fn a_standard_deviation_that_is_not_positive_is_refused() {
    for sigma in ["0", "-1e-4", "\"0 mm\"", "\"-0.1 mm\""] {
        refused(&with("\"0.05 mm\"", sigma))
            .at("calibration.toml", 7)
            .says(&["`sigma`", "expected more than 0"])
            .advises("positive");
    }
    refused(&with("\"0.05 mm\"", "nan"))
        .at("calibration.toml", 7)
        .says(&["expected a finite number"]);
    refused(&with("\"0.05 mm\"", "\"0.05 deg\""))
        .at("calibration.toml", 7)
        .says(&["found an angle; expected a length"]);
}

#[test]
fn a_guess_needs_what_it_is_a_guess_of() {
    refused(&with_key("target_guess = [0, 0, 0.1]\n"))
        .at("calibration.toml", 8)
        .says(&["there is no `target`"])
        .advises("target = ");
    refused(&with_key("frame_guess = [0, 0, 0, 1, 0, 0, 0]\n"))
        .at("calibration.toml", 8)
        .says(&["there is no `frame`"])
        .advises("frame = ");
}

#[test]
fn a_guess_must_be_a_point_or_a_pose() {
    refused(&with_key("target = \"s1\"\ntarget_guess = [0, 0]\n"))
        .at("calibration.toml", 9)
        .says(&["list of 2", "[x, y, z]"]);
    refused(&with_key(
        "target = \"s1\"\ntarget_guess = [0, 0, \"2 deg\"]\n",
    ))
    .at("calibration.toml", 9)
    .says(&["found an angle; expected a length"]);
    refused(&with_key(
        "frame = \"f\"\nframe_guess = [0, 0, 0, 0, 0, 0, 2]\n",
    ))
    .at("calibration.toml", 9)
    .says(&["length 2", "expected 1"])
    .advises("qw, qx, qy, qz");
}

#[test]
fn two_guesses_of_one_frame_must_agree() {
    let cell = with_key("frame = \"f\"\nframe_guess = [0, 0, 0, 1, 0, 0, 0]\n");
    let second = "[[constraint]]\nkind = \"position\"\ndata = \"tracker.csv\"\n";
    cell.append(
        "calibration.toml",
        &format!("\n{second}frame = \"f\"\nframe_guess = [0, 0, 1, 1, 0, 0, 0]\n"),
    );
    refused(&cell)
        .at("calibration.toml", 15)
        .says(&["the frame `f`", "`tracker-2` than in `tracker`"])
        .advises("once");
}

// Robots.

#[test]
fn a_robot_without_a_moving_joint_is_refused() {
    let cell = Cell::new();
    cell.write("robot.toml", "convention = \"khalil-kleinfinger\"\n");
    refused(&cell)
        .at("robot.toml", 0)
        .says(&["no joints", "at least one that moves"])
        .advises("[[joint]]");
    let cell = Cell::new();
    let fixed = cell.read("robot.toml").replace("revolute", "fixed");
    cell.write(
        "robot.toml",
        fixed.replace("limits = [-160.0, 160.0]\n", ""),
    );
    refused(&cell)
        .at("robot.toml", 0)
        .says(&["all 6 joints of this robot are fixed"]);
}

#[test]
fn two_robots_or_joints_of_one_name_are_refused() {
    let robots = "[robots.left]\nfile = \"robot.toml\"\n[robots.left]\nfile = \"robot.toml\"\n";
    refused(&with("[robot]\nfile = \"robot.toml\"\n", robots))
        .at("calibration.toml", 3)
        .says(&["twice", "left"])
        .shows("[robots.left]");
    let cell = Cell::new();
    cell.edit("robot.toml", "[[joint]]", "[joint]");
    refused(&cell)
        .at("robot.toml", 18)
        .says(&["`joint` is there twice"])
        .advises("[[joint]], with two brackets");
    let cell = Cell::new();
    cell.edit("robot.toml", "\"elbow\"", "\"waist\"");
    refused(&cell)
        .at("robot.toml", 25)
        .says(&["a second joint is called `waist`"])
        .advises("its own name");
}

#[test]
fn an_unknown_robot_is_said_with_the_known_ones() {
    refused(&with_key("robot = \"left\"\n"))
        .at("calibration.toml", 8)
        .says(&["`left`", "one [robot], without a name"])
        .advises("[robots.NAME]");
    let robots = "[robots.left]\nfile = \"robot.toml\"\n[robots.right]\nfile = \"robot.toml\"\n";
    let cell = with("[robot]\nfile = \"robot.toml\"\n", robots);
    refused(&cell)
        .at("calibration.toml", 6)
        .says(&["which robot", "`left` or `right`"])
        .advises("add robot = ");
    cell.append("calibration.toml", "robot = \"lift\"\n");
    refused(&cell)
        .at("calibration.toml", 10)
        .says(&["there is no robot `lift`", "`left` or `right`"])
        .advises("did you mean `left`?");
}

// What to estimate.

#[test]
fn an_unknown_parameter_is_said_with_the_nearest_known_one() {
    refused(&with_estimate("parameters = [\"all\", \"theta33\"]"))
        .at("calibration.toml", 5)
        .says(&["no parameter has the name `theta33`"])
        .shows("theta33")
        .advises("did you mean `theta3`?");
    for lines in [
        "fixed = [\"gamma*\"]",
        "bounds = { \"gamma*\" = 1 }",
        "prior = { \"gamma*\" = 1 }",
        "preference = [\"gamma*\"]",
    ] {
        refused(&with_estimate(lines))
            .at("calibration.toml", 5)
            .says(&["no parameter matches `gamma*`"])
            .advises("theta0");
    }
}

#[test]
fn bounds_that_exclude_the_nominal_value_are_refused() {
    refused(&with_estimate(
        "bounds = { theta2 = [\"1 deg\", \"3 deg\"] }",
    ))
    .at("calibration.toml", 5)
    .says(&["[1, 3] deg", "value 0 deg of theta2"])
    .shows("theta2 = ")
    .advises("distance from nominal");
    refused(&with_estimate("bounds = { d3 = [0.1, 0.2] }"))
        .at("calibration.toml", 5)
        .says(&["[100, 200] mm", "430 mm of d3"]);
    refused(&with_estimate("bounds = { d3 = [0.5, 0.2] }"))
        .at("calibration.toml", 5)
        .says(&["lower bound is not below the upper"]);
    refused(&with_estimate("bounds = { d3 = \"2 deg\" }"))
        .at("calibration.toml", 5)
        .says(&["d3", "found an angle; expected a length"]);
    refused(&with_estimate("bounds = { d3 = 0 }"))
        .at("calibration.toml", 5)
        .says(&["expected more than 0"]);
}

#[test]
fn a_prior_that_is_not_positive_is_refused() {
    refused(&with_estimate("prior = { d3 = \"-1 mm\" }"))
        .at("calibration.toml", 5)
        .says(&["expected more than 0"]);
}

#[test]
fn a_number_of_iterations_below_one_is_refused() {
    for number in ["-5", "0", "1.5"] {
        refused(&with_estimate(&format!("max_iterations = {number}")))
            .at("calibration.toml", 5)
            .says(&["`max_iterations`", number, "expected"]);
    }
}

#[test]
fn a_word_that_is_no_choice_is_said_with_the_choices() {
    refused(&with_estimate("jacobian = \"symbolic\""))
        .at("calibration.toml", 5)
        .says(&["symbolic", "`numeric`"]);
    refused(&with_estimate("solver = \"newton\""))
        .at("calibration.toml", 5)
        .says(&["newton", "`levenberg-marquardt`"])
        .advises("gauss-newton");
}

#[test]
fn nothing_left_to_estimate_is_said() {
    refused(&with_estimate("fixed = [\"all\"]"))
        .says(&["nothing is left to estimate"])
        .advises("`fixed`");
}

// Data.

#[test]
fn a_missing_column_is_named_with_those_there_are() {
    let cell = Cell::new();
    cell.edit("tracker.csv", ",z\n", ",height\n");
    refused(&cell)
        .at("tracker.csv", 1)
        .says(&["no column `z`", "waist, shoulder", "height"]);
    let cell = Cell::new();
    cell.edit("tracker.csv", "elbow", "elbwo");
    refused(&cell)
        .at("tracker.csv", 1)
        .says(&["no column for joint `elbow`", "elbwo"])
        .advises("columns = { elbow = \"elbwo\" }");
}

#[test]
fn one_column_cannot_be_two_joints() {
    refused(&with_key("columns = { shoulder = \"waist\" }\n"))
        .at("calibration.toml", 8)
        .says(&["joint `shoulder`", "`waist`", "another joint's already"])
        .advises("columns = {");
}

#[test]
fn a_column_map_must_name_what_is_read_and_what_is_there() {
    refused(&with_key("columns = { elbwo = \"q3\" }\n"))
        .at("calibration.toml", 8)
        .says(&["`elbwo`", "nothing"])
        .advises("did you mean `elbow`?");
    refused(&with_key("columns = { elbow = \"joint3\" }\n"))
        .at("calibration.toml", 8)
        .says(&["no column `joint3`", "shoulder, elbow"]);
}

#[test]
fn a_cell_that_is_not_a_finite_number_is_refused_with_its_line_and_column() {
    for (content, words) in [
        ("", "an empty cell"),
        ("1.2.3", "`1.2.3`"),
        ("abc", "`abc`"),
        ("nan", "`nan`"),
        ("inf", "`inf`"),
        ("-Infinity", "`-Infinity`"),
        ("1e400", "`1e400`"),
    ] {
        refused(&with_cell(5, 7, content))
            .at("tracker.csv", 5)
            .says(&["column `y`", words, "expected a"])
            .advises("correct the cell");
    }
    refused(&with_cell(5, 0, "\"1,5\""))
        .at("tracker.csv", 5)
        .says(&["`1,5`"])
        .advises("decimal point");
}

#[test]
fn a_number_that_no_model_can_square_is_refused() {
    refused(&with_cell(5, 7, "1e200"))
        .at("tracker.csv", 5)
        .says(&["column `y`", "`1e200`", "ordinary size"])
        .advises("unit");
    refused(&with("\"0.05 mm\"", "1e-200"))
        .at("calibration.toml", 7)
        .says(&["`sigma`", "1e-200", "ordinary size"]);
}

#[test]
fn a_cell_over_several_lines_is_refused() {
    refused(&with_cell(5, 7, "\"1"))
        .at("tracker.csv", 5)
        .says(&["goes over several lines"])
        .advises("close the quote");
}

#[test]
fn a_row_of_another_length_is_refused_with_its_line() {
    refused(&with_cell(7, 8, "1,2"))
        .at("tracker.csv", 7)
        .says(&["found 10 cells; expected 9"])
        .advises("remove the extra cells");
    let cell = Cell::new();
    cell.append("tracker.csv", "1,2,3\n");
    refused(&cell)
        .at("tracker.csv", 42)
        .says(&["found 3 cells; expected 9"]);
}

#[test]
fn a_table_without_rows_is_refused() {
    let cell = Cell::new();
    cell.write("tracker.csv", positions(&cell.readings(0)));
    refused(&cell)
        .at("tracker.csv", 1)
        .says(&["a header and no rows"])
        .advises("add the measurements");
}

#[test]
fn a_table_without_a_header_is_refused() {
    let cell = Cell::new();
    let text = cell.read("tracker.csv");
    cell.write("tracker.csv", text.split_once('\n').unwrap().1);
    refused(&cell)
        .at("tracker.csv", 1)
        .says(&["expected the names of the columns"])
        .advises("header");
}

#[test]
fn a_table_with_semicolons_or_tabs_is_refused() {
    for (mark, name) in [(";", "semicolons"), ("\t", "tabs")] {
        let cell = Cell::new();
        cell.write("tracker.csv", cell.read("tracker.csv").replace(',', mark));
        refused(&cell)
            .at("tracker.csv", 1)
            .says(&[name, "expected commas"])
            .advises("commas");
    }
}

#[test]
fn two_columns_of_one_name_are_refused() {
    let cell = Cell::new();
    cell.edit("tracker.csv", ",y,", ",x,");
    refused(&cell)
        .at("tracker.csv", 1)
        .says(&["columns 7 and 8 are both called `x`"]);
}

#[test]
fn a_unit_that_does_not_measure_the_column_is_refused() {
    let cell = Cell::new();
    cell.edit("tracker.csv", "waist", "waist [mm]");
    refused(&cell).at("tracker.csv", 1).says(&[
        "column `waist`",
        "`mm` is the unit of a length",
        "an angle",
    ]);
    let cell = Cell::new();
    cell.edit("tracker.csv", ",x,", ",x [furlong],");
    refused(&cell)
        .at("tracker.csv", 1)
        .says(&["column `x`", "`furlong` is not a unit"]);
}

#[test]
fn windows_line_ends_and_a_byte_order_mark_just_work() {
    let cell = Cell::new();
    let unix = cell.calibrate();
    for file in ["tracker.csv", "robot.toml", "calibration.toml"] {
        cell.write(
            file,
            format!("\u{feff}{}", cell.read(file).replace('\n', "\r\n")),
        );
    }
    assert_eq!(cell.calibrate(), unix);
}

/// A cell whose tracker sees poses, made from each reading by `row`.
fn with_poses(row: impl Fn(&Reading) -> Vec<f64>) -> Cell {
    let cell = with("\"position\"", "\"pose\"");
    let header = format!("{},x,y,z,qw,qx,qy,qz", cell::JOINTS);
    cell.write("tracker.csv", table(&header, &cell.readings(40), row));
    cell
}

#[test]
fn quaternions_near_unit_length_are_normalised_and_far_from_it_refused() {
    let scaled = |factor: f64| {
        with_poses(move |r| [&r.q[..], &r.position, &r.quaternion.map(|c| factor * c)].concat())
    };
    let unit = scaled(1.0).calibrate();
    let normalised = |result: &serde_json::Value| {
        let warnings = result["warnings"].as_array().unwrap();
        warnings
            .iter()
            .any(|w| w.as_str().unwrap().contains("normalised"))
    };
    assert!(!normalised(&unit));
    // All there is to say of the unit ones is that their sigma leaves rotations out.
    let warnings = unit["warnings"].as_array().unwrap();
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(
        warnings[0]
            .as_str()
            .unwrap()
            .contains("says nothing of rotations")
    );
    let near = scaled(1.001).calibrate();
    assert!(normalised(&near));
    let (a, b) = (
        &unit["constraints"][0]["after"]["rms"],
        &near["constraints"][0]["after"]["rms"],
    );
    approx::assert_relative_eq!(
        a.as_f64().unwrap(),
        b.as_f64().unwrap(),
        max_relative = 1e-6
    );
    refused(&scaled(1.2))
        .at("tracker.csv", 2)
        .says(&["quaternion", "length 1.2000; expected 1"])
        .advises("qw, qx, qy, qz");
    refused(&scaled(0.0))
        .at("tracker.csv", 2)
        .says(&["length 0"]);
}

#[test]
fn a_standard_deviation_in_a_column_must_be_positive() {
    for sigma in ["0", "-1e-4"] {
        let cell = Cell::new();
        let text = cell.read("tracker.csv");
        let rows = text.lines().enumerate().map(|(k, line)| match k {
            0 => format!("{line},sigma\n"),
            3 => format!("{line},{sigma}\n"),
            _ => format!("{line},1e-4\n"),
        });
        cell.write("tracker.csv", rows.collect::<String>());
        refused(&cell)
            .at("tracker.csv", 4)
            .says(&["column `sigma`", "above 0"])
            .advises("`rows`");
    }
}

// Which rows.

#[test]
fn a_selection_of_no_rows_is_refused() {
    for rows in ["waist > 100", "10:10"] {
        refused(&with_key(&format!("rows = \"{rows}\"\n")))
            .at("calibration.toml", 8)
            .says(&[rows, "selects none of the 40 rows"]);
    }
    refused(&with_key("rows = \"0:400\"\n"))
        .at("calibration.toml", 8)
        .says(&["row 400", "40"]);
    refused(&with_key("rows = \"wall == 'a'\"\n"))
        .at("calibration.toml", 8)
        .says(&["no column `wall`"]);
    refused(&with_key("rows = \"waist = 1\"\n"))
        .at("calibration.toml", 8)
        .says(&["`=`"])
        .advises("`==`");
}

#[test]
fn holding_out_everything_is_refused() {
    refused(&with_key("holdout = { every = 2, rows = [0, 1] }\n"))
        .at("calibration.toml", 8)
        .says(&["every row is held out"]);
    refused(&with_key(
        "rows = \"0:1\"\nholdout = { every = 2, rows = [0] }\n",
    ))
    .at("calibration.toml", 9)
    .says(&["held out", "expected some"]);
    refused(&with_key("holdout = { every = 2, rows = [2] }\n"))
        .at("calibration.toml", 8)
        .says(&["row 2", "less than `every`"]);
}

/// A cell whose data are touches, grouped by a column `group` with the labels given in order.
fn with_groups(kind: &str, column: &str, labels: &[&str]) -> Cell {
    let cell = with("\"position\"", &format!("\"{kind}\""));
    let rows = cell.readings(labels.len());
    let rows = rows.iter().zip(labels);
    let rows = rows.map(|(r, label)| format!("{},{label}\n", cells(&r.q)));
    let header = format!("{},{column}\n", cell::JOINTS);
    cell.write("tracker.csv", header + &rows.collect::<String>());
    cell
}

#[test]
fn groups_too_small_to_say_anything_are_refused() {
    refused(&with_groups("unknown-plane", "plane", &["wall", "wall"]))
        .at("tracker.csv", 2)
        .says(&["plane `wall` has 2 touches; expected at least 4"])
        .advises("at least 4 times");
    refused(&with_groups("same-point", "point", &["a", "b", "c"]))
        .at("tracker.csv", 2)
        .says(&["3 points", "`a` (1), `b` (1), `c` (1); expected at least 2"])
        .advises("at least 2 times");
}

#[test]
fn a_row_without_a_group_is_refused() {
    refused(&with_groups(
        "same-point",
        "point",
        &["a", "a", "", "b", "b"],
    ))
    .at("tracker.csv", 4)
    .says(&["column `point`", "empty cell"])
    .advises("`rows`");
}

#[test]
fn a_missing_group_column_is_said_where_it_is_asked_for() {
    let cell = with_groups("same-point", "pt", &["a", "a"]);
    refused(&cell)
        .at("calibration.toml", 4)
        .says(&["no column `point`", "pt"])
        .advises("group = ");
    cell.append("calibration.toml", "group = \"pnt\"\n");
    refused(&cell)
        .at("calibration.toml", 8)
        .says(&["no column `pnt`"])
        .advises("did you mean `pt`?");
}

#[test]
fn more_unknowns_than_rows_are_refused() {
    let cell = Cell::new();
    cell.write("tracker.csv", positions(&cell.readings(5)));
    refused(&cell)
        .at("calibration.toml", 0)
        .says(&["15 measured values", "unknowns"])
        .advises("more configurations");
}

// Where results go.

#[test]
fn a_folder_that_holds_something_is_not_overwritten() {
    let cell = Cell::new();
    std::fs::create_dir(cell.path("out")).unwrap();
    cell.write("out/notes.txt", "mine");
    refused(&cell)
        .says(&["out", "already there", "not overwritten"])
        .advises("--force");
}

#[test]
fn a_file_is_no_folder_to_write_into() {
    for more in [&[][..], &["--force"]] {
        let arguments = [
            "calibrate",
            "calibration.toml",
            "--output",
            "calibration.toml",
        ];
        refused_with(&Cell::new(), &[&arguments, more].concat())
            .says(&["calibration.toml", "not a folder"])
            .advises("--output");
    }
}

#[test]
fn a_folder_that_cannot_be_made_is_said_before_the_calibration() {
    let cell = Cell::new();
    let arguments = [
        "calibrate",
        "calibration.toml",
        "--output",
        "robot.toml/out",
    ];
    refused_with(&cell, &arguments)
        .says(&["robot.toml/out"])
        .advises("--output");
}

#[cfg(unix)]
#[test]
fn a_folder_that_cannot_be_written_is_said_before_the_calibration() {
    use std::os::unix::fs::PermissionsExt;
    let cell = Cell::new();
    std::fs::create_dir(cell.path("locked")).unwrap();
    std::fs::set_permissions(cell.path("locked"), std::fs::Permissions::from_mode(0o555)).unwrap();
    if std::fs::write(cell.path("locked/probe"), "").is_ok() {
        return; // The superuser may write anywhere.
    }
    for folder in ["locked", "locked/out"] {
        refused_with(
            &cell,
            &["calibrate", "calibration.toml", "--output", folder],
        )
        .says(&[folder, "ermission"])
        .advises("permissions");
    }
}

// Strategies and methods.

#[test]
fn an_unknown_strategy_is_said_with_the_known_ones() {
    refused(&with_estimate("strategy = \"continuation\""))
        .at("calibration.toml", 5)
        .says(&["`strategy`", "continuation", "`auto` or `direct`"])
        .advises("`direct`");
    refused(&with_estimate("jacobian = \"analitic\""))
        .at("calibration.toml", 5)
        .says(&["analitic", "`analytic`"])
        .advises("did you mean `analytic`?");
}

#[test]
fn a_method_of_another_kind_is_said_with_those_of_this_one() {
    refused(&with_key("method = \"vector-products\"\n"))
        .at("calibration.toml", 8)
        .says(&["the method `vector-products` is for unknown-plane, not for position"])
        .advises("the methods for position are paper");
    let cell = with_groups("unknown-plane", "plane", &["wall"; 6]);
    cell.append("calibration.toml", "method = \"fixed-plane\"\n");
    refused(&cell)
        .at("calibration.toml", 8)
        .says(&["the method `fixed-plane` is for known-plane, not for unknown-plane"])
        .advises("paper, vector-products");
    refused(&with_key("method = 3\n"))
        .at("calibration.toml", 8)
        .says(&["`method`", "the integer 3", "a text in quotes"]);
}

/// A cell whose data are touches of a known plane.
fn with_known_plane(lines: &str) -> Cell {
    let cell = with("\"position\"", "\"known-plane\"");
    cell.append("calibration.toml", lines);
    cell
}

#[test]
fn a_known_plane_is_given_or_its_methods_own() {
    refused(&with_known_plane(""))
        .at("calibration.toml", 4)
        .says(&["has no `plane`", "normal = ", "{ a, b, c }"]);
    refused(&with_known_plane("method = \"paper\"\n"))
        .at("calibration.toml", 4)
        .says(&["has no `plane`"])
        .advises("add plane = ");
    let plane = "plane = { normal = [0, 0, 1], distance = 0 }\n";
    refused(&with_known_plane(&format!(
        "method = \"fixed-plane\"\n{plane}"
    )))
    .at("calibration.toml", 9)
    .says(&["a plane of its own"])
    .advises("remove the key");
    refused(&with_known_plane(&format!("method = \"paper\"\n{plane}")))
        .at("calibration.toml", 8)
        .says(&["plane through the origin"])
        .advises("leave `method` out");
    refused(&with_known_plane("plane = \"random\"\n"))
        .at("calibration.toml", 8)
        .says(&["found the text \"random\"", "{ a, b, c }"])
        .advises("two forms");
}

// Locations.

#[test]
fn locations_need_their_column_and_two_visits() {
    refused(&with_groups("same-location", "place", &["a", "a"]))
        .at("calibration.toml", 4)
        .says(&["no column `location`", "place"])
        .advises("group = ");
    refused(&with_groups("same-location", "location", &["a", "b"]))
        .at("tracker.csv", 2)
        .says(&["2 locations", "`a` (1), `b` (1); expected at least 2"])
        .advises("at least 2 times");
    let cell = with_groups("same-location", "location", &["a", "a"]);
    cell.append("calibration.toml", "frame = \"tracker\"\n");
    refused(&cell)
        .at("calibration.toml", 8)
        .says(&["same-location", "only `pose` or `position` takes this key"]);
}

#[test]
fn a_table_of_standard_deviations_is_of_positions_and_rotations() {
    let table = |sigma: &str| {
        let cell = with_groups("same-location", "location", &["a", "a"]);
        cell.edit("calibration.toml", "\"0.05 mm\"", sigma);
        refused(&cell)
    };
    table("{ position = \"0.1 mm\" }")
        .at("calibration.toml", 7)
        .says(&["`sigma` has no `rotation`", "an angle"])
        .advises("rotation = ");
    table("{ position = \"0.1 mm\", rotation = \"1 mm\" }")
        .at("calibration.toml", 7)
        .says(&["`rotation`", "found a length; expected an angle"]);
    table("{ position = \"0.1 mm\", rotation = 0 }")
        .at("calibration.toml", 7)
        .says(&["found 0; expected more than 0"]);
    table("{ position = \"0.1 mm\", rotation = 1e-4, angle = 1 }")
        .at("calibration.toml", 7)
        .says(&["unknown key `angle` in `sigma`"])
        .advises("`rotation`");
    let both = "{ position = \"0.1 mm\", rotation = 1e-4 }";
    refused(&with("\"0.05 mm\"", both))
        .at("calibration.toml", 7)
        .says(&[
            "found a table; expected a length",
            "position have no rotation",
        ])
        .advises("one length");
}

// Simulations.

/// Simulates a constraint of a kind with more lines, from line 7 on.
#[track_caller]
fn simulated(kind: &str, lines: &str) -> Refusal {
    let cell = Cell::new();
    cell.write(
        "simulation.toml",
        format!(
            "[robot]\nfile = \"robot.toml\"\n[[constraint]]\nkind = \"{kind}\"\ndata = \"t.csv\"\ncount = 4\n{lines}\n"
        ),
    );
    refused_with(&cell, &["simulate", "simulation.toml", "--output", "out"])
}

#[test]
fn a_simulated_plane_is_a_plane_or_random() {
    simulated("known-plane", "plane = \"rnadom\"")
        .at("simulation.toml", 7)
        .says(&["\"rnadom\"", "expected \"random\"", "{ a, b, c }"])
        .advises("did you mean `random`?");
    simulated("known-plane", "")
        .at("simulation.toml", 3)
        .says(&["has no `plane`", "\"random\""]);
    simulated("unknown-plane", "plane = \"random\"")
        .at("simulation.toml", 7)
        .says(&["`plane`", "only `known-plane` takes this key"]);
    simulated("unknown-plane", "planes = \"two\"")
        .at("simulation.toml", 7)
        .says(&["\"two\"", "a number of planes, or a list of planes"]);
}

#[test]
fn a_distance_of_planes_is_of_planes_that_are_drawn() {
    simulated("known-plane", "plane = \"random\"\nplane_distance = -0.1")
        .at("simulation.toml", 8)
        .says(&["`plane_distance`", "found -0.1; expected 0 or more"])
        .advises("without a sign");
    simulated("unknown-plane", "plane_distance = \"2 deg\"")
        .at("simulation.toml", 7)
        .says(&["found an angle; expected a length"]);
    simulated(
        "unknown-plane",
        "planes = [{ a = 1, b = 1, c = 1 }]\nplane_distance = 0.3",
    )
    .at("simulation.toml", 8)
    .says(&["the planes are given"])
    .advises("planes = 1");
    simulated("unknown-plane", "plane_distance = 99")
        .at("simulation.toml", 3)
        .says(&["starting postures", "plane `1`"])
        .advises("units");
}

#[test]
fn simulated_locations_are_a_number_or_poses() {
    simulated("same-location", "locations = []")
        .at("simulation.toml", 7)
        .says(&["an empty list", "a number of locations"])
        .advises("1 or more");
    simulated("same-location", "locations = 0")
        .at("simulation.toml", 7)
        .says(&["found 0", "a number of locations"]);
    simulated("same-location", "locations = [[0, 0, 1]]")
        .at("simulation.toml", 7)
        .says(&["a list of 3", "qw, qx, qy, qz"]);
    simulated("same-point", "locations = 2")
        .at("simulation.toml", 7)
        .says(&["`locations`", "only `same-location` takes this key"]);
    simulated(
        "same-point",
        "[errors]\nangle = 1\ndistribution = \"normla\"",
    )
    .at("simulation.toml", 9)
    .says(&["`normla`", "\"uniform\" or \"normal\""])
    .advises("did you mean `normal`?");
}

// Studies.

const STUDY: &str = r#"trials = 1
configurations = 5
[robot]
file = "robot.toml"
[errors]
angle = "1 mrad"
[[case]]
name = "tracker"
[[case.constraint]]
kind = "position"
count = 30
[[method]]
name = "LM"
"#;

#[test]
fn mistakes_in_a_study_are_shown_where_they_are() {
    for (from, to, line, words, advice) in [
        ("trials = 1", "trials = \"many\"", 1, "\"many\"", "integer"),
        (
            "configurations = 5",
            "configurations = 0",
            2,
            "found 0",
            "configurations",
        ),
        (
            "angle = \"1 mrad\"",
            "",
            5,
            "does not say how wrong",
            "tool_error",
        ),
        (
            "angle = \"1 mrad\"",
            "distribution = \"even\"",
            6,
            "`even`",
            "`normal`",
        ),
        (
            "name = \"tracker\"",
            "",
            7,
            "[[case]] has no `name`",
            "name = ",
        ),
        (
            "[[case.constraint]]\nkind = \"position\"\ncount = 30",
            "",
            7,
            "has no constraint",
            "[[case.constraint]]",
        ),
        ("count = 30", "", 9, "has no `count`", "count = "),
        (
            "count = 30",
            "count = 30\nlocations = 2",
            12,
            "only `same-location`",
            "`kind`",
        ),
        (
            "name = \"LM\"",
            "",
            12,
            "[[method]] has no `name`",
            "name = ",
        ),
        (
            "name = \"LM\"",
            "name = \"LM\"\nstrategy = \"far\"",
            14,
            "`auto` or `direct`",
            "`direct`",
        ),
        (
            "[[method]]\nname = \"LM\"",
            "",
            0,
            "no [[method]]",
            "[[method]]",
        ),
    ] {
        let cell = Cell::new();
        cell.write("study.toml", STUDY);
        cell.edit("study.toml", from, to);
        refused_with(&cell, &["study", "study.toml", "--output", "out"])
            .at("study.toml", line)
            .says(&[words])
            .advises(advice);
    }
}

// Commands.

#[test]
fn every_command_names_a_file_that_is_missing_or_another() {
    let cell = Cell::new();
    cell.write("study.toml", STUDY);
    for command in ["check", "identify", "study"] {
        refused_with(&cell, &[command, "none.toml"])
            .at("none.toml", 0)
            .says(&["does not exist"])
            .advises("check the path");
        refused_with(&cell, &[command, "."])
            .at(".", 0)
            .says(&["is a folder; expected a file"]);
    }
    for command in ["check", "study"] {
        refused_with(&cell, &[command, "robot.toml"])
            .at("robot.toml", 0)
            .says(&["there is no [robot]"]);
    }
    refused_with(&cell, &["check", "study.toml"])
        .at("study.toml", 1)
        .says(&["unknown key `trials` in this calibration file"]);
    refused_with(&cell, &["study", "calibration.toml"])
        .at("calibration.toml", 0)
        .says(&["there is no [errors]"]);
    refused_with(&cell, &["identify", "study.toml"])
        .at("study.toml", 0)
        .says(&["a study file; expected a calibration or a robot"])
        .advises("robot file");
    cell.edit("calibration.toml", "\"tracker.csv\"", "\"none.csv\"");
    for command in ["check", "identify"] {
        refused_with(&cell, &[command, "calibration.toml"])
            .at("calibration.toml", 6)
            .says(&["none.csv", "does not exist"]);
    }
}

#[test]
fn a_plane_on_the_command_line_is_four_numbers() {
    let cell = Cell::new();
    for plane in ["0,0,1", "a,b,c,d", "0;0;1;0.4", "0,0,0,1"] {
        refused_with(&cell, &["identify", "robot.toml", "--plane", plane])
            .says(&["--plane", plane, "expected"])
            .advises("--plane 0,0,1,0.4");
    }
}

#[test]
fn arguments_that_make_no_sense_end_with_status_2_and_say_what_would() {
    let cell = Cell::new();
    for (arguments, words) in [
        (&[][..], "Usage: truing"),
        (&["calibrat", "calibration.toml"], "'calibrate'"),
        (&["calibrate"], "<FILE>"),
        (&["calibrate", "calibration.toml", "--forse"], "'--force'"),
        (
            &["calibrate", "calibration.toml", "--timeout", "0"],
            "--timeout",
        ),
        (&["check", "a.toml", "b.toml"], "'b.toml'"),
        (&["identify", "robot.toml", "--planes", "99"], "1..=20"),
        (&["simulate", "simulation.toml"], "--output <DIR>"),
        (&["study", "study.toml", "--trials", "0"], "--trials"),
        (&["study", "study.toml", "--threads", "x"], "--threads"),
    ] {
        let run = cell.run(arguments);
        assert_eq!(run.status, 2, "{arguments:?}");
        assert_eq!(run.stdout, "");
        assert!(run.stderr.contains(words), "{words} in {}", run.stderr);
    }
}
