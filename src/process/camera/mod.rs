//! The driver as a process: a session between a camera and the bus.

mod silences;

use std::os::fd::{AsFd, BorrowedFd};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use ::camera::{Camera, CameraConfig, Coding, Damage, Event, FixedControls, Given, Input, Limits, Output, Session, Trouble, monotonic_ns};
use anyhow::Result;
use bus::{Episode, FrameWriter};
use messages::{CameraFrame, FrameLayout, PixelFormat, StreamCursor};
use runtime::{Checkpoint, Context, Next, Shell, StepError};
use settings::{BuiltIn, CameraFormat, Settings};

use silences::Silences;

/// Most pictures taken in one step: as many as the device has buffers.
const MOST_AT_ONCE: usize = 4;

/// Shortest wait for a due time: what is due within it is done a little late rather than by spinning.
const SHORTEST_WAIT: Duration = Duration::from_millis(1);

/// The configuration in the settings.
fn config(settings: &settings::Camera) -> CameraConfig {
    let codings = match settings.format {
        CameraFormat::Any => Coding::ALL.to_vec(),
        CameraFormat::Grey => vec![Coding::Grey],
        CameraFormat::Yuyv => vec![Coding::Yuyv],
        CameraFormat::Mjpg => vec![Coding::Mjpg],
    };
    let controls = FixedControls {
        exposure_us: settings.exposure_us.map(|exposure| exposure.get()),
        gain: settings.gain.map(|gain| gain.get()),
        white_balance_k: settings.white_balance_k.map(|kelvin| kelvin.get()),
        others: settings.control.iter().map(|control| (control.name.clone(), control.value.get())).collect(),
    };
    let size = (settings.width.get(), settings.height.get());
    CameraConfig { size, rate_hz: settings.rate_hz.get(), codings, input: settings.input.map(|input| input.get()), controls }
}

/// Runs the driver until it is told to stop.
///
/// # Errors
/// When the bus fails.
pub(super) fn run(mut shell: Shell, settings: &Settings) -> Result<()> {
    let speed = shell.membership().speed();
    let checkpoint = shell.checkpoint();
    let last = checkpoint.restore_state().unwrap_or_default();
    shell.linger_as_source_until(settings.named(BuiltIn::Sbs));
    let limits = Limits::new(settings.camera.rate_hz.get(), speed);
    let mut process = Process {
        path: settings.camera.device.clone(),
        config: config(&settings.camera),
        camera: None,
        given: None,
        session: Session::new(limits, speed, last),
        frames: shell.frame_writer()?,
        checkpoint,
        speed,
        damages: Episode::default(),
        silences: Silences::default(),
    };
    Ok(shell.run(&mut process)?)
}

struct Process {
    path: PathBuf,
    config: CameraConfig,
    camera: Option<Camera>,
    /// What the camera gave when it was last opened.
    given: Option<Given>,
    session: Session,
    frames: FrameWriter<CameraFrame>,
    checkpoint: Checkpoint,
    speed: f64,
    damages: Episode,
    silences: Silences,
}

impl runtime::Process for Process {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        let more = self.take_pictures(context)?;
        if context.stopping() {
            let StreamCursor { seq, stamp_ns } = self.session.last();
            self.frames.end(seq, stamp_ns)?;
            let damaged = self.damages.close();
            self.report_damages(damaged);
            self.report(context);
            return Ok(Next::Finished);
        }
        self.feed(Input::Tick, context.now_ns())?;
        let damaged = self.damages.over(Instant::now());
        self.report_damages(damaged);
        if let Some(count) = self.silences.over(Instant::now()) {
            tracing::info!("{}: {count} times without pictures; they come steadily again", self.device());
        }
        self.report(context);
        Ok(if more { Next::Again } else { self.wait(context.now_ns()) })
    }

    fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        self.camera.iter().map(|camera| camera.stream.as_fd()).collect()
    }
}

impl Process {
    /// Takes what the camera has ready. Returns whether there may be more.
    fn take_pictures(&mut self, context: &Context<'_>) -> Result<bool, StepError> {
        for _ in 0..MOST_AT_ONCE {
            match self.take_picture(context.now_ns())? {
                Some(input) => self.feed(input, context.now_ns())?,
                None => return Ok(false),
            }
        }
        Ok(true)
    }

