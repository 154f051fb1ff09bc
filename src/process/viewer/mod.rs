//! The process `viewer`: from the bus to browsers and Foxglove.

mod inputs;

use ::viewer::access::Access;
use ::viewer::foxglove::{Feed, Port};
use ::viewer::{Board, Deployment, LISTEN_RETRY, Scene, Server, Topic};
use anyhow::Result;
use bus::{BusError, Writer};
use inputs::{Inputs, Screens, Taken};
use messages::{DeploymentStatus, PlaybackControl, ProcessStatus};
use runtime::{Context, Next, Shell, StepError};
use settings::{BuiltIn, Settings};
use std::os::fd::BorrowedFd;
use std::time::{Duration, Instant};

/// Time between two updates of the page: 20 a second look continuous.
const UPDATE_PERIOD: Duration = Duration::from_millis(50);
/// Longest time in which browsers receive the last update.
const LAST_UPDATE: Duration = Duration::from_secs(1);

/// Shows the deployment until every other process of the run is over.
///
/// # Errors
/// When the bus fails. Without a free port the process runs without the page and reports that in its status.
pub(super) fn run(mut shell: Shell, settings: &Settings) -> Result<()> {
    let now = Instant::now();
    let of = &settings.viewer;
    let access = Access::new(of.address.get(), of.token.as_ref().map(settings::Token::as_str));
    let feed = Feed::new(settings.name.as_str(), shell.membership().run(), access.clone(), now);
    let is_replay = settings.runs(BuiltIn::Playback);
    let mut board = Board::default();
    let deployment = deployment(settings);
    board.put_json(Topic::Deployment, &deployment);
    let others = settings.process.iter().filter(|process| !process.runs(BuiltIn::Viewer) && !process.runs(BuiltIn::Recorder));
    let mut viewer = Viewer {
        inputs: Inputs::open(&mut shell, now)?,
        control: if is_replay { Some(shell.writer()?) } else { None },
        commands: 0,
        scene: Scene::new(settings.mapping.cell_m.get(), playback(settings)),
        board,
        deployment,
        server: Server::new(of.address.get(), of.port.get() as u16, access, is_replay),
        foxglove: Port::new(of.address.get(), of.foxglove_port.get() as u16, feed),
        updated_at: now,
        scene_changed: false,
        others: others.map(|process| process.name.as_str().to_owned()).collect(),
        over_since: None,
    };
    Ok(shell.run(&mut viewer)?)
}

/// Name of the playback process.
fn playback(settings: &Settings) -> Option<&str> {
    settings.process.iter().find(|process| process.runs(BuiltIn::Playback)).map(|process| process.name.as_str())
}

/// The deployment as the page receives it before the port for Foxglove is open.
fn deployment(settings: &Settings) -> Deployment {
    Deployment {
        name: settings.name.as_str().to_owned(),
        cell_m: settings.mapping.cell_m.get(),
        half_beam_rad: settings.mapping.half_beam_deg.get().to_radians(),
        has_unfiltered: settings.mapping.keep_unfiltered,
        is_simulated: settings.runs(BuiltIn::Simulator),
        playback: playback(settings).is_some(),
        has_pace: settings.pace == settings::Pace::Live,
        foxglove_port: None,
    }
}

struct Viewer {
    inputs: Inputs,
    control: Option<Writer<PlaybackControl>>,
    commands: u64,
    scene: Scene,
    board: Board,
    deployment: Deployment,
    server: Server,
    foxglove: Port,
    /// Time of the last update of the page.
    updated_at: Instant,
    /// The scene has changed since the last update.
    scene_changed: bool,
    /// Processes whose end ends the page.
    others: Vec<String>,
    over_since: Option<Instant>,
}

impl runtime::Process for Viewer {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        let now = Instant::now();
        self.open(now);
        let is_watched = self.server.watching() > 0;
        let (board, scene, feed) = (&mut self.board, &mut self.scene, &mut self.foxglove.feed);
        let taken = self.inputs.take(&mut Screens { board, scene, feed, is_watched, now })?;
        self.note(&taken, now);
        self.forward_commands(context, now)?;
        self.foxglove.advance(now);
        let next = self.show(now);
        self.foxglove.feed.flush(now);
        self.report(context);
        if context.stopping() || self.is_done(now) {
            self.server.close();
            self.foxglove.feed.close(now);
            return Ok(Next::Finished);
        }
        Ok(if taken.more { Next::Again } else { next })
    }

    fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        self.server.descriptors().chain(self.foxglove.descriptors()).collect()
    }
}

