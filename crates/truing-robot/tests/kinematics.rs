//! Forward kinematics, parameters and regressor agree with textbooks and with elementary matrices.
//!
//! Nothing here uses the frame functions of the library: references are closed forms from
//! textbooks, products of 4 × 4 matrices, and Khalil's analytic columns.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{FRAC_PI_2, PI};
use truing::manifold::Pose;
use truing::nalgebra::{Matrix4, Rotation3, Unit, Vector3, Vector6};
use truing_robot::robot::{Convention, FrameRow, JointKind, JointRow, RobotFile};
use truing_robot::robot::{DifferentiateChain, FrameWise, Regressor};
use truing_robot::{Robot, robot as kinematics};

/// Chains of at most nine frames with lengths below one metre: a few hundred ε.
const TOLERANCE: f64 = 1e-13;

/// Khalil, Lemoine & Gautier 1996, section IV, with a generic base and tool.
const PUMA: &str = r#"
name = "PUMA 560"
convention = "khalil-kleinfinger"
units = { angle = "deg", length = "m" }
base = { theta = 17, r = 0.4 }
tool = { alpha = 17, d = 0.12, theta = 23, r = 0.08 }
joint = [
    { type = "revolute", alpha = 11, d = 0.15, theta = 5, r = 0.25 },
    { type = "revolute", alpha = -90, r = 0.2435 },
    { type = "revolute", d = 0.4318, r = -0.0934 },
    { type = "revolute", alpha = 90, d = -0.0203, r = 0.4331 },
    { type = "revolute", alpha = -90 },
    { type = "revolute", alpha = 90 },
]
"#;

/// The same kind of arm in the distal convention.
const PUMA_DISTAL: &str = r#"
convention = "denavit-hartenberg"
units = { angle = "deg", length = "m" }
base = { theta = 17, d = 0.4, a = 0.15, alpha = 11 }
tool = { theta = 23, d = 0.08, a = 0.01, alpha = 5 }
joint = [
    { type = "revolute", theta = 5, d = 0.25, alpha = -90 },
    { type = "revolute", d = 0.2435, a = 0.4318 },
    { type = "revolute", d = -0.0934, a = -0.0203, alpha = 90 },
    { type = "revolute", d = 0.4331, alpha = -90 },
    { type = "revolute", alpha = 90 },
    { type = "revolute", a = 0.12, alpha = 17 },
]
"#;

fn read(text: &str) -> Robot {
    Robot::new(&RobotFile::parse(text, "robot.toml").unwrap())
}

fn random() -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(1996)
}

fn numbers<const N: usize>(random: &mut ChaCha8Rng, size: f64) -> [f64; N] {
    std::array::from_fn(|_| random.random_range(-size..size))
}

fn rotate(axis: [f64; 3], angle: f64) -> Matrix4<f64> {
    Rotation3::from_axis_angle(&Unit::new_unchecked(Vector3::from(axis)), angle).to_homogeneous()
}

const X: [f64; 3] = [1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];
const Z: [f64; 3] = [0.0, 0.0, 1.0];

fn translate(x: f64, y: f64, z: f64) -> Matrix4<f64> {
    Matrix4::new_translation(&Vector3::new(x, y, z))
}

fn homogeneous(pose: &Pose<f64>) -> Matrix4<f64> {
    let mut m = Matrix4::identity();
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(&pose.rotation);
    m.fixed_view_mut::<3, 1>(0, 3).copy_from(&pose.translation);
    m
}

/// The matrix with the given rotation, by rows, and translation.
fn rigid(rows: [[f64; 3]; 3], p: [f64; 3]) -> Matrix4<f64> {
    Matrix4::from_fn(|i, k| match (i, k) {
        (3, k) => f64::from(u8::from(k == 3)),
        (i, 3) => p[i],
        (i, k) => rows[i][k],
    })
}

#[track_caller]
fn assert_pose(found: &Pose<f64>, expected: &Matrix4<f64>) {
    let difference = (homogeneous(found) - expected).amax();
    assert!(
        difference < TOLERANCE,
        "{found:?} differs from {expected} by {difference:.1e}"
    );
}

