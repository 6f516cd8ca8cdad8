//! Scenes of the race.

use bevy::math::{Quat, Vec3};

/// Balls of density 1 in a container that turns about the origin.
pub struct Scene {
    pub name: &'static str,
    /// Centers and radii.
    pub balls: Vec<(Vec3, f32)>,
    /// Inward normals, and points of the planes.
    pub planes: Vec<(Vec3, Vec3)>,
    /// Centers, half sizes, and rotations.
    pub boxes: Vec<(Vec3, Vec3, Quat)>,
    pub turn: fn(f32) -> Quat,
    /// Number of steps.
    pub steps: u32,
    /// Lets what rests fall asleep; then only taw runs it.
    pub sleeps: bool,
}

const STEPS: u32 = 240;

/// Numbers in [0, 1) that look random.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }
}

fn still(_: f32) -> Quat {
    Quat::IDENTITY
}

/// Balls on a lattice of `nx` by `nz` cells, each a little wider than the largest ball, upwards of a
/// height.
fn lattice(
    count: usize,
    [nx, nz]: [usize; 2],
    from: f32,
    radii: [f32; 2],
    even: bool,
) -> Vec<(Vec3, f32)> {
    let mut random = Random(count as u64);
    let pitch = 2.1 * radii[1];
    let at = |i: usize, n: usize| (i as f32 + 0.5 - n as f32 * 0.5) * pitch;
    let place = |i: usize| {
        let y = from + (i / (nx * nz)) as f32 * pitch + radii[1];
        Vec3::new(at(i % nx, nx), y, at(i / nx % nz, nz))
    };
    let mut radius = || {
        let part = random.next();
        let [least, most] = radii;
        if even { least + (most - least) * part } else { least * (most / least).powf(part) }
    };
    let all: Vec<_> = (0..count).map(|i| (place(i), radius())).collect();
    // Or they would stand on each other's heads.
    let mut aside = || (random.next() - 0.5) * 0.04 * pitch;
    all.into_iter().map(|(at, radius)| (at + Vec3::new(aside(), 0.0, aside()), radius)).collect()
}

fn open_box(half: f32) -> Vec<(Vec3, Vec3)> {
    let sides = [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z].map(|up| (up, up * -half));
    [(Vec3::Y, Vec3::ZERO)].into_iter().chain(sides).collect()
}

/// Twelve layers dropped into a box that fits them.
pub fn pour(count: usize) -> Scene {
    let side = (count as f32 / 12.0).sqrt().ceil() as usize;
    Scene {
        name: "pour",
        balls: lattice(count, [side; 2], 0.0, [0.3, 0.5], true),
        planes: open_box(side as f32 * 1.05 * 0.5),
        boxes: Vec::new(),
        turn: still,
        steps: STEPS,
        sleeps: false,
    }
}

/// Few balls, as most games have.
pub fn few() -> Scene {
    Scene { name: "few", ..pour(20) }
}

/// Ten thousand that have fallen asleep.
pub fn asleep() -> Scene {
    Scene { name: "asleep", steps: 1_200, sleeps: true, ..pour(10_000) }
}

/// A drum of 24 faces that turns once in ten seconds.
pub fn drum() -> Scene {
    let (radius, half) = (10.0, 8.0);
    let faces = (0..24_u8).map(|i| {
        let inward = Quat::from_rotation_z(f32::from(i) * std::f32::consts::TAU / 24.0) * Vec3::Y;
        (inward, inward * -radius)
    });
    let ends = [Vec3::Z, Vec3::NEG_Z].map(|inward| (inward, inward * -half));
    Scene {
        name: "drum",
        balls: lattice(4_000, [12, 15], -7.0, [0.3, 0.5], true),
        planes: faces.chain(ends).collect(),
        boxes: Vec::new(),
        turn: |time| Quat::from_rotation_z(time * std::f32::consts::TAU / 10.0),
        steps: STEPS,
        sleeps: false,
    }
}

/// A funnel of four boards over a floor.
pub fn hopper() -> Scene {
    let mut boxes = Vec::new();
    for i in 0..4_u8 {
        let about = Quat::from_rotation_y(f32::from(i) * std::f32::consts::FRAC_PI_2);
        let tilt = about * Quat::from_rotation_z(0.8);
        // Its inner edge leaves a hole of 3 m.
        let center =
            about * (Vec3::new(1.5, 6.0, 0.0) + Quat::from_rotation_z(0.8) * Vec3::X * 8.0);
        boxes.push((center, Vec3::new(8.0, 0.5, 14.0), tilt));
    }
    Scene {
        name: "hopper",
        balls: lattice(3_000, [12, 12], 16.0, [0.3, 0.5], true),
        planes: open_box(16.0),
        boxes,
        turn: still,
        steps: STEPS,
        sleeps: false,
    }
}

/// A box that tilts to and fro, with radii of one to ten.
pub fn board() -> Scene {
    Scene {
        name: "board, mixed",
        balls: lattice(5_000, [30; 2], 0.5, [0.05, 0.5], false),
        planes: open_box(16.5),
        boxes: Vec::new(),
        turn: |time| {
            let about = |speed: f32| (time * speed).sin() * 0.2;
            Quat::from_rotation_x(about(1.1)) * Quat::from_rotation_z(about(0.7))
        },
        steps: STEPS,
        sleeps: false,
    }
}
