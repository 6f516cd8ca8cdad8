//! Marbles that come, go, or change, one at a time: a game that spawns them all the time has sleepers.

use super::islands::floor_with_roller;
use super::{asleep, block, steps, world};
use taw::broad::CollisionLayers;
use taw::prelude::*;
use taw::swarm::{Ball, BallId, SwarmModel};

type Change = fn(&mut World<f32>, MarbleId, WallId);

fn marble() -> Marble<f32> {
    Marble::new(Point3::new(0.0, 3.0, 0.0), 0.1)
}

fn rubber() -> Material<f32> {
    Material { restitution: 0.4, friction: 0.9, ..Material::default() }
}

const OTHERS: CollisionLayers = CollisionLayers::new(2, u32::MAX);

fn insert(world: &mut World<f32>, marble: Marble<f32>) {
    world.marbles.insert(marble).unwrap();
}

fn remove(world: &mut World<f32>, id: MarbleId) {
    world.marbles.remove(id).unwrap();
}

fn remove_wall(world: &mut World<f32>, wall: WallId) {
    world.walls.remove(wall).unwrap();
}

fn move_far_wall(world: &mut World<f32>, wall: WallId) {
    world.walls.set(wall, block([40.0, 0.0, 0.0], [41.0, 1.0, 1.0])).unwrap();
}

const CHANGES: [(&str, Change); 9] = [
    ("comes", |w, _, _| insert(w, marble())),
    ("comes with a material", |w, _, _| insert(w, Marble { material: Some(rubber()), ..marble() })),
    ("comes with layers", |w, _, _| insert(w, Marble { layers: OTHERS, ..marble() })),
    ("gets a material", |w, id, _| w.marbles.set_material(id, Some(rubber())).unwrap()),
    ("gets layers", |w, id, _| w.marbles.set_layers(id, OTHERS).unwrap()),
    ("goes", |w, id, _| remove(w, id)),
    ("a wall far away goes", |w, _, wall| remove_wall(w, wall)),
    ("comes while a wall moves far away", |w, _, wall| {
        insert(w, marble());
        move_far_wall(w, wall);
    }),
    ("goes while a wall moves far away", |w, id, wall| {
        remove(w, id);
        move_far_wall(w, wall);
    }),
];

#[test]
pub fn one_that_comes_goes_or_changes_wakes_no_other_one() {
    let (mut world, mut ids, roller) = floor_with_roller();
    world.marbles.remove(roller).unwrap();
    let wall = world.walls.insert(block([30.0, 0.0, 0.0], [31.0, 1.0, 1.0])).unwrap();
    steps(&mut world, 90);
    let changed = ids.remove(210);
    for (name, change) in CHANGES {
        let mut world = world.clone();
        steps(&mut world, 1);
        change(&mut world, changed, wall);
        // The newcomer lands between four others.
        for step in 0..90 {
            steps(&mut world, 1);
            assert_eq!(asleep(&world, &ids), ids.len(), "{name}: after {step} steps");
            let wakes = step == 0 && name.starts_with("gets");
            assert!(!(wakes && world.is_asleep(changed).unwrap()), "{name}");
        }
    }
}

/// Rows of walls and of marbles change in one step, while others sleep on walls.
#[test]
pub fn a_block_that_goes_with_its_marble_wakes_no_other_one() {
    let mut world = world();
    let mut places: Vec<_> = (0..20_u8)
        .map(|i| {
            let x = 2.0 * f32::from(i);
            let wall = world.walls.insert(block([x, -1.0, 0.0], [x + 1.0, 0.0, 1.0])).unwrap();
            let marble = Marble::new(Point3::new(x + 0.5, 0.2, 0.5), 0.2);
            (wall, world.marbles.insert(marble).unwrap())
        })
        .collect();
    steps(&mut world, 90);
    for gone in [0, 5, 18, 3, 3, 9, 0] {
        let (wall, marble) = places.remove(gone.min(places.len() - 1));
        remove(&mut world, marble);
        world.walls.remove(wall).unwrap();
        steps(&mut world, 1);
        let ids = places.iter().map(|(_, marble)| marble);
        assert_eq!(asleep(&world, ids), places.len());
    }
    for (_, marble) in &places {
        world.marbles.set_velocity(*marble, Vec3::new(0.0, 0.01, 0.0)).unwrap();
    }
    steps(&mut world, 120);
    for (_, marble) in &places {
        let height = world.marbles.get(*marble).unwrap().position.y;
        assert!((height - 0.2).abs() < 0.01 && world.is_asleep(*marble).unwrap(), "at {height}");
    }
}

