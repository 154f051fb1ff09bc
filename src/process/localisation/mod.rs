//! The process around localisation: scans in, an estimate to each out, and revisions of earlier ones.

mod describe;
mod parameters;

use bus::{BusError, Reader, Received};
use messages::{Payload, RobotEstimate, Service, SonarScan, StreamCursor, TrajectoryRevision};
use runtime::{Answers, Checkpoint, Context, Fold, Next, Recent, RunError, Shell, Snapshot, StepError, run_fold};
use settings::{BuiltIn, Settings};
use state::{encode, take};

use ::localisation::{Answer, Facts, Localisation, Outgoing, Parameters, ParametersError, StateError, Status};

use describe::Drift;
pub(crate) use parameters::parameters;

/// An error that ends localisation.
#[derive(Debug, thiserror::Error)]
pub enum LocalisationError {
    /// The settings are out of range.
    #[error("[localisation]: {0}")]
    Parameters(#[from] ParametersError),
    /// A service cannot be used.
    #[error("{0}")]
    Bus(#[from] BusError),
    /// The work loop failed.
    #[error("{0}")]
    Run(#[from] RunError),
}

/// Answers scans until they end or the process is asked to stop.
///
/// # Errors
/// Settings out of range, or a bus that fails.
pub fn run(mut shell: Shell, settings: &Settings) -> Result<(), LocalisationError> {
    let parameters = parameters(settings);
    let checkpoint = shell.checkpoint();
    let State { last, estimates, revisions, outgoing, localisation } = match checkpoint.restore(|saved| restore(parameters, saved)) {
        Some(restored) => restored,
        None => State::new(parameters)?,
    };
    if last.seq > 0 {
        tracing::info!("resumes after scan {}", last.seq);
    }
    shell.linger_until(settings.named(BuiltIn::Mapping));
    shell.linger_until_recorded(settings.named(BuiltIn::Recorder), &[RobotEstimate::SERVICE, TrajectoryRevision::SERVICE]);
    let mut scans = shell.reader::<SonarScan>()?;
    scans.skip_to(last.seq, last.stamp_ns);
    let estimates = Answers::new(&mut shell, estimates)?;
    let revisions = Answers::new(&mut shell, revisions)?;
    Ok(run_fold(
        shell,
        checkpoint,
        &mut Estimation { scans, last, estimates, revisions, outgoing, localisation, status: Status::default(), drift: None },
    )?)
}

/// What a checkpoint holds.
struct State {
    last: StreamCursor,
    estimates: Recent<RobotEstimate>,
    revisions: Recent<TrajectoryRevision>,
    outgoing: Outgoing,
    localisation: Localisation,
}

impl State {
    fn new(parameters: Parameters) -> Result<Self, ParametersError> {
        let (last, estimates, revisions, outgoing) = Default::default();
        Ok(Self { last, estimates, revisions, outgoing, localisation: Localisation::new(parameters)? })
    }
}

struct Estimation {
    scans: Reader<SonarScan>,
    /// The last scan taken.
    last: StreamCursor,
    estimates: Answers<RobotEstimate>,
    revisions: Answers<TrajectoryRevision>,
    outgoing: Outgoing,
    localisation: Localisation,
    /// The last answer: how well the place is known, and how far odometry was off.
    status: Status,
    drift: Option<Drift>,
}

impl Fold for Estimation {
    const SOURCE: Service = SonarScan::SERVICE;

    fn take(&mut self) -> Result<bool, StepError> {
        let Some(received) = self.scans.take()? else { return Ok(false) };
        if let Received::Message(scan) = received {
            self.last = scan.cursor();
            let answer = self.localisation.step(scan.seq(), scan.stamp_ns(), &scan);
            self.outgoing.put(&answer);
            self.publish_next(self.last, &answer)?;
            if let Some(news) = describe::news(self.status, &answer) {
                tracing::info!("{news}");
            }
            self.status = answer.status;
            self.drift = Some(Drift::of(&answer.map_from_odom, &scan));
        }
        Ok(true)
    }

    fn received(&self) -> StreamCursor {
        self.last
    }

    fn is_complete(&self) -> bool {
        self.scans.ended()
    }

    fn save(&mut self, checkpoint: &mut Checkpoint) -> Result<(), StepError> {
        let bytes = encode(self.revisions.recent(), encode(self.estimates.recent(), encode(&self.last, Vec::new())));
        checkpoint.save(&[bytes, self.outgoing.to_bytes(), self.localisation.to_bytes()].concat());
        Ok(())
    }

    /// Answers what is left, in estimates that have the numbers after the last scan.
    fn end(&mut self) -> Result<(), StepError> {
        let answer = self.localisation.finish();
        self.outgoing.put(&answer);
        let mut at = self.last;
        while !self.outgoing.is_empty() {
            at.seq += 1;
            self.publish_next(at, &answer)?;
        }
        Ok(())
    }

    fn finish(&mut self, _: &Context<'_>) -> Result<Next, StepError> {
        if let Some(drift) = &self.drift {
            tracing::info!("{}", drift.line(&self.facts()));
        }
        self.estimates.end()?;
        self.revisions.end()?;
        Ok(Next::Finished)
    }

    fn report(&mut self, context: &mut Context<'_>, _: bool) {
        let facts = self.facts();
        let Facts { walls, closures, .. } = facts;
        context.note(&describe::note(self.status, &facts));
        context.count("walls", u64::from(walls));
        context.count("places recognised", u64::from(closures));
        context.count("pieces of revisions", self.revisions.last().seq);
    }
}

impl Estimation {
    fn publish_next(&mut self, at: StreamCursor, answer: &Answer) -> Result<(), BusError> {
        let (estimate, piece) = self.outgoing.take(answer, &self.facts());
        self.estimates.publish(at, &estimate)?;
        match piece {
            Some(piece) => self.revisions.publish(StreamCursor { seq: estimate.pieces, ..at }, &piece),
            None => Ok(()),
        }
    }

    fn facts(&self) -> Facts {
        let closures = self.localisation.closures().count() as u32;
        Facts { calibration: self.localisation.calibration(), walls: self.localisation.walls().count() as u32, closures }
    }
}

fn restore(parameters: Parameters, saved: &Snapshot<'_>) -> Result<State, StateError> {
    let (last, rest) = take(saved.state)?;
    let (estimates, rest) = take(rest)?;
    let (revisions, rest) = take(rest)?;
    let (mut outgoing, rest) = Outgoing::from_bytes(rest)?;
    let mut localisation = Localisation::from_bytes(parameters, rest)?;
    if saved.before_a_stop {
        // The process has answered what was left, and mapping may have taken that. It is sent again under the same numbers.
        outgoing.put(&localisation.finish());
    }
    Ok(State { last, estimates, revisions, outgoing, localisation })
}
