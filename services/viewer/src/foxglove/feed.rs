//! Messages of the bus, sent to the clients that subscribed to them.

use core::any::Any;
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::time::{Duration, Instant};

use drivelog::{Image, Logged, MapView, PoseView};
use messages::{FrameLayout, MapTile, Pictures, Pose, Recorded, RobotEstimate};

use super::channels::Channels;
use super::client::{Client, Offer};
use super::{protocol, scene};
use crate::access::Access;
use crate::scene::SceneView;

/// Most clients; further ones are closed at once.
const MOST_CLIENTS: usize = 8;
/// Time between two pictures of the whole map, whose size grows with the map.
const MAP_PICTURE: Duration = Duration::from_secs(1);

/// The clients of the port, and the map that they are sent.
pub struct Feed<S: Read + Write> {
    offer: Offer,
    clients: Vec<Client<S>>,
    /// The map by layer.
    maps: BTreeMap<u32, Map>,
    drawn: Instant,
    /// The odom frame in the map frame by the newest estimate; without localisation both are the same.
    map_from_odom: Pose,
    /// The newest sensor time.
    now_ns: Option<u64>,
    /// The time that was last sent to the clients.
    sent_time_ns: Option<u64>,
    sent: Sent,
}

/// Counters of a feed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Sent {
    /// Messages sent, counted for each client.
    pub messages: u64,
    /// Messages that a client missed because of its backlog.
    pub dropped: u64,
    /// Connections closed at once because there were too many.
    pub refused: u64,
}

#[derive(Default)]
struct Map {
    view: MapView,
    /// A subscriber lacks its newest picture.
    is_due: bool,
}

impl<S: Read + Write> Feed<S> {
    /// A feed of a run of this deployment.
    #[must_use]
    pub fn new(deployment: &str, run: u64, access: Access, now: Instant) -> Self {
        let channels = Channels::of_a_drive();
        let greeting = [protocol::server_info(&format!("stillmap {deployment}"), run), channels.advertise()];
        Self {
            offer: Offer { access, channels, greeting },
            clients: Vec::new(),
            maps: BTreeMap::new(),
            drawn: now,
            map_from_odom: Pose::default(),
            now_ns: None,
            sent_time_ns: None,
            sent: Sent::default(),
        }
    }

    /// Adds a client over a non-blocking stream, unless there are too many.
    pub fn add_client(&mut self, stream: S, now: Instant) {
        if self.clients.len() < MOST_CLIENTS {
            self.clients.push(Client::new(stream, now));
        } else {
            self.sent.refused += 1;
        }
    }

    /// Reads the requests of the clients.
    pub fn advance(&mut self, now: Instant) {
        for client in &mut self.clients {
            for channel in client.advance(&self.offer, now) {
                let maps = self.maps.iter_mut().filter(|(layer, _)| self.offer.channels.id(MapView::topic(**layer)) == Some(channel));
                maps.for_each(|(_, map)| map.is_due = true);
            }
        }
        self.remove_closed();
    }

    /// Sends a message, and what is derived from it: the pose of a scan, and from a tile the next picture of the map.
    ///
    /// A message about the deployment itself has no sensor time. It is sent at the newest sensor time, if there is one.
    pub fn message<T: Logged>(&mut self, seq: u64, stamp_ns: u64, payload: &T) {
        let log_ns = if T::SERVICE.recorded == Recorded::AsReport {
            self.now_ns.unwrap_or(stamp_ns)
        } else {
            self.advance_time(stamp_ns);
            stamp_ns
        };
        self.send(T::SERVICE.name, log_ns, || payload.encode(seq, stamp_ns));
        let payload: &dyn Any = payload;
        if let Some(RobotEstimate { map_from_odom, .. }) = payload.downcast_ref() {
            self.map_from_odom = *map_from_odom;
        }
        if let Some(scan) = payload.downcast_ref() {
            let map_from_odom = self.map_from_odom;
            self.send(PoseView::TOPIC, stamp_ns, || PoseView::encode(scan, &map_from_odom, stamp_ns));
        }
        if let Some(tile) = payload.downcast_ref::<MapTile>() {
            let map = self.maps.entry(tile.layer).or_default();
            map.view.take(tile);
            map.is_due = true;
        }
    }

