//! The kernel's virtual camera: its faults by the numbers of its controls, and its plug.

use std::path::Path;

use camera::Device;

use crate::harness::Deployment;

/// Where it is; the only camera of the virtual machine.
pub(crate) const DEVICE: &str = "/dev/video0";

/// A deployment with this camera's input 0, a webcam of 320 × 180 and more.
pub(crate) fn webcam(deployment: Deployment) -> Deployment {
    let sized = deployment.set("camera.device", DEVICE).set("camera.width", 320).set("camera.height", 180);
    sized.set("camera.rate_hz", 15).set("camera.input", 0)
}

/// Controls that can be set or pressed, by the kernel's numbers (`drivers/media/test-drivers/vivid/vivid-ctrls.c`).
#[derive(Debug, Clone, Copy)]
#[repr(u32)]
pub(crate) enum Fault {
    /// From now on the count of pictures starts 128 before its end.
    CountNearItsEnd = 0x00f0_f026,
    /// Percentage of pictures that are dropped.
    Dropped = 0x00f0_f040,
    /// Every call says that the device is gone, until all programs have closed it.
    Disconnect = 0x00f0_f041,
    /// One picture is marked as damaged.
    DamagedPicture = 0x00f0_f042,
    /// Asking for buffers fails once.
    RequestBuffers = 0x00f0_f043,
    /// Giving a buffer fails once.
    QueueBuffer = 0x00f0_f044,
    /// Starting the stream fails once.
    StreamOn = 0x00f0_f045,
    /// The stream fails until it is started again.
    Stream = 0x00f0_f046,
}

/// Whether the camera controls its gain itself, and the gain.
pub(crate) const AUTO_GAIN: u32 = 0x0098_0912;
pub(crate) const GAIN: u32 = 0x0098_0913;

pub(crate) fn set(fault: Fault, value: i32) {
    Device::open(Path::new(DEVICE)).unwrap().set_control(fault as u32, value).unwrap();
}

pub(crate) fn press(fault: Fault) {
    set(fault, 1);
}

pub(crate) fn pull() {
    std::fs::write("/sys/bus/platform/drivers/vivid/unbind", "vivid.0").unwrap();
}

pub(crate) fn plug() {
    std::fs::write("/sys/bus/platform/drivers/vivid/bind", "vivid.0").unwrap();
}

/// The camera in its initial state.
pub(crate) fn renew() {
    pull();
    plug();
    assert!(Path::new(DEVICE).exists(), "the camera has changed its number");
}
