//! Results as people read them.

use crate::show_statistics;
use crate::words::{lines, number, shown, table, titled};
use comfy_table::Table;
use std::collections::BTreeSet;
use std::fmt::Write;
use truing_robot::identify::Status;
use truing_robot::judge::{ErrorSummary, Outlier, SetResult};
use truing_robot::result::{
    CalibrationResult, ComponentEstimate, ParameterResult, UnknownEstimate,
};

fn error_rows(table: &mut Table, set: &SetResult, held_out: bool) {
    let (factor, unit) = shown(set.unit);
    let cell = |e: &Option<ErrorSummary>, f: fn(&ErrorSummary) -> f64| {
        e.as_ref()
            .map_or_else(|| "–".into(), |e| number(f(e) * factor))
    };
    let name = if held_out {
        format!("{} (not used)", set.name)
    } else {
        set.name.clone()
    };
    // The title says millimetres.
    let other = match unit {
        "mm" => String::new(),
        unit => format!(" {unit}"),
    };
    for (k, (label, f)) in [
        ("rms", (|e| e.rms) as fn(&ErrorSummary) -> f64),
        ("max", |e| e.max),
    ]
    .into_iter()
    .enumerate()
    {
        let (name, kind, count) = if k == 0 {
            (name.clone(), set.kind.clone(), set.count.to_string())
        } else {
            Default::default()
        };
        table.add_row([
            name,
            kind,
            count,
            format!("{label}{other}"),
            cell(&set.before, f),
            cell(&set.registered, f),
            cell(&set.after, f),
        ]);
    }
    for what in set.after.iter().flat_map(|e| e.more.keys()) {
        let (factor, label) = match *what {
            "rotation" => (1e3, "mrad"),
            other => (1.0, other),
        };
        let cell = |e: &Option<ErrorSummary>| {
            let own = e.as_ref().and_then(|e| e.more.get(what));
            own.map_or_else(|| "–".into(), |e| number(e.rms * factor))
        };
        table.add_row([
            String::new(),
            String::new(),
            String::new(),
            label.into(),
            cell(&set.before),
            cell(&set.registered),
            cell(&set.after),
        ]);
    }
}

/// Value, factor and unit for people: millimetres and degrees.
pub fn people(p: &ParameterResult) -> (f64, &'static str) {
    match p.unit {
        "m" => (1e3, "mm"),
        "rad" => (1.0_f64.to_degrees(), "deg"),
        "1" => (1.0, ""),
        other => (1.0, other),
    }
}

/// What takes a parameter's effect over: parameters with their coefficients, then the names of the
/// frames, tool points, planes and points that move along.
pub fn taken_over(p: &ParameterResult, robot: &BTreeSet<&str>) -> String {
    let mut parts: Vec<String> = Vec::new();
    for (name, coefficient) in p.into.iter().flatten() {
        if robot.contains(name.as_str()) {
            parts.push(format!("{} {name}", signed(*coefficient)));
            continue;
        }
        let owner = name
            .rsplit_once('.')
            .map_or(name.as_str(), |(owner, _)| owner)
            .to_owned();
        if !parts.contains(&owner) {
            parts.push(owner);
        }
    }
    const SHOWN: usize = 4;
    let more = if parts.len() > SHOWN { ", …" } else { "" };
    let parts = parts
        .iter()
        .take(SHOWN)
        .cloned()
        .collect::<Vec<_>>()
        .join(", ");
    format!("{} ({parts}{more})", p.status.name())
}

fn parameter_rows(table: &mut Table, p: &ParameterResult, robot: &BTreeSet<&str>) {
    let (factor, unit) = people(p);
    let status = match (&p.status, p.at_bound) {
        (Status::Estimated, Some(side)) => format!("estimated, at its {side} bound"),
        (Status::Regrouped | Status::Held, _) => taken_over(p, robot),
        (status, _) => status.name().to_owned(),
    };
    let estimated = p.status == Status::Estimated;
    table.add_row([
        p.name.clone(),
        number(p.nominal * factor),
        if estimated {
            number(p.estimate * factor)
        } else {
            "–".into()
        },
        if estimated {
            number((p.estimate - p.nominal) * factor)
        } else {
            "–".into()
        },
        p.sigma.map_or_else(|| "–".into(), |s| number(s * factor)),
        unit.to_owned(),
        status,
    ]);
}

