//! What there is to say about frames, in words for people.

use messages::CameraStatus;

use ::sbs::{Answer, FrameError, Remark};

/// So many frames long a word stays: at 15 frames a second long enough to be seen.
const STAYS_FRAMES: u64 = 30;

/// The last thing there was to say, and since when.
#[derive(Debug, Clone, Default)]
pub(super) struct Remarks {
    /// What kind of thing; the numbers in the words change from frame to frame.
    kind: Option<&'static str>,
    words: String,
    since_seq: u64,
}

impl Remarks {
    /// Takes account of the answer to a frame; `Some` with words when something new is to be said.
    pub(super) fn answered(&mut self, seq: u64, answer: &Answer) -> Option<&str> {
        match words(seq, answer) {
            Some((kind, words)) => self.say(seq, kind, words),
            None => {
                if seq.saturating_sub(self.since_seq) >= STAYS_FRAMES {
                    *self = Self::default();
                }
                None
            }
        }
    }

    /// Takes account of a frame that the bus refused.
    pub(super) fn refused(&mut self, seq: u64, problem: &str) -> Option<&str> {
        self.say(seq, "refused by the bus", format!("frame {seq} refused: {problem}"))
    }

    /// What there is to say now; empty when there is nothing.
    pub(super) fn now(&self) -> &str {
        &self.words
    }

    fn say(&mut self, seq: u64, kind: &'static str, words: String) -> Option<&str> {
        let is_new = self.kind != Some(kind);
        (self.kind, self.words, self.since_seq) = (Some(kind), words, seq);
        is_new.then_some(&self.words)
    }
}

/// A kind and words for an answer that is not as it should be.
fn words(seq: u64, answer: &Answer) -> Option<(&'static str, String)> {
    let status = CameraStatus::from_number(answer.motion.status);
    Some(match &answer.remark {
        Remark::Refused(error) => (kind(error), format!("frame {seq} refused: {error}")),
        Remark::NewSize => ("size", format!("pictures of another size from frame {seq} on: the background is learned anew")),
        Remark::Gap { seconds } => ("gap", format!("{seconds:.1} s without a picture before frame {seq}")),
        Remark::ModelRestarted => {
            ("restart", format!("the camera's motion was not found for long: the background is learned anew from frame {seq}"))
        }
        Remark::BadOdometry => ("odometry", format!("the odometry at frame {seq} is no number and was not used")),
        Remark::None => match status {
            Some(CameraStatus::NotCompensated) => ("motion", format!("frame {seq}: the camera's motion was not found")),
            Some(CameraStatus::Learning) => ("learning", "learning the background".to_owned()),
            _ => return None,
        },
    })
}

fn kind(error: &FrameError) -> &'static str {
    match error {
        FrameError::Layout(_) => "layout",
        FrameError::Size { .. } => "unfit size",
        FrameError::Uniform { .. } => "uniform",
        FrameError::Saturated { .. } => "saturated",
        FrameError::Time { .. } => "time",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::CameraMotion;

    fn answer(status: CameraStatus, remark: Remark) -> Answer {
        Answer { motion: CameraMotion { status: status as u32, ..CameraMotion::default() }, remark }
    }

    #[test]
    fn a_remark_is_logged_once_and_shown_for_2_s() {
        let mut remarks = Remarks::default();
        let dark = |value| answer(CameraStatus::Refused, Remark::Refused(FrameError::Uniform { value }));
        let good = answer(CameraStatus::Compensated, Remark::None);
        assert_eq!(remarks.answered(1, &good), None);
        assert_eq!(remarks.now(), "");
        assert_eq!(remarks.answered(2, &dark(0)), Some("frame 2 refused: all pixels have the value 0"));
        assert_eq!(remarks.answered(3, &dark(1)), None, "the log has said it");
        assert_eq!(remarks.now(), "frame 3 refused: all pixels have the value 1");
        assert_eq!(
            remarks.answered(4, &answer(CameraStatus::Compensated, Remark::Gap { seconds: 3.04 })),
            Some("3.0 s without a picture before frame 4")
        );
        for seq in 5..4 + STAYS_FRAMES {
            remarks.answered(seq, &good);
            assert_eq!(remarks.now(), "3.0 s without a picture before frame 4");
        }
        remarks.answered(4 + STAYS_FRAMES, &good);
        assert_eq!(remarks.now(), "");
        assert!(remarks.refused(99, "width is 3").is_some());
    }
}
