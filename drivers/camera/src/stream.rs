//! The pictures of a camera: buffers that the device fills, mapped into this process, and given back when they have been read.

use std::cell::Cell;
use std::os::fd::{AsFd, BorrowedFd};
use std::ptr::NonNull;

use rustix::io::Errno;
use rustix::mm::{MapFlags, ProtFlags};

use crate::abi;
use crate::device::Device;
use crate::trouble::Trouble;

/// Buffers asked for: one being read, one being filled, two for a process that was held up.
const BUFFERS: u32 = 4;

/// A camera that takes pictures.
#[derive(Debug)]
pub struct Stream {
    device: Device,
    buffers: Vec<Mapping>,
    /// Why a buffer could not be given back, to be told at the next opportunity.
    not_given_back: Cell<Option<Errno>>,
}

/// A picture in the device's own memory; given back when it is dropped.
#[derive(Debug)]
pub struct Frame<'a> {
    stream: &'a Stream,
    index: u32,
    bytes: &'a [u8],
    about: About,
}

/// What the device says of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct About {
    /// Its place in the device's own count, which wraps around.
    pub sequence: u32,
    /// The device holds it for damaged.
    pub damaged: bool,
    /// When it was taken by the monotonic clock, ns, if the device says.
    pub taken_ns: Option<u64>,
}

impl Stream {
    /// Starts to take pictures in the format that the device is set to.
    ///
    /// # Errors
    /// When the device refuses, or another program is taking pictures.
    pub fn start(device: Device) -> Result<Self, Trouble> {
        let mut request =
            abi::BufferRequest { count: BUFFERS, kind: abi::VIDEO_CAPTURE, memory: abi::MEMORY_MMAP, ..abi::BufferRequest::default() };
        abi::request_buffers(device.as_fd(), &mut request).map_err(|error| Trouble::of("VIDIOC_REQBUFS", error))?;
        let buffers = (0..request.count).map(|index| Mapping::of(&device, index)).collect::<Result<_, _>>()?;
        let stream = Self { device, buffers, not_given_back: Cell::new(None) };
        stream.fill_and_go()?;
        Ok(stream)
    }

    /// Stops and starts again, with all buffers given to the device.
    ///
    /// # Errors
    /// When the device refuses.
    pub fn restart(&mut self) -> Result<(), Trouble> {
        let mut kind = abi::VIDEO_CAPTURE;
        abi::stream_off(self.device.as_fd(), &mut kind).map_err(|error| Trouble::of("VIDIOC_STREAMOFF", error))?;
        self.not_given_back.set(None);
        self.fill_and_go()
    }

    /// The next picture that is ready, none if there is none yet.
    ///
    /// # Errors
    /// When the stream has broken or the device is gone.
    pub fn take(&mut self) -> Result<Option<Frame<'_>>, Trouble> {
        if let Some(error) = self.not_given_back.take() {
            return Err(Trouble::of("VIDIOC_QBUF", error));
        }
        let mut buffer = self.buffer(0);
        match abi::dequeue_buffer(self.device.as_fd(), &mut buffer) {
            Err(Errno::AGAIN) => return Ok(None),
            result => result.map_err(|error| Trouble::of("VIDIOC_DQBUF", error))?,
        }
        let mapped = self.buffers.get(buffer.index as usize).map_or(&[][..], Mapping::bytes);
        let bytes = mapped.get(..buffer.bytes_used as usize).unwrap_or(mapped);
        Ok(Some(Frame { stream: self, index: buffer.index, bytes, about: About::of(&buffer) }))
    }

    /// The device, for its controls.
    #[must_use]
    pub fn device(&self) -> &Device {
        &self.device
    }

    fn fill_and_go(&self) -> Result<(), Trouble> {
        for index in 0..self.buffers.len() as u32 {
            self.give(index).map_err(|error| Trouble::of("VIDIOC_QBUF", error))?;
        }
        let mut kind = abi::VIDEO_CAPTURE;
        abi::stream_on(self.device.as_fd(), &mut kind).map_err(|error| Trouble::of("VIDIOC_STREAMON", error))
    }

    fn give(&self, index: u32) -> Result<(), Errno> {
        abi::queue_buffer(self.device.as_fd(), &mut self.buffer(index))
    }

    fn buffer(&self, index: u32) -> abi::Buffer {
        abi::Buffer { index, kind: abi::VIDEO_CAPTURE, memory: abi::MEMORY_MMAP, ..abi::Buffer::default() }
    }
}

