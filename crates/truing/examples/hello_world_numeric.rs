//! Fits y = exp(a·t + b) as `hello_world.rs` does, with derivatives taken by central differences.
//!
//! Run it: `cargo run --example hello_world_numeric`

use std::error::Error;
use std::io::Write;
use truing::manifold::Vector;
use truing::{
    Batch, Constraint, Jacobian, Noise, Point, Problem, Scalar, Settings, Views, autodiff, solve,
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

    fn residual<T: Scalar>(&self, (p,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = (p[0] * self.t + p[1]).exp() - self.y;
    }

    // 1. Central differences need two evaluations a column and give about ten digits: for models
    //    that dual numbers cannot pass through, and as a reference for the other two.
    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        autodiff::central_differences(self, at, r, j);
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
