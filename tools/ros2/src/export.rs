//! From a log to a bag.

use std::collections::BTreeMap;
use std::path::Path;

use drivelog::{Image, Log, Logged, RawMessage};
use messages::{
    AFTER_DOUBT, AFTER_LOSS, CameraFrame, MapTile, Payload, Pictures, PixelFormat, Pose, RobotEstimate, SonarReading, SonarScan, Walkers,
};

use crate::bag_writer::{BagWriter, Type};
use crate::cdr::{encode, encode_with_bytes};
use crate::damages::Damages;
use crate::error::BagError;
use crate::interfaces::Pose as RosPose;
use crate::interfaces::{
    CameraInfo, Covariance, Header, ImageHead, Odometry, Quaternion, Range, RegionOfInterest, Text, TfMessage, Time, TransformStamped,
    Vector3, name,
};
use crate::markers::MarkerArray;
use crate::occupancy::Occupancy;
use crate::scans::SPACING_NS;
use crate::survey::{SETTINGS_TOPIC, UNKNOWN_M2};
use crate::tally::Tally;
use crate::trajectory::is_gap;

/// Frames of the bag.
const MAP: &str = "map";
const ODOM: &str = "odom";
const BASE: &str = "base_link";
const CAMERA: &str = "camera_optical";
/// `sensor_msgs/msg/Range`: the kind of its sensor.
const ULTRASOUND: u8 = 0;

macro_rules! types {
    ($($ty:ident: $name:expr, $file:literal;)*) => {
        $(const $ty: Type = Type { name: $name, definition: include_str!(concat!("schemas/", $file)) };)*
    };
}

types! {
    RANGE: name::RANGE, "Range.msg";
    ODOMETRY: name::ODOMETRY, "Odometry.msg";
    TF: name::TF, "TFMessage.msg";
    IMAGE: name::IMAGE, "Image.msg";
    CAMERA_INFO: name::CAMERA_INFO, "CameraInfo.msg";
    STRING: name::STRING, "String.msg";
    GRID: "nav_msgs/msg/OccupancyGrid", "OccupancyGrid.msg";
    MARKERS: "visualization_msgs/msg/MarkerArray", "MarkerArray.msg";
}

/// What a log does not say of its sensors by itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensors {
    /// Mounts of the sonars, in the order of their numbers.
    pub sonars: Vec<Pose>,
    /// Range at and above which a reading is no echo, m.
    pub max_range_m: f64,
    /// Opening angle of a sonar, rad.
    pub field_of_view_rad: f64,
    /// Mount of the camera in the plane.
    pub camera: Pose,
    /// Height of the lens above the floor, m.
    pub camera_height_m: f64,
    /// Horizontal field of view of the camera, rad.
    pub camera_field_of_view_rad: f64,
    /// Row of the horizon as a share of the height, from the top.
    pub horizon_share: f64,
    /// Whether the log has estimates of localisation: else the map is in the frame of the odometry.
    pub is_localised: bool,
}

/// What came of an export.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Exported {
    /// Messages by topic.
    pub messages: BTreeMap<String, u64>,
    /// What was left out, and why.
    pub left_out: Vec<String>,
}

/// Writes a log as a bag into the new folder `to`.
///
/// # Errors
/// When the folder exists already or a file in it cannot be written.
pub fn export(log: &mut Log, sensors: &Sensors, to: &Path) -> Result<Exported, BagError> {
    let (bag, maps, tally) = (BagWriter::create(to)?, BTreeMap::new(), Tally::default());
    let mut export = Export { bag, sensors, maps, tally, last_ns: None, last_scan_ns: None };
    let settings = log.preamble().settings.clone();
    let mut damages = Damages::default();
    loop {
        match log.advance() {
            Ok(true) => {}
            Ok(false) => break,
            Err(error) => {
                damages.add(error.to_string());
                continue;
            }
        }
        let Some(message) = log.message() else { continue };
        if export.last_ns.is_none() {
            export.begin(message.log_ns, &settings)?;
        }
        export.take(&message)?;
    }
    export.maps(None)?;
    let Export { bag, tally, .. } = export;
    let messages = bag.counts();
    bag.finish()?;
    Ok(Exported { messages, left_out: damages.lines().into_iter().chain(tally.lines()).collect() })
}

struct Export<'a> {
    bag: BagWriter,
    sensors: &'a Sensors,
    /// By layer.
    maps: BTreeMap<u32, Occupancy>,
    tally: Tally,
    /// Time of the last message; `None` before the first.
    last_ns: Option<u64>,
    /// Stamp of the last scan; `None` before the first.
    last_scan_ns: Option<u64>,
}

