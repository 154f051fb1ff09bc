//! The camera's driver against every fault that the virtual camera knows: each costs pictures, none costs the process.

use std::path::Path;

use camera::{Camera, Coding, Device, Held, Wish};
use rustix::process::Signal;
use serde_json::Value;

use crate::PATIENT;
use crate::harness::{Bench, Run, signal, text};
use crate::vivid::{self, AUTO_GAIN, DEVICE, Fault, GAIN, WEBCAM};

/// A deployment that takes pictures. Its robot is not there, and that is no matter.
struct Shooting {
    bench: Bench,
    run: Run,
}

impl Shooting {
    fn start(camera: &str) -> Self {
        let bench = Bench::new();
        let settings = format!(
            "name = \"shooting\"\n[[process]]\nname = \"camera\"\nrun = \"camera\"\n[[process]]\nname = \"pioneer\"\nrun = \"pioneer\"\n\
             {PATIENT}[pioneer]\nport = \"/dev/no-robot\"\n[camera]\ndevice = \"{DEVICE}\"\n{camera}"
        );
        let settings = bench.write("shooting.toml", &settings);
        let run = Run::start(bench.stillmap(["run", settings.to_str().unwrap()]));
        Self { bench, run }
    }

    /// A deployment with a new camera that gives pictures.
    fn with_pictures() -> Self {
        vivid::renew();
        let shooting = Self::start(WEBCAM);
        shooting.goes_on();
        shooting
    }

    /// The driver's status when `wanted` holds of it.
    fn when(&self, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        let camera = self.bench.wait_for("camera", what, wanted);
        assert_eq!(camera["restarts"], 0, "{camera}");
        camera
    }

    fn noted(&self, words: &str) -> Value {
        self.when(words, |camera| camera["note"].as_str().is_some_and(|note| note.contains(words)))
    }

    /// Ten more pictures than now come, and the note says so.
    fn goes_on(&self) -> Value {
        let now = self.when("it says something", |camera| camera["counters"]["pictures"].is_u64());
        let enough = count(&now, "pictures") + 10;
        self.when("ten more pictures", |camera| {
            count(camera, "pictures") >= enough && camera["note"].as_str().is_some_and(|note| note.ends_with("pictures a second"))
        })
    }

    /// Ends it; what it logged.
    fn end(self) -> String {
        signal(self.run.pid().into(), Signal::INT);
        let output = self.run.end();
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        text(&output.stderr)
    }
}

