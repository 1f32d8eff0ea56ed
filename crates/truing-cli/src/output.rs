//! Writing results: all files or none, and nothing over what is there.

use crate::failure::{Failure, Files};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Refuses early a folder that is already there and holds something, and one that cannot be written.
pub fn check(folder: &Path, force: bool) -> Result<(), Failure> {
    if !folder.exists() {
        return can_make(folder);
    }
    if !folder.is_dir() {
        return Err(Failure::new(
            format!("{} is there and is not a folder", folder.display()),
            "name another folder with --output",
        ));
    }
    let empty = folder
        .read_dir()
        .map_err(|e| Failure::io("read the folder", folder, &e))?
        .next()
        .is_none();
    if empty || force {
        return can_write(folder, folder);
    }
    Err(Failure::new(
        format!(
            "the folder {} is already there and is not overwritten",
            folder.display()
        ),
        "name another folder with --output, or write into this one with --force",
    ))
}

/// Whether a folder that is not there can be made in the nearest one above it that is.
fn can_make(folder: &Path) -> Result<(), Failure> {
    let above = folder.ancestors().skip(1).find(|above| above.exists());
    let above = match above {
        Some(above) if !above.as_os_str().is_empty() => above,
        _ => Path::new("."),
    };
    if !above.is_dir() {
        let message = format!(
            "cannot make the folder {}: {} is a file",
            folder.display(),
            above.display()
        );
        return Err(Failure::new(message, "name another folder with --output"));
    }
    can_write(above, folder)
}

/// Whether files can be written into a folder that is there; `wanted` is what is to be written.
fn can_write(folder: &Path, wanted: &Path) -> Result<(), Failure> {
    match tempfile::tempfile_in(folder) {
        Ok(_) => Ok(()),
        Err(error) => Err(Failure::io("write into the folder", wanted, &error)),
    }
}

/// Writes files into a folder, which is made if it is not there.
///
/// Every file is written beside its place first and then renamed, so that none is ever half there.
pub fn write(folder: &Path, files: &Files) -> Result<Vec<PathBuf>, Failure> {
    std::fs::create_dir_all(folder).map_err(|e| Failure::io("make the folder", folder, &e))?;
    let mut staged = Vec::new();
    for (name, content) in files {
        let path = folder.join(name);
        let mut file =
            tempfile::NamedTempFile::new_in(folder).map_err(|e| Failure::io("write", &path, &e))?;
        file.write_all(content.as_bytes())
            .map_err(|e| Failure::io("write", &path, &e))?;
        file.as_file()
            .sync_all()
            .map_err(|e| Failure::io("write", &path, &e))?;
        make_readable(file.as_file()).map_err(|e| Failure::io("write", &path, &e))?;
        staged.push((file, path));
    }
    let mut written = Vec::new();
    for (file, path) in staged {
        file.persist(&path)
            .map_err(|e| Failure::io("write", &path, &e.error))?;
        written.push(path);
    }
    Ok(written)
}

/// Temporary files are private; results are for everyone who may read the folder.
#[cfg(unix)]
fn make_readable(file: &std::fs::File) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn make_readable(_: &std::fs::File) -> std::io::Result<()> {
    Ok(())
}
