//! Marbles sleep where they rest, and wake when something changes about them.

mod islands;
mod random;
mod responses;
mod slow;
mod spawn;

use islands::island;

use std::cell::Cell;
use std::collections::BTreeSet;

use taw::motion::WallMotion;
use taw::prelude::*;
use taw::response::Response;
use taw::shape::{Aabb, BoundedShape};
use taw::swarm::SwarmModel;

const DT: f32 = 1.0 / 60.0;

fn block(min: [f32; 3], max: [f32; 3]) -> Aabb<Point3<f32>> {
    Aabb { min: min.into(), max: max.into() }
}

thread_local! {
    /// Response of the worlds of a test.
    static RESPONSE: Cell<Response> = const { Cell::new(Response::SoftStep) };
}

/// Random scenes: a fifth of so many by the methods other than `SoftStep`.
fn rounds(count: u64) -> u64 {
    if RESPONSE.get() == Response::SoftStep { count } else { count / 5 }
}

fn world() -> World<f32> {
    let mut world = World::default();
    let response = RESPONSE.get();
    let substeps = if response == Response::SoftStep { 2 } else { 8 };
    let model = Model { response, rotation: Rotation::Dynamic, substeps, ..Model::default() };
    world.set_model(model).unwrap();
    world.swarm.set_model(SwarmModel { threads: 1, ..SwarmModel::default() }).unwrap();
    world.set_gravity(Vec3::new(0.0, -9.81, 0.0)).unwrap();
    world
}

/// Three layers of balls that lie in a box without a top.
fn heap() -> (World<f32>, WallId, Vec<MarbleId>) {
    let mut world = world();
    let floor = world.walls.insert(block([-5.0, -1.0, -5.0], [5.0, 0.0, 5.0])).unwrap();
    for axis in [0, 2] {
        for side in [-1.0, 1.0] {
            let (mut min, mut max) = ([-5.0, 0.0, -5.0], [5.0, 9.0, 5.0]);
            (min[axis], max[axis]) = if side < 0.0 { (-5.0, -1.0) } else { (1.0, 5.0) };
            world.walls.insert(block(min, max)).unwrap();
        }
    }
    let ids = (0..48_u16).map(|i| {
        let at = |cell: u16| f32::from(cell) * 0.5 - 0.75;
        let y = 0.3 + f32::from(i / 16) * 0.5 + f32::from(i % 3) * 0.02;
        let ball = Marble::new(Point3::new(at(i % 4), y, at(i / 4 % 4)), 0.23);
        world.marbles.insert(ball).unwrap()
    });
    let ids: Vec<_> = ids.collect();
    (world, floor, ids)
}

fn sliding(velocity: Vec3<f32>) -> WallMotion<f32> {
    let zero = Vec3::new(0.0, 0.0, 0.0);
    WallMotion { velocity, angular_velocity: zero, pivot: Point3::new(0.0, 0.0, 0.0) }
}

fn steps(world: &mut World<f32>, count: u32) {
    (0..count).for_each(|_| world.step(DT).unwrap());
}

fn asleep<'a>(world: &World<f32>, ids: impl IntoIterator<Item = &'a MarbleId>) -> usize {
    ids.into_iter().filter(|id| world.is_asleep(**id).unwrap()).count()
}

/// The heap after four seconds, in which it has fallen asleep.
fn sleeping() -> (World<f32>, WallId, Vec<MarbleId>) {
    let (mut world, floor, ids) = heap();
    assert_eq!(asleep(&world, &ids), 0);
    let version = world.sleep_version();
    steps(&mut world, if RESPONSE.get() == Response::SoftStep { 240 } else { 720 });
    assert_eq!(asleep(&world, &ids), ids.len());
    assert_ne!(world.sleep_version(), version);
    assert!(world.marbles.velocity().iter().all(|v| *v == Vec3::new(0.0, 0.0, 0.0)));
    (world, floor, ids)
}

type Change = fn(&mut World<f32>, WallId, MarbleId);

