//! Contacts as data: geometry that the narrow phase fills in, impulses that the response adds, and
//! edits between the verbs that count.

use std::collections::HashSet;

use crate::draw::Draw;
use cgmath::{EuclideanSpace, InnerSpace, MetricSpace};
use taw::prelude::*;
use taw::response::ContactLaw;
use taw::swarm::{SimdLevel, SwarmModel};

const DT: f64 = 1.0 / 64.0;

/// A floor, and a response with friction.
fn world<S: Scalar>(response: Response) -> World<S> {
    let mut world = World::default();
    let model = Model { response, rotation: Rotation::Dynamic, iterations: 50, ..Model::default() };
    world.set_model(model).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_y(), S::zero()).unwrap()).unwrap();
    world
}

fn ball<S: Scalar>(at: [f64; 3], radius: f64) -> Marble<S> {
    Marble::new(Point3::from(at.map(S::from_f64)), S::from_f64(radius))
}

/// Mass of a ball of the default density, in kg.
fn mass<S: Scalar>(world: &World<S>, row: usize) -> S {
    let radius = world.marbles.radius()[row];
    radius * radius * radius * S::from_f64(2500.0 * 4.0 / 3.0 * std::f64::consts::PI)
}

/// One substep by its verbs, so that the contacts can be looked at in between.
fn substep<S: Scalar>(world: &mut World<S>, edit: impl FnOnce(&mut World<S>)) {
    let dt = S::from_f64(DT);
    world.begin_step();
    world.integrate(dt).unwrap();
    world.generate_contacts();
    edit(world);
    world.restitute(dt).unwrap();
    world.end_step();
}

const SOLVED: [Response; 3] = [
    Response::Impulse,
    Response::Penalty(ContactLaw::SpringDashpot),
    Response::Penalty(ContactLaw::HertzMindlin),
];

const LISTED: [Response; 4] = [Response::Displacement, SOLVED[0], SOLVED[1], SOLVED[2]];

fn places_contacts<S: Scalar>(response: Response) {
    let mut world = world::<S>(response);
    world
        .walls
        .insert(Sphere::new(Point3::new(S::from_f64(5.0), S::zero(), S::zero()), S::one()).unwrap())
        .unwrap();
    for (at, radius) in [([0.0, 0.49, 0.0], 0.5), ([0.0, 1.2, 0.3], 0.3), ([5.0, 1.3, 0.6], 0.5)] {
        world.marbles.insert(ball(at, radius)).unwrap();
    }
    world.generate_contacts();
    assert_eq!((world.contacts.wm.len(), world.contacts.mm.len()), (2, 1), "{response:?}");
    let near = |x: S, y: S| (x - y).abs() <= S::epsilon() * S::from_f64(64.0);
    for contact in &world.contacts.wm {
        let center = world.marbles.position()[contact.b as usize];
        let on_marble = center + contact.arms[1];
        let wall = world.walls.shapes()[contact.a as usize].project_point(center);
        assert!(near(contact.normal.magnitude(), S::one()), "{contact:?}");
        let distance = on_marble.distance(wall.point);
        assert!(near(distance, contact.separation.abs()), "{response:?} {contact:?}");
    }
    for contact in &world.contacts.mm {
        let [a, b] = [contact.a, contact.b].map(|row| world.marbles.position()[row as usize]);
        let apart = (b + contact.arms[1]) - (a + contact.arms[0]);
        assert!(near(apart.dot(contact.normal), contact.separation), "{response:?} {contact:?}");
        assert!(near(contact.mtv().magnitude(), contact.penetration()));
    }
}

#[test]
fn surfaces_lie_as_far_apart_at_the_arms_as_the_separation_says() {
    for response in LISTED {
        places_contacts::<f32>(response);
        places_contacts::<f64>(response);
    }
}

