//! Overlap below the slop is resolved by `Response::EventDriven`, too, where nothing else touches the
//! two: soon, and without energy. (In wide heaps the slop stays: parting would lift what lies on it.)

use taw::prelude::*;
use taw::shape::Aabb;

const DT: f64 = 1.0 / 60.0;

/// A world in steps of a sixtieth of a second, with this gravity in m/s².
fn world(gravity: [f64; 3]) -> World<f64> {
    let mut world = World::default();
    let model = Model {
        response: Response::EventDriven,
        precision: Precision::Compensated,
        rotation: Rotation::Dynamic,
        ..Model::default()
    };
    world.set_model(model).unwrap();
    world.set_gravity(Vec3::from(gravity)).unwrap();
    world
}

fn ball(position: [f64; 3], velocity: [f64; 3]) -> Marble<f64> {
    let mass = Mass::Kilograms(1.0);
    Marble { velocity: Vec3::from(velocity), mass, ..Marble::new(Point3::from(position), 0.1) }
}

/// Deepest overlap of two balls or a ball and a wall, over the radius.
fn overlap(world: &World<f64>) -> f64 {
    let at = world.marbles.position();
    let between = (0..at.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
    let balls = between.map(|(a, b)| 0.2 - (at[a] - at[b]).magnitude());
    let walls = world.walls.shapes().iter();
    let walls = walls.flat_map(|wall| at.iter().map(|at| 0.1 - wall.project_point(*at).distance));
    balls.chain(walls).fold(0.0, f64::max) / 0.1
}

/// Steps a quarter of a second. Returns the last overlap and the largest energy gained, in joules.
fn part(world: &mut World<f64>) -> (f64, f64) {
    let begin = world.energy().total();
    let mut gained: f64 = 0.0;
    for _ in 0..15 {
        world.step(DT).unwrap();
        gained = gained.max(world.energy().total() - begin);
    }
    (overlap(world), gained)
}

/// Weight of all marbles, of a kilogram each, in newtons.
fn weight(world: &World<f64>) -> f64 {
    let mass = world.marbles.len() as f64;
    mass * world.gravity().magnitude()
}

/// Scenes that begin with an overlap of .4 % of the radius, or a bit less or more.
fn scenes(deep: f64) -> Vec<(String, World<f64>)> {
    let mut scenes = Vec::new();
    let d = 0.1 * deep;
    let still = [0.0; 3];
    for (where_, gravity) in [("space", still), ("falling", [0.0, -9.81, 0.0])] {
        let mut pair = |name: &str, [a, b]: [[f64; 3]; 2]| {
            let mut world = world(gravity);
            world.marbles.insert(ball([0.0; 3], a)).unwrap();
            world.marbles.insert(ball([0.2 - d, 0.0, 0.0], b)).unwrap();
            scenes.push((format!("{name}, {where_}"), world));
        };
        pair("pair at rest", [still; 2]);
        pair("pair that moves together", [[0.3, 0.2, 0.1]; 2]);
        pair("pair that slides past each other", [still, [0.0, 0.01, 0.0]]);
        pair("pair that parts slowly", [still, [1e-5, 0.0, 0.0]]);
        pair("pair that closes slowly", [still, [-1e-5, 0.0, 0.0]]);
    }
    let plane = |normal: [f64; 3]| Plane::new(Vec3::from(normal), 0.0).unwrap();
    for (where_, gravity) in [
        ("floor", [0.0, -9.81, 0.0]),
        ("ceiling", [0.0, 9.81, 0.0]),
        ("upright wall", [0.0, 0.0, -9.81]),
        ("wall in space", still),
        ("slope", [4.0, -8.0, 0.0]),
    ] {
        for (kind, velocity) in
            [("at rest", still), ("that slides", [0.3, 0.0, 0.0]), ("that rises", [0.0, 1e-5, 0.0])]
        {
            let mut flat = world(gravity);
            flat.walls.insert(plane([0.0, 1.0, 0.0])).unwrap();
            flat.marbles.insert(ball([0.0, 0.1 - d, 0.0], velocity)).unwrap();
            scenes.push((format!("ball {kind}, {where_}"), flat));
            let mut boxed = world(gravity);
            let corners = [[-9.0, -1.0, -9.0], [9.0, 0.0, 9.0]].map(Point3::from);
            boxed.walls.insert(Aabb::new(corners[0], corners[1]).unwrap()).unwrap();
            boxed.marbles.insert(ball([0.0, 0.1 - d, 0.0], velocity)).unwrap();
            scenes.push((format!("ball {kind}, {where_} of a box"), boxed));
            let mut round = world(gravity);
            let sphere = Sphere::new(Point3::new(0.0, -1.0, 0.0), 1.0).unwrap();
            round.walls.insert(sphere).unwrap();
            round.marbles.insert(ball([0.0, 0.1 - d, 0.0], velocity)).unwrap();
            scenes.push((format!("ball {kind}, {where_} of a sphere"), round));
        }
    }
    scenes
}

#[test]
fn what_overlaps_a_little_parts() {
    let mut wrong = Vec::new();
    for deep in [1e-3, 3.9e-3, 4e-3, 8e-3] {
        for (name, mut world) in scenes(deep) {
            let (rest, gained) = part(&mut world);
            // Parting lifts, at most by as much as each of the overlaps.
            let lifted = weight(&world) * 0.1 * deep * (world.marbles.len() as f64).max(2.0);
            // What counts as touching, over the radius: the fall to a tenth of the speed that gravity
            // adds in a step. Twice that, as pairs of a heap push each other back.
            let touching = 0.5 * 0.01 * 9.81 * DT * DT / 0.1;
            if rest > 2.0 * touching || gained > lifted + 1e-9 {
                wrong.push(format!("{name}, {deep}: overlap {rest:e}, {gained:e} J of {lifted:e}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn a_tower_that_overlaps_a_little_parts() {
    for deep in [0.001, 0.002, 0.004] {
        let mut world = world([0.0, -9.81, 0.0]);
        world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
        for i in 0..4 {
            let height = (1.0 - deep) + f64::from(i) * (2.0 - deep);
            world.marbles.insert(ball([0.0, 0.1 * height, 0.0], [0.0; 3])).unwrap();
        }
        for _ in 0..300 {
            world.step(DT).unwrap();
        }
        // What counts as touching, as above.
        let touching = 0.5 * 0.01 * 9.81 * DT * DT / 0.1;
        let rest = overlap(&world);
        assert!(rest < 2.0 * touching, "{deep}: overlap {rest:e} of {touching:e}");
        let floor_and_gaps = world.marbles.position().iter().scan(-0.1, |below, at| {
            let gap = at.y - *below - 0.2;
            *below = at.y;
            Some(gap / 0.1)
        });
        let gap = floor_and_gaps.fold(0.0, f64::max);
        assert!(gap < 2.0 * touching, "{deep}: a gap of {gap:e} of {touching:e}");
    }
}
