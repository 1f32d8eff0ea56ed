//! Blocks of constraints: the only trait object in the evaluation path.

use crate::autodiff::Scratch;
use crate::constraint::{Constraint, Jacobian, Point};
use crate::error::Error;
use crate::loss::Loss;
use crate::noise::Noise;
use crate::robust::Weighing;
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
    /// The loss of every constraint.
    fn loss(&self) -> Loss {
        Loss::Trivial
    }
    /// Gives every constraint another loss.
    ///
    /// # Errors
    /// If the block takes none, as by default.
    fn set_loss(&mut self, loss: Loss) -> Result<(), Error> {
        Err(Error::Noise {
            found: format!("the loss `{}` for `{}`", loss.name(), self.name()),
            expected: "a block that takes a loss, such as a `Batch`".into(),
        })
    }
    /// By how much the cost of the whole block is multiplied.
    fn weight(&self) -> f64 {
        1.0
    }
    /// Indices of the variables of constraint `item`.
    fn variables(&self, item: usize) -> Vec<usize>;
    /// Residuals in the measurements' own units.
    fn raw_residual(&self, x: &[f64], r: &mut [f64]);
    /// Whitened residuals weighted by √(a ρ′); returns the cost ½aΣρ(‖r‖²). The scale of the loss is
    /// multiplied by `relaxation`, 1 or more ([`Loss::relaxed`]), and a is the block's weight.
    fn residual(&self, x: &[f64], relaxation: f64, r: &mut [f64]) -> f64;
    /// The residuals r̃ and the Jacobian J̃, written panel after panel, of which J̃ᵀr̃ is the gradient
    /// of the cost and J̃ᵀJ̃ about its Hessian; returns the cost. Under a robust loss r̃ need not be
    /// what [`residual`](Self::residual) is: see [`Loss`].
    fn linearize(
        &self,
        x: &[f64],
        relaxation: f64,
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
    weight: f64,
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
            weight: 1.0,
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

    /// Multiplies the cost of the whole block by a weight: ½aΣρ(‖r‖²). Unlike another noise it leaves
    /// what is large, for the loss, as it is.
    ///
    /// # Errors
    /// If the weight is not positive and finite.
    pub fn weight(mut self, weight: f64) -> Result<Self, Error> {
        if weight.is_finite() && weight > 0.0 {
            self.weight = weight;
            return Ok(self);
        }
        Err(Error::Noise {
            found: format!("a weight of {weight} for `{}`", self.name),
            expected: "a positive, finite number".into(),
        })
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

    fn loss(&self) -> Loss {
        self.loss
    }

    fn set_loss(&mut self, loss: Loss) -> Result<(), Error> {
        self.loss = loss;
        Ok(())
    }

    fn weight(&self) -> f64 {
        self.weight
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

    fn residual(&self, x: &[f64], relaxation: f64, r: &mut [f64]) -> f64 {
        self.raw_residual(x, r);
        let loss = self.loss.relaxed(relaxation);
        let mut cost = 0.0;
        for (item, r) in r.chunks_exact_mut(C::DIM).enumerate() {
            self.noises[item].whiten(r);
            let weighing = Weighing::of(loss, self.weight, r);
            r.iter_mut().for_each(|r| *r *= weighing.root);
            cost += weighing.cost;
        }
        cost
    }

    fn linearize(
        &self,
        x: &[f64],
        relaxation: f64,
        scratch: &mut Scratch,
        r: &mut [f64],
        j: &mut PanelWriter<'_>,
    ) -> f64 {
        let mut panel = std::mem::take(&mut scratch.panel);
        let loss = self.loss.relaxed(relaxation);
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
            if !matches!(noise, Noise::Unit) {
                for column in panel.chunks_exact_mut(C::DIM) {
                    noise.whiten(column);
                }
            }
            let weighing = Weighing::of(loss, self.weight, r);
            cost += weighing.cost;
            weighing.apply(r, &mut panel);
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
