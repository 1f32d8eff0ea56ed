//! How sure a fit is: a circle through readings of a short arc.
//!
//! Centre and radius of a short arc are hardly known, and go up and down together; the arc itself is
//! known well. One measurement that was misread is found.
//! Run it: `cargo run --example arc`

use std::error::Error;
use std::io::Write;
use truing::manifold::Vector;
use truing::statistics::{Prediction, Residuals};
use truing::{Batch, Constraint, Covariance, Noise, Problem, Scalar, Settings, Views, solve};

/// A place on a circle's rim \[mm\]: distance from the centre, less the radius.
struct OnCircle {
    x: f64,
    y: f64,
}

impl Constraint for OnCircle {
    type Vars = (Vector,);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (c,): Views<'_, Self, T>, r: &mut [T]) {
        let (dx, dy) = (c[0] - self.x, c[1] - self.y);
        r[0] = (dx * dx + dy * dy).sqrt() - c[2];
    }
}

// ANCHOR: function
/// Any function of the variables is a constraint: how far the rim is from the nominal centre (0, 0)
/// in some direction \[mm\].
struct Rim {
    direction: f64,
}

impl Constraint for Rim {
    type Vars = (Vector,);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (c,): Views<'_, Self, T>, r: &mut [T]) {
        // The longer root of ‖s·u − c‖ = R.
        let (u, v) = (self.direction.cos(), self.direction.sin());
        let along = c[0] * u + c[1] * v;
        let across = c[0] * v - c[1] * u;
        r[0] = along + (c[2] * c[2] - across * across).sqrt();
    }
}
// ANCHOR_END: function

/// Radius of the true circle about (0, 0), standard deviation of a reading \[mm\].
const RADIUS: f64 = 500.0;
const SIGMA: f64 = 0.01;

/// Errors of the readings, in standard deviations: numbers of the size that noise has.
const ERRORS: [f64; 13] = [
    0.46, -0.32, -0.07, 0.30, 0.06, 1.03, -1.47, 0.71, -0.53, 1.19, -0.22, -0.60, 0.26,
];

/// What came out \[mm\].
pub struct Arc {
    /// Radius and its standard deviation.
    pub radius: (f64, f64),
    /// The rim at 30° and at 180°.
    pub rim: [Prediction; 2],
    /// Correlation of the centre's x with the radius.
    pub correlation: f64,
    /// Leverages of the readings.
    pub leverage: Vec<f64>,
    /// The reading that is farthest off once one was misread, and its p-value.
    pub misread: (usize, f64),
}

/// A problem of readings over 60° of the rim.
fn readings(errors: &[f64]) -> Result<(Problem, truing::Var<Vector>), truing::Error> {
    let mut problem = Problem::new();
    let circle = problem.add_variable::<Vector>("circle", &vec![5.0, -5.0, 490.0]);
    problem.name_components(circle, &["x", "y", "R"].map(str::to_owned));
    let mut batch = Batch::new("rim").noise(Noise::isotropic(SIGMA)?);
    for (k, error) in errors.iter().enumerate() {
        let angle = (5.0 * k as f64).to_radians();
        let distance = RADIUS + SIGMA * error;
        let (x, y) = (distance * angle.cos(), distance * angle.sin());
        batch.push((circle,), OnCircle { x, y });
    }
    problem.add_block(batch);
    Ok((problem, circle))
}

/// Fits the arc and prints how sure everything is.
pub fn run(out: &mut dyn Write) -> Result<Arc, Box<dyn Error>> {
    // ANCHOR: deviations
    // 1. Fit, and the covariance there.
    let (problem, circle) = readings(&ERRORS)?;
    let values = solve(&problem, &Settings::default())?.values;
    let covariance = Covariance::at(&problem, &values)?;
    let sigmas = covariance.std_devs(circle);
    for (name, (value, sigma)) in ["x", "y", "R"]
        .iter()
        .zip(values.get(circle).iter().zip(&sigmas))
    {
        writeln!(out, "{name} = {value:.3} ± {sigma:.3} mm")?;
    }
    // ANCHOR_END: deviations

    // ANCHOR: chi_square
    // 2. Are the residuals as large as the noise that was stated?
    if let Some(test) = covariance.chi_square() {
        writeln!(out, "σ₀ = {:.2}: {}", covariance.sigma0(), test)?;
        writeln!(out, "{}", test.verdict(0.05))?;
    }
    // ANCHOR_END: chi_square

    // ANCHOR: correlations
    // 3. What goes up and down together.
    for pair in covariance.strongest_correlations(&problem, 0.9) {
        let (a, b) = &pair.names;
        writeln!(out, "{a} with {b}: {:+.3}", pair.coefficient)?;
    }
    // ANCHOR_END: correlations

    // ANCHOR: predict
    // 4. The rim where it was measured, and on the other side.
    let rim = [30.0_f64, 180.0].map(|degrees| {
        let direction = degrees.to_radians();
        covariance.predict((circle,), &Rim { direction }, &values)
    });
    for (degrees, rim) in [30, 180].iter().zip(&rim) {
        let (value, sigma) = (rim.value[0], rim.std_devs()[0]);
        writeln!(out, "rim at {degrees}°: {value:.3} ± {sigma:.3} mm")?;
    }
    // ANCHOR_END: predict

    // ANCHOR: residuals
    // 5. Which readings decide, and do they fit?
    let residuals = Residuals::at(&problem, &values, &covariance);
    for (k, reading) in residuals.constraints.iter().enumerate().step_by(3) {
        writeln!(
            out,
            "reading {k:2}: leverage {:.2}, standardised {:.2}, p = {:.2}",
            reading.leverage,
            reading.standardised(),
            reading.p_value
        )?;
    }
    // ANCHOR_END: residuals

    // ANCHOR: misread
    // 6. The last reading but one is misread by six of its standard deviations.
    let mut errors = ERRORS;
    errors[11] += 6.0;
    let (problem, _) = readings(&errors)?;
    let values_misread = solve(&problem, &Settings::default())?.values;
    let covariance_misread = Covariance::at(&problem, &values_misread)?;
    if let Some(test) = covariance_misread.chi_square() {
        writeln!(out, "misread: {test}")?;
    }
    let judged = Residuals::at(&problem, &values_misread, &covariance_misread);
    let p_values = judged.constraints.iter().map(|reading| reading.p_value);
    let farthest = p_values.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
    let (worst, p) = farthest.ok_or("there are readings")?;
    let limit = 0.05 / judged.constraints.len() as f64;
    writeln!(
        out,
        "reading {worst}: p = {p:.1e}, {limit:.1e} would be chance"
    )?;
    // ANCHOR_END: misread

    Ok(Arc {
        radius: (values.get(circle)[2], sigmas[2]),
        rim,
        correlation: covariance.correlation(circle.column(), circle.column() + 2),
        leverage: residuals.leverage,
        misread: (worst, p),
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    run(&mut std::io::stdout())?;
    Ok(())
}
