//! From the robot's counters to a pose: they wrap around, and a damaged packet may claim anything.
//!
//! *Step*: what lies between two packets. It is believed when its speed and turn rate are within the limits and its change of
//! velocity is one that a robot can make. A packet whose step is not believed is refused: the pose stays. What the next packet
//! says decides:
//! - it fits the packet before: the refused one was damaged, and nothing is lost but itself;
//! - it fits the refused one, and the whole is within the limits of speed: the robot was pushed, and the pose follows;
//! - it fits the refused one only: the counters have started anew elsewhere (switched off and on, set to zero), and the pose goes
//!   on from where it was. It never jumps.
//!
//! After a silence, several steps that differ by whole wraps may all be within the limits. The one nearest to the prediction is taken
//! then, as a guess.

use messages::Pose;

/// Time between two status packets, s. Also the slack in time that a step is granted: two packets may arrive up to that much
/// closer together or further apart than the robot sent them.
pub const CYCLE_S: f64 = 0.1;

/// The numbers at which the counters of the robots' firmwares start again from 0.
const MODULI: [u32; 3] = [4096, 32768, 65536];

/// How close to the prediction a refused step comes with the right modulus, m and rad: twice what the greatest accelerations make of
/// a cycle. With 12 bits a Pioneer 1 wraps every 0.21 m, so that a damaged counter comes as close one time in five.
const WRAP_FITS: (f64, f64) = (0.02, 0.1);

/// A wrap is looked for in a step of this long at most, s: later the prediction is no better than chance.
const WRAP_SEEN_S: f64 = 0.3;

/// Longest time over which the last velocity says anything about the next step, s. With a modulus of 2^15 a Pioneer 1's
/// x and y wrap every 1.66 m: after a silence this unwinds both a robot at 0.4 m/s that continued for up to 4 s and one that stopped at once.
const PREDICTION_S: f64 = 2.0;

/// Wraps to either side of the best step that are tried as alternatives. The possible steps lie in a disc: if it holds an alternative at
/// all, it holds one of these.
const WRAPS: i64 = 2;

/// Greatest acceleration, m/s²: six times what the robots are set to, and turning at full speed.
const ACCELERATION_M_S2: f64 = 2.0;

/// Greatest angular acceleration, rad/s²: as generous.
const TURN_ACCELERATION_RAD_S2: f64 = 10.0;

/// Deviations from the prediction that are within the roughness of a step, m and rad: some simulated robots start and stop at
/// full speed at once.
const ROUGHNESS: (f64, f64) = (0.05, 0.1);

/// Weight of a new step in the velocity. One damaged step that is believed must not carry the prediction half a wrap away.
const VELOCITY_GAIN: f64 = 0.5;

/// The counters of one packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Along x, robot units.
    pub x: u16,
    /// Along y, robot units.
    pub y: u16,
    /// Heading, robot units.
    pub heading: i16,
}

/// How counters become a pose, and what is believed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// The number at which x and y start again from 0.
    pub modulus: u32,
    /// Units of a full turn.
    pub heading_units: u16,
    /// m per unit of x and y.
    pub distance_m: f64,
    /// Greatest speed that is believed, m/s.
    pub speed_limit_m_s: f64,
    /// Greatest turn rate that is believed, rad/s.
    pub turn_limit_rad_s: f64,
}

/// Where the robot is. Plain numbers, so that a restarted process can take them up.
#[derive(Debug, Clone, Copy, PartialEq, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Track {
    /// The pose in the map frame at which the robot's counters were last taken up.
    pub base: Pose,
    /// Units travelled along the robot's own axes since then: x, y, heading.
    pub travelled: [i64; 3],
    /// Heading of the robot's counters then, units.
    pub base_heading: i64,
    /// The counters of the last step that was believed: x, y, heading.
    pub last: [i64; 3],
    /// Units a second along x, y and heading.
    pub velocity: [f64; 3],
    /// Stamp of the last step that was believed, ns.
    pub stamp_ns: u64,
    /// 1 when the counters have been taken up, 0 when the next packet's will be.
    pub anchored: u64,
}

