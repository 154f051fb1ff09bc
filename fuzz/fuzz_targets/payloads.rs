//! Messages of any content in any order: the services accept those that pass validation, and their outputs are valid.
#![no_main]

mod common;

use libfuzzer_sys::fuzz_target;
use messages::{
    Blob, CameraMotion, FilterVerdict, Layer, Mover, OutlookScan, Payload, SonarMotion, SonarScan, UpdateRegion, VerdictOutlook,
};

/// One message of the input: its type, its distance from the previous one in number and time, which of its changes are four bytes
/// instead of eight, and three changes of an offset and bytes.
const MESSAGE: usize = 4 + 3 * CHANGE;
const CHANGE: usize = 9;
/// Limit of messages per input.
const MOST: usize = 100;

/// A valid payload with changed bytes, if it passes validation.
fn changed<T: Payload>(mut payload: T, short: u8, changes: &[u8]) -> Option<T> {
    let bytes = bytemuck::bytes_of_mut(&mut payload);
    for (number, [place, value @ ..]) in changes.as_chunks::<CHANGE>().0.iter().enumerate() {
        let at = usize::from(*place) * 8;
        let (from, to) = match short >> (2 * number) & 3 {
            0 | 1 => (at, at + 8),
            2 => (at, at + 4),
            _ => (at + 4, at + 8),
        };
        if let Some(bytes) = bytes.get_mut(from..to) {
            bytes.copy_from_slice(&value[..to - from]);
        }
    }
    payload.validate().is_ok().then_some(payload)
}

fn sonar_motion() -> SonarMotion {
    let mut motion = SonarMotion { count: 1, ..SonarMotion::default() };
    motion.movers[0] = Mover { robot_x_m: 1.0, map_x_m: 1.1, velocity_x_m_s: 0.5, cells: 3, readings: 1, track: 1, ..Mover::default() };
    motion
}

fn camera_motion() -> CameraMotion {
    let transform = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let mut motion = CameraMotion { transform, inliers: 0.9, width: 160, height: 120, count: 1, ..CameraMotion::default() };
    motion.blobs[0] =
        Blob { u_px: 80.0, v_px: 60.0, size_px: 900, left_px: 65, top_px: 30, right_px: 95, bottom_px: 110, ..Blob::default() };
    motion
}

fn verdict() -> FilterVerdict {
    let mut verdict = FilterVerdict { count: 1, withheld: 1, inputs: 3, ..FilterVerdict::default() };
    verdict.regions[0] = UpdateRegion { x_m: 1.0, y_m: 0.2, cells: 9.0 };
    verdict
}

fn outlook(seq: u64) -> VerdictOutlook {
    let mut outlook = VerdictOutlook { count: 1, ..VerdictOutlook::default() };
    outlook.scans[0] = OutlookScan { seq, withheld: 1, reserved: 0 };
    outlook
}

fuzz_target!(|bytes: &[u8]| {
    let (mut mapper, mut std, mut fti) = common::services();
    let scans = common::scans();
    let (mut seq, mut stamp_ns) = (0_u64, 0_u64);
    let mut verdicts = Vec::new();
    for ([kind, number, time, short, changes @ ..], scan) in bytes.as_chunks::<MESSAGE>().0.iter().zip(scans.iter().cycle()).take(MOST) {
        // Numbers and stamps increase by 1 and 0.1 s, jump, or repeat.
        seq = seq.saturating_add(if number & 0x80 == 0 { u64::from(number % 3) } else { 1_u64 << (number % 64) });
        stamp_ns = stamp_ns.saturating_add(if time & 0x80 == 0 { u64::from(time % 64) * 10_000_000 } else { 1_u64 << (time % 64) });
        match kind % 6 {
            0 | 1 => {
                let Some(scan) = changed::<SonarScan>(*scan, *short, changes) else { continue };
                if mapper.step(mapping::Input::Scan { seq, stamp_ns, scan: &scan }).is_ok() {
                    let motion = std.step(stamp_ns, &scan);
                    motion.validate().unwrap();
                    fti.take(fti::Input::Scan { seq, stamp_ns, scan: &scan });
                    if kind % 6 == 0 {
                        fti.take(fti::Input::Sonar { seq, motion: &motion });
                    }
                }
            }
            2 => {
                let Some(motion) = changed(sonar_motion(), *short, changes) else { continue };
                fti.take(fti::Input::Sonar { seq, motion: &motion });
            }
            3 => {
                let Some(motion) = changed(camera_motion(), *short, changes) else { continue };
                fti.take(fti::Input::Camera { stamp_ns, motion: &motion });
            }
            4 => {
                let Some(verdict) = changed(verdict(), *short, changes) else { continue };
                let _ = mapper.step(mapping::Input::Verdict { seq, verdict: &verdict });
            }
            _ => {
                let Some(outlook) = changed(outlook(seq), *short, changes) else { continue };
                let _ = mapper.step(mapping::Input::Outlook(&outlook));
            }
        }
        while fti.advance(&mut verdicts) {}
        fti.walkers().validate().unwrap();
        fti.outlook().validate().unwrap();
        for given in verdicts.drain(..) {
            given.verdict.validate().unwrap();
            let _ = mapper.step(mapping::Input::Verdict { seq: given.seq, verdict: &given.verdict });
        }
    }
    let _ = mapper.step(mapping::Input::End);
    mapper.refresh();
    assert!(mapper.shown_tiles(Layer::Filtered).all(|tile| tile.validate().is_ok()));
    mapper.summary().validate().unwrap();
});
