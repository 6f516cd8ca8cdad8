//! Clusters of unlike balls that meet in the air, under `Response::EventDriven`: nothing outside
//! touches them, so that their momentum stays, and nothing gives them energy.

use crate::draw::Draw;
use taw::prelude::*;

const DT: f64 = 1.0 / 60.0;

/// So many balls, flung at one point from all sides.
fn cluster(seed: u64, count: usize) -> World<f64> {
    let mut draw = Draw(seed.wrapping_mul(0x2545_F491_4F6C_DD1D));
    let mut world = World::default();
    let rotation = [Rotation::None, Rotation::Dynamic][(seed % 2) as usize];
    let model = Model {
        response: Response::EventDriven,
        precision: Precision::Compensated,
        rotation,
        ..Model::default()
    };
    world.set_model(model).unwrap();
    if (seed / 2).is_multiple_of(2) {
        world.set_gravity(Vec3::new(0.0, 0.0, 0.0)).unwrap();
    }
    let restitution = [0.0, 0.3, 0.5, 0.9, 0.98, 1.0][(seed / 4 % 6) as usize];
    let friction = [0.0, 0.3][(seed / 24 % 2) as usize];
    let material = Some(Material { restitution, friction, ..Material::default() });
    let mut placed: Vec<(Point3<f64>, f64)> = Vec::new();
    while placed.len() < count {
        let mut number = || draw.between(-1.0, 1.0);
        let toward = Vec3::new(number(), number(), number());
        if !(0.1..1.0).contains(&toward.magnitude()) {
            continue;
        }
        let toward = toward.normalize();
        let radius = draw.between(0.05, 0.1);
        let at = Point3::new(0.0, 0.0, 0.0) - toward * draw.between(0.3, 0.5);
        if placed.iter().any(|(p, r)| (at - p).magnitude() < r + radius) {
            continue;
        }
        placed.push((at, radius));
        let mass = Mass::Kilograms(10_f64.powf(draw.between(-6.0, 0.0)));
        let marble = Marble { velocity: toward * 50.0, mass, material, ..Marble::new(at, radius) };
        world.marbles.insert(marble).unwrap();
    }
    world
}

/// In kilograms.
fn masses(world: &World<f64>) -> Vec<f64> {
    let mass = |row| match world.marbles.get(world.marbles.id(row)?).ok()?.mass {
        Mass::Kilograms(mass) => Some(mass),
        _ => None,
    };
    (0..world.marbles.len()).map(|row| mass(row).unwrap()).collect()
}

/// All momenta, in kg m/s.
fn momenta(world: &World<f64>) -> impl Iterator<Item = Vec3<f64>> {
    masses(world).into_iter().zip(world.marbles.velocity()).map(|(mass, velocity)| velocity * mass)
}

/// Deepest overlap of two balls, over the smaller radius.
fn overlap(world: &World<f64>) -> f64 {
    let marbles = &world.marbles;
    let mut deepest = 0.0_f64;
    for a in 0..marbles.len() {
        for b in 0..a {
            let (r, s) = (marbles.radius()[a], marbles.radius()[b]);
            let apart = (marbles.position()[a] - marbles.position()[b]).magnitude();
            deepest = deepest.max((r + s - apart) / r.min(s));
        }
    }
    deepest
}

/// Description of a failure in this cluster, if there is one.
fn judge(seed: u64, count: usize) -> Option<String> {
    let mut world = cluster(seed, count);
    let mass: f64 = masses(&world).iter().sum();
    let begin: Vec3<f64> = momenta(&world).sum();
    let largest: f64 = momenta(&world).map(Vec3::magnitude).sum();
    let energy = world.energy().total();
    let (mut deepest, mut off, mut gain, mut stopped) = (0.0_f64, 0.0_f64, 0.0_f64, 0);
    let mut before = energy;
    for step in 1..=6 {
        world.step(DT).unwrap();
        let fall = world.gravity() * (mass * DT * f64::from(step));
        off = off.max((momenta(&world).sum::<Vec3<f64>>() - begin - fall).magnitude() / largest);
        let now = world.energy().total();
        gain = gain.max((now - before) / energy);
        before = now;
        deepest = deepest.max(overlap(&world));
        stopped += world.stopped().count();
    }
    // Balls that fall together rest on each other where they come nearer by less than a tenth of
    // what gravity does in a step, until the next one.
    let rest = 0.1 * 9.81 * DT * DT / 0.05;
    (off > 1e-12 || gain > 1e-12 || deepest > rest || stopped > 0).then(|| {
        format!("momentum {off:e}, energy {gain:e}, overlap {deepest:e}, {stopped} stopped")
    })
}

#[test]
fn a_cluster_of_unlike_balls_keeps_its_momentum() {
    let number = |name: &str, or: u64| {
        std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(or)
    };
    let (from, many) = (number("KNOTS_FROM", 0), number("KNOTS_COUNT", 960));
    let mut bad = 0;
    for seed in from..from + many {
        let count = 5 + (seed / 48 % 4) as usize;
        if let Some(fault) = judge(seed, count) {
            println!("seed {seed}, {count} balls: {fault}");
            bad += 1;
        }
    }
    assert_eq!(bad, 0, "of {many} clusters from {from}");
}
