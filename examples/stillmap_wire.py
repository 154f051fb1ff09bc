"""The wire contract of stillmap: every payload on the bus as a structure of ctypes.

Generated from the registry: stillmap check --python > examples/stillmap_wire.py
docs/wire.md has the rules and the ranges of all fields.
"""

import ctypes


class Kind:
    DATA = 0  # A payload.
    END = 1  # The stream ends after `seq`; the payload is all zero.
    GAP = 2  # Message `seq` was dropped on purpose: a consumer in lockstep does not wait for it. The payload is all zero.
    SKIPPED = 3  # The sender left message `seq` out because a newer one waited: readers do not count it as lost. The payload is all zero.


class PixelFormat:
    GREY = 0  # One byte of luminance.
    YUYV = 1  # Two pixels in four bytes: Y0 U Y1 V.
    RGB = 2  # Red, green, blue.


class CameraStatus:
    COMPENSATED = 0  # The camera motion is compensated; the blobs are what moves.
    LEARNING = 1  # The model is still being learned; no blobs.
    NOT_COMPENSATED = 2  # The camera motion was not found; no blobs.
    REFUSED = 3  # The frame was refused (size, values or time); no blobs.


class FilterAction:
    WITHHOLD = 0  # The occupied part of the readings in `withheld` is left out.
    FREE = 1  # The cells of the regions are set free when the scan is integrated (the paper's action).


class Layer:
    FILTERED = 0  # The map without what moves.
    UNFILTERED = 1  # The map of every reading (the paper's Fig. 10 a).


class Trajectory:
    ROBOT = 0  # Where the robot was in the map.
    ODOMETRY = 1  # Where the wheels counted it, in the odom frame. It is published where localisation runs.


class EstimateStatus:
    ODOMETRY = 0  # No wall was measured yet: the map frame is the odometry's.
    TRACKING = 1  # It follows from odometry and walls.
    LOST = 2  # Something other than its wheels moved the robot. Its place is unknown until it is recognised.


class Phase:
    STARTING = 0  # It has joined the deployment and does not work yet.
    RUNNING = 1  # At work.
    ENDING = 2  # It has published everything and stays while a consumer may need its history.


class LogLevel:
    DEBUG = 1  # Details for finding a fault.
    INFO = 2  # Normal operation.
    WARNING = 3  # Something is degraded.
    ERROR = 4  # Something failed.


class ProcessState:
    WAITING = 0  # Not started yet.
    STARTING = 1  # Started, no heartbeat yet.
    RUNNING = 2  # At work.
    BACKOFF = 3  # It died and is restarted after a delay.
    STOPPING = 4  # Asked to stop.
    FINISHED = 5  # Ended in order.
    FAILED = 6  # It died more often than its budget allows and is not restarted.


class EchoLabel:
    NO_ECHO = 0  # No echo.
    STILL = 1  # A static surface.
    WALKER = 2  # A walker.
    GHOST = 3  # A mirrored or multiple path: no surface in that direction has this range.
    CROSSTALK = 4  # Another sonar's ping.


class Header(ctypes.Structure):
    _fields_ = [
        ("run", ctypes.c_uint64),  # Identity of the run. Readers refuse messages of another run.
        ("seq", ctypes.c_uint64),  # Sequence number in the source stream, from 1. An answer has the number of the message that it answers.
        ("stamp_ns", ctypes.c_uint64),  # Sensor time of what the payload reports, ns.
        ("kind", ctypes.c_uint32),  # `Kind` as a number.
        ("crc32", ctypes.c_uint32),  # CRC-32 of the message: the header, in which this field is 0, and the payload's bytes.
    ]

    @staticmethod
    def type_name():
        return "stillmap/header"


assert ctypes.sizeof(Header) == 32


class FrameLayout(ctypes.Structure):
    _fields_ = [
        ("width", ctypes.c_uint32),  # Pixels in a row.
        ("height", ctypes.c_uint32),  # Rows.
        ("stride", ctypes.c_uint32),  # Bytes from one row to the next.
        ("format", ctypes.c_uint32),  # `PixelFormat` as a number.
    ]