impl Viewer {
    /// Opens the page and the port for Foxglove, whose number the page shows.
    fn open(&mut self, now: Instant) {
        self.server.listener.open(now);
        if self.foxglove.listener.open(now) {
            self.deployment.foxglove_port = self.foxglove.listener.address().map(|address| address.port());
            self.board.put_json(Topic::Deployment, &self.deployment);
        }
    }

    fn note(&mut self, taken: &Taken, now: Instant) {
        self.scene_changed |= taken.scene;
        if let Some(status) = &taken.status {
            self.server.metrics = Some(::viewer::metrics(status));
        }
        if self.over_since.is_none() && taken.status.is_some_and(|status| self.others_are_over(&status)) {
            self.over_since = Some(now);
        }
    }

    /// Whether the run ends and every process with something to show is over.
    fn others_are_over(&self, status: &DeploymentStatus) -> bool {
        let mut others = status.processes().iter().filter(|it| self.others.iter().any(|name| name == it.process.as_str()));
        status.ending == 1 && others.all(ProcessStatus::is_over)
    }

    /// Forwards the commands of browsers to playback.
    fn forward_commands(&mut self, context: &Context<'_>, now: Instant) -> Result<(), BusError> {
        let commands = self.server.advance(now);
        // The last command wins.
        let Some((control, command)) = self.control.as_mut().zip(commands.last()) else { return Ok(()) };
        self.commands += 1;
        control.send_with(self.commands, context.now_ns(), |control| {
            control.speed = command.times.clamp(PlaybackControl::SLOWEST, PlaybackControl::FASTEST);
            control.paused = u32::from(command.paused);
        })
    }

    /// Updates the page when that is due. Returns when to step again.
    fn show(&mut self, now: Instant) -> Next {
        if self.server.watching() == 0 && !self.foxglove.feed.wants_scene() {
            let is_writing = self.server.is_writing() || self.foxglove.feed.is_writing();
            let are_open = self.server.listener.address().is_some() && self.foxglove.listener.address().is_some();
            return match (is_writing, are_open) {
                (true, _) => Next::WaitAtMost(UPDATE_PERIOD),
                (false, false) => Next::WaitAtMost(LISTEN_RETRY),
                (false, true) => Next::Wait,
            };
        }
        let until_next = UPDATE_PERIOD.saturating_sub(now.saturating_duration_since(self.updated_at));
        if !until_next.is_zero() {
            return Next::WaitAtMost(until_next);
        }
        self.updated_at = now;
        if std::mem::take(&mut self.scene_changed) {
            let scene = self.scene.view();
            self.board.put_json(Topic::Scene, &scene);
            self.foxglove.feed.scene(&scene);
        }
        self.server.offer(&self.board, now);
        // Browsers that have not received everything, and new ones, get the rest with the next update.
        Next::WaitAtMost(UPDATE_PERIOD)
    }

    /// Whether the run has ended and every browser has received its end, or had the time to receive it.
    fn is_done(&self, now: Instant) -> bool {
        let Some(since) = self.over_since else { return false };
        let is_behind = self.server.is_behind(&self.board) || self.foxglove.feed.is_writing();
        !is_behind || now.saturating_duration_since(since) >= LAST_UPDATE
    }

    fn report(&self, context: &mut Context<'_>) {
        let (served, sent) = (self.server.served, self.foxglove.feed.sent());
        context.count("browsers", self.server.watching() as u64);
        context.count("tiles", self.board.tiles() as u64);
        context.count("updates sent", served.updates);
        context.count("updates dropped", served.missed);
        context.count("bytes sent", served.bytes);
        context.count("foxglove clients", self.foxglove.feed.clients() as u64);
        context.count("foxglove messages sent", sent.messages);
        context.count("foxglove messages dropped", sent.dropped);
        context.count("connections refused", served.refused + sent.refused);
        match self.server.listener.address() {
            Some(address) => context.note(&format!("http://{address}/")),
            None => context.note(self.server.listener.problem()),
        }
    }
}
