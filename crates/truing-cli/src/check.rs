//! `truing check`.

use crate::args::Check;
use crate::failure::Failure;
use crate::streams::{Ending, Streams};
use crate::words::{lines, number, table};
use std::fmt::Write;
use truing_robot::check::{SetCheck, Way};
use truing_robot::file::CalibrationFile;
use truing_robot::load::load_with;
use truing_robot::robot::Derivatives;

/// Compares the Jacobians of a calibration file.
pub fn run(arguments: &Check, streams: &Streams) -> Result<Ending, Failure> {
    let file = CalibrationFile::read_with(&arguments.file, &streams.registry)?;
    let calibration = load_with(&file, &streams.registry)?;
    let mut ways = Vec::new();
    if let Some(analytic) = streams.registry.analytic() {
        ways.push(Way {
            name: "analytic",
            derivatives: Derivatives::Regressor(analytic.clone()),
            tolerance: Way::EXACT,
        });
    }
    ways.extend([Way::whole_chain(), Way::numeric()]);
    let sets = calibration
        .check(&ways)
        .map_err(|error| Failure::from(error).about(&arguments.file))?;
    let agree = sets.iter().all(|set| set.ways.iter().all(|way| way.agrees));
    streams.say(&shown(&sets, agree));
    if streams.json {
        let json = serde_json::json!({ "agree": agree, "reference": "auto", "constraints": sets });
        streams.print(&(json.to_string() + "\n"));
    }
    Ok(if agree {
        Ending::Good
    } else {
        Ending::Untrusted
    })
}

fn shown(sets: &[SetCheck], agree: bool) -> String {
    let mut out = String::from("Jacobians beside frame-wise automatic differentiation (auto)\n");
    let header = [
        "constraint",
        "Jacobian",
        "µs each",
        "× residual",
        "difference",
        "column",
        "measurement",
        "",
    ];
    let mut rows = table(&header, &[0, 1, 5, 6, 7]);
    for set in sets {
        let each = |seconds: f64| {
            let of_residual = seconds / set.residual_seconds;
            let micro = seconds * 1e6 / set.count.max(1) as f64;
            [format!("{micro:.2}"), format!("{of_residual:.1}")]
        };
        let name = match set.method {
            Some(method) => format!("{} ({method})", set.name),
            None => set.name.clone(),
        };
        let [micro, times] = each(set.seconds);
        let none = String::new;
        rows.add_row([
            name,
            "auto".into(),
            micro,
            times,
            none(),
            none(),
            none(),
            none(),
        ]);
        for way in &set.ways {
            let [micro, times] = each(way.seconds);
            let place = match way.line {
                Some(line) => format!("{} (line {line})", way.measurement),
                None => way.measurement.to_string(),
            };
            rows.add_row([
                none(),
                way.way.to_owned(),
                micro,
                times,
                format!("{:.1e}", way.difference),
                way.column.clone(),
                place,
                if way.agrees { "agrees" } else { "DIFFERS" }.into(),
            ]);
        }
    }
    out += &lines(&rows);
    out += "  difference: the largest in any column, over the column's length but at least a thousandth of the longest;\n  \
            times are of r and J together, for each measurement and over that of r alone.\n\n\
            Largest difference in each column\n";
    out += &columns(sets);
    for set in sets {
        for way in set.ways.iter().filter(|way| !way.agrees) {
            let _ = writeln!(
                out,
                "`{}`: {} differs in {}: {} against {} (more than {:.0e})",
                set.name,
                way.way,
                way.column,
                number(way.entries.0),
                number(way.entries.1),
                way.tolerance
            );
        }
    }
    out += if agree {
        "all agree\n"
    } else {
        "they do not agree\n"
    };
    out
}

/// One row a column, one number a way: the largest over all constraints.
fn columns(sets: &[SetCheck]) -> String {
    let ways: Vec<&str> = sets
        .first()
        .map_or_else(Vec::new, |set| set.ways.iter().map(|way| way.way).collect());
    let header: Vec<&str> = std::iter::once("column")
        .chain(ways.iter().copied())
        .collect();
    let mut rows = table(&header, &[0]);
    let mut names: Vec<&str> = Vec::new();
    for set in sets {
        for column in set.ways.iter().flat_map(|way| &way.columns) {
            if !names.contains(&column.name.as_str()) {
                names.push(&column.name);
            }
        }
    }
    for name in names {
        let largest = |k: usize| {
            let all = sets.iter().flat_map(|set| &set.ways[k].columns);
            let own = all.filter(|column| column.name == name);
            own.map(|column| column.difference).fold(0.0, f64::max)
        };
        let mut row = vec![name.to_owned()];
        row.extend((0..ways.len()).map(|k| format!("{:.1e}", largest(k))));
        rows.add_row(row);
    }
    lines(&rows)
}
