//! What echoes and movers say of the walkers.

use geometry::Beam;
use messages::{Mover, Pose};
use nalgebra::{Matrix2, Vector2};
use tracking::Motion;

use crate::observe::ECHO_GATE;
use crate::parameters::Parameters;
use crate::track::{Anchor, Origin, Track};
use crate::tracks::{COAST_NS, MAX_TRACKS, SPEED_SD_M_S, Tracks, UNSEEN_NS, in_view};

/// S from which on an echo is a known wall's.
const KNOWN_WALL: f64 = 1.5;
/// A slower walker may stand before a wall, m/s.
const SLOW_M_S: f64 = 0.35;
/// Who stands ends this long after the last echo, ns: so long a robot may look elsewhere and come to pass him.
const HELD_NS: u64 = 10_000_000_000;
/// Or when this many readings pass beyond him.
const PASSES: u32 = 2;
/// Or this many that look at him and hear something else.
const MISSES: u32 = 5;
/// Who came to rest was seen to: his blob fades a moment later, ns.
const SEEN_NS: u64 = 1_000_000_000;
/// Echoes that began with a walker are his from so many on: more than a second of them.
const LEFT_ECHOES: u32 = 4;
/// Who was faster than this at the last of them walks on, and does not stand, m/s.
const LEFT_SPEED_M_S: f64 = 0.6;
/// Echoes of a walker's are asked for him again within this time, ns.
const ANCHOR_NS: u64 = 1_000_000_000;
/// Two who stand closer than this are one, m.
const SAME_M: f64 = 0.4;

/// An echo of a scan, as tracks need it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Heard<'a> {
    pub(crate) beam: &'a Beam,
    /// S from the past alone.
    pub(crate) past: f64,
    /// Its run in its sonar.
    pub(crate) run: u64,
    /// The run begins with it.
    pub(crate) first: bool,
}

impl Track {
    /// Notes an echo that supported it, if it belongs to a run that began with it.
    fn anchor(&mut self, echo: &Heard<'_>, stamp_ns: u64) {
        let (motion, run) = (self.motion, echo.run);
        match self.anchors.iter_mut().find(|anchor| anchor.run == run) {
            Some(anchor) => *anchor = Anchor { run, echoes: anchor.echoes.saturating_add(1), motion, stamp_ns },
            None if echo.first => self.anchors.push(Anchor { run, echoes: 1, motion, stamp_ns }),
            None => {}
        }
    }

    /// Somebody who stands where an echo came from that began with this track and supports it no longer.
    fn left_behind(&self, echo: &Heard<'_>, stamp_ns: u64) -> Option<Self> {
        let anchor = self.anchors.iter().find(|anchor| anchor.run == echo.run && anchor.stamp_ns < stamp_ns)?;
        if anchor.echoes < LEFT_ECHOES || anchor.motion.velocity_m_s().norm() > LEFT_SPEED_M_S {
            return None;
        }
        let mut stander = self.stander_at(0, anchor.motion);
        (stander.stamp_ns, stander.heard_ns, stander.ended_ns) = (stamp_ns, stamp_ns, None);
        stander.remember();
        stander.stands_at(echo.beam).then_some(stander)
    }

    /// Whether this is somebody who stands where another does.
    fn stands_near(&self, other: &Self) -> bool {
        self.held && self.ended_ns.is_none() && (self.motion.place_m() - other.motion.place_m()).norm() < SAME_M
    }
}

