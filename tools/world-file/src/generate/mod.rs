//! Random buildings with people, as the text of a world's file.
//!
//! A building is a hall, an office, a corridor, a corridor with a corner or round a block, or a row of rooms. The robot drives 12
//! to 30 m through it. Walkers lead the robot, follow it, cross its path, stand, talk in pairs, and walk in groups. A walker that
//! would touch the robot is given another path.
//!
//! The text is a function of the seed.

mod building;
mod convoy;
mod floor;
mod people;
mod plan;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::parse;

/// Most buildings that are tried for a seed. More than one in two has room for a drive.
const TRIES: u64 = 200;
/// The stream of random numbers for the heights of the walkers.
const HEIGHTS: u64 = 1 << 32;

/// The text of a random world's file.
///
/// ```
/// let text = stillmap_world_file::random_world(1).unwrap();
/// assert!(stillmap_world_file::parse("random.toml", &text).is_ok());
/// ```
///
/// `None` if no building of this seed has room for a drive.
#[must_use]
pub fn random_world(seed: u64) -> Option<String> {
    let name = format!("random world {seed}");
    (0..TRIES).find_map(|round| {
        let mut chance = ChaCha8Rng::seed_from_u64(seed);
        chance.set_stream(round);
        let mut plan = building::build(&mut chance);
        floor::route(&mut plan, &mut chance)?;
        let empty = parse(&name, &plan.text()).ok()?;
        people::people(&mut plan, &empty, &mut chance);
        chance.set_stream(HEIGHTS);
        plan.heights_m = people::heights_m(plan.people.len(), &mut chance);
        let text = plan.text();
        parse(&name, &text).ok().map(|_| format!("# A random building with people, seed {seed}.\n{text}"))
    })
}

#[cfg(test)]
mod tests {
    use simulator::World;

    use super::*;

    #[test]
    fn seeds_give_worlds_that_differ_and_repeat() {
        let texts: Vec<String> = (1..=20).map(|seed| random_world(seed).unwrap()).collect();
        assert!(texts.iter().enumerate().all(|(n, text)| texts[..n].iter().all(|other| other != text)));
        assert_eq!(random_world(7), Some(texts[6].clone()));
        let worlds: Vec<World> = texts.iter().map(|text| parse("random", text).unwrap()).collect();
        assert!(worlds.iter().all(|world| !world.walkers.is_empty() && world.walls.len() + world.boxes.len() > 0));
    }
}
