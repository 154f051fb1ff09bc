//! The services that are shown: every one of the registry that is declared so.

use ::viewer::foxglove::Feed;
use ::viewer::{Board, Scene};
use bus::{BusError, Frame, FrameReader, Reader, Received};
use core::any::Any;
use drivelog::{LogVisitor, Logged, visit_logged};
use messages::{DeploymentStatus, Payload, Pictures};
use runtime::Shell;
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Most messages taken from one input in one step, so that a flood does not delay the heartbeat.
const MOST_AT_ONCE: usize = 256;
/// Time between two pictures of a service, which are most of the bytes: 12 a second.
const PICTURE_PERIOD: Duration = Duration::from_millis(80);

/// The inputs of the viewer, the statuses first.
pub(super) struct Inputs(Vec<Box<dyn Input>>);

/// Where messages are shown.
pub(super) struct Screens<'a> {
    pub(super) board: &'a mut Board,
    pub(super) scene: &'a mut Scene,
    pub(super) feed: &'a mut Feed<TcpStream>,
    /// A browser shows the page.
    pub(super) is_watched: bool,
    pub(super) now: Instant,
}

/// What one step has taken.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Taken {
    /// More messages may wait.
    pub(super) more: bool,
    /// The scene has changed.
    pub(super) scene: bool,
    /// The newest status, if one was received.
    pub(super) status: Option<DeploymentStatus>,
}

impl Inputs {
    pub(super) fn open(shell: &mut Shell, now: Instant) -> Result<Self, BusError> {
        let mut opening = Opening { shell, now, inputs: Vec::new() };
        visit_logged(&mut opening)?;
        let mut inputs = opening.inputs;
        // What a process sent before it was over waits already when the status reports that it is.
        inputs.sort_by_key(|input| input.service() != DeploymentStatus::SERVICE.name);
        Ok(Self(inputs))
    }

    /// Takes what waits, up to a limit for each input, and shows it.
    pub(super) fn take(&mut self, screens: &mut Screens<'_>) -> Result<Taken, BusError> {
        let mut taken = Taken::default();
        self.0.iter_mut().try_for_each(|input| input.drain(screens, &mut taken))?;
        Ok(taken)
    }
}

/// Opens an input for every service that is shown.
struct Opening<'a> {
    shell: &'a mut Shell,
    now: Instant,
    inputs: Vec<Box<dyn Input>>,
}

impl LogVisitor for Opening<'_> {
    type Error = BusError;

    fn message<T: Logged>(&mut self) -> Result<(), BusError> {
        if T::SERVICE.shown {
            self.inputs.push(Box::new(MessageInput::<T>(self.shell.reader()?)));
        }
        Ok(())
    }

    fn pictures<P: Pictures>(&mut self) -> Result<(), BusError> {
        if P::SERVICE.shown {
            self.inputs.push(Box::new(PictureInput::<P> { reader: self.shell.frame_reader()?, shown_at: self.now }));
        }
        Ok(())
    }
}

/// A service that is shown.
trait Input {
    /// Its name.
    fn service(&self) -> &'static str;
    /// Takes what waits, up to a limit, and shows it.
    fn drain(&mut self, screens: &mut Screens<'_>, taken: &mut Taken) -> Result<(), BusError>;
}

struct MessageInput<T: Logged>(Reader<T>);

impl<T: Logged> Input for MessageInput<T> {
    fn service(&self) -> &'static str {
        T::SERVICE.name
    }

    fn drain(&mut self, screens: &mut Screens<'_>, taken: &mut Taken) -> Result<(), BusError> {
        for _ in 0..MOST_AT_ONCE {
            match self.0.take()? {
                None => return Ok(()),
                Some(Received::Message(message)) => {
                    let (seq, stamp_ns, payload): (_, _, &T) = (message.seq(), message.stamp_ns(), &message);
                    screens.feed.message(seq, stamp_ns, payload);
                    screens.board.message(payload);
                    taken.scene |= screens.scene.message(seq, stamp_ns, payload);
                    let payload: &dyn Any = payload;
                    taken.status = payload.downcast_ref().copied().or(taken.status);
                }
                Some(Received::End { .. }) => {}
            }
        }
        taken.more = true;
        Ok(())
    }
}

struct PictureInput<P: Pictures> {
    reader: FrameReader<P>,
    /// When the last picture was shown.
    shown_at: Instant,
}

impl<P: Pictures> PictureInput<P> {
    /// The last of the pictures that wait.
    fn newest(&mut self) -> Result<Option<Frame<P>>, BusError> {
        let mut newest = None;
        for _ in 0..MOST_AT_ONCE {
            match self.reader.take()? {
                None => break,
                // This releases the previous one: its sender has few slots.
                Some(Received::Message(frame)) => newest = Some(frame),
                Some(Received::End { .. }) => {}
            }
        }
        Ok(newest)
    }
}

impl<P: Pictures> Input for PictureInput<P> {
    fn service(&self) -> &'static str {
        P::SERVICE.name
    }

    fn drain(&mut self, screens: &mut Screens<'_>, _: &mut Taken) -> Result<(), BusError> {
        let is_due = screens.now.saturating_duration_since(self.shown_at) >= PICTURE_PERIOD;
        let is_wanted = screens.is_watched || screens.feed.wants::<P>();
        if let Some(frame) = self.newest()?.filter(|_| is_due && is_wanted) {
            screens.board.picture::<P>(frame.layout(), frame.format(), frame.bytes());
            screens.feed.picture::<P>(frame.seq(), frame.stamp_ns(), &frame.layout(), frame.bytes());
            self.shown_at = screens.now;
        }
        Ok(())
    }
}
