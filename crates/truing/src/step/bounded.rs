//! Steps that keep limits: a convex quadratic program by clarabel, polished on its active set.

use super::program::{Data, Found, Program};
use super::{Equalities, NoStep, Quadratic, Side, Step, StepSolver};
use crate::least_squares::{Linearization, StepBounds};
use clarabel::algebra::CscMatrix;
use clarabel::solver::SupportedConeT;

/// Steps of any [`StepSolver`] that stay inside bounds and linear limits.
///
/// A step that keeps all limits by itself is the solver's own: clarabel is not asked. Otherwise the
/// limits that were active last are tried, and where they are not the ones, clarabel solves
///
/// min ½‖Jδ + r‖² + ½λ‖Dδ‖²  with  lower ≤ δ ≤ upper,  lower ≤ Aδ ≤ upper
///
/// in a solver object that is kept. Its interior-point solution says which limits are active; with
/// these as equalities the step is solved for exactly, and exchanged one by one until the
/// Karush–Kuhn–Tucker conditions hold to rounding. So a bound is kept to the last bit, and an
/// interior-point tolerance never reaches the step.
#[derive(Clone, Default)]
pub struct Bounded<S> {
    solver: S,
    free: Vec<usize>,
    scale: Vec<f64>,
    /// Place of every column in `free`.
    place: Vec<Option<usize>>,
    cols: usize,
    program: Program,
    ball: Program,
    last: Option<Active>,
}

/// Which limits are active, and on which side.
#[derive(Debug, Clone, PartialEq)]
struct Active {
    components: Vec<Option<Side>>,
    rows: Vec<Option<Side>>,
}

/// Limits in the scaled free components.
struct Limits {
    lower: Vec<f64>,
    upper: Vec<f64>,
    rows: Vec<Row>,
}

/// lower ≤ a·y ≤ upper with |a| = 1.
struct Row {
    terms: Vec<(usize, f64)>,
    lower: f64,
    upper: f64,
    rounding: f64,
}

impl Row {
    fn value(&self, y: &[f64]) -> f64 {
        self.terms.iter().map(|(k, a)| a * y[*k]).sum()
    }

    /// What rounding may do to the value.
    fn rounding(&self, y: &[f64]) -> f64 {
        let largest = (self.terms.iter()).fold(0.0_f64, |m, (k, _)| m.max(y[*k].abs()));
        self.rounding + 16.0 * f64::EPSILON * largest
    }

    fn limit(&self, side: Side) -> f64 {
        match side {
            Side::Lower => self.lower,
            Side::Upper | Side::Equal => self.upper,
        }
    }
}

impl Limits {
    /// The equalities only.
    fn equal(&self) -> Active {
        let side = |lower: f64, upper: f64| (lower == upper).then_some(Side::Equal);
        Active {
            components: (self.lower.iter().zip(&self.upper))
                .map(|(l, u)| side(*l, *u))
                .collect(),
            rows: (self.rows.iter())
                .map(|row| side(row.lower, row.upper))
                .collect(),
        }
    }

    fn equalities(&self, active: &Active) -> Equalities {
        let held = |k: usize, side: &Option<Side>| {
            side.map(|side| match side {
                Side::Lower => self.lower[k],
                Side::Upper | Side::Equal => self.upper[k],
            })
        };
        Equalities {
            held: (active.components.iter().enumerate())
                .map(|(k, side)| held(k, side))
                .collect(),
            rows: (self.rows.iter().zip(&active.rows))
                .filter_map(|(row, side)| side.map(|s| (row.terms.clone(), row.limit(s))))
                .collect(),
        }
    }

