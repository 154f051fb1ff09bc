//! A world with other walkers: more, fewer, or the same at other times.

use simulator::World;
use toml::{Table, Value};

/// Which walkers a drive meets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variation {
    /// Number of walkers; `None`: those of the file as they are.
    pub walkers: Option<usize>,
    /// Decides when, how fast and how far aside each walks.
    pub seed: u64,
    /// Time that each walker stands at every place of the path but the last, s, or halfway where there is no other; `None`: the times
    /// of the file.
    pub stand_s: Option<f64>,
}

/// A world that cannot be varied.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum VariationError {
    /// The text is no world.
    #[error("the world cannot be read: {0}")]
    World(#[from] toml::de::Error),
    /// There is no walker to copy.
    #[error("the world has no walkers, expected at least one to make {wanted} of")]
    NoWalker {
        /// Walkers wanted.
        wanted: usize,
    },
}

/// Most that a start is later or earlier, s.
const START_S: f64 = 4.0;
/// Most that a speed is higher or lower, as a share.
const SPEED: f64 = 0.2;
/// Most that a way lies aside, m.
const ASIDE_M: f64 = 0.12;
/// The same way is taken again after this time, s.
const AGAIN_S: f64 = 9.0;

/// A world from its text, with these walkers.
///
/// Walkers beyond those of the file take the ways of the file again, later, and every other time from the end to the start.
///
/// # Errors
/// A text that is no world; walkers wanted of a world that has none.
pub fn read_world(text: &str, variation: Variation) -> Result<World, VariationError> {
    let mut table: Table = toml::from_str(text)?;
    if let Some(wanted) = variation.walkers {
        let models: Vec<Table> = match table.remove("walker") {
            Some(Value::Array(walkers)) => walkers.into_iter().filter_map(|walker| walker.try_into().ok()).collect(),
            _ => Vec::new(),
        };
        if models.is_empty() && wanted > 0 {
            return Err(VariationError::NoWalker { wanted });
        }
        let walkers = (0..wanted).filter_map(|number| {
            let model = models.get(number % models.len())?;
            Some(Value::Table(varied(model, number / models.len(), Chance::new(variation.seed, number))))
        });
        table.insert("walker".to_owned(), Value::Array(walkers.collect()));
    }
    if let (Some(stand_s), Some(Value::Array(walkers))) = (variation.stand_s, table.get_mut("walker")) {
        walkers.iter_mut().filter_map(Value::as_table_mut).for_each(|walker| stand(walker, stand_s));
    }
    Ok(Value::Table(table).try_into()?)
}

/// Stops at every goal but the last; one halfway where there is only one.
fn stand(walker: &mut Table, stand_s: f64) {
    let from = walker.get("from_m").and_then(as_place);
    let Some(Value::Array(goals)) = walker.get_mut("way") else { return };
    let only = if let [Value::Table(goal)] = goals.as_slice() { goal.get("to_m").and_then(as_place) } else { None };
    if let (Some(from), Some(to)) = (from, only) {
        let halfway = [0, 1].map(|axis| Value::Float((from[axis] + to[axis]) / 2.0));
        goals.insert(0, Value::Table(Table::from_iter([("to_m".to_owned(), Value::Array(halfway.into()))])));
    }
    let before_last = goals.len().saturating_sub(1);
    for goal in goals.iter_mut().take(before_last).filter_map(Value::as_table_mut) {
        goal.insert("stop_s".to_owned(), Value::Float(stand_s));
    }
}

fn as_place(value: &Value) -> Option<[f64; 2]> {
    let [x, y] = value.as_array()?.as_slice() else { return None };
    Some([as_number(x)?, as_number(y)?])
}

