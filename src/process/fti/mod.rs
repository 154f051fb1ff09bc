//! The process around FTI: scans and what moves from the bus, verdicts onto it.

mod missed;
mod parameters;

use std::time::{Duration, Instant};

use bus::{BusError, Reader, Received, Recent, Writer};
use messages::{CameraMotion, FilterVerdict, Replay, SonarMotion, SonarScan, VerdictOutlook, Walkers, seconds};
use runtime::{Checkpoint, Context, Next, PartKey, Parts, Process, RunError, Shell, Snapshot, StepError};
use serde::{Deserialize, Serialize};
use settings::{BuiltIn, Pace, Settings};

use ::fti::{Fti, Input, Parameters, ParametersError, StateError};

use missed::{Missed, News};
pub(crate) use parameters::parameters;

/// Most messages taken of each stream in one round, so that the heartbeat is never late.
const TAKEN_PER_ROUND: usize = 128;
/// Shortest time between two outlooks: the map that is shown is made anew no more often.
const OUTLOOK_PERIOD: Duration = Duration::from_millis(90);
/// A stream this much older than the newest scan is missed, s of the wall clock.
const MISSED_S: f64 = 1.0;
/// How long after the last scan the other streams are waited for, live.
const STRAGGLERS: Duration = Duration::from_millis(500);

/// How FTI ended that should not have.
#[derive(Debug, thiserror::Error)]
pub enum FtiError {
    /// The settings make no FTI.
    #[error("[fti]: {0}")]
    Parameters(#[from] ParametersError),
    /// A service cannot be used.
    #[error("{0}")]
    Bus(#[from] BusError),
    /// The work loop failed.
    #[error("{0}")]
    Run(#[from] RunError),
}

/// Gives verdicts until the scans end or the process is asked to stop.
///
/// # Errors
/// Settings that make no FTI, or a bus that fails.
pub fn run(mut shell: Shell, settings: &Settings) -> Result<(), FtiError> {
    let mut integration = Integration::new(&mut shell, settings)?;
    Ok(shell.run(&mut integration)?)
}

/// What the state includes: the last message of each stream, the time of the first scan, and the times of the last
/// messages.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Place {
    scan: u64,
    sonar: u64,
    camera: u64,
    first_ns: u64,
    scan_ns: u64,
    sonar_ns: u64,
    camera_ns: u64,
    /// Number and time of the last scan that has its verdict.
    decided: (u64, u64),
}

#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    withheld: u64,
    verdicts: u64,
    sonar_only: u64,
    blind: u64,
}

struct Integration {
    fti: Fti,
    scans: Reader<SonarScan>,
    sonar: Reader<SonarMotion>,
    /// `None` where no camera is expected.
    camera: Option<Reader<CameraMotion>>,
    verdicts: Writer<FilterVerdict>,
    recent: Recent<FilterVerdict>,
    walkers: Writer<Walkers>,
    outlook: Writer<VerdictOutlook>,
    checkpoint: Checkpoint,
    place: Place,
    /// Last scan that the checkpoint includes.
    checkpointed: u64,
    /// The head of the last checkpoint: the next one takes its memory.
    saved: Vec<u8>,
    lockstep: bool,
    scans_ended_at: Option<Instant>,
    shown_at: Option<Instant>,
    /// Something came that the last outlook does not tell of.
    news: bool,
    /// Whether the motion of sonars and camera is missed.
    missed: [Missed; 2],
    /// A stream this much older than the newest scan is missed, ns of sensor time.
    missed_after_ns: u64,
    counts: Counts,
}

impl Process for Integration {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        let more = self.take_inputs()?;
        self.advance()?;
        context.answered::<SonarScan>(self.fti.last_scan().map_or(0, |(seq, _)| seq));
        if self.place.scan >= self.checkpointed + Replay::SCANS.checkpoint || self.checkpoint.is_missing() {
            self.save()?;
        }
        self.say(context, more);
        if more {
            return Ok(Next::Again);
        }
        if context.stopping() || self.is_over() {
            return self.finish();
        }
        self.show()
    }
}

