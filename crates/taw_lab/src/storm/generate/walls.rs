//! Random walls.

use std::f64::consts::{FRAC_PI_2, TAU};

use taw::math::Vec3;
use taw::scene::{Build, KinematicMotion, RotationDesc, Scene, ShapeDesc, Structure, WallDesc};

use super::Dice;

/// Walls, and where bodies go.
pub struct Arena {
    pub scene: Scene,
    pub about: &'static str,
    /// The length that everything is measured by, in metres.
    pub size: f64,
    /// A level floor exists at height zero.
    pub floor: bool,
    /// Corners of the box in which bodies begin.
    pub low: [f64; 3],
    pub high: [f64; 3],
    pub closed: Option<[[f64; 3]; 2]>,
    pub differenced: bool,
}

/// Builders of arenas of scenes whose number is `LATER` modulo `EVERY`: those that came later, so
/// that all other names stand for the scenes that they always stood for.
const EVERY: u64 = 12;
const LATER: u64 = 1;

/// One of many arenas.
pub fn arena(number: u64, dice: &mut Dice) -> Arena {
    let size = if dice.chance(0.6) { 1.0 } else { dice.magnitude(0.1, 5.0) };
    let mut arena = Arena {
        scene: Scene::default(),
        about: "",
        size,
        floor: true,
        low: [-size, 0.05 * size, -size],
        high: [size, 2.0 * size, size],
        closed: None,
        differenced: false,
    };
    match dice.below(10) {
        0 => arena.scene.gravity = [0.0, -1.62, 0.0],
        1 => arena.scene.gravity = (dice.upward(0.3) * -9.81).into(),
        _ => {}
    }
    let first: &[fn(&mut Arena, &mut Dice)] = &[
        open_floor,
        space,
        corner,
        groove,
        cone,
        bowl,
        block,
        box_of_planes,
        box_of_boxes,
        stairs,
        landscape,
        round,
        sheet,
        hopper,
        lift,
        disc,
        board,
        belt,
    ];
    let later: &[fn(&mut Arena, &mut Dice)] = &[paddle, plate, ridge];
    let builders = if number % EVERY == LATER { later } else { first };
    builders[dice.below(builders.len())](&mut arena, dice);
    arena
}

impl Arena {
    fn wall(&mut self, shape: ShapeDesc, motion: Option<KinematicMotion>) {
        self.scene.walls.push(WallDesc { shape, material: None, motion });
    }

    fn plane(&mut self, normal: Vec3<f64>, point: [f64; 3]) {
        self.wall(ShapeDesc::HalfSpace { normal: normal.into(), point }, None);
    }

    fn ground(&mut self) {
        self.plane(Vec3::unit_y(), [0.0; 3]);
    }

    fn block(
        &mut self,
        center: [f64; 3],
        size: [f64; 3],
        rotation: RotationDesc,
        motion: Option<KinematicMotion>,
    ) {
        self.wall(ShapeDesc::Box { center, size, rotation }, motion);
    }

    fn build(&mut self, shape: Build) {
        self.scene.structures.push(Structure { shape, material: None, motion: None });
    }
}

fn open_floor(arena: &mut Arena, _: &mut Dice) {
    arena.about = "a floor";
    arena.ground();
}

fn space(arena: &mut Arena, dice: &mut Dice) {
    arena.about = "nothing but bodies";
    arena.floor = false;
    if dice.chance(0.7) {
        arena.scene.gravity = [0.0; 3];
    }
}

fn corner(arena: &mut Arena, dice: &mut Dice) {
    arena.about = "a corner of planes";
    arena.ground();
    let (size, first) = (arena.size, dice.between(0.0, TAU));
    let lean = if dice.chance(0.5) { 0.0 } else { dice.between(-0.6, 0.6) };
    for i in 0..=dice.below(2) {
        let right = if dice.chance(0.5) { FRAC_PI_2 } else { dice.between(0.4, 2.6) };
        // Some along the axes, as games have them.
        let start = if lean == 0.0 { 0.0 } else { first };
        let angle = start + right * i as f64;
        let normal = Vec3::new(lean.cos() * angle.cos(), lean.sin(), lean.cos() * angle.sin());
        arena.plane(normal, (normal * -size).into());
    }
}

