//! Fits y = exp(a·t + b) as `hello_world.rs` does, with derivatives written by hand.
//!
//! Run it: `cargo run --example hello_world_analytic`

use std::error::Error;
use std::io::Write;
use truing::manifold::Vector;
use truing::{
    Batch, Constraint, Jacobian, Noise, Point, Problem, Scalar, Settings, Views, assert_jacobian,
    solve,
};

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

struct Growth {
    t: f64,
    y: f64,
}

// ANCHOR: constraint
impl Constraint for Growth {
    type Vars = (Vector,);
    const DIM: usize = 1;

    // 1. The residual stays as it was: plain evaluation and the checkers use it.
    fn residual<T: Scalar>(&self, (p,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = (p[0] * self.t + p[1]).exp() - self.y;
    }

    // 2. `linearize` writes r and J together: ∂r/∂a = t·exp(a·t + b), ∂r/∂b = exp(a·t + b).
    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let (p,) = at.views();
        let model = (p[0] * self.t + p[1]).exp();
        r[0] = model - self.y;
        j.set(0, 0, 0, self.t * model); // variable, row, column, value
        j.set(0, 0, 1, model);
    }
}
// ANCHOR_END: constraint

/// Fits the curve and prints how.
pub fn run(out: &mut dyn Write) -> Result<[f64; 2], Box<dyn Error>> {
    let mut problem = Problem::new();
    let p = problem.add_variable::<Vector>("a, b", &vec![0.0, 0.0]);
    let mut growth = Batch::new("growth").noise(Noise::isotropic(0.02)?);
    for (t, y) in MEASUREMENTS {
        growth.push((p,), Growth { t, y });
    }
    problem.add_block(growth);

    // ANCHOR: check
    // 3. Derivatives written by hand are checked against central differences, column by column.
    assert_jacobian!(&problem, problem.initial());
    // ANCHOR_END: check

    let solution = solve(&problem, &Settings::default())?;
    write!(out, "{solution}")?;
    let estimate = solution.values.get(p);
    writeln!(out, "a = {:.4}, b = {:.4}", estimate[0], estimate[1])?;
    Ok([estimate[0], estimate[1]])
}

fn main() -> Result<(), Box<dyn Error>> {
    run(&mut std::io::stdout())?;
    Ok(())
}
