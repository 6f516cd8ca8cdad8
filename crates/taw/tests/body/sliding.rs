use super::*;

const SLOPE: f64 = 0.5;

/// Box on a slope of .5 rad, just touching it.
fn on_slope(friction: f64) -> (World<f32>, BodyId) {
    let mut world = world(false);
    let normal = Vec3::new(-SLOPE.sin() as f32, SLOPE.cos() as f32, 0.0);
    world.walls.insert(Plane::through(point(0.0, 0.0, 0.0), normal).unwrap()).unwrap();
    let at = normal * 0.1;
    let body = Body {
        rotation: about_z(SLOPE),
        material: material(friction, 0.0),
        ..cuboid([0.3, 0.1, 0.3], Point3::from_vec(at))
    };
    let id = world.bodies.insert(body).unwrap();
    (world, id)
}

#[test]
fn a_box_slides_down_a_slope_by_g_sin_less_friction() {
    for friction in [0.0, 0.1, 0.3] {
        let (mut world, id) = on_slope(friction);
        run(&mut world, 1.0);
        let expected = 9.81 * (SLOPE.sin() - friction * SLOPE.cos());
        let speed = velocity(&world, id).magnitude();
        assert!((speed / expected - 1.0).abs() < 2e-3, "{friction}: {speed}, not {expected}");
    }
}

#[test]
fn a_box_stays_where_friction_holds_it() {
    let (mut world, id) = on_slope(SLOPE.tan() * 1.01);
    let start = place(&world, id);
    run(&mut world, 10.0);
    assert!((place(&world, id) - start).magnitude() < 1e-3, "{:?}", place(&world, id) - start);
}

#[test]
fn a_sliding_box_stops_where_its_energy_is_spent() {
    let mut world = world::<f32>(true);
    let body = Body {
        velocity: vector(3.0, 0.0, 0.0),
        material: material(0.4, 0.0),
        ..cuboid([0.3, 0.1, 0.3], point(0.0, 0.1, 0.0))
    };
    let id = world.bodies.insert(body).unwrap();
    run(&mut world, 2.0);
    let expected = 9.0 / (2.0 * 0.4 * 9.81);
    let way = place(&world, id).x;
    // Places follow the velocity at the end of each substep: half of a substep's way is missing.
    let missing = 3.0 / 240.0 / 2.0;
    assert!((way / (expected - missing) - 1.0).abs() < 1e-3, "{way}, not {expected}");
    assert!(velocity(&world, id).magnitude() < 1e-6);
}

/// A box topples from the angle on at which its center is above its edge: to .1°.
#[test]
fn a_tall_box_topples_from_the_angle_of_its_diagonal() {
    let topples = |angle: f64| {
        let mut world = world::<f32>(false);
        let normal = Vec3::new(-angle.sin() as f32, angle.cos() as f32, 0.0);
        world.walls.insert(Plane::through(point(0.0, 0.0, 0.0), normal).unwrap()).unwrap();
        let body = Body {
            rotation: about_z(angle),
            material: material(2.0, 0.0),
            ..cuboid([0.1, 0.3, 0.1], Point3::from_vec(normal * 0.3))
        };
        let id = world.bodies.insert(body).unwrap();
        run(&mut world, 20.0);
        upright(&world, id) < 0.8
    };
    let limit = (0.1_f64 / 0.3).atan();
    let tenth = 0.1_f64.to_radians();
    assert!(!topples(limit - tenth), "it falls too early");
    assert!(topples(limit + tenth), "it stands too long");
}

/// A box slides over the seams of flush tiles and of a mesh as over a plane.
#[test]
fn seams_do_not_catch_a_sliding_box() {
    let slide = |build: &dyn Fn(&mut World<f32>)| {
        let mut world = world::<f32>(false);
        build(&mut world);
        let body = Body {
            velocity: vector(2.0, 0.0, 0.3),
            material: material(0.2, 0.0),
            ..cuboid([0.23, 0.1, 0.17], point(0.0, 0.1, 0.0))
        };
        let id = world.bodies.insert(body).unwrap();
        run(&mut world, 1.5);
        (place(&world, id), upright(&world, id))
    };
    let (plane, _) = slide(&|world| {
        world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    });
    let tiles = slide(&|world| {
        for (i, j) in (-4..12).flat_map(|i| (-4..6).map(move |j| (i, j))) {
            let (x, z) = (i as f32 * 0.31, j as f32 * 0.31);
            let (min, max) = (Point3::new(x, -1.0, z), Point3::new(x + 0.31, 0.0, z + 0.31));
            world.walls.insert(taw::shape::Aabb::new(min, max).unwrap()).unwrap();
        }
    });
    let mesh = slide(&|world| {
        let at = |i: u32, j: u32| Point3::new(i as f32 * 0.31 - 1.24, 0.0, j as f32 * 0.31 - 1.24);
        let points = (0..16).flat_map(|i| (0..12).map(move |j| at(i, j))).collect();
        let quads = (0..15).flat_map(|i| (0..11).map(move |j| i * 12 + j));
        let triangles = quads.flat_map(|a| [[a, a + 1, a + 12], [a + 1, a + 13, a + 12]]).collect();
        world.walls.insert(taw::shape::Mesh::new(points, triangles).unwrap()).unwrap();
    });
    for (name, (at, upright)) in [("tiles", tiles), ("mesh", mesh)] {
        assert!((at - plane).magnitude() < 0.01, "{name}: {at:?}, not {plane:?}");
        assert!(upright > 0.9999, "{name}: {upright}");
    }
}
