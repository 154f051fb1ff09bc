//! The process around the mapper: scans and verdicts from the bus, tiles to it, files at the end.

mod parameters;

use std::path::PathBuf;
use std::time::{Duration, Instant};

use bus::{BusError, Reader, Received, Writer};
use messages::{FilterVerdict, Layer, MapSummary, MapTile, Replay, SonarScan, VerdictOutlook, WayChunk};
use runtime::{Checkpoint, Context, Next, PartKey, Parts, Process, RunError, Shell, StepError};
use settings::{Pace, Settings};

use ::mapping::export::MapCopy;
use ::mapping::{Input, Mapper, ParametersError, Refused, write_files};

pub(crate) use parameters::parameters;

/// Most messages taken in one round, so that the heartbeat is never late.
const TAKEN_PER_ROUND: usize = 256;
/// Most tiles sent in one round: a fraction of a reader's buffer, which it has time to empty before the next.
const TILES_PER_ROUND: usize = 64;
/// Most pieces of the way sent in one round.
const WAY_CHUNKS_PER_ROUND: usize = 16;
/// Time between two rounds of sending as long as tiles wait.
const SENDING_PAUSE: Duration = Duration::from_millis(5);
/// Shortest time between two looks at what has changed: a little less than the period of a robot's scans, so that live each is
/// shown at once, while a fast replay sends no more than people can see.
const SHOWING_PERIOD: Duration = Duration::from_millis(90);
/// How long after the last scan the end of the verdicts is waited for, live.
const VERDICTS_END: Duration = Duration::from_secs(5);

/// The counter of scans from which on poses may be off against the map before.
pub(crate) const DOUBTFUL_POSES: &str = "doubtful poses";

