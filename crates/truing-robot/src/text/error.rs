//! Errors of input files, with the place they are at and what to do about them.

use std::borrow::Cow;
use std::fmt;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Something is wrong with an input file: where, what was found and expected, and what to do.
///
/// Displayed as one line, `path:line: message`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputError {
    /// The file.
    pub path: PathBuf,
    /// The text of the file, where the error can be shown in it.
    pub text: Option<Arc<str>>,
    /// The place in `text`, in bytes.
    pub span: Option<Range<usize>>,
    /// The line in the file, counted from 1.
    pub line: Option<usize>,
    /// What was found and what was expected.
    pub message: String,
    /// What to do.
    pub help: Option<Box<str>>,
}

impl InputError {
    /// An error of the file as a whole.
    pub fn new(path: impl Into<PathBuf>, message: impl Into<String>) -> Self {
        Self {
            path: path.into(),
            text: None,
            span: None,
            line: None,
            message: message.into(),
            help: None,
        }
    }

    /// The same error on a line of the file, counted from 1.
    #[must_use]
    pub fn with_line(mut self, line: usize) -> Self {
        self.line = Some(line);
        self
    }

    /// The same error with advice on what to do.
    #[must_use]
    pub fn with_help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into().into_boxed_str());
        self
    }

    /// The same error at another place: `span` (bytes) of `source`.
    ///
    /// For an error found in one file that the user has to mend in another, such as a selection of
    /// rows that names a column the data do not have.
    #[must_use]
    pub fn moved_to(mut self, source: &Source, span: Range<usize>) -> Self {
        let span = source.clamp(span);
        self.path.clone_from(&source.path);
        self.line = Some(source.line(span.start));
        self.text = Some(Arc::clone(&source.text));
        self.span = Some(span);
        self
    }
}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:", self.path.display())?;
        if let Some(line) = self.line {
            write!(f, "{line}:")?;
        }
        write!(f, " {}", self.message)
    }
}

impl std::error::Error for InputError {}

/// A value that cannot be understood, before it is known where it stood.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct ValueError {
    /// What was found and what was expected.
    pub message: String,
    /// What to do.
    pub help: Option<String>,
}

impl ValueError {
    /// A value error with a message and no advice.
    pub fn new(message: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            help: None,
        }
    }

    /// The same error with advice on what to do.
    #[must_use]
    pub fn with_help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// The input error of this value at `span` (bytes) of `source`; `name` says which value it is.
    #[must_use]
    pub fn at(self, source: &Source, span: Range<usize>, name: &str) -> InputError {
        let error = source.error_at(span, format!("`{name}`: {}", self.message));
        match self.help {
            Some(help) => error.with_help(help),
            None => error,
        }
    }
}

/// The text of a file, for errors to point into.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// The file.
    pub path: PathBuf,
    /// Its text, without a byte order mark.
    pub text: Arc<str>,
}

impl Source {
    /// The source of a text that is already in memory; `path` is for messages and relative paths.
    pub fn new(text: &str, path: impl Into<PathBuf>) -> Self {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        Self {
            path: path.into(),
            text: Arc::from(text),
        }
    }

    /// Reads a file of UTF-8 text.
    ///
    /// # Errors
    ///
    /// The file is missing, cannot be read, or is not UTF-8.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, InputError> {
        let path = path.as_ref();
        let bytes = std::fs::read(path).map_err(|error| unreadable(path, &error))?;
        match String::from_utf8(bytes) {
            Ok(text) => Ok(Self::new(&text, path)),
            Err(error) => {
                let valid = error.utf8_error().valid_up_to();
                let bytes = error.as_bytes();
                let line = 1 + bytes[..valid].iter().filter(|&&b| b == b'\n').count();
                let utf16 = bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]);
                let found = if utf16 {
                    "found UTF-16 text".to_owned()
                } else {
                    let byte = bytes.get(valid).copied().unwrap_or_default();
                    format!("found the byte 0x{byte:02x}, which is not text")
                };
                let message = format!("{found}; expected UTF-8 text");
                Err(InputError::new(path, message)
                    .with_line(line)
                    .with_help("save the file as UTF-8"))
            }
        }
    }

    /// The error of `message` at `span` (bytes).
    #[must_use]
    pub fn error_at(&self, span: Range<usize>, message: impl Into<String>) -> InputError {
        InputError::new(self.path.clone(), message).moved_to(self, span)
    }

    /// The error of `message` about the file as a whole.
    #[must_use]
    pub fn error(&self, message: impl Into<String>) -> InputError {
        InputError::new(self.path.clone(), message)
    }

    /// The folder that relative paths in the file start from.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// The line of a byte offset, counted from 1.
    #[must_use]
    pub fn line(&self, offset: usize) -> usize {
        let before = self.text.as_bytes();
        let before = &before[..offset.min(before.len())];
        1 + before.iter().filter(|&&byte| byte == b'\n').count()
    }

    /// The nearest span that lies in the text and on character boundaries.
    fn clamp(&self, span: Range<usize>) -> Range<usize> {
        let mut start = span.start.min(self.text.len());
        while !self.text.is_char_boundary(start) {
            start -= 1;
        }
        let mut end = span.end.clamp(start, self.text.len());
        while !self.text.is_char_boundary(end) {
            end += 1;
        }
        start..end
    }
}

