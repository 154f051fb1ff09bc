//! A world that is being drawn, and its text.

use std::fmt::Write;

/// Time from one comparison of a path with the robot's to the next, s.
pub(super) const STEP_S: f64 = 0.25;

/// A place in the world's frame, m.
pub(super) type Spot = [f64; 2];

/// A closed door or a gap in a wall.
#[derive(Debug, Clone, Copy)]
pub(super) struct Opening {
    pub(super) at_m: f64,
    pub(super) width_m: f64,
    pub(super) depth_m: f64,
    pub(super) closed: bool,
}

/// A line of wall.
#[derive(Debug, Clone)]
pub(super) struct Line {
    pub(super) corners: Vec<Spot>,
    pub(super) openings: Vec<Opening>,
    pub(super) rough: bool,
}

/// A box.
#[derive(Debug, Clone, Copy)]
pub(super) struct Furniture {
    pub(super) centre: Spot,
    pub(super) size: [f64; 2],
    pub(super) height_m: f64,
    pub(super) rough: bool,
}

/// A pillar or a bin.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pillar {
    pub(super) centre: Spot,
    pub(super) radius_m: f64,
    /// `None`: it reaches the ceiling.
    pub(super) height_m: Option<f64>,
    pub(super) rough: bool,
}

/// A place on a path and how long to stand there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Goal {
    pub(super) to: Spot,
    pub(super) stop_s: f64,
}

/// A walker.
#[derive(Debug, Clone)]
pub(super) struct Person {
    pub(super) role: &'static str,
    pub(super) from: Spot,
    pub(super) start_s: f64,
    pub(super) speed_m_s: f64,
    pub(super) step_m: f64,
    pub(super) path: Vec<Goal>,
}

/// A world that is being drawn.
#[derive(Debug, Clone, Default)]
pub(super) struct Plan {
    pub(super) kind: &'static str,
    /// Lower left and upper right corner of all that may be free, m.
    pub(super) extent: [Spot; 2],
    /// Rectangles that are free floor: lower left and upper right corners.
    pub(super) rooms: Vec<[Spot; 2]>,
    pub(super) walls: Vec<Line>,
    pub(super) boxes: Vec<Furniture>,
    pub(super) pillars: Vec<Pillar>,
    pub(super) start: Spot,
    pub(super) heading_deg: f64,
    pub(super) speed_m_s: f64,
    pub(super) path: Vec<Goal>,
    pub(super) people: Vec<Person>,
    /// Heights of the people, in their order; those without one have the default.
    pub(super) heights_m: Vec<f64>,
}

impl Plan {
    /// As a world's file has it.
    pub(super) fn text(&self) -> String {
        let mut text = format!("# Kind: {}.\n\n", self.kind);
        // Writing into memory does not fail.
        let _ = self.write(&mut text);
        text
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        let [x, y] = self.start;
        writeln!(out, "[robot]\nstart_m = [{x:.2}, {y:.2}]\nheading_deg = {:.1}\nspeed_m_s = {:.2}", self.heading_deg, self.speed_m_s)?;
        writeln!(out, "way = [{}]\n", goals(&self.path))?;
        for wall in &self.walls {
            let corners: Vec<String> = wall.corners.iter().map(|[x, y]| format!("[{x:.2}, {y:.2}]")).collect();
            writeln!(out, "[[wall]]\nalong_m = [{}]", corners.join(", "))?;
            surface(out, wall.rough)?;
            for opening in &wall.openings {
                let Opening { at_m, width_m, depth_m, closed } = opening;
                let (table, depth) = if *closed { ("door", "recess_m") } else { ("gap", "jamb_m") };
                writeln!(out, "[[wall.{table}]]\nat_m = {at_m:.2}\nwidth_m = {width_m:.2}\n{depth} = {depth_m:.2}")?;
            }
            writeln!(out)?;
        }
        for Furniture { centre: [x, y], size: [length, width], height_m, rough } in &self.boxes {
            writeln!(out, "[[box]]\ncentre_m = [{x:.2}, {y:.2}]\nsize_m = [{length:.2}, {width:.2}]\nheight_m = {height_m:.2}")?;
            surface(out, *rough)?;
            writeln!(out)?;
        }
        for Pillar { centre: [x, y], radius_m, height_m, rough } in &self.pillars {
            writeln!(out, "[[pillar]]\ncentre_m = [{x:.2}, {y:.2}]\nradius_m = {radius_m:.2}")?;
            if let Some(height_m) = height_m {
                writeln!(out, "height_m = {height_m:.2}")?;
            }
            surface(out, *rough)?;
            writeln!(out)?;
        }
        for (number, person) in self.people.iter().enumerate() {
            let ([x, y], Person { role, start_s, speed_m_s, step_m, path, .. }) = (person.from, person);
            writeln!(out, "# {role}.\n[[walker]]\nfrom_m = [{x:.2}, {y:.2}]\nstart_s = {start_s:.1}\nspeed_m_s = {speed_m_s:.2}")?;
            writeln!(out, "step_m = {step_m:.2}")?;
            if let Some(height_m) = self.heights_m.get(number) {
                writeln!(out, "height_m = {height_m:.2}")?;
            }
            writeln!(out, "way = [{}]\n", goals(path))?;
        }
        Ok(())
    }
}

fn goals(path: &[Goal]) -> String {
    let goal = |Goal { to: [x, y], stop_s }: &Goal| {
        if *stop_s > 0.0 {
            format!("{{ to_m = [{x:.2}, {y:.2}], stop_s = {stop_s:.1} }}")
        } else {
            format!("{{ to_m = [{x:.2}, {y:.2}] }}")
        }
    };
    path.iter().map(goal).collect::<Vec<_>>().join(", ")
}

fn surface(out: &mut String, rough: bool) -> std::fmt::Result {
    if rough { writeln!(out, "surface = \"rough\"") } else { Ok(()) }
}
