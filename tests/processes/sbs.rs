//! The SBS process on a bus of its own publishes what its fold gives, also when it is killed in between, and reports malformed frames.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use super::wall::{PERIOD_NS, grey, picture};
use bus::{Domain, FrameReader, FrameWriter, Reader, Received};
use messages::{CameraBackground, CameraFrame, CameraMask, CameraMotion, CameraStatus, FrameLayout, Heartbeat, PixelFormat, Progress};
use runtime::Shell;
use sbs::{Answer, Frame, State};

const SIZE: (usize, usize) = (96, 72);
const FRAMES: u64 = 60;

fn start(domain: &Domain, incarnation: u32, settings: &Path) -> Child {
    let membership = domain.membership_for("sbs", incarnation, settings);
    let mut command = Command::new(env!("CARGO_BIN_EXE_stillmap"));
    command.args(["process", "sbs"]).envs(membership.environment()).stdout(Stdio::null());
    command.spawn().unwrap()
}

/// A figure walks before a wall; in every third picture the pixels are stored in another way.
fn frame(seq: u64) -> (u64, FrameLayout, Vec<u8>) {
    let (width, height) = SIZE;
    let figure = (seq > 20).then(|| [10.0 + 1.5 * (seq - 20) as f64, 20.0, 14.0, 40.0]);
    let bytes = picture(width, height, [0.0, 0.0], figure, seq);
    let (layout, bytes) = match seq % 3 {
        0 => (grey(width, height), bytes),
        1 => (FrameLayout::packed(width as u32, height as u32, PixelFormat::Yuyv), bytes.iter().flat_map(|y| [*y, 128]).collect()),
        _ => (FrameLayout::packed(width as u32, height as u32, PixelFormat::Rgb), bytes.iter().flat_map(|y| [*y; 3]).collect()),
    };
    (seq * PERIOD_NS, layout, bytes)
}

fn fold() -> (Vec<Answer>, State) {
    let mut state = State::new(sbs::Parameters::default());
    let answers = (1..=FRAMES).map(|seq| {
        let (stamp_ns, layout, bytes) = frame(seq);
        state.step(&Frame { stamp_ns, layout, bytes: &bytes, odometry: None })
    });
    (answers.collect(), state)
}

/// A reader of the answers, and what it has received: number, stamp and answer.
struct Answers {
    reader: Reader<CameraMotion>,
    taken: Vec<(u64, u64, CameraMotion)>,
}

impl Answers {
    fn of(shell: &mut Shell) -> Self {
        Self { reader: shell.reader().unwrap(), taken: Vec::new() }
    }

    fn take(&mut self) {
        while let Some(received) = self.reader.take().unwrap() {
            if let Received::Message(motion) = received {
                self.taken.push((motion.seq(), motion.stamp_ns(), *motion));
            }
        }
    }
}

/// An SBS process with all its inputs and outputs.
struct Bench {
    folder: tempfile::TempDir,
    frames: FrameWriter<CameraFrame>,
    progress: Reader<Progress>,
    heartbeats: Reader<Heartbeat>,
    /// Readers of the answers.
    answers: Vec<Answers>,
    masks: FrameReader<CameraMask>,
    backgrounds: FrameReader<CameraBackground>,
    source: Shell,
    watcher: Shell,
    domain: Domain,
    process: Option<Child>,
    answered: u64,
    mask: Option<(u64, FrameLayout, Vec<u8>)>,
    background: Option<(u64, FrameLayout)>,
}

