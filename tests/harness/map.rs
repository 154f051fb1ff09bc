//! A map as ROS map_server reads it.

use std::path::Path;

use super::text;

/// Row 0 of `cells` is the smallest y.
pub(crate) struct PgmMap {
    pub(crate) width: usize,
    height: usize,
    cell_m: f64,
    origin_m: [f64; 2],
    cells: Vec<u8>,
}

pub(crate) const OCCUPIED: u8 = 0;
pub(crate) const FREE: u8 = 254;
const UNKNOWN: u8 = 205;

impl PgmMap {
    pub(crate) fn read(folder: &Path) -> Self {
        let yaml = std::fs::read_to_string(folder.join("map.yaml")).unwrap();
        let value = |key: &str| yaml.lines().find_map(|line| line.strip_prefix(&format!("{key}: "))).unwrap().trim().to_owned();
        let origin: Vec<f64> = value("origin").trim_matches(['[', ']']).split(',').map(|number| number.trim().parse().unwrap()).collect();
        let bytes = std::fs::read(folder.join(value("image").trim_matches('"'))).unwrap();
        let mut fields = Vec::new();
        let mut at = 0;
        while fields.len() < 4 {
            let end = at + bytes[at..].iter().position(u8::is_ascii_whitespace).unwrap();
            fields.push(text(&bytes[at..end]));
            at = end + 1;
        }
        assert_eq!(fields[0], "P5");
        assert_eq!(fields[3], "255");
        let (width, height): (usize, usize) = (fields[1].parse().unwrap(), fields[2].parse().unwrap());
        let pixels = &bytes[at..];
        assert_eq!(pixels.len(), width * height);
        let cells = pixels.chunks(width).rev().flatten().copied().collect();
        Self { width, height, cell_m: value("resolution").parse().unwrap(), origin_m: [origin[0], origin[1]], cells }
    }

    pub(crate) fn at(&self, x_m: f64, y_m: f64) -> u8 {
        let column = ((x_m - self.origin_m[0]) / self.cell_m).floor();
        let row = ((y_m - self.origin_m[1]) / self.cell_m).floor();
        let inside = (0.0..self.width as f64).contains(&column) && (0.0..self.height as f64).contains(&row);
        if inside { self.cells[row as usize * self.width + column as usize] } else { UNKNOWN }
    }

    /// Number of cells of this value.
    pub(crate) fn count(&self, value: u8) -> usize {
        self.cells.iter().filter(|cell| **cell == value).count()
    }

    /// Share of the steps of 5 cm from `from_m` to `to_m` that have an occupied cell within `reach_m` across.
    pub(crate) fn wall_share(&self, from_m: [f64; 2], to_m: [f64; 2], reach_m: f64) -> f64 {
        let (dx, dy) = (to_m[0] - from_m[0], to_m[1] - from_m[1]);
        let length = dx.hypot(dy);
        let steps = (length / 0.05).ceil() as usize;
        let found = (0..steps).filter(|step| {
            let t = (*step as f64 + 0.5) / steps as f64;
            let across = (reach_m / 0.025).ceil() as i32;
            (-across..=across).any(|k| {
                let offset = f64::from(k) * 0.025;
                let x = from_m[0] + dx * t - dy / length * offset;
                let y = from_m[1] + dy * t + dx / length * offset;
                self.at(x, y) == OCCUPIED
            })
        });
        found.count() as f64 / steps as f64
    }
}
