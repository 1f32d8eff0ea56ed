//! What the residuals say of the fit, of single measurements and of the tool.

use super::figures::{
    Correlated, ErrorSeries, GlobalTest, MeasurementStatistics, Outlier, ToolUncertainty,
};
use super::uncertainty::Judged;
use crate::estimate::Job;
use crate::identify::Choice;
use crate::measurement::MeasurementSet;
use truing::Loss;
use truing::nalgebra::Vector3;
use truing::statistics::{ChiSquareTest, Verdict};

/// Level of the global test, and of the search for outliers over all measurements together.
pub(super) const LEVEL: f64 = 0.05;

/// Correlations beyond this are reported.
const STRONG: f64 = 0.9;

/// What is held moves the tool if this part of its effect is left where others have taken it over. They
/// do so at the start; at the solution a part of the size of the robot's errors is always left.
const MOVED: f64 = 0.1;

/// So many postures of a set show that.
const ENOUGH: usize = 20;

/// Residuals so many times smaller than the stated noise are rounding, and so are tools that move by less
/// reaches for a parameter that moves by 1.
const ROUNDING: f64 = 1e-6;

/// Everything that is said of a calibration beyond the standard deviations.
pub(crate) struct Statistics {
    pub test: GlobalTest,
    pub correlations: Vec<Correlated>,
    pub tools: Vec<ToolUncertainty>,
    pub measurements: Vec<MeasurementStatistics>,
}

impl Job {
    /// The statistics of a judged fit; `errors` of the sets come first in order.
    pub fn statistics(
        &self,
        judged: &Judged,
        choices: &[Choice],
        errors: &[ErrorSeries],
    ) -> Statistics {
        let measurements = self.measurement_statistics(judged, errors);
        Statistics {
            test: self.global_test(judged),
            correlations: correlations(judged),
            tools: self.tools(judged, choices, &measurements),
            measurements,
        }
    }

    fn global_test(&self, judged: &Judged) -> GlobalTest {
        let uncertainty = &judged.uncertainty;
        let freedom = uncertainty.degrees_of_freedom;
        let robust = self.is_robust();
        // Without redundancy degrees of freedom are rounding.
        let test = ChiSquareTest::new(judged.squares, freedom).filter(|_| freedom > 1e-9);
        let test = test.filter(|_| !robust);
        let mut caveats = Vec::new();
        if robust {
            caveats.push(
                "a robust loss limits what outliers cost: the sum of squares is not χ², and σ₀ is Huber's factor"
                    .to_owned(),
            );
        }
        if !self.estimate.priors.is_empty() {
            caveats.push(
                "priors take a share of the unknowns, so the degrees of freedom are estimated; the test is of the \
                 measurements alone"
                    .to_owned(),
            );
        }
        GlobalTest {
            sigma0: Some(uncertainty.sigma0).filter(|s| s.is_finite()),
            degrees_of_freedom: freedom,
            chi_square: test.map(|test| test.statistic),
            p_value: test.map(|test| test.p_value()),
            p_too_large: test.map(|test| test.p_too_large),
            p_too_small: test.map(|test| test.p_too_small),
            level: LEVEL,
            verdict: test.map(|test| match test.verdict(LEVEL) {
                Verdict::AsExpected => "as-expected",
                Verdict::TooLarge => "too-large",
                Verdict::TooSmall => "too-small",
            }),
            caveats,
        }
    }

    /// Every measurement that was used, set after set.
    fn measurement_statistics(
        &self,
        judged: &Judged,
        errors: &[ErrorSeries],
    ) -> Vec<MeasurementStatistics> {
        let mut all = Vec::new();
        let mut first = 0;
        let blocks = judged.assembly.problem.blocks();
        for (k, ((set, errors), block)) in self.sets.iter().zip(errors).zip(blocks).enumerate() {
            let own = &judged.residuals.constraints[first..first + block.len()];
            first += block.len();
            for (row, error) in errors.calibrated.iter().enumerate() {
                // Equations of a form that eliminates unknowns are about several measurements each.
                let residual = (block.len() == set.len()).then(|| &own[row]);
                let finite = |x: f64| Some(x).filter(|x| x.is_finite());
                let (file, line) = place(set, row);
                all.push(MeasurementStatistics {
                    constraint: set.name.clone(),
                    file,
                    line,
                    row: set.origin.as_ref().map_or(row, |origin| origin.rows[row]),
                    set: k,
                    item: row,
                    robot: set.tool().robot,
                    values: set.dim(),
                    error: *error,
                    standardised: residual.and_then(|r| finite(r.standardised())),
                    p_value: residual.and_then(|r| finite(r.p_value)),
                    leverage: residual.map(|r| r.leverage),
                    cook: residual.and_then(|r| finite(r.cook)),
                    tool_sigma: judged
                        .uncertainty
                        .tool_pose(
                            set.tool().robot,
                            &set.q()[row],
                            set.tool().target.as_deref(),
                            set.frame.as_deref(),
                        )
                        .ok()
                        .and_then(|tool| finite(tool.position_sigma())),
                });
            }
        }
        all
    }

