//! Checks of the sections of a deployment against each other.

use std::collections::HashSet;

use document::Fault;

use crate::text::{NO_TILDE, begins_with_tilde};
use crate::{BuiltIn, Disturbance, Pace, Port, Program, Provides, Published, RoutedService, Settings, Viewer};

/// Most processes of a deployment; the supervisor takes one more place in its status.
pub const MAX_PROCESSES: usize = 23;
/// Most sonars of a ring.
pub const MAX_SONARS: usize = 32;
/// Most faults of a deployment.
pub const MAX_FAULTS: usize = 64;

impl Settings {
    /// Checks what involves several sections.
    ///
    /// # Errors
    /// The first key that contradicts others.
    pub fn check(&self) -> Result<(), Fault> {
        self.check_processes()?;
        self.check_source()?;
        self.check_pictures()?;
        self.check_lists()?;
        self.check_verdicts()?;
        self.check_viewer()?;
        self.check_faults()?;
        self.check_hook()?;
        let (first, last) = (self.supervisor.backoff_first_s.get(), self.supervisor.backoff_last_s.get());
        if first > last {
            return Err(Fault::new("supervisor.backoff_first_s", format!("at most backoff_last_s, which is {last} s")));
        }
        Ok(())
    }

    /// Whether a process of the deployment runs this.
    #[must_use]
    pub fn runs(&self, kind: BuiltIn) -> bool {
        self.process.iter().any(|process| process.runs(kind))
    }

    /// The names of the processes that run this.
    pub fn named(&self, kind: BuiltIn) -> impl Iterator<Item = String> {
        self.process.iter().filter(move |process| process.runs(kind)).map(|process| process.name.as_str().to_owned())
    }

    /// The services that go through the injector, each once: none where no process runs it.
    #[must_use]
    pub fn routed_services(&self) -> Vec<RoutedService> {
        let named = |service: &RoutedService| {
            self.injector.services.contains(service)
                || self.fault.iter().any(|fault| matches!(&fault.disturbance, Disturbance::Service { service: it, .. } if it == service))
        };
        let injected = self.runs(BuiltIn::Injector);
        RoutedService::ALL.into_iter().filter(|service| injected && named(service)).collect()
    }

    /// Faults have an existing target, and a process injects them.
    fn check_faults(&self) -> Result<(), Fault> {
        if self.fault.len() > MAX_FAULTS {
            return Err(Fault::new("fault", format!("at most {MAX_FAULTS} faults, found {}", self.fault.len())));
        }
        if !self.runs(BuiltIn::Injector) {
            let needs = if self.fault.is_empty() { "injector.services" } else { "fault" };
            let idle = self.fault.is_empty() && self.injector.services.is_empty();
            return if idle { Ok(()) } else { Err(Fault::new(needs, "none, or else a process with run = \"injector\"")) };
        }
        for (index, fault) in self.fault.iter().enumerate() {
            if let Disturbance::Process { process, .. } = &fault.disturbance
                && !self.process.iter().any(|it| it.name == *process && !it.runs(BuiltIn::Injector))
            {
                return Err(Fault::new(format!("fault[{index}].process"), "the name of a process of this deployment, not the injector's"));
            }
        }
        Ok(())
    }

