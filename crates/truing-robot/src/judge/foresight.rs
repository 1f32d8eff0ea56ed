//! How far off a calibrated tool may be at postures that nobody measured, beside the nominal one.

use super::errors::Fitted;
use super::leave_out::LeaveOut;
use super::misfit::CERTAIN;
use super::tips::{motions, tips, without};
use super::uncertainty::Judged;
use crate::estimate::Job;
use crate::identify::Choice;
use crate::measurement::fit::rigid_registration;
use crate::model::{Assembly, Owner};
use crate::robot::{Unit, posture};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ContinuousCDF, StudentsT};
use truing::nalgebra::{DMatrix, DVector, Vector3};
use truing::statistics::ChiSquareTest;

/// The tool of one robot at postures all over its joints' ranges, up to a rigid motion (and the scale, if that is
/// free, and the place of a tool point that was estimated).
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
    /// Whether the measurements do not fit, and leave the scale free: they see a part of the tool only.
    pub blind: bool,
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
    /// Whether residuals are larger than the noise all the same.
    pub misfit: bool,
    /// Probability that lengths that err on their own look as if all had grown.
    pub p_value: f64,
}

impl Foresight {
    /// RMS error of the nominal tool to be expected \[m\]: it is off from the truth by what changed, and by the error of the estimate.
    pub fn nominal(&self) -> f64 {
        self.change.hypot(self.expected)
    }
}

impl Job {
    /// The expected error of every robot with estimated parameters.
    ///
    /// With G the derivatives of tool points by the estimated parameters, C their covariance, P the projection that takes
    /// rigid motions out and M = GᵀPG, the calibrated tools are off by T = trace(M C). The calibration changed them by
    /// D = δᵀMδ. With δ as the estimate and an error e of covariance C, the nominal tools are farther off than the
    /// calibrated ones by D + 2 δᵀM e: D, known up to √(4 δᵀM C M δ). Priors of the size that the errors have make this
    /// so: without them an estimate is as far from nominal as noise drives it.
    pub fn foresee(
        &self,
        fitted: &Fitted,
        assembly: &Assembly,
        choices: &[Choice],
        judged: &Judged,
        left_out: &[LeaveOut],
        place: Place,
    ) -> Vec<Foresight> {
        let uncertainty = &judged.uncertainty;
        let scaled = choices.iter().any(|c| matches!(c, Choice::Anchor(_)));
        let factor = uncertainty.factor();
        let freedom = uncertainty.degrees_of_freedom;
        let misfit = ChiSquareTest::new(judged.squares, freedom)
            .is_some_and(|test| freedom >= 1.0 && test.p_too_large < CERTAIN);
        let noise = if misfit {
            (factor * factor - 1.0).max(0.0)
        } else {
            0.0
        };
        let mut all = Vec::new();
        for (robot, arm) in self.arms.iter().enumerate() {
            let own = |c: &usize| matches!(&assembly.columns[*c].owner, Owner::Parameter { robot: r, .. } if *r == robot);
            let columns: Vec<usize> = (0..choices.len())
                .filter(|c| choices[*c] == Choice::Estimated)
                .filter(own)
                .collect();
            if columns.is_empty() {
                continue;
            }
            let target = (self.sets.iter().flat_map(|set| &set.tools))
                .find(|tool| tool.robot == robot)
                .and_then(|tool| tool.target.as_ref());
            let postures = match place {
                Place::Everywhere => {
                    let limits = posture::limits(&arm.robot);
                    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
                    (0..POSTURES)
                        .map(|_| posture::random(&limits, &mut rng))
                        .collect()
                }
                Place::Measured => {
                    let own = self.sets.iter().flat_map(|set| &set.tools);
                    let rows = own
                        .filter(|tool| tool.robot == robot)
                        .flat_map(|tool| &tool.q);
                    let rows: Vec<Vec<f64>> = rows.cloned().collect();
                    let every = rows.len().div_ceil(MOST).max(1);
                    rows.into_iter().step_by(every).collect::<Vec<_>>()
                }
            };
            if postures.len() < 3 {
                continue;
            }
            let tips = tips(
                &arm.robot, &postures, target, fitted, assembly, &columns, robot,
            );
            let motions = motions(&tips, scaled);
            let g = without(&motions, &tips.derivatives);
            let points = tips.estimated.len() as f64;
            let m = g.tr_mul(&g) / points;
            // Leaving clusters out: what the data say themselves of how sure they are, whatever is wrong with them.
            let shifted = |left_out: &LeaveOut| {
                let clusters = left_out.clusters.len() as f64;
                let places: Vec<Option<usize>> = columns
                    .iter()
                    .map(|c| left_out.free.iter().position(|f| f == c))
                    .collect();
                let mut covariance = DMatrix::zeros(columns.len(), columns.len());
                for cluster in &left_out.clusters {
                    let shift = DVector::from_iterator(
                        columns.len(),
                        places
                            .iter()
                            .map(|place| place.map_or(0.0, |k| cluster.shift[k])),
                    );
                    covariance += &shift * shift.transpose() * ((clusters - 1.0) / clusters);
                }
                covariance
            };
            let moments = |c: &DMatrix<f64>| {
                let mc = &m * c;
                (mc.trace(), (&mc * &mc).trace())
            };
            let stated = DMatrix::from_fn(columns.len(), columns.len(), |i, k| {
                uncertainty.covariance.entry(columns[i], columns[k]) * factor * factor
            });
            let c = (left_out.iter().map(shifted)).fold(stated, |c, other| {
                if moments(&other).0 > moments(&c).0 {
                    other
                } else {
                    c
                }
            });
            // Systematic errors do not average, and what does not see the whole tool shows a part of them.
            let systematic = (1.0 - 1.0 / (factor * factor)).max(0.0);
            let c = if scaled && misfit && place == Place::Everywhere {
                c * (1.0 + (PARTLY * PARTLY - 1.0) * systematic)
            } else {
                c
            };
            let (error, spread) = moments(&c);

            // Registered first: what is left is small enough for the projection.
            let sigmas = self
                .sets
                .iter()
                .flat_map(|set| (0..set.len()).filter_map(|row| set.length_sigma(row)));
            let (sum, count) = sigmas.fold((0.0, 0.0), |(sum, n), s| (sum + s * s, n + 1.0));
            let unmodelled = if count > 0.0 {
                3.0 * noise * sum / count
            } else {
                0.0
            };
            let motion = rigid_registration(&tips.nominal, &tips.estimated);
            let moved: Vec<f64> = (tips.nominal.iter().zip(&tips.estimated))
                .flat_map(|(n, t)| {
                    let moved = t - motion.apply(n);
                    [moved.x, moved.y, moved.z]
                })
                .collect();
            let moved = without(&motions, &DMatrix::from_vec(moved.len(), 1, moved));
            let change = moved.norm_squared() / points;
            let pull = g.tr_mul(&moved) / points;
            let along = (pull.transpose() * &c * &pull)[(0, 0)];
            let scatter = (4.0 * along).max(0.0).sqrt();
            let freedom = 2.0 * error * error / (2.0 * spread).max(f64::MIN_POSITIVE);
            let (factor, share) = growth(&tips.nominal, &tips.estimated, change);
            let grown = Grown {
                factor,
                misfit,
                share: if scaled { 0.0 } else { share },
                p_value: self.grown_by_chance(robot, &columns, fitted, assembly),
            };
            all.push(Foresight {
                // Bounds say what the covariance does not.
                blind: scaled && misfit && self.estimate.bounds.is_empty(),
                grown,
                robot,
                expected: error.max(0.0).sqrt(),
                bound: (error * quantile(freedom) + unmodelled).max(0.0).sqrt(),
                change: change.sqrt(),
                gain: if scatter > 0.0 { change / scatter } else { 0.0 },
            });
        }
        all
    }
}