fn signed(c: f64) -> String {
    format!("{}{}", if c < 0.0 { "−" } else { "+" }, number(c.abs()))
}

/// What robust losses have set aside, a line a set: how many of how many, the error of the rest, and the
/// worst by their rows.
pub fn set_aside(result: &CalibrationResult) -> Vec<String> {
    const SHOWN: usize = 8;
    let mut lines = Vec::new();
    for set in &result.constraints {
        let own = result.outliers.iter();
        let mut own: Vec<&Outlier> = own
            .filter(|o| o.constraint == set.name && o.weight.is_some())
            .collect();
        if own.is_empty() {
            continue;
        }
        own.sort_by(|a, b| b.error.abs().total_cmp(&a.error.abs()));
        let mut line = format!("{}: {} of {}", set.name, own.len(), set.count);
        let squares: f64 = own.iter().map(|o| o.error * o.error).sum();
        let rest = set.count - own.len();
        if let (Some(after), true) = (&set.after, rest > 0) {
            let all = after.rms * after.rms * set.count as f64;
            let rms = ((all - squares).max(0.0) / rest as f64).sqrt();
            let _ = write!(line, ", without them rms {} mm", number(rms * 1e3));
        }
        let worst: Vec<String> = own
            .iter()
            .take(SHOWN)
            .map(|o| {
                let at = o.line.map_or_else(String::new, |n| format!(" (line {n})"));
                format!("row {}{at} {} mm", o.row, number(o.error * 1e3))
            })
            .collect();
        let which = if own.len() > SHOWN { "; worst " } else { "; " };
        lines.push(line + which + &worst.join(", "));
    }
    lines
}

/// Numbers that sets of measurements brought, beside distances, which have lines of their own.
pub fn own_numbers(result: &CalibrationResult) -> impl Iterator<Item = &ComponentEstimate> {
    let point = |u: &&UnknownEstimate| {
        let mut points = result.points.iter();
        points.any(|point| point.constraint == u.constraint && point.group == u.group)
    };
    let unknowns = result.unknowns.iter();
    let numbers = unknowns.filter(move |u| u.name != "distance" && !point(u));
    let components = numbers.flat_map(|u| &u.components);
    components.filter(|component| component.estimate.is_some())
}

