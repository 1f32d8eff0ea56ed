//! What to estimate, from the table of a file.

use super::names::{Names, in_unit_of, plain};
use crate::estimate::{Estimate, Strategy};
use crate::file::{BoundSpec, EstimateSpec, JacobianKind, SolverKind, StrategyKind};
use crate::plugin::Registry;
use crate::robot::{Arm, Derivatives, Unit};
use crate::text::{InputError, Quantity, Source, Spanned};
use std::collections::BTreeMap;
use std::ops::Range;
use truing::{Method, Settings, Tolerances};

/// What to estimate, and how, by the names of the robots' parameters; `file` for the places of errors.
pub fn estimate(
    spec: &EstimateSpec,
    file: &Source,
    arms: &[Arm],
    registry: &Registry,
) -> Result<Estimate, InputError> {
    let names = Names { source: file, arms };
    let full = |texts: &[Spanned<String>]| -> Result<Vec<String>, InputError> {
        let each = texts.iter().map(|text| names.full(text));
        Ok(each.collect::<Result<Vec<_>, _>>()?.concat())
    };
    let name = |(r, p): (usize, usize)| arms[r].parameter_name(p);
    let in_unit = |quantity: Quantity, key: (usize, usize), span: &Range<usize>| {
        in_unit_of(arms, key, quantity, file, span)
    };
    let mut bounds = BTreeMap::new();
    for (text, bound) in &spec.bounds {
        let example = match bound {
            BoundSpec::Around(width) => *width,
            BoundSpec::Range(lower, _) => *lower,
        };
        for key in names.find_like(text, example)? {
            let nominal = arms[key.0].robot.parameters()[key.1].nominal;
            let (lower, upper) = match bound {
                BoundSpec::Around(width) => {
                    let width = in_unit(*width, key, &text.span)?;
                    (-width, width)
                }
                BoundSpec::Range(lower, upper) => (
                    in_unit(*lower, key, &text.span)? - nominal,
                    in_unit(*upper, key, &text.span)? - nominal,
                ),
            };
            // A bound at the nominal value may miss it by the rounding of its unit.
            let rounding = 4.0 * f64::EPSILON * nominal.abs();
            if !(lower <= rounding && upper >= -rounding) {
                let (factor, symbol) = match arms[key.0].robot.parameters()[key.1].unit() {
                    Unit::Radian => (1f64.to_degrees(), " deg"),
                    Unit::Meter => (1e3, " mm"),
                    Unit::One | Unit::Other(_) => (1.0, ""),
                };
                let shown = |x: f64| plain(x * factor);
                let message = format!(
                    "the bounds [{}, {}]{symbol} exclude the nominal value {}{symbol} of {}",
                    shown(lower + nominal),
                    shown(upper + nominal),
                    shown(nominal),
                    arms[key.0].parameter_name(key.1)
                );
                return Err(file.error_at(text.span.clone(), message).with_help(
                    "widen the bounds, or give a distance from nominal, like \"5 mm\"",
                ));
            }
            bounds.insert(key, (lower.min(0.0), upper.max(0.0)));
        }
    }
    let mut priors = BTreeMap::new();
    for (text, sigma) in &spec.prior {
        for key in names.find_like(text, *sigma)? {
            priors.insert(key, in_unit(*sigma, key, &text.span)?);
        }
    }
    let derivatives = match spec.jacobian {
        JacobianKind::Auto => Derivatives::default(),
        JacobianKind::WholeChain => Derivatives::WholeChain,
        JacobianKind::Numeric => Derivatives::Numeric,
        JacobianKind::Analytic => match registry.analytic() {
            Some(columns) => Derivatives::Regressor(columns.clone()),
            None => {
                return Err(file
                        .error_at(spec.spans.of("jacobian"), "no plugin has an analytic Jacobian")
                        .with_help("use \"auto\" (frame-wise automatic differentiation), \"whole-chain\" or \"numeric\""));
            }
        },
    };
    let method = match spec.solver {
        SolverKind::LevenbergMarquardt => Method::LevenbergMarquardt,
        SolverKind::GaussNewton => Method::GaussNewton,
        SolverKind::LineSearch => Method::LineSearch,
        SolverKind::Dogleg => Method::Dogleg,
    };
    let mut tolerances = Tolerances::default();
    if let Some(limit) = spec.max_iterations {
        tolerances.max_iterations = limit as u64;
    }
    Ok(Estimate {
        parameters: full(&spec.parameters)?,
        fixed: full(&spec.fixed)?,
        bounds: bounds
            .into_iter()
            .map(|(key, (l, u))| (name(key), l, u))
            .collect(),
        priors: priors.into_iter().map(|(key, s)| (name(key), s)).collect(),
        drawing: spec.drawing,
        preference: full(&spec.preference)?,
        derivatives,
        from: None,
        strategy: match spec.strategy {
            StrategyKind::Auto => Strategy::Auto,
            StrategyKind::Direct => Strategy::Direct,
        },
        settings: Settings {
            method,
            tolerances,
            ..Settings::default()
        },
    })
}