impl Integration {
    fn new(shell: &mut Shell, settings: &Settings) -> Result<Self, FtiError> {
        let speed = shell.membership().speed().max(1.0);
        let parameters = parameters(settings, speed);
        let with_camera = parameters.camera.is_some();
        let checkpoint = shell.checkpoint();
        let restored = checkpoint.restore(|saved| restore(parameters.clone(), saved));
        let (fti, place, recent) = match restored {
            Some(restored) => restored,
            None => (Fti::new(parameters)?, Place::default(), Recent::default()),
        };
        if place.scan > 0 {
            tracing::info!("goes on after scan {}", place.scan);
        }
        let mut verdicts = shell.writer()?;
        recent.republish(&mut verdicts)?;
        shell.linger_until(settings.named(BuiltIn::Mapping));
        let mut scans = shell.reader::<SonarScan>()?;
        scans.skip_to(place.scan, place.scan_ns);
        let mut sonar = shell.reader::<SonarMotion>()?;
        sonar.skip_to(place.sonar, place.sonar_ns);
        let camera = if with_camera {
            let mut camera = shell.reader::<CameraMotion>()?;
            camera.skip_to(place.camera, place.camera_ns);
            Some(camera)
        } else {
            None
        };
        Ok(Self {
            scans,
            sonar,
            camera,
            verdicts,
            recent,
            walkers: shell.writer()?,
            outlook: shell.writer()?,
            checkpoint,
            place,
            checkpointed: place.scan,
            saved: Vec::new(),
            lockstep: settings.pace == Pace::Lockstep,
            scans_ended_at: None,
            shown_at: None,
            news: true,
            missed: [Missed::default(); 2],
            missed_after_ns: (MISSED_S * speed * 1e9) as u64,
            counts: Counts::default(),
            fti,
        })
    }

    /// Takes what waits, up to a round's share; true when there may be more.
    fn take_inputs(&mut self) -> Result<bool, StepError> {
        // Scans last: after a delay they would else seem to have come without the rest.
        let more = self.take_up_to(Self::take_camera)? | self.take_up_to(Self::take_sonar)?;
        Ok(more | self.take_up_to(Self::take_scan)?)
    }

    fn take_up_to(&mut self, take: fn(&mut Self) -> Result<bool, StepError>) -> Result<bool, StepError> {
        for _ in 0..TAKEN_PER_ROUND {
            if !take(self)? {
                return Ok(false);
            }
            self.news = true;
        }
        Ok(true)
    }

    fn take_scan(&mut self) -> Result<bool, StepError> {
        match self.scans.take()? {
            None => return Ok(false),
            Some(Received::Message(scan)) => {
                (self.place.scan, self.place.scan_ns) = (scan.seq(), scan.stamp_ns());
                if self.place.first_ns == 0 {
                    self.place.first_ns = scan.stamp_ns();
                }
                self.fti.take(Input::Scan { seq: scan.seq(), stamp_ns: scan.stamp_ns(), scan: &scan });
            }
            Some(Received::End { .. }) => {
                self.scans_ended_at = Some(Instant::now());
                self.fti.take(Input::ScansEnded);
            }
        }
        Ok(true)
    }

    fn take_sonar(&mut self) -> Result<bool, StepError> {
        match self.sonar.take()? {
            None => {
                self.fti.take(Input::SonarPassed { seq: self.sonar.passed() });
                return Ok(false);
            }
            Some(Received::Message(motion)) => {
                (self.place.sonar, self.place.sonar_ns) = (motion.seq(), motion.stamp_ns());
                self.fti.take(Input::Sonar { seq: motion.seq(), motion: &motion });
            }
            Some(Received::End { .. }) => self.fti.take(Input::SonarEnded),
        }
        Ok(true)
    }

