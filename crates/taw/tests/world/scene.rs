//! Scenes as plain values, and read from files.

use taw::Error;
use taw::prelude::*;
use taw::scene::{
    GravityKeyframe, KinematicMotion, Lattice, MarbleDesc, MaterialDesc, Scene, ShapeDesc, WallDesc,
};

const DT: f64 = 1.0 / 240.0;

fn impulse() -> Model {
    Model { response: Response::Impulse, rotation: Rotation::Dynamic, ..Model::default() }
}

fn floor() -> WallDesc {
    let shape = ShapeDesc::HalfSpace { normal: [0.0, 2.0, 0.0], point: [0.0; 3] };
    WallDesc { shape, material: None, motion: None }
}

fn rough() -> MaterialDesc {
    MaterialDesc { friction: 0.5, restitution: 0.0, ..MaterialDesc::default() }
}

fn after(scene: &Scene) -> taw::scene::Simulation<f64> {
    let mut running = scene.run(impulse()).unwrap();
    while running.time() < scene.duration - 0.5 * DT {
        running.step(DT).unwrap();
    }
    running
}

#[test]
fn marbles_and_lattices_come_in_order_and_in_any_scalar() {
    let lattice = Lattice {
        first: MarbleDesc { radius: 0.4, ..MarbleDesc::default() },
        count: [3, 2, 4],
        pitch: [1.0, 1.1, 1.2],
        jitter: 0.1,
    };
    let single = MarbleDesc { position: [9.0, 9.0, 9.0], ..MarbleDesc::default() };
    let scene = Scene { marbles: vec![single], lattices: vec![lattice], ..Scene::default() };
    let balls: Vec<_> = scene.all_marbles().collect();
    assert_eq!((balls.len(), balls[0]), (25, single));
    for ball in &balls[1..] {
        assert!(ball.radius <= 0.4 && ball.radius > 0.36);
        for other in &balls[1..] {
            let apart = Vec3::from(ball.position) - Vec3::from(other.position);
            assert!(ball == other || apart.magnitude() > 0.8);
        }
    }
    let (f32s, f64s) = (scene.run::<f32>(impulse()).unwrap(), scene.run::<f64>(impulse()).unwrap());
    assert_eq!(f32s.world.marbles.len(), 25);
    for ((a, b), ball) in
        f32s.world.marbles.position().iter().zip(f64s.world.marbles.position()).zip(&balls)
    {
        assert_eq!(f64::from(a.x), f64::from(b.x as f32));
        assert_eq!([b.x, b.y, b.z], ball.position);
    }
}

#[test]
fn gravity_tilts_over_time() {
    let ball = MarbleDesc { position: [0.0, 100.0, 0.0], ..MarbleDesc::default() };
    let gravity_keyframes = vec![
        GravityKeyframe { time: 1.0, gravity: [0.0; 3] },
        GravityKeyframe { time: 2.0, gravity: [6.0, 0.0, 0.0] },
    ];
    let scene = Scene { duration: 3.0, gravity_keyframes, marbles: vec![ball], ..Scene::default() };
    let running = after(&scene);
    // Nothing, then 6 t, then 6: a speed of 3 + 6, and 1 + 3 + 3 metres.
    let marble = running.world.marbles.get(running.world.marbles.id(0).unwrap()).unwrap();
    assert!((marble.velocity.x - 9.0).abs() < 1e-9, "{} m/s", marble.velocity.x);
    assert!((marble.position.x - 7.0).abs() < 0.05, "{} m", marble.position.x);
}

