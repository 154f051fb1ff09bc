//! The camera's driver against every fault that the virtual camera has: each costs pictures, none costs the process.

use std::path::Path;

use camera::{Camera, CameraConfig, Coding, Device, FixedControls};
use messages::ProcessStatus;
use rustix::process::Signal;
use serde::Serialize;

use crate::harness::processes::signal;
use crate::harness::{Deployment, Run, Sandbox, counter};
use crate::vivid::{self, AUTO_GAIN, DEVICE, Fault, GAIN, webcam};

/// Pictures a second where restarts are counted. A silence of ten pictures is a stall, five seconds at this rate: an emulated machine on a
/// busy host does not cause one.
const COUNTED_HZ: u32 = 2;

/// A deployment that takes pictures; its robot is absent.
fn shooting() -> Deployment {
    webcam(crate::deployment("shooting", &["camera", "pioneer"]).set("pioneer.port", "/dev/no-robot"))
}

struct Shooting {
    run: Run,
    _sandbox: Sandbox,
}

impl Shooting {
    fn start(deployment: &Deployment) -> Self {
        let sandbox = Sandbox::new();
        Self { run: sandbox.run(deployment, &[]), _sandbox: sandbox }
    }

    /// A deployment with a camera in its initial state that gives pictures at this rate.
    fn at_rate(rate_hz: impl Serialize) -> Self {
        vivid::renew();
        let mut shooting = Self::start(&shooting().set("camera.rate_hz", rate_hz));
        shooting.wait_for_pictures();
        shooting
    }

    /// The driver's status when `wanted` holds of it.
    fn wait_for(&mut self, what: &str, wanted: impl Fn(&ProcessStatus) -> bool) -> ProcessStatus {
        let camera = self.run.wait_for("camera", what, wanted);
        assert_eq!(camera.restarts, 0, "{camera:?}");
        camera
    }

    fn wait_for_note(&mut self, words: &str) -> ProcessStatus {
        self.wait_for(words, |camera| camera.note.as_str().contains(words))
    }

    /// Four more pictures than now come, and the note says so.
    fn wait_for_pictures(&mut self) -> ProcessStatus {
        let now = self.wait_for("it counts pictures", |camera| counter(camera, "pictures").is_some());
        let enough = count(&now, "pictures") + 4;
        let has_pictures = |it: &ProcessStatus| count(it, "pictures") >= enough && it.note.as_str().ends_with("pictures a second");
        self.wait_for("more pictures", has_pictures)
    }

    /// Ends it; its log lines.
    fn end(self) -> String {
        signal(self.run.pid(), Signal::INT);
        let ended = self.run.end();
        ended.assert_code(0);
        ended.stderr
    }
}

fn count(camera: &ProcessStatus, name: &str) -> u64 {
    counter(camera, name).unwrap_or_default()
}

