//! The driver as a process: a session between a serial port and the bus.

mod sharing;

use std::os::fd::BorrowedFd;
use std::time::{Duration, Instant};

use super::robot;
use super::simulator::PORT_NAME;
use ::pioneer::{Address, Checkpoint, Factors, Input, Opening, Output, Parameters, Port, Session, Shared};
use anyhow::Result;
use bus::{Reader, Received, Writer};
use messages::{SimulatedTime, SonarScan};
use runtime::{Context, Next, Shell, StepError};
use rustix::time::{ClockId, clock_gettime};
use settings::{BuiltIn, NetworkPort, Port as PortSetting, Settings};
use sharing::Sharing;

/// Most bytes taken from the line in one step: a line that never falls silent must not keep the heartbeat from beating.
const MOST_AT_ONCE: usize = 8192;

/// Shortest wait for a due time: what is due within it is done a little late rather than by spinning.
const SHORTEST_WAIT: Duration = Duration::from_millis(1);

/// Time between the starts of two attempts to connect in the network, by the wall clock: a host that refuses does so at once.
const RECONNECT: Duration = Duration::from_secs(1);

/// Runs the driver until it is told to stop.
///
/// # Errors
/// When the bus fails.
pub(super) fn run(mut shell: Shell, settings: &Settings) -> Result<()> {
    let membership = shell.membership();
    let speed = membership.speed();
    let address = match address(&settings.pioneer.port) {
        Some(address) => address,
        None => Address::Device(membership.directory().join(PORT_NAME)),
    };
    let checkpoint = shell.checkpoint();
    let saved = checkpoint.restore(|saved| Checkpoint::from_bytes(saved.state).ok_or("it is of another build"));
    let consumers = [BuiltIn::Mapping, BuiltIn::Std, BuiltIn::Fti, BuiltIn::Localisation];
    shell.linger_as_source_until(consumers.into_iter().flat_map(|kind| settings.named(kind)));
    let mut scans = shell.writer()?;
    if let Some(saved) = &saved {
        scans.send(saved.seq, saved.stamp_ns, &saved.scan)?;
    }
    let times = if settings.pioneer.port == PortSetting::Simulator { Some(shell.reader()?) } else { None };
    let session = Session::new(parameters(&settings.robot, &settings.pioneer).at_speed(speed), saved);
    let simulated = settings.pioneer.port == PortSetting::Simulator;
    let mut process = Process {
        address,
        simulated,
        port: None,
        opening: None,
        opened: None,
        trouble: None,
        session,
        sharing: Sharing::new(&settings.pioneer, Instant::now()),
        stamp_ns: 0,
        scans,
        checkpoint,
        speed,
        times,
        time: None,
        suspended: Suspended::new(),
    };
    Ok(shell.run(&mut process)?)
}

/// The port of the settings as the driver names it; `None` for that of the deployment's simulator.
pub(crate) fn address(port: &PortSetting) -> Option<Address> {
    match port {
        PortSetting::Simulator => None,
        PortSetting::Device(path) => Some(Address::Device(path.clone())),
        PortSetting::Network(NetworkPort { host, port }) => Some(Address::Network { host: host.clone(), port: *port }),
    }
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
        bauds: match &pioneer.port {
            PortSetting::Network(_) => Vec::new(),
            PortSetting::Simulator | PortSetting::Device(_) => pioneer.bauds.iter().map(|baud| baud.get()).collect(),
        },
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
    address: Address,
    /// The port is the simulator's, which comes and goes with it: nothing to warn of.
    simulated: bool,
    port: Option<Port>,
    /// A port that is being opened.
    opening: Option<Opening>,
    /// When that was last begun.
    opened: Option<Instant>,
    /// Why there is no port, as it was last said.
    trouble: Option<String>,
    session: Session,
    sharing: Sharing,
    /// Stamp of the last scan.
    stamp_ns: u64,
    scans: Writer<SonarScan>,
    checkpoint: runtime::Checkpoint,
    speed: f64,
    /// Time in the world of a simulated robot.
    times: Option<Reader<SimulatedTime>>,
    /// What it was last.
    time: Option<SimulatedTime>,
    suspended: Suspended,
}

