//! World files that are wrong: one clear line each, and never a panic.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

const ROBOT: &str = "robot = { start_m = [0, 0], way = [{ to_m = [1, 0] }] }";

#[track_caller]
fn check(text: &str, expect: &str) {
    match world_file::parse("world.toml", text) {
        Ok(_) => panic!("accepted, expected: {expect}"),
        Err(error) => assert_eq!(error.to_string(), expect),
    }
}

#[test]
fn each_error_says_where_what_and_what_was_expected() {
    check("", "world.toml:1: robot: missing, expected this key");
    check(
        &format!("{ROBOT}\nwals = 3"),
        "world.toml:2: wals: unknown key, expected one of wall, walker, box, robot, sonar, pillar, surfaces, odometry",
    );
    check("[robot]\nstart_m = [0, 0]\nway = []\nspeed_m_s = 9", "world.toml:4: robot.speed_m_s = 9: expected 0.01 to 2 m/s");
    check("[robot]\nstart_m = [0, 0, 0]\nway = []", "world.toml:2: robot.start_m = [0, 0, 0]: expected a list of 2");
    check(&format!("{ROBOT}\n[sonar]\nhalf_beam_deg = 'wide'"), "world.toml:3: sonar.half_beam_deg = 'wide': expected a finite number");
    check(
        &format!("{ROBOT}\n[[wall]]\nalong_m = [[0, 5], [4, 5]]\nsurface = 'soft'"),
        "world.toml:4: wall[0].surface = 'soft': expected \"smooth\" or \"rough\"",
    );
    check(
        &format!("{ROBOT}\n[[wall]]\nalong_m = [[0, 5], [4, 5]]\ndoor = [{{ at_m = 4, width_m = 1 }}]"),
        "world.toml:2: wall[0]: the door at_m = 4, 1 m wide, is not within one straight piece of the wall, which is 4.000 m long",
    );
}

#[test]
fn a_way_through_things_is_refused() {
    let expected = "world.toml:1: robot.way[0].to_m = [1, 0]: expected a place that the robot reaches without driving through things";
    check(&format!("{ROBOT}\nwall = [{{ along_m = [[0.5, -1], [0.5, 1]] }}]"), expected);
    check(&format!("{ROBOT}\npillar = [{{ centre_m = [0.5, 0.2], radius_m = 0.25 }}]"), expected);
    world_file::parse("world.toml", &format!("{ROBOT}\nwall = [{{ along_m = [[0.5, 0.1], [0.5, 1]] }}]")).unwrap();
}

#[test]
fn worlds_too_large_are_refused() {
    let walkers: String = (0..17).map(|_| "[[walker]]\nfrom_m = [0, 0]\nway = []\n").collect();
    check(&format!("{ROBOT}\n{walkers}"), "world.toml:2: walker: expected at most 16 walkers, found 17");
    let pillars: String = (0..129).map(|x| format!("[[pillar]]\ncentre_m = [{x}, 9]\nradius_m = 0.2\n")).collect();
    check(&format!("{ROBOT}\n{pillars}"), "world.toml:1: wall: expected a world of at most 2048 pieces of surface, found 2064");
}

#[test]
fn damaged_files_give_one_line_and_never_a_panic() {
    let path = format!("{}/../../config/worlds/corridor.toml", env!("CARGO_MANIFEST_DIR"));
    let entire = std::fs::read(path).unwrap();
    let mut refused = 0;
    let mut read = |bytes: &[u8]| {
        let Ok(text) = std::str::from_utf8(bytes) else { return };
        if let Err(error) = world_file::parse("world.toml", text) {
            let line = error.to_string();
            assert!(line.starts_with("world.toml:") && !line.contains('\n'), "{line}");
            refused += 1;
        }
    };
    for length in 0..entire.len() {
        read(&entire[..length]);
    }
    for bit in (0..entire.len() * 8).step_by(3) {
        let mut damaged = entire.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        read(&damaged);
    }
    assert!(refused > entire.len() / 2, "{refused} refused of {} lengths and as many bit flips", entire.len());
}