    /// The limit that y violates most, if it violates one by more than rounding.
    fn violated(&self, y: &[f64]) -> Option<(Limit, Side)> {
        let mut worst: Option<(f64, Limit, Side)> = None;
        let mut look = |excess: f64, rounding: f64, limit: Limit, side: Side| {
            if excess > rounding && worst.is_none_or(|(most, ..)| excess > most) {
                worst = Some((excess, limit, side));
            }
        };
        // Where rows and bounds meet in one point they agree to rounding only, and components are
        // clipped in the end.
        let mut meeting = vec![0.0_f64; y.len()];
        for row in &self.rows {
            for (k, a) in &row.terms {
                meeting[*k] = meeting[*k].max(2.0 * row.rounding(y) / a.abs().max(0.1));
            }
        }
        for k in 0..y.len() {
            let rounding = 4.0 * f64::EPSILON * y[k].abs() + meeting[k];
            look(
                y[k] - self.upper[k],
                rounding,
                Limit::Component(k),
                Side::Upper,
            );
            look(
                self.lower[k] - y[k],
                rounding,
                Limit::Component(k),
                Side::Lower,
            );
        }
        for (k, row) in self.rows.iter().enumerate() {
            let (value, rounding) = (row.value(y), row.rounding(y));
            look(value - row.upper, rounding, Limit::Row(k), Side::Upper);
            look(row.lower - value, rounding, Limit::Row(k), Side::Lower);
        }
        worst.map(|(_, limit, side)| (limit, side))
    }
}

/// A limit by its number.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Limit {
    Component(usize),
    Row(usize),
}

impl<S: StepSolver> Bounded<S> {
    /// Around a solver.
    pub fn new(solver: S) -> Self {
        Self {
            solver,
            free: Vec::new(),
            scale: Vec::new(),
            place: Vec::new(),
            cols: 0,
            program: Program::default(),
            ball: Program::default(),
            last: None,
        }
    }

    /// Takes in J and r; `scale` is the diagonal of D, one positive number for each free column.
    pub fn factor(&mut self, lin: &Linearization, free: &[usize], scale: &[f64]) {
        self.solver.factor(lin, free, scale);
        self.free = free.to_vec();
        self.scale = scale.to_vec();
        self.cols = lin.structure.cols();
        self.place = vec![None; self.cols];
        for (k, column) in free.iter().enumerate() {
            self.place[*column] = Some(k);
        }
    }

    /// The minimiser of ½‖Jδ + r‖² + ½λ‖Dδ‖² over the free columns, inside the bounds.
    ///
    /// # Errors
    /// With λ = 0, names a free column that depends on others.
    pub fn step(&mut self, lambda: f64, bounds: Option<&StepBounds>) -> Result<Step, NoStep> {
        let Some(bounds) = bounds else {
            let y = self.solver.solve(lambda, None)?;
            return Ok(self.finished(y, None, false));
        };
        let limits = self.limits(bounds);
        let (y, limited) = self.inside(lambda, &limits)?;
        Ok(self.finished(y, Some(bounds), limited))
    }

    /// The minimiser of ½‖Jδ + r‖² in the ball ‖Dδ‖ ≤ radius and inside the bounds: a trust region
    /// as a second-order cone.
    ///
    /// Where the ball is active, its multiplier is a damping; the step is the damped one, polished
    /// as in [`step`](Self::step).
    ///
    /// # Errors
    /// If clarabel finds no step.
    pub fn ball(&mut self, radius: f64, bounds: Option<&StepBounds>) -> Result<Step, NoStep> {
        let unlimited;
        let limits = match bounds {
            Some(bounds) => self.limits(bounds),
            None => {
                unlimited = StepBounds::unlimited(self.cols);
                self.limits(&unlimited)
            }
        };
        let norm = |y: &[f64]| y.iter().map(|y| y * y).sum::<f64>().sqrt();
        if let Ok((y, limited)) = self.inside(0.0, &limits)
            && norm(&y) <= radius
        {
            return Ok(self.finished(y, bounds, limited));
        }
        let (data, size) = program(&self.solver.quadratic(), 0.0, &limits, Some(radius));
        let found = self.ball.solve(&data).ok_or(NoStep::Limits)?;
        // The cone's rows come last: (radius, y) in the cone, its multiplier (λ radius, −λ y).
        let lambda = found.z[data.b.len() - self.free.len() - 1] / (radius / size);
        let (mut y, limited) = self.of_length(radius, lambda, &limits)?;
        let length = norm(&y);
        if length > radius {
            // Zero keeps all limits, and so does what lies between.
            y.iter_mut().for_each(|y| *y *= radius / length);
        }
        Ok(self.finished(y, bounds, limited))
    }

