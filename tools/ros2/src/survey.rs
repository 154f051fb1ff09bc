//! What a bag holds that can be imported: everything but its pictures, of which there may be gigabytes.

use std::collections::BTreeMap;

use messages::{FrameLayout, Pose};

use crate::bag::Bag;
use crate::camera_mount::{CameraMount, Optics};
use crate::cdr;
use crate::damages::Damages;
use crate::error::BagError;
use crate::files::natural;
use crate::interfaces::{CameraInfo, Odometry, Range, Text, TfMessage, name};
use crate::message::{Message, Topic};
use crate::picture::picture;
use crate::scans::Reading;
use crate::tally::Tally;
use crate::trajectory::{Sample, Trajectory};
use crate::transforms::{Mounts, frame, isometry, planar};

/// The topic with the settings of the deployment, in a bag that was exported from a log.
pub(crate) const SETTINGS_TOPIC: &str = "/stillmap/settings";
/// The frame of odometry by convention.
const ODOM: &str = "odom";
/// The frame of a robot by convention, where the odometry names none.
const BASE: &str = "base_link";
/// The longest range of the bus, m.
pub(crate) const MAX_RANGE_M: f64 = 10.0;
/// A variance of x of at least so much says that the position is unknown, m².
pub(crate) const UNKNOWN_M2: f64 = 1e6;
/// What can be imported, for messages.
const UNDERSTOOD: &str = "Range, Odometry, TFMessage, Image, CompressedImage or CameraInfo";

/// A sonar of a bag.
#[derive(Debug, Clone, PartialEq)]
pub struct SonarFound {
    /// Its topic.
    pub topic: String,
    /// Its frame.
    pub frame: String,
    /// Where it is mounted; `None` when no transform says it.
    pub mount: Option<Pose>,
    /// Its longest range, at most 10 m.
    pub max_range_m: f64,
    /// Its opening angle, rad.
    pub field_of_view_rad: f64,
}

/// A camera of a bag.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraFound {
    /// The topic of its pictures.
    pub topic: String,
    /// Its pictures as they will be in the log.
    pub layout: FrameLayout,
    /// Where it is mounted; `None` when no transform says it.
    pub mount: Option<CameraMount>,
    /// Its calibration, if it has one.
    pub optics: Option<Optics>,
}

/// What a bag holds.
pub struct Survey {
    /// The sonars, in the order of their numbers.
    pub sonars: Vec<SonarFound>,
    /// The camera.
    pub camera: Option<CameraFound>,
    /// The settings, in a bag that was exported from a log.
    pub settings: Option<String>,
    pub(crate) readings: Vec<Reading>,
    pub(crate) trajectory: Trajectory,
    pub(crate) tally: Tally,
    pub(crate) damages: Damages,
}

/// What is gathered while the messages pass.
#[derive(Default)]
struct Gathered {
    topics: BTreeMap<String, Topic>,
    /// Readings by topic and frame.
    ranges: BTreeMap<(String, String), Ranges>,
    odometry: BTreeMap<String, Driven>,
    /// Moving frames, by parent and child.
    moving: BTreeMap<(String, String), Vec<Sample>>,
    mounts: Mounts,
    /// By topic.
    calibrations: BTreeMap<String, CameraInfo>,
    /// The first picture of each topic: its frame and layout.
    pictures: BTreeMap<String, (String, FrameLayout)>,
    settings: Option<String>,
    tally: Tally,
    /// Messages so far.
    messages: u64,
}

#[derive(Default)]
struct Ranges {
    readings: Vec<Measured>,
    max_range_m: f64,
    field_of_view_rad: f64,
}

struct Measured {
    stamp_ns: u64,
    /// Its place among all messages of the bag.
    place: u64,
    range_m: f64,
    has_echo: bool,
}

#[derive(Default)]
struct Driven {
    base: String,
    samples: Vec<Sample>,
}

