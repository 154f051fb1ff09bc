//! The run loop around a process in a domain: heartbeat, progress, the end, and a run that is resumed.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use bus::{Domain, Reader, Received, Writer};
use messages::{DeploymentStatus, Heartbeat, Payload, Phase, Pose, ProcessState, ProcessStatus, Progress, SonarMotion, SonarScan, Text};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use stillmap_runtime::{Context, Next, PersistedState, Process, RunState, Shell, StepError};

/// A domain that no other test shares.
fn domain() -> Domain {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    Domain::open(&format!("test-runtime-{}-{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed)), 1.0).unwrap()
}

fn scan(x_m: f64) -> SonarScan {
    SonarScan::new(Pose { x_m, ..Pose::default() }, &[], false)
}

fn shell(domain: &Domain, process: &str) -> Shell {
    Shell::join(domain.membership_for(process, 0, "settings.toml".as_ref())).unwrap()
}

/// Longest wait before a look: neither heartbeats nor the history that a member gets when it joins wake a reader.
const PATIENCE: Duration = Duration::from_millis(50);

/// Does what a supervisor does a few times a second: sends members that have joined what they missed.
fn attend(domain: &Domain) {
    let descriptors = domain.descriptors();
    let mut polled: Vec<_> = descriptors.iter().map(|descriptor| PollFd::new(descriptor, PollFlags::IN)).collect();
    poll(&mut polled, Some(&Timespec { tv_sec: 0, tv_nsec: PATIENCE.subsec_nanos().into() })).unwrap();
    domain.refresh();
}

fn sequence(reader: &mut Reader<SonarScan>) -> Vec<u64> {
    let mut taken = Vec::new();
    while let Some(received) = reader.take().unwrap() {
        match received {
            Received::Message(message) => taken.push(message.seq()),
            Received::End { seq } => taken.push(1_000_000 + seq),
        }
    }
    taken
}

/// Takes scans until the end and answers for them.
struct Counting {
    reader: Reader<SonarScan>,
    taken: u64,
}

impl Process for Counting {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        while let Some(received) = self.reader.take()? {
            match received {
                Received::Message(message) => {
                    self.taken += 1;
                    context.answered::<SonarScan>(message.seq());
                }
                Received::End { .. } => return Ok(Next::Finished),
            }
        }
        context.note("waiting for the end");
        context.count("taken", self.taken);
        Ok(Next::Wait)
    }
}

#[test]
fn the_run_loop_takes_reports_and_ends() {
    let mut domain = domain();
    let mut heartbeats: Reader<Heartbeat> = domain.reader().unwrap();
    let mut progress: Reader<Progress> = domain.reader().unwrap();
    let mut writer: Writer<SonarScan> = domain.writer().unwrap();
    let mut sink = shell(&domain, "sink");
    let reader = sink.reader().unwrap();
    for seq in 1..=20 {
        writer.send(seq, seq, &scan(0.0)).unwrap();
    }
    writer.end(20, 20).unwrap();
    assert!(progress.take().unwrap().is_none());
    assert!(matches!(heartbeats.take().unwrap(), Some(Received::Message(_))), "the first heartbeat comes with joining");
    let mut counting = Counting { reader, taken: 0 };
    sink.run(&mut counting).unwrap();
    assert_eq!(counting.taken, 20);
    drop(counting);
    let Some(Received::Message(answer)) = progress.take().unwrap() else { panic!("no progress") };
    assert_eq!((answer.process.as_str(), answer.service.as_str(), answer.answered), ("sink", "robot/scan", 20));
    let mut phases = Vec::new();
    while let Some(Received::Message(beat)) = heartbeats.take().unwrap() {
        assert_eq!(beat.process.as_str(), "sink");
        phases.push(beat.phase);
    }
    assert_eq!(phases, [1, 2]);
    drop((heartbeats, progress, writer, answer));
    domain.close().unwrap();
}

/// Sends three scans and the end, and has then done its work.
struct Sending(Writer<SonarScan>);

impl Process for Sending {
    fn step(&mut self, _: &mut Context<'_>) -> Result<Next, StepError> {
        for seq in 1..=3 {
            self.0.send(seq, seq, &scan(0.0))?;
        }
        self.0.end(3, 3)?;
        Ok(Next::Finished)
    }
}

#[test]
fn a_finished_process_lingers_until_its_consumers_are_over() {
    let mut domain = domain();
    let mut heartbeats: Reader<Heartbeat> = domain.reader().unwrap();
    let mut statuses: Writer<DeploymentStatus> = domain.writer().unwrap();
    let told = |state: ProcessState| {
        let mut status = DeploymentStatus { count: 1, ..DeploymentStatus::default() };
        status.processes[0] = ProcessStatus { process: Text::new("sink"), state: state as u32, ..ProcessStatus::default() };
        status
    };
    statuses.send(1, 1, &told(ProcessState::Running)).unwrap();
    let membership = domain.membership_for("source", 0, "settings.toml".as_ref());
    let source = std::thread::spawn(move || {
        let mut shell = Shell::join(membership).unwrap();
        let mut sending = Sending(shell.writer().unwrap());
        shell.linger_until(["sink".to_owned()]);
        shell.run(&mut sending).unwrap();
    });
    let mut beats = 0;
    while beats < 3 {
        while let Some(Received::Message(beat)) = heartbeats.take().unwrap() {
            assert!(!source.is_finished(), "it has gone");
            beats += u32::from(beat.phase == Phase::Ending as u32);
        }
        attend(&domain);
    }
    let mut sink = shell(&domain, "sink");
    let mut reader: Reader<SonarScan> = sink.reader().unwrap();
    let mut taken = Vec::new();
    while taken.len() < 4 {
        sink.wait_for_inputs(PATIENCE).unwrap();
        taken.extend(sequence(&mut reader));
    }
    assert_eq!(taken, [1, 2, 3, 1_000_003]);
    statuses.send(2, 2, &told(ProcessState::Finished)).unwrap();
    source.join().unwrap();
    drop((sink, reader, heartbeats, statuses));
    domain.close().unwrap();
}

#[test]
fn a_finished_process_lingers_until_its_end_is_recorded() {
    let mut domain = domain();
    let mut heartbeats: Reader<Heartbeat> = domain.reader().unwrap();
    let membership = domain.membership_for("source", 0, "settings.toml".as_ref());
    let source = std::thread::spawn(move || {
        let mut shell = Shell::join(membership).unwrap();
        let mut sending = Sending(shell.writer().unwrap());
        shell.linger_until_recorded(["recorder".to_owned()], &[SonarScan::SERVICE]);
        shell.run(&mut sending).unwrap();
    });
    let mut recorder = shell(&domain, "recorder");
    let mut progress: Writer<Progress> = recorder.writer().unwrap();
    let mut beats = 0;
    while beats < 3 {
        while let Some(Received::Message(beat)) = heartbeats.take().unwrap() {
            assert!(!source.is_finished(), "it has gone");
            beats += u32::from(beat.phase == Phase::Ending as u32);
        }
        progress.send(1, 1, &Progress { service: Text::new(SonarMotion::SERVICE.name), ..written("recorder") }).unwrap();
        progress.send(1, 1, &written("viewer")).unwrap();
        attend(&domain);
    }
    progress.send(1, 1, &written("recorder")).unwrap();
    source.join().unwrap();
    drop((recorder, progress, heartbeats));
    domain.close().unwrap();
}

fn written(process: &str) -> Progress {
    Progress { process: Text::new(process), service: Text::new(SonarScan::SERVICE.name), answered: 3 }
}

#[test]
fn a_resumed_run_is_later_than_its_last_note() {
    let out = tempfile::tempdir().unwrap();
    let folder = out.path().join("state");
    let name = format!("test-runtime-goes-on-{}", std::process::id());
    let open =
        || RunState::open(&name, 1.0, &[], Some(PersistedState { folder: &folder, made_with: "cells of 0.1 m", fresh: false })).unwrap();
    let (state, first) = open();
    let (run, noted_ns) = (first.run(), first.membership_for("mapping", 0, "x".as_ref()).clock().now_ns());
    assert!(!state.is_resumed());
    first.close().unwrap();

    // As if the wall clock had been set back by an hour since.
    let (note, later_ns) = (folder.join("run"), noted_ns + 3_600_000_000_000);
    let text = std::fs::read_to_string(&note).unwrap();
    let (head, _) = text.trim_end().rsplit_once('\n').unwrap();
    let digits = format!("{later_ns:020}");
    std::fs::write(&note, format!("{head}\n{digits} {:08x}\n", crc32fast::hash(digits.as_bytes()))).unwrap();
    let (state, second) = open();
    assert!(state.is_resumed());
    assert_eq!(second.run(), run);
    assert!(second.membership_for("mapping", 0, "x".as_ref()).clock().now_ns() > later_ns);
    second.close().unwrap();
}
