//! What the result of a run lacks, by the counters of its processes.

use crate::process::mapping::{CELLS_LEFT_OUT, DOUBTFUL_POSES};
use crate::process::playback::{FRAMES_MISSING, PARTS_MISSING, SCANS_MISSING};
use crate::process::recorder::{NOT_RECORDED, PARTS_LOST};
use crate::process::sbs::{FRAMES_ANSWERED, FRAMES_SKIPPED, are_many};
use crate::progress;
use messages::DeploymentStatus;

/// The count of each shortfall. A recorder continues the counts of the one before it, and its last count holds. Of the others the largest
/// one holds: a process that starts again counts anew.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Shortfall {
    doubtful_poses: u64,
    cells_left_out: u64,
    not_recorded: u64,
    parts_lost: u64,
    parts_missing: u64,
    scans_missing: u64,
    frames_missing: u64,
    /// Frames for which SBS had no time, and the others.
    frames_skipped: u64,
    frames_answered: u64,
}

impl Shortfall {
    /// Takes note of the counters in a status.
    pub(crate) fn note(&mut self, status: &DeploymentStatus) {
        let counts = [
            (&mut self.doubtful_poses, DOUBTFUL_POSES),
            (&mut self.cells_left_out, CELLS_LEFT_OUT),
            (&mut self.parts_missing, PARTS_MISSING),
            (&mut self.scans_missing, SCANS_MISSING),
            (&mut self.frames_missing, FRAMES_MISSING),
            (&mut self.frames_skipped, FRAMES_SKIPPED),
            (&mut self.frames_answered, FRAMES_ANSWERED),
        ];
        for (last, name) in [(&mut self.not_recorded, NOT_RECORDED), (&mut self.parts_lost, PARTS_LOST)] {
            let counted = status.processes().iter().find_map(|process| progress::counter(process, name));
            *last = counted.unwrap_or(*last);
        }
        for (most, name) in counts {
            let count: u64 = status.processes().iter().filter_map(|process| progress::counter(process, name)).sum();
            *most = count.max(*most);
        }
    }

    /// Whether the map lacks a part, or recorded data were lost, in this run or in the one that it replays.
    pub(crate) fn is_incomplete(&self) -> bool {
        [self.cells_left_out, self.not_recorded, self.parts_lost, self.parts_missing].iter().any(|count| *count > 0)
    }

    /// Lines for the summary of the run.
    pub(crate) fn lines(&self) -> Vec<String> {
        let counted = |count: u64, word: &str, rest: &str| {
            let words = if count == 1 { format!("1 {word}") } else { format!("{count} {word}s") };
            (count > 0).then(|| format!("{words}{rest}"))
        };
        let listed = |counts: &[Option<String>]| Some(counts.iter().flatten().cloned().collect::<Vec<_>>().join(", "));
        let line =
            |counts: &[Option<String>], start: &str| listed(counts).filter(|list| !list.is_empty()).map(|list| format!("{start}{list}"));
        let recorded = [counted(self.not_recorded, "message", " not recorded"), counted(self.parts_lost, "part", " removed or truncated")];
        let replayed =
            [counted(self.parts_missing, "part", ""), counted(self.scans_missing, "scan", ""), counted(self.frames_missing, "frame", "")];
        let doubtful = counted(self.doubtful_poses, "gap", ": the map may be shifted from there on");
        let left_out = counted(self.cells_left_out, "known cell", " too far from the rest for one picture");
        [
            line(&[left_out], "map        INCOMPLETE: "),
            line(&recorded, "log        INCOMPLETE: "),
            line(&replayed, "replay     INCOMPLETE, the log lacks "),
            line(&[doubtful], "poses      DOUBTFUL after "),
            too_slow(self.frames_skipped, self.frames_answered).map(|words| format!("pictures   {words}")),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

/// Words for frames that were skipped, if they are many.
fn too_slow(skipped: u64, answered: u64) -> Option<String> {
    let words = || format!("this computer was too slow: {} of {} pictures skipped", grouped(skipped), grouped(skipped + answered));
    are_many(skipped, answered).then(words)
}

/// A number with its thousands parted by commas.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let part = |(index, digit): (usize, char)| {
        let comma = index > 0 && (digits.len() - index).is_multiple_of(3);
        comma.then_some(',').into_iter().chain([digit])
    };
    digits.chars().enumerate().flat_map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_summary_has_a_line_for_each_kind_of_shortfall() {
        assert_eq!(Shortfall::default().lines(), [""; 0]);
        let recorded = Shortfall { not_recorded: 1, parts_lost: 2, ..Shortfall::default() };
        assert_eq!(recorded.lines(), ["log        INCOMPLETE: 1 message not recorded, 2 parts removed or truncated"]);
        assert!(recorded.is_incomplete());
        let cut = Shortfall { cells_left_out: 12, ..Shortfall::default() };
        assert_eq!(cut.lines(), ["map        INCOMPLETE: 12 known cells too far from the rest for one picture"]);
        assert!(cut.is_incomplete());
        let replayed = Shortfall { scans_missing: 80, doubtful_poses: 1, ..Shortfall::default() };
        let lines =
            ["replay     INCOMPLETE, the log lacks 80 scans", "poses      DOUBTFUL after 1 gap: the map may be shifted from there on"];
        assert_eq!(replayed.lines(), lines);
        assert!(!replayed.is_incomplete(), "faults on purpose drop scans, too");
    }

    #[test]
    fn a_summary_names_a_computer_that_skips_pictures() {
        let lines = |frames_skipped, frames_answered| Shortfall { frames_skipped, frames_answered, ..Shortfall::default() }.lines();
        assert_eq!(lines(341, 771), ["pictures   this computer was too slow: 341 of 1,112 pictures skipped"]);
        assert_eq!(lines(0, 1_112), [""; 0]);
        assert_eq!(lines(3, 1_109), [""; 0], "what a restart skips");
        assert_eq!([0, 999, 1_000, 1_234_567].map(grouped), ["0", "999", "1,000", "1,234,567"]);
    }
}
