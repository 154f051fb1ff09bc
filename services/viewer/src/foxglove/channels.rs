//! The channels that are offered.

use core::convert::Infallible;

use drivelog::{Format, Image, LogVisitor, Logged, MapView, PoseView, visit_logged};
use messages::{Layer, Pictures};
use tungstenite::Message;

use super::{protocol, scene};

/// The channels. Ids count from 1.
pub(super) struct Channels(Vec<(&'static str, Format)>);

impl Channels {
    /// Every service of the registry that is shown, under the topic that it has in a log, and what is derived from them.
    pub(super) fn of_a_drive() -> Self {
        let mut channels = Self(Vec::new());
        let Ok(()) = visit_logged(&mut channels);
        channels.0.extend([
            (PoseView::TOPIC, PoseView::format()),
            (MapView::topic(Layer::Filtered as u32), MapView::format()),
            (MapView::topic(Layer::Unfiltered as u32), MapView::format()),
            (scene::TOPIC, scene::format()),
        ]);
        channels
    }

    /// The id of the channel of a topic.
    pub(super) fn id(&self, topic: &str) -> Option<u32> {
        self.numbered().find(|(_, name, _)| *name == topic).map(|(id, _, _)| id)
    }

    /// The id that a client names, if there is such a channel.
    pub(super) fn known(&self, id: u64) -> Option<u32> {
        u32::try_from(id).ok().filter(|id| (1..=self.0.len()).contains(&(*id as usize)))
    }

    /// Number of channels.
    pub(super) fn count(&self) -> usize {
        self.0.len()
    }

    /// The message that lists the channels.
    pub(super) fn advertise(&self) -> Message {
        protocol::advertise(self.numbered())
    }

    fn numbered(&self) -> impl Iterator<Item = (u32, &str, &Format)> {
        (1..).zip(&self.0).map(|(id, (topic, format))| (id, *topic, format))
    }
}

impl LogVisitor for Channels {
    type Error = Infallible;

    fn message<T: Logged>(&mut self) -> Result<(), Infallible> {
        if T::SERVICE.shown {
            self.0.push((T::SERVICE.name, T::format()));
        }
        Ok(())
    }

    fn pictures<P: Pictures>(&mut self) -> Result<(), Infallible> {
        if P::SERVICE.shown {
            self.0.push((P::SERVICE.name, Image::format()));
        }
        Ok(())
    }
}
