//! Scenes with a known outcome, under `Response::Impulse`.

use crate::draw::Draw;
use taw::contact::Contact;
use taw::prelude::*;
use taw::world::WallMotion;

const G: f64 = 9.81;

fn world<S: Scalar>(rotation: Rotation) -> World<S> {
    let mut world = World::default();
    let model = Model { response: Response::Impulse, rotation, ..Model::default() };
    world.set_model(model).unwrap();
    world
}

/// A world with one wall, tilted by this angle down toward +x.
fn slope<S: Scalar>(degrees: f64, rotation: Rotation) -> (World<S>, Vec3<S>, WallId) {
    let mut world = world(rotation);
    let (sin, cos) = degrees.to_radians().sin_cos();
    let normal = Vec3::new(S::from_f64(sin), S::from_f64(cos), S::zero());
    let wall = Plane::through(Point3::new(S::zero(), S::zero(), S::zero()), normal).unwrap();
    let id = world.walls.insert(wall).unwrap();
    (world, wall.normal(), id)
}

fn surface<S: Scalar>(restitution: f64, friction: f64) -> Material<S> {
    let (restitution, friction) = (S::from_f64(restitution), S::from_f64(friction));
    Material { restitution, friction, ..Material::default() }
}

/// A marble that touches a wall through the origin.
fn on<S: Scalar>(normal: Vec3<S>, radius: f64, material: Material<S>) -> Marble<S> {
    let radius = S::from_f64(radius);
    let material = Some(material);
    Marble { material, ..Marble::new(Point3::from_vec(normal * radius), radius) }
}

fn run<S: Scalar>(world: &mut World<S>, dt: f64, seconds: f64) {
    for _ in 0..(seconds / dt).round() as u32 {
        world.step(S::from_f64(dt)).unwrap();
    }
}

#[test]
fn a_sliding_ball_ends_up_rolling_at_five_sevenths_of_its_speed() {
    for dt in [1.0 / 30.0, 1.0 / 60.0, 1.0 / 240.0, 1e-3] {
        for heading in [0.0_f64, 0.3, 0.8, 2.0] {
            let (mut world, up, _) = slope::<f32>(0.0, Rotation::Dynamic);
            let toward = Vec3::new(heading.cos() as f32, 0.0, heading.sin() as f32);
            let marble = Marble { velocity: toward * 5.0, ..on(up, 0.5, surface(0.0, 0.3)) };
            let id = world.marbles.insert(marble).unwrap();
            // It rolls after 2 v / (7 µ g) = 0.485 s.
            run(&mut world, dt, 2.0);
            let Marble { velocity, angular_velocity: spin, .. } = world.marbles.get(id).unwrap();
            let exact = toward * (25.0 / 7.0);
            assert!((velocity - exact).magnitude() < 5e-5, "{velocity:?} in steps of {dt}");
            let slip = velocity + up.cross(spin) * 0.5;
            let slip = slip - up * slip.dot(up);
            assert!(slip.magnitude() < 1e-5, "it slips by {slip:?} in steps of {dt}");
            let astray = velocity.cross(toward).magnitude() / velocity.magnitude();
            // Each addition to the velocity rounds, this way or that.
            let tolerance = f32::EPSILON * (2.0 / dt).sqrt() as f32;
            assert!(astray < tolerance, "{astray} rad off its heading {heading} in steps of {dt}");
        }
    }
}

#[test]
fn a_ball_rolls_down_a_slope_with_five_sevenths_of_the_pull() {
    for dt in [1.0 / 60.0, 1e-3] {
        let (mut world, up, _) = slope::<f64>(20.0, Rotation::Dynamic);
        let id = world.marbles.insert(on(up, 0.5, surface(0.0, 0.5))).unwrap();
        run(&mut world, dt, 4.0);
        let Marble { velocity, angular_velocity: spin, .. } = world.marbles.get(id).unwrap();
        let exact = 5.0 / 7.0 * G * 20_f64.to_radians().sin() * 4.0;
        assert!((velocity.magnitude() / exact - 1.0).abs() < 1e-9, "{velocity:?}, not {exact}");
        assert!((spin.magnitude() * 0.5 / exact - 1.0).abs() < 1e-9, "{spin:?}");
    }
}

