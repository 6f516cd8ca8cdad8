//! Limits that users of other engines run into, measured in them: with their defaults and with
//! settings that their users may change.
//!
//! `cargo run --release` in this folder. f32, steps of 1/60 s unless a row says otherwise.

mod avian;
mod rapier;

use avian::Avian;
use rapier::Rapier;

/// Settings of a world.
#[derive(Clone, Copy)]
struct Setup {
    name: &'static str,
    /// Rapier's other model of friction.
    coulomb: bool,
    ccd: bool,
    /// True if Avian lets things bounce that are slower than 1 m/s.
    bouncy: bool,
    /// The length that is usual in the scene, in metres; thresholds scale by it.
    unit: f32,
    /// Factor of the default number of iterations (Rapier) or substeps (Avian).
    finer: usize,
}

const DEFAULT: Setup =
    Setup { name: "defaults", coulomb: false, ccd: false, bouncy: false, unit: 1.0, finer: 1 };

struct Ball {
    at: [f32; 3],
    velocity: [f32; 3],
    radius: f32,
    mass: f32,
    e: f32,
    mu: f32,
}

impl Default for Ball {
    fn default() -> Self {
        Self { at: [0.0; 3], velocity: [0.0; 3], radius: 0.5, mass: 1.0, e: 0.0, mu: 0.0 }
    }
}

/// Operations that the scenes need of an engine. Of two coefficients the larger one counts; nothing
/// sleeps.
trait Engine {
    /// An empty world, with gravity toward -y.
    fn new(setup: &Setup, gravity: f32, dt: f32) -> Self;
    /// A half-space without friction and restitution of its own, through the origin.
    fn floor(&mut self, up: [f32; 3]);
    /// Balls are named by numbers from zero.
    fn insert(&mut self, ball: &Ball);
    fn step(&mut self);
    fn place_and_velocity(&self, ball: usize) -> [[f32; 3]; 2];
}

/// The normal of a floor whose slope goes down toward +x.
fn up(degrees: f32) -> [f32; 3] {
    let (sin, cos) = degrees.to_radians().sin_cos();
    [sin, cos, 0.0]
}

