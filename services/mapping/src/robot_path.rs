//! The robot's path, for pictures.

use messages::{MAX_WAY_POINTS, Pose, Trajectory, WayChunk};

/// Shortest move that is kept at first, m.
const FIRST_STEP_M: f64 = 0.01;
/// Most places kept: when there are more, every second goes and the step doubles, so that a long drive takes no more memory.
pub(crate) const MAX_PLACES: usize = 16_384;

/// A longer way is not told apart: messages tell of none.
pub(crate) const MAX_LENGTH_M: f64 = 1e9;

/// Where the robot has been, decimated.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RobotPath {
    pub(crate) step_m: f64,
    pub(crate) length_m: f64,
    pub(crate) places_m: Vec<[f32; 2]>,
    /// Places that have been handed out in chunks.
    sent: usize,
}

impl Default for RobotPath {
    fn default() -> Self {
        Self::restored(FIRST_STEP_M, 0.0, Vec::new())
    }
}

impl RobotPath {
    /// A way kept elsewhere; nothing of it has been handed out.
    pub(crate) fn restored(step_m: f64, length_m: f64, places_m: Vec<[f32; 2]>) -> Self {
        Self { step_m, length_m, places_m, sent: 0 }
    }

    /// From the last place to `pose`, m; the robot may have moved by less than a step since.
    pub(crate) fn distance_m(&self, pose: &Pose) -> Option<f64> {
        let [x, y] = *self.places_m.last()?;
        Some((pose.x_m - f64::from(x)).hypot(pose.y_m - f64::from(y)))
    }

    /// The robot is at `pose` in the map frame.
    pub(crate) fn visit(&mut self, pose: &Pose) {
        if let Some(moved) = self.distance_m(pose) {
            if moved < self.step_m {
                return;
            }
            self.length_m = (self.length_m + moved).min(MAX_LENGTH_M);
        }
        self.places_m.push([pose.x_m as f32, pose.y_m as f32]);
        if self.places_m.len() > MAX_PLACES {
            self.places_m = self.places_m.iter().step_by(2).copied().collect();
            self.step_m *= 2.0;
            self.sent = 0;
        }
    }

    /// The next piece that has not been handed out.
    pub(crate) fn next_chunk(&mut self, trajectory: Trajectory) -> Option<WayChunk> {
        let rest = &self.places_m[self.sent..];
        let count = rest.len().min(MAX_WAY_POINTS);
        if count == 0 {
            return None;
        }
        let (first, total, trajectory) = (self.sent as u64, self.places_m.len() as u64, trajectory as u32);
        let mut chunk = WayChunk { first, total, count: count as u32, trajectory, ..WayChunk::default() };
        chunk.points_m[..count].copy_from_slice(&rest[..count]);
        self.sent += count;
        Some(chunk)
    }

    /// Everything is to be handed out again.
    pub(crate) fn send_again(&mut self) {
        self.sent = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn along_x(x_m: f64) -> Pose {
        Pose { x_m, ..Pose::default() }
    }

    #[test]
    fn small_moves_are_left_out() {
        let mut path = RobotPath::default();
        [0.0, 0.004, 0.009, 0.012, 0.021, 0.023].iter().for_each(|&x| path.visit(&along_x(x)));
        assert_eq!(path.places_m, [[0.0, 0.0], [0.012, 0.0], [0.023, 0.0]]);
        assert!((path.length_m - 0.023).abs() < 1e-6);
    }

    #[test]
    fn chunks_hold_every_place_once() {
        let mut path = RobotPath::default();
        (0..600).for_each(|i| path.visit(&along_x(f64::from(i))));
        let mut told = Vec::new();
        while let Some(chunk) = path.next_chunk(Trajectory::Robot) {
            assert_eq!((chunk.first, chunk.total), (told.len() as u64, 600));
            told.extend_from_slice(&chunk.points_m[..chunk.count as usize]);
        }
        assert_eq!(told, path.places_m);
        path.visit(&along_x(600.0));
        assert_eq!(path.next_chunk(Trajectory::Robot).unwrap().first, 600);
        path.send_again();
        assert_eq!(path.next_chunk(Trajectory::Robot).unwrap().first, 0);
    }

    #[test]
    fn no_way_is_longer_than_can_be_told() {
        let mut path = RobotPath::default();
        (0..2_000).for_each(|i| path.visit(&along_x(if i % 2 == 0 { 1e6 } else { -1e6 })));
        assert_eq!(path.length_m, MAX_LENGTH_M);
    }

    #[test]
    fn a_long_way_takes_no_more_memory() {
        let mut path = RobotPath::default();
        (0..100_000).for_each(|i| path.visit(&along_x(f64::from(i) * 0.02)));
        assert!(path.places_m.len() <= MAX_PLACES);
        assert_eq!(path.places_m[0], [0.0, 0.0]);
        assert!((path.length_m - 2000.0).abs() < 1.0);
    }
}
