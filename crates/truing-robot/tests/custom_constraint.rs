//! A constraint written outside the crates in about ten lines joins a calibration problem, once with
//! automatic and once with hand-written derivatives; both give the same estimate, and it recovers
//! the simulated truth.

use std::path::Path;
use std::sync::Arc;
use truing::manifold::{Point3, Vector};
use truing::nalgebra::Vector3;
use truing::{
    Batch, Constraint, Jacobian, Noise, Point, Scalar, Settings, Solution, Var, Views, check, solve,
};
use truing_robot::Robot;
use truing_robot::identify::{Choice, default_preference, in_order, select};
use truing_robot::model::Assembly;
use truing_robot::robot::RobotFile;
use truing_robot::robot::{Chain, Derivatives};
use truing_robot::robot::{DifferentiateChain, FrameWise, Joint, Regressor};
use truing_robot::start::start;
use truing_robot::unknown::State;
use truing_robot::{Arm, kinds};

/// The length of a wire from the tool to an anchor whose place is estimated.
#[derive(Clone)]
struct DrawWire {
    chain: Arc<Chain>,
    q: Vec<f64>,
    length: f64,
}

impl Constraint for DrawWire {
    type Vars = (Vector, Point3);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (robot, anchor): Views<'_, Self, T>, r: &mut [T]) {
        let wire = self.chain.robot.forward(robot, &self.q).translation - anchor;
        r[0] = wire.dot(&wire).sqrt() - self.length;
    }
}

/// The same with derivatives written by hand: with u the direction of the wire, ∂r/∂parameter is
/// u · (velocity of the tip), ∂r/∂anchor is −u.
struct ByHand(DrawWire);

impl Constraint for ByHand {
    type Vars = (Vector, Point3);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, x: Views<'_, Self, T>, r: &mut [T]) {
        self.0.residual(x, r);
    }
    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let (parameters, anchor) = at.views();
        let regressor: &mut Regressor = at.memory();
        FrameWise.regressor(&self.0.chain.robot, parameters, &self.0.q, regressor);
        let tip = regressor.tool.translation;
        let wire = tip - anchor;
        r[0] = wire.norm() - self.0.length;
        let u = wire.normalize();
        for (k, twist) in regressor.twists.iter().enumerate() {
            j.set(0, 0, k, u.dot(&twist.at(&tip)));
        }
        j.block_mut(1).copy_from_slice((-u).as_slice());
    }
}

fn puma560() -> Robot {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/puma560/puma560.toml");
    Robot::new(&RobotFile::read(path).unwrap())
}

/// Postures spread over the joint ranges.
fn posture(robot: &Robot, k: usize) -> Vec<f64> {
    let spread = |(j, joint): (usize, &Joint)| {
        let [lower, upper] = joint.limits.unwrap_or([-1.0, 1.0]);
        let prime = [2.0_f64, 3.0, 5.0, 7.0, 11.0, 13.0][j];
        lower + (upper - lower) * (0.1 + 0.8 * (k as f64 * prime.sqrt()).fract())
    };
    robot.joints().iter().enumerate().map(spread).collect()
}

/// Every parameter but the gains off by up to 1 mm or 1 mrad.
fn true_parameters(robot: &Robot) -> Vec<f64> {
    let off = |k: usize| 1e-3 * (2.0 * (k as f64 * 19_f64.sqrt()).fract() - 1.0);
    let parameters = robot.parameters().iter().enumerate();
    parameters
        .map(|(k, p)| p.nominal + if p.name.starts_with('K') { 0.0 } else { off(k) })
        .collect()
}

const ANCHOR: [f64; 3] = [1.3, -0.5, 0.2];
const POSITIONS: usize = 6;
const WIRES: usize = 60;

