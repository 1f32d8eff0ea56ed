//! `truing study`.

use crate::args::Study as Arguments;
use crate::failure::{Failure, Files};
use crate::streams::{Ending, Streams};
use crate::words::{lines, number, table};
use crate::{figure, interrupt, output};
use indicatif::{ProgressBar, ProgressStyle};
use std::fmt::Write;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Instant;
use truing_robot::file::StudyFile;
use truing_robot::study::{Study, StudyResult, StudyRow, load_study};

/// Runs a study file.
pub fn run(arguments: &Arguments, streams: &Streams) -> Result<Ending, Failure> {
    if let Some(folder) = &arguments.output {
        output::check(folder, arguments.force)?;
    }
    let mut file = StudyFile::read_with(&arguments.file, &streams.registry)?;
    if let Some(trials) = arguments.trials {
        file.trials = trials as usize;
    }
    if let Some(seed) = arguments.seed {
        file.seed = seed;
    }
    let interrupt = interrupt::on_ctrl_c();
    let about = |error: truing_robot::Error| Failure::from(error).about(&arguments.file);
    let study = load_study(&file, &streams.registry).map_err(about)?;
    let result = trials(&study, arguments, &interrupt).map_err(about)?;
    streams.say(&shown(&result));
    let json = serde_json::to_string_pretty(&result).map_err(|e| {
        Failure::new(
            format!("cannot write the study as JSON: {e}"),
            "report this with the study file",
        )
    })? + "\n";
    match &arguments.output {
        Some(folder) if result.complete => {
            let files: Files = vec![
                (PathBuf::from("study.json"), json.clone()),
                (PathBuf::from("study.csv"), csv(&result)),
                (PathBuf::from("study.svg"), figure::shares(&result)?),
            ];
            for path in output::write(folder, &files)? {
                streams.say(&format!("wrote {}\n", path.display()));
            }
        }
        Some(folder) => streams.say(&format!("nothing written to {}\n", folder.display())),
        None => {}
    }
    if streams.json {
        streams.print(&json);
    }
    Ok(if result.complete {
        Ending::Good
    } else {
        Ending::Stopped
    })
}

fn trials(
    study: &Study,
    arguments: &Arguments,
    interrupt: &AtomicBool,
) -> Result<StudyResult, truing_robot::Error> {
    let bar = ProgressBar::new(study.trials() as u64);
    if let Ok(style) =
        ProgressStyle::with_template("{bar:30} {pos} of {len} trials ({elapsed}, {eta} left)")
    {
        bar.set_style(style);
    }
    let begin = Instant::now();
    let threads = arguments.threads.map(usize::from);
    let result = study.run(threads, interrupt, &|| bar.inc(1));
    bar.finish_and_clear();
    tracing::info!(
        "{} trials in {:.1} s",
        bar.position(),
        begin.elapsed().as_secs_f64()
    );
    result
}

/// The study as people read it.
fn shown(result: &StudyResult) -> String {
    let mut out = format!("Study, seed {}\n", result.seed);
    let mut case = "";
    let mut rows = None;
    for row in &result.rows {
        if row.case != case {
            out.extend(rows.as_ref().map(lines));
            let _ = writeln!(
                out,
                "\n{}: recovered to {} mm",
                row.case,
                number(row.tolerance * 1e3)
            );
            let header = [
                "tool error [m]",
                "method",
                "recovered",
                "iterations",
                "median",
                "max",
                "r",
                "J",
                "tool [mm]",
                "angles [mrad]",
                "lengths [mm]",
            ];
            rows = Some(table(&header, &[1]));
            case = &row.case;
        }
        if let Some(rows) = &mut rows {
            rows.add_row(cells(row));
        }
    }
    out.extend(rows.as_ref().map(lines));
    out.push_str(
        "  tool error: mean before the estimate; iterations: mean, median and most; r, J: mean evaluations of the residual\n  \
         and of the Jacobian; tool: RMS error on fresh configurations after it, up to the symmetries, median over the\n  \
         trials; angles, lengths: RMS errors of the estimated parameters, median over the recovered robots.\n",
    );
    let first = |row: &&StudyRow| {
        let of = |other: &&StudyRow| (&other.case, other.tool_error) == (&row.case, row.tool_error);
        result
            .rows
            .iter()
            .find(of)
            .is_some_and(|first| first.method == row.method)
    };
    let parts = || result.rows.iter().filter(first);
    let unreached: usize = parts().map(|row| row.out_of_reach).sum();
    let redrawn: usize = parts().map(|row| row.redrawn).sum();
    if redrawn > 0 {
        let _ = writeln!(
            out,
            "planes, points or locations out of reach: drawn anew {redrawn} times, {unreached} trials given up"
        );
    }
    if !result.complete {
        let _ = writeln!(
            out,
            "stopped: this is about the trials that were finished, fewer than the {} asked for",
            result.trials
        );
    }
    out
}

fn cells(row: &StudyRow) -> Vec<String> {
    let some = |x: Option<f64>, factor: f64| x.map_or_else(|| "–".into(), |x| number(x * factor));
    let tenths = |x: Option<f64>| x.map_or_else(|| "–".into(), |x| format!("{x:.1}"));
    vec![
        format!("{:.4}", row.measured_tool_error),
        row.method.clone(),
        format!("{} of {}", row.recovered, row.trials),
        tenths(row.iterations.map(|i| i.mean)),
        tenths(row.iterations.map(|i| i.median)),
        row.iterations
            .map_or_else(|| "–".into(), |i| i.max.to_string()),
        tenths(row.residual_evaluations),
        tenths(row.jacobian_evaluations),
        some(row.final_tool_error, 1e3),
        some(row.angle_error, 1e3),
        some(row.length_error, 1e3),
    ]
}

/// The rows as CSV, with the numbers as they are in study.json.
fn csv(result: &StudyResult) -> String {
    let mut out = String::from(
        "case,method,tool_error [m],measured_tool_error [m],tolerance [m],trials,recovered,share,\
         iterations_mean,iterations_median,iterations_max,residual_evaluations,jacobian_evaluations,\
         final_tool_error [m],final_residual [m],angle_error [rad],length_error [m],redrawn,out_of_reach\n",
    );
    let some = |x: Option<f64>| x.map_or_else(String::new, |x| x.to_string());
    for row in &result.rows {
        let iterations = row.iterations;
        let cells = [
            quoted(&row.case),
            quoted(&row.method),
            some(row.tool_error),
            row.measured_tool_error.to_string(),
            row.tolerance.to_string(),
            row.trials.to_string(),
            row.recovered.to_string(),
            some(row.share),
            some(iterations.map(|i| i.mean)),
            some(iterations.map(|i| i.median)),
            iterations.map_or_else(String::new, |i| i.max.to_string()),
            some(row.residual_evaluations),
            some(row.jacobian_evaluations),
            some(row.final_tool_error),
            some(row.final_residual),
            some(row.angle_error),
            some(row.length_error),
            row.redrawn.to_string(),
            row.out_of_reach.to_string(),
        ];
        out += &(cells.join(",") + "\n");
    }
    out
}

fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
