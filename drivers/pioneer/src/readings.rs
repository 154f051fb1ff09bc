//! From a packet's readings to those that a sonar can have made.

use messages::{Pose, SonarReading};
use psos::RawReading;

/// Farthest that any of the robots' sonars reports, m: they see to about 5 m, and a fifth more covers robots whose factors are a
/// little off. Beyond it a number is damage, not an echo.
const REACH_M: f64 = 6.0;

/// Whether no sonar sits here: some rings leave numbers out.
fn is_absent(mount: &Pose) -> bool {
    (mount.x_m, mount.y_m, mount.yaw_rad) == (0.0, 0.0, -std::f64::consts::PI)
}

/// The readings of one packet, and what was wrong with the others.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Readings {
    /// Readings to publish, one a sonar, in the order of the packet.
    pub good: Vec<SonarReading>,
    /// Readings of a sonar that the robot does not have, or of a range that no sonar gives.
    pub refused: u64,
    /// Readings replaced by a later one of the same sonar in the same packet.
    pub repeated: u64,
}

/// Judges a packet's readings. `ring` holds the sonars' mounts by number; `range_m` is the length of a range unit.
#[must_use]
pub fn readings(raw: &[RawReading], ring: &[Pose], unit_m: f64, range_limit_m: f64) -> Readings {
    let mut found = Readings::default();
    for reading in raw {
        let measured_m = f64::from(reading.range) * unit_m;
        let mount = ring.get(usize::from(reading.sonar));
        let (Some(&mount), true) = (mount.filter(|mount| !is_absent(mount)), reading.range > 0 && measured_m <= REACH_M) else {
            found.refused += 1;
            continue;
        };
        let echo = measured_m < range_limit_m;
        let reading =
            SonarReading { mount, range_m: measured_m.min(range_limit_m), sonar: u32::from(reading.sonar), echo: u32::from(echo) };
        if let Some(earlier) = found.good.iter_mut().find(|earlier| earlier.sonar == reading.sonar) {
            *earlier = reading;
            found.repeated += 1;
        } else {
            found.good.push(reading);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT_M: f64 = 0.1734e-3;

    fn ring() -> Vec<Pose> {
        (0..7).map(|k| Pose { x_m: f64::from(k), ..Pose::default() }).collect()
    }

    #[track_caller]
    fn check(raw: &[(u8, u16)], good: &[(u32, f64, u32)], refused: u64, repeated: u64) {
        let raw: Vec<_> = raw.iter().map(|&(sonar, range)| RawReading { sonar, range }).collect();
        let found = readings(&raw, &ring(), UNIT_M, 3.0);
        assert_eq!((found.refused, found.repeated), (refused, repeated), "{found:?}");
        assert_eq!(found.good.len(), good.len(), "{found:?}");
        for (reading, &(sonar, range_m, echo)) in found.good.iter().zip(good) {
            assert_eq!((reading.sonar, reading.echo), (sonar, echo));
            assert!((reading.range_m - range_m).abs() < 1e-4, "{reading:?}");
            assert_eq!(reading.mount.x_m, f64::from(sonar));
        }
    }

    #[test]
    fn ranges_and_silence() {
        check(&[(3, 10784), (0, 577)], &[(3, 1.8699, 1), (0, 0.1, 1)], 0, 0);
        // 3.5 m, the farthest that one robot reports, is beyond the limit of 3 m.
        check(&[(1, 20185), (2, 17302)], &[(1, 3.0, 0), (2, 3.0, 0)], 0, 0);
        check(&[], &[], 0, 0);
        let at_limit = readings(&[RawReading { sonar: 0, range: 3000 }], &ring(), 1e-3, 3.0);
        assert_eq!((at_limit.good[0].range_m, at_limit.good[0].echo), (3.0, 0));
    }

    #[test]
    fn what_no_sonar_gives_is_refused() {
        check(&[(7, 1000), (255, 1000), (2, 0), (2, 34603), (2, 65535), (4, 5767)], &[(4, 1.0, 1)], 5, 0);
    }

    #[test]
    fn of_two_readings_of_a_sonar_the_last_counts() {
        check(&[(4, 5767), (5, 5767), (4, 11534)], &[(4, 2.0, 1), (5, 1.0, 1)], 0, 1);
    }
}
