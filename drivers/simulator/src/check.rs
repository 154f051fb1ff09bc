//! What the parts of a world owe each other.

use crate::geometry::Segment;
use crate::still;
use crate::world::{MAX_WALKERS, Pillar, World};

/// Most straight pieces of all that stands still; a pillar counts for 16.
pub(crate) const MAX_PIECES: usize = 2048;

/// A part of a world that does not go with the others.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{key}: expected {expected}")]
pub struct WorldFault {
    /// Path of its key in the world's file, such as `robot.way[0].to_m`.
    pub key: String,
    /// What was expected.
    pub expected: String,
}

impl WorldFault {
    fn new(key: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { key: key.into(), expected: expected.into() }
    }
}

impl World {
    /// Checks what no part of the world can say alone.
    ///
    /// # Errors
    /// The first key that does not go with the others.
    pub fn check(&self) -> Result<(), WorldFault> {
        if self.walkers.len() > MAX_WALKERS {
            return Err(WorldFault::new("walker", format!("at most {MAX_WALKERS} walkers, found {}", self.walkers.len())));
        }
        let faces = still::faces(self);
        let pieces = faces.len() + self.pillars.len() * still::PIECES_OF_A_CIRCLE as usize;
        if pieces > MAX_PIECES {
            return Err(WorldFault::new("wall", format!("a world of at most {MAX_PIECES} pieces of surface, found {pieces}")));
        }
        let mut from = self.robot.start_m.vector();
        for (index, goal) in self.robot.path.iter().enumerate() {
            let leg = Segment { from, to: goal.to_m.vector() };
            let through_pillar = |pillar: &Pillar| leg.distance_m(&pillar.centre_m.vector()) <= pillar.radius_m.get();
            if faces.iter().any(|face| leg.crosses(&face.segment)) || self.pillars.iter().any(through_pillar) {
                return Err(WorldFault::new(
                    format!("robot.way[{index}].to_m"),
                    "a place that the robot reaches without driving through things",
                ));
            }
            from = leg.to;
        }
        Ok(())
    }
}
