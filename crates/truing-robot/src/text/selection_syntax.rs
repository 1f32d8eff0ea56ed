//! The grammar of row conditions, by recursive descent:
//!
//! ```text
//! condition  = both { "or" both }
//! both       = negation { "and" negation }
//! negation   = "not" negation | "(" condition ")" | operand comparison operand
//! comparison = "==" | "!=" | "<" | "<=" | ">" | ">="
//! operand    = column | `column` | number | 'text' | "text"
//! ```

use std::cmp::Ordering;

use super::error::{ValueError, short};

/// A condition on the cells of a row.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Expression {
    And(Box<Expression>, Box<Expression>),
    Or(Box<Expression>, Box<Expression>),
    Not(Box<Expression>),
    Compare(Operand, Comparison, Operand),
}

/// A side of a comparison.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Operand {
    Column(String),
    /// A number, and how it was written.
    Number(f64, String),
    Text(String),
}

/// How two values are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Comparison {
    Equal,
    NotEqual,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
}

impl Comparison {
    /// Whether it holds for values in this order; `None` if neither comes first.
    pub(crate) fn holds(self, ordering: Option<Ordering>) -> bool {
        match self {
            Self::Equal => ordering.is_some_and(Ordering::is_eq),
            Self::NotEqual => !ordering.is_some_and(Ordering::is_eq),
            Self::Less => ordering.is_some_and(Ordering::is_lt),
            Self::LessOrEqual => ordering.is_some_and(Ordering::is_le),
            Self::Greater => ordering.is_some_and(Ordering::is_gt),
            Self::GreaterOrEqual => ordering.is_some_and(Ordering::is_ge),
        }
    }
}

/// Parses a condition.
pub(crate) fn parse_expression(text: &str) -> Result<Expression, ValueError> {
    let mut parser = Parser {
        tokens: tokens(text)?,
        at: 0,
        depth: 0,
    };
    let expression = parser.condition()?;
    match parser.peek() {
        None => Ok(expression),
        Some(_) => Err(parser.expected("`and`, `or` or the end")),
    }
}

const EXAMPLE: &str = "write a range like \"0:400\" or a condition like \"plane == 'wall'\"";

/// How deep parentheses and `not` may nest, and how many comparisons there may be.
const DEEPEST: usize = 64;

#[derive(Debug, Clone, PartialEq)]
enum Token {
    Open,
    Close,
    And,
    Or,
    Not,
    Comparison(Comparison),
    Operand(Operand),
}

fn tokens(text: &str) -> Result<Vec<Token>, ValueError> {
    let mut tokens = Vec::new();
    let mut rest = text.trim_start();
    while let Some(first) = rest.chars().next() {
        let (token, length) = match first {
            '(' => (Token::Open, 1),
            ')' => (Token::Close, 1),
            '\'' | '"' | '`' => quoted(rest, first)?,
            '=' | '!' | '<' | '>' | '&' | '|' => operator(rest)?,
            c if c.is_ascii_digit() || "+-.".contains(c) => number(rest)?,
            c if c.is_alphabetic() || c == '_' => word(rest),
            c => {
                let found = format!(
                    "found `{}`, which has no meaning here",
                    short(&c.to_string())
                );
                return Err(ValueError::new(found).with_help(EXAMPLE));
            }
        };
        tokens.push(token);
        rest = rest[length..].trim_start();
    }
    Ok(tokens)
}

fn quoted(rest: &str, quote: char) -> Result<(Token, usize), ValueError> {
    let Some(length) = rest[1..].find(quote) else {
        let message = format!("the quote at `{}` is not closed", short(rest));
        return Err(ValueError::new(message).with_help(format!("add another {quote}")));
    };
    let text = rest[1..=length].to_owned();
    let operand = match quote {
        '`' => Operand::Column(text.trim().to_owned()),
        _ => Operand::Text(text.trim().to_owned()),
    };
    Ok((Token::Operand(operand), length + 2))
}

fn operator(rest: &str) -> Result<(Token, usize), ValueError> {
    for (text, comparison) in [
        ("==", Comparison::Equal),
        ("!=", Comparison::NotEqual),
        ("<=", Comparison::LessOrEqual),
        (">=", Comparison::GreaterOrEqual),
        ("<", Comparison::Less),
        (">", Comparison::Greater),
    ] {
        if rest.starts_with(text) {
            return Ok((Token::Comparison(comparison), text.len()));
        }
    }
    let (found, help) = match rest.as_bytes().first() {
        Some(b'=') => ("=", "write `==` to compare"),
        Some(b'&') => ("&", "write `and`"),
        Some(b'|') => ("|", "write `or`"),
        _ => ("!", "write `not`, or `!=` to compare"),
    };
    let message = format!("found `{found}`, which has no meaning here");
    Err(ValueError::new(message).with_help(help))
}

fn number(rest: &str) -> Result<(Token, usize), ValueError> {
    let mut length = 0;
    for (at, c) in rest.char_indices() {
        let exponent = rest[..at].ends_with(['e', 'E']);
        if !(c.is_alphanumeric() || "._".contains(c) || "+-".contains(c) && (at == 0 || exponent)) {
            break;
        }
        length = at + c.len_utf8();
    }
    let text = &rest[..length];
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() => {
            let operand = Operand::Number(value, text.to_owned());
            Ok((Token::Operand(operand), length))
        }
        _ => {
            let message = format!("`{}` is not a number", short(text));
            let help = "cells are compared as they are written: leave units out, \
                        and put a column whose name starts with a digit between backquotes";
            Err(ValueError::new(message).with_help(help))
        }
    }
}

