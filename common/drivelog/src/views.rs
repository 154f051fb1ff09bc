//! What is derived for people who look through Foxglove, at a log or live: the robot's pose, and the map in one picture.

use std::collections::BTreeMap;

use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{Grid, PackedElementField, PoseInFrame, Vector2};
use prost::Message;

use messages::{Layer, MapTile, Pose, SonarScan, TILE_CELLS, TILE_EDGE};

use crate::logged::{Format, foxglove_format};
use crate::tile::{pose, timestamp};

/// Bytes of a cell of the picture: red, green, blue, alpha.
const PIXEL: usize = 4;
/// The largest map of which a picture is recorded, cells: 100 m × 100 m in cells of 5 cm. Of a larger one the log holds the tiles.
const MAX_CELLS: usize = 4 << 20;
/// Shade of a cell of which nothing is known; known ones are at most 254.
const UNKNOWN: u8 = u8::MAX;

/// The robot's pose in the map frame, by itself.
#[derive(Debug, Clone, Copy)]
pub struct PoseView;

impl PoseView {
    /// Its topic.
    pub const TOPIC: &str = "robot/pose";

    /// What its channel says: it is a `foxglove.PoseInFrame`.
    #[must_use]
    pub fn format() -> Format {
        foxglove_format::<PoseInFrame>()
    }

    /// The pose of a scan, by the newest estimate of the odom frame in the map frame.
    #[must_use]
    pub fn encode(scan: &SonarScan, map_from_odom: &Pose, stamp_ns: u64) -> Vec<u8> {
        let Pose { x_m, y_m, yaw_rad } = map_from_odom.then(&scan.pose);
        let at = pose(x_m, y_m, yaw_rad);
        let view = PoseInFrame { timestamp: Some(timestamp(stamp_ns)), frame_id: "map".to_owned(), pose: Some(at) };
        Message::encode_to_vec(&view)
    }
}

/// A layer of the map, put together from its tiles.
///
/// A picture is due when as many bytes of tiles have come as it takes: the pictures of a log are never more than its tiles,
/// however large the map grows.
#[derive(Debug, Clone, Default)]
pub struct MapView {
    /// Shades by row and column of the tile, from 0 (occupied) to 254 (free).
    tiles: BTreeMap<(i32, i32), Box<[u8; TILE_CELLS]>>,
    cell_m: f64,
    fresh: usize,
    too_large: bool,
}

/// Rows and columns of tiles, inclusive.
struct Extent {
    rows: (i32, i32),
    columns: (i32, i32),
}

impl MapView {
    /// What its channel says: it is a `foxglove.Grid`, red, green, blue and alpha of each cell.
    #[must_use]
    pub fn format() -> Format {
        foxglove_format::<Grid>()
    }

    /// The topic of a layer's picture.
    #[must_use]
    pub fn topic(layer: u32) -> &'static str {
        if layer == Layer::Unfiltered as u32 { "map/picture/unfiltered" } else { "map/picture" }
    }

    /// Takes a tile in.
    pub fn take(&mut self, tile: &MapTile) {
        if self.too_large {
            return;
        }
        if self.cell_m.to_bits() != tile.cell_m.to_bits() {
            self.tiles.clear();
            self.cell_m = tile.cell_m;
        }
        self.tiles.insert((tile.row, tile.column), Box::new(tile.log_odds.map(shade)));
        self.fresh += TILE_CELLS * size_of::<f32>();
        if self.extent().is_some_and(|extent| extent.cells() > MAX_CELLS) {
            *self = Self { too_large: true, ..Self::default() };
        }
    }

    /// Whether as many bytes of tiles have come as the picture takes.
    #[must_use]
    pub fn is_due(&self) -> bool {
        self.extent().is_some_and(|extent| self.fresh >= extent.cells() * PIXEL)
    }

    /// Whether a tile has come since the last picture.
    #[must_use]
    pub fn is_stale(&self) -> bool {
        self.fresh > 0
    }

    /// The picture; none of an empty map.
    pub fn draw(&mut self, stamp_ns: u64) -> Option<Vec<u8>> {
        let extent = self.extent()?;
        self.fresh = 0;
        let (width, height) = (extent.width(), extent.height());
        let mut data = vec![0; width * height * PIXEL];
        for ((row, column), shades) in &self.tiles {
            let left = column.abs_diff(extent.columns.0) as usize * TILE_EDGE;
            let bottom = row.abs_diff(extent.rows.0) as usize * TILE_EDGE;
            for (line, shades) in shades.chunks(TILE_EDGE).enumerate() {
                let start = ((bottom + line) * width + left) * PIXEL;
                for (pixel, shade) in data[start..].chunks_mut(PIXEL).zip(shades) {
                    let alpha = if *shade == UNKNOWN { 0 } else { u8::MAX };
                    pixel.copy_from_slice(&[*shade, *shade, *shade, alpha]);
                }
            }
        }
        let edge_m = TILE_EDGE as f64 * self.cell_m;
        let field = |name: &str, offset| PackedElementField { name: name.to_owned(), offset, r#type: NumericType::Uint8 as i32 };
        let grid = Grid {
            timestamp: Some(timestamp(stamp_ns)),
            frame_id: "map".to_owned(),
            pose: Some(pose(f64::from(extent.columns.0) * edge_m, f64::from(extent.rows.0) * edge_m, 0.0)),
            column_count: width as u32,
            cell_size: Some(Vector2 { x: self.cell_m, y: self.cell_m }),
            row_stride: (width * PIXEL) as u32,
            cell_stride: PIXEL as u32,
            fields: vec![field("red", 0), field("green", 1), field("blue", 2), field("alpha", 3)],
            data: data.into(),
        };
        Some(Message::encode_to_vec(&grid))
    }

    fn extent(&self) -> Option<Extent> {
        let rows = (self.tiles.first_key_value()?.0.0, self.tiles.last_key_value()?.0.0);
        let columns = self.tiles.keys().map(|(_, column)| *column);
        Some(Extent { rows, columns: (columns.clone().min()?, columns.max()?) })
    }
}

impl Extent {
    fn width(&self) -> usize {
        (self.columns.1.abs_diff(self.columns.0) as usize + 1) * TILE_EDGE
    }

    fn height(&self) -> usize {
        (self.rows.1.abs_diff(self.rows.0) as usize + 1) * TILE_EDGE
    }

    fn cells(&self) -> usize {
        self.width().saturating_mul(self.height())
    }
}

/// Dark where occupied, light where free.
fn shade(log_odds: f32) -> u8 {
    if log_odds == 0.0 {
        return UNKNOWN;
    }
    let free = 1.0 / (1.0 + log_odds.exp());
    (free * 254.0).round() as u8
}