impl Bench {
    fn new(name: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let text = "name = \"x\"\npace = \"lockstep\"\n[[process]]\nname = \"sbs\"\nrun = \"sbs\"\n[[process]]\nname = \"playback\"\nrun = \"playback\"\n";
        std::fs::write(folder.path().join("settings.toml"), text).unwrap();
        let domain = Domain::open(&format!("test-sbs-{name}-{}", std::process::id()), 1.0).unwrap();
        let mut source = Shell::join(domain.membership_for("source", 0, "settings.toml".as_ref())).unwrap();
        let mut watcher = Shell::join(domain.membership_for("watcher", 0, "settings.toml".as_ref())).unwrap();
        Self {
            frames: source.frame_writer().unwrap(),
            progress: watcher.reader().unwrap(),
            heartbeats: watcher.reader().unwrap(),
            answers: vec![Answers::of(&mut watcher)],
            masks: watcher.frame_reader().unwrap(),
            backgrounds: watcher.frame_reader().unwrap(),
            folder,
            source,
            watcher,
            domain,
            process: None,
            answered: 0,
            mask: None,
            background: None,
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
        self.source.wait_for_inputs(Duration::ZERO).unwrap();
        self.watcher.wait_for_inputs(Duration::from_millis(50)).unwrap();
    }

    /// Sends frames as lockstep does: no more than a few ahead of their answers.
    fn send(&mut self, seqs: std::ops::RangeInclusive<u64>) {
        for seq in seqs {
            let (stamp_ns, layout, bytes) = frame(seq);
            self.frames.send(seq, stamp_ns, layout, &bytes).unwrap();
            self.wait_until_answered(seq.saturating_sub(7));
        }
    }

    fn wait_until_answered(&mut self, seq: u64) {
        while self.answered < seq {
            match self.progress.take().unwrap() {
                Some(Received::Message(progress)) => self.answered = progress.answered,
                _ => {
                    self.look();
                    self.wait();
                }
            }
        }
    }

    /// Adds a reader of the answers. Returns its index.
    fn join(&mut self) -> usize {
        self.answers.push(Answers::of(&mut self.watcher));
        self.answers.len() - 1
    }

    /// Ends the frames, once all readers are connected to the process: messages of a process that has exited do not reach later readers.
    fn end(&mut self, seq: u64, stamp_ns: u64) {
        self.look();
        self.frames.end(seq, stamp_ns).unwrap();
    }

    /// Takes what has arrived: the answers, and the last of the pictures.
    fn look(&mut self) {
        self.answers.iter_mut().for_each(Answers::take);
        while let Some(received) = self.masks.take().unwrap() {
            if let Received::Message(mask) = received {
                self.mask = Some((mask.seq(), mask.layout(), mask.bytes().to_vec()));
            }
        }
        while let Some(received) = self.backgrounds.take().unwrap() {
            if let Received::Message(background) = received {
                self.background = Some((background.seq(), background.layout()));
            }
        }
    }

    /// Takes what is sent until every stream has ended.
    fn receive_all(&mut self) {
        loop {
            let is_over = self.process.as_mut().unwrap().try_wait().unwrap().is_some();
            self.look();
            if self.masks.ended() && self.backgrounds.ended() && self.answers.iter().all(|answers| answers.reader.ended()) {
                break;
            }
            assert!(!is_over, "the process is over, but not every stream");
            self.wait();
        }
        assert!(self.process.take().unwrap().wait().unwrap().success());
    }

    /// Waits until a heartbeat says these words.
    fn wait_for_words(&mut self, words: &str) {
        loop {
            match self.heartbeats.take().unwrap() {
                Some(Received::Message(beat)) if beat.process.as_str() == "sbs" && beat.note.as_str().contains(words) => return,
                Some(_) => (),
                None => self.wait(),
            }
        }
    }

    fn close(self) {
        let Self { domain, frames, progress, heartbeats, answers, masks, backgrounds, source, watcher, folder: _folder, .. } = self;
        drop((frames, progress, heartbeats, answers, masks, backgrounds, source, watcher));
        domain.close().unwrap();
    }
}

fn check_answers(received: &[(u64, u64, CameraMotion)]) {
    let (answers, _) = fold();
    assert_eq!(received.len() as u64, FRAMES);
    for ((seq, stamp_ns, motion), (expected_seq, expected)) in received.iter().zip((1..).zip(&answers)) {
        assert_eq!((*seq, *stamp_ns), (expected_seq, expected_seq * PERIOD_NS));
        assert_eq!(motion, &expected.motion, "frame {seq}");
    }
    assert!(answers.iter().any(|answer| answer.motion.count > 0), "the figure is seen");
}

#[test]
fn sbs_publishes_the_answers_of_its_fold() {
    let mut bench = Bench::new("whole");
    bench.start(0);
    bench.send(1..=FRAMES);
    bench.end(FRAMES, FRAMES * PERIOD_NS);
    bench.receive_all();
    check_answers(&bench.answers[0].taken);
    let (_, state) = fold();
    let mask = state.mask().unwrap();
    assert!(mask.values().contains(&255));
    assert!(bench.mask == Some((FRAMES, grey(SIZE.0, SIZE.1), mask.values().to_vec())), "the mask of the last frame");
    assert_eq!(bench.background, Some((FRAMES / 8 * 8, grey(SIZE.0, SIZE.1))));
    bench.close();
}

#[test]
fn sbs_killed_in_between_ends_with_the_same_answers() {
    let mut bench = Bench::new("killed");
    let mut sent = 0;
    for (incarnation, last) in [(0, 7), (1, 9), (2, 40)] {
        bench.start(incarnation);
        bench.send(sent + 1..=last);
        bench.wait_until_answered(last);
        bench.look();
        bench.kill();
        sent = last;
    }
    // A reader of the answers may have been killed, too, and resume from further back.
    let late = bench.join();
    bench.start(3);
    bench.send(sent + 1..=FRAMES);
    bench.end(FRAMES, FRAMES * PERIOD_NS);
    bench.receive_all();
    check_answers(&bench.answers[0].taken);
    check_answers(&bench.answers[late].taken);
    bench.close();
}

#[test]
fn malformed_frames_are_refused_and_reported() {
    let mut bench = Bench::new("lies");
    bench.start(0);
    bench.send(1..=2);
    let (width, height) = SIZE;
    let (_, good, bytes) = frame(3);
    let second = 15 * PERIOD_NS;
    let refused = CameraStatus::Refused;
    let learning = CameraStatus::Learning;
    let wide = FrameLayout { width: 97, stride: 97, ..good };
    let checkered: Vec<u8> = (0..width * height).map(|at| if at % 7 == 0 { 128 } else { 255 * (at % 2) as u8 }).collect();
    let (large_width, large_height) = (112, 84);
    let large = picture(large_width, large_height, [0.0, 0.0], None, 1);
    let lies: [(u64, FrameLayout, &[u8], CameraStatus, &str); 8] = [
        (3 * PERIOD_NS, wide, &bytes, refused, "frame 3 refused: bytes is 6912, expected stride"),
        (4 * PERIOD_NS, good, &vec![17; bytes.len()], refused, "frame 4 refused: all pixels have the value 17"),
        (5 * PERIOD_NS, good, &checkered, refused, "frame 5 refused: 0.86 of the pixels are at an end of the range"),
        (PERIOD_NS, good, &bytes, refused, "frame 6 refused: its stamp"),
        (5 * PERIOD_NS + 3 * second, good, &bytes, learning, "3.2 s without a picture before frame 7"),
        (5 * PERIOD_NS + 3 * second, good, &bytes, refused, "frame 8 refused: stamp"),
        (6 * PERIOD_NS + 3 * second, grey(large_width, large_height), &large, learning, "pictures of another size from frame 9 on"),
        (7 * PERIOD_NS + 3 * second, grey(32, 24), &large[..32 * 24], refused, "frame 10 refused: a picture of 32"),
    ];
    for (seq, (stamp_ns, layout, bytes, _, words)) in (3..).zip(lies) {
        bench.frames.send(seq, stamp_ns, layout, bytes).unwrap();
        bench.wait_for_words(words);
    }
    bench.end(10, u64::MAX);
    bench.receive_all();
    let received = &bench.answers[0].taken;
    let statuses: Vec<(u64, u32)> = received.iter().map(|(seq, _, motion)| (*seq, motion.status)).collect();
    let expected = (3..).zip(lies).map(|(seq, (.., status, _))| (seq, status as u32));
    assert_eq!(statuses, [1, 2].map(|seq| (seq, learning as u32)).into_iter().chain(expected).collect::<Vec<_>>());
    assert!(received.is_sorted_by_key(|(_, stamp_ns, _)| *stamp_ns), "the answers run forwards");
    bench.close();
}
