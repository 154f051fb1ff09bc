//! The settings of a map in the units and shapes the algorithms work in.

use fuzzy::{PartitionError, TableError};
use geometry::{CellSize, CellSizeError};
use settings::Pace;

use crate::tuning::Tuning;

/// How long past the horizon a verdict is waited for at sensor pace, s.
///
/// FTI decides when the scan comes that passes the horizon; its answer takes milliseconds, one second covers its restart.
const VERDICT_GRACE_S: f64 = 1.0;

/// What the mapper works by; made from settings, so that its numbers can be meant.
#[derive(Debug, Clone)]
pub struct Parameters {
    pub(crate) cell: CellSize,
    /// Half the opening angle of a beam, rad.
    pub(crate) half_beam_rad: f64,
    pub(crate) sensor: SensorParameters,
    pub(crate) tuning: Tuning,
    /// Greatest log-odds of a cell, of either sign.
    pub(crate) l_max: f32,
    pub(crate) commit: CommitRule,
    pub(crate) keep_unfiltered: bool,
    /// Occupied cells with fewer occupied neighbours are published as free.
    pub(crate) lonely_below: usize,
}

/// Parameters of eq. 2 that no rule tunes, and of its limits.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SensorParameters {
    /// Peak probability of a surface.
    pub(crate) k_o: f64,
    /// Spread in range, m.
    pub(crate) sigma_r_m: f64,
    /// How far a reading without an echo frees, m.
    pub(crate) no_echo_free_m: f64,
    /// Far readings say less; `None` for the paper's own model.
    pub(crate) fades: Option<Fades>,
}

/// Where readings have lost half their weight, m.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fades {
    /// An echo.
    pub(crate) occupied_m: f64,
    /// Emptiness.
    pub(crate) free_m: f64,
}

/// When a reading is integrated for good. Times are ns of sensor time after the reading's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CommitRule {
    /// No verdicts: when a scan passes the horizon.
    Horizon {
        /// The horizon.
        horizon_ns: u64,
    },
    /// Lockstep: when its verdict is there, however long it takes.
    Verdict,
    /// Live: when its verdict is there, or a scan passes the deadline.
    VerdictOrDeadline {
        /// The deadline.
        deadline_ns: u64,
    },
}

/// Settings that make no mapper.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParametersError {
    /// The edge of a cell.
    #[error(transparent)]
    Cell(#[from] CellSizeError),
    /// The sets of P_arc or P_free.
    #[error("sets of the fuzzy tuning: {0}")]
    Sets(#[from] PartitionError),
    /// A rule table of the fuzzy tuning.
    #[error("rules of the fuzzy tuning: {0}")]
    Rules(#[from] TableError),
}

impl Parameters {
    /// The parameters that these settings mean at this pace.
    ///
    /// # Errors
    /// Numbers out of order that the settings' own limits do not see.
    pub fn new(settings: &settings::Mapping, pace: Pace) -> Result<Self, ParametersError> {
        let horizon_ns = (settings.horizon_s.get() * 1e9) as u64;
        let commit = match (settings.expect_verdicts, pace) {
            (false, _) => CommitRule::Horizon { horizon_ns },
            (true, Pace::Lockstep) => CommitRule::Verdict,
            (true, Pace::Live) => CommitRule::VerdictOrDeadline { deadline_ns: horizon_ns + (VERDICT_GRACE_S * 1e9) as u64 },
        };
        let fades = Fades { occupied_m: settings.occupied_fade_m.get(), free_m: settings.free_fade_m.get() };
        Ok(Self {
            cell: CellSize::new(settings.cell_m.get())?,
            half_beam_rad: settings.half_beam_deg.get().to_radians(),
            sensor: SensorParameters {
                k_o: settings.k_o.get(),
                sigma_r_m: settings.sigma_r_m.get(),
                no_echo_free_m: settings.no_echo_free_m.get(),
                fades: settings.fades.then_some(fades),
            },
            tuning: Tuning::new(&settings.tuning)?,
            l_max: settings.l_max.get() as f32,
            commit,
            keep_unfiltered: settings.keep_unfiltered,
            lonely_below: settings.lonely_below.get() as usize,
        })
    }

    /// The same for a deployment whose FTI waits `patience_s` for its inputs, and whose clock runs `speed` times faster than the
    /// wall's: what a restart or a busy machine delays takes so much more sensor time.
    #[must_use]
    pub fn waiting_for(mut self, patience_s: f64, speed: f64) -> Self {
        if let CommitRule::VerdictOrDeadline { deadline_ns } = &mut self.commit {
            let grace_s = (VERDICT_GRACE_S + patience_s) * speed.max(1.0);
            *deadline_ns = deadline_ns.saturating_add(((grace_s - VERDICT_GRACE_S) * 1e9) as u64);
        }
        self
    }

    /// Edge of a cell, m.
    #[must_use]
    pub fn cell_m(&self) -> f64 {
        self.cell.metres()
    }
}
