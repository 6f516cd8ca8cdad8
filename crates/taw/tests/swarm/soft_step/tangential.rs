//! Tangential restitution: what slides on after a bounce, or comes back.

use super::*;

/// Velocities and angular velocities after a bounce of the first marble, on a wall if there is no
/// second one.
fn bounce(
    response: Response,
    material: Material<f64>,
    marbles: &[Marble<f64>],
) -> Vec<[Vec3<f64>; 2]> {
    let mut world = World::<f64>::default();
    let model = Model { response, rotation: Rotation::Dynamic, substeps: 4, ..Model::default() };
    world.set_model(model).unwrap();
    world.set_gravity(Vec3::zero()).unwrap();
    if marbles.len() == 1 {
        let wall = world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
        world.walls.set_material(wall, Some(material)).unwrap();
    }
    let insert = |marble: &Marble<f64>| {
        world.marbles.insert(Marble { material: Some(material), ..*marble }).unwrap()
    };
    let ids: Vec<_> = marbles.iter().map(insert).collect();
    for _ in 0..30 {
        world.step(1.0 / 60.0).unwrap();
    }
    let state = |id: &MarbleId| {
        let marble = world.marbles.get(*id).unwrap();
        [marble.velocity, marble.angular_velocity]
    };
    ids.iter().map(state).collect()
}

#[test]
fn a_bounce_leaves_the_sliding_speed_that_tangential_restitution_does() {
    let angular_velocity = Vec3::new(5.0, 2.0, -7.0);
    for beta in [-1.0, -0.4, 0.0, 0.3, 1.0] {
        for (friction, restitution) in [(0.05, 0.7), (0.4, 0.7), (1e3, 1.0)] {
            let material = Material {
                restitution,
                friction,
                tangential_restitution: beta,
                ..Material::default()
            };
            let ball = Marble {
                velocity: Vec3::new(1.5, -2.0, 0.5),
                angular_velocity,
                ..Marble::new(Point3::new(0.0, 0.5, 0.0), 0.1)
            };
            let other = Marble {
                mass: taw::world::Mass::Kilograms(20.0),
                ..Marble::new(Point3::new(0.35, 0.0, 0.05), 0.15)
            };
            for marbles in [vec![ball], vec![ball, other]] {
                let [wanted, is] = [Response::Impulse, Response::SoftStep]
                    .map(|response| bounce(response, material, &marbles));
                let about = format!("{beta} {friction} {}", marbles.len());
                assert!(
                    (wanted[0][0] - marbles[0].velocity).magnitude() > 0.5,
                    "{about}: no bounce"
                );
                for (wanted, is) in wanted.iter().flatten().zip(is.iter().flatten()) {
                    assert!((wanted - is).magnitude() < 1e-4, "{about}: {is:?}, not {wanted:?}");
                }
            }
        }
    }
}
