//! Ordinary scenes that `Response::EventDriven` must not break in: walls that move, surfaces
//! that bend, numbers at the end of their range, steps that must end.

mod limits;

use taw::frame::{AxisAngle, Pose};
use taw::prelude::*;
use taw::shape::{Aabb, Capsule, HeightField, Hull, Mesh};
use taw::swarm::SwarmModel;
use taw::world::{WallMotion, WallShape};

const DT: f64 = 1.0 / 60.0;

fn world<S: Scalar>(rotation: Rotation, substeps: u32) -> World<S> {
    let mut world = World::default();
    let model = Model {
        response: Response::EventDriven,
        precision: Precision::Compensated,
        rotation,
        substeps,
        ..Model::default()
    };
    world.set_model(model).unwrap();
    // What is slow beside an unstable balance would sleep there.
    world.swarm.set_model(SwarmModel { sleeps: false, ..SwarmModel::default() }).unwrap();
    world
}

fn surface<S: Scalar>(restitution: f64, friction: f64) -> Material<S> {
    let (restitution, friction) = (S::from_f64(restitution), S::from_f64(friction));
    Material { restitution, friction, ..Material::default() }
}

fn point<S: Scalar>(x: f64, y: f64, z: f64) -> Point3<S> {
    Point3::new(S::from_f64(x), S::from_f64(y), S::from_f64(z))
}

fn vector<S: Scalar>(x: f64, y: f64, z: f64) -> Vec3<S> {
    Vec3::new(S::from_f64(x), S::from_f64(y), S::from_f64(z))
}

/// A board with its top at y = 0, of every kind that a wall may be of.
fn boards<S: Scalar>() -> Vec<(&'static str, WallShape<S>)> {
    let corner = |x: f64, z: f64| point(x, 0.0, z);
    let points = vec![corner(-9.0, -9.0), corner(9.0, -9.0), corner(9.0, 9.0), corner(-9.0, 9.0)];
    let hull: Vec<_> = [-9.0, 9.0]
        .into_iter()
        .flat_map(|x| [-9.0, 9.0].map(|z| (x, z)))
        .flat_map(|(x, z)| [-1.0, 0.0].map(|y| point(x, y, z)))
        .collect();
    let heights = vec![S::zero(); 49];
    vec![
        ("plane", Plane::new(vector(0.0, 1.0, 0.0), S::zero()).unwrap().into()),
        ("box", Aabb::new(point(-9.0, -1.0, -9.0), point(9.0, 0.0, 9.0)).unwrap().into()),
        ("mesh", Mesh::new(points, vec![[0, 2, 1], [0, 3, 2]]).unwrap().into()),
        ("hull", Hull::new(&hull).unwrap().into()),
        (
            "field",
            HeightField::new(point(-9.0, 0.0, -9.0), [S::from_f64(3.0); 2], 7, heights)
                .unwrap()
                .into(),
        ),
    ]
}

/// A wall that goes from pose to pose, as the plugin moves walls.
struct Mover<S: Scalar> {
    id: WallId,
    shape: WallShape<S>,
    last: (f64, f64),
}

impl<S: Scalar> Mover<S> {
    fn new(world: &mut World<S>, shape: WallShape<S>) -> Self {
        let id = world.walls.insert(shape.clone()).unwrap();
        Self { id, shape, last: (0.0, 0.0) }
    }

    fn pose(height: f64, angle: f64) -> Pose<S> {
        let turn = AxisAngle::new(vector(0.0, 0.0, 1.0), S::from_f64(angle)).unwrap();
        Pose { rotation: turn.into(), translation: vector(0.0, height, 0.0) }
    }

