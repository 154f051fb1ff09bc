//! The files of a bag.

use std::fs::{self, File};
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::BagError;

/// A file of a bag, ready to be read.
pub(crate) struct BagFile {
    /// The file as the user knows it.
    pub(crate) path: PathBuf,
    pub(crate) storage: Storage,
    /// What an intact file was unpacked to.
    unpacked: Option<NamedTempFile>,
}

/// How a file stores messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Storage {
    Mcap,
    Sqlite,
}

impl BagFile {
    /// The file to read.
    pub(crate) fn readable(&self) -> &Path {
        self.unpacked.as_ref().map_or(&self.path, NamedTempFile::path)
    }

    fn open(path: PathBuf) -> Result<Option<Self>, BagError> {
        let Some((storage, is_packed)) = form(&path) else { return Ok(None) };
        let unpacked = if is_packed { Some(unpack(&path)?) } else { None };
        Ok(Some(Self { path, storage, unpacked }))
    }
}

/// The files of a bag in their order: those of a folder that `ros2 bag record` has written, or one file.
pub(crate) fn files(bag: &Path) -> Result<Vec<BagFile>, BagError> {
    let mut paths = vec![bag.to_owned()];
    if bag.is_dir() {
        let entries = fs::read_dir(bag).map_err(BagError::io(bag))?;
        let found: Result<Vec<_>, io::Error> = entries.map(|entry| Ok(entry?.path())).collect();
        paths = found.map_err(BagError::io(bag))?;
        paths.sort_by_cached_key(|path| natural(&path.to_string_lossy()));
    } else {
        File::open(bag).map_err(BagError::io(bag))?;
    }
    let files: Vec<BagFile> = paths.into_iter().filter_map(|path| BagFile::open(path).transpose()).collect::<Result<_, _>>()?;
    if files.is_empty() { Err(BagError::NoBag { path: bag.to_owned() }) } else { Ok(files) }
}

/// How a file stores messages, and whether all of it is packed, by its name.
fn form(path: &Path) -> Option<(Storage, bool)> {
    let name = path.file_name()?.to_str()?;
    let (name, is_packed) = name.strip_suffix(".zstd").map_or((name, false), |name| (name, true));
    match Path::new(name).extension()?.to_str()? {
        "mcap" => Some((Storage::Mcap, is_packed)),
        "db3" => Some((Storage::Sqlite, is_packed)),
        _ => None,
    }
}

fn unpack(path: &Path) -> Result<NamedTempFile, BagError> {
    let packed = File::open(path).map_err(BagError::io(path))?;
    let mut decoder =
        ruzstd::decoding::StreamingDecoder::new(BufReader::new(packed)).map_err(io::Error::other).map_err(BagError::io(path))?;
    let mut unpacked = NamedTempFile::new().map_err(BagError::io(path))?;
    io::copy(&mut decoder, &mut unpacked).map_err(BagError::io(path))?;
    Ok(unpacked)
}

/// A key by which numbers in a name are compared as numbers: `sonar2` comes before `sonar10`.
pub(crate) fn natural(name: &str) -> Vec<(String, u64)> {
    let mut parts = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let start = rest.find(|letter: char| letter.is_ascii_digit()).unwrap_or(rest.len());
        let (word, behind) = rest.split_at(start);
        let end = behind.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(behind.len());
        let (digits, behind) = behind.split_at(end);
        parts.push((word.to_owned(), digits.parse().unwrap_or(u64::MAX)));
        rest = behind;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_are_compared_as_numbers() {
        let mut names = ["bag_10.mcap", "bag_2.mcap", "bag_1.mcap", "a"];
        names.sort_by_cached_key(|name| natural(name));
        assert_eq!(names, ["a", "bag_1.mcap", "bag_2.mcap", "bag_10.mcap"]);
    }

    #[test]
    fn the_form_of_a_file_is_told_by_its_name() {
        let form = |name: &str| form(Path::new(name));
        assert_eq!(form("b/x_0.mcap"), Some((Storage::Mcap, false)));
        assert_eq!(form("x_0.db3.zstd"), Some((Storage::Sqlite, true)));
        assert_eq!((form("metadata.yaml"), form("x.zstd"), form("db3")), (None, None, None));
    }

    #[test]
    fn a_folder_without_a_bag_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("metadata.yaml"), "").unwrap();
        let refused = files(folder.path()).err().unwrap().to_string();
        assert!(refused.ends_with("has no file of a bag, expected .mcap, .db3, .mcap.zstd or .db3.zstd"), "{refused}");
    }
}
