//! Multipliers of active limits, and what of the gradient they leave.

use crate::least_squares::{Linearization, StepBounds};
use faer::Mat;
use serde::{Deserialize, Serialize};

/// On which side a limit is active.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Side {
    /// At the lower limit.
    Lower,
    /// At the upper limit.
    Upper,
    /// Lower and upper are the same.
    Equal,
}

/// An active limit and its multiplier.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Multiplier {
    /// Its column, or its row among the linear limits.
    pub limit: ActiveAt,
    /// The side that is active.
    pub side: Side,
    /// −∂cost/∂limit: by how much the cost falls if the limit rises by one. Positive at an upper
    /// limit, negative at a lower one, either at an equality.
    pub value: f64,
}

/// Which limit is active.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ActiveAt {
    /// The bound of a column.
    Column(usize),
    /// A linear limit, by its number in [`StepBounds::rows`].
    Row(usize),
}

/// The first-order conditions of Karush, Kuhn and Tucker at a point.
#[derive(Debug, Clone, PartialEq)]
pub struct Kkt {
    /// Jᵀr + Aᵀz over the free columns, z the multipliers: zero at a minimum.
    pub residual: Vec<f64>,
    /// The active limits.
    pub multipliers: Vec<Multiplier>,
}

/// An active limit with its normal in scaled free components.
struct ActiveLimit {
    at: ActiveAt,
    side: Side,
    normal: Vec<(usize, f64)>,
}

/// The multipliers z of the limits that are active at δ = 0, right in sign, that leave least of the
/// gradient: min ‖D⁻¹(Jᵀr + Aᵀz)‖, D the lengths of the columns.
///
/// # Reference
/// Nocedal & Wright, section 12.3; Lawson & Hanson 1974, chapter 23 (non-negative least squares).
pub fn kkt(lin: &Linearization, free: &[usize], bounds: Option<&StepBounds>) -> Kkt {
    let gradient: Vec<f64> = free.iter().map(|column| lin.gradient(*column)).collect();
    let Some(bounds) = bounds else {
        return Kkt {
            residual: gradient,
            multipliers: Vec::new(),
        };
    };
    let active = |lower: f64, upper: f64| match (lower >= 0.0, upper <= 0.0) {
        // An equality may be off by rounding.
        _ if lower == upper => Some(Side::Equal),
        (true, true) => Some(Side::Equal),
        (true, false) => Some(Side::Lower),
        (false, true) => Some(Side::Upper),
        (false, false) => None,
    };
    let length: Vec<f64> = free
        .iter()
        .map(|column| lin.column_norm(*column))
        .map(|length| if length > 0.0 { length } else { 1.0 })
        .collect();
    let mut place = vec![None; lin.structure.cols()];
    for (k, column) in free.iter().enumerate() {
        place[*column] = Some(k);
    }
    let mut limits: Vec<ActiveLimit> = Vec::new();
    for (k, column) in free.iter().enumerate() {
        if let Some(side) = active(bounds.lower[*column], bounds.upper[*column]) {
            limits.push(ActiveLimit {
                at: ActiveAt::Column(*column),
                side,
                normal: vec![(k, 1.0 / length[k])],
            });
        }
    }
    for (row, linear) in bounds.rows.iter().enumerate() {
        let normal: Vec<_> = (linear.terms.iter())
            .filter_map(|(column, a)| place[*column].map(|k| (k, a / length[k])))
            .filter(|(_, a)| *a != 0.0)
            .collect();
        if let Some(side) = active(linear.lower, linear.upper)
            && !normal.is_empty()
        {
            limits.push(ActiveLimit {
                at: ActiveAt::Row(row),
                side,
                normal,
            });
        }
    }
    let scaled: Vec<f64> = gradient.iter().zip(&length).map(|(g, l)| g / l).collect();
    let z = signed_multipliers(&scaled, &limits);
    let mut residual = scaled;
    for (limit, z) in limits.iter().zip(&z) {
        for (k, a) in &limit.normal {
            residual[*k] += a * z;
        }
    }
    // A component that a multiplier balances is balanced exactly, but for rounding.
    for (limit, z) in limits.iter().zip(&z) {
        if matches!(limit.at, ActiveAt::Column(_)) && *z != 0.0 {
            residual[limit.normal[0].0] = 0.0;
        }
    }
    Kkt {
        residual: residual.iter().zip(&length).map(|(e, l)| e * l).collect(),
        multipliers: (limits.iter().zip(&z))
            .map(|(limit, z)| Multiplier {
                limit: limit.at,
                side: limit.side,
                value: *z,
            })
            .collect(),
    }
}

