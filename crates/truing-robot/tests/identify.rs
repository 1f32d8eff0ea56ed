//! What measurements would identify is answered as Khalil, Lemoine & Gautier 1996 answer it, with
//! the symmetries behind what is missing in words, the gap that decided, and data told apart from
//! structure.

#[path = "support/puma.rs"]
mod puma;

use puma::{Scene, What, puma, puma_with, stanford, table, two_pumas};
use truing::manifold::Plane;
use truing::nalgebra::Vector3;
use truing_robot::Arm;
use truing_robot::Registry;
use truing_robot::Robot;
use truing_robot::identify::{Asked, Identification, RobotQuestion, Status};
use truing_robot::kinds::KnownPlaneTouches;

const POSE: &str = "pose";
const POSITION: &str = "position";
const KNOWN_PLANE: &str = "known-plane";
const UNKNOWN_PLANE: &str = "unknown-plane";
const SAME_POINT: &str = "same-point";
const DISTANCE: &str = "distance";

fn kinds(kinds: &[&str]) -> Vec<Asked> {
    let registry = Registry::default();
    let asked = |name: &&str| Asked::kind(registry.kind(name).unwrap().clone());
    kinds.iter().map(asked).collect()
}

fn ask(robot: Robot, asked: Vec<Asked>) -> RobotQuestion {
    RobotQuestion::new(robot, asked)
}

#[track_caller]
fn answer(question: &RobotQuestion) -> Identification {
    question.question().unwrap().answer().unwrap()
}

fn identify(robot: &Robot, kind: &str) -> Identification {
    answer(&ask(robot.clone(), kinds(&[kind])))
}

/// The names of a status, sorted.
fn names(answer: &Identification, status: Status) -> Vec<&str> {
    let same = answer.parameters.iter().filter(|p| p.status == status);
    let mut names: Vec<&str> = same.map(|p| p.name.as_str()).collect();
    names.sort_unstable();
    names
}

/// What is asked about and not estimated, sorted.
fn lost(answer: &Identification) -> Vec<&str> {
    use Status::{Held, NoEffect, Regrouped};
    let all = [NoEffect, Regrouped, Held].map(|status| names(answer, status));
    let mut all = all.concat();
    all.sort_unstable();
    all
}

fn words(text: &str) -> Vec<&str> {
    let mut words: Vec<&str> = text.split_whitespace().collect();
    words.sort_unstable();
    words
}

const FOUR_METHODS: [(&str, &str); 4] = [
    (POSITION, "theta7 r3 r7 alpha7"),
    (
        SAME_POINT,
        "theta1 d1 r0 alpha1 theta0 theta7 r1 r6 r7 alpha7 r3",
    ),
    (KNOWN_PLANE, "theta7 r0 r6 r7 alpha7 theta0 r1 r3"),
    (
        UNKNOWN_PLANE,
        "theta7 theta1 d1 r0 r6 r7 alpha1 alpha7 theta0 r1 r3",
    ),
];

/// With and without β₃, with and without gains, whatever the random configurations, planes and points.
#[test]
fn section_iv_comes_out_with_the_default_order() {
    for (kind, expected) in FOUR_METHODS {
        for (all, fixed) in [
            (false, vec![]),
            (false, vec!["beta*".to_owned()]),
            (true, vec![]),
            (true, vec!["beta*".to_owned()]),
        ] {
            for seed in [1996, 1, 2, 3] {
                let mut question = ask(puma(), kinds(&[kind]));
                question.fixed.clone_from(&fixed);
                question.seed = seed;
                if all {
                    question.parameters = vec!["all".into()];
                }
                let answer = answer(&question);
                assert_eq!(lost(&answer), words(expected), "{kind:?}, seed {seed}");
                let columns = 31 + if all { 6 } else { 0 } - fixed.len();
                assert_eq!(answer.columns, columns);
                assert_eq!(answer.rank, columns - lost(&answer).len());
                assert_eq!(answer.rank, names(&answer, Status::Estimated).len());
            }
        }
    }
}

