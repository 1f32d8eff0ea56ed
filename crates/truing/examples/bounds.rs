//! Bounds and linear limits: how much of three substances is in a mixture, from a decay curve.
//!
//! Shares cannot be negative and add up to one; a fit that does not know this finds a negative share.
//! Run it: `cargo run --example bounds`

use std::error::Error;
use std::io::Write;
use truing::manifold::Vector;
use truing::{
    Batch, Constraint, LinearLimit, Noise, Problem, Scalar, Settings, Solution, Views, solve,
};

/// The measurements (t \[s\], y) of a mixture of 0.7 of the first substance and 0.3 of the second, none
/// of the third, with errors of 0.005.
const MEASUREMENTS: [(f64, f64); 12] = [
    (0.0, 1.0005),
    (0.2, 0.7469),
    (0.4, 0.5555),
    (0.6, 0.4380),
    (0.8, 0.3411),
    (1.0, 0.2754),
    (1.4, 0.2010),
    (1.8, 0.1419),
    (2.4, 0.0959),
    (3.0, 0.0723),
    (4.0, 0.0465),
    (5.0, 0.0245),
];

/// What each substance decays with [1/s].
const RATES: [f64; 3] = [2.0, 0.5, 0.8];

/// Σ shareₖ exp(−rateₖ · t / stretch) − y: the clock may run fast or slow.
struct Decay {
    t: f64,
    y: f64,
}

impl Constraint for Decay {
    type Vars = (Vector, Vector);
    const DIM: usize = 1;

    fn residual<T: Scalar>(&self, (shares, stretch): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = T::from(-self.y);
        for (share, rate) in shares.iter().zip(RATES) {
            r[0] += *share * (stretch[0].recip() * (-rate * self.t)).exp();
        }
    }
}

/// Fits the shares, with or without limits.
fn fit(limited: bool) -> Result<([f64; 3], Solution), Box<dyn Error>> {
    // ANCHOR: limits
    let mut problem = Problem::new();
    // The start may be anywhere: one that breaks a limit moves to the nearest point that does not.
    let shares = problem.add_variable::<Vector>("shares", &vec![1.0, 1.0, 1.0]);
    let stretch = problem.add_variable::<Vector>("stretch", &vec![1.0]);
    problem.name_components(shares, &["first", "second", "third"].map(String::from));
    if limited {
        for k in 0..3 {
            problem.bound_component(shares, k, 0.0, f64::INFINITY);
        }
        problem.add_limit(
            LinearLimit::new("shares add up to one")
                .term(shares, 0, 1.0)
                .term(shares, 1, 1.0)
                .term(shares, 2, 1.0)
                .equals(1.0),
        );
        problem.bound_component(stretch, 0, 0.9, 1.1);
    }
    // ANCHOR_END: limits
    let mut decay = Batch::new("decay").noise(Noise::isotropic(0.005)?);
    for (t, y) in MEASUREMENTS {
        decay.push((shares, stretch), Decay { t, y });
    }
    problem.add_block(decay);
    let solution = solve(&problem, &Settings::default())?;
    let found = solution.values.get(shares);
    Ok(([found[0], found[1], found[2]], solution))
}

/// Fits it both ways; the shares without and with limits.
pub fn run(out: &mut dyn Write) -> Result<[[f64; 3]; 2], Box<dyn Error>> {
    let (free, _) = fit(false)?;
    writeln!(
        out,
        "without limits: {:.3} {:.3} {:.3}, together {:.3}",
        free[0],
        free[1],
        free[2],
        free.iter().sum::<f64>()
    )?;
    let (limited, solution) = fit(true)?;
    writeln!(
        out,
        "with limits:    {:.3} {:.3} {:.3}, together {:.3}",
        limited[0],
        limited[1],
        limited[2],
        limited.iter().sum::<f64>()
    )?;
    write!(out, "{solution}")?;
    Ok([free, limited])
}

fn main() -> Result<(), Box<dyn Error>> {
    run(&mut std::io::stdout())?;
    Ok(())
}