assert ctypes.sizeof(FrameLayout) == 16


class FrameHeader(ctypes.Structure):
    _fields_ = [
        ("header", Header),  # As on every message.
        ("layout", FrameLayout),  # Size and format of the picture that follows.
    ]

    @staticmethod
    def type_name():
        return "stillmap/frame-header"


assert ctypes.sizeof(FrameHeader) == 48


class Pose(ctypes.Structure):
    _fields_ = [
        ("x_m", ctypes.c_double),  # Along x of the frame, m.
        ("y_m", ctypes.c_double),  # Along y of the frame, m.
        ("yaw_rad", ctypes.c_double),  # Counter-clockwise from the frame's x axis, rad.
    ]


assert ctypes.sizeof(Pose) == 24


class SonarReading(ctypes.Structure):
    _fields_ = [
        ("mount", Pose),  # Position and direction of the transducer in the robot frame.
        ("range_m", ctypes.c_double),  # Distance to the echo, m; the limit of the sensor without an echo.
        ("sonar", ctypes.c_uint32),  # Number of the sonar on the robot, from 0.
        ("echo", ctypes.c_uint32),  # 1 with an echo, 0 without.
    ]


assert ctypes.sizeof(SonarReading) == 40


class SonarScan(ctypes.Structure):
    """The sonar readings since the last packet, with the pose of the robot."""

    SERVICE = "robot/scan"
    CONTRACT = "version 2 layout cef28ed31cb79f93"
    NUMBERED = True
    WAKES = True
    _fields_ = [
        ("pose", Pose),  # Pose of the robot in the odom frame.
        ("readings", SonarReading * 16),  # The first `count` entries are readings, the rest is zero.
        ("count", ctypes.c_uint32),  # Number of readings.
        ("after_gap", ctypes.c_uint32),  # 0 when nothing was lost before this scan; 1 (`AFTER_LOSS`) when packets were lost and the pose is right all the same; 2 (`AFTER_DOUBT`) when the robot may have moved without the odometry knowing.
    ]

    @staticmethod
    def type_name():
        return "robot/scan"


assert ctypes.sizeof(SonarScan) == 672


class CameraFrame:
    """Pictures of the camera. The bytes of a picture under a FrameHeader."""

    SERVICE = "camera/frame"
    CONTRACT = "version 1 layout 48d1779581d753f2"
    NUMBERED = True
    WAKES = True
    MAX_BYTES = 921600


class Mover(ctypes.Structure):
    _fields_ = [
        ("robot_x_m", ctypes.c_double),  # Centroid in the robot frame, m.
        ("robot_y_m", ctypes.c_double),  # Centroid in the robot frame, m.
        ("map_x_m", ctypes.c_double),  # Centroid in the odom frame, m.
        ("map_y_m", ctypes.c_double),  # Centroid in the odom frame, m.
        ("velocity_x_m_s", ctypes.c_double),  # Velocity of its track in the odom frame, m/s.
        ("velocity_y_m_s", ctypes.c_double),  # Velocity of its track in the odom frame, m/s.
        ("cells", ctypes.c_uint32),  # Size in cells (`C_Size`).
        ("readings", ctypes.c_uint32),  # Bit i set: reading i of the scan belongs to it.
        ("track", ctypes.c_uint64),  # Identity of its track; 0 before it has one.
    ]


assert ctypes.sizeof(Mover) == 64


class SonarMotion(ctypes.Structure):
    """Motion detected by the sonars: the answer of STD to the scan of the same number."""

    SERVICE = "motion/sonar"
    CONTRACT = "version 1 layout 18c6995f9d3881fb"
    NUMBERED = True
    WAKES = True
    _fields_ = [
        ("movers", Mover * 16),  # The first `count` entries are movers, the rest is zero.
        ("count", ctypes.c_uint32),  # Number of movers.
        ("truncated", ctypes.c_uint32),  # 1 when there were more movers than fit.
    ]

    @staticmethod
    def type_name():
        return "motion/sonar"


