//! Parameters by the names that people use for them.

use super::arm::Arm;
use super::serial::ParameterKind;
use crate::text::{Pattern, nearest};

/// Words that mean several parameters, beside names and patterns.
const WORDS: [&str; 5] = ["all", "base", "tool", "gains", "models"];

/// A name that means no parameter.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnknownName {
    /// What was found.
    pub message: String,
    /// What to do.
    pub help: String,
}

/// The parameters, as (robot, parameter) in their order, that a name, pattern or word means: `theta3`,
/// `left.d*`, `all`, `base`, `tool`, `gains`, `models`.
///
/// # Errors
/// If it means none.
pub fn find(arms: &[Arm], text: &str) -> Result<Vec<(usize, usize)>, UnknownName> {
    let (prefix, word) = match text.split_once('.') {
        Some((prefix, word)) if arms.iter().any(|arm| arm.name == prefix) => (Some(prefix), word),
        _ => (None, text),
    };
    let means = |arm: &Arm, p: usize| {
        let robot = &arm.robot;
        match word {
            "all" => true,
            "base" => robot.base_parameters().contains(&p),
            "tool" => robot.tool_parameters().contains(&p),
            "gains" => robot.parameters()[p].kind == ParameterKind::Gain,
            "models" => robot.parameters()[p].kind == ParameterKind::Model,
            _ => Pattern::new(word).matches(&robot.parameters()[p].name),
        }
    };
    let mut found = Vec::new();
    for (r, arm) in arms.iter().enumerate() {
        if prefix.is_none_or(|prefix| arm.name == prefix) {
            let own = 0..arm.robot.parameters().len();
            found.extend(own.filter(|p| means(arm, *p)).map(|p| (r, p)));
        }
    }
    if !found.is_empty() {
        return Ok(found);
    }
    let full: Vec<String> = arms
        .iter()
        .flat_map(|arm| (0..arm.robot.parameters().len()).map(|p| arm.parameter_name(p)))
        .collect();
    let candidates: Vec<&str> = full.iter().map(String::as_str).chain(WORDS).collect();
    let help = match nearest(text, candidates.iter().copied()) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!(
            "there are {}, and the words {}",
            listed(&full),
            WORDS.join(", ")
        ),
    };
    let what = if Pattern::new(text).is_name() {
        "parameter has the name"
    } else {
        "parameter matches"
    };
    Err(UnknownName {
        message: format!("no {what} `{text}`"),
        help,
    })
}

/// A list of names, shortened where it is long.
pub fn listed(names: &[String]) -> String {
    let shown: Vec<&str> = names.iter().take(12).map(String::as_str).collect();
    let more = if names.len() > shown.len() {
        format!(", … ({} in all)", names.len())
    } else {
        String::new()
    };
    format!("{}{more}", shown.join(", "))
}
