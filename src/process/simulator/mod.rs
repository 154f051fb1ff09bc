//! The simulator as a process: the world in deployment time, its robot behind a pseudo-terminal, the truth on the bus.

mod drive_state;
mod pace;
mod parameters;
mod picture_feed;

use std::fs;
use std::os::fd::BorrowedFd;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::robot;
use ::simulator::{PACKET_INTERVAL_NS, RobotEnd, Simulation};
use anyhow::{Context as _, Result};
use bus::{BusError, Writer};
use drive_state::DriveState;
use messages::{TruthScan, TruthSurfaces};
use pace::Pace;
pub(crate) use parameters::optics;
use picture_feed::PictureFeed;
use runtime::{Checkpoint, Context, Next, Shell, StepError};
use settings::{BuiltIn, Provides, Settings};
use terminal::Terminal;

/// Name of the robot's serial port in the domain's folder.
pub(super) const PORT_NAME: &str = "robot";

/// Most packets made in one step: a world that lags behind the clock catches up without keeping its client waiting.
const CATCH_UP_PACKETS: usize = 32;

/// How long, by the wall clock, a client may take to read the last packets after the end of the drive.
const FAREWELL: Duration = Duration::from_secs(5);

/// How often, by the wall clock, to look whether it has.
const FAREWELL_LOOK: Duration = Duration::from_millis(10);

/// Longest wait before the consumers are looked at again; what they report wakes the process earlier.
const HOLD_LOOK: Duration = Duration::from_millis(20);

/// Lag behind the clock that is made up for, s on the wall: a process that is scheduled late, not one that is too slow.
const LONGEST_LAG_S: f64 = 0.25;

/// Runs the simulator of a deployment until its robot has come to the end of its way.
///
/// # Errors
/// When the world cannot be read, the robot gets no port, or the bus fails.
pub(super) fn run(mut shell: Shell, settings: &Settings) -> Result<()> {
    let world = world_file::read(&copy_of_world(shell.membership().directory(), &settings.simulator.world)?)?;
    let body = robot::body(&settings.robot);
    let mut simulation = Simulation::new(&world, &body, u64::from(settings.simulator.seed.get()));
    let checkpoint = shell.checkpoint();
    let state = resume(&checkpoint, &mut simulation);
    let port = shell.membership().directory().join(PORT_NAME);
    let mut terminal = Terminal::open(port)?;
    if let Some(link) = &settings.simulator.link {
        terminal.link(link.clone())?;
        tracing::info!("the robot is at {}", link.display());
    }
    let mut surfaces = shell.writer()?;
    publish_surfaces(&mut surfaces, &simulation)?;
    let driven_ns = simulation.packets() * PACKET_INTERVAL_NS;
    let camera = match settings.simulator.camera.provides {
        Provides::Off => None,
        Provides::Pictures => Some(PictureFeed::new(&world, settings, &mut shell, driven_ns)?),
    };
    if camera.is_some() {
        shell.linger_as_source_until([BuiltIn::Sbs, BuiltIn::Fti].into_iter().flat_map(|kind| settings.named(kind)));
    }
    let mut pace = Pace::new(&mut shell, settings)?;
    if let Some(pace) = &mut pace {
        let now_ns = shell.membership().clock().now_ns();
        pace.run_from(now_ns, now_ns)?;
    }
    let mut process = Process {
        pace,
        camera,
        robot: RobotEnd::new(&body, settings.robot.odometry_modulus.get(), simulation.odometry()),
        truth: shell.writer()?,
        speed: shell.membership().speed(),
        simulation,
        terminal,
        checkpoint,
        state,
        clock: WorldClock::WaitsForClient,
        stamp_ns: 0,
        lost_bytes: 0,
    };
    Ok(shell.run(&mut process)?)
}

/// The world file as it was when the simulator first started: a changed file does not change the world in the middle of a drive.
fn copy_of_world(domain: &Path, world: &Path) -> Result<PathBuf> {
    let (copy, partial) = (domain.join("world.toml"), domain.join("world.toml.partial"));
    if !copy.exists() {
        fs::copy(world, &partial).with_context(|| format!("cannot copy {}", world.display()))?;
        fs::rename(&partial, &copy).with_context(|| format!("cannot write {}", copy.display()))?;
    }
    Ok(copy)
}

