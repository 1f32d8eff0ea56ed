//! From sets of measurements to a [`Problem`], and back from its values to a state.

use super::column::{Column, Owner};
use crate::error::Error;
use crate::measurement::{Chart, Equations, Kind, MeasurementSet, TargetKind, Tool, ToolVars};
use crate::robot::{Arm, Chain, Derivatives, Unit};
use crate::unknown::{Component, Key, Own, State, Unknown, Value};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;
use truing::manifold::{Point3, Pose, Pose3, Vector};
use truing::nalgebra::Vector3;
use truing::{AnyVar, Problem, Values, Var};

/// A problem made of sets of measurements, with the handles to read its solution.
pub struct Assembly {
    /// The problem. Block k holds set k.
    pub problem: Problem,
    /// Every column.
    pub columns: Vec<Column>,
    robots: Vec<Var<Vector>>,
    /// Which parameters of each robot are lengths.
    lengths: Vec<Vec<bool>>,
    unknowns: BTreeMap<Key, AnyVar>,
    /// Values as they started; those whose equations have other coordinates in these.
    start: BTreeMap<Key, Value>,
    /// Sets whose unknowns have other coordinates, to read them back.
    charted: Vec<Charted>,
}

/// An unknown that is estimated in other coordinates.
struct Charted {
    key: Key,
    chart: Arc<dyn Chart>,
}

/// What is never estimated.
struct Constants {
    sensor: Var<Pose3>,
    /// A constraint cannot be on one variable twice: the second tool's origin is another one.
    origins: [Var<Point3>; 2],
}

