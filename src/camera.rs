//! `stillmap camera`: lists the cameras of this computer and takes pictures with them.

use crate::exit::BadInput;
use crate::output;
use camera::{CameraConfig, Coding, ControlInfo, FixedControls, Identity, Offer, Snapshot, Trouble};
use clap::Subcommand;
use image::{GrayImage, ImageFormat};
use messages::printable;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

#[derive(Debug, Subcommand)]
pub(crate) enum CameraCommand {
    /// Lists the cameras with their formats, sizes and controls
    List {
        /// Camera to list; all are listed if it is not given
        #[arg(value_name = "DEVICE")]
        device: Option<PathBuf>,
        /// Input of the camera to select first, counted from 0
        #[arg(long, value_name = "N", requires = "device")]
        input: Option<u32>,
    },
    /// Takes a picture and writes it to a file
    Snapshot {
        /// Device of the camera, such as /dev/video0
        #[arg(value_name = "DEVICE")]
        device: PathBuf,
        /// File of the picture
        #[arg(long, value_name = "FILE.png")]
        out: PathBuf,
        /// Size of the picture in pixels
        #[arg(long, value_name = "WxH", default_value = "160x120", value_parser = size)]
        size: (u32, u32),
        /// Input of the camera, counted from 0; the selected one if it is not given
        #[arg(long, value_name = "N")]
        input: Option<u32>,
    },
}

/// Frame rate that a snapshot requests, Hz.
const RATE_HZ: f64 = 15.0;

/// Most sizes that are listed for a format.
const MOST_SIZES: usize = 12;

/// Carries out a `camera` command.
pub(crate) fn camera(command: &CameraCommand) -> anyhow::Result<()> {
    match command {
        CameraCommand::List { device: Some(device), input } => {
            output::write(&describe(device, &camera::offer(device, *input).map_err(|trouble| bad_device(device, &trouble))?))?;
        }
        CameraCommand::List { device: None, .. } => list()?,
        CameraCommand::Snapshot { device, out, size, input } => snapshot(device, out, *size, *input)?,
    }
    Ok(())
}

/// Lists every camera. An error of one does not hide the others.
fn list() -> anyhow::Result<()> {
    let devices = camera::devices()?;
    let mut cameras = 0;
    for device in &devices {
        match camera::offer(device, None) {
            Ok(offer) => output::write(&describe(device, &offer))?,
            // A camera may have such nodes beside the one that delivers pictures.
            Err(Trouble::NotACamera) => continue,
            Err(trouble) => output::line(&format!("{}: {trouble}", device.display()))?,
        }
        cameras += 1;
    }
    match cameras {
        0 if devices.is_empty() => Err(BadInput("no camera: there is no /dev/video*. Is it plugged in?".to_owned()).into()),
        0 => Err(BadInput(format!("no camera: none of the {} video devices delivers pictures", devices.len())).into()),
        _ => Ok(()),
    }
}

fn snapshot(device: &Path, out: &PathBuf, size: (u32, u32), input: Option<u32>) -> anyhow::Result<()> {
    let config = CameraConfig { size, rate_hz: RATE_HZ, codings: Coding::ALL.to_vec(), input, controls: FixedControls::default() };
    let Snapshot { given, luminance } = camera::snapshot(device, &config).map_err(|error| bad_device(device, &error))?;
    let (width, height) = (given.shape.width(), given.shape.height());
    // The camera writes as many bytes as the picture has pixels.
    let picture =
        GrayImage::from_raw(width, height, luminance).ok_or_else(|| anyhow::anyhow!("the camera delivered a picture of another size"))?;
    picture
        .save_with_format(out, ImageFormat::Png)
        .map_err(|error| BadInput(format!("{}: the picture cannot be written: {error}", out.display())))?;
    let (card, coding) = (given.identity.card, given.shape.coding().four_cc());
    output::line(&format!("{}: {width} × {height} from {card} ({coding})", out.display()))?;
    output::line(&format!("if the horizon is in row R of this picture, set camera.horizon_share to R / {height}"))?;
    Ok(())
}

fn bad_device(device: &Path, error: &impl std::fmt::Display) -> BadInput {
    BadInput(format!("{}: {error}", device.display()))
}