/// What became of a packet's counters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step {
    /// Believed, and the pose has moved by it.
    Taken,
    /// The pose has moved by it, but with as much right the counters mean a step that differs by whole wraps.
    Guessed {
        /// Distance between two such steps, m.
        wrap_m: f64,
        /// How far the robot may have gone, m.
        reach_m: f64,
        /// The time since the last step that was believed, s.
        elapsed_s: f64,
    },
    /// The first since the start or since the link was down: the pose stays, the robot's counters count from here.
    Anchored,
    /// Not believed; the pose stays and the packet is of no use.
    Refused {
        /// The distance it claims, m.
        distance_m: f64,
        /// The turn it claims, rad.
        turn_rad: f64,
        /// The time since the last step that was believed, s.
        elapsed_s: f64,
        /// Another modulus of the counters with which the step would be believed.
        modulus: Option<u32>,
    },
}

/// The robot's pose from its odometry.
#[derive(Debug, Clone, PartialEq)]
pub struct Odometry {
    scale: Scale,
    track: Track,
    /// Counters that were refused last, with their stamp.
    refused: Option<(Counters, u64)>,
    /// Time since the last step that the stamps do not tell of, ns.
    unseen_ns: u64,
}

impl Odometry {
    /// Odometry that continues from `track`.
    #[must_use]
    pub fn new(scale: Scale, track: Track) -> Self {
        Self { scale, track, refused: None, unseen_ns: 0 }
    }

    /// The robot in the map frame.
    #[must_use]
    pub fn pose(&self) -> Pose {
        let Track { base, travelled, base_heading, .. } = self.track;
        let unit_rad = self.heading_rad();
        // The robot's own axes, seen from the map.
        let (sin, cos) = (base.yaw_rad - base_heading as f64 * unit_rad).sin_cos();
        let (x, y) = (travelled[0] as f64 * self.scale.distance_m, travelled[1] as f64 * self.scale.distance_m);
        Pose {
            x_m: base.x_m + cos * x - sin * y,
            y_m: base.y_m + sin * x + cos * y,
            yaw_rad: base.yaw_rad + travelled[2] as f64 * unit_rad,
        }
    }

    /// All that a later process needs to resume.
    #[must_use]
    pub fn track(&self) -> Track {
        self.track
    }

    /// Says that the robot's counters may start anew: the next packet's are taken up where the pose is.
    pub fn lift(&mut self) {
        self.track.anchored = 0;
        self.refused = None;
    }

    /// Says that more time has passed than the next stamp tells: the clock stood still meanwhile.
    pub fn add_unseen(&mut self, time_ns: u64) {
        self.unseen_ns = self.unseen_ns.saturating_add(time_ns);
    }

    /// Whether counters are within a cycle's motion of zero.
    #[must_use]
    pub fn is_near_zero(&self, counters: Counters) -> bool {
        let heading_units = i64::from(self.scale.heading_units);
        let near = |counter: i64, modulus: i64| unwrap_near(0, counter, modulus) as f64;
        let [x, y, heading] = units(counters);
        let modulus = i64::from(self.scale.modulus);
        let distance_m = near(x, modulus).hypot(near(y, modulus)) * self.scale.distance_m;
        let turn_rad = near(heading, heading_units).abs() * self.heading_rad();
        distance_m <= self.scale.speed_limit_m_s * CYCLE_S && turn_rad <= self.scale.turn_limit_rad_s * CYCLE_S
    }

    /// How far the robot may have gone since the last step that was believed, m.
    #[must_use]
    pub fn reach_m(&self, stamp_ns: u64) -> f64 {
        self.scale.speed_limit_m_s * (self.elapsed_s(self.track.stamp_ns, stamp_ns) + CYCLE_S)
    }

    /// Changes factors and limits, for another robot. The pose stays.
    pub fn rescale(&mut self, scale: Scale) {
        let base = self.pose();
        self.track = Track { base, stamp_ns: self.track.stamp_ns, ..Track::default() };
        self.scale = scale;
        self.refused = None;
    }

