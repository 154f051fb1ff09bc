//! Every service of the bus, declared once.
//!
//! An entry makes its type a [`Payload`] or [`Pictures`]. The domain creates what is declared here; recorder, playback, injector,
//! viewer and fuzz targets go through this list, so that none of them can forget a service. Numbered streams stand first: a heartbeat
//! has room for the counters of eight inputs.

use crate::camera::MAX_FRAME_BYTES;
use crate::delivery::{Qos, Replay};
use crate::service::{Invalid, Payload, Pictures, Recorded, Service, ServiceVisitor};
use crate::{
    CameraBackground, CameraFrame, CameraMask, CameraMotion, DeploymentStatus, FilterVerdict, Heartbeat, LogLine, MapSummary, MapTile,
    PlaybackControl, Progress, RobotEstimate, SimulatedTime, SonarMotion, SonarScan, TrajectoryRevision, TruthMask, TruthScan,
    TruthSurfaces, VerdictOutlook, Walkers, WayChunk,
};

/// Declares services: `message TYPE { field: value, … }` or `pictures TYPE (largest picture in bytes) { … }`, with the fields of
/// [`Service`] and its documentation as a comment. A message's type has a method `check`, which becomes [`Payload::validate`].
macro_rules! services {
    ($($(#[doc = $doc:literal])+ $kind:ident $ty:ident $(($max_bytes:expr))? { $($field:ident: $value:expr),* $(,)? })*) => {
        $(services!(@implement $kind $ty $(($max_bytes))? Service { doc: concat!($($doc),+).trim_ascii(), $($field: $value),* });)*

        /// Every service of the bus.
        ///
        /// ```
        /// let scans = stillmap_messages::SERVICES.iter().find(|service| service.name == "robot/scan").expect("declared");
        /// assert_eq!(scans.doc, "The sonar readings since the last packet, with the pose of the robot.");
        /// ```
        pub const SERVICES: &[Service] = &[$(services!(@service $kind $ty)),*];

        /// Calls the visitor for every service of the bus.
        ///
        /// ```
        /// use stillmap_messages::{Payload, Pictures, ServiceVisitor, visit_services};
        ///
        /// /// Adds up the shared memory that buffers of one subscriber take, bytes.
        /// struct Memory(usize);
        ///
        /// impl ServiceVisitor for Memory {
        ///     type Error = core::convert::Infallible;
        ///
        ///     fn message<T: Payload>(&mut self) -> Result<(), Self::Error> {
        ///         self.0 += T::SERVICE.qos.buffer * size_of::<T>();
        ///         Ok(())
        ///     }
        ///
        ///     fn pictures<P: Pictures>(&mut self) -> Result<(), Self::Error> {
        ///         self.0 += P::SERVICE.qos.buffer * P::MAX_BYTES;
        ///         Ok(())
        ///     }
        /// }
        ///
        /// let mut memory = Memory(0);
        /// let Ok(()) = visit_services(&mut memory);
        /// assert!(memory.0 > 37_000_000);
        /// ```
        ///
        /// # Errors
        /// The first error that the visitor returns.
        pub fn visit_services<V: ServiceVisitor>(visitor: &mut V) -> Result<(), V::Error> {
            $(services!(@visit visitor $kind $ty)?;)*
            Ok(())
        }

        /// Calls a macro with every service of the bus, as `message TYPE` or `pictures TYPE`: for a crate that requires a trait of its
        /// own of each of them, so that a service without it does not compile.
        ///
        /// ```
        /// trait Topic {
        ///     const TOPIC: &'static str;
        /// }
        /// macro_rules! topics {
        ///     ($($kind:ident $ty:ident)*) => { $(topics!(@one $kind $ty);)* };
        ///     (@one message $ty:ident) => { impl Topic for stillmap_messages::$ty { const TOPIC: &'static str = <Self as stillmap_messages::Payload>::SERVICE.name; } };
        ///     (@one pictures $ty:ident) => { impl Topic for stillmap_messages::$ty { const TOPIC: &'static str = <Self as stillmap_messages::Pictures>::SERVICE.name; } };
        /// }
        /// stillmap_messages::for_each_service!(topics);
        /// assert_eq!(stillmap_messages::CameraMask::TOPIC, "camera/mask");
        /// ```
        #[macro_export]
        macro_rules! for_each_service {
            ($callback:ident) => { $callback! { $($kind $ty)* } };
        }
    };
    (@implement message $ty:ident $service:expr) => {
        impl Payload for $ty {
            const SERVICE: Service = $service;

            fn validate(&self) -> Result<(), Invalid> {
                self.check()
            }
        }
    };
    (@implement pictures $ty:ident ($max_bytes:expr) $service:expr) => {
        impl Pictures for $ty {
            const SERVICE: Service = $service;
            const MAX_BYTES: usize = $max_bytes;
        }
    };
    (@service message $ty:ident) => { <$ty as Payload>::SERVICE };
    (@service pictures $ty:ident) => { <$ty as Pictures>::SERVICE };
    (@visit $visitor:ident message $ty:ident) => { $visitor.message::<$ty>() };
    (@visit $visitor:ident pictures $ty:ident) => { $visitor.pictures::<$ty>() };
}

impl Service {
    /// The service of this name, if there is one.
    ///
    /// ```
    /// use stillmap_messages::Service;
    ///
    /// assert!(Service::named("map/verdict").is_some_and(|service| service.sequenced));
    /// assert_eq!(Service::named("robot/position"), None);
    /// ```
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Service> {
        SERVICES.iter().find(|service| service.name == name)
    }
}

/// A process may read every service, and its heartbeat counts for each of them.
const _: () = assert!(SERVICES.len() <= crate::MAX_INPUTS);

/// The conditions for exact restarts, for every service that is played back.
const _: () = {
    let mut at = 0;
    while at < SERVICES.len() {
        let service = &SERVICES[at];
        if let Some(replay) = service.replay {
            let (history, behind) = (service.qos.history, replay.window as u64 + replay.checkpoint);
            assert!(service.sequenced, "only a numbered stream can be resumed");
            assert!(behind + replay.reserve < history as u64, "a consumer that is killed lacks messages that the history has dropped");
            assert!(behind <= replay.resent(history), "a consumer that is killed with playback lacks messages that are not sent again");
            assert!(history + (replay.window as usize) < service.qos.buffer, "what is sent again overflows the buffer of a slow consumer");
        }
        at += 1;
    }
};

services! {
    /// The sonar readings since the last packet, with the pose of the robot.
    message SonarScan {
        name: "robot/scan",
        version: 2,
        from: &["pioneer", "playback"],
        to: &["mapping", "std", "fti", "localisation", "simulator", "recorder", "viewer"],
        qos: Qos::STREAM,
        wakes: true,
        sequenced: true,
        recorded: Recorded::AtStamp,
        replay: Some(Replay::SCANS),
        injectable: true,
        shown: true,
    }

    /// Pictures of the camera.
    pictures CameraFrame (MAX_FRAME_BYTES) {
        name: "camera/frame",
        version: 1,
        from: &["camera", "simulator", "playback"],
        to: &["sbs", "recorder", "viewer"],
        qos: Qos::PICTURES,
        wakes: true,
        sequenced: true,
        recorded: Recorded::AtStamp,
        replay: Some(Replay::FRAMES),
        injectable: false,
        shown: true,
    }

    /// Motion detected by the sonars: the answer of STD to the scan of the same number.
    message SonarMotion {
        name: "motion/sonar",
        version: 1,
        from: &["std"],
        to: &["fti", "recorder", "viewer"],
        qos: Qos::STREAM,
        wakes: true,
        sequenced: true,
        recorded: Recorded::AtStamp,
        replay: None,
        injectable: true,
        shown: true,
    }

    /// Motion detected by the camera: the answer of SBS to the frame of the same number. It is played back where no SBS runs.
    message CameraMotion {
        name: "motion/camera",
        version: 1,
        from: &["sbs", "playback"],
        to: &["fti", "recorder", "viewer"],
        qos: Qos::STREAM,
        wakes: true,
        sequenced: true,
        recorded: Recorded::AtStamp,
        replay: Some(Replay::SCANS),
        injectable: true,
        shown: true,
    }

    /// The verdict of FTI on the scan of the same number: the readings that are withheld from the map.
    message FilterVerdict {
        name: "map/verdict",
        version: 2,
        from: &["fti"],
        to: &["mapping", "recorder", "viewer"],
        qos: Qos::STREAM,
        wakes: true,
        sequenced: true,
        recorded: Recorded::AtStamp,
        replay: None,
        injectable: true,
        shown: true,
    }

    /// Where the robot is in the map: the answer of localisation to the scan of the same number.
    message RobotEstimate {
        name: "robot/estimate",
        version: 1,
        from: &["localisation"],
        to: &["mapping", "recorder", "viewer"],
        qos: Qos::STREAM,
        wakes: true,
        sequenced: true,
        recorded: Recorded::AtStamp,
        replay: None,
        injectable: false,
        shown: true,
    }

    /// Poses that localisation estimates otherwise than before, in pieces. With a scan there is at most one piece, so that the history
    /// of the stream reaches as far back as that of the scans.
    message TrajectoryRevision {
        name: "trajectory/revision",
        version: 1,
        from: &["localisation"],
        to: &["mapping", "recorder", "viewer"],
        qos: Qos::STREAM,
        wakes: true,
        sequenced: true,
        recorded: Recorded::AtStamp,
        replay: None,
        injectable: false,
        shown: true,
    }

    /// The walkers that FTI tracks at the scan of the same number.
    message Walkers {
        name: "motion/walkers",
        version: 1,
        from: &["fti"],
        to: &["recorder", "viewer"],
        qos: Qos::STREAM,
        wakes: true,
        sequenced: true,
        recorded: Recorded::AtStamp,
        replay: None,
        injectable: false,
        shown: true,
    }

    /// The truth of a simulated scan of the same number: poses, walkers and the cause of each reading.
    message TruthScan {
        name: "truth/scan",
        version: 1,
        from: &["simulator"],
        to: &["recorder", "viewer"],
        qos: Qos::STREAM,
        wakes: true,
        sequenced: true,
        recorded: Recorded::AtStamp,
        replay: None,
        injectable: false,
        shown: true,
    }

    /// The truth of a simulated frame of the same number, in the labels of the ChangeDetection benchmark.
    pictures TruthMask (MAX_FRAME_BYTES / 3) {
        name: "truth/mask",
        version: 1,
        from: &["simulator"],
        to: &["recorder"],
        qos: Qos::PICTURES,
        wakes: true,
        sequenced: true,
        recorded: Recorded::AtStamp,
        replay: None,
        injectable: false,
        shown: false,
    }

    /// The speed of playback that a viewer requests; the newest message holds.
    message PlaybackControl {
        name: "control/playback",
        version: 1,
        from: &["viewer"],
        to: &["playback", "recorder"],
        qos: Qos::NEWEST,
        wakes: true,
        sequenced: false,
        recorded: Recorded::AsReport,
        replay: None,
        injectable: false,
        shown: false,
    }

    /// Time in a simulated world, with which the driver of its robot stamps; the newest message holds.
    message SimulatedTime {
        name: "control/simulated-time",
        version: 1,
        from: &["simulator"],
        to: &["pioneer"],
        qos: Qos::NEWEST,
        wakes: false,
        sequenced: false,
        recorded: Recorded::No,
        replay: None,
        injectable: false,
        shown: false,
    }

    /// The verdicts that FTI would give now on the pending scans; the newest message holds.
    message VerdictOutlook {
        name: "map/outlook",
        version: 1,
        from: &["fti"],
        to: &["mapping", "recorder"],
        qos: Qos::NEWEST,
        wakes: true,
        sequenced: false,
        recorded: Recorded::AtStamp,
        replay: None,
        injectable: false,
        shown: false,
    }

    /// A tile of the map that has changed. It has no history: mapping repeats all tiles slowly.
    message MapTile {
        name: "map/tile",
        version: 1,
        from: &["mapping"],
        to: &["recorder", "viewer", "command"],
        qos: Qos { history: 0, buffer: 512, publishers: 3, subscribers: 12 },
        wakes: true,
        sequenced: false,
        recorded: Recorded::AtStamp,
        replay: None,
        injectable: false,
        shown: true,
    }

    /// A piece of the robot's trajectory. It has no history: mapping repeats all pieces slowly.
    message WayChunk {
        name: "map/way",
        version: 2,
        from: &["mapping"],
        to: &["recorder", "viewer", "command"],
        qos: Qos { history: 0, buffer: 64, publishers: 3, subscribers: 12 },
        wakes: true,
        sequenced: false,
        recorded: Recorded::AtStamp,
        replay: None,
        injectable: false,
        shown: true,
    }

    /// The finished map in numbers.
    message MapSummary {
        name: "map/summary",
        version: 1,
        from: &["mapping"],
        to: &["recorder", "supervisor"],
        qos: Qos::NEWEST,
        wakes: true,
        sequenced: false,
        recorded: Recorded::AtStamp,
        replay: None,
        injectable: false,
        shown: false,
    }

    /// A heartbeat from the work loop of a process, with its counters.
    message Heartbeat {
        name: "health/heartbeat",
        version: 3,
        from: &["every process"],
        to: &["supervisor", "recorder", "viewer"],
        qos: Qos::REPORTS,
        wakes: false,
        sequenced: false,
        recorded: Recorded::AsReport,
        replay: None,
        injectable: false,
        shown: true,
    }

    /// How far a process has answered a stream. Playback in lockstep waits for it, and a process that has ended for the recorder's.
    message Progress {
        name: "health/progress",
        version: 1,
        from: &["consumers of scans and pictures"],
        to: &["playback", "simulator", "recorder", "processes that have ended"],
        qos: Qos::REPORTS,
        wakes: true,
        sequenced: false,
        recorded: Recorded::AsReport,
        replay: None,
        injectable: false,
        shown: false,
    }

    /// The whole deployment as the supervisor sees it.
    message DeploymentStatus {
        name: "health/status",
        version: 2,
        from: &["supervisor"],
        to: &["every process", "recorder", "viewer", "command"],
        qos: Qos::NEWEST,
        wakes: true,
        sequenced: false,
        recorded: Recorded::AsReport,
        replay: None,
        injectable: false,
        shown: true,
    }

    /// A line that a process has logged.
    message LogLine {
        name: "health/log",
        version: 1,
        from: &["supervisor"],
        to: &["recorder", "viewer", "command"],
        qos: Qos { history: 64, buffer: 256, publishers: 3, subscribers: 12 },
        wakes: true,
        sequenced: false,
        recorded: Recorded::AsReport,
        replay: None,
        injectable: false,
        shown: true,
    }

    /// A piece of the list of the simulated world's surfaces, which has no sensor time.
    message TruthSurfaces {
        name: "truth/surfaces",
        version: 1,
        from: &["simulator"],
        to: &["recorder", "viewer"],
        qos: Qos { history: 32, buffer: 64, publishers: 3, subscribers: 8 },
        wakes: true,
        sequenced: false,
        recorded: Recorded::AsReport,
        replay: None,
        injectable: false,
        shown: true,
    }

    /// Where SBS detects motion in the frame of the same number: 255 there, 0 elsewhere. It is made only while it is read and not
    /// recorded; a replay of the frames makes it again.
    pictures CameraMask (MAX_FRAME_BYTES / 3) {
        name: "camera/mask",
        version: 1,
        from: &["sbs"],
        to: &["viewer"],
        qos: Qos::PREVIEW,
        wakes: true,
        sequenced: true,
        recorded: Recorded::No,
        replay: None,
        injectable: false,
        shown: true,
    }

    /// The picture without what moves, as SBS models it. It is made only while it is read and not recorded; a replay of the frames
    /// makes it again.
    pictures CameraBackground (MAX_FRAME_BYTES / 3) {
        name: "camera/background",
        version: 1,
        from: &["sbs"],
        to: &[],
        qos: Qos::PREVIEW,
        wakes: true,
        sequenced: true,
        recorded: Recorded::No,
        replay: None,
        injectable: false,
        shown: false,
    }
}
