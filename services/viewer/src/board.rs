//! The newest state of everything, and which part of it each browser has received.

use core::any::Any;
use std::collections::BTreeMap;

use messages::{CameraFrame, CameraMask, DeploymentStatus, FrameLayout, MapTile, Pictures, PixelFormat, TILE_CELLS, WayChunk};
use serde::Serialize;
use tungstenite::Message;

use crate::camera;
use crate::status::Status;

/// Most tiles in one update: 0.2 MB, which a slow connection takes in a fraction of a second.
const TILES_AT_ONCE: usize = 192;
/// Most points of the path in one update.
const POINTS_AT_ONCE: usize = 16_384;
/// Most tiles of a map: 640 m × 640 m in two layers with cells of 5 cm. Further tiles are not shown.
const MOST_TILES: usize = 320_000;
/// Most points of a path.
const MOST_POINTS: u64 = 4_000_000;

/// First byte of a message with tiles.
const TILES: u8 = 1;
/// First byte of a message with a piece of the trajectory in the map, and by odometry.
const PATH: [u8; PATHS] = [2, 5];

/// A part of the page of which only the newest message matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Topic {
    /// The deployment.
    Deployment,
    /// The state of the processes.
    Status,
    /// The robot, its sonars and the walkers.
    Scene,
    /// The picture of the camera.
    Picture,
    /// The mask of what moves in it.
    Mask,
}

const TOPICS: usize = 5;

/// The newest state of everything on the page.
///
/// Changes are numbered: a browser that has received everything up to a number lacks exactly the later changes. A tile that changes
/// twice before a browser takes it is sent to it once.
#[derive(Debug, Clone, Default)]
pub struct Board {
    change: u64,
    tiles: BTreeMap<TileKey, Tile>,
    /// The tiles in the order of their last change.
    order: BTreeMap<u64, TileKey>,
    /// The trajectory in the map, and by odometry.
    paths: [Path; PATHS],
    topics: [Option<(u64, Message)>; TOPICS],
}

/// Trajectories on the page.
const PATHS: usize = 2;

#[derive(Debug, Clone, Default)]
struct Path {
    points_m: Vec<[f32; 2]>,
    /// Counts how often points were replaced by others.
    revision: u64,
}

/// Layer, row and column of a tile.
type TileKey = (u32, i32, i32);

#[derive(Debug, Clone)]
struct Tile {
    change: u64,
    shades: Box<[u8; TILE_CELLS]>,
}

/// What a browser has received.
#[derive(Debug, Clone, Default)]
pub struct Cursor {
    tiles: u64,
    paths: [PathCursor; PATHS],
    topics: [u64; TOPICS],
}

/// The points of a trajectory that a browser has received.
#[derive(Debug, Clone, Copy, Default)]
struct PathCursor {
    points: usize,
    revision: u64,
}

impl Path {
    #[expect(clippy::float_cmp, reason = "a point that is the same to the bit is not sent again")]
    fn take(&mut self, chunk: &WayChunk) {
        self.points_m.truncate(chunk.total as usize);
        let points = chunk.points_m.iter().take(chunk.count as usize);
        for (index, point) in (chunk.first as usize..).zip(points) {
            match self.points_m.get_mut(index) {
                Some(known) if known == point => {}
                Some(known) => {
                    *known = *point;
                    self.revision += 1;
                }
                // A missing piece is drawn as a straight line.
                None => self.points_m.resize(index + 1, *point),
            }
        }
    }

    fn is_newer_than(&self, cursor: &PathCursor) -> bool {
        self.points_m.len() != cursor.points || self.revision != cursor.revision
    }

    /// `[2, 0, 0, 0]` for the trajectory in the map or `[5, 0, 0, 0]` for that by odometry, the index of the first point as u32, then x
    /// and y of each point as f32. Points after the last one are dropped.
    fn update(&self, kind: u8, cursor: &mut PathCursor) -> Option<Message> {
        if !self.is_newer_than(cursor) {
            return None;
        }
        let known = if self.revision == cursor.revision { cursor.points } else { 0 };
        let first = known.min(self.points_m.len());
        let last = self.points_m.len().min(first + POINTS_AT_ONCE);
        *cursor = PathCursor { points: last, revision: self.revision };
        let mut bytes = vec![kind, 0, 0, 0];
        bytes.extend((first as u32).to_le_bytes());
        bytes.extend(self.points_m[first..last].iter().flatten().flat_map(|value| value.to_le_bytes()));
        Some(Message::Binary(bytes.into()))
    }
}

impl Board {
    /// Takes a message of any service: a tile, a piece of the path, or the state of the processes. Other payloads change nothing.
    pub fn message(&mut self, payload: &dyn Any) {
        if let Some(tile) = payload.downcast_ref() {
            self.tile(tile);
        } else if let Some(chunk) = payload.downcast_ref() {
            self.path(chunk);
        } else if let Some(status) = payload.downcast_ref::<DeploymentStatus>() {
            self.put_json(Topic::Status, &Status::from(status));
        }
    }