/// Solid ball: `7/5 m a = m g (sin - resistance cos)`, as the resistance is a torque of that part of
/// the radius times the normal force.
#[test]
fn rolling_resistance_holds_up_to_its_tangent_and_brakes_beyond_it() {
    let mut draw = Draw(6);
    for case in 0..1_000 {
        let (degrees, resistance) = (draw.between(1.0, 20.0), draw.between(0.01, 0.5));
        let (sin, cos) = degrees.to_radians().sin_cos();
        let pull = G * (sin - resistance * cos);
        if pull.abs() < 0.1 {
            continue;
        }
        let (dt, iterations) = (draw.between(1e-3, 1.0 / 30.0), [1, 2, 8, 50][case % 4]);
        let (mut world, up, _) = slope::<f64>(degrees, Rotation::Dynamic);
        world.set_model(Model { iterations, ..world.model() }).unwrap();
        let material = Material { rolling_resistance: resistance, ..surface(0.0, 1.0) };
        let start = on(up, draw.between(0.01, 1.0), material);
        let id = world.marbles.insert(start).unwrap();
        let steps = 60;
        for _ in 0..steps {
            world.step(dt).unwrap();
        }
        let Marble { position, velocity, .. } = world.marbles.get(id).unwrap();
        let name = format!("{degrees}°, {resistance}, {iterations} iterations of {dt} s");
        let (moved, time) = ((position - start.position).magnitude(), f64::from(steps) * dt);
        if pull < 0.0 {
            // A part of what gravity does in the first substep.
            assert!(moved < 1e-3 * G * dt * dt, "{name}: crept {moved} m");
        } else {
            let exact = 5.0 / 7.0 * pull * time;
            // Too few iterations lag by a substep's pull.
            let error = (velocity.magnitude() - exact).abs();
            assert!(error < G * sin * dt, "{name}: {} m/s, not {exact}", velocity.magnitude());
        }
    }
}

/// Two balls that meet, stick and stop rolling on each other: one iteration ends where a thousand end.
#[test]
fn slip_and_rolling_of_a_pair_end_in_one_iteration() {
    let mut draw = Draw(8);
    let mut blocked = 0;
    for case in 0..1_000 {
        let radii = [draw.between(0.05, 1.0), draw.between(0.05, 1.0)];
        let mut vector = |size: f64| Vec3::from([0; 3].map(|_: i32| draw.between(-size, size)));
        let axis = vector(1.0).normalize();
        let spins = [vector(2.0), vector(2.0)];
        let across = vector(0.1);
        let masses = [draw.between(0.1, 10.0), draw.between(0.1, 10.0)];
        let material = Material { rolling_resistance: 1.0, ..surface(0.0, 1.5) };
        let after = |iterations| {
            let mut world = world::<f64>(Rotation::Dynamic);
            world.set_gravity(Vec3::from([0.0; 3])).unwrap();
            world.set_model(Model { iterations, ..world.model() }).unwrap();
            let ids = [0, 1].map(|i| {
                let side = if i == 0 { -1.0 } else { 1.0 };
                let marble = Marble {
                    velocity: axis * -side * 4.0 + across * side,
                    angular_velocity: spins[i],
                    // One stands as firm as a wall, or does not turn.
                    mass: if case % 5 == 0 && i == 0 {
                        Mass::Infinite
                    } else {
                        Mass::Kilograms(masses[i])
                    },
                    rotation_model: (case % 5 == 1 && i == 0).then_some(Rotation::None),
                    material: Some(material),
                    ..Marble::new(Point3::from_vec(axis * (side * radii[i] * 0.999)), radii[i])
                };
                world.marbles.insert(marble).unwrap()
            });
            world.step(1e-3).unwrap();
            ids.map(|id| world.marbles.get(id).unwrap())
        };
        let (once, often) = (after(1), after(1000));
        let spin = often[1].angular_velocity - often[0].angular_velocity;
        if spin.cross(axis).magnitude() > 1e-3 {
            continue; // more than rolling friction can bear
        }
        blocked += 1;
        for (x, y) in once.iter().zip(&often) {
            let error = (x.velocity - y.velocity).magnitude()
                + (x.angular_velocity - y.angular_velocity).magnitude();
            assert!(error < 1e-6, "{case}: {x:?}, not {y:?}");
        }
    }
    assert!(blocked > 300, "{blocked}");
}

