//! One reading into a lattice: look at what the cone holds, tune, update (eqs. 1 to 3).

use grid::{Lattice, TileKey};
use messages::{Pose, SonarReading};

use crate::Parameters;
use crate::cone::{Cone, LANES};
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
        let known = if parameters.tuning.enabled() { look(lattice, &cone, extent) } else { Known::NOTHING };
        let tuned = parameters.tuning.tune(known);
        let extent = if withheld { extent.without_surface() } else { extent };
        let model = SensorModel::new(&parameters.sensor, self.reading.range_m, extent, tuned);
        update(lattice, &cone.reaching(extent.c), &model, parameters.l_max);
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
fn look(lattice: &Lattice<f32>, cone: &Cone, extent: Extent) -> Known {
    let before = (extent.b - lattice.cell_size().metres()) as f32;
    let (b, c) = (extent.b as f32, extent.c as f32);
    let mut highest_before = [0.0_f32; LANES];
    let (mut highest_arc, mut theta_max) = (0.0_f32, 0.0_f32);
    for row in cone.rows() {
        lattice.visit_row(row, cone.columns(row), |first, cells| {
            for (column, cells) in (first..).step_by(LANES).zip(cells.as_chunks::<LANES>().0) {
                let group = cone.group(row, column);
                for lane in 0..LANES {
                    let free = if group.z[lane] < before { cells[lane] } else { 0.0 };
                    highest_before[lane] = if free > highest_before[lane] { free } else { highest_before[lane] };
                }
                if group.z.iter().any(|&z| z >= b && z < c) {
                    for lane in (0..LANES).filter(|&lane| group.z[lane] >= b && group.z[lane] < c) {
                        let theta = group.theta(lane);
                        let nearer = cells[lane] == highest_arc && theta.abs() < theta_max.abs();
                        if cells[lane] > highest_arc || nearer {
                            (highest_arc, theta_max) = (cells[lane], theta);
                        }
                    }
                }
            }
        });
    }
    let highest_before = highest_before.into_iter().fold(0.0, f32::max);
    Known { p_arc: probability(highest_arc), theta_max_rad: f64::from(theta_max), p_free: probability(highest_before) }
}

/// Eq. 3 for every cell of the cone, as a clamped sum of log-odds.
fn update(lattice: &mut Lattice<f32>, cone: &Cone, model: &SensorModel, l_max: f32) {
    for row in cone.rows() {
        lattice.visit_row_mut(row, cone.columns(row), |first, cells| {
            for (column, cells) in (first..).step_by(LANES).zip(cells.as_chunks_mut::<LANES>().0) {
                let group = cone.group(row, column);
                let mut said = [0.0; LANES];
                if group.z.iter().all(|&z| z < model.a || z == f32::INFINITY) {
                    for lane in 0..LANES {
                        let free = model.free_log_odds(group.z[lane], group.theta(lane));
                        said[lane] = if group.z[lane] < model.a { free } else { 0.0 };
                    }
                } else {
                    for lane in 0..LANES {
                        said[lane] = model.log_odds(group.z[lane], group.theta(lane));
                    }
                }
                for lane in 0..LANES {
                    cells[lane] = add(cells[lane], said[lane], l_max);
                }
            }
        });
    }
}

/// Eq. 3 for one cell.
#[inline(always)]
pub(crate) fn add(log_odds: f32, said: f32, l_max: f32) -> f32 {
    (log_odds + said).clamp(-l_max, l_max)
}

/// Occupancy of a cell by its log-odds.
pub(crate) fn probability(log_odds: f32) -> f64 {
    1.0 / (1.0 + (-f64::from(log_odds)).exp())
}
