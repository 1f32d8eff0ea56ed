//! Models of joints: how a frame moves with what is read of its joint and beside it.

use super::joint_kind::JointKind;
use super::unit::{ModelParameter, Unit};
use std::fmt;
use std::sync::Arc;
use truing::{Dual, Scalar, autodiff};

/// What a model of a joint is a function of, beside its parameters.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Input {
    /// The reading of the joint itself [rad or m].
    Own,
    /// The reading of another joint, by name [rad or m].
    Joint(String),
    /// A further column of the data, by name: a torque, a temperature, a load.
    Column(String),
    /// A further column of which only the sign counts: a direction of approach.
    Sign(String),
    /// The arm of gravity on the joint's axis that a unit mass at the origin of a frame has \[m\], with the nominal
    /// parameters: what errors of these change in it is of second order.
    GravityArm(usize),
    /// The torque of gravity about the joint's axis \[N m\], or the force along it \[N\], from the masses of the
    /// robot's table, with the nominal parameters.
    GravityTorque,
}

/// A joint model: what it adds to the displacement of a joint [rad or m].
///
/// Written once over any [`Scalar`]; derivatives are automatic. The displacement of a joint is the sum
/// over its models; `gain`, K·q, is one of them.
pub trait JointModel: fmt::Debug + Send + Sync + 'static {
    /// Its parameters, at most sixteen.
    fn parameters(&self, joint: JointKind) -> Vec<ModelParameter>;

    /// Its inputs, at most eight.
    fn inputs(&self) -> Vec<Input> {
        vec![Input::Own]
    }

    /// Which part of the model a parameter belongs to: a part makes sense, and may pay, without those after it. All
    /// are of one part by default.
    fn part(&self, _parameter: usize) -> usize {
        0
    }

    /// What it adds to the displacement, from its parameters `p` and inputs `x` in their order.
    fn displacement<T: Scalar>(&self, p: &[T], x: &[T]) -> T;
}

/// Most parameters and inputs of a model.
pub(super) const MOST: usize = 16;
const MOST_INPUTS: usize = 8;

/// A [`JointModel`] of any type.
pub trait AnyJointModel: fmt::Debug + Send + Sync {
    /// Its parameters.
    fn parameters(&self, joint: JointKind) -> Vec<ModelParameter>;
    /// Its inputs.
    fn inputs(&self) -> Vec<Input>;
    /// Which part of the model a parameter belongs to.
    fn part(&self, parameter: usize) -> usize;
    /// What it adds to the displacement.
    fn value(&self, p: &[f64], x: &[f64]) -> f64;
    /// The same, with its derivatives by the parameters.
    fn by_parameters(&self, p: &[f64], x: &[f64], out: &mut [f64]) -> f64;
    /// Its derivatives by the inputs.
    fn by_inputs(&self, p: &[f64], x: &[f64], out: &mut [f64]);
}

/// Derivatives of f at x in chunks of four, on the stack.
fn gradient(x: &[f64], f: impl Fn(&[Dual<4>]) -> Dual<4>, out: &mut [f64]) -> f64 {
    let mut value = 0.0;
    let mut duals = [Dual::<4>::from(0.0); MOST];
    for first in (0..x.len().max(1)).step_by(4) {
        for (k, x) in x.iter().enumerate() {
            duals[k] = match k.checked_sub(first) {
                Some(place) if place < 4 => autodiff::seed(*x, place),
                _ => Dual::from(*x),
            };
        }
        let y = f(&duals[..x.len()]);
        let partials = autodiff::partials(&y);
        for (out, partial) in out[first.min(x.len())..].iter_mut().zip(partials.iter()) {
            *out = *partial;
        }
        value = truing::value(y);
    }
    value
}

/// Numbers as duals without derivatives.
fn constants(x: &[f64]) -> [Dual<4>; MOST] {
    let mut duals = [Dual::<4>::from(0.0); MOST];
    duals
        .iter_mut()
        .zip(x)
        .for_each(|(d, x)| *d = Dual::from(*x));
    duals
}

impl<M: JointModel> AnyJointModel for M {
    fn parameters(&self, joint: JointKind) -> Vec<ModelParameter> {
        let parameters = JointModel::parameters(self, joint);
        assert!(parameters.len() <= MOST, "at most {MOST} parameters");
        parameters
    }

    fn inputs(&self) -> Vec<Input> {
        let inputs = JointModel::inputs(self);
        assert!(inputs.len() <= MOST_INPUTS, "at most {MOST_INPUTS} inputs");
        inputs
    }

