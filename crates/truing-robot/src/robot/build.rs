//! From a robot's table to the robot.

use super::chain_frame::{Frame, FrameFunction, Motion, Term};
use super::frame_row::{Convention, FrameRow, Key};
use super::joint_kind::JointKind;
use super::joint_model::Input;
use super::serial::{Derived, InputColumn, Joint, Parameter, ParameterKind, Robot};
use super::table::{JointRow, Reading, RobotFile};
use super::unit::Unit;

/// Axes closer to parallel than this \[rad\] get the extra angle β.
const PARALLEL: f64 = 0.02;

impl Robot {
    /// The robot that a file describes.
    ///
    /// # Panics
    /// If a model names a joint or a frame that is not there: a file that was read names none.
    #[track_caller]
    pub fn new(file: &RobotFile) -> Self {
        let mut robot = Self {
            name: file.name.clone(),
            convention: file.convention,
            frames: Vec::new(),
            joints: Vec::new(),
            columns: Vec::new(),
            derived: Vec::new(),
            parameters: Vec::new(),
            file: file.clone(),
            moved: None,
        };
        let n = file.joints.len();
        robot.name_inputs();
        robot.push_frame(0, n, &file.base, None);
        for (j, row) in file.joints.iter().enumerate() {
            robot.push_frame(j + 1, n, &row.frame, Some(row));
        }
        robot.push_frame(n + 1, n, &file.tool, None);
        robot
    }

    /// The joints with readings of their own, the further columns and what is derived, in the order of the table.
    fn name_inputs(&mut self) {
        let moving = |joint: &JointRow| joint.kind != JointKind::Fixed;
        let joints = self.file.joints.clone();
        for (k, row) in joints.iter().enumerate() {
            if moving(row) && row.reading == Reading::Own {
                self.joints.push(Joint {
                    name: row.name.clone(),
                    kind: row.kind,
                    limits: row.limits,
                    value: row.value,
                    frame: k + 1,
                    offset_parameter: None,
                });
            }
        }
        for (k, row) in joints.iter().enumerate().filter(|(_, row)| moving(row)) {
            for input in row.models.iter().flat_map(|model| model.model.inputs()) {
                match input {
                    Input::Own | Input::Joint(_) => {}
                    Input::Column(name) => self.name_column(name, false),
                    Input::Sign(name) => self.name_column(name, true),
                    Input::GravityArm(frame) => self.derive_once(Derived::GravityArm(k + 1, frame)),
                    Input::GravityTorque => self.derive_once(Derived::GravityTorque(k + 1)),
                }
            }
        }
    }

    fn name_column(&mut self, name: String, sign: bool) {
        if let Some(known) = self.columns.iter_mut().find(|column| column.name == name) {
            known.sign &= sign;
            return;
        }
        let said = self.file.inputs.iter().find(|input| input.name == name);
        self.columns.push(InputColumn {
            name,
            sign,
            range: said.and_then(|said| said.range).unwrap_or([-1.0, 1.0]),
            value: said.and_then(|said| said.value),
        });
    }

    fn derive_once(&mut self, derived: Derived) {
        if !self.derived.contains(&derived) {
            self.derived.push(derived);
        }
    }

    fn push(&mut self, stem: &str, number: usize, n: usize, parameter: Parameter) {
        let distal = self.convention == Convention::DenavitHartenberg;
        let name = match number {
            0 if distal => format!("base_{stem}"),
            _ if distal && number == n + 1 => format!("tool_{stem}"),
            _ => format!("{stem}{number}"),
        };
        self.parameters.push(Parameter { name, ..parameter });
    }

    fn push_frame(&mut self, number: usize, n: usize, row: &FrameRow, joint: Option<&JointRow>) {
        let start = self.parameters.len();
        let convention = row.convention.unwrap_or(self.convention);
        let custom = self.file.custom.iter().find(|(k, _)| *k == number);
        let function = match (custom.cloned(), convention) {
            (Some((_, custom)), _) => {
                for (parameter, nominal) in custom.model.parameters().iter().zip(&custom.values) {
                    let made = Parameter {
                        name: String::new(),
                        kind: ParameterKind::Custom,
                        frame: number,
                        nominal: *nominal,
                        unit: parameter.unit,
                    };
                    self.push(&parameter.name, number, n, made);
                }
                FrameFunction::Custom(custom.model)
            }
            (None, convention) => self.push_table_frame(number, n, row, convention),
        };
        let width = self.parameters.len() - start;
        let moves = joint.filter(|joint| joint.kind != JointKind::Fixed);
        let motion = moves.map(|joint| self.push_motion(number, n, joint, start, &function));
        self.frames.push(Frame {
            parameters: start..self.parameters.len(),
            motion,
            width,
            function,
        });
    }