    /// Takes a picture of the camera, or the mask of one. Pictures of other services change nothing.
    pub fn picture<P: Pictures>(&mut self, layout: FrameLayout, format: PixelFormat, bytes: &[u8]) {
        if P::SERVICE == CameraFrame::SERVICE {
            self.put(Topic::Picture, camera::picture(layout, format, bytes));
        } else if P::SERVICE == CameraMask::SERVICE {
            self.put(Topic::Mask, camera::mask(layout, bytes));
        }
    }

    /// Takes a tile of the map. A tile that looks as before is no change.
    fn tile(&mut self, tile: &MapTile) {
        let key = (tile.layer, tile.row, tile.column);
        let shades = Box::new(tile.log_odds.map(|log_odds| shade(log_odds) as u8));
        match self.tiles.get(&key) {
            Some(known) if known.shades == shades => return,
            Some(known) => {
                self.order.remove(&known.change);
            }
            None if self.tiles.len() >= MOST_TILES => return,
            None => {}
        }
        self.change += 1;
        self.order.insert(self.change, key);
        self.tiles.insert(key, Tile { change: self.change, shades });
    }

    /// Takes a piece of a trajectory.
    fn path(&mut self, chunk: &WayChunk) {
        if chunk.total > MOST_POINTS || chunk.first > chunk.total {
            return;
        }
        if let Some(path) = self.paths.get_mut(chunk.trajectory as usize) {
            path.take(chunk);
        }
    }

    /// Replaces the message of a topic.
    pub fn put(&mut self, topic: Topic, message: Message) {
        self.change += 1;
        self.topics[topic as usize] = Some((self.change, message));
    }

    /// Replaces the message of a topic by this value as JSON.
    pub fn put_json(&mut self, topic: Topic, value: &impl Serialize) {
        match serde_json::to_string(value) {
            Ok(text) => self.put(topic, Message::text(text)),
            Err(error) => {
                tracing::error!("a message for the page cannot be serialised: {error}");
                self.put(topic, Message::text("{}"));
            }
        }
    }

    /// Number of tiles.
    #[must_use]
    pub fn tiles(&self) -> usize {
        self.tiles.len()
    }

    /// Whether something changed that a browser has not received.
    #[must_use]
    pub fn has_updates(&self, cursor: &Cursor) -> bool {
        let newer = |(topic, received): (&Option<(u64, Message)>, &u64)| topic.as_ref().is_some_and(|(change, _)| change > received);
        self.order.last_key_value().is_some_and(|(change, _)| *change > cursor.tiles)
            || self.paths.iter().zip(&cursor.paths).any(|(path, cursor)| path.is_newer_than(cursor))
            || self.topics.iter().zip(&cursor.topics).any(newer)
    }

    /// The changes that a browser has not received, the oldest first, up to a limit of tiles and points.
    pub fn updates(&self, cursor: &mut Cursor) -> Vec<Message> {
        let mut updates = Vec::new();
        for (topic, received) in self.topics.iter().zip(&mut cursor.topics) {
            if let Some((change, message)) = topic
                && *change > *received
            {
                *received = *change;
                updates.push(message.clone());
            }
        }
        let paths = self.paths.iter().zip(&mut cursor.paths);
        updates.extend(PATH.into_iter().zip(paths).filter_map(|(kind, (path, cursor))| path.update(kind, cursor)));
        updates.extend(self.tile_update(cursor));
        updates
    }

    /// `[1, 0, 0, 0]`, then each tile: layer as u32, column and row as i32, a signed byte for each cell.
    fn tile_update(&self, cursor: &mut Cursor) -> Option<Message> {
        let mut bytes = vec![TILES, 0, 0, 0];
        for (change, key) in self.order.range(cursor.tiles + 1..).take(TILES_AT_ONCE) {
            let (layer, row, column) = key;
            bytes.extend(layer.to_le_bytes());
            bytes.extend(column.to_le_bytes());
            bytes.extend(row.to_le_bytes());
            bytes.extend(self.tiles.get(key).iter().flat_map(|tile| tile.shades.iter()));
            cursor.tiles = *change;
        }
        (bytes.len() > 4).then(|| Message::Binary(bytes.into()))
    }
}