impl Tracks {
    /// The echoes and movers of a scan.
    pub(crate) fn hear(&mut self, parameters: &Parameters, map_from_robot: &Pose, stamp_ns: u64, echoes: &[Heard<'_>], movers: &[Mover]) {
        self.lead(stamp_ns);
        let mut claimed = vec![false; echoes.len()];
        for (echo, claimed) in echoes.iter().zip(&mut claimed).filter(|(echo, _)| echo.beam.echo()) {
            *claimed = self.support_by_echo(echo, stamp_ns);
        }
        for echo in echoes {
            for track in self.alive().filter(|track| track.held) {
                track.note_passing(echo.beam, stamp_ns);
            }
        }
        for mover in movers {
            let known = echoes.iter().zip(&claimed).enumerate().any(|(index, (_, claimed))| *claimed && mover.readings & (1 << index) != 0);
            if !known {
                self.support_or_start_by_mover(parameters, map_from_robot, stamp_ns, mover);
            }
        }
        self.note_left_behind(echoes, stamp_ns);
        self.note_standers(stamp_ns);
        self.end_silent(stamp_ns);
    }

    /// Gives an echo to the walker who explains it best and to whoever stands there; whether there is one.
    fn support_by_echo(&mut self, echo: &Heard<'_>, stamp_ns: u64) -> bool {
        let known_wall = echo.past > KNOWN_WALL;
        let mut standing = false;
        for track in self.alive().filter(|track| track.held && !known_wall) {
            if track.stands_at(echo.beam) {
                track.support_by_echo(echo.beam, stamp_ns);
                standing = true;
            }
        }
        let walking = self.alive().filter(|track| !track.held && (track.confirmed() || track.origin == Origin::Sonar));
        let near = walking.filter_map(|track| {
            let deviation = track.echo_deviation(echo.beam)?.abs();
            let plausible = !known_wall || track.walked && track.motion.velocity_m_s().norm() < SLOW_M_S;
            (deviation < ECHO_GATE && plausible).then_some((deviation, track))
        });
        match near.min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((_, track)) => {
                track.support_by_echo(echo.beam, stamp_ns);
                track.anchor(echo, stamp_ns);
                true
            }
            None => standing,
        }
    }

    /// Where a walker who was heard comes to rest, somebody stands: he may fade from the picture, and others may pass him.
    fn note_standers(&mut self, stamp_ns: u64) {
        let resting: Vec<usize> = (0..self.tracks.len())
            .filter(|index| {
                let Some(track) = self.tracks.get(*index) else { return false };
                let rests = track.ended_ns.is_none()
                    && !track.held
                    && track.confirmed()
                    && track.walked
                    && track.heard_ns == stamp_ns
                    && stamp_ns.saturating_sub(track.seen_ns) <= SEEN_NS
                    && track.rests();
                rests && !self.tracks.iter().any(|other| other.stands_near(track))
            })
            .collect();
        for index in resting {
            if self.tracks.len() < MAX_TRACKS
                && let Some(track) = self.tracks.get(index)
            {
                self.given += 1;
                let stander = track.stander_at(self.given, track.motion);
                self.tracks.push(stander);
            }
        }
    }

    /// Echoes that began with a walker and go on at their place when the track has left it: he stands there, and the track
    /// follows somebody who passed him.
    fn note_left_behind(&mut self, echoes: &[Heard<'_>], stamp_ns: u64) {
        let mut standers: Vec<Track> = Vec::new();
        for echo in echoes.iter().filter(|echo| echo.beam.echo() && echo.past <= KNOWN_WALL) {
            for track in self.tracks.iter().filter(|track| track.confirmed() && track.walked && !track.held) {
                let Some(stander) = track.left_behind(echo, stamp_ns) else { continue };
                if !self.tracks.iter().chain(&standers).any(|other| other.stands_near(&stander)) {
                    standers.push(stander);
                }
            }
        }
        for mut stander in standers.into_iter().take(MAX_TRACKS.saturating_sub(self.tracks.len())) {
            self.given += 1;
            stander.id = self.given;
            self.tracks.push(stander);
        }
        for track in &mut self.tracks {
            track.anchors.retain(|anchor| stamp_ns.saturating_sub(anchor.stamp_ns) < ANCHOR_NS);
        }
    }

    /// A mover that only STD sees, where the camera does not look.
    fn support_or_start_by_mover(&mut self, parameters: &Parameters, map_from_robot: &Pose, stamp_ns: u64, mover: &Mover) {
        let place = Vector2::new(mover.map_x_m, mover.map_y_m);
        let motion = Motion::at(place, Matrix2::identity() * 0.0625, SPEED_SD_M_S);
        let watched = parameters.camera.is_some_and(|camera| {
            let fresh = self.frame_ns != 0 && stamp_ns.saturating_sub(self.frame_ns) < UNSEEN_NS;
            fresh && in_view(&camera, &map_from_robot.then(&camera.mount), &motion)
        });
        if !watched {
            self.start(Origin::Sonar, motion, stamp_ns);
        }
    }

    fn end_silent(&mut self, stamp_ns: u64) {
        for track in self.alive() {
            let over = if track.held {
                track.passed >= PASSES || track.missed >= MISSES || stamp_ns.saturating_sub(track.heard_ns) > HELD_NS
            } else if track.origin == Origin::Sonar {
                stamp_ns.saturating_sub(track.supported_ns()) > UNSEEN_NS
            } else {
                stamp_ns.saturating_sub(track.seen_ns) > COAST_NS
            };
            if over {
                track.ended_ns = Some(track.supported_ns());
            }
        }
    }
}
