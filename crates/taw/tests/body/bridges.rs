//! Chains of links between two places.

use super::*;
use taw::joint::{Joint, JointDrive, JointEnd, JointKind, JointMotor};
use taw::world::Marble;

/// Length of a link from hinge to hinge, in metres.
const LINK: f64 = 0.22;

/// Links on hinges between two places `span` times their length apart, folded up and down so that the hinges fit, or
/// placed evenly on the line between the two.
fn bridge(
    links: usize,
    span: f64,
    is_folded: bool,
    motor: Option<JointMotor<f32>>,
) -> (World<f32>, Vec<BodyId>) {
    let mut world = world::<f32>(false);
    let kind = JointKind::Hinge(JointDrive { limits: None, motor });
    let turn = if is_folded { span.acos() } else { 0.0 };
    let mut before = JointEnd::world(point(0.0, 0.0, 0.0));
    let mut ids = Vec::new();
    for i in 0..links {
        let x = LINK * span * (i as f64 + 0.5);
        let (y, angle) = (-0.5 * LINK * turn.sin(), if i % 2 == 0 { -turn } else { turn });
        let link = cuboid([0.1, 0.02, 0.25], point(x, y, 0.0));
        let link = world.bodies.insert(Body { rotation: about_z(angle), ..link }).unwrap();
        let half = LINK * 0.5;
        let ends = [before, JointEnd::body(link, vector(-half, 0.0, 0.0))];
        world.joints.insert(Joint::new(kind, ends)).unwrap();
        before = JointEnd::body(link, vector(half, 0.0, 0.0));
        ids.push(link);
    }
    let end = JointEnd::world(point(LINK * span * links as f64, 0.0, 0.0));
    world.joints.insert(Joint::new(kind, [before, end])).unwrap();
    (world, ids)
}

/// Widest gap between the ends of neighbours, in metres.
fn gap(world: &World<f32>, links: &[BodyId]) -> f32 {
    let end = |id: BodyId, x: f64| {
        world.bodies.pose(id).unwrap().transform_point(point(x * LINK * 0.5, 0.0, 0.0))
    };
    let gaps = links.windows(2).map(|two| (end(two[1], -1.0) - end(two[0], 1.0)).magnitude());
    gaps.fold(0.0, f32::max)
}

/// Two links that are a hundredth longer than the distance of their ends sag.
#[test]
#[ignore = "they float, with a hinge open: the axial error that cannot be mended locks them"]
fn links_that_are_placed_too_long_sag() {
    let (mut world, links) = bridge(2, 0.99, false, None);
    run(&mut world, 8.0);
    assert!(gap(&world, &links) < 1e-3, "{}", gap(&world, &links));
    assert!(place(&world, links[0]).y < -0.005, "{:?}", place(&world, links[0]));
}

/// A marble that falls on a bridge of eight links makes no energy.
#[test]
#[ignore = "a marble that lands triples the energy of a long chain in four substeps; in sixteen it does not"]
fn a_marble_that_lands_on_a_bridge_makes_no_energy() {
    let (mut world, links) = bridge(8, 0.9, true, None);
    let material = material(0.3, 0.0);
    let marble = Marble {
        mass: Mass::Kilograms(18.0),
        velocity: vector(0.0, -3.0, 0.0),
        material: Some(material),
        ..Marble::new(point(LINK * 3.0, 0.6, 0.0), 0.12)
    };
    world.marbles.insert(marble).unwrap();
    let energy = |world: &World<f32>| {
        let bodies = world.bodies.ids().map(|id| {
            let mass = world.bodies.mass_properties(id).unwrap().map_or(0.0, |of| of.mass);
            let height = world.bodies.get(id).unwrap().position.y;
            world.bodies.kinetic_energy(id).unwrap() + mass * 9.81 * height
        });
        let Vec3 { x, y, z } = world.marbles.velocity()[0];
        let speed2 = x * x + y * y + z * z;
        bodies.sum::<f32>() + 18.0 * (0.5 * speed2 + 9.81 * world.marbles.position()[0].y)
    };
    let first = energy(&world);
    for _ in 0..180 {
        step(&mut world);
        let now = energy(&world);
        assert!(now < first + 2.0, "{now} of {first} J, gap {}", gap(&world, &links));
    }
}

/// Brakes in the hinges of a bridge hold it together.
#[test]
#[ignore = "they tear it"]
fn brakes_in_a_bridge_tear_nothing() {
    let brake = JointMotor::Speed { target: 0.0, max: 1.0 };
    let (mut world, links) = bridge(8, 0.9, true, Some(brake));
    for _ in 0..1200 {
        step(&mut world);
        assert!(gap(&world, &links) < 0.01 * LINK as f32, "{}", gap(&world, &links));
    }
}
