//! What localisation has estimated, as part of the state of a mapper. The map that is rendered again is not part of it: a restarted
//! process renders it from the beginning and shows it at the same scan.

use geometry::{MapFromOdom, Transform};
use messages::{MovedStretch, Payload, TrajectoryRevision};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::committed::Committed;
use crate::localised::{Localised, MAX_STRETCHES, Rendering};
use crate::saved::{SavedPath, StateError, error, require};

#[derive(Serialize, Deserialize, Schema)]
pub(crate) struct SavedLocalised<'a> {
    map_from_odom: [f64; 3],
    is_lost: bool,
    last: u64,
    pieces: u64,
    announced: u64,
    smoothed: u64,
    incoming: Vec<SavedStretch>,
    waiting: Vec<SavedStretch>,
    swap_at: Option<u64>,
    /// x, y (m) and yaw (rad) in the robot frame.
    mounts: Vec<[f64; 3]>,
    path: SavedPath<'a>,
}

/// First and last scan, and the pose of the first before and now.
#[derive(Serialize, Deserialize, Schema)]
struct SavedStretch {
    first: u64,
    last: u64,
    before: [f64; 3],
    now: [f64; 3],
}

impl Localised {
    pub(crate) fn save(&self) -> SavedLocalised<'_> {
        let stretches = |stretches: &[MovedStretch]| stretches.iter().map(SavedStretch::from).collect();
        SavedLocalised {
            map_from_odom: numbers(&self.map_from_odom),
            is_lost: self.is_lost,
            last: self.last,
            pieces: self.pieces,
            announced: self.announced,
            smoothed: self.smoothed,
            incoming: stretches(&self.incoming),
            waiting: stretches(&self.waiting),
            swap_at: self.rendering.as_ref().map(|rendering| rendering.swap_at),
            mounts: self.committed.saved_mounts(),
            path: SavedPath::from(&self.path),
        }
    }
}

impl SavedLocalised<'_> {
    /// `last_scan` is the number of the last scan taken. Estimates after it answered what was left at the end of the scans; a run that
    /// resumes has scans with these numbers.
    pub(crate) fn restore(self, deadline_ns: Option<u64>, last_scan: u64) -> Result<Localised, StateError> {
        let stretches = |saved: Vec<SavedStretch>| saved.into_iter().map(MovedStretch::try_from).collect::<Result<Vec<_>, _>>();
        let [x_m, y_m, yaw_rad] = self.map_from_odom;
        require(self.map_from_odom.iter().all(|number| number.is_finite()), format!("{x_m} {y_m} {yaw_rad}"), "a pose")?;
        require(self.incoming.len().max(self.waiting.len()) <= 2 * MAX_STRETCHES, self.waiting.len(), "at most 262144 stretches")?;
        Ok(Localised {
            map_from_odom: MapFromOdom::new(x_m, y_m, yaw_rad),
            is_lost: self.is_lost,
            last: self.last.min(last_scan),
            pieces: self.pieces,
            announced: self.announced,
            smoothed: self.smoothed,
            incoming: stretches(self.incoming)?,
            waiting: stretches(self.waiting)?,
            rendering: self.swap_at.map(Rendering::until),
            committed: Committed::with_mounts(self.mounts),
            path: self.path.restore()?,
            ..Localised::new(deadline_ns)
        })
    }
}

impl From<&MovedStretch> for SavedStretch {
    fn from(moved: &MovedStretch) -> Self {
        let pose = |pose: &messages::Pose| [pose.x_m, pose.y_m, pose.yaw_rad];
        Self { first: moved.first, last: moved.last, before: pose(&moved.before), now: pose(&moved.now) }
    }
}

impl TryFrom<SavedStretch> for MovedStretch {
    type Error = StateError;

    fn try_from(saved: SavedStretch) -> Result<Self, StateError> {
        let pose = |[x_m, y_m, yaw_rad]: [f64; 3]| messages::Pose::new(x_m, y_m, yaw_rad);
        let moved = Self { first: saved.first, last: saved.last, before: pose(saved.before), now: pose(saved.now) };
        let mut piece = TrajectoryRevision { count: 1, ..TrajectoryRevision::default() };
        piece.moved[0] = moved;
        piece.validate().map_err(|invalid| error(invalid.to_string(), "a valid stretch"))?;
        Ok(moved)
    }
}

fn numbers<A, B>(pose: &Transform<A, B>) -> [f64; 3] {
    [pose.x_m, pose.y_m, pose.yaw_rad]
}
