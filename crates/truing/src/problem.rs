//! Problems: variables, constraints, what is free and what is fixed.

use crate::autodiff::Scratch;
use crate::block::{Batch, ConstraintBlock, PanelWriter};
use crate::constraint::Constraint;
use crate::error::Error;
use crate::least_squares::{LeastSquares, Linearization, StepBounds, Structure};
use crate::limits::{Limits, LinearLimit};
use crate::loss::Loss;
use crate::prior::Prior;
use crate::variable::{AnyVar, Slot, Values, Var, Variable, VariableSlot, Vars, slope};
use nalgebra::DMatrix;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::ops::Range;
use std::sync::{Arc, Mutex, OnceLock};

/// A least-squares problem: variables with starting values, and blocks of constraints on them.
///
/// The Jacobian is always complete. Fixing a variable or a component only leaves its columns out of
/// the step, so what is identifiable can be asked of everything.
#[derive(Default)]
pub struct Problem {
    variables: Vec<VariableSlot>,
    initial: Values,
    columns: usize,
    fixed: Vec<bool>,
    limits: Limits,
    blocks: Vec<Box<dyn ConstraintBlock>>,
    structure: OnceLock<(Arc<Structure>, Vec<Vec<usize>>)>,
    memory: Mutex<(Scratch, Vec<usize>)>,
}

impl Problem {
    /// A problem without variables and constraints.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a variable with its starting value.
    pub fn add_variable<V: Variable>(
        &mut self,
        name: impl Into<String>,
        value: &V::Value,
    ) -> Var<V> {
        let stored = V::store(value);
        let tangent_dim = V::tangent_dim(stored.len());
        let slot = Slot {
            index: self.variables.len(),
            offset: self.initial.data.len(),
            len: stored.len(),
            column: self.columns,
        };
        self.variables.push(VariableSlot {
            name: name.into(),
            ambient: slot.offset..slot.offset + slot.len,
            tangent: slot.column..slot.column + tangent_dim,
            components: Vec::new(),
            plus: V::plus::<f64>,
            minus: V::minus::<f64>,
            slope: slope::<V>,
            flat: V::FLAT,
        });
        self.initial.data.extend(stored);
        self.columns += tangent_dim;
        self.fixed.resize(self.columns, false);
        self.limits.add_variable(tangent_dim);
        self.structure = OnceLock::new();
        Var::new(slot)
    }

    /// Adds one constraint with unit noise and the trivial loss. For many, make a [`Batch`].
    #[track_caller]
    pub fn add<C: Constraint>(
        &mut self,
        name: impl Into<String>,
        vars: <C::Vars as Vars>::Handles,
        constraint: C,
    ) {
        let mut batch = Batch::new(name);
        batch.push(vars, constraint);
        self.add_block(batch);
    }

    /// Adds a block of constraints; returns its number.
    ///
    /// # Panics
    /// If it names a variable that this problem does not have.
    #[track_caller]
    pub fn add_block(&mut self, block: impl ConstraintBlock + 'static) -> usize {
        for item in 0..block.len() {
            for index in block.variables(item) {
                assert!(
                    index < self.variables.len(),
                    "constraint {item} of `{}` is on variable {index}, the problem has {}",
                    block.name(),
                    self.variables.len()
                );
            }
        }
        self.blocks.push(Box::new(block));
        self.structure = OnceLock::new();
        self.blocks.len() - 1
    }

    /// Adds a prior on every component: (x ⊟ mean)ᵢ has standard deviation `sigma`.
    ///
    /// # Errors
    /// If sigma is not positive and finite.
    pub fn prior<V: Variable>(
        &mut self,
        var: Var<V>,
        mean: &V::Value,
        sigma: f64,
    ) -> Result<(), Error> {
        let sigmas: Vec<_> = (0..var.tangent_dim())
            .map(|component| (component, sigma))
            .collect();
        self.prior_components(var, mean, &sigmas)
    }

