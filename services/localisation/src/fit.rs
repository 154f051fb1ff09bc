//! A line through the echoes of one sonar.

use crate::graph::{Graph, Model};
use crate::rigid::{Rigid, length, unit, wrap};

/// Steps of Gauss–Newton: a fit from the axis converges in three or four.
const STEPS: usize = 6;
/// Largest turn of one step, rad.
const LARGEST_TURN_RAD: f64 = 0.2;
/// Weight of the prior that the normal is near the sonar's axis, relative to that of an echo: (20 mm / 8°)².
const AXIS_WEIGHT: f64 = 0.020_5;

/// A line that explains some echoes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Fit {
    /// Direction of the normal.
    pub(crate) normal: f64,
    /// Distance from the anchor, m.
    pub(crate) offset: f64,
    /// Mean of the sonar's places, m.
    pub(crate) anchor: [f64; 2],
    /// Root mean square and greatest of the residuals, m.
    pub(crate) rms: f64,
    pub(crate) worst: f64,
}

/// The line through these echoes; `None` where it is not determined, or lies outside the beam of one.
pub(crate) fn fit(graph: &Graph, model: &Model, echoes: &[u32]) -> Option<Fit> {
    let samples: Vec<(Rigid, f64)> =
        echoes.iter().map(|echo| &graph.echoes[*echo as usize]).map(|echo| (graph.sonar(echo), echo.range())).collect();
    let first = samples.first()?.0.yaw;
    let count = samples.len() as f64;
    let mean = |number: &dyn Fn(&(Rigid, f64)) -> f64| samples.iter().map(number).sum::<f64>() / count;
    let anchor = [mean(&|sample| sample.0.x), mean(&|sample| sample.0.y)];
    let axis = first + mean(&|sample| wrap(sample.0.yaw - first));
    let (mut normal, mut offset) = (axis, mean(&|sample| sample.1));
    let placed = |normal: f64, (sonar, _): &(Rigid, f64)| crate::rigid::along(unit(normal), [sonar.x - anchor[0], sonar.y - anchor[1]]);
    for _ in 0..STEPS {
        let (mut a, mut b, mut turn, mut shift) = (AXIS_WEIGHT, 0.0, AXIS_WEIGHT * wrap(axis - normal), 0.0);
        for sample in &samples {
            let [ahead, aside] = placed(normal, sample);
            let e = sample.1 - offset + ahead;
            a += aside * aside;
            b -= aside;
            turn -= aside * e;
            shift += e;
        }
        let determinant = a * count - b * b;
        if determinant.abs() < 1e-15 {
            return None;
        }
        normal += ((count * turn - b * shift) / determinant).clamp(-LARGEST_TURN_RAD, LARGEST_TURN_RAD);
        offset += (a * shift - b * turn) / determinant;
    }
    if samples.iter().any(|(sonar, _)| wrap(sonar.yaw - normal).abs() > model.reach_rad()) {
        return None;
    }
    let errors: Vec<f64> = samples.iter().map(|sample| sample.1 - offset + placed(normal, sample)[0]).collect();
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / count).sqrt();
    let worst = errors.iter().fold(0.0, |worst: f64, e| worst.max(e.abs()));
    let is_finite = length([normal, offset]).is_finite();
    is_finite.then_some(Fit { normal, offset, anchor, rms, worst })
}
