//! Shapes, and what is known of them, as lines.

use bevy::color::palettes::tailwind;
use bevy::prelude::*;
use bevy_taw::taw::math::Point3;
use bevy_taw::taw::shape::{Shape, Surface};

use crate::gallery::{Ground, Scene, ask, bevy_point, bevy_vector, ground, second, shape};

pub fn draw(scene: Res<Scene>, mut gizmos: Gizmos) {
    let (blue, orange) = (tailwind::SKY_400, tailwind::ORANGE_400);
    match ground(scene.kinds[0]) {
        Some(Ground::Plane(_)) => {
            gizmos.grid(
                Quat::from_rotation_x(1.570_796_4),
                UVec2::splat(12),
                Vec2::splat(0.5),
                blue,
            );
        }
        Some(Ground::Mesh(mesh)) => draw_surface(&mesh, &mut gizmos, blue),
        Some(Ground::HeightField(field)) => draw_surface(&field, &mut gizmos, blue),
        None => {
            if let Some(first) = shape(scene.kinds[0]) {
                draw_shape(&first, Vec3::ZERO, &mut gizmos, blue);
            }
        }
    }
    let (Some(b), Some(answers)) = (second(&scene), ask(&scene)) else { return };
    draw_shape(&b, Vec3::ZERO, &mut gizmos, orange);
    if let Some(found) = answers.closest {
        let (from, to) = (bevy_point(found.on_a), bevy_point(found.on_b));
        gizmos.line(from, to, tailwind::YELLOW_300);
        for point in [from, to] {
            gizmos.sphere(point, 0.03, tailwind::YELLOW_300);
        }
        if let Some(mtv) = found.mtv() {
            gizmos.arrow(from, from + bevy_vector(mtv), tailwind::YELLOW_300);
            draw_shape(&b, bevy_vector(mtv), &mut gizmos, orange.with_alpha(0.25));
        }
    }
    for (point, ..) in answers.touches {
        gizmos.cross(point, 0.12, tailwind::RED_500);
    }
    let start = scene.place.translation;
    gizmos.arrow(start, start + scene.way, tailwind::SLATE_500);
    if let Some((time, point, normal)) = answers.impact {
        draw_shape(&b, scene.way * time, &mut gizmos, tailwind::GREEN_400.with_alpha(0.5));
        gizmos.arrow(point, point + normal * 0.4, tailwind::GREEN_400);
    }
}

fn draw_surface(surface: &impl Surface<f32>, gizmos: &mut Gizmos, colour: Srgba) {
    surface.for_each_in_box(&surface.bounds(), |number| {
        if let Some(triangle) = surface.triangle(number) {
            let [a, b, c] = triangle.corners.map(bevy_point);
            gizmos.linestrip([a, b, c, a], colour.with_alpha(0.6));
        }
    });
}

fn draw_shape(shape: &Shape<f32>, by: Vec3, gizmos: &mut Gizmos, colour: Srgba) {
    let point = |p: Point3<f32>| bevy_point(p) + by;
    match shape {
        Shape::Sphere(it) => {
            gizmos.sphere(point(it.center), it.radius, colour).resolution(48);
        }
        Shape::Aabb(it) => draw_shape(&Shape::Obb(it.obb()), by, gizmos, colour),
        Shape::Obb(it) => {
            let corners = it.corners().map(point);
            for (i, corner) in corners.iter().enumerate() {
                for bit in [1, 2, 4] {
                    if i & bit == 0 {
                        gizmos.line(*corner, corners[i | bit], colour);
                    }
                }
            }
        }
        Shape::Capsule(it) => {
            let (a, b) = (point(it.a), point(it.b));
            let isometry = Isometry3d::new(
                (a + b) / 2.0,
                Quat::from_rotation_arc(Vec3::Y, (b - a).normalize_or(Vec3::Y)),
            );
            let capsule = Capsule3d::new(it.radius, a.distance(b));
            gizmos.primitive_3d(&capsule, isometry, colour).resolution(12);
        }
        Shape::Hull(it) => {
            let corners: Vec<_> = it.points().map(point).collect();
            for [a, b] in it.edges() {
                gizmos.line(corners[*a as usize], corners[*b as usize], colour);
            }
        }
        Shape::Compound(it) => {
            it.parts().iter().for_each(|part| draw_shape(part, by, gizmos, colour));
        }
    }
}
