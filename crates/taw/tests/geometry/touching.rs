//! Touches of a heap at rest go on.

use std::collections::BTreeSet;

use taw::contact::touch_goes_on;
use taw::prelude::*;
use taw::shape::Plane;

const DT: f32 = 1.0 / 60.0;
const RADIUS: f32 = 0.1;
const COUNT: usize = 1_000;

/// A thousand balls above a box of 2 m.
fn heap(model: Model) -> World<f32> {
    let mut world = World::default();
    world.set_model(model).unwrap();
    let sides = [Vec3::unit_x(), -Vec3::unit_x(), Vec3::unit_z(), -Vec3::unit_z()];
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    for normal in sides {
        world.walls.insert(Plane::new(normal, -1.0).unwrap()).unwrap();
    }
    let mut random = fastrand::Rng::with_seed(8);
    for number in 0..COUNT {
        let (layer, place) = (number / 49, number % 49);
        let mut jitter = || 0.02 * (random.f32() - 0.5);
        let x = -0.84 + 0.28 * (place % 7) as f32 + jitter();
        let z = -0.84 + 0.28 * (place / 7) as f32 + jitter();
        let at = Point3::new(x, 0.2 + 0.22 * layer as f32, z);
        world.marbles.insert(Marble::new(at, RADIUS)).unwrap();
    }
    world
}

type Pairs = BTreeSet<(u32, u32)>;

fn touching(world: &World<f32>) -> Pairs {
    world.contacts.mm.iter().filter(|c| c.is_touching()).map(|c| (c.a, c.b)).collect()
}

/// Pairs that touched and are no farther apart than a touch that goes on.
fn going_on(world: &World<f32>, before: &Pairs) -> Pairs {
    let fall = 9.81 * DT * DT;
    let at = world.marbles.position();
    let closed = |(a, b): &&(u32, u32)| {
        let separation = (at[*b as usize] - at[*a as usize]).magnitude() - 2.0 * RADIUS;
        touch_goes_on(separation, RADIUS, fall)
    };
    before.iter().filter(closed).copied().collect()
}

#[test]
fn no_touch_of_a_thousand_at_rest_begins_anew() {
    let impulse = Model { response: Response::Impulse, ..Model::default() };
    for (name, model) in [("impulse", impulse), ("soft step", Model::GAME)] {
        let mut world = heap(model);
        for _ in 0..600 {
            world.step(DT).unwrap();
        }
        let (mut touches, mut listed) = (touching(&world), touching(&world));
        let mut known = touching(&world);
        let (mut flickers, mut anew) = (0, 0);
        for _ in 0..300 {
            world.step(DT).unwrap();
            let now = touching(&world);
            flickers += now.difference(&listed).count();
            let all: Pairs = now.union(&going_on(&world, &touches)).copied().collect();
            // Who hovered from the beginning may touch for the first time.
            anew += all.difference(&touches).filter(|pair| known.contains(pair)).count();
            known.extend(&all);
            (listed, touches) = (now, all);
        }
        let fastest = world.marbles.velocity().iter().map(|v| v.magnitude()).fold(0.0, f32::max);
        println!("{name}: {flickers} flickers, {anew} anew, fastest {fastest} m/s");
        assert!(fastest < 0.01, "{name} is not at rest: {fastest} m/s");
        // A heap as large creeps for a minute, and one pair or other parts by more.
        let most = flickers / 1000;
        assert!(anew <= most, "{name}: {anew} touches began anew, of {flickers} that flickered");
    }
}
