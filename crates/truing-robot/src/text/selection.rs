//! Selections of rows: `0:400`, `plane == 'wall' and rep != 2`.

use std::cmp::Ordering;
use std::fmt;

use super::error::{InputError, ValueError, short};
use super::selection_syntax::{Comparison, Expression, Operand, parse_expression};
use super::table::Table;

/// A choice of rows of a table: a range, or a condition on their cells.
///
/// A range is `start:end`, counted from 0, without the end; either side may be left out, and a
/// negative one counts from the end. A condition compares columns, numbers and 'texts' in quotes
/// with `==`, `!=`, `<`, `<=`, `>`, `>=`, joined by `and`, `or`, `not` and parentheses. Two numbers
/// are compared as numbers, anything else as texts; what is not a number is neither above nor
/// below one. Cells are compared as they are written, without regard to units.
#[derive(Debug, Clone, PartialEq)]
pub struct Selection {
    text: String,
    rule: Rule,
}

#[derive(Debug, Clone, PartialEq)]
enum Rule {
    Range {
        start: Option<i64>,
        end: Option<i64>,
    },
    Condition(Expression),
}

impl Selection {
    /// Parses a selection.
    ///
    /// # Errors
    ///
    /// The text is neither a range nor a condition.
    pub fn parse(text: &str) -> Result<Self, ValueError> {
        let trimmed = text.trim();
        let range = |c: char| c.is_ascii_digit() || c.is_whitespace() || "+-:".contains(c);
        let rule = if !trimmed.is_empty() && trimmed.chars().all(range) {
            parse_range(trimmed)?
        } else {
            Rule::Condition(parse_expression(trimmed)?)
        };
        Ok(Self {
            text: trimmed.to_owned(),
            rule,
        })
    }

    /// The selection as it was written.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.text
    }

    /// The rows of the table that are selected, counted from 0, in the order of the file.
    ///
    /// # Errors
    ///
    /// A column is not in the table, a range goes beyond its end, or nothing is selected. The
    /// error is about the table; [`InputError::moved_to`] places it where the selection is written.
    pub fn apply(&self, table: &Table) -> Result<Vec<usize>, InputError> {
        let rows: Vec<usize> = match &self.rule {
            Rule::Range { start, end } => {
                let bound = |bound: Option<i64>, default| self.bound(bound, default, table);
                (bound(*start, 0)?..bound(*end, table.len())?).collect()
            }
            Rule::Condition(condition) => {
                let condition = self.bind(condition, table)?;
                (0..table.len())
                    .filter(|&row| condition.holds(table, row))
                    .collect()
            }
        };
        if rows.is_empty() {
            let error = self.error(
                table,
                format!(
                    "selects none of the {} rows of {}",
                    table.len(),
                    table.path().display()
                ),
            );
            return Err(error.with_help("check the bounds, or how the cells are written"));
        }
        Ok(rows)
    }

    /// A bound of a range as a row number.
    fn bound(
        &self,
        bound: Option<i64>,
        default: usize,
        table: &Table,
    ) -> Result<usize, InputError> {
        let Some(bound) = bound else {
            return Ok(default);
        };
        let size = usize::try_from(bound.unsigned_abs()).unwrap_or(usize::MAX);
        if size > table.len() {
            let rows = table.len();
            let message = format!("goes to row {bound}; expected at most {rows}, all there are");
            let help = "leave the bound out to take all rows to the end";
            return Err(self.error(table, message).with_help(help));
        }
        Ok(if bound < 0 { table.len() - size } else { size })
    }

    /// The condition with the columns looked up in the table.
    fn bind<'s>(
        &self,
        expression: &'s Expression,
        table: &Table,
    ) -> Result<Condition<'s>, InputError> {
        Ok(match expression {
            Expression::And(a, b) => {
                Condition::And(Box::new([self.bind(a, table)?, self.bind(b, table)?]))
            }
            Expression::Or(a, b) => {
                Condition::Or(Box::new([self.bind(a, table)?, self.bind(b, table)?]))
            }
            Expression::Not(a) => Condition::Not(Box::new(self.bind(a, table)?)),
            Expression::Compare(a, comparison, b) => Condition::Compare(
                self.bind_operand(a, table)?,
                *comparison,
                self.bind_operand(b, table)?,
            ),
        })
    }

    fn bind_operand<'s>(
        &self,
        operand: &'s Operand,
        table: &Table,
    ) -> Result<Side<'s>, InputError> {
        Ok(match operand {
            Operand::Number(number, text) => Side::Constant(Some(*number), text),
            Operand::Text(text) => Side::Constant(None, text),
            Operand::Column(name) => Side::Column(table.column(name).map_err(|missing| {
                let error = self.error(table, missing.message);
                error.with_help(match missing.help {
                    Some(help) if help.starts_with("did") => help.into_string(),
                    _ => format!("put quotes around a text: '{}'", short(name)),
                })
            })?),
        })
    }

    fn error(&self, table: &Table, message: impl fmt::Display) -> InputError {
        let text = short(&self.text);
        InputError::new(table.path(), format!("rows = \"{text}\": {message}"))
    }
}

impl fmt::Display for Selection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

