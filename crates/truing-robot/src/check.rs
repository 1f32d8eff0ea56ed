//! The same Jacobian made in several ways: do they agree, and what does each cost?

use crate::error::Error;
use crate::estimate::{Calibration, Job};
use crate::measurement::MeasurementSet;
use crate::model::{Assembly, Column, Owner};
use crate::robot::Derivatives;
use crate::start::start;
use crate::unknown::State;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::time::{Duration, Instant};
use truing::{LeastSquares, Linearization, check};

/// A way to differentiate, to be compared with the calibration's own.
pub struct Way {
    /// Its name in files.
    pub name: &'static str,
    /// The way.
    pub derivatives: Derivatives,
    /// The largest difference that rounding explains, relative to a column.
    pub tolerance: f64,
}

impl Way {
    /// What dual numbers and closed forms differ by: rounding of some thousand operations.
    pub const EXACT: f64 = 1e-10;

    /// What central differences are wrong by.
    pub const DIFFERENCES: f64 = 1e-6;

    /// Automatic differentiation of the whole chain.
    pub fn whole_chain() -> Self {
        Self {
            name: "whole-chain",
            derivatives: Derivatives::WholeChain,
            tolerance: Self::EXACT,
        }
    }

    /// Central differences.
    pub fn numeric() -> Self {
        Self {
            name: "numeric",
            derivatives: Derivatives::Numeric,
            tolerance: Self::DIFFERENCES,
        }
    }
}

/// Differences of one column.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ColumnCheck {
    /// Name of the column.
    pub name: String,
    /// Largest difference over the column's length, or over a thousandth of the longest column's if
    /// that is more.
    pub difference: f64,
}

/// One way on one set of measurements.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WayCheck {
    /// The way.
    pub way: &'static str,
    /// Whether it agrees with frame-wise automatic differentiation.
    pub agrees: bool,
    /// The largest difference of any column.
    pub difference: f64,
    /// What rounding explains.
    pub tolerance: f64,
    /// The column of the largest difference.
    pub column: String,
    /// The measurement of the largest difference, counted from 0 in the set.
    pub measurement: usize,
    /// Its line in the data file.
    pub line: Option<usize>,
    /// The two entries that differ most: by this way, by frame-wise automatic differentiation.
    pub entries: (f64, f64),
    /// Time of one linearisation of the set \[s\].
    pub seconds: f64,
    /// Every column.
    pub columns: Vec<ColumnCheck>,
}

/// One set of measurements.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SetCheck {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: &'static str,
    /// Other equations than the crate's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub method: Option<&'static str>,
    /// Number of measurements.
    pub count: usize,
    /// Rows of the Jacobian.
    pub rows: usize,
    /// Time of one evaluation of the residual alone \[s\].
    pub residual_seconds: f64,
    /// Time of one linearisation by frame-wise automatic differentiation \[s\].
    pub seconds: f64,
    /// The other ways.
    pub ways: Vec<WayCheck>,
}

/// How far from nominal the second point lies at which Jacobians are compared [rad, m, 1].
const AWAY: f64 = 0.01;

impl Calibration {
    /// Compares Jacobians of every set, made in each way, with frame-wise automatic differentiation:
    /// at the start of the estimate and at a point about a centimetre and half a degree away, where no
    /// angle is zero by chance.
    ///
    /// # Errors
    /// If a set cannot be assembled.
    pub fn check(&self, ways: &[Way]) -> Result<Vec<SetCheck>, Error> {
        Job::of(self)?.without_small_groups()?.0.check_all(ways)
    }
}

impl Job {
    fn check_all(&self, ways: &[Way]) -> Result<Vec<SetCheck>, Error> {
        let mut random = ChaCha8Rng::seed_from_u64(1996);
        let nominal: Vec<Vec<f64>> = self.arms.iter().map(|arm| arm.robot.nominal()).collect();
        let away = nominal
            .iter()
            .map(|p| {
                p.iter()
                    .map(|x| x + random.random_range(-AWAY..AWAY))
                    .collect()
            })
            .collect();
        let states =
            [nominal, away].map(|robots| start(&self.arms, &self.sets, robots, &State::default()));
        let check = |set: &MeasurementSet| self.check_set(set, &states, ways);
        self.sets.iter().map(check).collect()
    }