    /// Takes the counters of the next packet.
    pub fn step(&mut self, counters: Counters, stamp_ns: u64) -> Step {
        if self.track.anchored == 0 {
            self.anchor(counters, stamp_ns);
            return Step::Anchored;
        }
        let claim = self.claim((self.track.last, self.track.stamp_ns), self.track.velocity, counters, stamp_ns);
        let within_limits = self.is_within_limits(&claim);
        if within_limits && self.is_near_prediction(&claim) {
            return self.take_best(&claim, counters, stamp_ns);
        }
        let fits_refused = self
            .refused
            .is_some_and(|(before, then_ns)| self.is_within_limits(&self.claim((units(before), then_ns), [0.0; 3], counters, stamp_ns)));
        match (fits_refused, within_limits) {
            (true, true) => self.take_best(&claim, counters, stamp_ns),
            (true, false) => {
                self.anchor(counters, stamp_ns);
                Step::Anchored
            }
            (false, _) => {
                self.refused = Some((counters, stamp_ns));
                let modulus = self.other_modulus(counters, stamp_ns);
                Step::Refused { distance_m: self.distance_m(&claim), turn_rad: self.turn_rad(&claim), elapsed_s: claim.elapsed_s, modulus }
            }
        }
    }

    /// The modulus of another firmware with which these counters would be believed.
    fn other_modulus(&self, counters: Counters, stamp_ns: u64) -> Option<u32> {
        MODULI.into_iter().filter(|&modulus| modulus != self.scale.modulus).find(|&modulus| {
            let other = Self { scale: Scale { modulus, ..self.scale }, ..self.clone() };
            let claim = other.claim((self.track.last, self.track.stamp_ns), self.track.velocity, counters, stamp_ns);
            let off_m =
                (claim.step[0] as f64 - claim.predicted[0]).hypot(claim.step[1] as f64 - claim.predicted[1]) * self.scale.distance_m;
            let off_rad = (claim.step[2] as f64 - claim.predicted[2]).abs() * self.heading_rad();
            claim.elapsed_s <= WRAP_SEEN_S && other.is_within_limits(&claim) && off_m <= WRAP_FITS.0 && off_rad <= WRAP_FITS.1
        })
    }

    /// What the counters say happened since `last`. Of all steps that differ by a wrap, the one nearest to the prediction.
    fn claim(&self, last: ([i64; 3], u64), velocity: [f64; 3], counters: Counters, stamp_ns: u64) -> Claim {
        let (before, then_ns) = last;
        let now = units(counters);
        let moduli = [self.scale.modulus, self.scale.modulus, u32::from(self.scale.heading_units)];
        let elapsed_s = self.elapsed_s(then_ns, stamp_ns);
        let predicted = velocity.map(|velocity| velocity * elapsed_s.min(PREDICTION_S));
        let step = std::array::from_fn(|axis| unwrap_near(predicted[axis] as i64, now[axis] - before[axis], i64::from(moduli[axis])));
        Claim { step, predicted, elapsed_s }
    }

    fn elapsed_s(&self, then_ns: u64, stamp_ns: u64) -> f64 {
        (stamp_ns.saturating_sub(then_ns).saturating_add(self.unseen_ns) as f64 / 1e9).max(CYCLE_S)
    }

    /// Takes a possible step, and tells whether another one is possible as well.
    fn take_best(&mut self, claim: &Claim, counters: Counters, stamp_ns: u64) -> Step {
        let others = (-WRAPS..=WRAPS).flat_map(|x| (-WRAPS..=WRAPS).map(move |y| (x, y))).filter(|&wraps| wraps != (0, 0));
        let modulus = i64::from(self.scale.modulus);
        let ambiguous = others.into_iter().any(|(x, y)| {
            let [along_x, along_y, turn] = claim.step;
            let other = Claim { step: [along_x + x * modulus, along_y + y * modulus, turn], ..*claim };
            // How much the robot turned meanwhile is no matter: the heading's counter has a whole turn.
            let other_m = (other.step[0] as f64).hypot(other.step[1] as f64) * self.scale.distance_m;
            other_m <= self.scale.speed_limit_m_s * (claim.elapsed_s + CYCLE_S) && self.is_near_prediction(&other)
        });
        let step = Step::Guessed {
            wrap_m: f64::from(self.scale.modulus) * self.scale.distance_m,
            reach_m: self.reach_m(stamp_ns),
            elapsed_s: claim.elapsed_s,
        };
        self.take(claim, counters, stamp_ns);
        if ambiguous { step } else { Step::Taken }
    }

