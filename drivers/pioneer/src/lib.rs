//! Driver of a Pioneer's serial sonar and odometry.
