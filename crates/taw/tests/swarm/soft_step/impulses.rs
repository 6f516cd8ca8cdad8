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
        let marble = Marble { material: Some(material), ..Marble::new(Point3::from(at.map(s)), radius) };
        world.marbles.insert(marble).unwrap();
    }
    world
}

#[test]
fn impulses_of_contacts_are_what_moves_marbles() {
    for (seed, restitution) in (0..6).zip([0.0, 0.0, 0.3, 0.6, 0.9, 1.0]) {
        let mut world = pour::<f64>(seed, restitution);
        world.set_records_impulses(true);
        let (mut off, mut all) = (0.0, 0.0);
        for step in 0..240 {
            for (row, [gained, by_contacts]) in balances(&mut world).into_iter().enumerate() {
                off += (gained - by_contacts).magnitude();
                all += gained.magnitude();
                let weight = mass(&world, row) * 9.81 * DT;
                let d = (gained - by_contacts).magnitude();
                if d > 0.05 * (weight + gained.magnitude()) {
                    println!("seed {seed} step {step} row {row}: {gained:?} {by_contacts:?} weight {weight}");
                }
            }
        }
        println!("seed {seed}: {off} of {all}");
        assert!(off < 0.01 * all, "seed {seed}: {off} of {all} N s");
    }
}