/// Reads all that can be imported but the pictures, of these topics or, if none is named, of all.
///
/// # Errors
/// When a file cannot be read, a named topic is missing or of a type that cannot be imported, or several could be the odometry or the
/// camera.
pub fn survey(bag: &Bag, topics: &[String]) -> Result<Survey, BagError> {
    let mut gathered = Gathered::default();
    let is_chosen = |topic: &Topic| {
        let is_small = [name::TF, name::CAMERA_INFO].contains(&topic.type_name.as_str()) || topic.name == SETTINGS_TOPIC;
        topics.is_empty() || is_small || topics.contains(&topic.name)
    };
    let seen = std::cell::RefCell::new(BTreeMap::new());
    let wants = |topic: &Topic| {
        seen.borrow_mut().insert(topic.name.clone(), topic.clone());
        is_chosen(topic) && is_understood(topic)
    };
    let damages = bag.visit(&wants, &mut |message| {
        gathered.take(&message);
        Ok(())
    })?;
    gathered.topics = seen.into_inner();
    gathered.check(topics)?;
    gathered.survey(topics, damages)
}

fn is_understood(topic: &Topic) -> bool {
    let types = [name::RANGE, name::ODOMETRY, name::TF, name::IMAGE, name::COMPRESSED, name::CAMERA_INFO];
    topic.encoding == "cdr"
        && (types.contains(&topic.type_name.as_str()) || topic.name == SETTINGS_TOPIC && topic.type_name == name::STRING)
}

impl Gathered {
    /// Takes a message in; one that cannot be read is counted.
    fn take(&mut self, message: &Message<'_>) {
        self.messages += 1;
        // One picture tells the size of all: to unpack the others would take as long as the import.
        let is_picture = [name::IMAGE, name::COMPRESSED].contains(&message.topic.type_name.as_str());
        if is_picture && self.pictures.contains_key(&message.topic.name) {
            return;
        }
        if let Err(problem) = message.data().and_then(|data| self.take_data(message, &data)) {
            self.tally.add(&message.topic.name, &problem);
        }
    }

    fn take_data(&mut self, message: &Message<'_>, data: &[u8]) -> Result<(), String> {
        let topic = message.topic;
        match topic.type_name.as_str() {
            name::RANGE => self.range(message, data),
            name::ODOMETRY => self.drive(message, data),
            name::TF => self.transforms(message, data),
            name::CAMERA_INFO => cdr::decode::<CameraInfo>(data).map(|info| {
                self.calibrations.entry(topic.name.clone()).or_insert(info);
            }),
            name::STRING => cdr::decode::<Text>(data).map(|text| self.settings = Some(text.data)),
            _ => picture(&topic.type_name, data).map(|picture| {
                self.pictures.insert(topic.name.clone(), (picture.header.frame_id, picture.layout));
            }),
        }
    }

    fn range(&mut self, message: &Message<'_>, data: &[u8]) -> Result<(), String> {
        let range: Range = cdr::decode(data)?;
        let max_range_m = decimal(range.max_range);
        if !(max_range_m > 0.0 && max_range_m.is_finite()) {
            return Err(format!("a max_range of {max_range_m} m, expected more than 0"));
        }
        let max_range_m = max_range_m.min(MAX_RANGE_M);
        // Infinity says that nothing is near; less than the least range that nothing was measured.
        let range_m = decimal(range.range);
        if range_m.is_nan() || range_m < decimal(range.min_range) {
            return Err("ranges below min_range or that are no numbers are left out".to_owned());
        }
        let key = (message.topic.name.clone(), frame(&range.header.frame_id));
        let sonar = self.ranges.entry(key).or_default();
        sonar.max_range_m = sonar.max_range_m.max(max_range_m);
        sonar.field_of_view_rad = f64::from(range.field_of_view);
        let stamp_ns = range.header.stamp_or(message.received_ns);
        let (range_m, has_echo) = (range_m.min(max_range_m), range_m < max_range_m);
        sonar.readings.push(Measured { stamp_ns, place: self.messages, range_m, has_echo });
        Ok(())
    }

    fn drive(&mut self, message: &Message<'_>, data: &[u8]) -> Result<(), String> {
        let odometry: Odometry = cdr::decode(data)?;
        let place = isometry(&odometry.pose).ok_or("a pose without an orientation")?;
        let driven = self.odometry.entry(message.topic.name.clone()).or_default();
        driven.base = frame(&odometry.child_frame_id);
        let is_doubtful = odometry.pose_covariance.0[0][0] >= UNKNOWN_M2;
        driven.samples.push(Sample { stamp_ns: odometry.header.stamp_or(message.received_ns), pose: planar(&place), is_doubtful });
        Ok(())
    }