#[test]
fn whatever_changes_about_a_marble_wakes_its_island() {
    let (world, floor, ids) = sleeping();
    let changes: [(&str, Change); 7] = [
        ("impulse", |w, _, id| w.marbles.apply_impulse(id, Vec3::new(0.0, 5.0, 0.0)).unwrap()),
        ("velocity", |w, _, id| w.marbles.set_velocity(id, Vec3::new(0.0, 1.0, 0.0)).unwrap()),
        ("force", |w, _, id| w.marbles.apply_force(id, Vec3::new(0.0, 1e3, 0.0)).unwrap()),
        ("mass", |w, _, id| w.marbles.set_mass(id, Mass::Kilograms(1.0)).unwrap()),
        ("gravity scale", |w, _, id| w.marbles.set_gravity_scale(id, -1.0).unwrap()),
        ("locked axes", |w, _, id| w.marbles.set_locked_axes(id, LockedAxes::ROTATION_X).unwrap()),
        ("sleeping disabled", |w, _, id| w.marbles.set_sleeping_disabled(id, true).unwrap()),
    ];
    for id in &ids {
        let island = island(&world, *id);
        for (name, change) in changes {
            if name == "locked axes" && !RESPONSE.get().knows_locked_axes() {
                continue; // it is refused
            }
            let mut world = world.clone();
            change(&mut world, floor, *id);
            let version = world.sleep_version();
            steps(&mut world, 1);
            assert_eq!(asleep(&world, &island), 0, "{name} of {id:?}");
            assert_ne!(world.sleep_version(), version, "{name}");
        }
    }
}

#[test]
fn whatever_changes_about_a_heap_wakes_it() {
    let (world, floor, ids) = sleeping();
    let changes: [(&str, Change); 7] = [
        ("gravity", |w, _, _| w.set_gravity(Vec3::new(0.1, -9.81, 0.0)).unwrap()),
        ("floor lower", |w, floor, _| {
            w.walls.set(floor, block([-5.0, -2.0, -5.0], [5.0, -1.0, 5.0])).unwrap();
        }),
        ("floor gone", |w, floor, _| drop(w.walls.remove(floor).unwrap())),
        ("floor of another material", |w, floor, _| {
            w.walls.set_material(floor, Some(Material::default())).unwrap();
        }),
        ("floor conveys", |w, floor, _| {
            let motion = sliding(Vec3::new(1.0, 0.0, 0.0));
            w.walls.set_motion(floor, Some(motion)).unwrap();
        }),
        ("half-space", |w, _, _| {
            w.walls.insert(Plane::new(Vec3::unit_y(), -20.0).unwrap()).unwrap();
        }),
        ("neighbour gone", |w, _, id| {
            let _ = w.marbles.remove(id).unwrap();
        }),
    ];
    let mut beside = island(&world, ids[7]);
    beside.remove(&ids[7]);
    let beside = Vec::from_iter(beside);
    for (name, change) in changes {
        let (mut world, version) = (world.clone(), world.sleep_version());
        change(&mut world, floor, ids[7]);
        steps(&mut world, 1);
        let is_there = |id: &MarbleId| world.marbles.row(*id).is_ok();
        let rest: Vec<_> = ids.iter().copied().filter(is_there).collect();
        let woken = if name == "neighbour gone" { &beside } else { &rest };
        assert!(
            woken.len() > 1 && asleep(&world, woken) == 0,
            "{name}: {} of {}",
            asleep(&world, woken),
            woken.len()
        );
        assert_ne!(world.sleep_version(), version, "{name}");
        // By other methods, the heap may be one island.
        let others_sleep = asleep(&world, &rest) > 0;
        if RESPONSE.get() == Response::SoftStep || others_sleep {
            assert_eq!(others_sleep, name == "neighbour gone", "{name}");
        }
        if name.starts_with("floor gone") {
            steps(&mut world, 60);
            let fell = |id: &MarbleId| world.marbles.get(*id).unwrap().position.y < -2.0;
            assert!(rest.iter().all(fell), "{name}");
        }
    }
}

#[test]
fn nothing_falls_asleep_about_a_marble_that_must_not() {
    let (world, _, ids) = sleeping();
    let size = |id: &&MarbleId| island(&world, **id).len();
    let awake = *ids.iter().max_by_key(size).unwrap();
    let (mut world, _, ids) = heap();
    world.marbles.set_sleeping_disabled(awake, true).unwrap();
    assert!(world.marbles.get(awake).unwrap().sleeping_disabled);
    // Towers of three fall over one by one.
    for _ in 0..600 {
        steps(&mut world, 1);
        assert!(!world.is_asleep(awake).unwrap());
    }
    let around = island(&world, awake);
    assert!(around.len() > 3);
    assert_eq!((asleep(&world, &around), asleep(&world, &ids)), (0, ids.len() - around.len()));
    world.marbles.set_sleeping_disabled(awake, false).unwrap();
    steps(&mut world, 60);
    assert_eq!(asleep(&world, &ids), ids.len());
    // The slot of one that is gone says nothing of the next.
    world.marbles.set_sleeping_disabled(awake, true).unwrap();
    steps(&mut world, 1);
    let marble = world.marbles.remove(awake).unwrap();
    let id = world.marbles.insert(Marble { sleeping_disabled: false, ..marble }).unwrap();
    steps(&mut world, 400); // its neighbours fall in
    assert!(world.is_asleep(id).unwrap() && world.is_asleep(awake).is_err());
}

