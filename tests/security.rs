//! What other users, the network and foreign files can see and do: nothing of a running deployment is open to them, and no name in a
//! file leads out of the folders that the command line names.

use std::collections::HashSet;
use std::fs;
use std::net::Ipv6Addr;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use drivelog::{Preamble, Recording};
use messages::{Pose, SonarReading, SonarScan};
use rustix::fs::inotify::WatchFlags;
use rustix::process::Signal;

use crate::harness::inotify::Inotify;
use crate::harness::processes::{children, signal};
use crate::harness::{Deployment, Run, Sandbox, worlds};
use crate::live_page::page_address;

/// A drive with its page, in mid-drive.
fn driving(sandbox: &Sandbox) -> Run {
    let drive = Deployment::new("drive", &["recorder", "mapping", "fti", "std", "viewer", "simulator", "pioneer"]);
    let drive = drive.set("simulator.world", worlds::path("corridor")).set("pioneer.port", "simulator");
    // Under the most permissive mask: files are private by what the command does, not by the user's mask.
    let command = sandbox.command(&drive, &[]);
    let mut permissive = sandbox.program("sh");
    permissive.args(["-c", "umask 0; exec \"$0\" \"$@\""]).arg(command.get_program()).args(command.get_args());
    let mut run = sandbox.run_by(permissive, &drive);
    page_address(&mut run);
    run.wait_for("mapping", "it maps", |it| it.received > 0);
    run
}

fn end(run: Run) {
    signal(run.pid(), Signal::TERM);
    run.end().assert_code(0);
}

/// Everything below a folder.
fn all_below(folder: &Path) -> Vec<PathBuf> {
    let mut found = vec![folder.to_owned()];
    for entry in fs::read_dir(folder).unwrap().flatten() {
        if entry.file_type().unwrap().is_dir() {
            found.extend(all_below(&entry.path()));
        } else {
            found.push(entry.path());
        }
    }
    found
}

/// The supervisor and its children.
fn pids(run: &Run) -> Vec<u32> {
    children(run.pid()).into_iter().chain([run.pid()]).collect()
}

/// Inodes of the sockets of these processes.
fn sockets(pids: &[u32]) -> HashSet<u64> {
    let open = pids.iter().flat_map(|pid| fs::read_dir(format!("/proc/{pid}/fd")).unwrap().flatten());
    let targets = open.filter_map(|entry| fs::read_link(entry.path()).ok());
    targets.filter_map(|target| target.to_str()?.strip_prefix("socket:[")?.strip_suffix(']')?.parse().ok()).collect()
}

/// Local addresses of the sockets in a table of `/proc/net`, as they stand there, with their inodes; of TCP those that listen.
fn local_addresses(table: &str) -> Vec<(String, u64)> {
    const LISTENS: &str = "0A";
    let text = fs::read_to_string(format!("/proc/net/{table}")).unwrap_or_default();
    let rows = text.lines().skip(1).map(|line| line.split_ascii_whitespace().collect::<Vec<_>>());
    let rows = rows.filter(|row| table.starts_with("udp") || row.get(3) == Some(&LISTENS));
    rows.map(|row| (row[1].rsplit_once(':').unwrap().0.to_owned(), row[9].parse().unwrap())).collect()
}

#[test]
fn other_users_cannot_open_anything_of_a_deployment() {
    let sandbox = Sandbox::new();
    let run = driving(&sandbox);
    let shared = sandbox.shared_memory();
    assert!(shared.len() > 20, "{shared:?}");
    for path in shared {
        let mode = fs::metadata(&path).unwrap().mode();
        assert_eq!(mode & 0o077, 0, "{} has mode {mode:o}", path.display());
    }
    // The first checkpoint makes the folder of checkpoints.
    let state = sandbox.runtime().join("drive/state");
    Inotify::watch(&sandbox.runtime().join("drive"), WatchFlags::CREATE).wait_until("a checkpoint", || state.exists());
    // A user who cannot enter the folder cannot reach what is in it.
    for name in ["drive", "drive/bus", "drive/state"] {
        let folder = sandbox.runtime().join(name);
        let found = fs::metadata(&folder).unwrap();
        assert_eq!((found.mode() & 0o777, found.uid()), (0o700, rustix::process::getuid().as_raw()), "{name}");
    }
    for name in ["drive.lock", "drive.members"] {
        assert_eq!(fs::metadata(sandbox.runtime().join(name)).unwrap().mode() & 0o777, 0o600, "{name}");
    }
    end(run);
    sandbox.assert_nothing_left();
}

