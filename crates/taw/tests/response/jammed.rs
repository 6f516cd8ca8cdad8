//! Balls jammed between walls that move and walls that stand still, under `Response::Impulse`: no
//! velocities satisfy all contacts, or only such as no wall explains.

use taw::math::Quat;
use taw::motion::WallMotion;
use taw::prelude::*;
use taw::shape::Obb;

const GRAVITY: f64 = 9.81;
/// Height of the pit, in metres.
const HEIGHT: f64 = 2.0;
const SCENES: u64 = 600;

/// Part of a scene that moves.
#[derive(Clone, Copy, Debug)]
enum Mover {
    /// Belt that runs toward a wall beside it, with a gap of so many radii.
    Belt { speed: f64, gap: f64 },
    /// Plate that comes down to a fraction of a ball's diameter, holds, and goes up again.
    Plate { speed: f64, fraction: f64 },
    /// Floor that carries balls up to the lid.
    Lift { speed: f64, fraction: f64 },
    /// Wall of a pit that sweeps to and fro.
    Paddle { amplitude: f64, rate: f64 },
    /// Slanted wall that closes with another one.
    Wedge { speed: f64, slant: f64 },
    /// Floor with rails that tilts.
    Board { amplitude: f64, rate: f64 },
}

#[derive(Clone, Debug)]
struct Jam {
    mover: Mover,
    radius: f64,
    /// Masses, in kg; one ball each.
    masses: Vec<f64>,
    friction: f64,
    restitution: f64,
    model: Model,
    dt: f64,
    seed: u64,
}

/// Place of the mover: a turn about z, in radians, and a shift, in metres.
#[derive(Clone, Copy, Default)]
struct Place {
    turn: f64,
    shift: [f64; 2],
}

impl Jam {
    fn random(seed: u64) -> Self {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut between = |low: f64, high: f64| low + (high - low) * random.f64();
        let speed = between(0.5, 5.0);
        let mover = match seed % 6 {
            0 => Mover::Belt { speed, gap: between(1.5, 2.05) },
            1 => Mover::Plate { speed, fraction: 1.0 - between(0.03, 0.5).powi(3) },
            2 => Mover::Lift { speed, fraction: 1.0 - between(0.03, 0.5).powi(3) },
            3 => Mover::Paddle { amplitude: between(0.3, 0.6), rate: between(0.1, 1.5) },
            4 => Mover::Wedge { speed: speed * 0.3, slant: between(0.02, 0.8) },
            _ => Mover::Board { amplitude: between(0.02, 0.2), rate: between(0.1, 0.5) },
        };
        let radius = between(0.05, 0.12);
        let spread = between(0.0, 3.0);
        let friction = between(0.0, 1.5);
        let restitution = between(-0.5, 1.0).max(0.0);
        let mut pick = |values: &[f64]| values[(between(0.0, 1.0) * values.len() as f64) as usize];
        let count = pick(&[1.0, 1.0, 2.0, 3.0, 5.0, 8.0]) as u32;
        let model = Model {
            response: Response::Impulse,
            rotation: if pick(&[0.0, 1.0, 1.0]) == 0.0 {
                Rotation::None
            } else {
                Rotation::Dynamic
            },
            detection: if pick(&[0.0, 1.0]) == 0.0 {
                Detection::Discrete
            } else {
                Detection::Swept
            },
            substeps: pick(&[1.0, 2.0, 4.0]) as u32,
            iterations: pick(&[1.0, 2.0, 4.0, 8.0, 8.0, 20.0, 50.0]) as u32,
            ..Model::default()
        };
        let dt = 1.0 / pick(&[30.0, 60.0, 64.0, 120.0]);
        let masses = (0..count).map(|_| 10.0_f64.powf(spread * (random.f64() - 0.5))).collect();
        Self { mover, radius, masses, friction, restitution, model, dt, seed }
    }

