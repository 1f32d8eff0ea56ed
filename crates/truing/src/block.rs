//! Blocks of constraints: the only trait object in the evaluation path.

use crate::autodiff::Scratch;
use crate::constraint::{Constraint, Jacobian, Point};
use crate::loss::Loss;
use crate::noise::Noise;
use crate::variable::{MAX_VARS, Slot, Vars};

/// Writes the panels of a CSC matrix at a running cursor per column: constraints are visited in row
/// order, so every entry lands in its final place.
pub struct PanelWriter<'a> {
    pub(crate) values: &'a mut [f64],
    pub(crate) cursor: &'a mut [usize],
}

impl PanelWriter<'_> {
    /// Appends a column-major panel (`rows` × columns) to the consecutive columns from `first` on.
    pub fn write(&mut self, first: usize, rows: usize, panel: &[f64]) {
        for (cursor, column) in self.cursor[first..]
            .iter_mut()
            .zip(panel.chunks_exact(rows))
        {
            self.values[*cursor..*cursor + rows].copy_from_slice(column);
            *cursor += rows;
        }
    }
}

/// Many constraints of one type.
pub trait ConstraintBlock: Send + Sync {
    /// Name, for reports and errors.
    fn name(&self) -> &str;
    /// Number of constraints.
    fn len(&self) -> usize;
    /// Whether it holds no constraints.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Rows of each constraint.
    fn dim(&self) -> usize;
    /// Whether a loss other than the trivial one weighs it.
    fn is_robust(&self) -> bool {
        false
    }
    /// Indices of the variables of constraint `item`.
    fn variables(&self, item: usize) -> Vec<usize>;
    /// Residuals in the measurements' own units.
    fn raw_residual(&self, x: &[f64], r: &mut [f64]);
    /// Whitened, reweighted residuals; returns the cost ½Σρ(‖r‖²).
    fn residual(&self, x: &[f64], r: &mut [f64]) -> f64;
    /// The same with the Jacobian, written panel after panel.
    fn linearize(
        &self,
        x: &[f64],
        scratch: &mut Scratch,
        r: &mut [f64],
        j: &mut PanelWriter<'_>,
    ) -> f64;
}

/// Constraints of one type, each with its variables, its noise and one loss.
///
/// ```
/// # use truing::{Batch, Constraint, Noise, Loss, Problem, Scalar, Views, manifold::Point3};
/// # struct Fix([f64; 3]);
/// # impl Constraint for Fix {
/// #     type Vars = (Point3,);
/// #     const DIM: usize = 3;
/// #     fn residual<T: Scalar>(&self, (p,): Views<'_, Self, T>, r: &mut [T]) {
/// #         for i in 0..3 { r[i] = p[i] - self.0[i]; }
/// #     }
/// # }
/// # let mut problem = Problem::new();
/// # let p = problem.add_variable::<Point3>("p", &[0.0; 3].into());
/// let mut batch = Batch::new("fixes").noise(Noise::isotropic(1e-3)?).loss(Loss::huber(1.5)?);
/// batch.push((p,), Fix([1.0, 2.0, 3.0]));
/// problem.add_block(batch);
/// # Ok::<(), truing::Error>(())
/// ```
pub struct Batch<C: Constraint> {
    name: String,
    constraints: Vec<C>,
    slots: Vec<[Slot; MAX_VARS]>,
    noises: Vec<Noise>,
    /// For the constraints pushed without one of their own.
    noise: Noise,
    loss: Loss,
}