impl Export<'_> {
    /// What stands at the start: the settings and the frames that do not move.
    fn begin(&mut self, time_ns: u64, settings: &str) -> Result<(), BagError> {
        self.last_ns = Some(time_ns);
        self.bag.add(SETTINGS_TOPIC, STRING, time_ns, &encode(&Text { data: settings.to_owned() }))?;
        let stamp = Time::of_ns(time_ns);
        let sonars = self.sensors.sonars.iter().enumerate();
        let mut transforms: Vec<_> = sonars.map(|(sonar, mount)| transform(stamp, BASE, &sonar_frame(sonar), at(mount))).collect();
        // The frames are one where nothing corrects the odometry.
        if !self.sensors.is_localised {
            transforms.insert(0, transform(stamp, MAP, ODOM, at(&Pose::default())));
        }
        transforms.push(transform(stamp, BASE, CAMERA, self.camera_mount()));
        self.bag.add("/tf_static", TF, time_ns, &encode(&TfMessage { transforms }))
    }

    fn take(&mut self, message: &RawMessage<'_>) -> Result<(), BagError> {
        let topic = message.channel.topic.as_str();
        let Some(last_ns) = self.last_ns else { return Ok(()) };
        let time_ns = message.log_ns.max(last_ns);
        let (stamp_ns, data) = (message.stamp_ns, message.data);
        if topic == SonarScan::SERVICE.name {
            if let Some(scan) = self.decoded::<SonarScan>(data) {
                self.scan(time_ns, stamp_ns, &scan)?;
            }
        } else if topic == CameraFrame::SERVICE.name {
            match Image::decode(data) {
                Ok((_, image)) => self.picture(time_ns, stamp_ns, &image)?,
                Err(error) => self.tally.add(topic, &error.to_string()),
            }
        } else if topic == RobotEstimate::SERVICE.name {
            if let Some(estimate) = self.decoded::<RobotEstimate>(data).filter(|_| self.sensors.is_localised) {
                let transforms = vec![transform(Time::of_ns(stamp_ns), MAP, ODOM, at(&estimate.map_from_odom))];
                self.bag.add("/tf", TF, time_ns, &encode(&TfMessage { transforms }))?;
            }
        } else if topic == Walkers::SERVICE.name {
            if let Some(walkers) = self.decoded::<Walkers>(data) {
                let markers = MarkerArray::of(walkers.walkers(), Time::of_ns(stamp_ns));
                self.bag.add("/walkers", MARKERS, time_ns, &encode(&markers))?;
            }
        } else if topic == MapTile::SERVICE.name {
            if let Some(tile) = self.decoded::<MapTile>(data) {
                self.maps.entry(tile.layer).or_default().take(&tile);
            }
        } else if let Some(layer) = self.maps.keys().copied().find(|layer| drivelog::MapView::topic(*layer) == topic) {
            // The recorder decides how often the complete map is shown.
            self.maps(Some(layer))?;
        } else {
            return Ok(());
        }
        self.last_ns = Some(time_ns);
        Ok(())
    }

    /// A valid message; one that is not is counted.
    fn decoded<T: Logged>(&mut self, data: &[u8]) -> Option<T> {
        let decoded = T::decode(data).map_err(|error| error.to_string());
        let valid = decoded.and_then(|(_, payload)| payload.validate().map_err(|invalid| invalid.to_string()).map(|()| payload));
        valid.inspect_err(|problem| self.tally.add(T::SERVICE.name, problem)).ok()
    }

    /// Counts what an import of the bag does not find in it.
    fn count_what_is_lost(&mut self, stamp_ns: u64, scan: &SonarScan) {
        let topic = SonarScan::SERVICE.name;
        let since_ns = self.last_scan_ns.replace(stamp_ns).map(|last_ns| stamp_ns.saturating_sub(last_ns));
        if since_ns.is_some_and(|since_ns| since_ns < SPACING_NS) {
            self.tally.add(topic, "scans less than 20 ms after the one before: an import joins them");
        }
        // An import finds the loss itself where the odometry is silent for long.
        if scan.after_gap == AFTER_LOSS && !since_ns.is_some_and(is_gap) {
            self.tally.add(topic, "that packets were lost before a scan is not in the bag");
        }
        let is_at_mount = |reading: &SonarReading| self.sensors.sonars.get(reading.sonar as usize) == Some(&reading.mount);
        if !scan.readings().iter().all(is_at_mount) {
            self.tally.add(topic, "readings at another mount than that of their sonar are in the bag at that of their sonar");
        }
    }

    fn scan(&mut self, time_ns: u64, stamp_ns: u64, scan: &SonarScan) -> Result<(), BagError> {
        self.count_what_is_lost(stamp_ns, scan);
        let stamp = Time::of_ns(stamp_ns);
        let pose = at(&scan.pose);
        let mut pose_covariance = Covariance::default();
        if scan.after_gap >= AFTER_DOUBT {
            pose_covariance.0[0][0] = UNKNOWN_M2;
        }
        let odometry = Odometry {
            header: Header { stamp, frame_id: ODOM.to_owned() },
            child_frame_id: BASE.to_owned(),
            pose,
            pose_covariance,
            linear: Vector3::default(),
            angular: Vector3::default(),
            twist_covariance: Covariance::default(),
        };
        self.bag.add("/odom", ODOMETRY, time_ns, &encode(&odometry))?;
        self.bag.add("/tf", TF, time_ns, &encode(&TfMessage { transforms: vec![transform(stamp, ODOM, BASE, pose)] }))?;
        for reading in scan.readings() {
            let sonar = reading.sonar as usize;
            let has_echo = reading.echo == 1;
            let range = Range {
                header: Header { stamp, frame_id: sonar_frame(sonar) },
                radiation_type: ULTRASOUND,
                field_of_view: self.sensors.field_of_view_rad as f32,
                min_range: 0.0,
                max_range: if has_echo { self.sensors.max_range_m.max(reading.range_m) } else { reading.range_m } as f32,
                // Infinity says that nothing is within the range.
                range: if has_echo { reading.range_m as f32 } else { f32::INFINITY },
            };
            self.bag.add(&format!("/sonar/range_{sonar}"), RANGE, time_ns, &encode(&range))?;
        }
        Ok(())
    }

    fn picture(&mut self, time_ns: u64, stamp_ns: u64, image: &Image) -> Result<(), BagError> {
        let layout = image.layout;
        let encoding = match PixelFormat::from_number(layout.format) {
            Some(PixelFormat::Yuyv) => "yuv422_yuy2",
            Some(PixelFormat::Rgb) => "rgb8",
            Some(PixelFormat::Grey) | None => "mono8",
        };
        let header = Header { stamp: Time::of_ns(stamp_ns), frame_id: CAMERA.to_owned() };
        let (width, height) = (f64::from(layout.width), f64::from(layout.height));
        let half_view_rad = 0.5 * self.sensors.camera_field_of_view_rad;
        let focal = 0.5 * width * half_view_rad.cos() / half_view_rad.sin();
        let (cx, cy) = (0.5 * width, self.sensors.horizon_share * height);
        let info = CameraInfo {
            header: header.clone(),
            height: layout.height,
            width: layout.width,
            distortion_model: "plumb_bob".to_owned(),
            d: vec![0.0; 5],
            k: [focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0],
            r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            p: [focal, 0.0, cx, 0.0, 0.0, focal, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
            binning_x: 0,
            binning_y: 0,
            roi: RegionOfInterest::default(),
        };
        self.bag.add("/camera/camera_info", CAMERA_INFO, time_ns, &encode(&info))?;
        let head = ImageHead {
            header,
            height: layout.height,
            width: layout.width,
            encoding: encoding.to_owned(),
            is_bigendian: 0,
            step: layout.stride,
        };
        self.bag.add("/camera/image_raw", IMAGE, time_ns, &encode_with_bytes(&head, &image.bytes))
    }

    /// Writes the map of a layer or, at the end, of all that have changed.
    fn maps(&mut self, only: Option<u32>) -> Result<(), BagError> {
        let Some(time_ns) = self.last_ns else { return Ok(()) };
        for (layer, map) in &mut self.maps {
            if only.is_some_and(|only| only != *layer) {
                continue;
            }
            let topic = if *layer == messages::Layer::Unfiltered as u32 { "/map/unfiltered" } else { "/map" };
            match map.draw(Time::of_ns(time_ns)) {
                Ok(Some(data)) => self.bag.add(topic, GRID, time_ns, &data)?,
                Ok(None) => {}
                Err(cells) => self.tally.add(topic, &format!("a map of {cells} cells is too large for one message")),
            }
        }
        Ok(())
    }

    /// The frame of the pictures: z along the level optical axis, x to the right, y down.
    fn camera_mount(&self) -> RosPose {
        let Sensors { camera, camera_height_m, .. } = self.sensors;
        let (sin, cos) = (0.5 * camera.yaw_rad).sin_cos();
        // The turn by the heading, followed by (x, y, z, w) = (−½, ½, −½, ½), the turn from ahead, left, up to right, down, ahead.
        let orientation = Quaternion { x: -0.5 * (cos + sin), y: 0.5 * (cos - sin), z: -0.5 * (cos - sin), w: 0.5 * (cos + sin) };
        RosPose { position: Vector3 { x: camera.x_m, y: camera.y_m, z: *camera_height_m }, orientation }
    }
}

fn sonar_frame(sonar: usize) -> String {
    format!("sonar_{sonar}")
}

fn transform(stamp: Time, parent: &str, child: &str, place: RosPose) -> TransformStamped {
    TransformStamped { header: Header { stamp, frame_id: parent.to_owned() }, child_frame_id: child.to_owned(), transform: place }
}

/// A pose in the plane as ROS has it.
fn at(pose: &Pose) -> RosPose {
    let (sin, cos) = (0.5 * pose.yaw_rad).sin_cos();
    RosPose { position: Vector3 { x: pose.x_m, y: pose.y_m, z: 0.0 }, orientation: Quaternion { x: 0.0, y: 0.0, z: sin, w: cos } }
}