#[test]
fn no_spin_is_too_fast() {
    // 8 mm on 10 degrees up to 5 m/s, 625 rad/s: many engines stop at 47.1 rad/s.
    let (mut world, up, _) = slope::<f32>(10.0, Rotation::Dynamic);
    let id = world.marbles.insert(on(up, 0.008, surface(0.0, 0.5))).unwrap();
    let pull = 5.0 / 7.0 * G * 10_f64.to_radians().sin();
    let seconds = (5.0 / pull * 60.0).round() / 60.0;
    run(&mut world, 1.0 / 60.0, seconds);
    let speed = f64::from(world.marbles.get(id).unwrap().velocity.magnitude());
    assert!((speed / (pull * seconds) - 1.0).abs() < 1e-4, "{speed} m/s");
}

#[test]
fn too_little_friction_lets_it_slip() {
    let (mut world, up, _) = slope::<f64>(60.0, Rotation::Dynamic);
    let id = world.marbles.insert(on(up, 0.5, surface(0.0, 0.45))).unwrap();
    run(&mut world, 1.0 / 60.0, 1.0);
    let Marble { velocity, angular_velocity: spin, .. } = world.marbles.get(id).unwrap();
    let (sin, cos) = 60_f64.to_radians().sin_cos();
    assert!((velocity.magnitude() / (G * (sin - 0.45 * cos)) - 1.0).abs() < 1e-9);
    assert!((spin.magnitude() / (2.5 * 0.45 * G * cos / 0.5) - 1.0).abs() < 1e-9);
}

#[test]
fn without_rotation_friction_holds_what_does_not_slide() {
    for (friction, holds) in [(0.4, true), (0.3, false)] {
        let (mut world, up, _) = slope::<f64>(20.0, Rotation::None); // tan 20° = 0.364
        let id = world.marbles.insert(on(up, 0.5, surface(0.0, friction))).unwrap();
        run(&mut world, 1.0 / 60.0, 2.0);
        let speed = world.marbles.get(id).unwrap().velocity.magnitude();
        assert_eq!(speed < 1e-9, holds, "friction {friction}: {speed} m/s");
    }
}

#[test]
fn a_marble_rests_under_every_integrator() {
    for integrator in Integrator::ALL {
        for radius in [0.008, 0.5, 100.0] {
            let (mut world, up, _) = slope::<f32>(0.0, Rotation::Dynamic);
            world.set_model(Model { integrator, ..world.model() }).unwrap();
            let id = world.marbles.insert(on(up, radius, surface(0.5, 0.3))).unwrap();
            for step in 0..600 {
                world.step(1.0 / 60.0).unwrap();
                let Marble { position, velocity, .. } = world.marbles.get(id).unwrap();
                let height = f64::from(position.y) / radius - 1.0;
                let at = format!("{integrator:?}, radius {radius}, step {step}");
                assert!((-0.006..0.001).contains(&height), "{at}: off by {height} of its radius");
                assert!(velocity.magnitude() < 1e-3 * radius.sqrt() as f32, "{at}: {velocity:?}");
            }
        }
    }
}

