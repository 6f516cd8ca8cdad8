//! No tolerance, slop or threshold is in metres: a scene and its model are the same
//! scene at every size.

use taw::prelude::*;
use taw::swarm::SwarmModel;

/// A small heap, dropped into a box, after two seconds of its own time: lengths are
/// `scale` times as long, times the square root of that.
fn heap(model: Model, scale: f32, root: f32) -> World<f32> {
    assert_eq!(root * root, scale);
    let mut world = World::default();
    world.set_model(model).unwrap();
    // How long something rests before it sleeps is in seconds, at every size.
    world.swarm.set_model(SwarmModel { sleeps: false, ..SwarmModel::default() }).unwrap();
    for (normal, offset) in [
        (Vec3::unit_y(), 0.0),
        (Vec3::unit_x(), -1.5),
        (-Vec3::unit_x(), -1.5),
        (Vec3::unit_z(), -1.5),
        (-Vec3::unit_z(), -1.5),
    ] {
        world.walls.insert(Plane::new(normal, offset * scale).unwrap()).unwrap();
    }
    for i in 0..40_u16 {
        let f = f32::from(i);
        let (x, y, z) = (f32::from(i % 3), f32::from(i / 9), f32::from(i / 3 % 3));
        let at = [x - 1.0 + y / 20.0, y + 0.5, z - 1.0 - y / 30.0];
        let position = Point3::from(at.map(|x| x * scale));
        let radius = (0.2 + f * 13.0 % 7.0 / 25.0) * scale;
        world.marbles.insert(Marble::new(position, radius)).unwrap();
    }
    for _ in 0..128 {
        world.step(root / 64.0).unwrap();
    }
    world
}

#[test]
fn a_scene_is_the_same_to_the_bit_at_every_size() {
    let impulse =
        Model { response: Response::Impulse, rotation: Rotation::Dynamic, ..Model::default() };
    let verlet = Model { integrator: Integrator::VelocityVerlet, substeps: 2, ..impulse };
    for model in [Model::default(), impulse, verlet] {
        let metre = heap(model, 1.0, 1.0);
        assert!(metre.contacts.mm.len() > 10, "{} contacts to compare", metre.contacts.mm.len());
        // Powers of four, so that scaling itself rounds nothing.
        for root in [1.0 / 1024.0, 1.0 / 32.0, 32.0, 1024.0] {
            let scale = root * root;
            let scaled = heap(model, scale, root);
            for row in 0..metre.marbles.len() {
                let at = metre.marbles.position()[row] * scale;
                assert_eq!(at, scaled.marbles.position()[row], "row {row}, {scale}, {model:?}");
                let velocity = metre.marbles.velocity()[row] * root;
                assert_eq!(velocity, scaled.marbles.velocity()[row], "row {row}, {scale}");
            }
            assert_eq!(metre.contacts.mm.len(), scaled.contacts.mm.len());
        }
    }
}
