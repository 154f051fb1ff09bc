//! A video device: what it is and offers, and how it is set up. Nothing here waits.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::Path;

use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;

use crate::abi;
use crate::coding::{Coding, Shape};
use crate::controls::ControlInfo;
use crate::four_cc::FourCc;
use crate::trouble::Trouble;

/// Most entries taken from an enumeration: a kernel driver that never ends one must not hang this process.
const MOST_ENTRIES: u32 = 256;

/// Rates are told to the device in thousandths of a picture a second.
const RATE_DENOMINATOR: f64 = 1000.0;

/// A camera that has been opened.
#[derive(Debug)]
pub struct Device {
    descriptor: OwnedFd,
    identity: Identity,
}

/// What a camera says of itself.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Identity {
    /// Its name.
    pub card: String,
    /// The kernel's driver.
    pub driver: String,
    /// Where it is connected.
    pub bus: String,
}

impl Device {
    /// Opens a camera without waiting for anything. Several programs may; only one can take pictures.
    ///
    /// # Errors
    /// When it is not there, may not be opened, or is no camera that streams.
    pub fn open(path: &Path) -> Result<Self, Trouble> {
        let descriptor = rustix::fs::open(path, OFlags::RDWR | OFlags::NONBLOCK | OFlags::CLOEXEC, Mode::empty())
            .map_err(|error| Trouble::of("open", error))?;
        let mut found = abi::Capability::default();
        abi::query_capability(descriptor.as_fd(), &mut found).map_err(|error| match error {
            // A file that is no device at all says so in this way.
            Errno::INVAL => Trouble::NotACamera,
            error => Trouble::of("VIDIOC_QUERYCAP", error),
        })?;
        let own = if found.capabilities & abi::CAP_DEVICE_CAPS == 0 { found.capabilities } else { found.device_caps };
        if own & abi::CAP_VIDEO_CAPTURE == 0 || own & abi::CAP_STREAMING == 0 {
            return Err(Trouble::NotACamera);
        }
        let identity = Identity { card: abi::text(&found.card), driver: abi::text(&found.driver), bus: abi::text(&found.bus) };
        Ok(Self { descriptor, identity })
    }

    /// What it says of itself.
    #[must_use]
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Selects one of its inputs, numbered from 0.
    ///
    /// # Errors
    /// When it does not have it, or another program is taking pictures.
    pub fn select_input(&self, wanted: u32) -> Result<(), Trouble> {
        let mut input = wanted;
        match abi::set_input(self.as_fd(), &mut input) {
            Err(Errno::INVAL | Errno::NOTTY) => Err(Trouble::Input { wanted, count: self.inputs()?.len() as u32 }),
            result => result.map_err(|error| Trouble::of("VIDIOC_S_INPUT", error)),
        }
    }

    /// Sets the first of these codings that it has in this size. What it answers counts: many devices take any format and give
    /// another.
    ///
    /// # Errors
    /// When it has none of them.
    pub fn set_format(&self, codings: &[Coding], wanted: (u32, u32)) -> Result<Shape, Trouble> {
        let mut best = None;
        for &coding in codings {
            let given = self.try_format(coding, wanted)?;
            let (found, size) = (FourCc(given.pixel_format), (given.width, given.height));
            if found == coding.four_cc() && size == wanted {
                return Shape::new(coding, given.width, given.height, given.bytes_per_line);
            }
            // That it has the coding in another size tells more than that it does not have a coding.
            if found == coding.four_cc() {
                best = Some(Trouble::Size { wanted, found: size });
            } else if best.is_none() {
                let names: Vec<_> = codings.iter().map(|coding| coding.four_cc().to_string()).collect();
                best = Some(Trouble::Format { wanted: names.join(", "), found });
            }
        }
        Err(best.unwrap_or(Trouble::NotACamera))
    }

    fn try_format(&self, coding: Coding, (width, height): (u32, u32)) -> Result<abi::Format, Trouble> {
        let mut format = abi::Format {
            kind: abi::VIDEO_CAPTURE,
            width,
            height,
            pixel_format: coding.four_cc().0,
            field: abi::FIELD_NONE,
            ..abi::Format::default()
        };
        match abi::set_format(self.as_fd(), &mut format) {
            // Some devices refuse what others replace; the format's place says what was asked for, not what is given.
            Err(Errno::INVAL) => Ok(abi::Format { pixel_format: 0, ..format }),
            result => result.map(|()| format).map_err(|error| Trouble::of("VIDIOC_S_FMT", error)),
        }
    }

    /// Asks for this many pictures a second. Returns how many there will be, if the device says.
    ///
    /// # Errors
    /// When the device is gone; one that has but one rate is content.
    pub fn set_rate(&self, rate_hz: f64) -> Result<Option<f64>, Trouble> {
        let mut parameters = abi::StreamParameters {
            kind: abi::VIDEO_CAPTURE,
            numerator: RATE_DENOMINATOR as u32,
            denominator: (rate_hz * RATE_DENOMINATOR) as u32,
            ..abi::StreamParameters::default()
        };
        match abi::set_parameters(self.as_fd(), &mut parameters) {
            Ok(()) => Ok(rate(parameters.numerator, parameters.denominator)),
            Err(Errno::INVAL | Errno::NOTTY) => Ok(None),
            Err(error) => Err(Trouble::of("VIDIOC_S_PARM", error)),
        }
    }

