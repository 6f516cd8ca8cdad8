//! Walls of every shape: what lies on them, what bounces off them, and their seams.

use std::sync::Arc;

use taw::frame::{AxisAngle, Pose};
use taw::math::Quat;
use taw::prelude::*;
use taw::shape::{Aabb, Capsule, Compound, HeightField, Hull, Mesh, Obb, Shape};

const DT: f64 = 1.0 / 60.0;

/// The four ways to answer a touch; the third needs short substeps.
fn models() -> [Model; 4] {
    let with = |response, substeps| Model { response, substeps, ..Model::default() };
    [
        with(Response::Displacement, 1),
        with(Response::Impulse, 1),
        with(Response::Penalty(ContactLaw::SpringDashpot), 20),
        with(Response::EventDriven, 1),
    ]
}

fn slab(y: f64) -> Shape<f64> {
    let (min, max) = (Point3::new(-5.0, y - 1.0, -5.0), Point3::new(5.0, y, 5.0));
    Shape::Aabb(Aabb::new(min, max).unwrap())
}

/// Floors at zero, each of another kind.
fn floors() -> Vec<(&'static str, WallShape<f64>)> {
    let square = [[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]];
    let corners: Vec<_> = square.iter().map(|[x, z]| Point3::new(*x, 0.0, *z)).collect();
    let below = corners.iter().map(|p| p + Vec3::unit_y() * -1.0);
    let all: Vec<_> = corners.iter().copied().chain(below).collect();
    let Shape::Aabb(aabb) = slab(0.0) else { unreachable!() };
    let mesh = Mesh::new(corners, vec![[0, 2, 1], [0, 3, 2]]).unwrap();
    let field =
        HeightField::new(Point3::new(-5.0, 0.0, -5.0), [1.0, 1.0], 11, vec![0.0; 121]).unwrap();
    let big = Sphere::new(Point3::new(0.0, -1e4, 0.0), 1e4).unwrap();
    let long = Capsule::new(Point3::new(-5.0, -1e4, 0.0), Point3::new(5.0, -1e4, 0.0), 1e4);
    let half = [-2.5, 2.5].map(|x| {
        let center = Point3::new(x, -0.5, 0.0);
        let (turn, sizes) = (aabb.obb().rotation, Vec3::new(2.5, 0.5, 5.0));
        Shape::Obb(Obb::new(center, turn, sizes).unwrap())
    });
    // A mesh that lies elsewhere, and is turned to where it should be.
    let aside = mesh.points().iter().map(|p| Point3::new(p.y, -p.x, p.z)).collect();
    let aside = Mesh::new(aside, mesh.triangles().to_vec()).unwrap();
    let turn = AxisAngle::new(Vec3::unit_z(), std::f64::consts::FRAC_PI_2).unwrap();
    let pose = Pose { rotation: turn.into(), ..Pose::identity() };
    vec![
        ("plane", Plane::new(Vec3::unit_y(), 0.0).unwrap().into()),
        ("box", aabb.into()),
        ("turned box", aabb.obb().into()),
        ("hull", Hull::new(&all).unwrap().into()),
        ("sphere", big.into()),
        ("capsule", long.unwrap().into()),
        ("compound", Compound::new(half.to_vec()).unwrap().into()),
        ("mesh", mesh.into()),
        ("turned mesh", WallShape::Mesh(Arc::new(aside), pose)),
        ("height field", field.into()),
    ]
}

fn ball_at(position: [f64; 3], velocity: [f64; 3]) -> Marble<f64> {
    Marble { velocity: Vec3::from(velocity), ..Marble::new(Point3::from(position), 0.5) }
}

/// Material that slows nothing down.
fn smooth() -> Material<f64> {
    Material { friction: 0.0, ..Material::default() }
}

#[test]
fn a_marble_comes_to_rest_on_a_floor_of_any_kind() {
    for model in models() {
        for (name, floor) in floors() {
            let mut world = World::<f64>::default();
            world.set_model(model).unwrap();
            world.walls.insert(floor).unwrap();
            let id = world.marbles.insert(ball_at([0.3, 1.0, 0.2], [0.0; 3])).unwrap();
            for _ in 0..600 {
                world.step(DT).unwrap();
            }
            let marble = world.marbles.get(id).unwrap();
            let (height, speed) = (marble.position.y, marble.velocity.magnitude());
            assert!((height - 0.5).abs() < 0.005, "{name} {:?}: {height}", model.response);
            assert!(speed < 0.02, "{name} {:?}: {speed}", model.response);
        }
    }
}

