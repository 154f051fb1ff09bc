//! The address of the live page, printed once and opened in a browser on request.

use messages::{DeploymentStatus, ProcessState};
use settings::{BuiltIn, Settings};
use std::os::unix::process::CommandExt;
use std::process::{Command, Stdio};

/// The page of a run.
pub(crate) struct Page<'a> {
    /// Name of the process that serves it; `None` once the address is printed.
    viewer: Option<&'a str>,
    token: Option<&'a str>,
    open: bool,
}

impl<'a> Page<'a> {
    /// The page of this deployment, if it has one. With `open` a browser shows it.
    pub(crate) fn of(settings: &'a Settings, open: bool) -> Self {
        let viewer = settings.process.iter().find(|process| process.runs(BuiltIn::Viewer));
        Self {
            viewer: viewer.map(|process| process.name.as_str()),
            token: settings.viewer.token.as_ref().map(settings::Token::as_str),
            open,
        }
    }

    /// Prints the address of the page once a status has it.
    pub(crate) fn update(&mut self, status: &DeploymentStatus) {
        let Some(url) = self.url(status) else { return };
        self.viewer = None;
        tracing::info!("live page: {url}");
        if self.open
            && let Err(error) = show(&url)
        {
            tracing::warn!("no browser could be opened with xdg-open: {error}");
        }
    }

    fn url(&self, status: &DeploymentStatus) -> Option<String> {
        let processes = status.processes.iter().take(status.count as usize);
        let mut viewers = processes.filter(|it| self.viewer == Some(it.process.as_str()) && it.state == ProcessState::Running as u32);
        let page = viewers.find_map(|it| it.note.as_str().starts_with("http://").then(|| it.note.to_string()))?;
        Some(self.token.map_or(page.clone(), |token| format!("{page}?token={token}")))
    }
}

/// Opens a browser in a process group of its own, which Ctrl-C of this command does not reach.
fn show(url: &str) -> std::io::Result<()> {
    let null = Stdio::null;
    Command::new("xdg-open").arg(url).stdin(null()).stdout(null()).stderr(null()).process_group(0).spawn().map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{ProcessStatus, Text};

    #[test]
    fn the_address_is_that_of_a_running_viewer_with_its_token() {
        let text = "name = \"x\"\n[[process]]\nname = \"page\"\nrun = \"viewer\"\n[[process]]\nname = \"d\"\ncommand = [\"d\"]\n\
            [viewer]\ntoken = \"0123456789abcdef\"\n";
        let settings = Settings::parse("x.toml", text).unwrap();
        let page = Page::of(&settings, false);
        let mut status = DeploymentStatus { count: 2, ..DeploymentStatus::default() };
        status.processes[0] =
            ProcessStatus { process: Text::new("page"), note: Text::new("http://127.0.0.1:8089/"), ..ProcessStatus::default() };
        assert_eq!(page.url(&status), None, "it does not run yet");
        status.processes[0].state = ProcessState::Running as u32;
        assert_eq!(page.url(&status).as_deref(), Some("http://127.0.0.1:8089/?token=0123456789abcdef"));
        status.processes[0].note = Text::new("no page: every port is taken");
        assert_eq!(page.url(&status), None);
    }
}