    /// Adds a prior on some components, given as (component, standard deviation).
    ///
    /// # Errors
    /// If a sigma is not positive and finite.
    ///
    /// # Panics
    /// If there is no such component.
    #[track_caller]
    pub fn prior_components<V: Variable>(
        &mut self,
        var: Var<V>,
        mean: &V::Value,
        sigmas: &[(usize, f64)],
    ) -> Result<(), Error> {
        let name = format!("prior on {}", self.variables[var.index()].name);
        let prior = Prior::new(name, var, mean, sigmas)?;
        self.add_block(prior);
        Ok(())
    }

    /// Fixes a variable of any type.
    pub fn fix_any(&mut self, var: AnyVar) {
        for column in var.columns() {
            self.set_column_fixed(column, true);
        }
    }

    /// Names the components of a variable of any type, as [`name_components`](Self::name_components).
    ///
    /// # Panics
    /// If there is not one name for each degree of freedom.
    #[track_caller]
    pub fn name_any(&mut self, var: AnyVar, names: &[String]) {
        assert_eq!(
            names.len(),
            var.columns().len(),
            "one name a degree of freedom"
        );
        self.variables[var.index()].components = names.to_vec();
    }

    /// Holds a variable at its value.
    #[track_caller]
    pub fn fix<V: Variable>(&mut self, var: Var<V>) {
        let range = self.columns_of(var);
        self.fixed[range].fill(true);
    }

    /// Holds one component of a variable's tangent.
    #[track_caller]
    pub fn fix_component<V: Variable>(&mut self, var: Var<V>, component: usize) {
        let range = self.columns_of(var);
        self.fixed[range][component] = true;
    }

    /// Lets a variable be estimated again.
    #[track_caller]
    pub fn free_variable<V: Variable>(&mut self, var: Var<V>) {
        let range = self.columns_of(var);
        self.fixed[range].fill(false);
    }

    /// Fixes or frees one column of the Jacobian.
    #[track_caller]
    pub fn set_column_fixed(&mut self, column: usize, fixed: bool) {
        self.fixed[column] = fixed;
    }

    /// Bounds one component: lower ≤ ξᵢ ≤ upper, either of them infinite.
    ///
    /// ξ are the numbers themselves of a flat variable ([`Vector`](crate::manifold::Vector),
    /// [`Point3`](crate::manifold::Point3)), and of a curved one the tangent x ⊟ reference, with the
    /// starting value as the reference unless [`limits_about`](Self::limits_about) states another.
    /// Bounds are kept exactly; a start outside them moves to the nearest point inside. Steps ask
    /// clarabel where a bound could be active. A later call replaces an earlier one.
    ///
    /// # Panics
    /// If there is no such component.
    #[track_caller]
    pub fn bound_component<V: Variable>(
        &mut self,
        var: Var<V>,
        component: usize,
        lower: f64,
        upper: f64,
    ) {
        let range = self.columns_of(var);
        assert!(
            component < range.len(),
            "component {component} of `{}`, which has {}",
            self.variables[var.index()].name,
            range.len()
        );
        self.limits
            .bound(var.index(), range.start + component, lower, upper);
    }

    /// States the reference at whose tangent the limits of a curved variable are meant; the starting
    /// value otherwise. Of no effect on flat variables, whose limits are on the numbers themselves.
    #[track_caller]
    pub fn limits_about<V: Variable>(&mut self, var: Var<V>, reference: &V::Value) {
        self.limits.set_reference(var.index(), V::store(reference));
    }

    /// Adds a linear limit between components, an inequality or an equality.
    ///
    /// # Panics
    /// If it names a variable that this problem does not have.
    #[track_caller]
    pub fn add_limit(&mut self, limit: LinearLimit) {
        let columns = self.columns;
        assert!(
            limit.terms.iter().all(|(column, _)| *column < columns),
            "`{}` is on a variable of another problem",
            limit.name
        );
        self.limits.add(limit);
    }

    /// The linear limits, in the order in which they were added.
    pub fn linear_limits(&self) -> &[LinearLimit] {
        self.limits.linear()
    }

