//! Tables of data: CSV with a header.

use std::path::{Path, PathBuf};

use super::error::{InputError, Source, nearest, short};
use super::quantity::{Dimension, Units};

/// The largest number a cell may hold [m, rad or 1]: larger ones are mistakes, and overflow in models.
const LARGEST: f64 = 1e12;

/// A table of data with named columns. Its cells are texts until they are asked for as numbers.
#[derive(Debug, Clone)]
pub struct Table {
    path: PathBuf,
    columns: Vec<Column>,
    header_line: usize,
    /// The line of each row, counted from 1.
    lines: Vec<usize>,
    /// All cells, row by row, without anything between them; `ends` says where each one ends.
    cells: String,
    ends: Vec<usize>,
}

/// A column: its name, and its unit where the header has one.
#[derive(Debug, Clone)]
struct Column {
    name: String,
    unit: Option<String>,
}

impl Column {
    /// Reads a header cell: `q1`, `q1 [deg]`.
    fn parse(cell: &str) -> Self {
        if let Some((name, unit)) = cell
            .strip_suffix(']')
            .and_then(|cell| cell.rsplit_once('['))
        {
            return Self {
                name: name.trim().to_owned(),
                unit: Some(unit.trim().to_owned()),
            };
        }
        Self {
            name: cell.to_owned(),
            unit: None,
        }
    }
}