/// A cell as a signed byte: 64 per unit of log-odds, and 0 for an unknown cell only.
fn shade(log_odds: f32) -> i8 {
    let rounded = (log_odds * 64.0).round().clamp(-127.0, 127.0) as i8;
    match rounded {
        0 if log_odds > 0.0 => 1,
        0 if log_odds < 0.0 => -1,
        _ => rounded,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn tile(row: i32, value: f32) -> MapTile {
        MapTile { cell_m: 0.05, row, column: -1, layer: 0, tiles_in_layer: 1, log_odds: [value; TILE_CELLS], ..MapTile::default() }
    }

    /// Rows and first shades of the tiles in an update.
    fn tiles_in(updates: &[Message]) -> Vec<(i32, i8)> {
        let mut tiles = Vec::new();
        for message in updates {
            let Message::Binary(bytes) = message else { continue };
            if bytes[0] == TILES {
                for each in bytes[4..].chunks(12 + TILE_CELLS) {
                    assert_eq!(i32::from_le_bytes(each[4..8].try_into().unwrap()), -1);
                    tiles.push((i32::from_le_bytes(each[8..12].try_into().unwrap()), each[12] as i8));
                }
            }
        }
        tiles
    }

    #[test]
    fn only_an_unknown_cell_is_zero() {
        let cases = [(0.0, 0), (2.0, 127), (-2.0, -127), (50.0, 127), (1.0, 64), (-0.5, -32), (1e-6, 1), (-1e-6, -1)];
        for (log_odds, expected) in cases {
            assert_eq!(shade(log_odds), expected, "{log_odds}");
        }
    }

    #[test]
    fn each_browser_receives_the_newest_of_each_tile_once() {
        let mut board = Board::default();
        let (mut quick, mut slow) = (Cursor::default(), Cursor::default());
        board.tile(&tile(0, 1.0));
        board.tile(&tile(1, 1.0));
        assert_eq!(tiles_in(&board.updates(&mut quick)), [(0, 64), (1, 64)]);
        assert!(!board.has_updates(&quick) && board.updates(&mut quick).is_empty());
        board.tile(&tile(0, -1.0));
        board.tile(&tile(1, 1.0));
        assert_eq!(tiles_in(&board.updates(&mut quick)), [(0, -64)], "the other tile did not change");
        assert_eq!(tiles_in(&board.updates(&mut slow)), [(1, 64), (0, -64)], "only the newest");
    }

    #[test]
    fn a_message_of_a_topic_supersedes_the_one_before() {
        let mut board = Board::default();
        let mut cursor = Cursor::default();
        board.put(Topic::Scene, Message::text("a"));
        board.put(Topic::Scene, Message::text("b"));
        board.put(Topic::Status, Message::text("s"));
        assert_eq!(board.updates(&mut cursor), [Message::text("s"), Message::text("b")]);
        assert!(!board.has_updates(&cursor));
    }

    #[test]
    fn the_path_is_sent_in_pieces_and_cut_when_it_restarts() {
        let mut board = Board::default();
        let mut cursor = Cursor::default();
        let mut chunk = WayChunk { first: 0, total: 3, count: 2, ..WayChunk::default() };
        chunk.points_m[1] = [1.0, 0.0];
        board.path(&chunk);
        let lengths = |updates: Vec<Message>| updates.iter().map(Message::len).collect::<Vec<_>>();
        assert_eq!(lengths(board.updates(&mut cursor)), [8 + 16]);
        chunk = WayChunk { first: 2, total: 3, count: 1, ..WayChunk::default() };
        board.path(&chunk);
        board.path(&chunk);
        assert_eq!(lengths(board.updates(&mut cursor)), [8 + 8]);
        board.path(&WayChunk { first: 0, total: 1, count: 1, ..WayChunk::default() });
        assert_eq!(board.updates(&mut cursor), [Message::binary(vec![PATH[0], 0, 0, 0, 1, 0, 0, 0])], "the browser drops the rest");
        assert!(!board.has_updates(&cursor));
        board.path(&WayChunk { first: 9, total: u64::MAX, count: 1, ..WayChunk::default() });
        assert_eq!(board.paths[0].points_m.len(), 1, "a path this long is not valid");
    }

    #[test]
    fn a_revised_path_is_sent_again() {
        let mut board = Board::default();
        let mut cursor = Cursor::default();
        let mut chunk = WayChunk { first: 0, total: 2, count: 2, ..WayChunk::default() };
        board.path(&chunk);
        board.updates(&mut cursor);
        chunk.points_m[0] = [0.5, 0.0];
        board.path(&chunk);
        assert!(board.has_updates(&cursor));
        let first_m = 0.5_f32.to_le_bytes();
        assert!(
            matches!(&board.updates(&mut cursor)[..], [Message::Binary(bytes)] if bytes[..4] == [PATH[0], 0, 0, 0] && bytes[8..12] == first_m)
        );
        board.path(&WayChunk { trajectory: messages::Trajectory::Odometry as u32, ..chunk });
        assert!(matches!(&board.updates(&mut cursor)[..], [Message::Binary(bytes)] if bytes[..4] == [PATH[1], 0, 0, 0]));
        assert!(!board.has_updates(&cursor));
    }

    proptest! {
        /// A browser of any speed ends up with the newest of every tile.
        #[test]
        fn every_browser_receives_every_tile_in_the_end(steps in prop::collection::vec((0i32..40, -20i32..20, any::<bool>()), 1..400)) {
            let mut board = Board::default();
            let mut cursor = Cursor::default();
            let mut has = BTreeMap::new();
            let mut newest = BTreeMap::new();
            for (row, value, takes) in steps {
                board.tile(&tile(row, value as f32 * 0.1));
                newest.insert(row, shade(value as f32 * 0.1));
                if takes {
                    has.extend(tiles_in(&board.updates(&mut cursor)));
                }
            }
            while board.has_updates(&cursor) {
                has.extend(tiles_in(&board.updates(&mut cursor)));
            }
            prop_assert_eq!(has, newest);
            prop_assert_eq!(board.order.len(), board.tiles.len());
        }
    }
}
