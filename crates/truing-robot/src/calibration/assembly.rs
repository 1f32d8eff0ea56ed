//! From sets of measurements to a [`Problem`], and back from its values to planes, points and frames.

use super::form::{Form, Parts};
use super::measurement::{Arm, Measured, MeasurementSet};
use super::state::{Column, Owner, State};
use crate::constraint::{
    Chain, Derivatives, Distance, KnownPlane, MeasuredPose, Position, PostureDistance, SamePoint,
    UnknownPlane,
};
use crate::error::Error;
use crate::kinematics::Unit;
use std::collections::BTreeMap;
use std::sync::Arc;
use truing::manifold::{Plane, Plane3, Point3, Pose, Pose3, Vector};
use truing::nalgebra::Vector3;
use truing::{Batch, Noise, Problem, Values, Var};

/// A problem made of sets of measurements, with the handles to read its solution.
pub struct Assembly {
    /// The problem. Block k holds set k.
    pub problem: Problem,
    /// Every column.
    pub columns: Vec<Column>,
    robots: Vec<Var<Vector>>,
    /// Which parameters of each robot are lengths.
    lengths: Vec<Vec<bool>>,
    frames: BTreeMap<String, Var<Pose3>>,
    targets: BTreeMap<(usize, String), Var<Point3>>,
    planes: Vec<Vec<PlaneVar>>,
    points: Vec<Vec<Var<Point3>>>,
    locations: Vec<Vec<Var<Pose3>>>,
    distances: Vec<Option<Var<Vector>>>,
}

/// The variable of a plane.
#[derive(Clone)]
pub enum PlaneVar {
    /// Unit normal and distance.
    Plane(Var<Plane3>),
    /// The coordinates of a form.
    Coordinates(Var<Vector>, Arc<dyn Form>),
}

impl PlaneVar {
    /// Its first column.
    pub fn column(&self) -> usize {
        match self {
            Self::Plane(var) => var.column(),
            Self::Coordinates(var, _) => var.column(),
        }
    }
}

impl Assembly {
    /// Assembles sets at a state. Columns depend on the robots and the names in the sets only, not
    /// on how many rows there are.
    ///
    /// # Errors
    /// If a standard deviation is not positive and finite.
    pub fn new(
        arms: &[Arm],
        sets: &[MeasurementSet],
        state: &State,
        derivatives: &Derivatives,
    ) -> Result<Self, Error> {
        let chains: Vec<Arc<Chain>> = arms
            .iter()
            .map(|arm| Chain::with(arm.robot.clone(), derivatives.clone()))
            .collect();
        let mut a = Self {
            problem: Problem::new(),
            columns: Vec::new(),
            robots: Vec::new(),
            lengths: arms
                .iter()
                .map(|arm| {
                    arm.robot
                        .parameters()
                        .iter()
                        .map(|p| p.unit() == Unit::Meter)
                        .collect()
                })
                .collect(),
            frames: BTreeMap::new(),
            targets: BTreeMap::new(),
            planes: Vec::new(),
            points: Vec::new(),
            locations: Vec::new(),
            distances: Vec::new(),
        };
        for (robot, arm) in arms.iter().enumerate() {
            let name = if arm.name.is_empty() {
                arm.robot.name()
            } else {
                &arm.name
            };
            a.robots
                .push(a.problem.add_variable::<Vector>(name, &state.robots[robot]));
            let names: Vec<String> = (0..arm.robot.parameters().len())
                .map(|p| arm.parameter_name(p))
                .collect();
            a.problem.name_components(a.robots[robot], &names);
            for (parameter, name) in names.into_iter().enumerate() {
                a.columns.push(Column {
                    owner: Owner::Parameter { robot, parameter },
                    name,
                });
            }
        }
        let world = a.constant_pose("reference frame");
        let origin = a.constant_point("tool origin");
        // A constraint cannot be on one variable twice: the other robot's tool origin is another one.
        let other_origin = a.constant_point("other tool origin");
        for set in sets {
            if let Some(name) = &set.frame
                && !a.frames.contains_key(name)
            {
                let var = a.problem.add_variable::<Pose3>(name, &state.sensor(set));
                a.frames.insert(name.clone(), var);
                a.name_columns(
                    &Owner::Frame(name.clone()),
                    name,
                    &["x", "y", "z", "rx", "ry", "rz"],
                );
            }
            for key in set.targets() {
                if !a.targets.contains_key(&key) {
                    let (robot, name) = key.clone();
                    let value = state.targets.get(&key).copied().unwrap_or_default();
                    let var = a.problem.add_variable::<Point3>(&name, &value);
                    a.targets.insert(key, var);
                    let prefix = &arms[robot].name;
                    let full = if prefix.is_empty() {
                        name.clone()
                    } else {
                        format!("{prefix}.{name}")
                    };
                    a.name_columns(&Owner::Target(robot, name), &full, &["x", "y", "z"]);
                }
            }
        }
        for (k, set) in sets.iter().enumerate() {
            a.add_groups(k, set, state)?;
        }
        for (k, set) in sets.iter().enumerate() {
            let target = match &set.target {
                Some(name) => a.targets[&(set.robot, name.clone())],
                None => origin,
            };
            let sensor = set.frame.as_ref().map_or(world, |name| a.frames[name]);
            a.add_block(k, set, &chains, target, sensor, other_origin)?;
        }
        Ok(a)
    }

