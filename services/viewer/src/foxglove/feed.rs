//! What is said on the bus, on its way to whoever has subscribed.

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::time::{Duration, Instant};

use drivelog::{Image, Logged, MapView, PoseView};
use messages::{FrameLayout, MapTile, Pictures, SonarScan};

use super::channels::Channels;
use super::client::{Client, Offer};
use super::{protocol, scene};
use crate::access::Access;
use crate::scene::SceneView;

/// Most clients at a time; further ones are closed at once.
const MOST_CLIENTS: usize = 8;
/// Time between two pictures of the whole map, which grow with it.
const MAP_PICTURE: Duration = Duration::from_secs(1);

/// The clients of the port and what they are sent.
pub struct Feed<S: Read + Write> {
    offer: Offer,
    clients: Vec<Client<S>>,
    /// The map by layer.
    maps: BTreeMap<u32, Map>,
    drawn: Instant,
    /// The latest sensor stamp.
    now_ns: Option<u64>,
    /// The time that clients were last told.
    told_ns: Option<u64>,
    sent: Sent,
}

/// What was sent so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Sent {
    /// Messages, to each client.
    pub messages: u64,
    /// Messages that a client missed because it had not taken those before.
    pub dropped: u64,
    /// Connections that were closed at once because there were enough.
    pub turned_away: u64,
}

#[derive(Default)]
struct Map {
    view: MapView,
    /// Somebody lacks how it looks.
    is_due: bool,
}

impl<S: Read + Write> Feed<S> {
    /// A feed of a run of this deployment for those who may look.
    #[must_use]
    pub fn new(deployment: &str, run: u64, access: Access, now: Instant) -> Self {
        let channels = Channels::of_a_drive();
        let greeting = [protocol::server_info(&format!("stillmap {deployment}"), run), channels.advertise()];
        Self {
            offer: Offer { access, channels, greeting },
            clients: Vec::new(),
            maps: BTreeMap::new(),
            drawn: now,
            now_ns: None,
            told_ns: None,
            sent: Sent::default(),
        }
    }

    /// Takes somebody in who has just connected, unless there are enough; `stream` does not block.
    pub fn admit(&mut self, stream: S, now: Instant) {
        if self.clients.len() < MOST_CLIENTS {
            self.clients.push(Client::new(stream, now));
        } else {
            self.sent.turned_away += 1;
        }
    }

    /// Takes what clients ask for.
    pub fn advance(&mut self, now: Instant) {
        for client in &mut self.clients {
            for channel in client.advance(&self.offer, now) {
                let maps = self.maps.iter_mut().filter(|(layer, _)| self.offer.channels.id(MapView::topic(**layer)) == Some(channel));
                maps.for_each(|(_, map)| map.is_due = true);
            }
        }
        self.forget();
    }

    /// Sends a message whose stamp is sensor time.
    pub fn message<T: Logged>(&mut self, seq: u64, stamp_ns: u64, payload: &T) {
        self.come_to(stamp_ns);
        self.send(T::SERVICE.name, stamp_ns, || payload.encode(seq, stamp_ns));
    }

    /// Sends a message about the deployment itself, whose stamp is none or the wall's: it comes with the sensor's time, if there is
    /// one yet.
    pub fn report<T: Logged>(&mut self, seq: u64, stamp_ns: u64, payload: &T) {
        self.send(T::SERVICE.name, self.now_ns.unwrap_or(stamp_ns), || payload.encode(seq, stamp_ns));
    }

    /// Sends a scan and its pose.
    pub fn scan(&mut self, seq: u64, stamp_ns: u64, scan: &SonarScan) {
        self.message(seq, stamp_ns, scan);
        self.send(PoseView::TOPIC, stamp_ns, || PoseView::encode(scan, stamp_ns));
    }

    /// Sends a tile, and soon the whole map with it.
    pub fn tile(&mut self, seq: u64, stamp_ns: u64, tile: &MapTile) {
        self.message(seq, stamp_ns, tile);
        let map = self.maps.entry(tile.layer).or_default();
        map.view.take(tile);
        map.is_due = true;
    }

