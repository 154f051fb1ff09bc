//! Answers as messages: one estimate with each scan, and at most one piece of a revision.

use std::collections::VecDeque;

use messages::{EstimateStatus, MAX_MOVED, MAX_SMOOTHED, MovedStretch, RobotEstimate, SmoothedPose, TrajectoryRevision};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};
use state::Packed;

use crate::answer::{Answer, Calibration, Moved, Smoothed, Status};

/// Poses and stretches that are still to be sent.
///
/// A reader that restarts finds in the history of a stream as many messages as were sent with the scans of the same time. So a scan has
/// one estimate with room for [`MAX_SMOOTHED`] poses, and one piece of a revision; what does not fit is sent with the next scans. A
/// revision is sent after the poses that it moves.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outgoing {
    smoothed: VecDeque<SmoothedPose>,
    /// Number and stretches of each revision.
    revisions: VecDeque<(u32, VecDeque<MovedStretch>)>,
    /// Number of the last piece that was taken.
    pieces: u64,
}

/// What an estimate says beside poses.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Facts {
    /// Errors of the odometry.
    pub calibration: Calibration,
    /// Number of walls.
    pub walls: u32,
    /// Number of recognised places.
    pub closures: u32,
}

impl Outgoing {
    /// Adds what an answer says of earlier scans.
    pub fn put(&mut self, answer: &Answer) {
        self.smoothed.extend(answer.smoothed.iter().map(smoothed));
        if let Some(revision) = answer.revision.as_ref().filter(|revision| !revision.moved.is_empty()) {
            self.revisions.push_back((revision.number, revision.moved.iter().map(stretch).collect()));
        }
    }

    /// The next estimate, with the frame and the status of an answer, and the piece that belongs to it.
    pub fn take(&mut self, answer: &Answer, facts: &Facts) -> (RobotEstimate, Option<TrajectoryRevision>) {
        let Calibration { distance_share, turn_share, curvature_rad_m } = facts.calibration;
        let mut estimate = RobotEstimate {
            map_from_odom: answer.map_from_odom.to_wire(),
            distance_share,
            turn_share,
            curvature_rad_m,
            status: status(answer.status) as u32,
            walls: facts.walls,
            closures: facts.closures,
            ..RobotEstimate::default()
        };
        let count = self.smoothed.len().min(MAX_SMOOTHED);
        estimate.smoothed.iter_mut().zip(self.smoothed.drain(..count)).for_each(|(to, pose)| *to = pose);
        estimate.count = count as u32;
        let piece = if self.smoothed.is_empty() { self.next_piece() } else { None };
        estimate.pieces = self.pieces;
        (estimate, piece)
    }

    /// Whether everything has been taken.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.smoothed.is_empty() && self.revisions.is_empty()
    }

    fn next_piece(&mut self) -> Option<TrajectoryRevision> {
        let (revision, stretches) = self.revisions.front_mut()?;
        let count = stretches.len().min(MAX_MOVED);
        let mut piece = TrajectoryRevision { revision: *revision, count: count as u32, ..TrajectoryRevision::default() };
        piece.moved.iter_mut().zip(stretches.drain(..count)).for_each(|(to, moved)| *to = moved);
        if stretches.is_empty() {
            piece.is_last = 1;
            self.revisions.pop_front();
        }
        self.pieces += 1;
        Some(piece)
    }
}

fn smoothed(it: &Smoothed) -> SmoothedPose {
    SmoothedPose { seq: it.seq, map_from_robot: it.map_from_robot.to_wire(), is_placed: u32::from(it.is_placed), reserved: 0 }
}

fn stretch(it: &Moved) -> MovedStretch {
    MovedStretch { first: it.first, last: it.last, before: it.before.to_wire(), now: it.now.to_wire() }
}

fn status(status: Status) -> EstimateStatus {
    match status {
        Status::Odometry => EstimateStatus::Odometry,
        Status::Tracking => EstimateStatus::Tracking,
        Status::Lost => EstimateStatus::Lost,
    }
}

