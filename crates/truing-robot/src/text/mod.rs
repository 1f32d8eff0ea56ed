//! Text that people write: TOML with places, quantities with units, tables of numbers.
//!
//! Reading never panics: whatever is wrong with a file comes back as an [`InputError`] that says
//! where it is, what was found, what was expected and what to do.

pub(crate) mod error;
pub(crate) mod item;
pub(crate) mod loss;
pub(crate) mod pattern;
pub(crate) mod quantity;
pub(crate) mod section;
pub(crate) mod selection;
mod selection_syntax;
pub(crate) mod spanned;
pub(crate) mod table;
pub(crate) mod values;

pub(crate) use error::stem;
pub use error::{InputError, Source, ValueError, nearest};
pub use item::Item;
pub use loss::NamedLoss;
pub use pattern::Pattern;
pub use quantity::{Dimension, Quantity, Units};
pub use section::{Document, Section, Spans};
pub use selection::Selection;
pub use spanned::Spanned;
pub use table::Table;
pub use values::{ManyOf, PLANE_FORMS};