    fn name_columns(&mut self, owner: &Owner, name: &str, components: &[&str]) {
        for component in components {
            self.columns.push(Column {
                owner: owner.clone(),
                name: format!("{name}.{component}"),
            });
        }
    }

    fn constant_pose(&mut self, name: &str) -> Var<Pose3> {
        let var = self.problem.add_variable::<Pose3>(name, &Pose::identity());
        self.problem.fix(var);
        self.name_columns(&Owner::Constant, name, &["x", "y", "z", "rx", "ry", "rz"]);
        var
    }

    fn constant_point(&mut self, name: &str) -> Var<Point3> {
        let var = self.problem.add_variable::<Point3>(name, &Vector3::zeros());
        self.problem.fix(var);
        self.name_columns(&Owner::Constant, name, &["x", "y", "z"]);
        var
    }

    fn add_groups(&mut self, k: usize, set: &MeasurementSet, state: &State) -> Result<(), Error> {
        let (mut planes, mut points) = (Vec::new(), Vec::new());
        let (mut locations, mut distance) = (Vec::new(), None);
        if set.eliminates() {
            self.planes.push(planes);
            self.points.push(points);
            self.locations.push(locations);
            self.distances.push(distance);
            return Ok(());
        }
        match &set.measured {
            Measured::UnknownPlane(groups) => {
                for (g, name) in groups.names.iter().enumerate() {
                    let full = format!("{}[{name}]", set.name);
                    let plane = &state.planes[k][g];
                    let form = set.form.as_ref().filter(|form| form.chart().is_some());
                    let (var, components) = match form.and_then(|f| Some((f, f.chart()?))) {
                        Some((form, chart)) => {
                            let coordinates = chart.coordinates(plane)?.to_vec();
                            let var = self.problem.add_variable::<Vector>(&full, &coordinates);
                            (PlaneVar::Coordinates(var, form.clone()), ["a", "b", "c"])
                        }
                        None => {
                            let var = self.problem.add_variable::<Plane3>(&full, plane);
                            (PlaneVar::Plane(var), ["tilt1", "tilt2", "distance"])
                        }
                    };
                    planes.push(var);
                    self.name_columns(&Owner::Plane(k, g), &full, &components);
                }
            }
            Measured::SamePoint(groups) => {
                for (g, name) in groups.names.iter().enumerate() {
                    let full = format!("{}[{name}]", set.name);
                    points.push(
                        self.problem
                            .add_variable::<Point3>(&full, &state.points[k][g]),
                    );
                    self.name_columns(&Owner::Point(k, g), &full, &["x", "y", "z"]);
                }
            }
            Measured::SameLocation(groups) => {
                for (g, name) in groups.names.iter().enumerate() {
                    let full = format!("{}[{name}]", set.name);
                    let location = &state.locations[k][g];
                    locations.push(self.problem.add_variable::<Pose3>(&full, location));
                    let components = ["x", "y", "z", "rx", "ry", "rz"];
                    self.name_columns(&Owner::Location(k, g), &full, &components);
                }
            }
            Measured::Distance {
                distance: known, ..
            } => {
                let var = self
                    .problem
                    .add_variable::<Vector>(&set.name, &vec![state.distances[k]]);
                let owner = if known.is_some() {
                    self.problem.fix(var);
                    Owner::Constant
                } else {
                    Owner::Distance(k)
                };
                self.columns.push(Column {
                    owner,
                    name: format!("{}.distance", set.name),
                });
                distance = Some(var);
            }
            _ => {}
        }
        self.planes.push(planes);
        self.points.push(points);
        self.locations.push(locations);
        self.distances.push(distance);
        Ok(())
    }