/// The formats and controls of a camera as text.
fn describe(device: &Path, offer: &Offer) -> String {
    let mut text = format!("{}: {}\n", device.display(), printable(&identity_text(&offer.identity)));
    if offer.inputs.len() > 1 {
        let inputs: Vec<_> = offer.inputs.iter().enumerate().map(|(number, name)| format!("{number} {name}")).collect();
        add(&mut text, "inputs", &inputs);
    }
    for format in &offer.formats {
        let mut sizes: Vec<_> = format.sizes.iter().take(MOST_SIZES).map(|&size| size_text(size)).collect();
        if format.sizes.len() > MOST_SIZES {
            sizes.push(format!("{} more", format.sizes.len() - MOST_SIZES));
        }
        add(&mut text, &format.coding.four_cc().to_string(), &sizes);
    }
    if offer.formats.is_empty() {
        add(&mut text, "formats", &["none that stillmap can read (GREY, YUYV, MJPG)".to_owned()]);
    }
    if !offer.others.is_empty() {
        let others: Vec<_> = offer.others.iter().map(ToString::to_string).collect();
        add(&mut text, "formats not read", &others);
    }
    let as_text = |control: &ControlInfo| {
        let (least, greatest) = control.range;
        format!("{} {least} to {greatest} ({})", control.key(), control.default)
    };
    let controls: Vec<_> = offer.controls.iter().map(as_text).collect();
    if !controls.is_empty() {
        add(&mut text, "controls (default)", &controls);
    }
    text
}

fn identity_text(identity: &Identity) -> String {
    format!("{} ({}, {})", identity.card, identity.driver, identity.bus)
}

fn size_text((width, height, rate_hz): (u32, u32, Option<f64>)) -> String {
    let rate = rate_hz.map(|rate_hz| format!(" to {rate_hz:.0} Hz")).unwrap_or_default();
    format!("{width} × {height}{rate}")
}

fn add(text: &mut String, what: &str, entries: &[String]) {
    // Writing to a string does not fail.
    let _ = writeln!(text, "  {}: {}", printable(what), printable(&entries.join(", ")));
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let numbers = text.split_once('x').and_then(|(width, height)| width.parse().ok().zip(height.parse().ok()));
    let sound = |&(width, height): &(u32, u32)| (1..=8192).contains(&width) && (1..=8192).contains(&height);
    numbers.filter(sound).ok_or_else(|| "expected WIDTHxHEIGHT in pixels, such as 160x120".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use camera::OfferedFormat;

    #[test]
    fn a_camera_is_described_in_lines() {
        let offer = Offer {
            identity: Identity { card: "Webcam".into(), driver: "uvcvideo".into(), bus: "usb-1".into() },
            inputs: vec!["Input 1".into()],
            formats: vec![OfferedFormat { coding: Coding::Yuyv, sizes: vec![(160, 120, Some(30.0)), (640, 480, None)] }],
            others: vec![camera::FourCc(u32::from_le_bytes(*b"H264"))],
            controls: vec![ControlInfo { id: 1, name: "Gain".into(), range: (0, 100), default: 40 }],
        };
        assert_eq!(
            describe(Path::new("/dev/video0"), &offer),
            "/dev/video0: Webcam (uvcvideo, usb-1)\n  YUYV: 160 × 120 to 30 Hz, 640 × 480\n  formats not read: H264\n  \
             controls (default): gain 0 to 100 (40)\n"
        );
    }

    #[test]
    fn an_unusable_device_is_reported_in_one_line() {
        let message = |device: &str| {
            let device = PathBuf::from(device);
            camera(&CameraCommand::List { device: Some(device), input: None }).unwrap_err().to_string()
        };
        assert!(message("/dev/no-such-camera").starts_with("/dev/no-such-camera: no such device: is the camera plugged in?"));
        assert_eq!(message("/dev/null"), "/dev/null: not a camera that streams pictures");
        let out = std::env::temp_dir().join("none.png");
        let command = CameraCommand::Snapshot { device: "/dev/zero".into(), out, size: (160, 120), input: None };
        assert_eq!(camera(&command).unwrap_err().to_string(), "/dev/zero: not a camera that streams pictures");
    }

    #[test]
    fn a_size_is_two_numbers_of_pixels() {
        assert_eq!(size("160x120"), Ok((160, 120)));
        for wrong in ["", "160", "160x", "x120", "0x120", "160x9000", "160×120", "-1x2", "160x120x3"] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }
}
