//! The table for the numbers of scenes.

use taw::scene::{
    Ball, Build, Field, Form, Gate, Lattice, Movement, Scene, Structure, Surface, Tilt, Turn, Wall,
};

/// A scene with one of each.
pub fn one_of_each() -> Scene {
    let on_floor = |x: f64| Ball { position: [x, 0.5, 0.0], radius: 0.5, ..Ball::default() };
    let surface = Some(Surface::default());
    let turned = Turn { axis: [0.0, 0.0, 1.0], degrees: 10.0 };
    let turns =
        Movement::Turns { pivot: [1.0, 0.0, 0.0], axis: [0.0, 1.0, 0.0], degrees_per_second: 30.0 };
    let swings = Movement::Swings {
        way: [0.0, 0.2, 0.0],
        pivot: [0.0; 3],
        axis: [1.0, 0.0, 0.0],
        degrees: 5.0,
        period: 2.0,
    };
    let wall = |shape, moves| Wall { shape, surface, moves };
    Scene {
        tilts: vec![
            Tilt { at: 0.0, gravity: [0.0, -9.0, 0.0] },
            Tilt { at: 0.1, gravity: [1.0, -9.0, 0.0] },
        ],
        fields: vec![
            Field::Drag { velocity: [1.0, 0.0, 0.0], linear: 0.1, quadratic: 0.1 },
            Field::Spring { anchor: [0.0, 9.0, 0.0], rest_length: 1.0, stiffness: 1.0 },
            Field::Attraction { center: [0.0, -99.0, 0.0], strength: 1.0 },
        ],
        walls: vec![
            wall(Form::HalfSpace { normal: [0.0, 1.0, 0.0], through: [0.0; 3] }, Some(swings)),
            wall(Form::Box { center: [5.0, 0.0, 0.0], size: [1.0, 2.0, 3.0], turned }, Some(turns)),
            wall(
                Form::Ball { center: [0.0, 0.0, 5.0], radius: 1.0 },
                Some(Movement::Conveys { velocity: [1.0, 0.0, 0.0] }),
            ),
            wall(Form::Capsule { from: [0.0; 3], to: [0.0, 1.0, 0.0], radius: 0.2 }, None),
        ],
        structures: vec![Structure {
            shape: Build::Compound { parts: vec![Form::Ball { center: [9.0; 3], radius: 1.0 }] },
            surface,
            moves: None,
        }],
        gates: vec![Gate { normal: [0.0, 1.0, 0.0], through: [0.0; 3] }],
        marbles: vec![on_floor(3.0), on_floor(3.9)],
        lattices: vec![Lattice {
            first: Ball { position: [-3.0, 0.5, 0.0], radius: 0.4, ..Ball::default() },
            count: [2, 2, 1],
            pitch: [-1.0, 1.0, 1.0],
            disorder: 0.1,
        }],
        ..Scene::default()
    }
}

type Set = fn(&mut Scene, f64);

/// Into the first wall of the form.
fn form(scene: &mut Scene, mut set: impl FnMut(&mut Form)) {
    scene.walls.iter_mut().for_each(|wall| set(&mut wall.shape));
}

fn moves(scene: &mut Scene, set: impl FnMut(&mut Movement)) {
    scene.walls.iter_mut().filter_map(|wall| wall.moves.as_mut()).for_each(set);
}

fn surface(scene: &mut Scene, set: impl Fn(&mut Surface)) {
    set(&mut scene.surface);
    scene.walls.iter_mut().filter_map(|wall| wall.surface.as_mut()).for_each(set);
}

macro_rules! into {
    ($of:ident, $scene:expr, $pattern:pat => $set:expr) => {
        $of($scene, |it| {
            if let $pattern = it {
                $set
            }
        })
    };
}

