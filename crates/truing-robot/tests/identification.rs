//! What can be identified is what Khalil, Lemoine & Gautier 1996 (section IV) find for the PUMA 560:
//! the same parameters from the same measurements, however the data are laden with noise, and the
//! symmetries of other set-ups are counted right.

#[path = "support/puma.rs"]
mod puma;

use puma::{Scene, What, puma, puma_with, stanford, table, two_pumas};
use truing::manifold::Plane;
use truing::nalgebra::{Matrix3, Vector3};
use truing_robot::Arm;
use truing_robot::Robot;
use truing_robot::identify::{Choice, Status};
use truing_robot::robot::RobotFile;

/// A point with room around it.
fn corner() -> Vector3<f64> {
    Vector3::new(0.45, 0.25, 0.55)
}

/// A plane through a point.
fn through(point: Vector3<f64>, normal: Vector3<f64>) -> Plane<f64> {
    Plane {
        normal,
        distance: normal.dot(&point),
    }
}

/// Three planes at right angles through the corner, square to nothing else.
fn planes() -> [Plane<f64>; 3] {
    let skew = Matrix3::new(0.9, 0.1, 0.3, -0.2, 1.0, 0.1, -0.3, -0.1, 1.1);
    let axes = skew.qr().q();
    [0, 1, 2].map(|k| through(corner(), axes.column(k).into_owned()))
}

fn scene(robot: &Robot, what: &[What]) -> Scene {
    let scene = Scene::nominal(vec![Arm::only(robot.clone())], 9);
    let each = what.iter();
    each.fold(scene, |scene, what| scene.measure(what, 60, 0.0))
}

type Wanted = fn(usize, &str) -> bool;

/// α, d, θ and r of every frame, and β₃, which a PUMA's parallel second and third axes need.
const GEOMETRY: Wanted = |_, name| !name.starts_with('K');
/// The paper's 30 parameters: without β₃.
const WITHOUT_BETA: Wanted = |_, name| !name.starts_with('K') && !name.starts_with("beta");
const WITH_GAINS: Wanted = |_, _| true;
const GAINS_WITHOUT_BETA: Wanted = |_, name| !name.starts_with("beta");

/// The names of the parameters that are wanted and not estimated, in order.
fn lost(scene: &Scene, wanted: Wanted) -> Vec<String> {
    let choices = scene.choices(&[], wanted);
    let lost = |(name, choice): (String, Choice)| {
        (!matches!(choice, Choice::Estimated | Choice::Fixed)).then_some(name)
    };
    let mut names: Vec<String> = choices.into_iter().filter_map(lost).collect();
    names.sort();
    names
}

/// How many parameters of the robots are estimated.
fn count(scene: &Scene, wanted: Wanted) -> usize {
    let choices = scene.choices(&[], wanted);
    let estimated = choices.iter().filter(|(_, c)| *c == Choice::Estimated);
    estimated.count()
}

/// The lists of section IV, which hold with and without β₃, with and without the gains.
#[track_caller]
fn loses(what: What, names: &str) {
    let scene = scene(&puma(), std::slice::from_ref(&what));
    let mut expected: Vec<&str> = names.split_whitespace().collect();
    expected.sort_unstable();
    for wanted in [GEOMETRY, WITHOUT_BETA, WITH_GAINS, GAINS_WITHOUT_BETA] {
        assert_eq!(lost(&scene, wanted), expected, "{what:?}");
    }
}

#[test]
fn positions_lose_the_four_parameters_of_the_paper() {
    loses(What::Position, "theta7 r3 r7 alpha7");
}

#[test]
fn visits_of_one_point_lose_the_eleven_parameters_of_the_paper() {
    loses(
        What::SamePoint(vec![corner()]),
        "theta1 d1 r0 alpha1 theta0 theta7 r1 r6 r7 alpha7 r3",
    );
}

#[test]
fn touches_of_a_known_plane_lose_the_eight_parameters_of_the_paper() {
    loses(
        What::KnownPlane(table()),
        "theta7 r0 r6 r7 alpha7 theta0 r1 r3",
    );
}

#[test]
fn touches_of_an_unknown_plane_lose_the_eleven_parameters_of_the_paper() {
    loses(
        What::UnknownPlane(vec![table()]),
        "theta7 theta1 d1 r0 r6 r7 alpha1 alpha7 theta0 r1 r3",
    );
}

/// Poses tell everything but the sliding of frame 3 along its axis, which slides frame 2 as well.
#[test]
fn poses_lose_only_where_the_third_frame_sits_on_its_axis() {
    loses(What::Pose, "r3");
}

