//! The process around FTI: scans and what moves in, verdicts out.

mod missed;
mod parameters;

use std::time::{Duration, Instant};

use bus::{BusError, Reader, Received, Writer};
use messages::{CameraMotion, FilterVerdict, Payload, Service, SonarMotion, SonarScan, StreamCursor, VerdictOutlook, Walkers, seconds};
use runtime::{Answers, Checkpoint, Context, Fold, Next, PartKey, Parts, Recent, RunError, Settling, Shell, Snapshot, StepError, run_fold};
use serde::{Deserialize, Serialize};
use settings::{BuiltIn, Pace, Settings};
use state::{Schema, encode, take};

use ::fti::{Fti, Input, Parameters, ParametersError, StateError};

use missed::{Missed, News};
pub(crate) use parameters::parameters;

/// Motions of the camera between two checkpoints at most, as the registry says. A killed process needs those after its last checkpoint
/// again, and the history of the stream has to hold them.
const MOTIONS_PER_CHECKPOINT: u64 = match CameraMotion::SERVICE.replay {
    Some(replay) => replay.checkpoint,
    None => panic!("camera motion is played back"),
};
/// Shortest time between two outlooks: no faster than the displayed map is updated.
const OUTLOOK_PERIOD: Duration = Duration::from_millis(90);
/// A stream this much older than the newest scan is missed, s of the wall clock.
const MISSED_S: f64 = 1.0;
/// How long after the last scan the other streams are waited for, live.
const STRAGGLERS: Duration = Duration::from_millis(500);

/// An error that ends FTI.
#[derive(Debug, thiserror::Error)]
pub enum FtiError {
    /// The settings are out of range.
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
/// Settings out of range, or a bus that fails.
pub fn run(mut shell: Shell, settings: &Settings) -> Result<(), FtiError> {
    let checkpoint = shell.checkpoint();
    let mut integration = Integration::new(&mut shell, &checkpoint, settings)?;
    shell.linger_until(settings.named(BuiltIn::Mapping));
    shell.linger_until_recorded(settings.named(BuiltIn::Recorder), &[FilterVerdict::SERVICE]);
    Ok(run_fold(shell, checkpoint, &mut integration)?)
}

/// The last message of each input that the state includes.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, Schema)]
struct Cursors {
    scan: StreamCursor,
    sonar: StreamCursor,
    camera: StreamCursor,
    /// Stamp of the first scan.
    first_ns: u64,
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
    verdicts: Answers<FilterVerdict>,
    walkers: Writer<Walkers>,
    outlook: Writer<VerdictOutlook>,
    received: Cursors,
    settling: Settling,
    /// Last motion of the camera that the checkpoint includes.
    saved_camera: u64,
    /// Memory of the head of the last checkpoint, which the next one reuses.
    buffer: Vec<u8>,
    lockstep: bool,
    scans_ended_at: Option<Instant>,
    shown_at: Option<Instant>,
    /// Input came that the last outlook does not include.
    news: bool,
    /// Whether the motion of sonars and camera is missed.
    missed: [Missed; 2],
    /// A stream this much older than the newest scan is missed, ns of sensor time.
    missed_after_ns: u64,
    counts: Counts,
}

impl Fold for Integration {
    const SOURCE: Service = SonarScan::SERVICE;

    /// A scan comes last: after a delay it would otherwise seem to have come without the motion that waits behind it.
    fn take(&mut self) -> Result<bool, StepError> {
        let taken = self.take_camera()? || self.take_sonar()? || self.take_scan()?;
        self.news |= taken;
        if self.settling.is_over_now() {
            self.fti.be_patient(false);
        }
        self.advance()?;
        Ok(taken)
    }

    fn received(&self) -> StreamCursor {
        self.received.scan
    }

    fn answered(&self) -> u64 {
        self.fti.last_scan().map_or(0, |scan| scan.seq)
    }

    fn must_save(&self) -> bool {
        self.received.camera.seq >= self.saved_camera + MOTIONS_PER_CHECKPOINT
    }

    /// Whether every verdict has been given, or no stream that is missing is waited for any longer.
    fn is_complete(&self) -> bool {
        let waited = self.scans_ended_at.is_some_and(|at| at.elapsed() >= STRAGGLERS);
        self.fti.is_over() || !self.lockstep && waited
    }