    /// The damped step inside the limits whose length is the radius, from about the right damping:
    /// ‖y(λ)‖ falls with λ, and 1/‖y(λ)‖ is nearly straight (Moré & Sorensen 1983).
    fn of_length(
        &mut self,
        radius: f64,
        lambda: f64,
        limits: &Limits,
    ) -> Result<(Vec<f64>, bool), NoStep> {
        let length = |y: &[f64]| y.iter().map(|y| y * y).sum::<f64>().sqrt();
        let mut lambda = if lambda > 0.0 && lambda.is_finite() {
            lambda
        } else {
            1.0
        };
        // (λ, 1/‖y‖ − 1/Δ) with too long and too short steps.
        let mut long: Option<(f64, f64)> = None;
        let mut short: Option<(f64, f64)> = None;
        let mut best = self.inside(lambda, limits)?;
        for _ in 0..MOST_DAMPINGS {
            let norm = length(&best.0);
            let off = 1.0 / norm - 1.0 / radius;
            if (norm - radius).abs() <= 1e-9 * radius || norm == 0.0 {
                break;
            }
            if norm > radius {
                long = Some((lambda, off));
            } else {
                short = Some((lambda, off));
            }
            lambda = match (long, short) {
                (Some((a, fa)), Some((b, fb))) => {
                    let secant = a - fa * (b - a) / (fb - fa);
                    let inside = secant > a + 0.01 * (b - a) && secant < b - 0.01 * (b - a);
                    if inside { secant } else { (a * b).sqrt() }
                }
                (Some((a, _)), None) => a * (2.0 * norm / radius).max(2.0),
                (None, Some((b, _))) => b * 0.1,
                (None, None) => break,
            };
            best = self.inside(lambda, limits)?;
        }
        Ok(best)
    }

    /// The solution a of (JᵀJ + λD²) a = −g over the free columns, with the λ of the last step and
    /// g one number a column; `None` where the solver cannot tell.
    pub fn correction(&self, g: &[f64]) -> Option<Vec<f64>> {
        let scaled: Vec<f64> = (self.free.iter().zip(&self.scale))
            .map(|(column, scale)| g[*column] / scale)
            .collect();
        let a = self.solver.correction(&scaled)?;
        Some(self.unscaled(&a))
    }

    /// The gradient of ½‖Jδ + r‖² along the free columns at δ = 0, scaled: D⁻¹Jᵀr.
    pub fn gradient(&self) -> Vec<f64> {
        self.solver.gradient(&vec![0.0; self.free.len()])
    }

    /// D⁻¹Jᵀ(JD⁻¹y + r): the gradient at scaled free components y.
    pub fn gradient_at(&self, y: &[f64]) -> Vec<f64> {
        self.solver.gradient(y)
    }

    /// The step of the solver itself, scaled, whatever the limits.
    ///
    /// # Errors
    /// With λ = 0, names a free column that depends on others.
    pub fn free_step(&mut self, lambda: f64) -> Result<Vec<f64>, NoStep> {
        self.solver.solve(lambda, None)
    }

    /// The step y / D for scaled free components.
    pub fn along(&self, y: Vec<f64>) -> Step {
        self.finished(y, None, false)
    }

    /// The name of the solver inside, and why it was chosen.
    pub fn described(&self) -> (&'static str, String) {
        let reason = self.solver.reason().unwrap_or_default();
        (self.solver.name(), reason)
    }

    /// The solver inside.
    pub fn solver(&self) -> &S {
        &self.solver
    }

    /// How many clarabel solvers were made, and how many programs they solved.
    pub fn programs(&self) -> (u64, u64) {
        let both = [&self.program, &self.ball];
        (
            both.iter().map(|program| program.made).sum(),
            both.iter().map(|program| program.solved).sum(),
        )
    }

    fn unscaled(&self, y: &[f64]) -> Vec<f64> {
        let mut delta = vec![0.0; self.cols];
        for ((y, scale), column) in y.iter().zip(&self.scale).zip(&self.free) {
            delta[*column] = y / scale;
        }
        delta
    }

