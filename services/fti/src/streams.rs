//! The streams, brought into the order of sensor time.

use messages::{CameraMotion, SonarMotion, SonarScan, seconds};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};
use state::Queue;

use crate::parameters::Patience;

/// What FTI is told.
#[derive(Debug, Clone, Copy)]
pub enum Input<'a> {
    /// A scan.
    Scan {
        /// Its number.
        seq: u64,
        /// Its time.
        stamp_ns: u64,
        /// Its readings.
        scan: &'a SonarScan,
    },
    /// STD's answer to a scan.
    Sonar {
        /// The scan's number.
        seq: u64,
        /// What moves.
        motion: &'a SonarMotion,
    },
    /// STD's answers to scans up to this one have come, or do not come any more.
    SonarPassed {
        /// The scan's number.
        seq: u64,
    },
    /// SBS's answer to a frame.
    Camera {
        /// The frame's time.
        stamp_ns: u64,
        /// What moves.
        motion: &'a CameraMotion,
    },
    /// No more frames will come.
    CameraEnded,
    /// STD answers no more.
    SonarEnded,
    /// No more scans will come: what is pending is decided.
    ScansEnded,
}

/// Most scans that wait for the other streams. More than any patience at any scan rate: a guard of memory alone.
const MOST_SCANS: usize = 1024;
/// Most frames that wait for a scan.
const MOST_FRAMES: usize = 2048;

/// A scan, and STD's answer if it came.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, Schema)]
pub(crate) struct Waiting {
    pub(crate) seq: u64,
    pub(crate) stamp_ns: u64,
    #[serde(with = "messages::payload_bytes")]
    pub(crate) scan: SonarScan,
    #[serde(with = "messages::payload_bytes")]
    pub(crate) motion: SonarMotion,
    pub(crate) answered: bool,
}

/// A frame's motion and its time.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, Schema)]
pub(crate) struct Frame {
    pub(crate) stamp_ns: u64,
    #[serde(with = "messages::payload_bytes")]
    pub(crate) motion: CameraMotion,
}

/// What waits for the other streams.
#[derive(Debug, Clone, Default, Serialize, Deserialize, Schema)]
pub(crate) struct Streams {
    scans: Queue<Waiting>,
    frames: Queue<Frame>,
    /// Answers of STD that came before their scan.
    early: Queue<Early>,
    camera_ns: u64,
    camera_ended: bool,
    sonar_ended: bool,
    /// STD's answer to this scan, or an older one, does not come any more if it has not come.
    sonar_passed: u64,
    scans_ended: bool,
    newest_ns: u64,
}

#[derive(Debug, Clone, Copy, Serialize, Deserialize, Schema)]
struct Early {
    seq: u64,
    #[serde(with = "messages::payload_bytes")]
    motion: SonarMotion,
}

impl Streams {
    pub(crate) fn take_in(&mut self, input: Input<'_>) {
        match input {
            Input::Scan { seq, stamp_ns, scan } => {
                self.newest_ns = self.newest_ns.max(stamp_ns);
                let early = self.early.iter().position(|early| early.seq == seq).and_then(|at| self.early.remove(at));
                let motion = early.map_or_else(SonarMotion::default, |early| early.motion);
                self.scans.push_back(Waiting { seq, stamp_ns, scan: *scan, motion, answered: early.is_some() });
            }
            Input::Sonar { seq, motion } => {
                self.sonar_passed = self.sonar_passed.max(seq);
                match self.scans.iter_mut().find(|waiting| waiting.seq == seq) {
                    Some(waiting) => (waiting.motion, waiting.answered) = (*motion, true),
                    None => {
                        self.early.push_back(Early { seq, motion: *motion });
                        if self.early.len() > MOST_SCANS {
                            self.early.pop_front();
                        }
                    }
                }
            }
            Input::Camera { stamp_ns, motion } => {
                self.camera_ns = self.camera_ns.max(stamp_ns);
                self.frames.push_back(Frame { stamp_ns, motion: *motion });
                if self.frames.len() > MOST_FRAMES {
                    self.frames.pop_front();
                }
            }
            Input::SonarPassed { seq } => self.sonar_passed = self.sonar_passed.max(seq),
            Input::CameraEnded => self.camera_ended = true,
            Input::SonarEnded => self.sonar_ended = true,
            Input::ScansEnded => self.scans_ended = true,
        }
    }

