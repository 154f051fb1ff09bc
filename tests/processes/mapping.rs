//! The mapping process on a bus of its own publishes and writes what its fold gives, also when it is killed in between.

use std::f64::consts::TAU;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use bus::{Domain, Reader, Received, Writer};
use mapping::export::MapCopy;
use mapping::{Input, Mapper, Parameters};
use messages::{Heartbeat, Layer, MapSummary, MapTile, Pose, Progress, SonarReading, SonarScan, WayChunk};
use runtime::Shell;

const SCANS: u64 = 400;

fn start(domain: &Domain, incarnation: u32, settings: &Path) -> Child {
    let membership = domain.membership_for("mapping", incarnation, settings);
    let mut command = Command::new(env!("CARGO_BIN_EXE_stillmap"));
    command.args(["process", "mapping"]).envs(membership.environment()).stdout(Stdio::null());
    command.spawn().unwrap()
}

fn scan(seq: u64) -> (u64, SonarScan) {
    let turn = seq as f64 * 0.05;
    let pose = Pose { x_m: turn.cos(), y_m: turn.sin(), yaw_rad: turn };
    let reading = |sonar: u32| SonarReading {
        mount: Pose { yaw_rad: f64::from(sonar) * TAU / 7.0, ..Pose::default() },
        range_m: 0.5 + ((seq * 7 + u64::from(sonar) * 3) % 25) as f64 * 0.1,
        sonar,
        echo: u32::from(!seq.is_multiple_of(5)),
    };
    (seq * 100_000_000, SonarScan::new(pose, &[reading(seq as u32 % 7), reading((seq as u32 + 3) % 7)], false))
}

fn fold() -> Mapper {
    let mut mapper = Mapper::new(&Parameters::default()).unwrap();
    for seq in 1..=SCANS {
        let (stamp_ns, scan) = scan(seq);
        mapper.step(Input::Scan { seq, stamp_ns, scan: &scan }).unwrap();
    }
    mapper.step(Input::End).unwrap();
    mapper.refresh();
    mapper
}

/// A mapping process with all its inputs and outputs.
struct Bench {
    folder: tempfile::TempDir,
    scans: Writer<SonarScan>,
    progress: Reader<Progress>,
    tiles: Reader<MapTile>,
    path: Reader<WayChunk>,
    summaries: Reader<MapSummary>,
    copy: MapCopy,
    summary: Option<MapSummary>,
    watcher: Shell,
    domain: Domain,
    process: Option<Child>,
}

impl Bench {
    fn new(name: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let text = "name = \"x\"\npace = \"lockstep\"\nout = \"out\"\n[[process]]\nname = \"mapping\"\nrun = \"mapping\"\n[[process]]\nname = \"playback\"\nrun = \"playback\"\n";
        std::fs::write(folder.path().join("settings.toml"), text).unwrap();
        let mut domain = Domain::open(&format!("test-map-{name}-{}", std::process::id()), 1.0).unwrap();
        let mut watcher = Shell::join(domain.membership_for("watcher", 0, "settings.toml".as_ref())).unwrap();
        Self {
            scans: domain.writer().unwrap(),
            progress: watcher.reader().unwrap(),
            tiles: watcher.reader().unwrap(),
            path: watcher.reader().unwrap(),
            summaries: watcher.reader().unwrap(),
            copy: MapCopy::default(),
            summary: None,
            folder,
            watcher,
            domain,
            process: None,
        }
    }

    fn start(&mut self, incarnation: u32) {
        self.process = Some(start(&self.domain, incarnation, &self.folder.path().join("settings.toml")));
    }

    fn kill(&mut self) {
        let mut process = self.process.take().unwrap();
        process.kill().unwrap();
        process.wait().unwrap();
        self.domain.remove_dead_nodes();
    }

    /// Waits for messages; a process that has failed sends none.
    fn wait(&mut self) {
        let ended = self.process.as_mut().unwrap().try_wait().unwrap();
        assert!(ended.is_none_or(|status| status.success()), "the process failed: {ended:?}");
        self.domain.refresh();
        self.watcher.wait_for_inputs(Duration::from_millis(50)).unwrap();
    }

    fn send(&mut self, seqs: std::ops::RangeInclusive<u64>) {
        for seq in seqs {
            let (stamp_ns, scan) = scan(seq);
            self.scans.send(seq, stamp_ns, &scan).unwrap();
        }
    }

    fn wait_until_answered(&mut self, seq: u64) {
        loop {
            while let Some(received) = self.progress.take().unwrap() {
                if matches!(received, Received::Message(progress) if progress.answered >= seq) {
                    return;
                }
            }
            self.look();
            self.wait();
        }
    }

