use super::*;

fn tumbling<S: Scalar>(mut body: Body<S>) -> (World<S>, BodyId) {
    let mut world = world(false);
    world.set_gravity(vector(0.0, 0.0, 0.0)).unwrap();
    body.velocity = vector(0.3, -0.2, 0.1);
    body.sleeping_disabled = true;
    let id = world.bodies.insert(body).unwrap();
    (world, id)
}

fn angular_momentum<S: Scalar>(world: &World<S>, id: BodyId) -> Vec3<f64> {
    let body = world.bodies.get(id).unwrap();
    let properties = world.bodies.mass_properties(id).unwrap().unwrap();
    let axes = body.rotation * properties.axes;
    let local = axes.conjugate() * body.angular_velocity;
    let momentum = Vec3::new(
        local.x * properties.inertia.x,
        local.y * properties.inertia.y,
        local.z * properties.inertia.z,
    );
    (axes * momentum).map(S::as_f64)
}

/// Issue: a tumbling box keeps energy and momentum over 100 s in `f32`, and so does a capsule.
#[test]
fn tumbling_bodies_keep_energy_and_momentum() {
    let capsule = taw::shape::Capsule::new(point(0.0, -0.4, 0.0), point(0.0, 0.4, 0.0), 0.1_f32);
    for body in [
        cuboid([0.5, 0.3, 0.1], point(0.0, 0.0, 0.0)),
        Body::new(Shape::Capsule(capsule.unwrap()), point(0.0, 0.0, 0.0)),
    ] {
        let spin = vector(0.01, 5.0, 0.02);
        let (mut world, id) = tumbling(Body { angular_velocity: spin, ..body });
        let (before, energy_before) = (angular_momentum(&world, id), energy(&world));
        run(&mut world, 100.0);
        let after = angular_momentum(&world, id);
        assert!((after - before).magnitude() < 1e-5 * before.magnitude(), "{before:?} {after:?}");
        assert!((energy(&world) / energy_before - 1.0).abs() < 1e-5);
        assert!((place(&world, id) - Vec3::new(30.0, -20.0, 10.0)).magnitude() < 1e-4);
    }
}

/// Time of the twentieth flip of a box about its middle axis, in s.
#[test]
fn an_unstable_box_turns_over_twenty_times_in_time() {
    // The box of `motion::free_body`: unit mass with these moments.
    let properties = taw::shape::MassProperties {
        mass: 1.0_f32,
        center: Point3::new(0.0, 0.0, 0.0),
        inertia: Vec3::new(1.6, 4.16, 5.44),
        axes: Quat::new(1.0, 0.0, 0.0, 0.0),
    };
    let body = Body {
        mass: taw::body::BodyMass::Given(properties),
        angular_velocity: vector(0.01, 5.0, 0.01),
        ..cuboid([0.5, 0.5, 0.5], point(0.0, 0.0, 0.0))
    };
    let (mut world, id) = tumbling(body);
    let (mut flips, mut last, mut time) = (0, 1.0, 0.0_f64);
    while flips < 20 && time < 120.0 {
        step(&mut world);
        time += 1.0 / 60.0;
        let body = world.bodies.get(id).unwrap();
        let now = f64::from((body.rotation.conjugate() * body.angular_velocity).y);
        flips += i32::from(now * last < 0.0);
        last = now;
    }
    let expected = 2.84256 + 19.0 * 5.024_785;
    assert!((time - expected).abs() < 0.05, "{time}, not {expected}");
}

/// Flight is a parabola whatever the steps.
#[test]
fn a_thrown_box_flies_along_a_parabola() {
    let mut world = world::<f32>(false);
    let body = Body {
        velocity: vector(3.0, 4.0, 0.0),
        angular_velocity: vector(1.0, 2.0, 3.0),
        ..cuboid([0.1, 0.2, 0.3], point(0.0, 0.0, 0.0))
    };
    let id = world.bodies.insert(body).unwrap();
    run(&mut world, 1.0);
    let expected = Vec3::new(3.0, 4.0 - 4.905, 0.0);
    assert!((place(&world, id) - expected).magnitude() < 1e-5, "{:?}", place(&world, id));
}

/// A cube that falls flat bounces to its height, straight up, without a spin; and one that falls on an edge
/// keeps its energy.
#[test]
fn an_elastic_cube_bounces_back() {
    for (angle, bound) in [(0.0, 0.01), (0.3, 0.02), (0.785, 0.02)] {
        let mut world = world::<f32>(true);
        let body = Body {
            material: material(0.0, 1.0),
            rotation: about_z(angle),
            ..cuboid([0.1, 0.1, 0.1], point(0.0, 1.0, 0.0))
        };
        let id = world.bodies.insert(body).unwrap();
        let start = energy(&world);
        for at in 0..120 {
            step(&mut world);
            let change = energy(&world) / start - 1.0;
            assert!(change.abs() < bound, "{angle}: {change} after {at} steps");
        }
        if angle == 0.0 {
            assert!(spin(&world, id).magnitude() < 1e-3, "{:?}", spin(&world, id));
        }
    }
}
