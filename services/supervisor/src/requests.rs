//! Restarts that are requested while a deployment runs: an empty file with the name of the process, in the private folder of the
//! deployment.

use std::io;
use std::path::Path;

/// Folder of the requests within the folder of the domain.
const FOLDER: &str = "restart";

/// Requests that the supervisor of the deployment whose folder is `domain` restarts a process. A second request before the supervisor
/// has read the first changes nothing.
///
/// # Errors
/// When the folder cannot be written, or `process` is not the name of a file.
pub fn request_restart(domain: &Path, process: &str) -> io::Result<()> {
    let folder = domain.join(FOLDER);
    std::fs::create_dir_all(&folder)?;
    std::fs::File::create(folder.join(process)).map(drop)
}

/// Removes the waiting requests and returns the names. One that cannot be removed is not returned: it would be read again without end.
pub(crate) fn take_restart_requests(domain: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(domain.join(FOLDER)).into_iter().flatten().flatten();
    let removed = entries.filter(|entry| std::fs::remove_file(entry.path()).is_ok());
    removed.filter_map(|entry| entry.file_name().into_string().ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_is_read_once() {
        let domain = tempfile::tempdir().unwrap();
        assert_eq!(take_restart_requests(domain.path()), Vec::<String>::new());
        request_restart(domain.path(), "std").unwrap();
        request_restart(domain.path(), "std").unwrap();
        assert_eq!(take_restart_requests(domain.path()), ["std"]);
        assert_eq!(take_restart_requests(domain.path()), Vec::<String>::new());
    }
}
