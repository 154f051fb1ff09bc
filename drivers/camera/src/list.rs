//! Which cameras there are, and what they offer.

use std::path::{Path, PathBuf};

use crate::coding::Coding;
use crate::controls::ControlInfo;
use crate::device::{Device, Identity};
use crate::four_cc::FourCc;
use crate::trouble::Trouble;

/// What a camera offers.
#[derive(Debug, Clone, PartialEq)]
pub struct Offer {
    /// Who it is.
    pub identity: Identity,
    /// The names of its inputs, in order.
    pub inputs: Vec<String>,
    /// The formats that this driver reads, with their sizes and rates.
    pub formats: Vec<OfferedFormat>,
    /// The names of its other formats.
    pub others: Vec<FourCc>,
    /// The controls that can be set.
    pub controls: Vec<ControlInfo>,
}

/// A format that a camera offers.
#[derive(Debug, Clone, PartialEq)]
pub struct OfferedFormat {
    /// How the pixels are coded.
    pub coding: Coding,
    /// Width, height, and the highest rate in Hz if the camera says; of a range, the smallest and the largest size.
    pub sizes: Vec<(u32, u32, Option<f64>)>,
}

/// The video devices of this computer, in the order of their numbers: cameras and others.
///
/// # Errors
/// When the folder of devices cannot be read.
pub fn devices() -> std::io::Result<Vec<PathBuf>> {
    let number = |path: &Path| path.file_name()?.to_str()?.strip_prefix("video")?.parse::<u32>().ok();
    let mut found: Vec<_> = std::fs::read_dir("/dev")?
        .flatten()
        .map(|entry| entry.path())
        .filter_map(|path| number(&path).map(|number| (number, path)))
        .collect();
    found.sort();
    Ok(found.into_iter().map(|(_, path)| path).collect())
}

/// What a camera offers on the input that is selected, or on this one.
///
/// # Errors
/// When it cannot be opened, or is gone.
pub fn offer(path: &Path, input: Option<u32>) -> Result<Offer, Trouble> {
    let device = Device::open(path)?;
    if let Some(input) = input {
        device.select_input(input)?;
    }
    let (mut formats, mut others) = (Vec::new(), Vec::new());
    for (four_cc, _) in device.formats()? {
        match Coding::ALL.into_iter().find(|coding| coding.four_cc() == four_cc) {
            Some(coding) => formats.push(OfferedFormat { coding, sizes: sizes(&device, four_cc)? }),
            None => others.push(four_cc),
        }
    }
    Ok(Offer { identity: device.identity().clone(), inputs: device.inputs()?, formats, others, controls: device.controls()? })
}

fn sizes(device: &Device, format: FourCc) -> Result<Vec<(u32, u32, Option<f64>)>, Trouble> {
    let with_rate = |(width, height)| {
        let highest = device.rates(format, (width, height))?.into_iter().reduce(f64::max);
        Ok((width, height, highest))
    };
    device.sizes(format)?.into_iter().map(with_rate).collect()
}
