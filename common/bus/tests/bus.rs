//! A domain, a writer and readers in one process: order, loss, history, refusal, and what is left behind.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use std::sync::atomic::{AtomicU32, Ordering};

use messages::{DeploymentStatus, Heartbeat, Payload, Phase, Pose, ProcessState, ProcessStatus, Progress, SonarScan, Text};
use stillmap_bus::{Context, Domain, DomainError, Kept, Next, Process, Reader, Received, RunningDomain, Shell, StepError, Tool, Writer};

/// A domain that no other test shares.
fn domain() -> Domain {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    Domain::open(&format!("test-bus-{}-{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed)), 1.0).unwrap()
}

fn scan(x_m: f64) -> SonarScan {
    SonarScan::new(Pose { x_m, ..Pose::default() }, &[], false)
}

fn shell(domain: &Domain, process: &str) -> Shell {
    Shell::join(domain.membership_for(process, 0, "settings.toml".as_ref())).unwrap()
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

#[test]
fn messages_arrive_once_in_order_and_the_end_is_said() {
    let domain = domain();
    let mut source = shell(&domain, "source");
    let mut sink = shell(&domain, "sink");
    let mut writer: Writer<SonarScan> = source.writer().unwrap();
    let mut reader: Reader<SonarScan> = sink.reader().unwrap();
    for seq in [1, 2, 2, 1, 3] {
        writer.send(seq, seq, &scan(0.5)).unwrap();
    }
    writer.end(3, 3).unwrap();
    assert_eq!(sequence(&mut reader), [1, 2, 3, 1_000_003]);
    assert!(reader.ended());
    drop((source, sink, writer, reader));
    domain.close().unwrap();
}

#[test]
fn what_is_missing_is_counted_and_what_cannot_be_meant_is_refused() {
    let domain = domain();
    let mut source = shell(&domain, "source");
    let mut sink = shell(&domain, "sink");
    let mut writer: Writer<SonarScan> = source.writer().unwrap();
    let mut reader: Reader<SonarScan> = sink.reader().unwrap();
    writer.send(1, 100, &scan(0.0)).unwrap();
    writer.send(4, 400, &scan(f64::NAN)).unwrap();
    writer.send(5, 50, &scan(0.0)).unwrap();
    writer.send(6, 600, &scan(1.25)).unwrap();
    let mut lost = Vec::new();
    while let Some(Received::Message(message)) = reader.take().unwrap() {
        lost.push((message.seq(), message.lost_before(), message.pose.x_m));
    }
    assert_eq!(lost, [(1, 0, 0.0), (6, 4, 1.25)]);
    drop((source, sink, writer, reader));
    domain.close().unwrap();
}

#[test]
fn a_late_reader_gets_the_history_and_skips_what_it_has() {
    let domain = domain();
    let mut source = shell(&domain, "source");
    let mut writer: Writer<SonarScan> = source.writer().unwrap();
    let history = SonarScan::SERVICE.qos.history as u64;
    let sent = history + 100;
    for seq in 1..=sent {
        writer.send(seq, seq, &scan(0.0)).unwrap();
    }
    let mut sink = shell(&domain, "sink");
    let mut reader: Reader<SonarScan> = sink.reader().unwrap();
    reader.skip_to(sent - history + 7, 0);
    writer.send(sent + 1, sent + 1, &scan(0.0)).unwrap();
    let taken = sequence(&mut reader);
    assert_eq!(taken, (sent - history + 8..=sent + 1).collect::<Vec<_>>());
    drop((source, sink, writer, reader));
    domain.close().unwrap();
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
fn who_is_needed_stays_when_it_has_finished_and_what_it_said_can_be_had_again() {
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
        shell.stay_for(["sink".to_owned()]);
        shell.run(&mut sending).unwrap();
    });
    let mut beats = 0;
    while beats < 3 {
        domain.refresh();
        while let Some(Received::Message(beat)) = heartbeats.take().unwrap() {
            assert!(!source.is_finished(), "it has gone");
            beats += u32::from(beat.phase == Phase::Ending as u32);
        }
        std::thread::yield_now();
    }
    let mut sink = shell(&domain, "sink");
    let mut reader: Reader<SonarScan> = sink.reader().unwrap();
    let mut taken = Vec::new();
    while taken.len() < 4 {
        taken.extend(sequence(&mut reader));
        std::thread::yield_now();
    }
    assert_eq!(taken, [1, 2, 3, 1_000_003]);
    statuses.send(2, 2, &told(ProcessState::Finished)).unwrap();
    while !source.is_finished() {
        domain.refresh();
        std::thread::yield_now();
    }
    source.join().unwrap();
    drop((sink, reader, heartbeats, statuses));
    domain.close().unwrap();
}

#[test]
fn a_domain_has_one_supervisor_and_leaves_nothing_behind() {
    let domain = domain();
    let directory = domain.directory().to_owned();
    let name = directory.file_name().unwrap().to_str().unwrap().to_owned();
    let Err(error) = Domain::open(&name, 1.0) else { panic!("two supervisors") };
    assert!(matches!(&error, DomainError::Running { pid, .. } if *pid == std::process::id().to_string()), "{error}");

    let running = RunningDomain::all().unwrap();
    let found = running.iter().find(|found| found.name() == name).unwrap();
    let tool = Tool::join(found).unwrap();
    drop(tool);

    let prefix = format!("stillmap_{:08x}_", crc32fast::hash(directory.as_os_str().as_encoded_bytes()));
    let in_shared_memory = || {
        let names = std::fs::read_dir("/dev/shm").unwrap().flatten();
        names.filter(|entry| entry.file_name().to_string_lossy().starts_with(&prefix)).count()
    };
    assert!(in_shared_memory() > 0);
    domain.close().unwrap();
    assert_eq!(in_shared_memory(), 0);
    assert!(!directory.exists());
    assert!(!directory.with_extension("lock").exists());
    assert!(!directory.with_extension("members").exists());
}

#[test]
fn a_name_that_could_leave_its_folder_is_refused() {
    for name in ["", "..", "a/b", "Demo", "x".repeat(41).as_str()] {
        assert!(matches!(Domain::open(name, 1.0), Err(DomainError::Name { .. })), "{name}");
    }
}

#[test]
fn a_run_that_goes_on_is_later_than_its_last_note_whatever_the_wall_clock_says() {
    let out = tempfile::tempdir().unwrap();
    let folder = out.path().join("state");
    let name = format!("test-bus-goes-on-{}", std::process::id());
    let open = || Domain::open_with(&name, 1.0, &[], Some(Kept { folder: &folder, made_with: "cells of 0.1 m", fresh: false })).unwrap();
    let first = open();
    let (run, noted_ns) = (first.run(), first.membership_for("mapping", 0, "x".as_ref()).clock().now_ns());
    assert!(!first.goes_on());
    first.close().unwrap();

    // As if the wall clock had been set back by an hour since.
    let (note, later_ns) = (folder.join("run"), noted_ns + 3_600_000_000_000);
    let text = std::fs::read_to_string(&note).unwrap();
    let (head, _) = text.trim_end().rsplit_once('\n').unwrap();
    std::fs::write(&note, format!("{head}\n{later_ns}\n")).unwrap();
    let second = open();
    assert!(second.goes_on());
    assert_eq!(second.run(), run);
    assert!(second.membership_for("mapping", 0, "x".as_ref()).clock().now_ns() > later_ns);
    second.close().unwrap();
}