    fn take_camera(&mut self) -> Result<bool, StepError> {
        let Some(camera) = &mut self.camera else { return Ok(false) };
        match camera.take()? {
            None => return Ok(false),
            Some(Received::Message(motion)) => {
                (self.place.camera, self.place.camera_ns) = (motion.seq(), motion.stamp_ns());
                self.fti.take(Input::Camera { stamp_ns: motion.stamp_ns(), motion: &motion });
            }
            Some(Received::End { .. }) => self.fti.take(Input::CameraEnded),
        }
        Ok(true)
    }

    /// Integrates the scans that can be, and sends the verdicts that are due.
    fn advance(&mut self) -> Result<(), StepError> {
        let mut verdicts = Vec::new();
        while self.fti.advance(&mut verdicts) {
            if let Some((seq, stamp_ns)) = self.fti.last_scan() {
                self.walkers.send(seq, stamp_ns, &self.fti.walkers())?;
            }
        }
        for given in verdicts {
            self.counts.verdicts += 1;
            self.counts.withheld += u64::from(given.verdict.withheld.count_ones());
            self.counts.sonar_only += u64::from(given.verdict.inputs & FilterVerdict::FROM_CAMERA == 0);
            self.counts.blind += u64::from(given.verdict.inputs == 0);
            self.recent.note(given.seq, given.stamp_ns, &given.verdict);
            self.verdicts.send(given.seq, given.stamp_ns, &given.verdict)?;
            self.place.decided = (given.seq, given.stamp_ns);
        }
        Ok(())
    }

    /// Sends the verdicts to come as they stand, when something came and it is time.
    fn show(&mut self) -> Result<Next, StepError> {
        if !self.news {
            return Ok(Next::Wait);
        }
        let due_in = self.shown_at.map_or(Duration::ZERO, |at| OUTLOOK_PERIOD.saturating_sub(at.elapsed()));
        if due_in.is_zero() {
            self.outlook.send(self.place.scan, self.place.scan_ns, &self.fti.outlook())?;
            self.shown_at = Some(Instant::now());
            self.news = false;
            return Ok(Next::Wait);
        }
        Ok(Next::WaitAtMost(due_in))
    }

    /// Whether every verdict has been given, or what is missing does not come any more.
    fn is_over(&self) -> bool {
        let waited = self.scans_ended_at.is_some_and(|at| at.elapsed() >= STRAGGLERS);
        self.fti.is_over() || !self.lockstep && waited
    }

    /// Decides what is pending with what is there. Saved before: should the end fail, the next incarnation goes on from there.
    fn finish(&mut self) -> Result<Next, StepError> {
        self.save()?;
        for end in [Input::SonarEnded, Input::CameraEnded, Input::ScansEnded] {
            self.fti.take(end);
        }
        self.advance()?;
        let (seq, stamp_ns) = self.place.decided;
        self.verdicts.end(seq, stamp_ns)?;
        self.walkers.end(self.place.scan, self.place.scan_ns)?;
        Ok(Next::Finished)
    }

    fn save(&mut self) -> Result<(), StepError> {
        let mut bytes = std::mem::take(&mut self.saved);
        bytes.clear();
        let bytes = postcard::to_extend(&(self.place, self.recent.to_bytes()), bytes)?;
        self.saved = self.fti.save_head(bytes);
        self.checkpoint.save_parts(&self.saved, &mut Tiles(&mut self.fti));
        self.checkpointed = self.place.scan;
        Ok(())
    }