    fn part(&self, parameter: usize) -> usize {
        JointModel::part(self, parameter)
    }

    fn value(&self, p: &[f64], x: &[f64]) -> f64 {
        self.displacement(p, x)
    }

    fn by_parameters(&self, p: &[f64], x: &[f64], out: &mut [f64]) -> f64 {
        let inputs = constants(x);
        gradient(p, |p| self.displacement(p, &inputs[..x.len()]), out)
    }

    fn by_inputs(&self, p: &[f64], x: &[f64], out: &mut [f64]) {
        let parameters = constants(p);
        gradient(x, |x| self.displacement(&parameters[..p.len()], x), out);
    }
}

/// Makes a model from the words between its parentheses; none if they make no sense.
type Make = dyn Fn(&[&str]) -> Option<Arc<dyn AnyJointModel>> + Send + Sync;

/// A joint model that files can name: `model = ["gain", "eccentric"]`, or with words in parentheses.
#[derive(Clone)]
pub struct NamedJointModel {
    /// Its name.
    pub name: &'static str,
    /// How it is written: `harmonics(2)`.
    pub example: &'static str,
    make: Arc<Make>,
}

impl NamedJointModel {
    /// A model under its name; `make` makes it from the words between the parentheses, or says that they make no
    /// sense.
    pub fn new<M: JointModel>(
        name: &'static str,
        example: &'static str,
        make: impl Fn(&[&str]) -> Option<M> + Send + Sync + 'static,
    ) -> Self {
        let make = move |words: &[&str]| Some(Arc::new(make(words)?) as Arc<dyn AnyJointModel>);
        Self {
            name,
            example,
            make: Arc::new(make),
        }
    }

    /// The model with the words between the parentheses.
    pub fn make(&self, words: &[&str]) -> Option<Arc<dyn AnyJointModel>> {
        (self.make)(words)
    }
}

impl fmt::Debug for NamedJointModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "NamedJointModel({})", self.name)
    }
}

/// The unit of a joint's displacement.
fn unit_of(joint: JointKind) -> Unit {
    match joint {
        JointKind::Prismatic => Unit::Meter,
        _ => Unit::Radian,
    }
}

/// K·q: the gain of a joint.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Gain;

impl JointModel for Gain {
    fn parameters(&self, _: JointKind) -> Vec<ModelParameter> {
        vec![ModelParameter {
            name: "gain".into(),
            unit: Unit::One,
            nominal: 1.0,
        }]
    }

    fn displacement<T: Scalar>(&self, p: &[T], x: &[T]) -> T {
        p[0] * x[0]
    }
}

/// c·q of another joint: parallelogram arms, controllers whose joint 3 is relative to the horizontal, coupled
/// wrists, spline shafts whose screw moves with the turn.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Coupling {
    /// The other joint, by name.
    pub with: String,
}

impl JointModel for Coupling {
    fn parameters(&self, joint: JointKind) -> Vec<ModelParameter> {
        let unit = match joint {
            JointKind::Prismatic => Unit::Other("m/rad"),
            _ => Unit::One,
        };
        vec![ModelParameter::zero(
            format!("coupling_{}", self.with),
            unit,
        )]
    }

    fn inputs(&self) -> Vec<Input> {
        vec![Input::Joint(self.with.clone())]
    }

    fn displacement<T: Scalar>(&self, p: &[T], x: &[T]) -> T {
        p[0] * x[0]
    }
}

/// Σₖ (aₖ cos kq + bₖ sin kq), k = 1 … n: eccentric gears and encoders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Harmonics {
    /// How many, one to eight.
    pub count: usize,
}

impl JointModel for Harmonics {
    fn parameters(&self, joint: JointKind) -> Vec<ModelParameter> {
        let unit = unit_of(joint);
        let pair = |k: usize| ["cos", "sin"].map(|f| ModelParameter::zero(format!("{f}{k}"), unit));
        (1..=self.count).flat_map(pair).collect()
    }

    fn part(&self, parameter: usize) -> usize {
        parameter / 2
    }

    fn displacement<T: Scalar>(&self, p: &[T], x: &[T]) -> T {
        let mut sum = T::zero();
        for (k, pair) in p.chunks_exact(2).enumerate() {
            let (sin, cos) = (x[0] * (k + 1) as f64).sin_cos();
            sum += pair[0] * cos + pair[1] * sin;
        }
        sum
    }
}

/// c·τ with a torque τ that a column of the data gives \[N m\] (a force \[N\] of a sliding joint), or that gravity
/// has with the masses of the robot's table: the compliance of a joint.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Compliance {
    /// The column; none for gravity.
    pub column: Option<String>,
}

