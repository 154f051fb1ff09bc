//! The contents of a log: the messages, and views for people that are derived from them.

use core::any::Any;
use std::collections::{BTreeMap, VecDeque};

use messages::{FrameLayout, MapTile, Payload, Pictures, Pose, Recorded, RobotEstimate, SonarScan};

use crate::carry::carry;
use crate::damage::WriteError;
use crate::image::Image;
use crate::logged::Logged;
use crate::preamble::Preamble;
use crate::records::Channel;
use crate::views::{MapView, PoseView};
use crate::writer::{LogWriter, Times};

/// Writes the log of a drive into memory; its owner writes the bytes to a file.
///
/// What [`take`](Self::take) gives after a [`flush`](Self::flush) is, with all that was taken before, a log that can be read
/// up to the last message, whatever happens next.
pub struct Recording {
    log: LogWriter,
    scene: Scene,
    /// Reports before the first sensor stamp.
    early: VecDeque<EarlyReport>,
}

/// The state at the end of a part, with which the next part begins.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// The map by layer.
    pictures: BTreeMap<u32, MapView>,
    /// Number and stamp of the last tile.
    last_tile: (u64, u64),
    /// The odom frame in the map frame by the newest estimate; without localisation both are the same.
    map_from_odom: Pose,
    /// The latest sensor stamp.
    now_ns: Option<u64>,
    /// The channels of the part that has ended.
    channels: BTreeMap<u16, Channel>,
}

/// Most reports that wait for a sensor stamp; of more, the oldest are dropped.
const MAX_EARLY: usize = 256;

/// A report that writes itself once its log time is known.
type EarlyReport = Box<dyn FnOnce(&mut LogWriter, u64) -> Result<(), WriteError>>;

impl Recording {
    /// A log that starts with what its replay needs.
    ///
    /// # Errors
    /// When the preamble is too large for the format.
    pub fn new(preamble: &Preamble) -> Result<Self, WriteError> {
        Ok(Self { log: LogWriter::new(preamble, 1, 0)?, scene: Scene::default(), early: VecDeque::new() })
    }

    /// The part `number` of a log, after one that ended with `scene`. It starts with the messages of the chunks in `unwritten`, which
    /// are not in the file of that part, and with the complete map, so that a viewer can show the part by itself. Parts up to `removed` may
    /// be gone on purpose: a log without them is complete.
    ///
    /// # Errors
    /// As [`Recording::new`].
    pub fn after(mut scene: Scene, unwritten: &[u8], number: u32, removed: u32, preamble: &Preamble) -> Result<Self, WriteError> {
        let layers: Vec<u32> = scene.pictures.keys().copied().collect();
        let channels = std::mem::take(&mut scene.channels);
        let mut recording = Self { log: LogWriter::new(preamble, number, removed)?, scene, early: VecDeque::new() };
        carry(unwritten, &channels, &mut recording.log)?;
        layers.into_iter().try_for_each(|layer| recording.show_picture(layer))?;
        Ok(recording)
    }

    /// Adds a message as the registry declares its service, with the view that is derived from it.
    ///
    /// # Errors
    /// As [`message`](Self::message).
    pub fn add<T: Logged>(&mut self, seq: u64, stamp_ns: u64, payload: &T) -> Result<(), WriteError> {
        let any: &dyn Any = payload;
        if let Some(scan) = any.downcast_ref() {
            return self.scan(seq, stamp_ns, scan);
        }
        if let Some(tile) = any.downcast_ref() {
            return self.tile(seq, stamp_ns, tile);
        }
        if let Some(RobotEstimate { map_from_odom, .. }) = any.downcast_ref() {
            self.scene.map_from_odom = *map_from_odom;
        }
        match T::SERVICE.recorded {
            Recorded::No => Ok(()),
            Recorded::AtStamp => self.message(seq, stamp_ns, payload),
            Recorded::AsReport => self.report(seq, stamp_ns, payload),
        }
    }

    /// Adds a message whose stamp is sensor time.
    ///
    /// # Errors
    /// When the log has more channels than the format allows.
    pub fn message<T: Logged>(&mut self, seq: u64, stamp_ns: u64, payload: &T) -> Result<(), WriteError> {
        let times = self.at(stamp_ns)?;
        self.log.message(times, seq, payload)
    }

    /// Adds a message about the deployment itself, whose stamp is none or the wall's. On the log's time line it comes behind the sensor
    /// messages before it, so that the log of a replay has one time line. Before the first of these it is delayed.
    ///
    /// # Errors
    /// As [`message`](Self::message).
    pub fn report<T: Logged>(&mut self, seq: u64, stamp_ns: u64, payload: &T) -> Result<(), WriteError> {
        if let Some(log_ns) = self.scene.now_ns {
            return self.log.message(Times { log_ns, stamp_ns }, seq, payload);
        }
        if self.early.len() == MAX_EARLY {
            self.early.pop_front();
        }
        let payload = *payload;
        self.early.push_back(Box::new(move |log, log_ns| log.message(Times { log_ns, stamp_ns }, seq, &payload)));
        Ok(())
    }

