//! Unknowns beside the robots' parameters, by name and type, and the values of everything.

mod estimable;
mod state;
mod key;

pub use estimable::{Component, Estimable, Shape, Value};
pub use state::State;
pub use key::{Key, Own, Role, Unknown};
pub(crate) use estimable::typed;