#[test]
fn rolling_is_only_for_show() {
    let end = [Rotation::None, Rotation::Rolling].map(|rotation| {
        let (mut world, up, _) = slope::<f64>(0.0, rotation);
        let velocity = Vec3::new(3.0, 0.0, 0.0);
        let marble = Marble { velocity, ..on(up, 0.5, surface(0.0, 0.2)) };
        let id = world.marbles.insert(marble).unwrap();
        run(&mut world, 1.0 / 60.0, 1.0);
        world.marbles.get(id).unwrap().velocity
    });
    assert!((end[0].x - (3.0 - 0.2 * G)).abs() < 1e-9, "{:?}", end[0]);
    assert_eq!(end[0], end[1]);
}

#[test]
fn balls_of_any_mass_exchange_momentum_as_they_should() {
    for (masses, e) in [([1.0, 1.0], 1.0), ([1.0, 3.0], 1.0), ([2.0, 1.0], 0.5), ([1.0, 1e6], 0.0)]
    {
        let mut world = world::<f64>(Rotation::Dynamic);
        world.set_gravity(Vec3::new(0.0, 0.0, 0.0)).unwrap();
        let ids = [(0.0, 2.0), (1.5, -1.0)].map(|(x, v)| {
            let index = usize::from(x > 0.0);
            let marble = Marble {
                velocity: Vec3::new(v, 0.0, 0.0),
                mass: Mass::Kilograms(masses[index]),
                material: Some(surface(e, 0.3)),
                ..Marble::new(Point3::new(x, 0.0, 0.0), 0.5)
            };
            world.marbles.insert(marble).unwrap()
        });
        run(&mut world, 1.0 / 60.0, 1.0);
        let after = ids.map(|id| world.marbles.get(id).unwrap().velocity.x);
        let center = (2.0 * masses[0] - masses[1]) / (masses[0] + masses[1]);
        let exact = [center - e * (2.0 - center), center - e * (-1.0 - center)];
        for (after, exact) in after.into_iter().zip(exact) {
            assert!((after - exact).abs() < 1e-9, "{masses:?}, e = {e}: {after}, not {exact}");
        }
    }
}

#[test]
fn a_cradle_with_gaps_passes_the_speed_on() {
    let mut world = world::<f32>(Rotation::None);
    world.set_gravity(Vec3::new(0.0, 0.0, 0.0)).unwrap();
    let ids = [0, 1, 2, 3, 4].map(|i| {
        let marble = Marble {
            velocity: Vec3::new(if i == 0 { 1.0 } else { 0.0 }, 0.0, 0.0),
            material: Some(surface(1.0, 0.0)),
            ..Marble::new(Point3::new(i as f32 * 1.01, 0.0, 0.0), 0.5)
        };
        world.marbles.insert(marble).unwrap()
    });
    run(&mut world, 1.0 / 240.0, 1.0);
    let speeds = ids.map(|id| world.marbles.get(id).unwrap().velocity.x);
    for (speed, exact) in speeds.into_iter().zip([0.0, 0.0, 0.0, 0.0, 1.0]) {
        assert!((speed - exact).abs() < 1e-5, "{speeds:?}");
    }
}

#[test]
fn a_bounce_gives_back_its_part_of_the_speed() {
    for e in [0.0, 0.3, 0.8, 1.0] {
        let (mut world, up, _) = slope::<f64>(0.0, Rotation::None);
        let marble =
            Marble { position: Point3::new(0.0, 1.5, 0.0), ..on(up, 0.5, surface(e, 0.0)) };
        let id = world.marbles.insert(marble).unwrap();
        let (mut impact, mut rebound) = (0.0_f64, 0.0_f64);
        for _ in 0..600 {
            world.step(1e-3).unwrap();
            let v = world.marbles.get(id).unwrap().velocity.y;
            if rebound == 0.0 {
                impact = impact.min(v);
            }
            rebound = rebound.max(v);
        }
        // The step of the impact adds its gravity before the bounce takes it.
        assert!((rebound + e * impact).abs() <= G * 1e-3 * 1.001, "{e}: {impact} to {rebound}");
    }
}

