//! The kernel's side of a video device: the calls of `linux/videodev2.h` that a camera needs, as plain numbers.
//!
//! Every struct is plain old data without padding, so that each bit pattern the kernel writes is a value, and as long as the
//! kernel's own: a call's number holds its struct's length, and both are compared when this is compiled.

use std::os::fd::BorrowedFd;

use bytemuck::{Pod, Zeroable};
use rustix::io::Errno;
use rustix::ioctl::{Opcode, Updater, opcode};

/// The kernel's structs are laid out for 64-bit machines: a time stamp is two 64-bit numbers there.
const _: () = assert!(size_of::<usize>() == 8, "the layouts below are those of 64-bit machines");

/// A single plane of pictures that come in.
pub(crate) const VIDEO_CAPTURE: u32 = 1;
/// Buffers that the driver owns and the program maps.
pub(crate) const MEMORY_MMAP: u32 = 1;
/// Whole pictures, not interlaced.
pub(crate) const FIELD_NONE: u32 = 1;

/// [`Capability::device_caps`]: brings pictures in.
pub(crate) const CAP_VIDEO_CAPTURE: u32 = 0x0000_0001;
/// [`Capability::device_caps`]: by streaming.
pub(crate) const CAP_STREAMING: u32 = 0x0400_0000;
/// [`Capability::capabilities`]: `device_caps` is filled in.
pub(crate) const CAP_DEVICE_CAPS: u32 = 0x8000_0000;

/// [`Buffer::flags`]: the picture is damaged.
pub(crate) const BUFFER_ERROR: u32 = 0x0000_0040;
/// [`Buffer::flags`]: which clock the time stamp is of.
pub(crate) const BUFFER_CLOCK: u32 = 0x0000_e000;
/// [`Buffer::flags`]: the monotonic clock.
pub(crate) const BUFFER_MONOTONIC: u32 = 0x0000_2000;

/// [`ControlDescription::id`]: asks for the next control after this one.
pub(crate) const NEXT_CONTROL: u32 = 0x8000_0000;
/// [`ControlDescription::flags`]: there in name only.
pub(crate) const CONTROL_DISABLED: u32 = 0x0001;
/// [`ControlDescription::flags`]: cannot be set.
pub(crate) const CONTROL_READ_ONLY: u32 = 0x0004;
/// [`ControlDescription::kind`]: a number, a switch, a choice.
pub(crate) const CONTROL_KINDS_WITH_A_VALUE: [u32; 4] = [1, 2, 3, 9];

/// [`FrameSize::kind`] and [`FrameInterval::kind`]: one value; everything else is a range.
pub(crate) const DISCRETE: u32 = 1;