    fn is_within_limits(&self, claim: &Claim) -> bool {
        let time_s = claim.elapsed_s + CYCLE_S;
        self.distance_m(claim) <= self.scale.speed_limit_m_s * time_s && self.turn_rad(claim).abs() <= self.scale.turn_limit_rad_s * time_s
    }

    /// Whether the robot can have changed its velocity that much. The prediction itself may be off by a cycle's motion.
    fn is_near_prediction(&self, claim: &Claim) -> bool {
        let Claim { step, predicted, elapsed_s } = claim;
        let off: [f64; 3] = std::array::from_fn(|axis| step[axis] as f64 - predicted[axis]);
        let off_m = off[0].hypot(off[1]) * self.scale.distance_m;
        let off_rad = off[2].abs() * self.heading_rad();
        let cycle: [f64; 3] = self.track.velocity.map(|velocity| velocity * CYCLE_S);
        let cycle_m = cycle[0].hypot(cycle[1]) * self.scale.distance_m;
        let cycle_rad = cycle[2].abs() * self.heading_rad();
        let half_square = 0.5 * elapsed_s * elapsed_s;
        off_m <= ROUGHNESS.0 + cycle_m + ACCELERATION_M_S2 * half_square
            && off_rad <= ROUGHNESS.1 + cycle_rad + TURN_ACCELERATION_RAD_S2 * half_square
    }

    fn take(&mut self, claim: &Claim, counters: Counters, stamp_ns: u64) {
        for axis in 0..3 {
            self.track.travelled[axis] += claim.step[axis];
            let velocity = claim.step[axis] as f64 / claim.elapsed_s;
            self.track.velocity[axis] += VELOCITY_GAIN * (velocity - self.track.velocity[axis]);
        }
        self.track.last = units(counters);
        self.track.stamp_ns = stamp_ns;
        self.refused = None;
        self.unseen_ns = 0;
    }

    fn anchor(&mut self, counters: Counters, stamp_ns: u64) {
        let last = units(counters);
        let base = self.pose();
        self.track = Track { base, base_heading: last[2], last, stamp_ns, anchored: 1, ..Track::default() };
        self.refused = None;
        self.unseen_ns = 0;
    }

    fn heading_rad(&self) -> f64 {
        std::f64::consts::TAU / f64::from(self.scale.heading_units)
    }

    fn distance_m(&self, claim: &Claim) -> f64 {
        (claim.step[0] as f64).hypot(claim.step[1] as f64) * self.scale.distance_m
    }

    fn turn_rad(&self, claim: &Claim) -> f64 {
        claim.step[2] as f64 * self.heading_rad()
    }
}

/// A step that a packet claims, in units.
struct Claim {
    step: [i64; 3],
    predicted: [f64; 3],
    elapsed_s: f64,
}

fn units(counters: Counters) -> [i64; 3] {
    [i64::from(counters.x), i64::from(counters.y), i64::from(counters.heading)]
}

