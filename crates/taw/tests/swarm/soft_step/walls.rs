//! Boxes and meshes hold what falls on them as half-spaces do, and keep in what is struck.

use taw::prelude::*;
use taw::shape::{Aabb, Mesh};

use super::world;

/// The faces of a box, which look inward.
fn mesh_box(half: f32) -> Mesh<f32> {
    let corner = |i: u32| {
        let [x, y, z] = [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { half } else { -half });
        Point3::new(x, y, z)
    };
    let faces =
        [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let triangles = faces.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Mesh::new((0..8).map(corner).collect(), triangles).unwrap()
}

/// A flat floor at height zero, in three forms.
fn floors(world: &mut World<f32>, form: usize) {
    match form {
        0 => world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()),
        1 => world
            .walls
            .insert(Aabb { min: Point3::new(-5.0, -1.0, -5.0), max: Point3::new(5.0, 0.0, 5.0) }),
        _ => {
            let corners = [[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]];
            let corners = corners.map(|[x, z]| Point3::new(x, 0.0, z)).to_vec();
            world.walls.insert(Mesh::new(corners, vec![[0, 2, 1], [0, 3, 2]]).unwrap())
        }
    }
    .unwrap();
}

#[test]
fn nothing_sinks_into_a_floor_that_it_falls_on() {
    for substeps in [1, 2, 4] {
        for (radius, restitution) in [(0.1, 0.0), (0.1, 0.8), (0.02, 0.0), (0.02, 0.8)] {
            let mut most = 0.0; // by a half-space
            for form in 0..3 {
                let mut deepest: f32 = 0.0;
                for i in 0..40_u16 {
                    let mut world = world::<f32>(substeps);
                    floors(&mut world, form);
                    let material = Material { restitution, ..Material::default() };
                    let at = Point3::new(0.3, radius + 0.4 + 0.13 * f32::from(i), -0.2);
                    let ball = Marble { material: Some(material), ..Marble::new(at, radius) };
                    let id = world.marbles.insert(ball).unwrap();
                    for _ in 0..100 {
                        world.step(1.0 / 60.0).unwrap();
                        let height = world.marbles.get(id).unwrap().position.y;
                        deepest = deepest.max(1.0 - height / radius);
                    }
                }
                let what = format!("{substeps} substeps, radius {radius}, {restitution}, {form}");
                println!("{what}: {deepest:.4} of the radius");
                most = if form == 0 { deepest } else { most };
                assert!(deepest < most + 0.05, "{what}: {deepest} of the radius, not {most}");
            }
        }
    }
}

#[test]
fn what_is_struck_stays_in_a_box_of_triangles() {
    let mut escaped = 0;
    for seed in 0..400_u32 {
        let mut random = seed.wrapping_mul(0x9e37_79b9) | 1;
        let mut next = || {
            random ^= random << 13;
            random ^= random >> 17;
            random ^= random << 5;
            random as f32 / u32::MAX as f32 * 2.0 - 1.0
        };
        let mut world = world::<f32>(1 << (seed % 4));
        world.walls.insert(mesh_box(0.41)).unwrap();
        let material = Material { friction: 0.4, restitution: 0.3, ..Material::default() };
        let ids: Vec<_> = (0..8_u16)
            .map(|i| {
                let side = |bit: u16| if i >> bit & 1 == 1 { 0.2 } else { -0.2 };
                let ball = Marble {
                    velocity: Vec3::new(next(), next(), next()) * 60.0,
                    angular_velocity: Vec3::new(next(), next(), next()) * 400.0,
                    mass: Mass::Kilograms(if i == 0 { 1e3 } else { 3.0 }),
                    material: Some(material),
                    ..Marble::new(Point3::new(side(0), side(1), side(2)), 0.07)
                };
                world.marbles.insert(ball).unwrap()
            })
            .collect();
        for _ in 0..60 {
            world.step(1.0 / 60.0).unwrap();
        }
        let outside = |id: &&MarbleId| {
            let at = world.marbles.get(**id).unwrap().position;
            at.x.abs().max(at.y.abs()).max(at.z.abs()) > 0.41
        };
        let gone = ids.iter().filter(outside).count();
        if gone > 0 {
            println!("seed {seed}: {gone} of 8 left");
            escaped += gone;
        }
    }
    assert_eq!(escaped, 0);
}