    /// The tool of every robot that measured.
    fn tools(
        &self,
        judged: &Judged,
        choices: &[Choice],
        measurements: &[MeasurementStatistics],
    ) -> Vec<ToolUncertainty> {
        let mut tools = Vec::new();
        for (robot, arm) in self.arms.iter().enumerate() {
            let known = || {
                let own = measurements.iter().filter(move |m| m.robot == robot);
                own.filter_map(|m| Some((m, m.tool_sigma?)))
            };
            let worst = known().max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((worst, sigma)) = worst.filter(|(_, sigma)| *sigma > 0.0) else {
                continue;
            };
            let count = known().count();
            let squares: f64 = known().map(|(_, sigma)| sigma * sigma).sum();
            tools.push(ToolUncertainty {
                robot: arm.name.clone(),
                count,
                rms: (squares / count as f64).sqrt(),
                worst: sigma,
                given_held: self.given_held(robot, judged, choices),
                constraint: worst.constraint.clone(),
                file: worst.file.clone(),
                line: worst.line,
                row: worst.row,
            });
        }
        tools
    }
}

impl Job {
    /// Whether parameters of a robot are held that move its tool where it was measured, and that nothing
    /// measured: where its base stands, when what was touched moves along; the scale.
    ///
    /// A column c that columns b take over with coefficients w does nothing to the measurements if it moves
    /// by 1 and they by −w. If the tool stays where it is too, what it was held at makes no difference.
    fn given_held(&self, robot: usize, judged: &Judged, choices: &[Choice]) -> bool {
        let first = judged.assembly.robot(robot).column();
        let parameters = first..first + self.arms[robot].robot.parameters().len();
        let nothing = Vec::new();
        let reach = self.reach();
        let moves_the_tool = |set: &MeasurementSet, column: usize| {
            let into = match &choices[column] {
                Choice::Regrouped(into) | Choice::Anchor(into) => into,
                Choice::NoEffect => &nothing,
                _ => return false,
            };
            let (mut own, mut left) = (0.0, 0.0);
            for q in set.q().iter().step_by(set.len().div_ceil(ENOUGH).max(1)) {
                let (target, frame) = (set.tool().target.as_deref(), set.frame.as_deref());
                let Ok(motion) = judged.uncertainty.tool_motion(robot, q, target, frame) else {
                    return false;
                };
                let velocity = |column: usize| {
                    let place = motion.columns.iter().position(|c| *c == column);
                    place.map_or_else(Vector3::zeros, |k| {
                        motion.derivatives.fixed_view::<3, 1>(0, k).into_owned()
                    })
                };
                let taken: Vector3<f64> = into.iter().map(|(b, w)| velocity(*b) * *w).sum();
                own += velocity(column).norm_squared();
                left += (velocity(column) - taken).norm_squared();
            }
            left > MOVED * MOVED * own && left.sqrt() > ROUNDING * reach
        };
        let sets = self.sets.iter().filter(|set| set.tool().robot == robot);
        let mut sets = sets;
        sets.any(|set| parameters.clone().any(|column| moves_the_tool(set, column)))
    }
}

/// File name and line of a measurement.
pub fn place(set: &MeasurementSet, row: usize) -> (Option<String>, Option<usize>) {
    let Some(origin) = &set.origin else {
        return (None, None);
    };
    let file = (origin.path.file_name()).map(|name| name.to_string_lossy().into_owned());
    (file, origin.lines.get(row).copied())
}

fn correlations(judged: &Judged) -> Vec<Correlated> {
    let strong = judged
        .uncertainty
        .covariance
        .strongest_correlations(&judged.assembly.problem, STRONG);
    let columns = &judged.assembly.columns;
    strong
        .into_iter()
        .map(|pair| Correlated {
            a: columns[pair.columns.0].name.clone(),
            b: columns[pair.columns.1].name.clone(),
            coefficient: pair.coefficient,
        })
        .collect()
}

/// Those of measurements without a robust loss that are farther off than the worst of so many is by
/// chance; none where data without noise leave nothing but rounding.
pub fn beyond_chance(
    sets: &[MeasurementSet],
    measurements: &[MeasurementStatistics],
    noise: f64,
) -> Vec<Outlier> {
    if noise.is_nan() || noise <= ROUNDING {
        return Vec::new();
    }
    let plain = |m: &&MeasurementStatistics| sets[m.set].loss == Loss::Trivial;
    let judged = || measurements.iter().filter_map(|m| Some((m, m.p_value?)));
    let limit = LEVEL / judged().count().max(1) as f64;
    let outlier = |(m, p_value): (&MeasurementStatistics, f64)| Outlier {
        constraint: m.constraint.clone(),
        file: m.file.clone(),
        line: m.line,
        row: m.row,
        error: m.error,
        standardised: m.standardised,
        p_value: Some(p_value),
        weight: None,
    };
    judged()
        .filter(|(m, p)| *p < limit && plain(m))
        .map(outlier)
        .collect()
}
