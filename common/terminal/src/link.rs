//! The link by which clients find a terminal.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// A terminal that clients cannot find.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The system gives no pseudo-terminal.
    #[error("no pseudo-terminal: {source}")]
    Terminal {
        /// Why.
        source: io::Error,
    },
    /// Something is there that is not a link to a terminal.
    #[error("{path}: is there already, and is not a link: name another path")]
    Taken {
        /// The path of the link.
        path: PathBuf,
    },
    /// The link cannot be made.
    #[error("{path}: cannot link the terminal: {source}")]
    Io {
        /// The path of the link.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// A link to a terminal, removed with it.
#[derive(Debug)]
pub(crate) struct Link {
    name: PathBuf,
    device: PathBuf,
}

impl Link {
    /// Makes the link under another name first: at no moment does a client find none.
    pub(crate) fn make(device: &Path, name: PathBuf) -> Result<Self, LinkError> {
        if fs::symlink_metadata(&name).is_ok_and(|found| !found.is_symlink()) {
            return Err(LinkError::Taken { path: name });
        }
        let mut fresh = name.clone().into_os_string();
        fresh.push(".fresh");
        let made =
            remove(Path::new(&fresh)).and_then(|()| std::os::unix::fs::symlink(device, &fresh)).and_then(|()| fs::rename(&fresh, &name));
        match made {
            Ok(()) => Ok(Self { name, device: device.to_owned() }),
            Err(source) => Err(LinkError::Io { path: name, source }),
        }
    }

    pub(crate) fn name(&self) -> &Path {
        &self.name
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        // A later terminal may have replaced the link.
        if fs::read_link(&self.name).is_ok_and(|target| target == self.device)
            && let Err(error) = fs::remove_file(&self.name)
        {
            tracing::debug!("{} is left behind: {error}", self.name.display());
        }
    }
}

fn remove(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_not_replaced_by_a_link() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("notes.txt");
        fs::write(&name, "mine").unwrap();
        let error = Link::make(Path::new("/dev/null"), name.clone()).unwrap_err().to_string();
        assert_eq!(error, format!("{}: is there already, and is not a link: name another path", name.display()));
        assert_eq!(fs::read_to_string(&name).unwrap(), "mine");
    }

    #[test]
    fn a_missing_folder_is_named() {
        let error = Link::make(Path::new("/dev/null"), PathBuf::from("/no/such/folder/robot")).unwrap_err().to_string();
        assert!(error.starts_with("/no/such/folder/robot: cannot link the terminal: No such file"), "{error}");
    }
}