    fn add_block(
        &mut self,
        k: usize,
        set: &MeasurementSet,
        chains: &[Arc<Chain>],
        target: Var<Point3>,
        sensor: Var<Pose3>,
        other_origin: Var<Point3>,
    ) -> Result<(), Error> {
        let robot = self.robots[set.robot];
        let chain = &chains[set.robot];
        if let Some(form) = &set.form {
            let parts = Parts {
                chain,
                robot,
                target,
                sensor,
                planes: &self.planes[k],
                points: &self.points[k],
                locations: &self.locations[k],
            };
            return form.add(set, &parts, &mut self.problem);
        }
        let length = |row: usize| Noise::isotropic(set.sigma[row].position);
        let rigid = |row: usize| {
            let s = set.sigma[row];
            Noise::diagonal(&[
                s.position, s.position, s.position, s.rotation, s.rotation, s.rotation,
            ])
        };
        macro_rules! batch {
            (|$row:ident, $q:ident| $vars:expr, $constraint:expr, $noise:expr) => {{
                let mut batch = Batch::new(set.name.clone()).loss(set.loss);
                for ($row, $q) in set.q.iter().enumerate() {
                    let $q = $q.clone();
                    batch.push_with_noise($vars, $constraint, $noise?);
                }
                self.problem.add_block(batch);
            }};
        }
        match &set.measured {
            Measured::Position(points) => batch!(
                |row, q| (robot, sensor, target),
                Position {
                    chain: chain.clone(),
                    q,
                    measured: points[row]
                },
                length(row)
            ),
            Measured::Pose(poses) => batch!(
                |row, q| (robot, sensor, target),
                MeasuredPose {
                    chain: chain.clone(),
                    q,
                    measured: poses[row]
                },
                rigid(row)
            ),
            Measured::KnownPlane(plane) => batch!(
                |row, q| (robot, target),
                KnownPlane {
                    chain: chain.clone(),
                    q,
                    plane: *plane
                },
                length(row)
            ),
            Measured::UnknownPlane(groups) => {
                let mut batch = Batch::new(set.name.clone()).loss(set.loss);
                for (row, q) in set.q.iter().enumerate() {
                    // Without a form `add_groups` made planes.
                    let PlaneVar::Plane(plane) = self.planes[k][groups.of_row[row]] else {
                        continue;
                    };
                    let constraint = UnknownPlane {
                        chain: chain.clone(),
                        q: q.clone(),
                    };
                    batch.push_with_noise((robot, target, plane), constraint, length(row)?);
                }
                self.problem.add_block(batch);
            }
            // The tool, seen from the location, stands at the identity.
            Measured::SameLocation(groups) => batch!(
                |row, q| (robot, self.locations[k][groups.of_row[row]], target),
                MeasuredPose {
                    chain: chain.clone(),
                    q,
                    measured: Pose::identity()
                },
                rigid(row)
            ),
            Measured::SamePoint(groups) => batch!(
                |row, q| (robot, target, self.points[k][groups.of_row[row]]),
                SamePoint {
                    chain: chain.clone(),
                    q
                },
                length(row)
            ),
            Measured::Distance { other, q_b, .. } => {
                // `add_groups` made the variable for this kind.
                let Some(distance) = self.distances[k] else {
                    return Ok(());
                };
                match other {
                    Some(b) => {
                        let other = self.robots[*b];
                        let other_target = match &set.other_target {
                            Some(name) => self.targets[&(*b, name.clone())],
                            None => other_origin,
                        };
                        batch!(
                            |row, q| (robot, target, other, other_target, distance),
                            Distance {
                                a: chain.clone(),
                                b: chains[*b].clone(),
                                q_a: q,
                                q_b: q_b[row].clone()
                            },
                            length(row)
                        );
                    }
                    None => batch!(
                        |row, q| (robot, target, distance),
                        PostureDistance {
                            chain: chain.clone(),
                            q_a: q,
                            q_b: q_b[row].clone()
                        },
                        length(row)
                    ),
                }
            }
        }
        Ok(())
    }

    /// A robot's variable.
    pub fn robot(&self, robot: usize) -> Var<Vector> {
        self.robots[robot]
    }

    /// Columns of a sensor frame's variable.
    pub fn frame(&self, name: &str) -> Option<Var<Pose3>> {
        self.frames.get(name).copied()
    }

