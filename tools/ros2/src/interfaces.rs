//! Messages of ROS 2 that are read or written, by the fields of their definitions.
//!
//! Fields at the end that are not needed are left out where a message is only read.

use serde::{Deserialize, Serialize};

/// `builtin_interfaces/msg/Time`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Time {
    pub(crate) sec: i32,
    pub(crate) nanosec: u32,
}

/// `std_msgs/msg/Header`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Header {
    pub(crate) stamp: Time,
    pub(crate) frame_id: String,
}

/// `geometry_msgs/msg/Vector3`, and `Point`, which has the same fields.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Vector3 {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) z: f64,
}

/// `geometry_msgs/msg/Quaternion`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Quaternion {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) z: f64,
    pub(crate) w: f64,
}

/// `geometry_msgs/msg/Pose`, and `Transform`, which has the same fields.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Pose {
    pub(crate) position: Vector3,
    pub(crate) orientation: Quaternion,
}

/// `geometry_msgs/msg/TransformStamped`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct TransformStamped {
    pub(crate) header: Header,
    pub(crate) child_frame_id: String,
    pub(crate) transform: Pose,
}

/// `tf2_msgs/msg/TFMessage`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct TfMessage {
    pub(crate) transforms: Vec<TransformStamped>,
}

/// A covariance of six by six numbers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Covariance(pub(crate) [[f64; 6]; 6]);

/// `nav_msgs/msg/Odometry`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Odometry {
    pub(crate) header: Header,
    pub(crate) child_frame_id: String,
    pub(crate) pose: Pose,
    pub(crate) pose_covariance: Covariance,
    pub(crate) linear: Vector3,
    pub(crate) angular: Vector3,
    pub(crate) twist_covariance: Covariance,
}

/// `sensor_msgs/msg/Range`. Newer versions have a variance behind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Range {
    pub(crate) header: Header,
    pub(crate) radiation_type: u8,
    pub(crate) field_of_view: f32,
    pub(crate) min_range: f32,
    pub(crate) max_range: f32,
    pub(crate) range: f32,
}

/// `sensor_msgs/msg/Image` without its data, which follow.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct ImageHead {
    pub(crate) header: Header,
    pub(crate) height: u32,
    pub(crate) width: u32,
    pub(crate) encoding: String,
    pub(crate) is_bigendian: u8,
    pub(crate) step: u32,
}

/// `sensor_msgs/msg/CompressedImage` without its data, which follow.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct CompressedImageHead {
    pub(crate) header: Header,
    pub(crate) format: String,
}

/// `sensor_msgs/msg/CameraInfo`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct CameraInfo {
    pub(crate) header: Header,
    pub(crate) height: u32,
    pub(crate) width: u32,
    pub(crate) distortion_model: String,
    pub(crate) d: Vec<f64>,
    pub(crate) k: [f64; 9],
    pub(crate) r: [f64; 9],
    pub(crate) p: [f64; 12],
    pub(crate) binning_x: u32,
    pub(crate) binning_y: u32,
    pub(crate) roi: RegionOfInterest,
}

/// `sensor_msgs/msg/RegionOfInterest`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct RegionOfInterest {
    pub(crate) x_offset: u32,
    pub(crate) y_offset: u32,
    pub(crate) height: u32,
    pub(crate) width: u32,
    pub(crate) do_rectify: bool,
}

/// `std_msgs/msg/String`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Text {
    pub(crate) data: String,
}

/// Names of the types.
pub(crate) mod name {
    pub(crate) const RANGE: &str = "sensor_msgs/msg/Range";
    pub(crate) const ODOMETRY: &str = "nav_msgs/msg/Odometry";
    pub(crate) const TF: &str = "tf2_msgs/msg/TFMessage";
    pub(crate) const IMAGE: &str = "sensor_msgs/msg/Image";
    pub(crate) const COMPRESSED: &str = "sensor_msgs/msg/CompressedImage";
    pub(crate) const CAMERA_INFO: &str = "sensor_msgs/msg/CameraInfo";
    pub(crate) const STRING: &str = "std_msgs/msg/String";
}

impl Time {
    /// Nanoseconds; a time before 1970 is 0.
    pub(crate) fn ns(self) -> u64 {
        let seconds = u64::try_from(self.sec).unwrap_or_default();
        seconds * 1_000_000_000 + u64::from(self.nanosec)
    }

    /// The time so many nanoseconds after 1970; after 2038 the latest.
    pub(crate) fn of_ns(ns: u64) -> Self {
        match i32::try_from(ns / 1_000_000_000) {
            Ok(sec) => Self { sec, nanosec: (ns % 1_000_000_000) as u32 },
            Err(_) => Self { sec: i32::MAX, nanosec: 999_999_999 },
        }
    }
}

impl Default for Quaternion {
    fn default() -> Self {
        Self { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }
    }
}

impl Header {
    /// The stamp; of a message without one the time when it was received.
    pub(crate) fn stamp_or(&self, received_ns: u64) -> u64 {
        match self.stamp.ns() {
            0 => received_ns,
            ns => ns,
        }
    }
}
