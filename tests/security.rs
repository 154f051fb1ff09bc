//! What others may see and do: nothing of a running deployment is open to other users or to the network, and no name in a file
//! leads out of the folders that the command line names.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod harness;

use std::collections::HashSet;
use std::fs;
use std::net::Ipv6Addr;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use drivelog::{Preamble, Recording};
use harness::{Bench, Run, signal, text};
use messages::{Pose, SonarReading, SonarScan};
use serde_json::Value;

const WORLD: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/config/worlds/corridor.toml");

/// The demo, with its page and its sonars, while it drives.
fn driving(bench: &Bench) -> Run {
    let kinds = ["recorder", "mapping", "fti", "std", "viewer", "simulator", "pioneer"];
    let processes = kinds.map(|kind| format!("[[process]]\nname = {kind:?}\nrun = {kind:?}\n")).concat();
    let settings = bench.write(
        "drive.toml",
        &format!(
            "name = \"drive\"\n{processes}[simulator]\nworld = {WORLD:?}\n[pioneer]\nport = \"simulator\"\n
            [mapping]\nexpect_verdicts = true\n[fti]\nexpect_camera = false\n"
        ),
    );
    // Under the most careless mask: what is private is so because we say so.
    let command = bench.stillmap(["run", settings.to_str().unwrap()]);
    let mut careless = bench.stillmap_by("sh");
    careless.args(["-c", "umask 0; exec \"$0\" \"$@\""]).arg(command.get_program()).args(command.get_args());
    let run = Run::start(careless);
    let is_served = |process: &Value| process["note"].as_str().is_some_and(|note| note.starts_with("http://"));
    drop(bench.wait_for("viewer", "it serves the page", is_served));
    drop(bench.wait_for("mapping", "it maps", |process| process["received"].as_u64() > Some(0)));
    run
}

fn end(run: Run) {
    signal(run.pid().into(), rustix::process::Signal::TERM);
    let ended = run.end();
    assert_eq!(ended.status.code(), Some(0), "{}", text(&ended.stderr));
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
    let supervisor = run.pid();
    let children = fs::read_to_string(format!("/proc/{supervisor}/task/{supervisor}/children")).unwrap();
    children.split_ascii_whitespace().map(|pid| pid.parse().unwrap()).chain([supervisor]).collect()
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
fn nothing_of_a_deployment_is_open_to_other_users() {
    let bench = Bench::new();
    let run = driving(&bench);
    bench.remember_domain();
    let left = bench.left_behind();
    let shared: Vec<&PathBuf> = left.iter().filter(|path| path.starts_with("/dev/shm")).collect();
    assert!(shared.len() > 20, "{shared:?}");
    for path in shared {
        let mode = fs::metadata(path).unwrap().mode();
        assert_eq!(mode & 0o077, 0, "{} has mode {mode:o}", path.display());
    }
    // Whoever cannot enter the folder cannot reach what is in it.
    for name in ["drive", "drive/bus", "drive/state"] {
        let folder = bench.runtime().join(name);
        let found = fs::metadata(&folder).unwrap();
        assert_eq!((found.mode() & 0o777, found.uid()), (0o700, rustix::process::getuid().as_raw()), "{name}");
    }
    for name in ["drive.lock", "drive.members"] {
        assert_eq!(fs::metadata(bench.runtime().join(name)).unwrap().mode() & 0o777, 0o600, "{name}");
    }
    end(run);
    assert_eq!(bench.left_behind(), Vec::<PathBuf>::new());
}

#[test]
fn nothing_listens_beyond_this_computer() {
    let bench = Bench::new();
    let run = driving(&bench);
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
        assert!(is_loopback, "{address} is not this computer alone");
    }
    // Names that begin with @ are in no folder: every user reaches them.
    let unix = fs::read_to_string("/proc/net/unix").unwrap();
    for line in unix.lines().skip(1) {
        let fields: Vec<&str> = line.split_ascii_whitespace().collect();
        let (inode, name) = (fields[6].parse::<u64>().unwrap(), fields.get(7).copied().unwrap_or_default());
        assert!(!ours.contains(&inode) || !name.starts_with('@'), "{name} is open to every user");
    }
    end(run);
}

