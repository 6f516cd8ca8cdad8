//! Sleep by the other methods: sequential impulses, penalty forces, projection.

use super::*;
use taw::response::ContactLaw;

const RESPONSES: [Response; 4] = [
    Response::Impulse,
    Response::Displacement,
    Response::Penalty(ContactLaw::SpringDashpot),
    Response::Penalty(ContactLaw::HertzMindlin),
];

fn heap_by(response: Response) -> (World<f32>, WallId, Vec<MarbleId>) {
    let (mut world, floor, ids) = heap();
    world.set_model(Model { response, substeps: 8, ..world.model() }).unwrap();
    (world, floor, ids)
}

#[test]
fn a_heap_falls_asleep_by_every_method() {
    for response in RESPONSES {
        let (mut world, _, ids) = heap_by(response);
        let mut counts = Vec::new();
        for _ in 0..12 {
            steps(&mut world, 60);
            counts.push(asleep(&world, &ids));
        }
        println!("{response:?} {counts:?}");
    }
}
