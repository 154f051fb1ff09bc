//! Programs on the shared ports: what they send, what they miss, how they leave.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::time::{Duration, Instant};

use psos::{Command, number};
use rustix::event::{PollFd, PollFlags, poll};
use stillmap_pioneer::{Share, Shared};

fn program(link: &Path) -> File {
    OpenOptions::new().read(true).write(true).open(link).unwrap()
}

fn pulse() -> Vec<u8> {
    Command::plain(number::PULSE).encode().unwrap()
}

/// Reads until something has come.
fn read(share: &mut Share) -> Vec<Shared> {
    loop {
        let taken = share.read(Instant::now());
        if !taken.is_empty() {
            return taken;
        }
        std::thread::yield_now();
    }
}

fn is_remark(shared: &Shared, says: &str) -> bool {
    matches!(shared, Shared::Remark(words) if words.contains(says))
}

#[test]
fn packets_pass_whole_however_they_are_cut() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("robot");
    let mut share = Share::open(Some(link.clone()), None).unwrap();
    let mut program = program(&link);
    let (head, tail) = (pulse()[..4].to_vec(), pulse()[4..].to_vec());
    program.write_all(&head).unwrap();
    assert_eq!(share.read(Instant::now()), []);
    program.write_all(&tail).unwrap();
    program.write_all(&pulse()).unwrap();
    let mut taken = read(&mut share);
    while taken.len() < 2 {
        taken.extend(read(&mut share));
    }
    assert_eq!(taken, [Shared::Command(vec![0]), Shared::Command(vec![0])]);
}

#[test]
fn the_robots_bytes_reach_the_program_that_reads() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("robot");
    let mut share = Share::open(Some(link.clone()), None).unwrap();
    share.write(b"before any program");
    let mut program = program(&link);
    assert_eq!(share.read(Instant::now()), []);
    share.write(&[0xFA, 0xFB, 10, 13]);
    let mut bytes = [0; 4];
    program.read_exact(&mut bytes).unwrap();
    assert_eq!(bytes, [0xFA, 0xFB, 10, 13]);
}

#[test]
fn a_program_that_leaves_is_noticed_once() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("robot");
    let mut share = Share::open(Some(link.clone()), None).unwrap();
    for _ in 0..2 {
        let mut program = program(&link);
        program.write_all(&pulse()).unwrap();
        assert_eq!(read(&mut share), [Shared::Command(vec![0])]);
        drop(program);
        assert_eq!(read(&mut share), [Shared::Left]);
        assert_eq!(share.read(Instant::now()), []);
    }
}

#[test]
fn what_a_program_left_unread_is_not_for_the_next() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("robot");
    let mut share = Share::open(Some(link.clone()), None).unwrap();
    let first = program(&link);
    assert_eq!(share.read(Instant::now()), []);
    share.write(b"old");
    drop(first);
    assert_eq!(share.read(Instant::now()), []);
    let mut second = program(&link);
    assert_eq!(share.read(Instant::now()), []);
    share.write(b"new");
    let mut bytes = [0; 3];
    second.read_exact(&mut bytes).unwrap();
    assert_eq!(&bytes, b"new");
}

#[test]
fn a_program_that_does_not_read_is_reported_seldom() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("robot");
    let mut share = Share::open(Some(link.clone()), None).unwrap();
    let _program = program(&link);
    assert_eq!(share.read(Instant::now()), []);
    for _ in 0..1000 {
        share.write(&[7; 100]);
    }
    let taken = share.read(Instant::now());
    assert!((1..=10).contains(&taken.len()) && taken.iter().all(|it| is_remark(it, "does not read")), "{taken:?}");
}

#[test]
fn noise_is_dropped_and_reported_seldom() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("robot");
    let mut share = Share::open(Some(link.clone()), None).unwrap();
    let mut program = program(&link);
    let mut remarks = 0;
    for _ in 0..100 {
        program.write_all(&[0x55; 100]).unwrap();
        program.write_all(&pulse()).unwrap();
        let mut taken = read(&mut share);
        while !taken.contains(&Shared::Command(vec![0])) {
            taken.extend(read(&mut share));
        }
        remarks += taken.iter().filter(|it| is_remark(it, "no packets")).count();
        assert!(!taken.iter().any(|it| matches!(it, Shared::Command(data) if data != &[0])), "{taken:?}");
    }
    assert!((1..=8).contains(&remarks), "{remarks}");
}

#[test]
fn of_two_programs_the_first_commands_until_it_is_silent() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("robot");
    let mut share = Share::open(Some(link.clone()), Some(0)).unwrap();
    let address = share.names().nth(1).unwrap().to_owned();
    let mut first = program(&link);
    let mut second = TcpStream::connect(&address).unwrap();
    first.write_all(&pulse()).unwrap();
    assert_eq!(read(&mut share), [Shared::Command(vec![0])]);
    second.write_all(&pulse()).unwrap();
    let ignored = read(&mut share);
    assert!(matches!(&ignored[..], [remark] if is_remark(remark, "another program commands")), "{ignored:?}");
    // The robot's watchdog has stopped it by then.
    second.write_all(&pulse()).unwrap();
    let later = Instant::now() + Duration::from_secs(3);
    let taken = loop {
        let taken = share.read(later);
        if !taken.is_empty() {
            break taken;
        }
    };
    assert_eq!(taken, [Shared::Command(vec![0])]);
}

#[test]
fn a_second_connection_is_turned_away() {
    let mut share = Share::open(None, Some(0)).unwrap();
    let address = share.names().next().unwrap().to_owned();
    let mut first = TcpStream::connect(&address).unwrap();
    first.write_all(&pulse()).unwrap();
    assert_eq!(read(&mut share), [Shared::Command(vec![0])]);
    let mut second = TcpStream::connect(&address).unwrap();
    let turned_away = read(&mut share);
    assert!(matches!(&turned_away[..], [remark] if is_remark(remark, "turned away")), "{turned_away:?}");
    assert_eq!(second.read(&mut [0]).unwrap(), 0);
    share.write(&[1, 2]);
    let mut bytes = [0; 2];
    first.read_exact(&mut bytes).unwrap();
    drop(first);
    assert_eq!(read(&mut share), [Shared::Left]);
}

#[test]
fn an_idle_terminal_does_not_wake_the_driver() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("robot");
    let mut share = Share::open(Some(link.clone()), None).unwrap();
    assert_eq!(share.descriptors().count(), 0);
    let mut program = program(&link);
    assert_eq!(share.read(Instant::now()), []);
    program.write_all(&pulse()).unwrap();
    let mut ready: Vec<_> = share.descriptors().map(|it| PollFd::from_borrowed_fd(it, PollFlags::IN)).collect();
    poll(&mut ready, None).unwrap();
    assert_eq!(ready.len(), 1);
}

#[test]
fn ports_that_cannot_be_opened_are_named() {
    let taken = Share::open(None, Some(0)).unwrap();
    let port = taken.names().next().unwrap().rsplit_once(':').unwrap().1.parse().unwrap();
    let error = Share::open(None, Some(port)).unwrap_err().to_string();
    assert!(error.starts_with(&format!("TCP port {port}: ")), "{error}");
    let error = Share::open(Some("/no/such/folder/robot".into()), None).unwrap_err().to_string();
    assert!(error.starts_with("/no/such/folder/robot: "), "{error}");
}
