//! Reading a TOML table by hand, so that every error can point at the key it is about.

use std::collections::BTreeMap;
use std::ops::Range;

use toml::de::{DeTable, DeValue};

use super::error::{InputError, Source, nearest, one_of, short};
use super::item::Item;
use super::quantity::{Dimension, Quantity, Units};
use super::spanned::Spanned;

/// The places of a table and of its values, for errors found after reading.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Spans {
    table: Range<usize>,
    values: BTreeMap<String, Range<usize>>,
}

impl Spans {
    /// The place of the table, in bytes.
    #[must_use]
    pub fn table(&self) -> Range<usize> {
        self.table.clone()
    }

    /// The place of the value of `key`, in bytes; that of the table if the key was left out.
    #[must_use]
    pub fn of(&self, key: &str) -> Range<usize> {
        self.values.get(key).unwrap_or(&self.table).clone()
    }
}

/// A parsed TOML file.
#[derive(Debug)]
pub struct Document<'s> {
    source: &'s Source,
    table: toml::Spanned<DeTable<'s>>,
}

impl<'s> Document<'s> {
    /// Parses the text of a file.
    ///
    /// # Errors
    ///
    /// The text is not TOML.
    pub fn parse(source: &'s Source) -> Result<Self, InputError> {
        match DeTable::parse(&source.text) {
            Ok(table) => Ok(Self { source, table }),
            Err(error) => {
                let (message, help) = explain(&error, &source.text);
                let error = match error.span() {
                    Some(span) => source.error_at(span, message),
                    None => source.error(message),
                };
                Err(error.with_help(help))
            }
        }
    }

    /// The table of the whole file.
    #[must_use]
    pub fn root(&self) -> Section<'_> {
        let title = "this file".to_owned();
        Section::new(self.source, title, 0..0, self.table.get_ref())
    }
}

/// What a syntax error means, and what to do: in plain words where the mistake is a usual one.
fn explain(error: &toml::de::Error, text: &str) -> (String, String) {
    let span = error.span().unwrap_or_default();
    let found = text.get(span.clone()).unwrap_or_default().trim();
    let before = text.get(..span.start).unwrap_or_default();
    let message: Vec<&str> = error.message().lines().map(str::trim).collect();
    let message = message.join("; ");
    if message == "duplicate key" {
        let help = if text.contains(&format!("[[{found}]]")) {
            format!("write [[{found}]], with two brackets, for every one of them")
        } else {
            "keep one of the two, or give one another name".to_owned()
        };
        return (
            format!("`{}` is there twice; expected once", short(found)),
            help,
        );
    }
    let bare = found.starts_with(|c: char| c.is_alphabetic() || "./~".contains(c));
    if bare && before.trim_end().ends_with(['=', '[', ',']) && !found.contains('"') {
        return (
            format!(
                "found `{}`; expected a number, `true`, `false`, or a text in quotes",
                short(found)
            ),
            format!("put quotes around a text: \"{}\"", short(found)),
        );
    }
    let digit = |c: Option<char>| c.is_some_and(|c| c.is_ascii_digit());
    let comma = [span.start, span.start.saturating_sub(1)]
        .into_iter()
        .find(|at| text.get(*at..).is_some_and(|rest| rest.starts_with(',')));
    let help = match comma {
        Some(at)
            if digit(text[..at].chars().next_back()) && digit(text[at + 1..].chars().next()) =>
        {
            "write a decimal point, not a comma"
        }
        _ => "correct the text here: `key = value` lines, texts in quotes, tables in [brackets]",
    };
    (format!("this is not TOML: {message}"), help.to_owned())
}

impl<'a> Item<'a> {
    /// The table.
    ///
    /// # Errors
    ///
    /// The value is not a table.
    pub fn table(&self) -> Result<Section<'a>, InputError> {
        let DeValue::Table(table) = self.value.get_ref() else {
            return Err(self.wrong_type("a table"));
        };
        let title = format!("`{}`", self.name);
        Ok(Section::new(self.source, title, self.span(), table))
    }
}

/// A table being read. It remembers the keys it was asked for: any other one is unknown.
#[derive(Debug)]
pub struct Section<'a> {
    source: &'a Source,
    title: String,
    span: Range<usize>,
    table: &'a DeTable<'a>,
    asked: Vec<String>,
}

impl<'a> Section<'a> {
    /// A table at a place, of which nothing was read yet.
    pub(crate) fn new(
        source: &'a Source,
        title: String,
        span: Range<usize>,
        table: &'a DeTable<'a>,
    ) -> Self {
        Self {
            source,
            title,
            span,
            table,
            asked: Vec::new(),
        }
    }

    /// What messages call this table, such as `[base]`.
    #[must_use]
    pub fn title(&self) -> &str {
        &self.title
    }

    /// The same table under another name in messages.
    #[must_use]
    pub fn titled(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }

    /// The place of the table, in bytes.
    #[must_use]
    pub fn span(&self) -> Range<usize> {
        self.span.clone()
    }

    /// The places of the table and of its values.
    #[must_use]
    pub fn spans(&self) -> Spans {
        let values = self.table.iter();
        Spans {
            table: self.span.clone(),
            values: values
                .map(|(key, value)| (key.get_ref().to_string(), value.span()))
                .collect(),
        }
    }