    fn finished(&self, y: Vec<f64>, bounds: Option<&StepBounds>, limited: bool) -> Step {
        let mut delta = self.unscaled(&y);
        if let Some(bounds) = bounds {
            // Scaling there and back may round: bounds are kept exactly.
            for column in &self.free {
                delta[*column] = delta[*column].clamp(bounds.lower[*column], bounds.upper[*column]);
            }
        }
        Step {
            delta,
            predicted: self.solver.predicted(&y).max(0.0),
            scaled_norm: y.iter().map(|y| y * y).sum::<f64>().sqrt(),
            limited,
        }
    }

    /// The limits on the free columns, scaled, with rows of length one.
    fn limits(&self, bounds: &StepBounds) -> Limits {
        let side = |side: &[f64]| -> Vec<f64> {
            (self.free.iter().zip(&self.scale))
                .map(|(column, scale)| side[*column] * scale)
                .collect()
        };
        let row = |row: &crate::least_squares::LinearBound| {
            let terms: Vec<(usize, f64)> = (row.terms.iter())
                .filter_map(|(column, a)| self.place[*column].map(|k| (k, a / self.scale[k])))
                .collect();
            let length = terms.iter().map(|(_, a)| a * a).sum::<f64>().sqrt();
            (length > 0.0).then(|| Row {
                terms: terms.into_iter().map(|(k, a)| (k, a / length)).collect(),
                lower: row.lower / length,
                upper: row.upper / length,
                rounding: row.rounding / length,
            })
        };
        Limits {
            lower: side(&bounds.lower),
            upper: side(&bounds.upper),
            rows: bounds.rows.iter().filter_map(row).collect(),
        }
    }

    /// The minimiser inside the limits, and whether a limit changed it.
    fn inside(&mut self, lambda: f64, limits: &Limits) -> Result<(Vec<f64>, bool), NoStep> {
        let equal = limits.equal();
        let some = |active: &Active| {
            active.components.iter().any(Option::is_some) || active.rows.iter().any(Option::is_some)
        };
        let constrained = some(&equal);
        let equalities = constrained.then(|| limits.equalities(&equal));
        let free = self.solver.solve(lambda, equalities.as_ref());
        match &free {
            Ok(y) if limits.violated(y).is_none() => {
                return Ok((clipped(y, limits), constrained));
            }
            _ => {}
        }
        if let Some(last) = self.last.clone()
            && last.components.len() == limits.lower.len()
            && last.rows.len() == limits.rows.len()
            && let Some(y) = self.exchanged(lambda, limits, last, 1)
        {
            return Ok((y, true));
        }
        let (data, size) = program(&self.solver.quadratic(), lambda, limits, None);
        let Some(found) = self.program.solve(&data) else {
            // Without clarabel, from the equalities alone.
            let tries = 4 * (limits.lower.len() + limits.rows.len()) + 10;
            return match self.exchanged(lambda, limits, equal, tries) {
                Some(y) => Ok((y, true)),
                None => Err(free.err().unwrap_or(NoStep::Limits)),
            };
        };
        let guess = active(&found, limits);
        let tries = 4 * (limits.lower.len() + limits.rows.len()) + 10;
        if let Some(y) = self.exchanged(lambda, limits, guess, tries) {
            return Ok((y, true));
        }
        self.last = None;
        let mut y: Vec<f64> = found.x.iter().map(|x| x * size).collect();
        y = clipped(&y, limits);
        shorten(&mut y, limits);
        match limits.violated(&y) {
            None => Ok((y, true)),
            Some(_) => Err(NoStep::Limits),
        }
    }