    pub(crate) fn reopen(&mut self) {
        (self.scans_ended, self.sonar_ended, self.camera_ended) = (false, false, false);
    }

    pub(crate) fn ended(&self) -> bool {
        self.scans_ended && self.scans.is_empty()
    }

    /// The next scan in order, when all that belongs before it is there or is waited for no longer.
    pub(crate) fn next(&mut self, patience: Patience, with_camera: bool) -> Option<(Waiting, Vec<Frame>)> {
        let front = self.scans.front()?;
        let overdue = self.scans_ended && patience != Patience::Endless
            || self.scans.len() > MOST_SCANS
            || matches!(patience, Patience::Seconds(most_s) if seconds(self.newest_ns.saturating_sub(front.stamp_ns)) > most_s);
        let sonar_done = front.answered || self.sonar_ended || self.sonar_passed >= front.seq;
        let camera_done = !with_camera || self.camera_ended || self.camera_ns >= front.stamp_ns;
        if !(overdue || sonar_done && camera_done) {
            return None;
        }
        let waiting = self.scans.pop_front()?;
        let mut frames = Vec::new();
        while self.frames.front().is_some_and(|frame| frame.stamp_ns <= waiting.stamp_ns) {
            frames.extend(self.frames.pop_front());
        }
        // Answers to scans gone by.
        self.early.retain(|early| early.seq > waiting.seq);
        Some((waiting, frames))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan(streams: &mut Streams, seq: u64) {
        streams.take_in(Input::Scan { seq, stamp_ns: seq * 100_000_000, scan: &SonarScan::default() });
    }

    fn sonar(streams: &mut Streams, seq: u64) {
        streams.take_in(Input::Sonar { seq, motion: &SonarMotion::default() });
    }

    fn camera(streams: &mut Streams, stamp_ns: u64) {
        streams.take_in(Input::Camera { stamp_ns, motion: &CameraMotion::default() });
    }

    fn next(streams: &mut Streams, patience: Patience) -> Option<(u64, usize)> {
        streams.next(patience, true).map(|(waiting, frames)| (waiting.seq, frames.len()))
    }

    #[test]
    fn a_scan_comes_when_the_others_have_reached_it() {
        let mut streams = Streams::default();
        sonar(&mut streams, 1);
        scan(&mut streams, 1);
        camera(&mut streams, 50_000_000);
        assert_eq!(next(&mut streams, Patience::Endless), None);
        camera(&mut streams, 110_000_000);
        assert_eq!(next(&mut streams, Patience::Endless), Some((1, 1)));
        scan(&mut streams, 2);
        camera(&mut streams, 210_000_000);
        assert_eq!(next(&mut streams, Patience::Endless), None);
        sonar(&mut streams, 2);
        assert_eq!(next(&mut streams, Patience::Endless), Some((2, 1)));
    }

    #[test]
    fn a_lost_answer_is_not_waited_for_after_a_later_one() {
        let mut streams = Streams::default();
        (1..=3).for_each(|seq| scan(&mut streams, seq));
        camera(&mut streams, 400_000_000);
        sonar(&mut streams, 2);
        assert_eq!(next(&mut streams, Patience::Endless), Some((1, 0)));
        assert_eq!(next(&mut streams, Patience::Endless), Some((2, 0)));
        assert_eq!(next(&mut streams, Patience::Endless), None);
    }

    #[test]
    fn live_continues_without_late_streams_and_lockstep_waits() {
        let mut streams = Streams::default();
        (1..=7).for_each(|seq| scan(&mut streams, seq));
        assert_eq!(next(&mut streams, Patience::Seconds(0.5)), Some((1, 0)));
        assert_eq!(next(&mut streams, Patience::Seconds(0.5)), None);
        streams.take_in(Input::CameraEnded);
        streams.take_in(Input::SonarEnded);
        assert_eq!(next(&mut streams, Patience::Endless), Some((2, 0)));
    }

    #[test]
    fn ended_streams_continue_after_a_stop() {
        let mut streams = Streams::default();
        [Input::SonarEnded, Input::CameraEnded, Input::ScansEnded].into_iter().for_each(|end| streams.take_in(end));
        assert!(streams.ended());
        streams.reopen();
        assert!(!streams.ended());
        scan(&mut streams, 1);
        assert_eq!(next(&mut streams, Patience::Endless), None, "the others may still answer");
    }
}
