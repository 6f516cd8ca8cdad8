use super::*;
use crate::contact::Contact;
use crate::math::{Point3, Quat};
use crate::motion::Integrator;
use crate::response::{Material, Response};
use crate::shape::Plane;
use cgmath::InnerSpace;

const DT: f32 = 1.0 / 60.0;

fn floor<S: Scalar>() -> World<S> {
    let mut world = World::default();
    let plane = Plane::new(Vec3::unit_y(), S::zero()).unwrap();
    world.walls.insert(plane).unwrap();
    world
}

/// A heap of marbles of many sizes, dropped on a floor.
fn heap() -> World<f32> {
    let mut world = floor();
    for i in 0..200_u8 {
        let f = f32::from(i);
        let position = Point3::new(f % 5.0, 0.5 + f / 10.0, f * 7.0 % 5.0);
        let radius = 0.1 + f % 13.0 / 30.0;
        world.marbles.insert(Marble::new(position, radius)).unwrap();
    }
    world
}

#[test]
fn a_step_is_its_three_verbs() {
    let (mut whole, mut parts) = (heap(), heap());
    for _ in 0..60 {
        whole.step(DT).unwrap();
        parts.integrate(DT).unwrap();
        parts.generate_contacts();
        parts.restitute(DT).unwrap();
    }
    assert_eq!(whole, parts);
    assert!(!whole.contacts.mm.is_empty() && !whole.contacts.wm.is_empty());
}

#[test]
fn a_clone_is_a_snapshot_that_steps_to_the_same_bits() {
    let mut world = heap();
    for _ in 0..60 {
        world.step(DT).unwrap();
    }
    let mut clone = world.clone();
    for _ in 0..60 {
        world.step(DT).unwrap();
        clone.step(DT).unwrap();
    }
    assert_eq!(world, clone);
}

#[test]
fn a_heap_comes_to_rest_and_nothing_falls_through() {
    let mut world = heap();
    world.set_model(Model { substeps: 4, ..Model::default() }).unwrap();
    for _ in 0..1200 {
        world.step(DT).unwrap();
    }
    for (center, radius) in world.marbles.position().iter().zip(world.marbles.radius()) {
        // One pass over the contacts lets a heap sag; through the floor it never goes.
        assert!(center.y >= radius * 0.99, "a marble of {radius} m is at {} m", center.y);
    }
}

#[test]
fn substeps_are_steps_of_a_part() {
    let (mut whole, mut parts) = (heap(), heap());
    whole.set_model(Model { substeps: 4, ..Model::default() }).unwrap();
    for _ in 0..30 {
        whole.step(DT).unwrap();
        (0..4).for_each(|_| parts.step(DT / 4.0).unwrap());
    }
    assert_eq!(whole.marbles, parts.marbles);
}

#[test]
fn a_bad_step_changes_nothing() {
    let mut world = heap();
    world.step(DT).unwrap();
    let before = world.clone();
    for dt in [0.0, -DT, f32::NAN, f32::INFINITY] {
        let error = world.step(dt).unwrap_err();
        assert!(matches!(error, Error::NotPositive { field: "dt", .. }), "{error}");
    }
    assert!(world.integrate(0.0).is_err() && world.restitute(-1.0).is_err());
    assert_eq!(world, before);
}

#[test]
fn a_bad_force_is_refused_and_changes_nothing() {
    let mut world = floor::<f32>();
    let anchor = Point3::new(0.0, 0.0, 0.0);
    let spring = |stiffness| ForceField::Spring { anchor, rest_length: 0.0, stiffness };
    world.set_forces(vec![spring(1.0)]).unwrap();
    let error = world.set_forces(vec![spring(2.0), spring(-1.0)]).unwrap_err();
    assert!(error.to_string().starts_with("stiffness"), "{error}");
    assert_eq!(world.forces(), [spring(1.0)]);
}

#[test]
fn mass_and_gravity_scale_say_what_forces_do() {
    let mut world = World::<f64>::default();
    world.set_gravity(Vec3::new(0.0, -8.0, 0.0)).unwrap();
    world.set_forces(vec![ForceField::Custom(|_, _| Vec3::new(12.0, 0.0, 0.0))]).unwrap();
    let fallen = |marble: Marble<f64>| {
        let mut world = world.clone();
        let id = world.marbles.insert(marble).unwrap();
        world.marbles.apply_impulse(id, Vec3::new(0.0, 0.0, 6.0)).unwrap();
        (0..64).for_each(|_| world.step(1.0 / 64.0).unwrap());
        world.marbles.get(id).unwrap().velocity
    };
    let marble = Marble::new(Point3::new(0.0, 0.0, 0.0), 0.5);
    let heavy = Marble { mass: Mass::Kilograms(3.0), ..marble };
    assert_eq!(fallen(heavy), Vec3::new(4.0, -8.0, 2.0));
    assert_eq!(fallen(Marble { gravity_scale: -0.5, ..heavy }), Vec3::new(4.0, 4.0, 2.0));
    assert_eq!(fallen(Marble { mass: Mass::Infinite, ..marble }), Vec3::new(0.0, 0.0, 0.0));
    let glass = fallen(marble);
    let mass = 2500.0 * std::f64::consts::PI / 6.0;
    assert!((glass.x - 12.0 / mass).abs() < 1e-15 && (glass.z - 6.0 / mass).abs() < 1e-15);
}

