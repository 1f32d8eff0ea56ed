//! Measurements that do not fit, by the rows of their files.

use super::figures::{MeasurementStatistics, Outlier};
use super::statistics::{Statistics, beyond_chance, place};
use crate::doubt::Doubt;
use crate::error::Error;
use crate::estimate::Job;
use crate::model::errors_of;
use crate::unknown::State;
use truing::Solution;

/// More than this part of a set are too many to be outliers.
const MAJORITY: f64 = 0.5;

impl Job {
    /// The outliers of a solution at its state, the worst first: what robust losses set aside, and
    /// elsewhere what is farther off than chance explains.
    ///
    /// Equations that leave planes or points out have no residual of a single measurement: none are
    /// named of their sets.
    pub fn outliers(
        &self,
        solution: &Solution,
        state: &State,
        statistics: Option<&Statistics>,
        noise: f64,
    ) -> Result<Vec<Outlier>, Error> {
        let measurements: &[MeasurementStatistics] =
            statistics.map_or(&[], |statistics| &statistics.measurements);
        let mut all = beyond_chance(&self.sets, measurements, noise);
        for (k, set) in self.sets.iter().enumerate() {
            let one_each = (solution.blocks.get(k)).is_some_and(|block| block.count == set.len());
            let mut own = (solution.outliers.iter())
                .filter(|o| o.block == k && one_each)
                .peekable();
            if own.peek().is_none() {
                continue;
            }
            let errors = errors_of(set, 0, &self.residuals(set, state)?);
            for outlier in own {
                let item = outlier.item;
                let (file, line) = place(set, item);
                let judged = (measurements.iter()).find(|m| (m.set, m.item) == (k, item));
                all.push(Outlier {
                    constraint: set.name.clone(),
                    file,
                    line,
                    row: (set.origin.as_ref()).map_or(item, |origin| origin.rows[item]),
                    error: errors[item],
                    standardised: judged.and_then(|m| m.standardised),
                    p_value: judged.and_then(|m| m.p_value),
                    weight: Some(outlier.weight),
                });
            }
        }
        let size = |o: &Outlier| (o.standardised.unwrap_or(f64::INFINITY), o.error.abs());
        all.sort_by(|a, b| {
            let ((sa, ea), (sb, eb)) = (size(a), size(b));
            sb.total_cmp(&sa).then(eb.total_cmp(&ea))
        });
        Ok(all)
    }

    /// Sets of which most was set aside: then the rest may be what is wrong.
    pub fn doubt_outliers(&self, outliers: &[Outlier], doubts: &mut Vec<Doubt>) {
        for set in &self.sets {
            let own = outliers.iter();
            let own = own
                .filter(|o| o.constraint == set.name && o.weight.is_some())
                .count();
            if own as f64 > MAJORITY * set.len() as f64 {
                doubts.push(Doubt::note(format!(
                    "the loss set {own} of the {} measurements of `{}` aside as outliers: most of them; its `sigma` may be \
                     too small, or the rest is what is wrong",
                    set.len(),
                    set.name
                )));
            }
        }
    }
}
