//! What can be identified, as people read it.

use crate::words::{lines, number, table};
use std::collections::BTreeMap;
use std::fmt::Write;
use truing_robot::identify::{Gap, Identification, Identified, Status};

/// Lists are broken at this column.
const WIDTH: usize = 100;

/// The whole answer as text.
pub fn answer(answer: &Identification) -> String {
    let mut out = String::new();
    let of = answer.rank_of;
    let parts = [
        (of.robots, "of robots"),
        (of.frames, "of sensor frames"),
        (of.tool_points, "of tool points"),
        (of.instruments, "of instruments"),
    ];
    let parts: Vec<String> = parts
        .iter()
        .filter(|(n, _)| *n > 0)
        .map(|(n, what)| format!("{n} {what}"))
        .collect();
    let parts = match parts.len() {
        0 | 1 => String::new(),
        _ => format!(" ({})", parts.join(", ")),
    };
    let beside = match answer.beside {
        0 => String::new(),
        n => format!(", and beside them {n} unknowns of planes, points, locations and distances"),
    };
    let (rank, columns) = (answer.rank, answer.columns);
    let _ = writeln!(
        out,
        "{rank} of {columns} parameters can be identified{parts}{beside}.\n"
    );
    out.push_str("The constraints cannot see\n");
    let together = match answer.together_with.as_slice() {
        [] => String::new(),
        with => format!("; the robot moves with {}", with.join(", ")),
    };
    let (unseen, together) = match answer.symmetries.as_slice() {
        [] => (
            "nothing: every motion of the robot and its scale are seen".into(),
            String::new(),
        ),
        some => (symmetries(some), together),
    };
    paragraph(&mut out, &format!("{unseen}{together}"));
    out.push('\n');
    lists(&mut out, answer);
    relations(&mut out, answer);
    if answer.steps.len() > 1 {
        steps(&mut out, answer);
    }
    structure(&mut out, answer);
    if let Some(data) = &answer.data {
        let _ = writeln!(out, "\nThe data ({} measurements)", data.measurements);
        let allowed = match (data.rank, data.unexcited.len()) {
            (rank, 0) => format!("determine all {rank} that the structure allows"),
            (rank, _) => format!(
                "determine {rank} of the {} that the structure allows",
                answer.rank
            ),
        };
        paragraph(&mut out, &allowed);
        if !data.unexcited.is_empty() {
            let names: Vec<&str> = data.unexcited.iter().map(String::as_str).collect();
            list(&mut out, "not excited", &names);
        }
        values(&mut out, &data.singular_values, data.gap);
    }
    observability(&mut out, answer);
    for warning in &answer.warnings {
        let _ = writeln!(out, "warning: {warning}");
    }
    out
}

/// Text broken at single spaces and indented.
fn paragraph(out: &mut String, text: &str) {
    for line in broken(&text.replace(' ', "  "), WIDTH) {
        let _ = writeln!(out, "  {}", line.replace("  ", " "));
    }
}

/// Text broken at double spaces into lines of at most `width`.
fn broken(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    let mut used = 0;
    for part in text.split("  ") {
        let length = part.chars().count();
        if used > 0 && used + 2 + length > width {
            lines.push(String::new());
            used = 0;
        }
        if let Some(line) = lines.last_mut() {
            if used > 0 {
                line.push_str("  ");
                used += 2;
            }
            line.push_str(part);
            used += length;
        }
    }
    lines
}

/// "3 translations, 3 rotations, scale", with directions where not all are meant.
fn symmetries(all: &[String]) -> String {
    let mut parts: Vec<String> = Vec::new();
    // The entries of a kind, by the robot that moves alone.
    let mut grouped: BTreeMap<(usize, &str), Vec<&str>> = BTreeMap::new();
    for symmetry in all {
        let (motion, robot) = match symmetry.split_once(" of ") {
            Some((motion, robot)) => (motion, robot),
            None => (symmetry.as_str(), ""),
        };
        let rank = ["translation", "rotation", "scale"];
        let kind = rank.iter().position(|kind| motion.starts_with(kind));
        grouped
            .entry((kind.unwrap_or(rank.len()), robot))
            .or_default()
            .push(motion);
    }
    for ((kind, robot), motions) in grouped {
        let directions: Vec<&str> = motions
            .iter()
            .filter_map(|m| m.split_once(' ').and_then(|(_, rest)| rest.split_once(' ')))
            .map(|(_, direction)| direction)
            .collect();
        let text = match (kind, directions.as_slice()) {
            (0, [_, _, _]) => "3 translations".to_owned(),
            (0, [one]) => format!("1 translation along {one}"),
            (0, some) => format!("{} translations along {}", some.len(), some.join(" and ")),
            (1, [_, _, _]) => "3 rotations".to_owned(),
            (1, [one]) => format!("1 rotation about {one}"),
            (1, some) => format!("{} rotations about {}", some.len(), some.join(" and ")),
            _ => "scale".to_owned(),
        };
        let of = if robot.is_empty() {
            String::new()
        } else {
            format!(" of {robot}")
        };
        parts.push(text + &of);
    }
    parts.join(", ")
}

/// Names by status.
fn lists(out: &mut String, answer: &Identification) {
    out.push_str("Parameters\n");
    for (status, title) in [
        (Status::Estimated, "estimated"),
        (Status::Unexcited, "unexcited"),
        (Status::NoEffect, "no effect"),
        (Status::Regrouped, "regrouped"),
        (Status::Held, "held"),
        (Status::Fixed, "fixed"),
    ] {
        let same = answer.parameters.iter().filter(|p| p.status == status);
        let names: Vec<&str> = same.map(|p| p.name.as_str()).collect();
        if !names.is_empty() {
            list(out, title, &names);
        }
    }
    out.push('\n');
}