/// A number with eight digits: a ratio near one needs them.
pub fn digits(x: f64) -> String {
    let text = format!("{x:.8}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// The whole result as text.
pub fn result(result: &CalibrationResult) -> String {
    let mut out = String::new();
    out.push_str("Errors [mm]\n");
    let mut errors = table(
        &[
            "constraint",
            "kind",
            "count",
            "",
            "before",
            "registered",
            "calibrated",
        ],
        &[0, 1, 3],
    );
    for set in &result.constraints {
        error_rows(&mut errors, set, false);
    }
    for set in &result.validation {
        error_rows(&mut errors, set, true);
    }
    out.push_str(&lines(&errors));
    out.push_str(
        "  before: the nominal robot as given; registered: the nominal robot, only frames, base, tool points, planes\n  \
         and points estimated: what improvements are to be compared with.\n\n",
    );
    let outliers = set_aside(result);
    if !outliers.is_empty() {
        out.push_str("Outliers, which the losses set aside (rows counted from 0)\n");
        for line in outliers {
            let _ = writeln!(out, "  {line}");
        }
        out.push('\n');
    }
    out.push_str("Parameters\n");
    let mut parameters = table(
        &["name", "nominal", "estimate", "change", "σ", "", "status"],
        &[0, 5, 6],
    );
    let robot: BTreeSet<&str> = result.parameters.iter().map(|p| p.name.as_str()).collect();
    for p in &result.parameters {
        parameter_rows(&mut parameters, p, &robot);
    }
    out.push_str(&lines(&parameters));
    for frame in &result.frames {
        let [x, y, z] = frame.position;
        let [w, a, b, c] = frame.quaternion;
        let _ = writeln!(
            out,
            "  frame {}: position ({x:.6}, {y:.6}, {z:.6}) m, quaternion (w, x, y, z) ({w:.6}, {a:.6}, {b:.6}, {c:.6})",
            frame.name
        );
    }
    for target in &result.targets {
        let [x, y, z] = target.position.map(|x| number(x * 1e3));
        let (what, turn) = match target.quaternion {
            None => ("tool point", String::new()),
            Some([w, a, b, c]) => (
                "body",
                format!(", quaternion (w, x, y, z) ({w:.6}, {a:.6}, {b:.6}, {c:.6})"),
            ),
        };
        let of = if target.robot.is_empty() {
            String::new()
        } else {
            format!(" of {}", target.robot)
        };
        let _ = writeln!(
            out,
            "  {what} {}{of}: ({x}, {y}, {z}) mm{turn} in the tool frame",
            target.name
        );
    }
    for plane in &result.planes {
        let [x, y, z] = plane.normal;
        let _ = writeln!(
            out,
            "  plane {}: normal ({x:.6}, {y:.6}, {z:.6}), distance {:.6} m, rms {} mm over {} touches",
            titled(&plane.constraint, &plane.group),
            plane.distance,
            number(plane.rms * 1e3),
            plane.count
        );
    }
    for point in &result.points {
        let [x, y, z] = point.position;
        let _ = writeln!(
            out,
            "  point {}: ({x:.6}, {y:.6}, {z:.6}) m, rms {} mm over {} measurements",
            titled(&point.constraint, &point.group),
            number(point.rms * 1e3),
            point.count
        );
    }
    for location in &result.locations {
        let [x, y, z] = location.position;
        let [w, a, b, c] = location.quaternion;
        let _ = writeln!(
            out,
            "  location {}: position ({x:.6}, {y:.6}, {z:.6}) m, quaternion (w, x, y, z) ({w:.6}, {a:.6}, {b:.6}, {c:.6}), rms {} mm over {} visits",
            titled(&location.constraint, &location.group),
            number(location.rms * 1e3),
            location.count
        );
    }
    for (name, distance) in &result.distances {
        let _ = writeln!(out, "  distance {name}: {} mm", number(distance * 1e3));
    }
    for component in own_numbers(result) {
        let (factor, unit) = shown(component.unit);
        let sigma = component.sigma.map_or_else(String::new, |sigma| {
            format!(" ± {}", number(sigma * factor))
        });
        let _ = writeln!(
            out,
            "  {}: {}{sigma} {unit} ({})",
            component.name,
            digits(component.estimate.unwrap_or(f64::NAN) * factor),
            component.status.name()
        );
    }
    let estimated = result
        .parameters
        .iter()
        .filter(|p| p.status == Status::Estimated)
        .count();
    let _ = writeln!(
        out,
        "\n{} degrees of freedom estimated ({estimated} of {} robot parameters); condition number {}; σ₀ {}",
        result.identifiable,
        result.parameters.len(),
        result
            .condition
            .map_or_else(|| "–".into(), |c| format!("{c:.3e}")),
        result.sigma0.map_or_else(|| "–".into(), number),
    );
    if let Some(part) = result.drawing {
        let _ = writeln!(
            out,
            "links and tool are held near nominal by {} % of the robot's dimensions, 1 σ (`drawing`)",
            number(100.0 * part)
        );
    }
    out.push_str(&show_statistics::lines(result));
    let _ = writeln!(
        out,
        "{}\n{}, cost {:.6e} → {:.6e}",
        result.termination.message,
        match result.iterations {
            1 => "1 iteration".to_owned(),
            n => format!("{n} iterations"),
        },
        result.initial_cost,
        result.cost
    );
    for warning in &result.warnings {
        let _ = writeln!(out, "warning: {warning}");
    }
    out
}
