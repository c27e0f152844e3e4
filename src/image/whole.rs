//! Files that appear whole or not at all: a temporary file beside the target, fsync, rename, fsync of the folder.

use crate::{Error, Result};
use std::{
    fs::{self, File, OpenOptions},
    io,
    path::{Path, PathBuf},
};

/// Whether a file can be written at `path`; to be asked before the work that it is to hold.
///
/// # Errors
/// [`Error::Setting`] that says what is in the way.
pub fn check_writable(path: impl AsRef<Path>) -> Result<()> {
    let path = path.as_ref();
    let problem = |problem: String| Error::setting(path.display().to_string(), problem);
    if path.file_name().is_none() {
        return Err(problem("is not the name of a file".into()));
    }
    let folder = folder(path);
    match fs::metadata(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return Err(problem(format!("the folder {} does not exist", folder.display())));
        }
        Err(error) => return Err(problem(format!("the folder {}: {error}", folder.display()))),
        Ok(found) if !found.is_dir() => return Err(problem(format!("{} is not a folder", folder.display()))),
        Ok(_) => {}
    }
    // A rename would put a file where a folder, a device or a pipe was.
    if fs::metadata(path).is_ok_and(|found| !found.is_file()) {
        return Err(problem("exists and is not a file".into()));
    }
    let temporary = temporary(path);
    create(&temporary).map_err(|error| problem(format!("cannot be written: {error}")))?;
    fs::remove_file(&temporary).map_err(|error| problem(error.to_string()))
}

/// Writes a file that appears whole or not at all.
///
/// # Errors
/// [`Error::Setting`] for a path that no file can have, [`Error::File`] if it cannot be written; then there is no file, or
/// the old one.
pub fn write_whole(path: impl AsRef<Path>, content: &[u8]) -> Result<()> {
    write(path.as_ref(), |mut file| io::Write::write_all(&mut file, content).map_err(|error| error.to_string()))
}

/// Lets `fill` write the content of `path`. If it fails, there is no file, or the old one.
pub(super) fn write(path: &Path, fill: impl FnOnce(&File) -> std::result::Result<(), String>) -> Result<()> {
    check_writable(path)?;
    let temporary = temporary(path);
    let result = replace(path, &temporary, fill);
    if result.is_err() {
        // It is gone already if the rename was done; there is nothing better to report than the first error.
        let _ = fs::remove_file(&temporary);
    }
    result.map_err(|problem| Error::file(path, problem))
}

fn replace(
    path: &Path,
    temporary: &Path,
    fill: impl FnOnce(&File) -> std::result::Result<(), String>,
) -> std::result::Result<(), String> {
    let text = |error: io::Error| error.to_string();
    let file = create(temporary).map_err(text)?;
    fill(&file)?;
    file.sync_all().map_err(text)?;
    drop(file);
    fs::rename(temporary, path).map_err(text)?;
    // The rename lasts only when the folder is on disk too. Windows opens no folders, and needs none.
    if cfg!(unix) { File::open(folder(path)).and_then(|folder| folder.sync_all()).map_err(text) } else { Ok(()) }
}

fn create(path: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).write(true).create_new(true).open(path)
}

fn folder(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// A name beside `path` that no other process, nor another thread's file of this one, takes.
fn temporary(path: &Path) -> PathBuf {
    let mut name = std::ffi::OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(format!(".{}-{:?}.part", std::process::id(), std::thread::current().id()));
    path.with_file_name(name)
}