/// With α₇ = r₇ = 0 the tool point is on the axes that α₇ and θ₇ turn about; and the base moves all
/// visits of a point alike.
#[test]
fn zero_columns_have_no_effect_and_are_not_regrouped() {
    let robot = puma_with(
        "alpha = 17.0\nd = 0.12\ntheta = 23.0\nr = 0.08",
        "d = 0.12\ntheta = 23.0",
    );
    for (kind, none) in [
        (POSITION, "theta7 alpha7"),
        (SAME_POINT, "theta7 alpha7 theta0 r0 alpha1 d1 theta1 r1"),
    ] {
        let mut question = ask(robot.clone(), kinds(&[kind]));
        question.fixed = vec!["beta*".into()];
        let answer = answer(&question);
        assert_eq!(names(&answer, Status::NoEffect), words(none), "{kind:?}");
        assert!(names(&answer, Status::Regrouped).contains(&"r3"));
        let r3 = answer.parameters.iter().find(|p| p.name == "r3").unwrap();
        let [(name, coefficient)] = &r3.into.as_ref().unwrap()[..] else {
            panic!("{r3:?}")
        };
        assert_eq!(name, "r2");
        assert!((coefficient - 1.0).abs() < 1e-9);
    }
}

/// An unknown plane holds the base, which it would move along with, and a length for the scale.
#[test]
fn an_unknown_plane_holds_the_base_and_the_scale() {
    let answer = identify(&puma(), UNKNOWN_PLANE);
    let held = names(&answer, Status::Held);
    assert_eq!(held, words("theta0 r0 alpha1 d1 theta1 r1 r6"));
    assert_eq!(names(&answer, Status::NoEffect), ["theta7"]);
    assert_eq!((answer.columns, answer.rank, answer.beside), (31, 20, 3));
}

/// What a regrouped parameter does is what its relation says: the Jacobian of positions agrees.
#[test]
fn relations_reproduce_the_columns() {
    let robot = puma();
    let answer = identify(&robot, POSITION);
    let nominal = robot.nominal();
    let tip = |moves: &[(&str, f64)], q: &[f64]| {
        let mut values = nominal.clone();
        for (name, by) in moves {
            values[robot.parameter(name).unwrap()] += by;
        }
        robot.forward(&values, q).translation
    };
    let h = 1e-5;
    let slope = |moves: &[(&str, f64)], q: &[f64]| {
        let scaled = |s: f64| -> Vec<(&str, f64)> {
            moves.iter().map(|(name, c)| (*name, c * s * h)).collect()
        };
        (tip(&scaled(1.0), q) - tip(&scaled(-1.0), q)) / (2.0 * h)
    };
    let regrouped = answer
        .parameters
        .iter()
        .filter(|p| p.status == Status::Regrouped);
    let mut count = 0;
    for p in regrouped {
        let into: Vec<(&str, f64)> = (p.into.iter().flatten())
            .map(|(name, c)| (name.as_str(), *c))
            .collect();
        for q in [
            [0.3, -0.8, 0.4, 0.9, -0.5, 1.2],
            [-1.1, 0.2, 1.4, -0.3, 0.7, -2.0],
        ] {
            let off = slope(&[(p.name.as_str(), 1.0)], &q) - slope(&into, &q);
            assert!(off.norm() < 1e-6, "{}: {off}", p.name);
        }
        count += 1;
    }
    assert_eq!(count, 3);
}

/// Base aligned with joint 1: r₁ and θ₁ go with r₀ and θ₀.
#[test]
fn a_base_aligned_with_joint_1_loses_r1_and_theta1() {
    let robot = puma_with("alpha = 11.0\nd = 0.15\n", "");
    let mut question = ask(robot, kinds(&[POSITION]));
    question.fixed = vec!["beta1".into()];
    let aligned = answer(&question);
    assert_eq!(lost(&aligned), words("theta7 r3 r7 alpha7 r1 theta1"));
    for (name, expected) in [("r1", "r0"), ("theta1", "theta0")] {
        let p = aligned.parameters.iter().find(|p| p.name == name).unwrap();
        assert_eq!(p.into.as_ref().unwrap()[0].0, expected);
    }
    // Who prefers them gets them.
    question.preference = vec!["r1".into(), "theta1".into()];
    assert_eq!(
        lost(&answer(&question)),
        words("theta7 r3 r7 alpha7 r0 theta0")
    );
}