/// Pose, position, same point, known plane, unknown plane, as the paper and its notes count them.
fn counts(robot: &Robot, wanted: Wanted) -> [usize; 5] {
    [
        What::Pose,
        What::Position,
        What::SamePoint(vec![corner()]),
        What::KnownPlane(table()),
        What::UnknownPlane(vec![table()]),
    ]
    .map(|what| count(&scene(robot, &[what]), wanted))
}

#[test]
fn a_puma_has_30_27_20_23_and_20_and_six_gains() {
    assert_eq!(counts(&puma(), GEOMETRY), [30, 27, 20, 23, 20]);
    assert_eq!(counts(&puma(), WITHOUT_BETA), [29, 26, 19, 22, 19]);
    assert_eq!(counts(&puma(), WITH_GAINS), [36, 33, 26, 29, 26]);
}

/// An RX-90 has the axes of a PUMA and none of its small offsets.
#[test]
fn an_rx90_has_as_many_as_a_puma() {
    let text = std::fs::read_to_string(puma::example("puma560.toml")).unwrap();
    let text = text
        .replace("r = 0.2435\n", "")
        .replace("d = 0.4318\nr = -0.0934\n", "d = 0.45\n")
        .replace("d = -0.0203\nr = 0.4331\n", "r = 0.45\n");
    let robot = Robot::new(&RobotFile::parse(&text, "rx90.toml").unwrap());
    assert_eq!(robot.parameters().len(), puma().parameters().len());
    assert_eq!(counts(&robot, GEOMETRY), [30, 27, 20, 23, 20]);
}

/// The Stanford arm: its third joint slides. A sliding joint has two parameters where a turning one
/// has four (only its direction matters), so two fewer than a PUMA; but how far it slides is
/// known, so no scale is free: the planes and the point cost one less.
#[test]
fn a_stanford_arm_has_28_25_19_22_and_19() {
    let robot = stanford();
    assert_eq!(counts(&robot, GEOMETRY), [28, 25, 19, 22, 19]);
    // With the gains a scale is free again where neither sensor nor plane gives it.
    assert_eq!(counts(&robot, WITH_GAINS), [34, 31, 24, 27, 24]);
}

/// A plane more is three unknowns more and no symmetry less: position, orientation and scale stay
/// free, however many planes there are.
#[test]
fn more_unknown_planes_identify_nothing_more() {
    let [a, b, c] = planes();
    for listed in [vec![a], vec![a, b], vec![a, b, c], vec![a, b, c, table()]] {
        let scene = scene(&puma(), &[What::UnknownPlane(listed)]);
        assert_eq!(count(&scene, GEOMETRY), 20);
    }
}

/// A known plane leaves two translations, a rotation and the scale; a second at right angles leaves
/// the translation along both and the scale; a third only the scale, about the corner; a fourth,
/// parallel to one of them, none.
#[test]
fn known_planes_at_right_angles_take_away_one_symmetry_after_another() {
    let [a, b, c] = planes();
    let parallel = Plane {
        distance: a.distance + 0.2,
        ..a
    };
    let known = [a, b, c, parallel].map(What::KnownPlane);
    for (k, expected) in (1..=4).zip([23, 25, 26, 27]) {
        let scene = scene(&puma(), &known[..k]);
        assert_eq!(count(&scene, GEOMETRY), expected, "{k} planes");
    }
}

/// Two tools at a known distance: positions would identify 27 parameters of each robot, and only the
/// six motions of both together do not change the distance. If the distance is not known, growing
/// everything does not change anything either.
#[test]
fn two_robots_that_touch_have_the_motions_of_both_together_to_choose() {
    let scene = |what| Scene::nominal(two_pumas(), 9).measure(&what, 200, 0.0);
    assert_eq!(count(&scene(What::TwoArms(0.116)), GEOMETRY), 2 * 27 - 6);
    let unknown = scene(What::TwoArmsUnknown(0.116));
    assert_eq!(count(&unknown, GEOMETRY), 2 * 27 - 7);
    assert_eq!(count(&scene(What::TwoArms(0.116)), WITH_GAINS), 2 * 33 - 6);
}

#[test]
fn one_robot_in_two_postures_has_its_own_motions_to_choose() {
    let scene = scene(&puma(), &[What::TwoPostures(0.5)]);
    assert_eq!(count(&scene, GEOMETRY), 27 - 6);
}