#[test]
fn a_marble_bounces_off_a_floor_of_any_kind_as_off_a_plane() {
    for model in models() {
        let bounced = |floor: WallShape<f64>| {
            let mut world = World::<f64>::default();
            world.set_model(Model { rotation: Rotation::Dynamic, ..model }).unwrap();
            world.walls.insert(floor).unwrap();
            let id = world.marbles.insert(ball_at([-2.0, 1.5, 0.2], [2.0, -1.0, 0.5])).unwrap();
            let material = Material { restitution: 0.8, friction: 0.3, ..Material::default() };
            world.marbles.set_material(id, Some(material)).unwrap();
            for _ in 0..60 {
                world.step(DT).unwrap();
            }
            world.marbles.get(id).unwrap().position
        };
        let [(_, plane), others @ ..] = &floors()[..] else { unreachable!() };
        let exact = bounced(plane.clone());
        for (name, floor) in others {
            let off = (bounced(floor.clone()) - exact).magnitude();
            // A sphere of 10 km drops by 0.2 mm over two metres.
            let allowed = if matches!(*name, "sphere" | "capsule") { 3e-3 } else { 1e-9 };
            assert!(off < allowed, "{name} {:?}: {off}", model.response);
        }
    }
}

/// The largest angle between up and the normal of any touch, while a ball crosses a floor at
/// 5 m/s; and how far it got.
fn roll(walls: Vec<WallShape<f64>>, model: Model, heading: f64, way: f64) -> (f64, f64) {
    let mut world = World::<f64>::default();
    world.set_model(model).unwrap();
    for wall in walls {
        world.walls.insert(wall).unwrap();
    }
    let along = Vec3::new(heading.cos(), 0.0, heading.sin());
    let velocity = along * 5.0;
    let start = Point3::new(0.37, 0.5, 0.21);
    let id = world.marbles.insert(ball_at(start.into(), velocity.into())).unwrap();
    world.marbles.set_material(id, Some(smooth())).unwrap();
    let mut worst: f64 = 0.0;
    for _ in 0..(way / 5.0 / DT) as u32 {
        world.step(DT).unwrap();
        for contact in &world.contacts.wm {
            if contact.separation < 0.0 {
                worst = worst.max(contact.normal.angle(Vec3::unit_y()).0);
            }
        }
        for impact in world.impacts() {
            worst = worst.max(impact.normal.angle(Vec3::unit_y()).0);
        }
        let velocity = world.marbles.get(id).unwrap().velocity;
        worst = worst.max((velocity - along * velocity.dot(along)).x.abs() / 5.0);
    }
    let end = world.marbles.get(id).unwrap().position;
    (worst, (end - start).dot(along))
}

/// Flat floors of many pieces, wide enough to go `way` metres in any direction.
fn pieces(way: f64) -> Vec<(&'static str, Vec<WallShape<f64>>)> {
    let tile = |x: f64, z: f64, half: [f64; 2]| {
        let center = Point3::new(x, -0.5, z);
        let turn = AxisAngle::new(Vec3::unit_x(), 0.0).unwrap().into();
        WallShape::from(Obb::new(center, turn, Vec3::new(half[0], 0.5, half[1])).unwrap())
    };
    let count = way as i32 + 2;
    let grid = |count: i32| (-count..count).flat_map(move |x| (-count..count).map(move |z| (x, z)));
    let near = |x: i32, z: i32| (x.abs().max(z.abs()) < 12, f64::from(x) + 0.5, f64::from(z) + 0.5);
    let tiles: Vec<_> = grid(count).map(|(x, z)| near(x, z)).collect();
    let tiles: Vec<_> = tiles.iter().map(|(_, x, z)| tile(*x, *z, [0.5, 0.5])).collect();
    // Rows that are shifted by half a tile, so that edges meet in the middle of others.
    let shifted = grid(count).map(|(x, z)| {
        let shift = if z % 2 == 0 { 0.0 } else { 0.5 };
        tile(f64::from(x) + shift, f64::from(z) + 0.5, [0.5, 0.5])
    });
    let shifted: Vec<_> = shifted.collect();
    let side = 2 * count as u32 + 1;
    let corner = Point3::new(-f64::from(count), 0.0, -f64::from(count));
    let flat = vec![0.0; (side * side) as usize];
    let field = HeightField::new(corner, [1.0, 1.0], side, flat).unwrap();
    // The same triangles as a mesh, all of whose corners are moved along the plane.
    let mut points = Vec::new();
    let mut random = 1_u64;
    let mut next = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        f64::from((random >> 40) as u32) / f64::from(1 << 24) - 0.5
    };
    for z in 0..side {
        for x in 0..side {
            let (dx, dz) = (0.6 * next(), 0.6 * next());
            points.push(corner + Vec3::new(f64::from(x) + dx, 0.0, f64::from(z) + dz));
        }
    }
    let mut triangles = Vec::new();
    for (x, z) in (0..side - 1).flat_map(|x| (0..side - 1).map(move |z| (x, z))) {
        let at = |x: u32, z: u32| z * side + x;
        let [a, b, c, d] = [at(x, z), at(x + 1, z), at(x + 1, z + 1), at(x, z + 1)];
        triangles.extend([[a, c, b], [a, d, c]]);
    }
    let mesh = Mesh::new(points, triangles).unwrap();
    // One half of tiles, the other of triangles, on a half-space.
    let half = f64::from(count);
    let mut mixed = vec![tile(-half / 2.0, 0.0, [half / 2.0, half]), mesh.clone().into()];
    mixed.push(Plane::new(Vec3::unit_y(), -0.1).unwrap().into());
    let overlap = grid(count).map(|(x, z)| tile(f64::from(x), f64::from(z), [0.7, 0.8]));
    vec![
        ("tiles", tiles),
        ("shifted tiles", shifted),
        ("tiles that overlap", overlap.collect()),
        ("mesh", vec![mesh.into()]),
        ("height field", vec![field.into()]),
        ("a box beside a mesh over a plane", mixed),
    ]
}

