//! Settings from files and back.

use std::path::{Path, PathBuf, absolute};

use document::{DocumentError, parse_checked, read_text};

use crate::{Port, Program, Settings};

impl Settings {
    /// Reads a deployment's file. Relative paths in it mean its folder and come out absolute.
    ///
    /// # Errors
    /// The first problem of the file, in one line with file, line, key, value and what was expected.
    pub fn read(path: &Path) -> Result<Self, DocumentError> {
        let text = read_text(path)?;
        let mut settings = Self::parse(&path.display().to_string(), &text)?;
        let file = absolute(path).map_err(|source| DocumentError::unreadable(path, source))?;
        if let Some(folder) = file.parent() {
            settings.resolve(folder);
        }
        Ok(settings)
    }

    /// Reads settings from text; paths stay as they are written. `file` is what errors call the text.
    ///
    /// # Errors
    /// As [`Settings::read`].
    pub fn parse(file: &str, text: &str) -> Result<Self, DocumentError> {
        parse_checked(file, text, Self::check)
    }

    /// The settings in effect, defaults included, as TOML: reading it gives an equal value, wherever it lies once paths are absolute.
    ///
    /// # Errors
    /// When a path is not UTF-8.
    pub fn to_toml(&self) -> Result<String, DocumentError> {
        for (key, path) in self.paths() {
            if path.to_str().is_none() {
                return Err(DocumentError::Unwritable { key: key.to_owned() });
            }
        }
        // Every other value is a number, a word or a list of them.
        toml::to_string(self).map_err(|error| DocumentError::Unwritable { key: error.to_string() })
    }

    fn paths(&self) -> impl Iterator<Item = (&'static str, &Path)> {
        let port = match &self.pioneer.port {
            Port::Device(device) => Some(("pioneer.port", device.as_path())),
            Port::Simulator => None,
        };
        [("out", self.out.as_path()), ("simulator.world", &self.simulator.world), ("playback.log", &self.playback.log)]
            .into_iter()
            .chain(port)
    }

    fn resolve(&mut self, folder: &Path) {
        let join = |path: &mut PathBuf| *path = folder.join(&path);
        join(&mut self.out);
        join(&mut self.simulator.world);
        join(&mut self.playback.log);
        if let Port::Device(device) = &mut self.pioneer.port {
            join(device);
        }
        for process in &mut self.process {
            // A bare word is looked up in PATH.
            if let Program::Command(command) = &mut process.program
                && let Some(program) = command.first_mut()
                && program.contains('/')
                && let Some(joined) = folder.join(&*program).to_str()
            {
                *program = joined.to_owned();
            }
        }
    }
}
