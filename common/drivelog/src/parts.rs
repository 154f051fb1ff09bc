//! The files of a log: `drive.mcap`, and `drive.2.mcap`, `drive.3.mcap` … in which its recorder continued: after a restart, after a
//! failure of the disk or the loss of a file, or because the log is long.

use std::io;
use std::path::{Path, PathBuf};

/// The file of part `number` of a log, from 2.
#[must_use]
pub fn part_path(log: &Path, number: u32) -> PathBuf {
    let stem = log.file_stem().unwrap_or_default().to_string_lossy();
    let name = match log.extension() {
        Some(extension) => format!("{stem}.{number}.{}", extension.to_string_lossy()),
        None => format!("{stem}.{number}"),
    };
    log.with_file_name(name)
}

/// The parts that follow a log's first file, in order, with their numbers.
///
/// # Errors
/// When the folder cannot be read.
pub fn following_parts(log: &Path) -> io::Result<Vec<(u32, PathBuf)>> {
    let folder = match log.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let mut parts = Vec::new();
    for entry in folder.read_dir()? {
        let name = entry?.file_name();
        if let Some(number) = number_of(log, &name.to_string_lossy()) {
            parts.push((number, log.with_file_name(&name)));
        }
    }
    parts.sort();
    Ok(parts)
}

/// Whether a file is named as a part after the first: it is read by itself then.
pub(crate) fn is_later_part(path: &Path) -> bool {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let Some((first, _)) = stem.rsplit_once('.') else { return false };
    let mut log = path.with_file_name(first);
    if let Some(extension) = path.extension() {
        log = log.with_added_extension(extension);
    }
    number_of(&log, &path.file_name().unwrap_or_default().to_string_lossy()).is_some()
}

fn number_of(log: &Path, name: &str) -> Option<u32> {
    let stem = log.file_stem()?.to_str()?;
    let rest = name.strip_prefix(stem)?.strip_prefix('.')?;
    let number = match log.extension() {
        Some(extension) => rest.strip_suffix(extension.to_str()?)?.strip_suffix('.')?,
        None => rest,
    };
    let number: u32 = number.parse().ok()?;
    // Only as it is written: "+2" and "02" are names of something else.
    (number >= 2 && part_path(log, number).file_name()?.to_str()? == name).then_some(number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_beside_the_first_file() {
        assert_eq!(part_path(Path::new("out/drive.mcap"), 2), Path::new("out/drive.2.mcap"));
        assert_eq!(part_path(Path::new("a.b.mcap"), 11), Path::new("a.b.11.mcap"));
        assert_eq!(part_path(Path::new("drive"), 3), Path::new("drive.3"));
        let later = ["drive.mcap", "drive.2.mcap", "a.b.11.mcap", "drive.02.mcap", "drive.3.gz.mcap", "drive"];
        assert_eq!(later.map(|name| is_later_part(Path::new(name))), [false, true, true, false, false, false]);
    }

    #[test]
    fn parts_are_found_in_the_order_of_their_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let others = ["drive.1.mcap", "drive.02.mcap", "drive.+2.mcap", "drive.x.mcap", "drive.3.mcap.gz", "other.4.mcap", "drive.5"];
        for name in ["drive.mcap", "drive.10.mcap", "drive.2.mcap", "drive.3.mcap"].iter().chain(&others) {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let found = following_parts(&folder.path().join("drive.mcap")).unwrap();
        assert_eq!(found, [2, 3, 10].map(|number| (number, folder.path().join(format!("drive.{number}.mcap")))));
    }
}
