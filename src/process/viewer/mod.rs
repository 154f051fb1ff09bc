//! The viewer as a process: from the bus to browsers.

mod inputs;

use ::viewer::access::Access;
use ::viewer::foxglove::{Feed, Port};
use ::viewer::{Board, Deployment, LISTEN_RETRY, Scene, Server, Status, Topic};
use anyhow::Result;
use bus::{BusError, Writer};
use inputs::{Inputs, Taken};
use messages::{CameraFrame, CameraMask, DeploymentStatus, PlaybackControl, ProcessStatus};
use runtime::{Context, Next, Shell, StepError};
use settings::{BuiltIn, Settings};
use std::os::fd::BorrowedFd;
use std::time::{Duration, Instant};

/// Time between two frames: 20 a second are enough for the eye.
const FRAME: Duration = Duration::from_millis(50);
/// Time between two pictures of the camera: 12 a second.
const PICTURE: Duration = Duration::from_millis(80);
/// How long browsers may take for the last frame.
const FAREWELL: Duration = Duration::from_secs(1);

/// Shows the deployment until its run has ended.
///
/// # Errors
/// When the bus fails. A port that cannot be had is no failure: the run goes on without the page, and the status says so.
pub(super) fn run(mut shell: Shell, settings: &Settings) -> Result<()> {
    let now = Instant::now();
    let of = &settings.viewer;
    let access = Access::new(of.address.get(), of.token.as_ref().map(settings::Token::as_str));
    let feed = Feed::new(settings.name.as_str(), shell.membership().run(), access.clone(), now);
    let obeys = settings.runs(BuiltIn::Playback);
    let mut board = Board::default();
    let deployment = deployment(settings);
    board.put_json(Topic::Deployment, &deployment);
    let others = settings.process.iter().filter(|process| !process.runs(BuiltIn::Viewer) && !process.runs(BuiltIn::Recorder));
    let mut viewer = Viewer {
        inputs: Inputs::open(&mut shell)?,
        control: if obeys { Some(shell.writer()?) } else { None },
        commands: 0,
        scene: Scene::new(settings.mapping.cell_m.get(), playback(settings)),
        board,
        deployment,
        server: Server::new(of.address.get(), of.port.get() as u16, access, obeys),
        foxglove: Port::new(of.address.get(), of.foxglove_port.get() as u16, feed),
        framed: now,
        pictured: now,
        masked: now,
        scene_is_news: false,
        others: others.map(|process| process.name.as_str().to_owned()).collect(),
        over_since: None,
    };
    Ok(shell.run(&mut viewer)?)
}

/// Name of the process that plays a log.
fn playback(settings: &Settings) -> Option<&str> {
    settings.process.iter().find(|process| process.runs(BuiltIn::Playback)).map(|process| process.name.as_str())
}

/// What the page is told; the port for Foxglove is not open yet.
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
    framed: Instant,
    pictured: Instant,
    masked: Instant,
    scene_is_news: bool,
    /// Whose end ends the page.
    others: Vec<String>,
    over_since: Option<Instant>,
}

impl runtime::Process for Viewer {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        let now = Instant::now();
        self.open(now);
        let taken = self.inputs.take(&mut self.board, &mut self.scene, &mut self.foxglove.feed)?;
        self.note_news(&taken, now);
        self.take_pictures(now)?;
        self.obey(context, now)?;
        self.foxglove.advance(now);
        let next = self.show(now);
        self.foxglove.feed.flush(now);
        self.report(context);
        if context.stopping() || self.is_done(now) {
            self.server.bid_farewell();
            self.foxglove.feed.bid_farewell(now);
            return Ok(Next::Finished);
        }
        Ok(if taken.more { Next::Again } else { next })
    }

    fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        self.server.descriptors().chain(self.foxglove.descriptors()).collect()
    }
}

impl Viewer {
    /// Opens the page and the port for Foxglove, which the page names.
    fn open(&mut self, now: Instant) {
        self.server.listener.open(now);
        if self.foxglove.listener.open(now) {
            self.deployment.foxglove_port = self.foxglove.listener.address().map(|address| address.port());
            self.board.put_json(Topic::Deployment, &self.deployment);
        }
    }