    /// Sends the scene that is drawn over the map.
    pub fn scene(&mut self, view: &SceneView) {
        let now_ns = self.now_ns.unwrap_or_default();
        self.send(scene::TOPIC, now_ns, || scene::encode(view, now_ns));
    }

    /// Sends a picture.
    pub fn picture<P: Pictures>(&mut self, seq: u64, stamp_ns: u64, layout: &FrameLayout, bytes: &[u8]) {
        self.advance_time(stamp_ns);
        self.send(P::SERVICE.name, stamp_ns, || Image::encode(layout, bytes, seq, stamp_ns));
    }

    /// Writes to the streams of the clients what they take. Time and map are sent first when they are due.
    pub fn flush(&mut self, now: Instant) {
        if now.saturating_duration_since(self.drawn) >= MAP_PICTURE {
            self.drawn = now;
            self.draw();
        }
        if self.sent_time_ns != self.now_ns
            && let Some(now_ns) = self.now_ns
        {
            self.sent_time_ns = self.now_ns;
            self.clients.iter_mut().filter(|client| !client.link.is_stalled()).for_each(|client| client.link.write(protocol::time(now_ns)));
        }
        for client in &mut self.clients {
            client.link.flush(now);
        }
        self.remove_closed();
    }

    /// Sends the last picture of the map and closes every connection.
    pub fn close(&mut self, now: Instant) {
        self.draw();
        self.flush(now);
        self.clients.iter_mut().for_each(|client| client.link.close_at_end());
    }

    /// Whether a client has subscribed to these pictures.
    #[must_use]
    pub fn wants<P: Pictures>(&self) -> bool {
        self.has_subscriber(P::SERVICE.name)
    }

    /// Whether a client has subscribed to the scene.
    #[must_use]
    pub fn wants_scene(&self) -> bool {
        self.has_subscriber(scene::TOPIC)
    }

    /// Number of clients.
    #[must_use]
    pub fn clients(&self) -> usize {
        self.clients.len()
    }

    /// Whether something is still to be written to a stream.
    #[must_use]
    pub fn is_writing(&self) -> bool {
        self.clients.iter().any(|client| client.link.is_writing())
    }

    /// The streams of the clients.
    pub fn streams(&self) -> impl Iterator<Item = &S> {
        self.clients.iter().filter_map(|client| client.link.stream())
    }

    /// The counters.
    #[must_use]
    pub fn sent(&self) -> Sent {
        self.sent
    }

    fn advance_time(&mut self, stamp_ns: u64) {
        self.now_ns = self.now_ns.max(Some(stamp_ns));
    }

    fn draw(&mut self) {
        let Some(now_ns) = self.now_ns else { return };
        let mut maps = std::mem::take(&mut self.maps);
        for (layer, map) in &mut maps {
            let topic = MapView::topic(*layer);
            if map.is_due && self.has_subscriber(topic) {
                let data = map.view.draw(now_ns);
                // A client that misses this picture is sent the next one even if the map does not change any more.
                map.is_due = data.is_some_and(|data| !self.send(topic, now_ns, || data));
            }
        }
        self.maps = maps;
    }

    fn has_subscriber(&self, topic: &str) -> bool {
        self.offer.channels.id(topic).is_some_and(|channel| self.clients.iter().any(|client| client.wants(channel)))
    }

    /// Sends a message to the subscribers of a topic; false if one of them misses it.
    fn send(&mut self, topic: &str, log_ns: u64, encode: impl FnOnce() -> Vec<u8>) -> bool {
        let Some(channel) = self.offer.channels.id(topic) else { return true };
        let mut subscribers = self.clients.iter_mut().filter(|client| client.wants(channel)).peekable();
        if subscribers.peek().is_none() {
            return true;
        }
        let data = encode();
        let before = self.sent.dropped;
        for client in subscribers {
            match client.send(channel, log_ns, &data) {
                true => self.sent.messages += 1,
                false => self.sent.dropped += 1,
            }
        }
        self.sent.dropped == before
    }

    fn remove_closed(&mut self) {
        self.clients.retain(|client| !client.link.is_closed());
    }
}