/// Time that the computer was suspended, in which the monotonic clock and with it the deployment's stands still.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Suspended {
    /// How far the clock that counts suspensions is ahead of the one that does not, ns.
    ahead_ns: u64,
}

/// The two clocks are read one after the other: what they differ by less is the time in between, ns.
const CLOCKS_APART_NS: u64 = 100_000_000;

impl Suspended {
    fn new() -> Self {
        Self { ahead_ns: ahead_ns() }
    }

    /// The time of a suspension since the last call, if there was one, ns.
    fn since(&mut self, ahead_ns: u64) -> Option<u64> {
        let suspended_ns = ahead_ns.saturating_sub(self.ahead_ns);
        (suspended_ns >= CLOCKS_APART_NS).then(|| {
            self.ahead_ns = ahead_ns;
            suspended_ns
        })
    }
}

fn ahead_ns() -> u64 {
    let ns = |clock| {
        let time = clock_gettime(clock);
        time.tv_sec.unsigned_abs() * 1_000_000_000 + time.tv_nsec.unsigned_abs()
    };
    let monotonic_ns = ns(ClockId::Monotonic);
    ns(ClockId::Boottime).saturating_sub(monotonic_ns)
}

impl runtime::Process for Process {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        if let Some(time_ns) = self.suspended.since(ahead_ns()) {
            tracing::info!("the computer was suspended for {:.1} s", time_ns as f64 * 1e-9);
            self.session.add_unseen(time_ns);
        }
        let more = self.read(context)?;
        self.serve_clients(context)?;
        if context.stopping() {
            let now_ns = self.now_ns(context)?;
            self.feed(Input::Stop, now_ns)?;
            self.scans.end(self.session.seq(), self.stamp_ns)?;
            self.report(context);
            return Ok(Next::Finished);
        }
        let now_ns = self.now_ns(context)?;
        if self.port.is_none() {
            self.open(now_ns)?;
        }
        self.feed(Input::Tick, now_ns)?;
        self.report(context);
        Ok(if more { Next::Again } else { self.wait(now_ns) })
    }

    fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        self.port.iter().map(Port::descriptor).chain(self.sharing.share.descriptors()).collect()
    }
}

