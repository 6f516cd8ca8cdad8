//! Glancing bounces off walls that are round or have edges: the normal is that where they touch.

use cgmath::{EuclideanSpace, InnerSpace, Zero};
use taw::motion::WallMotion;
use taw::prelude::*;
use taw::shape::{Aabb, Capsule, Mesh};
use taw::world::WallShape;

use super::impacts::ball;
use super::world;

/// Wall at the origin, of about this size.
#[derive(Clone, Copy, Debug)]
struct Target {
    kind: usize,
    size: f64,
}

impl Target {
    /// Its shape, moved by this far.
    fn shape<S: Scalar>(self, by: Vec3<f64>) -> WallShape<S> {
        let at = |v: [f64; 3]| Point3::from_vec((Vec3::from(v) * self.size + by).map(S::from_f64));
        let r = S::from_f64(self.size);
        match self.kind % 4 {
            0 => Sphere { center: at([0.0; 3]), radius: r }.into(),
            1 => {
                let (a, b) = (at([-1.0, 0.0, 0.0]), at([1.0, 0.0, 0.0]));
                Capsule { a, b, radius: r * S::from_f64(0.5) }.into()
            }
            2 => Aabb { min: at([-1.0; 3]), max: at([1.0; 3]) }.into(),
            _ => {
                let tips = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
                let corners = tips.into_iter().flat_map(|tip| [at(tip), at(tip.map(|x| -x))]);
                let sides = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4]];
                let below = sides.map(|[a, b, _]| [b, a, 5]);
                Mesh::new(corners.collect(), [sides, below].concat()).unwrap().into()
            }
        }
    }
}

/// A throw: place, velocity, radius and restitution of the marble.
type Throw = ([f64; 3], [f64; 3], f64, f64);

/// Velocity after a throw at a wall that moves at a velocity, relative to it, and the speed of approach; none
/// if no impact is told.
fn throw<S: Scalar>(
    (response, substeps): (Response, u32),
    target: Target,
    (position, velocity, r, e): Throw,
    of_wall: Vec3<f64>,
) -> Option<(Vec3<f64>, f64)> {
    let mut world = world::<S>(substeps);
    world.set_model(Model { response, ..world.model() }).unwrap();
    world.set_gravity(Vec3::zero()).unwrap();
    let wall = world.walls.insert(target.shape::<S>(Vec3::zero())).unwrap();
    let velocity = Vec3::from(velocity) + of_wall;
    world.marbles.insert(ball(position, velocity.into(), r, e)).unwrap();
    let mut told = None;
    let dt = S::from_f64(1.0 / 64.0);
    for step in 1..=64 {
        if !of_wall.is_zero() {
            let (velocity, by) = (of_wall.map(S::from_f64), of_wall * (f64::from(step) / 64.0));
            world.walls.set(wall, target.shape::<S>(by)).unwrap();
            let pivot = Point3::new(S::zero(), S::zero(), S::zero());
            let motion = WallMotion { velocity, angular_velocity: Vec3::zero(), pivot };
            world.walls.set_motion(wall, Some(motion)).unwrap();
        }
        world.step(dt).unwrap();
        told = told.or(world.impacts().first().map(|impact| impact.approach_speed.as_f64()));
    }
    told.map(|speed| (world.marbles.velocity()[0].map(S::as_f64) - of_wall, speed))
}

/// Largest angle in degrees between bounces of thrown marbles by this model and event-driven ones.
fn worst_angle<S: Scalar>(throws: usize) -> f64 {
    let mut random = fastrand::Rng::with_seed(7);
    let direction = |random: &mut fastrand::Rng| {
        let [x, y, z] = [(); 3].map(|()| random.f64() - 0.5);
        Vec3::new(x, y, z).normalize()
    };
    let (mut bounces, mut worst) = (0, 0.0_f64);
    for number in 0..throws {
        let (from, aside) = (direction(&mut random), direction(&mut random));
        let [size, radius, e, speed] = [(); 4].map(|()| random.f64());
        let target = Target { kind: number, size: 0.05 + 0.5 * size * size };
        let (r, e, speed) = (0.02 + 0.4 * radius * radius, 0.3 + 0.7 * e, 1.0 + 11.0 * speed);
        let start = from * (target.size * 2.0 + r + 0.3 * speed);
        let velocity = (aside * ((target.size + r) * random.f64()) - start).normalize() * speed;
        let marble = (start.into(), velocity.into(), r, e);
        let of_wall = if number % 8 < 4 { Vec3::zero() } else { aside * (2.0 * r * random.f64()) };
        let exact = throw::<f64>((Response::EventDriven, 1), target, marble, Vec3::zero());
        let Some((exact, approach)) = exact else { continue };
        if approach < 0.2 * speed {
            continue; // so flat that rounding says where
        }
        let soft = throw::<S>((Response::SoftStep, 1 << (number / 8 % 4)), target, marble, of_wall);
        bounces += 1;
        let angle = soft.map_or(180.0, |(soft, _)| cgmath::Deg::from(soft.angle(exact)).0);
        worst = worst.max(angle);
    }
    assert!(bounces > throws * 2 / 3, "{bounces}");
    worst
}

