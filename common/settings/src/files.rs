//! Settings from files and back.

use std::path::{Path, PathBuf, absolute};

use document::{DocumentError, parse_checked, read_text};

use crate::effect;
use crate::{Port, Program, Settings};

impl Settings {
    /// Reads the file of a deployment. Relative paths in it are relative to its folder and become absolute.
    ///
    /// # Errors
    /// The first problem of the file, in one line with file, line, key, value and what was expected.
    pub fn read(path: &Path) -> Result<Self, DocumentError> {
        Self::read_by(path, Self::parse)
    }

    /// Reads the file of settings that a supervisor hands to its processes, in which keys without effect are accepted.
    ///
    /// # Errors
    /// As [`Settings::read`], but for those keys. An unknown key is refused: supervisor and process are of one version.
    pub fn read_handed(path: &Path) -> Result<Self, DocumentError> {
        Self::read_by(path, |file, text| parse_checked(file, text, Self::check))
    }

    fn read_by(path: &Path, parse: impl Fn(&str, &str) -> Result<Self, DocumentError>) -> Result<Self, DocumentError> {
        let mut settings = parse(&path.display().to_string(), &read_text(path)?)?;
        let file = absolute(path).map_err(|source| DocumentError::unreadable(path, source))?;
        if let Some(folder) = file.parent() {
            settings.resolve(folder);
        }
        Ok(settings)
    }

    /// Reads settings from text; paths stay as they are written. `file` is what errors call the text.
    ///
    /// # Errors
    /// As [`Settings::read`]. A key that has no effect in this deployment is refused, too.
    pub fn parse(file: &str, text: &str) -> Result<Self, DocumentError> {
        parse_checked(file, text, |settings: &Self| {
            settings.check()?;
            effect::check(settings, text)
        })
    }

    /// Reads settings that a program wrote: those of a log, perhaps of another version, or those that a supervisor hands to its
    /// processes. Unknown keys are left out and named; keys without effect are accepted.
    ///
    /// # Errors
    /// As [`Settings::read`], but for those keys.
    pub fn parse_recorded(file: &str, text: &str) -> Result<(Self, Vec<String>), DocumentError> {
        let mut left_out = Vec::new();
        let mut text = text.to_owned();
        loop {
            match parse_checked(file, &text, Self::check) {
                Ok(settings) => return Ok((settings, left_out)),
                Err(DocumentError::UnknownKey { file, line, key, known }) => match effect::without(&text, &key) {
                    Some(shorter) => {
                        left_out.push(key);
                        text = shorter;
                    }
                    None => return Err(DocumentError::UnknownKey { file, line, key, known }),
                },
                Err(error) => return Err(error),
            }
        }
    }

    /// The settings as TOML, without the keys that have their defaults: [`Settings::parse_recorded`] gives an equal value, wherever
    /// the text lies once paths are absolute.
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
        let table = |settings: &Self| toml::Table::try_from(settings).map_err(|error| DocumentError::Unwritable { key: error.to_string() });
        let mut set = table(self)?;
        let (name, process) = (set.get("name").cloned(), set.get("process").cloned());
        effect::remove_equal(&mut set, &table(&Self::default())?);
        set.extend([("name", name), ("process", process)].into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?))));
        toml::to_string(&set).map_err(|error| DocumentError::Unwritable { key: error.to_string() })
    }

    fn paths(&self) -> impl Iterator<Item = (&'static str, &Path)> {
        let port = match &self.pioneer.port {
            Port::Device(device) => Some(("pioneer.port", device.as_path())),
            Port::Simulator | Port::Network(_) => None,
        };
        let link = self.simulator.link.as_deref().map(|link| ("simulator.link", link));
        let share = self.pioneer.share.as_deref().map(|share| ("pioneer.share", share));
        let files = [
            ("out", self.out.as_path()),
            ("simulator.world", &self.simulator.world),
            ("playback.log", &self.playback.log),
            ("camera.device", &self.camera.device),
        ];
        files.into_iter().chain(port).chain(link).chain(share)
    }

    fn resolve(&mut self, folder: &Path) {
        let join = |path: &mut PathBuf| *path = folder.join(&path);
        join(&mut self.out);
        join(&mut self.simulator.world);
        join(&mut self.playback.log);
        join(&mut self.camera.device);
        if let Port::Device(device) = &mut self.pioneer.port {
            join(device);
        }
        self.simulator.link.iter_mut().chain(&mut self.pioneer.share).for_each(join);
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
