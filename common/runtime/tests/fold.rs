//! The run loop of a fold: rounds, checkpoints, the end.
#![expect(clippy::unwrap_used, reason = "tests fail by panicking")]

use std::sync::atomic::{AtomicU32, Ordering};

use bus::{Domain, Reader, Received};
use messages::{Payload, Service, SonarMotion, SonarScan, StreamCursor};
use stillmap_runtime::{Answers, Checkpoint, Context, Fold, Next, Recent, Shell, StepError, run_fold};

/// Stands for the end among the numbers of a stream.
const END: u64 = u64::MAX;

/// What a fold was asked to do, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Call {
    Take(u64),
    Save(u64),
    Report { more: bool },
    End,
    Finish,
}

/// Answers every scan and notes the calls.
struct Noting<'a> {
    scans: Reader<SonarScan>,
    motions: Answers<SonarMotion>,
    calls: &'a mut Vec<Call>,
    /// The work on each scan takes a whole round.
    is_slow: bool,
    /// Pieces of a result that `finish` has still to write.
    pieces: u32,
}

impl Fold for Noting<'_> {
    const SOURCE: Service = SonarScan::SERVICE;

    fn take(&mut self) -> Result<bool, StepError> {
        let Some(received) = self.scans.take()? else { return Ok(false) };
        if let Received::Message(scan) = received {
            self.motions.publish(scan.cursor(), &SonarMotion::default())?;
            self.calls.push(Call::Take(scan.seq()));
            if self.is_slow {
                let began = std::time::Instant::now();
                while began.elapsed() < std::time::Duration::from_millis(100) {}
            }
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
        checkpoint.save_state(self.motions.recent());
        self.calls.push(Call::Save(self.received().seq));
        Ok(())
    }

    fn end(&mut self) -> Result<(), StepError> {
        self.calls.push(Call::End);
        Ok(())
    }

    fn finish(&mut self, _: &Context<'_>) -> Result<Next, StepError> {
        self.calls.push(Call::Finish);
        if self.pieces > 0 {
            self.pieces -= 1;
            return Ok(Next::Again);
        }
        self.motions.end()?;
        Ok(Next::Finished)
    }

    fn report(&mut self, _: &mut Context<'_>, more: bool) {
        self.calls.push(Call::Report { more });
    }
}

/// Runs the process over scans `from` to `to`, which are the last ones; returns the calls and what it published.
fn run(domain: &mut Domain, from: u64, to: u64, is_slow: bool, pieces: u32) -> (Vec<Call>, Vec<u64>) {
    let mut published: Reader<SonarMotion> = domain.reader().unwrap();
    let mut source = shell(domain, "source");
    let mut scans = source.writer::<SonarScan>().unwrap();
    let mut process = shell(domain, "noting");
    let checkpoint = process.checkpoint();
    let recent: Recent<SonarMotion> = checkpoint.restore_state().unwrap_or_default();
    let mut reader = process.reader::<SonarScan>().unwrap();
    reader.skip_to(recent.last().seq, recent.last().stamp_ns);
    let motions = Answers::new(&mut process, recent).unwrap();
    for seq in from..=to {
        scans.send(seq, seq, &SonarScan::default()).unwrap();
    }
    scans.end(to, to).unwrap();
    let mut calls = Vec::new();
    let mut noting = Noting { scans: reader, motions, calls: &mut calls, is_slow, pieces };
    run_fold(process, checkpoint, &mut noting).unwrap();
    let mut answers = Vec::new();
    while let Some(received) = published.take().unwrap() {
        answers.push(if let Received::Message(motion) = received { motion.seq() } else { END });
    }
    drop(noting);
    (calls, answers)
}

fn shell(domain: &Domain, process: &str) -> Shell {
    Shell::join(domain.membership_for(process, 0, "settings.toml".as_ref())).unwrap()
}

/// A domain that no other test shares.
fn domain() -> Domain {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    Domain::open(&format!("test-fold-{}-{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed)), 1.0).unwrap()
}

fn taken(calls: &[Call]) -> Vec<u64> {
    calls.iter().filter_map(|call| if let Call::Take(seq) = call { Some(*seq) } else { None }).collect()
}

#[test]
fn state_is_saved_at_the_interval_and_before_the_end() {
    let mut domain = domain();
    let (calls, answers) = run(&mut domain, 1, 150, false, 0);
    assert_eq!(taken(&calls), (1..=150).collect::<Vec<_>>());
    // More often only while the file is not there yet.
    let saved: Vec<u64> = calls.iter().filter_map(|call| if let Call::Save(seq) = call { Some(*seq) } else { None }).collect();
    assert!([0].iter().chain(&saved).zip(&saved).all(|(before, seq)| seq - before <= 64), "{saved:?}");
    let at = calls.iter().position(|call| *call == Call::Save(150)).unwrap();
    assert_eq!(calls[at..], [Call::Save(150), Call::End, Call::Report { more: false }, Call::Finish]);
    assert_eq!(answers, (1..=150).chain([END]).collect::<Vec<_>>());
    domain.close().unwrap();
}

#[test]
fn a_restart_resumes_after_the_checkpoint_and_republishes() {
    let mut domain = domain();
    run(&mut domain, 1, 100, false, 0);
    let (calls, answers) = run(&mut domain, 50, 120, false, 0);
    assert_eq!(taken(&calls), (101..=120).collect::<Vec<_>>());
    assert_eq!(answers, (1..=120).chain([END]).collect::<Vec<_>>());
    domain.close().unwrap();
}

#[test]
fn slow_work_on_a_message_ends_the_round() {
    let mut domain = domain();
    let (calls, _) = run(&mut domain, 1, 3, true, 0);
    let mut between = calls.split(|call| matches!(call, Call::Report { more: true }));
    for seq in 1..=3 {
        assert_eq!(taken(between.next().unwrap()), [seq]);
    }
    domain.close().unwrap();
}

#[test]
fn finish_is_called_until_it_has_finished() {
    let mut domain = domain();
    let (calls, answers) = run(&mut domain, 1, 1, false, 2);
    assert_eq!(calls.iter().filter(|call| **call == Call::Finish).count(), 3);
    assert_eq!(calls.iter().filter(|call| **call == Call::End).count(), 1);
    assert_eq!(answers, [1, END]);
    domain.close().unwrap();
}