/// With the tool point on the axes that the tool's α and θ turn about, they do nothing; that is told
/// apart from what others take over.
#[test]
fn parameters_without_effect_are_told_from_those_that_are_taken_over() {
    let robot = puma_with(
        "alpha = 17.0\nd = 0.12\ntheta = 23.0\nr = 0.08",
        "d = 0.12\ntheta = 23.0",
    );
    for what in [What::Position, What::SamePoint(vec![corner()])] {
        let choices = scene(&robot, &[what]).choices(&[], WITHOUT_BETA);
        let without: Vec<&str> = choices
            .iter()
            .filter(|(_, c)| *c == Choice::NoEffect)
            .map(|(name, _)| name.as_str())
            .collect();
        assert_eq!(without, ["alpha7", "theta7"]);
        let r3 = choices.iter().find(|(name, _)| name == "r3").unwrap();
        assert!(matches!(&r3.1, Choice::Regrouped(_)), "{r3:?}");
    }
}

/// With one point or plane of which nothing is known, the six parameters of the base only move what
/// was touched along: they are held. A length more is held for the scale, and says which lengths it
/// goes with.
#[test]
fn the_base_is_held_where_nothing_outside_the_robot_is_known() {
    for what in [
        What::SamePoint(vec![corner()]),
        What::UnknownPlane(vec![table()]),
    ] {
        let result = scene(&puma(), std::slice::from_ref(&what))
            .calibrate(false)
            .result;
        let of = |status: Status| -> Vec<&str> {
            let all = result.parameters.iter();
            all.filter(|p| p.status == status)
                .map(|p| p.name.as_str())
                .collect()
        };
        let held = ["theta0", "r0", "alpha1", "d1", "theta1", "r1", "r6"];
        assert_eq!(of(Status::Held), held, "{what:?}");
        let scale = |w: &String| w.contains("leave the scale free") && w.contains("held by r6");
        assert!(result.warnings.iter().any(scale), "{:?}", result.warnings);
        let r6 = result.parameters.iter().find(|p| p.name == "r6").unwrap();
        let into: Vec<&str> = r6.into.iter().flatten().map(|(n, _)| n.as_str()).collect();
        for length in ["r2", "d3", "d4", "r4", "d7"] {
            assert!(into.contains(&length), "r6 goes with {length}: {into:?}");
        }
    }
}

/// Readings as if a joint had never moved.
fn park(scene: &mut Scene, joint: usize, at: f64) {
    let (robot, truth) = (&scene.arms[0].robot, &scene.truth.robots[0]);
    let set = &mut scene.sets[0];
    let readings = &mut set.readings;
    for (row, q) in readings.tools[0].q.iter_mut().enumerate() {
        q[joint] = at;
        let pose = robot.forward(truth, q);
        let seen = [pose.translation.as_slice(), &pose.quaternion()].concat();
        let read = readings.values.row_mut(row);
        let columns = read.len();
        read.copy_from_slice(&seen[..columns]);
    }
}

/// A joint that never moves in the data: the structure would allow its parameters, these data do not.
/// A PUMA with five joints and a tool point has 4 × 5 + 3 parameters and 5 gains, and those before
/// the flange come out exactly.
#[test]
fn what_a_parked_joint_would_tell_is_not_excited_and_stays_nominal() {
    for parked in [0.0, 0.2] {
        let robot = puma();
        let before =
            |p: usize| robot.parameters()[p].frame <= 5 && p != robot.parameter("r3").unwrap();
        let arms = vec![Arm::only(robot.clone())];
        let scene = Scene::perturbed(arms, 3, |_, p| before(p));
        let mut scene = scene.measure(&What::Position, 60, 0.0);
        park(&mut scene, 5, parked);

        let outcome = scene.calibrate(true);
        assert!(outcome.result.trusted);
        assert_eq!(outcome.result.identifiable, 4 * 5 + 3 + 5);
        let parameters = outcome.result.parameters.iter();
        let unexcited = parameters.filter(|p| p.status == Status::Unexcited);
        let names: Vec<&str> = unexcited
            .map(|p| {
                assert_eq!(p.estimate, p.nominal, "{}", p.name);
                assert_eq!(p.sigma, None, "{}", p.name);
                p.name.as_str()
            })
            .collect();
        assert_eq!(names.len(), 33 - 28, "{names:?}");
        assert!(names.contains(&"K6"), "{names:?}");
        // All of them place the flange or the tool.
        let last = |name: &&str| name.ends_with('6') || name.ends_with('7');
        assert!(names.iter().all(last), "{names:?}");
        let truth = scene.truth.robots[0].iter();
        for (p, truth) in outcome.result.parameters.iter().zip(truth) {
            assert!((p.estimate - truth).abs() < 1e-9, "{}", p.name);
        }
    }
}

