//! Walls that move further in a step than balls are wide.

use taw::prelude::*;
use taw::shape::Aabb;
use taw::world::WallShape;

use super::world;

/// Returns true if a plate that comes along x passes through a ball, at these speeds in m/s.
fn passes([speed, ball_speed]: [f64; 2], thickness: f64, substeps: u32, restitution: f64) -> bool {
    const DT: f64 = 1.0 / 60.0;
    let mut world = world::<f64>(substeps);
    world.set_gravity(Vec3::new(0.0, 0.0, 0.0)).unwrap();
    let at = |x: f64| Aabb {
        min: Point3::new(x - thickness, -1.0, -1.0),
        max: Point3::new(x, 1.0, 1.0),
    };
    let begin = -0.7 * speed.max(ball_speed) * 5.0 * DT - 0.2;
    let wall = world.walls.insert(at(begin)).unwrap();
    let material = Some(Material { restitution, ..Material::default() });
    let velocity = Vec3::new(-ball_speed, 0.1, 0.05);
    let ball = Marble { velocity, material, ..Marble::new(Point3::new(0.0, 0.02, 0.01), 0.05) };
    let id = world.marbles.insert(ball).unwrap();
    let motion = taw::motion::WallMotion {
        velocity: Vec3::new(speed, 0.0, 0.0),
        angular_velocity: Vec3::new(0.0, 0.0, 0.0),
        pivot: Point3::new(0.0, 0.0, 0.0),
    };
    (1..=30).any(|step| {
        let x = begin + speed * f64::from(step) * DT;
        world.walls.set(wall, at(x)).unwrap();
        world.walls.set_motion(wall, Some(motion)).unwrap();
        world.step(DT).unwrap();
        world.marbles.get(id).unwrap().position.x < x - 0.5 * thickness
    })
}

#[test]
fn no_plate_passes_through_a_ball() {
    let mut passed = Vec::new();
    for substeps in [1, 2, 4] {
        for speed in [1.0, 3.0, 5.0, 8.0, 12.0, 20.0, 40.0] {
            for ball_speed in [0.0, 1.0, 10.0, 40.0] {
                for thickness in [0.01, 0.1, 0.5] {
                    for restitution in [0.0, 0.5] {
                        if passes([speed, ball_speed], thickness, substeps, restitution) {
                            passed.push((substeps, speed, ball_speed, thickness, restitution));
                        }
                    }
                }
            }
        }
    }
    assert!(passed.is_empty(), "{} of 504: {passed:?}", passed.len());
}

/// At any speed: contacts with shapes were listed of where these were a step before, and with half-spaces
/// of where they will be.
#[test]
fn what_rides_on_a_lift_has_a_contact_with_it() {
    const DT: f32 = 1.0 / 64.0;
    for (speed, is_plane) in
        [0.2, 0.5, 1.0, 3.0, -0.2, -1.0].into_iter().flat_map(|v| [(v, true), (v, false)])
    {
        let mut world = world::<f32>(4);
        let slab = |y: f32| -> WallShape<f32> {
            if is_plane {
                return Plane::new(Vec3::unit_y(), y).unwrap().into();
            }
            Aabb { min: Point3::new(-4.0, y - 1.0, -4.0), max: Point3::new(4.0, y, 4.0) }.into()
        };
        let wall = world.walls.insert(slab(0.0)).unwrap();
        let velocity = Vec3::unit_y() * speed;
        let rides = Marble { velocity, ..Marble::new(Point3::new(0.0, 0.25, 0.0), 0.25) };
        world.marbles.insert(rides).unwrap();
        for step in 1..=64_u16 {
            let y = speed * DT * f32::from(step);
            let motion = taw::motion::WallMotion {
                velocity,
                angular_velocity: Vec3::new(0.0, 0.0, 0.0),
                pivot: Point3::new(0.0, y, 0.0),
            };
            world.walls.set(wall, slab(y)).unwrap();
            world.walls.set_motion(wall, Some(motion)).unwrap();
            world.step(DT).unwrap();
            let contacts = &world.contacts.wm;
            let touches = contacts.len() == 1 && contacts[0].separation.abs() < 1e-3;
            assert!(touches, "{speed} m/s, {is_plane}, step {step}: {contacts:?}");
        }
    }
}

/// A light ball carries a heavy one on a lift as it does on a floor: the wall behind it takes the load at once.
/// At 50 times the mass, the heavy one sank in by .7 of a diameter.
#[test]
fn a_light_ball_carries_a_heavy_one_on_a_lift() {
    const DT: f64 = 1.0 / 60.0;
    for speed in [-2.0, -0.5, 0.0, 0.5, 1.0, 3.0] {
        for ratio in [5.0, 10.0, 50.0, 1000.0] {
            for of_shape in [false, true] {
                let mut world = world::<f64>(4);
                let floor = |height: f64| -> WallShape<f64> {
                    if of_shape {
                        let min = Point3::new(-1.0, height - 0.5, -1.0);
                        Aabb { min, max: Point3::new(1.0, height, 1.0) }.into()
                    } else {
                        taw::shape::Plane::new(Vec3::unit_y(), height).unwrap().into()
                    }
                };
                let lift = world.walls.insert(floor(0.0)).unwrap();
                let motion = taw::motion::WallMotion {
                    velocity: Vec3::new(0.0, speed, 0.0),
                    angular_velocity: Vec3::zero(),
                    pivot: Point3::origin(),
                };
                world.walls.set_motion(lift, Some(motion)).unwrap();
                let mut insert = |height, mass| {
                    let ball = Marble::new(Point3::new(0.0, height, 0.0), 0.1);
                    let (velocity, mass) = (Vec3::new(0.0, speed, 0.0), Mass::Kilograms(mass));
                    world.marbles.insert(Marble { velocity, mass, ..ball }).unwrap()
                };
                let [light, heavy] = [(0.1, 1.0), (0.3, ratio)].map(|(h, mass)| insert(h, mass));
                for step in 1..=90 {
                    let height = speed * DT * f64::from(step);
                    world.walls.set(lift, floor(height)).unwrap();
                    world.walls.set_motion(lift, Some(motion)).unwrap();
                    world.step(DT).unwrap();
                    let [light, heavy] =
                        [light, heavy].map(|id| world.marbles.get(id).unwrap().position.y - height);
                    let name = format!("{speed} m/s, {ratio}, shape {of_shape}, step {step}");
                    let sinks = [0.1 - light, 0.2 - (heavy - light)];
                    assert!(sinks.iter().all(|sink| *sink < 0.01), "{name}: {sinks:?}");
                }
            }
        }
    }
}
