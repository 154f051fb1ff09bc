//! The estimates of localisation as mapping takes them: each after its scan, and before the pieces of revisions that it announces.

use bus::{BusError, Reader, Received};
use messages::{RobotEstimate, TrajectoryRevision};
use runtime::{Shell, StepError};

use ::mapping::{Input, Mapper, Refused};

pub(super) struct Estimates {
    given: Reader<RobotEstimate>,
    revisions: Reader<TrajectoryRevision>,
    /// The next estimate, until its scan is there.
    next: Option<(u64, RobotEstimate)>,
}

impl Estimates {
    /// Those after the state of the mapper.
    pub(super) fn open(shell: &mut Shell, mapper: &Mapper) -> Result<Self, BusError> {
        let (mut given, mut revisions) = (shell.reader::<RobotEstimate>()?, shell.reader::<TrajectoryRevision>()?);
        given.skip_to(mapper.estimated_up_to(), 0);
        revisions.skip_to(mapper.revised_up_to(), 0);
        Ok(Self { given, revisions, next: None })
    }

    /// Whether there is none that the mapper has not taken.
    pub(super) fn are_taken(&self, mapper: &Mapper) -> bool {
        let revised = self.revisions.ended() || !mapper.awaits_revision();
        self.given.ended() && self.next.is_none() && revised
    }

    /// Gives the mapper the next estimate or piece, if it is there. `scans_to` is the number of the last scan that came; estimates
    /// after it are there when the scans have ended. Returns whether the mapper accepted it, or `None` if there was nothing.
    pub(super) fn take(&mut self, mapper: &mut Mapper, scans_to: u64) -> Result<Option<Result<(), Refused>>, StepError> {
        if mapper.awaits_revision() && !self.revisions.ended() {
            return Ok(match self.revisions.take()? {
                None => None,
                Some(Received::Message(piece)) => Some(mapper.step(Input::Revision { number: piece.seq(), piece: &piece })),
                Some(Received::End { .. }) => Some(Ok(())),
            });
        }
        if self.next.is_none() {
            match self.given.take()? {
                None => return Ok(None),
                Some(Received::Message(estimate)) => self.next = Some((estimate.seq(), *estimate)),
                Some(Received::End { .. }) => return Ok(Some(Ok(()))),
            }
        }
        let next = self.next.take_if(|(seq, _)| *seq <= scans_to);
        Ok(next.map(|(seq, estimate)| mapper.step(Input::Estimate { seq, estimate: &estimate })))
    }
}
