//! The newest of everything, and what each browser has had of it.

use std::collections::BTreeMap;

use messages::{MapTile, TILE_CELLS, WayChunk};
use serde::Serialize;
use tungstenite::Message;

/// Most tiles sent at once: what a slow line takes in a fraction of a second.
const TILES_AT_ONCE: usize = 192;
/// Most places of the way sent at once.
const PLACES_AT_ONCE: usize = 16_384;
/// Most tiles kept of a map: 655 m × 655 m of 5 cm. What lies beyond is not shown.
const MOST_TILES: usize = 320_000;
/// Most places of the way kept.
const MOST_PLACES: u64 = 4_000_000;

/// First byte of a message with tiles.
const TILES: u8 = 1;
/// First byte of a message with a piece of the robot's way.
const WAY: u8 = 2;

/// What is shown as a whole: the newest message supersedes the one before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Topic {
    /// What the deployment is; does not change.
    Deployment,
    /// How the processes are.
    Status,
    /// The robot, its sonars and what moves.
    Scene,
    /// The camera's picture.
    Picture,
    /// What moves in it.
    Mask,
}

const TOPICS: usize = 5;

/// The newest of everything.
///
/// Each change has a number; a browser that has had everything up to a number lacks exactly what changed since. A tile that
/// changes twice before a browser is ready is sent to it once.
#[derive(Debug, Clone, Default)]
pub struct Board {
    change: u64,
    tiles: BTreeMap<Place, Tile>,
    /// The tiles in the order of their last change.
    order: BTreeMap<u64, Place>,
    way_m: Vec<[f32; 2]>,
    topics: [Option<(u64, Message)>; TOPICS],
}

/// Layer, row and column of a tile.
type Place = (u32, i32, i32);

#[derive(Debug, Clone)]
struct Tile {
    change: u64,
    shades: Box<[u8; TILE_CELLS]>,
}

/// What a browser has had.
#[derive(Debug, Clone, Default)]
pub struct Cursor {
    tiles: u64,
    places: usize,
    topics: [u64; TOPICS],
}

impl Board {
    /// Takes a tile of the map. One that looks as before is no news.
    pub fn tile(&mut self, tile: &MapTile) {
        let place = (tile.layer, tile.row, tile.column);
        let shades = Box::new(tile.log_odds.map(|log_odds| shade(log_odds) as u8));
        match self.tiles.get(&place) {
            Some(known) if known.shades == shades => return,
            Some(known) => {
                self.order.remove(&known.change);
            }
            None if self.tiles.len() >= MOST_TILES => return,
            None => {}
        }
        self.change += 1;
        self.order.insert(self.change, place);
        self.tiles.insert(place, Tile { change: self.change, shades });
    }

    /// Takes a piece of the robot's way.
    pub fn way(&mut self, chunk: &WayChunk) {
        if chunk.total > MOST_PLACES || chunk.first > chunk.total {
            return;
        }
        self.way_m.truncate(chunk.total as usize);
        let points = chunk.points_m.iter().take(chunk.count as usize);
        for (place, point) in (chunk.first as usize..).zip(points) {
            // Where a piece is missing, the way goes straight on.
            self.way_m.resize(self.way_m.len().max(place + 1), *point);
            if let Some(known) = self.way_m.get_mut(place) {
                *known = *point;
            }
        }
    }

    /// Puts a message in place of the one before.
    pub fn put(&mut self, topic: Topic, message: Message) {
        self.change += 1;
        self.topics[topic as usize] = Some((self.change, message));
    }

    /// Puts this as JSON in place of the message before.
    pub fn put_json(&mut self, topic: Topic, value: &impl Serialize) {
        match serde_json::to_string(value) {
            Ok(text) => self.put(topic, Message::text(text)),
            Err(error) => {
                tracing::error!("a message for the page cannot be written: {error}");
                self.put(topic, Message::text("{}"));
            }
        }
    }

    /// Tiles on the board.
    #[must_use]
    pub fn tiles(&self) -> usize {
        self.tiles.len()
    }

    /// Whether a browser lacks something.
    #[must_use]
    pub fn has_news(&self, cursor: &Cursor) -> bool {
        let newer = |(topic, had): (&Option<(u64, Message)>, &u64)| topic.as_ref().is_some_and(|(change, _)| change > had);
        self.order.last_key_value().is_some_and(|(change, _)| *change > cursor.tiles)
            || self.way_m.len() != cursor.places
            || self.topics.iter().zip(&cursor.topics).any(newer)
    }

    /// What a browser lacks, up to a share of tiles and places; the oldest changes first.
    pub fn news(&self, cursor: &mut Cursor) -> Vec<Message> {
        let mut news = Vec::new();
        for (topic, had) in self.topics.iter().zip(&mut cursor.topics) {
            if let Some((change, message)) = topic
                && *change > *had
            {
                *had = *change;
                news.push(message.clone());
            }
        }
        news.extend(self.way_news(cursor));
        news.extend(self.tile_news(cursor));
        news
    }

