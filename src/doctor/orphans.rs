//! Shared memory of deployments that are dead.
//!
//! A guard removes what a killed supervisor leaves, and the next start of the same deployment what a killed guard does. Where both were
//! killed and the deployment never starts again, as one with another runtime folder, its files take memory until the computer restarts.

use super::finding::Finding;
use crate::running::user_name;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::DirEntry;
use std::os::unix::fs::MetadataExt;

/// The folder of shared memory.
const FOLDER: &str = "/dev/shm";
/// What the names of all files begin with, and the digits that follow, which are those of a deployment.
const PREFIX: &str = "stillmap_";
const DIGITS: usize = 8;
/// Bytes of a block, in which the size of a file in memory is counted (stat(2)).
const BLOCK: u64 = 512;
/// Most dead deployments that are listed.
const MOST_LISTED: usize = 5;

/// A file in shared memory.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Segment {
    name: String,
    owner: u32,
    bytes: u64,
}

pub(super) fn orphans() -> Finding {
    // Before the processes are looked at: a deployment that starts meanwhile has none of these.
    let segments: Vec<Segment> = entries(FOLDER).filter_map(|entry| segment(&entry)).collect();
    let user = rustix::process::getuid();
    // A user sees what the own processes have mapped, root sees all.
    let visible: Vec<Segment> = segments.into_iter().filter(|it| user.is_root() || it.owner == user.as_raw()).collect();
    let maps = entries("/proc").filter_map(|process| std::fs::read_to_string(process.path().join("maps")).ok());
    let mapped: BTreeSet<String> =
        maps.flat_map(|maps| maps.lines().filter_map(mapped_prefix).map(str::to_owned).collect::<Vec<_>>()).collect();
    judge(&visible, &mapped)
}

fn entries(folder: &str) -> impl Iterator<Item = DirEntry> {
    std::fs::read_dir(folder).into_iter().flatten().flatten()
}

fn segment(entry: &DirEntry) -> Option<Segment> {
    let found = entry.metadata().ok()?;
    Some(Segment { name: entry.file_name().into_string().ok()?, owner: found.uid(), bytes: found.blocks() * BLOCK })
}

/// What all files of a deployment begin with, in the name of one of them.
fn prefix(name: &str) -> Option<&str> {
    let digits = name.strip_prefix(PREFIX)?;
    let is_one = digits.get(..DIGITS)?.bytes().all(|digit| digit.is_ascii_hexdigit()) && digits[DIGITS..].starts_with('_');
    if is_one { name.get(..PREFIX.len() + DIGITS + 1) } else { None }
}

/// The prefix of the file that a line of `/proc/PID/maps` maps.
fn mapped_prefix(line: &str) -> Option<&str> {
    prefix(line.split_once(FOLDER)?.1.strip_prefix('/')?)
}

fn judge(segments: &[Segment], mapped: &BTreeSet<String>) -> Finding {
    let mut dead: BTreeMap<(u32, &str), u64> = BTreeMap::new();
    let orphans = segments.iter().filter_map(|it| Some((it, prefix(&it.name)?))).filter(|(_, prefix)| !mapped.contains(*prefix));
    orphans.for_each(|(it, prefix)| *dead.entry((it.owner, prefix)).or_default() += it.bytes);
    if dead.is_empty() {
        return Finding::Well(format!("no dead deployment has left a file in {FOLDER}"));
    }
    let mb = |bytes: u64| bytes as f64 / 1e6;
    let listed = dead.iter().take(MOST_LISTED);
    let each = listed.map(|((owner, prefix), bytes)| format!("{prefix}* of {}, {:.1} MB", user_name(*owner), mb(*bytes)));
    let more = dead.len().saturating_sub(MOST_LISTED);
    let rest = (more > 0).then(|| format!("{more} more"));
    let each: Vec<String> = each.chain(rest).collect();
    let files = dead.keys().take(MOST_LISTED).map(|(_, prefix)| format!(" {FOLDER}/{prefix}*")).collect::<String>();
    Finding::Doubtful {
        found: format!("{:.1} MB in {FOLDER} are of deployments that no process runs: {}", mb(dead.values().sum()), each.join("; ")),
        remedy: format!("rm{files}, unless a container that shares {FOLDER} runs them"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(name: &str, bytes: u64) -> Segment {
        Segment { name: name.to_owned(), owner: 0, bytes }
    }

    #[test]
    fn files_that_no_process_maps_are_named_with_what_frees_them() {
        let segments = [
            segment("stillmap_0000000a_1.data", 1_000_000),
            segment("stillmap_0000000a_2.dynamic", 500_000),
            segment("stillmap_0000000b_1.data", 7_000_000),
            segment("stillmap_notes", 1),
            segment("of-another", 1),
        ];
        let line = "7f0-7f1 rw-s 00000000 00:19 4 /dev/shm/stillmap_0000000b_9.data";
        let mapped = |line: &str| mapped_prefix(line).into_iter().map(str::to_owned).collect();
        let Finding::Doubtful { found, remedy } = judge(&segments, &mapped(line)) else { panic!("one is dead") };
        assert!(found.starts_with("1.5 MB in /dev/shm ") && found.ends_with(": stillmap_0000000a_* of root, 1.5 MB"), "{found}");
        assert!(remedy.starts_with("rm /dev/shm/stillmap_0000000a_*,"), "{remedy}");
        assert!(matches!(judge(&segments[2..], &mapped(line)), Finding::Well(_)));
        assert!(matches!(judge(&segments[2..], &mapped("7f0-7f1 rw-s 0 00:19 4 /lib/libc.so.6")), Finding::Doubtful { .. }));
    }

    #[test]
    fn a_long_list_is_cut() {
        let segments: Vec<Segment> = (0..8).map(|number| segment(&format!("stillmap_{number:08x}_1.data"), 1_000_000)).collect();
        let Finding::Doubtful { found, .. } = judge(&segments, &BTreeSet::new()) else { panic!("all are dead") };
        assert!(found.starts_with("8.0 MB") && found.ends_with("; 3 more"), "{found}");
    }
}
