//! Memory of a swarm: columns of a known size, and nothing in a step that
//! seeks no pairs anew.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use taw::prelude::*;
use taw::swarm::{Ball, SwarmModel, Tier};

/// Counts what it is asked for.
struct Counting;

static ASKED: AtomicUsize = AtomicUsize::new(0);
static HELD: AtomicUsize = AtomicUsize::new(0);

// SAFETY: all is passed on.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ASKED.fetch_add(1, Ordering::Relaxed);
        HELD.fetch_add(layout.size(), Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

// One test, so that no other one allocates meanwhile.
#[test]
fn memory_is_counted_and_a_step_asks_for_none() {
    for tier in [Tier::Lab, Tier::Full] {
        let before = HELD.load(Ordering::Relaxed);
        let mut world = World::<f32>::default();
        world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
        for direction in [Vec3::unit_x(), -Vec3::unit_x(), Vec3::unit_z(), -Vec3::unit_z()] {
            world.walls.insert(Plane::new(direction, -21.0).unwrap()).unwrap();
        }
        let model = SwarmModel { tier, threads: 2, sleeps: false, ..SwarmModel::default() };
        world.swarm.set_model(model).unwrap();
        let balls: Vec<_> = (0..20_000_u16)
            .map(|i| {
                let at = |cell: u16| f32::from(cell) * 1.05 - 20.5;
                let height = 0.5 + f32::from(i / 1_600) * 1.05;
                let place = Point3::new(at(i % 40), height, at(i / 40 % 40));
                Ball::new(place, 0.3 + 0.2 * (f32::from(i) * 0.618).fract())
            })
            .collect();
        world.swarm.insert(&balls).unwrap();
        drop(balls);
        let (mut quiet, mut asked) = (0, 0);
        // The columns of the lattice tip over, and a heap comes to rest.
        for step in 0..700 {
            let (rebuilds, before) = (world.swarm.rebuilds(), ASKED.load(Ordering::Relaxed));
            world.step(1.0 / 60.0).unwrap();
            if step >= 600 && world.swarm.rebuilds() == rebuilds {
                quiet += 1;
                asked += ASKED.load(Ordering::Relaxed) - before;
            }
        }
        assert!(quiet > 30, "{quiet} steps sought nothing anew");
        // A list that becomes longer than it ever was doubles.
        assert!(asked <= 5, "{tier:?}: {asked} times in {quiet} steps");
        let held = HELD.load(Ordering::Relaxed) - before;
        let counted = world.swarm.bytes();
        println!("{tier:?}: {} bytes a ball, {} of them counted", held / 20_000, counted / 20_000);
        assert!(held.abs_diff(counted) < held / 20, "{held} bytes, {counted} of them counted");
    }
    for tier in [Tier::Lab, Tier::Full] {
        every_byte_of_a_copy_is_counted(tier);
    }
}

/// A copy has no room to spare, so what it takes is known to the byte: with marbles, half-spaces,
/// another wall and fast balls, so that every column is in use.
fn every_byte_of_a_copy_is_counted(tier: Tier) {
    let mut world = World::<f32>::default();
    let model = SwarmModel { tier, threads: 2, ..SwarmModel::default() };
    world.swarm.set_model(model).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    let box3 =
        taw::shape::Aabb3 { min: Point3::new(-2.0, 0.0, -2.0), max: Point3::new(2.0, 1.0, 2.0) };
    world.walls.insert(box3).unwrap();
    let balls: Vec<_> = (0..1_000_u16)
        .map(|i| {
            let at = |cell: u16| f32::from(cell) - 4.5;
            let velocity = Vec3::new(0.0, if i % 100 == 0 { -30.0 } else { 0.0 }, 0.0);
            let place = Point3::new(at(i % 10), f32::from(i / 100) + 0.5, at(i / 10 % 10));
            Ball { velocity, ..Ball::new(place, 0.4) }
        })
        .collect();
    let ids = world.swarm.insert(&balls).unwrap();
    for i in 0..50_u8 {
        let place = Point3::new(f32::from(i) - 25.0, 12.0, 0.0);
        world.marbles.insert(Marble::new(place, 0.4)).unwrap();
    }
    for step in 0..20 {
        world.step(1.0 / 60.0).unwrap();
        if step == 10 {
            world.swarm.remove(&ids[..50]).unwrap();
        }
        let before = HELD.load(Ordering::Relaxed);
        let copy = world.swarm.clone();
        let held = HELD.load(Ordering::Relaxed) - before;
        assert_eq!(held, copy.bytes(), "{tier:?} in step {step}");
    }
}
