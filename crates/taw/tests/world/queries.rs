//! Questions about a world, against asking each thing in it.

use std::sync::Arc;

use proptest::prelude::*;
use taw::contact::{RayCast, closest_points, shape_cast};
use taw::frame::{AxisAngle, Pose, Ray};
use taw::prelude::*;
use taw::shape::{Aabb, Capsule, Compound, HeightField, Hull, Mesh, Obb, Shape};

/// A world with walls of every kind, and marbles.
fn world(numbers: &[[f64; 3]]) -> World<f64> {
    let mut world = World::default();
    let mut numbers = numbers.iter().copied();
    let mut next = || Point3::from(numbers.next().unwrap_or([0.3, 0.7, -0.2]));
    let turn = |axis: Point3<f64>| {
        AxisAngle::new(axis.to_vec() + Vec3::unit_y() * 0.01, axis.x).unwrap().into()
    };
    let mut insert = |wall: WallShape<f64>| world.walls.insert(wall).unwrap();
    insert(Plane::new(Vec3::unit_y(), -4.0).unwrap().into());
    insert(Sphere::new(next(), 0.7).unwrap().into());
    let at = next();
    insert(Aabb::new(at, at + Vec3::new(1.0, 0.5, 0.8)).unwrap().into());
    insert(Obb::new(next(), turn(next()), Vec3::new(0.8, 0.3, 0.5)).unwrap().into());
    insert(Capsule::new(next(), next(), 0.4).unwrap().into());
    let around = next();
    let corner = |x: f64, y: f64, z: f64| around + Vec3::new(x, y, z);
    let corners = [corner(0.0, 0.0, 0.0), corner(1.0, 0.1, 0.0), corner(0.0, 1.2, 0.1)];
    let corners = [corners[0], corners[1], corners[2], corner(0.2, 0.1, 1.4)];
    insert(Hull::new(&corners).unwrap().into());
    let parts = [Shape::Sphere(Sphere::new(next(), 0.5).unwrap())].to_vec();
    let inner = Shape::Compound(Compound::new(parts).unwrap());
    let slab = Shape::Obb(Obb::new(next(), turn(next()), Vec3::new(0.2, 0.9, 0.3)).unwrap());
    insert(Compound::new(vec![slab, inner]).unwrap().into());
    let points = vec![next(), next(), next(), next()];
    let mesh = Mesh::new(points, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
    let pose = Pose { rotation: turn(next()), translation: next().to_vec() };
    insert(WallShape::Mesh(Arc::new(mesh), pose));
    let heights = (0..9).map(|_| next().x * 0.3).collect();
    let field = HeightField::new(Point3::new(-2.0, -3.0, -2.0), [2.0, 2.0], 3, heights).unwrap();
    insert(field.into());
    for _ in 0..5 {
        world.marbles.insert(Marble::new(next(), 0.3)).unwrap();
    }
    world
}

/// All things of a world.
fn things(world: &World<f64>) -> Vec<ColliderId> {
    let marbles =
        (0..world.marbles.len()).map(|row| ColliderId::Marble(world.marbles.id(row).unwrap()));
    let walls = (0..world.walls.len()).map(|row| ColliderId::Wall(world.walls.id(row).unwrap()));
    marbles.chain(walls).collect()
}

/// Distance of a thing's surface from a point, in metres.
fn distance(world: &World<f64>, thing: ColliderId, point: Point3<f64>) -> f64 {
    match thing {
        ColliderId::Marble(id) => {
            let marble = world.marbles.get(id).unwrap();
            (point - marble.position).magnitude() - marble.radius
        }
        ColliderId::Wall(id) => world.walls.get(id).unwrap().project_point(point).distance,
        ColliderId::Body(id) => panic!("{id:?} is not there"),
    }
}

fn numbers() -> impl Strategy<Value = Vec<[f64; 3]>> {
    prop::collection::vec([-3.0..3.0_f64, -3.0..3.0, -3.0..3.0], 40)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn a_ray_finds_what_is_first(
        numbers in numbers(), from in [-6.0..6.0_f64, -3.0..6.0, -6.0..6.0],
        to in [-3.0..3.0_f64, -3.0..3.0, -3.0..3.0],
    ) {
        let world = world(&numbers);
        let mut tree = QueryTree::default();
        let queries = world.queries(&mut tree);
        let origin = Point3::from(from);
        let ray = Ray { origin, direction: (Point3::from(to) - origin).normalize() };
        let all = queries.cast_ray_all(&ray, 9.0, |_| true);
        prop_assert!(all.is_sorted_by(|x, y| x.result.distance <= y.result.distance));
        let first = queries.cast_ray(&ray, 9.0, |_| true);
        prop_assert_eq!(first, all.first().copied());
        // Alone, each answers the same; and without it, the others do.
        for thing in things(&world) {
            let alone = queries.cast_ray(&ray, 9.0, |it| it == thing);
            let among = all.iter().find(|found| found.collider == thing).copied();
            prop_assert_eq!(alone, among);
            let others = queries.cast_ray_all(&ray, 9.0, |it| it != thing);
            prop_assert_eq!(others.len(), all.len() - usize::from(among.is_some()));
            if let ColliderId::Marble(id) = thing {
                let marble = world.marbles.get(id).unwrap();
                let sphere = Sphere { center: marble.position, radius: marble.radius };
                prop_assert_eq!(sphere.cast_ray(&ray, 9.0), alone.map(|found| found.result));
            }
            // What it hits is there, and nothing of it comes before.
            let end = alone.map_or(9.0, |found| found.result.distance);
            if let Some(found) = alone && end > 0.0 {
                let off = distance(&world, thing, found.result.point);
                prop_assert!(off.abs() < 1e-9, "{found:?} {off}");
            }
            for part in 1..30 {
                let at = ray.at(end * f64::from(part) / 30.0);
                let inside = distance(&world, thing, at) < -1e-9;
                prop_assert!(end == 0.0 || !inside, "{thing:?} {ray:?}");
            }
        }
    }

    #[test]
    fn the_closest_is_the_closest(
        numbers in numbers(), at in [-5.0..5.0_f64, -3.0..5.0, -5.0..5.0], within in 0.1..9.0_f64,
    ) {
        let world = world(&numbers);
        let mut tree = QueryTree::default();
        let queries = world.queries(&mut tree);
        let at = Point3::from(at);
        let found = queries.project_point(at, within, |_| true);
        let all = things(&world).into_iter().map(|thing| (distance(&world, thing, at), thing));
        let best = all.reduce(|x, y| if y.0 < x.0 { y } else { x }).unwrap();
        prop_assert_eq!(found.is_some(), best.0 <= within);
        if let Some(found) = found {
            prop_assert!((found.result.distance - best.0).abs() < 1e-12, "{found:?} {best:?}");
        }
    }

    #[test]
    fn overlaps_and_sweeps_agree_with_asking_each(
        numbers in numbers(), at in [-4.0..4.0_f64, -3.0..4.0, -4.0..4.0],
        other in [-4.0..4.0_f64, -3.0..4.0, -4.0..4.0],
        moves in [-6.0..6.0_f64, -6.0..6.0, -6.0..6.0],
    ) {
        let world = world(&numbers);
        let mut tree = QueryTree::default();
        let queries = world.queries(&mut tree);
        let ball = Sphere { center: Point3::from(at), radius: 0.4 };
        let long = Capsule::new(Point3::from(at), Point3::from(other), 0.3).unwrap();
        let both = Compound::new(vec![Shape::Sphere(ball), Shape::Capsule(long)]).unwrap();
        let found = queries.overlaps(&Shape::Sphere(ball), |_| true);
        for thing in things(&world) {
            let surface = distance(&world, thing, ball.center);
            let gap = surface - 0.4;
            prop_assert!(gap.abs() < 1e-9 || found.contains(&thing) == (gap <= 0.0), "{thing:?}");
        }
        let shape = Shape::Compound(both);
        let together = queries.overlaps(&shape, |_| true);
        let apart = queries.overlaps(&Shape::Capsule(long), |_| true);
        for thing in things(&world) {
            let either = found.contains(&thing) || apart.contains(&thing);
            prop_assert_eq!(together.contains(&thing), either);
        }
        let moves = Vec3::from(moves);
        let first = queries.cast_shape(&Shape::Sphere(ball), moves, |_| true);
        let end = first.map_or(1.0, |found| found.result.time);
        for thing in things(&world) {
            let alone = queries.cast_shape(&Shape::Sphere(ball), moves, |it| it == thing);
            let time = alone.map(|found| found.result.time);
            prop_assert!(time.is_none_or(|time| time >= end));
            if let ColliderId::Marble(id) = thing {
                let marble = world.marbles.get(id).unwrap();
                let sphere = Sphere { center: marble.position, radius: marble.radius };
                let exact = shape_cast(&sphere, Vec3::new(0.0, 0.0, 0.0), &ball, moves);
                prop_assert_eq!(time, exact.map(|touch| touch.time));
                prop_assert_eq!(found.contains(&thing), closest_points(&sphere, &ball).touching());
            }
            if !found.contains(&thing) {
                for part in 0..20 {
                    let there = ball.center + moves * (time.unwrap_or(1.0) * f64::from(part) / 20.0);
                    let surface = distance(&world, thing, there);
                            let gap = surface - 0.4;
                    prop_assert!(gap > -1e-8, "{thing:?} {gap} before {time:?}");
                }
            }
        }
    }
}

#[test]
fn a_tree_that_is_refitted_answers_as_one_that_is_new() {
    let numbers: Vec<_> =
        (0..40).map(|i| [0, 1, 2].map(|n| f64::from((i * 7 + n * 5) % 13) * 0.4 - 2.4)).collect();
    let mut world = world(&numbers);
    let mut kept = QueryTree::default();
    for step in 0..200 {
        world.step(1.0 / 60.0).unwrap();
        if step == 100 {
            let id = world.marbles.id(0).unwrap();
            world.marbles.remove(id).unwrap();
        }
        let mut new = QueryTree::default();
        for i in 0..10 {
            let at = Point3::new(f64::from(i) * 0.5 - 2.5, 1.0, 0.3);
            let ray = Ray { origin: at + Vec3::unit_y() * 4.0, direction: -Vec3::unit_y() };
            let all = world.queries(&mut kept).cast_ray_all(&ray, f64::INFINITY, |_| true);
            let fresh = world.queries(&mut new).cast_ray_all(&ray, f64::INFINITY, |_| true);
            assert_eq!(all, fresh);
            let near = world.queries(&mut kept).project_point(at, f64::INFINITY, |_| true);
            assert_eq!(near, world.queries(&mut new).project_point(at, f64::INFINITY, |_| true));
        }
    }
    let ball = Sphere::new(Point3::new(0.0, 0.0, 0.0), 100.0).unwrap();
    let all = world.queries(&mut kept).overlaps(&Shape::Sphere(ball), |_| true);
    assert_eq!(all.len(), things(&world).len());
    let walls = world
        .queries(&mut kept)
        .overlaps(&Shape::Sphere(ball), |it| matches!(it, ColliderId::Wall(_)));
    assert_eq!(walls.len(), world.walls.len());
}
