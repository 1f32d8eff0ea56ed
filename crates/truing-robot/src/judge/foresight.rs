//! How far off a calibrated tool may be, where it was measured and elsewhere, beside the nominal one.

use super::errors::Fitted;
use super::leave_out::LeftOut;
use super::tips::{Tips, motions, tips, without};
use super::uncertainty::Judged;
use crate::estimate::Job;
use crate::identify::Choice;
use crate::measurement::fit::{mean, rigid_registration};
use crate::model::{Assembly, Owner};
use crate::robot::{Unit, posture};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ChiSquared, ContinuousCDF, StudentsT};
use truing::nalgebra::{DMatrix, DVector, Vector3};

/// Systematic errors of which measurements show a part are so many times as large as these look.
const PARTLY: f64 = 3.0;

/// So many postures show where a tool is known, all over the joints' ranges and of the sets.
const POSTURES: usize = 150;
const MEASURED: usize = 500;

/// Any would do; the same postures in every run.
const SEED: u64 = 11;

/// The tool of one robot at some postures, up to a rigid motion (and the scale, if that is free, and the place of a
/// tool point that was estimated).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Foresight {
    /// The robot.
    pub robot: usize,
    /// RMS error of the tool to be expected of the estimate \[m\]: the larger of what the covariance and what
    /// leaving clusters of postures out says.
    pub expected: f64,
    /// What this RMS error is below with a probability of 95 % \[m\].
    pub bound: f64,
    /// RMS distance between the calibrated and the nominal tool \[m\].
    pub change: f64,
    /// By how many standard errors the nominal tool is expected to be farther off than the calibrated one.
    pub gain: f64,
    /// What of the change is one of size.
    pub grown: Grown,
}

/// Where a tool is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Place {
    /// At the postures that were measured.
    Measured,
    /// All over the joints' ranges.
    Everywhere,
}

/// A change of a robot's size.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Grown {
    /// Size of the calibrated over that of the nominal robot.
    pub factor: f64,
    /// The part of the change of its tools that this explains, in squares.
    pub share: f64,
    /// Probability that lengths that err on their own look as if all had grown.
    pub p_value: f64,
}

impl Foresight {
    /// RMS error of the nominal tool to be expected \[m\]: that of the estimate, and what the calibration changed.
    pub fn nominal(&self) -> f64 {
        self.change.hypot(self.expected)
    }
}

/// What a calibration found, to foresee from.
pub(crate) struct Foreseer<'a> {
    pub job: &'a Job,
    pub fitted: &'a Fitted,
    pub assembly: &'a Assembly,
    pub choices: &'a [Choice],
    pub judged: &'a Judged,
}

