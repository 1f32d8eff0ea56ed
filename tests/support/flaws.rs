//! Calibrations of simulated robots with a flaw each, and what is true of them.

use crate::forward::{Effect, Machine, misfit};
use nalgebra::{Matrix3, Matrix4, Rotation3, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::{FRAC_PI_2, TAU};
use truing::manifold::{Plane, Pose};
use truing::nalgebra;
use truing_robot::robot::{Convention, FrameRow, JointKind, JointRow, RobotFile};
use truing_robot::{Calibration, MeasurementSet, Outcome, Robot, kinds};

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Data {
    Positions,
    Tracker,
    Poses,
    Plane,
    Planes,
    KnownPlane,
    Points,
    TrackerAndPlane,
}

/// How large the errors of the robot are.
#[derive(Clone, Copy, Debug)]
pub enum Size {
    /// Half a millimetre, half a milliradian.
    Small,
    /// A few of each.
    Usual,
    /// Hardly any.
    None,
}

/// What is wrong with what was measured.
#[derive(Clone, Debug)]
pub enum Fault {
    Nothing,
    /// Noise so many times larger than stated.
    Louder(f64),
    /// Rows repeated, with the same noise.
    Duplicated(usize),
    /// One posture, measured over and over.
    OnePosture,
    /// Postures in this part of the joints' ranges.
    Part(f64),
    /// A share of the rows is wrong by centimetres.
    Outliers(f64),
    /// The sensor moves along a line by so much from first to last \[m\].
    Drift(f64),
    /// Lengths are read so many times too long.
    Scale(f64),
    /// Two points, planes or frames, so far apart, are called one \[m\].
    MixedUp(f64),
    /// A joint's zero is elsewhere.
    Offset(usize, f64),
    /// A joint turns the other way.
    Flipped(usize),
    /// Two joints have each other's column.
    Swapped(usize, usize),
    /// Postures and readings are one row apart.
    Shifted,
    /// The sensor's frame is left-handed.
    Mirrored,
    /// A joint's column has the same number everywhere.
    Stuck(usize),
}

impl Fault {
    /// Whether it is the file that is wrong: the result must not be used, whatever it predicts.
    pub fn is_of_the_file(&self) -> bool {
        use Fault::{Flipped, Mirrored, Offset, Shifted, Swapped};
        matches!(
            self,
            Offset(..) | Flipped(_) | Swapped(..) | Shifted | Mirrored
        )
    }
}

/// One kind of flaw.
#[derive(Clone, Debug)]
pub struct Flaw {
    pub data: Data,
    pub count: usize,
    pub noise: f64,
    pub size: Size,
    pub effect: Option<Effect>,
    pub fault: Fault,
}

impl Flaw {
    /// Measurements of a robot that is off, to the noise that is stated.
    pub fn plain(data: Data, count: usize) -> Self {
        Self {
            data,
            count,
            noise: 5e-5,
            size: Size::Usual,
            effect: None,
            fault: Fault::Nothing,
        }
    }

    pub fn name(&self) -> String {
        let effect = self
            .effect
            .as_ref()
            .map_or(String::new(), |e| format!(", {e:?}"));
        let fault = match self.fault {
            Fault::Nothing => String::new(),
            _ => format!(", {:?}", self.fault),
        };
        let (data, size) = (format!("{:?}", self.data), format!("{:?}", self.size));
        let noise = self.noise * 1e3;
        format!(
            "{data} {}, {noise} mm, {} errors{effect}{fault}",
            self.count,
            size.to_lowercase()
        )
    }
}

/// All of them: each thing that goes wrong, with the kinds of measurement that can see it.
pub fn flaws() -> Vec<Flaw> {
    use Data::*;
    let mut all = Vec::new();
    for (data, count) in [
        (Positions, 20),
        (Tracker, 40),
        (Poses, 30),
        (Plane, 60),
        (Planes, 120),
        (KnownPlane, 60),
        (Points, 60),
        (TrackerAndPlane, 55),
    ] {
        all.push(Flaw::plain(data, count));
        all.push(Flaw {
            size: Size::Small,
            noise: 3e-4,
            ..Flaw::plain(data, count)
        });
        all.push(Flaw {
            size: Size::None,
            noise: 3e-4,
            ..Flaw::plain(data, count)
        });
        let effects = [
            Effect::Harmonic {
                times: 1.0,
                amplitude: 2e-3,
            },
            Effect::Harmonic {
                times: 5.0,
                amplitude: 2e-3,
            },
            Effect::Backlash(3e-3),
            Effect::Elastic(4e-3),
            Effect::Gain(2e-3),
        ];
        for (k, effect) in effects.into_iter().enumerate() {
            let size = if k % 2 == 0 { Size::Small } else { Size::Usual };
            all.push(Flaw {
                effect: Some(effect),
                size,
                ..Flaw::plain(data, count)
            });
        }
        let mut with = |fault: Fault| {
            all.push(Flaw {
                fault,
                ..Flaw::plain(data, count)
            })
        };
        with(Fault::Louder(20.0));
        with(Fault::Duplicated(5));
        with(Fault::Outliers(0.1));
        with(Fault::Part(0.05));
        with(Fault::Part(0.3));
        match data {
            Positions | Tracker | Poses => {
                with(Fault::Drift(3e-3));
                with(Fault::Scale(1.01));
                with(Fault::Scale(25.0 / 25.4));
                with(Fault::Offset(1, FRAC_PI_2));
                with(Fault::Flipped(2));
                with(Fault::Swapped(1, 3));
                with(Fault::Shifted);
            }
            Plane | Points => {
                with(Fault::MixedUp(2e-3));
                with(Fault::Offset(1, FRAC_PI_2));
            }
            _ => {}
        }
        if data == Tracker {
            with(Fault::Mirrored);
            with(Fault::Stuck(3));
        }
        if data == Positions {
            with(Fault::OnePosture);
        }
    }
    all.push(Flaw {
        count: 14,
        ..Flaw::plain(Tracker, 14)
    });
    all.push(Flaw {
        count: 14,
        noise: 3e-4,
        ..Flaw::plain(Tracker, 14)
    });
    all.push(Flaw {
        count: 30,
        noise: 3e-4,
        ..Flaw::plain(Plane, 30)
    });
    all
}

/// The robots: nominal, in the convention of Khalil and Kleinfinger.
pub fn robots() -> Vec<RobotFile> {
    let revolute = JointKind::Revolute;
    type Row = (JointKind, f64, f64, f64, [f64; 2]);
    let robot = |name: &str, rows: &[Row]| {
        let mut file = RobotFile::new(name, Convention::KhalilKleinfinger);
        file.base = FrameRow {
            theta: 0.3,
            r: 0.4,
            ..FrameRow::default()
        };
        for (k, (kind, alpha, d, r, limits)) in rows.iter().enumerate() {
            let theta = if k == 0 { 0.09 } else { 0.0 };
            let frame = FrameRow {
                alpha: *alpha,
                d: *d,
                theta,
                r: *r,
                ..FrameRow::default()
            };
            let mut joint = JointRow::new(format!("q{}", k + 1), *kind, frame);
            joint.limits = Some(*limits);
            file.joints.push(joint);
        }
        file.tool = FrameRow {
            alpha: 0.3,
            d: 0.12,
            theta: 0.4,
            r: 0.08,
            ..FrameRow::default()
        };
        file
    };
    let h = FRAC_PI_2;
    let puma = [
        (revolute, 0.19, 0.15, 0.25, [-2.79, 2.79]),
        (revolute, -h, 0.0, 0.2435, [-3.93, 0.79]),
        (revolute, 0.0, 0.4318, -0.0934, [-0.79, 3.93]),
        (revolute, h, -0.0203, 0.4331, [-1.92, 2.97]),
        (revolute, -h, 0.0, 0.0, [-1.75, 1.75]),
        (revolute, h, 0.0, 0.0, [-4.64, 4.64]),
    ];
    let seven = [
        (revolute, 0.11, 0.1, 0.31, [-2.9, 2.9]),
        (revolute, -h, 0.0, 0.0, [-2.0, 2.0]),
        (revolute, h, 0.0, 0.4, [-2.9, 2.9]),
        (revolute, h, 0.0, 0.0, [-2.0, 2.0]),
        (revolute, -h, 0.0, 0.39, [-2.9, 2.9]),
        (revolute, -h, 0.0, 0.0, [-2.0, 2.0]),
        (revolute, h, 0.0, 0.078, [-2.9, 2.9]),
    ];
    let scara = [
        (revolute, 0.12, 0.1, 0.39, [-2.2, 2.2]),
        (revolute, 0.0, 0.325, 0.0, [-2.4, 2.4]),
        (JointKind::Prismatic, 0.0, 0.275, 0.0, [-0.2, 0.1]),
        (revolute, 0.0, 0.0, 0.0, [-3.1, 3.1]),
    ];
    vec![
        robot("PUMA", &puma),
        robot("seven axes", &seven),
        robot("SCARA", &scara),
    ]
}

/// A calibration to judge, with the truth.
pub struct Case {
    pub calibration: Calibration,
    truth: Machine,
    nominal: Robot,
    on_tool: Vector3<f64>,
    scaled: bool,
    rng: ChaCha8Rng,
}

/// Errors of the tool on fresh postures, after the best rigid motion (and growth, where the data leave the scale free) \[m\].
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    pub nominal: f64,
    pub calibrated: f64,
}

