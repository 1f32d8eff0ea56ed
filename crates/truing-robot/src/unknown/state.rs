//! Values of everything a calibration knows.

use super::estimable::Value;
use super::key::{Key, Own};
use std::collections::BTreeMap;
use truing::manifold::{Point3, Pose, Pose3};
use truing::nalgebra::Vector3;

/// Values of everything a calibration knows: robots, sensor frames, tool points, and what the sets of
/// measurements bring, whoever brought it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct State {
    /// Parameters of every robot.
    pub robots: Vec<Vec<f64>>,
    unknowns: BTreeMap<Key, Value>,
}

impl State {
    /// Robots alone.
    pub fn of(robots: Vec<Vec<f64>>) -> Self {
        Self {
            robots,
            unknowns: BTreeMap::new(),
        }
    }

    /// The value of an unknown.
    pub fn get(&self, key: &Key) -> Option<&Value> {
        self.unknowns.get(key)
    }

    /// Gives an unknown a value; the former one comes back.
    pub fn set(&mut self, key: Key, value: Value) -> Option<Value> {
        self.unknowns.insert(key, value)
    }

    /// All unknowns, sensor frames first, then tool points, then those of sets.
    pub fn iter(&self) -> impl Iterator<Item = (&Key, &Value)> {
        self.unknowns.iter()
    }

    /// The same robots, sensor frames and tool points, without what belongs to sets.
    #[must_use]
    pub fn shared(&self, robots: Vec<Vec<f64>>) -> Self {
        let shared = |(key, value): (&Key, &Value)| match key {
            Key::Own(_) => None,
            key => Some((key.clone(), value.clone())),
        };
        Self {
            robots,
            unknowns: self.unknowns.iter().filter_map(shared).collect(),
        }
    }

    /// The pose of a sensor's frame.
    pub fn frame(&self, name: &str) -> Option<Pose<f64>> {
        self.get(&Key::Frame(name.to_owned()))?
            .get::<Pose3>()
            .copied()
    }

    /// Places a sensor's frame.
    pub fn set_frame(&mut self, name: &str, pose: Pose<f64>) {
        self.set(Key::Frame(name.to_owned()), Value::of::<Pose3>(pose));
    }

    /// A point on a tool \[m\]: a tool point, or the origin of a body on the tool.
    pub fn target(&self, robot: usize, name: &str) -> Option<Vector3<f64>> {
        self.body(robot, name).map(|pose| pose.translation)
    }

    /// A body on a tool; a tool point has the tool's orientation.
    pub fn body(&self, robot: usize, name: &str) -> Option<Pose<f64>> {
        let value = self.get(&Key::Target(robot, name.to_owned()))?;
        match value.get::<Point3>() {
            Some(point) => Some(Pose {
                translation: *point,
                ..Pose::identity()
            }),
            None => value.get::<Pose3>().copied(),
        }
    }

    /// Places a tool point \[m\].
    pub fn set_target(&mut self, robot: usize, name: &str, point: Vector3<f64>) {
        let key = Key::Target(robot, name.to_owned());
        self.set(key, Value::of::<Point3>(point));
    }

    /// The value of an unknown of a group of a set.
    pub fn own(&self, set: &str, group: &str, name: &str) -> Option<&Value> {
        self.get(&Key::Own(Own {
            set: set.to_owned(),
            group: group.to_owned(),
            name: name.to_owned(),
        }))
    }

    /// Gives an unknown of a group of a set a value.
    pub fn set_own(&mut self, set: &str, group: &str, name: &str, value: Value) {
        let own = Own {
            set: set.to_owned(),
            group: group.to_owned(),
            name: name.to_owned(),
        };
        self.set(Key::Own(own), value);
    }
}
