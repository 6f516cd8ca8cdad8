//! Worlds of `f64`, in which rows have the precision of the world.

use taw::world::Mass;

use super::*;
use tunnelling::dice;

/// Friction at one point conserves the angular momentum about it, so a ball that slides rolls in the end
/// at 5/7 of its speed.
#[test]
fn a_ball_rolls_at_five_sevenths_of_its_speed_to_rounding() {
    let mut world = world::<f64>(4);
    floor(&mut world);
    let velocity = Vec3::new(3.0, 0.0, 0.1);
    let marble = Marble { velocity, ..Marble::new(Point3::new(0.0, 0.1, 0.0), 0.1) };
    let id = world.marbles.insert(marble).unwrap();
    for _ in 0..120 {
        world.step(1.0 / 60.0).unwrap();
    }
    let marble = world.marbles.get(id).unwrap();
    let horizontal = Vec3 { y: 0.0, ..marble.velocity };
    let error = (horizontal - velocity * (5.0 / 7.0)).magnitude();
    assert!(error < 1e-13, "{error} m/s");
    let rim = marble.angular_velocity.cross(Vec3::new(0.0, -0.1, 0.0)) + horizontal;
    assert!(rim.magnitude() < 1e-13, "slides at {} m/s", rim.magnitude());
}

/// A number of `f32` is rounded to eight millimetres there.
#[test]
fn a_slow_ball_far_from_the_origin_goes_on() {
    let mut world = world::<f64>(2);
    world.set_gravity(Vec3::zero()).unwrap();
    let far = Point3::new(1e5, -1e5, 0.0);
    let velocity = Vec3::new(1e-3, 2e-3, 0.0);
    let id = world.marbles.insert(Marble { velocity, ..Marble::new(far, 0.1) }).unwrap();
    for _ in 0..60 {
        world.step(1.0 / 60.0).unwrap();
    }
    let error = (world.marbles.get(id).unwrap().position - far - velocity).magnitude();
    assert!(error < 1e-8, "{error} m");
}

/// Bounces are along the line of centers, and friction is equal and opposite.
#[test]
fn a_gas_keeps_its_momentum_to_rounding() {
    let mut world = world::<f64>(4);
    world.set_gravity(Vec3::zero()).unwrap();
    let mut random = dice(7);
    let material = Some(Material { restitution: 0.9, friction: 0.3, ..Material::default() });
    let mut masses = Vec::new();
    for cell in 0..216_u16 {
        let at = [cell % 6, cell / 6 % 6, cell / 36].map(|i| f64::from(i) * 0.25);
        let velocity = Vec3::new(random(), random(), random()) * 4.0 - Vec3::new(2.0, 2.0, 2.0);
        let ball = Marble::new(Point3::from(at), 0.06 + 0.06 * random());
        masses.push(1.0 + random());
        let mass = Mass::Kilograms(masses[usize::from(cell)]);
        world.marbles.insert(Marble { velocity, mass, material, ..ball }).unwrap();
    }
    let momentum = |world: &World<f64>| {
        let all = world.marbles.velocity().iter().zip(&masses);
        all.map(|(velocity, mass)| velocity * *mass).sum::<Vec3<f64>>()
    };
    let (before, mut impacts) = (momentum(&world), 0);
    for _ in 0..120 {
        world.step(1.0 / 60.0).unwrap();
        impacts += world.impacts().len();
    }
    let error = (momentum(&world) - before).magnitude();
    assert!(impacts > 300 && error < 1e-11, "{error} N s after {impacts} impacts");
}