    fn transforms(&mut self, message: &Message<'_>, data: &[u8]) -> Result<(), String> {
        let message_is_static = message.topic.name.ends_with("tf_static");
        for transform in cdr::decode::<TfMessage>(data)?.transforms {
            let (parent, child) = (frame(&transform.header.frame_id), frame(&transform.child_frame_id));
            let place = isometry(&transform.transform).ok_or("a transform without an orientation")?;
            if message_is_static {
                self.mounts.add(&parent, &child, place);
                continue;
            }
            let stamp_ns = transform.header.stamp_or(message.received_ns);
            let sample = Sample { stamp_ns, pose: planar(&place), is_doubtful: false };
            let samples = self.moving.entry((parent.clone(), child.clone())).or_default();
            samples.push(sample);
            // Joints that do not move may be published with those that do.
            if parent != ODOM && samples.len() == 1 {
                self.mounts.add(&parent, &child, place);
            }
        }
        Ok(())
    }

    /// Every topic that the caller names is there and can be imported.
    fn check(&self, named: &[String]) -> Result<(), BagError> {
        for topic in named {
            let Some(found) = self.topics.get(topic) else {
                let present: Vec<&str> = self.topics.keys().map(String::as_str).collect();
                return Err(BagError::NoTopic { topic: topic.clone(), present: present.join(", ") });
            };
            if !is_understood(found) {
                let problem = format!("{} in {:?} is not understood, expected {UNDERSTOOD} in \"cdr\"", found.type_name, found.encoding);
                return Err(BagError::Topic { topic: topic.clone(), problem });
            }
        }
        Ok(())
    }

    fn survey(mut self, named: &[String], damages: Damages) -> Result<Survey, BagError> {
        let (base, samples) = self.odometry()?;
        if self.ranges.is_empty() {
            return Err(BagError::Missing("readable messages of sensor_msgs/msg/Range"));
        }
        let mut ranges: Vec<_> = std::mem::take(&mut self.ranges).into_iter().collect();
        // Sonars are numbered in the order in which the caller names their topics, else by their names.
        let place = |topic: &String| named.iter().position(|named| named == topic);
        ranges.sort_by_cached_key(|((topic, frame), _)| (place(topic), natural(topic), natural(frame)));
        let (mut sonars, mut readings) = (Vec::new(), Vec::new());
        for (sonar, ((topic, frame), ranges)) in ranges.into_iter().enumerate() {
            let mount = self.mounts.base_from(&base, &frame).map(|place| planar(&place));
            let Ranges { max_range_m, field_of_view_rad, readings: found } = ranges;
            readings.extend(
                found
                    .into_iter()
                    .map(|Measured { stamp_ns, place, range_m, has_echo }| (place, Reading { stamp_ns, sonar, range_m, has_echo })),
            );
            sonars.push(SonarFound { topic, frame, mount, max_range_m, field_of_view_rad });
        }
        // Readings of one time stay in the order in which they were recorded.
        readings.sort_by_key(|(place, _)| *place);
        let readings = readings.into_iter().map(|(_, reading)| reading).collect();
        let camera = self.camera(&base)?;
        Ok(Survey { sonars, camera, settings: self.settings, readings, trajectory: Trajectory::new(samples), tally: self.tally, damages })
    }

    /// The robot's frame and its poses.
    fn odometry(&mut self) -> Result<(String, Vec<Sample>), BagError> {
        let mut topics = std::mem::take(&mut self.odometry);
        if topics.len() > 1 {
            let found = topics.into_keys().collect::<Vec<_>>().join(", ");
            return Err(BagError::Ambiguous { of: "nav_msgs/msg/Odometry", found });
        }
        if let Some((_, Driven { base, samples })) = topics.pop_first() {
            return Ok((if base.is_empty() { BASE.to_owned() } else { base }, samples));
        }
        let of_odom: Vec<_> = self.moving.keys().filter(|(parent, _)| parent == ODOM).cloned().collect();
        match of_odom.as_slice() {
            [pair] => Ok((pair.1.clone(), self.moving.remove(pair).unwrap_or_default())),
            [] => Err(BagError::Missing("odometry: neither nav_msgs/msg/Odometry nor a transform from \"odom\" in /tf")),
            several => {
                let found = several.iter().map(|(_, child)| child.as_str()).collect::<Vec<_>>().join(", ");
                Err(BagError::Ambiguous { of: "a frame under \"odom\"", found })
            }
        }
    }

