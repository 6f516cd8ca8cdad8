//! Worlds are equal if they go on alike.

use taw::motion::WallMotion;
use taw::prelude::*;
use taw::shape::Aabb;
use taw::swarm::{Swarm, SwarmModel, Tier};

const DT: f32 = 1.0 / 60.0;

/// Marbles at rest on a floor, beside a block.
fn resting(response: Response) -> (World<f32>, WallId) {
    let mut world = World::<f32>::default();
    world.set_model(Model { response, substeps: 1, ..Model::default() }).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    let block = world.walls.insert(block(50.0)).unwrap();
    for x in 0..4 {
        let at = Point3::new(x as f32, 0.25, 0.0);
        world.marbles.insert(Marble::new(at, 0.25)).unwrap();
    }
    for _ in 0..120 {
        world.step(DT).unwrap();
    }
    (world, block)
}

fn block(x: f32) -> Aabb<Point3<f32>> {
    Aabb { min: Point3::new(x - 0.1, 0.3, -0.1), max: Point3::new(x + 0.1, 0.8, 0.1) }
}

#[test]
fn tiers_to_and_fro_leave_nothing_behind() {
    let mut swarm = Swarm::<f32>::default();
    let lab = SwarmModel { tier: Tier::Lab, ..SwarmModel::default() };
    swarm.set_model(lab).unwrap();
    assert_ne!(swarm, Swarm::default());
    swarm.set_model(SwarmModel::default()).unwrap();
    assert_eq!(swarm, Swarm::default());
}

#[test]
fn threads_and_instructions_make_no_difference() {
    let (mut world, _) = resting(Response::SoftStep);
    let other = world.clone();
    let model = SwarmModel { threads: 2, ..world.swarm.model() };
    world.swarm.set_model(model).unwrap();
    world.swarm.set_simd_level(taw::swarm::SimdLevel::PORTABLE);
    assert_eq!(world.swarm.model().threads, 2);
    let mut same = other.clone();
    same.swarm.set_model(other.swarm.model()).unwrap(); // wakes all, too
    assert!(world == same);
    world.step(DT).unwrap();
    same.step(DT).unwrap();
    assert!(world == same);
}

/// A wall that came back from elsewhere wakes who slept there.
#[test]
fn ways_of_walls_that_nobody_has_seen_yet_count() {
    for response in [Response::SoftStep, Response::Impulse] {
        let (world, wall) = resting(response);
        let moved_to = |x: f32| {
            let mut world = world.clone();
            world.walls.set(wall, block(x)).unwrap();
            world.walls.set(wall, block(50.0)).unwrap();
            world
        };
        let [at_first, at_third] = [moved_to(0.0), moved_to(2.0)];
        assert!(at_first == moved_to(0.0));
        let [mut a, mut b] = [at_first.clone(), at_third.clone()];
        a.step(DT).unwrap();
        b.step(DT).unwrap();
        assert!(a != b, "{response:?}: they wake others");
        assert!(at_first != at_third, "{response:?}");
    }
}

/// A step that is refused changes nothing: neither walls on their way, nor what the last one told.
#[test]
fn a_refused_step_leaves_a_world_equal() {
    for response in [Response::SoftStep, Response::Impulse, Response::EventDriven] {
        let mut world = World::<f32>::default();
        let detection = taw::world::Detection::Swept;
        world.set_model(Model { response, detection, substeps: 2, ..Model::default() }).unwrap();
        let wall = world.walls.insert(block(50.0)).unwrap();
        world.walls.set(wall, block(51.0)).unwrap();
        let velocity = Vec3::unit_x() * 50.0;
        let motion = WallMotion {
            velocity,
            angular_velocity: Vec3::new(0.0, 0.0, 0.0),
            pivot: Point3::new(0.0, 0.0, 0.0),
        };
        world.walls.set_motion(wall, Some(motion)).unwrap();
        for _ in 0..16_500 {
            world.marbles.insert(Marble::new(Point3::new(0.0, 5.0, 0.0), 0.25)).unwrap();
        }
        let before = world.clone();
        assert!(world.step(DT).is_err());
        assert!(world == before, "{response:?}");
        assert!(world.walls.get(wall).unwrap() == before.walls.get(wall).unwrap());
    }
}