/// A ball in a shaft, which must not sleep, and another one on it.
fn tower() -> (World<f32>, [MarbleId; 2]) {
    let mut world = world();
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    for x in [-0.45, 0.45] {
        world.walls.insert(block([x - 0.2, 0.0, -1.0], [x + 0.2, 3.0, 1.0])).unwrap();
        world.walls.insert(block([-1.0, 0.0, x - 0.2], [1.0, 3.0, x + 0.2])).unwrap();
    }
    let ball = |y: f32| Marble::new(Point3::new(0.0, y, 0.0), 0.24);
    let lower = Marble { sleeping_disabled: true, ..ball(0.24) };
    let ids = [lower, ball(0.72)].map(|marble| world.marbles.insert(marble).unwrap());
    (world, ids)
}

/// Also one that has rested for long, and is awake only since another one is, which now is gone.
#[test]
pub fn one_whose_support_goes_falls_whenever_it_goes() {
    let leaves: [(&str, fn(&mut World<f32>, MarbleId)); 3] = [
        ("removed", remove),
        ("far", |w, id| w.marbles.set_position(id, Point3::new(5.0, 0.24, 0.0)).unwrap()),
        ("passes through all", |w, id| w.marbles.set_layers(id, CollisionLayers::NONE).unwrap()),
    ];
    let (mut world, [lower, upper]) = tower();
    for step in 0..120 {
        steps(&mut world, 1);
        for (name, leave) in leaves {
            let mut world = world.clone();
            leave(&mut world, lower);
            steps(&mut world, 60);
            let height = world.marbles.get(upper).unwrap().position.y;
            assert!(height < 0.25, "{name} after {step} steps: at {height}");
        }
    }
    // It had rested for long enough.
    world.marbles.set_sleeping_disabled(lower, false).unwrap();
    steps(&mut world, 60);
    assert_eq!(asleep(&world, &[lower, upper]), 2);
}

fn sleeps(world: &World<f32>, ball: BallId) -> bool {
    world.swarm.velocities()[world.swarm.row(ball).unwrap()][3].is_sign_negative()
}

/// Several are removed between two steps, one by one, so that rows move more than once.
#[test]
pub fn several_that_go_one_by_one_wake_what_lay_beside_each() {
    let mut world = world();
    let grips = Material { friction: 1.0, rolling_resistance: 0.05, ..Material::default() };
    world.swarm.set_model(SwarmModel { material: grips, ..world.swarm.model() }).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    let balls = |places: &[[f32; 3]]| -> Vec<_> {
        places.iter().map(|place| Ball::new(Point3::from(*place), 0.2)).collect()
    };
    let (mut piles, mut lone) = (Vec::new(), Vec::new());
    for i in 0..200_u8 {
        let x = 2.0 * f32::from(i);
        // Three that touch, one on top of them, and one by itself.
        let places = [[0.2, 0.2, 0.0], [-0.2, 0.2, 0.0], [0.0, 0.2, 0.346], [0.0, 0.526, 0.115]];
        let places = places.map(|[dx, y, z]| [x + dx, y, z]);
        piles.push(world.swarm.insert(&balls(&places)).unwrap());
        lone.extend(world.swarm.insert(&balls(&[[x, 0.2, 2.0]])).unwrap());
    }
    steps(&mut world, 300);
    assert_eq!(world.swarm.asleep(), world.swarm.len());
    let height = |world: &World<f32>, ball| world.swarm.balls()[world.swarm.row(ball).unwrap()][1];
    assert!(piles.iter().all(|pile| height(&world, pile[3]) > 0.5));
    // Others come in between.
    for (i, pile) in (0_u8..).zip(&piles).step_by(2) {
        world.swarm.remove(&pile[..1]).unwrap();
        world.swarm.insert(&balls(&[[f32::from(i), 0.2, 5.0]])).unwrap();
    }
    for step in 0..90 {
        steps(&mut world, 1);
        for (i, pile) in piles.iter().enumerate() {
            let expected = i % 2 == 1;
            assert!(step > 10 || sleeps(&world, pile[3]) == expected, "{i} in step {step}");
        }
        assert!(lone.iter().all(|ball| sleeps(&world, *ball)));
    }
    for (i, pile) in piles.iter().enumerate() {
        assert_eq!(height(&world, pile[3]) > 0.5, i % 2 == 1, "pile {i}");
    }
}