impl Foreseer<'_> {
    /// Whether the data leave the scale free.
    pub fn is_scale_free(&self) -> bool {
        self.choices.iter().any(|c| matches!(c, Choice::Anchor(_)))
    }

    /// The expected error of every robot with estimated parameters.
    ///
    /// With G the derivatives of tool points by the estimated parameters, C their covariance, P the projection that takes
    /// rigid motions out and M = GᵀPG, the calibrated tools are off by T = trace(M C). The calibration changed them by
    /// D = δᵀMδ. With δ as the estimate and an error e of covariance C, the nominal tools are farther off than the
    /// calibrated ones by D + 2 δᵀM e: D, known up to √(4 δᵀM C M δ). Priors of the size that the errors have make this
    /// so: without them an estimate is as far from nominal as noise drives it. The sum of squares T is like
    /// χ²(n) T/n with n = T²/trace(M C M C) (Satterthwaite 1946).
    pub fn foresee(&self, free: &[usize], left_out: &[&LeftOut], place: Place) -> Vec<Foresight> {
        let factor = self.judged.uncertainty.factor();
        let blind = self.is_scale_free() && self.judged.misfit().is_some();
        // Systematic errors do not average, and what does not see the whole tool shows a part of them.
        let systematic = if blind && place == Place::Everywhere {
            1.0 + (PARTLY * PARTLY - 1.0) * (1.0 - 1.0 / (factor * factor)).max(0.0)
        } else {
            1.0
        };
        let unmodelled = self.unmodelled();
        let mut all = Vec::new();
        for robot in 0..self.job.arms.len() {
            let columns = self.columns(robot);
            let postures = self.postures(robot, place);
            if columns.is_empty() || postures.len() < 3 {
                continue;
            }
            let tips = self.tips(robot, &postures, &columns);
            let motions = motions(&tips, self.is_scale_free());
            let g = without(&motions, &tips.derivatives);
            let points = tips.estimated.len() as f64;
            let m = g.tr_mul(&g) / points;
            let expected = |c: &DMatrix<f64>| (&m * c).trace();
            let stated = DMatrix::from_fn(columns.len(), columns.len(), |i, k| {
                self.judged
                    .uncertainty
                    .covariance
                    .entry(columns[i], columns[k])
                    * factor
                    * factor
            });
            // What the data say themselves of how sure they are, whatever is wrong with them.
            let others = left_out
                .iter()
                .map(|left_out| scatter(left_out, free, &columns));
            let c = others.fold(stated, |c, other| {
                if expected(&other) > expected(&c) {
                    other
                } else {
                    c
                }
            });
            let c = c * systematic;
            let mc = &m * &c;
            let (error, spread) = (mc.trace().max(0.0), (&mc * &mc).trace());

            // Registered first: what is left is small enough for the projection.
            let motion = rigid_registration(&tips.nominal, &tips.estimated);
            let moved: Vec<_> = tips.nominal.iter().map(|n| motion.apply(n)).collect();
            let moves = moved.iter().zip(&tips.estimated);
            let moves: Vec<f64> = moves.flat_map(|(n, t)| <[f64; 3]>::from(t - n)).collect();
            let left = without(&motions, &DMatrix::from_vec(moves.len(), 1, moves));
            let change = left.norm_squared() / points;
            let pull = g.tr_mul(&left) / points;
            let along = (pull.tr_mul(&c) * &pull)[(0, 0)].max(0.0);
            let freedom = error * error / spread.max(f64::MIN_POSITIVE);
            all.push(Foresight {
                robot,
                expected: error.sqrt(),
                bound: (upper(error, freedom) + unmodelled).sqrt(),
                change: change.sqrt(),
                gain: if along > 0.0 {
                    change / (4.0 * along).sqrt()
                } else {
                    0.0
                },
                grown: self.grown(robot, &columns, &moved, &tips, change),
            });
        }
        all
    }

    /// The estimated parameters of a robot.
    fn columns(&self, robot: usize) -> Vec<usize> {
        let own = |c: &usize| matches!(self.assembly.columns[*c].owner, Owner::Parameter { robot: r, .. } if r == robot);
        let estimated = |c: &usize| self.choices[*c] == Choice::Estimated;
        (0..self.choices.len())
            .filter(estimated)
            .filter(own)
            .collect()
    }

    fn postures(&self, robot: usize, place: Place) -> Vec<Vec<f64>> {
        if place == Place::Everywhere {
            let limits = posture::limits(&self.job.arms[robot].robot);
            let mut rng = ChaCha8Rng::seed_from_u64(SEED);
            return (0..POSTURES)
                .map(|_| posture::random(&limits, &mut rng))
                .collect();
        }
        let tools = || {
            self.job
                .sets
                .iter()
                .flat_map(|set| &set.tools)
                .filter(|tool| tool.robot == robot)
        };
        let count: usize = tools().map(|tool| tool.q.len()).sum();
        let every = count.div_ceil(MEASURED).max(1);
        tools()
            .flat_map(|tool| &tool.q)
            .step_by(every)
            .cloned()
            .collect()
    }

    fn tips(&self, robot: usize, postures: &[Vec<f64>], columns: &[usize]) -> Tips {
        let target = (self.job.sets.iter().flat_map(|set| &set.tools))
            .find(|tool| tool.robot == robot)
            .and_then(|tool| tool.target.as_ref());
        let chain = &self.job.arms[robot].robot;
        tips(
            chain,
            postures,
            target,
            self.fitted,
            self.assembly,
            columns,
            robot,
        )
    }

    /// Mean square of the distance that the model does not have, from residuals beyond the noise \[m²\].
    fn unmodelled(&self) -> f64 {
        if self.judged.misfit().is_none() {
            return 0.0;
        }
        let beyond = (self.judged.uncertainty.factor().powi(2) - 1.0).max(0.0);
        let sigmas = self
            .job
            .sets
            .iter()
            .flat_map(|set| (0..set.len()).filter_map(|row| set.length_sigma(row)));
        let (sum, count) = sigmas.fold((0.0, 0.0), |(sum, n), s| (sum + s * s, n + 1.0));
        if count > 0.0 {
            3.0 * beyond * sum / count
        } else {
            0.0
        }
    }

    /// What of a change of the tool is growth: with centred nominal points p, registered, and calibrated points q,
    /// s = Σ q·p / Σ p·p (Umeyama 1991). A free scale says nothing of it.
    fn grown(
        &self,
        robot: usize,
        columns: &[usize],
        nominal: &[Vector3<f64>],
        tips: &Tips,
        change: f64,
    ) -> Grown {
        let (a, b) = (mean(nominal), mean(&tips.estimated));
        let pairs = nominal.iter().zip(&tips.estimated);
        let along: f64 = pairs.map(|(p, q)| (p - a).dot(&(q - b))).sum();
        let square: f64 = nominal.iter().map(|p| (p - a).norm_squared()).sum();
        let factor = along / square;
        let explained = (factor - 1.0).powi(2) * square / nominal.len() as f64;
        let share = if change > 0.0 && !self.is_scale_free() {
            explained / change
        } else {
            0.0
        };
        Grown {
            factor,
            share,
            p_value: self.grown_by_chance(robot, columns),
        }
    }

    /// The probability that lengths which err on their own would follow their nominal values as these do: with changes δ
    /// and nominal lengths l, t = Σ δl √(n − 1) / √(Σ δ² Σ l² − (Σ δl)²) is Student's with n − 1 degrees of freedom.
    fn grown_by_chance(&self, robot: usize, columns: &[usize]) -> f64 {
        let chain = &self.job.arms[robot].robot;
        let base = chain.base_parameters();
        let (mut along, mut changes, mut lengths, mut n) = (0.0, 0.0, 0.0, 0.0);
        for column in columns {
            let Owner::Parameter { parameter, .. } = self.assembly.columns[*column].owner else {
                continue;
            };
            if chain.parameters()[parameter].unit() != Unit::Meter || base.contains(&parameter) {
                continue;
            }
            let length = chain.parameters()[parameter].nominal;
            let change = self.fitted.estimated.robots[robot][parameter] - length;
            along += change * length;
            changes += change * change;
            lengths += length * length;
            n += 1.0;
        }
        let Ok(student) = StudentsT::new(0.0, 1.0, n - 1.0) else {
            return 1.0;
        };
        let left = changes * lengths - along * along;
        if left <= 0.0 {
            return if along == 0.0 { 1.0 } else { 0.0 };
        }
        2.0 * student.sf((along * (n - 1.0_f64).sqrt() / left.sqrt()).abs())
    }
}

/// The jackknife's covariance of some columns: (K − 1)/K Σ δδᵀ over K clusters (Efron & Stein 1981).
fn scatter(left_out: &LeftOut, free: &[usize], columns: &[usize]) -> DMatrix<f64> {
    let clusters = left_out.shifts.len() as f64;
    let places: Vec<Option<usize>> = columns
        .iter()
        .map(|c| free.iter().position(|f| f == c))
        .collect();
    let mut covariance = DMatrix::zeros(columns.len(), columns.len());
    for shift in &left_out.shifts {
        let own = places.iter().map(|place| place.map_or(0.0, |k| shift[k]));
        let own = DVector::from_iterator(columns.len(), own);
        covariance.ger((clusters - 1.0) / clusters, &own, &own, 1.0);
    }
    covariance
}

/// The 95 % quantile of what is like χ²(n) and `expected` on average.
fn upper(expected: f64, n: f64) -> f64 {
    let quantile = |chi_square: ChiSquared| chi_square.inverse_cdf(0.95) / n;
    expected * ChiSquared::new(n).map_or(1.0, quantile)
}
