//! Reading the tables of robots.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::frame_row::{Convention, FrameRow, Key, Part};
use super::joint_kind::JointKind;
use super::models::{CustomFrame, ModelRow, Models};
use super::table::{GRAVITY, JointRow, Mass, Reading, RobotFile};
use super::table_items::{check_readings, convention, inputs, joint_kind, limits, numbers};
use super::unit::{ModelParameter, Unit};
use crate::text::error::{InputError, Source, one_of, suggest};
use crate::text::item::Item;
use crate::text::quantity::{Dimension, Units};
use crate::text::section::{Document, Section};
use crate::text::stem;
use truing::nalgebra::Vector3;

impl RobotFile {
    /// Reads a robot file.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or is not a robot file.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, InputError> {
        Self::read_with(path, &Models::default())
    }

    /// Reads a robot file, which may also name models of joints and frames that are not this crate's.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn read_with(path: impl AsRef<Path>, models: &Models) -> Result<Self, InputError> {
        Self::from_source(&Source::read(path)?, models)
    }

    /// Reads the text of a robot file; `path` is for messages.
    ///
    /// # Errors
    ///
    /// The text is not a robot file.
    pub fn parse(text: &str, path: impl Into<PathBuf>) -> Result<Self, InputError> {
        Self::parse_with(text, path, &Models::default())
    }

    /// Reads the text of a robot file, which may also name models that are not this crate's.
    ///
    /// # Errors
    ///
    /// As [`parse`](Self::parse).
    pub fn parse_with(
        text: &str,
        path: impl Into<PathBuf>,
        models: &Models,
    ) -> Result<Self, InputError> {
        Self::from_source(&Source::new(text, path), models)
    }

    fn from_source(source: &Source, models: &Models) -> Result<Self, InputError> {
        if source.text.trim().is_empty() {
            return Err(source
                .error("this robot file is empty; expected `convention` and [[joint]] tables")
                .with_help("describe the robot, or check that the right file is named"));
        }
        let document = Document::parse(source)?;
        let mut root = document.root().titled("this robot file");
        let name = match root.get("name") {
            Some(item) => item.string()?.value,
            None => stem(&source.path),
        };
        let convention = convention(&root.require(
            "convention",
            "expected \"khalil-kleinfinger\" or \"denavit-hartenberg\"",
        )?)?;
        let units = root.units()?;
        let mut reader = TableReader {
            convention,
            units,
            models,
            custom: Vec::new(),
        };
        let base = reader.frame_table(&mut root, "base", 0)?.0;
        let mut joints = Vec::new();
        let mut names = BTreeSet::new();
        for mut table in root.tables("joint")? {
            let moving = joints
                .iter()
                .filter(|j: &&JointRow| j.kind != JointKind::Fixed)
                .count();
            let joint = reader.joint(&mut table, [joints.len() + 1, moving + 1])?;
            if !names.insert(joint.name.clone()) {
                let at = table.get("name").map_or(table.span(), |item| item.span());
                let message = format!("a second joint is called `{}`", joint.name);
                return Err(source
                    .error_at(at, message)
                    .with_help("give every joint its own name"));
            }
            table.finish()?;
            joints.push(joint);
        }
        let (tool, tool_mass) = reader.frame_table(&mut root, "tool", joints.len() + 1)?;
        let inputs = inputs(&mut root)?;
        let gravity = match root.get("gravity") {
            Some(item) => numbers(&item, "[x, y, z]")?,
            None => GRAVITY,
        };
        root.finish()?;
        if joints.iter().all(|joint| joint.kind == JointKind::Fixed) {
            let found = match joints.len() {
                0 => "this robot has no joints".to_owned(),
                n => format!("all {n} joints of this robot are fixed"),
            };
            return Err(source
                .error(format!("{found}; expected at least one that moves"))
                .with_help("add a [[joint]] with type = \"revolute\" or \"prismatic\""));
        }
        check_readings(source, &joints, tool_mass.as_ref())?;
        Ok(Self {
            path: source.path.clone(),
            name,
            convention,
            base,
            joints,
            tool,
            tool_mass,
            custom: reader.custom,
            inputs,
            gravity,
        })
    }
}

/// Reads the tables of one robot.
struct TableReader<'a> {
    /// The convention of frames that say none.
    convention: Convention,
    units: Units,
    models: &'a Models,
    /// Frames of models from outside, by number.
    custom: Vec<(usize, CustomFrame)>,
}

