//! Items of robot tables: conventions, kinds of joints, limits, inputs, readings.

use super::frame_row::Convention;
use super::joint_kind::JointKind;
use super::joint_model::Input;
use super::table::{InputRow, JointRow, Mass, Reading};
use crate::text::error::{InputError, Source, one_of, suggest};
use crate::text::item::Item;
use crate::text::quantity::{Dimension, Units};
use crate::text::section::Section;

pub(super) fn convention(item: &Item<'_>) -> Result<Convention, InputError> {
    let text = item.string()?.value;
    let found = Convention::NAMES.iter().find(|(name, _)| *name == text);
    found.map(|&(_, convention)| convention).ok_or_else(|| {
        let names = Convention::NAMES.map(|(name, _)| name);
        item.wrong_type("\"khalil-kleinfinger\" or \"denavit-hartenberg\"")
            .with_help(suggest(&text, &names))
    })
}

/// Three numbers.
pub(super) fn numbers(item: &Item<'_>, expected: &str) -> Result<[f64; 3], InputError> {
    let items: [Item<'_>; 3] = item.list_of(expected)?;
    let mut numbers = [0.0; 3];
    for (number, item) in numbers.iter_mut().zip(&items) {
        *number = item.number()?.value;
    }
    Ok(numbers)
}

/// `[inputs]`: what is known of further columns of the data.
pub(super) fn inputs(root: &mut Section<'_>) -> Result<Vec<InputRow>, InputError> {
    let Some(mut table) = root.table("inputs")? else {
        return Ok(Vec::new());
    };
    let mut all = Vec::new();
    for item in table.entries() {
        let name = item.name().to_owned();
        let mut table = item.table()?.titled(format!("[inputs.{name}]"));
        let range = match table.get("range") {
            Some(item) => Some(limits(&item, Dimension::None, &Units::SI)?),
            None => None,
        };
        let value = table.number("value")?.map(|value| value.value);
        table.finish()?;
        all.push(InputRow { name, range, value });
    }
    Ok(all)
}

/// What moves joints must be there: readings of joints, frames, masses.
pub(super) fn check_readings(
    source: &Source,
    joints: &[JointRow],
    tool_mass: Option<&Mass>,
) -> Result<(), InputError> {
    let has_mass = tool_mass.is_some() || joints.iter().any(|joint| joint.mass.is_some());
    let own = |joint: &&JointRow| joint.kind != JointKind::Fixed && joint.reading == Reading::Own;
    let names: Vec<&str> = joints.iter().filter(own).map(|j| j.name.as_str()).collect();
    let wrong = |joint: &JointRow, what: &str, name: &str| {
        let message = format!(
            "joint `{}`: {what} `{name}`, which is no joint with a reading of its own; expected {}",
            joint.name,
            one_of(&names)
        );
        Err(source.error(message).with_help(suggest(name, &names)))
    };
    for joint in joints {
        if let Reading::Of(name) = &joint.reading
            && !names.contains(&name.as_str())
        {
            return wrong(joint, "its reading is that of", name);
        }
        for model in &joint.models {
            for input in model.model.inputs() {
                match input {
                    Input::Joint(name) if !names.contains(&name.as_str()) => {
                        return wrong(joint, "it is coupled with", &name);
                    }
                    Input::Own if joint.reading == Reading::None => {
                        let message = format!(
                            "joint `{}` has no reading, which its model `{}` is a function of",
                            joint.name, model.text
                        );
                        let help = "leave `reading` out, or name the joint whose reading it has";
                        return Err(source.error(message).with_help(help));
                    }
                    Input::GravityArm(frame) if frame > joints.len() + 1 => {
                        let message = format!(
                            "joint `{}`: there is no frame {frame}; the tool is frame {}",
                            joint.name,
                            joints.len() + 1
                        );
                        let help = "frames are counted from 0, the base, to the tool";
                        return Err(source.error(message).with_help(help));
                    }
                    Input::Column(name) | Input::Sign(name) if names.contains(&name.as_str()) => {
                        let message = format!(
                            "joint `{}`: its model `{}` names a column, and `{name}` is what a joint reads",
                            joint.name, model.text
                        );
                        let help = format!("write `coupling({name})` for what a joint reads");
                        return Err(source.error(message).with_help(help));
                    }
                    Input::GravityTorque if !has_mass => {
                        let message = format!(
                            "joint `{}`: its model `{}` is a function of the torque of gravity, and nothing has a mass",
                            joint.name, model.text
                        );
                        let help = "add `mass` and `center_of_mass` to joints beyond it, or to [tool]; or name a column \
                                    with the measured torque, as in `compliance(tau2)`";
                        return Err(source.error(message).with_help(help));
                    }
                    _ => {}
                }
            }
        }
    }
    Ok(())
}

pub(super) fn joint_kind(item: &Item<'_>) -> Result<JointKind, InputError> {
    let text = item.string()?.value;
    match text.as_str() {
        "revolute" => Ok(JointKind::Revolute),
        "prismatic" => Ok(JointKind::Prismatic),
        "fixed" => Ok(JointKind::Fixed),
        _ => Err(item
            .wrong_type("\"revolute\", \"prismatic\" or \"fixed\"")
            .with_help(suggest(&text, &JointKind::NAMES))),
    }
}

pub(super) fn limits(
    item: &Item<'_>,
    dimension: Dimension,
    units: &Units,
) -> Result<[f64; 2], InputError> {
    let [lower, upper] = item.list_of("[lower, upper]")?;
    let limits = [
        lower.in_units(dimension, units)?,
        upper.in_units(dimension, units)?,
    ];
    if limits[0] < limits[1] {
        return Ok(limits);
    }
    Err(item
        .error("the lower limit is not below the upper one; expected [lower, upper]")
        .with_help("swap the limits, or leave them out"))
}
