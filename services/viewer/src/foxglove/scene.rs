//! The scene that the page draws over the map, for the 3D panel of Foxglove.

use drivelog::{Format, foxglove_format, timestamp};
use foxglove::messages::line_primitive::Type;
use foxglove::messages::{
    Color, CylinderPrimitive, LinePrimitive, Point3, Pose, SceneEntity, SceneUpdate, SpherePrimitive, TextPrimitive, Vector3,
};
use prost::Message;
use std::f64::consts::TAU;

use crate::scene::{Region, SceneView, SonarCone, WalkerView};

/// The topic of the scene.
pub(super) const TOPIC: &str = "viewer/scene";
/// Colours, as on the page.
const CONE: [u8; 3] = [217, 150, 10];
const WALKER: [u8; 3] = [192, 38, 211];
const REGION: [u8; 3] = [124, 58, 237];
const WITHHELD: [u8; 3] = [217, 45, 32];
const TRUE_WALKER: [u8; 3] = [14, 147, 132];
/// Height of a walker, m.
const HEIGHT_M: f64 = 1.7;
/// Radius of a true walker, m.
const TRUE_WALKER_RADIUS_M: f64 = 0.2;
/// Diameter of a withheld echo, m.
const ECHO_M: f64 = 0.08;
/// Corners of a circle.
const CORNERS: u32 = 24;

/// The format of the channel, `foxglove.SceneUpdate`.
pub(super) fn format() -> Format {
    foxglove_format::<SceneUpdate>()
}

/// The scene at this time; it supersedes the one before.
pub(super) fn encode(scene: &SceneView, stamp_ns: u64) -> Vec<u8> {
    let SceneView { cones, walkers, sonar_movers, regions, withheld, true_walkers, .. } = scene;
    let true_walkers = true_walkers.iter().map(|[x, y]| pillar(Region { x: *x, y: *y, radius: TRUE_WALKER_RADIUS_M }, TRUE_WALKER));
    let circles = regions.iter().map(|it| circle(it, REGION)).chain(sonar_movers.iter().map(|it| circle(it, CONE)));
    let entity = SceneEntity {
        timestamp: Some(timestamp(stamp_ns)),
        frame_id: "map".to_owned(),
        id: "scene".to_owned(),
        cylinders: walkers.iter().map(|walker| pillar(walker.region, WALKER)).chain(true_walkers).collect(),
        texts: walkers.iter().map(name).collect(),
        lines: [rays(cones), velocities(walkers)].into_iter().chain(circles).collect(),
        spheres: withheld.iter().map(|[x, y]| echo(*x, *y)).collect(),
        ..SceneEntity::default()
    };
    Message::encode_to_vec(&SceneUpdate { deletions: Vec::new(), entities: vec![entity] })
}

/// The axis of each cone, up to its range.
fn rays(cones: &[SonarCone]) -> LinePrimitive {
    let ends =
        |cone: &SonarCone| [point(cone.x, cone.y), point(cone.x + cone.range * cone.yaw.cos(), cone.y + cone.range * cone.yaw.sin())];
    let shade = |cone: &SonarCone| colour(CONE, if cone.echo { 1.0 } else { 0.2 });
    LinePrimitive {
        colors: cones.iter().flat_map(|cone| [shade(cone), shade(cone)]).collect(),
        ..segments(cones.iter().flat_map(ends), CONE)
    }
}

/// The displacement of each walker in a second.
fn velocities(walkers: &[WalkerView]) -> LinePrimitive {
    let ends =
        |walker: &WalkerView| [point(walker.region.x, walker.region.y), point(walker.region.x + walker.vx, walker.region.y + walker.vy)];
    segments(walkers.iter().flat_map(ends), WALKER)
}

fn segments(points: impl Iterator<Item = Point3>, rgb: [u8; 3]) -> LinePrimitive {
    let line = circle(&Region { x: 0.0, y: 0.0, radius: 0.0 }, rgb);
    LinePrimitive { r#type: Type::LineList as i32, points: points.collect(), ..line }
}

fn circle(region: &Region, rgb: [u8; 3]) -> LinePrimitive {
    let corner = |corner: u32| {
        let (sin, cos) = (TAU * f64::from(corner) / f64::from(CORNERS)).sin_cos();
        point(region.x + region.radius * cos, region.y + region.radius * sin)
    };
    LinePrimitive {
        r#type: Type::LineLoop as i32,
        pose: Some(Pose::default()),
        thickness: 2.0,
        scale_invariant: true,
        points: (0..CORNERS).map(corner).collect(),
        color: Some(colour(rgb, 1.0)),
        ..LinePrimitive::default()
    }
}

fn pillar(region: Region, rgb: [u8; 3]) -> CylinderPrimitive {
    let size = Vector3 { x: 2.0 * region.radius, y: 2.0 * region.radius, z: HEIGHT_M };
    let pose = Some(place(region.x, region.y, 0.5 * HEIGHT_M));
    CylinderPrimitive { pose, size: Some(size), bottom_scale: 1.0, top_scale: 1.0, color: Some(colour(rgb, 0.6)) }
}

fn name(walker: &WalkerView) -> TextPrimitive {
    TextPrimitive {
        pose: Some(place(walker.region.x, walker.region.y, HEIGHT_M + 0.2)),
        billboard: true,
        font_size: 16.0,
        scale_invariant: true,
        color: Some(colour(WALKER, 1.0)),
        text: walker.name.clone(),
    }
}

fn echo(x: f64, y: f64) -> SpherePrimitive {
    let size = Some(Vector3 { x: ECHO_M, y: ECHO_M, z: ECHO_M });
    SpherePrimitive { pose: Some(place(x, y, 0.0)), size, color: Some(colour(WITHHELD, 1.0)) }
}

fn place(x: f64, y: f64, z: f64) -> Pose {
    let upright = foxglove::messages::Quaternion { w: 1.0, ..Default::default() };
    Pose { position: Some(Vector3 { x, y, z }), orientation: Some(upright) }
}

fn point(x: f64, y: f64) -> Point3 {
    Point3 { x, y, z: 0.0 }
}

fn colour([r, g, b]: [u8; 3], a: f64) -> Color {
    let share = |value: u8| f64::from(value) / 255.0;
    Color { r: share(r), g: share(g), b: share(b), a }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;
    use messages::{TrackedWalker, Walkers};

    #[test]
    fn a_walker_is_drawn_with_name_and_velocity() {
        let mut scene = Scene::new(0.05, None);
        let walker = TrackedWalker { x_m: 2.0, y_m: -1.0, velocity_x_m_s: 0.5, track: 3, ..TrackedWalker::default() };
        let mut walkers = Walkers { count: 1, ..Walkers::default() };
        walkers.walkers[0] = walker;
        scene.message(1, 10, &walkers);
        let update = <SceneUpdate as foxglove::Decode>::decode(encode(&scene.view(), 10).as_slice()).unwrap();
        let [entity] = &update.entities[..] else { panic!("one entity") };
        let at = entity.cylinders[0].pose.as_ref().unwrap().position.unwrap();
        assert_eq!((at.x, at.y, entity.texts[0].text.as_str(), entity.cylinders.len()), (2.0, -1.0, "C", 1));
        let velocity: Vec<[f64; 2]> = entity.lines[1].points.iter().map(|point| [point.x, point.y]).collect();
        assert_eq!(velocity, [[2.0, -1.0], [2.5, -1.0]]);
        assert!(entity.lines[0].points.is_empty() && entity.spheres.is_empty());
    }
}
