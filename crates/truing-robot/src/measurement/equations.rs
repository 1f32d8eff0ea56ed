//! Putting the equations of a set into a problem.

use super::measurand::Measurand;
use super::readings::Readings;
use crate::error::Error;
use crate::robot::Chain;
use crate::unknown::typed;
use std::sync::Arc;
use truing::manifold::{Point3, Pose3, Vector};
use truing::{AnyVar, Batch, Constraint, Noise, Problem, Var, Variable, Vars};

/// The variables of a tool.
#[derive(Clone)]
pub struct ToolVars {
    /// The robot, with its way to be differentiated.
    pub chain: Arc<Chain>,
    /// Its parameters.
    pub robot: Var<Vector>,
    pub(crate) target: AnyVar,
}

impl ToolVars {
    /// The tool point; held at the tool origin where the set names none.
    ///
    /// # Panics
    /// If the kind's targets are bodies.
    #[track_caller]
    pub fn point(&self) -> Var<Point3> {
        typed(self.target)
    }

    /// The body on the tool; none where the set names none, and the tool itself is meant.
    pub fn body(&self) -> Option<Var<Pose3>> {
        self.target.typed()
    }
}

/// The variables that the equations of a set may be about, and where they go.
pub struct Equations<'a> {
    /// What was read.
    pub readings: &'a Readings,
    /// The problem, with the variables at their starting values.
    pub problem: &'a mut Problem,
    /// The tools.
    pub tools: Vec<ToolVars>,
    /// The sensor's pose; held where it is the reference frame.
    pub sensor: Var<Pose3>,
    pub(crate) measurands: &'a [Measurand],
    /// Unknowns of every group, by name.
    pub(crate) own: Vec<Vec<(&'static str, AnyVar)>>,
}

impl Equations<'_> {
    /// The variable of an unknown in a row's group.
    ///
    /// # Panics
    /// If the kind has no such unknown, or of another type.
    #[track_caller]
    pub fn unknown<V: Variable>(&self, name: &str, row: usize) -> Var<V> {
        let own = &self.own[self.readings.groups.of_row[row]];
        match own.iter().find(|(known, _)| *known == name) {
            Some((_, var)) => typed(*var),
            None => panic!("there is no unknown `{name}`"),
        }
    }

    /// What was read in a row.
    pub fn values(&self, row: usize) -> &[f64] {
        self.readings.values.row(row)
    }

    /// The joint values of a tool in a row.
    pub fn q(&self, tool: usize, row: usize) -> Vec<f64> {
        self.readings.tools[tool].q[row].clone()
    }

    /// The noise of a row: the standard deviation of each measurand in each of its rows.
    ///
    /// # Errors
    /// If a standard deviation is not positive and finite.
    pub fn noise(&self, row: usize) -> Result<Noise, Error> {
        let sigma = self.readings.sigma.row(row);
        if let [sigma] = sigma {
            return Ok(Noise::isotropic(*sigma)?);
        }
        let each = self.measurands.iter().zip(sigma);
        let all: Vec<f64> = each
            .flat_map(|(m, sigma)| std::iter::repeat_n(*sigma, m.rows))
            .collect();
        Ok(Noise::diagonal(&all)?)
    }

    /// Adds one constraint a row as the block of the set, with the noise of the rows and the loss.
    ///
    /// # Errors
    /// If a standard deviation is not positive and finite.
    pub fn add<C: Constraint + 'static>(
        &mut self,
        mut each: impl FnMut(&Self, usize) -> (<C::Vars as Vars>::Handles, C),
    ) -> Result<(), Error> {
        self.block((0..self.readings.len()).map(|row| {
            let noise = self.noise(row)?;
            let (vars, constraint) = each(self, row);
            Ok((vars, constraint, noise))
        }))
        .map(|batch| {
            self.problem.add_block(batch);
        })
    }

    /// A block of the set's name and loss, of constraints with noises of their own, which need not be one a
    /// row; to be put into [`problem`](Self::problem).
    ///
    /// # Errors
    /// The first error among them.
    pub fn block<C: Constraint>(
        &self,
        all: impl Iterator<Item = Result<(<C::Vars as Vars>::Handles, C, Noise), Error>>,
    ) -> Result<Batch<C>, Error> {
        let mut batch = Batch::new(self.readings.name.clone()).loss(self.readings.loss);
        for one in all {
            let (vars, constraint, noise) = one?;
            batch.push_with_noise(vars, constraint, noise);
        }
        Ok(batch)
    }
}