assert ctypes.sizeof(SonarMotion) == 1032


class Blob(ctypes.Structure):
    _fields_ = [
        ("u_px", ctypes.c_float),  # Centroid, px from the left.
        ("v_px", ctypes.c_float),  # Centroid, px from the top.
        ("size_px", ctypes.c_uint32),  # Area, px.
        ("left_px", ctypes.c_uint32),  # Left edge, px.
        ("top_px", ctypes.c_uint32),  # Top edge, px.
        ("right_px", ctypes.c_uint32),  # Right edge, px, exclusive.
        ("bottom_px", ctypes.c_uint32),  # Lowest row with its pixels, exclusive.
        ("reserved", ctypes.c_uint32),  # Always 0.
    ]


assert ctypes.sizeof(Blob) == 32


class CameraMotion(ctypes.Structure):
    """Motion detected by the camera: the answer of SBS to the frame of the same number. It is played back where no SBS runs."""

    SERVICE = "motion/camera"
    CONTRACT = "version 1 layout 2855b7e0c89e9c05"
    NUMBERED = True
    WAKES = True
    _fields_ = [
        ("transform", ctypes.c_double * 9),  # Maps a pixel of the current frame to the background frame, row by row, homogeneous (section 5.1 of the paper).
        ("residual_px", ctypes.c_double),  # Root mean square of the residuals of the accepted pairs, px.
        ("inliers", ctypes.c_double),  # Share of pairs that agree with the transform.
        ("blobs", Blob * 16),  # The first `count` entries are blobs, the rest is zero.
        ("count", ctypes.c_uint32),  # Number of blobs.
        ("status", ctypes.c_uint32),  # `CameraStatus` as a number.
        ("width", ctypes.c_uint32),  # Width of the frame, px.
        ("height", ctypes.c_uint32),  # Height of the frame, px.
    ]

    @staticmethod
    def type_name():
        return "motion/camera"


assert ctypes.sizeof(CameraMotion) == 616


class UpdateRegion(ctypes.Structure):
    _fields_ = [
        ("x_m", ctypes.c_double),  # Centre, m.
        ("y_m", ctypes.c_double),  # Centre, m.
        ("cells", ctypes.c_double),  # Size in cells.
    ]


assert ctypes.sizeof(UpdateRegion) == 24


class FilterVerdict(ctypes.Structure):
    """The verdict of FTI on the scan of the same number: the readings that are withheld from the map."""

    SERVICE = "map/verdict"
    CONTRACT = "version 2 layout bfac72270dda9022"
    NUMBERED = True
    WAKES = True
    _fields_ = [
        ("regions", UpdateRegion * 8),  # The first `count` entries are regions, the rest is zero.
        ("count", ctypes.c_uint32),  # Number of regions.
        ("withheld", ctypes.c_uint32),  # Bit i set: the occupied part of reading i is left out of the map.
        ("inputs", ctypes.c_uint32),  # Bit 0: it uses motion from the sonars; bit 1: motion from the camera.
        ("action", ctypes.c_uint32),  # `FilterAction` as a number.
    ]

    @staticmethod
    def type_name():
        return "map/verdict"


assert ctypes.sizeof(FilterVerdict) == 208


class SmoothedPose(ctypes.Structure):
    _fields_ = [
        ("seq", ctypes.c_uint64),  # Number of the scan.
        ("map_from_robot", Pose),  # The robot in the map frame when it sent the scan.
        ("is_placed", ctypes.c_uint32),  # 1 when the pose is known; 0 while the robot is lost: the scan is left out of the map until a revision moves it.
        ("reserved", ctypes.c_uint32),  # Always 0.
    ]


assert ctypes.sizeof(SmoothedPose) == 40


