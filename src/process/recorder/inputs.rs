//! The services that are recorded: every one of the registry that is declared so.

use ::recorder::LogBuffer;
use bus::{BusError, FrameReader, Reader, Received};
use core::any::Any;
use drivelog::{LogVisitor, Logged, visit_logged};
use messages::{CameraFrame, DeploymentStatus, Payload, Pictures, Recorded, SonarScan, StreamCursor};
use runtime::{Shell, StepError};

/// Most messages taken from one input in one step, so that a flood does not delay the heartbeat.
const MOST_AT_ONCE: usize = 256;
/// Most pictures taken in one step: recording one takes up to 2 ms.
const MOST_PICTURES_AT_ONCE: usize = 16;

/// The inputs of the recorder, the statuses first.
pub(super) struct Inputs(Vec<Box<dyn Input>>);

/// What a round of taking found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Taken {
    /// There may be more.
    pub(super) more: bool,
    /// Scans among it.
    pub(super) scans: u64,
    /// Camera frames among it.
    pub(super) frames: u64,
}

impl Inputs {
    pub(super) fn open(shell: &mut Shell, pictures: bool) -> Result<Self, BusError> {
        let mut opening = Opening { shell, pictures, inputs: Vec::new() };
        visit_logged(&mut opening)?;
        let mut inputs = opening.inputs;
        // What a process sent before it was over waits already when the status reports that it is.
        inputs.sort_by_key(|input| input.service() != DeploymentStatus::SERVICE.name);
        Ok(Self(inputs))
    }

    /// Takes what waits, up to a limit for each input; `look` sees the statuses.
    pub(super) fn take(&mut self, buffer: &mut LogBuffer, mut look: impl FnMut(&DeploymentStatus)) -> Result<Taken, StepError> {
        let before = (self.taken(SonarScan::SERVICE.name), self.taken(CameraFrame::SERVICE.name));
        let mut more = false;
        for input in &mut self.0 {
            more |= input.drain(buffer, &mut look)?;
        }
        let (scans, frames) = (self.taken(SonarScan::SERVICE.name), self.taken(CameraFrame::SERVICE.name));
        Ok(Taken { more, scans: scans - before.0, frames: frames - before.1 })
    }

    /// Leaves out scans and frames up to these: they are in the log already.
    pub(super) fn skip_to(&mut self, scan: u64, frame: u64) {
        for input in &mut self.0 {
            match input.service() {
                name if name == SonarScan::SERVICE.name => input.skip_to(scan),
                name if name == CameraFrame::SERVICE.name => input.skip_to(frame),
                _ => (),
            }
        }
    }

    /// The last scan taken.
    pub(super) fn last_scan(&self) -> u64 {
        self.input(SonarScan::SERVICE.name).map_or(0, |scans| scans.progress().last.seq)
    }

    /// The last camera frame taken; `None` when frames are not recorded.
    pub(super) fn last_frame(&self) -> Option<u64> {
        self.input(CameraFrame::SERVICE.name).map(|frames| frames.progress().last.seq)
    }

    /// The services whose end was taken, and their last numbers.
    pub(super) fn ended(&self) -> Vec<(&'static str, u64)> {
        let ended = self.0.iter().filter(|input| input.progress().ended);
        ended.map(|input| (input.service(), input.progress().last.seq)).collect()
    }

    fn taken(&self, service: &str) -> u64 {
        self.input(service).map_or(0, |input| input.progress().taken)
    }

    fn input(&self, service: &str) -> Option<&dyn Input> {
        self.0.iter().find(|input| input.service() == service).map(|input| &**input)
    }
}

/// Opens an input for every service that is recorded.
struct Opening<'a> {
    shell: &'a mut Shell,
    pictures: bool,
    inputs: Vec<Box<dyn Input>>,
}

impl LogVisitor for Opening<'_> {
    type Error = BusError;

    fn message<T: Logged>(&mut self) -> Result<(), BusError> {
        if T::SERVICE.recorded != Recorded::No {
            self.inputs.push(Box::new(MessageInput::<T> { reader: self.shell.reader()?, progress: Progress::default() }));
        }
        Ok(())
    }

    fn pictures<P: Pictures>(&mut self) -> Result<(), BusError> {
        if P::SERVICE.recorded != Recorded::No && self.pictures {
            self.inputs.push(Box::new(PictureInput::<P> { reader: self.shell.frame_reader()?, progress: Progress::default() }));
        }
        Ok(())
    }
}

/// How far an input has been taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Progress {
    /// Number of messages taken.
    taken: u64,
    /// The last message taken; its number may be that of the end of the stream.
    last: StreamCursor,
    /// The end was taken.
    ended: bool,
}

impl Progress {
    fn message(&mut self, seq: u64, stamp_ns: u64) {
        self.last = StreamCursor { seq, stamp_ns };
        self.taken += 1;
    }

    /// Messages before the end that were lost or refused do not come any more.
    fn end(&mut self, seq: u64) {
        self.last.seq = self.last.seq.max(seq);
        self.ended = true;
    }
}

