//! Faults that somebody asks for while the deployment runs: a file for each in the deployment's private folder.

use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use settings::{PlannedFault, SettingsError};

/// The folder within the domain's.
const FOLDER: &str = "faults";

/// An order that could not be given or taken.
#[derive(Debug, thiserror::Error)]
pub enum OrderError {
    /// The file system refuses.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What it says.
        source: io::Error,
    },
    /// It is no fault.
    #[error("{0}")]
    Unreadable(#[from] SettingsError),
    /// It cannot be written.
    #[error("this fault cannot be written: {0}")]
    Unwritable(#[from] toml::ser::Error),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Order {
    fault: Vec<PlannedFault>,
}

/// Asks the injector of the deployment whose folder is `domain` for a fault; it begins as soon as the injector has seen it.
///
/// # Errors
/// When the folder cannot be written.
pub fn give_order(domain: &Path, fault: &PlannedFault) -> Result<(), OrderError> {
    let text = toml::to_string(&Order { fault: vec![fault.clone()] })?;
    let folder = domain.join(FOLDER);
    let io = |path: &Path, source| OrderError::Io { path: path.to_owned(), source };
    std::fs::create_dir_all(&folder).map_err(|source| io(&folder, source))?;
    let fresh = folder.join(format!("{}.fresh", std::process::id()));
    std::fs::write(&fresh, text).map_err(|source| io(&fresh, source))?;
    // Seen whole or not at all.
    let order = fresh.with_extension("toml");
    std::fs::rename(&fresh, &order).map_err(|source| io(&order, source))
}

/// Takes the orders that have come since.
///
/// # Errors
/// Each order that is no fault, or whose file cannot be removed, is an error of its own.
pub fn take_orders(domain: &Path) -> Vec<Result<PlannedFault, OrderError>> {
    let mut taken = Vec::new();
    for entry in std::fs::read_dir(domain.join(FOLDER)).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.extension().is_none_or(|extension| extension != "toml") {
            continue;
        }
        let read = settings::read_text(&path).and_then(|text| settings::parse::<Order>(&path.display().to_string(), &text));
        if let Err(source) = std::fs::remove_file(&path) {
            taken.push(Err(OrderError::Io { path, source }));
            continue;
        }
        match read {
            Ok(order) => taken.extend(order.fault.into_iter().map(Ok)),
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
    fn an_order_is_taken_once_and_nonsense_is_said_once() {
        let folder = tempfile::tempdir().unwrap();
        let fault = PlannedFault::always(Disturbance::Service { service: RoutedService::Verdict, fault: StreamFault::Stall });
        give_order(folder.path(), &fault).unwrap();
        let taken = take_orders(folder.path());
        assert_eq!(taken.len(), 1);
        assert_eq!(taken[0].as_ref().unwrap(), &fault);
        assert!(take_orders(folder.path()).is_empty());
        std::fs::write(folder.path().join("faults/1.toml"), "fault = 3").unwrap();
        assert!(matches!(take_orders(folder.path()).as_slice(), [Err(OrderError::Unreadable(_))]));
        assert!(take_orders(folder.path()).is_empty());
    }
}
