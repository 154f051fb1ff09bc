//! One reading into a lattice: look at what the cone holds, tune, update (eqs. 1 to 3).

use geometry::{Lattice, TileKey};
use messages::{Pose, SonarReading};

use crate::Parameters;
use crate::cone::{Cone, Groups};
use crate::numeric::{LANES, Lanes, all};
use crate::sensor_model::{Extent, SensorModel};
use crate::tuning::Known;

/// A reading and where the robot was.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Beam<'a> {
    pub(crate) map_from_robot: &'a Pose,
    pub(crate) reading: &'a SonarReading,
}

impl Beam<'_> {
    /// Integrates the reading. When it is `withheld`, its occupied part is left out.
    ///
    /// The lattice holds log-odds of occupancy. Only cells within the cone and up to the end of its arc are touched.
    pub(crate) fn integrate(&self, lattice: &mut Lattice<f32>, parameters: &Parameters, withheld: bool) {
        let extent = self.extent(parameters);
        let cone = self.cone(parameters, extent.c);
        let groups = cone.groups();
        let known = if parameters.tuning.enabled() { look(lattice, &groups, extent) } else { Known::NOTHING };
        let tuned = parameters.tuning.tune(known);
        let extent = if withheld { extent.without_surface() } else { extent };
        let model = SensorModel::new(&parameters.sensor, self.reading.range_m, extent, tuned);
        update(lattice, &groups, &model, parameters.l_max);
    }

    /// The tiles that hold every cell the reading looks at or touches.
    pub(crate) fn tiles(&self, parameters: &Parameters) -> impl Iterator<Item = TileKey> + use<> {
        self.cone(parameters, self.extent(parameters).c).tiles()
    }

    fn extent(&self, parameters: &Parameters) -> Extent {
        let range_m = self.reading.range_m;
        match self.reading.echo {
            0 => Extent::of_silence(&parameters.sensor, range_m),
            _ => Extent::of_echo(&parameters.sensor, range_m),
        }
    }

    fn cone(&self, parameters: &Parameters, reach: f64) -> Cone {
        Cone::new(parameters.cell, self.map_from_robot, self.reading, parameters.half_beam_rad, reach)
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
