//! `map/verdict`: which readings of a scan a moving thing caused.

use crate::layout::plain;
use crate::service::{at_most, within};
use crate::{Invalid, MAX_READINGS, Payload, Qos, Service};

/// Most update regions in one verdict.
pub const MAX_REGIONS: usize = 8;

plain! {
    /// The region a moving thing covers (`O_Centroid`, `O_Size` of the paper's Tables 3 to 5), in the map frame.
    pub struct UpdateRegion {
        /// Centre, m.
        pub x_m: f64,
        /// Centre, m.
        pub y_m: f64,
        /// Size in cells.
        pub cells: f64,
    }

    /// The final answer of FTI on one scan; its sequence number is the scan's.
    pub struct FilterVerdict {
        /// The first `count` entries are regions, the rest is zero.
        pub regions: [UpdateRegion; MAX_REGIONS],
        /// Number of regions.
        pub count: u32,
        /// Bit i set: the occupied part of reading i is left out of the map.
        pub withheld: u32,
        /// Bit 0: rests on the sonar's motion; bit 1: on the camera's.
        pub inputs: u32,
        /// Always 0.
        pub reserved: u32,
    }
}

impl FilterVerdict {
    /// Bit of `inputs`: the verdict rests on the sonar's motion.
    pub const FROM_SONAR: u32 = 1;
    /// Bit of `inputs`: the verdict rests on the camera's motion.
    pub const FROM_CAMERA: u32 = 2;

    /// Whether the occupied part of reading `index` is left out.
    #[must_use]
    pub fn withholds(&self, index: usize) -> bool {
        index < MAX_READINGS && self.withheld & (1 << index) != 0
    }
}

impl Payload for FilterVerdict {
    const SERVICE: Service = Service { name: "map/verdict", version: 1, qos: Qos::STREAM, wakes: true, sequenced: true };

    fn validate(&self) -> Result<(), Invalid> {
        at_most("count", self.count, MAX_REGIONS, "at most 8")?;
        at_most("withheld", self.withheld, (1 << MAX_READINGS) - 1, "a bit for each of 16 readings")?;
        at_most("inputs", self.inputs, 3, "0 to 3")?;
        for region in &self.regions[..self.count as usize] {
            within("regions.x_m", region.x_m, -1e6, 1e6, "at most 1000 km from the origin")?;
            within("regions.y_m", region.y_m, -1e6, 1e6, "at most 1000 km from the origin")?;
            within("regions.cells", region.cells, 0.0, 1e6, "0 to 1000000 cells")?;
        }
        Ok(())
    }
}
