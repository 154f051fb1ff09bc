//! A driver in another program: publishes `robot/scan` from a text file with one scan per line. A line holds the time in s; x, y (m)
//! and yaw (rad) of the robot; then for each reading x, y (m) and heading (rad) of its sonar on the robot, and the range in m.

use messages::{Pose, SonarReading, SonarScan};
use runtime::{Context, Next, Shell};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let text = std::fs::read_to_string(std::env::args().nth(1).ok_or("expected the name of a text file")?)?;
    // Scans are numbered from 1. After a restart they are published again with the same numbers: readers drop those they have received.
    let mut lines = (1..).zip(text.lines());
    let (mut last_seq, mut last_ns) = (0, 0);
    let mut shell = Shell::from_env()?;
    let mut scans = shell.writer()?;
    shell.run(&mut |context: &mut Context<'_>| {
        let Some((seq, line)) = lines.next().filter(|_| !context.stopping()) else {
            scans.end(last_seq, last_ns)?;
            return Ok(Next::Finished);
        };
        let numbers: Vec<f64> = line.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
        let [time_s, x_m, y_m, yaw_rad, ref readings @ ..] = numbers[..] else {
            return Err(format!("line {seq} has {} numbers, expected at least 4", numbers.len()).into());
        };
        let reading = |(&[x, y, heading, m], sonar): (&[f64; 4], u32)| SonarReading::new(sonar, Pose::new(x, y, heading), m, m < 3.0);
        let readings: Vec<SonarReading> = readings.as_chunks().0.iter().zip(0..).map(reading).collect();
        (last_seq, last_ns) = (seq, (time_s * 1e9) as u64);
        scans.send(seq, last_ns, &SonarScan::new(Pose::new(x_m, y_m, yaw_rad), &readings, false))?;
        Ok(Next::WaitAtMost(std::time::Duration::from_millis(10)))
    })?;
    Ok(())
}
