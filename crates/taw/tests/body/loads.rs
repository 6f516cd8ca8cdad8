//! Sleepers on which something comes, goes, or presses otherwise.

use super::*;
use taw::body::{BodyContactInfo, BodyMass, ContactPartner};
use taw::broad::CollisionLayers;
use taw::swarm::Ball;
use taw::world::Marble;

/// Plank asleep on a narrow block, with its ends in the air.
fn plank_on_block() -> (World<f32>, BodyId) {
    let mut world = world::<f32>(true);
    let block = Body {
        mass: BodyMass::Uniform(Mass::Infinite),
        ..cuboid([0.2, 0.25, 0.2], point(0.0, 0.25, 0.0))
    };
    world.bodies.insert(block).unwrap();
    let plank = world.bodies.insert(cuboid([1.0, 0.02, 0.1], point(0.0, 0.52, 0.0))).unwrap();
    run(&mut world, 3.0);
    assert!(world.bodies.is_asleep(plank).unwrap());
    (world, plank)
}

/// A weight that is laid on the end of a plank tips it.
#[test]
fn a_weight_tips_a_plank_that_sleeps() {
    for kind in ["marble", "ball", "body"] {
        let (mut world, plank) = plank_on_block();
        let at = point(0.9, 0.54 + 0.08, 0.0);
        match kind {
            "marble" => drop(world.marbles.insert(Marble::new(at, 0.08)).unwrap()),
            "ball" => drop(world.swarm.insert(&[Ball::new(at, 0.08)]).unwrap()),
            _ => drop(world.bodies.insert(cuboid([0.1, 0.08, 0.1], at)).unwrap()),
        }
        let mut most = 0.0_f32;
        for _ in 0..90 {
            step(&mut world);
            most = most.max(world.bodies.pose(plank).unwrap().rotation.v.magnitude());
        }
        assert!(most > 0.1, "{kind}: {most}");
    }
}

/// A box inserted, placed or grown into a sleeper wakes it, and the two part.
#[test]
fn a_sleeper_wakes_for_what_is_put_into_it() {
    type Put = fn(&mut World<f32>, BodyId);
    let puts: [(&str, Put); 3] = [
        ("inserted", |world, _| {
            world.bodies.insert(cuboid([0.1, 0.1, 0.1], point(0.1, 0.1, 0.0))).unwrap();
        }),
        ("placed", |world, other| {
            let pose = world.bodies.pose(other).unwrap();
            let pose = taw::frame::Pose { translation: vector(0.1, 0.1, 0.0), ..pose };
            world.bodies.set_pose(other, pose).unwrap();
        }),
        ("grown", |world, other| {
            world.bodies.set(other, cuboid([1.95, 0.1, 0.1], point(2.0, 0.1, 0.0))).unwrap();
        }),
    ];
    for (name, put) in puts {
        let mut world = world::<f32>(true);
        let sleeper = world.bodies.insert(cuboid([0.1, 0.1, 0.1], point(0.0, 0.1, 0.0))).unwrap();
        let other = world.bodies.insert(cuboid([0.1, 0.1, 0.1], point(2.0, 0.1, 0.0))).unwrap();
        let marble = world.marbles.insert(Marble::new(point(-0.5, 0.1, 0.0), 0.1)).unwrap();
        run(&mut world, 3.0);
        assert!(world.bodies.is_asleep(sleeper).unwrap() && world.is_asleep(marble).unwrap());
        let before = place(&world, sleeper);
        put(&mut world, other);
        run(&mut world, 2.0);
        assert!(before.x - place(&world, sleeper).x > 0.02, "{name}: {:?}", place(&world, sleeper));
        assert_eq!(world.marbles.get(marble).unwrap().position.x, -0.5, "{name}");
    }
}

