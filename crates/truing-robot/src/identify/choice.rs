//! What becomes of columns in an estimate.

use crate::model::Column;
use serde::Serialize;

/// What became of a parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// Estimated from the data.
    Estimated,
    /// Not asked for.
    Fixed,
    /// Nothing that was measured depends on it.
    NoEffect,
    /// Its effect is taken over by others.
    Regrouped,
    /// The structure would allow it, these data do not determine it.
    Unexcited,
    /// Free to choose, since it only moves along what was touched, or scales everything: held at nominal.
    Held,
}

impl Status {
    /// The name in files.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Estimated => "estimated",
            Self::Fixed => "fixed",
            Self::NoEffect => "no-effect",
            Self::Regrouped => "regrouped",
            Self::Unexcited => "unexcited",
            Self::Held => "held",
        }
    }
}

/// What becomes of a column in the estimate.
#[derive(Debug, Clone, PartialEq)]
pub enum Choice {
    /// Not asked for.
    Fixed,
    /// Estimated.
    Estimated,
    /// Nothing measured depends on it.
    NoEffect,
    /// A combination of estimated columns, as (column, coefficient).
    Regrouped(Vec<(usize, f64)>),
    /// The same, but for the scale, which the data leave free: this parameter, held, anchors it.
    Anchor(Vec<(usize, f64)>),
    /// The structure would allow it, these data do not determine it.
    Unexcited,
}

impl Choice {
    /// What becomes of a robot's parameter, among these columns.
    pub fn status(&self, columns: &[Column]) -> Status {
        match self {
            Self::Fixed => Status::Fixed,
            Self::Estimated => Status::Estimated,
            Self::NoEffect => Status::NoEffect,
            Self::Unexcited => Status::Unexcited,
            Self::Anchor(_) => Status::Held,
            // What only planes, points and distances take over moves everything along.
            Self::Regrouped(into) => {
                let local = |(c, _): &(usize, f64)| columns[*c].owner.is_local();
                if into.iter().all(local) {
                    Status::Held
                } else {
                    Status::Regrouped
                }
            }
        }
    }

    /// What takes over, by name and coefficient.
    pub fn taken_over(&self, columns: &[Column]) -> Option<Vec<(String, f64)>> {
        let (Self::Regrouped(into) | Self::Anchor(into)) = self else {
            return None;
        };
        let named = |(c, w): &(usize, f64)| (columns[*c].name.clone(), *w);
        Some(into.iter().map(named).collect())
    }
}