/// A case of a flaw on a robot; none where the robot cannot be posed for it.
pub fn case(file: &RobotFile, flaw: &Flaw, seed: u64) -> Option<Case> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let nominal = Robot::new(file);
    let (angle, length) = match flaw.size {
        Size::Small => (5e-4, 5e-4),
        Size::Usual => (3e-3, 3e-3),
        Size::None => (2e-5, 2e-5),
    };
    let mut truth = Machine::of(file).off(angle, length, &mut rng);
    truth.effects.extend(flaw.effect.clone());
    let tracker = matches!(flaw.data, Data::Tracker | Data::TrackerAndPlane);
    let on_tool = if tracker {
        Vector3::new(0.03, -0.02, 0.05)
    } else {
        Vector3::zeros()
    };
    let sensor = {
        let turn =
            Rotation3::from_euler_angles(rng.random::<f64>(), 0.4, TAU * rng.random::<f64>());
        Matrix4::new_translation(&Vector3::new(2.0, -1.0, 0.7)) * turn.to_homogeneous()
    };
    let mut maker = Maker {
        truth: &truth,
        on_tool,
        flaw,
        rng: &mut rng,
        sensor,
    };
    let mut sets = Vec::new();
    match flaw.data {
        Data::TrackerAndPlane => {
            sets.push(maker.seen("tracker", 15));
            sets.push(maker.touched("plane", flaw.count - 15)?.target("ball"));
        }
        Data::Positions | Data::Tracker | Data::Poses => {
            sets.push(maker.seen("tracker", flaw.count))
        }
        _ => sets.push(maker.touched("touches", flaw.count)?),
    }
    let scaled = matches!(
        flaw.data,
        Data::Plane | Data::Planes | Data::KnownPlane | Data::Points
    );
    let mut calibration = Calibration::of(nominal.clone()).fixing(&["gains"]);
    for set in sets {
        calibration = calibration.measured(set);
    }
    Some(Case {
        calibration,
        truth,
        nominal,
        on_tool,
        scaled,
        rng,
    })
}

