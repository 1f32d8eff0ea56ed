//! How sure a calibration is, as people read it.

use crate::words::number;
use truing_robot::judge::{Correlated, GlobalTest, Outlier, ToolUncertainty};
use truing_robot::result::CalibrationResult;

/// How many correlations and outliers are named; the files have them all.
const NAMED: usize = 3;

/// A few sentences, a line each.
pub fn lines(result: &CalibrationResult) -> String {
    sentences(result)
        .into_iter()
        .map(|sentence| sentence + "\n")
        .collect()
}

/// What the statistics say, in sentences.
pub fn sentences(result: &CalibrationResult) -> Vec<String> {
    let mut all: Vec<String> = result.statistics.iter().filter_map(residuals).collect();
    all.extend(result.tools.iter().map(tool));
    all.extend(outliers(&result.outliers));
    all.extend(correlations(&result.correlations));
    all
}

/// Whether the residuals are as large as stated.
fn residuals(test: &GlobalTest) -> Option<String> {
    let verdict = match test.verdict? {
        "too-large" => {
            "larger than `sigma` explains: more noise than stated, outliers, or something that the model lacks"
        }
        "too-small" => "smaller than `sigma` says: less noise than stated",
        _ => "as large as `sigma` says",
    };
    Some(format!(
        "the residuals are {verdict} (χ² = {:.1} of {} degrees of freedom, p {})",
        test.chi_square?,
        (test.degrees_of_freedom * 10.0).round() / 10.0,
        match probability(test.p_value?) {
            below if below.starts_with('<') => below,
            p => format!("= {p}"),
        }
    ))
}

/// How well a tool is known, as far as noise goes: of errors that the model cannot express the
/// covariance knows nothing.
fn tool(tool: &ToolUncertainty) -> String {
    let whose = if tool.robot.is_empty() {
        String::new()
    } else {
        format!(" of {}", tool.robot)
    };
    let given = if tool.given_held {
        ", given what is held"
    } else {
        ""
    };
    format!(
        "noise leaves the tool position{whose} uncertain by {} mm where it was measured (1 σ{given}; worst {} mm at {})",
        number(tool.rms * 1e3),
        number(tool.worst * 1e3),
        place(&tool.constraint, tool.file.as_deref(), tool.line, tool.row)
    )
}

fn outliers(all: &[Outlier]) -> Option<String> {
    // Those that a loss has set aside are told of by set.
    let all: Vec<&Outlier> = all.iter().filter(|o| o.weight.is_none()).collect();
    let named: Vec<String> = (all.iter().take(NAMED))
        .map(|o| {
            format!(
                "{} ({} mm, {:.1} σ)",
                place(&o.constraint, o.file.as_deref(), o.line, o.row),
                number(o.error * 1e3),
                o.standardised.unwrap_or(f64::INFINITY)
            )
        })
        .collect();
    let (is, them) = match all.len() {
        0 => return None,
        1 => ("measurement is", "it"),
        _ => ("measurements are", "them"),
    };
    Some(format!(
        "{} {is} farther off than chance explains: {}{}; look at {them}, or use `loss`",
        all.len(),
        named.join(", "),
        more(all.len())
    ))
}

fn correlations(all: &[Correlated]) -> Option<String> {
    let named: Vec<String> = all
        .iter()
        .take(NAMED)
        .map(|c| {
            let sign = if c.coefficient < 0.0 { '−' } else { '+' };
            format!("{} with {} {sign}{:.3}", c.a, c.b, c.coefficient.abs())
        })
        .collect();
    (!all.is_empty()).then(|| {
        format!(
            "strongly correlated: {}{}",
            named.join(", "),
            more(all.len())
        )
    })
}

fn more(count: usize) -> String {
    match count.saturating_sub(NAMED) {
        0 => String::new(),
        rest => format!(" and {rest} more"),
    }
}

/// A probability, rounded.
pub fn probability(p: f64) -> String {
    match p {
        p if p < 1e-16 => "< 1e-16".to_owned(),
        p if p < 1e-3 => format!("{p:.0e}"),
        p if p < 0.01 => format!("{p:.3}"),
        p => format!("{p:.2}"),
    }
}

/// Where a measurement is: a line of a file, or a row of a set.
pub fn place(constraint: &str, file: Option<&str>, line: Option<usize>, row: usize) -> String {
    match (file, line) {
        (Some(file), Some(line)) => format!("line {line} of {file}"),
        _ => format!("row {row} of {constraint}"),
    }
}
