//! What can be identified: structure at configurations that satisfy the constraints exactly, and
//! apart from it what data excite.

use super::answer::{DataAnswer, Gap, Identification, Identified, Indices, RankOf, Scaling, Step};
use super::choice::{Choice, Status};
use super::compressed::{STRUCTURE, compressed};
use super::order::in_order;
use super::select::{excited, structure};
use super::symmetry::symmetries;
use super::twin::{LEAST, POSTURES, SEED, structural_twin};
use crate::error::Error;
use crate::measurement::{MeasurementSet, Rows};
use crate::model::{Assembly, Owner};
use crate::robot::{Arm, Derivatives, JointKind, ParameterKind, Robot, Unit, posture};
use crate::unknown::{Key, State};
use truing::identifiability::{
    ColumnStatus, Observability, base_columns, eliminate, singular_values,
};
use truing::nalgebra::DMatrix;

/// Sets of more planes than this are one step.
const PLANES: usize = 10;

/// A question: what do sets of measurements identify?
#[derive(Clone)]
pub struct Question {
    /// The robots.
    pub arms: Vec<Arm>,
    /// What is measured. Where rows are given they are the data; a set without rows asks about its
    /// structure alone.
    pub sets: Vec<MeasurementSet>,
    /// Robots, planes, points and frames as they are.
    pub state: State,
    /// Which parameters are asked about, as `wanted[robot][parameter]`.
    pub wanted: Vec<Vec<bool>>,
    /// All parameters in order of preference, as (robot, parameter).
    pub preference: Vec<(usize, usize)>,
    /// Parameters that the data may determine as weakly as they like, as (robot, parameter).
    pub with_prior: Vec<(usize, usize)>,
    /// How constraints are differentiated.
    pub derivatives: Derivatives,
    /// Seed of the random configurations.
    pub seed: u64,
    /// What was noticed while the question was put.
    pub warnings: Vec<String>,
}

const UNIT_COLUMNS: &str =
    "columns of unit length; planes, points, locations and unknown distances eliminated";

const METRES: &str = "metres per metre: angles, and gains of turning joints, count as arcs at the characteristic length; \
                      planes, points, locations and unknown distances eliminated";

impl Question {
    /// The answer.
    ///
    /// # Errors
    /// If a plane, point or distance is out of reach.
    pub fn answer(&self) -> Result<Identification, Error> {
        let (arms, state) = (&self.arms, &self.state);
        // A plane that is a step of its own needs rows for all there is to know.
        let few = self.sets.iter().all(|set| set.groups.len() <= PLANES);
        let least = if few { POSTURES } else { LEAST };
        let twin = structural_twin(arms, &self.sets, state, self.seed, least)?;
        let assembly = Assembly::new(arms, &twin, state, &self.derivatives)?;
        let wanted = in_order(&assembly, &self.preference, |owner| match owner {
            Owner::Parameter { robot, parameter } => self.wanted[*robot][*parameter],
            _ => true,
        });
        let owner = |c: &usize| &assembly.columns[*c].owner;
        let (local, asked): (Vec<usize>, Vec<usize>) =
            wanted.iter().partition(|c| owner(c).is_local());
        let columns = Columns {
            local: &local,
            asked: &asked,
        };
        let allowed = structure(arms, &twin, state, &self.derivatives, &wanted)?;
        let estimated = |choices: &[Choice], among: &[usize]| -> Vec<usize> {
            let kept = among.iter().filter(|c| choices[**c] == Choice::Estimated);
            kept.copied().collect()
        };
        let rank = estimated(&allowed, &asked).len();
        let mut rank_of = RankOf::default();
        for c in estimated(&allowed, &asked) {
            match owner(&c) {
                Owner::Frame(_) => rank_of.frames += 1,
                Owner::Target(..) => rank_of.tool_points += 1,
                Owner::Own { .. } => rank_of.instruments += 1,
                _ => rank_of.robots += 1,
            }
        }
        let values = singular_values(&columns.scaled(&assembly, &asked));

        let length = characteristic_length(arms, state);
        let has_data = self.sets.iter().any(|set| !set.is_empty());
        let (choices, data) = if has_data {
            let (choices, data) = self.data(&columns, &allowed)?;
            (choices, Some(data))
        } else {
            (allowed.clone(), None)
        };
        let kept = estimated(&choices, &asked);
        let measured = if has_data { &self.sets } else { &twin };
        let measurements = measured.iter().map(MeasurementSet::len).sum();
        let in_metres = in_metres(arms, measured, state, &self.derivatives, length)?;
        let jacobian =
            columns.eliminated(&in_metres, &kept, |c| match &in_metres.columns[c].owner {
                Owner::Parameter { robot, parameter } => {
                    unit_of(&arms[*robot].robot, *parameter, length)
                }
                _ => arc_of(&in_metres, state, c, length),
            });
        let observability = Observability::of(&singular_values(&jacobian), measurements);
        let symmetries = symmetries(arms, &twin, state, &wanted)?;
        Ok(Identification {
            columns: asked.len(),
            rank,
            rank_of,
            beside: estimated(&allowed, &local).len(),
            parameters: identified(&assembly, &choices),
            symmetries: symmetries.iter().map(ToString::to_string).collect(),
            together_with: self.together_with(),
            steps: self.steps(&twin, &wanted)?,
            gap: Gap::after(rank, &values),
            singular_values: values,
            measurements,
            observability: observability.map(Indices::from),
            scaling: Scaling {
                singular_values: UNIT_COLUMNS,
                observability: METRES,
                characteristic_length: length,
            },
            data,
            warnings: self.warnings.clone(),
        })
    }

