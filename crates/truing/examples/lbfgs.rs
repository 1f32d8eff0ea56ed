//! One problem, two optimisers: Truing's Levenberg–Marquardt and argmin's L-BFGS find the same pose.
//!
//! A `Problem` implements argmin's `CostFunction`, `Gradient`, `Operator` and `Jacobian` over the
//! tangent at its starting values, so that argmin's own solvers run on it. For least squares they
//! are second choice: L-BFGS sees only the gradient. Run it: `cargo run --example lbfgs`

use argmin::core::{Executor, State};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use nalgebra::Vector3;
use std::error::Error;
use std::io::Write;
use truing::manifold::{Pose, Pose3};
use truing::{Batch, Constraint, Noise, Problem, Scalar, Settings, Var, Views, solve};

/// Landmarks in the body's frame and as they were measured in the world [m], with errors of 1 mm: the
/// body was turned by 90° about z and moved by (1, 2, 0.5).
const LANDMARKS: [([f64; 3], [f64; 3]); 5] = [
    ([0.0, 0.0, 0.0], [1.0008, 1.9991, 0.5004]),
    ([0.4, 0.0, 0.0], [0.9994, 2.4007, 0.4989]),
    ([0.0, 0.3, 0.0], [0.7003, 2.0002, 0.5006]),
    ([0.0, 0.0, 0.2], [1.0011, 1.9995, 0.7001]),
    ([0.4, 0.3, 0.2], [0.6988, 2.4004, 0.6997]),
];

/// base_from_body · body − measured.
struct Landmark {
    body: Vector3<f64>,
    measured: Vector3<f64>,
}

impl Constraint for Landmark {
    type Vars = (Pose3,);
    const DIM: usize = 3;

    fn residual<T: Scalar>(&self, (pose,): Views<'_, Self, T>, r: &mut [T]) {
        for i in 0..3 {
            r[i] = pose.translation[i] - self.measured[i];
            for k in 0..3 {
                r[i] += pose.rotation[(i, k)] * self.body[k];
            }
        }
    }
}

fn problem() -> Result<(Problem, Var<Pose3>), Box<dyn Error>> {
    let mut problem = Problem::new();
    let pose = problem.add_variable::<Pose3>("base_from_body", &Pose::identity());
    let mut landmarks = Batch::new("landmarks").noise(Noise::isotropic(1e-3)?);
    for (body, measured) in LANDMARKS {
        landmarks.push(
            (pose,),
            Landmark {
                body: body.into(),
                measured: measured.into(),
            },
        );
    }
    problem.add_block(landmarks);
    Ok((problem, pose))
}

/// Solves it both ways; the costs.
pub fn run(out: &mut dyn Write) -> Result<[f64; 2], Box<dyn Error>> {
    let (problem, pose) = problem()?;
    let ours = solve(&problem, &Settings::default())?;
    writeln!(
        out,
        "Levenberg-Marquardt: cost {:.6} after {} evaluations",
        ours.cost,
        ours.evaluations.residual + ours.evaluations.jacobian
    )?;

    // ANCHOR: lbfgs
    // The parameter is the tangent at the starting values: all zeros is the start.
    let start = vec![0.0; problem.cols()];
    let lbfgs = LBFGS::new(MoreThuenteLineSearch::new(), 7).with_tolerance_grad(1e-6)?;
    let result = Executor::new(problem, lbfgs)
        .configure(|state| state.param(start).max_iters(200).counting(true))
        .run()?;
    let best = result.state.get_best_param().ok_or("no iteration")?;
    let problem = result.problem.problem.ok_or("no problem")?;
    let values = problem.at(best)?;
    // ANCHOR_END: lbfgs
    let cost = result.state.get_best_cost();
    let counts = &result.state.get_func_counts();
    let evaluations: u64 = counts.values().sum();
    writeln!(
        out,
        "L-BFGS: cost {cost:.6} after {evaluations} evaluations"
    )?;
    let position = values.get(pose).translation;
    writeln!(
        out,
        "position {:.4} {:.4} {:.4} m",
        position.x, position.y, position.z
    )?;
    Ok([ours.cost, cost])
}

fn main() -> Result<(), Box<dyn Error>> {
    run(&mut std::io::stdout())?;
    Ok(())
}
