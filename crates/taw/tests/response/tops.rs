//! Balls that fall exactly onto the top of others tip over.

use taw::prelude::*;
use taw::shape::Plane;

const DT: f64 = 1.0 / 60.0;
const RADIUS: f64 = 0.1;

fn models() -> Vec<(&'static str, Model)> {
    let impulse = |detection| {
        let (response, rotation) = (Response::Impulse, Rotation::Dynamic);
        Model { response, rotation, detection, ..Model::default() }
    };
    let springs = |law| {
        let (response, rotation) = (Response::Penalty(law), Rotation::Dynamic);
        Model { response, rotation, substeps: 4, ..Model::default() }
    };
    vec![
        ("displacement", Model::default()),
        ("impulse, discrete", impulse(Detection::Discrete)),
        ("impulse, swept", impulse(Detection::Swept)),
        ("spring and dashpot", springs(ContactLaw::SpringDashpot)),
        ("Hertz and Mindlin", springs(ContactLaw::HertzMindlin)),
        ("event-driven", Model::EXACT),
        ("soft step", Model::GAME),
    ]
}

fn world<S: Scalar>(model: Model) -> World<S> {
    let mut world = World::default();
    world.set_model(model).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_y(), S::zero()).unwrap()).unwrap();
    world
}

fn insert<S: Scalar>(world: &mut World<S>, height: f64, material: Material<S>) {
    let at = [0.0, height, 0.0].map(S::from_f64).into();
    let marble = Marble { material: Some(material), ..Marble::new(at, S::from_f64(RADIUS)) };
    world.marbles.insert(marble).unwrap();
}

fn height<S: Scalar>(world: &World<S>) -> f64 {
    world.marbles.position().iter().map(|p| p.y.as_f64()).fold(0.0, f64::max)
}

/// A column of a hundred would be twenty metres high.
fn a_spawner_makes_a_heap<S: Scalar>() {
    for (name, model) in models() {
        let mut world = world::<S>(model);
        for _ in 0..100 {
            insert(&mut world, 8.0, Material::default());
            for _ in 0..12 {
                world.step(S::from_f64(DT)).unwrap();
            }
        }
        // The last one bounces for some seconds.
        for _ in 0..300 {
            world.step(S::from_f64(DT)).unwrap();
        }
        let height = height(&world);
        println!("{name}: {height} m");
        assert!(height < 0.5, "{name}: {height} m high");
    }
}

#[test]
fn a_hundred_dropped_at_one_point_make_no_column() {
    a_spawner_makes_a_heap::<f32>();
    a_spawner_makes_a_heap::<f64>();
}

/// Without friction too, and whatever bounces: to tip takes its energy from the fall.
#[test]
fn one_that_falls_on_another_tips_over_and_gains_nothing() {
    for (name, model) in models() {
        for (friction, restitution) in [(0.0, 0.0), (0.0, 1.0), (0.5, 0.5)] {
            let mut world = world::<f64>(model);
            let material = Material { friction, restitution, ..Material::default() };
            insert(&mut world, RADIUS, material);
            insert(&mut world, 1.0, material);
            // Sleep holds what leans by less than a twentieth of its radius for half a second.
            for row in 0..2 {
                let id = world.marbles.id(row).unwrap();
                world.marbles.set_sleeping_disabled(id, true).unwrap();
            }
            let most = world.energy().total() * (1.0 + 1e-3);
            // Elastic impacts by these gain 2.6 and .5 % on a vertical line, too, where nothing tips.
            let errs = restitution == 1.0
                && (name == "impulse, discrete" || matches!(model.response, Response::Penalty(_)));
            let mut aside: f64 = 0.0;
            for step in 0..300 {
                world.step(DT).unwrap();
                let energy = world.energy().total();
                assert!(
                    errs || energy <= most,
                    "{name}, {friction}, {restitution}: {energy} of {most} J, {step}"
                );
                let at = world.marbles.position();
                aside = aside.max((at[1].x - at[0].x).hypot(at[1].z - at[0].z));
            }
            assert!(aside > RADIUS, "{name}, {friction}, {restitution}: {aside} m aside");
        }
    }
}

/// A column of balls that were placed onto each other stays.
#[test]
fn a_column_that_was_placed_stays() {
    for (name, model) in models() {
        let mut world = world::<f64>(model);
        for number in 0..4_u8 {
            insert(&mut world, RADIUS * (1.0 + 2.0 * f64::from(number)), Material::default());
        }
        for _ in 0..300 {
            world.step(DT).unwrap();
        }
        let height = height(&world);
        // Springs give way by a part of the substep's fall.
        assert!(height > 6.0 * RADIUS, "{name}: {height} m high");
    }
}