    /// The value of `key`, if it is there.
    pub fn get(&mut self, key: &str) -> Option<Item<'a>> {
        if !self.asked.iter().any(|asked| asked == key) {
            self.asked.push(key.to_owned());
        }
        self.peek(key)
    }

    /// The value of `key`, if it is there, without making it a known key.
    #[must_use]
    pub fn peek(&self, key: &str) -> Option<Item<'a>> {
        let (key, value) = self.table.get_key_value(key)?;
        Some(Item {
            source: self.source,
            name: key.get_ref().to_string(),
            key: key.span(),
            value,
        })
    }

    /// The value of `key`, which must be there; `expected` says what it is.
    ///
    /// # Errors
    ///
    /// The key is missing.
    pub fn require(&mut self, key: &str, expected: &str) -> Result<Item<'a>, InputError> {
        self.get(key).ok_or_else(|| {
            let unknown = self.unasked();
            let error = self.error(format!("{} has no `{key}`: {expected}", self.title));
            match nearest(key, unknown.iter().map(|item| item.name.as_str())) {
                Some(near) => error.with_help(format!("is `{near}` meant to be `{key}`?")),
                None => error.with_help(format!("add a line `{key} = …`")),
            }
        })
    }

    /// All the values, in the order of the file: for tables whose keys are free.
    pub fn entries(&mut self) -> Vec<Item<'a>> {
        let entries = self.unasked();
        self.asked
            .extend(entries.iter().map(|item| item.name.clone()));
        entries
    }

    /// The text of `key`, if it is there.
    ///
    /// # Errors
    ///
    /// The value is not a text.
    pub fn string(&mut self, key: &str) -> Result<Option<Spanned<String>>, InputError> {
        self.get(key).map(|item| item.string()).transpose()
    }

    /// The finite number of `key`, if it is there; integers are numbers too.
    ///
    /// # Errors
    ///
    /// The value is not a finite number.
    pub fn number(&mut self, key: &str) -> Result<Option<Spanned<f64>>, InputError> {
        self.get(key).map(|item| item.number()).transpose()
    }

    /// The truth value of `key`, if it is there.
    ///
    /// # Errors
    ///
    /// The value is not `true` or `false`.
    pub fn boolean(&mut self, key: &str) -> Result<Option<Spanned<bool>>, InputError> {
        self.get(key).map(|item| item.boolean()).transpose()
    }

    /// The integer of `key`, zero or more, if it is there.
    ///
    /// # Errors
    ///
    /// The value is not such an integer.
    pub fn integer(&mut self, key: &str) -> Result<Option<Spanned<usize>>, InputError> {
        self.get(key).map(|item| item.integer()).transpose()
    }

    /// The list of texts of `key`, if it is there.
    ///
    /// # Errors
    ///
    /// The value is not a list of texts.
    pub fn strings(&mut self, key: &str) -> Result<Option<Vec<Spanned<String>>>, InputError> {
        self.get(key).map(|item| item.strings()).transpose()
    }

    /// The text, or the list of texts, of `key`, if it is there.
    ///
    /// # Errors
    ///
    /// The value is neither.
    pub fn string_or_list(
        &mut self,
        key: &str,
    ) -> Result<Option<Vec<Spanned<String>>>, InputError> {
        self.get(key).map(|item| item.string_or_list()).transpose()
    }

    /// The quantity of `key`, if it is there: a number, or a text like "0.1 mm".
    ///
    /// # Errors
    ///
    /// The value is not a quantity.
    pub fn quantity(&mut self, key: &str) -> Result<Option<Spanned<Quantity>>, InputError> {
        self.get(key).map(|item| item.quantity()).transpose()
    }

    /// The table of `key`, if it is there.
    ///
    /// # Errors
    ///
    /// The value is not a table.
    pub fn table(&mut self, key: &str) -> Result<Option<Section<'a>>, InputError> {
        self.get(key).map(|item| item.table()).transpose()
    }

    /// The tables `[[key]]`, none if it is not there.
    ///
    /// # Errors
    ///
    /// The value is not a list of tables.
    pub fn tables(&mut self, key: &str) -> Result<Vec<Section<'a>>, InputError> {
        let Some(item) = self.get(key) else {
            return Ok(Vec::new());
        };
        if let DeValue::Table(_) = item.value.get_ref() {
            let message = format!("found one table [{key}]; expected a list of tables");
            let help = format!("write [[{key}]], with two brackets");
            return Err(item.error(message).with_help(help));
        }
        let items = item.list("a list of tables")?;
        let tables = items.into_iter().map(|item| item.table());
        tables
            .map(|table| table.map(|table| table.titled(format!("[[{key}]]"))))
            .collect()
    }

    /// The table `units = { angle = "deg", length = "mm" }`; metres and radians if it is not there.
    ///
    /// # Errors
    ///
    /// A unit does not exist or measures something else.
    pub fn units(&mut self) -> Result<Units, InputError> {
        let mut units = Units::SI;
        let Some(mut table) = self.table("units")? else {
            return Ok(units);
        };
        for (key, dimension, factor) in [
            ("length", Dimension::Length, &mut units.length),
            ("angle", Dimension::Angle, &mut units.angle),
        ] {
            if let Some(item) = table.get(key) {
                let name = item.string()?.value;
                *factor = Units::size(&name, dimension).map_err(|error| item.refuse(error))?;
            }
        }
        table.finish()?;
        Ok(units)
    }

    /// The error of `message` at this table.
    #[must_use]
    pub fn error(&self, message: impl Into<String>) -> InputError {
        if self.span.is_empty() {
            return self.source.error(message);
        }
        self.source.error_at(self.span.clone(), message)
    }

    /// Ends the reading.
    ///
    /// # Errors
    ///
    /// The table has a key that was never asked for.
    pub fn finish(self) -> Result<(), InputError> {
        let Some(unknown) = self.unasked().into_iter().next() else {
            return Ok(());
        };
        let message = format!("unknown key `{}` in {}", short(&unknown.name), self.title);
        let error = self.source.error_at(unknown.key, message);
        let known: Vec<&str> = self.asked.iter().map(String::as_str).collect();
        Err(match nearest(&unknown.name, known.iter().copied()) {
            Some(near) => error.with_help(format!("did you mean `{near}`?")),
            None if known.is_empty() => error.with_help("remove it"),
            None if known.len() == 1 => {
                error.with_help(format!("the only key here is `{}`", known[0]))
            }
            None => error.with_help(format!("the keys here are {}", one_of(&known))),
        })
    }

    /// The values of this table, and those of another one that it does not have itself; without the
    /// keys `but`.
    pub(crate) fn over(&self, other: Option<&Section<'a>>, but: &[&str]) -> DeTable<'a> {
        let mut merged = other.map_or_else(DeTable::new, |other| other.table.clone());
        for (key, value) in self.table {
            if !but.contains(&key.get_ref().as_ref()) {
                merged.remove(key.get_ref().as_ref());
                merged.insert(key.clone(), value.clone());
            }
        }
        merged
    }

    /// The same table with other values, of which the keys `known` are named in messages.
    pub(crate) fn with<'t>(self, values: &'t DeTable<'t>, known: &[&str]) -> Section<'t>
    where
        'a: 't,
    {
        Section {
            source: self.source,
            title: self.title,
            span: self.span,
            table: values,
            asked: known.iter().map(|key| (*key).to_owned()).collect(),
        }
    }

    /// The values that were not asked for, in the order of the file.
    fn unasked(&self) -> Vec<Item<'a>> {
        let mut items: Vec<Item<'a>> = self
            .table
            .iter()
            .map(|(key, value)| Item {
                source: self.source,
                name: key.get_ref().to_string(),
                key: key.span(),
                value,
            })
            .filter(|item| !self.asked.contains(&item.name))
            .collect();
        items.sort_by_key(|item| item.key.start);
        items
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with_root<T>(text: &str, read: impl FnOnce(Section<'_>) -> T) -> T {
        let source = Source::new(text, "x.toml");
        let document = Document::parse(&source).unwrap();
        read(document.root())
    }

    #[test]
    fn syntax_errors_have_a_place_and_one_line() {
        for text in [
            "a = ",
            "a = 1\na = 2",
            "[x",
            "a = \"",
            "\u{0}",
            "é = 1",
            "[[a]]\n[a]",
        ] {
            let source = Source::new(text, "x.toml");
            let error = Document::parse(&source).unwrap_err();
            assert!(error.span.is_some(), "{text:?}");
            assert!(!error.to_string().contains('\n'), "{error}");
        }
        let deep = format!("a = {}", "[".repeat(100_000));
        assert!(Document::parse(&Source::new(&deep, "x")).is_err());
    }

    #[test]
    fn the_first_unknown_key_is_reported_with_the_nearest() {
        with_root("zeta = 1\nsgima = 2\n", |mut root| {
            root.get("sigma");
            root.get("zeta");
            let error = root.finish().unwrap_err();
            assert_eq!(error.line, Some(2));
            assert_eq!(error.help.as_deref(), Some("did you mean `sigma`?"));
        });
    }

    #[test]
    fn units_are_checked() {
        with_root("units = { angle = 'deg', length = 'mm' }", |mut root| {
            let units = root.units().unwrap();
            assert_eq!(units.length, 1e-3);
            assert_eq!(units.angle, 1f64.to_radians());
        });
        for text in [
            "units = { angle = 'mm' }",
            "units = { length = 1 }",
            "units = { x = 'm' }",
        ] {
            with_root(text, |mut root| assert!(root.units().is_err(), "{text}"));
        }
    }

    #[test]
    fn tables_know_their_place() {
        let text = "[[joint]]\na = 1\n\n[[joint]]\nb = 2\n";
        with_root(text, |mut root| {
            let tables = root.tables("joint").unwrap();
            let error = tables[1].error("x");
            assert_eq!(error.line, Some(4));
            let spans = tables[1].spans();
            assert_eq!(&text[spans.of("b")], "2");
            assert_eq!(spans.of("none"), spans.table());
        });
    }
}
