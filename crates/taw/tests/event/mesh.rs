//! `Response::EventDriven` on walls of many triangles: meshes and height fields.

use std::time::{Duration, Instant};

use cpu_time::ThreadTime;
use taw::prelude::*;
use taw::shape::{HeightField, Mesh};

const DT: f64 = 1.0 / 60.0;

fn world<S: Scalar>() -> World<S> {
    let mut world = World::default();
    let model = Model {
        response: Response::EventDriven,
        precision: Precision::Compensated,
        rotation: Rotation::Dynamic,
        ..Model::default()
    };
    world.set_model(model).unwrap();
    world
}

fn surface<S: Scalar>(restitution: f64, friction: f64) -> Material<S> {
    let (restitution, friction) = (S::from_f64(restitution), S::from_f64(friction));
    Material { restitution, friction, ..Material::default() }
}

/// A waving meadow of this many squares of two triangles along each side, six metres wide.
fn meadow(squares: u32) -> Mesh<f64> {
    let at = |i: u32| 6.0 * f64::from(i) / f64::from(squares) - 3.0;
    let height = |x: f64, z: f64| 0.1 * ((2.0 * x).sin() + (3.0 * z).cos());
    let side = squares + 1;
    let points = (0..side * side).map(|i| (at(i % side), at(i / side)));
    let points = points.map(|(x, z)| Point3::new(x, height(x, z), z)).collect();
    let corners = (0..squares * squares).flat_map(|i| {
        let a = i / squares * side + i % squares;
        [[a, a + side, a + 1], [a + 1, a + side, a + side + 1]]
    });
    Mesh::new(points, corners.collect()).unwrap()
}

/// Processor time of a second and a half on a large mesh: the least of five runs.
fn cost(response: Response) -> Duration {
    let run = || {
        let mut world = world::<f64>();
        world.set_model(Model { response, iterations: 8, ..world.model() }).unwrap();
        world.walls.insert(meadow(200)).unwrap();
        let marble = Marble {
            material: Some(surface(0.3, 0.5)),
            velocity: Vec3::new(0.7, 0.0, 0.3),
            ..Marble::new(Point3::new(0.1, 1.0, 0.2), 0.2)
        };
        world.marbles.insert(marble).unwrap();
        world.step(DT).unwrap(); // it builds what it looks things up in
        let begin = ThreadTime::now();
        for _ in 0..90 {
            world.step(DT).unwrap();
        }
        let at = world.marbles.position()[0];
        assert!(at.y > -0.2, "{response:?}: {at:?}");
        begin.elapsed()
    };
    (0..5).map(|_| run()).min().unwrap()
}

#[test]
fn a_ball_on_a_large_mesh_costs_a_few_times_what_it_does_by_impulses() {
    let [events, impulses] = [Response::EventDriven, Response::Impulse].map(cost);
    let times = events.as_secs_f64() / impulses.as_secs_f64();
    println!("{events:?}, {impulses:?}: {times}");
    // 5 to 16 times; when it looked at every triangle it was 90, for 2.5 ms a step.
    assert!(times < 40.0, "{events:?} for 90 steps, {times} times as long as by impulses");
}

/// Balls of many sizes over hills of that scale: every step ends, and nobody falls through.
fn over_hills<S: Scalar>(scale: f64) {
    for (radius, height) in [(0.2, 1.0), (0.2, 0.5), (1e-3, 0.5), (0.2 / scale, 1.0 / scale)] {
        let number = |x: f64| S::from_f64(x * scale);
        let mut world = world::<S>();
        let heights = (0..49).map(|i| number(0.3 * f64::from(i % 3))).collect();
        let corner = Point3::new(number(-9.0), number(-0.3), number(-9.0));
        let field = HeightField::new(corner, [number(3.0); 2], 7, heights).unwrap();
        world.walls.insert(field).unwrap();
        let marble = Marble {
            material: Some(surface(0.3, 0.5)),
            mass: Mass::Kilograms(S::one()),
            ..Marble::new(Point3::new(number(0.1), number(height), number(0.2)), number(radius))
        };
        if world.marbles.insert(marble).is_err() {
            continue; // too small a number for this scalar
        }
        for step in 0..60 {
            let begin = Instant::now();
            world.step(S::from_f64(DT)).unwrap();
            let took = begin.elapsed();
            assert!(took < Duration::from_secs(5), "{scale:e}, {radius}, step {step}: {took:?}");
            let at = world.marbles.position()[0];
            let gap = world.walls.shapes()[0].project_point(at).distance.as_f64() / scale;
            let rounding = 100.0 * S::epsilon().as_f64();
            assert!(
                gap > -1e-3 * radius - rounding,
                "{scale:e}, {radius}, step {step}: {at:?}, {gap:e}"
            );
        }
    }
}

#[test]
fn hills_of_any_size_hold_and_every_step_ends() {
    for scale in [1.0, 1e6, 1e15, 1e30] {
        over_hills::<f64>(scale);
        over_hills::<f32>(scale);
    }
    over_hills::<f64>(1e100);
}

/// A landscape of one square, which falls from one metre at its border z = 0 along z.
fn beside_a_slope<S: Scalar>(position: [f64; 3], velocity: [f64; 3]) -> World<S> {
    let mut world = world::<S>();
    let heights = [1.0, 1.0, 0.0, 0.0].map(S::from_f64).to_vec();
    let corner = Point3::from([S::zero(); 3]);
    world.walls.insert(HeightField::new(corner, [S::one(); 2], 2, heights).unwrap()).unwrap();
    let marble = Marble {
        material: Some(surface(1.0, 0.0)),
        velocity: velocity.map(S::from_f64).into(),
        ..Marble::new(position.map(S::from_f64).into(), S::from_f64(0.01))
    };
    world.marbles.insert(marble).unwrap();
    world
}

