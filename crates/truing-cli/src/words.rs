//! Numbers, units and tables as people read them.

use comfy_table::{CellAlignment, ContentArrangement, Table, presets};

/// The factor and the name of a unit for people: millimetres and milliradians.
pub fn shown(unit: &str) -> (f64, &str) {
    match unit {
        "m" => (1e3, "mm"),
        "rad" => (1e3, "mrad"),
        "1" => (1.0, ""),
        other => (1.0, other),
    }
}

/// A name, with its group in brackets if there is one.
pub fn titled(name: &str, group: &str) -> String {
    if group.is_empty() {
        name.to_owned()
    } else {
        format!("{name}[{group}]")
    }
}

/// A number with about five significant digits, small ones in scientific notation.
pub fn number(x: f64) -> String {
    let size = x.abs();
    if x == 0.0 {
        "0".into()
    } else if size < 1e-4 {
        format!("{x:.1e}")
    } else if size < 1e4 {
        format!("{x:.4}")
    } else {
        format!("{x:.2}")
    }
}

/// An empty table; columns whose number is in `left` are aligned left.
pub fn table(header: &[&str], left: &[usize]) -> Table {
    let mut table = Table::new();
    table
        .load_preset(presets::NOTHING)
        .set_content_arrangement(ContentArrangement::Disabled);
    table.set_header(header.iter().copied());
    for (k, column) in table.column_iter_mut().enumerate() {
        let alignment = if left.contains(&k) {
            CellAlignment::Left
        } else {
            CellAlignment::Right
        };
        column.set_cell_alignment(alignment);
        column.set_padding((if k == 0 { 2 } else { 1 }, 1));
    }
    table
}

/// A table as text, without spaces at the ends of lines.
pub fn lines(table: &Table) -> String {
    table
        .lines()
        .map(|line| line.trim_end().to_owned() + "\n")
        .collect()
}