    /// Place of the mover at a time.
    fn place(&self, time: f64) -> Place {
        use std::f64::consts::PI;
        let room = HEIGHT - 2.0 * self.radius;
        match self.mover {
            Mover::Belt { .. } => Place::default(),
            Mover::Plate { speed, fraction } => {
                let low = 2.0 * self.radius * fraction;
                let fall = (room - speed * time).max(low);
                let rise = low + (time - room / speed - 0.5).max(0.0) * speed;
                Place { shift: [0.0, fall.max(rise.min(room))], ..Place::default() }
            }
            Mover::Lift { speed, fraction } => {
                let high = HEIGHT - 2.0 * self.radius * fraction;
                let rise = (speed * time).min(high);
                let fall = high - (time - high / speed - 0.5).max(0.0) * speed;
                Place { shift: [0.0, rise.min(fall.max(0.0))], ..Place::default() }
            }
            Mover::Paddle { amplitude, rate } => {
                Place { shift: [amplitude * (rate * PI * time).sin(), 0.0], ..Place::default() }
            }
            Mover::Wedge { speed, slant } => {
                // To and fro, 0.9 m each way.
                let phase = (speed * time).rem_euclid(1.8);
                Place { turn: -slant, shift: [0.9 - phase.min(1.8 - phase), 0.0] }
            }
            Mover::Board { amplitude, rate } => {
                Place { turn: amplitude * (rate * 2.0 * PI * time).sin(), ..Place::default() }
            }
        }
    }

    /// Boxes that move, as centers and half extents, before their [`Place`].
    fn boxes(&self) -> Vec<[[f64; 3]; 2]> {
        match self.mover {
            Mover::Belt { .. } => vec![[[-0.3, 0.3, 0.0], [1.0, 0.05, 1.0]]],
            Mover::Plate { .. } => vec![[[0.0, 0.05, 0.0], [0.95, 0.05, 0.95]]],
            Mover::Lift { .. } => vec![[[0.0, -0.05, 0.0], [0.95, 0.05, 0.95]]],
            Mover::Paddle { .. } => vec![[[0.0, 0.5, 0.0], [0.05, 0.5, 0.95]]],
            Mover::Wedge { .. } => vec![[[0.05, 1.0, 0.0], [0.05, 1.5, 0.95]]],
            Mover::Board { .. } => vec![
                [[0.0, 0.55, 0.0], [0.7, 0.05, 0.7]],
                [[-0.7, 0.65, 0.0], [0.05, 0.15, 0.7]],
                [[0.7, 0.65, 0.0], [0.05, 0.15, 0.7]],
            ],
        }
    }

    /// Pit of five walls and a lid; the belt has a wall beside it.
    fn world<S: Scalar>(&self) -> (World<S>, Vec<WallId>) {
        let mut world = World::<S>::default();
        world.set_model(self.model).unwrap();
        let mut side = |normal: [f64; 3], offset: f64| {
            let normal = Vec3::from(normal.map(S::from_f64));
            world.walls.insert(Plane::new(normal, S::from_f64(offset)).unwrap()).unwrap();
        };
        side([0.0, 1.0, 0.0], 0.0);
        side([0.0, -1.0, 0.0], -HEIGHT);
        let right = match self.mover {
            Mover::Belt { gap, .. } => 0.7 + gap * self.radius,
            _ => 1.0,
        };
        side([-1.0, 0.0, 0.0], -right);
        side([1.0, 0.0, 0.0], -1.0);
        side([0.0, 0.0, 1.0], -1.0);
        side([0.0, 0.0, -1.0], -1.0);
        let movers = self
            .boxes()
            .into_iter()
            .map(|block| world.walls.insert(placed(block, Place::default())).unwrap())
            .collect();
        self.drop_balls(&mut world);
        (world, movers)
    }

    fn drop_balls<S: Scalar>(&self, world: &mut World<S>) {
        let mut random = fastrand::Rng::with_seed(self.seed);
        let low = match self.mover {
            Mover::Plate { .. } => 0.0,
            Mover::Lift { .. } => 0.05,
            Mover::Board { .. } => 0.6,
            _ => 0.4,
        };
        for (at, mass) in self.masses.iter().enumerate() {
            // Columns that do not touch; the first ball is the one that a belt carries.
            let pitch = 2.2 * self.radius;
            let column = [0, 1, 2, 3][at % 4];
            let x = 0.4 - pitch * f64::from(column) + 0.1 * self.radius * random.f64();
            let y = low + self.radius + pitch * (at / 4) as f64;
            let material = Material {
                friction: S::from_f64(self.friction),
                restitution: S::from_f64(self.restitution),
                ..Material::default()
            };
            let at = Point3::from([x, y, 0.1 * random.f64()].map(S::from_f64));
            let marble = Marble {
                mass: Mass::Kilograms(S::from_f64(*mass)),
                material: Some(material),
                ..Marble::new(at, S::from_f64(self.radius))
            };
            world.marbles.insert(marble).unwrap();
        }
    }