    /// What moves with the robot where the constraints cannot see it: whatever else is estimated.
    fn together_with(&self) -> Vec<String> {
        let frames = self.state.iter().filter_map(|(key, _)| match key {
            Key::Frame(name) => Some(name.clone()),
            _ => None,
        });
        let mut names: Vec<String> = frames.collect();
        for set in &self.sets {
            if set.kind.unknowns().iter().any(|unknown| !unknown.known) {
                names.push(set.name.clone());
            }
        }
        names
    }

    /// What the data leave of what the structure allows.
    fn data(
        &self,
        columns: &Columns<'_>,
        allowed: &[Choice],
    ) -> Result<(Vec<Choice>, DataAnswer), Error> {
        let (arms, state) = (&self.arms, &self.state);
        let plain: Vec<MeasurementSet> = self.sets.iter().map(MeasurementSet::unweighted).collect();
        let assembly = Assembly::new(arms, &plain, state, &self.derivatives)?;
        let wanted = [columns.local, columns.asked].concat();
        let robot = |(r, p): &(usize, usize)| assembly.robot(*r).column() + p;
        let priors: Vec<usize> = self.with_prior.iter().map(robot).collect();
        let choices = excited(
            arms,
            &self.sets,
            state,
            &self.derivatives,
            allowed.to_vec(),
            &wanted,
            &priors,
        )?;
        let of = |choice: Choice, choices: &[Choice]| -> Vec<usize> {
            let same = columns.asked.iter().filter(|c| choices[**c] == choice);
            same.copied().collect()
        };
        let rank = of(Choice::Estimated, &choices).len();
        let values = singular_values(&columns.scaled(&assembly, &of(Choice::Estimated, allowed)));
        let unexcited = of(Choice::Unexcited, &choices).into_iter();
        let answer = DataAnswer {
            measurements: self.sets.iter().map(MeasurementSet::len).sum(),
            rank,
            unexcited: unexcited
                .map(|c| assembly.columns[c].name.clone())
                .collect(),
            gap: Gap::after(rank, &values),
            singular_values: values,
        };
        Ok((choices, answer))
    }

    /// The rank with the first constraint, the first two, …; each unknown plane of a set counts as one.
    fn steps(&self, twin: &[MeasurementSet], wanted: &[usize]) -> Result<Vec<Step>, Error> {
        let mut steps: Vec<Step> = Vec::new();
        for (k, set) in twin.iter().enumerate() {
            let grouping = set.kind.grouping();
            let steps_by_group = grouping.is_some_and(|grouping| grouping.steps)
                && (2..=PLANES).contains(&set.groups.len());
            for g in 0..if steps_by_group { set.groups.len() } else { 1 } {
                let (constraint, last) = if steps_by_group {
                    let known = |row: &usize| set.groups.of_row[*row] <= g;
                    let rows: Vec<usize> = (0..set.len()).filter(known).collect();
                    let title = format!("{}[{}]", set.name, set.groups.names[g]);
                    (title, set.rows(&rows))
                } else {
                    (set.name.clone(), set.clone())
                };
                // The sets to come keep their columns and lose their rows.
                let to_come = twin[k + 1..].iter().map(|set| set.rows(&[]));
                let sets: Vec<MeasurementSet> = twin[..k]
                    .iter()
                    .cloned()
                    .chain([last])
                    .chain(to_come)
                    .collect();
                let rank = self.rank(&sets, wanted)?;
                let left = symmetries(&self.arms, &sets, &self.state, wanted)?;
                steps.push(Step {
                    constraint,
                    kind: set.kind.name().to_owned(),
                    rank,
                    adds: rank.saturating_sub(steps.last().map_or(0, |step| step.rank)),
                    symmetries: left.iter().map(ToString::to_string).collect(),
                });
            }
        }
        Ok(steps)
    }

    /// The rank of what is asked about at sets that satisfy their constraints exactly.
    fn rank(&self, sets: &[MeasurementSet], wanted: &[usize]) -> Result<usize, Error> {
        let assembly = Assembly::new(&self.arms, sets, &self.state, &self.derivatives)?;
        let order: Vec<usize> = (0..wanted.len()).collect();
        let status = base_columns(&compressed(&assembly, wanted), &order, STRUCTURE);
        let counts = |(status, column): &(ColumnStatus, &usize)| {
            *status == ColumnStatus::Identifiable && !assembly.columns[**column].owner.is_local()
        };
        Ok(status.into_iter().zip(wanted).filter(counts).count())
    }
}

