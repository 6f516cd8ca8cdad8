//! Periodic boxes: nothing tells where their sides are.

use cgmath::InnerSpace;
use taw::Error;
use taw::prelude::*;

const SIDE: f64 = 4.01;

fn models() -> Vec<Model> {
    let elastic = Model { rotation: Rotation::None, ..Model::default() };
    let responses = [
        Response::Displacement,
        Response::Impulse,
        Response::Penalty(ContactLaw::SpringDashpot),
        Response::Penalty(ContactLaw::HertzMindlin),
        Response::EventDriven,
    ];
    let with = |detection| responses.map(|response| Model { response, detection, ..elastic });
    [with(Detection::Discrete), with(Detection::Swept)].concat()
}

/// Smooth balls without gravity in a cube that all of its sides are open to.
fn world<S: Scalar>(model: Model) -> World<S> {
    let mut world = World::default();
    world.set_model(model).unwrap();
    world.set_gravity(Vec3::new(S::zero(), S::zero(), S::zero())).unwrap();
    world.set_period([Some(S::from_f64(SIDE)); 3]).unwrap();
    world
}

fn ball<S: Scalar>(at: [f64; 3], velocity: [f64; 3], radius: f64, restitution: f64) -> Marble<S> {
    let restitution = S::from_f64(restitution);
    let material = Material { restitution, friction: S::zero(), ..Material::default() };
    Marble {
        velocity: Vec3::from(velocity).map(S::from_f64),
        material: Some(material),
        ..Marble::new(Point3::from(at).map(S::from_f64), S::from_f64(radius))
    }
}

/// Balls at random places that do not overlap, moved by `shift`.
fn gas<S: Scalar>(model: Model, shift: [f64; 3], restitution: f64, seed: u64) -> World<S> {
    let mut world = world(model);
    let mut random = fastrand::Rng::with_seed(seed);
    let mut placed: Vec<([f64; 3], f64)> = Vec::new();
    while placed.len() < 30 {
        let at = [(); 3].map(|()| (random.f64() - 0.5) * SIDE);
        let radius = 0.15 + 0.25 * random.f64();
        let velocity = [(); 3].map(|()| random.f64() * 4.0 - 2.0);
        let far = |(other, its): &([f64; 3], f64)| {
            let way = [0, 1, 2].map(|i| {
                let way: f64 = other[i] - at[i];
                way - (way / SIDE).round() * SIDE
            });
            Vec3::from(way).magnitude() > radius + its + 1e-3
        };
        if placed.iter().all(far) {
            placed.push((at, radius));
            let at = [0, 1, 2].map(|i| at[i] + shift[i]);
            world.marbles.insert(ball(at, velocity, radius, restitution)).unwrap();
        }
    }
    world
}

/// The longest way between where the balls of two worlds are, but for a shift.
fn off<S: Scalar>(world: &World<S>, other: &World<S>, shift: [f64; 3]) -> f64 {
    let pairs = world.marbles.position().iter().zip(other.marbles.position());
    let way = |(p, q): (&Point3<S>, &Point3<S>)| {
        let way = [0, 1, 2].map(|i| {
            let way = q[i].as_f64() - p[i].as_f64() - shift[i];
            way - (way / SIDE).round() * SIDE
        });
        Vec3::from(way).magnitude()
    };
    pairs.map(way).fold(0.0, f64::max)
}

#[test]
fn nothing_tells_where_the_sides_are() {
    let shift = [0.37 * SIDE, 0.5 * SIDE, -0.81 * SIDE];
    for model in models() {
        for seed in 0..10 {
            let restitution = [0.0, 0.5, 1.0][seed as usize % 3];
            let mut here = gas::<f64>(model, [0.0; 3], restitution, seed);
            let mut there = gas::<f64>(model, shift, restitution, seed);
            let momentum = here.momentum();
            for _ in 0..60 {
                here.step(1.0 / 60.0).unwrap();
                there.step(1.0 / 60.0).unwrap();
            }
            let off = off(&here, &there, shift);
            // A millionfold growth of rounding leaves this in a second of collisions.
            assert!(off < 1e-6, "{model:?}, seed {seed}: {off} m apart");
            for p in here.marbles.position() {
                assert!([p.x, p.y, p.z].iter().all(|x| x.abs() <= SIDE / 2.0), "{p:?} is outside");
            }
            let lost = (here.momentum() - momentum).magnitude();
            let knows_masses = model.response != Response::Displacement;
            assert!(
                !knows_masses || lost < 1e-9 * momentum.magnitude().max(1.0),
                "{model:?}: {lost} kg m/s"
            );
        }
    }
}

