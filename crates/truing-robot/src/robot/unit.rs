//! Units of parameters, unknowns and measured quantities.

/// A unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Radians.
    Radian,
    /// Metres.
    Meter,
    /// A ratio.
    One,
    /// Another one, by its symbol: `rad/(N m)`, `px`.
    Other(&'static str),
}

impl Unit {
    /// `rad`, `m`, `1`, or the symbol.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Radian => "rad",
            Self::Meter => "m",
            Self::One => "1",
            Self::Other(symbol) => symbol,
        }
    }
}

/// A parameter that a frame or a joint model declares.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelParameter {
    /// Its name in the table of the joint; in results the number of the frame comes behind it.
    pub name: String,
    /// Its unit.
    pub unit: Unit,
    /// Its nominal value where the table gives none.
    pub nominal: f64,
}

impl ModelParameter {
    /// A parameter that is nominally zero.
    pub fn zero(name: impl Into<String>, unit: Unit) -> Self {
        Self {
            name: name.into(),
            unit,
            nominal: 0.0,
        }
    }
}