/// A frame as the product of the elementary matrices that define its convention.
fn elementary(convention: Convention, row: &FrameRow) -> Matrix4<f64> {
    let (x, z) = match convention {
        Convention::KhalilKleinfinger => (row.d, row.r),
        Convention::DenavitHartenberg => (row.a, row.d),
        Convention::General => unreachable!("tests/joint_models.rs has those"),
    };
    let about_x = rotate(X, row.alpha) * translate(x, 0.0, 0.0);
    let about_z = rotate(Z, row.theta) * translate(0.0, 0.0, z);
    match convention {
        Convention::KhalilKleinfinger => rotate(Y, row.beta) * about_x * about_z,
        _ => about_z * about_x * rotate(Y, row.beta),
    }
}

/// base_from_tool of a file at the values of its moving joints.
fn product(file: &RobotFile, q: &[f64]) -> Matrix4<f64> {
    let mut q = q.iter();
    let mut pose = elementary(file.convention, &file.base);
    for joint in &file.joints {
        let mut row = joint.frame;
        let mut moved = || joint.gain.unwrap() * q.next().unwrap();
        match (joint.kind, file.convention) {
            (JointKind::Revolute, _) => row.theta += moved(),
            (JointKind::Prismatic, Convention::KhalilKleinfinger) => row.r += moved(),
            (JointKind::Prismatic, _) => row.d += moved(),
            (JointKind::Fixed, _) => {}
        }
        pose *= elementary(file.convention, &row);
    }
    pose * elementary(file.convention, &file.tool)
}

/// A robot with random frames, every one with β, and the joints given.
fn random_file(random: &mut ChaCha8Rng, convention: Convention, kinds: &[JointKind]) -> RobotFile {
    let mut frame = |part: usize| {
        let [alpha, theta, beta] = numbers(random, 3.0);
        let [x, z] = numbers(random, 0.9);
        match convention {
            // Frame 0 has θ and r only.
            Convention::KhalilKleinfinger if part == 0 => FrameRow {
                theta,
                r: z,
                ..FrameRow::default()
            },
            Convention::KhalilKleinfinger => FrameRow {
                alpha,
                d: x,
                theta,
                r: z,
                beta,
                ..FrameRow::default()
            },
            _ => FrameRow {
                alpha,
                a: x,
                theta,
                d: z,
                beta,
                ..FrameRow::default()
            },
        }
    };
    let base = frame(0);
    let frames: Vec<_> = (1..=kinds.len()).map(&mut frame).collect();
    let tool = frame(kinds.len() + 1);
    let joints = kinds
        .iter()
        .zip(frames)
        .enumerate()
        .map(|(j, (kind, frame))| {
            let mut joint = JointRow::new(format!("q{}", j + 1), *kind, frame);
            joint.gain = joint.gain.map(|_| random.random_range(0.5..1.5));
            joint
        });
    let joints = joints.collect();
    RobotFile {
        base,
        joints,
        tool,
        ..RobotFile::new("random", convention)
    }
}

const CONVENTIONS: [Convention; 2] = [Convention::KhalilKleinfinger, Convention::DenavitHartenberg];
const KINDS: [JointKind; 7] = [
    JointKind::Revolute,
    JointKind::Prismatic,
    JointKind::Fixed,
    JointKind::Revolute,
    JointKind::Revolute,
    JointKind::Fixed,
    JointKind::Prismatic,
];

#[test]
fn a_planar_arm_is_where_trigonometry_says_in_both_conventions() {
    let modified = "convention = 'kk'\njoint = [{ type = 'revolute' }, { type = 'revolute', d = 0.7 }]\ntool = { d = 0.4 }";
    let distal = "convention = 'dh'\njoint = [{ type = 'revolute', a = 0.7 }, { type = 'revolute', a = 0.4 }]";
    let mut random = random();
    for robot in [read(modified), read(distal)] {
        for _ in 0..50 {
            let q @ [q1, q2] = numbers(&mut random, PI);
            let (sin, cos) = (q1 + q2).sin_cos();
            let expected = rigid(
                [[cos, -sin, 0.0], [sin, cos, 0.0], Z],
                [0.7 * q1.cos() + 0.4 * cos, 0.7 * q1.sin() + 0.4 * sin, 0.0],
            );
            assert_pose(&robot.forward(&robot.nominal(), &q), &expected);
        }
    }
}

