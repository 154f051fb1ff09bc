//! The payload as iceoryx2 sees it.

use iceoryx2::prelude::ZeroCopySend;
use messages::{FrameHeader, Header, Payload};

/// A payload in shared memory.
#[derive(Debug, Clone, Copy)]
#[repr(transparent)]
pub(crate) struct Slot<T>(pub(crate) T);

// SAFETY: `Payload` requires `bytemuck::Pod`: `repr(C)`, no pointers, no padding, every bit pattern valid. The layout behind
// the name is pinned by the attribute that `fabric` puts on each service.
#[expect(unsafe_code, reason = "iceoryx2's marker for types that may lie in shared memory")]
unsafe impl<T: Payload> ZeroCopySend for Slot<T> {
    unsafe fn type_name() -> &'static str {
        T::SERVICE.name
    }
}

/// The header in shared memory.
#[derive(Debug, Clone, Copy, Default)]
#[repr(transparent)]
pub(crate) struct HeaderSlot(pub(crate) Header);

// SAFETY: `Header` is `bytemuck::Pod`, as above.
#[expect(unsafe_code, reason = "iceoryx2's marker for types that may lie in shared memory")]
unsafe impl ZeroCopySend for HeaderSlot {
    unsafe fn type_name() -> &'static str {
        "stillmap/header"
    }
}

/// The header of a picture in shared memory.
#[derive(Debug, Clone, Copy, Default)]
#[repr(transparent)]
pub(crate) struct FrameHeaderSlot(pub(crate) FrameHeader);

// SAFETY: `FrameHeader` is `bytemuck::Pod`, as above.
#[expect(unsafe_code, reason = "iceoryx2's marker for types that may lie in shared memory")]
unsafe impl ZeroCopySend for FrameHeaderSlot {
    unsafe fn type_name() -> &'static str {
        "stillmap/frame-header"
    }
}
