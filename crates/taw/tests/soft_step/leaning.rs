//! Heavy balls that lean on light ones.

use taw::world::Mass;

use super::*;
use tunnelling::dice;

/// A light ball between the floor and a heavy one that leans over: it is held by friction, of as much
/// as the floor bears for the heavy one. That friction goes with the load.
#[test]
fn a_heavy_ball_that_leans_on_a_light_one_makes_no_energy() {
    let mut random = dice(9);
    for number in 0..1_200 {
        let rotation = [Rotation::None, Rotation::Rolling, Rotation::Dynamic][number % 3];
        let mut world = world::<f32>(1 + number as u32 / 3 % 8);
        world.set_model(Model { rotation, ..world.model() }).unwrap();
        let friction = [0.0, 0.5, 1.0][number / 24 % 3];
        let restitution = if random() < 0.7 { 0.0 } else { 0.5 };
        let material = Some(Material { friction, restitution, ..Material::default() });
        world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
        let upper = 0.1 + 0.5 * random() as f32;
        let lower = upper * 25_f32.powf(random() as f32) / 5.0;
        let (ratio, lean) = (10.0 * 30_f32.powf(random() as f32), 0.1 * random() as f32);
        let height = 0.1 * random() as f32 + lower + (upper + lower) * (1.0 - lean * lean).sqrt();
        let mut insert = |x, y, radius, kilograms| {
            let ball = Marble::new(Point3::new(x, y, 0.0), radius);
            let marble = Marble { mass: Mass::Kilograms(kilograms), material, ..ball };
            world.marbles.insert(marble).unwrap();
        };
        insert(0.0, lower, lower, 1.0);
        insert(lean * (upper + lower), height, upper, ratio);
        let begin = world.energy().total();
        for step in 0..120 {
            world.step(1.0 / 60.0).unwrap();
            let now = world.energy().total();
            assert!(
                now < begin * 1.005,
                "{number}, step {step}: {begin} J to {now} J, radii {lower} and {upper}, {ratio} times as heavy"
            );
        }
    }
}
