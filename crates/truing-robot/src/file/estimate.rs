//! The table `[estimate]` of a calibration file.

use std::ops::Range;

use crate::text::error::{one_of, suggest};
use crate::text::{InputError, Item, Quantity, Section, Spanned, Spans};

/// How far parameters may go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BoundSpec {
    /// At most so far from nominal, more than zero.
    Around(Quantity),
    /// From the first to the second, which is greater.
    Range(Quantity, Quantity),
}

/// How Jacobians are made.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum JacobianKind {
    /// By automatic differentiation of each frame and the chain rule.
    #[default]
    Auto,
    /// By the closed-form columns of a plugin.
    Analytic,
    /// By automatic differentiation of the whole chain.
    WholeChain,
    /// By central differences.
    Numeric,
}

impl JacobianKind {
    const NAMES: [(&str, Self); 4] = [
        ("auto", Self::Auto),
        ("analytic", Self::Analytic),
        ("whole-chain", Self::WholeChain),
        ("numeric", Self::Numeric),
    ];

    /// The name of the kind in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Analytic => "analytic",
            Self::WholeChain => "whole-chain",
            Self::Numeric => "numeric",
        }
    }
}

/// How the least-squares problem is solved.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum SolverKind {
    /// Levenberg–Marquardt.
    #[default]
    LevenbergMarquardt,
    /// Gauss–Newton.
    GaussNewton,
    /// Gauss–Newton with a line search.
    LineSearch,
    /// Powell's dogleg.
    Dogleg,
}

impl SolverKind {
    const NAMES: [(&str, Self); 4] = [
        ("levenberg-marquardt", Self::LevenbergMarquardt),
        ("gauss-newton", Self::GaussNewton),
        ("line-search", Self::LineSearch),
        ("dogleg", Self::Dogleg),
    ];

    /// The name of the kind in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::LevenbergMarquardt => "levenberg-marquardt",
            Self::GaussNewton => "gauss-newton",
            Self::LineSearch => "line-search",
            Self::Dogleg => "dogleg",
        }
    }
}

/// How the estimate starts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum StrategyKind {
    /// At nominal; by continuation where that is far off and fails.
    #[default]
    Auto,
    /// At nominal.
    Direct,
}

impl StrategyKind {
    const NAMES: [(&str, Self); 2] = [("auto", Self::Auto), ("direct", Self::Direct)];

    /// The name of the kind in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Direct => "direct",
        }
    }
}

/// What to estimate, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct EstimateSpec {
    /// Names and patterns of the parameters to estimate; "all" by default.
    pub parameters: Vec<Spanned<String>>,
    /// Names and patterns of the parameters not to estimate.
    pub fixed: Vec<Spanned<String>>,
    /// Bounds by name or pattern, in the order of the file.
    pub bounds: Vec<(Spanned<String>, BoundSpec)>,
    /// One standard deviation about nominal by name or pattern, more than zero, in that order.
    pub prior: Vec<(Spanned<String>, Quantity)>,
    /// How far robots may be from their drawings, as a part of their dimensions; none if `false` turned it off.
    pub drawing: Option<f64>,
    /// Names and patterns, kept first to eliminated first; empty for the default order.
    pub preference: Vec<Spanned<String>>,
    /// How Jacobians are made.
    pub jacobian: JacobianKind,
    /// How the problem is solved.
    pub solver: SolverKind,
    /// How the estimate starts.
    pub strategy: StrategyKind,
    /// The most iterations, one or more; the solver's own limit by default.
    pub max_iterations: Option<usize>,
    /// Where the table and the values of its keys are in the file.
    pub spans: Spans,
}

impl Default for EstimateSpec {
    fn default() -> Self {
        Self {
            parameters: vec![Spanned::new("all".to_owned(), 0..0)],
            fixed: Vec::new(),
            bounds: Vec::new(),
            prior: Vec::new(),
            drawing: Some(DRAWING),
            preference: Vec::new(),
            jacobian: JacobianKind::default(),
            solver: SolverKind::default(),
            strategy: StrategyKind::default(),
            max_iterations: None,
            spans: Spans::default(),
        }
    }
}