/// A tool on the axis of joint 6: turning it does nothing, and the wrist's last frame sits anywhere.
#[test]
fn a_tool_on_the_axis_of_joint_6_loses_that_joint() {
    let robot = puma_with("alpha = 17.0\nd = 0.12\n", "");
    let mut question = ask(robot, kinds(&[POSITION]));
    question.parameters = vec!["all".into()];
    let answer = answer(&question);
    let lost = lost(&answer);
    for name in ["theta6", "alpha6", "d6", "K6"] {
        assert!(lost.contains(&name), "{name}: {lost:?}");
    }
    assert_eq!(names(&answer, Status::NoEffect), words("theta6 K6 theta7"));
}

#[test]
fn ranks_of_the_four_methods_and_poses() {
    let of = |robot: &Robot, gains: bool| {
        [POSE, POSITION, SAME_POINT, KNOWN_PLANE, UNKNOWN_PLANE].map(|kind| {
            let mut question = ask(robot.clone(), kinds(&[kind]));
            if gains {
                question.parameters = vec!["all".into()];
            }
            answer(&question).rank
        })
    };
    assert_eq!(of(&puma(), false), [30, 27, 20, 23, 20]);
    assert_eq!(of(&puma(), true), [36, 33, 26, 29, 26]);
}

/// The gap between what counts and what does not is wide, and its singular values are all there.
#[test]
fn the_gap_that_decided_is_wide() {
    for (kind, _) in FOUR_METHODS {
        let answer = identify(&puma(), kind);
        let values = &answer.singular_values;
        assert_eq!(values.len(), answer.columns);
        assert!(values.windows(2).all(|w| w[0] >= w[1]));
        let gap = answer.gap.unwrap();
        assert_eq!(gap.last_kept, values[answer.rank - 1]);
        assert_eq!(gap.first_dropped, Some(values[answer.rank]));
        assert!(gap.last_kept > 1e-2 * values[0], "{kind:?}: {gap:?}");
        assert!(values[answer.rank] < 1e-10 * values[0], "{kind:?}: {gap:?}");
        // Columns of unit length: nothing of them is lost without planes and points.
        if matches!(kind, POSITION | KNOWN_PLANE) {
            let squares: f64 = values.iter().map(|s| s * s).sum();
            let columns = (answer.columns - names(&answer, Status::NoEffect).len()) as f64;
            assert!((squares - columns).abs() < 1e-9, "{kind:?}: {squares}");
        }
        let o = answer.observability.unwrap();
        assert!(o.o2 > 0.0 && o.o2 <= 1.0);
        assert!((o.o4 - o.o2 * o.o3).abs() < 1e-12);
        assert!(o.o5 < o.o3);
    }
}

/// Translations, rotations and scale among symmetries.
fn counts(symmetries: &[String]) -> (usize, usize, usize) {
    let of = |word: &str| symmetries.iter().filter(|s| s.starts_with(word)).count();
    let counts = (of("translation"), of("rotation"), of("scale"));
    assert_eq!(counts.0 + counts.1 + counts.2, symmetries.len());
    counts
}

#[test]
fn symmetries_are_named() {
    for (kind, expected) in [
        (UNKNOWN_PLANE, (3, 3, 1)),
        (SAME_POINT, (3, 3, 1)),
        (KNOWN_PLANE, (2, 1, 1)),
        (POSITION, (0, 0, 0)),
        (POSE, (0, 0, 0)),
        (DISTANCE, (3, 3, 0)),
    ] {
        let found = identify(&puma(), kind).symmetries;
        assert_eq!(counts(&found), expected, "{kind:?}: {found:?}");
    }
    let all = [
        "translation along x",
        "translation along y",
        "translation along z",
        "rotation about x",
        "rotation about y",
        "rotation about z",
        "scale",
    ];
    assert_eq!(identify(&puma(), UNKNOWN_PLANE).symmetries, all);
    // A sensor frame takes up motions of robot and sensor together, and no growing.
    let mut question = ask(puma(), kinds(&[POSITION]));
    question.frame = Some("tracker".into());
    question.target = Some("reflector".into());
    let tracked = answer(&question);
    assert_eq!(tracked.symmetries, all[..6]);
    assert_eq!(tracked.together_with, ["tracker"]);
    assert_eq!((tracked.columns, tracked.rank), (40, 27));
}

