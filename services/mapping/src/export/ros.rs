//! `map.pgm` and `map.yaml` as ROS 1's map_server and nav2 read them: trinary, row 0 at the largest y.

use super::rectangle::Rectangle;
use crate::integrate::probability;
use crate::occupied::{OCCUPIED, is_occupied};

/// Below this occupancy a cell is free. With nav2's own default of 0.25 the grey of unknown would read as free.
const FREE_BELOW: f64 = 0.196;

const FREE: u8 = 254;
const BLACK: u8 = 0;
const UNKNOWN: u8 = 205;

pub(super) fn pgm(map: &Rectangle) -> Vec<u8> {
    let mut bytes = format!("P5\n{} {}\n255\n", map.columns, map.rows).into_bytes();
    bytes.extend(map.rows_from_top().flatten().map(|&log_odds| grey(log_odds)));
    bytes
}

fn grey(log_odds: f32) -> u8 {
    match log_odds {
        _ if is_occupied(log_odds) => BLACK,
        _ if probability(log_odds) < FREE_BELOW => FREE,
        _ => UNKNOWN,
    }
}

pub(super) fn yaml(map: &Rectangle, image: &str) -> String {
    let [x, y] = map.origin_m;
    format!(
        "image: {image}\nmode: trinary\nresolution: {}\norigin: [{x:.6}, {y:.6}, 0.0]\nnegate: 0\noccupied_thresh: {OCCUPIED}\nfree_thresh: {FREE_BELOW}\n",
        map.cell_m
    )
}

#[cfg(test)]
mod tests {
    use super::super::rectangle::tests::tile;
    use super::*;

    #[test]
    fn it_is_what_map_server_reads() {
        let tiles = [tile(0, 0, &[(0, 0, 2.0), (1, 0, -2.0), (0, 1, 0.3), (0, 2, -0.6)])];
        let map = Rectangle::around(tiles.iter()).unwrap();
        let image = pgm(&map);
        let (head, pixels) = image.split_at(image.len() - 19 * 18);
        assert_eq!(head, b"P5\n19 18\n255\n");
        // The upper row of the picture is that of the larger y.
        assert_eq!(pixels[8 * 19 + 8], FREE);
        assert_eq!(pixels[9 * 19 + 8..9 * 19 + 11], [BLACK, UNKNOWN, UNKNOWN]);
        assert_eq!(
            yaml(&map, "map.pgm"),
            "image: map.pgm\nmode: trinary\nresolution: 0.1\norigin: [-0.800000, -0.800000, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
        );
    }
}