    /// Names the components of a variable, for errors: `theta3` says more than "component 17".
    ///
    /// # Panics
    /// If there is not one name for each degree of freedom.
    #[track_caller]
    pub fn name_components<V: Variable>(&mut self, var: Var<V>, names: &[String]) {
        let dim = var.tangent_dim();
        assert_eq!(
            names.len(),
            dim,
            "{} names for {dim} components",
            names.len()
        );
        self.variables[var.index()].components = names.to_vec();
    }

    /// The columns of a variable in the Jacobian.
    pub fn columns_of<V: Variable>(&self, var: Var<V>) -> Range<usize> {
        self.variables[var.index()].tangent.clone()
    }

    /// The starting values.
    pub fn initial(&self) -> &Values {
        &self.initial
    }

    /// The blocks of constraints.
    pub fn blocks(&self) -> impl Iterator<Item = &dyn ConstraintBlock> {
        self.blocks.iter().map(|block| &**block)
    }

    /// Rows of block number `block` in r and J.
    #[track_caller]
    pub fn block_rows(&self, block: usize) -> Range<usize> {
        let start: usize = self.blocks[..block].iter().map(|b| b.len() * b.dim()).sum();
        start..start + self.blocks[block].len() * self.blocks[block].dim()
    }

    /// Residuals of a block in the measurements' own units: not whitened, not reweighted.
    #[track_caller]
    pub fn raw_residual(&self, block: usize, x: &Values) -> Vec<f64> {
        let block = &self.blocks[block];
        let mut r = vec![0.0; block.len() * block.dim()];
        block.raw_residual(&x.data, &mut r);
        r
    }

    /// Gives every constraint of a block another loss.
    ///
    /// # Errors
    /// If the block takes none, such as a prior.
    ///
    /// # Panics
    /// If there is no such block.
    #[track_caller]
    pub fn set_loss(&mut self, block: usize, loss: Loss) -> Result<(), Error> {
        self.blocks[block].set_loss(loss)
    }

    /// Number of residual rows.
    pub fn rows(&self) -> usize {
        self.blocks.iter().map(|b| b.len() * b.dim()).sum()
    }

    /// Number of columns, free and fixed.
    pub fn cols(&self) -> usize {
        self.columns
    }

    /// Structure of J, and where each block's first entry goes in every column.
    fn layout(&self) -> &(Arc<Structure>, Vec<Vec<usize>>) {
        self.structure.get_or_init(|| {
            let mut counts = vec![0; self.columns + 1];
            let each_panel = |visit: &mut dyn FnMut(usize, usize, usize)| {
                let mut row = 0;
                for block in &self.blocks {
                    for item in 0..block.len() {
                        for index in block.variables(item) {
                            for column in self.variables[index].tangent.clone() {
                                visit(column, row, block.dim());
                            }
                        }
                        row += block.dim();
                    }
                }
                row
            };
            let rows = each_panel(&mut |column, _, dim| counts[column + 1] += dim);
            for column in 0..self.columns {
                counts[column + 1] += counts[column];
            }
            let mut row_indices = vec![0; counts[self.columns]];
            let mut cursor = counts.clone();
            each_panel(&mut |column, row, dim| {
                for k in 0..dim {
                    row_indices[cursor[column] + k] = row + k;
                }
                cursor[column] += dim;
            });
            let mut starts = Vec::with_capacity(self.blocks.len());
            let mut cursor = counts[..self.columns].to_vec();
            for block in &self.blocks {
                starts.push(cursor.clone());
                for item in 0..block.len() {
                    for index in block.variables(item) {
                        for column in self.variables[index].tangent.clone() {
                            cursor[column] += block.dim();
                        }
                    }
                }
            }
            (
                Arc::new(Structure {
                    rows,
                    column_starts: counts,
                    row_indices,
                }),
                starts,
            )
        })
    }
}

impl LeastSquares for Problem {
    type Point = Values;

    fn structure(&self) -> Arc<Structure> {
        self.layout().0.clone()
    }