/// Craig, "Introduction to Robotics", 3rd edition, section 3.7, equation 3.14.
#[test]
fn the_puma_560_is_where_craigs_closed_form_says() {
    let robot = read(
        "convention = 'kk'\nunits = { angle = 'deg' }\njoint = [
            { type = 'revolute' },
            { type = 'revolute', alpha = -90 },
            { type = 'revolute', d = 0.4318, r = 0.1254 },
            { type = 'revolute', alpha = -90, d = 0.0203, r = 0.4318 },
            { type = 'revolute', alpha = 90 },
            { type = 'revolute', alpha = -90 },
        ]",
    );
    let (a2, a3, d3, d4) = (0.4318, 0.0203, 0.1254, 0.4318);
    let mut random = random();
    for _ in 0..50 {
        let q: [f64; 6] = numbers(&mut random, PI);
        let ((s1, c1), (s2, c2), (s23, c23)) =
            (q[0].sin_cos(), q[1].sin_cos(), (q[1] + q[2]).sin_cos());
        let ((s4, c4), (s5, c5), (s6, c6)) = (q[3].sin_cos(), q[4].sin_cos(), q[5].sin_cos());
        let reach = a2 * c2 + a3 * c23 - d4 * s23;
        // In the plane of the arm: along it, up, across.
        let x = [
            c23 * (c4 * c5 * c6 - s4 * s6) - s23 * s5 * c6,
            s4 * c5 * c6 + c4 * s6,
        ];
        let y = [
            c23 * (-c4 * c5 * s6 - s4 * c6) + s23 * s5 * s6,
            c4 * c6 - s4 * c5 * s6,
        ];
        let z = [-(c23 * c4 * s5 + s23 * c5), -s4 * s5];
        let expected = rigid(
            [
                [
                    c1 * x[0] + s1 * x[1],
                    c1 * y[0] + s1 * y[1],
                    c1 * z[0] + s1 * z[1],
                ],
                [
                    s1 * x[0] - c1 * x[1],
                    s1 * y[0] - c1 * y[1],
                    s1 * z[0] - c1 * z[1],
                ],
                [
                    -s23 * (c4 * c5 * c6 - s4 * s6) - c23 * s5 * c6,
                    -s23 * (-c4 * c5 * s6 - s4 * c6) + c23 * s5 * s6,
                    s23 * c4 * s5 - c23 * c5,
                ],
            ],
            [
                c1 * reach - d3 * s1,
                s1 * reach + d3 * c1,
                -a3 * s23 - a2 * s2 - d4 * c23,
            ],
        );
        assert_pose(&robot.forward(&robot.nominal(), &q), &expected);
    }
}

/// Paul, "Robot Manipulators", 1981, chapter 2: a spherical arm with a sliding third joint.
#[test]
fn the_stanford_arm_is_where_pauls_closed_form_says() {
    let robot = read(
        "convention = 'dh'\nunits = { angle = 'deg' }\njoint = [
            { type = 'revolute', alpha = -90 },
            { type = 'revolute', alpha = 90, d = 0.154 },
            { type = 'prismatic', d = 0.1 },
            { type = 'revolute', alpha = -90 },
            { type = 'revolute', alpha = 90 },
            { type = 'revolute' },
        ]",
    );
    let mut random = random();
    for _ in 0..50 {
        let q: [f64; 6] = numbers(&mut random, PI);
        // The slide starts at 0.1 m.
        let (d2, d3) = (0.154, 0.1 + q[2]);
        let ((s1, c1), (s2, c2)) = (q[0].sin_cos(), q[1].sin_cos());
        let ((s4, c4), (s5, c5), (s6, c6)) = (q[3].sin_cos(), q[4].sin_cos(), q[5].sin_cos());
        let x = [
            c2 * (c4 * c5 * c6 - s4 * s6) - s2 * s5 * c6,
            s4 * c5 * c6 + c4 * s6,
        ];
        let y = [
            -c2 * (c4 * c5 * s6 + s4 * c6) + s2 * s5 * s6,
            -s4 * c5 * s6 + c4 * c6,
        ];
        let z = [c2 * c4 * s5 + s2 * c5, s4 * s5];
        let expected = rigid(
            [
                [
                    c1 * x[0] - s1 * x[1],
                    c1 * y[0] - s1 * y[1],
                    c1 * z[0] - s1 * z[1],
                ],
                [
                    s1 * x[0] + c1 * x[1],
                    s1 * y[0] + c1 * y[1],
                    s1 * z[0] + c1 * z[1],
                ],
                [
                    -s2 * (c4 * c5 * c6 - s4 * s6) - c2 * s5 * c6,
                    s2 * (c4 * c5 * s6 + s4 * c6) + c2 * s5 * s6,
                    -s2 * c4 * s5 + c2 * c5,
                ],
            ],
            [c1 * s2 * d3 - s1 * d2, s1 * s2 * d3 + c1 * d2, c2 * d3],
        );
        assert_pose(&robot.forward(&robot.nominal(), &q), &expected);
    }
}

