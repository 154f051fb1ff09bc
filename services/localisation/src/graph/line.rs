//! Walls as lines, and the echoes off them.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::rigid::{Rigid, along, unit, wrap};

/// [`Echo::line`] of an echo that no line explains.
pub(crate) const NO_LINE: u32 = u32::MAX;

/// An echo: where its sonar was, and its range. Single precision: a tenth of a micrometre within a node's reach.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct Echo {
    pub(crate) node: u32,
    /// The line that it came from, or [`NO_LINE`].
    pub(crate) line: u32,
    /// The sonar in the frame of the node: x, y and yaw.
    mount: [f32; 3],
    range: f32,
}

impl Echo {
    pub(crate) fn new(node: u32, node_from_sonar: &Rigid, range_m: f64) -> Self {
        let mount = [node_from_sonar.x, node_from_sonar.y, node_from_sonar.yaw].map(|number| number as f32);
        Self { node, line: NO_LINE, mount, range: range_m as f32 }
    }

    /// The sonar in the frame of the node.
    pub(crate) fn mount(&self) -> Rigid {
        let [x, y, yaw] = self.mount.map(f64::from);
        Rigid::new(x, y, yaw)
    }

    /// In m.
    pub(crate) fn range(&self) -> f64 {
        f64::from(self.range)
    }
}

/// A smooth wall: an echo from it has the range r = d − n · (q − c), where q is the sonar's place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct Line {
    /// Direction of the normal n, from the robot to the wall.
    pub(crate) normal: f64,
    /// Distance d of the wall from the anchor along the normal, m.
    pub(crate) offset: f64,
    /// The anchor c, the mean of the sonar's places: close to it normal and offset are nearly independent. m.
    pub(crate) anchor: [f64; 2],
    /// Places of the sonar along the wall, left of the normal, from the anchor: least and greatest, m.
    pub(crate) ends: [f64; 2],
    /// Its echoes, ascending. Empty when it was merged into another line.
    pub(crate) echoes: Vec<u32>,
    /// Path length when it was seen last, m.
    pub(crate) seen_m: f64,
}

impl Line {
    pub(crate) fn is_alive(&self) -> bool {
        !self.echoes.is_empty()
    }

    pub(crate) fn length(&self) -> f64 {
        self.ends[1] - self.ends[0]
    }

    /// Place of the sonar along the normal and along the wall, from the anchor.
    pub(crate) fn along(&self, sonar: [f64; 2]) -> [f64; 2] {
        along(unit(self.normal), [sonar[0] - self.anchor[0], sonar[1] - self.anchor[1]])
    }

    /// Range less the range that the line explains, if the line can have caused the echo: within `reach` of the axis, on the
    /// right side, and not farther than `beyond` past the ends.
    pub(crate) fn residual(&self, sonar: &Rigid, range: f64, reach: f64, beyond: f64) -> Option<f64> {
        if wrap(sonar.yaw - self.normal).abs() > reach {
            return None;
        }
        let [ahead, aside] = self.along([sonar.x, sonar.y]);
        let distance = self.offset - ahead;
        let is_near = aside > self.ends[0] - beyond && aside < self.ends[1] + beyond;
        (distance >= 0.0 && is_near).then_some(range - distance)
    }

    /// Sets the anchor to the mean of the sonar's places, and the ends with it.
    pub(crate) fn set_anchor(&mut self, sonars: &[[f64; 2]]) {
        if sonars.is_empty() {
            return;
        }
        let count = sonars.len() as f64;
        let sum = sonars.iter().fold([0.0, 0.0], |sum, place| [sum[0] + place[0], sum[1] + place[1]]);
        let anchor = sum.map(|number| number / count);
        let [ahead, _] = self.along(anchor);
        self.offset -= ahead;
        self.anchor = anchor;
        let axes = unit(self.normal);
        self.ends = sonars.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], place| {
            let [_, aside] = along(axes, [place[0] - anchor[0], place[1] - anchor[1]]);
            [low.min(aside), high.max(aside)]
        });
    }

    /// Both ends of the wall, m.
    pub(crate) fn wall(&self) -> [[f64; 2]; 2] {
        let anchor = Rigid::new(self.anchor[0], self.anchor[1], self.normal);
        self.ends.map(|aside| anchor.apply([self.offset, aside]))
    }

    /// Moves it with the frame.
    pub(crate) fn moved(&mut self, motion: &Rigid) {
        self.anchor = motion.apply(self.anchor);
        self.normal += motion.yaw;
    }
}