    /// A tool point's variable.
    pub fn target(&self, robot: usize, name: &str) -> Option<Var<Point3>> {
        self.targets.get(&(robot, name.to_owned())).copied()
    }

    /// A plane's variable.
    pub fn plane(&self, set: usize, group: usize) -> &PlaneVar {
        &self.planes[set][group]
    }

    /// A point's variable.
    pub fn point(&self, set: usize, group: usize) -> Var<Point3> {
        self.points[set][group]
    }

    /// A location's variable.
    pub fn location(&self, set: usize, group: usize) -> Var<Pose3> {
        self.locations[set][group]
    }

    /// A distance's variable.
    pub fn distance(&self, set: usize) -> Option<Var<Vector>> {
        self.distances[set]
    }

    /// Estimates only the given columns.
    pub fn free_only(&mut self, free: &[usize]) {
        for column in 0..self.columns.len() {
            self.problem.set_column_fixed(column, true);
        }
        for column in free {
            self.problem.set_column_fixed(*column, false);
        }
    }

    /// The direction in which all lengths grow alike, one number a column: lengths and coordinates
    /// themselves, zero for angles, gains and what is known.
    pub fn scale_direction(&self, state: &State) -> Vec<f64> {
        let mut direction = vec![0.0; self.columns.len()];
        let mut put = |first: usize, values: &[f64]| {
            direction[first..first + values.len()].copy_from_slice(values);
        };
        for (var, (arm, values)) in self
            .robots
            .iter()
            .zip(self.lengths.iter().zip(&state.robots))
        {
            let lengths: Vec<f64> = values
                .iter()
                .zip(arm)
                .map(|(v, length)| if *length { *v } else { 0.0 })
                .collect();
            put(var.column(), &lengths);
        }
        for (name, var) in &self.frames {
            put(var.column(), state.frames[name].translation.as_slice());
        }
        for (key, var) in &self.targets {
            put(var.column(), state.targets[key].as_slice());
        }
        for (vars, planes) in self.planes.iter().zip(&state.planes) {
            vars.iter().zip(planes).for_each(|(var, plane)| match var {
                PlaneVar::Plane(var) => put(var.column() + 2, &[plane.distance]),
                PlaneVar::Coordinates(var, form) => {
                    if let Some(chart) = form.chart() {
                        put(var.column(), &chart.scaled(plane));
                    }
                }
            });
        }
        for (vars, points) in self.points.iter().zip(&state.points) {
            vars.iter()
                .zip(points)
                .for_each(|(var, point)| put(var.column(), point.as_slice()));
        }
        for (vars, locations) in self.locations.iter().zip(&state.locations) {
            vars.iter()
                .zip(locations)
                .for_each(|(var, location)| put(var.column(), location.translation.as_slice()));
        }
        for (var, distance) in self.distances.iter().zip(&state.distances) {
            if let Some(var) = var {
                put(var.column(), &[*distance]);
            }
        }
        direction
    }

    /// The state that values stand for; groups that forms have eliminated are empty in it.
    pub fn state(&self, values: &Values) -> State {
        State {
            robots: self.robots.iter().map(|var| values.get(*var)).collect(),
            frames: self
                .frames
                .iter()
                .map(|(name, var)| (name.clone(), values.get(*var)))
                .collect(),
            targets: self
                .targets
                .iter()
                .map(|(key, var)| (key.clone(), values.get(*var)))
                .collect(),
            planes: self
                .planes
                .iter()
                .map(|g| g.iter().map(|var| plane_of(var, values)).collect())
                .collect(),
            points: self
                .points
                .iter()
                .map(|g| g.iter().map(|var| values.get(*var)).collect())
                .collect(),
            locations: self
                .locations
                .iter()
                .map(|g| g.iter().map(|var| values.get(*var)).collect())
                .collect(),
            distances: self
                .distances
                .iter()
                .map(|var| var.map_or(0.0, |var| values.get(var)[0]))
                .collect(),
        }
    }

    /// Residuals of a set in its own units, one chunk of `dim` a measurement.
    pub fn residuals(&self, set: usize, values: &Values) -> Vec<f64> {
        self.problem.raw_residual(set, values)
    }
}

/// The plane that a variable stands for.
fn plane_of(var: &PlaneVar, values: &Values) -> Plane<f64> {
    match var {
        PlaneVar::Plane(var) => values.get(*var),
        PlaneVar::Coordinates(var, form) => match form.chart() {
            Some(chart) => chart.plane(&values.get(*var)),
            None => unreachable!("coordinates are those of a form's chart"),
        },
    }
}
