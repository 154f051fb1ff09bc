//! The process around STD: scans in, an answer to each out.

mod parameters;

use bus::{BusError, Reader, Received};
use messages::{Payload, Service, SonarMotion, SonarScan, StreamCursor};
use runtime::{Answers, Checkpoint, Context, Fold, Next, Recent, RunError, Shell, StepError, run_fold};
use settings::{BuiltIn, Settings};
use state::{encode, take};
use stillmap_std::{Parameters, ParametersError, StateError, Std};

pub(crate) use parameters::parameters;

/// An error that ends STD.
#[derive(Debug, thiserror::Error)]
pub enum StdError {
    /// The settings are out of range.
    #[error("[std]: {0}")]
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
pub fn run(mut shell: Shell, settings: &Settings) -> Result<(), StdError> {
    let parameters = parameters(settings);
    let checkpoint = shell.checkpoint();
    let (std, recent) = match checkpoint.restore(|saved| restore(parameters, saved.state)) {
        Some(restored) => restored,
        None => (Std::new(parameters)?, Recent::default()),
    };
    let StreamCursor { seq, stamp_ns } = recent.last();
    if seq > 0 {
        tracing::info!("resumes after scan {seq}");
    }
    shell.linger_until(settings.named(BuiltIn::Fti));
    shell.linger_until_recorded(settings.named(BuiltIn::Recorder), &[SonarMotion::SERVICE]);
    let mut scans = shell.reader::<SonarScan>()?;
    scans.skip_to(seq, stamp_ns);
    let motions = Answers::new(&mut shell, recent)?;
    Ok(run_fold(shell, checkpoint, &mut Difference { std, scans, motions, moving_scans: 0, movers: 0 })?)
}

struct Difference {
    std: Std,
    scans: Reader<SonarScan>,
    motions: Answers<SonarMotion>,
    moving_scans: u64,
    movers: u64,
}

impl Fold for Difference {
    const SOURCE: Service = SonarScan::SERVICE;

    fn take(&mut self) -> Result<bool, StepError> {
        let Some(received) = self.scans.take()? else { return Ok(false) };
        if let Received::Message(scan) = received {
            let motion = self.std.step(scan.stamp_ns(), &scan);
            self.moving_scans += u64::from(motion.count > 0);
            self.movers += u64::from(motion.count);
            self.motions.publish(scan.cursor(), &motion)?;
        }
        Ok(true)
    }

    fn received(&self) -> StreamCursor {
        self.motions.last()
    }

    fn is_complete(&self) -> bool {
        self.scans.ended()
    }

    fn save(&mut self, checkpoint: &mut Checkpoint) -> Result<(), StepError> {
        let mut bytes = encode(self.motions.recent(), Vec::new());
        bytes.extend(self.std.to_bytes());
        checkpoint.save(&bytes);
        Ok(())
    }

    fn finish(&mut self, _: &Context<'_>) -> Result<Next, StepError> {
        self.motions.end()?;
        Ok(Next::Finished)
    }

    fn report(&mut self, context: &mut Context<'_>, _: bool) {
        context.count("scans with movers", self.moving_scans);
        context.count("movers", self.movers);
        context.count("tracks", self.std.tracks().len() as u64);
    }
}

fn restore(parameters: Parameters, bytes: &[u8]) -> Result<(Std, Recent<SonarMotion>), StateError> {
    let (recent, std) = take(bytes)?;
    Ok((Std::from_bytes(parameters, std)?, recent))
}
