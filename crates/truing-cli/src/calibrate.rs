//! `truing calibrate`.

use crate::args::Calibrate;
use crate::failure::{Failure, Files};
use crate::streams::{Ending, Streams};
use crate::{interrupt, output, report, show};
use indicatif::{ProgressBar, ProgressStyle};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use truing::solver::Progress;
use truing_robot::file::CalibrationFile;
use truing_robot::load::load_with;
use truing_robot::{Calibration, Outcome};

/// Runs a calibration file.
pub fn run(arguments: &Calibrate, streams: &Streams) -> Result<Ending, Failure> {
    if let Some(folder) = &arguments.output {
        output::check(folder, arguments.force)?;
    }
    let file = CalibrationFile::read_with(&arguments.file, &streams.registry)?;
    let mut calibration = load_with(&file, &streams.registry)?;
    tracing::info!(
        "robots: {}, sets of measurements: {}, measurements: {}",
        calibration.arms.len(),
        calibration.sets.len(),
        calibration.sets.iter().map(|set| set.len()).sum::<usize>()
    );
    let outcome =
        solve(&mut calibration, arguments).map_err(|failure| failure.about(&arguments.file))?;
    streams.say(&show::result(&outcome.result));
    let mut result = serde_json::to_string_pretty(&outcome.result).map_err(|e| {
        Failure::new(
            format!("cannot write the result as JSON: {e}"),
            "report this with the calibration file",
        )
    })?;
    result.push('\n');
    if let Some(folder) = &arguments.output {
        if outcome.result.trusted || arguments.keep_untrusted || arguments.force {
            let written = output::write(folder, &files(&outcome, &arguments.file, &result)?)?;
            for path in written {
                streams.say(&format!("wrote {}\n", path.display()));
            }
        } else {
            streams.say(&format!(
                "nothing written to {}: the result must not be trusted; write it all the same with --keep-untrusted or --force\n",
                folder.display()
            ));
        }
    }
    if streams.json {
        streams.print(&result);
    }
    Ok(if outcome.result.trusted {
        Ending::Good
    } else {
        Ending::Untrusted
    })
}

fn solve(calibration: &mut Calibration, arguments: &Calibrate) -> Result<Outcome, Failure> {
    let bar = ProgressBar::new_spinner();
    if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} ({elapsed})") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(120));
    let interrupt = interrupt::on_ctrl_c();
    let settings = &mut calibration.estimate.settings;
    settings.interrupt = Some(interrupt);
    settings.timeout = arguments.timeout.map(Duration::from_secs);
    let told = bar.clone();
    settings.progress = Some(Arc::new(move |p: Progress| {
        told.set_message(format!(
            "estimating: iteration {}, cost {:.6e}",
            p.iteration, p.cost
        ));
    }));
    let outcome = calibration.run(&|stage| {
        tracing::info!("{}", stage.describe());
        bar.set_message(stage.describe());
    });
    bar.finish_and_clear();
    Ok(outcome?)
}

fn files(outcome: &Outcome, source: &std::path::Path, result: &str) -> Result<Files, Failure> {
    let made_from = source.file_name().map_or_else(
        || source.display().to_string(),
        |n| n.to_string_lossy().into_owned(),
    );
    let mut files = vec![
        (PathBuf::from("result.json"), result.to_owned()),
        (
            PathBuf::from("report.html"),
            report::html(outcome, &made_from)?,
        ),
        (PathBuf::from("residuals.csv"), residuals(outcome)),
    ];
    for (name, robot) in &outcome.robots {
        let path = if name.is_empty() {
            "robot.toml".to_owned()
        } else {
            format!("robot-{name}.toml")
        };
        let version = env!("CARGO_PKG_VERSION");
        let trust = if outcome.result.trusted {
            ""
        } else {
            " NOT TO BE TRUSTED: see result.json."
        };
        let header = format!("Calibrated by truing {version} from {made_from}.{trust}");
        files.push((PathBuf::from(path), robot.to_toml(&header)));
    }
    Ok(files)
}

/// Every measurement that was used, a row each, in metres.
fn residuals(outcome: &Outcome) -> String {
    let mut out = String::from(
        "constraint,row,file,line,values,error,standardised,p_value,leverage,cook,tool_sigma\n",
    );
    let number = |x: Option<f64>| x.map_or_else(String::new, |x| format!("{x:e}"));
    for m in &outcome.measurements {
        let cells = [
            quoted(&m.constraint),
            m.row.to_string(),
            m.file.as_deref().map_or_else(String::new, quoted),
            m.line.map_or_else(String::new, |line| line.to_string()),
            m.values.to_string(),
            number(Some(m.error)),
            number(m.standardised),
            number(m.p_value),
            number(m.leverage),
            number(m.cook),
            number(m.tool_sigma),
        ];
        out += &cells.join(",");
        out.push('\n');
    }
    out
}

/// A cell of a CSV file.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
