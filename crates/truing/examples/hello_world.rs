//! Fits y = exp(a·t + b) to ten measurements; the derivatives come from automatic differentiation.
//!
//! `hello_world_analytic.rs` and `hello_world_numeric.rs` fit the same curve with derivatives written
//! by hand and taken by central differences. Run it: `cargo run --example hello_world`

use std::error::Error;
use std::io::Write;
use truing::manifold::Vector;
use truing::{Batch, Constraint, Noise, Problem, Scalar, Settings, Views, solve};

/// The measurements (t, y): a = 0.3, b = 0.1, with errors of about 0.02.
const MEASUREMENTS: [(f64, f64); 10] = [
    (0.0, 1.087),
    (0.5, 1.301),
    (1.0, 1.477),
    (1.5, 1.747),
    (2.0, 1.994),
    (2.5, 2.352),
    (3.0, 2.708),
    (3.5, 3.162),
    (4.0, 3.649),
    (4.5, 4.281),
];

// ANCHOR: constraint
// 1. A constraint supplies the residual of one measurement, in the measurement's own units. It is
//    written once over any scalar: plain numbers give the residual, dual numbers its derivatives.
struct Growth {
    t: f64,
    y: f64,
}

impl Constraint for Growth {
    type Vars = (Vector,);
    const DIM: usize = 1;

    fn residual<T: Scalar>(&self, (p,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = (p[0] * self.t + p[1]).exp() - self.y;
    }
}
// ANCHOR_END: constraint

/// Fits the curve and prints how.
pub fn run(out: &mut dyn Write) -> Result<[f64; 2], Box<dyn Error>> {
    // ANCHOR: problem
    // 2. A problem holds the variables with their starting values, and the constraints on them.
    let mut problem = Problem::new();
    let p = problem.add_variable::<Vector>("a, b", &vec![0.0, 0.0]);
    let mut growth = Batch::new("growth").noise(Noise::isotropic(0.02)?);
    for (t, y) in MEASUREMENTS {
        growth.push((p,), Growth { t, y });
    }
    problem.add_block(growth);

    // 3. The solution says why the solver stopped, with the numbers.
    let solution = solve(&problem, &Settings::default())?;
    write!(out, "{solution}")?;

    // 4. A variable is read from the values through its typed handle.
    let estimate = solution.values.get(p);
    writeln!(out, "a = {:.4}, b = {:.4}", estimate[0], estimate[1])?;
    // ANCHOR_END: problem
    Ok([estimate[0], estimate[1]])
}

fn main() -> Result<(), Box<dyn Error>> {
    run(&mut std::io::stdout())?;
    Ok(())
}
