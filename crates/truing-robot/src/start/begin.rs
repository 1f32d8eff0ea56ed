//! Starting values nobody has to guess: sensor frames and tool points by registration, what was
//! touched by fitting, all with the robots as they are.

use super::register::{locate_target, register};
use crate::measurement::{At, MeasurementSet, TargetKind};
use crate::robot::Arm;
use crate::unknown::{Key, State, Value};
use std::collections::BTreeSet;
use truing::manifold::{Point3, Pose3};

/// A state for the sets with the given robots: known frames and tool points are kept, missing ones
/// are registered, unknowns of sets are started by their kinds.
pub fn start(arms: &[Arm], sets: &[MeasurementSet], robots: Vec<Vec<f64>>, known: &State) -> State {
    let mut state = known.shared(robots);
    for set in sets {
        for tool in &set.tools {
            if let (Some(name), Some(guess)) = (&tool.target, tool.guess) {
                let key = Key::Target(tool.robot, name.clone());
                if state.get(&key).is_none() {
                    let value = match set.kind.targets() {
                        TargetKind::Point => Value::of::<Point3>(guess.translation),
                        TargetKind::Body => Value::of::<Pose3>(guess),
                    };
                    state.set(key, value);
                }
            }
        }
        if let (Some(name), Some(guess)) = (&set.frame, set.frame_guess)
            && state.frame(name).is_none()
        {
            state.set_frame(name, guess);
        }
    }
    let frames: BTreeSet<&String> = sets.iter().filter_map(|set| set.frame.as_ref()).collect();
    for name in frames {
        if state.frame(name).is_none() {
            let of_frame = |set: &&MeasurementSet| set.frame.as_ref() == Some(name);
            let members: Vec<&MeasurementSet> = sets.iter().filter(of_frame).collect();
            register(arms, &members, name, &mut state);
        }
    }
    for set in sets {
        for (robot, name) in set.targets() {
            let key = Key::Target(robot, name);
            if state.get(&key).is_none() {
                let target = locate_target(arms, sets, &key, &state);
                state.set(key, target);
            }
        }
    }
    start_own(arms, sets, &mut state);
    state
}

/// Starts the unknowns of every set at the tool points of a state.
pub fn start_own(arms: &[Arm], sets: &[MeasurementSet], state: &mut State) {
    for set in sets {
        start_set(arms, set, state);
    }
}

/// Starts the unknowns that the equations of some sets leave out.
pub fn start_eliminated(arms: &[Arm], sets: &[MeasurementSet], state: &mut State) {
    for set in sets.iter().filter(|set| set.eliminates()) {
        start_set(arms, set, state);
    }
}

fn start_set(arms: &[Arm], set: &MeasurementSet, state: &mut State) {
    let unknowns = set.kind.unknowns();
    if unknowns.is_empty() {
        return;
    }
    let mut started = Vec::new();
    let at = At {
        arms,
        readings: &set.readings,
        state,
    };
    for group in 0..set.groups.len() {
        let own = set.kind.start(&at, group);
        for (unknown, value) in unknowns.iter().zip(own) {
            let method = set.method.as_ref();
            let chart = method.and_then(|method| method.chart(&*set.kind, unknown.name));
            let value = match chart {
                Some(chart) => chart.start(&at, group),
                None => value,
            };
            started.push((group, unknown.name, value));
        }
    }
    for (group, name, value) in started {
        state.set_own(&set.name, &set.groups.names[group], name, value);
    }
}