impl Assembly {
    /// Assembles sets at a state. Columns depend on the robots and the names in the sets only, not
    /// on how many rows there are.
    ///
    /// # Errors
    /// If a standard deviation is not positive and finite, or a kind does not add one block of its rows.
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
            lengths: arms.iter().map(lengths).collect(),
            unknowns: BTreeMap::new(),
            start: BTreeMap::new(),
            charted: Vec::new(),
        };
        for (robot, arm) in arms.iter().enumerate() {
            a.add_robot(robot, arm, &state.robots[robot]);
        }
        let constants = Constants {
            sensor: a.constant_pose("reference frame"),
            origins: ["tool origin", "other tool origin"].map(|name| a.constant_point(name)),
        };
        for set in sets {
            a.add_shared(set, state);
        }
        for set in sets {
            let own = a.add_own(set, state)?;
            a.add_equations(set, own, &chains, &constants)?;
        }
        Ok(a)
    }

    fn add_robot(&mut self, robot: usize, arm: &Arm, values: &[f64]) {
        let var = self
            .problem
            .add_variable::<Vector>(arm.title(), &values.to_vec());
        let names: Vec<String> = (0..arm.robot.parameters().len())
            .map(|p| arm.parameter_name(p))
            .collect();
        self.problem.name_components(var, &names);
        self.robots.push(var);
        for (parameter, name) in names.into_iter().enumerate() {
            self.columns.push(Column {
                owner: Owner::Parameter { robot, parameter },
                name,
            });
        }
    }

    fn constant_pose(&mut self, name: &str) -> Var<Pose3> {
        let var = self.problem.add_variable::<Pose3>(name, &Pose::identity());
        self.problem.fix(var);
        let components = Value::of::<Pose3>(Pose::identity()).components();
        self.name_columns(&Owner::Constant, name, &components);
        var
    }

    fn constant_point(&mut self, name: &str) -> Var<Point3> {
        let var = self.problem.add_variable::<Point3>(name, &Vector3::zeros());
        self.problem.fix(var);
        let components = Value::of::<Point3>(Vector3::zeros()).components();
        self.name_columns(&Owner::Constant, name, &components);
        var
    }

    fn name_columns(&mut self, owner: &Owner, name: &str, components: &[Component]) {
        for component in components {
            self.columns.push(Column {
                owner: owner.clone(),
                name: format!("{name}.{}", component.name),
            });
        }
    }

    /// The sensor frame and the targets of a set, where no set before has named them.
    fn add_shared(&mut self, set: &MeasurementSet, state: &State) {
        if let Some(name) = &set.frame {
            let key = Key::Frame(name.clone());
            let identity = || Value::of::<Pose3>(Pose::identity());
            self.add_shared_one(key, Owner::Frame(name.clone()), name, state, identity);
        }
        for (robot, name) in set.targets() {
            let key = Key::Target(robot, name.clone());
            let owner = Owner::Target(robot, name.clone());
            let origin = || match set.kind.targets() {
                TargetKind::Point => Value::of::<Point3>(Vector3::zeros()),
                TargetKind::Body => Value::of::<Pose3>(Pose::identity()),
            };
            self.add_shared_one(key, owner, &name, state, origin);
        }
    }

    fn add_shared_one(
        &mut self,
        key: Key,
        owner: Owner,
        name: &str,
        state: &State,
        default: impl FnOnce() -> Value,
    ) {
        if self.unknowns.contains_key(&key) {
            return;
        }
        let value = state.get(&key).cloned().unwrap_or_else(default);
        let var = value.add(&mut self.problem, name);
        self.name_columns(&owner, name, &value.components());
        self.start.insert(key.clone(), value);
        self.unknowns.insert(key, var);
    }

    /// The unknowns of every group of a set, unless its equations leave them out.
    fn add_own(
        &mut self,
        set: &MeasurementSet,
        state: &State,
    ) -> Result<Vec<Vec<(&'static str, AnyVar)>>, Error> {
        let unknowns = set.kind.unknowns();
        let mut all = Vec::new();
        if set.eliminates() {
            return Ok(all);
        }
        for group in &set.groups.names {
            let mut vars = Vec::new();
            for unknown in &unknowns {
                let own = Own {
                    set: set.name.clone(),
                    group: group.clone(),
                    name: unknown.name.to_owned(),
                };
                let var = self.add_own_one(set, own, unknown, unknowns.len() > 1, state)?;
                vars.push((unknown.name, var));
            }
            all.push(vars);
        }
        Ok(all)
    }

    fn add_own_one(
        &mut self,
        set: &MeasurementSet,
        own: Own,
        unknown: &Unknown,
        several: bool,
        state: &State,
    ) -> Result<AnyVar, Error> {
        let key = Key::Own(own.clone());
        let Some(value) = state.get(&key) else {
            return Err(Error::calibration(
                format!("`{}` has no starting value for `{}`", own.title(), own.name),
                format!(
                    "the kind {} must start every unknown that it brings",
                    set.kind.name()
                ),
            ));
        };
        let method = set.method.as_ref();
        let chart = method.and_then(|method| method.chart(&*set.kind, unknown.name));
        let value = match &chart {
            Some(chart) => chart.coordinates(value)?,
            None => value.clone(),
        };
        let title = own.title();
        let var = value.add(&mut self.problem, &title);
        let owner = if unknown.known {
            self.problem.fix_any(var);
            Owner::Constant
        } else {
            Owner::Own {
                role: unknown.role,
                compares: unknown.compares,
                own,
            }
        };
        let components = value.components();
        let alone = components.len() == 1 && components[0].name == unknown.name;
        let title = if several && !alone {
            format!("{title}.{}", unknown.name)
        } else {
            title
        };
        self.name_columns(&owner, &title, &components);
        if let Some(chart) = chart {
            let key = key.clone();
            self.charted.push(Charted { key, chart });
        }
        self.start.insert(key.clone(), value);
        self.unknowns.insert(key, var);
        Ok(var)
    }

    fn add_equations(
        &mut self,
        set: &MeasurementSet,
        own: Vec<Vec<(&'static str, AnyVar)>>,
        chains: &[Arc<Chain>],
        constants: &Constants,
    ) -> Result<(), Error> {
        let mut tools = Vec::new();
        for (k, tool) in set.tools.iter().enumerate() {
            let target = match &tool.target {
                Some(name) => self.unknowns[&Key::Target(tool.robot, name.clone())],
                None => constants.origins[k].into(),
            };
            tools.push(ToolVars {
                chain: chains[tool.robot].clone(),
                robot: self.robots[tool.robot],
                target,
            });
        }
        let sensor = match &set.frame {
            Some(name) => self.frame(name).unwrap_or(constants.sensor),
            None => constants.sensor,
        };
        let before = self.problem.blocks().count();
        let mut on = Equations {
            readings: &set.readings,
            problem: &mut self.problem,
            tools,
            sensor,
            measurands: set.kind.measurands(),
            own,
        };
        match &set.method {
            Some(method) => method.equations(&*set.kind, &mut on)?,
            None => set.kind.equations(&mut on)?,
        }
        self.check_block(set, before)
    }

    /// The equations of a set are one block, and a kind's own have the rows of what it measures: errors,
    /// leverages and outliers are found by them.
    fn check_block(&self, set: &MeasurementSet, before: usize) -> Result<(), Error> {
        let whose = match &set.method {
            Some(method) => format!("the method {}", method.name()),
            None => format!("the kind {}", set.kind.name()),
        };
        let added = self.problem.blocks().count() - before;
        if added != 1 {
            return Err(Error::calibration(
                format!(
                    "`{}`: {whose} added {added} blocks of equations; expected one",
                    set.name
                ),
                "put all equations of a set into one block",
            ));
        }
        let Some(block) = self.problem.blocks().last() else {
            return Ok(());
        };
        let right = block.len() == set.len() && (block.dim() == set.dim() || block.is_empty());
        if set.method.is_none() && !right {
            return Err(Error::calibration(
                format!(
                    "`{}`: {whose} added {} constraints of {} rows for {} measurements; expected one each, of {} rows",
                    set.name,
                    block.len(),
                    block.dim(),
                    set.len(),
                    set.dim()
                ),
                "its equations and its measurands must agree",
            ));
        }
        Ok(())
    }

    /// A robot's variable.
    pub fn robot(&self, robot: usize) -> Var<Vector> {
        self.robots[robot]
    }

    /// A sensor frame's variable.
    pub fn frame(&self, name: &str) -> Option<Var<Pose3>> {
        self.unknowns.get(&Key::Frame(name.to_owned()))?.typed()
    }

    /// The variable of an unknown.
    pub fn unknown(&self, key: &Key) -> Option<AnyVar> {
        self.unknowns.get(key).copied()
    }

    /// The variable of a tool point or body.
    pub fn target(&self, robot: usize, name: &str) -> Option<AnyVar> {
        self.unknown(&Key::Target(robot, name.to_owned()))
    }

    /// The variable of an unknown of a group of a set.
    pub fn own(&self, set: &str, group: &str, name: &str) -> Option<AnyVar> {
        self.unknown(&Key::Own(Own {
            set: set.to_owned(),
            group: group.to_owned(),
            name: name.to_owned(),
        }))
    }

    /// The columns of an unknown; none where it has none.
    pub fn columns_of(&self, key: &Key) -> Range<usize> {
        self.unknown(key).map_or(0..0, AnyVar::columns)
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
    /// themselves, zero for angles, gains and what belongs to constants.
    pub fn growth(&self, state: &State) -> Vec<f64> {
        let mut direction = vec![0.0; self.columns.len()];
        let mut put = |first: usize, values: &[f64]| {
            direction[first..first + values.len()].copy_from_slice(values);
        };
        let robots = self.robots.iter().zip(&state.robots).zip(&self.lengths);
        for ((var, values), lengths) in robots {
            let grown = values.iter().zip(lengths);
            let grown: Vec<f64> = grown.map(|(v, l)| if *l { *v } else { 0.0 }).collect();
            put(var.column(), &grown);
        }
        for (key, var) in &self.unknowns {
            let Some(value) = state.get(key) else {
                continue;
            };
            let chart = self.charted.iter().find(|charted| charted.key == *key);
            let growth = match chart {
                Some(charted) => charted.chart.growth(value),
                None => value.growth(),
            };
            put(var.columns().start, &growth);
        }
        direction
    }

    /// The state that values stand for; unknowns that a method has eliminated are not in it.
    pub fn state(&self, values: &Values) -> State {
        let robots = self.robots.iter().map(|var| values.get(*var)).collect();
        let mut state = State::of(robots);
        for (key, var) in &self.unknowns {
            let value = self.start[key].read(values, *var);
            let chart = self.charted.iter().find(|charted| charted.key == *key);
            let value = match chart {
                Some(charted) => charted.chart.value(&value),
                None => value,
            };
            state.set(key.clone(), value);
        }
        state
    }

    /// Residuals of a set in its own units, one chunk of `dim` a measurement.
    pub fn residuals(&self, set: usize, values: &Values) -> Vec<f64> {
        self.problem.raw_residual(set, values)
    }
}

/// Which parameters of a robot are lengths.
fn lengths(arm: &Arm) -> Vec<bool> {
    let parameters = arm.robot.parameters().iter();
    parameters.map(|p| p.unit() == Unit::Meter).collect()
}

/// Whether the files or the program give everything a set's errors depend on.
pub fn is_given(set: &MeasurementSet) -> bool {
    let frame = set.frame.is_none() || set.frame_guess.is_some();
    let first = set.tool();
    let same = |tool: &Tool| tool.robot == first.robot && tool.target == first.target;
    let given = |tool: &Tool| tool.target.is_none() || same(tool) && first.guess.is_some();
    let target = set.tools.iter().all(given);
    let known = |kind: &dyn Kind| kind.unknowns().iter().all(|unknown| unknown.known);
    frame && target && known(&*set.kind)
}
