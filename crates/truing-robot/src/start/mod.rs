//! Starting values nobody has to guess.

mod begin;
mod hand_eye;
mod register;

pub use begin::{start, start_eliminated, start_own};
pub use hand_eye::{body_seen, hand_eye, sensor_of};