class RobotEstimate(ctypes.Structure):
    """Where the robot is in the map: the answer of localisation to the scan of the same number."""

    SERVICE = "robot/estimate"
    CONTRACT = "version 1 layout 57f62123749c86f7"
    NUMBERED = True
    WAKES = True
    _fields_ = [
        ("map_from_odom", Pose),  # The odometry frame in the map frame.
        ("smoothed", SmoothedPose * 8),  # The scans whose poses leave the commit horizon, in ascending order; the first `count` are valid, the rest is zero.
        ("distance_share", ctypes.c_double),  # Share by which the wheels count distances too long.
        ("turn_share", ctypes.c_double),  # Share by which the wheels count turns too large.
        ("curvature_rad_m", ctypes.c_double),  # Angle by which the wheels count a straight path as a left turn, rad/m.
        ("pieces", ctypes.c_uint64),  # Number of the last piece on `trajectory/revision` that belongs to this estimate or to one before. A reader that integrates scans takes these pieces after this estimate and before the next.
        ("count", ctypes.c_uint32),  # Number of poses in `smoothed`.
        ("status", ctypes.c_uint32),  # `EstimateStatus` as a number.
        ("walls", ctypes.c_uint32),  # Walls of which the estimate makes use.
        ("closures", ctypes.c_uint32),  # Places that the robot recognised so far.
    ]

    @staticmethod
    def type_name():
        return "robot/estimate"


assert ctypes.sizeof(RobotEstimate) == 392


class MovedStretch(ctypes.Structure):
    _fields_ = [
        ("first", ctypes.c_uint64),  # Number of its first scan.
        ("last", ctypes.c_uint64),  # Number of its last scan.
        ("before", Pose),  # The robot at the first scan in the map frame, before the revision.
        ("now", Pose),  # The robot at the first scan in the map frame from now on. Each later scan of the stretch keeps its pose relative to it.
    ]


assert ctypes.sizeof(MovedStretch) == 64


class TrajectoryRevision(ctypes.Structure):
    """Poses that localisation estimates otherwise than before, in pieces. With a scan there is at most one piece, so that the history of the stream reaches as far back as that of the scans."""

    SERVICE = "trajectory/revision"
    CONTRACT = "version 1 layout 4a14ccd7a9cfe12b"
    NUMBERED = True
    WAKES = True
    _fields_ = [
        ("moved", MovedStretch * 32),  # The stretches, in ascending order of their scans; the first `count` are valid, the rest is zero.
        ("count", ctypes.c_uint32),  # Number of stretches in this piece.
        ("revision", ctypes.c_uint32),  # Number of the revision, from 1.
        ("is_last", ctypes.c_uint32),  # 1 for the last piece of the revision, otherwise 0. A revision counts once all of its pieces are there.
        ("reserved", ctypes.c_uint32),  # Always 0.
    ]

    @staticmethod
    def type_name():
        return "trajectory/revision"


assert ctypes.sizeof(TrajectoryRevision) == 2064


class TrackedWalker(ctypes.Structure):
    _fields_ = [
        ("x_m", ctypes.c_double),  # Position, m.
        ("y_m", ctypes.c_double),  # Position, m.
        ("velocity_x_m_s", ctypes.c_double),  # Velocity, m/s.
        ("velocity_y_m_s", ctypes.c_double),  # Velocity, m/s.
        ("track", ctypes.c_uint64),  # Identity of the track, from 1; unique in a run.
    ]


assert ctypes.sizeof(TrackedWalker) == 40


class Walkers(ctypes.Structure):
    """The walkers that FTI tracks at the scan of the same number."""

    SERVICE = "motion/walkers"
    CONTRACT = "version 1 layout 640c089a816991a6"
    NUMBERED = True
    WAKES = True
    _fields_ = [
        ("walkers", TrackedWalker * 16),  # The first `count` entries are walkers, the rest is zero.
        ("count", ctypes.c_uint32),  # Number of walkers.
        ("reserved", ctypes.c_uint32),  # Always 0.
    ]

    @staticmethod
    def type_name():
        return "motion/walkers"


