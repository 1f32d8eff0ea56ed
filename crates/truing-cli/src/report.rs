//! The report as one HTML page that needs nothing else.

use crate::failure::Failure;
use crate::show::{digits, own_numbers, people, set_aside, taken_over};
use crate::show_statistics::{place, probability, sentences};
use crate::words::{number, shown, titled};
use minijinja::{Environment, context};
use plotters::prelude::*;
use std::collections::BTreeSet;
use truing_robot::Outcome;
use truing_robot::identify::Status;
use truing_robot::judge::{Correlated, ErrorSeries, ErrorSummary, Outlier};
use truing_robot::result::CalibrationResult;

const TEMPLATE: &str = include_str!("report.html");

/// The page.
pub fn html(outcome: &Outcome, source: &str) -> Result<String, Failure> {
    let result = &outcome.result;
    let failed = |what: &str| {
        Failure::new(
            format!("cannot make the report: {what}"),
            "report this with the calibration file",
        )
    };
    let mut plots = Vec::new();
    for series in &outcome.errors {
        let svg = plot(series).map_err(|e| failed(&e))?;
        let rows = if series.held_out {
            "rows that were not used"
        } else {
            "rows that were used"
        };
        let what = if series.signed {
            "signed errors"
        } else {
            "lengths of the errors"
        };
        let caption = format!(
            "{} ({}), {rows}: {what} [{}], measurement by measurement",
            series.name,
            series.kind,
            shown(series.unit).1
        );
        plots.push(context! { svg, caption });
    }
    let names: Vec<&str> = outcome
        .robots
        .iter()
        .map(|(_, robot)| robot.name.as_str())
        .collect();
    let robot: BTreeSet<&str> = result.parameters.iter().map(|p| p.name.as_str()).collect();
    let parameters: Vec<_> = result
        .parameters
        .iter()
        .map(|p| {
            let (factor, unit) = people(p);
            let estimated = p.status == Status::Estimated;
            let shown = |x: f64| if estimated { number(x * factor) } else { "–".into() };
            let status = match (&p.status, p.at_bound) {
                (Status::Regrouped | Status::Held, _) => taken_over(p, &robot),
                (_, Some(side)) => format!("estimated, at its {side} bound"),
                (status, None) => status.name().to_owned(),
            };
            context! {
                name => p.name, nominal => number(p.nominal * factor), estimate => shown(p.estimate),
                change => shown(p.estimate - p.nominal), unit, status, estimated,
                sigma => p.sigma.map_or_else(|| "–".into(), |s| number(s * factor)),
            }
        })
        .collect();
    let shown_error = |e: Option<f64>, unit: &str| {
        let (factor, unit) = shown(unit);
        let other = match unit {
            "mm" => String::new(),
            unit => format!(" {unit}"),
        };
        e.map_or_else(|| "–".into(), |e| number(e * factor) + &other)
    };
    let rms = |e: &Option<ErrorSummary>, unit: &str| shown_error(e.as_ref().map(|e| e.rms), unit);
    let max = |e: &Option<ErrorSummary>, unit: &str| shown_error(e.as_ref().map(|e| e.max), unit);
    let used = result.constraints.iter().map(|set| (set, ""));
    let unused = result.validation.iter().map(|set| (set, " (not used)"));
    let sets: Vec<_> = used
        .chain(unused)
        .map(|(set, note)| {
            context! {
                name => format!("{}{note}", set.name), kind => set.kind, count => set.count,
                before => rms(&set.before, set.unit), registered => rms(&set.registered, set.unit),
                after => rms(&set.after, set.unit), registered_max => max(&set.registered, set.unit),
                after_max => max(&set.after, set.unit),
            }
        })
        .collect();
    let page = context! {
        robots => names.join(" and "),
        trusted => result.trusted,
        termination => result.termination.message,
        iterations => result.iterations,
        warnings => result.warnings,
        identifiable => result.identifiable,
        estimated => result.parameters.iter().filter(|p| p.status == Status::Estimated).count(),
        condition => result.condition.map_or_else(|| "–".into(), |c| format!("{c:.3e}")),
        sigma0 => result.sigma0.map_or_else(|| "–".into(), number),
        sets, plots, parameters,
        set_aside => set_aside(result),
        places => places(result),
        sentences => sentences(result),
        outliers => outliers(result),
        correlations => correlations(result),
        version => env!("CARGO_PKG_VERSION"),
        source,
    };
    let mut environment = Environment::new();
    environment
        .add_template("report.html", TEMPLATE)
        .map_err(|e| failed(&e.to_string()))?;
    let template = environment
        .get_template("report.html")
        .map_err(|e| failed(&e.to_string()))?;
    template.render(page).map_err(|e| failed(&e.to_string()))
}

/// So many outliers and correlations have a line; the files have them all.
const LISTED: usize = 20;