#[test]
fn a_lift_wakes_only_what_it_comes_to() {
    let (mut world, _, ids) = sleeping();
    let at = |x: f32| block([x, 0.0, -0.5], [x + 1.0, 0.5, 0.5]);
    let lift = world.walls.insert(at(20.0)).unwrap();
    steps(&mut world, 1);
    let version = world.sleep_version();
    for step in 0..60_u8 {
        let speed = Vec3::new(0.0, 0.1, 0.0);
        world.walls.set_motion(lift, Some(sliding(speed))).unwrap();
        world.walls.set(lift, at(20.0 - f32::from(step) * 0.1)).unwrap();
        steps(&mut world, 1);
        assert_eq!(asleep(&world, &ids), ids.len());
    }
    assert_eq!(world.sleep_version(), version);
    // Within one step from far away into the heap.
    let mut jump = world.clone();
    let met = islands_in(&world, &ids, at(0.0));
    assert!((3..ids.len()).contains(&met.len()));
    jump.walls.set(lift, at(0.0)).unwrap();
    steps(&mut jump, 1);
    assert_eq!(asleep(&jump, &met), 0);
    // More changes than the log has room for, of which one is in the heap.
    for (there, sleep) in [(3_000, met.len()), (2_000, 0)] {
        for step in 0..3_000_u16 {
            let x = if step == there { 0.0 } else { 20.0 + f32::from(step % 7) };
            world.walls.set(lift, at(x)).unwrap();
        }
        steps(&mut world, 1);
        assert_eq!(asleep(&world, &met), sleep);
    }
}

/// Marbles that a box would overlap, and their islands.
fn islands_in(
    world: &World<f32>,
    ids: &[MarbleId],
    place: Aabb<Point3<f32>>,
) -> BTreeSet<MarbleId> {
    let overlaps = |id: &&MarbleId| {
        let marble = world.marbles.get(**id).unwrap();
        place.project_point(marble.position).distance < marble.radius
    };
    ids.iter().filter(overlaps).flat_map(|id| island(world, *id)).collect()
}

/// Says if a ball touches a wall or another ball, or nearly.
fn is_supported(world: &World<f32>, row: usize) -> bool {
    let (at, radius) = (world.marbles.position()[row], world.marbles.radius()[row]);
    let reach = 1.1 * radius;
    let by_ball = (0..world.marbles.len()).any(|other| {
        let apart = (world.marbles.position()[other] - at).magnitude();
        other != row && apart < reach + world.marbles.radius()[other]
    });
    let by_wall = world.walls.shapes().iter().any(|shape| match shape {
        WallShape::Plane(plane) => plane.signed_distance(at) < reach,
        WallShape::Solid(shape) => shape.project_point(at).distance < reach,
        _ => false,
    });
    by_ball || by_wall
}

#[test]
fn nothing_sleeps_in_mid_air() {
    let mut slept = 0;
    for seed in 1..=rounds(60) {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f32 / (1 << 24) as f32
        };
        let mut world = world();
        let floor = world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
        let table = |y: f32| block([-1.0, y - 0.3, -1.0], [1.0, y, 1.0]);
        let wall = world.walls.insert(table(1.0)).unwrap();
        // Or what rolls would roll on.
        let slows = Material { rolling_resistance: 0.1, ..Material::default() };
        for wall in [floor, wall] {
            world.walls.set_material(wall, Some(slows)).unwrap();
        }
        let ids: Vec<_> = (0..30)
            .map(|_| {
                let at = [4.0 * random() - 2.0, 0.5 + 3.0 * random(), 4.0 * random() - 2.0];
                let velocity = Vec3::new(random() - 0.5, 4.0 * random(), random() - 0.5);
                let material = Material {
                    restitution: random(),
                    rolling_resistance: 0.1,
                    ..Material::default()
                };
                let radius = 0.02 + 0.2 * random();
                let mut ball = Marble::new(Point3::from(at), radius);
                (ball.velocity, ball.material) = (velocity, Some(material));
                world.marbles.insert(ball).unwrap()
            })
            .collect();
        let (leaves, moves) = (300 + (random() * 300.0) as u32, random() < 0.5);
        for step in 0..720 {
            if step == leaves {
                if moves {
                    world.walls.set(wall, table(-3.0)).unwrap();
                } else {
                    world.walls.remove(wall).unwrap();
                }
            }
            steps(&mut world, 1);
            for id in &ids {
                if world.is_asleep(*id).unwrap() {
                    slept += 1;
                    let row = world.marbles.row(*id).unwrap();
                    assert!(is_supported(&world, row), "seed {seed}, step {step}, {id:?}");
                }
            }
        }
    }
    assert!(slept > 16 * rounds(60), "only {slept} times did any sleep");
}