assert ctypes.sizeof(Walkers) == 648


class TrueReading(ctypes.Structure):
    _fields_ = [
        ("range_m", ctypes.c_double),  # The range as it is sent, m; the limit of the sensor without an echo.
        ("sonar", ctypes.c_uint32),  # The sonar's number, from 0.
        ("label", ctypes.c_uint32),  # `EchoLabel` as a number.
        ("walker", ctypes.c_uint32),  # Number of the walker from 1; 0 when none.
        ("reserved", ctypes.c_uint32),  # Always 0.
    ]


assert ctypes.sizeof(TrueReading) == 24


class TruthScan(ctypes.Structure):
    """The truth of a simulated scan of the same number: poses, walkers and the cause of each reading."""

    SERVICE = "truth/scan"
    CONTRACT = "version 1 layout 707159fafdaa47b0"
    NUMBERED = True
    WAKES = True
    _fields_ = [
        ("pose", Pose),  # True pose of the robot in the world frame.
        ("odometry", Pose),  # Pose of the robot by its odometry, in the frame of its start.
        ("readings", TrueReading * 16),  # The first `count` entries are readings, the rest is zero.
        ("walkers_m", (ctypes.c_double * 2) * 16),  # x and y of each walker in the world frame, m; the first `walkers_count` are valid.
        ("count", ctypes.c_uint32),  # Number of readings.
        ("walkers_count", ctypes.c_uint32),  # Number of walkers.
    ]

    @staticmethod
    def type_name():
        return "truth/scan"


assert ctypes.sizeof(TruthScan) == 696


class TruthMask:
    """The truth of a simulated frame of the same number, in the labels of the ChangeDetection benchmark. The bytes of a picture under a FrameHeader."""

    SERVICE = "truth/mask"
    CONTRACT = "version 1 layout 48d1779581d753f2"
    NUMBERED = True
    WAKES = True
    MAX_BYTES = 307200


class PlaybackControl(ctypes.Structure):
    """The speed of playback that a viewer requests; the newest message holds."""

    SERVICE = "control/playback"
    CONTRACT = "version 1 layout 527c2f64bc47d2b6"
    NUMBERED = False
    WAKES = True
    _fields_ = [
        ("speed", ctypes.c_double),  # Speed relative to the drive. It has no effect on a replay in lockstep.
        ("paused", ctypes.c_uint32),  # 1 to pause, 0 to continue.
        ("reserved", ctypes.c_uint32),  # Always 0.
    ]

    @staticmethod
    def type_name():
        return "control/playback"


assert ctypes.sizeof(PlaybackControl) == 16


class SimulatedTime(ctypes.Structure):
    """Time in a simulated world, with which the driver of its robot stamps; the newest message holds."""

    SERVICE = "control/simulated-time"
    CONTRACT = "version 1 layout cb79c542e9f502a9"
    NUMBERED = False
    WAKES = False
    _fields_ = [
        ("now_ns", ctypes.c_uint64),  # Time in the world, ns since the Unix epoch.
        ("since_ns", ctypes.c_uint64),  # Time on the clock of the deployment when it was that.
        ("runs", ctypes.c_uint32),  # 1 when the world's time runs with the clock since then, 0 when it stands until the next message.
        ("reserved", ctypes.c_uint32),  # Always 0.
    ]

    @staticmethod
    def type_name():
        return "control/simulated-time"


assert ctypes.sizeof(SimulatedTime) == 24


class OutlookScan(ctypes.Structure):
    _fields_ = [
        ("seq", ctypes.c_uint64),  # The scan's number.
        ("withheld", ctypes.c_uint32),  # Bit i set: the occupied part of reading i would be left out of the map.
        ("reserved", ctypes.c_uint32),  # Always 0.
    ]


assert ctypes.sizeof(OutlookScan) == 16


