//! Unknowns beside the robots' parameters, by name and type, and the values of everything.

mod estimable;
mod key;
mod state;

pub(crate) use estimable::typed;
pub use estimable::{Component, Estimable, Shape, Value};
pub use key::{Key, Own, Role, Unknown};
pub use state::State;
