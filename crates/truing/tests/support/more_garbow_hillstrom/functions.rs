//! The functions of Moré, Garbow & Hillstrom 1981, by the numbers and in the letters of the paper.

use truing::Scalar;
use truing::manifold::Vector;
use truing::{Constraint, Views};

/// One of the 35 functions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Function {
    Rosenbrock,
    FreudensteinRoth,
    PowellBadlyScaled,
    BrownBadlyScaled,
    Beale,
    JennrichSampson,
    HelicalValley,
    Bard,
    Gaussian,
    Meyer,
    Gulf,
    Box3d,
    PowellSingular,
    Wood,
    KowalikOsborne,
    BrownDennis,
    Osborne1,
    BiggsExp6,
    Osborne2,
    Watson,
    ExtendedRosenbrock,
    ExtendedPowell,
    Penalty1,
    Penalty2,
    VariablyDimensioned,
    Trigonometric,
    BrownAlmostLinear,
    DiscreteBoundaryValue,
    DiscreteIntegral,
    BroydenTridiagonal,
    BroydenBanded,
    LinearFullRank,
    LinearRank1,
    LinearRank1Zeros,
    Chebyquad,
}

/// One row fᵢ of a function.
pub struct Row {
    /// Which function.
    pub function: Function,
    /// i, from one as in the paper.
    pub i: usize,
    /// How many rows there are.
    pub m: usize,
}

impl Constraint for Row {
    type Vars = (Vector,);
    const DIM: usize = 1;

    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = self.function.row(x, self.i, self.m);
    }
}

const BARD: [f64; 15] = [
    0.14, 0.18, 0.22, 0.25, 0.29, 0.32, 0.35, 0.39, 0.37, 0.58, 0.73, 0.96, 1.34, 2.10, 4.39,
];
const GAUSSIAN: [f64; 8] = [
    0.0009, 0.0044, 0.0175, 0.0540, 0.1295, 0.2420, 0.3521, 0.3989,
];
const MEYER: [f64; 16] = [
    34780.0, 28610.0, 23650.0, 19630.0, 16370.0, 13720.0, 11540.0, 9744.0, 8261.0, 7030.0, 6005.0,
    5147.0, 4427.0, 3820.0, 3307.0, 2872.0,
];
/// (y, u).
const KOWALIK: [(f64, f64); 11] = [
    (0.1957, 4.0),
    (0.1947, 2.0),
    (0.1735, 1.0),
    (0.1600, 0.5),
    (0.0844, 0.25),
    (0.0627, 0.167),
    (0.0456, 0.125),
    (0.0342, 0.1),
    (0.0323, 0.0833),
    (0.0235, 0.0714),
    (0.0246, 0.0625),
];
const OSBORNE_1: [f64; 33] = [
    0.844, 0.908, 0.932, 0.936, 0.925, 0.908, 0.881, 0.850, 0.818, 0.784, 0.751, 0.718, 0.685,
    0.658, 0.628, 0.603, 0.580, 0.558, 0.538, 0.522, 0.506, 0.490, 0.478, 0.467, 0.457, 0.448,
    0.438, 0.431, 0.424, 0.420, 0.414, 0.411, 0.406,
];
const OSBORNE_2: [f64; 65] = [
    1.366, 1.191, 1.112, 1.013, 0.991, 0.885, 0.831, 0.847, 0.786, 0.725, 0.746, 0.679, 0.608,
    0.655, 0.616, 0.606, 0.602, 0.626, 0.651, 0.724, 0.649, 0.649, 0.694, 0.644, 0.624, 0.661,
    0.612, 0.558, 0.533, 0.495, 0.500, 0.423, 0.395, 0.375, 0.372, 0.391, 0.396, 0.405, 0.428,
    0.429, 0.523, 0.562, 0.607, 0.653, 0.672, 0.708, 0.633, 0.668, 0.645, 0.632, 0.591, 0.559,
    0.597, 0.625, 0.739, 0.710, 0.729, 0.720, 0.636, 0.581, 0.428, 0.292, 0.162, 0.098, 0.054,
];

