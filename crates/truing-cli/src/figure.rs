//! The figure of a study: shares of recovered robots against the tool error, a panel a case.

use crate::failure::Failure;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use truing_robot::study::{StudyResult, StudyRow};

/// Colours that people with any kind of colour vision tell apart (Okabe & Ito 2008).
const COLORS: [RGBColor; 7] = [
    RGBColor(213, 94, 0),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];

/// Width and height of a panel, height of a line of the legend.
const PANEL: (u32, u32) = (400, 300);
const LINE: u32 = 22;

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// The figure as SVG.
pub fn shares(result: &StudyResult) -> std::result::Result<String, Failure> {
    let mut svg = String::new();
    draw(result, &mut svg).map_err(|e| {
        Failure::new(
            format!("cannot make the figure: {e}"),
            "report this with the study file",
        )
    })?;
    Ok(svg)
}

fn draw(result: &StudyResult, svg: &mut String) -> Result<()> {
    let cases = names(result, |row| &row.case);
    let methods = names(result, |row| &row.method);
    let across = cases.len().clamp(1, 3);
    let down = cases.len().div_ceil(across).max(1);
    let legend = LINE * methods.len() as u32 + 14;
    let size = (PANEL.0 * across as u32, PANEL.1 * down as u32 + legend);
    let area = SVGBackend::with_string(svg, size).into_drawing_area();
    area.fill(&WHITE)?;
    let (panels, key) = area.split_vertically(PANEL.1 * down as u32);
    for (case, panel) in cases.iter().zip(panels.split_evenly((down, across))) {
        draw_panel(result, case, &methods, &panel)?;
    }
    let style = ("sans-serif", 15).into_font().color(&BLACK);
    for (m, method) in methods.iter().enumerate() {
        let y = (LINE * m as u32 + LINE / 2) as i32;
        let line = vec![(64, y), (104, y)];
        key.draw(&PathElement::new(line, stroke(m, methods.len())))?;
        mark(m, (84, y), &key)?;
        let style = style.pos(Pos::new(HPos::Left, VPos::Center));
        key.draw(&Text::new((*method).to_owned(), (114, y), style))?;
    }
    area.present()?;
    drop((panels, key));
    Ok(())
}

/// Names in the order in which they come.
fn names(result: &StudyResult, of: fn(&StudyRow) -> &String) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for row in &result.rows {
        if !names.contains(&of(row).as_str()) {
            names.push(of(row));
        }
    }
    names
}

fn color(method: usize) -> RGBColor {
    COLORS[method % COLORS.len()]
}

/// Earlier lines are wider, so that they show under later ones.
fn stroke(method: usize, methods: usize) -> ShapeStyle {
    let width = 2 + 2 * (methods - 1 - method).min(3) as u32;
    color(method).stroke_width(width)
}

/// A circle, triangle or cross at a place in pixels.
fn mark<DB: DrawingBackend>(
    method: usize,
    at: (i32, i32),
    area: &DrawingArea<DB, Shift>,
) -> Result<()>
where
    DB::ErrorType: 'static,
{
    let style = color(method).filled();
    match method % 3 {
        0 => area.draw(&Circle::new(at, 6, style))?,
        1 => area.draw(&TriangleMarker::new(at, 6, style))?,
        _ => area.draw(&Cross::new(at, 5, color(method).stroke_width(2)))?,
    }
    Ok(())
}

fn draw_panel<DB: DrawingBackend>(
    result: &StudyResult,
    case: &str,
    methods: &[&str],
    panel: &DrawingArea<DB, Shift>,
) -> Result<()>
where
    DB::ErrorType: 'static,
{
    let rows = || result.rows.iter().filter(|row| row.case == case);
    let most = rows()
        .map(|row| row.measured_tool_error)
        .fold(0.0, f64::max);
    let right = if most > 0.0 { 1.08 * most } else { 1.0 };
    let mut chart = ChartBuilder::on(panel)
        .caption(case, ("sans-serif", 17))
        .margin(10)
        .x_label_area_size(44)
        .y_label_area_size(52)
        .build_cartesian_2d(0.0..right, -4.0..104.0)?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .bold_line_style(RGBColor(225, 225, 225))
        .x_labels(7)
        .y_labels(6)
        .y_label_formatter(&|y| format!("{y:.0}"))
        .x_label_formatter(&|x| ((x * 1e6).round() / 1e6).to_string())
        .label_style(("sans-serif", 13))
        .axis_desc_style(("sans-serif", 14))
        .x_desc("mean initial tool error [m]")
        .y_desc("recovered [%]")
        .draw()?;
    for (m, method) in methods.iter().enumerate() {
        let of_method = rows().filter(|row| row.method == *method);
        let mut points: Vec<(f64, f64)> = of_method
            .filter_map(|row| Some((row.measured_tool_error, 100.0 * row.share?)))
            .collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        chart.draw_series(LineSeries::new(points.clone(), stroke(m, methods.len())))?;
        let area = chart.plotting_area();
        for point in &points {
            let at = area.map_coordinate(point);
            let origin = panel.get_base_pixel();
            mark(m, (at.0 - origin.0, at.1 - origin.1), panel)?;
        }
    }
    Ok(())
}