#[test]
fn walls_convey_turn_and_swing() {
    let on = |position: [f64; 3]| MarbleDesc { position, radius: 0.1, ..MarbleDesc::default() };
    let moved = |motion: KinematicMotion, ball: MarbleDesc, seconds: f64| {
        let center = [0.0, -0.5, 0.0];
        let size = [20.0, 1.0, 20.0];
        let shape = ShapeDesc::Box { center, size, rotation: taw::scene::RotationDesc::default() };
        let wall = WallDesc { shape, material: None, motion: Some(motion) };
        after(&Scene {
            duration: seconds,
            material: rough(),
            walls: vec![wall],
            marbles: vec![ball],
            ..Scene::default()
        })
    };
    let first = |running: &taw::scene::Simulation<f64>| {
        running.world.marbles.get(running.world.marbles.id(0).unwrap()).unwrap()
    };

    // A ball that is put on a belt ends up rolling at two sevenths of its speed.
    let belt = KinematicMotion::Conveyor { velocity: [1.0, 0.0, 0.0] };
    let running = moved(belt, on([0.0, 0.1, 0.0]), 1.0);
    let speed = first(&running).velocity.x;
    assert!((speed - 2.0 / 7.0).abs() < 1e-3, "{speed} m/s");

    // A lift takes it along, and is where it should be.
    let lift = KinematicMotion::Oscillate {
        amplitude: [0.0, 0.3, 0.0],
        pivot: [0.0; 3],
        axis: [0.0, 1.0, 0.0],
        degrees: 0.0,
        period: 4.0,
    };
    let running = moved(lift, on([0.0, 0.1, 0.0]), 1.0);
    let height = first(&running).position.y;
    assert!((height - 0.4).abs() < 1e-3, "{height} m");

    // A turntable about a pivot: the wall comes round.
    let table = KinematicMotion::Rotate {
        pivot: [1.0, 0.0, 0.0],
        axis: [0.0, 3.0, 0.0],
        degrees_per_second: 90.0,
    };
    let running = moved(table, on([0.0, 5.0, 0.0]), 2.0);
    let WallShape::Solid(taw::shape::Shape::Obb(obb)) = running.world.walls.shapes()[0] else {
        panic!("it is a box")
    };
    assert!((obb.center.x - 2.0).abs() < 1e-9 && obb.center.z.abs() < 1e-9, "{:?}", obb.center);
    let motion = running.world.walls.motion(running.world.walls.id(0).unwrap()).unwrap().unwrap();
    assert!((motion.angular_velocity.y - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    // Its surface moves as the wall does.
    let point = Point3::new(0.0, 0.0, 0.0);
    assert!((motion.velocity_at(point).z - std::f64::consts::FRAC_PI_2).abs() < 1e-9);
}

#[test]
fn what_a_world_refuses_a_scene_refuses_by_name() {
    let run = |scene: Scene| scene.run::<f64>(impulse()).unwrap_err();
    let ball = MarbleDesc { radius: -1.0, ..MarbleDesc::default() };
    let error = run(Scene { marbles: vec![ball], ..Scene::default() });
    assert_eq!(error, Error::NotPositive { field: "radius", value: -1.0 });
    let error = run(Scene { duration: f64::NAN, ..Scene::default() });
    assert!(matches!(error, Error::NotPositive { field: "duration", .. }));
    let shape = ShapeDesc::HalfSpace { normal: [0.0; 3], point: [0.0; 3] };
    let error = run(Scene { walls: vec![WallDesc { shape, ..floor() }], ..Scene::default() });
    assert!(matches!(error, Error::NotUnit { .. }), "{error}");
    let axis = [0.0; 3];
    let motion = Some(KinematicMotion::Rotate { pivot: [0.0; 3], axis, degrees_per_second: 1.0 });
    let error = run(Scene { walls: vec![WallDesc { motion, ..floor() }], ..Scene::default() });
    assert!(matches!(error, Error::NotUnit { field: "axis", .. }), "{error}");
    let material = MaterialDesc { restitution: 2.0, ..MaterialDesc::default() };
    let error = run(Scene { material, walls: vec![floor()], ..Scene::default() });
    assert!(matches!(error, Error::OutOfRange { field: "restitution", .. }), "{error}");
}

#[cfg(feature = "serde")]
mod files {
    use super::*;

    const TEXT: &str = "(
    description: \"one of each\",
    duration: 2,
    gravity: (0, -1, 0),
    gravity_keyframes: [(time: 0.5, gravity: (1, 0, 0))],
    force_fields: [Drag(linear: 0.1), Attraction(center: (0, 0, 0), strength: -1)],
    material: (friction: 0.2),
    walls: [
        (shape: HalfSpace(normal: (0, 1, 0))),
        (shape: Ball(center: (0, 0, 0), radius: 1), motion: Some(Conveyor(velocity: (1, 0, 0)))),
        (shape: Capsule(from: (0, 0, 0), to: (0, 1, 0), radius: 1)),
        (
            shape: Box(center: (0, 0, 0), size: (1, 1, 1), rotation: (axis: (0, 0, 1), degrees: 30)),
            motion: Some(Oscillate(amplitude: (1, 0, 0), period: 2)),
        ),
    ],
    marbles: [(position: (0, 5, 0), radius: 0.5, angular_velocity: (0, 0, 1))],
    lattices: [(
        first: (position: (3, 3, 3), radius: 0.1),
        count: (2, 2, 2),
        pitch: (1, 1, 1),
    )],
)";

    #[test]
    fn come_back_as_they_were() {
        let scene: Scene = ron::from_str(TEXT).unwrap();
        assert_eq!(scene.all_marbles().count(), 9);
        assert_eq!(scene.material.friction, 0.2);
        assert_eq!(scene.marbles[0].density, 2500.0);
        let text = ron::to_string(&scene).unwrap();
        assert_eq!(ron::from_str::<Scene>(&text).unwrap(), scene);
        scene.run::<f32>(impulse()).unwrap();
    }

    #[test]
    fn are_refused_with_line_and_reason() {
        let refused = |from: &str, to: &str, line: usize, why: &str| {
            assert!(TEXT.contains(from));
            let error = ron::from_str::<Scene>(&TEXT.replacen(from, to, 1)).unwrap_err();
            assert_eq!(error.span.start.line, line, "{error}");
            assert!(error.to_string().contains(why), "{error}");
        };
        refused("duration: 2", "duration: 0", 3, "above zero");
        refused("linear: 0.1", "linear: -0.1", 6, "at least zero");
        refused("friction: 0.2", "frition: 0.2", 7, "frition");
        refused("normal: (0, 1, 0)", "normal: (0, 0, 0)", 9, "not zero");
        refused("size: (1, 1, 1)", "size: (1, 0, 1)", 13, "above zero");
        refused("radius: 0.5", "radius: NaN", 17, "above zero");
        refused("position: (0, 5, 0), ", "", 17, "position");
    }
}
