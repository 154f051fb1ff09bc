//! Import of the log of Udacity's RoboND course: `measurement.txt` (time, eight ranges) beside `poses.txt` (time, x, y,
//! heading), one line a step, in ms, mm and tenths of a degree.
//!
//! The files say neither where the sonars sit nor which way round they are numbered. They are taken to sit at the robot's
//! centre, and the first to look right: so the corridor's walls come out straight, the other way round they waver.

use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::Path;

use messages::{Payload, Pose, SonarReading, SonarScan};

use crate::damage::{Fault, LogError};
use crate::preamble::Preamble;
use crate::recording::Recording;

/// Directions of the sonars in the order of their columns, degrees counter-clockwise from straight ahead.
const HEADINGS_DEG: [f64; 8] = [-90.0, -37.5, -22.5, -7.5, 7.5, 22.5, 37.5, 90.0];
/// What the sensor says when nothing comes back, mm.
const NO_ECHO_MM: f64 = 5110.0;
/// The longest file that is read, bytes: a day of steps.
const MOST: u64 = 64 << 20;
/// The settings that the log carries for its replay.
const SETTINGS: &str = include_str!("robond.toml");

/// What came of an import.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Imported {
    /// Scans in the log.
    pub scans: u64,
    /// Readings among them that are no echo.
    pub without_echo: u64,
}

/// Writes the log in the folder `from` into the new file `to`.
///
/// # Errors
/// When a file cannot be read or written, exists already, or has a line that is not of the format.
pub fn import_robond(from: &Path, to: &Path) -> Result<Imported, LogError> {
    let (measurements, poses) = (from.join("measurement.txt"), from.join("poses.txt"));
    let measured = lines(&measurements, "its time in ms and eight ranges in mm").map_err(LogError::at(&measurements))?;
    let posed = lines(&poses, "its time in ms, x and y in mm and the heading in 0.1 degrees").map_err(LogError::at(&poses))?;
    let scans = scans(&measured, &posed).map_err(LogError::at(&poses))?;
    let bytes = log(&scans).map_err(LogError::at(to))?;
    let mut file = File::create_new(to).map_err(LogError::at(to))?;
    file.write_all(&bytes).map_err(|error| {
        // The failure to write is the one to tell.
        let _ = fs::remove_file(to);
        LogError::at(to)(error)
    })?;
    let readings = scans.iter().flat_map(|(_, scan)| scan.readings());
    Ok(Imported { scans: scans.len() as u64, without_echo: readings.filter(|reading| reading.echo == 0).count() as u64 })
}

/// The numbers of each line.
fn lines<const N: usize>(path: &Path, expected: &str) -> Result<Vec<[f64; N]>, Fault> {
    let mut text = String::new();
    File::open(path)?.take(MOST).read_to_string(&mut text)?;
    text.lines().enumerate().map(|(index, line)| numbers(line).ok_or_else(|| wrong(index, line, expected))).collect()
}

fn numbers<const N: usize>(line: &str) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = line.split_whitespace().map(|word| word.parse().ok().filter(|value: &f64| value.is_finite())).collect();
    numbers?.try_into().ok()
}

fn wrong(index: usize, found: &str, expected: impl Into<String>) -> Fault {
    let found: String = found.chars().take(80).collect();
    Fault::Line { line: index + 1, found: format!("{found:?}"), expected: expected.into() }
}

/// The scans of the lines, in order, with their stamps.
fn scans(measured: &[[f64; 9]], posed: &[[f64; 4]]) -> Result<Vec<(u64, SonarScan)>, Fault> {
    if measured.len() != posed.len() {
        let expected = format!("{} as in measurement.txt", measured.len());
        return Err(wrong(measured.len().min(posed.len()), &format!("{} lines", posed.len()), expected));
    }
    let mut scans: Vec<(u64, SonarScan)> = Vec::new();
    for (index, ([measured_ms, ranges_mm @ ..], [time_ms, x_mm, y_mm, heading_tenths])) in measured.iter().zip(posed).enumerate() {
        if measured_ms.total_cmp(time_ms).is_ne() {
            return Err(wrong(index, &format!("time {time_ms}"), format!("{measured_ms} as in measurement.txt")));
        }
        // Up to 2⁵³ ms a number of the file is exact.
        let stamp_ns = (time_ms.clamp(0.0, 9e12) * 1e6) as u64;
        if scans.last().is_some_and(|(last_ns, _)| stamp_ns <= *last_ns) || *time_ms < 0.0 {
            return Err(wrong(index, &format!("time {time_ms}"), "a time after that of the line before"));
        }
        let pose = Pose { x_m: x_mm / 1e3, y_m: y_mm / 1e3, yaw_rad: (heading_tenths / 10.0).to_radians() };
        let scan = SonarScan::new(pose, &readings(ranges_mm), false);
        scan.validate().map_err(|invalid| wrong(index, &invalid.to_string(), "numbers in range"))?;
        scans.push((stamp_ns, scan));
    }
    Ok(scans)
}

fn readings(ranges_mm: &[f64]) -> Vec<SonarReading> {
    let numbered = (0..).zip(ranges_mm.iter().zip(HEADINGS_DEG));
    let reading = |(sonar, (range_mm, heading_deg)): (u32, (&f64, f64))| SonarReading {
        mount: Pose { x_m: 0.0, y_m: 0.0, yaw_rad: heading_deg.to_radians() },
        range_m: range_mm.min(NO_ECHO_MM) / 1e3,
        sonar,
        echo: u32::from(*range_mm < NO_ECHO_MM),
    };
    numbered.map(reading).collect()
}

fn log(scans: &[(u64, SonarScan)]) -> Result<Vec<u8>, Fault> {
    let preamble = Preamble {
        run: 1,
        robot: "unknown".to_owned(),
        sonars: HEADINGS_DEG.map(|deg| Pose { x_m: 0.0, y_m: 0.0, yaw_rad: deg.to_radians() }).to_vec(),
        origin: "imported from measurement.txt and poses.txt (robond); the sonars are taken to sit at the robot's centre, the first looking right"
            .to_owned(),
        settings: SETTINGS.to_owned(),
    };
    let mut recording = Recording::new(&preamble)?;
    let mut bytes = Vec::new();
    for (seq, (stamp_ns, scan)) in (1..).zip(scans) {
        recording.scan(seq, *stamp_ns, scan)?;
        bytes.extend(recording.take());
    }
    recording.end::<SonarScan>(scans.len() as u64, scans.last().map_or(0, |(stamp_ns, _)| *stamp_ns))?;
    bytes.extend(recording.finish()?);
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_settings_in_the_log_have_the_ring_of_its_scans() {
        let settings = settings::Settings::parse("robond.toml", SETTINGS).unwrap();
        let headings: Vec<f64> = settings.robot.sonar.iter().map(|sonar| sonar.heading_deg.get()).collect();
        assert_eq!(headings, HEADINGS_DEG);
        assert_eq!(settings.robot.range_limit_m.get(), NO_ECHO_MM / 1e3);
    }
}