    /// The times of a message with this stamp, which is sensor time. On the log's time line it comes behind all earlier ones: a verdict,
    /// for example, has the stamp of a scan seconds ago. Tools expect log times in order.
    fn at(&mut self, stamp_ns: u64) -> Result<Times, WriteError> {
        let log_ns = self.scene.now_ns.unwrap_or_default().max(stamp_ns);
        self.scene.now_ns = Some(log_ns);
        self.place_early(log_ns)?;
        Ok(Times { log_ns, stamp_ns })
    }

    fn place_early(&mut self, log_ns: u64) -> Result<(), WriteError> {
        self.early.drain(..).try_for_each(|report| report(&mut self.log, log_ns))
    }

    /// Adds a scan, and its pose as Foxglove shows it.
    ///
    /// # Errors
    /// As [`message`](Self::message).
    pub fn scan(&mut self, seq: u64, stamp_ns: u64, scan: &SonarScan) -> Result<(), WriteError> {
        self.message(seq, stamp_ns, scan)?;
        let times = self.at(stamp_ns)?;
        self.log.raw(PoseView::TOPIC, PoseView::format, times, seq as u32, &PoseView::encode(scan, &self.scene.map_from_odom, stamp_ns))
    }

    /// Adds a tile, and from time to time the complete map as Foxglove shows it.
    ///
    /// # Errors
    /// As [`message`](Self::message).
    pub fn tile(&mut self, seq: u64, stamp_ns: u64, tile: &MapTile) -> Result<(), WriteError> {
        self.message(seq, stamp_ns, tile)?;
        self.scene.last_tile = (seq, stamp_ns);
        let picture = self.scene.pictures.entry(tile.layer).or_default();
        picture.take(tile);
        if picture.is_due() { self.show_picture(tile.layer) } else { Ok(()) }
    }

    /// Adds that the stream of a service ends after message `seq`.
    ///
    /// # Errors
    /// As [`message`](Self::message).
    pub fn end<T: Payload>(&mut self, seq: u64, stamp_ns: u64) -> Result<(), WriteError> {
        let times = self.at(stamp_ns)?;
        self.log.end(&T::SERVICE, seq, times)
    }

    /// Adds a picture.
    ///
    /// # Errors
    /// As [`message`](Self::message).
    pub fn picture<P: Pictures>(&mut self, seq: u64, stamp_ns: u64, layout: &FrameLayout, bytes: &[u8]) -> Result<(), WriteError> {
        let data = Image::encode(layout, bytes, seq, stamp_ns);
        let times = self.at(stamp_ns)?;
        self.log.raw(P::SERVICE.name, Image::format, times, seq as u32, &data)
    }

    /// Adds that the stream of pictures of a service ends after picture `seq`.
    ///
    /// # Errors
    /// As [`message`](Self::message).
    pub fn end_of_pictures<P: Pictures>(&mut self, seq: u64, stamp_ns: u64) -> Result<(), WriteError> {
        let times = self.at(stamp_ns)?;
        self.log.end(&P::SERVICE, seq, times)
    }

    /// Makes all messages so far ready to be taken.
    ///
    /// # Errors
    /// As [`message`](Self::message).
    pub fn flush(&mut self) -> Result<(), WriteError> {
        self.log.flush()
    }

    /// The bytes that have become ready since they were last taken.
    #[must_use]
    pub fn take(&mut self) -> Vec<u8> {
        self.log.take()
    }

    /// Chunks so far: the index that ends the log has an entry for each, which is in memory until then.
    #[must_use]
    pub fn chunks(&self) -> u64 {
        self.log.chunks()
    }

    /// Ends the log with the map as it is and with its index; what it returns is the rest of the bytes.
    ///
    /// # Errors
    /// As [`message`](Self::message).
    pub fn finish(mut self) -> Result<Vec<u8>, WriteError> {
        self.complete()?;
        self.log.finish()
    }

    /// As [`finish`](Self::finish), for a log that continues in another file with [`after`](Self::after).
    ///
    /// # Errors
    /// As [`message`](Self::message).
    pub fn finish_part(mut self) -> Result<(Vec<u8>, Scene), WriteError> {
        self.complete()?;
        self.log.continued()?;
        self.scene.channels.clone_from(self.log.channels());
        Ok((self.log.finish()?, self.scene))
    }

    /// Adds what waits until the end.
    fn complete(&mut self) -> Result<(), WriteError> {
        let pictures = self.scene.pictures.iter();
        let stale: Vec<u32> = pictures.filter(|(_, picture)| picture.is_stale()).map(|(layer, _)| *layer).collect();
        for layer in stale {
            self.show_picture(layer)?;
        }
        self.place_early(0)
    }

    fn show_picture(&mut self, layer: u32) -> Result<(), WriteError> {
        let (seq, stamp_ns) = self.scene.last_tile;
        let times = self.at(stamp_ns)?;
        match self.scene.pictures.get_mut(&layer).and_then(|picture| picture.draw(stamp_ns)) {
            Some(data) => self.log.raw(MapView::topic(layer), MapView::format, times, seq as u32, &data),
            None => Ok(()),
        }
    }
}