    fn save(&mut self, checkpoint: &mut Checkpoint) -> Result<(), StepError> {
        let mut bytes = std::mem::take(&mut self.buffer);
        bytes.clear();
        let bytes = encode(self.verdicts.recent(), encode(&self.received, bytes));
        self.buffer = self.fti.save_head(bytes);
        checkpoint.save_parts(&self.buffer, &mut Tiles(&mut self.fti));
        self.saved_camera = self.received.camera.seq;
        Ok(())
    }

    /// Publishes the verdicts to come as they stand, when input came and the period is over.
    fn publish(&mut self, more: bool) -> Result<Next, StepError> {
        if more || !self.news {
            return Ok(Next::Wait);
        }
        let due_in = self.shown_at.map_or(Duration::ZERO, |at| OUTLOOK_PERIOD.saturating_sub(at.elapsed()));
        if !due_in.is_zero() {
            return Ok(Next::WaitAtMost(due_in));
        }
        let StreamCursor { seq, stamp_ns } = self.received.scan;
        self.outlook.send(seq, stamp_ns, &self.fti.outlook())?;
        self.shown_at = Some(Instant::now());
        self.news = false;
        Ok(Next::Wait)
    }

    /// Decides what is pending by what has come.
    fn end(&mut self) -> Result<(), StepError> {
        for end in [Input::SonarEnded, Input::CameraEnded, Input::ScansEnded] {
            self.fti.take(end);
        }
        self.news = false;
        self.advance()
    }

    fn finish(&mut self, _: &Context<'_>) -> Result<Next, StepError> {
        self.verdicts.end()?;
        self.walkers.end(self.received.scan.seq, self.received.scan.stamp_ns)?;
        Ok(Next::Finished)
    }