/// A slab asleep on marbles falls when these pass through it from then on.
#[test]
fn a_body_falls_through_balls_that_change_their_layers() {
    for of_swarm in [false, true] {
        let mut world = world::<f32>(true);
        let (mut balls, mut marbles) = (Vec::new(), Vec::new());
        for (x, z) in [(-0.3, -0.3), (-0.3, 0.3), (0.3, -0.3), (0.3, 0.3)] {
            let at = point(x, 0.1, z);
            if of_swarm {
                balls.extend(world.swarm.insert(&[Ball::new(at, 0.1)]).unwrap());
            } else {
                marbles.push(world.marbles.insert(Marble::new(at, 0.1)).unwrap());
            }
        }
        let slab = cuboid([0.5, 0.05, 0.5], point(0.0, 0.25, 0.0));
        let layers = CollisionLayers { memberships: 1, ..CollisionLayers::ALL };
        let slab = world.bodies.insert(Body { layers, ..slab }).unwrap();
        run(&mut world, 5.0);
        assert!(world.bodies.is_asleep(slab).unwrap());
        let others = CollisionLayers { memberships: 2, filters: 2 };
        if of_swarm {
            world.swarm.set_layers(&balls, others).unwrap();
        }
        for marble in &marbles {
            world.marbles.set_layers(*marble, others).unwrap();
        }
        run(&mut world, 2.0);
        let height = place(&world, slab).y;
        assert!((height - 0.05).abs() < 2e-3, "of a swarm: {of_swarm}, {height}");
    }
}

/// Contacts tell who touches whom, where, and with which forces; those of what sleeps, too.
#[test]
fn contacts_tell_forces_and_partners() {
    let mut world = world::<f64>(true);
    let floor = world.walls.id(0).unwrap();
    let lower = world.bodies.insert(cuboid([0.2, 0.1, 0.2], point(0.0, 0.1, 0.0))).unwrap();
    let upper = world.bodies.insert(cuboid([0.1, 0.1, 0.1], point(0.0, 0.3, 0.0))).unwrap();
    let marble = Marble { mass: Mass::Kilograms(1.0), ..Marble::new(point(0.0, 0.45, 0.0), 0.05) };
    let marble = world.marbles.insert(marble).unwrap();
    // Its handle may differ in row and generation from that of its ball.
    for _ in 0..2 {
        let gone = world.marbles.insert(Marble::new(point(3.0, 0.45, 0.0), 0.05)).unwrap();
        world.marbles.remove(gone).unwrap();
    }
    run(&mut world, 0.4);
    let weights = [
        (upper, ContactPartner::Marble(marble), -1.0, 0.4, 1),
        (upper, ContactPartner::Body(lower), 9.0, 0.2, 4),
        (lower, ContactPartner::Wall(floor), 41.0, 0.0, 4),
    ];
    for asleep in [false, true] {
        for (body, partner, mass, height, points) in weights {
            let of_pair = |it: &BodyContactInfo<f64>| (it.body, it.partner) == (body, partner);
            let found: Vec<_> = world.body_contacts().filter(of_pair).collect();
            assert_eq!(found.len(), points, "{partner:?}");
            assert!(found.iter().all(|it| it.is_touching && (it.point.y - height).abs() < 1e-3));
            let force: f64 = found.iter().map(|it| it.normal.y * it.normal_impulse * 60.0).sum();
            assert!((force / (mass * 9.81) - 1.0).abs() < 0.01, "{partner:?}: {force} N");
        }
        assert_eq!(world.bodies.is_asleep(upper).unwrap(), asleep);
        run(&mut world, 4.0);
    }
}

/// Approach speed and impulse of a ball that hits a body, and the touch that ends when it leaves.
#[test]
fn a_hit_is_told_with_its_speed_and_impulse() {
    let mut world = world::<f64>(false);
    world.set_gravity(vector(0.0, 0.0, 0.0)).unwrap();
    let elastic = material(0.0, 1.0);
    let wall = Body {
        mass: BodyMass::Uniform(Mass::Infinite),
        material: elastic,
        ..cuboid([0.1, 1.0, 1.0], point(0.0, 0.0, 0.0))
    };
    world.bodies.insert(wall).unwrap();
    let ball = Marble {
        mass: Mass::Kilograms(2.0),
        velocity: vector(-7.0, 1.0, 0.0),
        material: Some(elastic),
        ..Marble::new(point(1.0, 0.0, 0.0), 0.1)
    };
    let ball = world.marbles.insert(ball).unwrap();
    let mut touches = Vec::new();
    for _ in 0..30 {
        step(&mut world);
        touches.extend(world.body_contacts().filter(|contact| contact.is_touching));
    }
    assert!(!touches.is_empty() && touches.len() <= 2, "{touches:?}");
    let BodyContactInfo { partner, normal, approach_speed, slip_speed, normal_impulse, .. } =
        touches[0];
    assert_eq!((partner, normal.x.round()), (ContactPartner::Marble(ball), -1.0));
    assert!((approach_speed - 7.0).abs() < 1e-9 && (slip_speed - 1.0).abs() < 1e-9);
    assert!((normal_impulse - 28.0).abs() < 1e-9, "{normal_impulse} N s");
}

