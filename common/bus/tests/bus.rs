//! A domain, a writer and readers in one process: order, loss, history, refusal, and what is left behind.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use std::sync::atomic::{AtomicU32, Ordering};

use messages::{Payload, Pose, SonarScan};
use stillmap_bus::{Domain, DomainError, Ports, Reader, Received, RunningDomain, Writer};

/// A domain that no other test shares.
fn domain() -> Domain {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    Domain::open(&format!("test-bus-{}-{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed)), 1.0).unwrap()
}

fn scan(x_m: f64) -> SonarScan {
    SonarScan::new(Pose { x_m, ..Pose::default() }, &[], false)
}

fn ports(domain: &Domain, process: &str) -> Ports {
    Ports::join(&domain.membership_for(process, 0, "settings.toml".as_ref())).unwrap()
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
    let mut source = ports(&domain, "source");
    let mut sink = ports(&domain, "sink");
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
fn a_reader_that_takes_the_place_of_another_has_joined() {
    let domain = domain();
    let (mut source, mut sink) = (ports(&domain, "source"), ports(&domain, "sink"));
    let mut writer: Writer<SonarScan> = source.writer().unwrap();
    assert!(!writer.joined());
    let first: Reader<SonarScan> = sink.reader().unwrap();
    assert!(writer.joined());
    assert!(!writer.joined());
    drop(first);
    let second: Reader<SonarScan> = sink.reader().unwrap();
    assert!(writer.joined(), "there are as many readers as before");
    drop(second);
    assert!(!writer.joined());
    drop((source, sink, writer));
    domain.close().unwrap();
}

#[test]
fn missing_messages_are_counted_and_invalid_ones_refused() {
    let domain = domain();
    let mut source = ports(&domain, "source");
    let mut sink = ports(&domain, "sink");
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
    let mut source = ports(&domain, "source");
    let mut writer: Writer<SonarScan> = source.writer().unwrap();
    let history = SonarScan::SERVICE.qos.history as u64;
    let sent = history + 100;
    for seq in 1..=sent {
        writer.send(seq, seq, &scan(0.0)).unwrap();
    }
    let mut sink = ports(&domain, "sink");
    let mut reader: Reader<SonarScan> = sink.reader().unwrap();
    reader.skip_to(sent - history + 7, 0);
    writer.send(sent + 1, sent + 1, &scan(0.0)).unwrap();
    let taken = sequence(&mut reader);
    assert_eq!(taken, (sent - history + 8..=sent + 1).collect::<Vec<_>>());
    drop((source, sink, writer, reader));
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
    let observer = Ports::observe(found).unwrap();
    drop(observer);

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