#[rustfmt::skip] // one row a line
pub fn rows() -> Vec<(&'static str, Set)> {
    vec![
        ("scene::Scene.about scene::Scene.seconds", |s, x| s.seconds = x),
        ("scene::Scene.gravity", |s, x| { s.tilts.clear(); s.gravity = [x, x, 0.0]; }),
        ("scene::Scene.tilts scene::Tilt.at", |s, x| s.tilts[1].at = x),
        ("scene::Tilt.gravity", |s, x| s.tilts[1].gravity = [0.0, x, x]),
        ("scene::Scene.fields scene::Field::Drag.velocity", |s, x| into!(field, s, Field::Drag { velocity, .. } => velocity[1] = x)),
        ("scene::Field::Drag.linear", |s, x| into!(field, s, Field::Drag { linear, .. } => *linear = x)),
        ("scene::Field::Drag.quadratic", |s, x| into!(field, s, Field::Drag { quadratic, .. } => *quadratic = x)),
        ("scene::Field::Spring.anchor", |s, x| into!(field, s, Field::Spring { anchor, .. } => anchor[2] = x)),
        ("scene::Field::Spring.rest_length", |s, x| into!(field, s, Field::Spring { rest_length, .. } => *rest_length = x)),
        ("scene::Field::Spring.stiffness", |s, x| into!(field, s, Field::Spring { stiffness, .. } => *stiffness = x)),
        ("scene::Field::Attraction.center", |s, x| into!(field, s, Field::Attraction { center, .. } => center[0] = x)),
        ("scene::Field::Attraction.strength", |s, x| into!(field, s, Field::Attraction { strength, .. } => *strength = x)),
        ("scene::Scene.surface scene::Wall.surface scene::Surface.restitution", |s, x| surface(s, |it| it.restitution = x)),
        ("scene::Surface.friction", |s, x| surface(s, |it| it.friction = x)),
        ("scene::Surface.tangential_restitution", |s, x| surface(s, |it| it.tangential_restitution = x)),
        ("scene::Surface.rolling_resistance", |s, x| surface(s, |it| it.rolling_resistance = x)),
        ("scene::Surface.spinning_resistance", |s, x| surface(s, |it| it.spinning_resistance = x)),
        ("scene::Surface.youngs_modulus", |s, x| surface(s, |it| it.youngs_modulus = x)),
        ("scene::Surface.poissons_ratio", |s, x| surface(s, |it| it.poissons_ratio = x)),
        ("scene::Scene.walls scene::Wall.shape scene::Form::HalfSpace.normal", |s, x| into!(form, s, Form::HalfSpace { normal, .. } => *normal = [0.0, x, 0.0])),
        ("scene::Form::HalfSpace.through", |s, x| into!(form, s, Form::HalfSpace { through, .. } => *through = [x, x, 0.0])),
        ("scene::Form::Box.center", |s, x| into!(form, s, Form::Box { center, .. } => *center = [x, x, 0.0])),
        ("scene::Form::Box.size", |s, x| into!(form, s, Form::Box { size, .. } => size[1] = x)),
        ("scene::Form::Box.turned scene::Turn.axis", |s, x| into!(form, s, Form::Box { turned, .. } => turned.axis = [x, 0.0, 0.0])),
        ("scene::Turn.degrees", |s, x| into!(form, s, Form::Box { turned, .. } => turned.degrees = x)),
        ("scene::Form::Ball.center", |s, x| into!(form, s, Form::Ball { center, .. } => *center = [x, x, x])),
        ("scene::Form::Ball.radius", |s, x| into!(form, s, Form::Ball { radius, .. } => *radius = x)),
        ("scene::Form::Capsule.from", |s, x| into!(form, s, Form::Capsule { from, .. } => *from = [x, x, x])),
        ("scene::Form::Capsule.to", |s, x| into!(form, s, Form::Capsule { to, .. } => to[0] = x)),
        ("scene::Form::Capsule.radius", |s, x| into!(form, s, Form::Capsule { radius, .. } => *radius = x)),
        ("scene::Wall.moves scene::Movement::Conveys.velocity", |s, x| into!(moves, s, Movement::Conveys { velocity } => velocity[2] = x)),
        ("scene::Movement::Turns.pivot", |s, x| into!(moves, s, Movement::Turns { pivot, .. } => *pivot = [x, 0.0, x])),
        ("scene::Movement::Turns.axis", |s, x| into!(moves, s, Movement::Turns { axis, .. } => *axis = [x, x, 0.0])),
        ("scene::Movement::Turns.degrees_per_second", |s, x| into!(moves, s, Movement::Turns { degrees_per_second, .. } => *degrees_per_second = x)),
        ("scene::Movement::Swings.way", |s, x| into!(moves, s, Movement::Swings { way, .. } => way[1] = x)),
        ("scene::Movement::Swings.pivot", |s, x| into!(moves, s, Movement::Swings { pivot, .. } => *pivot = [x, x, x])),
        ("scene::Movement::Swings.axis", |s, x| into!(moves, s, Movement::Swings { axis, .. } => *axis = [0.0, 0.0, x])),
        ("scene::Movement::Swings.degrees", |s, x| into!(moves, s, Movement::Swings { degrees, .. } => *degrees = x)),
        ("scene::Movement::Swings.period", |s, x| into!(moves, s, Movement::Swings { period, .. } => *period = x)),
        ("scene::Scene.gates scene::Gate.normal", |s, x| s.gates[0].normal = [x, 0.0, x]),
        ("scene::Gate.through", |s, x| s.gates[0].through[1] = x),
        ("scene::Scene.marbles scene::Ball.position", |s, x| s.marbles[0].position = [x, x, x]),
        ("scene::Ball.radius", |s, x| s.marbles[0].radius = x),
        ("scene::Ball.velocity", |s, x| s.marbles[0].velocity[1] = x),
        ("scene::Ball.angular_velocity", |s, x| s.marbles[0].angular_velocity = [x, x, x]),
        ("scene::Ball.density", |s, x| s.marbles[0].density = x),
        ("scene::Ball.half_length", |s, x| s.marbles[0].half_length = x),
        ("scene::Ball.turned", |s, x| s.marbles[0].turned = Turn { axis: [0.0, x, x], degrees: x }),
        ("scene::Scene.structures", |s, x| s.structures[0].shape = Build::Mesh { points: vec![[0.0; 3], [x, 0.0, 0.0], [0.0, x, 1.0]], triangles: vec![[0, 1, 2]] }),
        ("scene::Scene.structures", |s, x| s.structures[0].shape = Build::HeightField { corner: [x, 0.0, 0.0], cell: [1.0; 2], columns: 2, heights: vec![0.0, x, 0.0, 0.0] }),
        ("scene::Scene.structures", |s, x| s.structures[0].shape = Build::Compound { parts: vec![Form::Ball { center: [0.0; 3], radius: x }] }),
        ("scene::Ball.surface", |s, x| s.marbles[0].surface = Some(Surface { friction: x, ..Surface::default() })),
        ("scene::Scene.lattices scene::Lattice.first", |s, x| s.lattices[0].first.radius = x),
        ("scene::Lattice.count", |s, x| s.lattices[0].count = [x.abs().min(65535.0) as u16; 3]),
        ("scene::Lattice.pitch", |s, x| s.lattices[0].pitch[0] = x),
        ("scene::Lattice.disorder", |s, x| s.lattices[0].disorder = x),
    ]
}

/// Into each field of force of the kind.
fn field(scene: &mut Scene, set: impl FnMut(&mut Field)) {
    scene.fields.iter_mut().for_each(set);
}