/// A known plane leaves the motions in it; three at right angles only the growing about their corner.
#[test]
fn every_further_known_plane_takes_symmetries_away() {
    let plane = |x: f64, y: f64, z: f64, distance: f64| {
        Asked::given(KnownPlaneTouches::of(Plane {
            normal: Vector3::new(x, y, z),
            distance,
        }))
    };
    let asked = vec![
        plane(0.0, 0.0, 1.0, 0.55),
        plane(1.0, 0.0, 0.0, 0.45),
        plane(0.0, 1.0, 0.0, 0.25),
        plane(0.0, 1.0, 0.0, 0.4),
        kinds(&[UNKNOWN_PLANE]).remove(0),
    ];
    let answer = answer(&ask(puma(), asked));
    let steps = &answer.steps;
    let ranks: Vec<(usize, usize)> = steps.iter().map(|s| (s.rank, s.adds)).collect();
    assert_eq!(ranks, [(23, 23), (25, 2), (26, 1), (27, 1), (27, 0)]);
    let left: Vec<&[String]> = steps.iter().map(|s| &s.symmetries[..]).collect();
    assert_eq!(
        left[0],
        [
            "translation along x",
            "translation along y",
            "rotation about z",
            "scale"
        ]
    );
    assert_eq!(left[1], ["translation along y", "scale"]);
    assert_eq!(left[2], ["scale"]);
    assert!(left[3].is_empty() && left[4].is_empty());
    assert!(answer.symmetries.is_empty());
    assert_eq!((answer.rank, answer.beside), (27, 3));
}

#[test]
fn further_unknown_planes_add_planes_only() {
    for k in 1..=3 {
        let answer = answer(&ask(puma(), kinds(&vec![UNKNOWN_PLANE; k])));
        assert_eq!((answer.rank, answer.beside), (20, 3 * k));
        assert_eq!(answer.steps.len(), k);
        assert!(answer.steps.iter().all(|step| step.rank == 20));
        assert_eq!(counts(&answer.symmetries), (3, 3, 1));
    }
    // The same with the planes as groups of one set.
    let planes = [0.3, 0.35, 0.4, 0.45, 0.5, 0.55].map(|distance| Plane {
        distance,
        ..table()
    });
    let scene = Scene::nominal(vec![Arm::only(puma())], 9);
    let scene = scene.measure(&What::UnknownPlane(planes.into()), 40, 0.0);
    let answer = scene.calibration(false).identify(None).unwrap();
    let ranks: Vec<usize> = answer.steps.iter().map(|step| step.rank).collect();
    assert_eq!(ranks, [20; 6]);
}

/// The scale is free only if the robot can grow: not with a length fixed, nor with a joint that
/// slides by a known amount.
#[test]
fn the_scale_is_free_only_for_a_robot_that_can_grow() {
    let mut question = ask(puma(), kinds(&[UNKNOWN_PLANE]));
    question.fixed = vec!["d3".into()];
    let fixed = answer(&question);
    assert_eq!(counts(&fixed.symmetries), (3, 3, 0));
    // d3 gives the scale, and r6 is estimated.
    assert_eq!((fixed.columns, fixed.rank), (30, 20));
    // A zero is a zero at any size, and r3 does nothing that r2 does not.
    for name in ["d5", "r3"] {
        question.fixed = vec![name.into()];
        assert_eq!(counts(&answer(&question).symmetries), (3, 3, 1), "{name}");
    }
}

/// How far the third joint of the Stanford arm slides is known, unless its gain is in question.
#[test]
fn a_sliding_joint_knows_the_scale() {
    let robot = stanford();
    let expected = [
        (POSE, 28, (0, 0, 0)),
        (POSITION, 25, (0, 0, 0)),
        (SAME_POINT, 19, (3, 3, 0)),
        (KNOWN_PLANE, 22, (2, 1, 0)),
        (UNKNOWN_PLANE, 19, (3, 3, 0)),
    ];
    for (kind, rank, symmetries) in expected {
        let mut question = ask(robot.clone(), kinds(&[kind]));
        let found = answer(&question);
        assert_eq!(found.rank, rank, "{kind:?}");
        assert_eq!(counts(&found.symmetries), symmetries, "{kind:?}");
        question.parameters = vec!["all".into()];
        let found = answer(&question);
        let scale = usize::from(!matches!(kind, POSE | POSITION));
        assert_eq!(found.rank, rank + 6 - scale, "{kind:?}");
        assert_eq!(counts(&found.symmetries).2, scale, "{kind:?}");
    }
}