/// The error of a file that the system would not give us.
fn unreadable(path: &Path, error: &io::Error) -> InputError {
    match error.kind() {
        io::ErrorKind::NotFound => InputError::new(path, "this file does not exist")
            .with_help("check the path, and the folder the program runs in"),
        io::ErrorKind::IsADirectory => InputError::new(path, "this is a folder; expected a file")
            .with_help("name a file in it"),
        io::ErrorKind::PermissionDenied => InputError::new(path, "no permission to read this file")
            .with_help("check the permissions of the file and its folders"),
        _ => InputError::new(path, format!("cannot read this file: {error}"))
            .with_help("check the path and the disk it is on"),
    }
}

/// The candidate that `name` most likely stands for, if one is near enough to suggest.
///
/// Letters that differ in case are free; otherwise a third of the longer name may differ
/// (Damerau–Levenshtein distance), so names of one or two letters are never guessed.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    const LONGEST: usize = 64;
    let wanted = name.trim().to_lowercase();
    let length = wanted.chars().count();
    if length == 0 || length > LONGEST {
        return None;
    }
    let mut best: Option<(usize, &'a str)> = None;
    for candidate in candidates {
        let other = candidate.to_lowercase();
        let longer = length.max(other.chars().count());
        if longer > LONGEST {
            continue;
        }
        let distance = strsim::damerau_levenshtein(&wanted, &other);
        if distance <= longer / 3 && best.is_none_or(|(least, _)| distance < least) {
            best = Some((distance, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

/// Advice for a name that is not one of `candidates`: the nearest one, or all of them.
pub(crate) fn suggest(name: &str, candidates: &[&str]) -> String {
    match nearest(name, candidates.iter().copied()) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("use {}", one_of(candidates)),
    }
}

/// Names as a list in words: "`a`, `b` or `c`".
pub(crate) fn one_of(names: &[&str]) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    match quoted.as_slice() {
        [] => "nothing".to_owned(),
        [only] => only.clone(),
        [first @ .., last] => format!("{} or {last}", first.join(", ")),
    }
}

/// A text short enough, and free of line breaks, to be quoted in a message of one line.
pub(crate) fn short(text: &str) -> Cow<'_, str> {
    const LONGEST: usize = 48;
    let plain = !text.chars().any(char::is_control);
    if plain && text.chars().count() <= LONGEST {
        return Cow::Borrowed(text);
    }
    let mut out: String = text
        .chars()
        .take(LONGEST)
        .flat_map(char::escape_debug)
        .collect();
    if text.chars().count() > LONGEST {
        out.push('…');
    }
    Cow::Owned(out)
}

/// The name of a file without folder and extension.
pub(crate) fn stem(path: &Path) -> String {
    path.file_stem()
        .map(|stem| stem.to_string_lossy().into_owned())
        .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn display_is_one_line_with_path_and_line() {
        let source = Source::new("a = 1\nb = 2\n", "dir/x.toml");
        let error = source.error_at(6..7, "no `b` here").with_help("remove it");
        assert_eq!(error.to_string(), "dir/x.toml:2: no `b` here");
        assert_eq!(error.help.as_deref(), Some("remove it"));
        let error = InputError::new("x.csv", "empty");
        assert_eq!(error.to_string(), "x.csv: empty");
    }

    #[test]
    fn spans_are_clamped_to_the_text() {
        let source = Source::new("é\n", "x");
        assert_eq!(source.error_at(1..1, "").span, Some(0..2));
        assert_eq!(source.error_at(50..90, "").span, Some(3..3));
        assert_eq!(source.error_at(50..90, "").line, Some(2));
    }

    #[test]
    fn nearest_suggests_only_what_is_near() {
        let names = ["sigma", "loss", "unknown-plane", "x"];
        assert_eq!(nearest("sgima", names), Some("sigma"));
        assert_eq!(nearest("Sigma", names), Some("sigma"));
        assert_eq!(nearest("unknown_plane", names), Some("unknown-plane"));
        assert_eq!(nearest("y", names), None);
        assert_eq!(nearest("X", names), Some("x"));
        assert_eq!(nearest("colour", names), None);
        assert_eq!(nearest("", names), None);
        assert_eq!(nearest(&"s".repeat(100_000), names), None);
    }

    #[test]
    fn a_missing_file_a_folder_and_foreign_bytes_are_explained() {
        let folder = std::env::temp_dir().join(format!("truing-source-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let missing = Source::read(folder.join("none.toml")).unwrap_err();
        assert!(missing.message.contains("does not exist"));
        assert!(Source::read(&folder).is_err());
        let file = folder.join("latin1.toml");
        std::fs::write(&file, b"a = 1\nb = \"\xe9\"\n").unwrap();
        let error = Source::read(&file).unwrap_err();
        assert_eq!(error.line, Some(2));
        assert!(error.message.contains("0xe9"), "{error}");
        std::fs::write(&file, b"\xff\xfea\0").unwrap();
        assert!(Source::read(&file).unwrap_err().message.contains("UTF-16"));
        std::fs::write(&file, b"\xef\xbb\xbfa = 1").unwrap();
        assert_eq!(&*Source::read(&file).unwrap().text, "a = 1");
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn quoted_texts_stay_on_one_line() {
        assert_eq!(short("wall"), "wall");
        assert_eq!(short("a\nb"), "a\\nb");
        assert!(short(&"é".repeat(1000)).chars().count() < 60);
    }

    #[test]
    fn the_error_stays_small_enough_to_return_by_value() {
        assert!(size_of::<InputError>() < 128);
    }
}