    /// Says what is missed, once when it begins and once when it is over, and what was done.
    fn say(&mut self, context: &mut Context<'_>, more_waits: bool) {
        let Place { first_ns, scan_ns, sonar_ns, camera_ns, .. } = self.place;
        let late = |stream_ns: u64| {
            self.scans_ended_at.is_none() && scan_ns.saturating_sub(stream_ns.max(first_ns)) > self.missed_after_ns && !self.lockstep
        };
        let missing = [late(sonar_ns), self.camera.is_some() && late(camera_ns)];
        // What waits may be what is missed.
        let known = self.missed.iter_mut().zip(missing).filter(|_| !more_waits);
        for ((missed, is_late), what) in known.zip(["sonar motion", "camera motion"]) {
            match missed.look(is_late, context.elapsed_s(), seconds(self.missed_after_ns)) {
                Some(News::Missed) => tracing::warn!("no {what}: verdicts rest on what is left"),
                Some(News::Back) => tracing::info!("{what} is there again"),
                None => {}
            }
        }
        match self.missed.map(|missed| missed.since_s()) {
            [None, None] if self.camera.is_none() => context.note("sonar only"),
            [None, None] => context.note("sonar and camera"),
            [None, Some(since)] => context.note(&format!("sonar only since {since:.1} s: no camera motion")),
            [Some(since), None] => context.note(&format!("no sonar motion since {since:.1} s")),
            [Some(sonar), Some(camera)] => {
                context.note(&format!("neither sonar motion (since {sonar:.1} s) nor camera motion (since {camera:.1} s)"));
            }
        }
        context.count("verdicts", self.counts.verdicts);
        context.count("readings withheld", self.counts.withheld);
        context.count("verdicts from sonar only", self.counts.sonar_only);
        context.count("verdicts from nothing", self.counts.blind);
    }
}

/// The tiles of the state as parts of a checkpoint.
struct Tiles<'a>(&'a mut Fti);

impl Parts for Tiles<'_> {
    fn take_changed(&mut self) -> Vec<PartKey> {
        self.0.take_unsaved()
    }

    fn all(&self) -> Vec<PartKey> {
        self.0.saved_tiles()
    }

    fn write(&self, key: PartKey, bytes: &mut Vec<u8>) {
        self.0.save_tile(key, bytes);
    }
}

fn restore(parameters: Parameters, saved: &Snapshot<'_>) -> Result<(Fti, Place, Recent<FilterVerdict>), StateError> {
    let ((place, recent), head) = postcard::take_from_bytes::<(Place, Vec<u8>)>(saved.state)?;
    let recent = Recent::from_bytes(&recent).ok_or(postcard::Error::DeserializeBadEncoding)?;
    let mut fti = Fti::restore(parameters, head, saved.parts.iter().map(|(key, part)| (*key, *part)))?;
    if saved.before_a_stop {
        fti.reopen();
    }
    Ok((fti, place, recent))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bus::Domain;

    #[test]
    fn what_is_to_come_is_said_when_something_came_and_never_again() {
        let domain = Domain::open(&format!("test-fti-{}", std::process::id()), 1.0).unwrap();
        let shell = |process| Shell::join(domain.membership_for(process, 0, "settings.toml".as_ref())).unwrap();
        let (mut source, mut fti, mut viewer) = (shell("pioneer"), shell("fti"), shell("viewer"));
        let mut scans = source.writer::<SonarScan>().unwrap();
        let mut outlooks = viewer.reader::<VerdictOutlook>().unwrap();
        let mut integration = Integration::new(&mut fti, &Settings::default()).unwrap();
        let mut said = |integration: &mut Integration| {
            integration.take_inputs().unwrap();
            // Whatever was shown last is long ago.
            integration.shown_at = None;
            integration.show().unwrap();
            let mut count = 0;
            while let Some(received) = outlooks.take().unwrap() {
                count += usize::from(matches!(received, Received::Message(_)));
            }
            count
        };
        assert_eq!((said(&mut integration), said(&mut integration)), (1, 0), "what was restored, once");
        scans.send(1, 1, &SonarScan::default()).unwrap();
        assert_eq!((said(&mut integration), said(&mut integration)), (1, 0));
        drop((integration, scans, outlooks, source, fti, viewer));
        domain.close().unwrap();
    }
}