    /// Moves the mover to its place at the end of a step. Returns the largest speed of its surface.
    fn move_walls<S: Scalar>(&self, world: &mut World<S>, movers: &[WallId], time: f64) -> f64 {
        let [before, after] = [time, time + self.dt].map(|time| self.place(time));
        let rate = |from: f64, to: f64| (to - from) / self.dt;
        let turn = rate(before.turn, after.turn);
        let mut velocity = [0, 1].map(|axis| rate(before.shift[axis], after.shift[axis]));
        if let Mover::Belt { speed, .. } = self.mover {
            velocity[0] = speed;
        }
        let shift = |[x, y]: [f64; 2], z: f64| [x, y, z].map(S::from_f64);
        let motion = WallMotion {
            velocity: Vec3::from(shift(velocity, 0.0)),
            angular_velocity: Vec3::from(shift([0.0; 2], turn)),
            pivot: Point3::from(shift(after.shift, 0.0)),
        };
        for (id, block) in movers.iter().zip(self.boxes()) {
            world.walls.set(*id, placed(block, after)).unwrap();
            world.walls.set_motion(*id, Some(motion)).unwrap();
        }
        velocity[0].hypot(velocity[1]) + turn.abs() * HEIGHT
    }
}

/// Box at a place.
fn placed<S: Scalar>([center, half]: [[f64; 3]; 2], place: Place) -> Obb<S> {
    let (sin, cos) = place.turn.sin_cos();
    let [x, y, z] = center;
    let [dx, dy] = place.shift;
    let center = [x * cos - y * sin + dx, x * sin + y * cos + dy, z];
    let (sin, cos) = (place.turn * 0.5).sin_cos();
    let turn = Quat::new(S::from_f64(cos), S::zero(), S::zero(), S::from_f64(sin));
    let [center, half] = [center, half].map(|v| v.map(S::from_f64));
    Obb::new(Point3::from(center), turn, Vec3::from(half)).unwrap()
}

/// Largest energy and impulse of a jam, as fractions of their bounds.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    energy: f64,
    impulse: f64,
}

/// Runs a jam. Its balls may have the kinetic energy that they have if each falls through the pit
/// and is as fast as bounces between the mover and a wall that stands still make it. And a contact
/// may bear the momentum of all balls at that speed, times the leverage of a wedge.
fn run<S: Scalar>(jam: &Jam, seconds: f64) -> Worst {
    let (mut world, movers) = jam.world::<S>();
    let mut worst = Worst::default();
    let mut fastest_wall = 0.0_f64;
    let mass = jam.masses.iter().sum::<f64>();
    for step in 0..(seconds / jam.dt).round() as u32 {
        let time = f64::from(step) * jam.dt;
        fastest_wall = fastest_wall.max(jam.move_walls(&mut world, &movers, time));
        world.step(S::from_f64(jam.dt)).unwrap();
        let bounces = f64::from(step + 1) * 2.0;
        let gain = ((1.0 + jam.restitution) / (1.0 - jam.restitution)).min(bounces);
        let speed = (2.0 * GRAVITY * HEIGHT).sqrt() + fastest_wall * gain;
        let energies = jam.masses.iter().zip(world.marbles.velocity());
        let energy: f64 = energies.map(|(mass, v)| mass * v.magnitude2().as_f64()).sum();
        worst.energy = worst.energy.max(energy / (mass * speed * speed));
        let contacts = world.contacts.wm.iter().chain(&world.contacts.mm);
        let pressed = contacts.map(|c| c.normal_impulse.as_f64()).fold(0.0, f64::max);
        worst.impulse = worst.impulse.max(pressed / (mass * speed));
    }
    worst
}

/// Largest force of a contact over what causes it, as [`Response::Impulse`] documents it.
const LEVERAGE: f64 = 1000.0;

#[test]
fn a_jam_stores_no_impulses_and_shoots_nothing() {
    let mut faults = Vec::new();
    for seed in 0..SCENES {
        let jam = Jam::random(seed);
        for (scalar, worst) in [("f32", run::<f32>(&jam, 4.0)), ("f64", run::<f64>(&jam, 4.0))] {
            if !(worst.energy <= 1.0 && worst.impulse <= LEVERAGE) {
                faults.push(format!("{scalar} {worst:.3?} {jam:?}"));
            }
        }
    }
    assert!(faults.is_empty(), "{} faults: {faults:#?}", faults.len());
}