/// Two arms that touch: both can be moved together, and only together.
#[test]
fn two_robots_move_together() {
    let scene = |what| Scene::nominal(two_pumas(), 9).measure(&what, 200, 0.0);
    let symmetries = |scene: Scene| {
        let answer = scene.calibration(false).identify(None).unwrap();
        answer.symmetries
    };
    let known = symmetries(scene(What::TwoArms(0.116)));
    assert_eq!(counts(&known), (3, 3, 0), "{known:?}");
    assert!(known.iter().all(|s| !s.ends_with("alone")));
    let unknown = symmetries(scene(What::TwoArmsUnknown(0.116)));
    assert_eq!(counts(&unknown), (3, 3, 1), "{unknown:?}");
    // Touches of the left arm alone: the right one is not seen at all.
    let planes = symmetries(scene(What::UnknownPlane(vec![table()])));
    let left = planes.iter().filter(|s| s.ends_with("of left alone"));
    assert_eq!(left.count(), 7, "{planes:?}");
}

/// Structure and data are told apart: a joint that was parked excites nothing of its own, whatever
/// could be known; noise changes neither.
#[test]
fn data_that_do_not_excite_are_told_from_structure() {
    let arms = vec![Arm::only(puma())];
    let scene = Scene::perturbed(arms, 3, |_, _| true).measure(&What::Position, 60, 1e-4);
    let all = scene.calibration(true).identify(None).unwrap();
    assert_eq!((all.columns, all.rank), (37, 33));
    let data = all.data.as_ref().unwrap();
    assert_eq!((data.measurements, data.rank), (60, 33));
    assert!(data.unexcited.is_empty());
    assert_eq!(data.singular_values.len(), 33);

    let mut parked = scene.clone();
    let (robot, truth) = (&scene.arms[0].robot, &scene.truth.robots[0]);
    let set = &mut parked.sets[0];
    let readings = &mut set.readings;
    for (row, q) in readings.tools[0].q.iter_mut().enumerate() {
        q[5] = 0.2;
        let seen = robot.forward(truth, q).translation;
        readings
            .values
            .row_mut(row)
            .copy_from_slice(seen.as_slice());
    }
    let answer = parked.calibration(true).identify(None).unwrap();
    assert_eq!(answer.rank, 33);
    let data = answer.data.as_ref().unwrap();
    assert_eq!(data.rank, 4 * 5 + 3 + 5);
    assert_eq!(data.unexcited.len(), 5);
    assert!(data.unexcited.contains(&"K6".to_owned()));
    let mut unexcited: Vec<&str> = data.unexcited.iter().map(String::as_str).collect();
    unexcited.sort_unstable();
    assert_eq!(names(&answer, Status::Unexcited), unexcited);
    let gap = data.gap.unwrap();
    assert!(gap.first_dropped.unwrap() < 1e-6 * gap.last_kept, "{gap:?}");
    assert!(answer.observability.unwrap().o2 > 1e-3);
}

/// Twice the measurements at the same configurations: the worst direction is determined √2 better,
/// the volume for each measurement stays.
#[test]
fn observability_counts_measurements() {
    let arms = vec![Arm::only(puma())];
    let scene = Scene::nominal(arms, 3).measure(&What::Position, 60, 0.0);
    let mut twice = scene.clone();
    let rows: Vec<usize> = (0..60).chain(0..60).collect();
    twice.sets[0] = scene.sets[0].rows(&rows);
    let of = |scene: &Scene| {
        let answer = scene.calibration(false).identify(None).unwrap();
        answer.observability.unwrap()
    };
    let (once, twice) = (of(&scene), of(&twice));
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9 * b, "{a} and {b}");
    near(twice.o1, once.o1);
    near(twice.o2, once.o2);
    near(twice.o3, once.o3 * 2f64.sqrt());
    near(twice.o4, once.o4 * 2f64.sqrt());
    near(twice.o5, once.o5 * 2f64.sqrt());
}

#[test]
fn a_seed_gives_one_answer() {
    let mut question = ask(puma(), kinds(&[UNKNOWN_PLANE, POSITION]));
    question.seed = 7;
    assert_eq!(answer(&question), answer(&question));
}
