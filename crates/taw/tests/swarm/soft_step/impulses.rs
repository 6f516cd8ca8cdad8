//! Contacts and impacts have their impulses.

use cgmath::{InnerSpace, Zero};
use taw::prelude::*;
use taw::shape::Aabb;
use taw::swarm::SwarmModel;

use super::{floor, world};

const DT: f64 = 1.0 / 60.0;

/// Mass of a marble of the default density, in kg.
fn mass<S: Scalar>(world: &World<S>, row: usize) -> f64 {
    let radius = world.marbles.radius()[row];
    Mass::<S>::default().of(radius).as_f64()
}

/// Momentum that each marble got in a step besides gravity's, and the sum of its contacts' impulses; in N s.
fn balances<S: Scalar>(world: &mut World<S>) -> Vec<[Vec3<f64>; 2]> {
    let dt = S::from_f64(DT);
    let before = world.marbles.velocity().to_vec();
    world.step(dt).unwrap();
    let number = |v: Vec3<S>| v.map(S::as_f64);
    let mut balances: Vec<_> = before
        .iter()
        .zip(world.marbles.velocity())
        .enumerate()
        .map(|(row, (before, after))| {
            let gained = number(*after - before - world.gravity() * dt);
            [gained * mass(world, row), Vec3::zero()]
        })
        .collect();
    for c in &world.contacts.wm {
        balances[c.b as usize][1] += number(c.impulse());
    }
    for c in &world.contacts.mm {
        balances[c.a as usize][1] -= number(c.impulse());
        balances[c.b as usize][1] += number(c.impulse());
    }
    balances
}

/// Marbles of many sizes that fall into a box, with friction and this restitution.
fn pour<S: Scalar>(seed: u64, restitution: f64) -> World<S> {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut world = world::<S>(4);
    world.swarm.set_model(SwarmModel { sleeps: false, ..SwarmModel::default() }).unwrap();
    floor(&mut world);
    let s = S::from_f64;
    for (x, z) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
        let normal = Vec3::new(s(x), S::zero(), s(z));
        world.walls.insert(Plane::new(normal, s(-1.0)).unwrap()).unwrap();
    }
    let (min, max) = (Point3::new(s(-0.3), s(0.0), s(-0.3)), Point3::new(s(0.3), s(0.4), s(0.3)));
    world.walls.insert(Aabb { min, max }).unwrap();
    let material =
        Material { restitution: s(restitution), friction: s(0.4), ..Material::default() };
    for i in 0..60 {
        let mut around = || 1.6 * random.f64() - 0.8;
        let at = [around(), 0.7 + 0.05 * f64::from(i), around()];
        let radius = s(0.05 + 0.15 * random.f64());
        let marble =
            Marble { material: Some(material), ..Marble::new(Point3::from(at.map(s)), radius) };
        world.marbles.insert(marble).unwrap();
    }
    world
}

/// Momentum that the contacts do not account for, over what marbles got, in a pour of four seconds.
fn unaccounted<S: Scalar>(seed: u64, restitution: f64) -> f64 {
    let mut world = pour::<S>(seed, restitution);
    world.set_records_impulses(true);
    let (mut off, mut all) = (0.0, 0.0);
    for _ in 0..240 {
        for [gained, by_contacts] in balances(&mut world) {
            off += (gained - by_contacts).magnitude();
            all += gained.magnitude();
        }
    }
    off / all
}

#[test]
fn impulses_of_contacts_are_what_moves_marbles() {
    for (seed, restitution) in (0..6).zip([0.0, 0.0, 0.3, 0.6, 0.9, 1.0]) {
        let off = unaccounted::<f64>(seed, restitution);
        assert!(off < 1e-3, "seed {seed}: {off}");
    }
    // With restitution, to a millionth of a scalar that has the digits.
    let off = unaccounted::<f64>(5, 1.0);
    assert!(off < 2e-6, "{off}");
    let off = unaccounted::<f32>(5, 1.0);
    assert!(off < 1e-3, "{off}");
}

#[test]
fn no_contact_is_listed_twice() {
    for restitution in [0.0, 0.5] {
        let mut world = pour::<f32>(1, restitution);
        for _ in 0..120 {
            world.step(DT as f32).unwrap();
            let mut pairs: Vec<_> = world.contacts.mm.iter().map(|c| (c.a, c.b)).collect();
            pairs.sort_unstable();
            assert!(pairs.windows(2).all(|two| two[0] != two[1]), "{pairs:?}");
        }
    }
}

#[test]
fn nothing_is_recorded_unless_it_is_asked_for() {
    let mut world = pour::<f32>(2, 0.3);
    for _ in 0..120 {
        world.step(DT as f32).unwrap();
    }
    let all = world.contacts.wm.iter().chain(&world.contacts.mm);
    assert!(all.clone().count() > 20);
    assert!(all.into_iter().all(|c| c.impulse() == Vec3::zero()));
}

