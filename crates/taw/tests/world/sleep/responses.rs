//! Sleep by the other methods: sequential impulses, penalty forces, projection.

use super::*;
use taw::response::ContactLaw;
use taw::world::Damping;

/// The last one lets all sleep or none.
const RESPONSES: [Response; 5] = [
    Response::Impulse,
    Response::Displacement,
    Response::Penalty(ContactLaw::SpringDashpot),
    Response::Penalty(ContactLaw::HertzMindlin),
    Response::EventDriven,
];

/// Runs a test by each of these methods.
fn by(responses: &[Response], test: fn()) {
    for response in responses {
        RESPONSE.set(*response);
        println!("{response:?}");
        test();
    }
}

#[test]
fn whatever_changes_wakes() {
    by(&RESPONSES, whatever_changes_about_a_marble_wakes_its_island);
    by(&RESPONSES, whatever_changes_about_a_heap_wakes_it);
    by(&RESPONSES, walls_of_another_history_wake_all);
    // Springs overlap so far that the heap is one island.
    by(&RESPONSES[..2], a_lift_wakes_only_what_it_comes_to);
}

/// By projection, a heap comes to rest later than they look.
#[test]
fn heaps_fall_asleep_about_what_must_not_or_does_not_move() {
    let but_displacement = [RESPONSES[0], RESPONSES[2], RESPONSES[3]];
    by(&but_displacement, marbles_of_infinite_mass_that_do_not_move_let_others_sleep);
    by(&but_displacement, nothing_falls_asleep_about_a_marble_that_must_not);
}

#[test]
fn nothing_sleeps_in_mid_air_by_any_method() {
    by(&RESPONSES[..4], nothing_sleeps_in_mid_air);
    by(&RESPONSES, spawn::one_whose_support_goes_falls_whenever_it_goes);
}

#[test]
fn random_changes_wake_and_who_sleeps_does_not_move() {
    by(&RESPONSES[..4], random::who_must_wake_wakes_and_who_sleeps_does_not_move);
}

#[test]
fn one_that_comes_or_goes_wakes_no_other_one_by_any_method() {
    by(&RESPONSES[..4], spawn::one_that_comes_goes_or_changes_wakes_no_other_one);
    by(&RESPONSES[..4], spawn::a_block_that_goes_with_its_marble_wakes_no_other_one);
}

/// A floor, a ball at rest on it, and one that is sent against it at this speed after three seconds.
fn struck(sleeps: bool, speed: f32) -> [Vec3<f32>; 2] {
    let mut world = world();
    world.swarm.set_model(SwarmModel { sleeps, ..world.swarm.model() }).unwrap();
    world.set_model(Model { detection: Detection::Swept, ..world.model() }).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    let ball = |x: f32| Marble::new(Point3::new(x, 0.2, 0.0), 0.2);
    let resting = world.marbles.insert(ball(0.0)).unwrap();
    steps(&mut world, 180);
    assert_eq!(world.is_asleep(resting).unwrap(), sleeps);
    let velocity = Vec3::new(speed, 0.0, 0.0);
    let sent = world.marbles.insert(Marble { velocity, ..ball(-1.0) }).unwrap();
    steps(&mut world, (2.0 / speed * 60.0) as u32 + 10);
    assert!(!world.is_asleep(resting).unwrap());
    [sent, resting].map(|id| world.marbles.get(id).unwrap().velocity)
}

#[test]
fn a_sleeper_that_is_struck_goes_as_one_that_was_awake() {
    by(&RESPONSES, || {
        for speed in [1.0, 5.0, 100.0] {
            let [asleep, awake] = [true, false].map(|sleeps| struck(sleeps, speed));
            for (one, other) in asleep.into_iter().zip(awake) {
                assert!((one - other).magnitude() < 1e-3 * speed, "{asleep:?}, {awake:?}");
            }
            assert!(asleep[1].x > 0.1 * speed, "{asleep:?}");
        }
    });
}

