//! A value of a TOML table, read by its type.

use std::ops::Range;

use toml::de::DeValue;

use super::error::{InputError, Source, ValueError, short};
use super::quantity::{Dimension, Quantity, Units, not_finite};
use super::spanned::Spanned;

/// A value of a table or list, with its name and place.
#[derive(Debug, Clone)]
pub struct Item<'a> {
    pub(crate) source: &'a Source,
    pub(crate) name: String,
    pub(crate) key: Range<usize>,
    pub(crate) value: &'a toml::Spanned<DeValue<'a>>,
}

impl<'a> Item<'a> {
    /// The key of the value, or of the list it is in.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The place of the key, in bytes.
    #[must_use]
    pub fn key_span(&self) -> Range<usize> {
        self.key.clone()
    }

    /// The place of the value, in bytes.
    #[must_use]
    pub fn span(&self) -> Range<usize> {
        self.value.span()
    }

    /// The text, if the value is one.
    #[must_use]
    pub fn as_str(&self) -> Option<&'a str> {
        self.value.get_ref().as_str()
    }

    /// Whether the value is a table.
    #[must_use]
    pub fn is_table(&self) -> bool {
        self.value.get_ref().is_table()
    }

    /// Whether the value is a list.
    #[must_use]
    pub fn is_list(&self) -> bool {
        self.value.get_ref().is_array()
    }

    /// The error of `message` at this value, with its name in front.
    #[must_use]
    pub fn error(&self, message: impl AsRef<str>) -> InputError {
        let message = format!("`{}`: {}", short(&self.name), message.as_ref());
        self.source.error_at(self.span(), message)
    }

    /// The error of this value for a reason found while understanding it.
    #[must_use]
    pub fn refuse(&self, error: ValueError) -> InputError {
        error.at(self.source, self.span(), &short(&self.name))
    }

    /// The error of a value of the wrong type; `expected` says which is right.
    #[must_use]
    pub fn wrong_type(&self, expected: &str) -> InputError {
        self.error(format!("found {}; expected {expected}", self.found()))
            .with_help(format!("write {expected}"))
    }

    /// The text.
    ///
    /// # Errors
    ///
    /// The value is not a text.
    pub fn string(&self) -> Result<Spanned<String>, InputError> {
        match self.as_str() {
            Some(text) => Ok(Spanned::new(text.to_owned(), self.span())),
            None => Err(self.wrong_type("a text in quotes")),
        }
    }

    /// The text, which must have something in it; spaces around it are dropped.
    ///
    /// # Errors
    ///
    /// The value is not a text, or it is empty.
    pub fn name_text(&self) -> Result<Spanned<String>, InputError> {
        let text = self.string()?;
        match text.value.trim() {
            "" => Err(self
                .error("found an empty text; expected a name")
                .with_help("write a name, or leave the key out")),
            name => Ok(Spanned::new(name.to_owned(), text.span)),
        }
    }

    /// The finite number; integers are numbers too.
    ///
    /// # Errors
    ///
    /// The value is not a finite number.
    pub fn number(&self) -> Result<Spanned<f64>, InputError> {
        let (value, text) = match self.value.get_ref() {
            DeValue::Float(float) => (float.as_str().parse::<f64>().ok(), float.as_str()),
            DeValue::Integer(integer) if integer.radix() == 10 => {
                (integer.as_str().parse::<f64>().ok(), integer.as_str())
            }
            DeValue::Integer(integer) => {
                let parsed = i64::from_str_radix(integer.as_str(), integer.radix());
                #[expect(clippy::cast_precision_loss, reason = "a number like any other")]
                let value = parsed.ok().map(|value| value as f64);
                (value, integer.as_str())
            }
            _ => return Err(self.wrong_type("a number")),
        };
        match value {
            Some(value) if value.is_finite() => Ok(Spanned::new(value, self.span())),
            _ => Err(self.refuse(not_finite(text))),
        }
    }

    /// The truth value.
    ///
    /// # Errors
    ///
    /// The value is not `true` or `false`.
    pub fn boolean(&self) -> Result<Spanned<bool>, InputError> {
        match self.value.get_ref() {
            DeValue::Boolean(value) => Ok(Spanned::new(*value, self.span())),
            _ => Err(self.wrong_type("`true` or `false`")),
        }
    }

    /// The integer, zero or more.
    ///
    /// # Errors
    ///
    /// The value is not such an integer.
    pub fn integer(&self) -> Result<Spanned<usize>, InputError> {
        let value = match self.value.get_ref() {
            DeValue::Integer(integer) => {
                usize::from_str_radix(integer.as_str(), integer.radix()).ok()
            }
            _ => None,
        };
        match value {
            Some(value) => Ok(Spanned::new(value, self.span())),
            None => Err(self.wrong_type("an integer, zero or more")),
        }
    }

    /// The quantity: a number, or a text like "0.1 mm".
    ///
    /// # Errors
    ///
    /// The value is not a quantity.
    pub fn quantity(&self) -> Result<Spanned<Quantity>, InputError> {
        let quantity = match self.value.get_ref() {
            DeValue::String(text) => Quantity::parse(text).map_err(|error| self.refuse(error))?,
            DeValue::Integer(_) | DeValue::Float(_) => Quantity::bare(self.number()?.value),
            _ => return Err(self.wrong_type("a number, or a text like \"0.1 mm\"")),
        };
        Ok(Spanned::new(quantity, self.span()))
    }

    /// The quantity in m, rad or 1, where a bare number is in `units`.
    ///
    /// # Errors
    ///
    /// The value is not a quantity, or has a unit of another dimension.
    pub fn in_units(&self, dimension: Dimension, units: &Units) -> Result<f64, InputError> {
        let quantity = self.quantity()?.value;
        quantity
            .resolve(dimension, units)
            .map_err(|error| self.refuse(error))
    }

    /// The values of a list; `expected` says what the list is of.
    ///
    /// # Errors
    ///
    /// The value is not a list.
    pub fn list(&self, expected: &str) -> Result<Vec<Item<'a>>, InputError> {
        let DeValue::Array(array) = self.value.get_ref() else {
            return Err(self.wrong_type(expected));
        };
        Ok(array
            .iter()
            .map(|value| Item {
                source: self.source,
                name: self.name.clone(),
                key: self.key.clone(),
                value,
            })
            .collect())
    }

    /// The values of a list of `N`; `expected` says what the list is of.
    ///
    /// # Errors
    ///
    /// The value is not a list, or has another number of values.
    pub fn list_of<const N: usize>(&self, expected: &str) -> Result<[Item<'a>; N], InputError> {
        let items = self.list(expected)?;
        let found = items.len();
        <[Item<'a>; N]>::try_from(items).map_err(|_| {
            self.error(format!("found a list of {found}; expected {expected}"))
                .with_help(format!("write {N} values between the brackets"))
        })
    }

    /// The list of texts, none of them empty.
    ///
    /// # Errors
    ///
    /// The value is not such a list.
    pub fn strings(&self) -> Result<Vec<Spanned<String>>, InputError> {
        let items = self.list("a list of texts, like [\"a\", \"b\"]")?;
        items.iter().map(Item::name_text).collect()
    }

    /// The text, or the list of texts, none of them empty.
    ///
    /// # Errors
    ///
    /// The value is neither.
    pub fn string_or_list(&self) -> Result<Vec<Spanned<String>>, InputError> {
        if self.is_list() {
            return self.strings();
        }
        match self.as_str() {
            Some(_) => Ok(vec![self.name_text()?]),
            None => Err(self.wrong_type("a text or a list of texts")),
        }
    }

    /// The value in words.
    fn found(&self) -> String {
        match self.value.get_ref() {
            DeValue::String(text) => format!("the text \"{}\"", short(text)),
            DeValue::Integer(integer) => format!("the integer {}", short(integer.as_str())),
            DeValue::Float(float) => format!("the number {}", short(float.as_str())),
            DeValue::Boolean(value) => format!("`{value}`"),
            DeValue::Datetime(_) => "a date or time".to_owned(),
            DeValue::Array(array) => format!("a list of {}", array.len()),
            DeValue::Table(_) => "a table".to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::section::{Document, Section};

    fn with_root<T>(text: &str, read: impl FnOnce(Section<'_>) -> T) -> T {
        let source = Source::new(text, "x.toml");
        let document = Document::parse(&source).unwrap();
        read(document.root())
    }

    #[test]
    fn values_are_read_by_type() {
        let text = "s = 's'\ni = 0x10\nn = 3\nf = 1.5\nb = true\nl = ['a', 'b']\nq = '2 mm'\n";
        with_root(text, |mut root| {
            assert_eq!(root.string("s").unwrap().unwrap().value, "s");
            assert_eq!(root.integer("i").unwrap().unwrap().value, 16);
            assert_eq!(root.number("i").unwrap().unwrap().value, 16.0);
            assert_eq!(root.number("n").unwrap().unwrap().value, 3.0);
            assert_eq!(root.number("f").unwrap().unwrap().value, 1.5);
            assert!(root.boolean("b").unwrap().unwrap().value);
            assert_eq!(root.string_or_list("l").unwrap().unwrap().len(), 2);
            assert_eq!(root.string_or_list("s").unwrap().unwrap().len(), 1);
            let quantity = root.quantity("q").unwrap().unwrap();
            assert_eq!(quantity.value.value, 2e-3);
            assert_eq!(&text[quantity.span], "'2 mm'");
            assert_eq!(root.string("missing").unwrap(), None);
            root.finish().unwrap();
        });
    }

    #[test]
    fn wrong_types_say_what_was_found_and_expected() {
        with_root(
            "a = nan\nb = 1e999\nc = 'x'\nd = [1]\ne = -1",
            |mut root| {
                assert!(root.number("a").is_err());
                assert!(root.number("b").is_err());
                let error = root.number("c").unwrap_err();
                assert_eq!(
                    error.to_string(),
                    "x.toml:3: `c`: found the text \"x\"; expected a number"
                );
                assert!(root.strings("d").is_err());
                assert!(root.integer("e").is_err());
                assert!(root.table("e").is_err());
                assert!(root.tables("e").is_err());
            },
        );
        with_root("[a]\nx = 1", |mut root| {
            let error = root.tables("a").unwrap_err();
            assert!(error.help.unwrap().contains("[[a]]"));
        });
    }
}
