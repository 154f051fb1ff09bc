//! Names for files that are put aside.

use std::path::{Path, PathBuf};

/// The first of `path-1`, `path-2` … that nothing has.
pub(crate) fn free_name(path: &Path) -> PathBuf {
    let numbered = |number: u32| {
        let mut name = path.as_os_str().to_owned();
        name.push(format!("-{number}"));
        PathBuf::from(name)
    };
    (1..u32::MAX).map(numbered).find(|name| !name.exists()).unwrap_or_else(|| numbered(u32::MAX))
}
