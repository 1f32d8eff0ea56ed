//! Numbers with units: "0.1 mm", "2 deg"; everything inside is in metres and radians.

use std::f64::consts::PI;
use std::fmt;

use super::error::{ValueError, nearest, one_of, short};

/// What a number measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Dimension {
    /// A length \[m\].
    Length,
    /// An angle \[rad\].
    Angle,
    /// A pure number.
    None,
}

impl Dimension {
    /// An example of a value with a unit of this dimension, for messages.
    fn example(self) -> &'static str {
        match self {
            Self::Length => "\"0.1 mm\"",
            Self::Angle => "\"0.5 deg\"",
            Self::None => "1.5",
        }
    }
}

impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Length => "a length",
            Self::Angle => "an angle",
            Self::None => "a number without a unit",
        })
    }
}

/// The names of the units, the names shown first, with their size in m or rad.
const UNITS: [(&str, Dimension, f64); 17] = [
    ("m", Dimension::Length, 1.0),
    ("cm", Dimension::Length, 1e-2),
    ("mm", Dimension::Length, 1e-3),
    ("um", Dimension::Length, 1e-6),
    ("in", Dimension::Length, 0.0254),
    ("rad", Dimension::Angle, 1.0),
    ("mrad", Dimension::Angle, 1e-3),
    ("urad", Dimension::Angle, 1e-6),
    ("deg", Dimension::Angle, PI / 180.0),
    ("arcmin", Dimension::Angle, PI / 10_800.0),
    ("arcsec", Dimension::Angle, PI / 648_000.0),
    // Other spellings. The micro sign and the Greek letter are different characters.
    ("\u{b5}m", Dimension::Length, 1e-6),
    ("\u{3bc}m", Dimension::Length, 1e-6),
    ("inch", Dimension::Length, 0.0254),
    ("\u{b5}rad", Dimension::Angle, 1e-6),
    ("\u{3bc}rad", Dimension::Angle, 1e-6),
    ("\u{b0}", Dimension::Angle, PI / 180.0),
];

/// How many of `UNITS` are listed in messages.
const SHOWN: usize = 11;

/// A unit by its name: what it measures and its size in m or rad.
pub(crate) fn unit(name: &str) -> Result<(Dimension, f64), ValueError> {
    if let Some(&(_, dimension, factor)) = UNITS.iter().find(|unit| unit.0 == name) {
        return Ok((dimension, factor));
    }
    let shown: Vec<&str> = UNITS[..SHOWN].iter().map(|unit| unit.0).collect();
    let error = ValueError::new(format!(
        "`{}` is not a unit; expected {}",
        short(name),
        one_of(&shown)
    ));
    Err(match nearest(name, shown.iter().copied()) {
        Some(near) => error.with_help(format!("did you mean `{near}`?")),
        None => error.with_help("convert the value to one of these units"),
    })
}

/// A finite number, perhaps with a unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// The value, in m or rad where a unit was given, else as it was written.
    pub value: f64,
    /// What it measures; `None` for a bare number, which may measure anything.
    pub dimension: Option<Dimension>,
}

impl Quantity {
    /// A bare number.
    #[must_use]
    pub fn bare(value: f64) -> Self {
        Self {
            value,
            dimension: None,
        }
    }

    /// Parses "0.1 mm", "2deg" or "3e-4".
    ///
    /// # Errors
    ///
    /// The text is not a finite number, or its unit does not exist.
    pub fn parse(text: &str) -> Result<Self, ValueError> {
        let text = text.trim();
        let end = text
            .rfind(|c: char| c.is_ascii_digit() || c == '.')
            .map_or(0, |last| last + 1);
        let (number, name) = (text[..end].trim(), text[end..].trim());
        let Ok(value) = number.parse::<f64>() else {
            let error = ValueError::new(format!(
                "`{}` is not a number with a unit, like \"0.1 mm\"",
                short(text)
            ));
            return Err(if number.contains(',') {
                error.with_help("write a decimal point, not a comma")
            } else {
                error.with_help("write a number, then perhaps a unit")
            });
        };
        let (dimension, factor) = match name {
            "" => (None, 1.0),
            name => unit(name).map(|(dimension, factor)| (Some(dimension), factor))?,
        };
        let value = value * factor;
        if value.is_finite() {
            Ok(Self { value, dimension })
        } else {
            Err(not_finite(text))
        }
    }

    /// The value in m, rad or 1, where a bare number is already in these.
    ///
    /// # Errors
    ///
    /// The quantity has a unit of another dimension.
    pub fn expect(self, dimension: Dimension) -> Result<f64, ValueError> {
        self.resolve(dimension, &Units::SI)
    }

    /// The value in m, rad or 1, where a bare number is in `units`.
    ///
    /// # Errors
    ///
    /// The quantity has a unit of another dimension, or overflows.
    pub fn resolve(self, dimension: Dimension, units: &Units) -> Result<f64, ValueError> {
        let value = match self.dimension {
            None => self.value * units.factor(dimension),
            Some(found) if found == dimension => self.value,
            Some(found) => {
                let message = format!("found {found}; expected {dimension}");
                let help = format!("write it like {}", dimension.example());
                return Err(ValueError::new(message).with_help(help));
            }
        };
        if value.is_finite() {
            Ok(value)
        } else {
            Err(not_finite(&self.value.to_string()))
        }
    }
}

