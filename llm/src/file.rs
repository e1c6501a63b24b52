//! Files that people write or keep: read with limits, told of in one line.

use std::{fs::File, io::Read, path::Path};
use thiserror::Error;

/// Largest file that is read, bytes.
const MAX_BYTES: u64 = 64 << 20;

/// A file that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{file}{}: {reason}", .line.map_or_else(String::new, |line| format!(" line {line}")))]
pub struct FileError {
    /// The file.
    pub file: String,
    /// The line, from 1, where one is to blame.
    pub line: Option<usize>,
    /// What is wrong with it.
    pub reason: String,
}

impl FileError {
    pub(crate) fn new(file: &str, line: Option<usize>, reason: impl ToString) -> FileError {
        let reason = reason.to_string();
        let reason = reason.lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("; ");
        FileError { file: file.into(), line, reason }
    }
}

/// Reads a text file of bounded size.
pub(crate) fn read(path: &Path) -> Result<String, FileError> {
    let name = path.display().to_string();
    let failed = |reason: &dyn ToString| FileError::new(&name, None, reason.to_string());
    let mut text = String::new();
    let file = File::open(path).map_err(|error| failed(&error))?;
    file.take(MAX_BYTES + 1).read_to_string(&mut text).map_err(|error| failed(&error))?;
    if text.len() as u64 > MAX_BYTES {
        return Err(failed(&format!("it has more than {MAX_BYTES} bytes")));
    }
    Ok(text)
}

/// The lines of a text that say something, with their numbers from 1.
pub(crate) fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().zip(1..).map(|(line, number)| (number, line.trim())).filter(|(_, line)| !line.is_empty())
}