    fn check_set(
        &self,
        set: &MeasurementSet,
        states: &[State],
        ways: &[Way],
    ) -> Result<SetCheck, Error> {
        // A robust loss weighs rows alike in every way: leave it out.
        let set = set.unweighted();
        let sets = std::slice::from_ref(&set);
        let assemble = |state: &State, derivatives: &Derivatives| {
            Assembly::new(&self.arms, sets, state, derivatives)
        };
        let own: Vec<Assembly> = states
            .iter()
            .map(|state| assemble(state, &Derivatives::default()))
            .collect::<Result<_, _>>()?;
        if own[0].problem.rows() == 0 {
            return Err(Error::calibration(
                format!(
                    "`{}` has no equations: there is nothing to compare",
                    set.name
                ),
                "measure more, or choose another `method`",
            ));
        }
        let reference: Vec<Linearization> = own.iter().map(linearized).collect();
        let mut checks = Vec::new();
        for way in ways {
            let others: Vec<Assembly> = states
                .iter()
                .map(|state| assemble(state, &way.derivatives))
                .collect::<Result<_, _>>()?;
            let found: Vec<Linearization> = others.iter().map(linearized).collect();
            checks.push(compared(way, &set, &own[0], &found, &reference, &others[0]));
        }
        let rows = own[0].problem.rows();
        let mut r = vec![0.0; rows];
        let residual_seconds = timed(|| {
            own[0].problem.residual(own[0].problem.initial(), &mut r);
        });
        Ok(SetCheck {
            name: set.name.clone(),
            kind: set.kind.name(),
            method: set.method.as_ref().map(|method| method.name()),
            count: set.len(),
            rows,
            residual_seconds,
            seconds: time_of(&own[0]),
            ways: checks,
        })
    }
}

fn linearized(assembly: &Assembly) -> Linearization {
    let mut lin = Linearization::new(assembly.problem.structure());
    assembly
        .problem
        .linearize(assembly.problem.initial(), &mut lin);
    lin
}

/// One way beside the reference, at all points.
fn compared(
    way: &Way,
    set: &MeasurementSet,
    own: &Assembly,
    found: &[Linearization],
    reference: &[Linearization],
    timed: &Assembly,
) -> WayCheck {
    let mut columns: Vec<ColumnCheck> = own.columns.iter().map(named).collect();
    let mut worst: Option<check::ColumnDifference> = None;
    for (found, reference) in found.iter().zip(reference) {
        let length = |column| found.column_norm(column).max(reference.column_norm(column));
        let longest = (0..columns.len()).map(length).fold(0.0, f64::max);
        let floor = (1e-3 * longest).max(f64::MIN_POSITIVE);
        for mut difference in check::compare(found, reference) {
            let column = difference.column;
            let (a, b) = difference.entries;
            difference.relative = (a - b).abs() / length(column).max(floor);
            if difference.relative.is_nan() {
                difference.relative = f64::INFINITY;
            }
            let largest = &mut columns[column].difference;
            *largest = largest.max(difference.relative);
            if worst
                .as_ref()
                .is_none_or(|worst| worst.relative < difference.relative)
            {
                worst = Some(difference);
            }
        }
    }
    let block_dim = own.problem.blocks().next().map_or(1, |block| block.dim());
    let worst = worst.unwrap_or(check::ColumnDifference {
        column: 0,
        row: 0,
        entries: (0.0, 0.0),
        relative: 0.0,
    });
    // Equations that leave planes or points out are not one a measurement.
    let one_each = own.problem.rows() == set.len() * block_dim;
    let measurement = worst.row / block_dim;
    let line = set.origin.as_ref().filter(|_| one_each);
    let difference = worst.relative;
    let kept = |column: &&Column| column.owner != Owner::Constant;
    let kept: Vec<&str> = own
        .columns
        .iter()
        .filter(kept)
        .map(|c| c.name.as_str())
        .collect();
    columns.retain(|column| kept.contains(&column.name.as_str()));
    WayCheck {
        way: way.name,
        agrees: difference <= way.tolerance,
        difference,
        tolerance: way.tolerance,
        column: own.columns[worst.column].name.clone(),
        measurement,
        line: line.and_then(|origin| origin.lines.get(measurement).copied()),
        entries: worst.entries,
        seconds: time_of(timed),
        columns,
    }
}

fn named(column: &Column) -> ColumnCheck {
    ColumnCheck {
        name: column.name.clone(),
        difference: 0.0,
    }
}

fn time_of(assembly: &Assembly) -> f64 {
    let mut lin = Linearization::new(assembly.problem.structure());
    timed(|| {
        assembly
            .problem
            .linearize(assembly.problem.initial(), &mut lin);
    })
}

/// The shortest time of one call, of as many as fit into a few hundredths of a second.
fn timed(mut call: impl FnMut()) -> f64 {
    let begun = Instant::now();
    let mut best = f64::INFINITY;
    while begun.elapsed() < Duration::from_millis(30) || best.is_infinite() {
        let one = Instant::now();
        call();
        best = best.min(one.elapsed().as_secs_f64());
    }
    best
}