    /// To this height, and turned by this angle about z at the origin of the wall.
    fn go(&mut self, world: &mut World<S>, height: f64, angle: f64, dt: f64) {
        let per = |x: f64| x / dt;
        let motion = WallMotion {
            velocity: vector(0.0, per(height - self.last.0), 0.0),
            angular_velocity: vector(0.0, 0.0, per(angle - self.last.1)),
            pivot: point(0.0, height, 0.0),
        };
        self.last = (height, angle);
        let shape = self.shape.transformed(Self::pose(height, angle)).unwrap();
        world.walls.set(self.id, shape).unwrap();
        world.walls.set_motion(self.id, Some(motion)).unwrap();
    }

    /// Distance of a marble from the wall, in metres.
    fn gap(&self, world: &World<S>, row: usize) -> f64 {
        let shape = world.walls.get(self.id).unwrap();
        let near = shape.project_point(world.marbles.position()[row]);
        (near.distance - world.marbles.radius()[row]).as_f64()
    }
}

fn a_lift<S: Scalar>(rounding: f64) {
    for (name, shape) in boards::<S>() {
        for speed in [-3.0, -1.0, 1.0, 3.0] {
            for (substeps, rotation) in
                [(1, Rotation::None), (1, Rotation::Dynamic), (3, Rotation::Dynamic)]
            {
                let mut world = world::<S>(rotation, substeps);
                let mut lift = Mover::new(&mut world, shape.clone());
                let marble = Marble {
                    velocity: vector(0.0, speed, 0.0),
                    material: Some(surface(0.5, 0.5)),
                    ..Marble::new(point(0.5, 0.1, 0.3), S::from_f64(0.1))
                };
                world.marbles.insert(marble).unwrap();
                for step in 1..=120 {
                    lift.go(&mut world, speed * DT * f64::from(step), 0.0, DT);
                    world.step(S::from_f64(DT)).unwrap();
                    let gap = lift.gap(&world, 0);
                    assert!(
                        gap.abs() < rounding,
                        "{name} at {speed} m/s, {substeps} substeps: {gap} m at step {step}"
                    );
                    let v = world.marbles.velocity()[0].y.as_f64();
                    assert!((v - speed).abs() < 1e-3, "{name}: {v}, not {speed} m/s");
                }
            }
        }
    }
}

#[test]
fn a_ball_on_a_lift_stays_on_it() {
    a_lift::<f64>(1e-9);
    a_lift::<f32>(4e-6);
}

#[test]
fn a_ball_on_a_tilting_board_neither_hops_nor_sinks() {
    for (name, shape) in boards::<f64>() {
        for (substeps, friction) in [(1, 0.5), (1, 0.0), (4, 0.5)] {
            let mut world = world::<f64>(Rotation::Dynamic, substeps);
            let mut board = Mover::new(&mut world, shape.clone());
            let marble = Marble {
                material: Some(surface(0.5, friction)),
                ..Marble::new(Point3::new(4.0, 0.1, 0.3), 0.1)
            };
            world.marbles.insert(marble).unwrap();
            for step in 1..=240 {
                let angle =
                    0.025 * (1.0 - (std::f64::consts::TAU * 0.25 * DT * f64::from(step)).cos());
                board.go(&mut world, 0.0, angle, DT);
                world.step(DT).unwrap();
                let gap = board.gap(&world, 0);
                // The speed of a board that goes from pose to pose jumps by up to 4 mm/s, which
                // throws a ball by 1 micrometre.
                assert!(
                    gap > -1e-9 && gap < 2e-6,
                    "{name}, friction {friction}, {substeps} substeps: {gap} m at step {step}"
                );
            }
        }
    }
}

