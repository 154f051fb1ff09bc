//! Limits of the disk space of a log: old parts are removed, the newest are kept.
//!
//! A part is kept if a file of its name with `.keep` behind it is there. A removed part is named in the description of the part that
//! began before the removal, so that a reader does not miss it.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use drivelog::following_parts;

/// With a limit of the size, a part is at most this share of it. What is kept is at least seven eighths of the limit.
const SHARE: u64 = 8;
/// With a limit of the free space, a part may have this size before anything is removed. Smaller ones would be all head: settings,
/// schemas and the map take up to a megabyte.
const SMALLEST_PART: u64 = 16 << 20;

/// How much space a log may take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Limits {
    /// Most bytes of all parts but the marked ones.
    pub log_bytes: Option<u64>,
    /// Bytes of the disk that stay free.
    pub free_bytes: Option<u64>,
}

/// A part that may be removed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct OldPart {
    pub(crate) number: u32,
    pub(crate) path: PathBuf,
    bytes: u64,
}

impl Limits {
    /// Whether the part that has grown to `part_bytes` has to end, so that old parts can be removed.
    pub(crate) fn ends_part(&self, part_bytes: u64, first: &Path, number: u32) -> bool {
        let is_long = self.log_bytes.is_some_and(|most| part_bytes >= most / SHARE);
        is_long || self.shortage(first) > 0 && part_bytes + sum(&old_parts(first, number)) >= SMALLEST_PART
    }

    /// The parts before part `number` that have to go, the oldest first.
    pub(crate) fn excess(&self, first: &Path, number: u32) -> Vec<OldPart> {
        let mut parts = old_parts(first, number);
        let most = self.log_bytes.map_or(u64::MAX, |limit| limit - limit / SHARE);
        let (mut rest, mut shortage) = (sum(&parts), self.shortage(first));
        let excess = parts.iter().take_while(|part| {
            let goes = rest > most || shortage > 0;
            rest -= part.bytes;
            shortage = shortage.saturating_sub(part.bytes);
            goes
        });
        let count = excess.count();
        parts.truncate(count);
        parts
    }

    /// Bytes that the disk has too few.
    fn shortage(&self, first: &Path) -> u64 {
        let folder = first.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
        let free = || rustix::fs::statvfs(folder).map(|found| found.f_bavail.saturating_mul(found.f_frsize));
        self.free_bytes.map_or(0, |least| free().map_or(0, |free| least.saturating_sub(free)))
    }
}

/// The parts before part `number` that are not marked.
fn old_parts(first: &Path, number: u32) -> Vec<OldPart> {
    let following = following_parts(first).unwrap_or_default();
    let all = std::iter::once((1, first.to_owned())).chain(following);
    let earlier = all.filter(|(of, path)| *of < number && !keep_path(path).exists());
    earlier.filter_map(|(number, path)| Some(OldPart { number, bytes: fs::metadata(&path).ok()?.len(), path })).collect()
}

fn sum(parts: &[OldPart]) -> u64 {
    parts.iter().map(|part| part.bytes).sum()
}

/// The file that marks a part.
fn keep_path(part: &Path) -> PathBuf {
    part.with_added_extension("keep")
}

/// Removes parts.
pub(crate) fn remove(parts: &[OldPart]) {
    let failed = |part: &OldPart, error: io::Error| tracing::warn!("{}: cannot be removed: {error}", part.path.display());
    parts.iter().for_each(|part| fs::remove_file(&part.path).unwrap_or_else(|error| failed(part, error)));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A log of parts with these sizes.
    fn log(sizes: &[usize]) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let first = folder.path().join("drive.mcap");
        for (number, bytes) in (1..).zip(sizes) {
            let path = if number == 1 { first.clone() } else { drivelog::part_path(&first, number) };
            fs::write(path, vec![0; *bytes]).unwrap();
        }
        (folder, first)
    }

    fn numbers(limits: Limits, first: &Path, number: u32) -> Vec<u32> {
        limits.excess(first, number).iter().map(|part| part.number).collect()
    }

    #[test]
    fn the_oldest_parts_go_until_an_eighth_is_free() {
        let (_folder, first) = log(&[100, 100, 100, 100]);
        let limit = |bytes| Limits { log_bytes: Some(bytes), free_bytes: None };
        assert_eq!(numbers(limit(320), &first, 5), [1, 2]);
        assert_eq!(numbers(limit(344), &first, 5), [1]);
        assert_eq!(numbers(limit(344), &first, 4), [0; 0], "the current part is not counted");
        assert_eq!(numbers(limit(1), &first, 5), [1, 2, 3, 4]);
        assert_eq!(numbers(Limits::default(), &first, 5), [0; 0]);
    }

    #[test]
    fn a_marked_part_stays_and_does_not_count() {
        let (_folder, first) = log(&[100, 100, 100, 100]);
        fs::write(keep_path(&first), "").unwrap();
        assert_eq!(numbers(Limits { log_bytes: Some(320), free_bytes: None }, &first, 5), [2]);
    }

    #[test]
    fn too_little_free_space_removes_what_is_missing() {
        let (_folder, first) = log(&[100, 100]);
        let all = Limits { log_bytes: None, free_bytes: Some(u64::MAX) };
        assert_eq!(numbers(all, &first, 3), [1, 2]);
        assert!(!all.ends_part(SMALLEST_PART - 201, &first, 3) && all.ends_part(SMALLEST_PART - 200, &first, 3));
        assert_eq!(numbers(Limits { log_bytes: None, free_bytes: Some(0) }, &first, 3), [0; 0]);
    }

    #[test]
    fn a_part_ends_at_an_eighth_of_the_size() {
        let (_folder, first) = log(&[100]);
        let limits = Limits { log_bytes: Some(800), free_bytes: None };
        assert_eq!([99, 100].map(|bytes| limits.ends_part(bytes, &first, 2)), [false, true]);
    }
}
