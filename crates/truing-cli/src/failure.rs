//! Failures, shown with the place in the file they are about.

use miette::{
    Diagnostic, LabeledSpan, MietteHandlerOpts, NamedSource, ReportHandler as _, SourceCode,
};
use std::fmt;
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use truing_robot::Error;
use truing_robot::file::InputError;

/// Bad input: exit status 2.
#[derive(Debug)]
pub struct Failure {
    message: String,
    help: Option<String>,
    file: Option<PathBuf>,
    line: Option<usize>,
    source: Option<NamedSource<String>>,
    label: Option<LabeledSpan>,
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
            label: None,
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
/// Lines are broken between words to fit a terminal, and not at all elsewhere, so that a log can be
/// searched for what was said.
pub struct Shown<'a>(pub &'a Failure);

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        MietteHandlerOpts::new()
            .wrap_lines(std::io::stderr().is_terminal())
            .break_words(false)
            .terminal_links(false)
            .build()
            .debug(self.0, f)
    }
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
            label: None,
        };
        if let (Some(text), Some(span), Some(file)) = (error.text, error.span, &failure.file) {
            // A place at the end of the text has nothing to underline: what comes before it does.
            let end = text.trim_end().len();
            let last = text.floor_char_boundary(end.saturating_sub(1));
            if end > 0 {
                let start = span.start.min(last);
                let span = start..span.end.clamp(start, end);
                failure.label = Some(LabeledSpan::underline(span));
                failure.source = Some(NamedSource::new(
                    file.display().to_string(),
                    text.to_string(),
                ));
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
        self.source.as_ref().map(|source| source as _)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        self.label
            .clone()
            .map(|label| Box::new(std::iter::once(label)) as _)
    }
}

/// Files to be written together.
pub type Files = Vec<(PathBuf, String)>;