/// The error of a number that is not finite.
pub(crate) fn not_finite(text: &str) -> ValueError {
    ValueError::new(format!(
        "found {}; expected a finite number",
        short(text.trim())
    ))
    .with_help("replace it by a number, or leave it out")
}

/// The units of the bare numbers of a file: the sizes of one unit in m and rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Units {
    /// The length of one unit \[m\].
    pub length: f64,
    /// The angle of one unit \[rad\].
    pub angle: f64,
}

impl Units {
    /// Metres and radians.
    pub const SI: Self = Self {
        length: 1.0,
        angle: 1.0,
    };

    /// The size of one unit of `dimension`, in m, rad or 1.
    #[must_use]
    pub fn factor(&self, dimension: Dimension) -> f64 {
        match dimension {
            Dimension::Length => self.length,
            Dimension::Angle => self.angle,
            Dimension::None => 1.0,
        }
    }

    /// The size of the unit called `name`, which must measure `dimension`.
    ///
    /// # Errors
    ///
    /// There is no such unit, or it measures something else.
    pub fn size(name: &str, dimension: Dimension) -> Result<f64, ValueError> {
        let (found, factor) = unit(name.trim())?;
        if found == dimension {
            return Ok(factor);
        }
        let fitting: Vec<&str> = UNITS[..SHOWN]
            .iter()
            .filter(|unit| unit.1 == dimension)
            .map(|unit| unit.0)
            .collect();
        let message = format!("`{name}` is the unit of {found}; expected that of {dimension}");
        Err(ValueError::new(message).with_help(match dimension {
            Dimension::None => "leave the unit out".to_owned(),
            _ => format!("use {}", one_of(&fitting)),
        }))
    }
}

impl Default for Units {
    fn default() -> Self {
        Self::SI
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> (f64, Option<Dimension>) {
        let quantity = Quantity::parse(text).unwrap();
        (quantity.value, quantity.dimension)
    }

    #[test]
    fn units_are_converted_to_metres_and_radians() {
        assert_eq!(value("0.1 mm"), (0.1 * 1e-3, Some(Dimension::Length)));
        assert_eq!(
            value(" 2deg "),
            (2.0f64.to_radians(), Some(Dimension::Angle))
        );
        assert_eq!(value("0.5 mrad"), (0.5e-3, Some(Dimension::Angle)));
        assert_eq!(value("3e-4"), (3e-4, None));
        assert!((value("-1E2 um").0 + 1e-4).abs() < 1e-18);
        assert_eq!(value("4 \u{b5}m").0, value("4 \u{3bc}m").0);
        assert_eq!(value("1 in"), (0.0254, Some(Dimension::Length)));
        assert_eq!(value("5. m").0, 5.0);
        assert!((value("60 arcmin").0 - value("1 deg").0).abs() < 1e-15);
        assert!((value("3600 arcsec").0 - value("1\u{b0}").0).abs() < 1e-15);
    }

    #[test]
    fn what_is_not_a_quantity_is_refused() {
        for text in [
            "", " ", "mm", "inf", "nan", "NaN mm", "-inf deg", "1e400", "1e400 mm", "3e", "3 e-4x",
            "1,5 mm", "1 2 mm", "0x10", "١ mm", "1 mm/s", "--1", "1_000",
        ] {
            assert!(Quantity::parse(text).is_err(), "{text:?} was accepted");
        }
    }

    #[test]
    fn errors_help() {
        let error = Quantity::parse("1,5 mm").unwrap_err();
        assert!(error.help.unwrap().contains("decimal point"));
        let error = Quantity::parse("1 MM").unwrap_err();
        assert_eq!(error.help.as_deref(), Some("did you mean `mm`?"));
        let error = Quantity::parse("1 deg").unwrap().expect(Dimension::Length);
        let error = error.unwrap_err();
        assert_eq!(error.message, "found an angle; expected a length");
    }

    #[test]
    fn bare_numbers_take_the_units_of_the_file() {
        let units = Units {
            length: 1e-3,
            angle: PI / 180.0,
        };
        let bare = Quantity::bare(90.0);
        assert_eq!(bare.resolve(Dimension::Angle, &units), Ok(PI / 2.0));
        assert_eq!(bare.resolve(Dimension::Length, &units), Ok(90.0 * 1e-3));
        assert_eq!(bare.resolve(Dimension::None, &units), Ok(90.0));
        assert_eq!(bare.expect(Dimension::Angle), Ok(90.0));
        assert!(Quantity::bare(f64::NAN).expect(Dimension::None).is_err());
    }

    #[test]
    fn a_unit_must_measure_what_is_asked() {
        assert_eq!(Units::size("mm", Dimension::Length), Ok(1e-3));
        assert!(Units::size("mm", Dimension::Angle).is_err());
        assert!(Units::size("mm", Dimension::None).is_err());
        assert!(Units::size("furlong", Dimension::Length).is_err());
    }
}
