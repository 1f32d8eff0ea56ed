//! Losses in files: `"cauchy(2.4)"`, `"huber"`, `"barron(0.5, 1)"`.

use super::error::{InputError, ValueError, one_of, short, suggest};
use super::item::Item;
use truing::Loss;

/// `"trivial"`, or the name of a robust loss with its scale in standard deviations in parentheses; a name
/// alone has the scale of 95 % efficiency.
pub(crate) fn loss(item: &Item<'_>, more: &[NamedLoss]) -> Result<Loss, InputError> {
    let text = item.string()?.value;
    let of_plugin = more.iter().find_map(|loss| loss.parse(&text));
    let parsed = of_plugin.unwrap_or_else(|| parse(&text, more));
    parsed.map_err(|error| item.refuse(error))
}

/// A loss that files can name beside the framework's own.
#[derive(Debug, Clone, Copy)]
pub struct NamedLoss {
    /// Its name.
    pub name: &'static str,
    /// How it is written: `"steep(2)"`.
    pub example: &'static str,
    /// The loss with the numbers between the parentheses; none if they make no sense.
    pub make: fn(&[f64]) -> Option<Loss>,
}

impl NamedLoss {
    /// The loss that a text means; none if it does not begin with the name.
    fn parse(&self, text: &str) -> Option<Result<Loss, ValueError>> {
        let rest = text.trim().strip_prefix(self.name)?.trim();
        let inside = match rest {
            "" => Some(""),
            rest => rest.strip_prefix('(')?.strip_suffix(')'),
        };
        let parts = inside?.split(',').map(str::trim);
        let numbers: Option<Vec<f64>> = parts
            .filter(|part| !part.is_empty())
            .map(|part| part.parse().ok())
            .collect();
        let made = numbers.and_then(|numbers| (self.make)(&numbers));
        Some(made.ok_or_else(|| {
            found(text, "its numbers between parentheses")
                .with_help(format!("write \"{}\"", self.example))
        }))
    }
}

const NAMES: [&str; 8] = [
    "trivial",
    "huber",
    "soft-l1",
    "cauchy",
    "tukey",
    "welsch",
    "geman-mcclure",
    "barron",
];

fn parse(text: &str, more: &[NamedLoss]) -> Result<Loss, ValueError> {
    let (name, rest) = match text.trim().split_once('(') {
        Some((name, rest)) => (name.trim(), Some(rest)),
        None => (text.trim(), None),
    };
    if name == "trivial" {
        return match rest {
            None => Ok(Loss::Trivial),
            Some(_) => Err(found(text, "`trivial` without a scale")
                .with_help("write \"trivial\" without parentheses")),
        };
    }
    let efficient = Loss::EFFICIENT.into_iter().find(|loss| loss.name() == name);
    if efficient.is_none() && name != "barron" {
        let names: Vec<&str> = NAMES
            .into_iter()
            .chain(more.iter().map(|l| l.name))
            .collect();
        return Err(found(text, &one_of(&names)).with_help(suggest(name, &names)));
    }
    let Some(rest) = rest else {
        return efficient.ok_or_else(|| {
            found(text, "its shape alpha and its scale")
                .with_help("write like \"barron(0, 1)\": alpha from 2, least squares, down to -inf")
        });
    };
    // How it is written, in the words of an example.
    let example = match efficient {
        Some(loss) => format!("{name}({})", loss.scale().unwrap_or_default()),
        None => "barron(0, 1)".to_owned(),
    };
    let inside = rest.trim_end().strip_suffix(')');
    let numbers: Option<Vec<f64>> = inside.and_then(|inside| {
        let parts = inside.split(',').map(|part| part.trim().parse().ok());
        parts.collect()
    });
    let made = match (name, numbers.as_deref()) {
        ("huber", Some([k])) => Loss::huber(*k),
        ("soft-l1", Some([c])) => Loss::soft_l1(*c),
        ("cauchy", Some([c])) => Loss::cauchy(*c),
        ("tukey", Some([c])) => Loss::tukey(*c),
        ("welsch", Some([c])) => Loss::welsch(*c),
        ("geman-mcclure", Some([c])) => Loss::geman_mcclure(*c),
        ("barron", Some([alpha, c])) => Loss::barron(*alpha, *c),
        ("barron", _) => {
            return Err(found(
                text,
                "a shape and a scale between the parentheses, and no more",
            )
            .with_help(format!("write \"{example}\"")));
        }
        _ => {
            return Err(found(
                text,
                "one number of sigmas between the parentheses, and no more",
            )
            .with_help(format!("write \"{example}\"")));
        }
    };
    made.map_err(|_| {
        let expected = match name {
            "barron" => "a shape of at most 2 and a positive, finite scale",
            _ => "a positive, finite number of sigmas between the parentheses",
        };
        found(text, expected).with_help(format!("write \"{example}\""))
    })
}

fn found(text: &str, expected: &str) -> ValueError {
    ValueError::new(format!("found `{}`; expected {expected}", short(text)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn losses_are_read() {
        for (text, loss) in [
            ("trivial", Loss::Trivial),
            (" huber( 1.5 ) ", Loss::Huber(1.5)),
            ("soft-l1(1)", Loss::SoftL1(1.0)),
            ("cauchy(2.4)", Loss::Cauchy(2.4)),
            ("tukey(4.7)", Loss::Tukey(4.7)),
            ("welsch(3)", Loss::Welsch(3.0)),
            ("geman-mcclure(2)", Loss::GemanMcClure(2.0)),
            (
                "barron(-2, 0.5)",
                Loss::Barron {
                    alpha: -2.0,
                    c: 0.5,
                },
            ),
            (
                "barron(-inf,1)",
                Loss::Barron {
                    alpha: f64::NEG_INFINITY,
                    c: 1.0,
                },
            ),
            ("huber", Loss::Huber(1.345)),
            ("tukey", Loss::Tukey(4.685)),
        ] {
            assert_eq!(parse(text, &[]), Ok(loss), "{text}");
        }
    }

    #[test]
    fn what_is_no_loss_says_what_to_write() {
        for (text, message, help) in [
            ("", "`trivial`, `huber`", "use `trivial`"),
            ("huber(", "one number of sigmas", "\"huber(1.345)\""),
            ("huber()", "one number of sigmas", "\"huber(1.345)\""),
            ("huber(1, 2)", "one number of sigmas", "\"huber(1.345)\""),
            ("huber(0)", "positive, finite", "\"huber(1.345)\""),
            ("welsch(-1)", "positive, finite", "\"welsch(2.985)\""),
            ("tukey(nan)", "positive, finite", "\"tukey(4.685)\""),
            ("cauchy(inf)", "positive, finite", "\"cauchy(2.385)\""),
            ("huber(1.5", "one number", "\"huber(1.345)\""),
            ("huber(1.5))", "one number", "\"huber(1.345)\""),
            ("trivial(1)", "without a scale", "without parentheses"),
            ("Huber(1)", "`huber`", "did you mean `huber`?"),
            ("caucy(1)", "`cauchy`", "did you mean `cauchy`?"),
            ("barron", "its shape alpha", "barron(0, 1)"),
            ("barron(1)", "a shape and a scale", "barron(0, 1)"),
            ("barron(2.5, 1)", "at most 2", "barron(0, 1)"),
            ("barron(0, 0)", "positive, finite", "barron(0, 1)"),
        ] {
            let error = parse(text, &[]).unwrap_err();
            assert!(error.message.contains(message), "{text}: {}", error.message);
            let said = error.help.unwrap();
            assert!(said.contains(help), "{text}: {said}");
        }
    }
}