fn change_of_momentum_is_the_impulses<S: Scalar>(response: Response) {
    let mut world = world::<S>(response);
    let number = S::from_f64;
    // Three that slide and press on each other, of unlike masses.
    for (at, radius, vx) in [
        ([0.0, 0.495, 0.0], 0.5, 2.0),
        ([0.85, 0.395, 0.1], 0.4, -1.0),
        ([0.3, 1.2, 0.1], 0.4, 0.0),
    ] {
        let mut marble = ball(at, radius);
        marble.velocity = Vec3::new(number(vx), number(-1.0), S::zero());
        world.marbles.insert(marble).unwrap();
    }
    let (mut before, mut most) = (Vec::new(), S::zero());
    substep(&mut world, |world| before = world.marbles.velocity().to_vec());
    for (row, before) in before.iter().enumerate() {
        let (velocity, mass) = (world.marbles.velocity()[row], mass(&world, row));
        let mut impulse = Vec3::new(S::zero(), S::zero(), S::zero());
        for contact in &world.contacts.wm {
            impulse +=
                contact.impulse() * if contact.b as usize == row { S::one() } else { S::zero() };
        }
        for contact in &world.contacts.mm {
            let side = |at: u32| if at as usize == row { S::one() } else { S::zero() };
            impulse += contact.impulse() * (side(contact.b) - side(contact.a));
        }
        most = most.max(impulse.magnitude());
        let gap = ((velocity - *before) * mass - impulse).magnitude();
        let digits = S::epsilon() * number(1e3) * mass;
        assert!(gap <= digits, "{response:?} {row}: {gap:?} of {digits:?}");
    }
    assert!(most > S::zero(), "nothing touched by {response:?}");
}

#[test]
fn listed_impulses_are_the_change_of_momentum() {
    for response in SOLVED {
        change_of_momentum_is_the_impulses::<f32>(response);
        change_of_momentum_is_the_impulses::<f64>(response);
    }
}

#[test]
fn friction_is_at_most_the_coefficient_times_the_normal_impulse() {
    for response in SOLVED {
        let mut world = world::<f64>(response);
        let mut marble = ball([0.0, 0.499, 0.0], 0.5);
        marble.velocity = Vec3::new(3.0, 0.0, 1.0);
        marble.material = Some(Material { friction: 0.2, ..Material::default() });
        world.marbles.insert(marble).unwrap();
        for _ in 0..8 {
            substep(&mut world, |_| ());
            for contact in &world.contacts.wm {
                let (normal, tangent) = (contact.normal_impulse, contact.tangent_impulse);
                assert!(
                    normal >= 0.0 && tangent.dot(contact.normal).abs() < 1e-9 * normal.max(1.0)
                );
                assert!(tangent.magnitude() <= 0.2 * normal * (1.0 + 1e-9), "{response:?}");
            }
        }
    }
}

#[test]
fn a_resting_marble_is_borne_by_its_weight_times_the_substep() {
    let mut world = world::<f64>(Response::Impulse);
    let id = world.marbles.insert(ball([0.0, 0.5, 0.0], 0.5)).unwrap();
    for _ in 0..64 {
        substep(&mut world, |_| ());
    }
    let row = world.marbles.row(id).unwrap();
    let weight = mass(&world, row) * 9.81 * DT;
    let impulse = world.contacts.wm[0].normal_impulse;
    assert!((impulse / weight - 1.0).abs() < 1e-9, "{impulse} for {weight}");
}

#[test]
fn a_normal_edited_between_the_verbs_is_the_one_that_solves() {
    for response in LISTED {
        let mut world = world::<f64>(response);
        let mut marble = ball([0.0, 0.49, 0.0], 0.5);
        marble.velocity = Vec3::new(0.0, -1.0, 0.0);
        let id = world.marbles.insert(marble).unwrap();
        // A ramp that nobody sees.
        let ramp = Vec3::new(0.6, 0.8, 0.0);
        substep(&mut world, |world| world.contacts.wm[0].normal = ramp);
        let velocity = world.marbles.get(id).unwrap().velocity;
        assert!(velocity.x > 0.01, "{response:?}: {velocity:?}");
    }
}