#[test]
fn a_deployment_listens_on_the_loopback_interface_only() {
    let sandbox = Sandbox::new();
    let run = driving(&sandbox);
    let ours = sockets(&pids(&run));
    let of_tables = |tables: [&str; 4]| tables.map(local_addresses).concat().into_iter().filter(|(_, inode)| ours.contains(inode));
    let addresses: Vec<String> = of_tables(["tcp", "tcp6", "udp", "udp6"]).map(|(address, _)| address).collect();
    assert!(!addresses.is_empty(), "the page is served");
    for address in addresses {
        // Words of four bytes, each in the order of this machine.
        let words: Vec<u32> =
            (0..address.len() / 8).map(|word| u32::from_str_radix(&address[word * 8..word * 8 + 8], 16).unwrap()).collect();
        let bytes: Vec<u8> = words.into_iter().flat_map(u32::to_ne_bytes).collect();
        let is_loopback = match <[u8; 16]>::try_from(bytes.as_slice()) {
            Ok(bytes) => Ipv6Addr::from(bytes).is_loopback(),
            Err(_) => bytes.first() == Some(&127),
        };
        assert!(is_loopback, "{address} is no loopback address");
    }
    // Socket names that begin with @ are in no folder: every user reaches them.
    let unix = fs::read_to_string("/proc/net/unix").unwrap();
    for line in unix.lines().skip(1) {
        let fields: Vec<&str> = line.split_ascii_whitespace().collect();
        let (inode, name) = (fields[6].parse::<u64>().unwrap(), fields.get(7).copied().unwrap_or_default());
        assert!(!ours.contains(&inode) || !name.starts_with('@'), "{name} is open to every user");
    }
    end(run);
}

/// A log whose settings ask for more than a map.
fn hostile_log(sandbox: &Sandbox) -> PathBuf {
    let hostile = Deployment::new("x", &["mapping", "recorder"]).set("out", sandbox.path("elsewhere"));
    let hostile = hostile.with_driver(["/bin/touch".into(), sandbox.path("touched")]).set("recorder.file", "written.mcap");
    let settings = hostile.set("viewer.address", "0.0.0.0").set("viewer.token", "known-to-strangers").to_toml();
    let preamble = Preamble { run: 1, robot: "../../robot".into(), sonars: Vec::new(), origin: "../../origin".into(), settings };
    let mut recording = Recording::new(&preamble).unwrap();
    let reading = SonarReading { range_m: 1.0, echo: 1, ..SonarReading::default() };
    for seq in 1..=20 {
        recording.scan(seq, seq * 100_000_000, &SonarScan::new(Pose::default(), &[reading], false)).unwrap();
    }
    recording.end::<SonarScan>(20, 2_000_000_000).unwrap();
    fs::create_dir(sandbox.path("logs")).unwrap();
    let log = sandbox.path("logs").join("drive.mcap");
    fs::write(&log, recording.finish().unwrap()).unwrap();
    log
}

#[test]
fn the_settings_in_a_log_only_affect_the_map() {
    let sandbox = Sandbox::new();
    let log = hostile_log(&sandbox);
    for (arguments, made) in [
        (vec!["replay", log.to_str().unwrap()], "replay-out"),
        (vec!["log", "info", log.to_str().unwrap()], ""),
        (vec!["log", "recover", log.to_str().unwrap()], "logs/drive-recovered.mcap"),
    ] {
        let before: HashSet<PathBuf> = all_below(&sandbox.path("")).into_iter().collect();
        let ended = sandbox.output(&arguments);
        assert_eq!(ended.code, Some(0), "{arguments:?}: {}{}", ended.stdout, ended.stderr);
        let fresh = all_below(&sandbox.path("")).into_iter().filter(|path| !before.contains(path));
        let astray: Vec<PathBuf> = fresh.filter(|path| made.is_empty() || !path.starts_with(sandbox.path(made))).collect();
        assert_eq!(astray, Vec::<PathBuf>::new(), "{arguments:?}");
        assert!(made.is_empty() || sandbox.path(made).exists(), "{arguments:?}");
    }
}

#[test]
fn names_in_settings_that_are_paths_are_refused() {
    let sandbox = Sandbox::new();
    let x = || Deployment::new("x", &[]);
    for (bad, key) in [
        (x().set("name", "../x"), "name"),
        (x().set("recorder.file", "../drive.mcap"), "recorder.file"),
        (x().set("recorder.file", "/tmp/drive.mcap"), "recorder.file"),
        (x().set("recorder.file", ".."), "recorder.file"),
        (x().set("process", [toml::toml! { name = "../../mapping" run = "mapping" }]), "process[0].name"),
        (x().set("process", [toml::toml! { name = "a/b" run = "mapping" }]), "process[0].name"),
    ] {
        let settings = sandbox.write("bad.toml", &bad.to_toml());
        for command in ["check", "run"] {
            let ended = sandbox.output([command, settings.to_str().unwrap()]);
            ended.assert_code(2);
            let said = ended.stderr;
            assert!(said.lines().any(|line| line.starts_with("error: ") && line.contains(key)), "{bad:?}: {said}");
        }
    }
}
