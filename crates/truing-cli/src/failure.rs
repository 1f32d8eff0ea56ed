//! Failures, shown with the place in the file they are about.

use miette::{
    Diagnostic, LabeledSpan, MietteHandlerOpts, NamedSource, ReportHandler as _, SourceCode,
};
use std::fmt;
use std::path::{Path, PathBuf};
use truing_robot::Error;
use truing_robot::text::InputError;

/// Bad input: exit status 2.
#[derive(Debug, Clone)]
pub struct Failure {
    message: String,
    help: Option<String>,
    file: Option<PathBuf>,
    line: Option<usize>,
    /// The text of the file, and the part of it to underline.
    source: Option<Box<(NamedSource<String>, LabeledSpan)>>,
}

impl Failure {
    /// A failure without a place in a file.
    pub fn new(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            help: Some(help.into()),
            file: None,
            line: None,
            source: None,
        }
    }

    /// A failure to write or read a file.
    pub fn io(what: &str, path: &Path, error: &std::io::Error) -> Self {
        Self::new(
            format!("cannot {what} {}: {}", path.display(), reason(error)),
            "check the path, its permissions and the free space",
        )
    }

    /// The same failure about a file as a whole, unless it has a place already.
    #[must_use]
    pub fn about(mut self, file: &Path) -> Self {
        self.file.get_or_insert_with(|| file.to_owned());
        self
    }

    /// The failure for machines, one line of JSON.
    pub fn json(&self) -> String {
        let error = serde_json::json!({ "error": {
            "message": self.message,
            "help": self.help,
            "file": self.file.as_ref().map(|file| file.display().to_string()),
            "line": self.line,
        } });
        error.to_string()
    }
}

/// The failure as people read it on standard error, with the place in its file.
///
/// Lines are broken at spaces to fit a terminal, so that names stay whole, and not at all elsewhere,
/// so that a log can be searched for what was said.
pub struct Shown<'a>(pub &'a Failure);

/// Columns that the mark before a message, or `help:`, takes.
const MARGIN: usize = 8;

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // A table knows the width of the terminal, and that there is none elsewhere.
        let width = match comfy_table::Table::new().use_stderr().width() {
            Some(width) => usize::from(width).saturating_sub(MARGIN).max(20),
            None => usize::MAX,
        };
        let fitted = Failure {
            message: fill(&self.0.to_string(), width),
            help: self.0.help.as_deref().map(|help| fill(help, width)),
            file: None,
            ..self.0.clone()
        };
        MietteHandlerOpts::new()
            .wrap_lines(false)
            .terminal_links(false)
            .build()
            .debug(&fitted, f)
    }
}

/// A text with line breaks in place of spaces, so that no line is wider unless it is one word.
fn fill(text: &str, width: usize) -> String {
    let mut out = String::new();
    let mut used = 0;
    for word in text.split(' ') {
        let length = word.chars().count();
        if used > 0 && used + 1 + length > width {
            out.push('\n');
            used = 0;
        } else if used > 0 {
            out.push(' ');
            used += 1;
        }
        out.push_str(word);
        used += length;
    }
    out
}

/// What the system says, without the number it gives it.
fn reason(error: &std::io::Error) -> String {
    let text = error.to_string();
    match text.split_once(" (os error") {
        Some((text, _)) => text.to_lowercase(),
        None => text,
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        match error {
            Error::Input(error) => error.into(),
            Error::Calibration { message, help } | Error::Unreachable { message, help } => {
                Self::new(message, help)
            }
            other => Self::new(
                other.to_string(),
                "check the robot and the data for values that make no sense",
            ),
        }
    }
}

impl From<InputError> for Failure {
    fn from(error: InputError) -> Self {
        let mut failure = Self {
            message: error.message,
            help: error.help.map(String::from),
            file: Some(error.path),
            line: error.line,
            source: None,
        };
        if let (Some(text), Some(span), Some(file)) = (error.text, error.span, &failure.file) {
            // A place at the end of the text has nothing to underline: what comes before it does.
            let end = text.trim_end().len();
            let last = text[..end]
                .char_indices()
                .next_back()
                .map_or(0, |(at, _)| at);
            if end > 0 {
                let start = span.start.min(last);
                let span = start..span.end.clamp(start, end);
                let source = NamedSource::new(file.display().to_string(), text.to_string());
                failure.source = Some(Box::new((source, LabeledSpan::underline(span))));
            }
        }
        failure
    }
}

impl fmt::Display for Failure {
    /// The message, behind its place where no source shows that.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let (None, Some(file)) = (&self.source, &self.file) {
            write!(f, "{}:", file.display())?;
            if let Some(line) = self.line {
                write!(f, "{line}:")?;
            }
            f.write_str(" ")?;
        }
        f.write_str(&self.message)
    }
}

impl std::error::Error for Failure {}

impl Diagnostic for Failure {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help.as_ref().map(|help| Box::new(help) as _)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.source.as_ref().map(|source| &source.0 as _)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let source = self.source.as_ref()?;
        Some(Box::new(std::iter::once(source.1.clone())))
    }
}

/// Files to be written together.
pub type Files = Vec<(PathBuf, String)>;
