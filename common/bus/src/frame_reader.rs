//! One input of pictures: in order, each once, each with bytes that fit its shape.

use std::cell::RefCell;
use std::marker::PhantomData;
use std::rc::Rc;

use iceoryx2::port::listener::Listener;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::ipc;
use iceoryx2::sample::Sample;
use messages::{FrameHeader, FrameLayout, Header, Pictures, PixelFormat, StreamCursor};

use crate::clock::DeploymentClock;
use crate::connections::Connections;
use crate::error::BusError;
use crate::fabric::{Opened, PicturePubSub, listener};
use crate::slot::FrameHeaderSlot;
use crate::stream::{Account, Admission, Received, Stream, checksum};

/// Receives the pictures of one service, under the rules of [`Reader`](crate::Reader).
///
/// ```
/// use messages::{CameraFrame, FrameLayout, PixelFormat};
/// use stillmap_bus::{Domain, Ports, Received};
///
/// let domain = Domain::open(&format!("example-frame-reader-{}", std::process::id()), 1.0)?;
/// let membership = domain.membership_for("example", 0, "settings.toml".as_ref());
/// let mut ports = Ports::join(&membership)?;
/// let mut frames = ports.frame_reader::<CameraFrame>()?;
/// let mut camera = ports.frame_writer::<CameraFrame>()?;
/// camera.send(1, 1_000, FrameLayout::packed(16, 16, PixelFormat::Grey), &[7; 256])?;
///
/// let Some(Received::Message(frame)) = frames.take()? else { panic!("a picture waits") };
/// assert_eq!((frame.seq(), frame.bytes()[0]), (1, 7));
/// # drop(frame);
/// # drop((frames, camera, ports));
/// domain.close()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct FrameReader<P: Pictures> {
    subscriber: Subscriber<ipc::Service, [u8], FrameHeaderSlot>,
    listener: Option<Rc<Listener<ipc::Service>>>,
    connections: Connections,
    service: PicturePubSub,
    stream: Stream,
    refused: Option<RefusedFrame>,
    pictures: PhantomData<P>,
}

/// A picture in shared memory, checked; it goes back to its sender when dropped.
///
/// ```
/// use messages::{CameraFrame, FrameLayout, PixelFormat};
/// use stillmap_bus::{Domain, Ports, Received};
///
/// let domain = Domain::open(&format!("example-frame-{}", std::process::id()), 1.0)?;
/// let membership = domain.membership_for("example", 0, "settings.toml".as_ref());
/// let mut ports = Ports::join(&membership)?;
/// let mut frames = ports.frame_reader::<CameraFrame>()?;
/// let mut camera = ports.frame_writer::<CameraFrame>()?;
/// camera.send(1, 1_000, FrameLayout::packed(16, 20, PixelFormat::Grey), &[0; 320])?;
///
/// let Some(Received::Message(frame)) = frames.take()? else { panic!("a picture waits") };
/// let rows = frame.bytes().chunks(frame.layout().stride as usize);
/// assert_eq!((frame.format(), rows.len()), (PixelFormat::Grey, 20));
/// # drop(frame);
/// # drop((frames, camera, ports));
/// domain.close()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Frame<P: Pictures> {
    sample: Sample<ipc::Service, [u8], FrameHeaderSlot>,
    format: PixelFormat,
    lost_before: u64,
    service: PhantomData<P>,
}

/// A picture that arrived whole and was refused: its shape does not fit its bytes, or its time runs backwards.
///
/// ```
/// use stillmap_bus::RefusedFrame;
///
/// let refused = RefusedFrame { seq: 4, stamp_ns: 900, problem: "its stamp 900 ns is before 1000 ns".to_owned() };
/// assert_eq!(refused.seq, 4);
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RefusedFrame {
    /// Its place in the stream.
    pub seq: u64,
    /// Sensor time, ns, as it says.
    pub stamp_ns: u64,
    /// What is wrong with it.
    pub problem: String,
}

