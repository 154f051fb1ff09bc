//! A tile of the map as a `foxglove.Grid`, with what a grid has no word for behind it.

use foxglove::Decode;
use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{Grid, PackedElementField, Pose, Quaternion, Timestamp, Vector2, Vector3};
use prost::Message;

use messages::{MapTile, TILE_CELLS, TILE_EDGE};

use crate::decode_error::DecodeError;

/// Bytes of a cell: its log-odds as a little-endian `f32`.
const CELL_BYTES: usize = 4;

/// Fields that follow those of the grid, under numbers that no grid uses: a reader of plain grids skips them.
#[derive(Clone, PartialEq, Message)]
struct Rest {
    #[prost(uint64, tag = "1001")]
    seq: u64,
    #[prost(uint64, tag = "1002")]
    scan_seq: u64,
    #[prost(sint32, tag = "1003")]
    column: i32,
    #[prost(sint32, tag = "1004")]
    row: i32,
    #[prost(uint32, tag = "1005")]
    layer: u32,
    #[prost(uint32, tag = "1006")]
    tiles_in_layer: u32,
}

/// The tile at its place in the map frame.
pub(crate) fn encode(tile: &MapTile, seq: u64, stamp_ns: u64) -> Vec<u8> {
    let edge_m = TILE_EDGE as f64 * tile.cell_m;
    let grid = Grid {
        timestamp: Some(timestamp(stamp_ns)),
        frame_id: "map".to_owned(),
        pose: Some(pose(f64::from(tile.column) * edge_m, f64::from(tile.row) * edge_m, 0.0)),
        column_count: TILE_EDGE as u32,
        cell_size: Some(Vector2 { x: tile.cell_m, y: tile.cell_m }),
        row_stride: (TILE_EDGE * CELL_BYTES) as u32,
        cell_stride: CELL_BYTES as u32,
        fields: vec![PackedElementField { name: "log_odds".to_owned(), offset: 0, r#type: NumericType::Float32 as i32 }],
        data: tile.log_odds.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>().into(),
    };
    let rest =
        Rest { seq, scan_seq: tile.scan_seq, column: tile.column, row: tile.row, layer: tile.layer, tiles_in_layer: tile.tiles_in_layer };
    // Two protobuf messages one after the other are one message with the fields of both.
    let mut bytes = Message::encode_to_vec(&grid);
    bytes.extend(Message::encode_to_vec(&rest));
    bytes
}

/// The sequence number and the tile.
pub(crate) fn decode(data: &[u8]) -> Result<(u64, MapTile), DecodeError> {
    let grid = <Grid as Decode>::decode(data)?;
    let rest = <Rest as Message>::decode(data)?;
    let expect = |what, found: usize, expected: usize| {
        if found == expected { Ok(()) } else { Err(DecodeError::NoTile { what, found: found as f64, expected: expected as f64 }) }
    };
    expect("its width in cells", grid.column_count as usize, TILE_EDGE)?;
    expect("its size in bytes", grid.data.len(), TILE_CELLS * CELL_BYTES)?;
    let mut tile = MapTile {
        cell_m: grid.cell_size.map(|size| size.x).unwrap_or_default(),
        scan_seq: rest.scan_seq,
        column: rest.column,
        row: rest.row,
        layer: rest.layer,
        tiles_in_layer: rest.tiles_in_layer,
        ..MapTile::default()
    };
    let (cells, _) = grid.data.as_chunks::<CELL_BYTES>();
    for (value, bytes) in tile.log_odds.iter_mut().zip(cells) {
        *value = f32::from_le_bytes(*bytes);
    }
    Ok((rest.seq, tile))
}

/// A stamp as Foxglove writes it; it ends in the year 2106.
#[must_use]
pub fn timestamp(stamp_ns: u64) -> Timestamp {
    let seconds = u32::try_from(stamp_ns / 1_000_000_000).unwrap_or(u32::MAX);
    Timestamp::new(seconds, (stamp_ns % 1_000_000_000) as u32)
}

/// A place in the plane as Foxglove writes it.
pub(crate) fn pose(x: f64, y: f64, yaw_rad: f64) -> Pose {
    let (sin, cos) = (0.5 * yaw_rad).sin_cos();
    Pose { position: Some(Vector3 { x, y, z: 0.0 }), orientation: Some(Quaternion { x: 0.0, y: 0.0, z: sin, w: cos }) }
}
