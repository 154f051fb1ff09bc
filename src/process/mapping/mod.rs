//! The process around the mapper: scans and verdicts in, tiles out, files at the end.

mod estimates;
mod parameters;

use std::path::PathBuf;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use bus::{BusError, Episode, Reader, Received, Writer};
use messages::{FilterVerdict, Layer, MapSummary, MapTile, Payload, Service, SonarScan, StreamCursor, VerdictOutlook, WayChunk};
use runtime::{Checkpoint, Context, Fold, Next, PartKey, Parts, RunError, Settling, Shell, StepError, run_fold};
use settings::{BuiltIn, Pace, Settings};

use ::mapping::export::{MapCopy, MapFiles};
use ::mapping::{Input, Mapper, ParametersError, Refused, write_files};

use estimates::Estimates;
pub(crate) use parameters::parameters;

/// Most tiles published in one round: a fraction of a reader's buffer, which the reader has time to empty before the next round.
const TILES_PER_ROUND: usize = 64;
/// Most pieces of the path published in one round.
const WAY_CHUNKS_PER_ROUND: usize = 16;
/// Time between two rounds of publishing while tiles wait.
const SENDING_PAUSE: Duration = Duration::from_millis(5);
/// Shortest time between two updates of the displayed map: a little less than the period of a robot's scans, so that live each scan
/// is shown at once, while a fast replay sends no more than people can see.
const SHOWING_PERIOD: Duration = Duration::from_millis(90);
/// How long after the last scan the end of verdicts and estimates is waited for, live.
const ANSWERS_END: Duration = Duration::from_secs(5);

/// Time between two looks at whether the map is written.
const WRITING_POLL: Duration = Duration::from_millis(10);

/// The counter of scans from which on poses may be off against the map before.
pub(crate) const DOUBTFUL_POSES: &str = "doubtful poses";
/// The counter of known cells that the pictures of the map lack.
pub(crate) const CELLS_LEFT_OUT: &str = "cells left out";

/// An error that ends mapping.
#[derive(Debug, thiserror::Error)]
pub enum MappingError {
    /// The settings are out of range.
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
/// Settings out of range, a bus that fails, or files that cannot be written.
pub fn run(mut shell: Shell, settings: &Settings) -> Result<(), MappingError> {
    let checkpoint = shell.checkpoint();
    let mut mapping = Mapping::new(&mut shell, &checkpoint, settings)?;
    Ok(run_fold(shell, checkpoint, &mut mapping)?)
}

/// The final verdicts, and the outlook on those to come.
struct Verdicts {
    given: Reader<FilterVerdict>,
    outlooks: Reader<VerdictOutlook>,
}

struct Mapping {
    mapper: Mapper,
    settling: Settling,
    scans: Reader<SonarScan>,
    verdicts: Option<Verdicts>,
    /// `None` where odometry is exact.
    estimates: Option<Estimates>,
    tiles: Writer<MapTile>,
    path: Writer<WayChunk>,
    summary: Writer<MapSummary>,
    out: PathBuf,
    pace: Pace,
    layers: &'static [Layer],
    /// Input came that is not shown yet.
    news: bool,
    shown_at: Option<Instant>,
    scans_ended_at: Option<Instant>,
    refused: u64,
    /// The last scan that the map refused: it is answered, too.
    refused_scan: u64,
    refusals: Episode,
    /// Scans from which on poses may be off against the map before.
    doubtful: u64,
    doubts: Episode,
    writing: Option<JoinHandle<Result<Written, StepError>>>,
    written: Option<Written>,
}

/// The finished map.
struct Written {
    summary: MapSummary,
    cells_left_out: u64,
}

impl Fold for Mapping {
    const SOURCE: Service = SonarScan::SERVICE;

    fn take(&mut self) -> Result<bool, StepError> {
        let taken = self.take_scan()? | self.take_estimate()? | self.take_verdict()?;
        self.news |= taken;
        if self.settling.is_over_now() {
            self.mapper.be_patient(false);
        }
        Ok(taken)
    }

    fn received(&self) -> StreamCursor {
        self.mapper.last_scan()
    }

    fn answered(&self) -> u64 {
        self.mapper.last_scan().seq.max(self.refused_scan)
    }