impl TableReader<'_> {
    /// `[base]` or `[tool]`, with its mass.
    fn frame_table(
        &mut self,
        root: &mut Section<'_>,
        key: &str,
        number: usize,
    ) -> Result<(FrameRow, Option<Mass>), InputError> {
        let Some(table) = root.table(key)? else {
            return Ok((FrameRow::default(), None));
        };
        let mut table = table.titled(format!("[{key}]"));
        let part = if key == "base" {
            Part::Base
        } else {
            Part::Tool
        };
        let row = self.frame(&mut table, part, number)?;
        let mass = if part == Part::Tool {
            self.mass(&mut table)?
        } else {
            None
        };
        table.finish()?;
        Ok((row, mass))
    }

    /// `mass` and `center_of_mass`.
    fn mass(&self, table: &mut Section<'_>) -> Result<Option<Mass>, InputError> {
        let Some(item) = table.get("mass") else {
            return Ok(None);
        };
        let mass = item.size(Dimension::None)?;
        let center = match table.get("center_of_mass") {
            Some(item) => item.point(&self.units)?.into(),
            None => [0.0; 3],
        };
        Ok(Some(Mass { mass, center }))
    }

    /// The parameters of a frame; one that only another convention or frame has is explained.
    fn frame(
        &mut self,
        table: &mut Section<'_>,
        part: Part,
        number: usize,
    ) -> Result<FrameRow, InputError> {
        let mut row = FrameRow::default();
        if let Some(item) = table.get("convention") {
            let name = item.string()?.value;
            if let Some(model) = self.models.frames.iter().find(|f| f.name == name) {
                let model = model.model.clone();
                let values = self.values(table, &model.parameters())?;
                let custom = CustomFrame {
                    name,
                    model,
                    values,
                };
                self.custom.push((number, custom));
                return Ok(row);
            }
            row.convention = Some(convention(&item)?);
        }
        let convention = row.convention.unwrap_or(self.convention);
        let keys = convention.keys(part);
        for &key in keys {
            if let Some(item) = table.get(key.name()) {
                *row.get_mut(key) = item.in_units(key.dimension(), &self.units)?;
            }
        }
        let mut names: Vec<&str> = keys.iter().map(|key| key.name()).collect();
        if convention == Convention::General {
            self.general(table, part, &mut row)?;
            names.extend(["xyz", "rpy", "axis"]);
        }
        for key in Key::ALL.into_iter().filter(|key| !keys.contains(key)) {
            let Some(item) = table.peek(key.name()) else {
                continue;
            };
            let message = format!(
                "{} has no such parameter in the {} convention; it has {}",
                table.title(),
                convention.name(),
                names.join(", ")
            );
            let help = match (convention, key) {
                (Convention::KhalilKleinfinger, Key::A) => {
                    "the distance along x is called `d` here"
                }
                (Convention::DenavitHartenberg, Key::R) => {
                    "the distance along z is called `d` here"
                }
                _ => "remove it: the frames next to it can express the same",
            };
            return Err(item.error(message).with_help(help));
        }
        Ok(row)
    }

    /// What is constant in a general frame.
    fn general(
        &self,
        table: &mut Section<'_>,
        part: Part,
        row: &mut FrameRow,
    ) -> Result<(), InputError> {
        if let Some(item) = table.get("xyz") {
            row.general.xyz = item.point(&self.units)?.into();
        }
        if let Some(item) = table.get("rpy") {
            let items: [Item<'_>; 3] = item.list_of("[roll, pitch, yaw]")?;
            for (angle, item) in row.general.rpy.iter_mut().zip(&items) {
                *angle = item.in_units(Dimension::Angle, &self.units)?;
            }
        }
        if part != Part::Joint {
            return Ok(());
        }
        if let Some(item) = table.get("axis") {
            row.general.axis = numbers(&item, "[x, y, z]")?;
            if !Vector3::from(row.general.axis).norm().is_normal() {
                return Err(item
                    .error("the axis has no direction; expected one that is not zero")
                    .with_help("write the axis of the joint in its frame, like [0, 0, 1]"));
            }
        }
        Ok(())
    }

    /// The values of a model's parameters, nominal where there is no key.
    fn values(
        &self,
        table: &mut Section<'_>,
        parameters: &[ModelParameter],
    ) -> Result<Vec<f64>, InputError> {
        let mut values = Vec::new();
        for parameter in parameters {
            let dimension = match parameter.unit {
                Unit::Radian => Dimension::Angle,
                Unit::Meter => Dimension::Length,
                _ => Dimension::None,
            };
            values.push(match table.get(&parameter.name) {
                Some(item) => item.in_units(dimension, &self.units)?,
                None => parameter.nominal,
            });
        }
        Ok(values)
    }

    /// `[[joint]]`; `number` counts all of them, `moving` those that move.
    fn joint(
        &mut self,
        table: &mut Section<'_>,
        [number, moving]: [usize; 2],
    ) -> Result<JointRow, InputError> {
        let name = table.get("name");
        let kind = joint_kind(&table.require("type", "expected revolute, prismatic or fixed")?)?;
        // Data count the joints that move: `q2` is the second of these.
        let name = match name {
            Some(item) => item.name_text()?.value,
            None if kind == JointKind::Fixed => format!("fixed{number}"),
            None => format!("q{moving}"),
        };
        let frame = self.frame(table, Part::Joint, number)?;
        let mut joint = JointRow::new(name, kind, frame);
        joint.mass = self.mass(table)?;
        if kind == JointKind::Fixed {
            self.parked(table, &mut joint)?;
            return Ok(joint);
        }
        self.moved_by(table, &mut joint)?;
        joint.limits = match table.get("limits") {
            Some(item) => Some(limits(&item, kind.dimension(), &self.units)?),
            None => None,
        };
        joint.value = match table.get("value") {
            Some(item) => Some(item.in_units(kind.dimension(), &self.units)?),
            None => None,
        };
        Ok(joint)
    }

    /// A joint that is parked for good: where it is parked is part of its frame.
    fn parked(&self, table: &mut Section<'_>, joint: &mut JointRow) -> Result<(), InputError> {
        for key in ["gain", "limits", "model", "reading"] {
            if let Some(item) = table.peek(key) {
                let error = item.error("a fixed joint does not move and has none");
                return Err(error.with_help("remove it, or change the `type` of the joint"));
            }
        }
        let Some(item) = table.get("value") else {
            return Ok(());
        };
        let quantity = item.quantity()?.value;
        let frame = &mut joint.frame;
        let convention = frame.convention.unwrap_or(self.convention);
        match (quantity.dimension, convention) {
            (_, Convention::General) => {
                let error = item.error("a general frame has its place in `xyz` and `rpy`");
                return Err(error.with_help("write where the joint is parked into these"));
            }
            (Some(Dimension::Angle), _) => frame.theta += quantity.value,
            (Some(_), Convention::KhalilKleinfinger) => frame.r += quantity.value,
            (Some(_), Convention::DenavitHartenberg) => frame.d += quantity.value,
            (None, _) if quantity.value == 0.0 => {}
            (None, _) => {
                let error = item.error("a fixed joint may turn or slide; expected a unit");
                return Err(
                    error.with_help("write where it is parked like \"20 deg\" or \"0.3 m\"")
                );
            }
        }
        Ok(())
    }

    /// `reading`, `model` and the parameters of the models.
    fn moved_by(&self, table: &mut Section<'_>, joint: &mut JointRow) -> Result<(), InputError> {
        if let Some(item) = table.get("reading") {
            let text = item.name_text()?.value;
            joint.reading = match text.as_str() {
                "none" => Reading::None,
                _ if text == joint.name => Reading::Own,
                _ => Reading::Of(text),
            };
        }
        let listed = match table.get("model") {
            Some(item) => Some((item.strings()?, item)),
            None => None,
        };
        let mut has_gain = joint.reading != Reading::None;
        if let Some((texts, item)) = &listed {
            has_gain = texts.iter().any(|text| text.value.trim() == "gain");
            if has_gain && joint.reading == Reading::None {
                let error = item.error("a joint without a reading has no gain");
                return Err(error.with_help("remove \"gain\", or leave `reading` out"));
            }
            for text in texts.iter().filter(|text| text.value.trim() != "gain") {
                let row = self.model(table, &text.value, item, joint)?;
                joint.models.push(row);
            }
        }
        let gain = match table.get("gain") {
            Some(item) if !has_gain => {
                let error = item.error("the joint has no gain");
                return Err(error.with_help("add \"gain\" to its `model`, or remove the key"));
            }
            Some(item) => match item.number()?.value {
                0.0 => {
                    let error = item.error("found 0; expected a factor that is not 0");
                    return Err(
                        error.with_help("use type = \"fixed\" for a joint that does not move")
                    );
                }
                gain => gain,
            },
            None => 1.0,
        };
        joint.gain = has_gain.then_some(gain);
        Ok(())
    }

    /// One model as it is written, `harmonics(2)`, with the values of its parameters.
    fn model(
        &self,
        table: &mut Section<'_>,
        text: &str,
        item: &Item<'_>,
        joint: &JointRow,
    ) -> Result<ModelRow, InputError> {
        let text = text.trim();
        let (name, inside) = match text.split_once('(') {
            Some((name, rest)) => (name.trim(), rest.trim_end().strip_suffix(')')),
            None => (text, Some("")),
        };
        let names: Vec<&str> = std::iter::once("gain")
            .chain(self.models.joints.iter().map(|model| model.name))
            .collect();
        let Some(named) = self.models.joints.iter().find(|model| model.name == name) else {
            let message = format!("found `{text}`; expected {}", one_of(&names));
            return Err(item.error(message).with_help(suggest(name, &names)));
        };
        let words: Option<Vec<&str>> = inside.map(|inside| {
            let words = inside.split(',').map(str::trim);
            words.filter(|word| !word.is_empty()).collect()
        });
        let Some(model) = words.and_then(|words| named.make(&words)) else {
            let message = format!("found `{text}`; expected it like `{}`", named.example);
            let help = "correct what is between the parentheses";
            return Err(item.error(message).with_help(help));
        };
        let parameters = model.parameters(joint.kind);
        let before = joint
            .models
            .iter()
            .flat_map(|row| row.model.parameters(joint.kind));
        let mut before: Vec<String> = before.map(|parameter| parameter.name).collect();
        for parameter in &parameters {
            if before.contains(&parameter.name) {
                let message = format!(
                    "`{text}` brings the parameter `{}`, which the joint has already",
                    parameter.name
                );
                return Err(item.error(message).with_help("name each model once"));
            }
            before.push(parameter.name.clone());
        }
        let values = self.values(table, &parameters)?;
        Ok(ModelRow {
            text: text.to_owned(),
            model,
            values,
        })
    }
}

#[cfg(test)]
mod tests;