/// Estimates all that can be of a robot from a few positions and many wire lengths, exact ones.
fn calibrate<C: Constraint<Vars = (Vector, Point3)>>(
    robot: &Robot,
    make: impl Fn(DrawWire) -> C,
) -> (Solution, Var<Vector>, Var<Point3>) {
    let truth = true_parameters(robot);
    let tip = |q: &[f64]| robot.forward(&truth, q).translation;
    let q: Vec<Vec<f64>> = (0..POSITIONS).map(|k| posture(robot, k)).collect();
    let tips: Vec<Vector3<f64>> = q.iter().map(|q| tip(q)).collect();
    let sets = [kinds::position("positions", q, &tips)];
    let arms = [Arm::only(robot.clone())];
    let state = start(&arms, &sets, vec![robot.nominal()], &State::default());
    let derivatives = Derivatives::default();
    let mut assembly = Assembly::new(&arms, &sets, &state, &derivatives).unwrap();

    // What positions can identify of the robot, gains held.
    let gain = |k: usize| robot.parameters()[k].name.starts_with('K');
    let wanted: Vec<usize> = in_order(&assembly, &default_preference(&arms), |_| true)
        .into_iter()
        .filter(|column| !gain(*column))
        .collect();
    // Six positions alone would not do for that: the choice is asked of more postures.
    let many: Vec<Vec<f64>> = (0..100).map(|k| posture(robot, k)).collect();
    let seen: Vec<Vector3<f64>> = many.iter().map(|q| tip(q)).collect();
    let many = [kinds::position("positions", many, &seen)];
    let choices = select(&arms, &many, &state, &derivatives, &wanted, &[]).unwrap();
    let free: Vec<usize> = (0..choices.len())
        .filter(|column| choices[*column] == Choice::Estimated)
        .collect();
    assert!(free.len() > 3 * POSITIONS, "the wires are needed");
    assembly.free_only(&free);

    let parameters = assembly.robot(0);
    let problem = &mut assembly.problem;
    let anchor = problem.add_variable::<Point3>("anchor", &Vector3::new(1.0, -0.3, 0.0));
    let mut wires = Batch::new("wires").noise(Noise::isotropic(1e-4).unwrap());
    for k in 0..WIRES {
        let q = posture(robot, POSITIONS + k);
        let length = (tip(&q) - Vector3::from(ANCHOR)).norm();
        let chain = Chain::new(robot.clone());
        wires.push((parameters, anchor), make(DrawWire { chain, q, length }));
    }
    problem.add_block(wires);
    // Columns of parameters that have no effect hold nothing but rounding.
    for difference in check::jacobian(problem, problem.initial()) {
        if free.contains(&difference.column)
            || problem.columns_of(anchor).contains(&difference.column)
        {
            assert!(difference.relative < 1e-7, "{difference:?}");
        }
    }
    let solution = solve(problem, &Settings::default()).unwrap();
    assert!(solution.termination.converged(), "{}", solution.termination);
    (solution, parameters, anchor)
}

#[test]
fn a_constraint_from_outside_joins_a_calibration_and_recovers_the_truth() {
    let robot = puma560();
    let (solution, parameters, anchor) = calibrate(&robot, |wire| wire);
    let estimate = solution.values.get(parameters);
    let truth = true_parameters(&robot);
    for k in 0..50 {
        let q = posture(&robot, 1000 + k);
        let [found, nominal, exact] = [&estimate, &robot.nominal(), &truth]
            .map(|parameters| robot.forward(parameters, &q).translation);
        assert!((nominal - exact).norm() > 1e-4);
        assert!(
            (found - exact).norm() < 1e-9,
            "posture {k}: {:e} m off",
            (found - exact).norm()
        );
    }
    assert!((solution.values.get(anchor) - Vector3::from(ANCHOR)).norm() < 1e-9);
}

#[test]
fn automatic_and_hand_written_derivatives_give_the_same_estimate() {
    let robot = puma560();
    let (automatic, parameters, _) = calibrate(&robot, |wire| wire);
    let (by_hand, same, _) = calibrate(&robot, ByHand);
    let (a, b) = (automatic.values.get(parameters), by_hand.values.get(same));
    for ((a, b), p) in a.iter().zip(&b).zip(robot.parameters()) {
        assert!((a - b).abs() < 1e-10, "{}: {a} and {b}", p.name);
    }
}