/// The number nearest to `predicted` that differs from `difference` by whole wraps.
fn unwrap_near(predicted: i64, difference: i64, modulus: i64) -> i64 {
    let half = modulus / 2;
    predicted + (difference - predicted + half).rem_euclid(modulus) - half
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SCALE: Scale = Scale { modulus: 32768, heading_units: 1024, distance_m: 0.05066e-3, speed_limit_m_s: 1.0, turn_limit_rad_s: 3.0 };
    const CYCLE_NS: u64 = 100_000_000;

    fn counters(x: i64, y: i64, heading: i64, modulus: i64) -> Counters {
        Counters { x: x.rem_euclid(modulus) as u16, y: y.rem_euclid(modulus) as u16, heading: heading.rem_euclid(1024) as i16 }
    }

    #[test]
    fn wraps_are_unwound_towards_the_prediction() {
        assert_eq!(unwrap_near(0, 32767 - 1, 32768), -2);
        assert_eq!(unwrap_near(0, -32766, 32768), 2);
        assert_eq!(unwrap_near(3100, 1000, 4096), 1000 + 4096);
        assert_eq!(unwrap_near(-1100, 1000, 4096), 1000 - 4096);
    }

    proptest! {
        /// A drive at up to 0.45 m/s (a Pioneer 1 reaches 0.4) and any turn: whatever the modulus, wherever it starts.
        #[test]
        fn a_drive_is_followed_through_every_wrap(
            modulus in prop_oneof![Just(4096_i64), Just(32768), Just(65536)],
            start in (0_i64..65536, 0_i64..65536, 0_i64..1024),
            legs in prop::collection::vec((-0.45_f64..0.45, -2.0_f64..2.0, 5_u64..40), 1..12),
        ) {
            let mut odometry = Odometry::new(Scale { modulus: modulus as u32, ..SCALE }, Track::default());
            let unit = odometry.heading_rad();
            let (mut x, mut y, mut heading) = (start.0 as f64, start.1 as f64, start.2 as f64);
            let raw = |x: f64, y: f64, heading: f64| counters(x as i64, y as i64, heading as i64, modulus);
            prop_assert_eq!(odometry.step(raw(x, y, heading), 0), Step::Anchored);
            let mut stamp_ns = 0;
            let (mut speed, mut turn_rate) = (0.0, 0.0);
            for (target_speed, target_rate, packets) in legs {
                for _ in 0..packets {
                    speed += f64::clamp(target_speed - speed, -0.05, 0.05);
                    turn_rate += f64::clamp(target_rate - turn_rate, -0.5, 0.5);
                    heading += turn_rate * CYCLE_S / unit;
                    let yaw = (heading - start.2 as f64) * unit + start.2 as f64 * unit;
                    x += speed * CYCLE_S * yaw.cos() / SCALE.distance_m;
                    y += speed * CYCLE_S * yaw.sin() / SCALE.distance_m;
                    stamp_ns += CYCLE_NS;
                    prop_assert_eq!(odometry.step(raw(x.floor(), y.floor(), heading.floor()), stamp_ns), Step::Taken);
                }
            }
            let pose = odometry.pose();
            let (dx, dy) = ((x - start.0 as f64) * SCALE.distance_m, (y - start.1 as f64) * SCALE.distance_m);
            let (sin, cos) = (-(start.2 as f64) * unit).sin_cos();
            prop_assert!((pose.x_m - (cos * dx - sin * dy)).abs() < 2e-4, "{pose:?}");
            prop_assert!((pose.y_m - (sin * dx + cos * dy)).abs() < 2e-4, "{pose:?}");
            prop_assert!((pose.yaw_rad - (heading - start.2 as f64) * unit).abs() < 0.01, "{pose:?}");
        }

        /// Whatever the counters say, the pose moves no further than the limits let it.
        #[test]
        fn no_counters_make_the_pose_jump(
            packets in prop::collection::vec((any::<u16>(), any::<u16>(), any::<i16>(), 0_u64..300_000_000), 1..60),
        ) {
            let mut odometry = Odometry::new(SCALE, Track::default());
            let mut stamp_ns = 0;
            let mut before = (odometry.pose(), 0);
            for (x, y, heading, wait_ns) in packets {
                stamp_ns += wait_ns;
                let step = odometry.step(Counters { x, y, heading }, stamp_ns);
                let pose = odometry.pose();
                let moved = (pose.x_m - before.0.x_m).hypot(pose.y_m - before.0.y_m);
                let turned = (pose.yaw_rad - before.0.yaw_rad).abs();
                match step {
                    Step::Taken | Step::Guessed { .. } => {
                        let time_s = ((stamp_ns - before.1) as f64 / 1e9).max(CYCLE_S) + CYCLE_S;
                        prop_assert!(moved <= time_s + 1e-9 && turned <= 3.0 * time_s + 1e-9);
                        before = (pose, stamp_ns);
                    }
                    Step::Anchored => {
                        prop_assert!(moved < 1e-9 && turned < 1e-9);
                        before = (pose, stamp_ns);
                    }
                    Step::Refused { .. } => prop_assert_eq!(pose, before.0),
                }
            }
        }
    }

    fn driven() -> Odometry {
        let mut odometry = Odometry::new(SCALE, Track::default());
        for packet in 0..20 {
            odometry.step(counters(packet * 790, 0, 0, 32768), packet as u64 * CYCLE_NS);
        }
        odometry
    }

    #[test]
    fn one_damaged_packet_costs_nothing_but_itself() {
        let mut odometry = driven();
        let before = odometry.pose();
        assert!((before.x_m - 19.0 * 790.0 * SCALE.distance_m).abs() < 1e-9);
        let step = odometry.step(counters(20 * 790 + 8192, 0, 0, 32768), 20 * CYCLE_NS);
        assert!(matches!(step, Step::Refused { distance_m, .. } if (distance_m - 0.455).abs() < 1e-3), "{step:?}");
        assert_eq!(odometry.pose(), before);
        assert_eq!(odometry.step(counters(21 * 790, 0, 0, 32768), 21 * CYCLE_NS), Step::Taken);
        assert!((odometry.pose().x_m - 21.0 * 790.0 * SCALE.distance_m).abs() < 1e-9);
    }

    /// Within the limits of speed, so only the change of velocity gives it away: sideways at 1.5 m/s for one packet.
    #[test]
    fn an_impossible_step_below_the_limits_is_refused() {
        let mut odometry = driven();
        let step = odometry.step(counters(20 * 790, 3000, 0, 32768), 20 * CYCLE_NS);
        assert!(matches!(step, Step::Refused { distance_m, .. } if distance_m < 0.2), "{step:?}");
        assert_eq!(odometry.step(counters(21 * 790, 0, 0, 32768), 21 * CYCLE_NS), Step::Taken);
        assert!(odometry.pose().y_m.abs() < 1e-9);
        assert!(matches!(odometry.step(counters(22 * 790, 0, 64, 32768), 22 * CYCLE_NS), Step::Refused { turn_rad, .. } if turn_rad < 0.4));
    }

    #[test]
    fn a_robot_that_is_pushed_is_followed() {
        let mut odometry = driven();
        assert!(matches!(odometry.step(counters(20 * 790, 3000, 0, 32768), 20 * CYCLE_NS), Step::Refused { .. }));
        assert_eq!(odometry.step(counters(20 * 790, 3500, 0, 32768), 21 * CYCLE_NS), Step::Taken);
        assert!((odometry.pose().y_m - 3500.0 * SCALE.distance_m).abs() < 1e-9, "nothing of the push is lost");
    }

    #[test]
    fn counters_set_to_zero_leave_the_pose_where_it_was() {
        let mut odometry = driven();
        let before = odometry.pose();
        assert!(matches!(odometry.step(counters(0, 0, 300, 32768), 20 * CYCLE_NS), Step::Refused { .. }));
        assert_eq!(odometry.step(counters(10, 0, 300, 32768), 21 * CYCLE_NS), Step::Anchored);
        assert_eq!(odometry.pose(), before);
        assert_eq!(odometry.step(counters(10 + 790, 0, 300, 32768), 22 * CYCLE_NS), Step::Taken);
        // The robot looks the same way as before; its own x axis lies 300 units to the right of that.
        let moved = (odometry.pose().x_m - before.x_m).hypot(odometry.pose().y_m);
        assert!((moved - 790.0 * SCALE.distance_m).abs() < 1e-9);
        assert!((odometry.pose().y_m / (odometry.pose().x_m - before.x_m) - (-300.0 * odometry.heading_rad()).tan()).abs() < 1e-9);
    }

    /// Counters of 12 bits taken for counters of 15: refused at the wrap, with the modulus that they have.
    #[test]
    fn a_wrap_at_another_modulus_is_named() {
        let mut odometry = Odometry::new(SCALE, Track::default());
        let mut named = Vec::new();
        for packet in 0..20_i64 {
            let step = odometry.step(counters(packet * 790, 0, 0, 4096), packet as u64 * CYCLE_NS);
            named.extend(match step {
                Step::Refused { modulus, .. } => Some(modulus),
                _ => None,
            });
        }
        assert_eq!(named, [Some(4096); 3]);
        assert!(matches!(driven().step(counters(0, 0, 300, 32768), 20 * CYCLE_NS), Step::Refused { modulus: None, .. }));
    }

    /// What a silence of so many cycles makes of a robot that drives on at 0.4 m/s.
    fn after_silence(cycles: i64, scale: Scale) -> (Step, f64) {
        let mut odometry = Odometry::new(scale, Track::default());
        let units = (0.04 / scale.distance_m) as i64;
        let modulus = i64::from(scale.modulus);
        for packet in 0..20 {
            assert!(matches!(
                odometry.step(counters(packet * units, 0, 0, modulus), packet as u64 * CYCLE_NS),
                Step::Taken | Step::Anchored
            ));
        }
        let last = 19 + cycles;
        let step = odometry.step(counters(last * units, 0, 0, modulus), last as u64 * CYCLE_NS);
        (step, odometry.pose().x_m - last as f64 * units as f64 * scale.distance_m)
    }

    #[test]
    fn a_silence_that_the_counters_bridge_leaves_no_doubt() {
        for cycles in [2, 5, 8] {
            let (step, off_m) = after_silence(cycles, SCALE);
            assert_eq!(step, Step::Taken, "{cycles}");
            assert!(off_m.abs() < 1e-9);
        }
        // A P3-DX wraps every 15.9 m: at 1 m/s at the most, 7.5 s are no matter.
        let p3_dx = Scale { distance_m: 0.485e-3, heading_units: 4096, ..SCALE };
        let (step, off_m) = after_silence(75, p3_dx);
        assert_eq!((step, off_m.abs() < 1e-9), (Step::Taken, true));
        assert!(matches!(after_silence(160, p3_dx).0, Step::Guessed { .. }), "16 s are");
    }

    #[test]
    fn a_silence_longer_than_a_wrap_is_a_guess_with_its_size() {
        let (step, off_m) = after_silence(30, SCALE);
        let Step::Guessed { wrap_m, reach_m, elapsed_s } = step else { unreachable!("{step:?}") };
        assert!((wrap_m - 1.66).abs() < 1e-3 && (reach_m - 3.1).abs() < 1e-9 && (elapsed_s - 3.0).abs() < 1e-9);
        assert!(off_m.abs() < 1e-9, "the nearest to the prediction was right this time");
        let (step, off_m) = after_silence(75, SCALE);
        assert!(matches!(step, Step::Guessed { .. }) && off_m.abs() > 1.6, "and wrong by a wrap that time: {off_m}");
    }

    #[test]
    fn time_that_the_stamps_do_not_tell_counts() {
        let mut odometry = driven();
        odometry.add_unseen(6_000_000_000);
        assert!(
            matches!(odometry.step(counters(20 * 790, 0, 0, 32768), 20 * CYCLE_NS), Step::Guessed { elapsed_s, .. } if elapsed_s > 6.0)
        );
        assert_eq!(odometry.step(counters(21 * 790, 0, 0, 32768), 21 * CYCLE_NS), Step::Taken);
    }

    #[test]
    fn after_a_lost_link_the_pose_continues() {
        let mut odometry = driven();
        let before = odometry.pose();
        odometry.lift();
        assert_eq!(odometry.step(counters(12345, 54321, 77, 32768), 900 * CYCLE_NS), Step::Anchored);
        assert_eq!(odometry.pose(), before);
    }

    #[test]
    fn a_track_can_be_resumed() {
        let odometry = driven();
        let mut resumed = Odometry::new(SCALE, odometry.track());
        assert_eq!(resumed.pose(), odometry.pose());
        assert_eq!(resumed.step(counters(24 * 790, 0, 0, 32768), 24 * CYCLE_NS), Step::Taken);
        assert!((resumed.pose().x_m - 24.0 * 790.0 * SCALE.distance_m).abs() < 1e-9);
    }
}
