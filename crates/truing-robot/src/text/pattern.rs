//! Patterns of parameter names: `theta*`, `left.theta?`.

use std::fmt;

/// A pattern of names: `*` stands for any number of characters, `?` for exactly one.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Pattern {
    text: String,
}

impl Pattern {
    /// The pattern written as `text`.
    pub fn new(text: impl Into<String>) -> Self {
        Self { text: text.into() }
    }

    /// The pattern as it was written.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.text
    }

    /// Whether the pattern is a plain name, without `*` and `?`.
    #[must_use]
    pub fn is_name(&self) -> bool {
        !self.text.contains(['*', '?'])
    }

    /// Whether the pattern matches the whole of `name`.
    #[must_use]
    pub fn matches(&self, name: &str) -> bool {
        let pattern: Vec<char> = self.text.chars().collect();
        let name: Vec<char> = name.chars().collect();
        // `star` is the place after the last star, and how much of the name it has taken so far.
        let (mut p, mut n) = (0, 0);
        let mut star = None;
        while n < name.len() {
            match pattern.get(p) {
                Some('*') => {
                    p += 1;
                    star = Some((p, n));
                }
                Some(&c) if c == '?' || c == name[n] => {
                    p += 1;
                    n += 1;
                }
                _ => {
                    let Some((after, taken)) = star else {
                        return false;
                    };
                    p = after;
                    n = taken + 1;
                    star = Some((p, n));
                }
            }
        }
        pattern[p..].iter().all(|&c| c == '*')
    }
}

impl fmt::Display for Pattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stars_and_question_marks() {
        let matches = |pattern: &str, name: &str| Pattern::new(pattern).matches(name);
        assert!(matches("theta*", "theta3"));
        assert!(matches("theta*", "theta"));
        assert!(!matches("theta*", "left.theta3"));
        assert!(matches("*theta*", "left.theta3"));
        assert!(matches("left.theta3", "left.theta3"));
        assert!(matches("*.K?", "left.K2"));
        assert!(!matches("K?", "K12"));
        assert!(matches("*", ""));
        assert!(matches("", ""));
        assert!(!matches("", "a"));
        assert!(matches("a*b*c", "aXbYbZc"));
        assert!(!matches("a*b*c", "aXbYbZ"));
        assert!(matches("é?", "éß"));
        assert!(!matches(&"*a".repeat(40), &"a".repeat(39)));
        assert!(!matches(&("*a".repeat(40) + "b"), &"a".repeat(400)));
    }

    #[test]
    fn plain_names_are_told_from_patterns() {
        assert!(Pattern::new("theta1").is_name());
        assert!(!Pattern::new("theta?").is_name());
    }
}
