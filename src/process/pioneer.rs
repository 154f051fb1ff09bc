//! The driver as a process: a session between a serial port and the bus.

use std::os::fd::BorrowedFd;
use std::path::PathBuf;
use std::time::Duration;

use super::robot;
use super::simulator::PORT_NAME;
use ::pioneer::{Checkpoint, Command, Factors, Input, Output, Parameters, Port, Session, words};
use anyhow::Result;
use bus::Writer;
use messages::SonarScan;
use runtime::{Context, Next, Shell, StepError};
use settings::{BuiltIn, Port as PortSetting, Settings};

/// Most bytes taken from the line in one step: a line that never falls silent must not keep the heartbeat from beating.
const MOST_AT_ONCE: usize = 8192;

/// Shortest wait for a due time: what is due within it is done a little late rather than by spinning.
const SHORTEST_WAIT: Duration = Duration::from_millis(1);

/// Runs the driver until it is told to stop.
///
/// # Errors
/// When the bus fails.
pub(super) fn run(mut shell: Shell, settings: &Settings) -> Result<()> {
    let membership = shell.membership();
    let speed = membership.speed();
    let path = match &settings.pioneer.port {
        PortSetting::Simulator => membership.directory().join(PORT_NAME),
        PortSetting::Device(path) => path.clone(),
    };
    let checkpoint = shell.checkpoint();
    let kept = checkpoint.restore(|saved| Checkpoint::from_bytes(saved.state).ok_or("it is of another build"));
    shell.linger_as_source_until([BuiltIn::Mapping, BuiltIn::Std, BuiltIn::Fti].into_iter().flat_map(|kind| settings.named(kind)));
    let mut scans = shell.writer()?;
    if let Some(kept) = &kept {
        scans.send(kept.seq, kept.stamp_ns, &kept.scan)?;
    }
    let session = Session::new(parameters(&settings.robot, &settings.pioneer).at_speed(speed), kept);
    let simulated = settings.pioneer.port == PortSetting::Simulator;
    let mut process = Process { path, simulated, port: None, trouble: None, session, stamp_ns: 0, scans, checkpoint, speed };
    Ok(shell.run(&mut process)?)
}

/// The driver's parameters in a deployment that runs as fast as the wall clock.
fn parameters(robot: &settings::Robot, pioneer: &settings::Pioneer) -> Parameters {
    Parameters {
        model: robot.model.get(),
        factors: Factors {
            distance_mm: robot.distance_unit_mm.map(|unit| unit.get()),
            range_mm: robot.range_unit_mm.map(|unit| unit.get()),
            heading_units: robot.heading_units.and_then(|units| u16::try_from(units.get()).ok()),
        },
        ring: if robot.sonar.is_empty() { None } else { Some(robot::sonars(robot)) },
        range_limit_m: robot.range_limit_m.get(),
        odometry_modulus: robot.odometry_modulus.get(),
        bauds: pioneer.bauds.iter().map(|baud| baud.get()).collect(),
        pulse_ns: nanoseconds(pioneer.pulse_s.get()),
        link_lost_ns: nanoseconds(pioneer.link_lost_s.get()),
        speed_limit_m_s: pioneer.speed_limit_m_s.get(),
        turn_limit_rad_s: pioneer.turn_limit_rad_s.get(),
        ..Parameters::default()
    }
}

fn nanoseconds(seconds: f64) -> u64 {
    (seconds * 1e9) as u64
}

struct Process {
    path: PathBuf,
    /// The port is the simulator's, which comes and goes with it: nothing to warn of.
    simulated: bool,
    port: Option<Port>,
    /// Why there is no port, as it was last said.
    trouble: Option<String>,
    session: Session,
    /// Stamp of the last scan.
    stamp_ns: u64,
    scans: Writer<SonarScan>,
    checkpoint: runtime::Checkpoint,
    speed: f64,
}

impl runtime::Process for Process {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        let more = self.read(context)?;
        if context.stopping() {
            self.feed(Input::Stop, context.now_ns())?;
            self.scans.end(self.session.seq(), self.stamp_ns)?;
            self.report(context);
            return Ok(Next::Finished);
        }
        if self.port.is_none() {
            self.open(context.now_ns())?;
        }
        self.feed(Input::Tick, context.now_ns())?;
        self.report(context);
        Ok(if more { Next::Again } else { self.wait(context.now_ns()) })
    }

    fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        self.port.iter().map(Port::descriptor).collect()
    }
}

impl Process {
    /// Takes what has come over the line, at once: how many packets waited together tells when they came. Returns whether there
    /// may be more.
    fn read(&mut self, context: &Context<'_>) -> Result<bool, StepError> {
        let Some(port) = &mut self.port else { return Ok(false) };
        let mut bytes = vec![0; MOST_AT_ONCE];
        let mut count = 0;
        let end = loop {
            match port.read(&mut bytes[count..]) {
                Ok(0) => break None,
                Ok(more) => count += more,
                Err(error) => break Some(error),
            }
        };
        if count > 0 {
            self.feed(Input::Bytes(&bytes[..count]), context.now_ns())?;
        }
        match end {
            Some(error) => self.vanish(&error.to_string(), context.now_ns())?,
            None if count == MOST_AT_ONCE => return Ok(true),
            None => {}
        }
        Ok(false)
    }