#[test]
fn a_floor_of_many_pieces_feels_as_one() {
    for (name, walls) in pieces(10.0) {
        for model in models() {
            for heading in 0..16 {
                let heading = f64::from(heading) * std::f64::consts::TAU / 16.0 + 0.01;
                let (worst, way) = roll(walls.clone(), model, heading, 9.0);
                let what = format!("{name} {:?} at {heading}", model.response);
                assert!(worst < 1e-5, "{what}: off by {worst} rad");
                assert!((way - 9.0).abs() < 0.1, "{what}: {way} m");
            }
        }
    }
}

/// Lying across its way, along it, and askew.
#[test]
fn a_capsule_feels_one_floor_too() {
    for (name, walls) in pieces(10.0) {
        for model in models() {
            if model.response == Response::EventDriven {
                continue; // it knows balls only
            }
            for turn in [0.0, 0.4, std::f64::consts::FRAC_PI_2] {
                let mut world = World::<f64>::default();
                world.set_model(model).unwrap();
                for wall in walls.clone() {
                    world.walls.insert(wall).unwrap();
                }
                let lying = AxisAngle::new(Vec3::unit_x(), std::f64::consts::FRAC_PI_2).unwrap();
                let turned = AxisAngle::new(Vec3::unit_y(), turn).unwrap();
                let (lying, turned): (Quat<f64>, Quat<f64>) = (lying.into(), turned.into());
                let mut marble = ball_at([0.37, 0.5, 0.21], [5.0, 0.0, 0.3]);
                (marble.half_length, marble.rotation) = (0.8, turned * lying);
                let id = world.marbles.insert(marble).unwrap();
                world.marbles.set_material(id, Some(smooth())).unwrap();
                let mut worst: f64 = 0.0;
                for _ in 0..96 {
                    world.step(DT).unwrap();
                    for contact in world.contacts.wm.iter().filter(|c| c.separation < 0.0) {
                        worst = worst.max(contact.normal.angle(Vec3::unit_y()).0);
                    }
                }
                let end = world.marbles.get(id).unwrap();
                let what = format!("{name} {:?} turned by {turn}", model.response);
                assert!(worst < 1e-5, "{what}: off by {worst} rad");
                assert!((end.position.x - 8.37).abs() < 0.1, "{what}: {end:?}");
            }
        }
    }
}

#[test]
fn a_thousand_flush_boxes_are_one_floor() {
    let tile = |i: u32| {
        let x = f64::from(i) * 0.3;
        let (min, max) = (Point3::new(x, -1.0, -1.0), Point3::new(x + 0.3, 0.0, 1.0));
        WallShape::from(Aabb::new(min, max).unwrap())
    };
    for model in models() {
        let (worst, way) = roll((0..1000).map(tile).collect(), model, 0.0, 290.0);
        assert!(worst < 1e-5, "{:?}: off by {worst} rad", model.response);
        assert!((way - 290.0).abs() < 0.1, "{:?}: {way} m", model.response);
    }
}