fn parse_range(text: &str) -> Result<Rule, ValueError> {
    let parts: Vec<&str> = text.split(':').map(str::trim).collect();
    let bound = |part: &str| match part {
        "" => Ok(None),
        _ => part.parse().map(Some).map_err(|_| {
            let message = format!("`{}` is not a row number", short(part));
            ValueError::new(message).with_help("write a range like \"0:400\"")
        }),
    };
    match parts.as_slice() {
        [start, end] => Ok(Rule::Range {
            start: bound(start)?,
            end: bound(end)?,
        }),
        [_] => Err(ValueError::new(format!(
            "found `{}`; expected a range like \"0:400\" or a condition",
            short(text)
        ))
        .with_help("row 5 alone is \"5:6\"")),
        _ => Err(ValueError::new(format!(
            "found `{}`; expected a range with one colon, like \"0:400\"",
            short(text)
        ))
        .with_help("ranges have no step; use `holdout = { every = … }` to take every n-th row")),
    }
}

/// A condition on the columns of a known table.
enum Condition<'s> {
    And(Box<[Condition<'s>; 2]>),
    Or(Box<[Condition<'s>; 2]>),
    Not(Box<Condition<'s>>),
    Compare(Side<'s>, Comparison, Side<'s>),
}

impl Condition<'_> {
    fn holds(&self, table: &Table, row: usize) -> bool {
        match self {
            Self::And(both) => both.iter().all(|part| part.holds(table, row)),
            Self::Or(both) => both.iter().any(|part| part.holds(table, row)),
            Self::Not(part) => !part.holds(table, row),
            Self::Compare(a, comparison, b) => {
                let (a_number, a_text) = a.value(table, row);
                let (b_number, b_text) = b.value(table, row);
                let ordering = match (a_number, b_number) {
                    (Some(a), Some(b)) => a.partial_cmp(&b),
                    _ if a_text == b_text => Some(Ordering::Equal),
                    (None, None) => Some(a_text.cmp(b_text)),
                    // A number and a text differ, and neither comes first.
                    _ => None,
                };
                comparison.holds(ordering)
            }
        }
    }
}

/// A side of a comparison: a column, or a constant with its number and text.
enum Side<'s> {
    Column(usize),
    Constant(Option<f64>, &'s str),
}

impl Side<'_> {
    /// The finite number, if it is one, and the text.
    fn value<'v>(&'v self, table: &'v Table, row: usize) -> (Option<f64>, &'v str) {
        match self {
            Self::Constant(number, text) => (*number, text),
            Self::Column(column) => {
                let cell = table.cell(row, *column);
                let number = cell.parse().ok().filter(|number: &f64| number.is_finite());
                (number, cell)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let text = "plane,rep,x [mm],my col\nwall,1,0.4,a\nwall,2,0.6,b\nfloor,02,n/a,c\n,3,,d\n";
        Table::parse(text, "t.csv").unwrap()
    }

    fn rows(text: &str) -> Vec<usize> {
        Selection::parse(text).unwrap().apply(&table()).unwrap()
    }

    fn error(text: &str) -> InputError {
        Selection::parse(text).unwrap().apply(&table()).unwrap_err()
    }

    #[test]
    fn ranges_are_half_open_and_counted_from_zero() {
        assert_eq!(rows("0:2"), [0, 1]);
        assert_eq!(rows(" 2 : "), [2, 3]);
        assert_eq!(rows(":1"), [0]);
        assert_eq!(rows(":"), [0, 1, 2, 3]);
        assert_eq!(rows("-1:"), [3]);
        assert_eq!(rows("1:-1"), [1, 2]);
        assert!(error("0:5").message.contains("goes to row 5"));
        assert!(error("-5:").message.contains("-5"));
        assert!(error("2:2").message.contains("none of the 4 rows"));
        assert!(error("3:1").message.contains("none of the 4 rows"));
    }

    #[test]
    fn conditions_compare_numbers_as_numbers_and_texts_as_texts() {
        assert_eq!(rows("plane == 'wall'"), [0, 1]);
        assert_eq!(rows("plane != \"wall\""), [2, 3]);
        assert_eq!(rows("rep == 2"), [1, 2]);
        assert_eq!(rows("rep == '2'"), [1]);
        assert_eq!(rows("x > 0.5"), [1]);
        assert_eq!(rows("0.5 > x"), [0]);
        assert_eq!(rows("x != 0.4"), [1, 2, 3]);
        assert_eq!(rows("x == ''"), [3]);
        assert_eq!(rows("`my col` >= 'c'"), [2, 3]);
        assert_eq!(rows("not plane == 'wall'"), [2, 3]);
        assert_eq!(rows("rep != 2 and plane == \"wall\""), [0]);
        assert_eq!(rows("rep==1 or rep==3 and plane==''"), [0, 3]);
        assert_eq!(rows("(rep == 1 or rep == 3) and not (plane == '')"), [0]);
        assert_eq!(rows("rep >= -1e0"), [0, 1, 2, 3]);
        assert_eq!(rows("rep == rep"), [0, 1, 2, 3]);
    }

    #[test]
    fn errors_of_a_selection_say_what_to_do() {
        let wrong = error("plan == 'wall'");
        assert!(wrong.message.contains("no column `plan`"), "{wrong}");
        assert_eq!(wrong.help.as_deref(), Some("did you mean `plane`?"));
        let wrong = error("plane == wall");
        assert_eq!(
            wrong.help.as_deref(),
            Some("put quotes around a text: 'wall'")
        );
        assert!(error("rep > 10").message.contains("selects none"));
    }

    #[test]
    fn ranges_that_are_not_ranges_are_refused() {
        for text in ["5", "0:10:2", "99999999999999999999:", "--1:", "1 2:"] {
            let error = Selection::parse(text).unwrap_err();
            assert!(error.help.is_some(), "{text}");
        }
    }
}