/// The maker's table of a Franka Panda and the joint origins of its URDF describe one arm.
#[test]
fn a_panda_by_its_table_is_the_panda_of_its_urdf() {
    let robot = read(
        "convention = 'modified-dh'\nunits = { angle = 'deg' }\ntool = { r = 0.107 }\njoint = [
            { type = 'revolute', r = 0.333 },
            { type = 'revolute', alpha = -90 },
            { type = 'revolute', alpha = 90, r = 0.316 },
            { type = 'revolute', alpha = 90, d = 0.0825 },
            { type = 'revolute', alpha = -90, d = -0.0825, r = 0.384 },
            { type = 'revolute', alpha = 90 },
            { type = 'revolute', alpha = 90, d = 0.088 },
        ]",
    );
    // Origin and roll of each joint; pitch and yaw are zero.
    let origins = [
        ([0.0, 0.0, 0.333], 0.0),
        ([0.0, 0.0, 0.0], -FRAC_PI_2),
        ([0.0, -0.316, 0.0], FRAC_PI_2),
        ([0.0825, 0.0, 0.0], FRAC_PI_2),
        ([-0.0825, 0.384, 0.0], -FRAC_PI_2),
        ([0.0, 0.0, 0.0], FRAC_PI_2),
        ([0.088, 0.0, 0.0], FRAC_PI_2),
    ];
    let mut random = random();
    for _ in 0..50 {
        let q: [f64; 7] = numbers(&mut random, 2.8);
        let mut expected = Matrix4::identity();
        for (([x, y, z], roll), q) in origins.iter().zip(q) {
            expected *= translate(*x, *y, *z) * rotate(X, *roll) * rotate(Z, q);
        }
        expected *= translate(0.0, 0.0, 0.107);
        assert_pose(&robot.forward(&robot.nominal(), &q), &expected);
    }
}

#[test]
fn a_chain_is_the_product_of_the_elementary_matrices_of_its_convention() {
    let mut random = random();
    for convention in CONVENTIONS {
        for n in 1..=KINDS.len() {
            for _ in 0..30 {
                let file = random_file(&mut random, convention, &KINDS[..n]);
                let robot = Robot::new(&file);
                let q: [f64; 7] = numbers(&mut random, 2.0);
                let q = &q[..file.moving_joints()];
                assert_eq!(robot.joints().len(), q.len());
                assert_pose(&robot.forward(&robot.nominal(), q), &product(&file, q));
            }
        }
    }
}

#[test]
fn parameters_written_to_a_file_come_back_and_move_the_tool_alike() {
    let mut random = random();
    for convention in CONVENTIONS {
        let file = random_file(&mut random, convention, &KINDS);
        let robot = Robot::new(&file);
        assert_eq!(robot.with_parameters(&robot.nominal()), file);
        for _ in 0..30 {
            let shift = |x: f64| x + random.random_range(-0.1..0.1);
            let parameters: Vec<f64> = robot.nominal().into_iter().map(shift).collect();
            let moved = robot.with_parameters(&parameters);
            assert_eq!(Robot::new(&moved).nominal(), parameters);
            let q: [f64; 5] = numbers(&mut random, 2.0);
            assert_pose(&robot.forward(&parameters, &q), &product(&moved, &q));
        }
    }
}