impl Function {
    /// fᵢ(x), i from one; m rows in all.
    pub fn row<T: Scalar>(self, x: &[T], i: usize, m: usize) -> T {
        let n = x.len();
        let count = i as f64;
        let sum = |terms: &mut dyn Iterator<Item = T>| terms.fold(T::zero(), |s, t| s + t);
        match self {
            Self::Rosenbrock => rosenbrock(x[0], x[1], i),
            Self::FreudensteinRoth if i == 1 => x[0] + ((-x[1] + 5.0) * x[1] - 2.0) * x[1] - 13.0,
            Self::FreudensteinRoth => x[0] + ((x[1] + 1.0) * x[1] - 14.0) * x[1] - 29.0,
            Self::PowellBadlyScaled if i == 1 => x[0] * x[1] * 1e4 - 1.0,
            Self::PowellBadlyScaled => (-x[0]).exp() + (-x[1]).exp() - 1.0001,
            Self::BrownBadlyScaled => match i {
                1 => x[0] - 1e6,
                2 => x[1] - 2e-6,
                _ => x[0] * x[1] - 2.0,
            },
            Self::Beale => x[0] * (x[1].powi(i as i32) - 1.0) + [1.5, 2.25, 2.625][i - 1],
            Self::JennrichSampson => {
                -((x[0] * count).exp() + (x[1] * count).exp()) + 2.0 * (count + 1.0)
            }
            Self::HelicalValley => match i {
                1 => (x[2] - angle(x[0], x[1]) * 10.0) * 10.0,
                2 => ((x[0] * x[0] + x[1] * x[1]).sqrt() - 1.0) * 10.0,
                _ => x[2],
            },
            Self::Bard => {
                let v = 16.0 - count;
                -(x[0] + (x[1] * v + x[2] * count.min(v)).recip() * count) + BARD[i - 1]
            }
            Self::Gaussian => {
                let t = (8.0 - count) / 2.0;
                let z = -x[2] + t;
                x[0] * (-(x[1] * z * z) / 2.0).exp() - GAUSSIAN[(i - 1).min(15 - i)]
            }
            Self::Meyer => x[0] * (x[1] / (x[2] + 45.0 + 5.0 * count)).exp() - MEYER[i - 1],
            Self::Gulf => {
                let t = count / 100.0;
                let y = 25.0 + (-50.0 * t.ln()).powf(2.0 / 3.0);
                (-((-x[1] + y).abs().powd(x[2]) / x[0])).exp() - t
            }
            Self::Box3d => {
                let t = 0.1 * count;
                (-x[0] * t).exp() - (-x[1] * t).exp() - x[2] * ((-t).exp() - (-10.0 * t).exp())
            }
            Self::PowellSingular => powell(x, i),
            Self::Wood => match i {
                1 | 2 => rosenbrock(x[0], x[1], i),
                3 => (x[3] - x[2] * x[2]) * 90f64.sqrt(),
                4 => -x[2] + 1.0,
                5 => (x[1] + x[3] - 2.0) * 10f64.sqrt(),
                _ => (x[1] - x[3]) / 10f64.sqrt(),
            },
            Self::KowalikOsborne => {
                let (y, u) = KOWALIK[i - 1];
                -(x[0] * (x[1] + u) * u / ((x[2] + u) * u + x[3])) + y
            }
            Self::BrownDennis => {
                let t = count / 5.0;
                (x[0] + x[1] * t - t.exp()).powi(2) + (x[2] + x[3] * t.sin() - t.cos()).powi(2)
            }
            Self::Osborne1 => {
                let t = 10.0 * (count - 1.0);
                -(x[0] + x[1] * (-x[3] * t).exp() + x[2] * (-x[4] * t).exp()) + OSBORNE_1[i - 1]
            }
            Self::BiggsExp6 => {
                let t = 0.1 * count;
                let y = (-t).exp() - 5.0 * (-10.0 * t).exp() + 3.0 * (-4.0 * t).exp();
                x[2] * (-x[0] * t).exp() - x[3] * (-x[1] * t).exp() + x[5] * (-x[4] * t).exp() - y
            }
            Self::Osborne2 => {
                let t = (count - 1.0) / 10.0;
                let peak = |height: T, rate: T, centre: T| {
                    let z = -centre + t;
                    height * (-(z * z * rate)).exp()
                };
                let peaks =
                    peak(x[1], x[5], x[8]) + peak(x[2], x[6], x[9]) + peak(x[3], x[7], x[10]);
                -(x[0] * (-x[4] * t).exp() + peaks) + OSBORNE_2[i - 1]
            }
            Self::Watson => match i {
                30 => x[0],
                31 => x[1] - x[0] * x[0] - 1.0,
                _ => {
                    let t = count / 29.0;
                    let power = |j: usize| t.powi(j as i32);
                    let slope = sum(&mut (1..n).map(|j| x[j] * (j as f64 * power(j - 1))));
                    let value = sum(&mut (0..n).map(|j| x[j] * power(j)));
                    slope - value * value - 1.0
                }
            },
            Self::ExtendedRosenbrock => {
                let pair = (i - 1) / 2 * 2;
                rosenbrock(x[pair], x[pair + 1], (i - 1) % 2 + 1)
            }
            Self::ExtendedPowell => {
                let four = (i - 1) / 4 * 4;
                powell(&x[four..four + 4], (i - 1) % 4 + 1)
            }
            Self::Penalty1 if i <= n => (x[i - 1] - 1.0) * 1e-5f64.sqrt(),
            Self::Penalty1 => sum(&mut x.iter().map(|x| *x * *x)) - 0.25,
            Self::Penalty2 => penalty_2(x, i),
            Self::VariablyDimensioned => {
                let weighted = |x: &[T]| {
                    let term = |(j, x): (usize, &T)| (*x - 1.0) * (j + 1) as f64;
                    x.iter().enumerate().map(term).fold(T::zero(), |s, t| s + t)
                };
                match i - 1 {
                    j if j < n => x[j] - 1.0,
                    j if j == n => weighted(x),
                    _ => weighted(x).powi(2),
                }
            }
            Self::Trigonometric => {
                let cosines = sum(&mut x.iter().map(|x| x.cos()));
                let x = x[i - 1];
                -cosines + n as f64 + (-x.cos() + 1.0) * count - x.sin()
            }
            Self::BrownAlmostLinear if i < n => {
                x[i - 1] + sum(&mut x.iter().copied()) - (n + 1) as f64
            }
            Self::BrownAlmostLinear => x.iter().fold(T::one(), |p, x| p * *x) - 1.0,
            Self::DiscreteBoundaryValue => {
                let h = 1.0 / (n + 1) as f64;
                let cube = (x[i - 1] + (count * h + 1.0)).powi(3);
                x[i - 1] * 2.0 - neighbour(x, i - 1) - neighbour(x, i + 1) + cube * (h * h / 2.0)
            }
            Self::DiscreteIntegral => {
                let h = 1.0 / (n + 1) as f64;
                let t = |j: usize| j as f64 * h;
                let cube = |j: usize| (x[j - 1] + (t(j) + 1.0)).powi(3);
                let below = sum(&mut (1..=i).map(|j| cube(j) * t(j)));
                let above = sum(&mut (i + 1..=n).map(|j| cube(j) * (1.0 - t(j))));
                x[i - 1] + (below * (1.0 - t(i)) + above * t(i)) * (h / 2.0)
            }
            Self::BroydenTridiagonal => {
                let own = x[i - 1];
                (-own * 2.0 + 3.0) * own - neighbour(x, i - 1) - neighbour(x, i + 1) * 2.0 + 1.0
            }
            Self::BroydenBanded => {
                let own = x[i - 1];
                let band = i.saturating_sub(5).max(1)..=(i + 1).min(n);
                let others = band.filter(|j| *j != i).map(|j| x[j - 1]);
                own * (own * own * 5.0 + 2.0) + 1.0 - sum(&mut others.map(|x| x * (x + 1.0)))
            }
            Self::LinearFullRank => {
                let mean = sum(&mut x.iter().copied()) * (2.0 / m as f64);
                let own = if i <= n { x[i - 1] } else { T::zero() };
                own - mean - 1.0
            }
            Self::LinearRank1 => sum(&mut (1..=n).map(|j| x[j - 1] * j as f64)) * count - 1.0,
            Self::LinearRank1Zeros => {
                let inner = sum(&mut (2..n).map(|j| x[j - 1] * j as f64));
                let factor = if i == m { 0.0 } else { count - 1.0 };
                inner * factor - 1.0
            }
            Self::Chebyquad => {
                let integral = if i.is_multiple_of(2) {
                    -1.0 / (count * count - 1.0)
                } else {
                    0.0
                };
                sum(&mut x.iter().map(|x| chebyshev(*x, i))) / n as f64 - integral
            }
        }
    }
}

