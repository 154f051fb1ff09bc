//! The service as a fold: [`State::step`] takes a frame and gives its answer.

use messages::{Blob, CameraMotion, CameraStatus, FrameLayout, MAX_BLOBS, seconds};

use crate::compensation::Found;
use crate::components::Component;
use crate::parameters::Parameters;
use crate::picture::{FrameError, luminance};
use crate::plane::Plane;
use crate::scene::{Outcome, Scene};
use crate::transform::Transform;
use crate::working::Working;

/// Pose of the robot by its odometry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Odometry {
    /// Heading, rad, counter-clockwise.
    pub yaw_rad: f64,
}

/// One picture of the camera.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    /// Sensor time, ns.
    pub stamp_ns: u64,
    /// Shape of the bytes.
    pub layout: FrameLayout,
    /// The pixels.
    pub bytes: &'a [u8],
    /// The pose at that time, if it is known.
    pub odometry: Option<Odometry>,
}

/// What there is to say about a frame besides its status.
#[derive(Debug, Clone, PartialEq)]
pub enum Remark {
    /// Nothing.
    None,
    /// It was refused; the state is as before.
    Refused(FrameError),
    /// The pictures have another size than before: everything starts anew.
    NewSize,
    /// So much time lay between this frame and the last one that the motion before says nothing any more.
    Gap {
        /// That time, s.
        seconds: f64,
    },
    /// The odometry is no number and was not used.
    BadOdometry,
    /// Too many frames in a row were not compensated: the model starts anew with this one.
    ModelRestarted,
}

/// The answer to a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// As it goes out on the bus.
    pub motion: CameraMotion,
    /// What else there is to say.
    pub remark: Remark,
}

/// After a gap longer than this, ns, prediction says nothing.
const GAP_NS: u64 = 1_000_000_000;

/// Everything SBS remembers between frames.
#[derive(Debug, Clone)]
pub struct State {
    pub(crate) parameters: Parameters,
    pub(crate) last_stamp_ns: Option<u64>,
    pub(crate) scene: Option<(Working, Scene)>,
}

impl State {
    /// Nothing seen yet.
    #[must_use]
    pub fn new(parameters: Parameters) -> Self {
        Self { parameters, last_stamp_ns: None, scene: None }
    }

    /// The mask of the last frame's blobs: 255 where something moves.
    #[must_use]
    pub fn mask(&self) -> Option<Plane<u8>> {
        self.scene.as_ref().map(|(working, scene)| working.mask(&scene.mask()))
    }

    /// The background picture, grey levels.
    #[must_use]
    pub fn background(&self) -> Option<Plane<u8>> {
        self.scene.as_ref().map(|(working, scene)| working.picture(&scene.model.background.mean))
    }

    /// Takes a frame.
    pub fn step(&mut self, frame: &Frame<'_>) -> Answer {
        let picture = match self.accepted(frame) {
            Ok(picture) => picture,
            Err(error) => return refused(frame, error),
        };
        let gap_ns = self.last_stamp_ns.map_or(0, |last| frame.stamp_ns - last);
        self.last_stamp_ns = Some(frame.stamp_ns);
        let mut remark = Remark::None;
        let yaw_rad = frame.odometry.map(|o| o.yaw_rad).filter(|yaw| yaw.is_finite());
        if frame.odometry.is_some() && yaw_rad.is_none() {
            remark = Remark::BadOdometry;
        }
        let working = Working::new(picture.width(), picture.height());
        let picture = working.reduced(picture);
        match &mut self.scene {
            Some((known, _)) if *known != working => {
                remark = Remark::NewSize;
                self.scene = None;
            }
            Some((_, scene)) if gap_ns > GAP_NS => {
                remark = Remark::Gap { seconds: seconds(gap_ns) };
                scene.forget_motion();
            }
            _ => {}
        }
        let Some((_, scene)) = &mut self.scene else {
            self.scene = Some((working, Scene::new(&picture, yaw_rad, &self.parameters)));
            return answer(&working, &Outcome::first(), remark);
        };
        let outcome = scene.step(&picture, yaw_rad, &self.parameters);
        answer(&working, &outcome, if outcome.restarted { Remark::ModelRestarted } else { remark })
    }

    fn accepted(&self, frame: &Frame<'_>) -> Result<Plane<f32>, FrameError> {
        match self.last_stamp_ns {
            Some(last_ns) if frame.stamp_ns <= last_ns => Err(FrameError::Time { stamp_ns: frame.stamp_ns, last_ns }),
            _ => luminance(&frame.layout, frame.bytes),
        }
    }
}

fn refused(frame: &Frame<'_>, error: FrameError) -> Answer {
    let motion = CameraMotion {
        transform: Transform::identity().rows(),
        status: CameraStatus::Refused as u32,
        width: frame.layout.width.min(640),
        height: frame.layout.height.min(480),
        ..CameraMotion::default()
    };
    Answer { motion, remark: Remark::Refused(error) }
}

fn answer(working: &Working, outcome: &Outcome, remark: Remark) -> Answer {
    let Found { transform, agreement } = outcome.found;
    let mut motion = CameraMotion {
        transform: working.transform(&transform).rows(),
        residual_px: agreement.sigma.rms() * working.factor as f64,
        inliers: agreement.inliers,
        status: outcome.status as u32,
        width: working.width as u32,
        height: working.height as u32,
        count: outcome.blobs.len().min(MAX_BLOBS) as u32,
        ..CameraMotion::default()
    };
    for (out, blob) in motion.blobs.iter_mut().zip(&outcome.blobs) {
        *out = message(&working.component(blob));
    }
    Answer { motion, remark }
}

fn message(c: &Component) -> Blob {
    Blob {
        u_px: (c.sum_u as f64 / f64::from(c.size)) as f32,
        v_px: (c.sum_v as f64 / f64::from(c.size)) as f32,
        size_px: c.size,
        left_px: c.left,
        top_px: c.top,
        right_px: c.right,
        bottom_px: c.bottom,
        reserved: 0,
    }
}
