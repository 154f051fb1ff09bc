//! A deployment in one process: a drive, the processes' answers and their score.

use simulator::{Body, Optics, World};

use crate::drive::{CameraSetup, Drive};
use crate::judge::{Chain, FilterError, Outcome, filter};
use crate::localised::{LocalisationScore, Localised};
use crate::trial::{Trial, reference};

/// Robot, camera and algorithms of a simulated deployment.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The robot.
    pub body: Body,
    /// Readings from this range on are no echo, m.
    pub range_limit_m: f64,
    /// The camera; `None` with sonars only.
    pub camera: Option<CameraSetup>,
    /// STD, FTI, localisation and the mapper.
    pub chain: Chain,
}

/// A drive with its score.
#[derive(Debug, Clone)]
pub struct Driven {
    /// What the sensors gave.
    pub drive: Drive,
    /// What STD and FTI answered.
    pub outcome: Outcome,
    /// The score. Where localisation runs, it is that of the map by its final poses.
    pub trial: Trial,
    /// The score of localisation, where it runs.
    pub localisation: Option<LocalisationScore>,
}

impl Setup {
    /// The default parameters of everything.
    #[must_use]
    pub fn new(body: Body) -> Self {
        let chain = Chain::default();
        Self { body, range_limit_m: chain.fti.range_limit_m, camera: Some(CameraSetup::new(Optics::default())), chain }
    }

    /// The same with sonars only.
    #[must_use]
    pub fn without_camera(mut self) -> Self {
        self.camera = None;
        self.chain.fti.camera = None;
        self
    }

    /// Drives through a world, runs the algorithms and scores the map, also against that of the same drive without walkers.
    ///
    /// # Errors
    /// Parameters that an algorithm refuses.
    pub fn run(&self, world: &World, seed: u64) -> Result<Driven, FilterError> {
        let drive = Drive::through(world, &self.body, self.range_limit_m, self.camera.as_ref(), seed);
        let outcome = filter(&drive, &self.chain)?;
        let empty = World { walkers: Vec::new(), ..world.clone() };
        let empty = Drive::through(&empty, &self.body, self.range_limit_m, None, seed);
        let Some(parameters) = self.chain.localisation else {
            let trial = Trial::judge(&drive, &outcome, Some(&reference(&empty, &self.chain.mapping)?), &self.chain)?;
            return Ok(Driven { drive, outcome, trial, localisation: None });
        };
        let localised = Localised::of(&drive, parameters)?;
        let reference = reference(&empty.placed(&empty.true_poses()), &self.chain.mapping)?;
        let trial = Trial::judge(&drive.placed(&localised.last), &outcome, Some(&reference), &self.chain)?;
        let localisation = LocalisationScore::of(&drive, &localised, &outcome.verdicts, &self.chain.mapping)?;
        Ok(Driven { drive, outcome, trial, localisation: Some(localisation) })
    }
}