#[test]
fn a_ball_dropped_on_a_lift_bounces_off_it_where_it_is() {
    for (name, shape) in boards::<f64>() {
        for speed in [-2.0, 0.0, 2.0] {
            let mut world = world::<f64>(Rotation::None, 1);
            let mut lift = Mover::new(&mut world, shape.clone());
            let marble = Marble {
                material: Some(surface(1.0, 0.0)),
                velocity: Vec3::new(0.0, speed, 0.0),
                ..Marble::new(Point3::new(0.5, 0.6, 0.3), 0.1)
            };
            world.marbles.insert(marble).unwrap();
            for step in 1..=240 {
                lift.go(&mut world, speed * DT * f64::from(step), 0.0, DT);
                world.step(DT).unwrap();
                // In the frame of the lift it has the energy that it began with.
                let v = world.marbles.velocity()[0].y - speed;
                let height = lift.gap(&world, 0);
                let energy = 0.5 * v * v + 9.81 * height;
                let off = energy / (9.81 * 0.5) - 1.0;
                assert!(off.abs() < 1e-9, "{name} at {speed} m/s: {off} at step {step}");
            }
        }
    }
}

/// Where a ball that starts beside the top of a round thing leaves it, as a cosine, and by
/// what part its energy is another one then.
fn leaves(shape: WallShape<f64>, radius: f64, friction: f64, dt: f64) -> (f64, f64) {
    let mut world = world::<f64>(Rotation::Dynamic, 1);
    world.walls.insert(shape.clone()).unwrap();
    let (start, ball) = (1e-3_f64, 0.1);
    let far = radius + ball;
    let marble = Marble {
        material: Some(surface(0.0, friction)),
        ..Marble::new(Point3::new(far * start.sin(), far * start.cos(), 0.0), ball)
    };
    world.marbles.insert(marble).unwrap();
    let begin = world.energy().total();
    for _ in 0..(20.0 / dt) as u32 {
        world.step(dt).unwrap();
        let at = world.marbles.position()[0];
        if (at - Point3::new(0.0, 0.0, 0.0)).magnitude() - far > 1e-11 {
            // It flies: back along the parabola to where that touches.
            let v = world.marbles.velocity()[0];
            let back = |t: f64| at - v * t - Vec3::new(0.0, 0.5 * 9.81 * t * t, 0.0);
            // Path and surface bend alike there, so that the gap grows with the third power.
            let gap = |t: f64| (back(t) - Point3::new(0.0, 0.0, 0.0)).magnitude() - far;
            let (mut lo, mut hi) = (0.0, dt.max(0.03));
            for _ in 0..100 {
                let middle = 0.5 * (lo + hi);
                if gap(middle) > 1e-14 { lo = middle } else { hi = middle }
            }
            let there = back(0.5 * (lo + hi));
            let off = world.energy().total() / begin - 1.0;
            return (there.y / far, off);
        }
    }
    (f64::NAN, f64::NAN)
}

#[test]
fn a_ball_leaves_a_round_thing_where_it_must() {
    let origin = Point3::new(0.0, 0.0, 0.0);
    let along = Vec3::new(0.0, 0.0, 3.0);
    for (friction, cosine) in [(0.0, 2.0 / 3.0), (1e6, 10.0 / 17.0)] {
        for dt in [1.0 / 30.0, DT, 1e-3] {
            let ball: WallShape<f64> = Sphere::new(origin, 1.0).unwrap().into();
            let roller = Capsule::new(origin - along, origin + along, 1.0).unwrap().into();
            for (name, shape) in [("ball", ball), ("capsule", roller)] {
                let (cos, energy) = leaves(shape, 1.0, friction, dt);
                // From rest a thousandth beside the top, instead of on it.
                let exact = cosine * 1e-3_f64.cos();
                let degrees = (cos.acos() - exact.acos()).to_degrees();
                assert!(
                    degrees.abs() < 0.05 && energy.abs() < 1e-6,
                    "{name}, friction {friction}, steps of {dt}: {degrees}° off, energy {energy}"
                );
            }
        }
    }
}