#[test]
fn a_random_glancing_bounce_leaves_as_geometry_says() {
    let worst = [worst_angle::<f32>(1_000), worst_angle::<f64>(1_000)];
    assert!(worst.iter().all(|angle| *angle < 0.1), "{worst:?}");
}

/// Floor at height zero: a half-space, flush boxes, or a mesh of triangles, with cells of this width.
fn insert_floor(world: &mut World<f32>, kind: usize, cell: f32) {
    let count = 24_u16;
    let along = |i: u16| (f32::from(i) - f32::from(count / 2)) * cell;
    if kind == 0 {
        world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    } else if kind == 1 {
        for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))) {
            let (min, max) = ([along(i), -1.0, along(j)], [along(i + 1), 0.0, along(j + 1)]);
            world.walls.insert(Aabb { min: min.into(), max: max.into() }).unwrap();
        }
    } else {
        let side = 0..=count;
        let corners = side.clone().flat_map(|i| side.clone().map(move |j| [i, j]));
        let corners = corners.map(|[i, j]| Point3::new(along(i), 0.0, along(j))).collect();
        let row = u32::from(count) + 1;
        let cells = (0..row - 1).flat_map(|i| (0..row - 1).map(move |j| i * row + j));
        let halves = |a: u32| [[a, a + 1, a + row], [a + 1, a + row + 1, a + row]];
        world.walls.insert(Mesh::new(corners, cells.flat_map(halves).collect()).unwrap()).unwrap();
    }
}

/// A marble that was listed over one tile and comes down on the next one bounced off the edge between them.
#[test]
fn a_random_bounce_on_flush_tiles_is_one_on_a_floor() {
    let mut random = fastrand::Rng::with_seed(3);
    for number in 0..2_000 {
        let radius = 0.02 + 0.3 * random.f64() * random.f64();
        let cell = (radius * (0.3 + 4.0 * random.f64())) as f32;
        let (speed, down) = (1.0 + 9.0 * random.f64(), 0.05 + 0.9 * random.f64());
        let (turn, e) = (std::f64::consts::TAU * random.f64(), 0.2 + 0.8 * random.f64());
        let side = (1.0 - down * down).sqrt();
        let velocity = [side * turn.cos(), -down, side * turn.sin()].map(|v| v * speed);
        let dt = [1.0 / 30.0, 1.0 / 60.0, 1.0 / 64.0, 1.0 / 240.0][random.usize(0..4)];
        let time = dt * (1.0 + 2.0 * random.f64());
        let from = velocity.map(|v| -v * time);
        let substeps = 1 << random.u32(0..4);
        let mut after = [0, 1 + number % 2].map(|kind| {
            let mut world = world::<f32>(substeps);
            world.set_gravity(Vec3::zero()).unwrap();
            insert_floor(&mut world, kind, cell);
            let place = [from[0], radius + from[1], from[2]];
            world.marbles.insert(ball(place, velocity, radius, e)).unwrap();
            world
        });
        for _ in 0..8 {
            for world in &mut after {
                world.step(dt as f32).unwrap();
            }
            let place = after[0].marbles.position()[0];
            if place.x.abs().max(place.z.abs()) > 11.0 * cell {
                break; // there the tiles end
            }
            let [floor, tiles] = after.each_ref().map(|world| world.marbles.velocity()[0]);
            let off = (floor - tiles).magnitude() / speed as f32;
            assert!(off < 1e-3, "{number}: {off}, {floor:?} {tiles:?}");
        }
    }
}
