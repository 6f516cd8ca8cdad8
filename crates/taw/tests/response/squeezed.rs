//! A light ball squeezed between a heavy one and the floor, under `Response::Impulse`: it meets both in
//! one substep, though free motion leads it away from one of them.

use taw::prelude::*;

const RADIUS: f64 = 0.1;
const STEP: f64 = 1.0 / 240.0;
const STEPS: usize = 120;

/// A heavy ball of 25 kg that falls onto one of 1 kg, which falls onto a floor.
fn heavy_on_light() -> World<f64> {
    let mut world = World::default();
    let (response, detection) = (Response::Impulse, Detection::Discrete);
    world.set_model(Model { response, detection, ..Model::default() }).unwrap();
    let floor = Plane::through(Point3::new(0.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0)).unwrap();
    world.walls.insert(floor).unwrap();
    for (height, mass) in [(2.0 * RADIUS, 1.0), (0.87, 25.0)] {
        let material = Some(Material { restitution: 0.5, ..Material::default() });
        let mass = Mass::Kilograms(mass);
        let ball = Marble { mass, material, ..Marble::new(Point3::new(0.0, height, 0.0), RADIUS) };
        world.marbles.insert(ball).unwrap();
    }
    world
}

/// The first half of a step, after which contacts may be edited.
fn find_contacts(world: &mut World<f64>) {
    world.begin_step();
    world.begin_substep(0.0);
    world.integrate(STEP).unwrap();
    world.generate_contacts();
}

/// Returns true if a contact is listed that neither touches nor closes by gravity in two steps.
fn lists_open_contacts(world: &World<f64>) -> bool {
    let margin = 2.0 * world.gravity().magnitude() * STEP * STEP;
    let Contacts { wm, mm } = &world.contacts;
    wm.iter().chain(mm).any(|contact| contact.separation > margin)
}

#[test]
fn a_light_ball_bounces_under_a_falling_heavy_one_without_sinking_into_it_or_the_floor() {
    let mut world = heavy_on_light();
    for step in 0..STEPS {
        world.step(STEP).unwrap();
        let at = world.marbles.position();
        let deepest = (RADIUS - at[0].y).max(2.0 * RADIUS - (at[1] - at[0]).magnitude());
        // That is what nobody sees.
        assert!(deepest < 0.1 * RADIUS, "{deepest} m deep in step {step}");
    }
}

#[test]
fn contacts_that_have_opened_are_solved_but_not_listed_after_a_step() {
    let mut world = heavy_on_light();
    let mut opened = 0;
    for step in 0..STEPS {
        find_contacts(&mut world);
        opened += u32::from(lists_open_contacts(&world));
        world.restitute(STEP).unwrap();
        assert!(!lists_open_contacts(&world), "step {step}: {:?}", world.contacts);
        world.end_step();
    }
    assert!(opened > 0, "none has opened");
}

#[test]
fn a_contact_that_has_opened_is_not_solved_if_it_is_taken_out() {
    let mut world = heavy_on_light();
    for _ in 0..STEPS {
        find_contacts(&mut world);
        if lists_open_contacts(&world) {
            world.contacts.clear();
            let before = world.marbles.velocity().to_vec();
            world.restitute(STEP).unwrap();
            assert_eq!(world.marbles.velocity(), before);
            return;
        }
        world.restitute(STEP).unwrap();
        world.end_step();
    }
    panic!("none has opened");
}

#[test]
fn looking_for_contacts_between_steps_changes_no_step() {
    let (mut world, mut observed) = (heavy_on_light(), heavy_on_light());
    for _ in 0..STEPS {
        world.step(STEP).unwrap();
        observed.step(STEP).unwrap();
        observed.generate_contacts();
        assert_eq!(world.marbles.position(), observed.marbles.position());
    }
}