/// How the world's time runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum WorldClock {
    /// Not at all: the robot has not been opened since it was switched on.
    WaitsForClient,
    /// The drive has begun at `start_ns` in the world. It is due as if it had begun at `paced_from_ns` on the deployment's clock, which
    /// is later where the world had to wait.
    Runs { start_ns: u64, paced_from_ns: u64 },
    /// The drive is over; until this time the client may read the last packets.
    Over { until_ns: u64 },
}

struct Process {
    /// What the drive waits for; `None` where it follows the clock alone.
    pace: Option<Pace>,
    simulation: Simulation,
    robot: RobotEnd,
    terminal: Terminal,
    truth: Writer<TruthScan>,
    camera: Option<PictureFeed>,
    checkpoint: Checkpoint,
    state: DriveState,
    clock: WorldClock,
    speed: f64,
    /// Stamp of the last packet that was sent.
    stamp_ns: u64,
    /// Bytes that no client took.
    lost_bytes: u64,
}

impl runtime::Process for Process {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        self.answer_client()?;
        if let Some(pace) = &mut self.pace {
            pace.listen()?;
        }
        let next = if context.stopping() { Next::Finished } else { self.advance(context.now_ns())? };
        if next == Next::Finished {
            self.truth.end(self.state.sent, self.stamp_ns)?;
            if let Some(camera) = &mut self.camera {
                camera.end()?;
            }
        }
        self.report(context);
        Ok(next)
    }

    fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        vec![self.terminal.descriptor()]
    }
}

impl Process {
    fn answer_client(&mut self) -> Result<(), StepError> {
        let received = self.terminal.read()?;
        let answer = self.robot.push(&received);
        self.send(&answer)
    }

    fn advance(&mut self, now_ns: u64) -> Result<Next, StepError> {
        match self.clock {
            _ if self.simulation.is_over() && self.clock == WorldClock::WaitsForClient => Ok(Next::Finished),
            WorldClock::WaitsForClient if !self.robot.is_open() => Ok(Next::Wait),
            WorldClock::WaitsForClient => {
                let driven_ns = self.simulation.packets() * PACKET_INTERVAL_NS;
                let start_ns = now_ns.saturating_sub(driven_ns);
                self.clock = WorldClock::Runs { start_ns, paced_from_ns: start_ns };
                if let Some(pace) = &mut self.pace {
                    pace.stand_at(now_ns, false)?;
                }
                Ok(Next::Again)
            }
            WorldClock::Runs { start_ns, paced_from_ns } => self.drive(now_ns, start_ns, paced_from_ns),
            WorldClock::Over { until_ns } if now_ns >= until_ns || self.terminal.is_drained()? => Ok(Next::Finished),
            WorldClock::Over { .. } => Ok(Next::WaitAtMost(FAREWELL_LOOK)),
        }
    }

    /// Makes the packets and frames that are due, in the order of their times.
    fn drive(&mut self, now_ns: u64, start_ns: u64, paced_from_ns: u64) -> Result<Next, StepError> {
        let mut paced_from_ns = paced_from_ns;
        for _ in 0..CATCH_UP_PACKETS {
            let packet_ns = (self.simulation.packets() + 1) * PACKET_INTERVAL_NS;
            let frame_ns = self.camera.as_ref().and_then(PictureFeed::due_ns).unwrap_or(u64::MAX);
            let next_ns = packet_ns.min(frame_ns);
            let due_ns = paced_from_ns.saturating_add(next_ns);
            if due_ns > now_ns {
                let wait_s = (due_ns - now_ns) as f64 * 1e-9 / self.speed;
                return Ok(Next::WaitAtMost(Duration::from_secs_f64(wait_s)));
            }
            if let Some(pace) = &mut self.pace {
                let is_read = self.terminal.is_drained()?;
                if !pace.has_room(is_read) {
                    return Ok(Next::WaitAtMost(HOLD_LOOK));
                }
                // A short wait is made up for, a long one is not: the drive would outrun its pace afterwards.
                let longest_lag_ns = (LONGEST_LAG_S * self.speed * 1e9) as u64;
                if now_ns - due_ns > longest_lag_ns {
                    paced_from_ns = now_ns.saturating_sub(next_ns);
                    self.clock = WorldClock::Runs { start_ns, paced_from_ns };
                }
            }
            if let Some(camera) = self.camera.as_mut().filter(|_| frame_ns <= packet_ns) {
                camera.send(start_ns)?;
                if let Some(pace) = &mut self.pace {
                    pace.frame_sent(camera.last());
                }
                continue;
            }
            if !self.make_packet(start_ns + packet_ns)? {
                let farewell_ns = (FAREWELL.as_nanos() as f64 * self.speed) as u64;
                self.clock = WorldClock::Over { until_ns: now_ns.saturating_add(farewell_ns) };
                if let Some(pace) = &mut self.pace {
                    pace.run_from(self.stamp_ns, now_ns)?;
                }
                return Ok(Next::WaitAtMost(FAREWELL_LOOK));
            }
        }
        Ok(Next::Again)
    }