fn groove(arena: &mut Arena, dice: &mut Dice) {
    arena.about = "a groove";
    arena.floor = false;
    let (slope, turn) = (dice.between(0.1, 1.4), dice.between(0.0, TAU));
    for side in [-1.0, 1.0] {
        let across = Vec3::new(turn.cos(), 0.0, turn.sin()) * (side * slope.sin());
        arena.plane(across + Vec3::unit_y() * slope.cos(), [0.0; 3]);
    }
}

/// A fan of triangles around a point, whose rim is `rise` metres above it.
fn fan(apex: [f64; 3], radius: f64, rise: f64, sides: u32) -> Build {
    let rim = (0..sides).map(|i| {
        let angle = TAU * f64::from(i) / f64::from(sides);
        [apex[0] + radius * angle.cos(), apex[1] + rise, apex[2] + radius * angle.sin()]
    });
    let points = std::iter::once(apex).chain(rim).collect();
    let triangles = (0..sides).map(|i| [0, 1 + (i + 1) % sides, 1 + i]).collect();
    Build::Mesh { points, triangles }
}

fn cone(arena: &mut Arena, dice: &mut Dice) {
    arena.about = "a cone of triangles";
    arena.ground();
    let (size, sides) = (arena.size, 16 + dice.below(85) as u32);
    let height = size * dice.between(0.05, 1.0);
    arena.build(fan([0.0, height, 0.0], size, -height, sides));
    if dice.chance(0.5) {
        // Onto the apex.
        arena.low = [-0.1 * size, height, -0.1 * size];
        arena.high = [0.1 * size, height + size, 0.1 * size];
        if dice.chance(0.5) {
            (arena.low[0], arena.low[2], arena.high[0], arena.high[2]) = (0.0, 0.0, 1e-9, 1e-9);
        }
    } else {
        arena.low[1] = height;
        arena.high[1] += height;
    }
    arena.floor = false;
}

fn bowl(arena: &mut Arena, dice: &mut Dice) {
    arena.about = "a bowl of triangles";
    arena.floor = false;
    let (size, sides) = (arena.size, 8 + dice.below(13) as u32);
    let (rings, depth) = (1 + dice.below(4) as u32, dice.between(0.2, 1.0));
    let mut points = vec![[0.0; 3]];
    let mut triangles = Vec::new();
    for ring in 1..=rings {
        let part = f64::from(ring) / f64::from(rings);
        for i in 0..sides {
            let angle = TAU * f64::from(i) / f64::from(sides);
            let out = 1.5 * size * part;
            points.push([out * angle.cos(), 1.5 * size * depth * part * part, out * angle.sin()]);
            let (here, next) =
                (1 + (ring - 1) * sides + i, 1 + (ring - 1) * sides + (i + 1) % sides);
            if ring == 1 {
                triangles.push([0, next, here]);
            } else {
                triangles.push([here - sides, next, here]);
                triangles.push([here - sides, next - sides, next]);
            }
        }
    }
    arena.build(Build::Mesh { points, triangles });
    (arena.low, arena.high) =
        ([-0.5 * size, 0.6 * size, -0.5 * size], [0.5 * size, 2.5 * size, 0.5 * size]);
}

fn block(arena: &mut Arena, dice: &mut Dice) {
    arena.about = "boxes on a floor";
    arena.ground();
    let size = arena.size;
    for _ in 0..=dice.below(3) {
        let center = dice.inside([-size, 0.0, -size], [size, 0.5 * size, size]);
        let sides = dice.inside([0.05 * size; 3], [size; 3]);
        let turned = if dice.chance(0.5) {
            RotationDesc::default()
        } else {
            RotationDesc { axis: dice.direction().into(), degrees: dice.between(0.0, 360.0) }
        };
        arena.block(center, sides, turned, None);
    }
}

