//! Walkers of a log as a `visualization_msgs/msg/MarkerArray`.

use messages::TrackedWalker;
use serde::Serialize;

use crate::interfaces::{CompressedImageHead, Header, Pose, Quaternion, Time, Vector3};

/// Size of a person who stands, m: the figure only shows where a walker is.
const BREADTH_M: f64 = 0.5;
const HEIGHT_M: f64 = 1.7;
/// Numbers of `visualization_msgs/msg/Marker`.
const CYLINDER: i32 = 3;
const DELETE_ALL: i32 = 3;
const ADD: i32 = 0;

/// `visualization_msgs/msg/MarkerArray`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct MarkerArray {
    markers: Vec<Marker>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Marker {
    header: Header,
    ns: String,
    id: i32,
    kind: i32,
    action: i32,
    pose: Pose,
    scale: Vector3,
    /// Red, green, blue, opacity.
    colour: [f32; 4],
    lifetime: Time,
    frame_locked: bool,
    points: Vec<Vector3>,
    colours: Vec<[f32; 4]>,
    texture_resource: String,
    texture: (CompressedImageHead, Vec<u8>),
    uv_coordinates: Vec<[f32; 2]>,
    text: String,
    mesh_resource: String,
    mesh_file: (String, Vec<u8>),
    mesh_use_embedded_materials: bool,
}

impl MarkerArray {
    /// One figure for each walker, in the frame of the odometry as the log has them; those of the message before are removed.
    pub(crate) fn of(walkers: &[TrackedWalker], stamp: Time) -> Self {
        let header = Header { stamp, frame_id: "odom".to_owned() };
        let figures = walkers.iter().map(|walker| {
            let at = Vector3 { x: walker.x_m, y: walker.y_m, z: 0.5 * HEIGHT_M };
            // Tracks are numbered from 1; a number beyond 32 bits wraps.
            Marker::new(&header, (walker.track & 0x7fff_ffff) as i32, ADD, at)
        });
        let remove = Marker::new(&header, 0, DELETE_ALL, Vector3::default());
        Self { markers: std::iter::once(remove).chain(figures).collect() }
    }
}

impl Marker {
    fn new(header: &Header, id: i32, action: i32, at: Vector3) -> Self {
        Self {
            header: header.clone(),
            ns: "walkers".to_owned(),
            id,
            kind: CYLINDER,
            action,
            pose: Pose { position: at, orientation: Quaternion::default() },
            scale: Vector3 { x: BREADTH_M, y: BREADTH_M, z: HEIGHT_M },
            colour: [0.9, 0.3, 0.1, 0.8],
            lifetime: Time::default(),
            frame_locked: false,
            points: Vec::new(),
            colours: Vec::new(),
            texture_resource: String::new(),
            texture: (CompressedImageHead { header: Header::default(), format: String::new() }, Vec::new()),
            uv_coordinates: Vec::new(),
            text: String::new(),
            mesh_resource: String::new(),
            mesh_file: (String::new(), Vec::new()),
            mesh_use_embedded_materials: false,
        }
    }
}
