//! Files that are part of the command, so that the one file of it is enough for a demo.

/// Settings of the demo.
pub(crate) const DEMO: &str = include_str!("../config/demo.toml");
/// The world of the demo.
pub(crate) const HALL: &str = include_str!("../config/worlds/hall.toml");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_files_are_valid() {
        settings::Settings::parse("demo.toml", DEMO).unwrap();
        world_file::parse("hall.toml", HALL).unwrap();
    }
}
