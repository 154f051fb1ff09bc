//! What can be wrong with a robot or its line, and what a packet shows of it.

use psos::{Sip, System};

/// Below this a battery of 12 V is nearly empty, V: what the robots are set to warn at as they leave the factory (P2OS manual). Robots
/// with two batteries report as if they had one.
const LOW_BATTERY_V: f64 = 11.5;

/// A battery that is low has recovered from here on, V: more than the dip while the motors start.
const GOOD_BATTERY_V: f64 = 11.8;

/// A state of the robot or its line that a person should know of. The order is that of the status: what is most urgent first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Condition {
    /// The emergency stop is pressed.
    EmergencyStop,
    /// A wheel turns less than its motor wants.
    Stall,
    /// A bumper is pressed.
    Bumper,
    /// No sonar gives readings.
    NoReadings,
    /// Some sonars give no readings any more.
    SilentSonars,
    /// Packets are lost on the line.
    PacketLoss,
    /// The odometry is refused again and again.
    Odometry,
    /// The battery is nearly empty.
    LowBattery,
    /// The motors have no power. Normal for a robot that is pushed.
    MotorsOff,
}

impl Condition {
    /// Every condition, in the order of the status.
    pub const ALL: [Self; 9] = [
        Self::EmergencyStop,
        Self::Stall,
        Self::Bumper,
        Self::NoReadings,
        Self::SilentSonars,
        Self::PacketLoss,
        Self::Odometry,
        Self::LowBattery,
        Self::MotorsOff,
    ];
}

/// What a packet itself shows of its robot. Batteries recover later than they run low: `battery_low` says that it is low already.
pub(crate) fn shown_by(sip: &Sip, system: System, battery_low: bool) -> [(Condition, Option<String>); 5] {
    let p2os = system == System::P2os;
    let battery_v = sip.battery_v();
    // 0: the robot does not measure it.
    let low = sip.battery > 0 && battery_v < if battery_low { GOOD_BATTERY_V } else { LOW_BATTERY_V };
    [
        (Condition::EmergencyStop, (p2os && sip.stop_button()).then(|| "EMERGENCY STOP pressed".to_owned())),
        (Condition::Stall, stall(sip)),
        (Condition::Bumper, bumpers(sip)),
        (Condition::LowBattery, low.then(|| format!("BATTERY LOW: {battery_v:.1} V"))),
        (Condition::MotorsOff, (p2os && !sip.motors_on()).then(|| "motors off".to_owned())),
    ]
}

fn stall(sip: &Sip) -> Option<String> {
    let which = match (sip.left_stall_bumpers & 1, sip.right_stall_bumpers & 1) {
        (0, 0) => return None,
        (1, 0) => "the left wheel",
        (0, _) => "the right wheel",
        _ => "both wheels",
    };
    Some(format!("STALL of {which}"))
}

/// The bits above the stall bits: rear bumpers beside the left wheel's, front bumpers beside the right wheel's.
fn bumpers(sip: &Sip) -> Option<String> {
    let pressed = |name: &str, bits: u8| {
        let numbers: Vec<_> = (1..8).filter(|bit| bits >> bit & 1 == 1).map(|bit: u8| bit.to_string()).collect();
        (!numbers.is_empty()).then(|| format!("{name} {}", numbers.join(", ")))
    };
    let both: Vec<_> = [pressed("front", sip.right_stall_bumpers), pressed("rear", sip.left_stall_bumpers)].into_iter().flatten().collect();
    (!both.is_empty()).then(|| format!("BUMPER pressed: {}", both.join("; ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(change: impl FnOnce(&mut Sip), system: System) -> String {
        let mut sip = Sip {
            status: 2,
            x: 0,
            y: 0,
            heading: 0,
            left_velocity: 0,
            right_velocity: 0,
            battery: 126,
            left_stall_bumpers: 0,
            right_stall_bumpers: 0,
            control: 0,
            flags: 1,
            compass: 0,
            readings: Vec::new(),
            tail: Vec::new(),
        };
        change(&mut sip);
        shown_by(&sip, system, false).into_iter().filter_map(|(_, words)| words).collect::<Vec<_>>().join(" | ")
    }

    #[test]
    fn a_packet_shows_stalls_bumpers_battery_and_the_stop_button() {
        assert_eq!(words(|_| {}, System::P2os), "");
        assert_eq!(words(|sip| sip.flags = 0x26, System::P2os), "EMERGENCY STOP pressed | motors off");
        assert_eq!(words(|sip| sip.flags = 0x26, System::Psos), "", "PSOS means something else by these bits");
        assert_eq!(words(|sip| sip.left_stall_bumpers = 1, System::Psos), "STALL of the left wheel");
        assert_eq!(
            words(|sip| (sip.left_stall_bumpers, sip.right_stall_bumpers) = (3, 0x0D), System::Psos),
            "STALL of both wheels | BUMPER pressed: front 2, 3; rear 1"
        );
        assert_eq!(words(|sip| sip.battery = 100, System::Psos), "BATTERY LOW: 10.0 V");
        assert_eq!(words(|sip| sip.battery = 0, System::Psos), "", "not measured");
    }
}