impl Table {
    /// Reads a CSV file.
    ///
    /// # Errors
    ///
    /// The file cannot be read, has no header or no rows, a column without a name or two with the
    /// same, or a row with too few or too many cells.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, InputError> {
        Self::from_source(&Source::read(path)?)
    }

    /// Reads CSV text; `path` is for messages.
    ///
    /// # Errors
    ///
    /// Those of [`Table::read`].
    pub fn parse(text: &str, path: impl Into<PathBuf>) -> Result<Self, InputError> {
        Self::from_source(&Source::new(text, path))
    }

    fn from_source(source: &Source) -> Result<Self, InputError> {
        let mut lines = Lines::new(&source.text);
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(source.text.as_bytes());
        let mut table = Self {
            path: source.path.clone(),
            columns: Vec::new(),
            header_line: 1,
            lines: Vec::new(),
            cells: String::new(),
            ends: Vec::new(),
        };
        let mut record = csv::StringRecord::new();
        loop {
            let more = reader.read_record(&mut record);
            let start = record.position().map_or(0, csv::Position::byte);
            let line = lines.of(usize::try_from(start).unwrap_or(usize::MAX));
            match more {
                Ok(true) => {}
                Ok(false) => break,
                Err(error) => {
                    let error = table.error(line, format!("this is not CSV: {error}"));
                    return Err(error.with_help("write cells separated by commas, a row a line"));
                }
            }
            if let Some(cell) = record.iter().find(|cell| cell.contains(['\n', '\r'])) {
                let message = format!("the cell `{}` goes over several lines", short(cell));
                let help = "close the quote that opens it, or write it on one line";
                return Err(table.error(line, message).with_help(help));
            }
            if table.columns.is_empty() {
                table.header(&record, line)?;
            } else {
                table.row(&record, line)?;
            }
        }
        if table.columns.is_empty() {
            return Err(InputError::new(
                table.path,
                "this file is empty; expected a header and rows",
            )
            .with_help("write the names of the columns on the first line"));
        }
        if table.lines.is_empty() {
            let message = "found a header and no rows; expected at least one row of data";
            return Err(table
                .error(table.header_line, message)
                .with_help("add the measurements, or leave this file out"));
        }
        Ok(table)
    }

    fn header(&mut self, record: &csv::StringRecord, line: usize) -> Result<(), InputError> {
        self.header_line = line;
        if let (1, Some(cell)) = (record.len(), record.get(0)) {
            for (mark, name) in [(';', "semicolons"), ('\t', "tabs")] {
                if cell.contains(mark) {
                    let message = format!("the columns are separated by {name}; expected commas");
                    let help = "save the file with commas between columns and decimal points";
                    return Err(self.error(line, message).with_help(help));
                }
            }
        }
        let columns: Vec<Column> = record.iter().map(Column::parse).collect();
        for (i, column) in columns.iter().enumerate() {
            let number = i + 1;
            if column.name.is_empty() {
                let message = format!("column {number} has no name");
                let help = "name it, or remove the column or a comma too many";
                return Err(self.error(line, message).with_help(help));
            }
            if let Some(first) = columns[..i].iter().position(|c| c.name == column.name) {
                let message = format!(
                    "columns {} and {number} are both called `{}`",
                    first + 1,
                    short(&column.name)
                );
                let help = "give every column its own name";
                return Err(self.error(line, message).with_help(help));
            }
        }
        if columns.iter().all(|c| c.name.parse::<f64>().is_ok()) {
            let message = "found numbers; expected the names of the columns";
            let help = "write a header line above the data, like `q1,q2,x,y,z`";
            return Err(self.error(line, message).with_help(help));
        }
        self.columns = columns;
        Ok(())
    }

    fn row(&mut self, record: &csv::StringRecord, line: usize) -> Result<(), InputError> {
        let (found, expected) = (record.len(), self.columns.len());
        if found != expected {
            let message = format!("found {found} cells; expected {expected}, as in the header");
            return Err(self.error(line, message).with_help(if found < expected {
                "fill in the missing cells, leaving a cell empty where there is no value"
            } else {
                "remove the extra cells, or put quotes around a cell that has a comma in it"
            }));
        }
        for cell in record {
            self.cells.push_str(cell);
            self.ends.push(self.cells.len());
        }
        self.lines.push(line);
        Ok(())
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lines.len()
    }

    /// Whether there are no rows; never so for a table that was read.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    /// The names of the columns, in the order of the file, without units.
    pub fn column_names(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().map(|column| column.name.as_str())
    }

    /// Whether there is a column `name`.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.column_names().any(|column| column == name)
    }

    /// The line of a row in the file, counted from 1.
    ///
    /// # Panics
    ///
    /// The row is not below [`Table::len`].
    #[must_use]
    #[track_caller]
    pub fn line(&self, row: usize) -> usize {
        self.lines[row]
    }

    /// The numbers of a column in the given rows, in m, rad or 1.
    ///
    /// The unit in the header counts, and `units` where there is none.
    ///
    /// # Errors
    ///
    /// There is no such column, its unit does not measure `dimension`, or a cell is not a finite
    /// number.
    ///
    /// # Panics
    ///
    /// A row is not below [`Table::len`].
    #[track_caller]
    pub fn numbers(
        &self,
        name: &str,
        dimension: Dimension,
        units: &Units,
        rows: &[usize],
    ) -> Result<Vec<f64>, InputError> {
        let column = self.column(name)?;
        let factor = match self.columns[column].unit.as_deref() {
            None => units.factor(dimension),
            Some("" | "-" | "1") if dimension == Dimension::None => 1.0,
            Some(unit) => Units::size(unit, dimension).map_err(|error| {
                let message = format!("column `{}`: {}", short(name), error.message);
                let wrong = self.error(self.header_line, message);
                match error.help {
                    Some(help) => wrong.with_help(help),
                    None => wrong,
                }
            })?,
        };
        let mut numbers = Vec::with_capacity(rows.len());
        for &row in rows {
            let cell = self.cell(row, column);
            match cell.parse::<f64>() {
                Ok(number) if (number * factor).abs() <= LARGEST => numbers.push(number * factor),
                Ok(number) if number.is_finite() => {
                    let (name, cell) = (short(name), short(cell));
                    let message = format!(
                        "column `{name}`: found `{cell}`; expected a number of ordinary size"
                    );
                    let help = "correct the cell, or the unit in the header";
                    return Err(self.error_at(row, message).with_help(help));
                }
                parsed => return Err(self.not_a_number(name, row, cell, parsed.is_ok())),
            }
        }
        Ok(numbers)
    }

    /// The texts of a column in the given rows.
    ///
    /// # Errors
    ///
    /// There is no such column.
    ///
    /// # Panics
    ///
    /// A row is not below [`Table::len`].
    #[track_caller]
    pub fn strings(&self, name: &str, rows: &[usize]) -> Result<Vec<&str>, InputError> {
        let column = self.column(name)?;
        Ok(rows.iter().map(|&row| self.cell(row, column)).collect())
    }

    /// The error of `message` about a row.
    ///
    /// # Panics
    ///
    /// The row is not below [`Table::len`].
    #[must_use]
    #[track_caller]
    pub fn error_at(&self, row: usize, message: impl Into<String>) -> InputError {
        self.error(self.lines[row], message)
    }

    /// The error of `message` about the header.
    #[must_use]
    pub fn header_error(&self, message: impl Into<String>) -> InputError {
        self.error(self.header_line, message)
    }

    /// The place of a column.
    pub(crate) fn column(&self, name: &str) -> Result<usize, InputError> {
        let found = self.columns.iter().position(|column| column.name == name);
        found.ok_or_else(|| {
            let message = format!(
                "there is no column `{}`; the columns are {}",
                short(name),
                self.listed()
            );
            self.error(self.header_line, message).with_help(
                match nearest(name, self.column_names()) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => "add the column, or name another".to_owned(),
                },
            )
        })
    }

    /// The text of a cell.
    #[track_caller]
    pub(crate) fn cell(&self, row: usize, column: usize) -> &str {
        let index = row * self.columns.len() + column;
        let start = match index {
            0 => 0,
            _ => self.ends[index - 1],
        };
        &self.cells[start..self.ends[index]]
    }

    /// The names of the columns in words, not too many of them.
    fn listed(&self) -> String {
        const MOST: usize = 30;
        let names: Vec<_> = self.column_names().take(MOST).map(short).collect();
        let rest = self.columns.len() - names.len();
        let names = names.join(", ");
        match rest {
            0 => names,
            rest => format!("{names} and {rest} more"),
        }
    }

    fn not_a_number(&self, name: &str, row: usize, cell: &str, parsed: bool) -> InputError {
        let (name, found) = (short(name), short(cell));
        let found = match cell {
            "" => "an empty cell".to_owned(),
            _ => format!("`{found}`"),
        };
        let kind = if parsed {
            "a finite number"
        } else {
            "a number"
        };
        let message = format!("column `{name}`: found {found}; expected {kind}");
        let help = if cell.contains(',') {
            "write a decimal point, not a comma"
        } else {
            "correct the cell, remove the row, or leave it out with `rows = …`"
        };
        self.error_at(row, message).with_help(help)
    }

    fn error(&self, line: usize, message: impl Into<String>) -> InputError {
        InputError::new(self.path.clone(), message).with_line(line)
    }
}

/// Counts the lines of a text up to growing offsets. Lines end with LF, CRLF or CR.
struct Lines<'t> {
    bytes: &'t [u8],
    at: usize,
    line: usize,
}

impl<'t> Lines<'t> {
    fn new(text: &'t str) -> Self {
        Self {
            bytes: text.as_bytes(),
            at: 0,
            line: 1,
        }
    }

    /// The line, counted from 1, of the first text at or after `offset`: blank lines are skipped.
    fn of(&mut self, offset: usize) -> usize {
        while let Some(&byte) = self.bytes.get(self.at) {
            if self.at >= offset && byte != b'\n' && byte != b'\r' {
                break;
            }
            self.at += 1;
            let crlf = byte == b'\r' && self.bytes.get(self.at) == Some(&b'\n');
            if (byte == b'\n' || byte == b'\r') && !crlf {
                self.line += 1;
            }
        }
        self.line
    }
}

#[cfg(test)]
mod tests;
