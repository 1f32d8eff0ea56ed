//! Starting values nobody has to guess.

mod begin;
mod register;

pub use begin::{start, start_eliminated, start_own};