/// As bytes have it.
#[derive(Serialize, Deserialize, Schema)]
struct SavedOutgoing<'a> {
    smoothed: Packed<'a, SmoothedPose>,
    /// Number of each revision and how many stretches it has.
    revisions: Vec<(u32, u32)>,
    stretches: Packed<'a, MovedStretch>,
    pieces: u64,
}

impl Outgoing {
    /// For the state of the process.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let smoothed: Vec<SmoothedPose> = self.smoothed.iter().copied().collect();
        let stretches: Vec<MovedStretch> = self.revisions.iter().flat_map(|(_, stretches)| stretches).copied().collect();
        let saved = SavedOutgoing {
            smoothed: Packed::from(&smoothed[..]),
            revisions: self.revisions.iter().map(|(number, stretches)| (*number, stretches.len() as u32)).collect(),
            stretches: Packed::from(&stretches[..]),
            pieces: self.pieces,
        };
        state::encode(&saved, Vec::new())
    }

    /// From the state of the process, with the bytes that follow.
    ///
    /// # Errors
    /// Bytes of another version, cut or damaged bytes.
    pub fn from_bytes(bytes: &[u8]) -> Result<(Self, &[u8]), state::DecodeError> {
        let (SavedOutgoing { smoothed, revisions, stretches, pieces }, rest) = state::take(bytes)?;
        let mut stretches = stretches.into_vec().into_iter();
        let revisions = revisions.into_iter().map(|(number, count)| (number, stretches.by_ref().take(count as usize).collect()));
        Ok((Self { smoothed: smoothed.into_vec().into(), revisions: revisions.collect(), pieces }, rest))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answer::Revision;
    use geometry::{MapFromOdom, MapFromRobot};
    use messages::Payload;

    fn answer(scans: u64, stretches: u64) -> Answer {
        let at = |x: u64| MapFromRobot::new(x as f64, 0.0, 0.0);
        let moved = (1..=stretches).map(|seq| Moved { first: seq, last: seq, before: at(seq), now: at(seq + 1) }).collect();
        Answer {
            map_from_odom: MapFromOdom::new(0.5, 0.0, 0.0),
            status: Status::Tracking,
            smoothed: (1..=scans).map(|seq| Smoothed { seq, map_from_robot: at(seq), is_placed: true }).collect(),
            revision: (stretches > 0).then_some(Revision { number: 1, moved }),
        }
    }

    #[test]
    fn what_does_not_fit_is_sent_with_the_next_scans() {
        let mut outgoing = Outgoing::default();
        outgoing.put(&answer(20, 40));
        let mut sent = Vec::new();
        while !outgoing.is_empty() {
            let (estimate, piece) = outgoing.take(&answer(0, 0), &Facts::default());
            assert_eq!((estimate.validate(), piece.map(|piece| piece.validate())), (Ok(()), piece.map(|_| Ok(()))));
            sent.push((estimate.smoothed().len(), estimate.pieces, piece.map(|piece| (piece.moved().len(), piece.is_last))));
        }
        assert_eq!(sent, [(8, 0, None), (8, 0, None), (4, 1, Some((32, 0))), (0, 2, Some((8, 1)))]);
    }

    #[test]
    fn a_restored_queue_sends_the_same_messages() {
        let mut whole = Outgoing::default();
        whole.put(&answer(12, 40));
        for _ in 0..5 {
            let bytes = whole.to_bytes();
            let (mut restored, rest) = Outgoing::from_bytes(&bytes).unwrap();
            assert_eq!((&restored, rest.len()), (&whole, 0));
            assert_eq!(restored.take(&answer(0, 0), &Facts::default()), whole.take(&answer(0, 0), &Facts::default()));
        }
        assert!(Outgoing::from_bytes(&whole.to_bytes()[..9]).is_err());
    }
}