#[test]
fn a_gain_multiplies_the_reading_and_a_fixed_joint_has_none() {
    let text = "convention = 'kk'\ntool = { d = 0.3 }\njoint = [
        { type = 'revolute', theta = 0.2, GAIN },
        { type = 'fixed', alpha = 0.4, d = 0.5, theta = -0.3, r = 0.1 },
        { type = 'prismatic', alpha = 1.0, r = 0.2, gain = -0.5 },
    ]";
    let geared = read(&text.replace("GAIN", "gain = 1.25"));
    let direct = read(&text.replace("GAIN", "gain = 1"));
    let reading = geared.forward(&geared.nominal(), &[0.8, 0.6]);
    let angle = direct.forward(&direct.nominal(), &[1.0, 0.6]);
    assert_pose(&reading, &homogeneous(&angle));
    assert_eq!(geared.joints().len(), 2);
    assert_eq!(geared.parameter("K2"), None);
    assert_eq!(geared.nominal()[geared.parameter("K3").unwrap()], -0.5);
}

#[test]
fn joints_keep_their_names_limits_and_values() {
    let robot = read(
        "convention = 'kk'\nunits = { angle = 'deg', length = 'mm' }\njoint = [
            { name = 'waist', type = 'revolute', limits = [-160, 90] },
            { type = 'fixed' },
            { type = 'prismatic', alpha = 90, limits = [0, 250], value = 20 },
        ]",
    );
    let [waist, slide] = robot.joints() else {
        panic!("two joints move")
    };
    assert_eq!(
        (waist.name.as_str(), waist.kind),
        ("waist", kinematics::JointKind::Revolute)
    );
    assert_eq!(
        (slide.name.as_str(), slide.kind),
        // The second joint that moves: data count those.
        ("q2", kinematics::JointKind::Prismatic)
    );
    assert_eq!(waist.limits, Some([-160f64.to_radians(), FRAC_PI_2]));
    assert_eq!((slide.limits, slide.value), (Some([0.0, 0.25]), Some(0.02)));
    let again = Robot::new(&robot.with_parameters(&robot.nominal()));
    assert_eq!(again.joints(), robot.joints());
}

/// A joint that is parked for good is fixed, at its value.
#[test]
fn a_fixed_joint_may_be_parked_at_a_value() {
    let parked = read(
        "convention = 'kk'\nunits = { angle = 'deg' }\njoint = [
            { type = 'fixed', alpha = 20, theta = 10, value = '30 deg' },
            { type = 'revolute', d = 0.5 },
        ]",
    );
    let turned = read(
        "convention = 'kk'\nunits = { angle = 'deg' }\njoint = [
            { type = 'fixed', alpha = 20, theta = 40 },
            { type = 'revolute', d = 0.5 },
        ]",
    );
    let pose = |robot: &Robot| robot.forward(&robot.nominal(), &[0.3]);
    approx::assert_relative_eq!(
        pose(&parked).translation,
        pose(&turned).translation,
        epsilon = 1e-15
    );
    assert_eq!(parked.joints().len(), 1);
}

/// Khalil's generalised differential model: column by column, position over rotation.
///
/// In the distal convention the same axes, in the order of its elementary motions.
fn analytic(robot: &Robot, file: &RobotFile, q: &[f64]) -> Vec<(String, Vector6<f64>)> {
    let kk = file.convention == Convention::KhalilKleinfinger;
    let tool: Vector3<f64> = product(file, q).fixed_view::<3, 1>(0, 3).into();
    let about = |axis: Vector3<f64>, origin: Vector3<f64>| {
        let position = axis.cross(&(tool - origin));
        Vector6::new(position.x, position.y, position.z, axis.x, axis.y, axis.z)
    };
    let along = |axis: Vector3<f64>| Vector6::new(axis.x, axis.y, axis.z, 0.0, 0.0, 0.0);
    let axis = |m: &Matrix4<f64>, k: usize| -> Vector3<f64> { m.fixed_view::<3, 1>(0, k).into() };
    let n = file.joints.len();
    let mut pose = Matrix4::identity();
    let mut columns = Vec::new();
    let mut joint_values = q.iter();
    for number in 0..=n + 1 {
        let joint = (1..=n).contains(&number).then(|| &file.joints[number - 1]);
        let mut row = joint.map_or(if number == 0 { file.base } else { file.tool }, |joint| {
            joint.frame
        });
        let value = joint
            .filter(|j| j.kind != JointKind::Fixed)
            .map(|_| *joint_values.next().unwrap());
        let slides = joint.is_some_and(|joint| joint.kind == JointKind::Prismatic);
        let moved = joint.and_then(|joint| joint.gain).unwrap_or(1.0) * value.unwrap_or(0.0);
        match (slides, kk) {
            (false, _) => row.theta += moved,
            (true, true) => row.r += moved,
            (true, false) => row.d += moved,
        }
        let before = pose;
        pose *= elementary(file.convention, &row);
        let (x, z, z_origin, x_origin, beta) = if kk {
            // x after Rot(y, β); Rot(x, α) does not move it. z is the new one.
            let x = axis(&(before * rotate(Y, row.beta)), 0);
            let beta = about(axis(&before, 1), axis(&before, 3));
            (x, axis(&pose, 2), axis(&pose, 3), axis(&before, 3), beta)
        } else {
            // z is the old one. x after Rot(z, θ); Rot(x, α) does not move it.
            let x = axis(&(before * rotate(Z, row.theta)), 0);
            let beta = about(axis(&pose, 1), axis(&pose, 3));
            (x, axis(&before, 2), axis(&before, 3), axis(&pose, 3), beta)
        };
        let (along_x, along_z) = if kk { ("d", "r") } else { ("a", "d") };
        let of_joint = if slides { along(z) } else { about(z, z_origin) };
        let table = [
            (along_x, along(x)),
            (along_z, along(z)),
            ("alpha", about(x, x_origin)),
            ("theta", about(z, z_origin)),
            ("beta", beta),
            ("K", of_joint * value.unwrap_or(0.0)),
        ];
        for (letter, column) in table {
            let name = match number {
                0 if !kk => format!("base_{letter}"),
                m if !kk && m == n + 1 => format!("tool_{letter}"),
                m => format!("{letter}{m}"),
            };
            if robot.parameter(&name).is_some() {
                columns.push((name, column));
            }
        }
    }
    columns
}

