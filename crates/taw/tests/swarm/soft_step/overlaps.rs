//! Overlap is no energy: balls that are placed in each other part without speed.

use super::tunnelling::dice;
use super::*;

/// Kinetic energy about the mean velocity, in J/kg, and the fastest about it in m/s, after half a second
/// of free fall.
fn agitation(places: &[Point3<f32>], radius: f32, rotation: Rotation) -> [f32; 2] {
    let mut world = World::<f32>::default();
    world.set_model(Model { rotation, ..Model::GAME }).unwrap();
    for place in places {
        world.marbles.insert(Marble::new(*place, radius)).unwrap();
    }
    for _ in 0..30 {
        world.step(1.0 / 60.0).unwrap();
    }
    let velocities = world.marbles.velocity();
    let count = velocities.len() as f32;
    let mean = velocities.iter().fold(Vec3::zero(), |all, v| all + v) / count;
    let speeds = velocities.iter().map(|v| (v - mean).magnitude());
    let energy = speeds.clone().map(|speed| 0.5 * speed * speed).sum::<f32>() / count;
    [energy, speeds.fold(0.0, f32::max)]
}

#[test]
fn what_falls_freely_parts_without_speed() {
    let radius = 0.2;
    let lattice = |side: usize, pitch: f32| {
        let at = |i: usize| i as f32 * pitch;
        (0..side.pow(3))
            .map(move |i| Point3::new(at(i % side), at(i / side % side), at(i / side / side)))
            .collect::<Vec<_>>()
    };
    let mut random = dice(3);
    let mut scattered = |count: usize, size: f32| {
        let mut at = || size * random() as f32;
        (0..count).map(|_| Point3::new(at(), at(), at())).collect::<Vec<_>>()
    };
    let mut scenes = vec![lattice(5, 0.36), lattice(5, 0.39), lattice(3, 0.36)];
    scenes.extend([scattered(200, 0.1), scattered(200, 0.5)]);
    scenes.extend([2, 3, 8, 50, 125, 1_000].map(|count| vec![Point3::new(0.0, 0.0, 0.0); count]));
    for rotation in [Rotation::None, Rotation::Dynamic] {
        for places in &scenes {
            let [energy, fastest] = agitation(places, radius, rotation);
            let about = format!("{} about {:?}, {rotation:?}", places.len(), places[1]);
            assert!(energy < 1e-6 && fastest < 1e-2, "{about}: {energy} J/kg, {fastest} m/s");
        }
    }
}