fn box_of_planes(arena: &mut Arena, dice: &mut Dice) {
    arena.about = "a closed box of planes";
    let half = arena.size * dice.between(0.5, 1.5);
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let mut normal = Vec3::new(0.0, 0.0, 0.0);
            normal[axis] = -side;
            arena.plane(normal, (normal * -half + Vec3::unit_y() * half).into());
        }
    }
    if dice.chance(0.3) {
        arena.scene.gravity = [0.0; 3];
    }
    close(arena, half);
}

fn box_of_boxes(arena: &mut Arena, dice: &mut Dice) {
    arena.about = "a closed box of solid boxes";
    let half = arena.size * dice.between(0.5, 1.5);
    let thick = if dice.chance(0.5) { 0.02 * half } else { half * dice.between(0.02, 0.5) };
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let (mut center, mut sides) = ([0.0, half, 0.0], [2.0 * (half + thick); 3]);
            center[axis] += side * (half + 0.5 * thick);
            sides[axis] = thick;
            arena.block(center, sides, RotationDesc::default(), None);
        }
    }
    close(arena, half);
}

fn close(arena: &mut Arena, half: f64) {
    arena.closed = Some([[-half, 0.0, -half], [half, 2.0 * half, half]]);
    (arena.low, arena.high) =
        ([-0.9 * half, 0.05 * half, -0.9 * half], [0.9 * half, 1.9 * half, 0.9 * half]);
}

fn stairs(arena: &mut Arena, dice: &mut Dice) {
    arena.about = "a compound of steps";
    arena.floor = false;
    let (size, steps) = (arena.size, 2 + dice.below(5));
    let part = |i: usize| {
        let (deep, high) = (2.0 * size / steps as f64, 0.5 * size / steps as f64);
        ShapeDesc::Box {
            center: [-size + deep * (i as f64 + 0.5), -high * i as f64 - 0.5 * size, 0.0],
            size: [deep, size, 2.0 * size],
            rotation: RotationDesc::default(),
        }
    };
    arena.build(Build::Compound { parts: (0..steps).map(part).collect() });
}

fn landscape(arena: &mut Arena, dice: &mut Dice) {
    arena.about = "a height field";
    arena.floor = false;
    let (size, columns) = (arena.size, 3 + dice.below(8) as u32);
    let (rough, cell) = (size * dice.between(0.0, 0.5), 4.0 * size / f64::from(columns - 1));
    let heights = (0..columns * columns).map(|_| dice.between(-rough, 0.0)).collect();
    let corner = [-2.0 * size, 0.0, -2.0 * size];
    arena.build(Build::HeightField { corner, cell: [cell; 2], columns, heights });
}

fn round(arena: &mut Arena, dice: &mut Dice) {
    arena.about = "a ball and a capsule that do not move";
    arena.ground();
    let size = arena.size;
    let radius = size * dice.between(0.1, 0.8);
    arena.wall(ShapeDesc::Ball { center: [0.0, 0.5 * radius, 0.0], radius }, None);
    let (from, to) = (dice.inside([-size; 3], [size; 3]), dice.inside([-size; 3], [size; 3]));
    arena.wall(ShapeDesc::Capsule { from, to, radius: size * dice.between(0.05, 0.3) }, None);
    (arena.low[1], arena.floor) = (1.5 * radius, false);
}