    fn camera(&mut self, base: &str) -> Result<Option<CameraFound>, BagError> {
        // The same pictures may be there with and without compression.
        let all: Vec<String> = self.pictures.keys().cloned().collect();
        let is_copy = |topic: &String| all.iter().any(|raw| topic.strip_prefix(raw.as_str()).is_some_and(|rest| rest.starts_with('/')));
        self.pictures.retain(|topic, _| !is_copy(topic));
        if self.pictures.len() > 1 {
            let found = std::mem::take(&mut self.pictures).into_keys().collect::<Vec<_>>().join(", ");
            return Err(BagError::Ambiguous { of: "pictures", found });
        }
        let Some((topic, (frame, layout))) = self.pictures.pop_first() else { return Ok(None) };
        let mount = self.mounts.base_from(base, &frame).map(|place| CameraMount::of(&place));
        let optics = self.calibration(&topic).and_then(Optics::of);
        Ok(Some(CameraFound { topic, layout, mount, optics }))
    }

    /// The calibration that stands beside the pictures of this topic.
    fn calibration(&self, pictures: &str) -> Option<&CameraInfo> {
        let is_below = |folder: &str| pictures.strip_prefix(folder).is_some_and(|rest| rest.starts_with('/'));
        let beside = self.calibrations.iter().filter(|(info, _)| info.rsplit_once('/').is_some_and(|(folder, _)| is_below(folder)));
        beside.max_by_key(|(info, _)| info.len()).map(|(_, info)| info)
    }
}

/// A number of single precision as the decimal that it was meant to be: 1.234 rather than 1.2339999675750732.
fn decimal(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interfaces::{Header, RegionOfInterest};

    fn info(width: u32) -> CameraInfo {
        let header = Header::default();
        let (k, r, p, roi) = ([0.0; 9], [0.0; 9], [0.0; 12], RegionOfInterest::default());
        CameraInfo { header, height: 60, width, distortion_model: String::new(), d: Vec::new(), k, r, p, binning_x: 0, binning_y: 0, roi }
    }

    #[test]
    fn a_calibration_stands_in_the_folder_of_its_pictures() {
        let mut gathered = Gathered::default();
        let mut check = |calibrations: &[(&str, u32)], pictures: &str, expect: Option<u32>| {
            gathered.calibrations = calibrations.iter().map(|(topic, width)| ((*topic).to_owned(), info(*width))).collect();
            assert_eq!(gathered.calibration(pictures).map(|info| info.width), expect, "{pictures}");
        };
        check(&[("/cam/camera_info", 1)], "/camera2/image_raw", None);
        check(&[("/cam/camera_info", 1), ("/camera2/camera_info", 2)], "/camera2/image_raw", Some(2));
        check(&[("/cam/camera_info", 1), ("/cam/left/camera_info", 2)], "/cam/left/image_raw/compressed", Some(2));
        check(&[("/camera_info", 1)], "/image_raw", Some(1));
    }

    #[test]
    fn pictures_behind_the_first_are_not_unpacked() {
        let mut gathered = Gathered::default();
        let topic = Topic { name: "/image".to_owned(), type_name: name::IMAGE.to_owned(), encoding: "cdr".to_owned() };
        let packed_badly = Message { topic: &topic, received_ns: 1, stored: &[0x28, 0xb5, 0x2f, 0xfd, 0xff] };
        gathered.take(&packed_badly);
        assert_eq!(gathered.tally.lines().len(), 1);
        gathered.pictures.insert(topic.name.clone(), (String::new(), FrameLayout::packed(80, 60, messages::PixelFormat::Grey)));
        gathered.take(&packed_badly);
        assert!(gathered.tally.lines()[0].ends_with("(1 message)"), "{:?}", gathered.tally.lines());
    }
}
