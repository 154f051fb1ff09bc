//! The worlds of `config/worlds`, to drive through or to change.

use std::path::PathBuf;

use toml::{Table, Value};

use super::Sandbox;

/// The file of a world.
pub(crate) fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("config/worlds/{name}.toml"))
}

/// Its contents.
pub(crate) fn read(name: &str) -> Table {
    toml::from_str(&std::fs::read_to_string(path(name)).unwrap()).unwrap()
}

/// The legs of the robot's path.
pub(crate) fn legs(world: &mut Table) -> &mut Vec<Value> {
    world["robot"]["way"].as_array_mut().unwrap()
}

pub(crate) fn write(sandbox: &Sandbox, world: &Table) -> PathBuf {
    sandbox.write("world.toml", &toml::to_string(world).unwrap())
}