    /// Tries to open the port. Without one the loop comes by a few times a second.
    fn open(&mut self, now_ns: u64) -> Result<(), StepError> {
        match Port::open(&self.path, self.session.baud()) {
            Ok(port) => {
                tracing::info!("opened {} at {} baud", self.path.display(), self.session.baud());
                self.port = Some(port);
                self.trouble = None;
                self.feed(Input::Opened, now_ns)
            }
            Err(error) => {
                self.say_trouble(&error);
                Ok(())
            }
        }
    }

    fn say_trouble(&mut self, error: &serialport::Error) {
        let trouble = format!("{}: {}", self.path.display(), words(error));
        if self.trouble.as_ref() != Some(&trouble) {
            match self.simulated {
                true => tracing::debug!("{trouble}; still trying"),
                false => tracing::warn!("{trouble}; still trying"),
            }
            self.trouble = Some(trouble);
        }
    }

    fn vanish(&mut self, why: &str, now_ns: u64) -> Result<(), StepError> {
        match self.simulated {
            true => tracing::debug!("{} is gone ({why}); waiting for it", self.path.display()),
            false => tracing::warn!("{} is gone ({why}); waiting for it", self.path.display()),
        }
        self.port = None;
        self.feed(Input::Vanished, now_ns)
    }

    /// Tells the session what happened and does what it wants.
    fn feed(&mut self, input: Input<'_>, now_ns: u64) -> Result<(), StepError> {
        let mut gone = None;
        for output in self.session.step(input, now_ns) {
            match output {
                Output::Send(command) => gone = gone.or(self.send(command)),
                Output::Baud(baud) => self.tolerate("set the baud rate of", |port| port.set_baud(baud)),
                Output::Flush => self.tolerate("flush", |port| port.flush()),
                Output::Reopen => self.port = None,
                Output::Publish(kept) => self.publish(&kept)?,
                Output::Event(event) if event.is_warning() => tracing::warn!("{event}"),
                Output::Event(event) => tracing::info!("{event}"),
            }
        }
        match gone {
            Some(why) => self.vanish(&why, now_ns),
            None => Ok(()),
        }
    }

    /// Returns why the port is gone, if it is.
    fn send(&mut self, command: Command) -> Option<String> {
        match self.port.as_mut()?.send(&command.packet()) {
            Ok(true) => None,
            Ok(false) => {
                tracing::debug!("{command:?} is lost: the line takes no bytes");
                None
            }
            Err(error) => Some(error.to_string()),
        }
    }

    /// A device that refuses a setting may still carry bytes; if not, the time limits find out.
    fn tolerate(&mut self, what: &str, setting: impl FnOnce(&mut Port) -> serialport::Result<()>) {
        if let Some(Err(error)) = self.port.as_mut().map(setting) {
            tracing::warn!("cannot {what} {}: {error}", self.path.display());
        }
    }

    fn publish(&mut self, kept: &Checkpoint) -> Result<(), StepError> {
        // Before the scan leaves: after a kill at any moment no number is given twice.
        self.checkpoint.save(kept.as_bytes());
        self.stamp_ns = kept.stamp_ns;
        Ok(self.scans.send(kept.seq, kept.stamp_ns, &kept.scan)?)
    }

    fn wait(&self, now_ns: u64) -> Next {
        self.session.due_ns().map_or(Next::Wait, |due_ns| {
            let wall = Duration::from_nanos((due_ns.saturating_sub(now_ns) as f64 / self.speed) as u64);
            Next::WaitAtMost(wall.max(SHORTEST_WAIT))
        })
    }

    fn report(&self, context: &mut Context<'_>) {
        match &self.trouble {
            Some(trouble) => context.note(trouble),
            None => context.note(&self.session.note(&self.path.display().to_string())),
        }
        let (link, refusals, rhythm) = (self.session.link(), self.session.refusals(), self.session.rhythm());
        for (name, value) in [
            ("packets", link.packets),
            ("bad checksums", link.bad_checksums),
            ("skipped bytes", link.skipped_bytes),
            ("refused packets", refusals.packets),
            ("refused odometry", refusals.odometry),
            ("refused readings", refusals.readings),
            ("repeated readings", refusals.repeated),
            ("duplicate packets", self.session.duplicates()),
            ("lost packets", self.session.lost_packets()),
            ("doubtful gaps", self.session.doubtful_poses()),
            ("reconnects", self.session.reconnects()),
            ("packet interval us", (rhythm.interval_s * 1e6) as u64),
            ("packet jitter us", (rhythm.jitter_s * 1e6) as u64),
        ] {
            context.count(name, value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_settings_are_the_drivers_default_parameters() {
        assert_eq!(parameters(&settings::Robot::default(), &settings::Pioneer::default()), Parameters::default());
    }
}