    fn residual(&self, x: &Values, r: &mut [f64]) -> f64 {
        self.residual_relaxed(x, 1.0, r)
    }

    fn linearize(&self, x: &Values, lin: &mut Linearization) {
        self.linearize_relaxed(x, 1.0, lin);
    }

    fn plus(&self, x: &Values, delta: &[f64]) -> Values {
        let mut out = x.clone();
        for (k, variable) in self.variables.iter().enumerate() {
            let delta = &delta[variable.tangent.clone()];
            // A variable that does not move keeps its numbers to the last bit.
            if delta.iter().any(|d| *d != 0.0) {
                let out = &mut out.data[variable.ambient.clone()];
                self.limits.plus(k, variable, &self.initial, x, delta, out);
            }
        }
        out
    }

    fn norm(&self, x: &Values) -> f64 {
        x.data.iter().map(|x| x * x).sum::<f64>().sqrt()
    }

    /// Where a variable has a column for each of its numbers, their absolute values; elsewhere the
    /// largest of the variable.
    fn sizes(&self, x: &Values) -> Vec<f64> {
        let mut sizes = Vec::with_capacity(self.columns);
        for variable in &self.variables {
            let numbers = x.data[variable.ambient.clone()].iter().map(|x| x.abs());
            if variable.ambient.len() == variable.tangent.len() {
                sizes.extend(numbers);
            } else {
                let largest = numbers.fold(0.0, f64::max);
                sizes.extend(variable.tangent.clone().map(|_| largest));
            }
        }
        sizes
    }

    fn free(&self) -> Vec<usize> {
        (0..self.columns).filter(|c| !self.fixed[*c]).collect()
    }

    fn step_bounds(&self, x: &Values) -> Option<StepBounds> {
        self.limits.step_bounds(&self.variables, &self.initial, x)
    }

    fn is_robust(&self) -> bool {
        self.blocks
            .iter()
            .any(|block| block.loss() != Loss::Trivial)
    }

    fn describe_row(&self, row: usize) -> String {
        let mut first = 0;
        for block in &self.blocks {
            let rows = block.len() * block.dim();
            if row < first + rows {
                let item = (row - first) / block.dim();
                return format!(
                    "constraint {item} of `{}` (component {})",
                    block.name(),
                    (row - first) % block.dim()
                );
            }
            first += rows;
        }
        format!("row {row}")
    }

    fn describe_column(&self, column: usize) -> String {
        match self.variables.iter().find(|v| v.tangent.contains(&column)) {
            Some(variable) if !variable.components.is_empty() => {
                format!("`{}`", variable.components[column - variable.tangent.start])
            }
            Some(variable) if variable.tangent.len() == 1 => format!("`{}`", variable.name),
            Some(variable) => format!(
                "component {} of `{}`",
                column - variable.tangent.start,
                variable.name
            ),
            None => format!("column {column}"),
        }
    }

    fn describe_limit(&self, row: usize) -> String {
        self.limits
            .describe_row(&self.variables, row, |column| self.describe_column(column))
    }

    fn feasible(&self, x: &Values) -> Result<Values, Error> {
        assert_eq!(
            x.data.len(),
            self.initial.data.len(),
            "these values belong to another problem"
        );
        self.limits
            .feasible(&self.variables, &self.initial, x, &self.fixed, |column| {
                self.describe_column(column)
            })
    }
}

/// The columns of a variable, and ∂(tangent at a point)/∂(tangent at the start) there; `None` for
/// the identity.
pub(crate) type ChartSlope = (Range<usize>, Option<DMatrix<f64>>);

impl Problem {
    /// r at x with the scale of every loss multiplied by a relaxation, and the cost.
    pub(crate) fn residual_relaxed(&self, x: &Values, relaxation: f64, r: &mut [f64]) -> f64 {
        let mut row = 0;
        let mut cost = 0.0;
        for block in &self.blocks {
            let rows = block.len() * block.dim();
            cost += block.residual(&x.data, relaxation, &mut r[row..row + rows]);
            row += rows;
        }
        cost
    }

