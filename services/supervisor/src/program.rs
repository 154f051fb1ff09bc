//! Programs that a deployment names: where they are, and what is wrong with one that cannot be started.

use rustix::fs::{Access, access};
use std::ffi::OsStr;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// The first bytes of a script, which name its interpreter.
const SCRIPT: &[u8] = b"#!";
/// Longest first line of a script that the kernel reads (execve(2)).
const SCRIPT_LINE: usize = 255;

/// A program that cannot be started.
#[derive(Debug, thiserror::Error)]
pub enum ProgramError {
    /// Nothing has its name.
    #[error("{program}: no such program{}", looked_in(searched))]
    Missing {
        /// What the settings name.
        program: String,
        /// The folders that were looked in: those of `PATH`, or none where the settings name a file.
        searched: Vec<PathBuf>,
    },
    /// It is no file that this user may execute.
    #[error("{path}: not a program that this user may start: {source}")]
    NotExecutable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// It is a script for a program that is not there.
    #[error("{path}: its interpreter {interpreter} does not exist")]
    NoInterpreter {
        /// The script.
        path: PathBuf,
        /// What its first line names.
        interpreter: String,
    },
}

fn looked_in(searched: &[PathBuf]) -> String {
    match searched {
        [] => String::new(),
        folders => format!(" in {}", folders.iter().map(|folder| folder.display().to_string()).collect::<Vec<_>>().join(", ")),
    }
}

/// Finds the program of this name as the system does: a name with a slash is a file, any other is searched for in `PATH`.
///
/// # Errors
/// When there is none, or it could not be started.
pub fn find_program(name: &str) -> Result<PathBuf, ProgramError> {
    find_in(name, std::env::var_os("PATH").as_deref())
}

fn find_in(name: &str, path: Option<&OsStr>) -> Result<PathBuf, ProgramError> {
    if name.contains('/') {
        let path = std::path::absolute(name).unwrap_or_else(|_| name.into());
        return if path.exists() { check(path) } else { Err(ProgramError::Missing { program: display(&path), searched: Vec::new() }) };
    }
    let searched: Vec<PathBuf> = path.map(|path| std::env::split_paths(path).collect()).unwrap_or_default();
    let found: Vec<PathBuf> = searched.iter().map(|folder| folder.join(name)).filter(|path| path.is_file()).collect();
    let executable = found.iter().find(|path| access(*path, Access::EXEC_OK).is_ok());
    match executable.or(found.first()) {
        Some(path) => check(path.clone()),
        None => Err(ProgramError::Missing { program: name.to_owned(), searched }),
    }
}

fn check(path: PathBuf) -> Result<PathBuf, ProgramError> {
    let refused = |path: PathBuf, source: io::Error| Err(ProgramError::NotExecutable { path, source });
    if !path.is_file() {
        return refused(path, io::Error::from(io::ErrorKind::IsADirectory));
    }
    if let Err(error) = access(&path, Access::EXEC_OK) {
        return refused(path, error.into());
    }
    match interpreter(&path) {
        Some(interpreter) if !Path::new(&interpreter).exists() => Err(ProgramError::NoInterpreter { path, interpreter }),
        Some(_) | None => Ok(path),
    }
}

/// What the first line of a script names; `None` for what is no script, or cannot be read, which a program need not be.
fn interpreter(path: &Path) -> Option<String> {
    let mut start = Vec::new();
    std::fs::File::open(path).ok()?.take(SCRIPT_LINE as u64).read_to_end(&mut start).ok()?;
    let line = start.strip_prefix(SCRIPT)?.split(|byte| *byte == b'\n').next()?;
    String::from_utf8_lossy(line).split_whitespace().next().map(str::to_owned)
}

fn display(path: &Path) -> String {
    path.display().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    fn file(folder: &Path, name: &str, text: &str, mode: u32) -> PathBuf {
        let path = folder.join(name);
        std::fs::write(&path, text).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(mode)).unwrap();
        path
    }

    #[test]
    fn a_program_is_found_where_the_system_finds_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = file(folder.path(), "driver", "#!/bin/sh\n", 0o755);
        assert_eq!(find_in("driver", Some(folder.path().as_os_str())).unwrap(), path);
        assert_eq!(find_in(path.to_str().unwrap(), None).unwrap(), path);
    }

    #[test]
    fn what_cannot_be_started_is_named_with_the_reason() {
        let folder = tempfile::tempdir().unwrap();
        let here = folder.path().display();
        let plain = file(folder.path(), "plain", "text", 0o644);
        let script = file(folder.path(), "script", "#! /no/such/python -u\n", 0o755);
        let said = |name: &str| find_in(name, Some(folder.path().as_os_str())).unwrap_err().to_string();
        assert_eq!(said("driver"), format!("driver: no such program in {here}"));
        assert_eq!(said("/no/such/driver"), "/no/such/driver: no such program");
        assert!(said("plain").starts_with(&format!("{}: not a program that this user may start: ", plain.display())));
        assert!(said(&here.to_string()).contains("not a program that this user may start"), "a folder is no program");
        assert_eq!(said("script"), format!("{}: its interpreter /no/such/python does not exist", script.display()));
    }
}