    fn report(&mut self, context: &mut Context<'_>, more: bool) {
        // A stream that waits to be taken is not missed.
        if !more {
            self.look_for_missed(context.elapsed_s());
        }
        if self.camera.is_some() {
            context.answered::<CameraMotion>(self.received.camera.seq);
        }
        context.note(&self.note());
        context.count("verdicts", self.counts.verdicts);
        context.count("readings withheld", self.counts.withheld);
        context.count("verdicts from sonar only", self.counts.sonar_only);
        context.count("verdicts from nothing", self.counts.blind);
    }
}

impl Integration {
    fn new(shell: &mut Shell, checkpoint: &Checkpoint, settings: &Settings) -> Result<Self, FtiError> {
        let speed = shell.membership().speed().max(1.0);
        let parameters = parameters(settings, speed);
        let with_camera = parameters.camera.is_some();
        let restored = checkpoint.restore(|saved| restore(parameters.clone(), saved));
        let (mut fti, received, recent) = match restored {
            Some(restored) => restored,
            None => (Fti::new(parameters)?, Cursors::default(), Recent::default()),
        };
        if received.scan.seq > 0 {
            tracing::info!("resumes after scan {}", received.scan.seq);
        }
        fti.be_patient(true);
        let verdicts = Answers::new(shell, recent)?;
        let scans = reader_after(shell, received.scan)?;
        let sonar = reader_after(shell, received.sonar)?;
        let camera = if with_camera { Some(reader_after(shell, received.camera)?) } else { None };
        Ok(Self {
            scans,
            sonar,
            camera,
            verdicts,
            walkers: shell.writer()?,
            outlook: shell.writer()?,
            received,
            settling: Settling::begin(),
            saved_camera: received.camera.seq,
            buffer: Vec::new(),
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

    fn take_scan(&mut self) -> Result<bool, StepError> {
        match self.scans.take()? {
            None => return Ok(false),
            Some(Received::Message(scan)) => {
                self.received.scan = scan.cursor();
                if self.received.first_ns == 0 {
                    self.received.first_ns = scan.stamp_ns();
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
                self.received.sonar = motion.cursor();
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
                self.received.camera = motion.cursor();
                self.fti.take(Input::Camera { stamp_ns: motion.stamp_ns(), motion: &motion });
            }
            Some(Received::End { .. }) => self.fti.take(Input::CameraEnded),
        }
        Ok(true)
    }

    /// Integrates the scans that can be, and publishes the verdicts that are due.
    fn advance(&mut self) -> Result<(), StepError> {
        let mut verdicts = Vec::new();
        while self.fti.advance(&mut verdicts) {
            if let Some(StreamCursor { seq, stamp_ns }) = self.fti.last_scan() {
                self.walkers.send(seq, stamp_ns, &self.fti.walkers())?;
            }
        }
        for given in verdicts {
            self.counts.verdicts += 1;
            self.counts.withheld += u64::from(given.verdict.withheld.count_ones());
            self.counts.sonar_only += u64::from(given.verdict.inputs & FilterVerdict::FROM_CAMERA == 0);
            self.counts.blind += u64::from(given.verdict.inputs == 0);
            self.verdicts.publish(StreamCursor { seq: given.seq, stamp_ns: given.stamp_ns }, &given.verdict)?;
        }
        Ok(())
    }

    /// Logs once when a stream is missed and once when it is back.
    fn look_for_missed(&mut self, now_s: f64) {
        let Cursors { first_ns, scan, sonar, camera } = self.received;
        let late = |stream: StreamCursor| {
            let behind_ns = scan.stamp_ns.saturating_sub(stream.stamp_ns.max(first_ns));
            self.scans_ended_at.is_none() && behind_ns > self.missed_after_ns && !self.lockstep
        };
        let missing = [late(sonar), self.camera.is_some() && late(camera)];
        for ((missed, is_late), what) in self.missed.iter_mut().zip(missing).zip(["sonar motion", "camera motion"]) {
            match missed.look(is_late, now_s, seconds(self.missed_after_ns)) {
                Some(News::Missed) => tracing::warn!("no {what}: verdicts rest on what is left"),
                Some(News::Back) => tracing::info!("{what} is back"),
                None => {}
            }
        }
    }

    /// What the verdicts rest on.
    fn note(&self) -> String {
        match self.missed.map(|missed| missed.since_s()) {
            [None, None] if self.camera.is_none() => "sonar only".to_owned(),
            [None, None] => "sonar and camera".to_owned(),
            [None, Some(since)] => format!("sonar only since {since:.1} s: no camera motion"),
            [Some(since), None] => format!("no sonar motion since {since:.1} s"),
            [Some(sonar), Some(camera)] => {
                format!("neither sonar motion (since {sonar:.1} s) nor camera motion (since {camera:.1} s)")
            }
        }
    }
}

fn reader_after<T: Payload>(shell: &mut Shell, received: StreamCursor) -> Result<Reader<T>, BusError> {
    let mut reader = shell.reader()?;
    reader.skip_to(received.seq, received.stamp_ns);
    Ok(reader)
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

fn restore(parameters: Parameters, saved: &Snapshot<'_>) -> Result<(Fti, Cursors, Recent<FilterVerdict>), StateError> {
    let (received, rest) = take(saved.state)?;
    let (recent, head) = take(rest)?;
    let mut fti = Fti::restore(parameters, head, saved.parts.iter().map(|(key, part)| (*key, *part)))?;
    if saved.before_a_stop {
        fti.reopen();
    }
    Ok((fti, received, recent))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bus::Domain;

    #[test]
    fn the_outlook_is_published_once_after_each_input() {
        let domain = Domain::open(&format!("test-fti-{}", std::process::id()), 1.0).unwrap();
        let shell = |process| Shell::join(domain.membership_for(process, 0, "settings.toml".as_ref())).unwrap();
        let (mut source, mut fti, mut viewer) = (shell("pioneer"), shell("fti"), shell("viewer"));
        let mut scans = source.writer::<SonarScan>().unwrap();
        let mut outlooks = viewer.reader::<VerdictOutlook>().unwrap();
        let checkpoint = fti.checkpoint();
        let mut integration = Integration::new(&mut fti, &checkpoint, &Settings::default()).unwrap();
        let mut published = |integration: &mut Integration| {
            while integration.take().unwrap() {}
            // The last outlook was published long ago.
            integration.shown_at = None;
            integration.publish(false).unwrap();
            let mut count = 0;
            while let Some(received) = outlooks.take().unwrap() {
                count += usize::from(matches!(received, Received::Message(_)));
            }
            count
        };
        assert_eq!((published(&mut integration), published(&mut integration)), (1, 0), "what was restored, once");
        scans.send(1, 1, &SonarScan::default()).unwrap();
        assert_eq!((published(&mut integration), published(&mut integration)), (1, 0));
        drop((integration, scans, outlooks, source, fti, viewer));
        domain.close().unwrap();
    }
}