impl JointModel for Compliance {
    fn parameters(&self, joint: JointKind) -> Vec<ModelParameter> {
        let unit = match joint {
            JointKind::Prismatic => Unit::Other("m/N"),
            _ => Unit::Other("rad/(N m)"),
        };
        vec![ModelParameter::zero("compliance", unit)]
    }

    fn inputs(&self) -> Vec<Input> {
        vec![match &self.column {
            Some(column) => Input::Column(column.clone()),
            None => Input::GravityTorque,
        }]
    }

    fn displacement<T: Scalar>(&self, p: &[T], x: &[T]) -> T {
        p[0] * x[0]
    }
}

/// Σₖ wₖ·aₖ with the arms aₖ \[m\] of gravity that masses at the origins of frames beyond the joint have on its
/// axis: compliance where neither masses nor torques are known. wₖ is compliance times weight [rad/m].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Gravity {
    /// The frames.
    pub frames: Vec<usize>,
}

impl JointModel for Gravity {
    fn parameters(&self, joint: JointKind) -> Vec<ModelParameter> {
        let unit = match joint {
            JointKind::Prismatic => Unit::Other("m/m"),
            _ => Unit::Other("rad/m"),
        };
        let one = |frame: &usize| ModelParameter::zero(format!("gravity_{frame}"), unit);
        self.frames.iter().map(one).collect()
    }

    fn inputs(&self) -> Vec<Input> {
        let arm = |frame: &usize| Input::GravityArm(*frame);
        self.frames.iter().map(arm).collect()
    }

    fn displacement<T: Scalar>(&self, p: &[T], x: &[T]) -> T {
        let products = p.iter().zip(x).map(|(p, x)| *p * *x);
        products.fold(T::zero(), |sum, product| sum + product)
    }
}

/// ±b by the direction in which the joint came: backlash. A column says the direction by its sign.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Backlash {
    /// The column.
    pub column: String,
}

impl JointModel for Backlash {
    fn parameters(&self, joint: JointKind) -> Vec<ModelParameter> {
        vec![ModelParameter::zero("backlash", unit_of(joint))]
    }

    fn inputs(&self) -> Vec<Input> {
        vec![Input::Sign(self.column.clone())]
    }

    fn displacement<T: Scalar>(&self, p: &[T], x: &[T]) -> T {
        p[0] * x[0]
    }
}

/// c·x with a further column x of the data: temperature, load.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Linear {
    /// The column.
    pub column: String,
}

impl JointModel for Linear {
    fn parameters(&self, joint: JointKind) -> Vec<ModelParameter> {
        let unit = match joint {
            JointKind::Prismatic => Unit::Other("m/1"),
            _ => Unit::Other("rad/1"),
        };
        vec![ModelParameter::zero(
            format!("linear_{}", self.column),
            unit,
        )]
    }

    fn inputs(&self) -> Vec<Input> {
        vec![Input::Column(self.column.clone())]
    }

    fn displacement<T: Scalar>(&self, p: &[T], x: &[T]) -> T {
        p[0] * x[0]
    }
}

/// The models that every file can name, beside `gain`.
pub fn built_in() -> Vec<NamedJointModel> {
    let one = |words: &[&str]| match words {
        [word] => Some((*word).to_owned()),
        _ => None,
    };
    vec![
        NamedJointModel::new("coupling", "coupling(q2)", move |words| {
            Some(Coupling { with: one(words)? })
        }),
        NamedJointModel::new("harmonics", "harmonics(2)", |words| match words {
            [count] => {
                let count: usize = count.parse().ok()?;
                (1..=8).contains(&count).then_some(Harmonics { count })
            }
            _ => None,
        }),
        NamedJointModel::new("compliance", "compliance(tau2)", |words| match words {
            [] => Some(Compliance { column: None }),
            [column] => Some(Compliance {
                column: Some((*column).to_owned()),
            }),
            _ => None,
        }),
        NamedJointModel::new("gravity", "gravity(3, 4)", |words| {
            let frames: Option<Vec<usize>> = words.iter().map(|word| word.parse().ok()).collect();
            let frames = frames.filter(|frames| (1..=8).contains(&frames.len()))?;
            Some(Gravity { frames })
        }),
        NamedJointModel::new("backlash", "backlash(direction2)", move |words| {
            Some(Backlash {
                column: one(words)?,
            })
        }),
        NamedJointModel::new("linear", "linear(temperature)", move |words| {
            Some(Linear {
                column: one(words)?,
            })
        }),
    ]
}
