//! Parameters by the names that files use, with places in errors.

use crate::robot::{Arm, Unit, names};
use crate::text::{Dimension, InputError, Quantity, Source, Spanned};
use std::ops::Range;

/// All parameters of all robots by the names a file can use.
pub struct Names<'a> {
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
        names::find(self.arms, &text.value).map_err(|unknown| {
            self.source
                .error_at(text.span.clone(), unknown.message)
                .with_help(unknown.help)
        })
    }

    /// The full names of what a name, pattern or word means.
    pub fn full(&self, text: &Spanned<String>) -> Result<Vec<String>, InputError> {
        let found = self.find(text)?;
        let name = |(r, p): (usize, usize)| self.arms[r].parameter_name(p);
        Ok(found.into_iter().map(name).collect())
    }
}

/// A quantity in the unit of a parameter [m, rad or 1].
pub fn in_unit_of(
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
pub fn dimension_of(unit: Unit) -> Dimension {
    match unit {
        Unit::Radian => Dimension::Angle,
        Unit::Meter => Dimension::Length,
        Unit::One | Unit::Other(_) => Dimension::None,
    }
}

/// A number to six places, without zeros at the end.
pub fn plain(x: f64) -> String {
    let text = format!("{x:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0" } else { text }.to_owned()
}
