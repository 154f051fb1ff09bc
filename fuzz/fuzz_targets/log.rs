//! A damaged log is read as far as possible, and what is recovered from it is intact. A log of another format is imported or rejected.
#![no_main]

mod common;

use std::convert::Infallible;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use drivelog::{Log, LogError, LogVisitor, Logged, Preamble, Recording, visit_logged};
use libfuzzer_sys::fuzz_target;
use messages::{CameraFrame, CameraMotion, FilterVerdict, FrameLayout, Heartbeat, Pictures, PixelFormat, SonarScan, TruthScan, Walkers};

const MAGIC: &[u8] = b"\x89MCAP0\r\n";
const CHUNK: u8 = 6;

/// A small log: the records before its first chunk, and those in its chunks.
static SOUND: LazyLock<(Vec<u8>, Vec<u8>)> = LazyLock::new(|| {
    let log = recorded();
    let (mut head, mut content, mut rest) = (MAGIC.to_vec(), Vec::new(), &log[MAGIC.len()..]);
    while let Some((&opcode, after)) = rest.split_first() {
        let (length, after) = after.split_first_chunk().unwrap();
        let (body, after) = after.split_at(u64::from_le_bytes(*length) as usize);
        if opcode == CHUNK {
            // Times, size, checksum, "lz4" with its length, and the length of what follows.
            lz4::Decoder::new(&body[8 + 8 + 8 + 4 + 7 + 8..]).and_then(|mut packed| std::io::copy(&mut packed, &mut content)).unwrap();
        } else if content.is_empty() {
            head.extend(&rest[..rest.len() - after.len()]);
        } else {
            break;
        }
        rest = after;
    }
    (head, content)
});

fn recorded() -> Vec<u8> {
    let settings = common::DEMO.to_owned();
    let preamble = Preamble { run: 1, robot: "pioneer-1".into(), sonars: Vec::new(), origin: "fuzzing".into(), settings };
    let mut recording = Recording::new(&preamble).unwrap();
    let (mut std, layout) = (common::services().1, FrameLayout { width: 4, height: 2, stride: 4, format: PixelFormat::Grey as u32 });
    recording.report(1, 0, &Heartbeat::default()).unwrap();
    for (seq, scan) in (1..).zip(common::scans().iter().take(8)) {
        let stamp_ns = seq * 100_000_000;
        recording.scan(seq, stamp_ns, scan).unwrap();
        recording.message(seq, stamp_ns, &std.step(stamp_ns, scan)).unwrap();
        recording.message(seq, stamp_ns, &FilterVerdict::default()).unwrap();
        recording.message(seq, stamp_ns, &CameraMotion::default()).unwrap();
        recording.picture::<CameraFrame>(seq, stamp_ns, &layout, &[7; 8]).unwrap();
    }
    recording.message(1, 1, &Walkers::default()).unwrap();
    recording.message(1, 1, &TruthScan::default()).unwrap();
    recording.end::<SonarScan>(8, 800_000_000).unwrap();
    recording.flush().unwrap();
    let mut bytes = recording.take();
    bytes.extend(recording.finish().unwrap());
    bytes
}

/// A log whose only chunk has this content, under its checksum.
fn with_content(content: &[u8]) -> Vec<u8> {
    let mut body = vec![0; 16];
    body.extend((content.len() as u64).to_le_bytes());
    body.extend(crc32fast::hash(content).to_le_bytes());
    body.extend([0; 4]);
    body.extend((content.len() as u64).to_le_bytes());
    body.extend(content);
    let mut log = SOUND.0.clone();
    log.push(CHUNK);
    log.extend((body.len() as u64).to_le_bytes());
    log.extend(body);
    log
}

/// A folder for this process alone.
fn folder() -> PathBuf {
    static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
        let folder = std::env::temp_dir().join(format!("stillmap-fuzz-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        folder
    });
    FOLDER.clone()
}

/// Reads to the end and ignores errors.
fn to_the_end<T>(mut next: impl FnMut() -> Result<Option<T>, LogError>) {
    while !matches!(next(), Ok(None)) {}
}

fn read(path: &Path) {
    let Ok(mut log) = Log::open(path) else { return };
    to_the_end(|| log.next_of::<SonarScan>());
    let Ok(mut log) = Log::open(path) else { return };
    to_the_end(|| log.next_picture::<CameraFrame>());
    let Ok(mut log) = Log::open(path) else { return };
    to_the_end(|| {
        let more = log.advance()?;
        if let Some(message) = log.message() {
            let Ok(()) = visit_logged(&mut AsEach(message.data));
        }
        Ok(more.then_some(()))
    });
}

/// Reads the bytes as each type of message: those of another type are rejected.
struct AsEach<'a>(&'a [u8]);

impl LogVisitor for AsEach<'_> {
    type Error = Infallible;

    fn message<T: Logged>(&mut self) -> Result<(), Infallible> {
        let _ = T::decode(self.0).is_ok_and(|(_, payload)| payload.validate().is_ok());
        Ok(())
    }

    fn pictures<P: Pictures>(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// The new log holds the readable part of the old one and has no damage. Scans that the old one lacks stay named as missing.
fn recover(from: &Path) {
    let to = from.with_file_name("whole.mcap");
    let _ = fs::remove_file(&to);
    if let Ok(recovered) = drivelog::recover(from, &to) {
        let info = drivelog::info(&to).unwrap();
        assert_eq!(info.damage_count, 0, "{info}");
        assert_eq!(info.channels.values().map(|channel| channel.messages).sum::<u64>(), recovered.messages);
    }
}

fn import(bytes: &[u8]) {
    let (measurements, poses) = bytes.split_at(bytes.iter().position(|byte| *byte == 0xff).unwrap_or(bytes.len()));
    let (folder, to) = (folder(), folder().join("imported.mcap"));
    fs::write(folder.join("measurement.txt"), measurements).unwrap();
    fs::write(folder.join("poses.txt"), poses.strip_prefix(&[0xff]).unwrap_or_default()).unwrap();
    let _ = fs::remove_file(&to);
    match drivelog::import_robond(&folder, &to) {
        Ok(imported) => assert_eq!(scans_of(&to), imported.scans),
        Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
    }
}

fn scans_of(log: &Path) -> u64 {
    drivelog::info(log).unwrap().channels.get("robot/scan").map_or(0, |channel| channel.messages)
}

fuzz_target!(|bytes: &[u8]| {
    let Some((how, bytes)) = bytes.split_first() else { return };
    let log = match how % 4 {
        0 => bytes.to_vec(),
        1 => common::changed(&with_content(&SOUND.1), bytes),
        2 => with_content(&common::changed(&SOUND.1, bytes)),
        _ => return import(bytes),
    };
    let path = folder().join("log.mcap");
    fs::write(&path, log).unwrap();
    read(&path);
    let _ = drivelog::info(&path);
    recover(&path);
});
