//! Marbles that turn less than their world could.

use taw::prelude::*;

#[test]
fn a_marble_may_turn_less_than_its_world() {
    for response in
        [Response::Impulse, Response::Penalty(ContactLaw::SpringDashpot), Response::EventDriven]
    {
        let mut world = World::<f64>::default();
        let rotation = Rotation::Dynamic;
        world.set_model(Model { response, rotation, substeps: 16, ..Model::default() }).unwrap();
        world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
        let material = Material { restitution: 0.0, friction: 0.2, ..Material::default() };
        let ids = [None, Some(Rotation::Rolling), Some(Rotation::None)].map(|rotation_model| {
            let z = rotation_model.map_or(0.0, |model| 3.0 + 3.0 * f64::from(model as u8));
            let marble = Marble {
                velocity: Vec3::new(5.0, 0.0, 0.0),
                rotation_model,
                material: Some(material),
                ..Marble::new(Point3::new(0.0, 0.5, z), 0.5)
            };
            world.marbles.insert(marble).unwrap()
        });
        for _ in 0..60 {
            world.step(1.0 / 60.0).unwrap();
        }
        let [free, rolls, slides] = ids.map(|id| world.marbles.get(id).unwrap());
        // It rolls after 2 v / (7 µ g) = 0.73 s, and is slowed no more.
        assert!((free.velocity.x - 25.0 / 7.0).abs() < 1e-2, "{response:?}: {free:?}");
        assert!(
            (free.angular_velocity.z + free.velocity.x / 0.5).abs() < 2e-2,
            "{response:?}: {free:?}"
        );
        let slid = 5.0 - 0.2 * 9.81;
        for marble in [rolls, slides] {
            assert!((marble.velocity.x - slid).abs() < 2e-2, "{response:?}: {marble:?}");
        }
        assert!(
            (rolls.angular_velocity.z + rolls.velocity.x / 0.5).abs() < 0.2,
            "{response:?}: {rolls:?}"
        );
        let unturned = taw::math::Quat::new(1.0, 0.0, 0.0, 0.0);
        assert_eq!(
            (slides.angular_velocity, slides.rotation),
            (Vec3::new(0.0, 0.0, 0.0), unturned)
        );
        assert_ne!(rolls.rotation, unturned);
    }
}

#[test]
fn a_spin_that_only_shows_is_no_energy() {
    let mut world = World::<f64>::default();
    world.set_model(Model { rotation: Rotation::Rolling, ..Model::default() }).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    let velocity = Vec3::new(5.0, 0.0, 0.0);
    let ball = Marble { velocity, ..Marble::new(Point3::new(0.0, 0.5, 0.0), 0.5) };
    let id = world.marbles.insert(ball).unwrap();
    let energy = world.energy().total();
    for _ in 0..60 {
        world.step(1.0 / 60.0).unwrap();
        assert!((world.energy().total() / energy - 1.0).abs() < 1e-9, "{:?}", world.energy());
    }
    assert!(
        (world.marbles.get(id).unwrap().angular_velocity.z + 10.0).abs() < 1e-9,
        "it rolls, to be seen"
    );
}
