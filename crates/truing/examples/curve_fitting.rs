//! Fits a curve to published measurements and compares with the certified answer: no robot at all.
//!
//! The light of a carbon filament lamp grows with a power of its temperature; Stefan and Boltzmann say
//! the fourth. Six measurements ask the lamp itself. They are NIST's data set DanWood (Daniel & Wood
//! 1980, "Fitting Equations to Data", p. 428), in the public domain, with estimates and standard
//! deviations certified to eleven digits. Run it: `cargo run --example curve_fitting`

use std::error::Error;
use std::io::Write;
use truing::manifold::Vector;
use truing::{Batch, Constraint, Covariance, Problem, Scalar, Settings, Views, solve};

/// Temperature [1000 K] and radiated energy of the lamp.
const LAMP: [(f64, f64); 6] = [
    (1.309, 2.138),
    (1.471, 3.421),
    (1.490, 3.597),
    (1.565, 4.340),
    (1.611, 4.882),
    (1.680, 5.660),
];

/// NIST's estimates of b₁ and b₂.
pub const CERTIFIED: [f64; 2] = [7.6886226176e-1, 3.8604055871];
/// NIST's standard deviations of b₁ and b₂.
pub const CERTIFIED_SIGMA: [f64; 2] = [1.8281973860e-2, 5.1726610913e-2];

// ANCHOR: model
/// 1. The model, as what one measurement leaves over: r = b₁ T^b₂ − energy. It is written over any
///    scalar, so its derivatives need not be written at all.
struct Radiation {
    temperature: f64,
    energy: f64,
}

impl Constraint for Radiation {
    type Vars = (Vector,);
    const DIM: usize = 1;

    fn residual<T: Scalar>(&self, (b,): Views<'_, Self, T>, r: &mut [T]) {
        let power = (b[1] * self.temperature.ln()).exp();
        r[0] = b[0] * power - self.energy;
    }
}
// ANCHOR_END: model

/// The estimates of b₁ and b₂ with their standard deviations.
pub fn run(out: &mut dyn Write) -> Result<[(f64, f64); 2], Box<dyn Error>> {
    // ANCHOR: fit
    // 2. The unknowns with a guess (NIST's first, not a good one), and a constraint a measurement.
    let mut problem = Problem::new();
    let b = problem.add_variable::<Vector>("b", &vec![1.0, 5.0]);
    let mut lamp = Batch::new("lamp");
    for (temperature, energy) in LAMP {
        lamp.push(
            (b,),
            Radiation {
                temperature,
                energy,
            },
        );
    }
    problem.add_block(lamp);

    // 3. Solve, and see why it stopped.
    let solution = solve(&problem, &Settings::default())?;
    write!(out, "{solution}")?;

    // 4. Nobody said how precise the measurements are: σ₀, what the residuals themselves say of it,
    //    scales the covariance.
    let covariance = Covariance::at(&problem, &solution.values)?;
    let estimate = solution.values.get(b);
    let sigmas = covariance
        .std_devs(b)
        .into_iter()
        .map(|s| s * covariance.sigma0());
    // ANCHOR_END: fit

    let mut result = [(0.0, 0.0); 2];
    for (k, sigma) in sigmas.enumerate() {
        result[k] = (estimate[k], sigma);
        writeln!(out, "b{} = {:.10} ± {sigma:.10}", k + 1, estimate[k])?;
        writeln!(
            out,
            "NIST {:.10} ± {:.10}",
            CERTIFIED[k], CERTIFIED_SIGMA[k]
        )?;
    }
    let (power, sigma) = result[1];
    let away = (power - 4.0).abs() / sigma;
    writeln!(
        out,
        "The fourth power is {away:.1} standard deviations away."
    )?;
    Ok(result)
}

fn main() -> Result<(), Box<dyn Error>> {
    run(&mut std::io::stdout())?;
    Ok(())
}
