//! The output stream that answers a source stream message by message.

use bus::{BusError, Writer};
use messages::{Payload, StreamCursor};

use crate::recent::Recent;
use crate::shell::Shell;

/// A writer of answers that notes the last of them for the checkpoint.
///
/// ```no_run
/// use messages::{SonarMotion, StreamCursor};
/// use stillmap_runtime::{Answers, Recent, Shell};
///
/// let mut shell = Shell::from_env()?;
/// let mut motions = Answers::<SonarMotion>::new(&mut shell, Recent::default())?;
/// motions.publish(StreamCursor { seq: 1, stamp_ns: 100 }, &SonarMotion::default())?;
/// assert_eq!(motions.last().seq, 1);
/// motions.end()?;
/// # Ok::<(), stillmap_runtime::RunError>(())
/// ```
pub struct Answers<T: Payload> {
    writer: Writer<T>,
    recent: Recent<T>,
}

impl<T: Payload> Answers<T> {
    /// Declares the output and republishes the answers of the checkpoint.
    ///
    /// # Errors
    /// When the service does not exist or cannot be used.
    pub fn new(shell: &mut Shell, recent: Recent<T>) -> Result<Self, BusError> {
        let mut writer = shell.writer()?;
        recent.republish(&mut writer)?;
        Ok(Self { writer, recent })
    }

    /// Publishes the answer to the message at `at`.
    ///
    /// # Errors
    /// As [`Writer::send`].
    pub fn publish(&mut self, at: StreamCursor, answer: &T) -> Result<(), BusError> {
        self.recent.note(at, answer);
        self.writer.send(at.seq, at.stamp_ns, answer)
    }

    /// Publishes that the message at `at` has no answer because a newer one waited.
    ///
    /// # Errors
    /// As [`Writer::send`].
    pub fn skip(&mut self, at: StreamCursor) -> Result<(), BusError> {
        self.writer.skip(at.seq, at.stamp_ns)
    }

    /// Publishes the end of the stream.
    ///
    /// # Errors
    /// As [`Writer::end`].
    pub fn end(&mut self) -> Result<(), BusError> {
        let StreamCursor { seq, stamp_ns } = self.last();
        self.writer.end(seq, stamp_ns)
    }

    /// The last message that has its answer.
    #[must_use]
    pub fn last(&self) -> StreamCursor {
        self.recent.last()
    }

    /// The last answers.
    #[must_use]
    pub fn recent(&self) -> &Recent<T> {
        &self.recent
    }
}