impl<P: Pictures> FrameReader<P> {
    pub(crate) fn new(opened: Opened<PicturePubSub>, run: u64, clock: Option<DeploymentClock>) -> Result<Self, BusError> {
        let connections = Connections::new(P::SERVICE.name);
        let builder = opened.data.subscriber_builder().set_degradation_handler(connections.on_failure());
        let subscriber = builder.create().map_err(|error| BusError::broken(P::SERVICE.name, error))?;
        let (listener, stream) = (listener(&opened)?, Stream::new(&P::SERVICE, run, clock));
        Ok(Self { subscriber, listener, connections, service: opened.data, stream, refused: None, pictures: PhantomData })
    }

    /// The next picture, if one waits.
    ///
    /// # Errors
    /// When the connection to a sender cannot be made, or more pictures are held than a reader may.
    pub fn take(&mut self) -> Result<Option<Received<Frame<P>>>, BusError> {
        loop {
            let received = self.subscriber.receive().map_err(|error| BusError::refused("cannot receive from", P::SERVICE.name, error))?;
            self.connections.check(&self.service)?;
            let Some(sample) = received else { return Ok(None) };
            let FrameHeader { header, layout } = sample.user_header().0;
            let bytes = sample.payload();
            let found = || checksum(&FrameHeader { header: Header { crc32: 0, ..header }, layout }, bytes);
            let mut format = PixelFormat::Grey;
            let validate = || layout.validate(bytes.len()).map(|found| format = found);
            match self.stream.admit(&header, found, validate) {
                Admission::Message { lost_before } => {
                    return Ok(Some(Received::Message(Frame { sample, format, lost_before, service: PhantomData })));
                }
                Admission::End { seq } => return Ok(Some(Received::End { seq })),
                Admission::Refused { problem } => {
                    self.refused = Some(RefusedFrame { seq: header.seq, stamp_ns: header.stamp_ns, problem });
                }
                Admission::Dropped => (),
            }
        }
    }

    /// The last picture that was refused since this was last asked: who answers for every picture answers for it, too.
    pub fn take_refused(&mut self) -> Option<RefusedFrame> {
        self.refused.take()
    }

    /// Takes everything up to `seq`, which has this stamp, as received: a process that restarts resumes after what its
    /// checkpoint includes.
    pub fn skip_to(&mut self, seq: u64, stamp_ns: u64) {
        self.stream.skip_to(seq, stamp_ns);
    }

    /// Takes the first picture that comes as the beginning of the stream: what was sent before is not missed.
    pub fn join(&mut self) {
        self.stream.join();
    }

    /// Whether the end of the stream has been taken.
    #[must_use]
    pub fn ended(&self) -> bool {
        self.stream.ended()
    }

    pub(crate) fn listener(&self) -> Option<Rc<Listener<ipc::Service>>> {
        self.listener.clone()
    }

    pub(crate) fn account(&self) -> Rc<RefCell<Account>> {
        self.stream.account()
    }
}

impl<P: Pictures> Frame<P> {
    /// Its place in the source stream.
    #[must_use]
    pub fn seq(&self) -> u64 {
        self.header().header.seq
    }

    /// Sensor time, ns.
    #[must_use]
    pub fn stamp_ns(&self) -> u64 {
        self.header().header.stamp_ns
    }

    /// Number and stamp.
    #[must_use]
    pub fn cursor(&self) -> StreamCursor {
        StreamCursor { seq: self.seq(), stamp_ns: self.stamp_ns() }
    }

    /// Pictures missing between the one before and this one.
    #[must_use]
    pub fn lost_before(&self) -> u64 {
        self.lost_before
    }

    /// Its shape, which fits [`Frame::bytes`].
    #[must_use]
    pub fn layout(&self) -> FrameLayout {
        self.header().layout
    }

    /// How its pixels are stored.
    #[must_use]
    pub fn format(&self) -> PixelFormat {
        self.format
    }

    /// Its bytes, at least as many as its shape needs.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        self.sample.payload()
    }

    fn header(&self) -> &FrameHeader {
        &self.sample.user_header().0
    }
}