class VerdictOutlook(ctypes.Structure):
    """The verdicts that FTI would give now on the pending scans; the newest message holds."""

    SERVICE = "map/outlook"
    CONTRACT = "version 1 layout 20afdb0d682e307a"
    NUMBERED = False
    WAKES = True
    _fields_ = [
        ("scans", OutlookScan * 128),  # The first `count` entries are scans in ascending order, the rest is zero.
        ("count", ctypes.c_uint32),  # Number of scans.
        ("reserved", ctypes.c_uint32),  # Always 0.
    ]

    @staticmethod
    def type_name():
        return "map/outlook"


assert ctypes.sizeof(VerdictOutlook) == 2056


class MapTile(ctypes.Structure):
    """A tile of the map that has changed. It has no history: mapping repeats all tiles slowly."""

    SERVICE = "map/tile"
    CONTRACT = "version 1 layout 48cc7d688ee87004"
    NUMBERED = False
    WAKES = True
    _fields_ = [
        ("cell_m", ctypes.c_double),  # Edge of a cell, m.
        ("scan_seq", ctypes.c_uint64),  # Last scan whose readings the tile shows.
        ("column", ctypes.c_int32),  # Column of the tile: its cells start at x = `column` × 32 × `cell_m` in the map frame.
        ("row", ctypes.c_int32),  # Row of the tile: its cells start at y = `row` × 32 × `cell_m` in the map frame.
        ("layer", ctypes.c_uint32),  # `Layer` as a number.
        ("tiles_in_layer", ctypes.c_uint32),  # Number of tiles of that layer when this one was published. A reader that has as many has the whole map.
        ("log_odds", ctypes.c_float * 1024),  # Log-odds of occupancy, row by row from the smallest y; 0 is unknown.
    ]

    @staticmethod
    def type_name():
        return "map/tile"


assert ctypes.sizeof(MapTile) == 4128


class WayChunk(ctypes.Structure):
    """A piece of the robot's trajectory. It has no history: mapping repeats all pieces slowly."""

    SERVICE = "map/way"
    CONTRACT = "version 2 layout d23d3cf7d787be2f"
    NUMBERED = False
    WAKES = True
    _fields_ = [
        ("first", ctypes.c_uint64),  # Index of the first position of this piece.
        ("total", ctypes.c_uint64),  # Positions of the whole trajectory so far.
        ("points_m", (ctypes.c_float * 2) * 256),  # x and y of each position, m; the first `count` are valid.
        ("count", ctypes.c_uint32),  # Number of positions in this piece.
        ("trajectory", ctypes.c_uint32),  # `Trajectory` as a number.
    ]

    @staticmethod
    def type_name():
        return "map/way"


assert ctypes.sizeof(WayChunk) == 2072


class MapSummary(ctypes.Structure):
    """The finished map in numbers."""

    SERVICE = "map/summary"
    CONTRACT = "version 1 layout f92890ea92f68073"
    NUMBERED = False
    WAKES = True
    _fields_ = [
        ("sha256", ctypes.c_uint8 * 32),  # SHA-256 over cells and placement of the filtered layer.
        ("scans", ctypes.c_uint64),  # Scans integrated.
        ("readings", ctypes.c_uint64),  # Readings integrated.
        ("withheld", ctypes.c_uint64),  # Readings whose occupied part was withheld.
        ("undecided", ctypes.c_uint64),  # Readings integrated without a verdict, where verdicts were expected.
        ("tiles", ctypes.c_uint64),  # Tiles of the filtered layer.
        ("way_m", ctypes.c_double),  # Length of the trajectory, m.
    ]

    @staticmethod
    def type_name():
        return "map/summary"


assert ctypes.sizeof(MapSummary) == 80