impl AsFd for Stream {
    /// Becomes readable when a picture is ready, or the stream breaks.
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.device.as_fd()
    }
}

impl Frame<'_> {
    /// Its bytes, no more than the device says it has written.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        self.bytes
    }

    /// What the device says of it.
    #[must_use]
    pub fn about(&self) -> About {
        self.about
    }
}

impl Drop for Frame<'_> {
    fn drop(&mut self) {
        if let Err(error) = self.stream.give(self.index) {
            self.stream.not_given_back.set(Some(error));
        }
    }
}

impl About {
    fn of(buffer: &abi::Buffer) -> Self {
        let monotonic = buffer.flags & abi::BUFFER_CLOCK == abi::BUFFER_MONOTONIC;
        let seconds = u64::try_from(buffer.seconds).ok();
        let microseconds = u64::try_from(buffer.microseconds).ok();
        let nanoseconds = seconds.zip(microseconds).and_then(|(s, us)| s.checked_mul(1_000_000_000)?.checked_add(us.checked_mul(1000)?));
        Self { sequence: buffer.sequence, damaged: buffer.flags & abi::BUFFER_ERROR != 0, taken_ns: nanoseconds.filter(|_| monotonic) }
    }
}

/// A buffer of the device in this process's memory, to be read.
#[derive(Debug)]
struct Mapping {
    start: NonNull<u8>,
    length: usize,
}

impl Mapping {
    fn of(device: &Device, index: u32) -> Result<Self, Trouble> {
        let mut buffer = abi::Buffer { index, kind: abi::VIDEO_CAPTURE, memory: abi::MEMORY_MMAP, ..abi::Buffer::default() };
        abi::query_buffer(device.as_fd(), &mut buffer).map_err(|error| Trouble::of("VIDIOC_QUERYBUF", error))?;
        let (length, offset) = (buffer.length as usize, u64::from(buffer.offset));
        // SAFETY: a new mapping at a place of the kernel's choice touches no memory that is in use.
        #[expect(unsafe_code, reason = "the device's buffers are reached by mapping them only")]
        let start = unsafe { rustix::mm::mmap(std::ptr::null_mut(), length, ProtFlags::READ, MapFlags::SHARED, device, offset) };
        let start = start.map_err(|error| Trouble::of("mmap", error))?;
        NonNull::new(start.cast()).map(|start| Self { start, length }).ok_or(Trouble::Failed { call: "mmap", error: Errno::FAULT })
    }

    /// The bytes. They are looked at only between taking the buffer from the device and giving it back: a [`Frame`]'s life.
    fn bytes(&self) -> &[u8] {
        // SAFETY: the mapping is `length` bytes long and lives as long as `self`; the device writes no buffer that it has handed
        // out, and no other code writes to this memory.
        #[expect(unsafe_code, reason = "the device's buffers are reached by mapping them only")]
        unsafe {
            std::slice::from_raw_parts(self.start.as_ptr(), self.length)
        }
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: this is the mapping that was made, whole; every borrow of its bytes has ended.
        #[expect(unsafe_code, reason = "what was mapped by hand is unmapped by hand")]
        let result = unsafe { rustix::mm::munmap(self.start.as_ptr().cast(), self.length) };
        if let Err(error) = result {
            tracing::debug!("a camera buffer stays mapped: {error}");
        }
    }
}
