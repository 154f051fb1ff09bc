//! What goes into a log: the messages, and what is derived from them for people.

use core::any::Any;
use std::collections::{BTreeMap, VecDeque};

use messages::{FrameLayout, MapTile, Payload, Pictures, Recorded, SonarScan};

use crate::damage::WriteError;
use crate::image::Image;
use crate::logged::Logged;
use crate::preamble::Preamble;
use crate::views::{MapView, PoseView};
use crate::writer::{LogWriter, Times};

/// Writes the log of a drive into memory; whoever holds it brings the bytes to where they belong.
///
/// What [`take`](Self::take) gives after a [`flush`](Self::flush) is, with all that was taken before, a log that can be read
/// up to the last message, whatever happens next.
pub struct Recording {
    log: LogWriter,
    scene: Scene,
    /// Reports before the first sensor stamp.
    early: VecDeque<Held>,
}

/// How far a recording has come, for its next part to begin with.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// The map by layer.
    pictures: BTreeMap<u32, MapView>,
    /// Number and stamp of the last tile.
    last_tile: (u64, u64),
    /// The latest sensor stamp.
    now_ns: Option<u64>,
}

/// Reports that are held until there is a sensor stamp; of more, the oldest go.
const MAX_EARLY: usize = 256;

/// A report that writes itself once its place on the time line is known.
type Held = Box<dyn FnOnce(&mut LogWriter, u64) -> Result<(), WriteError>>;

impl Recording {
    /// A log that starts with what its replay needs.
    ///
    /// # Errors
    /// When the preamble is too large for the format.
    pub fn new(preamble: &Preamble) -> Result<Self, WriteError> {
        Ok(Self { log: LogWriter::new(preamble)?, scene: Scene::default(), early: VecDeque::new() })
    }

    /// A log that goes on where another one ended: it starts with the whole map as it was then, so that it can be looked at by
    /// itself.
    ///
    /// # Errors
    /// As [`Recording::new`].
    pub fn after(scene: Scene, preamble: &Preamble) -> Result<Self, WriteError> {
        let layers: Vec<u32> = scene.pictures.keys().copied().collect();
        let mut recording = Self { log: LogWriter::new(preamble)?, scene, early: VecDeque::new() };
        layers.into_iter().try_for_each(|layer| recording.show_picture(layer))?;
        Ok(recording)
    }

    /// Adds a message as the registry declares its service, with what is derived from it for people.
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
        self.log.message(seq, stamp_ns, payload)?;
        self.come_to(stamp_ns)
    }

    /// Adds a message about the deployment itself, whose stamp is none or the wall's: it stands among the sensor messages that
    /// came before it, so that a replay's log has one time line. Until the first of these it is held back.
    ///
    /// # Errors
    /// As [`message`](Self::message).
    pub fn report<T: Logged>(&mut self, seq: u64, stamp_ns: u64, payload: &T) -> Result<(), WriteError> {
        if let Some(log_ns) = self.scene.now_ns {
            return self.log.report(log_ns, seq, stamp_ns, payload);
        }
        if self.early.len() == MAX_EARLY {
            self.early.pop_front();
        }
        let payload = *payload;
        self.early.push_back(Box::new(move |log, log_ns| log.report(log_ns, seq, stamp_ns, &payload)));
        Ok(())
    }

    /// The log's time line has come to this stamp.
    fn come_to(&mut self, stamp_ns: u64) -> Result<(), WriteError> {
        self.scene.now_ns = self.scene.now_ns.max(Some(stamp_ns));
        self.place_early(stamp_ns)
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
        self.log.raw(PoseView::TOPIC, PoseView::format, Times::of(stamp_ns), seq as u32, &PoseView::encode(scan, stamp_ns))
    }

    /// Adds a tile, and from time to time the whole map as Foxglove shows it.
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
        self.log.end(&T::SERVICE, seq, stamp_ns)
    }

    /// Adds a picture.
    ///
    /// # Errors
    /// As [`message`](Self::message).
    pub fn picture<P: Pictures>(&mut self, seq: u64, stamp_ns: u64, layout: &FrameLayout, bytes: &[u8]) -> Result<(), WriteError> {
        let data = Image::encode(layout, bytes, seq, stamp_ns);
        self.log.raw(P::SERVICE.name, Image::format, Times::of(stamp_ns), seq as u32, &data)?;
        self.come_to(stamp_ns)
    }

    /// Adds that the stream of pictures of a service ends after picture `seq`.
    ///
    /// # Errors
    /// As [`message`](Self::message).
    pub fn end_of_pictures<P: Pictures>(&mut self, seq: u64, stamp_ns: u64) -> Result<(), WriteError> {
        self.log.end(&P::SERVICE, seq, stamp_ns)
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
    pub fn finish(self) -> Result<Vec<u8>, WriteError> {
        self.finish_part().map(|(bytes, _)| bytes)
    }

    /// As [`finish`](Self::finish), for a log that goes on in another file with [`after`](Self::after).
    ///
    /// # Errors
    /// As [`message`](Self::message).
    pub fn finish_part(mut self) -> Result<(Vec<u8>, Scene), WriteError> {
        let pictures = self.scene.pictures.iter();
        let stale: Vec<u32> = pictures.filter(|(_, picture)| picture.is_stale()).map(|(layer, _)| *layer).collect();
        for layer in stale {
            self.show_picture(layer)?;
        }
        self.place_early(0)?;
        Ok((self.log.finish()?, self.scene))
    }

    fn show_picture(&mut self, layer: u32) -> Result<(), WriteError> {
        let (seq, stamp_ns) = self.scene.last_tile;
        match self.scene.pictures.get_mut(&layer).and_then(|picture| picture.draw(stamp_ns)) {
            Some(data) => self.log.raw(MapView::topic(layer), MapView::format, Times::of(stamp_ns), seq as u32, &data),
            None => Ok(()),
        }
    }
}