/// A slab that fell asleep on balls weighs what it did, by its contacts, which were solved for some steps as those of an
/// obstacle: balls fall asleep up to eight steps later.
#[test]
fn what_sleeps_on_balls_keeps_its_forces() {
    let (world, slab, _) = super::sleep::slab_on_balls(false);
    let force: f32 = world
        .body_contacts()
        .filter(|it| it.body == slab && it.is_touching)
        .map(|it| it.normal.y * it.normal_impulse * 60.0)
        .sum();
    assert!((force / (100.0 * 9.81) - 1.0).abs() < 0.05, "{force} N");
}

/// A ball asleep on a thin plate is not driven into it by a crate that comes down on it.
#[test]
fn a_sleeper_that_is_struck_keeps_what_it_lies_on() {
    let mut world = world::<f64>(false);
    let plate = Body {
        mass: BodyMass::Uniform(Mass::Infinite),
        ..cuboid([0.5, 0.01, 0.5], point(0.0, -0.01, 0.0))
    };
    world.bodies.insert(plate).unwrap();
    let marble = world.marbles.insert(Marble::new(point(0.0, 0.1, 0.0), 0.1)).unwrap();
    run(&mut world, 3.0);
    assert!(world.is_asleep(marble).unwrap());
    let crate_ = Body {
        velocity: vector(0.0, -8.0, 0.0),
        mass: BodyMass::Uniform(Mass::Kilograms(20.0)),
        ..cuboid([0.1, 0.1, 0.1], point(0.0, 0.31, 0.0))
    };
    world.bodies.insert(crate_).unwrap();
    let mut lowest = 1.0_f64;
    for _ in 0..30 {
        step(&mut world);
        lowest = lowest.min(world.marbles.get(marble).unwrap().position.y);
    }
    assert!(lowest > 0.09, "{lowest}");
}

/// A box that strikes a sleeper moves the ball, too, against which that sleeps.
#[test]
fn a_blow_goes_through_a_sleeper_to_a_ball() {
    let mut world = world::<f64>(true);
    let smooth = material(0.0, 0.0);
    let of_mass = |x: f64, velocity| Body {
        mass: BodyMass::Uniform(Mass::Kilograms(5.0)),
        material: smooth,
        velocity,
        ..cuboid([0.1, 0.1, 0.1], point(x, 0.1, 0.0))
    };
    let still = vector(0.0, 0.0, 0.0);
    world.bodies.insert(of_mass(0.0, still)).unwrap();
    let marble = Marble {
        mass: Mass::Kilograms(5.0),
        material: Some(smooth),
        ..Marble::new(point(0.1995, 0.1, 0.0), 0.1)
    };
    let marble = world.marbles.insert(marble).unwrap();
    run(&mut world, 4.0);
    assert!(world.is_asleep(marble).unwrap());
    world.bodies.insert(of_mass(-0.35, vector(5.0, 0.0, 0.0))).unwrap();
    run(&mut world, 0.2);
    let momentum: f64 = world.bodies.ids().map(|id| velocity(&world, id).x * 5.0).sum();
    let speed = world.marbles.get(marble).unwrap().velocity.x;
    assert!((momentum + speed * 5.0 - 25.0).abs() < 0.5, "{momentum} and {speed}");
    assert!(speed > 1.5, "{speed} m/s");
}

/// A ball that never sleeps keeps a body awake on which it leans, and pushes it from there.
#[test]
fn what_never_sleeps_keeps_awake_what_it_touches() {
    let mut world = world::<f32>(true);
    let hero = Marble { sleeping_disabled: true, ..Marble::new(point(0.0, 0.3, 0.0), 0.1) };
    world.marbles.insert(hero).unwrap();
    let below = world.bodies.insert(cuboid([0.2, 0.1, 0.2], point(0.0, 0.1, 0.0))).unwrap();
    let alone = world.bodies.insert(cuboid([0.2, 0.1, 0.2], point(2.0, 0.1, 0.0))).unwrap();
    run(&mut world, 4.0);
    assert_eq!([below, alone].map(|id| world.bodies.is_asleep(id).unwrap()), [false, true]);
}
