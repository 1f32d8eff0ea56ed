//! Solutions and short reports of them.

use crate::robust::Outlier;
use crate::solver::{ActiveLimit, Evaluations, Termination};
use crate::step::Side;
use crate::variable::Values;

/// The outcome of a solve.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// The point of convergence, or the best one if there was none.
    pub values: Values,
    /// Why the solver stopped.
    pub termination: Termination,
    /// ½Σρ at that point.
    pub cost: f64,
    /// ½Σρ at the start.
    pub initial_cost: f64,
    /// Iterations: trial steps.
    pub iterations: u64,
    /// Model evaluations.
    pub evaluations: Evaluations,
    /// The limits that are active, with their multipliers.
    pub limits: Vec<ActiveLimit>,
    /// The linear algebra that made the steps: "dense QR".
    pub linear_solver: &'static str,
    /// Why it was that one: "40 columns".
    pub linear_solver_reason: String,
    /// Every block's residuals before and after.
    pub blocks: Vec<BlockReport>,
    /// The measurements that robust losses have set aside, block after block.
    pub outliers: Vec<Outlier>,
}

/// A block's residuals before and after, in the measurements' own units.
#[derive(Debug, Clone, PartialEq)]
pub struct BlockReport {
    /// Name of the block.
    pub name: String,
    /// Number of constraints.
    pub count: usize,
    /// Number of rows.
    pub rows: usize,
    /// Root mean square over the rows at the start.
    pub initial_rms: f64,
    /// Root mean square over the rows at the solution.
    pub rms: f64,
}

impl std::fmt::Display for Solution {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "{}", self.termination)?;
        writeln!(
            f,
            "cost {:.6e} → {:.6e} in {} iterations ({} residual, {} Jacobian evaluations)",
            self.initial_cost,
            self.cost,
            self.iterations,
            self.evaluations.residual,
            self.evaluations.jacobian
        )?;
        if !self.linear_solver.is_empty() {
            let (name, reason) = (self.linear_solver, &self.linear_solver_reason);
            writeln!(f, "steps by {name}: {reason}")?;
        }
        for (number, block) in self.blocks.iter().enumerate() {
            write!(
                f,
                "  {}: {} constraints, rms {:.4e} → {:.4e}",
                block.name, block.count, block.initial_rms, block.rms
            )?;
            let own = || self.outliers.iter().filter(|o| o.block == number);
            if let Some(worst) = own().max_by(|a, b| a.norm.total_cmp(&b.norm)) {
                let count = own().count();
                write!(
                    f,
                    ", {count} set aside as outliers, the worst number {} ({:.1} σ)",
                    worst.item, worst.norm
                )?;
            }
            writeln!(f)?;
        }
        for limit in &self.limits {
            let side = match limit.side {
                Side::Lower => "at its lower limit",
                Side::Upper => "at its upper limit",
                Side::Equal => "held by an equality",
            };
            writeln!(
                f,
                "  {} {side}, multiplier {:.3e}",
                limit.name, limit.multiplier
            )?;
        }
        Ok(())
    }
}