/// Whichever joint is parked, and where: its gain is not estimated (even where an angle beside it,
/// like θ₁, gives way to all gains by preference), and all errors are taken over by parameters that
/// move the tool as they do, not by one that would have to turn far for it.
#[test]
fn with_any_joint_parked_the_errors_beside_it_are_taken_over() {
    for (what, expected) in [(What::Position, 4 * 5 + 3 + 5), (What::Pose, 4 * 5 + 6 + 5)] {
        for (joint, at) in (0..6).flat_map(|joint| [(joint, 0.0), (joint, 0.2), (joint, -0.7)]) {
            let arms = vec![Arm::only(puma())];
            let scene = Scene::perturbed(arms, 4 + joint as u64, |_, _| true);
            let mut scene = scene.measure(&what, 60, 0.0);
            park(&mut scene, joint, at);
            let result = scene.calibrate(true).result;
            assert!(result.trusted);
            assert_eq!(result.identifiable, expected, "{what:?}, joint {joint}");
            let gain = format!("K{}", joint + 1);
            let gain = result.parameters.iter().find(|p| p.name == gain).unwrap();
            assert_eq!(gain.status, Status::Unexcited, "{} at {at}", gain.name);
            // Errors are of 0.3°: at the wrist's lever of 0.1 m, 1 mm is another 0.6°.
            let angles = result.parameters.iter().filter(|p| p.unit == "rad");
            for p in angles {
                let moved = (p.estimate - p.nominal).to_degrees();
                assert!(moved.abs() < 5.0, "{}: {moved}°", p.name);
            }
            let after = result.constraints[0].after.as_ref().unwrap();
            assert!(after.max < 1e-9, "joint {joint} at {at}: {} m", after.max);
        }
    }
}

/// Rank is a matter of the robot, not of the noise: 1 mm of it, and errors of the robot itself, do
/// not pretend to more parameters, nor hide any.
#[test]
fn noise_does_not_change_what_is_identified() {
    for (what, expected) in [
        (What::KnownPlane(table()), 29),
        (What::UnknownPlane(vec![table()]), 26),
        (What::SamePoint(vec![corner()]), 26),
        (What::Position, 33),
    ] {
        let clean = scene(&puma(), std::slice::from_ref(&what));
        let clean = clean.choices(&[], WITH_GAINS);
        for seed in 1..=5 {
            let arms = vec![Arm::only(puma())];
            let scene = Scene::perturbed(arms, seed, |_, _| true).measure(&what, 100, 1e-3);
            assert_eq!(count(&scene, WITH_GAINS), expected, "{what:?}");
            let noisy = scene.choices(&[], WITH_GAINS);
            for ((name, clean), (_, noisy)) in clean.iter().zip(&noisy) {
                let same = (*clean == Choice::Estimated) == (*noisy == Choice::Estimated);
                assert!(same, "{what:?}: {name} is {clean:?} and {noisy:?}");
            }
        }
    }
}

/// Whoever prefers a parameter gets it, as long as it does anything; others make room.
#[test]
fn the_user_decides_which_of_several_is_estimated() {
    let number = |name: &str| (0, puma().parameter(name).unwrap());
    let estimated = |scene: &Scene, preferred: &[&str]| -> Vec<String> {
        let preferred: Vec<(usize, usize)> = preferred.iter().map(|name| number(name)).collect();
        let choices = scene.choices(&preferred, GEOMETRY);
        let kept = |(name, c): (String, Choice)| (c == Choice::Estimated).then_some(name);
        choices.into_iter().filter_map(kept).collect()
    };
    let positions = scene(&puma(), &[What::Position]);
    let usual = estimated(&positions, &[]);
    let other = estimated(&positions, &["r3"]);
    assert!(usual.contains(&"r2".to_owned()) && !usual.contains(&"r3".to_owned()));
    assert!(other.contains(&"r3".to_owned()) && !other.contains(&"r2".to_owned()));
    assert_eq!(usual.len(), other.len());

    // The length that stands for the scale: with all others preferred, the upper arm. (The tool's
    // r7 lies askew to the flange: what it does, r6 and theta6 do together.)
    let plane = scene(&puma(), &[What::UnknownPlane(vec![table()])]);
    let others = ["r6", "theta6", "r2", "r4", "d4", "d7"];
    let kept = estimated(&plane, &others);
    assert_eq!(kept.len(), 20);
    for name in others {
        assert!(kept.iter().any(|k| k == name), "{name}: {kept:?}");
    }
    assert!(!kept.contains(&"d3".to_owned()), "{kept:?}");

    // A calibration asks the same way.
    let mut calibration = positions.calibration(false);
    calibration.estimate.preference = vec!["r3".into()];
    let result = calibration.run(&|_| {}).unwrap().result;
    let status = |name: &str| {
        let found = result.parameters.iter().find(|p| p.name == name);
        found.unwrap().status.clone()
    };
    assert_eq!(status("r3"), Status::Estimated);
    assert_eq!(status("r2"), Status::Regrouped);
}
