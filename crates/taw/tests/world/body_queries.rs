//! Questions about rigid bodies, against the distances of their shapes.

use taw::Error;
use taw::body::Body;
use taw::frame::Ray;
use taw::joint::{Joint, JointEnd, JointKind};
use taw::prelude::*;
use taw::shape::{BoundedShape, Compound, Shape};

use crate::any_body::{any_body, any_point, any_vector, placed};
use crate::draw::Draw;

/// Bodies that have flown for a while, with their shapes where they are.
fn flown<S: Scalar>(seed: u64) -> (World<S>, Vec<(ColliderId, Shape<f64>)>) {
    let mut world = World::default();
    world.set_model(Model::GAME).unwrap();
    let locals: Vec<_> = (0..10)
        .map(|i| {
            let seed = 1000 * seed + i;
            let body = any_body::<S>(&mut Draw(seed), 0.5, 1.5);
            let local = any_body::<f64>(&mut Draw(seed), 0.5, 1.5).shape;
            let angular_velocity = any_vector(&mut Draw(seed + 500), 5.0);
            (world.bodies.insert(Body { angular_velocity, ..body }).unwrap(), local)
        })
        .collect();
    for _ in 0..5 {
        world.step(S::from_f64(1.0 / 60.0)).unwrap();
    }
    let shapes = locals.into_iter().map(|(id, local)| (id.into(), placed(&world, id, &local)));
    let shapes = shapes.collect();
    (world, shapes)
}

fn distance<S: Scalar>(shape: &Shape<f64>, point: Point3<S>) -> f64 {
    shape.project_point(point.map(S::as_f64)).distance
}

fn rays<S: Scalar>(tolerance: f64) {
    let mut hits = 0;
    for seed in 0..60 {
        let (world, shapes) = flown::<S>(seed);
        let mut tree = QueryTree::default();
        let queries = world.queries(&mut tree);
        let mut draw = Draw(seed);
        for _ in 0..12 {
            let origin: Point3<S> = any_point(&mut draw, 6.0);
            let direction = (any_point::<S>(&mut draw, 1.5) - origin).normalize();
            let (ray, far) = (Ray { origin, direction }, S::from_f64(9.0));
            let all = queries.cast_ray_all(&ray, far, |_| true);
            assert_eq!(queries.cast_ray(&ray, far, |_| true), all.first().copied());
            assert!(all.is_sorted_by(|x, y| x.result.distance <= y.result.distance));
            for (id, shape) in &shapes {
                let mut of_it = all.iter().filter(|hit| hit.collider == *id);
                let (hit, again) = (of_it.next().map(|hit| hit.result), of_it.next());
                assert_eq!(again, None, "{id:?} is hit twice");
                let end = hit.map_or(far, |hit| hit.distance);
                if let Some(hit) = hit {
                    hits += 1;
                    let gap = distance(shape, hit.point);
                    let on_it = gap.abs() < tolerance || gap < 0.0 && end == S::zero();
                    assert!(on_it, "{seed}, {id:?}: {hit:?} is {gap} m off");
                    let toward = hit.normal.dot(direction).as_f64();
                    assert!(end == S::zero() || toward < tolerance, "{seed}, {id:?}: {hit:?}");
                }
                for part in 0..200 {
                    let at = ray.at(end * S::from_f64(f64::from(part) / 200.0));
                    let gap = distance(shape, at);
                    assert!(
                        end == S::zero() || gap > -tolerance,
                        "{seed}, {id:?}: {gap} at {at:?}"
                    );
                }
            }
        }
    }
    assert!(hits > 200, "{hits} hits say little");
}

#[test]
fn a_ray_hits_each_body_once_where_it_first_meets_a_part_of_it() {
    rays::<f64>(1e-9);
    rays::<f32>(3e-5);
}

fn projections<S: Scalar>(tolerance: f64) {
    for seed in 0..60 {
        let (world, shapes) = flown::<S>(seed);
        let mut tree = QueryTree::default();
        let queries = world.queries(&mut tree);
        let mut draw = Draw(seed);
        for _ in 0..40 {
            let (at, within) = (any_point::<S>(&mut draw, 3.0), draw.between(0.1, 3.0));
            let best = shapes.iter().map(|(_, shape)| distance(shape, at)).fold(9.0, f64::min);
            let found = queries.project_point(at, S::from_f64(within), |_| true);
            let case = format!("{seed}: {found:?}, {best} of {within}");
            assert!(
                found.is_some() == (best <= within) || (best - within).abs() < tolerance,
                "{case}"
            );
            let Some(found) = found else { continue };
            assert!((found.result.distance.as_f64() - best).abs() < tolerance, "{case}");
            let (_, shape) = shapes.iter().find(|(id, _)| *id == found.collider).unwrap();
            assert!((distance(shape, at) - best).abs() < tolerance, "{case}");
            let way = (found.result.point - at).magnitude().as_f64();
            assert!((way - best.abs()).abs() < tolerance, "{case}");
        }
    }
}

#[test]
fn a_point_is_projected_on_the_nearest_body() {
    projections::<f64>(1e-9);
    projections::<f32>(3e-5);
}

