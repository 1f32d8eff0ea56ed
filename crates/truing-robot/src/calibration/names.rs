//! Parameters by the names that files use.

use super::measurement::Arm;
use crate::file::{Dimension, InputError, Pattern, Quantity, Source, Spanned, nearest};
use crate::kinematics::{ParameterKind, Unit};
use std::ops::Range;

/// All parameters of all robots by the names a calibration file can use.
pub(crate) struct Names<'a> {
    pub source: &'a Source,
    pub arms: &'a [Arm],
}

impl Names<'_> {
    /// The parameters that a name, pattern or word means and whose unit the quantity has: `"a*"`
    /// with a length means the lengths `a2`, `a3`, … and not the angles `alpha2`, `alpha3`, …. If
    /// none has it, all that are meant, for the error to name one.
    pub fn find_like(
        &self,
        text: &Spanned<String>,
        quantity: Quantity,
    ) -> Result<Vec<(usize, usize)>, InputError> {
        let found = self.find(text)?;
        let alike = |(r, p): &(usize, usize)| {
            quantity.dimension.is_none_or(|dimension| {
                dimension == dimension_of(self.arms[*r].robot.parameters()[*p].unit())
            })
        };
        let like: Vec<(usize, usize)> = found.iter().copied().filter(alike).collect();
        Ok(if like.is_empty() { found } else { like })
    }

    /// The parameters that a name, pattern or word means, in their order.
    pub fn find(&self, text: &Spanned<String>) -> Result<Vec<(usize, usize)>, InputError> {
        let all: Vec<(usize, usize)> = self
            .arms
            .iter()
            .enumerate()
            .flat_map(|(r, arm)| (0..arm.robot.parameters().len()).map(move |p| (r, p)))
            .collect();
        let (prefix, word) = match text.value.split_once('.') {
            Some((prefix, word)) if self.arms.iter().any(|arm| arm.name == prefix) => {
                (Some(prefix), word)
            }
            _ => (None, text.value.as_str()),
        };
        let of_arm =
            |(r, _): &(usize, usize)| prefix.is_none_or(|prefix| self.arms[*r].name == prefix);
        let means = |(r, p): &(usize, usize)| {
            let robot = &self.arms[*r].robot;
            match word {
                "all" => true,
                "base" => robot.base_parameters().contains(p),
                "tool" => robot.tool_parameters().contains(p),
                "gains" => robot.parameters()[*p].kind == ParameterKind::Gain,
                _ => {
                    let pattern = Pattern::new(word);
                    pattern.matches(&robot.parameters()[*p].name)
                }
            }
        };
        let found: Vec<(usize, usize)> = all
            .iter()
            .copied()
            .filter(|k| of_arm(k) && means(k))
            .collect();
        if !found.is_empty() {
            return Ok(found);
        }
        let full: Vec<String> = all
            .iter()
            .map(|(r, p)| self.arms[*r].parameter_name(*p))
            .collect();
        let words = ["all", "base", "tool", "gains"];
        let candidates: Vec<&str> = full.iter().map(String::as_str).chain(words).collect();
        let help = match nearest(&text.value, candidates.iter().copied()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!(
                "there are {}, and the words {}",
                listed(&full),
                words.join(", ")
            ),
        };
        let what = if Pattern::new(text.value.as_str()).is_name() {
            "parameter has the name"
        } else {
            "parameter matches"
        };
        Err(self
            .source
            .error_at(text.span.clone(), format!("no {what} `{}`", text.value))
            .with_help(help))
    }
}

/// A quantity in the unit of a parameter [m, rad or 1].
pub(crate) fn in_unit_of(
    arms: &[Arm],
    (robot, parameter): (usize, usize),
    quantity: Quantity,
    source: &Source,
    span: &Range<usize>,
) -> Result<f64, InputError> {
    let dimension = dimension_of(arms[robot].robot.parameters()[parameter].unit());
    quantity
        .expect(dimension)
        .map_err(|e| e.at(source, span.clone(), &arms[robot].parameter_name(parameter)))
}

/// The dimension of a unit.
pub(crate) fn dimension_of(unit: Unit) -> Dimension {
    match unit {
        Unit::Radian => Dimension::Angle,
        Unit::Meter => Dimension::Length,
        Unit::One => Dimension::None,
    }
}

/// A number to six places, without zeros at the end.
pub(crate) fn plain(x: f64) -> String {
    let text = format!("{x:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0" } else { text }.to_owned()
}

/// A list of names, shortened where it is long.
pub(crate) fn listed(names: &[String]) -> String {
    let shown: Vec<&str> = names.iter().take(12).map(String::as_str).collect();
    let more = if names.len() > shown.len() {
        format!(", … ({} in all)", names.len())
    } else {
        String::new()
    };
    format!("{}{more}", shown.join(", "))
}