#[test]
fn walls_carry_along_what_lies_on_them() {
    // A conveyor; no rotation, so that the marble cannot roll on it.
    let (mut world, up, wall) = slope::<f64>(0.0, Rotation::None);
    let motion = WallMotion {
        velocity: Vec3::new(0.7, 0.0, 0.0),
        angular_velocity: Vec3::new(0.0, 0.0, 0.0),
        pivot: Point3::new(0.0, 0.0, 0.0),
    };
    world.walls.set_motion(wall, Some(motion)).unwrap();
    let id = world.marbles.insert(on(up, 0.5, surface(0.0, 0.3))).unwrap();
    run(&mut world, 1.0 / 60.0, 1.0);
    assert!((world.marbles.get(id).unwrap().velocity.x - 0.7).abs() < 1e-9);

    // A lift: the marble rises with it and stays on it.
    let lift = WallMotion { velocity: Vec3::new(0.0, 2.0, 0.0), ..motion };
    world.walls.set_motion(wall, Some(lift)).unwrap();
    for step in 1..=60 {
        let height = 2.0 * f64::from(step) / 60.0;
        world.walls.set(wall, Plane::new(Vec3::unit_y(), height).unwrap()).unwrap();
        world.step(1.0 / 60.0).unwrap();
    }
    let marble = world.marbles.get(id).unwrap();
    assert!((marble.position.y - 2.5).abs() < 1e-9 && (marble.velocity.y - 2.0).abs() < 1e-9);
}

/// Kinetic and potential energy of all marbles, in joules.
fn energy(world: &World<f64>) -> f64 {
    let ids = (0..world.marbles.len()).filter_map(|row| world.marbles.id(row));
    ids.map(|id| {
        let m = world.marbles.get(id).unwrap();
        let mass = m.mass.of(m.radius);
        let rim = m.angular_velocity.magnitude() * m.radius;
        mass * (0.5 * m.velocity.magnitude2() + 0.2 * rim * rim + G * m.position.y)
    })
    .sum()
}

#[test]
fn the_residual_says_how_far_the_contacts_are_from_agreeing() {
    let residual = |iterations| {
        let (mut world, ..) = slope::<f64>(0.0, Rotation::Dynamic);
        world.set_model(Model { iterations, ..world.model() }).unwrap();
        for i in 0..10_u8 {
            let marble = Marble {
                position: Point3::new(0.0, 0.5 + f64::from(i), 0.0),
                ..on(Vec3::unit_y(), 0.5, surface(0.0, 0.3))
            };
            world.marbles.insert(marble).unwrap();
        }
        world.step(1.0 / 60.0).unwrap();
        world.residual()
    };
    let [few, more, many] = [2, 8, 100].map(residual);
    assert!(few > 0.02, "a tower of ten is not held in two sweeps: {few} m/s");
    // Below a hundred-thousandth of the speed that bounces, sweeps go on without search.
    assert!(more < few && many < 1e-5, "{few}, {more}, {many} m/s");
}

/// A heap of 150 balls after a minute, in which it gained no energy. Rolling resistance in metres.
fn settled_heap(rolling_resistance: f64) -> World<f64> {
    let (mut world, ..) = slope::<f64>(0.0, Rotation::Dynamic);
    for (normal, offset) in [
        (Vec3::unit_x(), -2.0),
        (-Vec3::unit_x(), -2.0),
        (Vec3::unit_z(), -2.0),
        (-Vec3::unit_z(), -2.0),
    ] {
        world.walls.insert(Plane::new(normal, offset).unwrap()).unwrap();
    }
    for i in 0..150_u32 {
        let at = |n: u32| f64::from(n) - 1.0 + f64::from(i * 7 % 10) / 50.0;
        let position = Point3::new(at(i % 3), 1.0 + f64::from(i / 9) * 1.1, at(i / 3 % 3));
        let radius = 0.3 + 0.2 * f64::from(i * 13 % 17) / 17.0;
        let material = Some(Material { rolling_resistance, ..surface(0.2, 0.3) });
        world.marbles.insert(Marble { material, ..Marble::new(position, radius) }).unwrap();
    }
    let mut last = energy(&world);
    let start = last;
    for step in 0..3600 {
        world.step(1.0 / 60.0).unwrap();
        let now = energy(&world);
        // Pushing overlap apart lifts what lies on it, by less than it fell to overlap.
        assert!(now <= last + 1e-4 * start, "step {step}: from {last} J to {now} J");
        last = now;
    }
    world
}

