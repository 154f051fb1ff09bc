//! The configuration packet with which P2OS robots answer CONFIG (P2OS manual, table of the CONFIGpac).

use psos::{Identity, encode_frame};

/// Type byte of the packet.
const TYPE: u8 = 0x20;

/// The packet of a robot as it leaves the factory, driven by hand.
pub(crate) fn encode(identity: &Identity, sonars: usize) -> Vec<u8> {
    let mut data = vec![TYPE];
    let serial_number = "0";
    for text in [&identity.class, &identity.subclass, serial_number] {
        data.extend_from_slice(text.as_bytes());
        data.push(0);
    }
    let four_motors = 0;
    data.push(four_motors);
    // Top speeds and accelerations (rotation in deg, translation in mm), greatest pulse width.
    for number in [360_u16, 2200, 300, 2000, 500] {
        data.extend_from_slice(&number.to_le_bytes());
    }
    data.extend_from_slice(identity.name.as_bytes());
    data.push(0);
    let (packet_interval_ms, host_baud, auxiliary_baud) = (100, 0, 0);
    data.extend_from_slice(&[packet_interval_ms, host_baud, auxiliary_baud]);
    let (gripper, front_sonars, rear_sonars) = (0_u16, 1_u16, u8::from(sonars > 8));
    data.extend_from_slice(&gripper.to_le_bytes());
    data.extend_from_slice(&front_sonars.to_le_bytes());
    data.push(rear_sonars);
    let (low_battery, counts_in_a_turn, watchdog_ms) = (115_u16, 16_570_u16, 2000_u16);
    for number in [low_battery, counts_in_a_turn, watchdog_ms] {
        data.extend_from_slice(&number.to_le_bytes());
    }
    let packets_of_second_kind = 0;
    data.push(packets_of_second_kind);
    // Stall value and count, joystick speeds, speed limits, accelerations and gains; the robot is driven by hand.
    for number in [200_u16, 100, 0, 0, 100, 400, 100, 100, 40, 20, 0, 300, 300, 40, 20, 0] {
        data.extend_from_slice(&number.to_le_bytes());
    }
    // The texts are the simulator's own and short.
    encode_frame(&data).unwrap_or_default()
}