#[test]
fn a_rolling_marble_turns_by_its_way_over_its_radius() {
    let mut world = floor::<f64>();
    world.set_model(Model { rotation: Rotation::Rolling, ..Model::default() }).unwrap();
    let velocity = Vec3::new(2.0, 0.0, 0.0);
    let marble = Marble { velocity, ..Marble::new(Point3::new(0.0, 0.25, 0.0), 0.25) };
    let id = world.marbles.insert(marble).unwrap();
    world.step(1.0 / 64.0).unwrap(); // from here on it spins
    let start = world.marbles.get(id).unwrap();
    (0..16).for_each(|_| world.step(1.0 / 64.0).unwrap());
    let end = world.marbles.get(id).unwrap();
    // Toward +x over a floor is clockwise about z.
    let angle = -(end.position.x - start.position.x) / 0.25;
    let turned = start.rotation.conjugate() * end.rotation;
    let exact = Quat::new((angle / 2.0).cos(), 0.0, 0.0, (angle / 2.0).sin());
    assert!((turned - exact).magnitude() < 1e-12, "{turned:?}, not {exact:?}");
    assert_eq!(end.angular_velocity, Vec3::new(0.0, 0.0, -8.0));
}

#[test]
fn rotation_takes_columns_only_while_it_is_modelled() {
    let mut world = heap();
    world.step(DT).unwrap();
    assert!(world.marbles.rotation().is_empty() && world.marbles.angular_velocity().is_empty());
    let without = world.clone();
    world.set_model(Model { rotation: Rotation::Rolling, ..Model::default() }).unwrap();
    assert_eq!(world.marbles.rotation().len(), 200);
    let id = world.marbles.id(7).unwrap();
    world.marbles.set_angular_velocity(id, Vec3::new(1.0, 0.0, 0.0)).unwrap();
    world.marbles.remove(world.marbles.id(0).unwrap()).unwrap();
    assert_eq!(world.marbles.get(id).unwrap().angular_velocity.x, 1.0);
    assert!(world.marbles.set_rotation(id, Quat::new(0.0, 0.0, 0.0, 0.0)).is_err());
    world.marbles.insert(Marble::new(Point3::new(0.0, 9.0, 0.0), 0.1)).unwrap();
    (0..60).for_each(|_| world.step(DT).unwrap());
    world.set_model(Model::default()).unwrap();
    assert!(world.marbles.rotation().is_empty() && world.marbles.angular_velocity().is_empty());
    assert_eq!(without.marbles.len(), world.marbles.len());
}

#[test]
fn a_bad_setting_is_refused_and_changes_nothing() {
    let mut world = heap();
    let before = world.clone();
    let error = world.set_gravity(Vec3::new(0.0, 0.0, f32::NAN)).unwrap_err();
    assert_eq!(error.to_string(), "gravity.z must be finite, but is NaN");
    for substeps in [0, 1001] {
        let error = world.set_model(Model { substeps, ..Model::default() }).unwrap_err();
        assert!(matches!(error, Error::OutOfRange { field: "substeps", .. }), "{error}");
    }
    assert_eq!(world, before);
}

#[test]
fn a_bad_marble_is_refused_and_changes_nothing() {
    let mut world = floor::<f32>();
    let good = Marble::new(Point3::new(0.0, 1.0, 0.0), 0.5);
    let id = world.marbles.insert(good).unwrap();
    let before = world.clone();
    let nan = f32::NAN;
    let material =
        |restitution, friction| Some(Material { restitution, friction, ..Material::default() });
    let bad = [
        (Marble { position: Point3::new(nan, 0.0, 0.0), ..good }, "position.x"),
        (Marble { radius: 0.0, ..good }, "radius"),
        (Marble { velocity: Vec3::new(0.0, 0.0, f32::INFINITY), ..good }, "velocity.z"),
        (Marble { material: material(1.1, 0.0), ..good }, "restitution"),
        (Marble { material: material(0.5, nan), ..good }, "friction"),
    ];
    for (marble, field) in bad {
        let error = world.marbles.insert(marble).unwrap_err().to_string();
        assert!(error.starts_with(field), "{error}");
    }
    assert!(world.marbles.set_position(id, Point3::new(0.0, nan, 0.0)).is_err());
    assert!(world.marbles.set_velocity(id, Vec3::new(nan, 0.0, 0.0)).is_err());
    assert!(world.marbles.set_radius(id, -1.0).is_err());
    assert!(world.marbles.set_material(id, material(-0.1, 0.0)).is_err());
    assert_eq!(world, before);
}

