//! Faults that are requested while the deployment runs: a file for each in the private folder of the deployment.

use std::io;
use std::path::{Path, PathBuf};

use document::DocumentError;
use serde::{Deserialize, Serialize};
use settings::PlannedFault;

/// Folder of the requests within the folder of the domain.
const FOLDER: &str = "faults";

/// A request could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum RequestError {
    /// The file system reports an error.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// Its error.
        source: io::Error,
    },
    /// The file does not describe a fault.
    #[error("{0}")]
    Unreadable(#[from] DocumentError),
    /// The fault cannot be serialised.
    #[error("this fault cannot be written: {0}")]
    Unwritable(#[from] toml::ser::Error),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Request {
    fault: Vec<PlannedFault>,
}

/// Requests a fault from the injector of the deployment whose folder is `domain`. It begins when the injector reads the request.
///
/// # Errors
/// When the folder cannot be written.
pub fn request_fault(domain: &Path, fault: &PlannedFault) -> Result<(), RequestError> {
    let text = toml::to_string(&Request { fault: vec![fault.clone()] })?;
    let folder = domain.join(FOLDER);
    let io = |path: &Path, source| RequestError::Io { path: path.to_owned(), source };
    std::fs::create_dir_all(&folder).map_err(|source| io(&folder, source))?;
    let fresh = folder.join(format!("{}.fresh", std::process::id()));
    std::fs::write(&fresh, text).map_err(|source| io(&fresh, source))?;
    // The injector sees the whole file or none.
    let request = fresh.with_extension("toml");
    std::fs::rename(&fresh, &request).map_err(|source| io(&request, source))
}

/// Removes and returns the waiting requests.
///
/// # Errors
/// One for each file that does not describe a fault or cannot be removed.
pub fn take_requests(domain: &Path) -> Vec<Result<PlannedFault, RequestError>> {
    let mut taken = Vec::new();
    for entry in std::fs::read_dir(domain.join(FOLDER)).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.extension().is_none_or(|extension| extension != "toml") {
            continue;
        }
        let read = document::read_text(&path).and_then(|text| document::parse::<Request>(&path.display().to_string(), &text));
        if let Err(source) = std::fs::remove_file(&path) {
            taken.push(Err(RequestError::Io { path, source }));
            continue;
        }
        match read {
            Ok(request) => taken.extend(request.fault.into_iter().map(Ok)),
            Err(error) => taken.push(Err(error.into())),
        }
    }
    taken
}

#[cfg(test)]
mod tests {
    use super::*;
    use settings::{Disturbance, RoutedService, StreamFault};

    #[test]
    fn each_request_is_taken_once_valid_or_not() {
        let folder = tempfile::tempdir().unwrap();
        let fault =
            PlannedFault::always(Disturbance::Service { service: RoutedService::named("map/verdict").unwrap(), fault: StreamFault::Stall });
        request_fault(folder.path(), &fault).unwrap();
        let taken = take_requests(folder.path());
        assert_eq!(taken.len(), 1);
        assert_eq!(taken[0].as_ref().unwrap(), &fault);
        assert!(take_requests(folder.path()).is_empty());
        std::fs::write(folder.path().join("faults/1.toml"), "fault = 3").unwrap();
        assert!(matches!(take_requests(folder.path()).as_slice(), [Err(RequestError::Unreadable(_))]));
        assert!(take_requests(folder.path()).is_empty());
    }
}
