//! Files that are whole or not there.

use std::fs::{self, File};
use std::io::{self, BufWriter, Seek, Write};
use std::path::Path;

use tempfile::{Builder, NamedTempFile};

use crate::{Error, Result};

/// A sink that encoders can seek in.
pub trait WriteSeek: Write + Seek {}
impl<T: Write + Seek> WriteSeek for T {}

/// Creates or replaces `path` with what `write` writes.
///
/// The content goes to a temporary file beside `path`, which is renamed when it is complete and removed when `write`
/// fails, so that nobody ever sees half a file. What exists and is no regular file (`/dev/null`, a pipe) is written to
/// directly, since it cannot be replaced.
///
/// # Errors
/// [`Error::Io`] with `path` if the folder cannot be written to, and whatever `write` returns.
pub fn write_whole(path: &Path, write: impl FnOnce(&mut dyn WriteSeek) -> Result<()>) -> Result<()> {
    let io = |cause| Error::Io { path: path.to_owned(), cause };
    if fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir()) {
        return write_through(path, write);
    }
    let mut temporary = temporary_beside(path).map_err(io)?;
    let mut buffered = BufWriter::new(temporary.as_file_mut());
    write(&mut buffered)?;
    buffered.flush().map_err(io)?;
    drop(buffered);
    temporary.persist(path).map_err(|e| io(e.error))?;
    Ok(())
}

/// Creates or replaces `path` with a text.
///
/// # Errors
/// As for [`write_whole`].
pub fn write_text(path: &Path, text: &str) -> Result<()> {
    write_bytes(path, text.as_bytes())
}

/// Creates or replaces `path` with some bytes.
///
/// # Errors
/// As for [`write_whole`].
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    let io = |cause| Error::Io { path: path.to_owned(), cause };
    write_whole(path, |sink| sink.write_all(bytes).map_err(io))
}

/// A file without a name in the folder of `path`; it is gone when it is closed, however the program ends.
///
/// # Errors
/// [`Error::Io`] with `path` if the folder cannot be written to.
pub fn spool_beside(path: &Path) -> Result<File> {
    tempfile::tempfile_in(folder(path)).map_err(|cause| Error::Io { path: path.to_owned(), cause })
}

/// Tells before the work whether `path` will be writable after it. Nothing is left of the attempt.
///
/// # Errors
/// [`Error::Io`] with `path` if it is a folder or its folder cannot be written to.
pub fn check_target(path: &Path) -> Result<()> {
    match fs::metadata(path) {
        Ok(found) if found.is_dir() => {
            Err(Error::Io { path: path.to_owned(), cause: io::ErrorKind::IsADirectory.into() })
        }
        Ok(found) if !found.is_file() => Ok(()),
        _ => spool_beside(path).map(drop),
    }
}

/// For targets that cannot seek, the content is completed in memory first.
fn write_through(path: &Path, write: impl FnOnce(&mut dyn WriteSeek) -> Result<()>) -> Result<()> {
    let mut memory = io::Cursor::new(Vec::new());
    write(&mut memory)?;
    fs::write(path, memory.into_inner()).map_err(|cause| Error::Io { path: path.to_owned(), cause })
}

fn temporary_beside(path: &Path) -> io::Result<NamedTempFile> {
    let mut builder = Builder::new();
    builder.prefix(".stillray-").suffix(".part");
    // The default of 0600 is for secrets; pictures get what the user's umask says.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder(path))
}

fn folder(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
    }

    fn put(bytes: &'static [u8]) -> impl FnOnce(&mut dyn WriteSeek) -> Result<()> {
        move |w| w.write_all(bytes).map_err(|cause| Error::Io { path: "test".into(), cause })
    }

    #[test]
    fn replaces_the_file_and_leaves_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a b.txt");
        write_whole(&path, put(b"old")).unwrap();
        write_whole(&path, put(b"new")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(names(dir.path()), ["a b.txt"]);
    }

    #[test]
    fn a_failed_write_keeps_the_old_file_and_leaves_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        write_whole(&path, put(b"old")).unwrap();
        let failed = write_whole(&path, |w| {
            put(b"half")(w)?;
            Err(Error::Image { path: "a.txt".into(), message: "stop".into() })
        });
        assert!(failed.is_err());
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(dir.path()), ["a.txt"]);
    }

    #[test]
    fn a_missing_folder_is_an_error_that_names_the_file() {
        let failed = write_whole(Path::new("/nowhere at all/a.txt"), put(b"x")).unwrap_err().to_string();
        assert!(failed.starts_with("/nowhere at all/a.txt: "), "{failed}");
    }

    #[test]
    fn targets_are_checked_without_a_trace() {
        let dir = tempfile::tempdir().unwrap();
        check_target(&dir.path().join("a.json")).unwrap();
        assert!(check_target(dir.path()).is_err());
        assert!(check_target(&dir.path().join("b/a.json")).is_err());
        assert!(names(dir.path()).is_empty());
    }

    #[cfg(unix)]
    #[test]
    fn devices_are_written_to_and_not_replaced() {
        write_whole(Path::new("/dev/null"), put(b"x")).unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
    }
}