    /// Ends the scans, once all readers are connected to the process: messages of a process that has exited do not reach later readers.
    fn end(&mut self) {
        self.wait_until_answered(SCANS);
        self.end_at(SCANS, SCANS * 100_000_000);
    }

    fn end_at(&mut self, seq: u64, stamp_ns: u64) {
        self.look();
        self.scans.end(seq, stamp_ns).unwrap();
    }

    /// Takes the messages that have arrived.
    fn look(&mut self) {
        while let Some(received) = self.tiles.take().unwrap() {
            if let Received::Message(tile) = received {
                self.copy.take_tile(&tile);
            }
        }
        while let Some(received) = self.path.take().unwrap() {
            if let Received::Message(chunk) = received {
                self.copy.take_way(&chunk);
            }
        }
        while let Some(received) = self.summaries.take().unwrap() {
            if let Received::Message(summary) = received {
                self.summary = Some(*summary);
            }
        }
    }

    /// Takes messages until the summary of the complete map has arrived.
    fn receive_all(&mut self) -> MapSummary {
        loop {
            let is_over = self.process.as_mut().unwrap().try_wait().unwrap().is_some();
            self.look();
            if let (true, Some(summary)) = (self.summaries.ended(), self.summary) {
                assert!(self.process.take().unwrap().wait().unwrap().success());
                return summary;
            }
            assert!(!is_over, "the process has exited before its map was complete");
            self.wait();
        }
    }

    fn close(self) {
        let Self { domain, scans, progress, tiles, path, summaries, watcher, folder: _folder, .. } = self;
        drop((scans, progress, tiles, path, summaries, watcher));
        domain.close().unwrap();
    }
}

#[test]
fn mapping_publishes_and_writes_the_map_of_its_fold() {
    let mut bench = Bench::new("whole");
    bench.start(0);
    bench.send(1..=SCANS);
    bench.end();
    let summary = bench.receive_all();
    let received = &bench.copy;

    let fold = fold();
    assert_eq!(summary, fold.summary());
    let mut expected = MapCopy::default();
    fold.shown_tiles(Layer::Filtered).for_each(|tile| expected.take_tile(&tile));
    expected.set_way(fold.way_m());
    assert!(received.is_whole());
    let files = expected.files().unwrap().files;
    assert!(received.files().unwrap().files == files);
    assert_eq!(files.iter().map(|file| file.name).collect::<Vec<_>>(), ["map.pgm", "map.yaml", "map.png"]);
    for file in files {
        assert!(std::fs::read(bench.folder.path().join("out").join(file.name)).unwrap() == file.contents, "{}", file.name);
    }
    bench.close();
}

#[test]
fn a_part_far_away_is_left_out_of_the_files_and_counted() {
    let mut bench = Bench::new("far");
    let mut heartbeats = bench.watcher.reader::<Heartbeat>().unwrap();
    bench.start(0);
    bench.send(1..=SCANS);
    // An hour later the robot may be anywhere.
    let (stamp_ns, (_, last)) = (SCANS * 100_000_000 + 3_600_000_000_000, scan(SCANS));
    let far = Pose { x_m: 600.0, y_m: 600.0, yaw_rad: 0.0 };
    bench.scans.send(SCANS + 1, stamp_ns, &SonarScan::new(far, &last.readings[..1], false)).unwrap();
    bench.wait_until_answered(SCANS + 1);
    // Connects to the process, so that its last heartbeat arrives.
    assert!(heartbeats.take().unwrap().is_some());
    bench.end_at(SCANS + 1, stamp_ns);
    assert_eq!(bench.receive_all().scans, SCANS + 1);

    let written = std::fs::read(bench.folder.path().join("out/map.pgm")).unwrap();
    let mut near = MapCopy::default();
    fold().shown_tiles(Layer::Filtered).for_each(|tile| near.take_tile(&tile));
    assert!(written == near.files().unwrap().files[0].contents);
    let mut left_out = None;
    while let Some(received) = heartbeats.take().unwrap() {
        if let Received::Message(heartbeat) = received {
            let counter = heartbeat.counters.iter().find(|counter| counter.name.as_str() == "cells left out");
            left_out = counter.map(|counter| counter.value);
        }
    }
    assert_eq!(left_out, Some(bench.copy.files().unwrap().left_out[0].cells));
    bench.close();
}

#[test]
fn mapping_killed_in_between_ends_with_the_same_map() {
    let mut bench = Bench::new("killed");
    let mut sent = 0;
    for (incarnation, last) in [(0, 90), (1, 91), (2, 300)] {
        bench.start(incarnation);
        bench.send(sent + 1..=last);
        bench.wait_until_answered(last);
        bench.kill();
        sent = last;
    }
    bench.start(3);
    bench.send(sent + 1..=SCANS);
    bench.end();
    assert_eq!(bench.receive_all(), fold().summary());
    bench.close();
}