#[test]
fn balls_collide_across_a_side_as_in_the_middle() {
    for model in models() {
        for axis in 0..3 {
            let at = |x: f64| {
                let mut at = [0.1, 0.2, 0.3];
                at[axis] = x;
                at
            };
            let run = |middle: f64| {
                let mut world = world::<f32>(model);
                let velocity = [0, 1, 2].map(|i| if i == axis { 3.0 } else { 0.0 });
                world.marbles.insert(ball(at(middle - 0.6), velocity, 0.5, 1.0)).unwrap();
                world.marbles.insert(ball(at(middle + 0.6), [0.0; 3], 0.5, 1.0)).unwrap();
                for _ in 0..20 {
                    world.step(1.0 / 60.0).unwrap();
                }
                world
            };
            let (inside, across) = (run(0.0), run(SIDE / 2.0));
            let velocity = across.marbles.velocity();
            let least = if model.response == Response::Displacement { 1.0 } else { 2.0 };
            assert!(velocity[1][axis] > least, "{model:?}: they passed: {velocity:?}");
            let mut shift = [0.0; 3];
            shift[axis] = SIDE / 2.0;
            let off = off(&inside, &across, shift);
            assert!(off < 1e-4, "{model:?}: {off} m apart");
        }
    }
}

#[test]
fn a_gas_of_elastic_balls_keeps_energy_and_momentum() {
    let model = Model { response: Response::EventDriven, ..models()[0] };
    let mut gas = gas::<f64>(model, [0.0; 3], 1.0, 1);
    let (energy, momentum) = (gas.energy().total(), gas.momentum());
    let mut collisions = 0;
    for _ in 0..600 {
        gas.step(1.0 / 60.0).unwrap();
        collisions += gas.impacts().len();
    }
    assert!(collisions > 100, "{collisions}");
    assert!((gas.energy().total() / energy - 1.0).abs() < 1e-10);
    assert!((gas.momentum() - momentum).magnitude() < 1e-10 * gas.energy().total().sqrt());
}

#[test]
fn a_heap_lies_across_a_side_as_in_the_middle() {
    // Displacement knows no masses, which would hold the lower balls.
    for model in models().into_iter().filter(|m| m.response != Response::Displacement) {
        let height = |middle: f64| {
            let mut world = world::<f64>(Model { substeps: 8, ..model });
            world.set_period([Some(SIDE), None, Some(SIDE)]).unwrap();
            world.set_gravity(Vec3::new(0.0, -9.81, 0.0)).unwrap();
            for (x, z) in [(-0.4, -0.4), (0.4, -0.4), (-0.4, 0.4), (0.4, 0.4)] {
                let still = ball([middle + x, 0.4, middle + z], [0.0; 3], 0.4, 0.0);
                world.marbles.insert(Marble { mass: Mass::Infinite, ..still }).unwrap();
            }
            let top = ball([middle, 1.0, -middle], [0.0; 3], 0.4, 0.0);
            let top = world.marbles.insert(top).unwrap();
            for _ in 0..240 {
                world.step(1.0 / 60.0).unwrap();
            }
            world.marbles.get(top).unwrap().position.y
        };
        let (inside, across) = (height(0.0), height(SIDE / 2.0));
        assert!(inside > 0.9, "{model:?}: {inside}");
        assert!((across - inside).abs() < 1e-9, "{model:?}: {across}, not {inside}");
    }
}

#[test]
fn what_does_not_fit_is_refused_and_nothing_changes() {
    let mut world = world::<f64>(models()[1]);
    let id = world.marbles.insert(ball([0.0; 3], [1.0, 0.0, 0.0], 0.5, 1.0)).unwrap();
    let before = world.clone();
    let short = Error::OutOfRange { field: "period.y", value: 4.0, min: 4.01, max: f64::MAX };
    assert_eq!(world.set_period([None, Some(4.0), None]), Err(short));
    let none = Error::NotPositive { field: "period.x", value: 0.0 };
    assert_eq!(world.set_period([Some(0.0), None, None]), Err(none));
    assert_eq!(world, before);
    // Those that come or grow later are refused by the step.
    world.marbles.set_radius(id, 0.6).unwrap();
    let before = world.clone();
    let short =
        Error::OutOfRange { field: "period.x", value: 4.01, min: 0.6 * 8.02, max: f64::MAX };
    assert_eq!(world.step(1.0 / 60.0), Err(short));
    assert_eq!(world, before);
    world.marbles.set_radius(id, 0.5).unwrap();
    let capsule = Marble { half_length: 0.2, ..Marble::new(Point3::new(0.0, 1.0, 0.0), 0.2) };
    let id = world.marbles.insert(capsule).unwrap();
    assert_eq!(world.step(1.0 / 60.0), Err(Error::UnsupportedShape(id)));
    assert_eq!(world.set_period([Some(8.0); 3]), Err(Error::UnsupportedShape(id)));
    world.set_period([None; 3]).unwrap();
    world.step(1.0 / 60.0).unwrap();
}
