//! Fig. 6: the sets of the fuzzy rule base of Tables 3 to 5.

use fuzzy::Partition;

use crate::chart::{Axis, Chart};
use crate::scenes::Error;
use crate::svg::{Anchor, LINES, Svg};

pub(crate) fn figure() -> Result<String, Error> {
    let mut svg = Svg::new(1080.0, 560.0);
    for (index, variable) in fti::variables(&fti::Parameters::default())?.iter().enumerate() {
        let at = [50.0 + 350.0 * (index % 3) as f64, 50.0 + 270.0 * (index / 3) as f64];
        draw(&mut svg, at, variable);
    }
    Ok(svg.finish())
}

fn draw(svg: &mut Svg, at: [f64; 2], variable: &fti::Variable) {
    let centres = variable.sets.centres();
    let (Some(first), Some(last)) = (centres.first(), centres.last()) else { return };
    let chart = Chart { at, size: [310.0, 160.0], x: [*first, *last], y: [0.0, 1.0] };
    chart.axes(svg, variable.name, Axis { name: variable.unit, spaces: 4 }, Axis { name: "", spaces: 4 });
    for (set, (colour, name)) in LINES.into_iter().zip(variable.words).enumerate() {
        chart.line(svg, outline(&variable.sets, set), colour);
        let [x, y] = chart.place(centres.get(set).copied().unwrap_or(*first), 0.55);
        // Under its peak each set is alone.
        let (x, anchor) = match set {
            0 => (x + 6.0, Anchor::Start),
            4 => (x - 6.0, Anchor::End),
            _ => (x, Anchor::Middle),
        };
        svg.text([x, y], anchor, 12.0, colour, name);
    }
}

/// A set's membership over the whole variable.
fn outline(sets: &Partition, set: usize) -> impl Iterator<Item = [f64; 2]> {
    sets.centres().iter().map(move |centre| [*centre, sets.membership(set, *centre)])
}