    fn push_table_frame(
        &mut self,
        number: usize,
        n: usize,
        row: &FrameRow,
        convention: Convention,
    ) -> FrameFunction {
        use ParameterKind::{Alpha, Beta, LengthX, LengthZ, Small, Theta};
        let parallel = row.alpha.sin().abs() < PARALLEL && row.beta.sin().abs() < PARALLEL;
        let beta = (parallel || row.beta != 0.0).then_some((Beta, Key::Beta));
        let base = convention == Convention::KhalilKleinfinger && number == 0;
        let (function, mut kinds) = match convention {
            Convention::KhalilKleinfinger if base => (
                FrameFunction::Base,
                vec![(Theta, Key::Theta), (LengthZ, Key::R)],
            ),
            Convention::KhalilKleinfinger => (
                FrameFunction::KhalilKleinfinger,
                vec![
                    (Alpha, Key::Alpha),
                    (LengthX, Key::D),
                    (Theta, Key::Theta),
                    (LengthZ, Key::R),
                ],
            ),
            Convention::DenavitHartenberg => (
                FrameFunction::DenavitHartenberg,
                vec![
                    (Theta, Key::Theta),
                    (LengthZ, Key::D),
                    (LengthX, Key::A),
                    (Alpha, Key::Alpha),
                ],
            ),
            Convention::General => {
                let small = (0..).map(Small).zip(Key::SMALL);
                (
                    FrameFunction::General(Box::new(row.general)),
                    small.collect(),
                )
            }
        };
        if !base && convention != Convention::General {
            kinds.extend(beta);
        }
        for (kind, key) in kinds {
            let unit = match key.dimension() {
                crate::text::Dimension::Angle => Unit::Radian,
                _ => Unit::Meter,
            };
            let made = Parameter {
                name: String::new(),
                kind,
                frame: number,
                nominal: row.get(key),
                unit,
            };
            self.push(key.name(), number, n, made);
        }
        function
    }

    fn push_motion(
        &mut self,
        number: usize,
        n: usize,
        joint: &JointRow,
        start: usize,
        function: &FrameFunction,
    ) -> Motion {
        let reading_of =
            |robot: &Self, name: &str| robot.joints.iter().position(|j| j.name == name);
        let reading = match &joint.reading {
            Reading::Own => reading_of(self, &joint.name),
            Reading::Of(name) => reading_of(self, name),
            Reading::None => None,
        };
        let offset = match joint.kind {
            JointKind::Prismatic => ParameterKind::LengthZ,
            _ => ParameterKind::Theta,
        };
        let own = start..self.parameters.len();
        let adds_to = self.parameters[own].iter().position(|p| p.kind == offset);
        let nearest = match function {
            FrameFunction::General(frame) => {
                let first = if joint.kind == JointKind::Prismatic {
                    0
                } else {
                    3
                };
                Some(start + first + frame.axis().iamax())
            }
            _ => adds_to.map(|place| start + place),
        };
        if let (Reading::Own, Some(reading)) = (&joint.reading, reading) {
            self.joints[reading].offset_parameter = nearest;
        }
        let gain = joint.gain.filter(|_| reading.is_some()).map(|nominal| {
            let made = Parameter {
                name: String::new(),
                kind: ParameterKind::Gain,
                frame: number,
                nominal,
                unit: Unit::One,
            };
            self.push("K", number, n, made);
            self.parameters.len() - 1
        });
        let mut terms = Vec::new();
        for row in &joint.models {
            let first = self.parameters.len();
            let parameters = row.model.parameters(joint.kind);
            for (parameter, nominal) in parameters.iter().zip(&row.values) {
                let made = Parameter {
                    name: String::new(),
                    kind: ParameterKind::Model,
                    frame: number,
                    nominal: *nominal,
                    unit: parameter.unit,
                };
                // `cos1` of frame 3 is `cos1_3`: digits do not run together.
                self.push(&format!("{}_", parameter.name), number, n, made);
            }
            let place = |input: &Input| self.place_of(number, reading, input);
            terms.push(Term {
                model: row.model.clone(),
                parameters: first..self.parameters.len(),
                inputs: row.model.inputs().iter().map(place).collect(),
            });
        }
        Motion {
            name: joint.name.clone(),
            kind: joint.kind,
            number: self.motions(),
            adds_to,
            reading,
            gain,
            terms,
        }
    }

    /// Where an input of a joint stands in a row.
    fn place_of(&self, number: usize, own: Option<usize>, input: &Input) -> usize {
        let derived = |wanted: Derived| {
            let place = self.derived.iter().position(|known| *known == wanted);
            place.map(|place| self.given() + place)
        };
        let place = match input {
            Input::Own => own,
            Input::Joint(name) => self.joints.iter().position(|j| j.name == *name),
            Input::Column(name) | Input::Sign(name) => {
                let place = self.columns.iter().position(|column| column.name == *name);
                place.map(|place| self.joints.len() + place)
            }
            Input::GravityArm(frame) => derived(Derived::GravityArm(number, *frame)),
            Input::GravityTorque => derived(Derived::GravityTorque(number)),
        };
        // Tables are checked as they are read; one made in a program may name what is not there.
        match place {
            Some(place) => place,
            None => panic!("frame {number}: there is no input {input:?}"),
        }
    }
}
