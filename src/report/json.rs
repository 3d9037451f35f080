//! JSON files.

use std::path::Path;

use serde::Serialize;

use super::file::write_whole;
use crate::{Error, Result};

/// Writes `value` as indented JSON with a final newline; the file is whole or not there.
///
/// # Errors
/// [`Error::Io`] with `path` if it cannot be written.
pub fn write(path: &Path, value: &impl Serialize) -> Result<()> {
    let io = |cause| Error::Io { path: path.to_owned(), cause };
    write_whole(path, |sink| {
        serde_json::to_writer_pretty(&mut *sink, value).map_err(|e| io(e.into()))?;
        writeln!(sink).map_err(io)
    })
}
