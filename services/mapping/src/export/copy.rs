//! A copy of the map, held by its owner at the end or put together from what was received.

use std::collections::BTreeMap;
use std::fmt;

use messages::{Layer, MapTile, Trajectory, WayChunk};

use crate::mapper::Mapper;

use super::comparison::side_by_side;
use super::extent::{Extent, MAX_CELLS, known_cells};
use super::picture::picture;
use super::rectangle::{Rectangle, RectangleError};
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

/// The files of a map.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MapFiles {
    /// In the order in which they are written.
    pub files: Vec<MapFile>,
    /// What is too large for them, for each picture that lacks something.
    pub left_out: Vec<LeftOut>,
}

/// The part of a map that a picture lacks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    /// The picture.
    pub file: &'static str,
    /// Known cells that are not in it.
    pub cells: u64,
    /// Columns of all known cells with their margin.
    pub columns: i64,
    /// Rows of all known cells with their margin.
    pub rows: i64,
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { file, cells, columns, rows } = self;
        write!(f, "{file} lacks {cells} known cells: the map extends over {columns} × {rows} cells, a picture holds {MAX_CELLS}")
    }
}

impl LayerCopy {
    fn rectangle(&self, extent: &Extent) -> Result<Rectangle, RectangleError> {
        Rectangle::of(extent, self.tiles.values())
    }

    /// What a picture of this extent lacks.
    fn left_out(&self, file: &'static str, extent: &Extent) -> Option<LeftOut> {
        let outside = self.tiles.values().flat_map(known_cells).filter(|(row, column, _)| !extent.contains(*row, *column));
        let cells = outside.count() as u64;
        let all = || Extent::of(self.tiles.values());
        (cells > 0).then(all).map(|all| LeftOut { file, cells, columns: all.column_count(), rows: all.row_count() })
    }
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
    /// there, `unfiltered.png` and `comparison.png` with both side by side. Of a map that is too large for a picture, a part is
    /// drawn.
    ///
    /// # Errors
    /// When the tiles are of two maps, or encoding fails.
    pub fn files(&self) -> Result<MapFiles, ExportError> {
        let (extent, unfiltered_extent) = self.extents();
        let mut left_out: Vec<LeftOut> = self.filtered.left_out("map.png", &extent).into_iter().collect();
        let map = self.filtered.rectangle(&extent)?;
        let mut files = vec![
            MapFile { name: "map.pgm", contents: pgm(&map) },
            MapFile { name: "map.yaml", contents: yaml(&map, "map.pgm").into_bytes() },
            self.picture("map.png", &map)?,
        ];
        if !self.unfiltered.tiles.is_empty() {
            left_out.extend(self.unfiltered.left_out("unfiltered.png", &unfiltered_extent));
            files.push(self.picture("unfiltered.png", &self.unfiltered.rectangle(&unfiltered_extent)?)?);
            files.push(self.comparison()?);
        }
        Ok(MapFiles { files, left_out })
    }

    /// `comparison.png`: the map of every reading beside the map without what moves, with the ways of the walkers drawn thin
    /// (Fig. 10 of the paper).
    ///
    /// # Errors
    /// When the tiles are of two maps, or encoding fails.
    pub fn comparison(&self) -> Result<MapFile, ExportError> {
        let (extent, unfiltered_extent) = self.extents();
        let [unfiltered, map] = [self.unfiltered.rectangle(&unfiltered_extent)?, self.filtered.rectangle(&extent)?];
        png("comparison.png", &side_by_side(&unfiltered, &map, &self.way_m, &self.walkers_m))
    }

    /// What is drawn of the filtered and of the unfiltered layer: if that is too large, the same part of both.
    fn extents(&self) -> (Extent, Extent) {
        let extent = Extent::fitting(self.filtered.tiles.values());
        let unfiltered = Extent::of(self.unfiltered.tiles.values());
        (extent.clone(), if unfiltered.fits() { unfiltered } else { extent })
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

#[cfg(test)]
mod tests {
    use super::super::rectangle::tests::tile;
    use super::*;

    fn unfiltered(tile: MapTile) -> MapTile {
        MapTile { layer: Layer::Unfiltered as u32, ..tile }
    }

    #[test]
    fn a_map_with_a_part_far_away_is_written_without_it() {
        let near = tile(0, 0, &[(0, 0, 1.0), (20, 30, -1.0)]);
        let far = tile(9_000, 9_000, &[(3, 3, 1.0)]);
        let copy = |tiles: &[MapTile]| {
            let mut copy = MapCopy::default();
            tiles.iter().for_each(|tile| copy.take_tile(tile));
            copy.set_way(&[[0.0, 0.0], [28_800.0, 28_800.0]]);
            copy.files().unwrap()
        };
        let both = [near, far, unfiltered(near), unfiltered(far)];
        let MapFiles { files, left_out } = copy(&both);
        let names: Vec<_> = files.iter().map(|file| file.name).collect();
        assert_eq!(names, ["map.pgm", "map.yaml", "map.png", "unfiltered.png", "comparison.png"]);
        assert!(files == copy(&[near, unfiltered(near)]).files);
        let extent = 9_000 * 32 + 3 + 1 + 16;
        let lacks = |file| LeftOut { file, cells: 1, columns: extent, rows: extent };
        assert_eq!(left_out, [lacks("map.png"), lacks("unfiltered.png")]);
        assert_eq!(
            left_out[0].to_string(),
            "map.png lacks 1 known cells: the map extends over 288020 × 288020 cells, a picture holds 64000000"
        );
        // The part that only the unfiltered layer has is left out of that layer alone.
        let left_out = copy(&[near, unfiltered(near), unfiltered(far)]).left_out;
        assert_eq!(left_out, [lacks("unfiltered.png")]);
    }
}
