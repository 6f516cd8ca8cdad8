//! Queries of balls, against those of marbles at the same places.

use taw::frame::Ray;
use taw::prelude::*;
use taw::shape::{Obb, Shape};
use taw::swarm::{Ball, BallTree};

/// Numbers in [-1, 1) that look random (Steele, Lea and Flood 2014, `SplitMix64`).
fn random(seed: u64) -> f64 {
    let mut z = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

fn vector(seed: u64, size: f64) -> Vec3<f64> {
    Vec3::new(random(3 * seed), random(3 * seed + 1), random(3 * seed + 2)) * size
}

/// A world of marbles that are where the balls are.
fn copy(world: &World<f64>) -> World<f64> {
    let mut copy = World::default();
    for [x, y, z, radius] in world.swarm.balls() {
        copy.marbles.insert(Marble::new(Point3::new(*x, *y, *z), *radius)).unwrap();
    }
    copy
}

#[test]
fn balls_are_found_as_marbles_are_wherever_they_moved() {
    let mut world = World::<f64>::default();
    world.set_gravity(Vec3::zero()).unwrap();
    let place = |i: u64| Point3::from_vec(vector(i, 10.0));
    let balls = (0..400).map(|i| Ball {
        velocity: vector(1000 + i, 20.0),
        ..Ball::new(place(i), 0.2 + 0.1 * random(9999 + i).abs())
    });
    let mut ids = world.swarm.insert(&balls.collect::<Vec<_>>()).unwrap();
    let mut tree = BallTree::default();
    let (mut found, mut none) = (0, 0);
    for round in 0..8 {
        let gone = ids.split_off(400 - 7 * round);
        world.swarm.remove(&gone).unwrap();
        let copy = copy(&world);
        let mut marbles = QueryTree::default();
        let marbles = copy.queries(&mut marbles);
        tree.update(&world.swarm);
        let balls = world.swarm.queries(&tree);
        // The one takes every second row, as the other does.
        let row = |ball| world.swarm.row(ball).unwrap();
        let marble = |ball| ColliderId::Marble(copy.marbles.id(row(ball)).unwrap());
        let even = |id: ColliderId| matches!(id, ColliderId::Marble(id) if copy.marbles.row(id).unwrap().is_multiple_of(2));
        let even_ball = |ball| row(ball).is_multiple_of(2);
        for i in 0..40 {
            let seed = 100_000 + 50 * i + 3000 * round as u64;
            let origin = Point3::from_vec(vector(seed, 12.0));
            let ray = Ray { origin, direction: vector(seed + 1, 1.0).normalize() };
            let of_balls = balls.cast_ray_all(&ray, 15.0, even_ball);
            let of_marbles = marbles.cast_ray_all(&ray, 15.0, even);
            let hits: Vec<_> = of_balls.iter().map(|it| (marble(it.ball), it.result)).collect();
            let expected: Vec<_> = of_marbles.iter().map(|it| (it.collider, it.result)).collect();
            assert_eq!(hits, expected);
            let half = Vec3::new(0.5, 1.5, 1.0);
            let shape = Shape::Obb(Obb::new(origin, One::one(), half).unwrap());
            let motion = vector(seed + 2, 4.0);
            let hit = balls.cast_shape(&shape, motion, even_ball);
            let expected = marbles.cast_shape(&shape, motion, even);
            assert_eq!(hit.map(|it| it.result), expected.map(|it| it.result));
            let mut over: Vec<_> =
                balls.overlaps(&shape, even_ball).into_iter().map(marble).collect();
            over.sort_unstable();
            assert_eq!(over, marbles.overlaps(&shape, even));
            let near = balls.project_point(origin, 2.0, even_ball);
            let expected = marbles.project_point(origin, 2.0, even);
            assert_eq!(near.map(|it| it.result), expected.map(|it| it.result));
            found += hits.len() + over.len() + usize::from(hit.is_some());
            none += usize::from(near.is_none());
        }
        for _ in 0..3 {
            world.step(1.0 / 60.0).unwrap();
        }
    }
    assert!(found > 100 && none > 5, "{found} and {none} say little");
}

#[test]
fn balls_of_marbles_are_none_of_the_swarm() {
    let mut world = World::<f64>::default();
    world.set_model(Model::GAME).unwrap();
    world.set_gravity(Vec3::zero()).unwrap();
    world.marbles.insert(Marble::new(Point3::new(2.0, 0.0, 0.0), 0.5)).unwrap();
    let ray = Ray { origin: Point3::origin(), direction: Vec3::unit_x() };
    let mut tree = BallTree::default();
    for expected in [0, 1, 0] {
        if expected == 1 {
            world.swarm.insert(&[Ball::new(Point3::new(4.0, 0.0, 0.0), 0.5)]).unwrap();
        }
        world.step(1.0 / 60.0).unwrap();
        tree.update(&world.swarm);
        let hits = world.swarm.queries(&tree).cast_ray_all(&ray, f64::INFINITY, |_| true);
        assert_eq!(hits.len(), expected);
        let nan = Ray { origin: Point3::new(f64::NAN, 0.0, 0.0), ..ray };
        assert!(world.swarm.queries(&tree).cast_ray_all(&nan, 1.0, |_| true).is_empty());
        if let Some(hit) = hits.first() {
            assert_eq!(hit.result.distance, 3.5);
            world.swarm.remove(&[hit.ball]).unwrap();
        }
    }
}