/// A marble on a slope presses it with its weight along the normal, and is held by friction along it.
#[test]
fn a_marble_at_rest_on_a_slope_presses_with_its_weight() {
    let mut world = world::<f64>(4);
    world.swarm.set_model(SwarmModel { sleeps: false, ..SwarmModel::default() }).unwrap();
    world.set_records_impulses(true);
    let angle = 0.2_f64;
    let normal = Vec3::new(angle.sin(), angle.cos(), 0.0);
    world.walls.insert(Plane::new(normal, 0.0).unwrap()).unwrap();
    let material = Material { friction: 1.0, rolling_resistance: 0.5, ..Material::default() };
    let marble = Marble {
        material: Some(material),
        ..Marble::new(Point3::from([0.0; 3]) + normal * 0.5, 0.5)
    };
    world.marbles.insert(marble).unwrap();
    for _ in 0..60 {
        world.step(DT).unwrap();
    }
    let weight = mass(&world, 0) * 9.81 * DT;
    let contact = world.contacts.wm[0];
    assert!((contact.normal_impulse / (weight * angle.cos()) - 1.0).abs() < 1e-3, "{contact:?}");
    let friction = contact.tangent_impulse;
    assert!((friction.magnitude() / (weight * angle.sin()) - 1.0).abs() < 1e-3, "{contact:?}");
    assert!(friction.y > 0.0);
}

/// Each impact has the impulse that it gave, by both responses that tell of impacts.
#[test]
fn impacts_have_their_impulses() {
    for response in [Response::SoftStep, Response::EventDriven] {
        let mut world = world::<f64>(4);
        world.set_model(Model { response, rotation: Rotation::Dynamic, ..world.model() }).unwrap();
        world.set_gravity(Vec3::zero()).unwrap();
        let material = Material { restitution: 0.8, friction: 0.3, ..Material::default() };
        let mut insert = |position: [f64; 3], velocity: [f64; 3], radius: f64| {
            let marble = Marble {
                velocity: velocity.into(),
                material: Some(material),
                ..Marble::new(Point3::from(position), radius)
            };
            world.marbles.insert(marble).unwrap();
        };
        insert([0.0, 0.0, 0.0], [2.0, 0.1, 0.0], 0.5);
        insert([1.5, 0.3, 0.1], [0.0; 3], 0.3);
        world.walls.insert(Plane::new(-Vec3::unit_x(), -3.0).unwrap()).unwrap();
        let (mut pairs, mut at_walls) = (0, 0);
        for _ in 0..180 {
            let before = world.marbles.velocity().to_vec();
            world.step(DT).unwrap();
            let mut gained = [Vec3::zero(); 2];
            for impact in world.impacts() {
                gained[impact.b as usize] += impact.impulse;
                if impact.on_wall {
                    at_walls += 1;
                } else {
                    gained[impact.a as usize] -= impact.impulse;
                    pairs += 1;
                }
                assert!(impact.slip.dot(impact.normal).abs() < 1e-9);
                let with_friction = impact.slip.magnitude() > 1e-3;
                let tangent = impact.impulse - impact.normal * impact.impulse.dot(impact.normal);
                assert!(!with_friction || tangent.dot(impact.slip) < 0.0, "{impact:?}");
            }
            for (row, gained) in gained.iter().enumerate() {
                let change = world.marbles.velocity()[row] - before[row];
                let momentum = change * mass(&world, row);
                assert!(
                    (momentum - gained).magnitude() < 1e-9 * 1e3,
                    "{response:?}: {momentum:?} {gained:?}"
                );
            }
        }
        assert!(pairs >= 1 && at_walls >= 1, "{response:?}: {pairs} {at_walls}");
    }
}

/// A marble that comes near a box in the step in which pairs are searched is told when it hits it.
#[test]
fn a_hit_on_a_box_is_told_whenever_pairs_are_searched() {
    for start in 0..40 {
        let mut world = world::<f32>(4);
        let (min, max) = (Point3::new(-5.0, -1.0, -5.0), Point3::new(5.0, 0.0, 5.0));
        world.walls.insert(Aabb { min, max }).unwrap();
        let material = Material { restitution: 0.0, ..Material::default() };
        let height = 1.5 + start as f32 * 0.013;
        let marble =
            Marble { material: Some(material), ..Marble::new(Point3::new(0.0, height, 0.0), 0.5) };
        world.marbles.insert(marble).unwrap();
        let speed = (2.0_f32 * 9.81 * (height - 0.5)).sqrt();
        let mut fastest = 0.0_f32;
        for _ in 0..60 {
            world.step(DT as f32).unwrap();
            fastest = world.impacts().iter().fold(fastest, |most, it| most.max(it.approach_speed));
        }
        assert!((fastest / speed - 1.0).abs() < 0.05, "from {height}: {fastest}, not {speed}");
    }
}