#[test]
fn a_ball_pivots_over_an_edge_and_a_corner_and_keeps_its_energy() {
    // A box with its edge along z at the origin, and triangles of the same form.
    let solid: WallShape<f64> =
        Aabb::new(Point3::new(-4.0, -4.0, -4.0), Point3::new(0.0, 0.0, 4.0)).unwrap().into();
    let points = [
        [-4.0, 0.0, -4.0],
        [-4.0, 0.0, 4.0],
        [0.0, 0.0, 4.0],
        [0.0, 0.0, -4.0],
        [0.0, -4.0, 4.0],
        [0.0, -4.0, -4.0],
    ];
    let mesh = Mesh::new(
        points.map(Point3::from).to_vec(),
        vec![[0, 1, 2], [0, 2, 3], [3, 2, 4], [3, 4, 5]],
    );
    for (name, shape) in [("box", solid), ("mesh", mesh.unwrap().into())] {
        for dt in [DT, 1e-3] {
            let mut world = world::<f64>(Rotation::Dynamic, 1);
            world.walls.insert(shape.clone()).unwrap();
            let marble = Marble {
                material: Some(surface(0.0, 1e6)),
                velocity: Vec3::new(0.1, 0.0, 0.0),
                angular_velocity: Vec3::new(0.0, 0.0, -1.0),
                ..Marble::new(Point3::new(-0.05, 0.1, 0.3), 0.1)
            };
            world.marbles.insert(marble).unwrap();
            let begin = world.energy().total();
            let mut turned: f64 = 0.0;
            for _ in 0..(3.0 / dt) as u32 {
                world.step(dt).unwrap();
                let at = world.marbles.position()[0];
                let gap = at.x.hypot(at.y) - 0.1;
                if gap > 1e-11 && at.x > 0.0 {
                    break;
                }
                if at.x > 0.0 {
                    turned = turned.max(at.x.atan2(at.y).to_degrees());
                }
            }
            // v² = g r cos: 7/10 v² + g r (cos - 1) = 7/10 .1²
            let exact = ((1.0_f64 + 0.7 * 0.01 / 0.981) * 10.0 / 17.0).acos().to_degrees();
            let off = world.energy().total() / begin - 1.0;
            // It is seen at the ends of steps only, at less than a metre a second.
            let seen = exact - (dt / 0.1).to_degrees();
            assert!(turned > seen && turned < exact + 0.05, "{name}: {turned}, not {exact}");
            assert!(off.abs() < 1e-6, "{name}, steps of {dt}: energy {off}");
        }
    }
}

#[test]
fn a_little_overlap_goes_without_energy() {
    for deep in [1e-4, 1e-3, 0.004, 0.02, 0.3] {
        for (name, shape) in boards::<f64>() {
            let mut world = world::<f64>(Rotation::Dynamic, 1);
            world.walls.insert(shape).unwrap();
            let at = Point3::new(0.5, 0.5 * (1.0 - deep), 0.3);
            world.marbles.insert(Marble::new(at, 0.5)).unwrap();
            for _ in 0..60 {
                world.step(DT).unwrap();
                let speed = world.marbles.velocity()[0].magnitude();
                assert!(speed < 1e-6, "{name}, {deep}: gap {speed} m/s");
            }
            let gap = world.marbles.position()[0].y - 0.5;
            assert!(gap.abs() < 1e-9, "{name}, {deep}: {gap} m");
        }
    }
}

#[test]
fn two_balls_that_overlap_a_little_part_without_energy() {
    let mut world = world::<f64>(Rotation::Dynamic, 1);
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    for x in [0.0, 0.996] {
        world.marbles.insert(Marble::new(Point3::new(x, 0.5, 0.0), 0.5)).unwrap();
    }
    for _ in 0..120 {
        world.step(DT).unwrap();
        for v in world.marbles.velocity() {
            assert!(v.magnitude() < 1e-4, "{v:?}");
        }
    }
    let at = world.marbles.position();
    let gap = (at[1] - at[0]).magnitude() - 1.0;
    // As much as a gap that counts as touching.
    assert!(gap.abs() < 2e-5, "{gap} m");
}