    /// The minimiser under the active limits as equalities; limits are exchanged one by one, at
    /// most `tries` times, until none is violated and no multiplier pulls the wrong way.
    fn exchanged(
        &mut self,
        lambda: f64,
        limits: &Limits,
        mut active: Active,
        tries: usize,
    ) -> Option<Vec<f64>> {
        for _ in 0..tries {
            let equalities = limits.equalities(&active);
            let y = self.solver.solve(lambda, Some(&equalities)).ok()?;
            if y.iter().any(|y| !y.is_finite()) {
                return None;
            }
            if let Some((limit, side)) = limits.violated(&y) {
                let entry = match limit {
                    Limit::Component(k) => &mut active.components[k],
                    Limit::Row(k) => &mut active.rows[k],
                };
                if entry.is_some() {
                    // An active limit that does not hold: the active ones contradict each other.
                    return None;
                }
                *entry = Some(side);
                continue;
            }
            let mut gradient = self.solver.gradient(&y);
            let size = self.solver.gradient(&vec![0.0; y.len()]);
            let size = size.iter().fold(0.0_f64, |size, g| size.max(g.abs()));
            gradient
                .iter_mut()
                .zip(&y)
                .for_each(|(g, y)| *g += lambda * y);
            match wrong(&gradient, limits, &active, 1e-11 * size) {
                None => {
                    self.last = Some(active);
                    return Some(clipped(&y, limits));
                }
                Some(Limit::Component(k)) => active.components[k] = None,
                Some(Limit::Row(k)) => active.rows[k] = None,
            }
        }
        None
    }
}

/// The active limit whose multiplier pulls the wrong way most, if it does by more than `rounding`.
fn wrong(gradient: &[f64], limits: &Limits, active: &Active, rounding: f64) -> Option<Limit> {
    let rows: Vec<usize> = (0..limits.rows.len())
        .filter(|k| active.rows[*k].is_some())
        .collect();
    let mut left = gradient.to_vec();
    let mut worst: Option<(f64, Limit)> = None;
    let mut look = |multiplier: f64, side: Side, limit: Limit| {
        let wrong = match side {
            Side::Upper => -multiplier,
            Side::Lower => multiplier,
            Side::Equal => 0.0,
        };
        if wrong > rounding && worst.is_none_or(|(most, _)| wrong > most) {
            worst = Some((wrong, limit));
        }
    };
    if !rows.is_empty() {
        let normals: Vec<&[(usize, f64)]> = rows
            .iter()
            .map(|k| limits.rows[*k].terms.as_slice())
            .collect();
        let moving = |k: usize| active.components[k].is_none();
        let multipliers = super::kkt::least_multipliers(&left, &normals, moving);
        for ((k, normal), z) in rows.iter().zip(&normals).zip(&multipliers) {
            for (component, a) in *normal {
                left[*component] += a * z;
            }
            if let Some(side) = active.rows[*k] {
                look(*z, side, Limit::Row(*k));
            }
        }
    }
    for (k, side) in active.components.iter().enumerate() {
        if let Some(side) = side {
            look(-left[k], *side, Limit::Component(k));
        }
    }
    worst.map(|(_, limit)| limit)
}

fn clipped(y: &[f64], limits: &Limits) -> Vec<f64> {
    y.iter()
        .zip(limits.lower.iter().zip(&limits.upper))
        .map(|(y, (lower, upper))| y.clamp(*lower, *upper))
        .collect()
}

/// Shortens y until every row holds: zero keeps all limits, and what lies between does too.
fn shorten(y: &mut [f64], limits: &Limits) {
    let mut length = 1.0_f64;
    for row in &limits.rows {
        let (value, rounding) = (row.value(y), row.rounding(y));
        if value > row.upper + rounding && row.upper >= 0.0 {
            length = length.min(row.upper / value);
        }
        if value < row.lower - rounding && row.lower <= 0.0 {
            length = length.min(row.lower / value);
        }
    }
    if length < 1.0 {
        y.iter_mut().for_each(|y| *y *= length);
    }
}

/// Dampings tried at most for a step of a given length.
const MOST_DAMPINGS: usize = 60;

/// A limit farther than this, relative to the gradient, is as good as none to clarabel, whose
/// equilibration it would spoil.
const FAR: f64 = 1e8;

