//! Words that warnings share.

/// How a warning starts that makes a result untrusted.
pub const DISTRUST: &str = "not to be trusted: ";

/// A list in words, its first eight entries if it is longer.
pub fn shortened(all: &[String]) -> String {
    match all.get(8..) {
        None | Some([]) => all.join(", "),
        Some(rest) => format!("{} and {} more", all[..8].join(", "), rest.len()),
    }
}
