//! What the supervisor reports although no process died: lost messages, and a disk that is nearly full.

use crate::events::Notice;
use messages::{Counter, DeploymentStatus, ProcessStatus};
use std::path::Path;
use std::time::Duration;

/// Least time between two reports of lost messages of one process. A stream that loses messages does so many times a second.
const BETWEEN_LOSSES: Duration = Duration::from_secs(60);
/// How often the disk is looked at. At the 7 MB/s of a log with pictures of 640 × 480 at 15 Hz in colour, 70 MB are written meanwhile.
const BETWEEN_DISKS: Duration = Duration::from_secs(10);
/// The disk is reported again after it had this many times as much space: a value about the limit is one event.
const HYSTERESIS: f64 = 1.5;

/// What has been reported.
#[derive(Debug)]
pub(crate) struct Watch {
    processes: Vec<Reported>,
    disk_checked: Option<Duration>,
    disk_is_low: bool,
}

#[derive(Debug, Clone, Copy, Default)]
struct Reported {
    count: u64,
    at: Option<Duration>,
}

impl Watch {
    pub(crate) fn new(processes: usize) -> Self {
        Self { processes: vec![Reported::default(); processes], disk_checked: None, disk_is_low: false }
    }

    /// The processes that have lost messages since the last report of them.
    pub(crate) fn losses(&mut self, status: &DeploymentStatus, now: Duration) -> Vec<Notice> {
        let mut notices = Vec::new();
        for (process, (reported, of)) in self.processes.iter_mut().zip(status.processes()).enumerate() {
            let count = lost(of);
            if count > reported.count && reported.at.is_none_or(|at| now >= at + BETWEEN_LOSSES) {
                *reported = Reported { count, at: Some(now) };
                notices.push(Notice::Lost { process, count });
            }
        }
        notices
    }

    /// Whether it is time to look at the disk.
    pub(crate) fn disk_is_due(&mut self, now: Duration) -> bool {
        let due = self.disk_checked.is_none_or(|at| now >= at + BETWEEN_DISKS);
        if due {
            self.disk_checked = Some(now);
        }
        due
    }

    /// A notice when the space falls below the limit.
    pub(crate) fn disk(&mut self, path: &Path, free_mb: u64, low_mb: f64) -> Option<Notice> {
        let was_low = self.disk_is_low;
        self.disk_is_low = (free_mb as f64) < if was_low { low_mb * HYSTERESIS } else { low_mb };
        (self.disk_is_low && !was_low).then(|| Notice::DiskLow { path: path.to_owned(), free_mb })
    }
}

/// Messages that a process did not receive, or did not record, and lost parts of the log.
fn lost(process: &ProcessStatus) -> u64 {
    let counters = process.counters.iter().take(process.counters_count as usize);
    let counted = counters.filter(|counter| [Counter::NOT_RECORDED, Counter::PARTS_LOST].contains(&counter.name.as_str()));
    counted.fold(process.lost, |sum, counter| sum.saturating_add(counter.value))
}

/// Free space of the disk that a folder is on, MB; `None` if the system does not tell.
pub(crate) fn free_mb(folder: &Path) -> Option<u64> {
    let found = rustix::fs::statvfs(folder).ok()?;
    Some(found.f_bavail.saturating_mul(found.f_frsize) / 1_000_000)
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::Text;

    fn status(lost: u64, not_recorded: u64) -> DeploymentStatus {
        let mut status = DeploymentStatus { count: 1, ..DeploymentStatus::default() };
        status.processes[0] = ProcessStatus { lost, counters_count: 1, ..ProcessStatus::default() };
        status.processes[0].counters[0] = Counter { name: Text::new(Counter::NOT_RECORDED), value: not_recorded };
        status
    }

    #[test]
    fn losses_are_reported_once_a_minute_if_there_are_more() {
        let mut watch = Watch::new(1);
        let s = Duration::from_secs;
        assert_eq!(watch.losses(&status(0, 0), s(0)), []);
        assert_eq!(watch.losses(&status(2, 1), s(1)), [Notice::Lost { process: 0, count: 3 }]);
        assert_eq!(watch.losses(&status(9, 1), s(60)), []);
        assert_eq!(watch.losses(&status(9, 1), s(61)), [Notice::Lost { process: 0, count: 10 }]);
        assert_eq!(watch.losses(&status(9, 1), s(200)), []);
    }

    #[test]
    fn a_disk_about_the_limit_is_one_event() {
        let mut watch = Watch::new(0);
        let mut is_reported = |free_mb| watch.disk(Path::new("/out"), free_mb, 100.0).is_some();
        let found = [200, 99, 120, 99, 150, 99].map(&mut is_reported);
        assert_eq!(found, [false, true, false, false, false, true]);
    }

    #[test]
    fn the_disk_is_looked_at_every_ten_seconds() {
        let mut watch = Watch::new(0);
        let due = [0, 9, 10, 19, 20].map(|at| watch.disk_is_due(Duration::from_secs(at)));
        assert_eq!(due, [true, false, true, false, true]);
    }
}