    /// Whether the scans have ended and neither verdict nor estimate is missing, or none is waited for any longer.
    fn is_complete(&self) -> bool {
        let Some(ended_at) = self.scans_ended_at else { return false };
        let all_decided = self.mapper.decided_up_to() == self.mapper.last_scan().seq;
        let out_of_patience = self.pace == Pace::Live && ended_at.elapsed() >= ANSWERS_END;
        let are_decided = self.verdicts.as_ref().is_none_or(|verdicts| verdicts.given.ended() || all_decided);
        let are_placed = self.estimates.as_ref().is_none_or(|estimates| estimates.are_taken(&self.mapper));
        are_decided && are_placed || out_of_patience
    }

    fn save(&mut self, checkpoint: &mut Checkpoint) -> Result<(), StepError> {
        checkpoint.save_parts(&self.mapper.save_head(), &mut Tiles(&mut self.mapper));
        Ok(())
    }

    fn publish(&mut self, _: bool) -> Result<Next, StepError> {
        if self.tiles.joined() | self.path.joined() {
            self.mapper.send_again();
        }
        let next_look = self.show();
        if self.send()? {
            return Ok(Next::WaitAtMost(SENDING_PAUSE));
        }
        Ok(next_look.map_or(Next::Wait, Next::WaitAtMost))
    }

    /// Integrates what is pending.
    fn end(&mut self) -> Result<(), StepError> {
        self.mapper.step(Input::End)?;
        self.mapper.refresh();
        self.news = false;
        Ok(())
    }

    /// Has the files written beside the work loop. In the round after that it publishes that the map is finished: the heartbeat
    /// then counts what the files lack.
    fn finish(&mut self, _: &Context<'_>) -> Result<Next, StepError> {
        let Some(written) = &self.written else {
            let Some(writing) = self.writing.take_if(|writing| writing.is_finished()) else {
                let (mapper, out) = (&self.mapper, &self.out);
                self.writing.get_or_insert_with(|| begin_writing(mapper.clone(), out.clone()));
                return Ok(Next::WaitAtMost(WRITING_POLL));
            };
            self.written = Some(writing.join().map_err(|_| "the thread that writes the map has panicked")??);
            return Ok(Next::Again);
        };
        let StreamCursor { seq, stamp_ns } = self.mapper.last_scan();
        self.summary.send(seq, stamp_ns, &written.summary)?;
        self.summary.end(seq, stamp_ns)?;
        self.tiles.end(seq, stamp_ns)?;
        self.path.end(seq, stamp_ns)?;
        Ok(Next::Finished)
    }

    fn report(&mut self, context: &mut Context<'_>, _: bool) {
        let counts = self.mapper.counts();
        context.count("scans integrated", counts.scans);
        context.count("readings integrated", counts.readings);
        context.count("readings withheld", counts.withheld);
        context.count("readings undecided", counts.undecided);
        context.count("scans pending", self.mapper.pending_scans() as u64);
        context.count("inputs refused", self.refused);
        context.count(DOUBTFUL_POSES, self.doubtful);
        context.count(CELLS_LEFT_OUT, self.written.as_ref().map_or(0, |written| written.cells_left_out));
        if self.estimates.is_some() {
            context.count("scans without a smoothed pose", counts.unsmoothed);
        }
    }
}

impl Mapping {
    fn new(shell: &mut Shell, checkpoint: &Checkpoint, settings: &Settings) -> Result<Self, MappingError> {
        let speed = shell.membership().speed();
        let empty = Mapper::new(&parameters(settings, speed))?;
        let restored = checkpoint.restore(|saved| empty.clone().restore(saved.state, saved.parts.iter().map(|(key, part)| (*key, *part))));
        let mut mapper = restored.unwrap_or(empty);
        mapper.be_patient(true);
        let mut scans = shell.reader::<SonarScan>()?;
        let StreamCursor { seq, stamp_ns } = mapper.last_scan();
        if seq > 0 {
            tracing::info!("resumes after scan {seq}");
        }
        scans.skip_to(seq, stamp_ns);
        let mut verdicts = None;
        if settings.expects_verdicts() {
            let mut reader = shell.reader::<FilterVerdict>()?;
            reader.skip_to(mapper.decided_up_to(), 0);
            verdicts = Some(Verdicts { given: reader, outlooks: shell.reader()? });
        }
        let estimates = if settings.runs(BuiltIn::Localisation) { Some(Estimates::open(shell, &mapper)?) } else { None };
        Ok(Self {
            settling: Settling::begin(),
            scans,
            verdicts,
            estimates,
            tiles: shell.writer()?,
            path: shell.writer()?,
            summary: shell.writer()?,
            out: settings.out.clone(),
            pace: settings.pace,
            layers: if settings.mapping.keep_unfiltered { &[Layer::Filtered, Layer::Unfiltered] } else { &[Layer::Filtered] },
            news: true,
            shown_at: None,
            scans_ended_at: None,
            refused: 0,
            refused_scan: 0,
            refusals: Episode::default(),
            doubtful: 0,
            doubts: Episode::default(),
            writing: None,
            written: None,
            mapper,
        })
    }

