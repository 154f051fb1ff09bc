//! `stillmap pioneer probe`: identifies a robot at a serial port.

use crate::exit::BadInput;
use crate::output;
use clap::Subcommand;
use pioneer::{Answer, Parameters};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

#[derive(Debug, Subcommand)]
pub(crate) enum PioneerCommand {
    /// Connects to a robot and prints its name, model, baud rate and firing sonars. The robot does not move
    Probe {
        /// Serial port, such as /dev/ttyUSB0
        #[arg(value_name = "PORT")]
        port: PathBuf,
    },
}

/// Carries out the command.
pub(crate) fn pioneer(command: &PioneerCommand) -> anyhow::Result<()> {
    let PioneerCommand::Probe { port } = command;
    let answer = pioneer::probe(port, &Parameters::default()).map_err(|error| BadInput(error.to_string()))?;
    output::write(&describe(port, &answer))?;
    Ok(())
}

/// The answer as text.
fn describe(port: &Path, answer: &Answer) -> String {
    let Answer { identity, model, baud, sonars, fired, packets, damaged, note } = answer;
    let model = match model {
        Some(model) => format!("robot.model = {:?}", model.name),
        None => "of a model that stillmap does not know: distances and ranges would be wrong".to_owned(),
    };
    format!(
        "{}: {:?}, a {} {}, at {baud} baud\n  {model}\n  {}\n  {packets} status packets, {damaged} damaged; {note}\n",
        port.display(),
        identity.name,
        identity.class,
        identity.subclass,
        describe_sonars(*sonars, fired)
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
    fn silent_sonars_are_marked() {
        assert_eq!(describe_sonars(7, &(0..7).collect()), "all 7 sonars fire");
        assert_eq!(describe_sonars(7, &BTreeSet::new()), "none of its 7 sonars fires");
        assert_eq!(describe_sonars(4, &[0, 2, 3].into()), "sonars that fire: 0, 2, 3; SILENT: 1");
    }
}