fn model() -> Model {
    Model { response: Response::Impulse, rotation: Rotation::Dynamic, ..Model::default() }
}

/// Fastest ball, in m/s, and greatest normal impulse, in N s, of a ball of 6.4 kg that a belt
/// carries into the gap beside it.
fn belt<S: Scalar>(speed: f64, gap: f64) -> [f64; 2] {
    let mut world = World::<S>::default();
    world.set_model(model()).unwrap();
    let radius = 0.085;
    let mut side = |normal: [f64; 3], offset: f64| {
        let normal = Vec3::from(normal.map(S::from_f64));
        world.walls.insert(Plane::new(normal, S::from_f64(offset)).unwrap()).unwrap();
    };
    side([0.0, 1.0, 0.0], 0.0);
    side([-1.0, 0.0, 0.0], -1.0 - gap * radius);
    let belt = placed([[0.0, 0.3, 0.0], [1.0, 0.05, 1.0]], Place::default());
    let belt = world.walls.insert(belt).unwrap();
    let vector = |x: f64, y: f64| [x, y, 0.0].map(S::from_f64);
    let motion = WallMotion {
        velocity: Vec3::from(vector(speed, 0.0)),
        angular_velocity: Vec3::from(vector(0.0, 0.0)),
        pivot: Point3::from(vector(0.0, 0.0)),
    };
    world.walls.set_motion(belt, Some(motion)).unwrap();
    let (friction, restitution) = (S::from_f64(0.5), S::zero());
    let ball = Marble {
        velocity: Vec3::from(vector(0.5, 0.0)),
        material: Some(Material { friction, restitution, ..Material::default() }),
        ..Marble::new(Point3::from(vector(0.8, 0.7)), S::from_f64(radius))
    };
    world.marbles.insert(ball).unwrap();
    let mut worst = [0.0_f64; 2];
    for _ in 0..600 {
        world.step(S::from_f64(1.0 / 60.0)).unwrap();
        worst[0] = worst[0].max(world.marbles.velocity()[0].magnitude().as_f64());
        let impulses = world.contacts.wm.iter().map(|c| c.normal_impulse.as_f64());
        worst[1] = impulses.fold(worst[1], f64::max);
    }
    worst
}

#[test]
fn a_belt_beside_a_wall_does_not_shoot_the_ball_between_them() {
    for speed in [1.0, 1.5, 5.0] {
        for gap in [1.9, 1.95, 1.97, 1.99] {
            // Falls .32 m to the belt, with .5 m/s, then .3 m more to the floor.
            let fall = (0.25 + 2.0 * GRAVITY * 0.615).sqrt();
            for [fastest, impulse] in [belt::<f32>(speed, gap), belt::<f64>(speed, gap)] {
                let may_be = fall.hypot(speed);
                assert!(fastest <= may_be, "belt {speed} m/s, gap {gap} r: {fastest} m/s");
                let momentum = 6.5 * (fall + speed);
                assert!(impulse <= LEVERAGE * momentum, "belt {speed} m/s: {impulse} N s");
            }
        }
    }
}

/// Greatest normal impulse over the momentum that the ball gets from gravity in a step, in the last
/// step in which a plate stands still on a ball that it squeezes.
fn held<S: Scalar>(fraction: f64) -> f64 {
    let jam = Jam {
        mover: Mover::Plate { speed: 1.0, fraction },
        radius: 0.1,
        masses: vec![1.0],
        friction: 0.5,
        restitution: 0.0,
        model: model(),
        dt: 1.0 / 60.0,
        seed: 0,
    };
    let (mut world, movers) = jam.world::<S>();
    // The plate arrives after less than 1.8 s, and rises half a second later.
    for step in 0..132 {
        jam.move_walls(&mut world, &movers, f64::from(step) * jam.dt);
        world.step(S::from_f64(jam.dt)).unwrap();
    }
    let impulses = world.contacts.wm.iter().map(|c| c.normal_impulse.as_f64());
    impulses.fold(0.0, f64::max) / (GRAVITY * jam.dt)
}

#[test]
fn a_plate_that_stands_on_a_ball_presses_it_no_more_than_a_wedge_could() {
    for fraction in [0.999, 0.99, 0.95] {
        for pressed in [held::<f32>(fraction), held::<f64>(fraction)] {
            assert!(pressed <= LEVERAGE * 1.001, "{fraction}: {pressed} times its weight");
        }
    }
}