    /// Publishes the next picture, if one is ready, and returns what came of it.
    fn take_picture(&mut self, now_ns: u64) -> Result<Option<Input>, StepError> {
        let Some(Camera { stream, given }) = &mut self.camera else { return Ok(None) };
        let frame = match stream.take() {
            Ok(Some(frame)) => frame,
            Ok(None) => return Ok(None),
            Err(trouble) => return Ok(Some(Input::Trouble(trouble))),
        };
        let about = frame.about();
        if about.damaged {
            return Ok(Some(Input::Picture(about.sequence, Err(Damage::Marked))));
        }
        let position = self.session.next_position(&about, now_ns, monotonic_ns());
        // Before the picture leaves: after a kill at any moment no number is given twice.
        self.checkpoint.save_state(&position);
        let layout = FrameLayout::packed(given.shape.width(), given.shape.height(), PixelFormat::Grey);
        let result =
            self.frames.try_send_with(position.seq, position.stamp_ns, layout, |bytes| given.shape.luminance(frame.bytes(), bytes))?;
        Ok(Some(Input::Picture(about.sequence, result.map(|()| position))))
    }

    /// Tells the session what happened and does what it wants.
    fn feed(&mut self, input: Input, now_ns: u64) -> Result<(), StepError> {
        for output in self.session.step(input, now_ns) {
            match output {
                Output::Open => {
                    let input = self.open();
                    self.feed(input, now_ns)?;
                }
                Output::Restart => {
                    let restarted = self.camera.as_mut().map_or(Err(Trouble::Absent), |camera| camera.stream.restart());
                    self.feed(restarted.map_or_else(Input::Trouble, |()| Input::Opened), now_ns)?;
                }
                Output::Close => self.camera = None,
                Output::Event(event @ Event::Recovered { .. }) => {
                    if self.silences.end(Instant::now()) {
                        tracing::info!("{}: {event}", self.device());
                    }
                }
                Output::Event(Event::Damaged { .. }) if !self.damages.occurred(Instant::now()) => {}
                Output::Event(Event::Trouble(_) | Event::Stalled { .. }) if !self.silences.begin(Instant::now()) => {}
                Output::Event(event) => tracing::warn!("{}: {event}", self.device()),
            }
        }
        Ok(())
    }

    /// Logs the end of an episode of so many damaged pictures.
    fn report_damages(&self, damaged: Option<u64>) {
        if let Some(damaged) = damaged {
            tracing::info!("{}: {damaged} pictures were damaged; they are intact again", self.device());
        }
    }

    fn open(&mut self) -> Input {
        match Camera::open(&self.path, &self.config) {
            Ok(camera) => {
                if self.given.as_ref() != Some(&camera.given) {
                    tracing::info!("{}: {}", self.device(), camera.given);
                    camera.given.troubles.iter().for_each(|trouble| tracing::warn!("{}: {trouble}", self.device()));
                    self.given = Some(camera.given.clone());
                }
                self.camera = Some(camera);
                Input::Opened
            }
            Err(trouble) => Input::Trouble(trouble),
        }
    }

    fn device(&self) -> std::path::Display<'_> {
        self.path.display()
    }

    fn wait(&self, now_ns: u64) -> Next {
        let wall = Duration::from_nanos((self.session.due_ns().saturating_sub(now_ns) as f64 / self.speed) as u64);
        Next::WaitAtMost(wall.max(SHORTEST_WAIT))
    }

    fn report(&self, context: &mut Context<'_>) {
        let given = self.given.as_ref().map(ToString::to_string).unwrap_or_default();
        context.note(&self.session.note(&self.device().to_string(), &given, context.now_ns()));
        let counters = self.session.counters();
        for (name, value) in [
            ("pictures", counters.pictures),
            ("lost pictures", counters.lost),
            ("damaged pictures", counters.damaged),
            ("stream restarts", counters.restarts),
            ("reopenings", counters.reopenings),
            ("controls not set", self.given.as_ref().map_or(0, |given| given.troubles.len() as u64)),
        ] {
            context.count(name, value);
        }
    }
}