/// How mapping ended that should not have.
#[derive(Debug, thiserror::Error)]
pub enum MappingError {
    /// The settings make no mapper.
    #[error("[mapping]: {0}")]
    Parameters(#[from] ParametersError),
    /// A service cannot be used.
    #[error("{0}")]
    Bus(#[from] BusError),
    /// The work loop failed.
    #[error("{0}")]
    Run(#[from] RunError),
}

/// Maps until the scans end or the process is asked to stop, then writes the map.
///
/// # Errors
/// Settings that make no mapper, a bus that fails, or files that cannot be written.
pub fn run(mut shell: Shell, settings: &Settings) -> Result<(), MappingError> {
    let mut mapping = Mapping::new(&mut shell, settings)?;
    Ok(shell.run(&mut mapping)?)
}

/// The verdicts, and what they are expected to be.
struct Verdicts {
    given: Reader<FilterVerdict>,
    outlooks: Reader<VerdictOutlook>,
}

struct Mapping {
    mapper: Mapper,
    scans: Reader<SonarScan>,
    verdicts: Option<Verdicts>,
    tiles: Writer<MapTile>,
    way: Writer<WayChunk>,
    summary: Writer<MapSummary>,
    checkpoint: Checkpoint,
    /// Last scan that the checkpoint includes.
    checkpointed: u64,
    out: PathBuf,
    pace: Pace,
    layers: &'static [Layer],
    /// Input came that is not shown yet.
    news: bool,
    shown_at: Option<Instant>,
    scans_ended_at: Option<Instant>,
    /// Everything is integrated for good; what is left is to send and to write it.
    over: bool,
    refused: u64,
    /// Scans from which on poses may be off against the map before.
    doubtful: u64,
}

impl Mapping {
    fn new(shell: &mut Shell, settings: &Settings) -> Result<Self, MappingError> {
        let speed = shell.membership().speed();
        let empty = Mapper::new(&parameters(settings, speed))?;
        let checkpoint = shell.checkpoint();
        let restored = checkpoint.restore(|saved| empty.clone().restore(saved.state, saved.parts.iter().map(|(key, part)| (*key, *part))));
        let mapper = restored.unwrap_or(empty);
        let mut scans = shell.reader::<SonarScan>()?;
        let (last_seq, last_ns) = mapper.last_scan();
        if last_seq > 0 {
            tracing::info!("goes on after scan {last_seq}");
        }
        scans.skip_to(last_seq, last_ns);
        let mut verdicts = None;
        if settings.expects_verdicts() {
            let mut reader = shell.reader::<FilterVerdict>()?;
            reader.skip_to(mapper.decided_up_to(), 0);
            verdicts = Some(Verdicts { given: reader, outlooks: shell.reader()? });
        }
        Ok(Self {
            scans,
            verdicts,
            tiles: shell.writer()?,
            way: shell.writer()?,
            summary: shell.writer()?,
            checkpoint,
            checkpointed: last_seq,
            out: settings.out.clone(),
            pace: settings.pace,
            layers: if settings.mapping.keep_unfiltered { &[Layer::Filtered, Layer::Unfiltered] } else { &[Layer::Filtered] },
            news: true,
            shown_at: None,
            scans_ended_at: None,
            over: false,
            refused: 0,
            doubtful: 0,
            mapper,
        })
    }

    /// Takes what waits, up to a round's share; true when there may be more.
    fn take_inputs(&mut self) -> Result<bool, StepError> {
        for _ in 0..TAKEN_PER_ROUND {
            let scan = self.take_scan()?;
            let verdict = self.take_verdict()?;
            if !scan && !verdict {
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
                let seq = scan.seq();
                if scan.is_doubtful() {
                    self.doubtful += 1;
                    tracing::warn!("from scan {seq} on the pose is doubtful: the map may be shifted against what it was");
                }
                let taken = self.mapper.step(Input::Scan { seq, stamp_ns: scan.stamp_ns(), scan: &scan });
                self.note(taken);
                if seq >= self.checkpointed + Replay::SCANS.checkpoint || self.checkpoint.is_missing() {
                    self.save()?;
                }
            }
            Some(Received::End { .. }) => {
                self.scans_ended_at = Some(Instant::now());
                self.save()?;
            }
        }
        Ok(true)
    }

    fn take_verdict(&mut self) -> Result<bool, StepError> {
        let Some(verdicts) = &mut self.verdicts else { return Ok(false) };
        if let Some(Received::Message(outlook)) = verdicts.outlooks.take()? {
            self.mapper.step(Input::Outlook(&outlook))?;
        }
        match verdicts.given.take()? {
            None => return Ok(false),
            Some(Received::Message(verdict)) => {
                let taken = self.mapper.step(Input::Verdict { seq: verdict.seq(), verdict: &verdict });
                self.note(taken);
            }
            Some(Received::End { .. }) => {}
        }
        Ok(true)
    }

    fn note(&mut self, taken: Result<(), Refused>) {
        if let Err(refused) = taken {
            self.refused += 1;
            tracing::warn!("{refused}");
        }
    }

    fn save(&mut self) -> Result<(), StepError> {
        self.checkpoint.save_parts(&self.mapper.save_head(), &mut Tiles(&mut self.mapper));
        self.checkpointed = self.mapper.last_scan().0;
        Ok(())
    }

    /// Whether nothing more is to come that the map could wait for.
    fn nothing_is_to_come(&self) -> bool {
        let Some(ended_at) = self.scans_ended_at else { return false };
        let all_decided = self.mapper.decided_up_to() == self.mapper.last_scan().0;
        let out_of_patience = self.pace == Pace::Live && ended_at.elapsed() >= VERDICTS_END;
        match &self.verdicts {
            None => true,
            Some(verdicts) => verdicts.given.ended() || all_decided || out_of_patience,
        }
    }

    /// Makes what is shown anew when something came and it is time; otherwise the time until then, if something came.
    fn show(&mut self) -> Option<Duration> {
        if !self.news {
            return None;
        }
        let due_in = self.shown_at.map_or(Duration::ZERO, |at| SHOWING_PERIOD.saturating_sub(at.elapsed()));
        if !due_in.is_zero() {
            return Some(due_in);
        }
        self.mapper.refresh();
        self.news = false;
        self.shown_at = Some(Instant::now());
        None
    }

    /// Sends what has changed, up to a round's share; true when there is more.
    fn send(&mut self) -> Result<bool, BusError> {
        let (seq, stamp_ns) = self.mapper.last_scan();
        let mut room = TILES_PER_ROUND;
        for &layer in self.layers {
            let keys = self.mapper.take_unsent(layer, room);
            room -= keys.len();
            for key in keys {
                self.tiles.send_with(seq, stamp_ns, |message| self.mapper.write_tile(layer, key, message))?;
            }
        }
        for _ in 0..WAY_CHUNKS_PER_ROUND {
            let Some(chunk) = self.mapper.next_way_chunk() else { return Ok(room == 0) };
            self.way.send(seq, stamp_ns, &chunk)?;
        }
        Ok(true)
    }

    fn count(&self, context: &mut Context<'_>) {
        let counts = self.mapper.counts();
        context.count("scans integrated", counts.scans);
        context.count("readings integrated", counts.readings);
        context.count("readings withheld", counts.withheld);
        context.count("readings undecided", counts.undecided);
        context.count("scans pending", self.mapper.pending_scans() as u64);
        context.count("inputs refused", self.refused);
        context.count(DOUBTFUL_POSES, self.doubtful);
    }

    /// Integrates what is pending. Saved before: should the end fail, the next incarnation goes on from there.
    fn decide_the_rest(&mut self) -> Result<(), StepError> {
        self.save()?;
        self.mapper.step(Input::End)?;
        self.mapper.refresh();
        self.over = true;
        Ok(())
    }

    /// Writes the files and says that the map is finished.
    fn finish(&mut self) -> Result<(), StepError> {
        for path in write_files(&self.out, &MapCopy::of(&self.mapper).files()?)? {
            tracing::info!("wrote {}", path.display());
        }
        let (seq, stamp_ns) = self.mapper.last_scan();
        self.summary.send(seq, stamp_ns, &self.mapper.summary())?;
        self.summary.end(seq, stamp_ns)?;
        self.tiles.end(seq, stamp_ns)?;
        self.way.end(seq, stamp_ns)?;
        Ok(())
    }
}

/// The tiles of a mapper's state as parts of a checkpoint.
pub struct Tiles<'a>(pub &'a mut Mapper);

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

impl Process for Mapping {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        let more_waits = self.take_inputs()?;
        // Also what a checkpoint includes: who saved it may have been killed before it could say so.
        context.answered::<SonarScan>(self.mapper.last_scan().0);
        if !self.over && !more_waits && (context.stopping() || self.nothing_is_to_come()) {
            self.decide_the_rest()?;
        }
        self.count(context);
        if self.tiles.joined() | self.way.joined() {
            self.mapper.send_again();
        }
        let next_look = self.show();
        let more_to_send = self.send()?;
        if more_waits {
            return Ok(Next::Again);
        }
        if more_to_send {
            return Ok(Next::WaitAtMost(SENDING_PAUSE));
        }
        if self.over {
            self.finish()?;
            return Ok(Next::Finished);
        }
        Ok(next_look.map_or(Next::Wait, Next::WaitAtMost))
    }
}