fn varied(model: &Table, round: usize, mut chance: Chance) -> Table {
    let mut walker = if round % 2 == 1 { reversed(model) } else { model.clone() };
    let number = |walker: &Table, key: &str, default: f64| walker.get(key).and_then(as_number).unwrap_or(default);
    let start_s = number(&walker, "start_s", 0.0) + START_S * chance.either_way() + AGAIN_S * round as f64;
    let speed = number(&walker, "speed_m_s", 1.2) * (1.0 + SPEED * chance.either_way());
    let aside = [ASIDE_M * chance.either_way(), ASIDE_M * chance.either_way()];
    walker.insert("start_s".to_owned(), Value::Float(start_s.max(0.0)));
    walker.insert("speed_m_s".to_owned(), Value::Float(speed.clamp(0.05, 3.0)));
    if let Some(from) = walker.get_mut("from_m") {
        shift(from, aside);
    }
    if let Some(Value::Array(goals)) = walker.get_mut("way") {
        goals.iter_mut().filter_map(|goal| goal.get_mut("to_m")).for_each(|place| shift(place, aside));
    }
    walker
}

/// The way from its end to its start; stops stay at their places.
fn reversed(model: &Table) -> Table {
    let mut walker = model.clone();
    let Some(Value::Array(goals)) = model.get("way") else { return walker };
    let mut places: Vec<(Option<Value>, Option<Value>)> = vec![(model.get("from_m").cloned(), None)];
    places.extend(goals.iter().map(|goal| (goal.get("to_m").cloned(), goal.get("stop_s").cloned())));
    places.reverse();
    if let Some((Some(from), _)) = places.first() {
        walker.insert("from_m".to_owned(), from.clone());
    }
    let path = places.iter().skip(1).filter_map(|(place, stop)| {
        let mut goal = Table::new();
        goal.insert("to_m".to_owned(), place.clone()?);
        if let Some(stop) = stop {
            goal.insert("stop_s".to_owned(), stop.clone());
        }
        Some(Value::Table(goal))
    });
    walker.insert("way".to_owned(), Value::Array(path.collect()));
    walker
}

fn shift(place: &mut Value, by: [f64; 2]) {
    if let Value::Array(coordinates) = place {
        for (coordinate, by) in coordinates.iter_mut().zip(by) {
            if let Some(number) = as_number(coordinate) {
                *coordinate = Value::Float(number + by);
            }
        }
    }
}

fn as_number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|number| number as f64))
}

/// Numbers from a seed (SplitMix64).
struct Chance(u64);

impl Chance {
    fn new(seed: u64, walker: usize) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (walker as u64).wrapping_mul(0xd1b5_4a32_d192_ed03))
    }

    /// Between −1 and 1.
    fn either_way(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::float_cmp, reason = "tests fail by panicking, on exact values where these are exact")]
    use super::*;

    const WORLD: &str = "[robot]\nstart_m = [0, 0]\nway = [{ to_m = [5, 0] }]\n[[walker]]\nfrom_m = [1, 1]\nstart_s = 20\nway = [{ to_m = [2, 2], stop_s = 5 }, { to_m = [3, 3] }]\n";

    fn world(walkers: Option<usize>, seed: u64) -> World {
        read_world(WORLD, Variation { walkers, seed, stand_s: None }).unwrap()
    }

    #[test]
    fn walkers_stand_on_their_path_for_the_given_time() {
        let path = |text: &str| {
            let world = read_world(text, Variation { walkers: None, seed: 1, stand_s: Some(30.0) }).unwrap();
            world.walkers[0].path.iter().map(|goal| (goal.to_m.get(), goal.stop_s.get())).collect::<Vec<_>>()
        };
        assert_eq!(path(WORLD), [([2.0, 2.0], 30.0), ([3.0, 3.0], 0.0)]);
        let straight = WORLD.replace("{ to_m = [2, 2], stop_s = 5 }, ", "");
        assert_eq!(path(&straight), [([2.0, 2.0], 30.0), ([3.0, 3.0], 0.0)]);
    }

    #[test]
    fn walkers_are_as_many_as_wanted_and_differ_with_the_seed() {
        assert_eq!(world(None, 1), world(None, 2));
        assert_eq!(world(Some(0), 1).walkers.len(), 0);
        assert_eq!(world(Some(5), 1).walkers.len(), 5);
        assert_eq!(world(Some(5), 1), world(Some(5), 1));
        assert_ne!(world(Some(5), 1), world(Some(5), 2));
        let two = world(Some(2), 1).walkers;
        assert!((two[1].from_m.get()[0] - 3.0).abs() <= ASIDE_M && two[1].path[0].stop_s.get() == 5.0);
    }
}