/// Repeats the last test in `f32`, as far as its digits reach.
#[test]
fn a_hundred_flush_boxes_are_one_floor_in_single_precision() {
    for model in models() {
        let mut world = World::<f32>::default();
        world.set_model(model).unwrap();
        for i in 0..100_u8 {
            let x = f32::from(i) * 0.3;
            let (min, max) = (Point3::new(x, -1.0, -1.0), Point3::new(x + 0.3, 0.0, 1.0));
            world.walls.insert(Aabb::new(min, max).unwrap()).unwrap();
        }
        let marble = Marble::new(Point3::new(0.37, 0.5, 0.21), 0.5);
        let velocity = Vec3::new(5.0, 0.0, 0.0);
        let material = Some(Material { friction: 0.0, ..Material::default() });
        let id = world.marbles.insert(Marble { velocity, material, ..marble }).unwrap();
        for _ in 0..330 {
            world.step(1.0 / 60.0).unwrap();
            for contact in
                world.contacts.wm.iter().filter(|c| c.separation < 0.0 && c.normal.y > 0.0)
            {
                let off = contact.normal.angle(Vec3::unit_y()).0;
                assert!(off < 1e-5, "{:?}: off by {off} rad", model.response);
            }
        }
        let end = world.marbles.get(id).unwrap();
        assert!((end.position.x - 27.87).abs() < 0.01, "{:?}: {end:?}", model.response);
        assert!(end.velocity.z.abs() < 5e-5, "{:?}: {end:?}", model.response);
    }
}

#[test]
fn what_is_no_seam_is_felt() {
    for model in models() {
        // A step of a tenth of the radius stops what comes slowly; a wall stops all.
        for high in [0.05, 2.0] {
            let mut world = World::<f64>::default();
            world.set_model(model).unwrap();
            world.walls.insert(slab(0.0)).unwrap();
            let (min, max) = (Point3::new(1.0, -1.0, -5.0), Point3::new(9.0, high, 5.0));
            world.walls.insert(Aabb::new(min, max).unwrap()).unwrap();
            let id = world.marbles.insert(ball_at([0.0, 0.5, 0.0], [0.3, 0.0, 0.0])).unwrap();
            world.marbles.set_material(id, Some(smooth())).unwrap();
            let mut farthest: f64 = 0.0;
            for _ in 0..300 {
                world.step(DT).unwrap();
                farthest = farthest.max(world.marbles.get(id).unwrap().position.x);
            }
            let edge = 1.0 - (0.25 - (0.5 - high.min(0.5)) * (0.5 - high.min(0.5))).sqrt();
            let off = farthest - edge;
            assert!(off.abs() < 0.02, "{:?} {high} m high: {off}", model.response);
        }
    }
}

#[test]
fn walls_can_be_moved_and_taken_out() {
    let mut world = World::<f64>::default();
    let floor = world.walls.insert(slab(0.0)).unwrap();
    let id = world.marbles.insert(ball_at([0.0, 0.5, 0.0], [0.0; 3])).unwrap();
    world.step(DT).unwrap();
    assert_eq!(world.contacts.wm.len(), 1);
    world.walls.set(floor, slab(-3.0)).unwrap();
    world.step(DT).unwrap();
    assert_eq!(world.contacts.wm.len(), 0, "it is three metres below");
    world.walls.set(floor, slab(0.2)).unwrap();
    world.step(DT).unwrap();
    let y = world.marbles.get(id).unwrap().position.y;
    assert!((y - 0.7).abs() < 1e-12, "pushed out: {y}");
    // It may become a half-space, and a box again, beside others.
    world.marbles.set_velocity(id, Vec3::zero()).unwrap();
    let below = world.walls.insert(Plane::new(Vec3::unit_y(), -9.0).unwrap()).unwrap();
    world.walls.set(floor, Plane::new(Vec3::unit_y(), y - 0.4).unwrap()).unwrap();
    world.step(DT).unwrap();
    assert_eq!(world.contacts.wm.len(), 1, "the half-space that it is now");
    world.walls.set(floor, slab(-3.0)).unwrap();
    world.step(DT).unwrap();
    assert_eq!(world.contacts.wm.len(), 0);
    world.walls.set(floor, slab(0.2)).unwrap();
    world.walls.remove(below).unwrap();
    assert_eq!(world.walls.remove(floor).unwrap(), slab(0.2).into());
    world.step(DT).unwrap();
    assert_eq!(world.contacts.wm.len(), 0);
    let nan = Sphere { center: Point3::new(0.0, f64::NAN, 0.0), radius: 1.0 };
    let error = world.walls.insert(nan).unwrap_err();
    assert_eq!(error.to_string(), "center.y must be finite, but is NaN");
    assert!(world.walls.is_empty());
}

