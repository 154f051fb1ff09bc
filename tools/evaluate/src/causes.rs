//! Where the verdicts are wrong: which echoes of walkers enter the map, and which other echoes do not.

use std::f64::consts::FRAC_PI_4;

use geometry::wrapped;
use messages::{FilterVerdict, SonarReading, TruthScan};
use serde::Serialize;

use crate::drive::Drive;
use crate::judge::of_walker;
use crate::truth::STANDS_M;

/// Time over which the movement of a walker is measured, ns.
const MOVES_NS: u64 = 1_000_000_000;
/// An echo this near to a walker may be part of the walker: half a shoulder and half a step, m.
const NEAR_M: f64 = 0.6;

/// Echoes of one kind, and how many of them got the wrong verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Share {
    /// Echoes with the wrong verdict.
    pub wrong: usize,
    /// All echoes.
    pub all: usize,
}

impl Share {
    fn count(&mut self, wrong: bool) {
        self.wrong += usize::from(wrong);
        self.all += 1;
    }

    fn with(&self, other: &Self) -> Self {
        Self { wrong: self.wrong + other.wrong, all: self.all + other.all }
    }
}

/// Wrong verdicts by their causes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Causes {
    /// Echoes of walkers that move, in sonars that look ahead: within 45° of the heading.
    pub moving_ahead: Share,
    /// The same in other sonars.
    pub moving_aside: Share,
    /// Echoes of walkers that stand, in sonars that look ahead.
    pub standing_ahead: Share,
    /// The same in other sonars.
    pub standing_aside: Share,
    /// Other echoes within 0.6 m of a walker.
    pub near_walkers: Share,
    /// Other echoes farther from every walker, in sonars that look ahead.
    pub far_ahead: Share,
    /// The same in other sonars.
    pub far_aside: Share,
}

impl Causes {
    /// Of a drive with these verdicts.
    #[must_use]
    pub fn count(drive: &Drive, verdicts: &[FilterVerdict]) -> Self {
        let mut causes = Self::default();
        for (number, (scan, verdict)) in drive.scans.iter().zip(verdicts).enumerate() {
            // The last scan that is at least so much older; the first one at the start.
            let from_ns = scan.stamp_ns.saturating_sub(MOVES_NS);
            let past = &drive.scans[drive.scans[..=number].partition_point(|past| past.stamp_ns <= from_ns).saturating_sub(1)];
            let readings = scan.scan.readings().iter().zip(&scan.truth.readings).enumerate();
            for (index, (reading, truth)) in readings.filter(|(_, (reading, _))| reading.echo != 0) {
                let withheld = verdict.withholds(index);
                let ahead = wrapped(reading.mount.yaw_rad).abs() <= FRAC_PI_4;
                if of_walker(truth) {
                    let stands = moved_m(&past.truth, &scan.truth, truth.walker as usize) < STANDS_M;
                    causes.walker(stands, ahead).count(!withheld);
                } else {
                    causes.other(distance_m(reading, &scan.truth) < NEAR_M, ahead).count(withheld);
                }
            }
        }
        causes
    }

    fn walker(&mut self, stands: bool, ahead: bool) -> &mut Share {
        match (stands, ahead) {
            (false, true) => &mut self.moving_ahead,
            (false, false) => &mut self.moving_aside,
            (true, true) => &mut self.standing_ahead,
            (true, false) => &mut self.standing_aside,
        }
    }

    fn other(&mut self, near: bool, ahead: bool) -> &mut Share {
        match (near, ahead) {
            (true, _) => &mut self.near_walkers,
            (false, true) => &mut self.far_ahead,
            (false, false) => &mut self.far_aside,
        }
    }

    /// Both counts together.
    #[must_use]
    pub fn with(&self, other: &Self) -> Self {
        Self {
            moving_ahead: self.moving_ahead.with(&other.moving_ahead),
            moving_aside: self.moving_aside.with(&other.moving_aside),
            standing_ahead: self.standing_ahead.with(&other.standing_ahead),
            standing_aside: self.standing_aside.with(&other.standing_aside),
            near_walkers: self.near_walkers.with(&other.near_walkers),
            far_ahead: self.far_ahead.with(&other.far_ahead),
            far_aside: self.far_aside.with(&other.far_aside),
        }
    }
}

/// How far a walker, by its number from 1, is from where it was.
fn moved_m(before: &TruthScan, now: &TruthScan, walker: usize) -> f64 {
    let place = |truth: &TruthScan| truth.walkers_m.get(walker.wrapping_sub(1)).copied().unwrap_or_default();
    let ([x0, y0], [x1, y1]) = (place(before), place(now));
    (x1 - x0).hypot(y1 - y0)
}

/// Distance of an echo, taken to be on the axis of its sonar, from the nearest walker.
fn distance_m(reading: &SonarReading, truth: &TruthScan) -> f64 {
    let sonar = truth.pose.then(&reading.mount);
    let (sin, cos) = sonar.yaw_rad.sin_cos();
    let [x, y] = [sonar.x_m + cos * reading.range_m, sonar.y_m + sin * reading.range_m];
    let walkers = &truth.walkers_m[..(truth.walkers_count as usize).min(truth.walkers_m.len())];
    walkers.iter().map(|walker| (walker[0] - x).hypot(walker[1] - y)).fold(f64::INFINITY, f64::min)
}