/// min ‖g + Σ zⱼ aⱼ‖ with zⱼ ≥ 0 at upper, ≤ 0 at lower limits.
fn signed_multipliers(g: &[f64], limits: &[ActiveLimit]) -> Vec<f64> {
    let sign = |side: Side| match side {
        Side::Upper => 1.0,
        Side::Lower => -1.0,
        Side::Equal => 0.0,
    };
    let only_bounds = (limits.iter()).all(|limit| matches!(limit.at, ActiveAt::Column(_)));
    if only_bounds {
        return limits
            .iter()
            .map(|limit| {
                let (k, a) = limit.normal[0];
                let z = -g[k] / a;
                if sign(limit.side) * z < 0.0 { 0.0 } else { z }
            })
            .collect();
    }
    // A bound takes up whatever the rows leave of its component: only the rows need a factorisation,
    // over the components without a passive bound.
    let solve = |passive: &[bool]| {
        let is_bound = |j: usize| matches!(limits[j].at, ActiveAt::Column(_));
        let chosen = || (0..limits.len()).filter(|j| passive[*j]);
        let mut moving = vec![true; g.len()];
        for j in chosen().filter(|j| is_bound(*j)) {
            moving[limits[j].normal[0].0] = false;
        }
        let rows: Vec<usize> = chosen().filter(|j| !is_bound(*j)).collect();
        let normals: Vec<&[(usize, f64)]> =
            rows.iter().map(|j| limits[*j].normal.as_slice()).collect();
        let mut all = vec![0.0; limits.len()];
        let mut left = g.to_vec();
        for (j, z) in rows
            .iter()
            .zip(least_multipliers(g, &normals, |k| moving[k]))
        {
            all[*j] = z;
            limits[*j]
                .normal
                .iter()
                .for_each(|(k, a)| left[*k] += a * z);
        }
        for j in chosen().filter(|j| is_bound(*j)) {
            let (k, a) = limits[j].normal[0];
            all[j] = -left[k] / a;
        }
        all
    };
    // It starts from all limits at once and leaves out those that pull the wrong way, until none
    // does: near a solution hardly any.
    let mut passive = vec![true; limits.len()];
    let mut z = solve(&passive);
    loop {
        let wrong = |j: usize| passive[j] && sign(limits[j].side) * z[j] < 0.0;
        let wrong: Vec<usize> = (0..limits.len()).filter(|j| wrong(*j)).collect();
        if wrong.is_empty() {
            break;
        }
        wrong.iter().for_each(|j| passive[*j] = false);
        z = solve(&passive);
    }
    // Those that depend on others have none, and could only be in the way.
    for j in 0..limits.len() {
        passive[j] &= z[j] != 0.0 || limits[j].side == Side::Equal;
    }
    let size = g.iter().fold(0.0_f64, |size, g| size.max(g.abs()));
    for _ in 0..3 * limits.len() + 3 {
        let mut left = g.to_vec();
        for (limit, z) in limits.iter().zip(&z) {
            for (k, a) in &limit.normal {
                left[*k] += a * z;
            }
        }
        // How much it would help to let a multiplier grow in its direction.
        let help = |j: usize| {
            let ActiveLimit { side, normal, .. } = &limits[j];
            let length = normal.iter().map(|(_, a)| a * a).sum::<f64>().sqrt();
            let along: f64 = normal.iter().map(|(k, a)| a * left[*k]).sum();
            -sign(*side) * along / length
        };
        let entering = (0..limits.len())
            .filter(|j| !passive[*j])
            .map(|j| (j, help(j)))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        match entering {
            Some((j, help)) if help > 1e-14 * size => passive[j] = true,
            _ => break,
        }
        // Inner loop: those that would change sign leave.
        for _ in 0..=limits.len() {
            let next = solve(&passive);
            let against = |j: usize| {
                passive[j] && sign(limits[j].side) != 0.0 && sign(limits[j].side) * next[j] < 0.0
            };
            let Some((length, leaving)) = (0..limits.len())
                .filter(|j| against(*j))
                .map(|j| (z[j] / (z[j] - next[j]), j))
                .min_by(|a, b| a.0.total_cmp(&b.0))
            else {
                z = next;
                break;
            };
            for (z, next) in z.iter_mut().zip(&next) {
                *z += length * (next - *z);
            }
            z[leaving] = 0.0;
            passive[leaving] = false;
        }
    }
    z
}

/// z of min ‖g + Σ zⱼ aⱼ‖ over the components that move; zero for normals that depend on others.
pub(super) fn least_multipliers(
    g: &[f64],
    normals: &[&[(usize, f64)]],
    moving: impl Fn(usize) -> bool,
) -> Vec<f64> {
    // Components that no normal has add nothing: many columns with few limits stay cheap.
    let mut components: Vec<usize> = (normals.iter())
        .flat_map(|normal| normal.iter().map(|(k, _)| *k))
        .filter(|k| moving(*k))
        .collect();
    components.sort_unstable();
    components.dedup();
    let mut index = vec![None; g.len()];
    for (i, k) in components.iter().enumerate() {
        index[*k] = Some(i);
    }
    let mut a = Mat::<f64>::zeros(components.len(), normals.len());
    for (j, normal) in normals.iter().enumerate() {
        for (k, coefficient) in *normal {
            if let Some(i) = index[*k] {
                a[(i, j)] = *coefficient;
            }
        }
    }
    let mut z = vec![0.0; normals.len()];
    if components.is_empty() || normals.is_empty() {
        return z;
    }
    let qr = a.col_piv_qr();
    let (q, r) = (qr.compute_thin_Q(), qr.thin_R());
    let order = qr.P().arrays().0;
    let largest = r[(0, 0)].abs();
    let rank = (0..r.nrows().min(r.ncols()))
        .take_while(|k| r[(*k, *k)].abs() > 1e-11 * largest)
        .count();
    let mut u: Vec<f64> = (0..rank)
        .map(|k| {
            -(components.iter().enumerate())
                .map(|(i, component)| q[(i, k)] * g[*component])
                .sum::<f64>()
        })
        .collect();
    for k in (0..rank).rev() {
        let known: f64 = (k + 1..rank).map(|l| r[(k, l)] * u[l]).sum();
        u[k] = (u[k] - known) / r[(k, k)];
    }
    for (k, u) in u.iter().enumerate() {
        z[order[k]] = *u;
    }
    z
}