fn outliers(result: &CalibrationResult) -> Vec<minijinja::Value> {
    let line = |o: &Outlier| {
        context! {
            constraint => o.constraint,
            place => place(&o.constraint, o.file.as_deref(), o.line, o.row),
            error => number(o.error * 1e3),
            standardised => o.standardised.map_or_else(|| "–".into(), |s| format!("{s:.1}")),
            p => o.p_value.map_or_else(|| "–".into(), probability),
            weight => o.weight.map_or_else(|| "–".into(), |w| format!("{w:.2}")),
        }
    };
    result.outliers.iter().take(LISTED).map(line).collect()
}

fn correlations(result: &CalibrationResult) -> Vec<minijinja::Value> {
    let line = |c: &Correlated| {
        context! { a => c.a, b => c.b, coefficient => format!("{:+.3}", c.coefficient) }
    };
    result.correlations.iter().take(LISTED).map(line).collect()
}

fn places(result: &CalibrationResult) -> Vec<minijinja::Value> {
    let place = |what: &str, name: String, position: String| context! { what, name, position };
    let meters = |p: [f64; 3]| format!("({:.6}, {:.6}, {:.6}) m", p[0], p[1], p[2]);
    let mut all = Vec::new();
    for frame in &result.frames {
        let [w, x, y, z] = frame.quaternion;
        let turn = format!(
            "{}, quaternion (w, x, y, z) ({w:.6}, {x:.6}, {y:.6}, {z:.6})",
            meters(frame.position)
        );
        all.push(place("sensor frame", frame.name.clone(), turn));
    }
    for target in &result.targets {
        let name = if target.robot.is_empty() {
            target.name.clone()
        } else {
            format!("{}.{}", target.robot, target.name)
        };
        all.push(place("tool point", name, meters(target.position)));
    }
    for plane in &result.planes {
        let [x, y, z] = plane.normal;
        let text = format!(
            "normal ({x:.6}, {y:.6}, {z:.6}), distance {:.6} m",
            plane.distance
        );
        all.push(place(
            "plane",
            titled(&plane.constraint, &plane.group),
            text,
        ));
    }
    for point in &result.points {
        all.push(place(
            "point",
            titled(&point.constraint, &point.group),
            meters(point.position),
        ));
    }
    for (name, distance) in &result.distances {
        all.push(place(
            "distance",
            name.clone(),
            format!("{} mm", number(distance * 1e3)),
        ));
    }
    for component in own_numbers(result) {
        let (factor, unit) = shown(component.unit);
        let value = digits(component.estimate.unwrap_or(f64::NAN) * factor);
        let name = component.name.clone();
        all.push(place("unknown", name, format!("{value} {unit}")));
    }
    all
}

/// Errors of a set over its measurements: on the left with the registered (grey) and the calibrated
/// robot (blue), on the right with the calibrated one alone, on its own scale.
fn plot(series: &ErrorSeries) -> Result<String, String> {
    let mut svg = String::new();
    draw(series, &mut svg).map_err(|e| e.to_string())?;
    Ok(svg)
}

/// A label of the axis that reaches up to `high`: zero is not rounding, and no digits to spare.
fn tick(y: f64, high: f64) -> String {
    if y.abs() < 1e-6 * high {
        "0".into()
    } else if high < 1e-3 {
        format!("{y:.1e}")
    } else {
        ((y * 1e4).round() / 1e4).to_string()
    }
}

const GREY: RGBColor = RGBColor(150, 150, 150);
const BLUE: RGBColor = RGBColor(28, 92, 168);

fn draw(series: &ErrorSeries, svg: &mut String) -> Result<(), Box<dyn std::error::Error>> {
    let factor = shown(series.unit).0;
    let scaled = |errors: &[f64]| errors.iter().map(|e| e * factor).collect::<Vec<_>>();
    let registered = (scaled(&series.registered), GREY, "registered");
    let calibrated = (scaled(&series.calibrated), BLUE, "calibrated");
    let area = SVGBackend::with_string(svg, (1000, 260)).into_drawing_area();
    let halves = area.split_evenly((1, 2));
    for (half, shown) in halves
        .iter()
        .zip([vec![&registered, &calibrated], vec![&calibrated]])
    {
        let all = || shown.iter().flat_map(|(errors, ..)| errors.iter().copied());
        // Room above for the legend; a set without any error still needs an axis.
        let high = all().fold(0.0, f64::max).max(1e-9) * 1.25;
        let low = all().fold(0.0, f64::min) * 1.1;
        let mut chart = ChartBuilder::on(half)
            .margin(8)
            .x_label_area_size(28)
            .y_label_area_size(64)
            .build_cartesian_2d(-0.5..calibrated.0.len() as f64 - 0.5, low..high)?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .light_line_style(WHITE)
            .x_labels(6)
            .y_labels(6)
            .x_label_formatter(&|x| format!("{x:.0}"))
            .y_label_formatter(&|y| tick(*y, high))
            .draw()?;
        for (errors, color, name) in shown {
            let dots = errors
                .iter()
                .enumerate()
                .map(|(k, e)| Circle::new((k as f64, *e), 3, color.filled()));
            let key = color.filled();
            chart
                .draw_series(dots)?
                .label(*name)
                .legend(move |(x, y)| Circle::new((x + 8, y), 3, key));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .background_style(WHITE.mix(0.8))
            .draw()?;
    }
    area.present()?;
    drop(halves);
    Ok(())
}