    /// r, J and the cost at x with the scale of every loss multiplied by a relaxation.
    pub(crate) fn linearize_relaxed(&self, x: &Values, relaxation: f64, lin: &mut Linearization) {
        let (_, starts) = self.layout();
        let mut memory = match self.memory.lock() {
            Ok(memory) => memory,
            // Scratch memory holds nothing that a panic elsewhere could have spoilt.
            Err(poisoned) => poisoned.into_inner(),
        };
        let (scratch, cursor) = &mut *memory;
        let mut row = 0;
        lin.cost = 0.0;
        for (block, start) in self.blocks.iter().zip(starts) {
            let rows = block.len() * block.dim();
            cursor.clone_from(start);
            let mut writer = PanelWriter {
                values: &mut lin.values,
                cursor,
            };
            lin.cost += block.linearize(
                &x.data,
                relaxation,
                scratch,
                &mut lin.residual[row..row + rows],
                &mut writer,
            );
            row += rows;
        }
    }

    /// x₀ ⊞ δ, whatever the limits.
    pub(crate) fn retract_from_start(&self, delta: &[f64]) -> Values {
        let mut out = self.initial.clone();
        for variable in &self.variables {
            let from = &self.initial.data[variable.ambient.clone()];
            let out = &mut out.data[variable.ambient.clone()];
            (variable.plus)(from, &delta[variable.tangent.clone()], out);
        }
        out
    }

    /// For x = x₀ ⊞ p, how the tangent at x moves with p: ∂((x₀ ⊞ p′) ⊟ x)/∂p′ at p′ = p.
    ///
    /// # Errors
    /// If x is where the tangent at the start ends.
    pub(crate) fn chart_slopes(&self, x: &Values) -> Result<Vec<ChartSlope>, Error> {
        let of = |variable: &VariableSlot| {
            let range = variable.tangent.clone();
            if variable.flat {
                return Ok((range, None));
            }
            let n = range.len();
            let mut back = vec![0.0; n * n];
            let (here, start) = (
                &x.data[variable.ambient.clone()],
                &self.initial.data[variable.ambient.clone()],
            );
            (variable.slope)(here, start, &mut back);
            let inverse = DMatrix::from_row_slice(n, n, &back).try_inverse();
            match inverse.filter(|m| m.iter().all(|m| m.is_finite())) {
                Some(slope) => Ok((range, Some(slope))),
                None => Err(Error::Chart {
                    variable: variable.name.clone(),
                }),
            }
        };
        self.variables.iter().map(of).collect()
    }

    /// The starting values, then random ones without end, for
    /// [`multi_start`](crate::solver::multi_start): free components that are bounded on both sides
    /// are drawn uniformly between their bounds, others from the start ± `spread` (the tangent of a
    /// curved variable), and linear limits then met by the nearest point. The same seed gives the
    /// same starts.
    ///
    /// # Errors
    /// If no point keeps all limits.
    pub fn random_starts(
        &self,
        spread: f64,
        seed: u64,
    ) -> Result<impl Iterator<Item = Values> + '_, Error> {
        let first = LeastSquares::feasible(self, &self.initial)?;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let free = LeastSquares::free(self);
        let draw = move || {
            let mut delta = vec![0.0; self.columns];
            for column in &free {
                delta[*column] = spread * rng.random_range(-1.0..=1.0);
            }
            let mut x = self.retract_from_start(&delta);
            for variable in self.variables.iter().filter(|variable| variable.flat) {
                for (k, column) in variable.tangent.clone().enumerate() {
                    let (lower, upper) = self.limits.of(column);
                    if !self.fixed[column] && lower.is_finite() && upper.is_finite() {
                        let share: f64 = rng.random_range(0.0..=1.0);
                        x.data[variable.ambient.start + k] = lower + share * (upper - lower);
                    }
                }
            }
            LeastSquares::feasible(self, &x).ok()
        };
        Ok(std::iter::once(first).chain(std::iter::from_fn(draw)))
    }
}
