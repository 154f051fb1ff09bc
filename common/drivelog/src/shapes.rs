//! The shape of each payload in the log.

use messages::Text;

use crate::mirror::mirror;

mirror! {
    /// A place and direction in the plane; yaw counter-clockwise from the frame's x axis.
    Pose { x_m: f64, y_m: f64, yaw_rad: f64 }

    /// One reading of one sonar: its mount in the robot frame, the distance, whether an echo came back (1) or not (0).
    SonarReading { mount: messages::Pose, range_m: f64, sonar: u32, echo: u32 }

    /// The sonar readings that are new since the last packet, with the odometry of that packet in the map frame.
    SonarScan { pose: messages::Pose, after_gap: u32; readings[count]: messages::SonarReading }

    /// A class of cells that moves; bit i of readings: reading i of the scan belongs to it.
    Mover {
        robot_x_m: f64,
        robot_y_m: f64,
        map_x_m: f64,
        map_y_m: f64,
        velocity_x_m_s: f64,
        velocity_y_m_s: f64,
        cells: u32,
        readings: u32,
        track: u64
    }

    /// The answer of the sonar temporal difference to the scan of the same number.
    SonarMotion { truncated: u32; movers[count]: messages::Mover }

    /// A moving region of the picture.
    Blob { u_px: f32, v_px: f32, size_px: u32, left_px: u32, top_px: u32, right_px: u32, bottom_px: u32 }

    /// The answer of the background subtraction to the frame of the same number.
    CameraMotion {
        transform: [f64; 9],
        residual_px: f64,
        inliers: f64,
        status: u32,
        width: u32,
        height: u32;
        blobs[count]: messages::Blob
    }

    /// The region a moving thing covers, in the map frame.
    UpdateRegion { x_m: f64, y_m: f64, cells: f64 }

    /// The final answer on the scan of the same number; bit i of withheld: reading i puts no occupied cell into the map.
    FilterVerdict { withheld: u32, inputs: u32, action: u32; regions[count]: messages::UpdateRegion }

    /// A walker who is followed, in the map frame.
    TrackedWalker { x_m: f64, y_m: f64, velocity_x_m_s: f64, velocity_y_m_s: f64, track: u64 }

    /// The walkers that are followed at the time of the scan of the same number.
    Walkers { ; walkers[count]: messages::TrackedWalker }

    /// A piece of the robot's way, in the map frame, m.
    WayChunk { first: u64, total: u64; points_m[count]: [f32; 2] }

    /// The finished map in numbers.
    MapSummary { sha256: [u8; 32], scans: u64, readings: u64, withheld: u64, undecided: u64, tiles: u64, way_m: f64 }

    /// What came in on one service.
    InputCounters {
        service: Text<32>,
        received: u64,
        lost: u64,
        repeated: u64,
        refused: u64,
        last_seq: u64,
        latency_median_us: u32,
        latency_p99_us: u32
    }

    /// A number that a process counts.
    Counter { name: Text<32>, value: u64 }

    /// A sign of life from the work loop of a process.
    Heartbeat {
        process: Text<32>,
        note: Text<128>,
        progress: u64,
        sent: u64,
        pid: u32,
        phase: u32;
        inputs[inputs_count]: messages::InputCounters;
        counters[counters_count]: messages::Counter
    }

    /// How far a process has answered its source stream.
    Progress { process: Text<32>, service: Text<32>, answered: u64 }

    /// One process as the supervisor sees it.
    ProcessStatus {
        process: Text<32>,
        note: Text<128>,
        heartbeat_age_ms: u64,
        received: u64,
        lost: u64,
        refused: u64,
        sent: u64,
        received_per_s: f64,
        sent_per_s: f64,
        latency_median_us: u32,
        latency_p99_us: u32,
        cpu: f64,
        resident_bytes: u64,
        pid: u32,
        state: u32,
        restarts: u32;
        counters[counters_count]: messages::Counter
    }

    /// The whole deployment as the supervisor sees it.
    DeploymentStatus { deployment: Text<64>, uptime_ms: u64, ending: u32; processes[count]: messages::ProcessStatus }

    /// One reading with what it came from: 0 no echo, 1 still, 2 walker, 3 ghost, 4 crosstalk.
    TrueReading { range_m: f64, sonar: u32, label: u32, walker: u32 }

    /// What the simulator knows of one status packet: poses and walkers in the world's frame.
    TruthScan {
        pose: messages::Pose,
        odometry: messages::Pose;
        readings[count]: messages::TrueReading;
        walkers_m[walkers_count]: [f64; 2]
    }

    /// A straight piece of a surface that stands still, in the world's frame, m.
    Surface { from_m: [f64; 2], to_m: [f64; 2] }

    /// A piece of the list of true surfaces.
    TruthSurfaces { start: messages::Pose, first: u32, total: u32; surfaces[count]: messages::Surface }
}