struct Maker<'a> {
    truth: &'a Machine,
    on_tool: Vector3<f64>,
    flaw: &'a Flaw,
    sensor: Matrix4<f64>,
    rng: &'a mut ChaCha8Rng,
}

impl Maker<'_> {
    fn part(&self) -> f64 {
        match self.flaw.fault {
            Fault::Part(part) => part,
            _ => 1.0,
        }
    }

    /// Where the postures of a small part are.
    fn around(&mut self) -> Option<Vec<f64>> {
        (self.part() < 1.0).then(|| self.truth.posture(0.5, None, self.rng))
    }

    fn noise(&mut self) -> f64 {
        let louder = match self.flaw.fault {
            Fault::Louder(times) => times,
            _ => 1.0,
        };
        louder * self.flaw.noise * self.rng.sample::<f64, _>(StandardNormal)
    }

    fn noise3(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.noise())
    }

    fn repeats(&self) -> usize {
        match self.flaw.fault {
            Fault::Duplicated(times) => times,
            _ => 1,
        }
    }

    /// What a sensor saw.
    fn seen(&mut self, name: &str, count: usize) -> MeasurementSet {
        let flaw = self.flaw;
        let around = self.around();
        let (mut postures, mut poses) = (Vec::new(), Vec::<Matrix4<f64>>::new());
        for k in 0..count {
            let q = match (&flaw.fault, postures.last()) {
                (Fault::OnePosture, Some(q)) => Vec::clone(q),
                _ => self.truth.posture(self.part(), around.as_deref(), self.rng),
            };
            let mut pose = self.truth.pose(&q, self.rng);
            let at = (pose * self.on_tool.push(1.0)).xyz();
            let mut at = at + self.noise3();
            match flaw.fault {
                Fault::Drift(by) => at.y += by * k as f64 / count as f64,
                Fault::Outliers(share) if self.rng.random::<f64>() < share => {
                    at += Vector3::from_fn(|_, _| 0.04 * (self.rng.random::<f64>() - 0.5));
                }
                Fault::Scale(times) => at *= times,
                _ => {}
            }
            let turn = Rotation3::new(self.noise3() * 4.0).into_inner();
            let turned: Matrix3<f64> = pose.fixed_view::<3, 3>(0, 0) * turn;
            pose.fixed_view_mut::<3, 3>(0, 0).copy_from(&turned);
            pose.fixed_view_mut::<3, 1>(0, 3).copy_from(&at);
            for _ in 0..self.repeats() {
                postures.push(q.clone());
                poses.push(pose);
            }
        }
        let base = flaw.data == Data::Positions;
        let inverse = self.sensor.try_inverse().unwrap();
        if !base {
            poses.iter_mut().for_each(|pose| *pose = inverse * *pose);
        }
        let mut q = self.misread(postures);
        if let Fault::Shifted = flaw.fault {
            q.rotate_left(1);
        }
        let mut points: Vec<Vector3<f64>> = poses
            .iter()
            .map(|p| p.fixed_view::<3, 1>(0, 3).into_owned())
            .collect();
        if let Fault::Mirrored = flaw.fault {
            points.iter_mut().for_each(|p| p.x = -p.x);
        }
        let sigma = flaw.noise;
        match flaw.data {
            Data::Positions => kinds::position(name, q, &points).sigma(&[sigma]),
            Data::Poses => {
                let poses: Vec<Pose<f64>> = poses
                    .iter()
                    .map(|p| Pose {
                        rotation: p.fixed_view::<3, 3>(0, 0).into_owned(),
                        translation: p.fixed_view::<3, 1>(0, 3).into_owned(),
                    })
                    .collect();
                kinds::pose(name, q, &poses)
                    .sigma(&[sigma, 4.0 * sigma])
                    .frame("tracker")
            }
            _ => kinds::position(name, q, &points)
                .sigma(&[sigma])
                .frame("tracker")
                .target("ball"),
        }
    }

    /// What the tool point touched.
    fn touched(&mut self, name: &str, count: usize) -> Option<MeasurementSet> {
        let flaw = self.flaw;
        let groups = match flaw.data {
            Data::Planes => 3,
            Data::Points => 5,
            _ => 1,
        };
        let around = self.around();
        let (mut q, mut labels) = (Vec::new(), Vec::new());
        let mut normal = Vector3::z();
        let mut distance = 0.0;
        for group in 0..groups {
            // The plane or point lies where the arm is in some posture.
            let seed = self.truth.posture(0.5, around.as_deref(), self.rng);
            let place = self
                .truth
                .point(&around.clone().unwrap_or(seed), &self.on_tool, self.rng);
            let tilt = Vector3::from_fn(|_, _| 0.6 * (self.rng.random::<f64>() - 0.5));
            let axis = if group == 0 {
                Vector3::z()
            } else {
                Vector3::ith(group % 3, 1.0)
            };
            normal = (axis + tilt).normalize();
            distance = normal.dot(&place);
            let (mut found, mut tries) = (0, 0);
            while found < count / groups {
                tries += 1;
                if tries > 60 * count {
                    return None;
                }
                let near = self.truth.posture(self.part(), around.as_deref(), self.rng);
                let mut off = self.noise();
                match flaw.fault {
                    Fault::MixedUp(by) if found % 2 == 0 => off += by,
                    Fault::Outliers(share) if self.rng.random::<f64>() < share => off += 0.02,
                    _ => {}
                }
                let off3 = if flaw.data == Data::Points {
                    self.noise3() + normal * off
                } else {
                    normal * off
                };
                let at = place + off3;
                let visit = ChaCha8Rng::seed_from_u64(self.rng.random());
                let posture = if flaw.data == Data::Points {
                    self.truth.solve(
                        &near,
                        &self.on_tool,
                        |p| (p - at).as_slice().to_vec(),
                        &visit,
                    )
                } else {
                    self.truth.solve(
                        &near,
                        &self.on_tool,
                        |p| vec![normal.dot(&(p - at))],
                        &visit,
                    )
                };
                let Some(posture) = posture else { continue };
                found += 1;
                for _ in 0..self.repeats() {
                    q.push(posture.clone());
                    labels.push(format!("{group}"));
                }
            }
        }
        let q = self.misread(q);
        let sigma = flaw.noise;
        Some(match flaw.data {
            Data::KnownPlane => {
                let plane = Plane { normal, distance };
                kinds::known_plane(name, q, plane).sigma(&[sigma])
            }
            Data::Points => kinds::same_point(name, q, labels).sigma(&[sigma]),
            _ => kinds::unknown_plane(name, q, labels).sigma(&[sigma]),
        })
    }

    /// Readings as a file with this fault has them.
    fn misread(&self, mut q: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        for row in &mut q {
            match self.flaw.fault {
                Fault::Offset(joint, by) => row[joint] -= by,
                Fault::Flipped(joint) => row[joint] = -row[joint],
                Fault::Swapped(a, b) => row.swap(a, b),
                Fault::Stuck(joint) => row[joint] = 0.1,
                _ => {}
            }
        }
        q
    }
}

impl Case {
    /// What the outcome is truly worth.
    pub fn truth(&mut self, outcome: &Outcome) -> Truth {
        const FRESH: usize = 300;
        let (mut at, mut before, mut after) = (Vec::new(), Vec::new(), Vec::new());
        let calibrated = Robot::new(&outcome.robots[0].1);
        let seen = outcome
            .result
            .targets
            .first()
            .map(|t| Vector3::from(t.position));
        for _ in 0..FRESH {
            let q = self.truth.posture(1.0, None, &mut self.rng);
            at.push(self.truth.point(&q, &self.on_tool, &mut self.rng));
            let pose = |robot: &Robot| robot.forward(&robot.nominal(), &q);
            before.push(pose(&self.nominal).apply(&self.on_tool));
            after.push(pose(&calibrated).apply(&seen.unwrap_or(self.on_tool)));
        }
        Truth {
            nominal: misfit(&before, &at, self.scaled),
            calibrated: misfit(&after, &at, self.scaled),
        }
    }
}
