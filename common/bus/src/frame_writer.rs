//! One output of pictures.

use std::cell::Cell;
use std::convert::Infallible;
use std::marker::PhantomData;
use std::rc::Rc;

use iceoryx2::prelude::AllocationStrategy;
use messages::{FrameHeader, FrameLayout, Header, Kind, Pictures};

use crate::connections::Connections;
use crate::error::BusError;
use crate::fabric::{Opened, PicturePubSub};
use crate::outlet::{Outlet, Refresh};
use crate::slot::FrameHeaderSlot;
use crate::stream::checksum;

/// Sends the pictures of one service.
///
/// ```
/// use messages::{CameraFrame, FrameLayout, PixelFormat};
/// use stillmap_bus::{Domain, Ports};
///
/// let domain = Domain::open(&format!("example-frame-writer-{}", std::process::id()), 1.0)?;
/// let membership = domain.membership_for("example", 0, "settings.toml".as_ref());
/// let mut ports = Ports::join(&membership)?;
/// let mut camera = ports.frame_writer::<CameraFrame>()?;
/// // The picture is written straight into shared memory.
/// camera.send_with(1, 1_000, FrameLayout::packed(16, 16, PixelFormat::Grey), |bytes| bytes.fill(128))?;
/// camera.end(1, 1_000)?;
/// # drop((camera, ports));
/// domain.close()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct FrameWriter<P: Pictures> {
    outlet: Rc<Outlet<[u8], FrameHeaderSlot>>,
    run: u64,
    service: PhantomData<P>,
}

impl<P: Pictures> FrameWriter<P> {
    pub(crate) fn new(opened: Opened<PicturePubSub>, run: u64, sent: Rc<Cell<u64>>) -> Result<Self, BusError> {
        let name = P::SERVICE.name;
        let connections = Connections::new(name);
        let builder = opened.data.publisher_builder().set_degradation_handler(connections.on_failure());
        let builder = builder.initial_max_slice_len(P::MAX_BYTES).allocation_strategy(AllocationStrategy::Static);
        let publisher = builder.create().map_err(|error| BusError::broken(name, error))?;
        Ok(Self { outlet: Rc::new(Outlet::new(connections, publisher, opened, sent)?), run, service: PhantomData })
    }

    /// Sends a picture that `fill` writes straight into shared memory: [`FrameLayout::bytes`] bytes, which hold some earlier
    /// picture or zeros until they are written.
    ///
    /// # Errors
    /// When the picture is larger than any may be, no memory can be loaned or a reader cannot be reached.
    pub fn send_with(&mut self, seq: u64, stamp_ns: u64, layout: FrameLayout, fill: impl FnOnce(&mut [u8])) -> Result<(), BusError> {
        self.try_send_with(seq, stamp_ns, layout, always(fill)).map(|Ok(())| ())
    }

    /// As [`FrameWriter::send_with`], unless `fill` finds that there is no picture: then nothing is sent, and why is returned.
    ///
    /// # Errors
    /// As [`FrameWriter::send_with`].
    pub fn try_send_with<E>(
        &mut self,
        seq: u64,
        stamp_ns: u64,
        layout: FrameLayout,
        fill: impl FnOnce(&mut [u8]) -> Result<(), E>,
    ) -> Result<Result<(), E>, BusError> {
        self.transmit(seq, stamp_ns, Kind::Data, layout, layout.bytes(), fill)
    }

    /// Sends a copy of `bytes`; readers refuse it when they are fewer than its shape needs.
    ///
    /// # Errors
    /// As [`FrameWriter::send_with`].
    pub fn send(&mut self, seq: u64, stamp_ns: u64, layout: FrameLayout, bytes: &[u8]) -> Result<(), BusError> {
        let copy = always(|place| place.copy_from_slice(bytes));
        self.transmit(seq, stamp_ns, Kind::Data, layout, bytes.len(), copy).map(|Ok(())| ())
    }

    /// Says that the stream ends after `seq`.
    ///
    /// # Errors
    /// When no memory can be loaned or a reader cannot be reached.
    pub fn end(&mut self, seq: u64, stamp_ns: u64) -> Result<(), BusError> {
        self.transmit(seq, stamp_ns, Kind::End, FrameLayout::default(), 0, always(|_| ())).map(|Ok(())| ())
    }

    /// Whether a process reads: a picture without a reader need not be made.
    #[must_use]
    pub fn is_read(&self) -> bool {
        self.outlet.readers() > 0
    }

    pub(crate) fn refresh(&self) -> Rc<dyn Refresh> {
        self.outlet.clone()
    }

    fn transmit<E>(
        &mut self,
        seq: u64,
        stamp_ns: u64,
        kind: Kind,
        layout: FrameLayout,
        bytes: usize,
        fill: impl FnOnce(&mut [u8]) -> Result<(), E>,
    ) -> Result<Result<(), E>, BusError> {
        let name = P::SERVICE.name;
        let sample = self.outlet.publisher.loan_slice_uninit(bytes).map_err(|error| BusError::refused("cannot loan for", name, error))?;
        // SAFETY: the memory is that of a mapped file: every byte of it has a value, and any value is a `u8`.
        #[expect(unsafe_code, reason = "a picture is written once, straight into shared memory; zeroing it first would write it twice")]
        let mut sample = unsafe { sample.assume_init() };
        if let Err(none) = fill(sample.payload_mut()) {
            return Ok(Err(none));
        }
        let header = Header { run: self.run, seq, stamp_ns, kind: kind as u32, crc32: 0 };
        let crc32 = checksum(&FrameHeader { header, layout }, sample.payload());
        *sample.user_header_mut() = FrameHeaderSlot(FrameHeader { header: Header { crc32, ..header }, layout });
        sample.send().map_err(|error| BusError::refused("cannot send on", name, error))?;
        self.outlet.has_sent().map(Ok)
    }
}

/// A picture that cannot fail to be one.
fn always(fill: impl FnOnce(&mut [u8])) -> impl FnOnce(&mut [u8]) -> Result<(), Infallible> {
    |bytes| {
        fill(bytes);
        Ok(())
    }
}
