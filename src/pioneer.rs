//! `stillmap pioneer probe`: identifies a robot at a serial port.

use crate::exit::BadInput;
use crate::output;
use crate::process;
use clap::Subcommand;
use pioneer::{Address, Answer, Parameters};
use psos::Model;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

#[derive(Debug, Subcommand)]
pub(crate) enum PioneerCommand {
    /// Connects to a robot and prints its name, model, baud rate and firing sonars. The robot does not move
    Probe {
        /// Serial port, such as /dev/ttyUSB0, or tcp://HOST:PORT for a robot simulator or a serial bridge
        #[arg(value_name = "PORT")]
        port: PathBuf,
    },
}

/// Carries out the command.
pub(crate) fn pioneer(command: &PioneerCommand) -> anyhow::Result<()> {
    let PioneerCommand::Probe { port } = command;
    let address = address(port)?;
    let mut parameters = Parameters::default();
    if !address.has_speed() {
        parameters.bauds.clear();
    }
    let answer = pioneer::probe(&address, &parameters).map_err(|error| BadInput(error.to_string()))?;
    output::write(&describe(&address, &answer))?;
    Ok(())
}

/// The port of the command line.
fn address(port: &Path) -> Result<Address, BadInput> {
    let read = settings::Port::try_from(port.to_owned()).map_err(|error| BadInput(format!("{}: {error}", port.display())))?;
    // `simulator` is a file's name here.
    Ok(process::pioneer::address(&read).unwrap_or_else(|| Address::Device(port.to_owned())))
}

/// The answer as text.
fn describe(port: &Address, answer: &Answer) -> String {
    let Answer { identity, model, baud, sonars, fired, packets, damaged, note } = answer;
    let model = match model {
        Some(model) => format!("robot.model = {:?}", model.name),
        None => describe_unknown(Parameters::default().model),
    };
    format!(
        "{port}: {:?}, a {} {}{}\n  {model}\n  {}\n  {packets} status packets, {damaged} damaged; {note}\n",
        identity.name,
        identity.class,
        identity.subclass,
        if *baud == 0 { String::new() } else { format!(", at {baud} baud") },
        describe_sonars(*sonars, fired)
    )
}

/// The settings of a robot of an unknown type, with the factors of a known one in their places.
fn describe_unknown(nearest: &Model) -> String {
    let Model { name, distance_mm, range_mm, heading_units, .. } = nearest;
    format!(
        "its type is unknown. Its manual has the numbers that belong here instead of those of the {name}:\n\
         \x20   [robot]\n\
         \x20   model = {name:?}\n\
         \x20   distance_unit_mm = {distance_mm}\n\
         \x20   range_unit_mm = {range_mm}\n\
         \x20   heading_units = {heading_units}"
    )
}

fn describe_sonars(sonars: usize, fired: &BTreeSet<u32>) -> String {
    let names = |numbers: &mut dyn Iterator<Item = u32>| numbers.map(|number| number.to_string()).collect::<Vec<_>>().join(", ");
    let mut silent = (0..sonars as u32).filter(|number| !fired.contains(number)).peekable();
    match (fired.len(), silent.peek()) {
        (0, _) => format!("none of its {sonars} sonars fires"),
        (_, None) => format!("all {sonars} sonars fire"),
        _ => format!("sonars that fire: {}; SILENT: {}", names(&mut fired.iter().copied()), names(&mut silent)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_settings_of_an_unknown_robot_can_be_pasted() {
        let described = describe_unknown(Parameters::default().model);
        let (_, pasted) = described.split_once('\n').unwrap();
        let text = format!("name = \"x\"\nprocess = [{{ name = \"p\", run = \"pioneer\" }}]\n{pasted}");
        let settings = settings::Settings::parse("x.toml", &text).unwrap();
        assert_eq!(settings.robot.distance_unit_mm.map(|unit| unit.get()), Some(0.05066));
        assert_eq!(settings.robot.range_unit_mm.map(|unit| unit.get()), Some(0.1734));
        assert_eq!(settings.robot.heading_units.map(|units| units.get()), Some(1024));
    }

    #[test]
    fn silent_sonars_are_marked() {
        assert_eq!(describe_sonars(7, &(0..7).collect()), "all 7 sonars fire");
        assert_eq!(describe_sonars(7, &BTreeSet::new()), "none of its 7 sonars fires");
        assert_eq!(describe_sonars(4, &[0, 2, 3].into()), "sonars that fire: 0, 2, 3; SILENT: 1");
    }
}