    fn check_processes(&self) -> Result<(), Fault> {
        if !(1..=MAX_PROCESSES).contains(&self.process.len()) {
            return Err(Fault::new("process", format!("1 to {MAX_PROCESSES} processes, found {}", self.process.len())));
        }
        let mut names = HashSet::new();
        let mut kinds = HashSet::new();
        for (index, process) in self.process.iter().enumerate() {
            if !names.insert(&process.name) {
                return Err(Fault::new(format!("process[{index}].name"), "a name that no other process has"));
            }
            match &process.program {
                // Two of a kind would publish the same services or write the same file.
                Program::BuiltIn(kind) if !kinds.insert(*kind) => {
                    return Err(Fault::new(format!("process[{index}].run"), "each built-in process once"));
                }
                Program::Command(command) if command.first().is_none_or(String::is_empty) => {
                    return Err(Fault::new(format!("process[{index}].command"), "a program and its arguments"));
                }
                Program::Command(command) if command.first().is_some_and(|program| begins_with_tilde(program.as_ref())) => {
                    return Err(Fault::new(format!("process[{index}].command"), NO_TILDE));
                }
                Program::Command(command) if command.iter().any(|word| word.contains('\0')) => {
                    return Err(Fault::new(format!("process[{index}].command"), "words without a zero byte"));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Scans have one source, and its pace and span suit it.
    fn check_source(&self) -> Result<(), Fault> {
        let foreign = self.process.iter().any(|process| matches!(process.program, Program::Command(_)));
        let sources: Vec<usize> = (0..self.process.len())
            .filter(|index| self.process[*index].runs(BuiltIn::Pioneer) || self.process[*index].runs(BuiltIn::Playback))
            .collect();
        match sources.as_slice() {
            [] if !foreign && !self.serves_others() => {
                return Err(Fault::new("process", "a source of scans: run = \"pioneer\" or \"playback\", or a command"));
            }
            [_, second, ..] => {
                return Err(Fault::new(format!("process[{second}].run"), "one source of scans, either \"pioneer\" or \"playback\""));
            }
            _ => {}
        }
        if self.runs(BuiltIn::Pioneer) && self.pioneer.port == Port::Simulator && !self.runs(BuiltIn::Simulator) {
            return Err(Fault::new("pioneer.port", "a serial device or tcp://HOST:PORT, or else a process with run = \"simulator\""));
        }
        let live = [BuiltIn::Pioneer, BuiltIn::Simulator, BuiltIn::Camera];
        if self.pace == Pace::Lockstep && live.into_iter().any(|kind| self.runs(kind)) {
            return Err(Fault::new("pace", "\"live\", because a robot does not wait"));
        }
        if self.runs(BuiltIn::Simulator) && self.runs(BuiltIn::Playback) {
            return Err(Fault::new("process", "one world, either that of \"simulator\" or that of \"playback\""));
        }
        if self.playback.to_s.is_some_and(|to_s| to_s.get() < self.playback.from_s.get()) {
            return Err(Fault::new("playback.to_s", "a time that is not before playback.from_s"));
        }
        Ok(())
    }

    /// Whether the simulated robot is there for programs that are not part of the deployment, and nothing here needs scans.
    fn serves_others(&self) -> bool {
        let needs_scans = [BuiltIn::Mapping, BuiltIn::Std, BuiltIn::Fti, BuiltIn::Localisation].into_iter().any(|kind| self.runs(kind));
        self.runs(BuiltIn::Simulator) && self.simulator.link.is_some() && !needs_scans
    }

    /// Pictures have one source, and SBS has pictures.
    fn check_pictures(&self) -> Result<(), Fault> {
        let foreign = self.process.iter().any(|process| matches!(process.program, Program::Command(_)));
        let (camera, playback, sbs) = (self.runs(BuiltIn::Camera), self.runs(BuiltIn::Playback), self.runs(BuiltIn::Sbs));
        let simulated = if self.runs(BuiltIn::Simulator) { self.simulator.camera.provides } else { Provides::Off };
        if camera && playback {
            return Err(Fault::new("process", "one source of pictures, either \"camera\" or \"playback\""));
        }
        if camera && simulated == Provides::Pictures {
            return Err(Fault::new("simulator.camera.provides", "\"off\", since a process runs \"camera\", which gives the pictures"));
        }
        if sbs && !(camera || playback || foreign || simulated == Provides::Pictures) {
            let expected = "a source of pictures for \"sbs\": run = \"camera\", or the simulator with camera.provides = \"pictures\"";
            return Err(Fault::new("process", expected));
        }
        Ok(())
    }

    /// Whether every scan gets a verdict, which mapping waits for before it integrates a reading.
    #[must_use]
    pub fn expects_verdicts(&self) -> bool {
        self.runs(BuiltIn::Fti) || self.publishes(Published::Verdicts)
    }

    /// Whether camera motion is published, which FTI waits for before it integrates a scan. Without it FTI works on sonar alone.
    #[must_use]
    pub fn expects_camera_motion(&self) -> bool {
        let recorded = self.runs(BuiltIn::Playback) && self.playback.camera_motion;
        self.runs(BuiltIn::Sbs) || recorded || self.publishes(Published::CameraMotion)
    }

    fn publishes(&self, stream: Published) -> bool {
        self.process.iter().any(|process| process.publishes.contains(&stream))
    }

    /// Verdicts and camera motion come from one process each, and FTI has the answers of STD.
    fn check_verdicts(&self) -> Result<(), Fault> {
        let foreign = self.process.iter().any(|process| matches!(process.program, Program::Command(_)));
        if self.runs(BuiltIn::Fti) && self.publishes(Published::Verdicts) {
            return Err(Fault::new("process", "one source of verdicts, either run = \"fti\" or a command that publishes \"map/verdict\""));
        }
        if self.runs(BuiltIn::Fti) && !self.runs(BuiltIn::Std) && !foreign {
            return Err(Fault::new("process", "a process with run = \"std\" beside \"fti\", which waits for its answers"));
        }
        if self.runs(BuiltIn::Sbs) && self.publishes(Published::CameraMotion) {
            let expected = "one source of camera motion, either run = \"sbs\" or a command that publishes \"motion/camera\"";
            return Err(Fault::new("process", expected));
        }
        if self.runs(BuiltIn::Sbs) && self.runs(BuiltIn::Playback) && self.playback.camera_motion {
            return Err(Fault::new("playback.camera_motion", "false, since a process runs \"sbs\" and finds the motion in the pictures"));
        }
        Ok(())
    }

    /// The page is served to this computer alone, or with a token.
    fn check_viewer(&self) -> Result<(), Fault> {
        let Viewer { address, token, .. } = &self.viewer;
        if address.get().is_loopback() || token.is_some() {
            return Ok(());
        }
        Err(Fault::new("viewer.address", "127.0.0.1 or ::1, or else a token"))
    }

    /// The program of `on_event` can be started as it is written.
    fn check_hook(&self) -> Result<(), Fault> {
        let command = &self.supervisor.on_event;
        let refused = |expected: &str| Err(Fault::new("supervisor.on_event", expected));
        match command.first() {
            None => Ok(()),
            Some(program) if program.is_empty() => refused("a program and its arguments"),
            Some(program) if begins_with_tilde(program.as_ref()) => refused(NO_TILDE),
            Some(_) if command.iter().any(|word| word.contains('\0')) => refused("words without a zero byte"),
            Some(_) => Ok(()),
        }
    }

    fn check_lists(&self) -> Result<(), Fault> {
        if self.robot.sonar.len() > MAX_SONARS {
            return Err(Fault::new("robot.sonar", format!("at most {MAX_SONARS} sonars, found {}", self.robot.sonar.len())));
        }
        let mut bauds = HashSet::new();
        if self.pioneer.bauds.is_empty() || !self.pioneer.bauds.iter().all(|baud| bauds.insert(baud)) {
            return Err(Fault::new("pioneer.bauds", "at least one speed, and each once"));
        }
        Ok(())
    }
}
