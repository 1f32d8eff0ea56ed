//! What every command is given, and how it ends.

use std::io::Write;
use truing_robot::Registry;

/// How a command ended that ran to its end.
pub enum Ending {
    /// Converged, or agrees: exit status 0.
    Good,
    /// Did not converge, must not be trusted or does not agree: exit status 1.
    Untrusted,
    /// Stopped before its end: exit status 1.
    Stopped,
}

/// Where output goes (data to standard output, words to standard output or, beside JSON, to standard error),
/// and what files can name.
pub struct Streams {
    pub json: bool,
    pub registry: Registry,
}

impl Streams {
    /// Words for people.
    pub fn say(&self, text: &str) {
        // A reader that hung up (`truing … | head`) is no failure.
        let _ = if self.json {
            std::io::stderr().write_all(text.as_bytes())
        } else {
            std::io::stdout().write_all(text.as_bytes())
        };
    }

    /// Data for machines.
    pub fn print(&self, text: &str) {
        let _ = std::io::stdout().write_all(text.as_bytes());
    }
}