#[track_caller]
fn assert_columns(robot: &Robot, parameters: &[f64], q: &[f64], regressor: &mut Regressor) {
    FrameWise.regressor(robot, parameters, q, regressor);
    let (position, rotation) = regressor.matrices();
    let expected = analytic(robot, &robot.with_parameters(parameters), q);
    assert_eq!(expected.len(), robot.parameters().len());
    for (name, expected) in expected {
        let k = robot.parameter(&name).unwrap();
        let (p, r) = (position.column(k), rotation.column(k));
        let found = Vector6::new(p[0], p[1], p[2], r[0], r[1], r[2]);
        // Rotations count one and lengths are of about a metre, so no column is a difference of
        // large numbers and a few hundred ε are left.
        let relative = (found - expected).norm() / expected.norm();
        assert!(
            relative < 1e-12,
            "{name}: {found} differs from {expected} by {relative:.1e}"
        );
    }
}

#[test]
fn the_frame_wise_regressor_is_the_analytic_one() {
    let mut random = random();
    let mut regressor = Regressor::default();
    for text in [PUMA, PUMA_DISTAL] {
        let robot = read(text);
        for _ in 0..200 {
            let shift = |x: f64| x + random.random_range(-0.5..0.5);
            let parameters: Vec<f64> = robot.nominal().into_iter().map(shift).collect();
            let q: [f64; 6] = numbers(&mut random, PI);
            assert_columns(&robot, &parameters, &q, &mut regressor);
        }
    }
}

#[test]
fn it_is_so_with_beta_slides_and_fixed_joints_too() {
    let mut random = random();
    let mut regressor = Regressor::default();
    for convention in CONVENTIONS {
        for _ in 0..200 {
            let robot = Robot::new(&random_file(&mut random, convention, &KINDS));
            let q: [f64; 5] = numbers(&mut random, 2.0);
            assert_columns(&robot, &robot.nominal(), &q, &mut regressor);
        }
    }
}

#[test]
fn a_moving_joint_moves_a_tool_point_at_its_joint_velocity() {
    let mut random = random();
    let mut regressor = Regressor::default();
    // Central differences: h² and ε/h are both below 1e-9.
    let (h, tolerance) = (1e-5, 1e-9);
    for convention in CONVENTIONS {
        let robot = Robot::new(&random_file(&mut random, convention, &KINDS));
        let parameters = robot.nominal();
        let q: [f64; 5] = numbers(&mut random, 2.0);
        FrameWise.regressor(&robot, &parameters, &q, &mut regressor);
        let target = Vector3::new(0.1, -0.2, 0.3);
        let tip = regressor.tool.apply(&target);
        for joint in 0..q.len() {
            let at = |step: f64| {
                let mut q = q;
                q[joint] += step;
                robot.forward(&parameters, &q).apply(&target)
            };
            let difference = (at(h) - at(-h)) / (2.0 * h);
            let slopes = robot.slopes(&parameters, &q);
            let found = regressor.joint_velocity(&robot, &slopes, joint, &tip);
            assert!(
                (found - difference).norm() < tolerance,
                "joint {joint}: {found} against {difference}"
            );
        }
    }
}