#[test]
fn a_contact_that_is_not_touching_says_so() {
    let mut world = world::<f64>(Response::Impulse);
    for (at, touches) in [(0.499, true), (0.5, true), (0.5 + 1e-6, true), (0.5 + 1e-5, false)] {
        let id = world.marbles.insert(ball([0.0, at, 0.0], 0.5)).unwrap();
        world.integrate(DT).unwrap(); // for the margin
        world.marbles.set_position(id, Point3::new(0.0, at, 0.0)).unwrap();
        world.generate_contacts();
        assert_eq!(world.contacts.wm.len(), 1, "{at}");
        assert_eq!(world.contacts.wm[0].is_touching(), touches, "{at}");
        world.marbles.remove(id).unwrap();
    }
}

/// Marbles that fly about and overlap, at rest and fast.
fn cloud<S: Scalar>(count: u32) -> World<S> {
    let mut draw = Draw(count.into());
    let mut world = World::default();
    world.set_model(Model { substeps: 1, ..Model::GAME }).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_y(), S::from_f64(-2.0)).unwrap()).unwrap();
    for _ in 0..count {
        let mut vector =
            |most: f64| Vec3::new(0, 0, 0).map(|_: i32| S::from_f64(draw.between(-most, most)));
        let (at, velocity) = (Point3::from_vec(vector(2.0)), vector(3.0));
        let velocity = if at.x > S::zero() { velocity } else { velocity * S::from_f64(0.01) };
        let marble = Marble { velocity, ..Marble::new(at, S::from_f64(draw.between(0.05, 0.2))) };
        world.marbles.insert(marble).unwrap();
    }
    world
}

/// Checks that all pairs that touch or may do so within the step are listed, whoever looks for them, and
/// no others.
#[test]
fn soft_step_lists_the_pairs_that_are_near() {
    lists_the_pairs_that_are_near::<f32>();
    lists_the_pairs_that_are_near::<f64>();
}

fn lists_the_pairs_that_are_near<S: Scalar>() {
    let dt = S::from_f64(DT);
    for count in [300, 1_000, 3_000] {
        let mut world = cloud::<S>(count);
        let mut portable = world.clone();
        portable.swarm.set_simd_level(SimdLevel::PORTABLE);
        let model = SwarmModel { threads: 3, ..portable.swarm.model() };
        portable.swarm.set_model(model).unwrap();
        for world in [&mut world, &mut portable] {
            world.begin_step();
            world.integrate(dt).unwrap();
            world.generate_contacts();
        }
        assert_eq!(world.contacts, portable.contacts, "{count} marbles");
        let listed: HashSet<_> = world.contacts.mm.iter().map(|c| (c.a, c.b)).collect();
        assert_eq!(listed.len(), world.contacts.mm.len(), "each once");
        let (at, velocity) = (world.marbles.position(), world.marbles.velocity());
        let radius = world.marbles.radius();
        let mut near = 0;
        for b in 0..at.len() {
            for a in 0..b {
                let apart = (at[b] - at[a]).cast::<f64>().unwrap();
                let separation = apart.magnitude() - radius[a].as_f64() - radius[b].as_f64();
                let speed = (velocity[a] - velocity[b]).cast::<f64>().unwrap().dot(apart);
                let closes = (speed / apart.magnitude()).max(0.0) * DT;
                let beyond = separation - 2.0 * 9.81 * DT * DT - closes;
                let is_listed = listed.contains(&(a as u32, b as u32));
                assert!(beyond.abs() < 1e-5 || is_listed == (beyond < 0.0), "{a} {b}: {beyond}");
                near += u32::from(is_listed);
            }
        }
        assert!(near > count / 20, "{near} of {count} are near");
        world.restitute(dt).unwrap();
    }
}