/// Declares calls of a video device: `name = number: Struct;` makes `name(device, &mut Struct)`.
macro_rules! calls {
    ($($(#[$doc:meta])* $name:ident = $direction:ident $number:literal: $value:ty;)+) => {$(
        $(#[$doc])*
        pub(crate) fn $name(device: BorrowedFd<'_>, value: &mut $value) -> Result<(), Errno> {
            call::<{ opcode::$direction::<$value>(b'V', $number) }, _>(device, value)
        }
    )+};
}

calls! {
    /// Who the device is.
    query_capability = read 0: Capability;
    /// A pixel format it offers.
    enumerate_format = read_write 2: FormatDescription;
    /// Sets the format; what comes back is what it will be.
    set_format = read_write 5: Format;
    /// Asks for buffers.
    request_buffers = read_write 8: BufferRequest;
    /// Where a buffer is to be mapped.
    query_buffer = read_write 9: Buffer;
    /// Gives a buffer to the device to fill.
    queue_buffer = read_write 15: Buffer;
    /// Takes a filled buffer.
    dequeue_buffer = read_write 17: Buffer;
    /// Starts streaming.
    stream_on = write 18: u32;
    /// Stops streaming; all buffers come back.
    stream_off = write 19: u32;
    /// Sets the rate; what comes back is what it will be.
    set_parameters = read_write 22: StreamParameters;
    /// An input it has.
    enumerate_input = read_write 26: InputDescription;
    /// The value of a control.
    get_control = read_write 27: Control;
    /// Sets a control.
    set_control = read_write 28: Control;
    /// A control it has.
    query_control = read_write 36: ControlDescription;
    /// Selects an input.
    set_input = read_write 39: u32;
    /// A picture size of a pixel format.
    enumerate_size = read_write 74: FrameSize;
    /// A rate of a picture size.
    enumerate_interval = read_write 75: FrameInterval;
}

fn call<const OPCODE: Opcode, T: Pod>(device: BorrowedFd<'_>, value: &mut T) -> Result<(), Errno> {
    const { assert!((OPCODE >> 16) & 0x3fff == size_of::<T>() as Opcode, "the kernel's struct has another length") };
    rustix::io::retry_on_intr(|| {
        // SAFETY: the number says that the kernel reads and writes as many bytes as `T` has, of which every pattern is a value; no
        // struct of this module holds a pointer for the kernel to follow, since all memory is of the kind `MEMORY_MMAP`.
        #[expect(unsafe_code, reason = "no maintained crate wraps these calls with time stamps, time-outs and error flags")]
        unsafe {
            rustix::ioctl::ioctl(device, Updater::<OPCODE, T>::new(value))
        }
    })
}

/// Declares structs of the kernel with their lengths, bytes.
macro_rules! kernel_structs {
    ($($(#[$doc:meta])* $name:ident: $length:literal { $($(#[$field_doc:meta])* $field:ident: $kind:ty,)+ })+) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, Pod, Zeroable)]
        #[repr(C)]
        pub(crate) struct $name { $($(#[$field_doc])* pub(crate) $field: $kind,)+ }

        const _: () = assert!(size_of::<$name>() == $length);

        impl Default for $name {
            fn default() -> Self {
                Self::zeroed()
            }
        }
    )+};
}

kernel_structs! {
    /// `v4l2_capability`.
    Capability: 104 {
        driver: [u8; 16],
        card: [u8; 32],
        bus: [u8; 32],
        version: u32,
        capabilities: u32,
        device_caps: u32,
        reserved: [u32; 3],
    }

    /// `v4l2_fmtdesc`.
    FormatDescription: 64 {
        index: u32,
        kind: u32,
        flags: u32,
        description: [u8; 32],
        pixel_format: u32,
        media_bus_code: u32,
        reserved: [u32; 3],
    }

    /// `v4l2_format` with its `v4l2_pix_format`.
    Format: 208 {
        kind: u32,
        gap: u32,
        width: u32,
        height: u32,
        pixel_format: u32,
        field: u32,
        bytes_per_line: u32,
        size_image: u32,
        colour: [u32; 6],
        rest: [u32; 38],
    }

    /// `v4l2_requestbuffers`.
    BufferRequest: 20 {
        count: u32,
        kind: u32,
        memory: u32,
        capabilities: u32,
        flags: u32,
    }

    /// `v4l2_buffer`.
    Buffer: 88 {
        index: u32,
        kind: u32,
        bytes_used: u32,
        flags: u32,
        field: u32,
        gap: u32,
        seconds: i64,
        microseconds: i64,
        timecode: [u32; 4],
        sequence: u32,
        memory: u32,
        offset: u32,
        offset_gap: u32,
        length: u32,
        reserved: [u32; 3],
    }

    /// `v4l2_streamparm` with its `v4l2_captureparm`.
    StreamParameters: 204 {
        kind: u32,
        capability: u32,
        mode: u32,
        /// Seconds a picture are `numerator / denominator`.
        numerator: u32,
        denominator: u32,
        extended_mode: u32,
        read_buffers: u32,
        rest: [u32; 44],
    }

    /// `v4l2_input`.
    InputDescription: 80 {
        index: u32,
        name: [u8; 32],
        kind: u32,
        audio: u32,
        tuner: u32,
        standards: u64,
        status: u32,
        capabilities: u32,
        reserved: [u32; 4],
    }

    /// `v4l2_control`.
    Control: 8 {
        id: u32,
        value: i32,
    }

    /// `v4l2_queryctrl`.
    ControlDescription: 68 {
        id: u32,
        kind: u32,
        name: [u8; 32],
        minimum: i32,
        maximum: i32,
        step: i32,
        default: i32,
        flags: u32,
        reserved: [u32; 2],
    }

    /// `v4l2_frmsizeenum`; `numbers` are width and height, or the least, greatest and step of width, then of height.
    FrameSize: 44 {
        index: u32,
        pixel_format: u32,
        kind: u32,
        numbers: [u32; 6],
        reserved: [u32; 2],
    }

    /// `v4l2_frmivalenum`; `numbers` are numerator and denominator of the seconds a picture, or the shortest, longest and step.
    FrameInterval: 52 {
        index: u32,
        pixel_format: u32,
        width: u32,
        height: u32,
        kind: u32,
        numbers: [u32; 6],
        reserved: [u32; 2],
    }
}

/// A text of the kernel: up to the first zero byte.
pub(crate) fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).trim().to_owned()
}