#[test]
fn a_removed_handle_names_nothing() {
    let mut world = floor::<f32>();
    let first = world.marbles.insert(Marble::new(Point3::new(0.0, 1.0, 0.0), 0.5)).unwrap();
    let second = world.marbles.insert(Marble::new(Point3::new(0.0, 9.0, 0.0), 0.2)).unwrap();
    assert_eq!(world.marbles.remove(first).unwrap().radius, 0.5);
    assert_eq!(world.marbles.remove(first), Err(Error::NoSuchMarble(first)));
    assert!(world.marbles.set_radius(first, 1.0).is_err());
    assert_eq!(world.marbles.get(second).unwrap().radius, 0.2);
    let wall = world.walls.id(0).unwrap();
    world.walls.remove(wall).unwrap();
    assert_eq!(world.walls.get(wall), Err(Error::NoSuchWall(wall)));
}

#[test]
fn an_overflowing_marble_is_stopped_and_no_other_changes_by_a_bit() {
    let (mut healthy, mut sick) = (heap(), heap());
    let far = Point3::new(-3e38, 0.0, 0.0);
    for world in [&mut healthy, &mut sick] {
        world.marbles.insert(Marble::new(far, 0.5)).unwrap();
    }
    let id = sick.marbles.id(200).unwrap();
    sick.marbles.set_velocity(id, Vec3::new(-3e38, 0.0, 0.0)).unwrap();
    for world in [&mut healthy, &mut sick] {
        world.step(1.0).unwrap();
    }
    assert_eq!(sick.stopped().collect::<Vec<_>>(), [id]);
    assert_eq!(healthy.stopped().count(), 0);
    let stopped = sick.marbles.get(id).unwrap();
    assert_eq!((stopped.position.x, stopped.velocity.x), (-3e38, 0.0));
    assert_eq!(sick.marbles.position()[..200], healthy.marbles.position()[..200]);
    assert_eq!(sick.marbles.velocity()[..200], healthy.marbles.velocity()[..200]);
}

#[test]
fn a_marble_may_have_its_own_integrator() {
    let mut world = World::<f64>::default();
    let origin = Point3::new(0.0, 0.0, 0.0);
    let explicit =
        Marble { integrator: Some(Integrator::ExplicitEuler), ..Marble::new(origin, 0.5) };
    let ids = [Marble::new(origin + Vec3::unit_x() * 9.0, 0.5), explicit]
        .map(|marble| world.marbles.insert(marble).unwrap());
    world.set_gravity(Vec3::new(0.0, -30.0, 0.0)).unwrap();
    for _ in 0..30 {
        world.step(1.0 / 30.0).unwrap();
    }
    let fallen = ids.map(|id| -world.marbles.get(id).unwrap().position.y);
    assert!((fallen[0] - 15.5).abs() < 1e-12, "the model's: {}", fallen[0]);
    assert!((fallen[1] - 14.5).abs() < 1e-12, "its own: {}", fallen[1]);
}

#[test]
fn a_contact_taken_out_is_not_restituted_and_a_made_up_one_is_passed_over() {
    let mut world = floor::<f32>();
    let id = world.marbles.insert(Marble::new(Point3::new(0.0, 0.0, 0.0), 0.5)).unwrap();
    world.generate_contacts();
    assert_eq!(world.contacts.wm.len(), 1);
    world.contacts.wm[0].b = 77;
    world.contacts.mm.push(Contact::between_marbles(0, 1));
    world.restitute(DT).unwrap();
    assert_eq!(world.marbles.get(id).unwrap().position.y, 0.0);
}

#[test]
fn a_model_equal_to_the_current_one_changes_nothing() {
    let mut world = floor::<f64>();
    let model = Model { response: Response::Impulse, ..Model::default() };
    world.set_model(model).unwrap();
    world.marbles.insert(Marble::new(Point3::new(0.0, 0.5, 0.0), 0.5)).unwrap();
    for _ in 0..4 {
        world.step(1.0 / 64.0).unwrap();
    }
    assert!(!world.memory.impulses.is_empty(), "the contact remembers an impulse");
    let before = world.clone();
    world.set_model(model).unwrap();
    assert_eq!(world, before);
}
