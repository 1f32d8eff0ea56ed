//! Words that warnings share.

/// A list in words, its first eight entries if it is longer.
pub fn shortened(all: &[String]) -> String {
    match all.get(8..) {
        None | Some([]) => all.join(", "),
        Some(rest) => format!("{} and {} more", all[..8].join(", "), rest.len()),
    }
}
