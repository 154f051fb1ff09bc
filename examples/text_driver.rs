//! A driver of one's own: publishes `robot/scan` from a text file, one scan a line.
//!
//! A line is: time in s; x, y (m) and yaw (rad) of the robot; then for each reading x, y (m) and heading (rad) of its sonar on
//! the robot, and the range in m.

use bus::{Context, Membership, Next, Process, Shell, StepError, Writer};
use messages::{Pose, SonarReading, SonarScan};
use std::time::Duration;

struct TextDriver {
    lines: std::vec::IntoIter<Vec<f64>>,
    scans: Writer<SonarScan>,
    seq: u64,
    stamp_ns: u64,
}

impl Process for TextDriver {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        let Some(line) = self.lines.next().filter(|_| !context.stopping()) else {
            self.scans.end(self.seq, self.stamp_ns)?;
            return Ok(Next::Finished);
        };
        let [time_s, x_m, y_m, yaw_rad, readings @ ..] = line.as_slice() else { return Err("a line is too short".into()) };
        let reading = |(sonar, numbers): (u32, &[f64; 4])| {
            let [x_m, y_m, yaw_rad, range_m] = *numbers;
            SonarReading { mount: Pose { x_m, y_m, yaw_rad }, range_m, sonar, echo: u32::from(range_m < 3.0) }
        };
        let readings: Vec<SonarReading> = (0..).zip(readings.as_chunks().0).map(reading).collect();
        // Scans are numbered from 1; after a restart they may come again with their numbers: whoever had them drops them.
        (self.seq, self.stamp_ns) = (self.seq + 1, (time_s * 1e9) as u64);
        let scan = SonarScan::new(Pose { x_m: *x_m, y_m: *y_m, yaw_rad: *yaw_rad }, &readings, false);
        self.scans.send(self.seq, self.stamp_ns, &scan)?;
        Ok(Next::WaitAtMost(Duration::from_millis(10)))
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("expected the name of a text file")?;
    let text = std::fs::read_to_string(path)?;
    let lines: Vec<Vec<f64>> = text.lines().map(|line| line.split_whitespace().map(str::parse).collect()).collect::<Result<_, _>>()?;
    let mut shell = Shell::join(Membership::from_env()?)?;
    let scans = shell.writer()?;
    Ok(shell.run(&mut TextDriver { lines: lines.into_iter(), scans, seq: 0, stamp_ns: 0 })?)
}