    /// `[2, 0, 0, 0]`, the number of the first place as u32, then x and y of each place as f32: what follows the places before.
    fn way_news(&self, cursor: &mut Cursor) -> Option<Message> {
        let first = cursor.places.min(self.way_m.len());
        let last = self.way_m.len().min(first + PLACES_AT_ONCE);
        if first == last && cursor.places == last {
            return None;
        }
        cursor.places = last;
        let mut bytes = vec![WAY, 0, 0, 0];
        bytes.extend((first as u32).to_le_bytes());
        bytes.extend(self.way_m[first..last].iter().flatten().flat_map(|value| value.to_le_bytes()));
        Some(Message::Binary(bytes.into()))
    }

    /// `[1, 0, 0, 0]`, then each tile: layer as u32, column and row as i32, a signed byte for each cell.
    fn tile_news(&self, cursor: &mut Cursor) -> Option<Message> {
        let mut bytes = vec![TILES, 0, 0, 0];
        for (change, place) in self.order.range(cursor.tiles + 1..).take(TILES_AT_ONCE) {
            let (layer, row, column) = place;
            bytes.extend(layer.to_le_bytes());
            bytes.extend(column.to_le_bytes());
            bytes.extend(row.to_le_bytes());
            bytes.extend(self.tiles.get(place).iter().flat_map(|tile| tile.shades.iter()));
            cursor.tiles = *change;
        }
        (bytes.len() > 4).then(|| Message::Binary(bytes.into()))
    }
}

/// A cell as a signed byte: 64 to a unit of log-odds; 0 is unknown and nothing else is.
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

    /// Rows and first shades of the tiles in a batch.
    fn tiles_in(news: &[Message]) -> Vec<(i32, i8)> {
        let mut tiles = Vec::new();
        for message in news {
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
    fn a_cell_is_a_byte_and_only_the_unknown_is_zero() {
        let cases = [(0.0, 0), (2.0, 127), (-2.0, -127), (50.0, 127), (1.0, 64), (-0.5, -32), (1e-6, 1), (-1e-6, -1)];
        for (log_odds, expected) in cases {
            assert_eq!(shade(log_odds), expected, "{log_odds}");
        }
    }

    #[test]
    fn each_browser_gets_what_it_lacks_and_what_is_superseded_once() {
        let mut board = Board::default();
        let (mut quick, mut slow) = (Cursor::default(), Cursor::default());
        board.tile(&tile(0, 1.0));
        board.tile(&tile(1, 1.0));
        assert_eq!(tiles_in(&board.news(&mut quick)), [(0, 64), (1, 64)]);
        assert!(!board.has_news(&quick) && board.news(&mut quick).is_empty());
        board.tile(&tile(0, -1.0));
        board.tile(&tile(1, 1.0));
        assert_eq!(tiles_in(&board.news(&mut quick)), [(0, -64)], "the other looks as before");
        assert_eq!(tiles_in(&board.news(&mut slow)), [(1, 64), (0, -64)], "the newest only");
    }

    #[test]
    fn the_newest_message_of_a_topic_supersedes_the_one_before() {
        let mut board = Board::default();
        let mut cursor = Cursor::default();
        board.put(Topic::Scene, Message::text("a"));
        board.put(Topic::Scene, Message::text("b"));
        board.put(Topic::Status, Message::text("s"));
        assert_eq!(board.news(&mut cursor), [Message::text("s"), Message::text("b")]);
        assert!(!board.has_news(&cursor));
    }

    #[test]
    fn the_way_is_sent_piece_by_piece_and_again_when_it_begins_anew() {
        let mut board = Board::default();
        let mut cursor = Cursor::default();
        let mut chunk = WayChunk { first: 0, total: 3, count: 2, ..WayChunk::default() };
        chunk.points_m[1] = [1.0, 0.0];
        board.way(&chunk);
        let lengths = |news: Vec<Message>| news.iter().map(Message::len).collect::<Vec<_>>();
        assert_eq!(lengths(board.news(&mut cursor)), [8 + 16]);
        chunk = WayChunk { first: 2, total: 3, count: 1, ..WayChunk::default() };
        board.way(&chunk);
        board.way(&chunk);
        assert_eq!(lengths(board.news(&mut cursor)), [8 + 8]);
        board.way(&WayChunk { first: 0, total: 1, count: 1, ..WayChunk::default() });
        assert_eq!(board.news(&mut cursor), [Message::binary(vec![WAY, 0, 0, 0, 1, 0, 0, 0])], "the browser forgets the rest");
        assert!(!board.has_news(&cursor));
        board.way(&WayChunk { first: 9, total: u64::MAX, count: 1, ..WayChunk::default() });
        assert_eq!(board.way_m.len(), 1, "no robot has come so far");
    }

    proptest! {
        /// However slowly a browser takes them: in the end it has every tile as it is.
        #[test]
        fn nobody_lacks_a_tile_in_the_end(steps in prop::collection::vec((0i32..40, -20i32..20, any::<bool>()), 1..400)) {
            let mut board = Board::default();
            let mut cursor = Cursor::default();
            let mut has = BTreeMap::new();
            let mut newest = BTreeMap::new();
            for (row, value, takes) in steps {
                board.tile(&tile(row, value as f32 * 0.1));
                newest.insert(row, shade(value as f32 * 0.1));
                if takes {
                    has.extend(tiles_in(&board.news(&mut cursor)));
                }
            }
            while board.has_news(&cursor) {
                has.extend(tiles_in(&board.news(&mut cursor)));
            }
            prop_assert_eq!(has, newest);
            prop_assert_eq!(board.order.len(), board.tiles.len());
        }
    }
}
