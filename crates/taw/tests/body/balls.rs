use super::*;
use taw::swarm::Ball;
use taw::world::Marble;

/// Momentum of a ball and a box that meet in empty space, and their energy, are kept.
#[test]
fn a_ball_and_a_box_collide_as_equals() {
    for offset in [0.0, 0.1] {
        let mut world = world::<f32>(false);
        world.set_gravity(vector(0.0, 0.0, 0.0)).unwrap();
        let elastic = material(0.0, 1.0);
        let body = Body { material: elastic, ..cuboid([0.2, 0.2, 0.2], point(1.0, 0.0, 0.0)) };
        let body = world.bodies.insert(body).unwrap();
        let marble = Marble {
            velocity: vector(3.0, 0.0, 0.0),
            material: Some(elastic),
            mass: Mass::Kilograms(20.0),
            ..Marble::new(point(0.0, offset, 0.0), 0.1)
        };
        let marble = world.marbles.insert(marble).unwrap();
        let start = energy(&world);
        run(&mut world, 1.0);
        let [m, n] = [20.0, 64.0];
        let ball = world.marbles.get(marble).unwrap().velocity.map(f64::from);
        let momentum = ball * m + velocity(&world, body) * n;
        assert!((momentum - Vec3::new(60.0, 0.0, 0.0)).magnitude() < 1e-3, "{momentum:?}");
        assert!(
            (energy(&world) / start - 1.0).abs() < 1e-3,
            "{offset}: {}",
            energy(&world) / start
        );
        if offset == 0.0 {
            let expected = 3.0 * (m - n) / (m + n);
            assert!((ball.x - expected).abs() < 1e-3, "{ball:?}, not {expected}");
        }
    }
}

/// A ball on a body reaches e² of its height, as on a wall.
#[test]
fn a_ball_bounces_off_a_body_to_its_height() {
    for restitution in [0.5, 0.8, 1.0] {
        let mut world = world::<f32>(false);
        let surface = material(0.0, restitution);
        let floor = Body {
            mass: taw::body::BodyMass::Uniform(Mass::Infinite),
            material: surface,
            ..cuboid([1.0, 0.1, 1.0], point(0.0, -0.1, 0.0))
        };
        world.bodies.insert(floor).unwrap();
        let marble = Marble { material: Some(surface), ..Marble::new(point(0.0, 1.1, 0.0), 0.1) };
        let marble = world.marbles.insert(marble).unwrap();
        let (mut peak, mut rising) = (0.0_f64, false);
        for _ in 0..120 {
            step(&mut world);
            let marble = world.marbles.get(marble).unwrap();
            let rises = marble.velocity.y > 0.0;
            if rising && !rises {
                break;
            }
            rising = rises;
            peak = if rises { f64::from(marble.position.y) - 0.1 } else { peak };
        }
        let expected = restitution * restitution;
        assert!((peak / expected - 1.0).abs() < 0.02, "{restitution}: {peak}, not {expected}");
    }
}

/// Marbles and balls lie on a box that lies on marbles.
#[test]
fn balls_bear_a_box_and_it_bears_balls() {
    let mut world = world::<f32>(true);
    for (x, z) in [(-0.3, -0.3), (-0.3, 0.3), (0.3, -0.3), (0.3, 0.3)] {
        world.marbles.insert(Marble::new(point(x, 0.1, z), 0.1)).unwrap();
    }
    let slab = world.bodies.insert(cuboid([0.5, 0.05, 0.5], point(0.0, 0.25, 0.0))).unwrap();
    let ball = world.swarm.insert(&[Ball::new(point(0.1, 0.36, 0.0), 0.05)]).unwrap()[0];
    run(&mut world, 5.0);
    assert!((place(&world, slab).y - 0.25).abs() < 2e-3, "{:?}", place(&world, slab));
    let row = world.swarm.row(ball).unwrap();
    assert!((world.swarm.balls()[row][1] - 0.35).abs() < 2e-3, "{:?}", world.swarm.balls()[row]);
}

/// A ball that rolls down a box that stands askew rolls by 5/7 g sin.
#[test]
fn a_marble_rolls_down_a_body() {
    let mut world = world::<f32>(false);
    let slope = Body {
        mass: taw::body::BodyMass::Uniform(Mass::Infinite),
        rotation: about_z(0.2),
        ..cuboid([5.0, 0.1, 1.0], point(0.0, 0.0, 0.0))
    };
    world.bodies.insert(slope).unwrap();
    let up = Vec3::new(-0.2_f32.sin(), 0.2_f32.cos(), 0.0);
    let marble = Marble {
        material: Some(material(0.8, 0.0)),
        ..Marble::new(Point3::from_vec(up * 0.2), 0.1)
    };
    let marble = world.marbles.insert(marble).unwrap();
    run(&mut world, 1.0);
    let speed = f64::from(world.marbles.get(marble).unwrap().velocity.magnitude());
    let expected = 5.0 / 7.0 * 9.81 * 0.2_f64.sin();
    assert!((speed / expected - 1.0).abs() < 5e-3, "{speed}, not {expected}");
}

/// A fast ball does not pass through a thin box.
#[test]
fn nothing_passes_through_a_body() {
    for speed in [10.0, 100.0, 300.0] {
        let mut world = world::<f32>(false);
        world.set_gravity(vector(0.0, 0.0, 0.0)).unwrap();
        let plate = Body {
            mass: taw::body::BodyMass::Uniform(Mass::Infinite),
            ..cuboid([0.01, 1.0, 1.0], point(1.0, 0.0, 0.0))
        };
        world.bodies.insert(plate).unwrap();
        let thrown =
            Marble { velocity: vector(speed, 0.0, 0.0), ..Marble::new(point(0.0, 0.0, 0.0), 0.02) };
        let ball = world.marbles.insert(thrown).unwrap();
        let body = Body {
            velocity: vector(speed, 0.0, 0.0),
            ..cuboid([0.02, 0.02, 0.02], point(0.0, 0.5, 0.0))
        };
        let body = world.bodies.insert(body).unwrap();
        run(&mut world, 0.5);
        assert!(world.marbles.get(ball).unwrap().position.x < 1.0, "ball at {speed}");
        assert!(place(&world, body).x < 1.0, "box at {speed}");
    }
}
