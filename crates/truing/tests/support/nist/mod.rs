//! NIST's Statistical Reference Datasets for nonlinear regression: the reader of the files, and what
//! other solvers reach on them.

pub mod models;

use models::{Model, Observation};
use std::collections::BTreeMap;
use std::path::Path;
use truing::manifold::Vector;
use truing::{Batch, Problem, Var};

/// The data sets by NIST's own levels of difficulty: lower, average, higher.
pub const NAMES: [&str; 27] = [
    "Misra1a", "Chwirut2", "Chwirut1", "Lanczos3", "Gauss1", "Gauss2", "DanWood", "Misra1b",
    "Kirby2", "Hahn1", "Nelson", "MGH17", "Lanczos1", "Lanczos2", "Gauss3", "Misra1c", "Misra1d",
    "Roszman1", "ENSO", "MGH09", "Thurber", "BoxBOD", "Rat42", "MGH10", "Eckerle4", "Rat43",
    "Bennett5",
];

/// Roszman1's b₁. The distributed file has "1.20196866396E-0" in its place, which is not the least-squares
/// estimate: there the residual sum of squares is 25.0, with this one the certified 4.9484847331E-04.
pub const ROSZMAN1_B1: f64 = 2.0196866396E-01;

/// One data set.
pub struct DataSet {
    /// Its name.
    pub name: String,
    /// The two starting points.
    pub starts: [Vec<f64>; 2],
    /// Certified parameters, to eleven digits.
    pub certified: Vec<f64>,
    /// Certified standard deviations of the parameters.
    pub standard_deviations: Vec<f64>,
    /// Certified residual sum of squares.
    pub residual_sum_of_squares: f64,
    /// Predictors and response of every observation.
    observations: Vec<([f64; 2], f64)>,
}

impl DataSet {
    /// Reads `<name>.dat` of a folder.
    ///
    /// # Panics
    /// If there is no such file, or it is not what NIST publishes.
    pub fn read(folder: &Path, name: &str) -> Self {
        let path = folder.join(format!("{name}.dat"));
        let text = std::fs::read_to_string(&path)
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let numbers = |line: &str| -> Vec<f64> {
            line.split_whitespace()
                .map(|cell| cell.parse().unwrap_or_else(|_| panic!("{name}: {line}")))
                .collect()
        };
        let mut set = Self {
            name: name.to_owned(),
            starts: [Vec::new(), Vec::new()],
            certified: Vec::new(),
            standard_deviations: Vec::new(),
            residual_sum_of_squares: f64::NAN,
            observations: Vec::new(),
        };
        // b1 =    first start    second start    certified value    standard deviation
        for line in text.lines() {
            if let Some((parameter, values)) = line.split_once('=')
                && let Some(number) = parameter.trim().strip_prefix('b')
                && number.parse::<usize>().is_ok()
            {
                let values = numbers(values);
                set.starts[0].push(values[0]);
                set.starts[1].push(values[1]);
                set.certified.push(values[2]);
                set.standard_deviations.push(values[3]);
            }
            if let Some(value) = line.strip_prefix("Residual Sum of Squares:") {
                set.residual_sum_of_squares = numbers(value)[0];
            }
        }
        if name == "Roszman1" {
            set.certified[0] = ROSZMAN1_B1;
        }
        // The data begin after the last line that begins with "Data:".
        let lines: Vec<&str> = text.lines().collect();
        let head = lines.iter().rposition(|line| line.starts_with("Data:"));
        let first = head.unwrap_or_else(|| panic!("{name} has no data")) + 1;
        for line in &lines[first..] {
            match numbers(line)[..] {
                [] => {}
                [y, x] => set.observations.push(([x, 0.0], y)),
                [y, x1, x2] => set.observations.push(([x1, x2], y)),
                _ => panic!("{name}: {line}"),
            }
        }
        set
    }

    /// Σ (f(x; b) − y)².
    pub fn sum_of_squares(&self, b: &[f64]) -> f64 {
        let (problem, _) = self.problem(b);
        let residual = problem.raw_residual(0, problem.initial());
        residual.iter().map(|r| r * r).sum()
    }

    /// The problem from one of the starts: a constraint for every observation.
    pub fn problem(&self, start: &[f64]) -> (Problem, Var<Vector>) {
        let Some(model) = Model::of(&self.name) else {
            panic!("{} is not one of NIST's data sets", self.name);
        };
        let mut problem = Problem::new();
        let b = problem.add_variable::<Vector>("b", &start.to_vec());
        let mut batch = Batch::new(&self.name);
        for &(x, y) in &self.observations {
            let y = model.response(y);
            batch.push((b,), Observation { model, x, y });
        }
        problem.add_block(batch);
        (problem, b)
    }
}

/// What other solvers reach: columns of (first start, second start) for every data set, as the table
/// in the README of the data has them.
#[derive(Default)]
pub struct Published {
    /// Names of the solvers.
    pub solvers: Vec<String>,
    /// Log relative errors, one pair a solver.
    pub digits: BTreeMap<String, Vec<[f64; 2]>>,
}

impl Published {
    /// Reads the table of the README in the folder of the data.
    ///
    /// # Panics
    /// If there is none.
    pub fn read(folder: &Path) -> Self {
        let text = std::fs::read_to_string(folder.join("README.md")).unwrap();
        let rows = text.lines().filter_map(|line| {
            let line = line.strip_prefix('|')?.trim_end().strip_suffix('|')?;
            Some(line.split('|').map(str::trim).collect::<Vec<_>>())
        });
        let mut published = Self {
            solvers: Vec::new(),
            digits: BTreeMap::new(),
        };
        for row in rows {
            if row[0] == "problem" {
                published.solvers = row[1..].iter().map(|s| (*s).to_owned()).collect();
            } else if NAMES.contains(&row[0]) {
                let pair = |cell: &&str| {
                    let (first, second) = cell.split_once('/').unwrap();
                    [first, second].map(|digits| digits.trim().parse().unwrap())
                };
                let pairs = row[1..].iter().map(pair).collect();
                published.digits.insert(row[0].to_owned(), pairs);
            }
        }
        published
    }
}