fn falls_beside_a_slope<S: Scalar>() {
    // Behind the slope, seen along its normal, but beside it.
    let mut world = beside_a_slope::<S>([0.5, 0.52, -0.08], [0.0; 3]);
    let mut free = world.clone();
    let slope = free.walls.id(0).unwrap();
    free.walls.remove(slope).unwrap();
    for _ in 0..12 {
        world.step(S::from_f64(DT)).unwrap();
        free.step(S::from_f64(DT)).unwrap();
        assert_eq!(world.marbles.position(), free.marbles.position());
    }
}

#[test]
fn a_ball_beside_a_height_field_falls_freely() {
    falls_beside_a_slope::<f64>();
    falls_beside_a_slope::<f32>();
}

/// The inside of half a pipe of so many facets, which falls by `slope` along x.
fn half_pipe(facets: u32, radius: f64, slope: f64) -> Mesh<f64> {
    let rim = |i: u32| std::f64::consts::PI * f64::from(i) / f64::from(facets);
    let point = |i: u32, x: f64| {
        let (sin, cos) = rim(i).sin_cos();
        Point3::new(x, -radius * sin - slope * x, radius * cos)
    };
    let points = (0..=facets).flat_map(|i| [point(i, -0.5), point(i, 0.5)]).collect();
    let corners = (0..facets).flat_map(|i| {
        let a = 2 * i;
        [[a, a + 1, a + 2], [a + 1, a + 3, a + 2]]
    });
    Mesh::new(points, corners.collect()).unwrap()
}

#[test]
fn a_ball_goes_down_a_half_pipe_of_facets_without_sinking_into_them() {
    let radius = 5e-3;
    let cases = [0.0, 0.3, 0.5, 0.7].into_iter().flat_map(|e| [(e, 0.0), (e, 0.3)]);
    let cases = cases.flat_map(|(e, mu)| (0..8).map(move |i| (e, mu, 1.1e-3 * f64::from(i))));
    for (restitution, friction, z) in cases {
        let mut world = world::<f64>();
        world.walls.insert(half_pipe(12, 15e-3, 0.05)).unwrap();
        let marble = Marble {
            material: Some(surface(restitution, friction)),
            mass: Mass::Kilograms(1.0),
            ..Marble::new(Point3::new(-0.4, 0.02 - 6e-3, z), radius)
        };
        world.marbles.insert(marble).unwrap();
        let mut energy = world.energy().total();
        for step in 0..60 {
            world.step(DT).unwrap();
            let name = format!("e {restitution}, mu {friction}, from {z}, step {step}");
            let now = world.energy().total();
            let at = world.marbles.position()[0];
            let deep = 1.0 - world.walls.shapes()[0].project_point(at).distance / radius;
            // As much of an overlap as may stay.
            assert!(deep < 4e-3, "{name}: {deep} of the radius deep");
            let gain = (now - energy) / (9.81 * radius);
            assert!(gain < 0.02, "{name}: gained {gain} of a lift by its radius");
            assert_eq!(world.stopped().count(), 0, "{name}");
            energy = now;
        }
    }
}

/// Balls that roll and bounce down one flank of a ridge are not inside for the other one, which is
/// straight behind it.
#[test]
fn balls_on_a_ridge_of_a_height_field_move_no_farther_than_they_fly() {
    let mut random = fastrand::Rng::with_seed(1);
    let mut fields = vec![(vec![3.75, 2.0, 2.0, 3.0], Point3::new(5.0, 3.0, -0.5))];
    fields.extend((0..200).map(|_| {
        let heights = (0..4).map(|_| 4.0 * random.f64()).collect();
        let at = Point3::new(3.5 + 2.0 * random.f64(), 4.0, -0.9 + 0.8 * random.f64());
        (heights, at)
    }));
    for (heights, at) in fields {
        let mut world = world::<f64>();
        let corner = Point3::new(3.0, -1.0, -1.0);
        let field = HeightField::new(corner, [3.0, 1.0], 2, heights.clone()).unwrap();
        world.walls.insert(field).unwrap();
        let marble = Marble { material: Some(surface(0.3, 0.5)), ..Marble::new(at, 0.25) };
        world.marbles.insert(marble).unwrap();
        for step in 0..90 {
            let (before, speed) = (world.marbles.position()[0], world.marbles.velocity()[0]);
            world.step(DT).unwrap();
            let fastest = speed.magnitude().max(world.marbles.velocity()[0].magnitude());
            let moved = (world.marbles.position()[0] - before).magnitude();
            assert!(
                moved <= (fastest + 9.81 * DT) * DT + 4e-3 * 0.25,
                "{heights:?}, {at:?}, step {step}: {moved}"
            );
        }
    }
}

/// It lands askew on thousands of faces: to ask all that are near for each that it rolls over would
/// take more than the budget of a step.
#[test]
fn a_large_ball_on_a_fine_mesh_finishes_its_steps() {
    let mut world = world::<f64>();
    world.walls.insert(meadow(400)).unwrap();
    let marble = Marble {
        material: Some(surface(0.0, 0.5)),
        velocity: Vec3::new(3.0, 0.0, 0.3),
        ..Marble::new(Point3::new(0.0, 1.25, 0.0), 1.0)
    };
    world.marbles.insert(marble).unwrap();
    for step in 0..12 {
        world.step(DT).unwrap();
        assert_eq!(world.stopped().count(), 0, "step {step}");
    }
}
