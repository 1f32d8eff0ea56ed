//! Types of variables that a calibration can estimate: components with names and units, what growth
//! does to them, how they are shown.

use crate::robot::Unit;
use std::any::Any;
use std::fmt;
use std::marker::PhantomData;
use std::sync::Arc;
use truing::manifold::{Direction3, Plane, Plane3, Point3, Pose, Pose3, Rotation3, Vector};
use truing::nalgebra::Vector3;
use truing::{AnyVar, Problem, Values, Variable};

/// What an unknown is, as a person pictures it.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A plane.
    Plane(Plane<f64>),
    /// A point \[m\].
    Point(Vector3<f64>),
    /// A position with an orientation.
    Pose(Pose<f64>),
    /// Numbers, one a component.
    Numbers(Vec<f64>),
}

/// A type of variable that a calibration can estimate.
///
/// Implement it for a [`Variable`] of your own to use that in a kind of measurement; planes, points,
/// poses, directions and rotations have it. Plain numbers have their names in their value:
/// [`Value::numbers`].
pub trait Estimable: Variable<Value: PartialEq + Send + Sync> {
    /// Names and units of the components of its tangent.
    const COMPONENTS: &'static [(&'static str, Unit)];

    /// The derivative of its components by ε where all lengths grow by 1 + ε about the origin of the
    /// reference frame: lengths and coordinates themselves, zero for angles and ratios.
    fn growth(value: &Self::Value) -> Vec<f64>;

    /// What it is, as a person pictures it.
    fn shape(value: &Self::Value) -> Shape;
}

impl Estimable for Plane3 {
    const COMPONENTS: &'static [(&'static str, Unit)] = &[
        ("tilt1", Unit::Radian),
        ("tilt2", Unit::Radian),
        ("distance", Unit::Meter),
    ];

    fn growth(plane: &Plane<f64>) -> Vec<f64> {
        vec![0.0, 0.0, plane.distance]
    }

    fn shape(plane: &Plane<f64>) -> Shape {
        Shape::Plane(*plane)
    }
}

impl Estimable for Point3 {
    const COMPONENTS: &'static [(&'static str, Unit)] =
        &[("x", Unit::Meter), ("y", Unit::Meter), ("z", Unit::Meter)];

    fn growth(point: &Vector3<f64>) -> Vec<f64> {
        point.as_slice().to_vec()
    }

    fn shape(point: &Vector3<f64>) -> Shape {
        Shape::Point(*point)
    }
}

impl Estimable for Pose3 {
    const COMPONENTS: &'static [(&'static str, Unit)] = &[
        ("x", Unit::Meter),
        ("y", Unit::Meter),
        ("z", Unit::Meter),
        ("rx", Unit::Radian),
        ("ry", Unit::Radian),
        ("rz", Unit::Radian),
    ];

    fn growth(pose: &Pose<f64>) -> Vec<f64> {
        let t = pose.translation;
        vec![t.x, t.y, t.z, 0.0, 0.0, 0.0]
    }

    fn shape(pose: &Pose<f64>) -> Shape {
        Shape::Pose(*pose)
    }
}

impl Estimable for Direction3 {
    const COMPONENTS: &'static [(&'static str, Unit)] =
        &[("tilt1", Unit::Radian), ("tilt2", Unit::Radian)];

    fn growth(_: &Vector3<f64>) -> Vec<f64> {
        vec![0.0; 2]
    }

    fn shape(direction: &Vector3<f64>) -> Shape {
        Shape::Numbers(direction.as_slice().to_vec())
    }
}

impl Estimable for Rotation3 {
    const COMPONENTS: &'static [(&'static str, Unit)] = &[
        ("rx", Unit::Radian),
        ("ry", Unit::Radian),
        ("rz", Unit::Radian),
    ];

    fn growth(_: &Self::Value) -> Vec<f64> {
        vec![0.0; 3]
    }

    fn shape(rotation: &Self::Value) -> Shape {
        let pose = Pose {
            rotation: *rotation,
            translation: Vector3::zeros(),
        };
        Shape::Numbers(pose.quaternion().to_vec())
    }
}

/// A component of an unknown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Component {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: Unit,
}

/// The type of an unknown, at run time.
trait AnyType: fmt::Debug + Send + Sync {
    fn components(&self) -> Vec<Component>;
    fn add(&self, problem: &mut Problem, name: &str, value: &dyn Any) -> AnyVar;
    fn read(&self, values: &Values, var: AnyVar) -> Value;
    fn growth(&self, value: &dyn Any) -> Vec<f64>;
    fn shape(&self, value: &dyn Any) -> Shape;
    fn equal(&self, a: &dyn Any, b: &dyn Any) -> bool;
    fn show(&self, value: &dyn Any, f: &mut fmt::Formatter<'_>) -> fmt::Result;
}

/// An [`Estimable`] type.
struct Typed<V>(PhantomData<fn() -> V>);

impl<V> Clone for Typed<V> {
    fn clone(&self) -> Self {
        Self(PhantomData)
    }
}

impl<V> Typed<V> {
    fn new() -> Self {
        Self(PhantomData)
    }
}

impl<V> fmt::Debug for Typed<V> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(std::any::type_name::<V>())
    }
}

/// A value is made together with its type, and only by this module: they never differ.
#[track_caller]
fn of<V: Variable>(value: &dyn Any) -> &V::Value
where
    V::Value: 'static,
{
    match value.downcast_ref() {
        Some(value) => value,
        None => panic!(
            "a value of another type than {}",
            std::any::type_name::<V>()
        ),
    }
}