fn sheet(arena: &mut Arena, dice: &mut Dice) {
    arena.about = "a thin sheet over a floor";
    arena.ground();
    let (size, thick) = (arena.size, 0.02);
    let axis = Vec3::new(dice.between(-1.0, 1.0), 0.0, dice.between(-1.0, 1.0)).into();
    let degrees = if dice.chance(0.5) { 0.0 } else { dice.between(-40.0, 40.0) };
    let turned = RotationDesc { axis, degrees };
    let center = [0.0, 0.5 * size, 0.0];
    if dice.chance(0.5) {
        arena.block(center, [2.0 * size, thick * size, 2.0 * size], turned, None);
    } else {
        // Of two triangles.
        let points = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let points = points.map(|[x, z]| [x * size, 0.5 * size, z * size]).to_vec();
        arena.build(Build::Mesh { points, triangles: vec![[0, 2, 1], [0, 3, 2]] });
    }
    arena.low[1] = 0.6 * size;
    arena.floor = false;
}

fn hopper(arena: &mut Arena, dice: &mut Dice) {
    arena.about = "a hopper over a floor";
    arena.ground();
    let size = arena.size;
    let (slope, mouth) = (dice.between(0.4, 1.2_f64), size * dice.between(0.0, 0.4));
    for i in 0..4 {
        let angle = FRAC_PI_2 * f64::from(i);
        let out = [angle.cos(), angle.sin()];
        let far = mouth + size * slope.cos();
        let center = [out[0] * far, size + size * slope.sin(), out[1] * far];
        // A plate that leans outward, turned about the horizontal across.
        let turned = RotationDesc { axis: [-out[1], 0.0, out[0]], degrees: slope.to_degrees() };
        let sides = if i % 2 == 0 {
            [2.0 * size, 0.1 * size, 4.0 * size]
        } else {
            [4.0 * size, 0.1 * size, 2.0 * size]
        };
        arena.block(center, sides, turned, None);
    }
    let reach = mouth + 0.3 * size;
    arena.low = [-reach, 2.0 * size, -reach];
    arena.high = [reach, 3.5 * size, reach];
    arena.floor = false;
}

fn swing(way: [f64; 3], degrees: f64, axis: [f64; 3], period: f64) -> KinematicMotion {
    KinematicMotion::Oscillate { amplitude: way, pivot: [0.0; 3], axis, degrees, period }
}

fn lift(arena: &mut Arena, dice: &mut Dice) {
    arena.about = "a lift";
    let (size, period) = (arena.size, dice.magnitude(0.7, 20.0));
    // As fast as a lift, or a fast one, at most; and no faster than gravity lets go.
    let fastest = dice.between(0.1, 3.0).min(9.0 * period / TAU);
    let way = fastest * period / TAU * dice.pick(&[-1.0, 1.0]);
    let sides = [3.0 * size, 0.5 * size, 3.0 * size];
    arena.block(
        [0.0, -0.25 * size, 0.0],
        sides,
        RotationDesc::default(),
        Some(swing([0.0, way, 0.0], 0.0, [0.0, 1.0, 0.0], period)),
    );
    arena.differenced = dice.chance(0.5);
}

fn disc(arena: &mut Arena, dice: &mut Dice) {
    arena.about = "a turning disc";
    let (size, degrees_per_second) = (arena.size, dice.between(-180.0, 180.0));
    let motion =
        KinematicMotion::Rotate { pivot: [0.0; 3], axis: [0.0, 1.0, 0.0], degrees_per_second };
    let center = [0.0, -0.25 * size, 0.0];
    arena.block(
        center,
        [3.0 * size, 0.5 * size, 3.0 * size],
        RotationDesc::default(),
        Some(motion),
    );
    arena.differenced = dice.chance(0.5);
}