class InputCounters(ctypes.Structure):
    _fields_ = [
        ("service", ctypes.c_char * 32),  # The service.
        ("received", ctypes.c_uint64),  # Messages received.
        ("lost", ctypes.c_uint64),  # Messages missing between those received.
        ("repeated", ctypes.c_uint64),  # Messages that were received before.
        ("refused", ctypes.c_uint64),  # Messages refused: wrong checksum, numbers out of range, time running backwards.
        ("last_seq", ctypes.c_uint64),  # Last sequence number received.
        ("latency_median_us", ctypes.c_uint32),  # Median latency of the last messages, from their stamp until they were received, µs; 0 when none was measured.
        ("latency_p99_us", ctypes.c_uint32),  # 99th percentile of that latency, µs; 0 when none was measured.
    ]


assert ctypes.sizeof(InputCounters) == 80


class Counter(ctypes.Structure):
    _fields_ = [
        ("name", ctypes.c_char * 32),  # Its name, such as `bad checksums`.
        ("value", ctypes.c_uint64),  # Its value.
    ]


assert ctypes.sizeof(Counter) == 40


class Heartbeat(ctypes.Structure):
    """A heartbeat from the work loop of a process, with its counters."""

    SERVICE = "health/heartbeat"
    CONTRACT = "version 3 layout 3c8686e284cfb3a7"
    NUMBERED = False
    WAKES = False
    _fields_ = [
        ("process", ctypes.c_char * 32),  # Name in the deployment.
        ("note", ctypes.c_char * 128),  # A note on its state; may be empty.
        ("progress", ctypes.c_uint64),  # Number of steps of its work loop.
        ("sent", ctypes.c_uint64),  # Messages sent.
        ("inputs", InputCounters * 24),  # Its inputs; the first `inputs_count` are valid.
        ("counters", Counter * 16),  # Its counters; the first `counters_count` are valid.
        ("inputs_count", ctypes.c_uint32),  # Number of inputs.
        ("counters_count", ctypes.c_uint32),  # Number of counters.
        ("pid", ctypes.c_uint32),  # Process id.
        ("phase", ctypes.c_uint32),  # `Phase` as a number.
    ]

    @staticmethod
    def type_name():
        return "health/heartbeat"


assert ctypes.sizeof(Heartbeat) == 2752


class Progress(ctypes.Structure):
    """How far a process has answered a stream. Playback in lockstep waits for it, and a process that has ended for the recorder's."""

    SERVICE = "health/progress"
    CONTRACT = "version 1 layout cfcaed6a34c9d1c1"
    NUMBERED = False
    WAKES = True
    _fields_ = [
        ("process", ctypes.c_char * 32),  # Name in the deployment.
        ("service", ctypes.c_char * 32),  # The source stream.
        ("answered", ctypes.c_uint64),  # Every message up to this number is answered.
    ]

    @staticmethod
    def type_name():
        return "health/progress"


assert ctypes.sizeof(Progress) == 72


class ProcessStatus(ctypes.Structure):
    _fields_ = [
        ("process", ctypes.c_char * 32),  # Name in the deployment.
        ("note", ctypes.c_char * 128),  # The note of its last heartbeat, or the reason why it is down.
        ("heartbeat_age_ms", ctypes.c_uint64),  # Milliseconds since its last heartbeat; `u64::MAX` when there was none.
        ("received", ctypes.c_uint64),  # Messages received, all inputs.
        ("lost", ctypes.c_uint64),  # Messages lost, all inputs.
        ("refused", ctypes.c_uint64),  # Messages refused, all inputs.
        ("sent", ctypes.c_uint64),  # Messages sent.
        ("received_per_s", ctypes.c_double),  # Messages received per second, recently.
        ("sent_per_s", ctypes.c_double),  # Messages sent per second, recently.
        ("latency_median_us", ctypes.c_uint32),  # Median latency of its busiest input, µs; 0 when none was measured.
        ("latency_p99_us", ctypes.c_uint32),  # 99th percentile of the latency of that input, µs; 0 when none was measured.
        ("cpu", ctypes.c_double),  # Share of one core, recently.
        ("resident_bytes", ctypes.c_uint64),  # Resident memory, bytes.
        ("counters", Counter * 16),  # Its counters; the first `counters_count` are valid.
        ("counters_count", ctypes.c_uint32),  # Number of counters.
        ("pid", ctypes.c_uint32),  # Process id; 0 when it is not running.
        ("state", ctypes.c_uint32),  # `ProcessState` as a number.
        ("restarts", ctypes.c_uint32),  # Number of restarts.
    ]