/// The program of a step for clarabel, and the size by which its variable is divided so that the
/// gradient is one: equalities first, then inequalities, then the ball.
fn program(
    quadratic: &Quadratic,
    lambda: f64,
    limits: &Limits,
    radius: Option<f64>,
) -> (Data, f64) {
    let n = quadratic.linear.len();
    let mut p = CscMatrix::new(
        n,
        n,
        quadratic.starts.clone(),
        quadratic.rows.clone(),
        quadratic.values.clone(),
    );
    for k in 0..n {
        let diagonal = quadratic.starts[k + 1] - 1;
        p.nzval[diagonal] += lambda;
    }
    let norm = quadratic.linear.iter().map(|q| q * q).sum::<f64>().sqrt();
    let size = if norm > 0.0 { norm } else { 1.0 };
    let q = quadratic.linear.iter().map(|q| q / size).collect();

    // Entries of A as (column, row, value), rows in the order of the cones.
    let mut entries: Vec<(usize, usize, f64)> = Vec::new();
    let mut b = Vec::new();
    let mut add = |terms: &[(usize, f64)], sign: f64, limit: f64| {
        for (k, a) in terms {
            entries.push((*k, b.len(), sign * a));
        }
        b.push(sign * (limit / size).clamp(-FAR, FAR));
        b.len()
    };
    let unit = |k: usize| [(k, 1.0)];
    let mut equal = 0;
    for k in 0..n {
        if limits.lower[k] == limits.upper[k] {
            equal = add(&unit(k), 1.0, limits.upper[k]);
        }
    }
    for row in &limits.rows {
        if row.lower == row.upper {
            equal = add(&row.terms, 1.0, row.upper);
        }
    }
    let mut all = equal;
    each_inequality(limits, |limit, sign, value| {
        all = match limit {
            Limit::Component(k) => add(&unit(k), sign, value),
            Limit::Row(k) => add(&limits.rows[k].terms, sign, value),
        };
    });
    let mut cones = Vec::new();
    if equal > 0 {
        cones.push(SupportedConeT::ZeroConeT(equal));
    }
    if all > equal {
        cones.push(SupportedConeT::NonnegativeConeT(all - equal));
    }
    if let Some(radius) = radius {
        b.push(radius / size);
        for k in 0..n {
            entries.push((k, b.len(), -1.0));
            b.push(0.0);
        }
        cones.push(SupportedConeT::SecondOrderConeT(n + 1));
    }
    entries.sort_unstable_by_key(|(column, row, _)| (*column, *row));
    let mut starts = vec![0; n + 1];
    for (column, ..) in &entries {
        starts[column + 1] += 1;
    }
    for k in 0..n {
        starts[k + 1] += starts[k];
    }
    let a = CscMatrix::new(
        b.len(),
        n,
        starts,
        entries.iter().map(|(_, row, _)| *row).collect(),
        entries.iter().map(|(.., value)| *value).collect(),
    );
    (Data { p, q, a, b, cones }, size)
}

/// Every finite inequality in the program's order: components, then rows; upper, then lower.
fn each_inequality(limits: &Limits, mut visit: impl FnMut(Limit, f64, f64)) {
    let mut both = |limit: Limit, lower: f64, upper: f64| {
        if lower == upper {
            return;
        }
        if upper.is_finite() {
            visit(limit, 1.0, upper);
        }
        if lower.is_finite() {
            visit(limit, -1.0, lower);
        }
    };
    for k in 0..limits.lower.len() {
        both(Limit::Component(k), limits.lower[k], limits.upper[k]);
    }
    for (k, row) in limits.rows.iter().enumerate() {
        both(Limit::Row(k), row.lower, row.upper);
    }
}

/// Active where the multiplier outweighs the slack.
fn active(found: &Found, limits: &Limits) -> Active {
    let mut active = limits.equal();
    let mut row = active.components.iter().flatten().count() + active.rows.iter().flatten().count();
    each_inequality(limits, |limit, sign, _| {
        if found.z[row] > found.s[row] {
            let side = if sign > 0.0 { Side::Upper } else { Side::Lower };
            match limit {
                Limit::Component(k) => active.components[k] = Some(side),
                Limit::Row(k) => active.rows[k] = Some(side),
            }
        }
        row += 1;
    });
    active
}
