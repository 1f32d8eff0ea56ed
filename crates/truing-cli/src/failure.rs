//! Failures, shown with the place in the file they are about.

use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};
use std::fmt;
use std::path::PathBuf;
use truing_robot::Error;
use truing_robot::file::InputError;

/// Bad input: exit status 2.
#[derive(Debug)]
pub struct Failure {
    message: String,
    help: Option<String>,
    source: Option<NamedSource<String>>,
    label: Option<LabeledSpan>,
}

impl Failure {
    /// A failure without a place in a file.
    pub fn new(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            help: Some(help.into()),
            source: None,
            label: None,
        }
    }

    /// A failure to write or read a file.
    pub fn io(what: &str, path: &std::path::Path, error: &std::io::Error) -> Self {
        Self::new(
            format!("cannot {what} {}: {error}", path.display()),
            "check the path, its permissions and the free space",
        )
    }

    /// What is wrong, in one line.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// What to do.
    pub fn advice(&self) -> Option<&str> {
        self.help.as_deref()
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        match error {
            Error::Input(error) => error.into(),
            Error::Calibration { message, help } | Error::Unreachable { message, help } => {
                Self::new(message, help)
            }
            other => Self {
                message: other.to_string(),
                help: None,
                source: None,
                label: None,
            },
        }
    }
}

impl From<InputError> for Failure {
    fn from(error: InputError) -> Self {
        let message = error.to_string();
        let help = error.help.as_deref().map(str::to_owned);
        let (Some(text), Some(span)) = (&error.text, &error.span) else {
            return Self {
                message,
                help,
                source: None,
                label: None,
            };
        };
        let name = error.path.display().to_string();
        // An empty span at the end of a text has nothing to underline.
        let label = (span.start < text.len()).then(|| LabeledSpan::underline(span.clone()));
        Self {
            message,
            help,
            source: Some(NamedSource::new(name, text.to_string())),
            label,
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
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