#[test]
fn walls_of_another_history_wake_all() {
    let (world, floor, ids) = sleeping();
    let lower = block([-5.0, -2.0, -5.0], [5.0, -1.0, 5.0]);
    let far = block([20.0, 0.0, 0.0], [21.0, 1.0, 1.0]);
    // The same number of changes as the world has seen, and more, of walls that began alike.
    for extra in 0..4 {
        let (mut seen, mut other) = (world.clone(), world.clone());
        let lift = seen.walls.insert(far).unwrap();
        seen.walls.set(lift, far).unwrap();
        steps(&mut seen, 1);
        assert_eq!(asleep(&seen, &ids), ids.len());
        other.walls.set(floor, lower).unwrap();
        let lift = other.walls.insert(far).unwrap();
        (0..extra).for_each(|_| other.walls.set(lift, far).unwrap());
        seen.walls = other.walls;
        steps(&mut seen, 1);
        assert_eq!(asleep(&seen, &ids), 0, "{extra}");
    }
    // Clones see the same, also when both change in the same way.
    let mut pair = [world.clone(), world];
    for world in &mut pair {
        let lift = world.walls.insert(far).unwrap();
        steps(world, 2);
        world.walls.set(lift, lower).unwrap();
        steps(world, 2);
    }
    assert_eq!(pair[0], pair[1]);
}

/// More walls than the log of changes has room for.
#[test]
fn a_thousand_walls_that_move_far_away_change_no_bit_of_a_heap() {
    let (mut still, _, ids) = heap();
    let at = |i: u16, x: f32| block([x, 0.0, f32::from(i)], [x + 1.0, 1.0, f32::from(i) + 0.5]);
    let walls = (0..1500).map(|i| still.walls.insert(at(i, 20.0)).unwrap());
    let walls: Vec<_> = walls.collect();
    let mut moving = still.clone();
    for step in 0..300_u16 {
        for (i, wall) in (0..).zip(&walls) {
            moving.walls.set(*wall, at(i, 20.0 + 0.01 * f32::from(step))).unwrap();
        }
        steps(&mut still, 1);
        steps(&mut moving, 1);
        assert_eq!(still.marbles.position(), moving.marbles.position(), "step {step}");
    }
    assert_eq!(asleep(&moving, &ids), ids.len());
    for last in [0, 700, 1499] {
        let mut world = moving.clone();
        for (i, wall) in (0..).zip(&walls) {
            let x = if i == last { -0.5 } else { 24.0 };
            world.walls.set(*wall, block([x, 0.0, -0.5], [x + 1.0, 1.0, 0.5])).unwrap();
        }
        steps(&mut world, 1);
        let met = islands_in(&moving, &ids, block([-0.5, 0.0, -0.5], [0.5, 1.0, 0.5]));
        assert!(met.len() > 3);
        assert_eq!(asleep(&world, &met), 0, "wall {last} came");
    }
}

/// Numbers in [0, 1) that look random.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }

    fn below(&mut self, count: usize) -> usize {
        (self.next() * count as f32) as usize % count
    }

    fn block(&mut self) -> Aabb<Point3<f32>> {
        let [x, z] = [4.0 * self.next() - 2.0, 4.0 * self.next() - 2.0];
        let (y, half) = (1.5 * self.next() - 0.3, 0.1 + 0.6 * self.next());
        block([x - half, y - half, z - half], [x + half, y + half, z + half])
    }
}

/// One lies on the floor, one floats.
#[test]
fn marbles_of_infinite_mass_that_do_not_move_let_others_sleep() {
    let (mut world, _, ids) = heap();
    let mass = taw::world::Mass::Infinite;
    let lies = Marble { mass, ..Marble::new(Point3::new(3.0, 0.31, 0.0), 0.3) };
    let floats =
        Marble { mass, gravity_scale: 0.0, ..Marble::new(Point3::new(0.0, 6.0, 0.0), 0.2) };
    let heavy = [lies, floats].map(|marble| world.marbles.insert(marble).unwrap());
    steps(&mut world, 600);
    assert!(ids.iter().chain(&heavy).all(|id| world.is_asleep(*id).unwrap()));
    // One that moves, however slowly, does not rest.
    world.marbles.set_velocity(heavy[1], Vec3::new(1e-4, 0.0, 0.0)).unwrap();
    steps(&mut world, 600);
    assert!(!world.is_asleep(heavy[1]).unwrap());
    assert!((world.marbles.get(heavy[1]).unwrap().position.x - 1e-3).abs() < 1e-5);
}