/// A service that is recorded.
trait Input {
    /// Its name.
    fn service(&self) -> &'static str;
    /// Takes what waits, up to a limit; true when there may be more.
    fn drain(&mut self, buffer: &mut LogBuffer, look: &mut dyn FnMut(&DeploymentStatus)) -> Result<bool, StepError>;
    /// Leaves out messages up to this one.
    fn skip_to(&mut self, seq: u64);
    /// How far it has been taken.
    fn progress(&self) -> &Progress;
}

struct MessageInput<T: Logged> {
    reader: Reader<T>,
    progress: Progress,
}

impl<T: Logged> Input for MessageInput<T> {
    fn service(&self) -> &'static str {
        T::SERVICE.name
    }

    fn drain(&mut self, buffer: &mut LogBuffer, look: &mut dyn FnMut(&DeploymentStatus)) -> Result<bool, StepError> {
        for _ in 0..MOST_AT_ONCE {
            match self.reader.take()? {
                None => return Ok(false),
                Some(Received::Message(message)) => {
                    self.progress.message(message.seq(), message.stamp_ns());
                    let payload: &T = &message;
                    if let Some(status) = (payload as &dyn Any).downcast_ref() {
                        look(status);
                    }
                    buffer.record(|recording| recording.add(message.seq(), message.stamp_ns(), payload))?;
                }
                Some(Received::End { seq }) => {
                    self.progress.end(seq);
                    buffer.record(|recording| recording.end::<T>(seq, self.progress.last.stamp_ns))?;
                }
            }
        }
        Ok(true)
    }

    fn skip_to(&mut self, seq: u64) {
        self.reader.skip_to(seq, 0);
    }

    fn progress(&self) -> &Progress {
        &self.progress
    }
}

struct PictureInput<P: Pictures> {
    reader: FrameReader<P>,
    progress: Progress,
}

impl<P: Pictures> Input for PictureInput<P> {
    fn service(&self) -> &'static str {
        P::SERVICE.name
    }

    fn drain(&mut self, buffer: &mut LogBuffer, _: &mut dyn FnMut(&DeploymentStatus)) -> Result<bool, StepError> {
        for _ in 0..MOST_PICTURES_AT_ONCE {
            match self.reader.take()? {
                None => return Ok(false),
                Some(Received::Message(frame)) => {
                    self.progress.message(frame.seq(), frame.stamp_ns());
                    let (layout, bytes) = (frame.layout(), frame.bytes());
                    buffer.record(|recording| recording.picture::<P>(frame.seq(), frame.stamp_ns(), &layout, bytes))?;
                }
                Some(Received::End { seq }) => {
                    self.progress.end(seq);
                    buffer.record(|recording| recording.end_of_pictures::<P>(seq, self.progress.last.stamp_ns))?;
                }
            }
        }
        Ok(true)
    }

    fn skip_to(&mut self, seq: u64) {
        self.reader.skip_to(seq, 0);
    }

    fn progress(&self) -> &Progress {
        &self.progress
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bus::{Domain, FrameWriter, Writer};
    use drivelog::Preamble;
    use messages::{FrameLayout, PixelFormat, Pose};

    #[test]
    fn the_end_acknowledges_a_refused_last_message() {
        let domain = Domain::open(&format!("test-recorder-{}", std::process::id()), 1.0).unwrap();
        let mut shell = Shell::join(domain.membership_for("recorder", 0, "settings.toml".as_ref())).unwrap();
        let mut inputs = Inputs::open(&mut shell, true).unwrap();
        let mut scans: Writer<SonarScan> = shell.writer().unwrap();
        let mut frames: FrameWriter<CameraFrame> = shell.frame_writer().unwrap();
        let scan = SonarScan::new(Pose::default(), &[], false);
        let layout = FrameLayout::packed(20, 16, PixelFormat::Grey);
        // The stamp of the third is before that of the second.
        for (seq, stamp_ns) in [(1, 100), (2, 200), (3, 150)] {
            scans.send(seq, stamp_ns, &scan).unwrap();
            frames.send(seq, stamp_ns, layout, &[0; 320]).unwrap();
        }
        scans.end(3, 200).unwrap();
        frames.end(3, 200).unwrap();
        let preamble = Preamble { run: 1, robot: "pioneer-1".into(), sonars: Vec::new(), origin: "a test".into(), settings: String::new() };
        let taken = inputs.take(&mut LogBuffer::new(&preamble).unwrap(), |_| ()).unwrap();
        assert_eq!(taken, Taken { more: false, scans: 2, frames: 2 });
        assert_eq!((inputs.last_scan(), inputs.last_frame()), (3, Some(3)));
        assert_eq!(inputs.ended(), [(SonarScan::SERVICE.name, 3), (CameraFrame::SERVICE.name, 3)]);
        drop((inputs, scans, frames, shell));
        domain.close().unwrap();
    }
}
