//! The configuration that a camera is asked for, and an open camera.

use std::path::Path;

use crate::coding::{Coding, Shape};
use crate::controls::{ControlTrouble, FixedControls};
use crate::device::{Device, Identity};
use crate::stream::Stream;
use crate::trouble::Trouble;

/// The configuration that a camera is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraConfig {
    /// Width and height of its pictures.
    pub size: (u32, u32),
    /// Pictures a second.
    pub rate_hz: f64,
    /// Codings that may be used, the best first.
    pub codings: Vec<Coding>,
    /// The input to use, numbered from 0; the one that is selected when not given.
    pub input: Option<u32>,
    /// Controls to set to fixed values.
    pub controls: FixedControls,
}

/// A camera that takes pictures as it was asked to, as far as it can.
#[derive(Debug)]
pub struct Camera {
    /// Its pictures.
    pub stream: Stream,
    /// The configuration that it gives.
    pub given: Given,
}

/// The configuration that a camera gives.
#[derive(Debug, Clone, PartialEq)]
pub struct Given {
    /// The device.
    pub identity: Identity,
    /// The form of its pictures.
    pub shape: Shape,
    /// Pictures a second, if it says.
    pub rate_hz: Option<f64>,
    /// Controls that are not as they were asked for.
    pub troubles: Vec<ControlTrouble>,
}

impl core::fmt::Display for Given {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { identity, shape, rate_hz, .. } = self;
        write!(f, "{}, {} × {} {}", identity.card, shape.width(), shape.height(), shape.coding().four_cc())?;
        rate_hz.map_or(Ok(()), |rate_hz| write!(f, " at {rate_hz:.0} Hz"))
    }
}

impl Camera {
    /// Opens a camera, sets it up and starts to take pictures.
    ///
    /// # Errors
    /// When it is not there, or does not give pictures of the size asked for. Rate and controls it may keep.
    pub fn open(path: &Path, config: &CameraConfig) -> Result<Self, Trouble> {
        let device = Device::open(path)?;
        if let Some(input) = config.input {
            device.select_input(input)?;
        }
        let shape = device.set_format(&config.codings, config.size)?;
        let rate_hz = device.set_rate(config.rate_hz)?;
        let troubles = fix(&device, &config.controls)?;
        let given = Given { identity: device.identity().clone(), shape, rate_hz, troubles };
        Ok(Self { stream: Stream::start(device)?, given })
    }
}

fn fix(device: &Device, controls: &FixedControls) -> Result<Vec<ControlTrouble>, Trouble> {
    if *controls == FixedControls::default() {
        return Ok(Vec::new());
    }
    let (settings, mut troubles) = controls.settings(&device.controls()?);
    for setting in settings {
        let refused = |answer: String| ControlTrouble::Refused { name: setting.name.clone(), wanted: setting.value, answer };
        match device.set_control(setting.id, setting.value).and_then(|()| device.control(setting.id)) {
            Ok(value) if value == setting.value => {}
            Ok(value) => troubles.push(refused(format!("takes {value} instead"))),
            Err(Trouble::Absent) => return Err(Trouble::Absent),
            Err(trouble) => troubles.push(refused(format!("refuses: {trouble}"))),
        }
    }
    Ok(troubles)
}