/// A log whose settings want more than a map.
fn hostile_log(bench: &Bench) -> PathBuf {
    let settings = format!(
        "name = \"x\"\nout = \"{out}\"
        [[process]]\nname = \"mapping\"\nrun = \"mapping\"
        [[process]]\nname = \"recorder\"\nrun = \"recorder\"
        [[process]]\nname = \"driver\"\ncommand = [\"/bin/touch\", {touched:?}]
        [recorder]\nfile = \"written.mcap\"
        [viewer]\naddress = \"0.0.0.0\"\ntoken = \"known-to-strangers\"\n",
        out = bench.path("elsewhere").display(),
        touched = bench.path("touched"),
    );
    let preamble = Preamble { run: 1, robot: "../../robot".into(), sonars: Vec::new(), origin: "../../origin".into(), settings };
    let mut recording = Recording::new(&preamble).unwrap();
    let reading = SonarReading { range_m: 1.0, echo: 1, ..SonarReading::default() };
    for seq in 1..=20 {
        recording.scan(seq, seq * 100_000_000, &SonarScan::new(Pose::default(), &[reading], false)).unwrap();
    }
    recording.end::<SonarScan>(20, 2_000_000_000).unwrap();
    fs::create_dir(bench.path("logs")).unwrap();
    let log = bench.path("logs").join("drive.mcap");
    fs::write(&log, recording.finish().unwrap()).unwrap();
    log
}

#[test]
fn a_log_decides_nothing_but_the_map() {
    let bench = Bench::new();
    let log = hostile_log(&bench);
    for (arguments, made) in [
        (vec!["replay", log.to_str().unwrap()], "replay-out"),
        (vec!["log", "info", log.to_str().unwrap()], ""),
        (vec!["log", "recover", log.to_str().unwrap()], "logs/drive-recovered.mcap"),
    ] {
        let before: HashSet<PathBuf> = all_below(&bench.path("")).into_iter().collect();
        let ended = bench.output(&arguments);
        assert_eq!(ended.status.code(), Some(0), "{arguments:?}: {}{}", text(&ended.stdout), text(&ended.stderr));
        let fresh = all_below(&bench.path("")).into_iter().filter(|path| !before.contains(path));
        let astray: Vec<PathBuf> = fresh.filter(|path| made.is_empty() || !path.starts_with(bench.path(made))).collect();
        assert_eq!(astray, Vec::<PathBuf>::new(), "{arguments:?}");
        assert!(made.is_empty() || bench.path(made).exists(), "{arguments:?}");
    }
}

#[test]
fn names_in_settings_are_names() {
    let bench = Bench::new();
    for (section, key) in [
        ("name = \"../x\"", "name"),
        ("name = \"x\"\n[recorder]\nfile = \"../drive.mcap\"", "recorder.file"),
        ("name = \"x\"\n[recorder]\nfile = \"/tmp/drive.mcap\"", "recorder.file"),
        ("name = \"x\"\n[recorder]\nfile = \"..\"", "recorder.file"),
        ("name = \"x\"\n[[process]]\nname = \"../../mapping\"\nrun = \"mapping\"", "process[0].name"),
        ("name = \"x\"\n[[process]]\nname = \"a/b\"\nrun = \"mapping\"", "process[0].name"),
    ] {
        let settings = bench.write("bad.toml", section);
        for command in ["check", "run"] {
            let ended = bench.output([command, settings.to_str().unwrap()]);
            let said = text(&ended.stderr);
            assert_eq!(ended.status.code(), Some(2), "{section}: {said}");
            assert!(said.lines().any(|line| line.starts_with("error: ") && line.contains(key)), "{section}: {said}");
        }
    }
}
