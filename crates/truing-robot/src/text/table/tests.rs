use super::*;

const TEXT: &str = "q1 [deg], x [mm],y,plane\n90,1.5,2,\"wall, left\"\n-90,2e3,3,floor\n";

fn table(text: &str) -> Table {
    Table::parse(text, "t.csv").unwrap()
}

fn error(text: &str) -> InputError {
    Table::parse(text, "t.csv").unwrap_err()
}

#[test]
fn units_of_the_header_win() {
    let table = table(TEXT);
    assert_eq!(table.len(), 2);
    let names: Vec<&str> = table.column_names().collect();
    assert_eq!(names, ["q1", "x", "y", "plane"]);
    let units = Units {
        length: 1e-2,
        angle: 7.0,
    };
    let numbers = |name, dimension| table.numbers(name, dimension, &units, &[1, 0]).unwrap();
    let quarter = 90f64.to_radians();
    assert_eq!(numbers("q1", Dimension::Angle), [-quarter, quarter]);
    assert_eq!(numbers("x", Dimension::Length), [2.0, 1.5e-3]);
    assert_eq!(numbers("y", Dimension::Length), [3e-2, 2e-2]);
    assert_eq!(numbers("y", Dimension::None), [3.0, 2.0]);
    assert_eq!(table.strings("plane", &[0]).unwrap(), ["wall, left"]);
    assert!(table.has("plane") && !table.has("Plane"));
}

#[test]
fn errors_name_line_column_and_cell() {
    let numbers = |text: &str, name: &str, dimension| {
        let table = table(text);
        let rows: Vec<usize> = (0..table.len()).collect();
        let error = table.numbers(name, dimension, &Units::SI, &rows);
        error.unwrap_err()
    };
    let wrong = numbers(TEXT, "plane", Dimension::None);
    assert_eq!(
        wrong.to_string(),
        "t.csv:2: column `plane`: found `wall, left`; expected a number"
    );
    for cell in ["nan", "inf", "-Infinity", "1e999", "", "1;5", "0x1"] {
        let wrong = numbers(&format!("x\n1\n\n\"{cell}\"\n"), "x", Dimension::Length);
        assert_eq!(wrong.line, Some(4), "{cell}: {wrong}");
    }
    let wrong = numbers(TEXT, "q1", Dimension::Length);
    assert_eq!(wrong.line, Some(1));
    assert!(wrong.message.contains("a length"), "{wrong}");
    assert!(numbers(TEXT, "q1", Dimension::None).message.contains("q1"));
    assert!(
        numbers("x [N]\n1\n", "x", Dimension::Length)
            .message
            .contains("`N`")
    );
    let wrong = numbers(TEXT, "plan", Dimension::None);
    assert!(wrong.message.contains("q1, x, y, plane"), "{wrong}");
    assert_eq!(wrong.help.as_deref(), Some("did you mean `plane`?"));
}

#[test]
fn malformed_tables_are_refused_with_their_line() {
    for (text, line, words) in [
        ("", 0, "empty"),
        ("\n\r\n", 0, "empty"),
        ("a,b\n", 1, "no rows"),
        ("\na,b\n", 2, "no rows"),
        ("a,b\n1,2\n1\n", 3, "found 1 cells; expected 2"),
        (
            "a,b\r\n1,2\r\n\r\n1,2,3\r\n",
            4,
            "found 3 cells; expected 2",
        ),
        ("a,b\r1,2\r1\r", 3, "found 1 cells"),
        ("a,,b\n1,2,3\n", 1, "column 2 has no name"),
        ("a,[mm]\n1,2\n", 1, "column 2 has no name"),
        ("a,b,a\n1,2,3\n", 1, "columns 1 and 3"),
        ("a [mm],a [m]\n1,2\n", 1, "both called `a`"),
        ("a;b\n1;2\n", 1, "semicolons"),
        ("a\tb\n1\t2\n", 1, "tabs"),
        ("1,2\n3,4\n", 1, "names of the columns"),
        ("a,b\n1,\"2\n3,4\n", 2, "several lines"),
    ] {
        let error = error(text);
        assert!(error.message.contains(words), "{text:?}: {error}");
        assert_eq!(error.line.unwrap_or(0), line, "{text:?}: {error}");
    }
}

#[test]
fn byte_order_marks_crlf_and_blank_lines_do_not_matter() {
    let table = table("\u{feff}a,b [deg]\r\n\r\n1,2\r\n3,\"4\"");
    assert_eq!(table.strings("a", &[0, 1]).unwrap(), ["1", "3"]);
    assert_eq!((table.line(0), table.line(1)), (3, 4));
    let odd = Table::parse("é [mm],\u{202e}\n1,\u{0}\n", "t.csv").unwrap();
    assert_eq!(odd.strings("\u{202e}", &[0]).unwrap(), ["\u{0}"]);
}
