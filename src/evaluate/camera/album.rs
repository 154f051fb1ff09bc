//! Pictures of frame, mask and truth side by side, and a log of the three for Foxglove.

use crate::drive::lock_folder;
use anyhow::{Context, Result};
use foxglove::Encode;
use foxglove::messages::{RawImage, Timestamp};
use image::GrayImage;
use mcap::records::MessageHeader;
use sbs::plane::Plane;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use supervisor::OutputFolder;

/// Topics of the log, in the order of the pictures.
const TOPICS: [&str; 3] = ["camera/frame", "camera/mask", "camera/truth"];
/// Name of the log.
const LOG: &str = "camera.mcap";
/// Width of the gap between two pictures, px, and its grey value.
const GAP: usize = 4;
const GAP_SHADE: u8 = 128;

/// A folder of pictures and a log.
pub(super) struct Album {
    folder: OutputFolder,
    log: mcap::Writer<BufWriter<File>>,
    channels: [u16; 3],
}

impl Album {
    /// Creates the folder, if it is missing, and an empty log in it.
    pub(super) fn new(folder: &Path) -> Result<Self> {
        let folder = lock_folder(folder)?;
        let path = folder.path().join(LOG);
        let file = File::create(&path).with_context(|| format!("{}: cannot be written", path.display()))?;
        let mut log = mcap::WriteOptions::new().compression(Some(mcap::Compression::Lz4)).create(BufWriter::new(file))?;
        let schema = match RawImage::get_schema() {
            Some(schema) => log.add_schema(&schema.name, &schema.encoding, &schema.data)?,
            None => 0,
        };
        let mut channels = [0; TOPICS.len()];
        for (channel, topic) in channels.iter_mut().zip(TOPICS) {
            *channel = log.add_channel(schema, topic, &RawImage::get_message_encoding(), &BTreeMap::new())?;
        }
        Ok(Self { folder, log, channels })
    }

    /// Adds a frame, its mask and its truth, all of one size.
    pub(super) fn add(&mut self, number: u64, stamp_ns: u64, pictures: [&Plane<u8>; 3]) -> Result<()> {
        for (channel, picture) in self.channels.into_iter().zip(pictures) {
            let header = MessageHeader { channel_id: channel, sequence: number as u32, log_time: stamp_ns, publish_time: stamp_ns };
            let mut message = Vec::new();
            raw_image(picture, stamp_ns).encode(&mut message)?;
            self.log.write_to_known_channel(&header, &message)?;
        }
        let path = self.folder.path().join(format!("frame_{number:05}.png"));
        side_by_side(pictures).save(&path).with_context(|| format!("{}: cannot be written", path.display()))
    }

    /// Ends the log with its index.
    pub(super) fn finish(mut self) -> Result<()> {
        self.log.finish().map(|_| ()).with_context(|| format!("{}: cannot be written", self.folder.path().join(LOG).display()))
    }
}

fn raw_image(picture: &Plane<u8>, stamp_ns: u64) -> RawImage {
    let seconds = u32::try_from(stamp_ns / 1_000_000_000).unwrap_or(u32::MAX);
    RawImage {
        timestamp: Some(Timestamp::new(seconds, (stamp_ns % 1_000_000_000) as u32)),
        frame_id: "camera".to_owned(),
        width: picture.width() as u32,
        height: picture.height() as u32,
        encoding: "mono8".to_owned(),
        step: picture.width() as u32,
        data: picture.values().to_vec().into(),
    }
}

fn side_by_side(pictures: [&Plane<u8>; 3]) -> GrayImage {
    let [frame, ..] = pictures;
    let (width, height) = (frame.width(), frame.height());
    let total_width = pictures.len() * (width + GAP) - GAP;
    let mut out = GrayImage::from_pixel(total_width as u32, height as u32, image::Luma([GAP_SHADE]));
    for (v, line) in out.chunks_exact_mut(total_width).enumerate() {
        for (row, picture) in line.chunks_mut(width + GAP).zip(pictures) {
            row[..width].copy_from_slice(picture.row(v));
        }
    }
    out
}
