//! The files of a bag.

use std::fs::{self, File};
use std::io::{self, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::BagError;

/// The most that a packed file may unpack to, bytes: two hours of grey pictures of 640 × 480 pixels, 30 in a second. A few bytes can
/// stand for any number of zeros.
const MAX_UNPACKED: u64 = 64 << 30;
/// Bytes that are unpacked at a time.
const PIECE: usize = 256 << 10;

/// A file of a bag.
pub(crate) struct BagFile {
    path: PathBuf,
    pub(crate) storage: Storage,
    is_packed: bool,
}

/// How a file stores messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Storage {
    Mcap,
    Sqlite,
}

/// A file of a bag that can be read. What a packed one was unpacked to is removed when this is dropped.
pub(crate) struct Readable<'a> {
    /// The file as the user knows it.
    pub(crate) path: &'a Path,
    unpacked: Option<NamedTempFile>,
}

impl Readable<'_> {
    /// The file that has the messages.
    pub(crate) fn storage(&self) -> &Path {
        self.unpacked.as_ref().map_or(self.path, NamedTempFile::path)
    }
}

impl BagFile {
    /// The file or, if it is packed, what can be unpacked of it; the rest is told to `damaged`.
    ///
    /// # Errors
    /// When there is no room for it.
    pub(crate) fn readable(&self, damaged: &mut dyn FnMut(BagError)) -> Result<Readable<'_>, BagError> {
        let unpacked = if self.is_packed { Some(unpack(&self.path, MAX_UNPACKED, damaged)?) } else { None };
        Ok(Readable { path: &self.path, unpacked })
    }

    fn of(path: PathBuf) -> Option<Self> {
        let (storage, is_packed) = form(&path)?;
        Some(Self { path, storage, is_packed })
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
    let files: Vec<BagFile> = paths.into_iter().filter_map(BagFile::of).collect();
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

fn unpack(path: &Path, limit: u64, damaged: &mut dyn FnMut(BagError)) -> Result<NamedTempFile, BagError> {
    let mut unpacked = NamedTempFile::new().map_err(BagError::io(path))?;
    let decoder =
        File::open(path).and_then(|packed| ruzstd::decoding::StreamingDecoder::new(BufReader::new(packed)).map_err(io::Error::other));
    let mut decoder = match decoder {
        Ok(decoder) => decoder,
        Err(error) => {
            damaged(BagError::io(path)(error));
            return Ok(unpacked);
        }
    };
    let (mut piece, mut bytes) = (vec![0; PIECE], 0);
    loop {
        let count = match decoder.read(&mut piece) {
            Ok(0) => break,
            Ok(count) => count,
            Err(error) => {
                damaged(BagError::io(path)(error));
                break;
            }
        };
        bytes += count as u64;
        if bytes > limit {
            damaged(BagError::TooLarge { path: path.to_owned(), limit });
            break;
        }
        unpacked.write_all(&piece[..count]).map_err(BagError::io(path))?;
    }
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
    use ruzstd::encoding::{CompressionLevel, compress_to_vec};

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

    /// What a packed file unpacks to, and what is told of it.
    fn unpacked(packed: &[u8], limit: u64) -> (Vec<u8>, Vec<String>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.mcap.zstd");
        fs::write(&path, packed).unwrap();
        let mut damages = Vec::new();
        let unpacked = unpack(&path, limit, &mut |error| damages.push(error.to_string())).unwrap();
        let bytes = fs::read(unpacked.path()).unwrap();
        (bytes, damages.into_iter().map(|damage| damage.replace(path.to_str().unwrap(), "x")).collect())
    }

    #[test]
    fn a_packed_file_is_unpacked_as_far_as_it_can_be() {
        let content: Vec<u8> = (0..600_000_u32).map(|place| (place.wrapping_mul(place) >> 7) as u8).collect();
        let packed = compress_to_vec(content.as_slice(), CompressionLevel::Fastest);
        assert!(unpacked(&packed, 600_000) == (content.clone(), Vec::new()));
        let (bytes, damages) = unpacked(&packed, 599_999);
        assert_eq!((bytes.len() as u64 <= 599_999, damages), (true, vec!["x: unpacks to more than 599999 bytes".to_owned()]));
        let (bytes, damages) = unpacked(&packed[..packed.len() / 2], 600_000);
        assert!(!bytes.is_empty() && content.starts_with(&bytes) && damages.len() == 1, "{} bytes, {damages:?}", bytes.len());
        let (bytes, damages) = unpacked(b"no zstd", 600_000);
        assert!(bytes.is_empty() && damages.len() == 1, "{damages:?}");
    }
}