fn count(camera: &Value, name: &str) -> u64 {
    camera["counters"][name].as_u64().unwrap_or_default()
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn pulled_out_and_put_back() {
    let shooting = Shooting::with_pictures();
    vivid::pull();
    shooting.noted("/dev/video0: no such device");
    vivid::plug();
    let camera = shooting.goes_on();
    assert!(count(&camera, "reopenings") > 0, "{camera}");
    let log = shooting.end();
    assert!(log.contains("pictures again after"), "{log}");
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn disconnected() {
    let shooting = Shooting::with_pictures();
    vivid::press(Fault::Disconnect);
    // It comes back by itself when the last program has closed it.
    shooting.when("it is opened again", |camera| count(camera, "reopenings") > 0);
    shooting.goes_on();
    let log = shooting.end();
    assert!(log.contains("no such device"), "{log}");
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn stalled() {
    let shooting = Shooting::with_pictures();
    vivid::set(Fault::Dropped, 100);
    shooting.noted("/dev/video0: no picture for");
    let stalled = shooting.when("the stream is started again", |camera| count(camera, "stream restarts") >= 2);
    vivid::set(Fault::Dropped, 0);
    let camera = shooting.goes_on();
    assert!(count(&camera, "stream restarts") >= count(&stalled, "stream restarts"));
    let log = shooting.end();
    assert!(log.contains("no picture for") && log.contains("pictures again after"), "{log}");
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn half_of_its_pictures_dropped() {
    let shooting = Shooting::with_pictures();
    vivid::set(Fault::Dropped, 50);
    shooting.when("20 lost pictures", |camera| count(camera, "lost pictures") >= 20);
    shooting.goes_on();
    shooting.end();
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_damaged_picture() {
    let shooting = Shooting::with_pictures();
    vivid::press(Fault::DamagedPicture);
    shooting.when("a damaged picture", |camera| count(camera, "damaged pictures") == 1);
    let camera = shooting.goes_on();
    assert_eq!(count(&camera, "damaged pictures"), 1);
    assert_eq!(camera["sent"], count(&camera, "pictures"), "it is not published");
    shooting.end();
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn no_buffers_at_first() {
    vivid::renew();
    vivid::press(Fault::RequestBuffers);
    let shooting = Shooting::start(WEBCAM);
    shooting.goes_on();
    let log = shooting.end();
    assert!(log.contains("VIDIOC_REQBUFS failed: Invalid argument"), "{log}");
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_buffer_refused_in_mid_stream() {
    let shooting = Shooting::with_pictures();
    vivid::press(Fault::QueueBuffer);
    shooting.when("it is opened again", |camera| count(camera, "reopenings") > 0);
    shooting.goes_on();
    let log = shooting.end();
    assert!(log.contains("VIDIOC_QBUF failed: Invalid argument"), "{log}");
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn no_start_at_first() {
    vivid::renew();
    vivid::press(Fault::StreamOn);
    let shooting = Shooting::start(WEBCAM);
    shooting.goes_on();
    let log = shooting.end();
    assert!(log.contains("VIDIOC_STREAMON failed: Invalid argument"), "{log}");
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_broken_stream() {
    let shooting = Shooting::with_pictures();
    vivid::press(Fault::Stream);
    shooting.when("the stream is started again", |camera| count(camera, "stream restarts") > 0);
    shooting.goes_on();
    let log = shooting.end();
    assert!(log.contains("the stream broke (VIDIOC_"), "{log}");
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_count_that_starts_anew_at_its_end() {
    vivid::renew();
    vivid::set(Fault::CountNearItsEnd, 1);
    let shooting = Shooting::start(&WEBCAM.replace("rate_hz = 15", "rate_hz = 60"));
    let camera = shooting.when("200 pictures", |camera| count(camera, "pictures") + count(camera, "lost pictures") > 200);
    assert!(count(&camera, "lost pictures") < 200, "{camera}");
    shooting.end();
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_format_that_it_answers_with_another() {
    vivid::renew();
    let shooting = Shooting::start(&format!("{WEBCAM}format = \"mjpg\"\n"));
    let camera = shooting.noted("/dev/video0: refuses the format MJPG and gives ");
    assert_eq!(count(&camera, "pictures"), 0);
    shooting.end();
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_size_that_it_does_not_have() {
    vivid::renew();
    let shooting = Shooting::start("input = 0\n");
    let camera = shooting.noted("/dev/video0: gives 320 × 180, not the 160 × 120 asked for");
    assert_eq!(count(&camera, "pictures"), 0);
    shooting.end();
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn both_codings_that_it_has() {
    for (format, word) in [("yuyv", "320 × 180 YUYV at 15 Hz"), ("grey", "320 × 180 GREY at 15 Hz")] {
        vivid::renew();
        let shooting = Shooting::start(&format!("{WEBCAM}format = \"{format}\"\n"));
        let camera = shooting.goes_on();
        assert!(camera["note"].as_str().unwrap().contains(word), "{camera}");
        assert_eq!(count(&camera, "damaged pictures"), 0);
        shooting.end();
    }
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn in_use_by_another_program() {
    vivid::renew();
    let wish = Wish { size: (320, 180), rate_hz: 15.0, codings: vec![Coding::Grey], input: Some(0), held: Held::default() };
    let other = Camera::open(Path::new(DEVICE), &wish).unwrap();
    let shooting = Shooting::start(WEBCAM);
    shooting.noted("/dev/video0: in use by another program");
    drop(other);
    shooting.goes_on();
    shooting.end();
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn controls_are_held_and_those_it_lacks_are_said() {
    vivid::renew();
    let shooting =
        Shooting::start(&format!("{WEBCAM}gain = 42\nexposure_us = 10000\n[[camera.control]]\nname = \"brightness\"\nvalue = 77\n"));
    let camera = shooting.goes_on();
    assert_eq!(count(&camera, "controls not set"), 1, "{camera}");
    let device = Device::open(Path::new(DEVICE)).unwrap();
    assert_eq!((device.control(AUTO_GAIN).unwrap(), device.control(GAIN).unwrap()), (0, 42));
    let brightness = device.controls().unwrap().into_iter().find(|control| control.key() == "brightness").unwrap();
    assert_eq!(device.control(brightness.id).unwrap(), 77);
    let log = shooting.end();
    assert!(log.contains("this camera has no control exposure_us"), "{log}");
}
