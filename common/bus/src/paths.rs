//! Where domains live on this machine.
//!
//! `<runtime>/<name>.lock` says that a supervisor lives, `<runtime>/<name>.members` that any process of the domain does, and
//! `<runtime>/<name>/` holds what the deployment needs while it runs. `<runtime>` belongs to the user alone.

use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The folder of all domains of this user: `$STILLMAP_RUNTIME_DIR`, `$XDG_RUNTIME_DIR/stillmap`, or `/tmp/stillmap-<uid>`.
///
/// # Errors
/// When it cannot be made, or is another user's (someone else could have put it there).
pub(crate) fn runtime_dir() -> io::Result<PathBuf> {
    let from_environment = |key: &str| std::env::var_os(key).filter(|value| !value.is_empty()).map(PathBuf::from);
    let uid = rustix::process::getuid().as_raw();
    let path = from_environment("STILLMAP_RUNTIME_DIR")
        .or_else(|| from_environment("XDG_RUNTIME_DIR").map(|run| run.join("stillmap")))
        .unwrap_or_else(|| PathBuf::from(format!("/tmp/stillmap-{uid}")));
    make_private(&path)?;
    Ok(path)
}

/// Makes a folder that only its user may enter, and the folders above it that are missing.
///
/// ```
/// let folder = std::env::temp_dir().join(format!("example-private-{}", std::process::id()));
/// stillmap_bus::make_private(&folder)?;
/// std::fs::remove_dir(folder)?;
/// # Ok::<(), std::io::Error>(())
/// ```
///
/// # Errors
/// When the file system refuses, or the folder that is there already belongs to another user or others may write to it.
pub fn make_private(path: &Path) -> io::Result<()> {
    std::fs::DirBuilder::new().recursive(true).mode(0o700).create(path)?;
    let found = std::fs::symlink_metadata(path)?;
    let uid = rustix::process::getuid().as_raw();
    if !found.is_dir() || found.uid() != uid || found.mode() & 0o022 != 0 {
        return Err(io::Error::other(format!(
            "{} is owned by user {} with mode {:o}, expected a folder of user {uid} that no other user may write",
            path.display(),
            found.uid(),
            found.mode() & 0o777
        )));
    }
    Ok(())
}

/// The folder, in that of a domain, of checkpoints that go with the deployment.
pub(crate) fn volatile_state(directory: &Path) -> PathBuf {
    directory.join("state")
}

/// The paths of one domain.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct DomainPaths {
    pub(crate) name: String,
    pub(crate) lock: PathBuf,
    pub(crate) members: PathBuf,
    pub(crate) directory: PathBuf,
}

impl DomainPaths {
    pub(crate) fn new(runtime: &Path, name: &str) -> Self {
        Self {
            name: name.to_owned(),
            lock: runtime.join(format!("{name}.lock")),
            members: runtime.join(format!("{name}.members")),
            directory: runtime.join(name),
        }
    }

    /// The paths of a domain whose folder is known.
    pub(crate) fn of_directory(directory: &Path) -> Option<Self> {
        Some(Self::new(directory.parent()?, directory.file_name()?.to_str()?))
    }

    /// Root path of iceoryx2 within the domain.
    pub(crate) fn root(&self) -> PathBuf {
        self.directory.join("bus")
    }

    /// Prefix of the domain's files in `/dev/shm`: another one for every folder, since the folder of shared memory is one.
    pub(crate) fn prefix(&self) -> String {
        let hash = crc32fast::hash(self.directory.as_os_str().as_encoded_bytes());
        format!("stillmap_{hash:08x}_")
    }

    /// Makes what lies in shared memory the user's alone: iceoryx2 leaves one small file open to all users.
    pub(crate) fn close_to_others(&self) -> io::Result<()> {
        let prefix = self.prefix();
        let uid = rustix::process::getuid().as_raw();
        for entry in std::fs::read_dir("/dev/shm")?.flatten() {
            let is_open = || entry.metadata().is_ok_and(|found| found.uid() == uid && found.mode() & 0o077 != 0);
            if entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes()) && is_open() {
                ignore_missing(std::fs::set_permissions(entry.path(), std::fs::Permissions::from_mode(0o600)))?;
            }
        }
        Ok(())
    }

    /// The folders of the domain, and the files that its services have for as long as they exist. Others come and go with observers.
    pub(crate) fn of_the_bus(&self) -> io::Result<Vec<PathBuf>> {
        let prefix = self.prefix();
        let in_memory = std::fs::read_dir("/dev/shm")?.flatten();
        let in_memory = in_memory.filter(|entry| entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes()));
        let services = std::fs::read_dir(self.root().join("services")).into_iter().flatten().flatten();
        let files = in_memory.chain(services).map(|entry| entry.path());
        let lasting = files.filter(|path| path.extension().is_some_and(|extension| extension == "dynamic" || extension == "service"));
        Ok([self.directory.clone(), self.root()].into_iter().chain(lasting).collect())
    }

    /// Removes everything the domain ever put anywhere. Only while nothing lives in it.
    pub(crate) fn wipe(&self) -> io::Result<()> {
        self.wipe_bus()?;
        remove_tree(&self.directory)
    }

    /// Removes what iceoryx2 has made, and keeps the checkpoints of the run. Only while nothing lives in the domain.
    pub(crate) fn wipe_bus(&self) -> io::Result<()> {
        let prefix = self.prefix();
        let uid = rustix::process::getuid().as_raw();
        for entry in std::fs::read_dir("/dev/shm")?.flatten() {
            // What another user has put there under this prefix is no file of the domain, and cannot be removed.
            let is_ours = || entry.metadata().is_ok_and(|found| found.uid() == uid);
            if entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes()) && is_ours() {
                ignore_missing(std::fs::remove_file(entry.path()))?;
            }
        }
        remove_tree(&self.root())
    }
}

/// Most tries to remove a folder, and the time between two: an observer that joins adds files for some milliseconds.
const TRIES: u32 = 100;
const BETWEEN_TRIES: Duration = Duration::from_millis(5);

/// Removes a folder with all that is in it, if it is there.
fn remove_tree(folder: &Path) -> io::Result<()> {
    for _ in 1..TRIES {
        match std::fs::remove_dir_all(folder) {
            Err(error) if error.kind() == io::ErrorKind::DirectoryNotEmpty => std::thread::park_timeout(BETWEEN_TRIES),
            result => return ignore_missing(result),
        }
    }
    ignore_missing(std::fs::remove_dir_all(folder))
}

pub(crate) fn ignore_missing(result: io::Result<()>) -> io::Result<()> {
    match result {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        other => other,
    }
}

/// Names of the domains in a runtime folder, alive or not.
pub(crate) fn names(runtime: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(runtime).into_iter().flatten().flatten();
    entries.filter_map(|entry| Some(entry.file_name().to_str()?.strip_suffix(".lock")?.to_owned())).collect()
}
