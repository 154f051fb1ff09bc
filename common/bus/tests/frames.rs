//! Pictures on the bus: order, loss, shapes that do not fit, damage in shared memory, and what they leave there.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use std::os::unix::fs::FileExt;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use messages::{CameraFrame, CameraMask, FrameLayout, MAX_FRAME_BYTES, Pictures, PixelFormat};
use stillmap_bus::{Domain, FrameReader, FrameWriter, Ports, Received, RunningDomain};

/// A domain that no other test shares.
fn domain() -> Domain {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    Domain::open(&format!("test-frames-{}-{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed)), 1.0).unwrap()
}

fn ports(domain: &Domain, process: &str) -> Ports {
    Ports::join(&domain.membership_for(process, 0, "settings.toml".as_ref())).unwrap()
}

fn grey(width: u32, height: u32) -> FrameLayout {
    FrameLayout::packed(width, height, PixelFormat::Grey)
}

/// Numbers, losses and first bytes of everything that waits; the end is number 0.
fn taken(reader: &mut FrameReader<CameraFrame>) -> Vec<(u64, u64, u8)> {
    let mut taken = Vec::new();
    while let Some(received) = reader.take().unwrap() {
        taken.push(match received {
            Received::Message(frame) => (frame.seq(), frame.lost_before(), frame.bytes()[0]),
            Received::End { seq } => (0, seq, 0),
        });
    }
    taken
}

#[test]
fn pictures_of_every_kind_arrive_once_in_order() {
    let domain = domain();
    let (mut source, mut sink) = (ports(&domain, "source"), ports(&domain, "sink"));
    let mut writer: FrameWriter<CameraFrame> = source.frame_writer().unwrap();
    assert!(!writer.is_read());
    let mut reader: FrameReader<CameraFrame> = sink.frame_reader().unwrap();
    assert!(writer.is_read());
    let layouts = [
        grey(160, 120),
        FrameLayout::packed(320, 240, PixelFormat::Yuyv),
        FrameLayout::packed(640, 480, PixelFormat::Rgb),
        FrameLayout { stride: 200, ..grey(160, 120) },
    ];
    let picture = |layout: &FrameLayout, seq: u64| -> Vec<u8> { (0..layout.bytes()).map(|at| (at as u64 * 31 + seq) as u8).collect() };
    for (seq, layout) in (1..).zip(layouts) {
        writer.send_with(seq, 10 * seq, layout, |bytes| bytes.copy_from_slice(&picture(&layout, seq))).unwrap();
    }
    for (seq, layout) in (1..).zip(layouts) {
        let Some(Received::Message(frame)) = reader.take().unwrap() else { panic!("picture {seq} is missing") };
        assert_eq!((frame.seq(), frame.stamp_ns(), frame.layout(), frame.format() as u32), (seq, 10 * seq, layout, layout.format));
        assert!(frame.bytes() == picture(&layout, seq), "bytes of picture {seq}");
    }
    writer.send(4, 40, grey(16, 16), &[7; 256]).unwrap();
    writer.send(7, 70, grey(16, 16), &[8; 256]).unwrap();
    writer.end(7, 70).unwrap();
    writer.end(7, 70).unwrap();
    assert_eq!(taken(&mut reader), [(7, 2, 8), (0, 7, 0)], "the fourth again, two missing, the end once");
    assert!(reader.ended());
    drop((source, sink, writer, reader));
    domain.close().unwrap();
}

#[test]
fn what_does_not_fit_is_refused_and_named() {
    let domain = domain();
    let (mut source, mut sink) = (ports(&domain, "source"), ports(&domain, "sink"));
    let mut writer: FrameWriter<CameraFrame> = source.frame_writer().unwrap();
    let mut reader: FrameReader<CameraFrame> = sink.frame_reader().unwrap();
    let good = grey(160, 120);
    let lies = [
        (FrameLayout { format: 9, ..good }, 19_200, "format is 9"),
        (FrameLayout { width: 8, ..good }, 19_200, "width is 8"),
        (FrameLayout { height: 4_000_000_000, ..good }, 19_200, "height is 4000000000"),
        (FrameLayout { stride: 100, ..good }, 19_200, "stride is 100"),
        (good, 19_199, "bytes is 19199"),
        (good, 0, "bytes is 0"),
    ];
    for (seq, (layout, bytes, _)) in (1..).zip(lies) {
        writer.send(seq, 100 * seq, layout, &vec![1; bytes]).unwrap();
        assert_eq!(taken(&mut reader), []);
        let refused = reader.take_refused().unwrap();
        assert_eq!((refused.seq, refused.stamp_ns), (seq, 100 * seq));
        assert!(refused.problem.starts_with(lies[seq as usize - 1].2), "{}", refused.problem);
        assert_eq!(reader.take_refused(), None);
    }
    writer.send(10, 1_000, good, &[2; 19_200]).unwrap();
    writer.send(11, 999, good, &[3; 19_200]).unwrap();
    assert_eq!(taken(&mut reader), [(10, 9, 2)]);
    assert_eq!(reader.take_refused().unwrap().problem, "its stamp 999 ns is before 1000 ns");
    assert!(writer.send(12, 2_000, good, &vec![0; MAX_FRAME_BYTES + 1]).is_err());
    let mut masks: FrameWriter<CameraMask> = source.frame_writer().unwrap();
    let rgb = FrameLayout::packed(640, 480, PixelFormat::Rgb);
    assert!(masks.send_with(1, 1, rgb, |_| ()).is_err(), "a mask has one byte a pixel");
    drop((source, sink, writer, reader, masks));
    domain.close().unwrap();
}

/// The files of the domain in shared memory.
fn shared_memory(domain: &Domain) -> Vec<PathBuf> {
    let prefix = format!("stillmap_{:08x}_", crc32fast::hash(domain.directory().as_os_str().as_encoded_bytes()));
    let entries = std::fs::read_dir("/dev/shm").unwrap().flatten();
    entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(&prefix)).map(|entry| entry.path()).collect()
}

/// Flips a bit at `offset` from where `pattern` lies in the shared memory of the domain.
fn damage(domain: &Domain, pattern: &[u8], offset: usize) {
    let mut found = 0;
    for path in shared_memory(domain) {
        let bytes = std::fs::read(&path).unwrap();
        for at in memchr(&bytes, pattern) {
            let file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
            file.write_all_at(&[bytes[at + offset] ^ 1], (at + offset) as u64).unwrap();
            found += 1;
        }
    }
    assert_eq!(found, 1, "the pattern lies in one place");
}

fn memchr<'a>(bytes: &'a [u8], pattern: &'a [u8]) -> impl Iterator<Item = usize> + 'a {
    let (first, length) = (pattern[0], pattern.len());
    let starts = bytes.iter().enumerate().filter(move |(_, byte)| **byte == first);
    starts.map(|(at, _)| at).filter(move |at| bytes.get(*at..at + length) == Some(pattern))
}

#[test]
fn a_bit_that_flips_in_shared_memory_is_noticed() {
    let domain = domain();
    let (mut source, mut sink) = (ports(&domain, "source"), ports(&domain, "sink"));
    let mut writer: FrameWriter<CameraFrame> = source.frame_writer().unwrap();
    let mut reader: FrameReader<CameraFrame> = sink.frame_reader().unwrap();
    let picture = |seq: u8| -> Vec<u8> { [b"picture number ", &[seq; 4][..], &[seq; 237][..]].concat() };
    for seq in 1..=4u8 {
        writer.send(seq.into(), 0x1234_5678_0000 + u64::from(seq), grey(16, 16), &picture(seq)).unwrap();
    }
    damage(&domain, &picture(1)[..19], 255);
    damage(&domain, &picture(2)[..19], 0);
    // In a header, where the number stands: before the stamp.
    damage(&domain, &[3u64.to_le_bytes(), (0x1234_5678_0003u64).to_le_bytes()].concat(), 5);
    assert_eq!(taken(&mut reader), [(4, 3, b'p')]);
    assert_eq!(reader.take_refused(), None, "nothing that a damaged message says is believed");
    drop((source, sink, writer, reader));
    domain.close().unwrap();
}

#[test]
fn a_late_reader_gets_the_history_and_a_slow_one_the_newest() {
    let domain = domain();
    let (mut source, mut sink) = (ports(&domain, "source"), ports(&domain, "sink"));
    let mut writer: FrameWriter<CameraFrame> = source.frame_writer().unwrap();
    let mut slow: FrameReader<CameraFrame> = sink.frame_reader().unwrap();
    let (history, buffer) = (CameraFrame::SERVICE.qos.history as u64, CameraFrame::SERVICE.qos.buffer as u64);
    for seq in 1..=100 {
        writer.send(seq, seq, grey(16, 16), &[seq as u8; 256]).unwrap();
    }
    let running = RunningDomain::all().unwrap();
    let name = domain.directory().file_name().unwrap().to_str().unwrap();
    let mut observer = Ports::observe(running.iter().find(|found| found.name() == name).unwrap()).unwrap();
    let mut late: FrameReader<CameraFrame> = observer.frame_reader().unwrap();
    late.skip_to(100 - history + 5, 0);
    writer.send(101, 101, grey(16, 16), &[101; 256]).unwrap();
    let numbers = |taken: Vec<(u64, u64, u8)>| taken.iter().map(|(seq, ..)| *seq).collect::<Vec<_>>();
    assert_eq!(numbers(taken(&mut late)), (100 - history + 6..=101).collect::<Vec<_>>());
    assert_eq!(numbers(taken(&mut slow)), (102 - buffer..=101).collect::<Vec<_>>());
    drop((source, sink, writer, late, slow, observer));
    domain.close().unwrap();
}

#[test]
fn pictures_take_the_memory_of_those_that_wait_and_no_more() {
    let domain = domain();
    let (mut source, mut sink) = (ports(&domain, "source"), ports(&domain, "sink"));
    let mut writer: FrameWriter<CameraFrame> = source.frame_writer().unwrap();
    let mut reader: FrameReader<CameraFrame> = sink.frame_reader().unwrap();
    let blocks = || -> u64 {
        use std::os::unix::fs::MetadataExt;
        shared_memory(&domain).iter().map(|path| std::fs::metadata(path).unwrap().blocks() * 512).sum()
    };
    let before = blocks();
    let layout = FrameLayout::packed(640, 480, PixelFormat::Rgb);
    for seq in 1..=200 {
        writer.send_with(seq, seq, layout, |bytes| bytes.fill(seq as u8)).unwrap();
    }
    let buffer = CameraFrame::SERVICE.qos.buffer as u64;
    let (used, most) = (blocks() - before, (buffer + 4) * (MAX_FRAME_BYTES as u64 + 8192));
    assert!(used <= most, "{used} bytes, expected at most {most}");
    assert_eq!(taken(&mut reader).len() as u64, buffer);
    drop((source, sink, writer, reader));
    domain.close().unwrap();
}