    fn take_scan(&mut self) -> Result<bool, StepError> {
        match self.scans.take()? {
            None => return Ok(false),
            Some(Received::Message(scan)) => {
                let seq = scan.seq();
                if scan.is_doubtful() {
                    self.doubtful += 1;
                    if self.doubts.occurred(Instant::now()) {
                        tracing::warn!("from scan {seq} on the pose is doubtful: the map may be shifted against what it was");
                    }
                } else if let Some(count) = self.doubts.over(Instant::now()) {
                    tracing::info!("the pose was doubtful {count} times up to scan {seq}");
                }
                let taken = self.mapper.step(Input::Scan { seq, stamp_ns: scan.stamp_ns(), scan: &scan });
                if taken.is_err() {
                    self.refused_scan = seq;
                }
                self.count_refused(taken);
            }
            Some(Received::End { .. }) => self.scans_ended_at = Some(Instant::now()),
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
                self.count_refused(taken);
            }
            Some(Received::End { .. }) => {}
        }
        Ok(true)
    }

    fn take_estimate(&mut self) -> Result<bool, StepError> {
        let Some(estimates) = &mut self.estimates else { return Ok(false) };
        let scans_to = if self.scans_ended_at.is_some() { u64::MAX } else { self.mapper.last_scan().seq.max(self.refused_scan) };
        let Some(taken) = estimates.take(&mut self.mapper, scans_to)? else { return Ok(false) };
        self.count_refused(taken);
        Ok(true)
    }

    fn count_refused(&mut self, taken: Result<(), Refused>) {
        if let Err(refused) = taken {
            self.refused += 1;
            if self.refusals.occurred(Instant::now()) {
                tracing::warn!("{refused}");
            }
        } else if let Some(count) = self.refusals.over(Instant::now()) {
            tracing::info!("{count} inputs were refused; the map takes them again");
        }
    }

    /// Updates the displayed map when input came and the period is over; otherwise the time until then, if input came.
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

    /// Publishes changed tiles and pieces of the path, as many as a round allows; true when there are more.
    fn send(&mut self) -> Result<bool, BusError> {
        let StreamCursor { seq, stamp_ns } = self.mapper.last_scan();
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
            self.path.send(seq, stamp_ns, &chunk)?;
        }
        Ok(true)
    }
}

/// Writes the map in a thread of its own. At the largest size this takes a minute, and a process may be silent for two seconds.
fn begin_writing(mapper: Mapper, out: PathBuf) -> JoinHandle<Result<Written, StepError>> {
    std::thread::spawn(move || {
        let (summary, copy) = (mapper.summary(), MapCopy::of(&mapper));
        drop(mapper);
        let MapFiles { files, left_out } = copy.files()?;
        for path in write_files(&out, &files)? {
            tracing::info!("wrote {}", path.display());
        }
        for lack in &left_out {
            tracing::warn!("{lack}");
        }
        Ok(Written { summary, cells_left_out: left_out.iter().map(|lack| lack.cells).sum() })
    })
}

/// The tiles of a mapper's state as parts of a checkpoint.
pub struct Tiles<'a>(pub &'a mut Mapper);

impl Parts for Tiles<'_> {
    fn take_changed(&mut self) -> Vec<PartKey> {
        self.0.take_unsaved()
    }

    fn all(&self) -> Vec<PartKey> {
        self.0.saved_parts()
    }

    fn write(&self, key: PartKey, bytes: &mut Vec<u8>) {
        self.0.save_part(key, bytes);
    }
}