    /// The value of a control.
    ///
    /// # Errors
    /// What the device says.
    pub fn control(&self, id: u32) -> Result<i32, Trouble> {
        let mut control = abi::Control { id, value: 0 };
        abi::get_control(self.as_fd(), &mut control).map_err(|error| Trouble::of("VIDIOC_G_CTRL", error))?;
        Ok(control.value)
    }

    /// Sets a control.
    ///
    /// # Errors
    /// What the device says.
    pub fn set_control(&self, id: u32, value: i32) -> Result<(), Trouble> {
        let mut control = abi::Control { id, value };
        abi::set_control(self.as_fd(), &mut control).map_err(|error| Trouble::of("VIDIOC_S_CTRL", error))
    }

    /// Its controls that have a value, in the order of their numbers.
    ///
    /// # Errors
    /// When the device is gone.
    pub fn controls(&self) -> Result<Vec<ControlInfo>, Trouble> {
        let mut last = 0;
        let mut controls = Vec::new();
        for _ in 0..MOST_ENTRIES {
            let mut entry = abi::ControlDescription { id: last | abi::NEXT_CONTROL, ..abi::ControlDescription::default() };
            match abi::query_control(self.as_fd(), &mut entry) {
                Ok(()) => last = entry.id,
                Err(Errno::INVAL | Errno::NOTTY) => break,
                Err(error) => return Err(Trouble::of("VIDIOC_QUERYCTRL", error)),
            }
            let usable = entry.flags & (abi::CONTROL_DISABLED | abi::CONTROL_READ_ONLY) == 0;
            if usable && abi::CONTROL_KINDS_WITH_A_VALUE.contains(&entry.kind) {
                controls.push(ControlInfo {
                    id: entry.id,
                    name: abi::text(&entry.name),
                    range: (entry.minimum, entry.maximum),
                    default: entry.default,
                });
            }
        }
        Ok(controls)
    }

    /// The names of its inputs, in order.
    ///
    /// # Errors
    /// When the device is gone.
    pub fn inputs(&self) -> Result<Vec<String>, Trouble> {
        self.entries("VIDIOC_ENUMINPUT", |index| {
            let mut entry = abi::InputDescription { index, ..abi::InputDescription::default() };
            abi::enumerate_input(self.as_fd(), &mut entry).map(|()| abi::text(&entry.name))
        })
    }

    /// Its pixel formats with their names.
    ///
    /// # Errors
    /// When the device is gone.
    pub fn formats(&self) -> Result<Vec<(FourCc, String)>, Trouble> {
        self.entries("VIDIOC_ENUM_FMT", |index| {
            let mut entry = abi::FormatDescription { index, kind: abi::VIDEO_CAPTURE, ..abi::FormatDescription::default() };
            abi::enumerate_format(self.as_fd(), &mut entry).map(|()| (FourCc(entry.pixel_format), abi::text(&entry.description)))
        })
    }

    /// The picture sizes of a pixel format, in the device's order; of a range, the smallest and the largest.
    ///
    /// # Errors
    /// When the device is gone.
    pub fn sizes(&self, format: FourCc) -> Result<Vec<(u32, u32)>, Trouble> {
        let sizes = self.entries("VIDIOC_ENUM_FRAMESIZES", |index| {
            let mut entry = abi::FrameSize { index, pixel_format: format.0, ..abi::FrameSize::default() };
            abi::enumerate_size(self.as_fd(), &mut entry).map(|()| match (entry.kind, entry.numbers) {
                (abi::DISCRETE, [width, height, ..]) => vec![(width, height)],
                (_, [least_width, most_width, _, least_height, most_height, _]) => {
                    vec![(least_width, least_height), (most_width, most_height)]
                }
            })
        })?;
        Ok(sizes.concat())
    }

    /// The rates of a picture size, Hz; of a range, the highest and the lowest.
    ///
    /// # Errors
    /// When the device is gone.
    pub fn rates(&self, format: FourCc, (width, height): (u32, u32)) -> Result<Vec<f64>, Trouble> {
        let rates = self.entries("VIDIOC_ENUM_FRAMEINTERVALS", |index| {
            let mut entry = abi::FrameInterval { index, pixel_format: format.0, width, height, ..abi::FrameInterval::default() };
            abi::enumerate_interval(self.as_fd(), &mut entry).map(|()| match (entry.kind, entry.numbers) {
                (abi::DISCRETE, [numerator, denominator, ..]) => vec![rate(numerator, denominator)],
                (_, [shortest, of_shortest, longest, of_longest, ..]) => {
                    vec![rate(shortest, of_shortest), rate(longest, of_longest)]
                }
            })
        })?;
        Ok(rates.into_iter().flatten().flatten().collect())
    }

    fn entries<T>(&self, call: &'static str, entry: impl Fn(u32) -> Result<T, Errno>) -> Result<Vec<T>, Trouble> {
        let mut entries = Vec::new();
        for index in 0..MOST_ENTRIES {
            match entry(index) {
                Ok(entry) => entries.push(entry),
                // The end, or an enumeration that this device does not have.
                Err(Errno::INVAL | Errno::NOTTY | Errno::NODATA) => break,
                Err(error) => return Err(Trouble::of(call, error)),
            }
        }
        Ok(entries)
    }
}

impl AsFd for Device {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.descriptor.as_fd()
    }
}

/// Pictures a second of an interval in seconds.
fn rate(numerator: u32, denominator: u32) -> Option<f64> {
    (numerator > 0 && denominator > 0).then(|| f64::from(denominator) / f64::from(numerator))
}
