//! A copy of the map, held by its owner at the end or put together from what was received.

use std::collections::BTreeMap;

use messages::{Layer, MapTile, Trajectory, WayChunk};

use crate::mapper::Mapper;

use super::comparison::side_by_side;
use super::picture::picture;
use super::rectangle::Rectangle;
use super::ros::{pgm, yaml};
use super::{ExportError, MapFile};

/// Tiles and the robot's way, taken in any order.
#[derive(Debug, Clone, Default)]
pub struct MapCopy {
    filtered: LayerCopy,
    unfiltered: LayerCopy,
    way_m: Vec<[f32; 2]>,
    way_total: u64,
    walkers_m: Vec<Vec<[f32; 2]>>,
}

#[derive(Debug, Clone, Default)]
struct LayerCopy {
    /// By row and column.
    tiles: BTreeMap<(i32, i32), MapTile>,
    expected: u32,
}

impl MapCopy {
    /// What a mapper shows.
    #[must_use]
    pub fn of(mapper: &Mapper) -> Self {
        let mut copy = Self::default();
        for layer in [Layer::Filtered, Layer::Unfiltered] {
            mapper.shown_tiles(layer).for_each(|tile| copy.take_tile(&tile));
        }
        copy.set_way(mapper.way_m());
        copy
    }

    /// Takes a tile, in place of the one that was there.
    pub fn take_tile(&mut self, tile: &MapTile) {
        let layer = match Layer::from_number(tile.layer) {
            Some(Layer::Filtered) => &mut self.filtered,
            Some(Layer::Unfiltered) => &mut self.unfiltered,
            None => return,
        };
        layer.expected = tile.tiles_in_layer;
        layer.tiles.insert((tile.row, tile.column), *tile);
    }

    /// Takes a piece of the robot's way in the map; one that leaves a gap is not used.
    pub fn take_way(&mut self, chunk: &WayChunk) {
        if chunk.trajectory != Trajectory::Robot as u32 {
            return;
        }
        self.way_total = chunk.total;
        let points = chunk.points_m.get(..chunk.count as usize).unwrap_or_default();
        if let Ok(first) = usize::try_from(chunk.first)
            && first <= self.way_m.len()
        {
            self.way_m.truncate(first);
            self.way_m.extend_from_slice(points);
        }
    }

    /// Takes the whole way at once.
    pub fn set_way(&mut self, way_m: &[[f32; 2]]) {
        self.way_m = way_m.to_vec();
        self.way_total = way_m.len() as u64;
    }

    /// Takes the ways of the walkers, in the map frame, m: they are drawn into the comparison.
    pub fn set_walkers(&mut self, walkers_m: Vec<Vec<[f32; 2]>>) {
        self.walkers_m = walkers_m;
    }

    /// Whether nothing is missing that the owner had when it sent what was taken last.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        let is_complete = |layer: &LayerCopy| layer.tiles.len() as u64 >= u64::from(layer.expected);
        self.filtered.expected > 0
            && is_complete(&self.filtered)
            && is_complete(&self.unfiltered)
            && self.way_m.len() as u64 >= self.way_total
    }

    /// Tiles of the filtered layer held, and expected.
    #[must_use]
    pub fn progress(&self) -> (usize, usize) {
        (self.filtered.tiles.len(), self.filtered.expected as usize)
    }

    /// `map.pgm` and `map.yaml` as map_server and nav2 read them, `map.png` for people, and, when that layer is
    /// there, `unfiltered.png` and `comparison.png` with both side by side.
    ///
    /// # Errors
    /// When the map is too large for one picture, or encoding fails.
    pub fn files(&self) -> Result<Vec<MapFile>, ExportError> {
        let map = Rectangle::around(self.filtered.tiles.values())?;
        let mut files = vec![
            MapFile { name: "map.pgm", contents: pgm(&map) },
            MapFile { name: "map.yaml", contents: yaml(&map, "map.pgm").into_bytes() },
            self.picture("map.png", &map)?,
        ];
        if !self.unfiltered.tiles.is_empty() {
            files.push(self.picture("unfiltered.png", &Rectangle::around(self.unfiltered.tiles.values())?)?);
            files.push(self.comparison()?);
        }
        Ok(files)
    }

    /// `comparison.png`: the map of every reading beside the map without what moves, with the ways of the walkers drawn thin
    /// (Fig. 10 of the paper).
    ///
    /// # Errors
    /// When the map is too large for one picture, or encoding fails.
    pub fn comparison(&self) -> Result<MapFile, ExportError> {
        let [unfiltered, map] = [&self.unfiltered, &self.filtered].map(|layer| Rectangle::around(layer.tiles.values()));
        png("comparison.png", &side_by_side(&unfiltered?, &map?, &self.way_m, &self.walkers_m))
    }

    fn picture(&self, file: &'static str, map: &Rectangle) -> Result<MapFile, ExportError> {
        png(file, &picture(map, &self.way_m))
    }
}

fn png(file: &'static str, image: &image::RgbImage) -> Result<MapFile, ExportError> {
    let mut contents = std::io::Cursor::new(Vec::new());
    image.write_to(&mut contents, image::ImageFormat::Png).map_err(|source| ExportError::Encode { file, source })?;
    Ok(MapFile { name: file, contents: contents.into_inner() })
}