fn board(arena: &mut Arena, dice: &mut Dice) {
    arena.about = "a tilting board with rails";
    let (size, period) = (arena.size, dice.between(2.0, 8.0));
    let tilt = Some(swing([0.0; 3], dice.between(1.0, 8.0), [0.0, 0.0, 1.0], period));
    let thick = 0.2 * size;
    arena.block(
        [0.0, -0.5 * thick, 0.0],
        [2.4 * size, thick, 2.4 * size],
        RotationDesc::default(),
        tilt,
    );
    for side in [-1.0, 1.0] {
        let (at, height) = (side * (1.1 * size), 0.5 * thick);
        arena.block([at, height, 0.0], [thick, thick, 2.4 * size], RotationDesc::default(), tilt);
        arena.block([0.0, height, at], [2.4 * size, thick, thick], RotationDesc::default(), tilt);
    }
    (arena.low, arena.high) =
        ([-0.8 * size, 0.05 * size, -0.8 * size], [0.8 * size, size, 0.8 * size]);
    arena.differenced = dice.chance(0.7);
}

fn belt(arena: &mut Arena, dice: &mut Dice) {
    arena.about = "a belt";
    let way = Vec3::new(dice.between(-3.0, 3.0), 0.0, dice.between(-3.0, 3.0));
    let shape = ShapeDesc::HalfSpace { normal: [0.0, 1.0, 0.0], point: [0.0; 3] };
    arena.wall(shape, Some(KinematicMotion::Conveyor { velocity: way.into() }));
}

/// A closed box with room for any body beside what moves in it.
fn roomy_box(arena: &mut Arena, dice: &mut Dice) -> f64 {
    if dice.chance(0.5) {
        box_of_planes(arena, dice);
    } else {
        box_of_boxes(arena, dice);
    }
    let half = arena.high[0] / 0.9;
    // Bodies are as wide as 0.7 of the size at most; what moves leaves half a box.
    arena.size = 0.5 * half;
    half
}

fn paddle(arena: &mut Arena, dice: &mut Dice) {
    let half = roomy_box(arena, dice);
    arena.about = "a paddle in a closed box";
    let degrees_per_second = dice.magnitude(20.0, 1000.0) * dice.pick(&[-1.0, 1.0]);
    let motion =
        KinematicMotion::Rotate { pivot: [0.0; 3], axis: [0.0, 1.0, 0.0], degrees_per_second };
    // Through the floor, so that nothing gets under it.
    let sides = [half, 0.4 * half, half * dice.between(0.02, 0.2)];
    arena.block([0.0, 0.1 * half, 0.0], sides, RotationDesc::default(), Some(motion));
    (arena.low[1], arena.floor) = (0.4 * half, false);
    arena.differenced = dice.chance(0.5);
}

fn plate(arena: &mut Arena, dice: &mut Dice) {
    let half = roomy_box(arena, dice);
    arena.about = "a plate that goes to and fro in a closed box";
    let amplitude = 0.45 * half;
    let period = TAU * amplitude / dice.magnitude(0.1, 20.0);
    let motion = swing([amplitude, 0.0, 0.0], 0.0, [0.0, 1.0, 0.0], period);
    let sides = [half * dice.between(0.02, 0.1), 1.2 * half, 2.2 * half];
    arena.block([0.0, 0.5 * half, 0.0], sides, RotationDesc::default(), Some(motion));
    (arena.low[1], arena.floor) = (1.2 * half, false);
    arena.differenced = dice.chance(0.5);
}

fn ridge(arena: &mut Arena, dice: &mut Dice) {
    arena.about = "a height field narrower than bodies";
    arena.ground();
    let size = arena.size;
    let (columns, rows) = (2 + dice.below(2) as u32, 2 + dice.below(6) as u32);
    let width = size * dice.magnitude(0.02, 0.5) / f64::from(columns - 1);
    let length = 2.0 * size / f64::from(rows - 1);
    let heights = (0..columns * rows).map(|_| size * dice.between(0.3, 0.6)).collect();
    let corner = [-0.5 * width * f64::from(columns - 1), 0.0, -size];
    arena.build(Build::HeightField { corner, cell: [width, length], columns, heights });
    (arena.low[1], arena.floor) = (0.6 * size, false);
    if dice.chance(0.5) {
        (arena.low[0], arena.high[0]) = (-0.2 * size, 0.2 * size); // onto the ridge
    }
}