fn word(rest: &str) -> (Token, usize) {
    let length = rest
        .find(|c: char| !(c.is_alphanumeric() || c == '_' || c == '.'))
        .unwrap_or(rest.len());
    let token = match &rest[..length] {
        "and" => Token::And,
        "or" => Token::Or,
        "not" => Token::Not,
        name => Token::Operand(Operand::Column(name.to_owned())),
    };
    (token, length)
}

struct Parser {
    tokens: Vec<Token>,
    at: usize,
    depth: usize,
}

impl Parser {
    fn peek(&self) -> Option<&Token> {
        self.tokens.get(self.at)
    }

    /// Takes the next token if it is this one.
    fn take(&mut self, token: &Token) -> bool {
        let found = self.peek() == Some(token);
        self.at += usize::from(found);
        found
    }

    fn condition(&mut self) -> Result<Expression, ValueError> {
        let mut left = self.both()?;
        while self.take(&Token::Or) {
            self.deeper()?;
            left = Expression::Or(Box::new(left), Box::new(self.both()?));
        }
        Ok(left)
    }

    fn both(&mut self) -> Result<Expression, ValueError> {
        let mut left = self.negation()?;
        while self.take(&Token::And) {
            self.deeper()?;
            left = Expression::And(Box::new(left), Box::new(self.negation()?));
        }
        Ok(left)
    }

    fn negation(&mut self) -> Result<Expression, ValueError> {
        if self.take(&Token::Not) {
            self.deeper()?;
            return Ok(Expression::Not(Box::new(self.negation()?)));
        }
        if self.take(&Token::Open) {
            self.deeper()?;
            let inner = self.condition()?;
            if self.take(&Token::Close) {
                return Ok(inner);
            }
            return Err(self.expected("`)`"));
        }
        let left = self.operand()?;
        let Some(&Token::Comparison(comparison)) = self.peek() else {
            return Err(self.expected("a comparison like `==`"));
        };
        self.at += 1;
        Ok(Expression::Compare(left, comparison, self.operand()?))
    }

    fn operand(&mut self) -> Result<Operand, ValueError> {
        match self.peek() {
            Some(Token::Operand(operand)) => {
                let operand = operand.clone();
                self.at += 1;
                Ok(operand)
            }
            _ => Err(self.expected("a column, a number or a 'text'")),
        }
    }

    /// Counts what makes the tree of the condition deeper: walking it must not exhaust the stack.
    fn deeper(&mut self) -> Result<(), ValueError> {
        self.depth += 1;
        if self.depth <= DEEPEST {
            return Ok(());
        }
        let message = format!("found more than {DEEPEST} `and`, `or`, `not` and parentheses");
        Err(ValueError::new(message).with_help("mark the rows in a column of the data instead"))
    }

    fn expected(&self, expected: &str) -> ValueError {
        let found = match self.peek() {
            None => "the end".to_owned(),
            Some(token) => describe(token),
        };
        ValueError::new(format!("found {found}; expected {expected}")).with_help(EXAMPLE)
    }
}

fn describe(token: &Token) -> String {
    match token {
        Token::Open => "`(`".to_owned(),
        Token::Close => "`)`".to_owned(),
        Token::And => "`and`".to_owned(),
        Token::Or => "`or`".to_owned(),
        Token::Not => "`not`".to_owned(),
        Token::Comparison(_) => "another comparison".to_owned(),
        Token::Operand(Operand::Column(name)) => format!("the column `{}`", short(name)),
        Token::Operand(Operand::Number(_, text)) => format!("the number {}", short(text)),
        Token::Operand(Operand::Text(text)) => format!("the text '{}'", short(text)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn and_binds_tighter_than_or() {
        let parsed = parse_expression("a == 1 or b == 2 and c == 3").unwrap();
        assert!(
            matches!(parsed, Expression::Or(_, right) if matches!(*right, Expression::And(..)))
        );
        let parsed = parse_expression("(a == 1 or b == 2) and c == 3").unwrap();
        assert!(matches!(parsed, Expression::And(left, _) if matches!(*left, Expression::Or(..))));
    }

    #[test]
    fn numbers_texts_and_columns_are_told_apart() {
        let operand = |text: &str| match parse_expression(&format!("{text}==x")).unwrap() {
            Expression::Compare(left, ..) => left,
            other => panic!("{other:?}"),
        };
        assert_eq!(
            operand("-1.5e-3"),
            Operand::Number(-1.5e-3, "-1.5e-3".into())
        );
        assert_eq!(operand("'1'"), Operand::Text("1".into()));
        assert_eq!(operand("\"it's\""), Operand::Text("it's".into()));
        assert_eq!(operand("`1 é`"), Operand::Column("1 é".into()));
        assert_eq!(operand("größe_2.b"), Operand::Column("größe_2.b".into()));
    }

    #[test]
    fn nonsense_is_refused_with_advice() {
        for text in [
            "",
            "a",
            "a ==",
            "== 1",
            "a == 1 b",
            "a = 1",
            "a == 1 && b == 2",
            "a == 1 | b",
            "!a",
            "(a == 1",
            "a == 1)",
            "()",
            "not",
            "a == 'x",
            "a == 1 == 2",
            "a < ",
            "a == 1mm",
            "a == 1e999",
            "a == -",
            "a @ 1",
            "a == nan(",
            "a == 1é",
            "and",
            "é",
        ] {
            let error = parse_expression(text).unwrap_err();
            assert!(error.help.is_some(), "{text:?}");
        }
    }

    #[test]
    fn deep_conditions_are_refused_not_overflowed() {
        assert!(parse_expression(&"(".repeat(100_000)).is_err());
        assert!(parse_expression(&"not ".repeat(100_000)).is_err());
        assert!(parse_expression(&vec!["a==1"; 100_000].join(" and ")).is_err());
        assert!(parse_expression(&vec!["a==1"; 60].join(" or ")).is_ok());
    }
}