#[test]
fn nothing_fast_passes_through_a_thin_wall() {
    for model in models() {
        if matches!(model.response, Response::Penalty(_)) {
            continue; // its forces need time
        }
        let swept = Model { detection: Detection::Swept, substeps: 1, ..model };
        for (name, wall) in floors() {
            // A floor a tenth of a radius thick, and what is thin already.
            let thin = match wall {
                WallShape::Solid(Shape::Aabb(aabb)) => {
                    let min = Point3::new(aabb.min.x, -0.05, aabb.min.z);
                    Aabb::new(min, aabb.max).unwrap().into()
                }
                other => other,
            };
            for speed in [30.0, 300.0, 3_000.0] {
                let mut world = World::<f64>::default();
                world.set_model(swept).unwrap();
                world.walls.insert(thin.clone()).unwrap();
                let velocity = [0.3 * speed, -speed, 0.1 * speed];
                let start = [-0.3 * 1.7, 2.3, -0.17];
                let id = world.marbles.insert(ball_at(start, velocity)).unwrap();
                for _ in 0..3 {
                    world.step(DT).unwrap();
                    let at = world.marbles.get(id).unwrap().position;
                    let over = at.x.abs() < 5.0 && at.z.abs() < 5.0;
                    let what = format!("{name} {:?} at {speed} m/s", model.response);
                    assert!(!over || at.y > 0.45, "{what}: {at:?}");
                    if !over {
                        break;
                    }
                }
            }
        }
    }
}

/// Shoots a ball at the sides and the bottom of a landscape that falls inward from its border.
fn meets_the_sides<S: Scalar>(model: Model) {
    let number = S::from_f64;
    let heights = [1.0, 1.0, 1.0, 1.0, -0.9, 1.0, 1.0, 1.0, 1.0].map(number).to_vec();
    let corner = Point3::from([S::zero(); 3]);
    let field = HeightField::new(corner, [S::one(); 2], 3, heights).unwrap();
    let bottom = -0.9 - (8.0_f64 + 1.9 * 1.9).sqrt();
    let radius = 0.1;
    for axis in 0..3 {
        for away in [-1.0, 1.0] {
            let [low, high] = if axis == 1 { [bottom, f64::INFINITY] } else { [0.0, 2.0] };
            let border = if away < 0.0 { low } else { high };
            if border.is_infinite() {
                continue; // the top
            }
            let (mut start, mut velocity) = ([1.1, 0.8, 0.9], [0.0; 3]);
            start[axis] = border + away * 0.3;
            velocity[axis] = -away * 2.0;
            let mut world = World::<S>::default();
            world.set_model(model).unwrap();
            world.set_gravity(Vec3::from([S::zero(); 3])).unwrap();
            world.walls.insert(field.clone()).unwrap();
            let marble = Marble::new(start.map(number).into(), number(radius));
            let marble = Marble { velocity: velocity.map(number).into(), ..marble };
            let id = world.marbles.insert(marble).unwrap();
            let what = format!("{:?}, axis {axis}, {away}", model.response);
            for step in 0..60 {
                world.step(number(DT)).unwrap();
                let at = world.marbles.position()[0];
                let gap = (at[axis].as_f64() - border) * away - radius;
                assert!(gap > -0.5 * radius, "{what}: {gap} in step {step}");
                for contact in &world.contacts.wm {
                    let normal = contact.normal[axis].as_f64() * away;
                    assert!(normal > 0.999, "{what}: {:?}", contact.normal);
                }
            }
            let end = world.marbles.get(id).unwrap();
            assert!(end.velocity[axis].as_f64() * away > -1e-3, "{what}: {:?}", end.velocity);
            let aside = (0..3).filter(|i| *i != axis).map(|i| end.velocity[i].as_f64().abs());
            assert!(aside.fold(0.0, f64::max) < 1e-3, "{what}: {:?}", end.velocity);
        }
    }
}

#[test]
fn the_sides_and_the_bottom_of_a_height_field_stop_a_ball() {
    let soft = Model { response: Response::SoftStep, ..Model::default() };
    for model in models().into_iter().chain([soft]) {
        meets_the_sides::<f64>(model);
        meets_the_sides::<f32>(model);
    }
}