impl Process {
    /// Now: the deployment's clock, or time in the world of a simulated robot.
    fn now_ns(&mut self, context: &Context<'_>) -> Result<u64, StepError> {
        while let Some(received) = self.times.as_mut().map_or(Ok(None), Reader::take)? {
            if let Received::Message(time) = received {
                self.time = Some(*time);
            }
        }
        let clock_ns = context.now_ns();
        Ok(self.time.map_or(clock_ns, |time| time.at(clock_ns)))
    }

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
        // After the bytes: the world's time that a simulated robot's packet was sent at is there before the packet.
        let now_ns = self.now_ns(context)?;
        if count > 0 {
            if self.session.is_shared() {
                self.sharing.share.write(&bytes[..count]);
            }
            self.feed(Input::Bytes(&bytes[..count]), now_ns)?;
        }
        match end {
            Some(error) => self.vanish(&error.to_string(), now_ns)?,
            None if count == MOST_AT_ONCE => return Ok(true),
            None => {}
        }
        Ok(false)
    }

    /// Takes what programs on the shared ports have sent.
    fn serve_clients(&mut self, context: &Context<'_>) -> Result<(), StepError> {
        let now_ns = self.now_ns(context)?;
        self.sharing.retry(Instant::now());
        for shared in self.sharing.share.read(Instant::now()) {
            match shared {
                Shared::Command(data) => self.feed(Input::Client(&data), now_ns)?,
                Shared::Left => self.feed(Input::ClientLeft, now_ns)?,
                Shared::Remark(remark) => tracing::warn!("{remark}"),
            }
        }
        Ok(())
    }

    /// Tries to open the port. Without one the loop comes by a few times a second.
    fn open(&mut self, now_ns: u64) -> Result<(), StepError> {
        if self.opening.is_none() {
            let pause = if self.address.has_speed() { Duration::ZERO } else { RECONNECT };
            if self.opened.is_some_and(|opened| opened.elapsed() < pause) {
                return Ok(());
            }
            self.opened = Some(Instant::now());
        }
        let opening = self.opening.get_or_insert_with(|| Opening::start(&self.address, self.session.baud()));
        let Some(made) = opening.poll() else { return Ok(()) };
        self.opening = None;
        match made {
            Ok(port) => {
                let (address, baud) = (&self.address, self.session.baud());
                let speed = if baud == 0 { String::new() } else { format!(" at {baud} baud") };
                tracing::info!("opened {address}{speed}");
                self.port = Some(port);
                self.trouble = None;
                self.feed(Input::Opened, now_ns)
            }
            Err(error) => {
                self.report_trouble(error.to_string());
                Ok(())
            }
        }
    }

    fn report_trouble(&mut self, trouble: String) {
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
            true => tracing::debug!("{} is gone ({why}); waiting for it", self.address),
            false => tracing::warn!("{} is gone ({why}); waiting for it", self.address),
        }
        self.port = None;
        self.feed(Input::Vanished, now_ns)
    }

    /// Tells the session what happened and does what it wants.
    fn feed(&mut self, input: Input<'_>, now_ns: u64) -> Result<(), StepError> {
        let mut gone = None;
        for output in self.session.step(input, now_ns) {
            match output {
                Output::Send(command) => gone = gone.or(self.send(&command.packet())),
                Output::Forward(packet) => gone = gone.or(self.send(&packet)),
                Output::Baud(baud) => self.tolerate("set the baud rate of", |port| port.set_baud(baud)),
                Output::Flush => self.tolerate("flush", |port| port.flush()),
                Output::Reopen => self.port = None,
                Output::Publish(saved) => self.publish(&saved)?,
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
    fn send(&mut self, packet: &[u8]) -> Option<String> {
        match self.port.as_mut()?.send(packet) {
            Ok(true) => None,
            Ok(false) => {
                tracing::debug!("{packet:02x?} is lost: the line takes no bytes");
                None
            }
            Err(error) => Some(error.to_string()),
        }
    }

    /// A device that refuses a setting may still carry bytes; if not, the time limits find out.
    fn tolerate(&mut self, what: &str, setting: impl FnOnce(&mut Port) -> serialport::Result<()>) {
        if let Some(Err(error)) = self.port.as_mut().map(setting) {
            tracing::warn!("cannot {what} {}: {error}", self.address);
        }
    }

    fn publish(&mut self, saved: &Checkpoint) -> Result<(), StepError> {
        // Before the scan leaves: after a kill at any moment no number is given twice.
        self.checkpoint.save(saved.as_bytes());
        self.stamp_ns = saved.stamp_ns;
        Ok(self.scans.send(saved.seq, saved.stamp_ns, &saved.scan)?)
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
            None => context.note(&self.session.note(&self.address.to_string())),
        }
        let (link, refusals, rhythm) = (self.session.link(), self.session.refusals(), self.session.rhythm());
        let (forwarded, not_forwarded) = self.session.client_commands();
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
            ("forwarded commands", forwarded),
            ("refused commands", not_forwarded),
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
    fn a_suspension_counts_once() {
        const S: u64 = 1_000_000_000;
        let mut suspended = Suspended { ahead_ns: 5 * S };
        assert_eq!(suspended.since(5 * S + 999), None, "the time between two readings");
        assert_eq!(suspended.since(12 * S), Some(7 * S));
        assert_eq!(suspended.since(12 * S), None);
        assert_eq!(suspended.since(4 * S), None);
    }

    #[test]
    fn default_settings_are_the_drivers_default_parameters() {
        assert_eq!(parameters(&settings::Robot::default(), &settings::Pioneer::default()), Parameters::default());
    }
}
