//! Values that several tables have: positive quantities, points, poses, planes, lists of places.

use super::error::{InputError, suggest};
use super::item::Item;
use super::quantity::{Dimension, Quantity, Units};
use super::section::Section;
use truing::manifold::{Plane, Pose};
use truing::nalgebra::Vector3;

impl Item<'_> {
    /// A quantity of this dimension, in m, rad or 1, that is more than zero.
    ///
    /// # Errors
    ///
    /// It is none.
    pub fn positive(&self, dimension: Dimension, units: &Units) -> Result<f64, InputError> {
        let value = self.in_units(dimension, units)?;
        if value > 0.0 {
            return Ok(value);
        }
        Err(self.not_positive(value))
    }

    /// A quantity of any dimension that is more than zero.
    ///
    /// # Errors
    ///
    /// It is none.
    pub fn positive_quantity(&self) -> Result<Quantity, InputError> {
        let quantity = self.quantity()?.value;
        if quantity.value > 0.0 {
            return Ok(quantity);
        }
        Err(self.not_positive(quantity.value))
    }

    fn not_positive(&self, value: f64) -> InputError {
        self.error(format!("found {value}; expected more than 0"))
            .with_help("write a positive number, or leave the key out")
    }

    /// A size of zero or more, in m, rad or 1.
    ///
    /// # Errors
    ///
    /// It is none.
    pub fn size(&self, dimension: Dimension) -> Result<f64, InputError> {
        let value = self.in_units(dimension, &Units::SI)?;
        if value >= 0.0 {
            return Ok(value);
        }
        Err(self
            .error(format!("found {value}; expected 0 or more"))
            .with_help("write it without a sign"))
    }

    /// Whether it is the word `estimate`, in place of what is known otherwise: `a length`.
    ///
    /// # Errors
    ///
    /// It is another word.
    pub fn is_estimate(&self, otherwise: &str) -> Result<bool, InputError> {
        match self.as_str().map(str::trim) {
            Some("estimate") => Ok(true),
            Some(word) if word.starts_with(char::is_alphabetic) => Err(self
                .wrong_type(&format!("{otherwise} or \"estimate\""))
                .with_help(suggest(word, &["estimate"]))),
            _ => Ok(false),
        }
    }

    /// `[x, y, z]`, lengths \[m\].
    ///
    /// # Errors
    ///
    /// It is none.
    pub fn point(&self, units: &Units) -> Result<Vector3<f64>, InputError> {
        let mut point = Vector3::zeros();
        let items: [Item<'_>; 3] = self.list_of("[x, y, z]")?;
        for (coordinate, item) in point.iter_mut().zip(&items) {
            *coordinate = item.in_units(Dimension::Length, units)?;
        }
        Ok(point)
    }

    /// `[x, y, z, qw, qx, qy, qz]`, the quaternion brought to length one.
    ///
    /// # Errors
    ///
    /// It is none.
    pub fn pose(&self, units: &Units) -> Result<Pose<f64>, InputError> {
        let items: [Item<'_>; 7] = self.list_of("[x, y, z, qw, qx, qy, qz]")?;
        let mut pose = [0.0; 7];
        for (i, (number, item)) in pose.iter_mut().zip(&items).enumerate() {
            let dimension = if i < 3 {
                Dimension::Length
            } else {
                Dimension::None
            };
            *number = item.in_units(dimension, units)?;
        }
        let [x, y, z, quaternion @ ..] = pose;
        let norm = quaternion.iter().fold(0.0f64, |norm, q| norm.hypot(*q));
        if !(0.9..1.1).contains(&norm) {
            return Err(self
                .error(format!("the quaternion has length {norm}; expected 1"))
                .with_help("the order is x, y, z, qw, qx, qy, qz"));
        }
        let position = Vector3::new(x, y, z);
        Ok(Pose::from_quaternion(
            position,
            quaternion.map(|q| q / norm),
        ))
    }

    /// `{ normal = [0, 0, 1], distance = 0.4 }` or `{ a = 0.3, b = -0.5, c = -1.1 }`, the coefficients of
    /// a·x + b·y + c·z + 1 = 0.
    ///
    /// # Errors
    ///
    /// It is neither, or has no direction.
    pub fn plane(&self, units: &Units) -> Result<Plane<f64>, InputError> {
        if !self.is_table() {
            return Err(self
                .wrong_type(PLANE_FORMS)
                .with_help("write the plane as a table, in one of the two forms"));
        }
        let mut table = self.table()?;
        let has = |keys: &[&str]| keys.iter().any(|key| table.peek(key).is_some());
        let by_coefficients = has(&COEFFICIENTS);
        if by_coefficients && has(&["normal", "distance"]) {
            return Err(self
                .error(format!(
                    "found both forms of a plane; expected {PLANE_FORMS}"
                ))
                .with_help("keep either `normal` and `distance`, or `a`, `b` and `c`"));
        }
        let (normal, distance) = if by_coefficients {
            (coefficients(&mut table, units)?, -1.0)
        } else {
            normal_and_distance(&mut table, units)?
        };
        table.finish()?;
        // What is not zero must also have a length that is neither zero nor infinite.
        let length = normal.iter().fold(0.0f64, |norm, n| norm.hypot(*n));
        if length.is_normal() {
            return Ok(Plane {
                normal: normal.map(|n| n / length).into(),
                distance: distance / length,
            });
        }
        Err(self
            .error("the plane has no direction; expected a normal that is not zero")
            .with_help("write the normal of the plane, like [0, 0, 1]"))
    }
}

/// The two forms of a plane.
pub const PLANE_FORMS: &str = "{ normal = [0, 0, 1], distance = 0.4 } or { a, b, c }";

const COEFFICIENTS: [&str; 3] = ["a", "b", "c"];

fn coefficients(table: &mut Section<'_>, units: &Units) -> Result<[f64; 3], InputError> {
    let mut normal = [0.0; 3];
    for (number, key) in normal.iter_mut().zip(COEFFICIENTS) {
        // One over a length.
        *number = table.require(key, "expected a number")?.number()?.value / units.length;
    }
    Ok(normal)
}

fn normal_and_distance(
    table: &mut Section<'_>,
    units: &Units,
) -> Result<([f64; 3], f64), InputError> {
    let items: [Item<'_>; 3] = table
        .require("normal", "expected [x, y, z]")?
        .list_of("[x, y, z]")?;
    let mut normal = [0.0; 3];
    for (number, item) in normal.iter_mut().zip(&items) {
        *number = item.number()?.value;
    }
    let distance = table.require("distance", "expected a length")?;
    Ok((normal, distance.in_units(Dimension::Length, units)?))
}

/// Places that a simulation file gives, or how many are drawn.
#[derive(Debug, Clone, PartialEq)]
pub enum ManyOf<T> {
    /// So many, drawn within reach of the robot.
    Drawn(usize),
    /// These.
    Listed(Vec<T>),
}

impl Section<'_> {
    /// A number of places, or a list of them; one that is drawn if the key is not there.
    ///
    /// # Errors
    ///
    /// It is neither, or there are none.
    pub fn many<T>(
        &mut self,
        key: &str,
        what: &str,
        one: impl Fn(&Item<'_>) -> Result<T, InputError>,
    ) -> Result<ManyOf<T>, InputError> {
        let Some(item) = self.get(key) else {
            return Ok(ManyOf::Drawn(1));
        };
        let expected = format!("a number of {what}, or a list of {what}");
        if item.is_list() {
            let listed = item.list(&expected)?;
            let listed = listed.iter().map(one).collect::<Result<Vec<T>, _>>()?;
            if listed.is_empty() {
                return Err(item
                    .error(format!("found an empty list; expected {expected}"))
                    .with_help("write 1 or more, or leave the key out for one"));
            }
            return Ok(ManyOf::Listed(listed));
        }
        let number = item.integer().map_err(|_| item.wrong_type(&expected))?;
        if number.value == 0 {
            return Err(item
                .error(format!("found 0; expected {expected}"))
                .with_help("write 1 or more"));
        }
        Ok(ManyOf::Drawn(number.value))
    }
}