/// Times that the stream was started again, and that the camera was opened again.
fn recoveries(camera: &ProcessStatus) -> (u64, u64) {
    (count(camera, "stream restarts"), count(camera, "reopenings"))
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_camera_pulled_out_and_put_back_is_reopened_once() {
    let mut shooting = Shooting::at_rate(COUNTED_HZ);
    vivid::pull();
    shooting.wait_for_note("/dev/video0: no such device");
    vivid::plug();
    assert_eq!(recoveries(&shooting.wait_for_pictures()), (0, 1));
    let log = shooting.end();
    assert_eq!(log.matches("pictures again after").count(), 1, "{log}");
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_disconnected_camera_is_reopened_once() {
    let mut shooting = Shooting::at_rate(COUNTED_HZ);
    vivid::press(Fault::Disconnect);
    // It comes back by itself when the last program has closed it.
    shooting.wait_for("it is opened again", |camera| recoveries(camera) == (0, 1));
    assert_eq!(recoveries(&shooting.wait_for_pictures()), (0, 1));
    let log = shooting.end();
    assert!(log.contains("no such device"), "{log}");
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_stalled_stream_is_started_again_until_pictures_come() {
    let mut shooting = Shooting::at_rate(COUNTED_HZ);
    vivid::set(Fault::Dropped, 100);
    shooting.wait_for_note("/dev/video0: no picture for");
    shooting.wait_for("the stream is started again", |camera| recoveries(camera) == (2, 0));
    vivid::set(Fault::Dropped, 0);
    assert_eq!(recoveries(&shooting.wait_for_pictures()), (2, 0));
    let log = shooting.end();
    assert!(log.contains("no picture for") && log.matches("pictures again after").count() == 1, "{log}");
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn dropped_pictures_are_counted_and_restart_nothing() {
    let mut shooting = Shooting::at_rate(COUNTED_HZ);
    // Ten in a row would be a stall: one in ten million positions.
    vivid::set(Fault::Dropped, 20);
    let camera = shooting.wait_for("four lost pictures", |camera| count(camera, "lost pictures") >= 4);
    assert_eq!(recoveries(&camera), (0, 0));
    shooting.wait_for_pictures();
    shooting.end();
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_damaged_picture_is_counted_and_not_published() {
    let mut shooting = Shooting::at_rate(COUNTED_HZ);
    vivid::press(Fault::DamagedPicture);
    shooting.wait_for("a damaged picture", |camera| count(camera, "damaged pictures") == 1);
    let camera = shooting.wait_for_pictures();
    assert_eq!((count(&camera, "damaged pictures"), recoveries(&camera)), (1, (0, 0)));
    assert_eq!(camera.sent, count(&camera, "pictures"), "it is not published");
    shooting.end();
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_camera_that_refuses_buffers_once_is_opened_again() {
    vivid::renew();
    vivid::press(Fault::RequestBuffers);
    let mut shooting = Shooting::start(&shooting());
    shooting.wait_for_pictures();
    let log = shooting.end();
    assert!(log.contains("VIDIOC_REQBUFS failed: Invalid argument"), "{log}");
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_buffer_refused_in_mid_stream_reopens_the_camera_once() {
    let mut shooting = Shooting::at_rate(COUNTED_HZ);
    vivid::press(Fault::QueueBuffer);
    shooting.wait_for("it is opened again", |camera| recoveries(camera) == (0, 1));
    assert_eq!(recoveries(&shooting.wait_for_pictures()), (0, 1));
    let log = shooting.end();
    assert!(log.contains("VIDIOC_QBUF failed: Invalid argument"), "{log}");
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_camera_that_refuses_to_start_once_is_opened_again() {
    vivid::renew();
    vivid::press(Fault::StreamOn);
    let mut shooting = Shooting::start(&shooting());
    shooting.wait_for_pictures();
    let log = shooting.end();
    assert!(log.contains("VIDIOC_STREAMON failed: Invalid argument"), "{log}");
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_broken_stream_is_started_again_once() {
    let mut shooting = Shooting::at_rate(COUNTED_HZ);
    vivid::press(Fault::Stream);
    shooting.wait_for("the stream is started again", |camera| recoveries(camera) == (1, 0));
    assert_eq!(recoveries(&shooting.wait_for_pictures()), (1, 0));
    let log = shooting.end();
    // The driver may be giving a buffer or taking a picture when the stream breaks.
    assert!(log.contains("the stream broke (VIDIOC_"), "{log}");
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_picture_count_that_wraps_counts_no_lost_pictures() {
    vivid::renew();
    vivid::set(Fault::CountNearItsEnd, 1);
    let mut shooting = Shooting::start(&shooting().set("camera.rate_hz", 60));
    let camera = shooting.wait_for("200 pictures", |camera| count(camera, "pictures") + count(camera, "lost pictures") > 200);
    // At this rate an emulated machine loses some, but not the two thousand million that the count jumps by.
    assert!(count(&camera, "lost pictures") < 200, "{camera:?}");
    shooting.end();
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_format_answered_with_another_is_reported() {
    vivid::renew();
    let mut shooting = Shooting::start(&shooting().set("camera.format", "mjpg"));
    let camera = shooting.wait_for_note("/dev/video0: refuses the format MJPG and gives ");
    assert_eq!(count(&camera, "pictures"), 0);
    shooting.end();
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_size_answered_with_another_is_reported() {
    vivid::renew();
    let mut shooting = Shooting::start(&shooting().set("camera.width", 160).set("camera.height", 120));
    let camera = shooting.wait_for_note("/dev/video0: gives 320 × 180, not the 160 × 120 asked for");
    assert_eq!(count(&camera, "pictures"), 0);
    shooting.end();
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn yuyv_and_grey_both_give_undamaged_pictures() {
    for (format, word) in [("yuyv", "320 × 180 YUYV at 15 Hz"), ("grey", "320 × 180 GREY at 15 Hz")] {
        vivid::renew();
        let mut shooting = Shooting::start(&shooting().set("camera.format", format));
        let camera = shooting.wait_for_pictures();
        assert!(camera.note.as_str().contains(word), "{camera:?}");
        assert_eq!(count(&camera, "damaged pictures"), 0);
        shooting.end();
    }
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_camera_in_use_elsewhere_is_opened_once_it_is_free() {
    vivid::renew();
    let config =
        CameraConfig { size: (320, 180), rate_hz: 15.0, codings: vec![Coding::Grey], input: Some(0), controls: FixedControls::default() };
    let other = Camera::open(Path::new(DEVICE), &config).unwrap();
    let mut shooting = Shooting::start(&shooting());
    shooting.wait_for_note("/dev/video0: in use by another program");
    drop(other);
    shooting.wait_for_pictures();
    shooting.end();
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn controls_are_set_and_missing_ones_reported() {
    vivid::renew();
    let brightness = toml::toml! { name = "brightness" value = 77 };
    let controlled = shooting().set("camera.gain", 42).set("camera.exposure_us", 10000).set("camera.control", [brightness]);
    let mut shooting = Shooting::start(&controlled);
    let camera = shooting.wait_for_pictures();
    assert_eq!(count(&camera, "controls not set"), 1, "{camera:?}");
    let device = Device::open(Path::new(DEVICE)).unwrap();
    assert_eq!((device.control(AUTO_GAIN).unwrap(), device.control(GAIN).unwrap()), (0, 42));
    let brightness = device.controls().unwrap().into_iter().find(|control| control.key() == "brightness").unwrap();
    assert_eq!(device.control(brightness.id).unwrap(), 77);
    let log = shooting.end();
    assert!(log.contains("this camera has no control exposure_us"), "{log}");
}