impl<C: Constraint> Batch<C> {
    /// An empty batch with unit noise and the trivial loss.
    pub fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            constraints: Vec::new(),
            slots: Vec::new(),
            noises: Vec::new(),
            noise: Noise::Unit,
            loss: Loss::Trivial,
        }
    }

    /// The noise of the constraints pushed from now on.
    ///
    /// # Panics
    /// If the model is made for another number of rows.
    #[track_caller]
    #[must_use]
    pub fn noise(mut self, noise: Noise) -> Self {
        Self::check_dim(&noise);
        self.noise = noise;
        self
    }

    #[track_caller]
    fn check_dim(noise: &Noise) {
        assert!(
            noise.dim().is_none_or(|dim| dim == C::DIM),
            "noise for {:?} rows, the constraint has {}",
            noise.dim(),
            C::DIM
        );
    }

    /// The loss of every constraint.
    #[must_use]
    pub fn loss(mut self, loss: Loss) -> Self {
        self.loss = loss;
        self
    }

    /// Adds a constraint on the given variables.
    ///
    /// # Panics
    /// If a variable is given twice.
    #[track_caller]
    pub fn push(&mut self, vars: <C::Vars as Vars>::Handles, constraint: C) {
        self.push_with_noise(vars, constraint, self.noise.clone());
    }

    /// Adds a constraint with a noise of its own.
    ///
    /// # Panics
    /// If a variable is given twice or the noise is made for another number of rows.
    #[track_caller]
    pub fn push_with_noise(
        &mut self,
        vars: <C::Vars as Vars>::Handles,
        constraint: C,
        noise: Noise,
    ) {
        Self::check_dim(&noise);
        let slots = C::Vars::slots(vars);
        for i in 0..C::Vars::COUNT {
            for k in 0..i {
                assert!(
                    slots[i].index != slots[k].index,
                    "variable {} is given twice to one constraint of `{}`",
                    slots[i].index,
                    self.name
                );
            }
        }
        self.slots.push(slots);
        self.constraints.push(constraint);
        self.noises.push(noise);
    }

    /// The constraints, in row order.
    pub fn constraints(&self) -> &[C] {
        &self.constraints
    }

    fn slices<'a>(&self, item: usize, x: &'a [f64]) -> [&'a [f64]; MAX_VARS] {
        let mut slices: [&[f64]; MAX_VARS] = [&[]; MAX_VARS];
        for (slice, slot) in slices.iter_mut().zip(&self.slots[item][..C::Vars::COUNT]) {
            *slice = &x[slot.offset..slot.offset + slot.len];
        }
        slices
    }
}

/// The cost ½ρ(‖r‖²) of one whitened measurement and √ρ', by which r is multiplied in place.
fn reweight(loss: Loss, r: &mut [f64]) -> (f64, f64) {
    let s = r.iter().map(|r| r * r).sum();
    let (rho, slope) = loss.evaluate(s);
    let weight = slope.sqrt();
    if weight != 1.0 {
        r.iter_mut().for_each(|r| *r *= weight);
    }
    (0.5 * rho, weight)
}

impl<C: Constraint> ConstraintBlock for Batch<C> {
    fn name(&self) -> &str {
        &self.name
    }

    fn len(&self) -> usize {
        self.constraints.len()
    }

    fn dim(&self) -> usize {
        C::DIM
    }

    fn is_robust(&self) -> bool {
        self.loss != Loss::Trivial
    }

    fn variables(&self, item: usize) -> Vec<usize> {
        self.slots[item][..C::Vars::COUNT]
            .iter()
            .map(|slot| slot.index)
            .collect()
    }

    fn raw_residual(&self, x: &[f64], r: &mut [f64]) {
        for (item, (constraint, r)) in self
            .constraints
            .iter()
            .zip(r.chunks_exact_mut(C::DIM))
            .enumerate()
        {
            constraint.residual(C::Vars::views(self.slices(item, x)), r);
        }
    }

    fn residual(&self, x: &[f64], r: &mut [f64]) -> f64 {
        self.raw_residual(x, r);
        let mut cost = 0.0;
        for (item, r) in r.chunks_exact_mut(C::DIM).enumerate() {
            self.noises[item].whiten(r);
            cost += reweight(self.loss, r).0;
        }
        cost
    }

    fn linearize(
        &self,
        x: &[f64],
        scratch: &mut Scratch,
        r: &mut [f64],
        j: &mut PanelWriter<'_>,
    ) -> f64 {
        let mut panel = std::mem::take(&mut scratch.panel);
        let mut cost = 0.0;
        for (item, (constraint, r)) in self
            .constraints
            .iter()
            .zip(r.chunks_exact_mut(C::DIM))
            .enumerate()
        {
            let slices = self.slices(item, x);
            let dims = C::Vars::tangent_dims(slices);
            let total: usize = dims.iter().sum();
            panel.clear();
            panel.resize(total * C::DIM, 0.0);
            let mut jacobian = Jacobian::new(C::DIM, dims, &mut panel);
            constraint.linearize(&mut Point::new(slices, scratch), r, &mut jacobian);
            let noise = &self.noises[item];
            noise.whiten(r);
            let (c, weight) = reweight(self.loss, r);
            cost += c;
            if !matches!(noise, Noise::Unit) || weight != 1.0 {
                for column in panel.chunks_exact_mut(C::DIM) {
                    noise.whiten(column);
                    column.iter_mut().for_each(|entry| *entry *= weight);
                }
            }
            let mut from = 0;
            for (slot, dim) in self.slots[item].iter().zip(dims).take(C::Vars::COUNT) {
                j.write(slot.column, C::DIM, &panel[from..from + dim * C::DIM]);
                from += dim * C::DIM;
            }
        }
        scratch.panel = panel;
        cost
    }
}