/// "  title (n)  a, b, c", broken and indented.
fn list(out: &mut String, title: &str, names: &[&str]) {
    let head = format!("  {:<15}", format!("{title} ({})", names.len()));
    let indent = head.chars().count() + 1;
    let mut line = head + " ";
    for (k, name) in names.iter().enumerate() {
        let comma = if k + 1 < names.len() { "," } else { "" };
        if line.chars().count() + name.chars().count() + 2 > WIDTH {
            let _ = writeln!(out, "{}", line.trim_end());
            line = " ".repeat(indent);
        }
        line += &format!("{name}{comma} ");
    }
    let _ = writeln!(out, "{}", line.trim_end());
}

/// Which parameters take over, with which coefficients; what moves along.
fn relations(out: &mut String, answer: &Identification) {
    let robot: Vec<&str> = answer.parameters.iter().map(|p| p.name.as_str()).collect();
    let with = |status: Status| answer.parameters.iter().filter(move |p| p.status == status);
    let mut rows = table(&["", ""], &[0, 1]);
    let mut any = false;
    for p in with(Status::Regrouped).chain(with(Status::Held)) {
        any = true;
        let mut name = p.name.as_str();
        for line in broken(&relation(p, &robot), WIDTH) {
            rows.add_row([name.to_owned(), line]);
            name = "";
        }
    }
    if any {
        out.push_str("A change of one of these does what these changes do together\n");
        let text = lines(&rows);
        // The header is empty.
        out.extend(text.lines().skip(1).map(|line| format!("{line}\n")));
        out.push('\n');
    }
}

/// A coefficient with its sign, to four places, without zeros at the end.
fn factor(c: f64) -> String {
    let size = match c.abs() {
        size if size < 1e-3 => format!("{size:.1e}"),
        size => {
            let places = format!("{size:.4}");
            places
                .trim_end_matches('0')
                .trim_end_matches('.')
                .to_owned()
        }
    };
    format!("{}{size}", if c < 0.0 { "−" } else { "+" })
}

fn relation(p: &Identified, robot: &[&str]) -> String {
    let mut parts: Vec<String> = Vec::new();
    let mut along: Vec<String> = Vec::new();
    for (name, coefficient) in p.into.iter().flatten() {
        if robot.contains(&name.as_str()) {
            parts.push(format!("{} {name}", factor(*coefficient)));
            continue;
        }
        // `touches[1].tilt1` is of the set `touches`.
        let owner = name.rsplit_once('.').map_or(name.as_str(), |(o, _)| o);
        let owner = owner.split_once('[').map_or(owner, |(set, _)| set);
        if !along.iter().any(|known| known == owner) {
            along.push(owner.to_owned());
        }
    }
    let moved = along.join(", ");
    match (parts.is_empty(), along.is_empty()) {
        (true, _) => format!("moves {moved} along"),
        (false, true) => parts.join("  "),
        (false, false) => format!("{}  and moves {moved}", parts.join("  ")),
    }
}

fn steps(out: &mut String, answer: &Identification) {
    out.push_str("What each constraint adds\n");
    let mut rows = table(&["constraint", "adds", "rank", "left unseen"], &[0, 3]);
    for step in &answer.steps {
        let unseen = if step.symmetries.is_empty() {
            "–".to_owned()
        } else {
            symmetries(&step.symmetries)
        };
        rows.add_row([
            step.constraint.clone(),
            format!("+{}", step.adds),
            step.rank.to_string(),
            unseen,
        ]);
    }
    out.push_str(&lines(&rows));
    out.push('\n');
}

fn structure(out: &mut String, answer: &Identification) {
    out.push_str("Structure, at random configurations that satisfy the constraints exactly\n");
    values(out, &answer.singular_values, answer.gap);
    paragraph(out, &format!("of J, {}", answer.scaling.singular_values));
}

fn observability(out: &mut String, answer: &Identification) {
    let Some(o) = &answer.observability else {
        return;
    };
    let at = match answer.data {
        Some(_) => "the data's configurations",
        None => "these configurations",
    };
    let m = answer.measurements;
    let _ = writeln!(
        out,
        "\nObservability of what is estimated, at {at} ({m} measurements)"
    );
    let [o1, o2, o3, o4, o5] = [o.o1, o.o2, o.o3, o.o4, o.o5].map(number);
    let _ = writeln!(out, "  O1 {o1}   O2 {o2}   O3 {o3}   O4 {o4}   O5 {o5}");
    let (scaling, length) = (
        answer.scaling.observability,
        answer.scaling.characteristic_length,
    );
    paragraph(
        out,
        &format!("of J, {scaling}; the characteristic length is {length:.3} m"),
    );
}

fn values(out: &mut String, all: &[f64], gap: Option<Gap>) {
    let short = |s: &f64| match *s {
        0.0 => "0".to_owned(),
        s if s >= 0.01 => format!("{s:.2}"),
        s => format!("{s:.0e}"),
    };
    let shown: Vec<String> = all.iter().map(short).collect();
    let names: Vec<&str> = shown.iter().map(String::as_str).collect();
    list(out, "singular values", &names);
    let Some(gap) = gap else { return };
    let last = short(&gap.last_kept);
    let text = match (gap.first_dropped, gap.ratio) {
        (None, _) => format!("all of them count; the smallest is {last}"),
        (Some(_), None) => format!("the last that counts is {last}, the next is 0"),
        (Some(dropped), Some(ratio)) => format!(
            "the last that counts is {last}, the next is {}: {ratio:.0e} times smaller",
            short(&dropped)
        ),
    };
    paragraph(out, &text);
}