fn rosenbrock<T: Scalar>(x: T, y: T, i: usize) -> T {
    match i {
        1 => (y - x * x) * 10.0,
        _ => -x + 1.0,
    }
}

fn powell<T: Scalar>(x: &[T], i: usize) -> T {
    match i {
        1 => x[0] + x[1] * 10.0,
        2 => (x[2] - x[3]) * 5f64.sqrt(),
        3 => (x[1] - x[2] * 2.0).powi(2),
        _ => (x[0] - x[3]).powi(2) * 10f64.sqrt(),
    }
}

/// Angle of (x, y) in turns, from −¼ to ¾: the helix' θ.
fn angle<T: Scalar>(x: T, y: T) -> T {
    let turns = (y / x).atan() / std::f64::consts::TAU;
    if x.re() < 0.0 { turns + 0.5 } else { turns }
}

fn penalty_2<T: Scalar>(x: &[T], i: usize) -> T {
    let n = x.len();
    let root = 1e-5f64.sqrt();
    let grown = |j: usize| (x[j - 1] / 10.0).exp();
    if i == 1 {
        x[0] - 0.2
    } else if i <= n {
        let y = (i as f64 / 10.0).exp() + ((i - 1) as f64 / 10.0).exp();
        (grown(i) + grown(i - 1) - y) * root
    } else if i < 2 * n {
        (grown(i - n + 1) - (-0.1f64).exp()) * root
    } else {
        let term = |j: usize| x[j - 1] * x[j - 1] * (n - j + 1) as f64;
        (1..=n).map(term).fold(T::zero(), |s, t| s + t) - 1.0
    }
}

/// xⱼ, zero beyond both ends.
fn neighbour<T: Scalar>(x: &[T], j: usize) -> T {
    if j == 0 || j > x.len() {
        T::zero()
    } else {
        x[j - 1]
    }
}

/// Chebyshev's polynomial of degree i, shifted to [0, 1].
fn chebyshev<T: Scalar>(x: T, i: usize) -> T {
    let z = x * 2.0 - 1.0;
    let (mut before, mut now) = (T::one(), z);
    for _ in 1..i {
        (before, now) = (now, z * now * 2.0 - before);
    }
    now
}