#[test]
fn a_heap_gains_no_energy_and_comes_to_rest() {
    // Where nothing resists rolling, a few are still on their way after a minute, and shake those that
    // they lean on, by more or less from heap to heap: of six, up to six rolled, and the 140 slowest
    // moved at 1e-16 to 1e-8 m/s.
    for (rolling_resistance, fastest) in [(0.001, 1e-12), (0.0, 0.02)] {
        let mut world = settled_heap(rolling_resistance);
        let mut speeds: Vec<_> = world.marbles.velocity().iter().map(|v| v.magnitude()).collect();
        speeds.sort_by(f64::total_cmp);
        assert!(speeds[149] < fastest, "the ten fastest: {:?}", &speeds[140..]);
        // What the solver leaves on purpose: a two-hundredth of the smaller radius.
        world.generate_contacts();
        let contacts = world.contacts.wm.iter().chain(&world.contacts.mm);
        let deepest = contacts.map(Contact::penetration).fold(0.0, f64::max);
        assert!(deepest < 0.0051 * 0.5, "the deepest overlap is {deepest} m");
    }
}

#[test]
fn friction_in_several_contacts_at_once_gains_nothing() {
    // Newton's restitution alone made 1.36 times the energy of the first of these.
    for spin in [0.0, 10.0, -40.0] {
        for speed in [0.3, 1.0, 4.0] {
            let (mut world, up, _) = slope::<f64>(0.0, Rotation::Dynamic);
            world.set_gravity(Vec3::zero()).unwrap();
            let first = on(up, 0.5, surface(1.0, 1.0));
            let velocity = Vec3::new(speed, -1.0, 0.0);
            let first = Marble { velocity, angular_velocity: Vec3::unit_z() * spin, ..first };
            let second = Point3::new(1.0, 0.5, 0.0);
            let velocity = Vec3::new(-speed, 0.0, 0.0);
            world.marbles.insert(first).unwrap();
            world.marbles.insert(Marble { position: second, velocity, ..first }).unwrap();
            let before = world.energy().total();
            for step in 0..20 {
                world.step(1e-3).unwrap();
                let left = world.energy().total() / before;
                assert!(left <= 1.0 + 1e-9, "{left} of it at {speed} m/s and {spin} rad/s");
                // What would gain rebounds as far as it gains nothing, and no less.
                assert!(spin != 0.0 || left >= 1.0 - 1e-9, "{left} of it after {step} steps");
            }
        }
    }
}

#[test]
fn eight_iterations_solve_a_heavy_ball_on_a_light_one_just_above_a_floor() {
    // Three contacts, of which the heavy ball's with the floor comes to bear nothing. Sweeps alone
    // take as many iterations as the masses are apart.
    for ratio in [2.0, 33.0, 400.0, 1000.0] {
        for light in [0.001, 0.004, 0.005] {
            let mut world = World::<f64>::default();
            world.set_model(Model { response: Response::Impulse, ..Model::default() }).unwrap();
            world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
            let balls = [(light, light, 1.0), (2.0 * light + 0.016, 0.016, ratio)];
            let ids = balls.map(|(height, radius, mass)| {
                let ball = Marble::new(Point3::new(0.0, height, 0.0), radius);
                world.marbles.insert(Marble { mass: Mass::Kilograms(mass), ..ball }).unwrap()
            });
            world.step(1.0 / 30.0).unwrap();
            for id in ids {
                let speed = world.marbles.get(id).unwrap().velocity.magnitude();
                assert!(speed < 1e-6, "{ratio} times as heavy, {light} m: {speed} m/s");
            }
        }
    }
}
