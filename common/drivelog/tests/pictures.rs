//! Pictures come back from a log as they went in, among everything else, and what is no picture of ours is named.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod payloads;

use foxglove::Decode;
use foxglove::messages::RawImage;
use messages::{CameraFrame, FrameLayout, Payload, Pictures, PixelFormat, SonarScan, TruthMask};
use proptest::prelude::*;
use stillmap_drivelog::{Entry, Image, Log, Recording, info};

fn image(width: u32, height: u32, format: PixelFormat, gap: u32, seed: u8) -> Image {
    let packed = FrameLayout::packed(width, height, format);
    let layout = FrameLayout { stride: packed.stride + gap, ..packed };
    Image { layout, bytes: (0..layout.bytes()).map(|at| (at as u8).wrapping_mul(31).wrapping_add(seed)).collect() }
}

fn arbitrary() -> impl Strategy<Value = Image> {
    let format = prop::sample::select(vec![PixelFormat::Grey, PixelFormat::Yuyv, PixelFormat::Rgb]);
    (16u32..50, 16u32..40, format, 0u32..9, any::<u8>())
        .prop_map(|(width, height, format, gap, seed)| image(width, height, format, gap, seed))
}

proptest! {
    #[test]
    fn a_stream_of_pictures_comes_back_in_order(images in prop::collection::vec(arbitrary(), 0..12), first in 1..u64::MAX / 2) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.mcap");
        let mut recording = Recording::new(&payloads::preamble(1)).unwrap();
        for (seq, Image { layout, bytes }) in (first..).zip(&images) {
            recording.scan(seq, seq, &SonarScan::default()).unwrap();
            recording.picture::<CameraFrame>(seq, seq + 7, layout, bytes).unwrap();
            // A restarted recorder is given again what it had.
            recording.picture::<CameraFrame>(seq, seq + 7, layout, bytes).unwrap();
            recording.picture::<TruthMask>(seq, seq + 7, &FrameLayout::packed(16, 16, PixelFormat::Grey), &[3; 256]).unwrap();
        }
        recording.end_of_pictures::<CameraFrame>(55, 44).unwrap();
        std::fs::write(&path, recording.finish().unwrap()).unwrap();
        let mut log = Log::open(&path).unwrap();
        for (expected, image) in (first..).zip(&images) {
            let Some(Entry::Message { seq, stamp_ns, payload }) = log.next_picture::<CameraFrame>().unwrap() else { panic!("a picture") };
            prop_assert_eq!((seq, stamp_ns), (expected, expected + 7));
            prop_assert_eq!(&payload, image);
        }
        prop_assert_eq!(log.next_picture::<CameraFrame>().unwrap(), Some(Entry::End { seq: 55, stamp_ns: 44 }));
        prop_assert_eq!(log.next_picture::<CameraFrame>().unwrap(), None);
        let counts = info(&path).unwrap().channels;
        for service in [SonarScan::SERVICE, CameraFrame::SERVICE, TruthMask::SERVICE] {
            prop_assert_eq!(counts.get(service.name).map_or(0, |channel| channel.messages), images.len() as u64);
        }
    }
}

/// The log of one picture, whose message is then changed.
fn log_of(change: impl Fn(&mut RawImage)) -> (tempfile::TempDir, Log) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let Image { layout, bytes } = image(20, 16, PixelFormat::Yuyv, 2, 1);
    let mut recording = Recording::new(&payloads::preamble(1)).unwrap();
    recording.picture::<CameraFrame>(3, 5_000_000_007, &layout, &bytes).unwrap();
    std::fs::write(&path, recording.finish().unwrap()).unwrap();
    let mut raw = Log::open(&path).unwrap();
    assert!(raw.advance().unwrap());
    let mut found = <RawImage as Decode>::decode(raw.message().unwrap().data).unwrap();
    change(&mut found);
    let changed = foxglove_log(&found);
    std::fs::write(&path, changed).unwrap();
    let log = Log::open(&path).unwrap();
    (folder, log)
}

/// A log with this one picture, as another program would write it.
fn foxglove_log(image: &RawImage) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().create(&mut out).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("empty.mcap");
    std::fs::write(&path, Recording::new(&payloads::preamble(1)).unwrap().finish().unwrap()).unwrap();
    let empty = std::fs::read(&path).unwrap();
    let summary = mcap::Summary::read(&empty).unwrap().unwrap();
    writer.attach(&mcap::read::attachment(&empty, &summary.attachment_indexes[0]).unwrap()).unwrap();
    writer.write_metadata(&mcap::read::metadata(&empty, &summary.metadata_indexes[0]).unwrap()).unwrap();
    let channel = writer.add_channel(0, CameraFrame::SERVICE.name, "protobuf", &Default::default()).unwrap();
    let header = mcap::records::MessageHeader { channel_id: channel, sequence: 3, log_time: 5, publish_time: 5 };
    writer.write_to_known_channel(&header, &prost::Message::encode_to_vec(image)).unwrap();
    writer.finish().unwrap();
    drop(writer);
    out.into_inner()
}

#[test]
fn what_foxglove_finds_is_the_picture() {
    log_of(|found| {
        assert_eq!((found.width, found.height, found.step, found.encoding.as_str()), (20, 16, 42, "yuyv"));
        assert_eq!(found.data.len(), 42 * 15 + 40);
        let stamp = found.timestamp.unwrap();
        assert_eq!((stamp.sec(), stamp.nsec()), (5, 7));
    });
}

#[test]
fn what_is_no_picture_of_ours_is_named() {
    let check = |change: &dyn Fn(&mut RawImage), expected: &str| {
        let (_folder, mut log) = log_of(change);
        let error = log.next_picture::<CameraFrame>().unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    };
    check(&|found| found.encoding = "bayer_rggb8".to_owned(), "the picture's encoding is \"bayer_rggb8\", expected mono8, yuyv or rgb8");
    check(&|found| found.width = 4_000_000_000, "width is 4000000000");
    check(&|found| found.step = 39, "stride is 39");
    check(&|found| found.data = vec![0; 100].into(), "bytes is 100, expected stride × (height − 1) + a row");
}

#[test]
fn a_picture_without_its_number_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let Image { layout, bytes } = image(16, 16, PixelFormat::Grey, 0, 1);
    let mut recording = Recording::new(&payloads::preamble(1)).unwrap();
    recording.picture::<CameraFrame>(0, 7, &layout, &bytes).unwrap();
    std::fs::write(&path, recording.finish().unwrap()).unwrap();
    let error = Log::open(&path).unwrap().next_picture::<CameraFrame>().unwrap_err().to_string();
    assert!(error.contains("its sequence number is missing, expected 1 or more in the field 1001 of the picture"), "{error}");
}