fn shapes<S: Scalar>(tolerance: f64) {
    let (mut touching, mut hits) = (0, 0);
    for seed in 0..60 {
        let (world, shapes) = flown::<S>(seed);
        let mut tree = QueryTree::default();
        let queries = world.queries(&mut tree);
        let mut draw = Draw(seed);
        for _ in 0..12 {
            let (center, radius) = (any_point::<S>(&mut draw, 2.5), draw.between(0.05, 0.6));
            let way: Vec3<S> = any_vector(&mut draw, 6.0);
            let ball = Shape::Sphere(Sphere::new(center, S::from_f64(radius)).unwrap());
            let overlaps = queries.overlaps(&ball, |_| true);
            touching += overlaps.len();
            for (id, shape) in &shapes {
                let gap = distance(shape, center) - radius;
                let says = overlaps.contains(id);
                assert!(says == (gap <= 0.0) || gap.abs() < tolerance, "{seed}, {id:?}: {gap}");
            }
            // Of those that it does not touch at the start, the first.
            let apart: Vec<_> = shapes.iter().filter(|(id, _)| !overlaps.contains(id)).collect();
            let hit = queries.cast_shape(&ball, way, |id| !overlaps.contains(&id));
            let end = hit.map_or(S::one(), |hit| hit.result.time);
            if let Some(hit) = hit {
                hits += 1;
                let (_, shape) = shapes.iter().find(|(id, _)| *id == hit.collider).unwrap();
                let gap = distance(shape, center + way * end) - radius;
                assert!(gap.abs() < tolerance, "{seed}: {hit:?} is {gap} m off");
                let off = distance(shape, hit.result.point);
                assert!(off.abs() < tolerance, "{seed}: {hit:?} is {off} m off");
            }
            for part in 0..200 {
                let at = center + way * (end * S::from_f64(f64::from(part) / 200.0));
                for (id, shape) in &apart {
                    let gap = distance(shape, at) - radius;
                    assert!(gap > -tolerance, "{seed}, {id:?}: {gap} at {at:?}");
                }
            }
        }
    }
    assert!(touching > 50 && hits > 100, "{touching} and {hits} say little");
}

#[test]
fn shapes_overlap_and_meet_bodies_where_their_distance_says() {
    shapes::<f64>(1e-6);
    shapes::<f32>(1e-4);
}

fn rod(position: Point3<f64>, layers: CollisionLayers) -> Body<f64> {
    let end = |x: f64| Shape::Sphere(Sphere::new(Point3::new(x, 0.0, 0.0), 0.2).unwrap());
    let shape = Shape::Compound(Compound::new(vec![end(-1.0), end(1.0)]).unwrap());
    Body { layers, ..Body::new(shape, position) }
}

#[test]
fn a_body_that_is_gone_or_changed_is_not_found_where_it_was() {
    let mut world = World::<f64>::default();
    world.set_model(Model::GAME).unwrap();
    let at = |x: f64| Point3::new(x, 0.0, 0.0);
    let [gone, less] =
        [0.0, 5.0].map(|x| world.bodies.insert(rod(at(x), CollisionLayers::ALL)).unwrap());
    let mut tree = QueryTree::default();
    tree.update(&world);
    let ends = [at(-1.0), at(1.0), at(4.0), at(6.0)].map(|at| Sphere::new(at, 0.1).unwrap());
    let found = |world: &World<f64>, tree: &QueryTree<f64>, end: &Sphere<f64>| {
        world.queries_of(tree).overlaps(&Shape::Sphere(*end), |_| true)
    };
    let all = [gone, gone, less, less].map(|id| vec![ColliderId::Body(id)]);
    assert_eq!(ends.each_ref().map(|end| found(&world, &tree, end)), all);
    world.bodies.remove(gone).unwrap();
    let ball = Body::new(Shape::Sphere(Sphere::new(at(-1.0), 0.2).unwrap()), at(5.0));
    world.bodies.set(less, ball).unwrap();
    let now = [vec![], vec![], vec![ColliderId::Body(less)], vec![]];
    assert_eq!(ends.each_ref().map(|end| found(&world, &tree, end)), now, "an older tree");
    tree.update(&world);
    assert_eq!(ends.each_ref().map(|end| found(&world, &tree, end)), now, "a new tree");
    assert_eq!(world.layers(gone.into()), Err(Error::NoSuchBody(gone)));
}

#[test]
fn a_marble_may_collide_with_a_body_of_its_layers_that_no_joint_keeps_apart() {
    let mut world = World::<f64>::default();
    world.set_model(Model::GAME).unwrap();
    let at = |x: f64| Point3::new(x, 0.0, 0.0);
    let other = CollisionLayers::new(2, 2);
    let deaf = world.bodies.insert(rod(at(0.0), other)).unwrap();
    let [near, held] =
        [3.0, 6.0].map(|x| world.bodies.insert(rod(at(x), CollisionLayers::ALL)).unwrap());
    let marble = Marble { layers: CollisionLayers::new(1, 1), ..Marble::new(at(6.0), 0.1) };
    let marble = world.marbles.insert(marble).unwrap();
    let zero = Vec3::new(0.0, 0.0, 0.0);
    let ends = [JointEnd::marble(marble, zero), JointEnd::body(held, zero)];
    world.joints.insert(Joint::new(JointKind::Distance([0.0, 1.0]), ends)).unwrap();
    assert_eq!(world.layers(deaf.into()), Ok(other));
    let collides = [deaf, near, held].map(|id| world.may_collide(marble, id.into()));
    assert_eq!(collides, [Ok(false), Ok(true), Ok(false)]);
    // Only marbles and walls are passed by name.
    world.marbles.set_ignored(marble, &[near.into()]).unwrap();
    world.step(1.0 / 60.0).unwrap();
    assert_eq!(world.may_collide(marble, near.into()), Ok(true));
    world.bodies.remove(near).unwrap();
    assert_eq!(world.may_collide(marble, near.into()), Err(Error::NoSuchBody(near)));
}