#[test]
fn what_a_constant_force_bears_on_sleeps_until_it_changes() {
    by(&RESPONSES, || {
        let mut world = world();
        world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
        let id = world.marbles.insert(Marble::new(Point3::new(0.0, 0.2, 0.0), 0.2)).unwrap();
        let pulled = |world: &mut World<f32>, pull: f32, count: u32| {
            for _ in 0..count {
                world.marbles.apply_acceleration(id, Vec3::new(0.0, pull, 0.0)).unwrap();
                steps(world, 1);
            }
            world.is_asleep(id).unwrap()
        };
        assert!(pulled(&mut world, 4.0, 180));
        for pull in [3.0, 0.0] {
            assert!(!pulled(&mut world, pull, 1) && pulled(&mut world, pull, 60));
        }
        assert!(!pulled(&mut world, 20.0, 30));
        assert!(world.marbles.get(id).unwrap().position.y > 0.5);
    });
}

#[test]
fn the_energy_audit_has_what_sleep_takes() {
    by(&RESPONSES, || {
        let (mut world, _, ids) = heap();
        world.enable_energy_audit(true);
        let mut before = world.energy().total();
        for _ in 0..720 {
            steps(&mut world, 1);
            let audit = world.energy_audit().unwrap();
            let lost = audit.friction + audit.restitution + audit.resistance + audit.solver;
            let now = world.energy().total();
            assert!((before - lost - now).abs() < 1e-4 * before.abs().max(1.0), "{audit:?}");
            before = now;
        }
        let asleep = asleep(&world, &ids);
        assert!(asleep == ids.len() || RESPONSE.get() == Response::EventDriven, "{asleep}");
    });
}

/// Friction holds the ball against it.
#[test]
fn no_marble_sleeps_that_a_torque_acts_on() {
    by(&RESPONSES, || {
        let mut world = world();
        world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
        let grips = Material { rolling_resistance: 0.5, ..Material::default() };
        let ball = Marble::new(Point3::new(0.0, 0.2, 0.0), 0.2);
        let id = world.marbles.insert(Marble { material: Some(grips), ..ball }).unwrap();
        for _ in 0..180 {
            world.marbles.apply_torque(id, Vec3::new(0.0, 0.0, 1.0)).unwrap();
            steps(&mut world, 1);
            assert!(!world.is_asleep(id).unwrap());
        }
        steps(&mut world, 90);
        assert!(world.is_asleep(id).unwrap());
    });
}

/// Whenever it comes: it may be on its way through a step while the ball falls asleep.
#[test]
fn a_wall_that_comes_within_a_step_wakes_whom_it_meets() {
    by(&[RESPONSES[0], RESPONSES[1], RESPONSES[4]], || {
        for speed in [2.0, 20.0] {
            let mut world = world();
            world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
            let way = speed * DT;
            let at = |x: f32| block([x - 2.0, 0.0, -1.0], [x, 1.0, 1.0]);
            let wall = world.walls.insert(at(-0.1 - 0.7 * way)).unwrap();
            let id = world.marbles.insert(Marble::new(Point3::new(0.0, 0.1, 0.0), 0.1)).unwrap();
            for step in 0..60 {
                let mut world = world.clone();
                world.walls.set(wall, at(-0.1 + 0.3 * way)).unwrap();
                let motion = sliding(Vec3::new(speed, 0.0, 0.0));
                world.walls.set_motion(wall, Some(motion)).unwrap();
                steps(&mut world, 1);
                world.walls.set_motion(wall, None).unwrap();
                steps(&mut world, 60);
                let x = world.marbles.get(id).unwrap().position.x;
                assert!(x > 0.25 * way, "{speed} m/s after {step} steps: at {x} m");
            }
            steps(&mut world, 60);
        }
    });
}

#[test]
fn two_that_only_touch_each_other_do_not_sleep() {
    by(&RESPONSES, || {
        let mut world = world();
        let damping = Damping { linear: 400.0, angular: 0.0 };
        let ids = [5.0, 5.1999].map(|y| {
            let ball = Marble::new(Point3::new(0.0, y, 0.0), 0.1);
            world.marbles.insert(Marble { damping, ..ball }).unwrap()
        });
        for _ in 0..300 {
            steps(&mut world, 1);
            assert_eq!(asleep(&world, &ids), 0);
        }
    });
}
