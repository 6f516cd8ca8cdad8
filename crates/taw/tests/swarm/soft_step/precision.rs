//! Worlds of `f64`, in which rows have the precision of the world.

use taw::motion::{ForceField, Integrator};
use taw::swarm::{Ball, SwarmModel, Tier};
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

#[test]
fn a_slow_ball_of_a_swarm_far_from_the_origin_goes_on() {
    for (tier, response) in [Tier::Lab, Tier::Full]
        .into_iter()
        .flat_map(|tier| [Response::SoftStep, Response::Impulse].map(|response| (tier, response)))
    {
        let mut world = world::<f64>(2);
        world.set_model(Model { response, ..world.model() }).unwrap();
        world.set_gravity(Vec3::zero()).unwrap();
        world.swarm.set_model(SwarmModel { tier, ..world.swarm.model() }).unwrap();
        let (far, velocity) = (Point3::new(1e5, -1e5, 0.0), Vec3::new(1e-3, 2e-3, 0.0));
        world.swarm.insert(&[Ball { velocity, ..Ball::new(far, 0.1) }]).unwrap();
        for _ in 0..60 {
            world.step(1.0 / 60.0).unwrap();
        }
        let [x, y, z, _] = world.swarm.balls()[0];
        let error = (Point3::new(x, y, z) - far - velocity).magnitude();
        assert!(error < 1e-8, "{tier:?}, {response:?}: {error} m");
    }
}

/// A marble by `Impulse` is a proxy in the swarm.
#[test]
fn a_marble_that_a_ball_strikes_takes_its_momentum_to_rounding() {
    let mut world = world::<f64>(2);
    world.set_model(Model { response: Response::Impulse, ..world.model() }).unwrap();
    world.set_gravity(Vec3::zero()).unwrap();
    let [marble, ball] = [0.3, 0.7].map(Mass::Kilograms);
    let at = |x: f64| Point3::new(x, 0.0, 0.0);
    world.marbles.insert(Marble { mass: marble, ..Marble::new(at(0.5), 0.1) }).unwrap();
    let velocity = Vec3::new(1.0, 0.0, 0.0);
    world.swarm.insert(&[Ball { velocity, mass: ball, ..Ball::new(at(0.0), 0.1) }]).unwrap();
    for _ in 0..60 {
        world.step(1.0 / 60.0).unwrap();
    }
    let taken = world.marbles.velocity()[0].x * 0.3;
    let error = taken + world.swarm.velocities()[0][0] * 0.7 - 0.7;
    assert!(taken > 0.1 && error.abs() < 1e-13, "{taken} N s taken, {error} lost");
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

/// Error of a marble on a spring after two seconds, in radii of its first swing.
fn spring_error(integrator: Integrator) -> f64 {
    let (stiffness, origin) = (10.0, Point3::new(0.0, 0.0, 0.0));
    let mut world = world::<f64>(4);
    world.set_gravity(Vec3::zero()).unwrap();
    let spring = ForceField::Spring { anchor: origin, rest_length: 0.0, stiffness };
    world.set_forces(vec![spring]).unwrap();
    let marble = Marble {
        mass: Mass::Kilograms(1.0),
        integrator: Some(integrator),
        ..Marble::new(Point3::new(1.0, 0.0, 0.0), 0.1)
    };
    world.marbles.insert(marble).unwrap();
    for _ in 0..120 {
        world.step(1.0 / 60.0).unwrap();
    }
    (world.marbles.position()[0].x - (2.0 * stiffness.sqrt()).cos()).abs()
}

#[test]
fn an_integrator_counts_for_force_fields() {
    let [euler, verlet, rk4] =
        [Integrator::ExplicitEuler, Integrator::VelocityVerlet, Integrator::Rk4].map(spring_error);
    assert!(euler > 0.03 && verlet < 0.003 && rk4 < 0.003, "{euler} {verlet} {rk4}");
}