    fn take_pictures(&mut self, now: Instant) -> Result<(), BusError> {
        let feed = &self.foxglove.feed;
        let somebody_looks = self.server.watching() > 0 || feed.wants::<CameraFrame>() || feed.wants::<CameraMask>();
        let is_wanted = |last: Instant| somebody_looks && now.saturating_duration_since(last) >= PICTURE;
        if self.inputs.take_picture(&mut self.board, &mut self.foxglove.feed, is_wanted(self.pictured))? {
            self.pictured = now;
        }
        if self.inputs.take_mask(&mut self.board, &mut self.foxglove.feed, is_wanted(self.masked))? {
            self.masked = now;
        }
        Ok(())
    }

    fn note_news(&mut self, taken: &Taken, now: Instant) {
        self.scene_is_news |= taken.scene;
        if let Some(status) = &taken.status {
            self.board.put_json(Topic::Status, &Status::from(status));
            if self.over_since.is_none() && self.others_are_over(status) {
                self.over_since = Some(now);
            }
        }
    }

    /// Whether the run ends and everybody is over who has something to show.
    fn others_are_over(&self, status: &DeploymentStatus) -> bool {
        let mut others = status.processes().iter().filter(|it| self.others.iter().any(|name| name == it.process.as_str()));
        status.ending == 1 && others.all(ProcessStatus::is_over)
    }

    /// Hands on to playback what browsers ask for.
    fn obey(&mut self, context: &Context<'_>, now: Instant) -> Result<(), BusError> {
        let commands = self.server.advance(now);
        // Of several browsers that want something, the last one has it.
        let Some((control, command)) = self.control.as_mut().zip(commands.last()) else { return Ok(()) };
        self.commands += 1;
        control.send_with(self.commands, context.now_ns(), |control| {
            control.speed = command.times.clamp(PlaybackControl::SLOWEST, PlaybackControl::FASTEST);
            control.paused = u32::from(command.paused);
        })
    }

    /// Sends a frame when it is time for one; when to look again.
    fn show(&mut self, now: Instant) -> Next {
        if self.server.watching() == 0 && !self.foxglove.feed.wants_scene() {
            let is_writing = self.server.is_writing() || self.foxglove.feed.is_writing();
            let are_open = self.server.listener.address().is_some() && self.foxglove.listener.address().is_some();
            return match (is_writing, are_open) {
                (true, _) => Next::WaitAtMost(FRAME),
                (false, false) => Next::WaitAtMost(LISTEN_RETRY),
                (false, true) => Next::Wait,
            };
        }
        let until_next = FRAME.saturating_sub(now.saturating_duration_since(self.framed));
        if !until_next.is_zero() {
            return Next::WaitAtMost(until_next);
        }
        self.framed = now;
        if std::mem::take(&mut self.scene_is_news) {
            let scene = self.scene.view();
            self.board.put_json(Topic::Scene, &scene);
            self.foxglove.feed.scene(&scene);
        }
        self.server.offer(&self.board, now);
        // What is left over, or comes to somebody who has just joined, is offered with the next frame.
        Next::WaitAtMost(FRAME)
    }

    /// Whether the run has ended and everybody has been sent the end of it, or had the time to take it.
    fn is_done(&self, now: Instant) -> bool {
        let Some(since) = self.over_since else { return false };
        let somebody_waits = self.server.is_behind(&self.board) || self.foxglove.feed.is_writing();
        !somebody_waits || now.saturating_duration_since(since) >= FAREWELL
    }

    fn report(&self, context: &mut Context<'_>) {
        let (served, sent) = (self.server.served, self.foxglove.feed.sent());
        context.count("browsers", self.server.watching() as u64);
        context.count("tiles", self.board.tiles() as u64);
        context.count("frames sent", served.frames);
        context.count("frames dropped", served.missed);
        context.count("bytes sent", served.bytes);
        context.count("foxglove clients", self.foxglove.feed.clients() as u64);
        context.count("foxglove messages sent", sent.messages);
        context.count("foxglove messages dropped", sent.dropped);
        context.count("connections refused", served.turned_away + sent.turned_away);
        match self.server.listener.address() {
            Some(address) => context.note(&format!("http://{address}/")),
            None => context.note(self.server.listener.trouble()),
        }
    }
}
