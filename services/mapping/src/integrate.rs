//! One reading into a lattice: look at what the cone holds, tune, update (eqs. 1 to 3).

use geometry::{CellSize, Lattice, MapFromRobot, TileKey};
use messages::SonarReading;

use crate::cone::{Cone, Groups};
use crate::numeric::{LANES, Lanes, all};
use crate::parameters::{Parameters, ParametersError, SensorParameters};
use crate::sensor_model::{Extent, SensorModel};
use crate::tuning::{Known, Tuning};

/// What readings are integrated by: parameters that have been checked, in the shapes the algorithm works with.
#[derive(Debug, Clone)]
pub(crate) struct Integrator {
    pub(crate) cell: CellSize,
    /// Half the opening angle of a beam, rad.
    half_beam_rad: f64,
    sensor: SensorParameters,
    tuning: Tuning,
    /// Greatest log-odds of a cell, of either sign.
    pub(crate) l_max: f32,
}

impl Integrator {
    pub(crate) fn new(parameters: &Parameters) -> Result<Self, ParametersError> {
        Ok(Self {
            cell: parameters.check()?,
            half_beam_rad: parameters.half_beam_rad,
            sensor: parameters.sensor,
            tuning: Tuning::new(&parameters.tuning)?,
            l_max: parameters.l_max as f32,
        })
    }
}

/// A reading and where the robot was.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Beam<'a> {
    pub(crate) map_from_robot: &'a MapFromRobot,
    pub(crate) reading: &'a SonarReading,
}

impl Beam<'_> {
    /// Integrates the reading. When it is `withheld`, its occupied part is left out.
    ///
    /// The lattice holds log-odds of occupancy. Only cells within the cone and up to the end of its arc are touched.
    pub(crate) fn integrate(&self, lattice: &mut Lattice<f32>, integrator: &Integrator, withheld: bool) {
        let extent = self.extent(integrator);
        let cone = self.cone(integrator, extent.c);
        let groups = cone.groups();
        let known = if integrator.tuning.enabled() { look(lattice, &groups, extent) } else { Known::NOTHING };
        let tuned = integrator.tuning.tune(known);
        let extent = if withheld { extent.without_surface() } else { extent };
        let model = SensorModel::new(&integrator.sensor, self.reading.range_m, extent, tuned);
        update(lattice, &groups, &model, integrator.l_max);
    }

    /// The tiles that hold every cell the reading looks at or touches.
    pub(crate) fn tiles(&self, integrator: &Integrator) -> impl Iterator<Item = TileKey> + use<> {
        self.cone(integrator, self.extent(integrator).c).tiles()
    }

    fn extent(&self, integrator: &Integrator) -> Extent {
        let range_m = self.reading.range_m;
        match self.reading.echo {
            0 => Extent::of_silence(&integrator.sensor, range_m),
            _ => Extent::of_echo(&integrator.sensor, range_m),
        }
    }

    fn cone(&self, integrator: &Integrator, reach: f64) -> Cone {
        Cone::new(integrator.cell, self.map_from_robot, self.reading, integrator.half_beam_rad, reach)
    }
}

/// The highest occupancies in the cone: of the arc, and of what lies at least a cell before it.
fn look(lattice: &Lattice<f32>, groups: &Groups, extent: Extent) -> Known {
    let before = all((extent.b - lattice.cell_size().metres()) as f32);
    let (b, c) = (all(extent.b as f32), all(extent.c as f32));
    let mut highest_before = all(0.0);
    let (mut highest_arc, mut theta_max) = (0.0_f32, 0.0_f32);
    for row in groups.rows() {
        lattice.visit_row(row.row(), row.columns(), |first, cells| {
            // What the loop works with is held by itself, in registers.
            let (before, b, c, mut highest) = (before, b, c, highest_before);
            for (group, cells) in groups.of_row_from(row, first).iter().zip(cells.as_chunks::<LANES>().0) {
                let cells = Lanes::new(*cells);
                highest = highest.fast_max(group.z.simd_lt(before) & cells);
                let on_arc = group.z.simd_ge(b) & group.z.simd_lt(c);
                if on_arc.any() {
                    for (cell, theta) in (on_arc & cells).to_array().into_iter().zip(group.theta().to_array()) {
                        let nearer = cell >= highest_arc && theta.abs() < theta_max.abs();
                        if cell > highest_arc || nearer {
                            (highest_arc, theta_max) = (cell, theta);
                        }
                    }
                }
            }
            highest_before = highest;
        });
    }
    let highest_before = highest_before.to_array().into_iter().fold(0.0, f32::max);
    Known { p_arc: probability(highest_arc), theta_max_rad: f64::from(theta_max), p_free: probability(highest_before) }
}

/// Eq. 3 for every cell of the cone.
fn update(lattice: &mut Lattice<f32>, groups: &Groups, model: &SensorModel, l_max: f32) {
    for row in groups.rows() {
        lattice.visit_row_mut(row.row(), row.columns(), |first, cells| {
            // A copy of its own: what the loop works with does not change when it writes a cell.
            let (model, least, most) = (*model, all(-l_max), all(l_max));
            for (group, cells) in groups.of_row_from(row, first).iter().zip(cells.as_chunks_mut::<LANES>().0) {
                let within = group.z.simd_lt(model.c);
                if !within.any() {
                    continue;
                }
                let free = group.z.simd_lt(model.a);
                let said = if (free ^ within).any() {
                    within & model.log_odds(group.z, group.theta())
                } else {
                    free & model.free_log_odds(group.z, group.theta())
                };
                *cells = add(Lanes::new(*cells), said, least, most).to_array();
            }
        });
    }
}

/// Eq. 3 as a clamped sum of log-odds.
#[inline(always)]
pub(crate) fn add(log_odds: Lanes, said: Lanes, least: Lanes, most: Lanes) -> Lanes {
    (log_odds + said).fast_max(least).fast_min(most)
}

/// Occupancy of a cell by its log-odds.
pub(crate) fn probability(log_odds: f32) -> f64 {
    1.0 / (1.0 + (-f64::from(log_odds)).exp())
}
