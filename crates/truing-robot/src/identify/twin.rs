//! The structural twin of a calibration: the same sets at random postures that satisfy them exactly.

use crate::error::Error;
use crate::measurement::{At, MeasurementSet, Sampling, sample};
use crate::robot::Arm;
use crate::unknown::State;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// How many rows of measurements each set of the structural twin has, about.
pub const POSTURES: usize = 120;

/// How many rows each group of a set has at least.
pub const LEAST: usize = 12;

/// Seed of the structural twin, unless another is asked for.
pub const SEED: u64 = 1996;

/// The structural twin of a calibration: sets like the given ones, at random postures that satisfy
/// their constraints exactly at `state`, where rank is a property of the robot and not of the noise.
/// Half of the postures start between the joint limits, half near the data's own, so that a plane
/// in a corner of the workspace is reached too. Each group has `least` rows or more. The same data and
/// seed always give the same twin.
///
/// # Errors
/// If what is to be reached is out of reach.
pub fn structural_twin(
    arms: &[Arm],
    sets: &[MeasurementSet],
    state: &State,
    seed: u64,
    least: usize,
) -> Result<Vec<MeasurementSet>, Error> {
    let twin = |(k, set): (usize, &MeasurementSet)| {
        let sampling = Sampling {
            count: POSTURES.div_ceil(set.groups.len().max(1)).max(least),
            noise: None,
            near: Some(set),
        };
        let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_add(k as u64));
        // Structure knows no noise: all sets weigh the same.
        let mut set = set.noiseless();
        match sample(arms, &set, state, &sampling, &mut rng) {
            Err(Error::Unreachable { message, help }) => {
                let at = At {
                    arms,
                    readings: &set.readings,
                    state,
                };
                match set.kind.within_reach(&at) {
                    Some(kind) => {
                        set.kind = kind;
                        sample(arms, &set, state, &sampling, &mut rng)
                    }
                    None => Err(Error::Unreachable { message, help }),
                }
            }
            sampled => sampled,
        }
    };
    sets.iter().enumerate().map(twin).collect()
}