    /// Makes the next packet, and sends it when a client listens; false at the end of the drive.
    fn make_packet(&mut self, stamp_ns: u64) -> Result<bool, StepError> {
        let Some((packet, mut truth)) = self.simulation.next_packet() else { return Ok(false) };
        let bytes = self.robot.tick(&packet);
        self.state = DriveState { packets: packet.number, sent: self.state.sent + u64::from(!bytes.is_empty()) };
        // Before the packet leaves: after a kill at any moment the robot continues from where its client saw it last, or further.
        self.checkpoint.save_state(&self.state);
        if let Some(pace) = &mut self.pace {
            // Before the packet: the driver that reads it stamps it with this.
            pace.stand_at(stamp_ns, !bytes.is_empty())?;
        }
        if !bytes.is_empty() {
            self.send(&bytes)?;
            if !self.robot.sonars_on() {
                truth.count = 0;
            }
            self.stamp_ns = stamp_ns;
            self.truth.send(self.state.sent, stamp_ns, &truth)?;
        }
        Ok(true)
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), StepError> {
        self.lost_bytes += self.terminal.write(bytes)? as u64;
        Ok(())
    }

    fn report(&mut self, context: &mut Context<'_>) {
        let is_read = self.terminal.is_drained().unwrap_or(true);
        let waits_for = self.pace.as_mut().and_then(|pace| pace.waits_for(is_read));
        let driven_s = self.simulation.packets() * PACKET_INTERVAL_NS / 1_000_000_000;
        let drive_s = self.simulation.total_packets() * PACKET_INTERVAL_NS / 1_000_000_000;
        match self.clock {
            WorldClock::WaitsForClient => context.note("waiting for a client to open the robot"),
            WorldClock::Over { .. } => context.note("the robot has arrived"),
            WorldClock::Runs { .. } if !self.robot.is_open() => context.note("driving, but no client has the robot open"),
            WorldClock::Runs { .. } if self.robot.client_is_silent() => context.note("driving, but the client has fallen silent"),
            WorldClock::Runs { .. } => {
                let waits = waits_for.map_or_else(String::new, |process| format!("; waits for {process}"));
                context.note(&format!("driving, {driven_s} of {drive_s} s{waits}"));
            }
        }
        let line = self.robot.line();
        context.count("done", driven_s);
        context.count("total", drive_s);
        context.count("status packets", self.state.sent);
        context.count("commands", line.packets);
        context.count("bad checksums", line.bad_checksums);
        context.count("bytes not taken", self.lost_bytes);
    }
}

/// Takes the drive up where an earlier incarnation left it.
fn resume(checkpoint: &Checkpoint, simulation: &mut Simulation) -> DriveState {
    let state = checkpoint.restore_state::<DriveState>().unwrap_or_default();
    if state.packets > 0 {
        tracing::info!("the drive resumes after {} packets, the robot switched off and on", state.packets);
    }
    simulation.advance_to(state.packets);
    state
}

fn publish_surfaces(writer: &mut Writer<TruthSurfaces>, simulation: &Simulation) -> Result<(), BusError> {
    for (seq, chunk) in (1..).zip(simulation.surfaces()) {
        writer.send(seq, 0, &chunk)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_changed_world_file_does_not_change_a_drive() {
        let folder = tempfile::tempdir().unwrap();
        let world = folder.path().join("hall.toml");
        for text in ["first", "second"] {
            fs::write(&world, text).unwrap();
            let copy = copy_of_world(folder.path(), &world).unwrap();
            assert_eq!(fs::read_to_string(copy).unwrap(), "first");
        }
        fs::remove_file(&world).unwrap();
        assert!(copy_of_world(folder.path(), &world).is_ok(), "a removed file neither");
    }
}
