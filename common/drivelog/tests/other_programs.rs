//! Logs that another program has rewritten, and files that another program has recorded.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod payloads;

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, MessageStream, WriteOptions};
use messages::{Pose, SonarScan};
use stillmap_drivelog::{Entry, Log, Recording, info};

const SCANS: u64 = 50;

/// How a log is rewritten.
#[derive(Clone, Copy)]
struct Form {
    chunks: bool,
    compression: Option<Compression>,
    /// Chunks and the data have checksums.
    checksums: bool,
    /// Messages come before settings and description.
    messages_first: bool,
    /// The description comes before the settings, each among records of other names.
    description_first: bool,
}

fn scan(seq: u64) -> SonarScan {
    SonarScan::new(Pose { x_m: seq as f64, ..Default::default() }, &[], false)
}

fn recorded() -> Vec<u8> {
    let mut recording = Recording::new(&payloads::preamble(7)).unwrap();
    for seq in 1..=SCANS {
        recording.scan(seq, seq * 40_000_000, &scan(seq)).unwrap();
        if seq % 10 == 0 {
            recording.flush().unwrap();
        }
    }
    recording.finish().unwrap()
}

/// The same log in another form.
fn rewritten(log: &[u8], form: Form) -> Vec<u8> {
    let options = WriteOptions::new().use_chunks(form.chunks).compression(form.compression).chunk_size(Some(4096));
    let options = options.calculate_chunk_crcs(form.checksums).calculate_data_section_crc(form.checksums);
    let mut writer = options.library("a test").create(Cursor::new(Vec::new())).unwrap();
    let summary = mcap::Summary::read(log).unwrap().unwrap();
    let attachment = mcap::read::attachment(log, &summary.attachment_indexes[0]).unwrap();
    let description = mcap::read::metadata(log, &summary.metadata_indexes[0]).unwrap();
    let describe = |writer: &mut mcap::Writer<Cursor<Vec<u8>>>| {
        let media_type = "text/plain".to_owned();
        let other = Attachment { name: "notes.txt".to_owned(), media_type, log_time: 0, create_time: 0, data: b"none".as_slice().into() };
        let unrelated = Metadata { name: "rosbag2".to_owned(), metadata: BTreeMap::new() };
        if form.description_first {
            writer.write_metadata(&unrelated).unwrap();
            writer.write_metadata(&description).unwrap();
            writer.attach(&other).unwrap();
            writer.attach(&attachment).unwrap();
        } else {
            writer.attach(&attachment).unwrap();
            writer.write_metadata(&description).unwrap();
        }
    };
    if !form.messages_first {
        describe(&mut writer);
    }
    for message in MessageStream::new(log).unwrap() {
        let message = message.unwrap();
        let schema = message.channel.schema.as_ref().unwrap();
        let schema = writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap();
        let channel_id = writer.add_channel(schema, &message.channel.topic, &message.channel.message_encoding, &BTreeMap::new()).unwrap();
        let header =
            MessageHeader { channel_id, sequence: message.sequence, log_time: message.log_time, publish_time: message.publish_time };
        writer.write_to_known_channel(&header, &message.data).unwrap();
    }
    if form.messages_first {
        describe(&mut writer);
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

fn scans(path: &Path) -> Vec<u64> {
    let mut log = Log::open(path).unwrap();
    assert_eq!(log.preamble(), &payloads::preamble(7));
    let mut scans = Vec::new();
    while let Some(entry) = log.next_of::<SonarScan>().unwrap() {
        if let Entry::Message { seq, payload, .. } = entry {
            assert_eq!(payload, scan(seq));
            scans.push(seq);
        }
    }
    scans
}

#[test]
fn a_log_is_read_in_every_form_that_tools_write() {
    let log = recorded();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let lz4 = Some(Compression::Lz4);
    for (chunks, compression, checksums) in
        [(true, None, true), (true, None, false), (true, lz4, true), (true, lz4, false), (false, None, true)]
    {
        for (messages_first, description_first) in [(false, false), (false, true), (true, false), (true, true)] {
            let form = Form { chunks, compression, checksums, messages_first, description_first };
            std::fs::write(&path, rewritten(&log, form)).unwrap();
            assert_eq!(scans(&path), (1..=SCANS).collect::<Vec<_>>());
            let summary = info(&path).unwrap();
            assert!(summary.is_complete(), "{summary}");
        }
    }
}

#[test]
fn a_recording_of_another_program_is_told_by_its_library() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag.mcap");
    for (profile, library, expected) in [
        (
            "ros2",
            "libmcap 1.3.0",
            "recorded by libmcap 1.3.0 with profile ros2: not a stillmap log; `stillmap log import --format ros2` makes one of it",
        ),
        ("", "rosbag2 \u{1b}[31m", "recorded by rosbag2 \\u{1b}[31m: not a stillmap log"),
        ("", "", "recorded by an unnamed program: not a stillmap log"),
    ] {
        let options = WriteOptions::new().profile(profile).library(library).compression(None);
        let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
        let channel_id = writer.add_channel(0, "/scan", "cdr", &BTreeMap::new()).unwrap();
        let header = MessageHeader { channel_id, sequence: 1, log_time: 1, publish_time: 1 };
        writer.write_to_known_channel(&header, &[1, 2, 3]).unwrap();
        writer.finish().unwrap();
        let bytes = writer.into_inner().into_inner();
        std::fs::write(&path, &bytes).unwrap();
        let said = Log::open(&path).err().unwrap().to_string();
        assert!(said.ends_with(expected), "{said}");
        // Cut behind its messages.
        std::fs::write(&path, &bytes[..bytes.len() - 30]).unwrap();
        let said = Log::open(&path).err().unwrap().to_string();
        assert!(said.ends_with(expected), "{said}");
    }
}

#[test]
fn a_head_behind_a_damaged_chunk_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let form = Form { chunks: true, compression: Some(Compression::Lz4), checksums: true, messages_first: true, description_first: false };
    let mut bytes = rewritten(&recorded(), form);
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let chunk = summary.chunk_indexes[1].chunk_start_offset as usize;
    // The length of the second chunk.
    bytes[chunk + 3] ^= 0x40;
    std::fs::write(&path, bytes).unwrap();
    let summary = info(&path).unwrap();
    assert_eq!(summary.preamble, payloads::preamble(7));
    assert!(summary.damage_count > 0 && summary.gaps.messages["robot/scan"].messages < SCANS, "{summary}");
}
