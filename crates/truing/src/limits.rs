//! Limits on variables: bounds on components and linear limits between them.

use crate::error::Error;
use crate::least_squares::{LinearBound, Linearization, StepBounds, Structure};
use crate::step::{AnyStep, Bounded};
use crate::variable::{Values, Var, Variable, VariableSlot};
use std::sync::Arc;

/// A linear limit between components: lower ≤ Σ aₖ ξₖ ≤ upper.
///
/// ξ are the coordinates in which bounds are stated: the numbers themselves of a flat variable, the
/// tangent at a reference of a curved one (see [`Problem::bound_component`](crate::Problem::bound_component)).
///
/// ```
/// # use truing::{LinearLimit, Problem, manifold::Vector};
/// # let mut problem = Problem::new();
/// # let shares = problem.add_variable::<Vector>("shares", &vec![0.2, 0.5]);
/// let limit = LinearLimit::new("shares add up to one")
///     .term(shares, 0, 1.0)
///     .term(shares, 1, 1.0)
///     .equals(1.0);
/// problem.add_limit(limit);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct LinearLimit {
    pub(crate) name: String,
    /// (column, aₖ).
    pub(crate) terms: Vec<(usize, f64)>,
    /// Numbers of the variables named.
    pub(crate) variables: Vec<usize>,
    pub(crate) lower: f64,
    pub(crate) upper: f64,
}

impl LinearLimit {
    /// A limit without terms, infinite on both sides.
    pub fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            terms: Vec::new(),
            variables: Vec::new(),
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
        }
    }

    /// Adds `coefficient` times a component of a variable.
    ///
    /// # Panics
    /// If the variable has no such component.
    #[track_caller]
    #[must_use]
    pub fn term<V: Variable>(mut self, var: Var<V>, component: usize, coefficient: f64) -> Self {
        assert!(
            component < var.tangent_dim(),
            "component {component} of a variable that has {}",
            var.tangent_dim()
        );
        self.terms.push((var.column() + component, coefficient));
        self.variables.push(var.index());
        self
    }

    /// Σ aₖ ξₖ ≤ upper.
    #[must_use]
    pub fn at_most(mut self, upper: f64) -> Self {
        self.upper = upper;
        self
    }

    /// Σ aₖ ξₖ ≥ lower.
    #[must_use]
    pub fn at_least(mut self, lower: f64) -> Self {
        self.lower = lower;
        self
    }

    /// Σ aₖ ξₖ = value.
    #[must_use]
    pub fn equals(self, value: f64) -> Self {
        self.at_least(value).at_most(value)
    }
}

/// All limits of a problem, in the coordinates ξ in which they are stated.
#[derive(Debug, Default)]
pub(crate) struct Limits {
    /// One pair a column.
    bounds: Vec<(f64, f64)>,
    /// The reference of every limited variable that is curved.
    references: Vec<Option<Vec<f64>>>,
    /// Whether a variable is limited.
    limited: Vec<bool>,
    linear: Vec<LinearLimit>,
}

impl Limits {
    pub fn add_variable(&mut self, tangent_dim: usize) {
        let unbounded = (f64::NEG_INFINITY, f64::INFINITY);
        self.bounds.extend((0..tangent_dim).map(|_| unbounded));
        self.references.push(None);
        self.limited.push(false);
    }

    pub fn bound(&mut self, variable: usize, column: usize, lower: f64, upper: f64) {
        self.bounds[column] = (lower, upper);
        self.limited[variable] = true;
    }

    pub fn add(&mut self, limit: LinearLimit) {
        for variable in &limit.variables {
            self.limited[*variable] = true;
        }
        self.linear.push(limit);
    }

    pub fn set_reference(&mut self, variable: usize, reference: Vec<f64>) {
        self.references[variable] = Some(reference);
    }

    pub fn of(&self, column: usize) -> (f64, f64) {
        self.bounds[column]
    }

    pub fn linear(&self) -> &[LinearLimit] {
        &self.linear
    }

    fn any(&self) -> bool {
        self.limited.iter().any(|limited| *limited)
    }

