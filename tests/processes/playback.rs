//! The process on a bus of its own: scans and frames of a log come in the order of sensor time, lockstep waits for both.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use bus::{Domain, FrameReader, Reader, Received, Writer};
use drivelog::{Preamble, Recording};
use messages::{CameraFrame, CameraMotion, FrameLayout, Payload, Pictures, PixelFormat, Pose, Progress, SonarScan, Text};
use runtime::Shell;

const SCANS: u64 = 40;
const FRAMES: u64 = 70;
/// Frames that lockstep has on the way.
const FRAME_WINDOW: u64 = messages::Replay::FRAMES.window as u64;

fn scan_stamp(seq: u64) -> u64 {
    1_000_000 * (100 + seq * 100)
}

fn frame_stamp(seq: u64) -> u64 {
    1_000_000 * (50 + seq * 66)
}

fn layout() -> FrameLayout {
    FrameLayout::packed(20, 16, PixelFormat::Grey)
}

/// A log in which the frames stand far behind the scans of their time, as a recorder that was busy writes them.
fn write_log(path: &Path) {
    let preamble = Preamble { run: 1, robot: "pioneer-1".into(), sonars: Vec::new(), origin: "a test".into(), settings: String::new() };
    let mut recording = Recording::new(&preamble).unwrap();
    for seq in 1..=SCANS {
        let scan = SonarScan::new(Pose { x_m: seq as f64, ..Pose::default() }, &[], false);
        recording.scan(seq, scan_stamp(seq), &scan).unwrap();
        recording.message(seq, scan_stamp(seq), &CameraMotion::default()).unwrap();
    }
    for seq in 1..=FRAMES {
        recording.picture::<CameraFrame>(seq, frame_stamp(seq), &layout(), &[seq as u8; 320]).unwrap();
    }
    recording.end::<SonarScan>(SCANS, scan_stamp(SCANS)).unwrap();
    std::fs::write(path, recording.finish().unwrap()).unwrap();
}

/// Playback, and a mapping and an SBS that are played by the test.
struct Bench {
    folder: tempfile::TempDir,
    scans: Reader<SonarScan>,
    frames: FrameReader<CameraFrame>,
    motions: Reader<CameraMotion>,
    progress: Writer<Progress>,
    shell: Shell,
    domain: Domain,
    process: Option<Child>,
    /// Number and stamp of what has come: scans, frames.
    taken: [Vec<(u64, u64)>; 2],
}

impl Bench {
    fn new(name: &str, pace: &str, speed: f64, with_sbs: bool) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let sbs = if with_sbs { "[[process]]\nname = \"eyes\"\nrun = \"sbs\"\n" } else { "" };
        let text = format!(
            "name = \"x\"\npace = \"{pace}\"\n[[process]]\nname = \"mapping\"\nrun = \"mapping\"\n{sbs}[[process]]\nname = \"playback\"\nrun = \"playback\"\n[playback]\nlog = \"drive.mcap\"\nwindow = 10\ncamera_motion = {}\n",
            !with_sbs
        );
        std::fs::write(folder.path().join("settings.toml"), text).unwrap();
        write_log(&folder.path().join("drive.mcap"));
        let domain = Domain::open(&format!("test-play-{name}-{}", std::process::id()), speed).unwrap();
        let mut shell = Shell::join(domain.membership_for("test", 0, "settings.toml".as_ref())).unwrap();
        Self {
            scans: shell.reader().unwrap(),
            frames: shell.frame_reader().unwrap(),
            motions: shell.reader().unwrap(),
            progress: shell.writer().unwrap(),
            folder,
            shell,
            domain,
            process: None,
            taken: [Vec::new(), Vec::new()],
        }
    }

    fn start(&mut self, incarnation: u32) {
        let membership = self.domain.membership_for("playback", incarnation, &self.folder.path().join("settings.toml"));
        let mut command = Command::new(env!("CARGO_BIN_EXE_stillmap"));
        command.args(["process", "playback"]).envs(membership.environment()).stdout(Stdio::null());
        self.process = Some(command.spawn().unwrap());
    }

    fn wait(&mut self) {
        let ended = self.process.as_mut().unwrap().try_wait().unwrap();
        assert!(ended.is_none_or(|status| status.success()), "the process failed: {ended:?}");
        self.shell.wait_for_inputs(Duration::from_millis(50)).unwrap();
    }

    /// Takes what has come.
    fn take(&mut self) {
        while let Some(received) = self.scans.take().unwrap() {
            if let Received::Message(scan) = received {
                assert!((scan.pose.x_m - scan.seq() as f64).abs() < 1e-9);
                self.taken[0].push((scan.seq(), scan.stamp_ns()));
            }
        }
        while let Some(received) = self.frames.take().unwrap() {
            if let Received::Message(frame) = received {
                assert_eq!((frame.layout(), frame.bytes()), (layout(), &[frame.seq() as u8; 320][..]));
                self.taken[1].push((frame.seq(), frame.stamp_ns()));
            }
        }
    }

    fn answer(&mut self, process: &str, service: &str, answered: u64) {
        let progress = Progress { process: Text::new(process), service: Text::new(service), answered };
        self.progress.send(answered, 0, &progress).unwrap();
    }

    fn last(&self, stream: usize) -> u64 {
        self.taken[stream].last().map_or(0, |(seq, _)| *seq)
    }

    fn check_complete(&self) {
        let numbers = |stream: usize| self.taken[stream].iter().map(|(seq, _)| *seq).collect::<Vec<_>>();
        assert_eq!(numbers(0), (1..=SCANS).collect::<Vec<_>>());
        assert_eq!(numbers(1), (1..=FRAMES).collect::<Vec<_>>());
    }

    fn close(self) {
        let Self { domain, scans, frames, motions, progress, shell, folder: _folder, mut process, .. } = self;
        if let Some(process) = &mut process {
            process.kill().unwrap();
            process.wait().unwrap();
        }
        drop((scans, frames, motions, progress, shell));
        domain.close().unwrap();
    }
}