assert ctypes.sizeof(ProcessStatus) == 896


class DeploymentStatus(ctypes.Structure):
    """The whole deployment as the supervisor sees it."""

    SERVICE = "health/status"
    CONTRACT = "version 2 layout b65d954b36f85e77"
    NUMBERED = False
    WAKES = True
    _fields_ = [
        ("deployment", ctypes.c_char * 64),  # Name of the deployment.
        ("uptime_ms", ctypes.c_uint64),  # Milliseconds since it was started.
        ("processes", ProcessStatus * 24),  # Its processes in start order; the first `count` are valid.
        ("count", ctypes.c_uint32),  # Number of processes.
        ("ending", ctypes.c_uint32),  # 1 while the deployment is ending.
    ]

    @staticmethod
    def type_name():
        return "health/status"


assert ctypes.sizeof(DeploymentStatus) == 21584


class LogLine(ctypes.Structure):
    """A line that a process has logged."""

    SERVICE = "health/log"
    CONTRACT = "version 1 layout 75359bed8342c157"
    NUMBERED = False
    WAKES = True
    _fields_ = [
        ("process", ctypes.c_char * 32),  # Name in the deployment; `supervisor` for the supervisor's own.
        ("message", ctypes.c_char * 480),  # The text, cut to what fits.
        ("level", ctypes.c_uint32),  # `LogLevel` as a number.
        ("reserved", ctypes.c_uint32),  # Always 0.
    ]

    @staticmethod
    def type_name():
        return "health/log"


assert ctypes.sizeof(LogLine) == 520


class Surface(ctypes.Structure):
    _fields_ = [
        ("from_m", ctypes.c_double * 2),  # Its start, m.
        ("to_m", ctypes.c_double * 2),  # Its end, m.
    ]


assert ctypes.sizeof(Surface) == 32


class TruthSurfaces(ctypes.Structure):
    """A piece of the list of the simulated world's surfaces, which has no sensor time."""

    SERVICE = "truth/surfaces"
    CONTRACT = "version 1 layout a94f625951a2de48"
    NUMBERED = False
    WAKES = True
    _fields_ = [
        ("start", Pose),  # Pose of the robot at the start in the world frame: the origin of the map.
        ("surfaces", Surface * 64),  # The first `count` entries are surfaces, the rest is zero.
        ("first", ctypes.c_uint32),  # Index of the first surface of this piece.
        ("total", ctypes.c_uint32),  # Surfaces of the whole world.
        ("count", ctypes.c_uint32),  # Number of surfaces in this piece.
        ("reserved", ctypes.c_uint32),  # Always 0.
    ]

    @staticmethod
    def type_name():
        return "truth/surfaces"


assert ctypes.sizeof(TruthSurfaces) == 2088


class CameraMask:
    """Where SBS detects motion in the frame of the same number: 255 there, 0 elsewhere. It is made only while it is read and not recorded; a replay of the frames makes it again. The bytes of a picture under a FrameHeader."""

    SERVICE = "camera/mask"
    CONTRACT = "version 1 layout 48d1779581d753f2"
    NUMBERED = True
    WAKES = True
    MAX_BYTES = 307200


class CameraBackground:
    """The picture without what moves, as SBS models it. It is made only while it is read and not recorded; a replay of the frames makes it again. The bytes of a picture under a FrameHeader."""

    SERVICE = "camera/background"
    CONTRACT = "version 1 layout 48d1779581d753f2"
    NUMBERED = True
    WAKES = True
    MAX_BYTES = 307200