    /// Sends what is to be drawn over the map.
    pub fn scene(&mut self, view: &SceneView) {
        let now_ns = self.now_ns.unwrap_or_default();
        self.send(scene::TOPIC, now_ns, || scene::encode(view, now_ns));
    }

    /// Sends a picture.
    pub fn picture<P: Pictures>(&mut self, seq: u64, stamp_ns: u64, layout: &FrameLayout, bytes: &[u8]) {
        self.come_to(stamp_ns);
        self.send(P::SERVICE.name, stamp_ns, || Image::encode(layout, bytes, seq, stamp_ns));
    }

    /// Brings to the clients' streams what they take; the time and the map first, when they are due.
    pub fn flush(&mut self, now: Instant) {
        if now.saturating_duration_since(self.drawn) >= MAP_PICTURE {
            self.drawn = now;
            self.draw();
        }
        if self.told_ns != self.now_ns
            && let Some(now_ns) = self.now_ns
        {
            self.told_ns = self.now_ns;
            self.clients.iter_mut().filter(|client| !client.link.is_deaf()).for_each(|client| client.link.write(protocol::time(now_ns)));
        }
        for client in &mut self.clients {
            client.link.flush(now);
        }
        self.forget();
    }

    /// Sends the last of the map, and that nothing more comes.
    pub fn bid_farewell(&mut self, now: Instant) {
        self.draw();
        self.flush(now);
        self.clients.iter_mut().for_each(|client| client.link.bid_farewell());
    }

    /// Whether somebody has subscribed to pictures of the camera.
    #[must_use]
    pub fn wants<P: Pictures>(&self) -> bool {
        self.has_reader(P::SERVICE.name)
    }

    /// Whether somebody has subscribed to what is drawn over the map.
    #[must_use]
    pub fn wants_scene(&self) -> bool {
        self.has_reader(scene::TOPIC)
    }

    /// Those who are connected.
    #[must_use]
    pub fn clients(&self) -> usize {
        self.clients.len()
    }

    /// Whether a stream has not taken everything yet.
    #[must_use]
    pub fn is_writing(&self) -> bool {
        self.clients.iter().any(|client| client.link.is_writing())
    }

    /// The streams of those who are connected.
    pub fn streams(&self) -> impl Iterator<Item = &S> {
        self.clients.iter().filter_map(|client| client.link.stream())
    }

    /// What was sent so far.
    #[must_use]
    pub fn sent(&self) -> Sent {
        self.sent
    }

    fn come_to(&mut self, stamp_ns: u64) {
        self.now_ns = self.now_ns.max(Some(stamp_ns));
    }

    fn draw(&mut self) {
        let Some(now_ns) = self.now_ns else { return };
        let mut maps = std::mem::take(&mut self.maps);
        for (layer, map) in &mut maps {
            let topic = MapView::topic(*layer);
            if map.is_due && self.has_reader(topic) {
                let data = map.view.draw(now_ns);
                // Whoever misses it is sent the next one, also when the map does not change any more.
                map.is_due = data.is_some_and(|data| !self.send(topic, now_ns, || data));
            }
        }
        self.maps = maps;
    }

    fn has_reader(&self, topic: &str) -> bool {
        self.offer.channels.id(topic).is_some_and(|channel| self.clients.iter().any(|client| client.wants(channel)))
    }

    /// Sends a message to whoever wants it; false when somebody misses it.
    fn send(&mut self, topic: &str, log_ns: u64, encode: impl FnOnce() -> Vec<u8>) -> bool {
        let Some(channel) = self.offer.channels.id(topic) else { return true };
        let mut readers = self.clients.iter_mut().filter(|client| client.wants(channel)).peekable();
        if readers.peek().is_none() {
            return true;
        }
        let data = encode();
        let before = self.sent.dropped;
        for reader in readers {
            match reader.send(channel, log_ns, &data) {
                true => self.sent.messages += 1,
                false => self.sent.dropped += 1,
            }
        }
        self.sent.dropped == before
    }

    fn forget(&mut self) {
        self.clients.retain(|client| !client.link.is_over());
    }
}