#[test]
fn lockstep_waits_for_the_answers_to_frames_too() {
    let mut bench = Bench::new("lockstep", "lockstep", 1000.0, true);
    bench.start(0);
    bench.answer("eyes", CameraFrame::SERVICE.name, 0);
    // Mapping answers everything at once, the eyes a frame at a time.
    let mut answered = 0;
    while bench.last(0) < SCANS || bench.last(1) < FRAMES {
        bench.take();
        let (scan, frame) = (bench.last(0), bench.last(1));
        assert!(frame <= answered + FRAME_WINDOW, "frame {frame} came when {answered} was answered");
        if scan > 0 {
            // One scan at most passes a frame that waits.
            let waiting = frame_stamp((answered + FRAME_WINDOW + 1).min(FRAMES));
            assert!(scan == 1 || scan_stamp(scan - 1) <= waiting, "scan {scan} came when frame {answered} was answered");
            bench.answer("mapping", SonarScan::SERVICE.name, scan);
        }
        if answered < frame {
            answered += 1;
            bench.answer("eyes", CameraFrame::SERVICE.name, answered);
        } else {
            bench.wait();
        }
    }
    bench.check_complete();
    assert!(bench.motions.take().unwrap().is_none(), "an SBS tells camera motion anew");
    bench.close();
}

#[test]
fn a_restarted_playback_leaves_no_frame_out() {
    let mut bench = Bench::new("restarted", "lockstep", 1000.0, true);
    for (incarnation, until) in [(0, 11), (1, 30), (2, FRAMES)] {
        bench.start(incarnation);
        while bench.last(1) < until || until == FRAMES && bench.last(0) < SCANS {
            bench.take();
            let (scan, frame) = (bench.last(0), bench.last(1));
            bench.answer("mapping", SonarScan::SERVICE.name, scan);
            bench.answer("eyes", CameraFrame::SERVICE.name, frame);
            bench.wait();
        }
        if until < FRAMES {
            let mut process = bench.process.take().unwrap();
            process.kill().unwrap();
            process.wait().unwrap();
            bench.domain.remove_dead_nodes();
        }
    }
    bench.check_complete();
    bench.close();
}

#[test]
fn a_live_replay_without_sbs_plays_the_recorded_camera_motion() {
    let mut bench = Bench::new("live", "live", 10.0, false);
    bench.start(0);
    let mut motions = 0;
    loop {
        let is_over = bench.process.as_mut().unwrap().try_wait().unwrap().is_some();
        bench.take();
        while let Some(received) = bench.motions.take().unwrap() {
            motions += u64::from(matches!(received, Received::Message(_)));
        }
        if bench.scans.ended() && bench.frames.ended() && bench.motions.ended() {
            break;
        }
        assert!(!is_over, "playback is over, but not every stream");
        bench.wait();
    }
    assert_eq!(motions, SCANS);
    bench.check_complete();
    bench.close();
}