impl Job {
    /// The probability that lengths which err on their own would follow their nominal values as these do: with changes δ
    /// and nominal lengths l, t = Σ δl √(n − 1) / √(Σ δ² Σ l² − (Σ δl)²) is Student's with n − 1 degrees of freedom.
    fn grown_by_chance(
        &self,
        robot: usize,
        columns: &[usize],
        fitted: &Fitted,
        assembly: &Assembly,
    ) -> f64 {
        let parameters = self.arms[robot].robot.parameters();
        let base = self.arms[robot].robot.base_parameters();
        let (mut along, mut changes, mut lengths, mut n) = (0.0, 0.0, 0.0, 0.0);
        for column in columns {
            let Owner::Parameter { parameter, .. } = assembly.columns[*column].owner else {
                continue;
            };
            if parameters[parameter].unit() != Unit::Meter || base.contains(&parameter) {
                continue;
            }
            let length = parameters[parameter].nominal;
            let change = fitted.estimated.robots[robot][parameter] - length;
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
        let t = along * (n - 1.0_f64).sqrt() / left.sqrt();
        2.0 * student.sf(t.abs())
    }
}

/// The 95 % quantile of χ²(n)/n, by Wilson and Hilferty (1931).
fn quantile(n: f64) -> f64 {
    const Z: f64 = 1.6449;
    let a = 2.0 / (9.0 * n.max(1.0));
    (1.0 - a + Z * a.sqrt()).powi(3)
}

/// The growth that brings registered points nearest to others, and the part of the mean squared distance `change`
/// that it explains: with centred points p and q, s = Σ q·p / Σ p·p (Umeyama 1991).
fn growth(from: &[Vector3<f64>], to: &[Vector3<f64>], change: f64) -> (f64, f64) {
    let motion = rigid_registration(from, to);
    let n = from.len() as f64;
    let moved: Vec<Vector3<f64>> = from.iter().map(|p| motion.apply(p)).collect();
    let middle = |p: &[Vector3<f64>]| p.iter().sum::<Vector3<f64>>() / p.len() as f64;
    let (a, b) = (middle(&moved), middle(to));
    let along: f64 = moved
        .iter()
        .zip(to)
        .map(|(p, q)| (p - a).dot(&(q - b)))
        .sum();
    let square: f64 = moved.iter().map(|p| (p - a).norm_squared()).sum();
    let factor = along / square;
    let explained = (factor - 1.0).powi(2) * square / n;
    (
        factor,
        if change > 0.0 {
            explained / change
        } else {
            0.0
        },
    )
}

/// Systematic errors of which measurements show a part are so many times as large as these look.
const PARTLY: f64 = 3.0;

/// So many postures show where a tool is known.
const POSTURES: usize = 150;

/// So many postures of the sets, at most.
const MOST: usize = 500;

/// Any would do; the same postures in every run.
const SEED: u64 = 11;