/// Columns by what is done with them.
struct Columns<'a> {
    /// Of planes, points, locations and distances: eliminated.
    local: &'a [usize],
    /// Asked about.
    asked: &'a [usize],
}

impl Columns<'_> {
    /// Some of the columns asked about, times `scale`, without what the local ones take up.
    fn eliminated(
        &self,
        assembly: &Assembly,
        among: &[usize],
        scale: impl Fn(usize) -> f64,
    ) -> DMatrix<f64> {
        let all = [self.local, among].concat();
        let triangle = compressed(assembly, &all);
        let (local, rest) = triangle.columns_range_pair(..self.local.len(), self.local.len()..);
        let mut rest = rest.into_owned();
        for (mut column, c) in rest.column_iter_mut().zip(among) {
            column *= scale(*c);
        }
        eliminate(&rest, &local.into_owned(), STRUCTURE)
    }

    /// The same with columns of unit length (zero where they have none).
    fn scaled(&self, assembly: &Assembly, among: &[usize]) -> DMatrix<f64> {
        let triangle = compressed(assembly, among);
        let lengths: Vec<f64> = triangle.column_iter().map(|c| c.norm()).collect();
        let largest = lengths.iter().copied().fold(0.0, f64::max);
        self.eliminated(assembly, among, |c| {
            let length = among
                .iter()
                .position(|a| *a == c)
                .map_or(0.0, |k| lengths[k]);
            if length > 1e-13 * largest {
                1.0 / length
            } else {
                0.0
            }
        })
    }
}

/// What becomes of every parameter, and of frames and tool points.
fn identified(assembly: &Assembly, choices: &[Choice]) -> Vec<Identified> {
    let columns = &assembly.columns;
    let asked = |c: &usize| !columns[*c].owner.is_local() && columns[*c].owner != Owner::Constant;
    let one = |c: usize| {
        let (choice, name) = (&choices[c], columns[c].name.clone());
        // What only visited points take over moves every visit of a point alike: nothing that
        // is compared changes.
        if let Choice::Regrouped(into) = choice
            && into
                .iter()
                .all(|(c, _)| matches!(columns[*c].owner, Owner::Own { compares: true, .. }))
        {
            return Identified {
                name,
                status: Status::NoEffect,
                into: None,
            };
        }
        Identified {
            name,
            status: choice.status(columns),
            into: choice.taken_over(columns),
        }
    };
    (0..columns.len()).filter(asked).map(one).collect()
}

/// RMS distance of the tools from their mean over random postures \[m\]: the size of the workspace.
fn characteristic_length(arms: &[Arm], state: &State) -> f64 {
    let robots = arms.iter().zip(&state.robots);
    let sizes = robots.map(|(arm, p)| posture::spread(&arm.robot, p, POSTURES, SEED));
    let length = sizes.sum::<f64>() / arms.len().max(1) as f64;
    if length > 0.0 { length } else { 1.0 }
}

/// The sets with rows in metres: rotations count as arcs at the characteristic length.
fn in_metres(
    arms: &[Arm],
    sets: &[MeasurementSet],
    state: &State,
    derivatives: &Derivatives,
    length: f64,
) -> Result<Assembly, Error> {
    let metric: Vec<MeasurementSet> = sets
        .iter()
        .map(|set| {
            let sigma = set.kind.measurands().iter().map(|m| match m.unit {
                Unit::Radian => 1.0 / length,
                _ => 1.0,
            });
            let mut set = set.unweighted();
            let sigma: Vec<f64> = sigma.collect();
            set.readings.sigma = Rows::repeated(&sigma, set.len());
            set
        })
        .collect();
    Assembly::new(arms, &metric, state, derivatives)
}

/// How much of a parameter is a metre: 1 for lengths and what moves sliding joints, 1 / length for
/// angles and what moves turning ones.
fn unit_of(robot: &Robot, parameter: usize, length: f64) -> f64 {
    let p = &robot.parameters()[parameter];
    let slides = || {
        let motion = robot.frames()[p.frame].motion.as_ref();
        motion.is_some_and(|motion| motion.kind == JointKind::Prismatic)
    };
    match (p.kind, p.unit()) {
        (ParameterKind::Gain | ParameterKind::Model, _) if slides() => 1.0,
        (_, Unit::Meter) => 1.0,
        _ => 1.0 / length,
    }
}

/// How much of a component of a frame, tool point or instrument is a metre: angles count as arcs at the
/// characteristic length.
fn arc_of(assembly: &Assembly, state: &State, column: usize, length: f64) -> f64 {
    let key = match &assembly.columns[column].owner {
        Owner::Frame(name) => Key::Frame(name.clone()),
        Owner::Target(robot, name) => Key::Target(*robot, name.clone()),
        Owner::Own { own, .. } => Key::Own(own.clone()),
        _ => return 1.0,
    };
    let components = state.get(&key).map(|value| value.components());
    let place = column - assembly.columns_of(&key).start;
    match components.as_deref().and_then(|all| all.get(place)) {
        Some(component) if component.unit == Unit::Radian => 1.0 / length,
        _ => 1.0,
    }
}
