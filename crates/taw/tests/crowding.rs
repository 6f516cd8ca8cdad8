//! More marbles at one place than a step takes are refused, before anything has moved.

use taw::Error;
use taw::prelude::*;

const DT: f32 = 1.0 / 60.0;

fn world(response: Response, count: usize, place: impl Fn(usize) -> Marble<f32>) -> World<f32> {
    let mut world = World::default();
    world.set_model(Model { response, ..Model::default() }).unwrap();
    for i in 0..count {
        world.marbles.insert(place(i)).unwrap();
    }
    world
}

fn at_one_point(_: usize) -> Marble<f32> {
    Marble::new(Point3::new(0.3, 1.0, -2.0), 0.1)
}

const BY_LISTS: [Response; 4] = [
    Response::Displacement,
    Response::Impulse,
    Response::Penalty(ContactLaw::SpringDashpot),
    Response::EventDriven,
];

#[test]
fn too_many_at_one_point_are_refused_and_nothing_has_changed() {
    for response in BY_LISTS {
        let mut world = world(response, 20_000, at_one_point);
        let before = world.clone();
        let error = world.step(DT).unwrap_err();
        let Error::TooManyPairs { pairs, max } = error else { panic!("{error}") };
        assert_eq!((pairs, max), (20_000 * 19_999 / 2, World::<f32>::MAX_PAIRS), "{response:?}");
        assert!(error.to_string().starts_with("at least 199990000 pairs"), "{error}");
        assert_eq!(world, before, "{response:?}");
        // Fewer are taken.
        let surplus: Vec<_> = (0..5_000).filter_map(|row| world.marbles.id(row)).collect();
        for id in surplus {
            world.marbles.remove(id).unwrap();
        }
        world.integrate(DT).unwrap();
    }
}

#[test]
fn many_that_do_not_overlap_or_do_not_collide_are_no_crowd() {
    let spread = |i: usize| Marble::new(Point3::new(i as f32 * 0.1, 1.0, 0.0), 0.1);
    let ghosts = |_: usize| Marble { layers: CollisionLayers::NONE, ..at_one_point(0) };
    let far = |i: usize| Marble::new(Point3::new(1e30, i as f32, 0.0), 0.1);
    for place in [&spread as &dyn Fn(usize) -> Marble<f32>, &ghosts, &far] {
        for response in BY_LISTS {
            world(response, 20_000, place).integrate(DT).unwrap();
        }
    }
}
