//! The channels that are offered.

use drivelog::{Format, Image, Logged, MapView, PoseView};
use messages::{
    CameraFrame, CameraMask, CameraMotion, DeploymentStatus, FilterVerdict, Heartbeat, Layer, LogLine, MapTile, Pictures, SonarMotion,
    SonarScan, TruthScan, Walkers,
};
use tungstenite::Message;

use super::{protocol, scene};

/// The channels. Ids count from 1.
pub(super) struct Channels(Vec<(&'static str, Format)>);

impl Channels {
    /// The topics of a log that are published repeatedly.
    pub(super) fn of_a_drive() -> Self {
        Self(vec![
            of::<SonarScan>(),
            (PoseView::TOPIC, PoseView::format()),
            of::<SonarMotion>(),
            of::<CameraMotion>(),
            pictures::<CameraFrame>(),
            pictures::<CameraMask>(),
            of::<Walkers>(),
            of::<FilterVerdict>(),
            of::<MapTile>(),
            (MapView::topic(Layer::Filtered as u32), MapView::format()),
            (MapView::topic(Layer::Unfiltered as u32), MapView::format()),
            (scene::TOPIC, scene::format()),
            of::<TruthScan>(),
            of::<DeploymentStatus>(),
            of::<Heartbeat>(),
            of::<LogLine>(),
        ])
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

fn of<T: Logged>() -> (&'static str, Format) {
    (T::SERVICE.name, T::format())
}

fn pictures<P: Pictures>() -> (&'static str, Format) {
    (P::SERVICE.name, Image::format())
}