fn names(robot: &Robot) -> Vec<&str> {
    robot.parameters().iter().map(|p| p.name.as_str()).collect()
}

#[test]
fn the_puma_560_has_37_parameters_30_of_them_geometry() {
    let robot = read(PUMA);
    let count = |kind| robot.parameters().iter().filter(|p| p.kind == kind).count();
    assert_eq!(robot.parameters().len(), 37);
    assert_eq!(count(kinematics::ParameterKind::Gain), 6);
    // Axes 2 and 3 are parallel, no others.
    assert_eq!(count(kinematics::ParameterKind::Beta), 1);
    assert!(robot.parameter("beta3").is_some());
}

#[test]
fn parameters_are_named_by_letter_and_frame() {
    let kk = read(
        "convention = 'kk'\ntool = { alpha = 0.5 }\njoint = [
            { type = 'revolute', alpha = 0.3 },
            { type = 'fixed', alpha = 1 },
            { type = 'prismatic' },
        ]",
    );
    let expected = "theta0 r0 alpha1 d1 theta1 r1 K1 alpha2 d2 theta2 r2 alpha3 d3 theta3 r3 beta3 K3 alpha4 d4 theta4 r4";
    assert_eq!(names(&kk).join(" "), expected);
    let distal = read(
        "convention = 'dh'\nbase = { alpha = 0.5 }\ntool = { alpha = 1 }\njoint = [
            { type = 'revolute', alpha = 0.3 },
            { type = 'prismatic' },
        ]",
    );
    let expected = "base_theta base_d base_a base_alpha theta1 d1 a1 alpha1 K1 \
                    theta2 d2 a2 alpha2 beta2 K2 tool_theta tool_d tool_a tool_alpha";
    assert_eq!(names(&distal).join(" "), expected);
}

/// Khalil, Lemoine & Gautier 1996, section IV: with this order the paper's lists come out.
#[test]
fn the_default_preference_keeps_links_before_base_and_tool() {
    let robot = read(PUMA);
    let order: Vec<&str> = robot
        .default_preference()
        .iter()
        .map(|k| names(&robot)[*k])
        .collect();
    let expected = "alpha2 d2 theta2 r2 alpha3 d3 theta3 beta3 r3 alpha4 d4 theta4 r4 \
                    alpha5 d5 theta5 r5 alpha6 d6 theta6 K1 K2 K3 K4 K5 K6 \
                    alpha1 d1 theta1 d7 r1 theta0 r0 r6 r7 alpha7 theta7";
    assert_eq!(order.join(" "), expected);
}

/// Distal row j holds Khalil's θⱼ, rⱼ and dⱼ₊₁, αⱼ₊₁, βⱼ₊₁.
#[test]
fn the_default_preference_means_the_same_in_the_distal_convention() {
    let robot = read(PUMA_DISTAL);
    let order: Vec<&str> = robot
        .default_preference()
        .iter()
        .map(|k| names(&robot)[*k])
        .collect();
    let expected = "alpha1 a1 theta2 d2 alpha2 a2 theta3 beta2 d3 alpha3 a3 theta4 d4 \
                    alpha4 a4 theta5 d5 alpha5 a5 theta6 K1 K2 K3 K4 K5 K6 \
                    base_alpha base_a theta1 a6 d1 base_theta base_d d6 tool_d alpha6 tool_theta \
                    tool_alpha tool_a";
    assert_eq!(order.join(" "), expected);
    let named = |list: Vec<usize>| {
        list.into_iter()
            .map(|k| names(&robot)[k])
            .collect::<Vec<_>>()
            .join(" ")
    };
    assert_eq!(
        named(robot.base_parameters()),
        "base_theta base_d base_a base_alpha theta1 d1"
    );
    assert_eq!(
        named(robot.tool_parameters()),
        "tool_theta tool_d tool_a tool_alpha"
    );
}