fn length([x, y, z]: [f32; 3]) -> f64 {
    [x, y, z].map(f64::from).iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Radius 8 mm on 10 degrees, until 5 m/s: relative error of the speed.
fn no_spin_cap<E: Engine>(setup: &Setup) -> f64 {
    let mut world = E::new(setup, 9.81, 1.0 / 60.0);
    world.floor(up(10.0));
    let (sin, cos) = 10_f32.to_radians().sin_cos();
    let radius = 8e-3;
    let at = [radius * sin, radius * cos, 0.0];
    world.insert(&Ball { at, radius, mu: 0.5, ..Default::default() });
    let pull = 5.0 / 7.0 * 9.81 * f64::from(sin);
    let steps = (5.0 / pull * 60.0).round();
    for _ in 0..steps as u32 {
        world.step();
    }
    length(world.place_and_velocity(0)[1]) / (pull * steps / 60.0) - 1.0
}

/// Drops of 1 mm, 1 cm, 0.1 m and 1 m with e = 0.8, in steps of 1/60 s: the largest error
/// of the first rebound over the height.
fn restitution<E: Engine>(setup: &Setup) -> f64 {
    let mut worst: f64 = 0.0;
    for height in [1e-3, 1e-2, 0.1, 1.0] {
        let mut world = E::new(setup, 9.81, 1.0 / 60.0);
        world.floor(up(0.0));
        let at = [0.0, 0.05 + height, 0.0];
        world.insert(&Ball { at, radius: 0.05, e: 0.8, ..Default::default() });
        let (mut fell, mut apex) = (false, 0.0_f32);
        for _ in 0..180 {
            world.step();
            let [[_, y, _], [_, v, _]] = world.place_and_velocity(0);
            if v > 0.0 {
                fell = true;
            }
            if fell {
                apex = apex.max(y - 0.05);
                if v < 0.0 && apex > 0.0 {
                    break;
                }
            }
        }
        worst = worst.max(f64::from((apex / height - 0.64).abs()));
    }
    worst
}

/// Slides, then rolls, at 24 angles: the largest turn of its heading, in rad.
fn straight<E: Engine>(setup: &Setup) -> f64 {
    let mut worst: f64 = 0.0;
    for i in 0..24_u8 {
        let mut world = E::new(setup, 9.81, 1.0 / 60.0);
        world.floor(up(0.0));
        let angle = f32::from(i) * 0.2617 + 0.01;
        let (sin, cos) = angle.sin_cos();
        let velocity = [5.0 * cos, 0.0, 5.0 * sin];
        world.insert(&Ball { at: [0.0, 0.5, 0.0], velocity, mu: 0.3, ..Default::default() });
        for _ in 0..120 {
            world.step();
        }
        let [_, [x, _, z]] = world.place_and_velocity(0);
        worst = worst.max(f64::from((x * sin - z * cos).abs() / x.hypot(z)));
    }
    worst
}

/// Two balls at 300 m/s head on, e = 1: error of the velocity over the speed, and of the
/// place a second later over the way.
fn fast<E: Engine>(setup: &Setup, radius: f32) -> f64 {
    let mut world = E::new(setup, 0.0, 1.0 / 60.0);
    let mass = if radius < 0.5 { 1e-3 } else { 1.0 };
    let ball = |x: f32, v: f32, radius, mass| Ball {
        at: [x, 0.0, 0.0],
        velocity: [v, 0.0, 0.0],
        radius,
        mass,
        e: 1.0,
        ..Default::default()
    };
    world.insert(&ball(-10.0, 300.0, 0.5, 1.0));
    world.insert(&ball(10.0, -300.0, radius, mass));
    for _ in 0..60 {
        world.step();
    }
    let (meet, mass) = ((19.5 - f64::from(radius)) / 600.0, f64::from(mass));
    let common = 300.0 * (1.0 - mass) / (1.0 + mass);
    let mut worst: f64 = 0.0;
    for (id, start, v) in [(0, -10.0, 300.0), (1, 10.0, -300.0)] {
        let after = 2.0 * common - v;
        let place = start + v * meet + after * (1.0 - meet);
        let [[x, ..], [speed, ..]] = world.place_and_velocity(id);
        worst = worst.max((f64::from(speed) - after).abs() / 300.0);
        worst = worst.max((f64::from(x) - place).abs() / 300.0);
    }
    worst
}

/// A scene of a slope and two balls at scales of 1e-3, 1 and 1e3 (times by the root): the
/// largest deviation of a place, over the scale.
fn scale_free<E: Engine>(setup: &Setup, follow: bool) -> f64 {
    let run = |scale: f32| {
        let setup = Setup { unit: if follow { scale } else { 1.0 }, ..*setup };
        let mut world = E::new(&setup, 9.81, scale.sqrt() / 64.0);
        world.floor(up(10.0));
        let (sin, cos) = 10_f32.to_radians().sin_cos();
        for (along, lift) in [(-3.0, 0.0), (1.0, 0.7)] {
            let at =
                [along * cos + (0.5 + lift) * sin, -along * sin + (0.5 + lift) * cos, 0.1 * lift];
            let (at, radius) = (at.map(|x: f32| x * scale), 0.5 * scale);
            world.insert(&Ball { at, radius, e: 0.4, mu: 0.3, ..Default::default() });
        }
        for _ in 0..128 {
            world.step();
        }
        [0, 1].map(|ball| world.place_and_velocity(ball)[0].map(|x| x / scale))
    };
    let exact = run(1.0);
    let mut worst: f64 = 0.0;
    for scale in [1e-3, 1e3] {
        for (a, b) in exact.iter().zip(run(scale)) {
            worst = worst.max(length([a[0] - b[0], a[1] - b[1], a[2] - b[2]]));
        }
    }
    worst
}

/// Measurement of a scene in an engine with some settings.
type Scene = fn(&Setup) -> f64;

/// A scene's name, itself in Rapier and in Avian, and what its users may set to better it.
type Row = (&'static str, Scene, Scene, Vec<Setup>);

fn main() {
    let finer = Setup { name: "8 times as fine", finer: 8, ..DEFAULT };
    let coulomb = Setup { name: "Coulomb friction (Rapier)", coulomb: true, ..DEFAULT };
    let ccd = Setup { name: "ccd on", ccd: true, ..DEFAULT };
    let small = Setup { name: "length unit 0.05", unit: 0.05, ..DEFAULT };
    let bouncy = Setup { name: "no threshold (Avian)", bouncy: true, ..DEFAULT };
    let unit = Setup { name: "length unit follows", ..DEFAULT };
    let rows: [Row; 7] = [
        (
            "no spin cap: 8 mm to 5 m/s, relative",
            no_spin_cap::<Rapier>,
            no_spin_cap::<Avian>,
            vec![DEFAULT, finer, coulomb, small],
        ),
        (
            "rebound of 1 mm to 1 m, e 0.8, over the height",
            restitution::<Rapier>,
            restitution::<Avian>,
            vec![DEFAULT, finer, small, bouncy],
        ),
        (
            "straight: turn of the heading, rad",
            straight::<Rapier>,
            straight::<Avian>,
            vec![DEFAULT, finer, coulomb],
        ),
        (
            "300 m/s head on",
            |setup| fast::<Rapier>(setup, 0.5),
            |setup| fast::<Avian>(setup, 0.5),
            vec![DEFAULT, ccd],
        ),
        (
            "300 m/s against a tenth",
            |setup| fast::<Rapier>(setup, 0.05),
            |setup| fast::<Avian>(setup, 0.05),
            vec![DEFAULT, ccd],
        ),
        (
            "scale 1e-3 to 1e3",
            |setup| scale_free::<Rapier>(setup, false),
            |setup| scale_free::<Avian>(setup, false),
            vec![DEFAULT],
        ),
        (
            "scale 1e-3 to 1e3",
            |setup| scale_free::<Rapier>(setup, true),
            |setup| scale_free::<Avian>(setup, true),
            vec![unit],
        ),
    ];
    println!("| scene | set-up | Rapier 0.36.1 | Avian 0.7.0 |\n|---|---|---|---|");
    for (scene, rapier, avian, setups) in rows {
        for setup in setups {
            let (rapier, avian) = (rapier(&setup), avian(&setup));
            println!("| {scene} | {} | {rapier:.1e} | {avian:.1e} |", setup.name);
        }
    }
}