    /// The reference of a curved variable: the one that was set, or the starting value.
    fn reference<'a>(
        &'a self,
        k: usize,
        variable: &VariableSlot,
        initial: &'a Values,
    ) -> &'a [f64] {
        match &self.references[k] {
            Some(reference) => reference,
            None => &initial.data[variable.ambient.clone()],
        }
    }

    /// ξ of a variable at x.
    fn coordinates(
        &self,
        k: usize,
        variable: &VariableSlot,
        initial: &Values,
        x: &[f64],
        out: &mut [f64],
    ) {
        let x = &x[variable.ambient.clone()];
        if variable.flat {
            out.copy_from_slice(x);
        } else {
            (variable.minus)(x, self.reference(k, variable, initial), out);
        }
    }

    /// Limits on a step from x.
    pub fn step_bounds(
        &self,
        variables: &[VariableSlot],
        initial: &Values,
        x: &Values,
    ) -> Option<StepBounds> {
        if !self.any() {
            return None;
        }
        let mut bounds = StepBounds::unlimited(self.bounds.len());
        let mut coordinates = vec![0.0; self.bounds.len()];
        // ∂ξ/∂δ of the curved variables, rows one after another.
        let mut slopes: Vec<Option<Vec<f64>>> = vec![None; variables.len()];
        for (k, variable) in variables.iter().enumerate() {
            if !self.limited[k] {
                continue;
            }
            let range = variable.tangent.clone();
            self.coordinates(
                k,
                variable,
                initial,
                &x.data,
                &mut coordinates[range.clone()],
            );
            if variable.flat {
                continue;
            }
            let n = range.len();
            let mut slope = vec![0.0; n * n];
            let here = &x.data[variable.ambient.clone()];
            (variable.slope)(here, self.reference(k, variable, initial), &mut slope);
            for (i, column) in range.clone().enumerate() {
                let (lower, upper) = self.bounds[column];
                if lower.is_infinite() && upper.is_infinite() {
                    continue;
                }
                let terms = range.clone().zip(slope[i * n..(i + 1) * n].iter().copied());
                let at = coordinates[column];
                let rounding = 8.0 * f64::EPSILON * (1.0 + at.abs());
                bounds.rows.push(LinearBound {
                    terms: terms.collect(),
                    lower: at_most_zero(lower - at, rounding),
                    upper: at_least_zero(upper - at, rounding),
                    rounding,
                });
            }
            slopes[k] = Some(slope);
        }
        // A component that a linear limit holds at its bound is there to the rounding of the sum.
        let mut meeting = vec![0.0_f64; self.bounds.len()];
        for limit in &self.linear {
            let mut terms = Vec::new();
            let (mut value, mut size) = (0.0, 0.0_f64);
            for ((column, a), k) in limit.terms.iter().zip(&limit.variables) {
                value += a * coordinates[*column];
                size += (a * coordinates[*column]).abs();
                match &slopes[*k] {
                    None => terms.push((*column, *a)),
                    Some(slope) => {
                        let range = variables[*k].tangent.clone();
                        let n = range.len();
                        let i = column - range.start;
                        terms.extend(
                            range.zip(slope[i * n..(i + 1) * n].iter().map(|slope| a * slope)),
                        );
                    }
                }
            }
            let rounding = 8.0 * f64::EPSILON * size;
            for (column, a) in &limit.terms {
                let own = &mut meeting[*column];
                *own = own.max(2.0 * rounding / a.abs().max(0.1));
            }
            let (lower, upper) = (limit.lower - value, limit.upper - value);
            let (lower, upper) = if lower == upper {
                let off = if lower.abs() <= rounding { 0.0 } else { lower };
                (off, off)
            } else {
                (
                    at_most_zero(lower, rounding),
                    at_least_zero(upper, rounding),
                )
            };
            bounds.rows.push(LinearBound {
                terms: merged(terms),
                lower,
                upper,
                rounding,
            });
        }
        for (k, variable) in variables.iter().enumerate() {
            if !self.limited[k] || !variable.flat {
                continue;
            }
            for column in variable.tangent.clone() {
                let (lower, upper) = self.bounds[column];
                let at = coordinates[column];
                let rounding = 4.0 * f64::EPSILON * at.abs() + meeting[column];
                bounds.lower[column] = at_most_zero(lower - at, rounding);
                bounds.upper[column] = at_least_zero(upper - at, rounding);
            }
        }
        Some(bounds)
    }

    /// The bounds of curved variables and the linear limits, in the order of the rows of
    /// [`step_bounds`](Self::step_bounds), as (column or limit).
    pub fn describe_row(
        &self,
        variables: &[VariableSlot],
        row: usize,
        column: impl Fn(usize) -> String,
    ) -> String {
        let curved = |k: &usize| self.limited[*k] && !variables[*k].flat;
        let bounded = |c: &usize| self.bounds[*c].0.is_finite() || self.bounds[*c].1.is_finite();
        let columns: Vec<usize> = (0..variables.len())
            .filter(curved)
            .flat_map(|k| variables[k].tangent.clone())
            .filter(bounded)
            .collect();
        match columns.get(row) {
            Some(c) => column(*c),
            None => match self.linear.get(row - columns.len()) {
                Some(limit) => format!("`{}`", limit.name),
                None => format!("linear limit {row}"),
            },
        }
    }

    /// x ⊞ δ of one variable, inside its bounds.
    ///
    /// A curved variable that is limited moves in its coordinates, ξ + ∂ξ/∂δ δ, in which limits are
    /// straight: to first order that is x ⊞ δ. Where this would leave the chart the step is halved.
    pub fn plus(
        &self,
        k: usize,
        variable: &VariableSlot,
        initial: &Values,
        x: &Values,
        delta: &[f64],
        out: &mut [f64],
    ) {
        let here = &x.data[variable.ambient.clone()];
        if !self.limited[k] {
            (variable.plus)(here, delta, out);
            return;
        }
        let bounds = &self.bounds[variable.tangent.clone()];
        if variable.flat {
            (variable.plus)(here, delta, out);
            for (x, (lower, upper)) in out.iter_mut().zip(bounds) {
                // Not `clamp`: NaN stays NaN, and bounds that hold nothing are an error elsewhere.
                *x = x.max(*lower).min(*upper);
            }
            return;
        }
        let n = delta.len();
        let reference = self.reference(k, variable, initial);
        let (mut at, mut slope) = (vec![0.0; n], vec![0.0; n * n]);
        (variable.minus)(here, reference, &mut at);
        (variable.slope)(here, reference, &mut slope);
        let step: Vec<f64> = (0..n)
            .map(|i| (0..n).map(|j| slope[i * n + j] * delta[j]).sum())
            .collect();
        let mut length = 1.0;
        let mut back = vec![0.0; n];
        for _ in 0..60 {
            let moved: Vec<f64> = (0..n)
                .map(|i| (at[i] + length * step[i]).max(bounds[i].0).min(bounds[i].1))
                .collect();
            (variable.plus)(reference, &moved, out);
            (variable.minus)(out, reference, &mut back);
            let stays = back
                .iter()
                .zip(&moved)
                .all(|(back, moved)| (back - moved).abs() <= 1e-9 * (1.0 + moved.abs()));
            if stays || !step.iter().all(|step| step.is_finite()) {
                return;
            }
            length *= 0.5;
        }
        out.copy_from_slice(here);
    }

    /// The point nearest to x, in the coordinates of the limits, that keeps all limits on the free
    /// columns.
    pub fn feasible(
        &self,
        variables: &[VariableSlot],
        initial: &Values,
        x: &Values,
        fixed: &[bool],
        describe: impl Fn(usize) -> String,
    ) -> Result<Values, Error> {
        if !self.any() {
            return Ok(x.clone());
        }
        for (column, (lower, upper)) in self.bounds.iter().enumerate() {
            let holds = lower <= upper && *lower < f64::INFINITY && *upper > f64::NEG_INFINITY;
            if !fixed[column] && !holds {
                return Err(Error::Bounds {
                    column: describe(column),
                    lower: *lower,
                    upper: *upper,
                });
            }
        }
        for limit in &self.linear {
            let finite = limit.terms.iter().all(|(_, a)| a.is_finite());
            let holds = limit.lower <= limit.upper;
            if !holds || !finite {
                return Err(Error::Limit {
                    name: limit.name.clone(),
                    lower: limit.lower,
                    upper: limit.upper,
                });
            }
        }
        let mut start = vec![0.0; self.bounds.len()];
        for (k, variable) in variables.iter().enumerate() {
            if self.limited[k] {
                let out = &mut start[variable.tangent.clone()];
                self.coordinates(k, variable, initial, &x.data, out);
            }
        }
        let mut moved = start.clone();
        for (column, (lower, upper)) in self.bounds.iter().enumerate() {
            if !fixed[column] {
                moved[column] = moved[column].max(*lower).min(*upper);
            }
        }
        if !self.rows_hold(&moved) {
            moved = self
                .nearest(&start, fixed)
                .ok_or_else(|| Error::Infeasible {
                    limits: self.names(),
                })?;
        }
        let mut out = x.clone();
        for (k, variable) in variables.iter().enumerate() {
            let range = variable.tangent.clone();
            if !self.limited[k] || moved[range.clone()] == start[range.clone()] {
                continue;
            }
            let target = &mut out.data[variable.ambient.clone()];
            if variable.flat {
                target.copy_from_slice(&moved[range]);
            } else {
                let reference = self.reference(k, variable, initial);
                (variable.plus)(reference, &moved[range], target);
            }
        }
        Ok(out)
    }

    fn names(&self) -> String {
        let names: Vec<String> = (self.linear.iter())
            .map(|limit| format!("`{}`", limit.name))
            .collect();
        names.join(", ")
    }

    fn rows_hold(&self, coordinates: &[f64]) -> bool {
        self.linear.iter().all(|limit| {
            let terms = limit.terms.iter().map(|(c, a)| a * coordinates[*c]);
            let rounding = 64.0 * f64::EPSILON * terms.clone().map(f64::abs).sum::<f64>();
            let value: f64 = terms.sum();
            limit.lower - rounding <= value && value <= limit.upper + rounding
        })
    }

    /// min ½‖ξ − start‖² under the limits.
    fn nearest(&self, start: &[f64], fixed: &[bool]) -> Option<Vec<f64>> {
        let n = start.len();
        let mut bounds = StepBounds::unlimited(n);
        let mut concerned = vec![false; n];
        for column in 0..n {
            bounds.lower[column] = self.bounds[column].0 - start[column];
            bounds.upper[column] = self.bounds[column].1 - start[column];
        }
        for limit in &self.linear {
            let value: f64 = limit.terms.iter().map(|(c, a)| a * start[*c]).sum();
            for (column, _) in &limit.terms {
                concerned[*column] = true;
            }
            bounds.rows.push(LinearBound {
                terms: merged(limit.terms.clone()),
                lower: limit.lower - value,
                upper: limit.upper - value,
                rounding: 0.0,
            });
        }
        let free: Vec<usize> = (0..n).filter(|c| concerned[*c] && !fixed[*c]).collect();
        let structure = Structure {
            rows: n,
            column_starts: (0..=n).collect(),
            row_indices: (0..n).collect(),
        };
        let mut lin = Linearization::new(Arc::new(structure));
        lin.values.fill(1.0);
        let mut steps = Bounded::new(AnyStep::default());
        steps.factor(&lin, &free, &vec![1.0; free.len()]);
        let step = steps.step(0.0, Some(&bounds)).ok()?;
        let moved: Vec<f64> = (0..n)
            .map(|column| match (fixed[column], concerned[column]) {
                (true, _) => start[column],
                (false, true) => start[column] + step.delta[column],
                (false, false) => start[column].max(self.bounds[column].0),
            })
            .zip(fixed)
            .zip(&self.bounds)
            .map(
                |((x, fixed), (lower, upper))| {
                    if *fixed { x } else { x.max(*lower).min(*upper) }
                },
            )
            .collect();
        self.rows_hold(&moved).then_some(moved)
    }
}

/// A limit of a feasible point lies at zero or below; what rounding left above is zero.
fn at_most_zero(limit: f64, rounding: f64) -> f64 {
    if limit > -rounding { 0.0 } else { limit }
}

fn at_least_zero(limit: f64, rounding: f64) -> f64 {
    if limit < rounding { 0.0 } else { limit }
}

/// Terms of one column added up.
fn merged(mut terms: Vec<(usize, f64)>) -> Vec<(usize, f64)> {
    terms.sort_by_key(|(column, _)| *column);
    let mut merged: Vec<(usize, f64)> = Vec::with_capacity(terms.len());
    for (column, a) in terms {
        match merged.last_mut() {
            Some((last, sum)) if *last == column => *sum += a,
            _ => merged.push((column, a)),
        }
    }
    merged
}