impl EstimateSpec {
    /// The place of the value of `key`, in bytes; that of the table if the key was left out.
    #[must_use]
    pub fn span_of(&self, key: &str) -> Range<usize> {
        self.spans.of(key)
    }

    pub(super) fn read(mut table: Section<'_>) -> Result<Self, InputError> {
        let spec = Self {
            parameters: match table.strings("parameters")? {
                Some(parameters) => parameters,
                None => vec![Spanned::new("all".to_owned(), table.span())],
            },
            fixed: table.strings("fixed")?.unwrap_or_default(),
            bounds: entries(&mut table, "bounds", bound)?,
            prior: entries(&mut table, "prior", |item| item.positive_quantity())?,
            drawing: drawing(&mut table)?,
            preference: table.strings("preference")?.unwrap_or_default(),
            jacobian: choice(&mut table, "jacobian", &JacobianKind::NAMES)?,
            solver: choice(&mut table, "solver", &SolverKind::NAMES)?,
            strategy: choice(&mut table, "strategy", &StrategyKind::NAMES)?,
            max_iterations: match table.get("max_iterations") {
                Some(item) => Some(at_least_one(&item)?),
                None => None,
            },
            spans: table.spans(),
        };
        table.finish()?;
        Ok(spec)
    }
}

/// The values of a table whose keys are names and patterns.
fn entries<T>(
    table: &mut Section<'_>,
    key: &str,
    read: impl Fn(&Item<'_>) -> Result<T, InputError>,
) -> Result<Vec<(Spanned<String>, T)>, InputError> {
    let Some(mut table) = table.table(key)? else {
        return Ok(Vec::new());
    };
    let entries = table.entries();
    let entries = entries.iter().map(|item| {
        let name = Spanned::new(item.name().to_owned(), item.key_span());
        Ok((name, read(item)?))
    });
    entries.collect()
}

fn bound(item: &Item<'_>) -> Result<BoundSpec, InputError> {
    if !item.is_list() {
        return Ok(BoundSpec::Around(item.positive_quantity()?));
    }
    let [lower, upper] = item.list_of("[lower, upper], or a distance from nominal")?;
    let (lower, upper) = (lower.quantity()?.value, upper.quantity()?.value);
    if let (Some(first), Some(second)) = (lower.dimension, upper.dimension)
        && first != second
    {
        let message = format!("found {first} and {second}; expected two of the same");
        let help = "write both bounds with a unit of the parameter";
        return Err(item.error(message).with_help(help));
    }
    if lower.value < upper.value {
        return Ok(BoundSpec::Range(lower, upper));
    }
    Err(item
        .error("the lower bound is not below the upper one; expected [lower, upper]")
        .with_help("swap the bounds; to hold a parameter, put it in `fixed`"))
}

fn choice<T: Copy + Default>(
    table: &mut Section<'_>,
    key: &str,
    choices: &[(&str, T)],
) -> Result<T, InputError> {
    let Some(item) = table.get(key) else {
        return Ok(T::default());
    };
    let name = item.string()?.value;
    let found = choices.iter().find(|(choice, _)| *choice == name);
    found.map(|&(_, value)| value).ok_or_else(|| {
        let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
        item.wrong_type(&one_of(&names))
            .with_help(suggest(&name, &names))
    })
}

fn drawing(table: &mut Section<'_>) -> Result<Option<f64>, InputError> {
    let Some(item) = table.get("drawing") else {
        return Ok(Some(DRAWING));
    };
    if matches!(item.boolean(), Ok(off) if !off.value) {
        return Ok(None);
    }
    match item.number() {
        Ok(part) if part.value > 0.0 && part.value <= 1.0 => Ok(Some(part.value)),
        _ => Err(item
            .wrong_type("a number above 0, at most 1, or false")
            .with_help("give how far a drawing may be off as a part of the robot's dimensions (0.01 by default); false holds nothing")),
    }
}

/// Drawings are off by a part of the robot's dimensions of this size, if nothing is said.
const DRAWING: f64 = 0.01;

fn at_least_one(item: &Item<'_>) -> Result<usize, InputError> {
    match item.integer()?.value {
        0 => Err(item
            .error("found 0; expected 1 or more")
            .with_help("leave it out for the solver's own limit")),
        number => Ok(number),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::CalibrationFile;
    use crate::text::Dimension;

    fn read(estimate: &str) -> Result<EstimateSpec, InputError> {
        let text = format!(
            "[robot]\nfile = 'r'\n[[constraint]]\nkind = 'pose'\ndata = 'd'\n[estimate]\n{estimate}"
        );
        CalibrationFile::parse(&text, "c.toml").map(|file| file.estimate)
    }

    #[test]
    fn everything_has_a_default() {
        let spec = read("").unwrap();
        assert_eq!(spec.parameters[0].value, "all");
        assert_eq!(spec.jacobian, JacobianKind::Auto);
        assert_eq!(spec.solver, SolverKind::LevenbergMarquardt);
        assert_eq!(spec.max_iterations, None);
    }

    #[test]
    fn bounds_and_priors_keep_the_order_of_the_file() {
        let spec = read(
            "parameters = ['theta*', 'd?']\nfixed = ['K*']\npreference = ['r1']\n\
             bounds = { 'theta*' = '2 deg', 'd*' = [-1, '5 mm'], a = 3 }\n\
             prior = { z = 1, 'd*' = '0.5 mm' }\n\
             jacobian = 'whole-chain'\nsolver = 'dogleg'\nmax_iterations = 7\n",
        )
        .unwrap();
        let names: Vec<&str> = spec
            .bounds
            .iter()
            .map(|(name, _)| name.value.as_str())
            .collect();
        assert_eq!(names, ["theta*", "d*", "a"]);
        let BoundSpec::Around(width) = spec.bounds[0].1 else {
            panic!("a width");
        };
        assert_eq!(width.dimension, Some(Dimension::Angle));
        assert_eq!(
            spec.bounds[1].1,
            BoundSpec::Range(Quantity::bare(-1.0), Quantity::parse("5 mm").unwrap())
        );
        assert_eq!(spec.prior[0].0.value, "z");
        assert_eq!(spec.jacobian, JacobianKind::WholeChain);
        assert_eq!(spec.solver, SolverKind::Dogleg);
        assert_eq!(spec.max_iterations, Some(7));
        assert_ne!(spec.span_of("jacobian"), spec.span_of("solver"));
    }

    #[test]
    fn mistakes_are_located_and_explained() {
        for (text, words) in [
            ("parameters = 'all'", "expected a list"),
            ("parameters = ['']", "empty text"),
            ("fixed = [1]", "expected a text"),
            ("bounds = { x = 0 }", "more than 0"),
            ("bounds = { x = '-1 mm' }", "more than 0"),
            ("bounds = { x = nan }", "finite"),
            ("bounds = { x = [1] }", "list of 1"),
            ("bounds = { x = [2, 1] }", "lower bound"),
            ("bounds = { x = [1, 1] }", "lower bound"),
            (
                "bounds = { x = ['1 mm', '2 deg'] }",
                "a length and an angle",
            ),
            ("prior = { x = 'a' }", "not a number"),
            ("prior = { x = [1, 2] }", "expected a number"),
            ("prior = 3", "expected a table"),
            ("jacobian = 'numerical'", "`whole-chain` or `numeric`"),
            ("solver = 'lm'", "`levenberg-marquardt`"),
            ("solver = 1", "the integer 1"),
            ("max_iterations = 0", "1 or more"),
            ("max_iterations = 1.5", "an integer"),
            ("bound = {}", "unknown key `bound` in [estimate]"),
        ] {
            let error = read(text).unwrap_err();
            assert_eq!(error.line, Some(7), "{text}: {error}");
            assert!(error.message.contains(words), "{text}: {error}");
        }
    }
}