/// A handle of a type other than the unknown's is a mistake of a programmer.
#[track_caller]
pub(crate) fn typed<V: Variable>(var: AnyVar) -> truing::Var<V> {
    match var.typed() {
        Some(var) => var,
        None => panic!("the unknown is not a {}", std::any::type_name::<V>()),
    }
}

impl<V: Estimable> AnyType for Typed<V> {
    fn components(&self) -> Vec<Component> {
        let one = |(name, unit): &(&str, Unit)| Component {
            name: (*name).to_owned(),
            unit: *unit,
        };
        V::COMPONENTS.iter().map(one).collect()
    }

    fn add(&self, problem: &mut Problem, name: &str, value: &dyn Any) -> AnyVar {
        problem.add_variable::<V>(name, of::<V>(value)).into()
    }

    fn read(&self, values: &Values, var: AnyVar) -> Value {
        Value::of::<V>(values.get(typed::<V>(var)))
    }

    fn growth(&self, value: &dyn Any) -> Vec<f64> {
        V::growth(of::<V>(value))
    }

    fn shape(&self, value: &dyn Any) -> Shape {
        V::shape(of::<V>(value))
    }

    fn equal(&self, a: &dyn Any, b: &dyn Any) -> bool {
        match (a.downcast_ref::<V::Value>(), b.downcast_ref::<V::Value>()) {
            (Some(a), Some(b)) => a == b,
            _ => false,
        }
    }

    fn show(&self, value: &dyn Any, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(of::<V>(value), f)
    }
}

/// Numbers with names and units.
#[derive(Debug, Clone, PartialEq)]
struct Numbers(Vec<Component>);

impl AnyType for Numbers {
    fn components(&self) -> Vec<Component> {
        self.0.clone()
    }

    fn add(&self, problem: &mut Problem, name: &str, value: &dyn Any) -> AnyVar {
        problem
            .add_variable::<Vector>(name, of::<Vector>(value))
            .into()
    }

    fn read(&self, values: &Values, var: AnyVar) -> Value {
        Value {
            of: Arc::new(self.clone()),
            value: Arc::new(values.get(typed::<Vector>(var))),
        }
    }

    fn growth(&self, value: &dyn Any) -> Vec<f64> {
        let grown = |(c, x): (&Component, &f64)| if c.unit == Unit::Meter { *x } else { 0.0 };
        self.0.iter().zip(of::<Vector>(value)).map(grown).collect()
    }

    fn shape(&self, value: &dyn Any) -> Shape {
        Shape::Numbers(of::<Vector>(value).clone())
    }

    fn equal(&self, a: &dyn Any, b: &dyn Any) -> bool {
        match (a.downcast_ref::<Vec<f64>>(), b.downcast_ref::<Vec<f64>>()) {
            (Some(a), Some(b)) => a == b,
            _ => false,
        }
    }

    fn show(&self, value: &dyn Any, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(of::<Vector>(value), f)
    }
}

/// The value of an unknown, of any [`Estimable`] type, or numbers.
#[derive(Clone)]
pub struct Value {
    of: Arc<dyn AnyType>,
    value: Arc<dyn Any + Send + Sync>,
}

impl Value {
    /// A value of a type.
    pub fn of<V: Estimable>(value: V::Value) -> Self {
        Self {
            of: Arc::new(Typed::<V>::new()),
            value: Arc::new(value),
        }
    }

    /// Numbers with names and units: a variable of type [`Vector`].
    pub fn numbers(numbers: &[(&str, Unit, f64)]) -> Self {
        let component = |(name, unit, _): &(&str, Unit, f64)| Component {
            name: (*name).to_owned(),
            unit: *unit,
        };
        let values: Vec<f64> = numbers.iter().map(|(_, _, x)| *x).collect();
        Self {
            of: Arc::new(Numbers(numbers.iter().map(component).collect())),
            value: Arc::new(values),
        }
    }

    /// One number with its name and unit: a variable of type [`Vector`].
    pub fn number(name: &str, unit: Unit, value: f64) -> Self {
        Self::numbers(&[(name, unit, value)])
    }

    /// The value, if it is of that type.
    pub fn get<V: Variable>(&self) -> Option<&V::Value>
    where
        V::Value: 'static,
    {
        self.value.downcast_ref()
    }

    /// Names and units of its components.
    pub fn components(&self) -> Vec<Component> {
        self.of.components()
    }

    /// The derivative of its components by ε where all lengths grow by 1 + ε.
    pub fn growth(&self) -> Vec<f64> {
        self.of.growth(&*self.value)
    }

    /// What it is, as a person pictures it.
    pub fn shape(&self) -> Shape {
        self.of.shape(&*self.value)
    }

    /// A variable of a problem that starts at this value.
    pub(crate) fn add(&self, problem: &mut Problem, name: &str) -> AnyVar {
        self.of.add(problem, name, &*self.value)
    }

    /// The value that such a variable has.
    pub(crate) fn read(&self, values: &Values, var: AnyVar) -> Self {
        self.of.read(values, var)
    }
}

impl PartialEq for Value {
    fn eq(&self, other: &Self) -> bool {
        self.of.equal(&*self.value, &*other.value)
    }
}

impl fmt::Debug for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.of.show(&*self.value, f)
    }
}
