//! The pace of a simulated world: no faster than the deployment's clock, and no further ahead than its consumers can follow.
//!
//! A simulated robot has no reason to outrun the processes that map its drive. So time in the world stands until the driver has made
//! a scan of each packet, SBS has answered each picture, and the consumers of the scans are close behind. The driver stamps with time
//! in the world: a drive gives the same scans at any speed and load.

use std::time::{Duration, Instant};

use ::playback::{Answers, Consumer};
use bus::{BusError, Reader, Received, Writer};
use messages::{CameraFrame, DeploymentStatus, Payload, Pictures, Progress, SimulatedTime, SonarScan};
use runtime::Shell;
use settings::{BuiltIn, Port, Settings};

/// How many scans a consumer may be behind. The consumers work at the same time, a picture is answered in less than four packets, and
/// 0.4 s are within every patience for a process that lags.
const SCANS_BEHIND: u64 = 4;

/// How long, by the wall clock, a packet that the driver has read may remain without a scan: a driver refuses some packets, and one
/// that is killed loses what it has read.
const SCAN_WITHIN: Duration = Duration::from_millis(250);

/// How long, by the wall clock, one consumer may hold the world. The supervisor restarts a process that hangs within seconds; one that
/// runs and does not answer is left behind.
const PATIENCE: Duration = Duration::from_secs(30);

/// What the world waits for.
pub(super) struct Pace {
    times: Writer<SimulatedTime>,
    scans: Reader<SonarScan>,
    progress: Reader<Progress>,
    statuses: Reader<DeploymentStatus>,
    drivers: Vec<String>,
    scan_answers: Answers,
    frame_answers: Answers,
    /// Number and stamp of the last scan.
    last_scan: (u64, u64),
    /// Number of the last picture that this process has sent.
    last_frame: Option<u64>,
    /// Stamp of the last packet, and when it was sent, until the driver has made a scan of it.
    packet: Option<(u64, Instant)>,
    /// Since when the world stands.
    held_since: Option<Instant>,
    /// Times that the world's time was published.
    published: u64,
}

impl Pace {
    /// The pace of the settings' deployment; `None` where the world follows the clock alone: the driver is not part of the deployment,
    /// or an injector disturbs the streams.
    pub(super) fn new(shell: &mut Shell, settings: &Settings) -> Result<Option<Self>, BusError> {
        let drives = settings.runs(BuiltIn::Pioneer) && settings.pioneer.port == Port::Simulator;
        if !drives || !settings.routed_services().is_empty() {
            return Ok(None);
        }
        // Each of the kinds waits for the answers of those before it.
        let consumers = |kinds: &[BuiltIn], reports_on| {
            let named = (0..).zip(kinds).flat_map(|(depth, kind)| settings.named(*kind).map(move |name| (depth, name)));
            let named = named.collect::<Vec<(u8, String)>>();
            Answers::new(named.into_iter().map(|(depth, name)| Consumer { name, ends_itself: true, depth, reports_on }))
        };
        let pictures: &[BuiltIn] = if settings.simulator.camera.provides == settings::Provides::Pictures { &[BuiltIn::Sbs] } else { &[] };
        Ok(Some(Self {
            times: shell.writer()?,
            scans: shell.reader()?,
            progress: shell.reader()?,
            statuses: shell.reader()?,
            drivers: settings.named(BuiltIn::Pioneer).collect(),
            scan_answers: consumers(&[BuiltIn::Std, BuiltIn::Localisation, BuiltIn::Fti, BuiltIn::Mapping], SonarScan::SERVICE.name),
            frame_answers: consumers(pictures, CameraFrame::SERVICE.name),
            last_scan: (0, 0),
            last_frame: None,
            packet: None,
            held_since: None,
            published: 0,
        }))
    }

    /// Time in the world is `now_ns` and runs with the clock, which shows `clock_ns`.
    pub(super) fn run_from(&mut self, now_ns: u64, clock_ns: u64) -> Result<(), BusError> {
        self.packet = None;
        self.publish(SimulatedTime { now_ns, since_ns: clock_ns, runs: 1, reserved: 0 })
    }

    /// Time in the world is `now_ns`, and stands. A packet follows at once if `has_packet`.
    pub(super) fn stand_at(&mut self, now_ns: u64, has_packet: bool) -> Result<(), BusError> {
        self.packet = has_packet.then(|| (now_ns, Instant::now()));
        self.publish(SimulatedTime { now_ns, since_ns: now_ns, runs: 0, reserved: 0 })
    }

    fn publish(&mut self, time: SimulatedTime) -> Result<(), BusError> {
        self.published += 1;
        self.times.send(self.published, time.now_ns, &time)
    }

    /// This picture has been sent.
    pub(super) fn frame_sent(&mut self, seq: u64) {
        self.last_frame = Some(seq);
    }

    /// Takes what the consumers and the supervisor report.
    pub(super) fn listen(&mut self) -> Result<(), BusError> {
        while let Some(received) = self.scans.take()? {
            if let Received::Message(scan) = received {
                self.last_scan = (scan.seq(), scan.stamp_ns());
            }
        }
        while let Some(received) = self.progress.take()? {
            if let Received::Message(progress) = received {
                let Progress { process, service, answered } = &*progress;
                for answers in [&mut self.scan_answers, &mut self.frame_answers] {
                    answers.answered(process.as_str(), service.as_str(), *answered);
                }
            }
        }
        while let Some(received) = self.statuses.take()? {
            if let Received::Message(status) = received {
                status.processes().iter().filter(|it| it.is_over()).for_each(|it| self.leave_behind(it.process.as_str()));
            }
        }
        Ok(())
    }

    /// Whether the world may advance. `is_read` tells whether the driver has read all that was sent to it.
    pub(super) fn has_room(&mut self, is_read: bool) -> bool {
        let Some(slowest) = self.slowest(is_read) else {
            self.held_since = None;
            return true;
        };
        if self.held_since.get_or_insert_with(Instant::now).elapsed() >= PATIENCE {
            tracing::warn!("{slowest} has not answered for {} s: the drive does not wait for it any more", PATIENCE.as_secs());
            self.leave_behind(&slowest);
            self.held_since = None;
        }
        false
    }

    /// The process that the world waits for, if any.
    fn slowest(&mut self, is_read: bool) -> Option<String> {
        if let Some((stamp_ns, sent)) = self.packet
            && (self.last_scan.1 >= stamp_ns || is_read && sent.elapsed() >= SCAN_WITHIN)
        {
            self.packet = None;
        }
        if let (Some(_), Some(driver)) = (self.packet, self.drivers.first()) {
            return Some(driver.clone());
        }
        // Before the first message no consumer is behind.
        let behind = |answers: &Answers, least: u64| answers.behind(least).filter(|_| least > 0).map(|behind| behind.name.to_owned());
        behind(&self.frame_answers, self.last_frame.unwrap_or_default())
            .or_else(|| behind(&self.scan_answers, self.last_scan.0.saturating_sub(SCANS_BEHIND)))
    }

    /// For the status: what the world waits for, once that takes longer than a moment.
    pub(super) fn waits_for(&mut self, is_read: bool) -> Option<String> {
        self.held_since.filter(|held_since| held_since.elapsed() >= Duration::from_secs(1))?;
        self.slowest(is_read)
    }

    fn leave_behind(&mut self, process: &str) {
        self.drivers.retain(|driver| driver != process);
        self.scan_answers.over(process);
        self.frame_answers.over(process);
    }
}
