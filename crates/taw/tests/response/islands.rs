//! Islands of `Impulse` and of resting clusters, which threads solve one each.

use crate::draw::Draw;
use taw::prelude::*;
use taw::swarm::SwarmModel;

/// Pyramids of 14 balls, each of which is an island.
fn piles(response: Response, threads: u32) -> World<f32> {
    let mut world = World::default();
    let model = Model { response, substeps: 1, ..Model::GAME };
    world.set_model(model).unwrap();
    world.swarm.set_model(SwarmModel { threads, ..world.swarm.model() }).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    let mut draw = Draw(7);
    for pile in 0..25_u8 {
        for (layer, side) in [(0_u8, 3_u8), (1, 2), (2, 1)] {
            for at in 0..side * side {
                let mut along = |pile: u8, at: u8| {
                    let from_middle = f64::from(at) - 0.5 * f64::from(side - 1);
                    let jitter = draw.between(-0.01, 0.01);
                    (f64::from(pile) * 5.0 + from_middle * 1.02 + jitter) as f32
                };
                let (x, z) = (along(pile / 5, at / side), along(pile % 5, at % side));
                let center = Point3::new(x, 0.5 + 0.75 * f32::from(layer), z);
                world.marbles.insert(Marble::new(center, 0.5)).unwrap();
            }
        }
    }
    world
}

/// Checks islands that fall onto the floor and come to rest there: each is solved by whatever thread
/// comes first.
#[test]
fn islands_have_the_same_bits_on_any_number_of_threads() {
    for response in [Response::Impulse, Response::EventDriven] {
        let mut worlds = [1, 2, 3, 7].map(|threads| piles(response, threads));
        for step in 0..40 {
            for world in &mut worlds {
                world.step(1.0 / 60.0).unwrap();
            }
            let [first, others @ ..] = &worlds;
            let threads = first.contacts.len() / 128;
            assert!(step < 20 || threads >= 2, "{response:?}: {threads} threads pay");
            for world in others {
                assert_eq!(first.marbles, world.marbles, "{response:?}, step {step}");
                assert_eq!(first.contacts, world.contacts, "{response:?}, step {step}");
            }
        }
    }
}
