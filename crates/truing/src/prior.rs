//! Priors: what is known of a variable beforehand.

use crate::autodiff::{Scratch, partials, seed};
use crate::block::{ConstraintBlock, PanelWriter};
use crate::error::Error;
use crate::noise::Noise;
use crate::scalar::{Dual, value};
use crate::variable::{Slot, Var, Variable};

/// A Gaussian prior on components of one variable: rows (x ⊟ mean)ᵢ / σᵢ.
pub struct Prior<V: Variable> {
    name: String,
    slot: Slot,
    mean: Vec<f64>,
    components: Vec<usize>,
    noise: Noise,
    kind: std::marker::PhantomData<fn() -> V>,
}

impl<V: Variable> Prior<V> {
    /// A prior with the given standard deviations, as (component, sigma).
    ///
    /// # Errors
    /// If a sigma is not positive and finite.
    ///
    /// # Panics
    /// If there is no such component, or the mean is of another length than the variable.
    #[track_caller]
    pub fn new(
        name: String,
        var: Var<V>,
        mean: &V::Value,
        sigmas: &[(usize, f64)],
    ) -> Result<Self, Error> {
        let mean = V::store(mean);
        assert_eq!(
            mean.len(),
            var.slot.len,
            "the mean has {} numbers, the variable {}",
            mean.len(),
            var.slot.len
        );
        let dim = var.tangent_dim();
        for (component, _) in sigmas {
            assert!(
                *component < dim,
                "there is no component {component}, the variable has {dim}"
            );
        }
        let noise = Noise::diagonal(&sigmas.iter().map(|s| s.1).collect::<Vec<_>>())?;
        let components = sigmas.iter().map(|s| s.0).collect();
        Ok(Self {
            name,
            slot: var.slot,
            mean,
            components,
            noise,
            kind: std::marker::PhantomData,
        })
    }

    fn x<'a>(&self, x: &'a [f64]) -> &'a [f64] {
        &x[self.slot.offset..self.slot.offset + self.slot.len]
    }
}

impl<V: Variable> ConstraintBlock for Prior<V> {
    fn name(&self) -> &str {
        &self.name
    }

    fn len(&self) -> usize {
        1
    }

    fn dim(&self) -> usize {
        self.components.len()
    }

    fn variables(&self, _: usize) -> Vec<usize> {
        vec![self.slot.index]
    }

    fn raw_residual(&self, x: &[f64], r: &mut [f64]) {
        let mut all = vec![0.0; V::tangent_dim(self.slot.len)];
        V::minus(self.x(x), &self.mean, &mut all);
        for (r, component) in r.iter_mut().zip(&self.components) {
            *r = all[*component];
        }
    }

    fn residual(&self, x: &[f64], _: f64, r: &mut [f64]) -> f64 {
        self.raw_residual(x, r);
        self.noise.whiten(r);
        0.5 * r.iter().map(|r| r * r).sum::<f64>()
    }

    fn linearize(
        &self,
        x: &[f64],
        _: f64,
        _: &mut Scratch,
        r: &mut [f64],
        j: &mut PanelWriter<'_>,
    ) -> f64 {
        const N: usize = 8;
        let x = self.x(x);
        let dim = V::tangent_dim(x.len());
        let rows = self.components.len();
        let mut ambient = vec![Dual::<N>::from(0.0); x.len()];
        let mut all = vec![Dual::<N>::from(0.0); dim];
        let mut panel = vec![0.0; rows * dim];
        for start in (0..dim).step_by(N) {
            let end = (start + N).min(dim);
            let delta: Vec<Dual<N>> = (0..dim)
                .map(|k| {
                    if (start..end).contains(&k) {
                        seed(0.0, k - start)
                    } else {
                        Dual::from(0.0)
                    }
                })
                .collect();
            V::plus(x, &delta, &mut ambient);
            V::minus(&ambient, &self.mean, &mut all);
            for (row, component) in self.components.iter().enumerate() {
                r[row] = value(all[*component]);
                let gradient = partials(&all[*component]);
                for column in start..end {
                    panel[column * rows + row] = gradient[column - start];
                }
            }
        }
        self.noise.whiten(r);
        for column in panel.chunks_exact_mut(rows.max(1)) {
            self.noise.whiten(column);
        }
        if rows > 0 {
            j.write(self.slot.column, rows, &panel);
        }
        0.5 * r.iter().map(|r| r * r).sum::<f64>()
    }
}
