//! Distances of pairs.

use taw::contact::closest_points_of_plane;
use taw::prelude::*;

use super::cases::Def::{self, Ball, Block, Rod, Tri};
use super::cases::{O, Place, STRAIGHT, Tally, ULP, finite};
use crate::things::Thing;
#[test]
fn spheres() {
    let mut tally = Tally::default();
    let at = |x: f64| [x, 0.0, 0.0];
    tally.pairs(&[
        (Ball(O, 0.5), Ball(O, 0.5), -1.0),
        (Ball(O, 0.5), Ball(O, 0.25), -0.75),
        (Ball(O, 0.5), Ball(at(ULP), 0.5), ULP - 1.0),
        (Ball(O, 0.5), Ball(at(f64::from(f32::EPSILON)), 0.5), f64::from(f32::EPSILON) - 1.0),
        (Ball(O, 0.5), Ball(at(1e-40), 0.5), -1.0),
        (Ball(O, 0.5), Ball([1e-40, -1e-42, 1e-45], 0.5), -1.0),
        (Ball(O, 0.5), Ball(at(1e-310), 0.5), -1.0),
        (Ball(O, 0.5), Ball(at(1.0), 0.5), 0.0),
        (Ball(O, 0.5), Ball(at(1.0 + ULP), 0.5), ULP),
        (Ball(O, 0.5), Ball(at(1.0 - ULP), 0.5), -ULP),
        (Ball(O, 0.5), Ball([0.6, 0.8, 0.0], 0.5), 0.0),
        (Ball(O, 0.5), Ball(at(0.1), 0.01), -0.41),
        (Ball(O, 0.5), Ball(at(0.25), 0.25), -0.5),
        (Ball([1e6, 0.0, 0.0], 1e6), Ball(O, 1.0), -1.0),
        (Ball([1e6, 0.0, 0.0], 1e6), Ball(at(-1.0), 1.0), 0.0),
        (Ball(O, 0.5), Ball(at(1e6), 0.5), 1e6 - 1.0),
    ]);
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let origin = Point3::new(0.0, 0.0, 0.0);
        tally.check(Sphere::new(origin, radius).is_err(), || format!("a radius of {radius}"));
    }
    tally.end("1, spheres");
}

const CUBE: Def = Block(O, [1.0; 3], STRAIGHT);
const TALL: Def = Block(O, [1.0, 2.0, 3.0], STRAIGHT);
const ROD: Def = Rod([0.0, -1.0, 0.0], [0.0, 1.0, 0.0], 0.5);
const FLAT: Def = Tri([[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 0.0, 1.0]]);

/// A sphere, another shape, and their distance.
const SPHERES_AND_OTHERS: &[(Def, Def, f64)] = &[
    // On a face, an edge and a corner, within, and without.
    (Ball([1.0, 0.0, 0.0], 0.5), CUBE, -0.5),
    (Ball([1.0, 1.0, 0.0], 0.5), CUBE, -0.5),
    (Ball([1.0, 1.0, 1.0], 0.5), CUBE, -0.5),
    (Ball([1.5, 0.0, 0.0], 0.5), CUBE, 0.0),
    (Ball([1.5 + ULP, 0.0, 0.0], 0.5), CUBE, ULP),
    (Ball([2.0, 2.0, 0.0], 0.5), CUBE, std::f64::consts::SQRT_2 - 0.5),
    (Ball([2.0, 2.0, 2.0], 0.5), CUBE, 1.732_050_807_568_877_2 - 0.5),
    (Ball([2.0, 1.0, 0.0], 0.5), CUBE, 0.5),
    (Ball([0.9, 0.0, 0.0], 0.5), CUBE, -0.6),
    (Ball([0.9, 0.9, 0.9], 0.5), CUBE, -0.6),
    (Ball([0.5, 0.5, 0.0], 0.5), CUBE, -1.0),
    // In the middle, with one, two and three half widths that are as short.
    (Ball(O, 0.5), TALL, -1.5),
    (Ball(O, 0.5), Block(O, [1.0, 1.0, 3.0], STRAIGHT), -1.5),
    (Ball(O, 0.5), CUBE, -1.5),
    (Ball(O, 1e-3), CUBE, -1.001),
    (Ball(O, 100.0), CUBE, -101.0),
    (Ball([1e4, 0.0, 0.0], 1e4), Block(O, [1e-2; 3], STRAIGHT), -1e-2),
    // Long and thin, and of no extent at all.
    (Ball([0.0, 1.0, 0.0], 0.5), Block(O, [1e3, 1e-3, 1e-3], STRAIGHT), 0.5 - 1e-3),
    (Ball([0.0, 1.0, 0.0], 0.5), Block(O, [1.0, 0.0, 1.0], STRAIGHT), 0.5),
    (Ball(O, 0.5), Block(O, [1.0, 0.0, 1.0], STRAIGHT), -0.5),
    (Ball([0.0, 1.0, 0.0], 0.5), Block(O, [0.0; 3], STRAIGHT), 0.5),
    (Ball(O, 0.5), Block(O, [0.0; 3], STRAIGHT), -0.5),
    // On the line of a capsule, at its end, beside it.
    (Ball(O, 0.5), ROD, -1.0),
    (Ball([0.0, 1.0, 0.0], 0.5), ROD, -1.0),
    (Ball([0.0, 2.0, 0.0], 0.5), ROD, 0.0),
    (Ball([1.0, 0.3, 0.0], 0.5), ROD, 0.0),
    (Ball([1.0, 1.0, 0.0], 0.5), ROD, 0.0),
    (Ball([3.0, 5.0, 0.0], 0.5), ROD, 4.0),
    // Triangles: over one, on it, on an edge, on a corner; slivers, lines and points.
    (Ball([0.0, 0.5, 0.0], 0.5), FLAT, 0.0),
    (Ball(O, 0.5), FLAT, -0.5),
    (Ball([0.0, 0.0, -1.0], 0.5), FLAT, -0.5),
    (Ball([0.0, 0.0, 1.0], 0.5), FLAT, -0.5),
    (Ball([0.0, 0.0, -2.0], 0.5), FLAT, 0.5),
    (Ball([0.0, 3.0, 5.0], 0.5), FLAT, 4.5),
    (Ball([0.0, 1.0, 0.0], 0.5), Tri([[-1.0, 0.0, 0.0], [1.0, 0.0, 1e-9], [1.0, 0.0, 0.0]]), 0.5),
    (Ball([0.0, 1.0, 0.0], 0.5), Tri([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.0, 0.0]]), 0.5),
    (Ball([0.5, 0.0, 0.0], 0.5), Tri([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.0, 0.0]]), -0.5),
    (Ball([0.0, 1.0, 0.0], 0.5), Tri([O; 3]), 0.5),
    (Ball(O, 0.5), Tri([O; 3]), -0.5),
    (Ball([2.0, 0.0, 0.0], 0.5), Def::Hull(O, [1.0; 3]), 0.5),
    (Ball([1.0, 1.0, 1.0], 0.5), Def::Hull(O, [1.0; 3]), -0.5),
    (Ball(O, 0.5), Def::Hull(O, [1.0, 1.0, 1.0]), -1.5),
];

#[test]
fn spheres_and_others() {
    let mut tally = Tally::default();
    tally.pairs(SPHERES_AND_OTHERS);
    for place in Place::all() {
        for (height, gap) in [(0.5, 0.0), (0.0, -0.5), (-3.0, -3.5), (1.0, 0.5), (0.5 + ULP, ULP)] {
            let normal: Vec3<f64> = place.vector([0.0, 1.0, 0.0]);
            let floor = Plane::through(place.point::<f64>(O), normal).unwrap();
            let Thing::Sphere(ball) = Ball([7.0, height, -3.0], 0.5).thing::<f64>(&place) else {
                continue;
            };
            let found = closest_points_of_plane(&floor, &ball);
            let off = (found.distance - gap * place.scale).abs();
            tally.check(finite(&found) && off <= 4.0 * place.tolerance::<f64>(10.0), || {
                format!("a plane at {height}, {place:?}: {found:?}")
            });
        }
    }
    tally.end("2, spheres and others");
}

#[test]
fn capsules() {
    let mut tally = Tally::default();
    let up = |x: f64, from: f64, to: f64| Rod([x, from, 0.0], [x, to, 0.0], 0.5);
    let across = |y: f64, z: f64| Rod([-1.0, y, z], [1.0, y, z], 0.5);
    let dot = |x: f64| Rod([x, 0.0, 0.0], [x, 0.0, 0.0], 0.5);
    let block = Block(O, [2.0, 0.5, 2.0], STRAIGHT);
    tally.pairs(&[
        (dot(0.0), dot(0.75), -0.25),
        (dot(0.0), dot(1.0), 0.0),
        (dot(0.0), dot(0.0), -1.0),
        (dot(1.5), up(0.0, -1.0, 1.0), 0.5),
        (dot(0.0), up(0.0, -1.0, 1.0), -1.0),
        (up(0.0, -1.0, 1.0), up(0.8, -1.0, 1.0), -0.2),
        (up(0.0, -1.0, 1.0), up(0.8, 0.0, 3.0), -0.2),
        (up(0.0, -1.0, 1.0), up(2.0, -1.0, 1.0), 1.0),
        (up(0.0, -1.0, 1.0), up(0.0, 2.0, 3.0), 0.0),
        (up(0.0, -1.0, 1.0), up(0.0, 1.5, 3.0), -0.5),
        (up(0.0, -1.0, 1.0), up(0.0, 3.0, 4.0), 1.0),
        (up(0.0, -1.0, 1.0), up(0.0, -1.0, 1.0), -1.0),
        (up(0.0, -1.0, 1.0), up(0.0, 0.0, 3.0), -1.0),
        (up(0.0, -1.0, 1.0), across(0.0, 0.0), -1.0),
        (up(0.0, -1.0, 1.0), across(0.5, 0.0), -1.0),
        (up(0.0, -1.0, 1.0), across(1.0, 0.0), -1.0),
        (up(0.0, -1.0, 1.0), across(0.0, 1e-9), 1e-9 - 1.0),
        (up(0.0, -1.0, 1.0), across(0.0, 1.0), 0.0),
        (up(0.0, -1.0, 1.0), Rod([1.0, -1.0, 0.0], [1.0 + 1e-9, 1.0, 0.0], 0.5), 0.0),
        // Lying on a box, standing on it, through it, along its edge.
        (block, across(1.0, 0.0), 0.0),
        (block, across(0.9, 0.0), -0.1),
        (block, up(0.0, 1.0, 3.0), 0.0),
        (block, up(0.0, -3.0, 3.0), -2.5),
        (block, up(0.0, -1.0, 3.0), -2.0),
        (block, up(2.0, -1.0, 1.0), -0.5),
        (block, Rod([-2.0, 0.5, 2.0], [2.0, 0.5, 2.0], 0.5), -0.5),
        (block, Rod([-2.0, 1.1, 2.8], [2.0, 1.1, 2.8], 0.5), 0.5),
        (Tri([[-2.0, 0.0, -2.0], [2.0, 0.0, -2.0], [0.0, 0.0, 2.0]]), across(0.5, 0.0), 0.0),
        (Tri([[-2.0, 0.0, -2.0], [2.0, 0.0, -2.0], [0.0, 0.0, 2.0]]), across(0.0, 0.0), -0.5),
    ]);
    tally.end("3, capsules");
}

#[test]
fn boxes() {
    let mut tally = Tally::default();
    let cube = |x: f64, y: f64| Block([x, y, 0.0], [0.5; 3], STRAIGHT);
    let turned =
        |x: f64, y: f64, axis: [f64; 3], angle: f64| Block([x, y, 0.0], [0.5; 3], (axis, angle));
    let (y, z) = ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let quarter = std::f64::consts::FRAC_PI_4;
    let d2 = 2.0_f64.sqrt();
    tally.pairs(&[
        (cube(0.0, 0.0), cube(0.0, 0.0), -1.0),
        (cube(0.0, 0.0), cube(0.9, 0.0), -0.1),
        (cube(0.0, 0.0), cube(1.0, 0.0), 0.0),
        (cube(0.0, 0.0), cube(1.0, 1.0), 0.0),
        (cube(0.0, 0.0), cube(0.8, 0.8), -0.2),
        (cube(0.0, 0.0), cube(2.0, 0.0), 1.0),
        (cube(0.0, 0.0), cube(2.0, 2.0), d2),
        (cube(0.0, 0.0), turned(1.0, 0.0, y, 1e-7), -0.5e-7),
        (cube(0.0, 0.0), turned(0.9, 0.0, z, 1e-7), -0.1 - 0.5e-7),
        (cube(0.0, 0.0), turned(0.0, 0.9, [0.6, 0.0, 0.8], 1e-12), -0.1),
        (cube(0.0, 0.0), turned(0.0, 0.0, y, quarter), -1.0),
        // An edge on a face, an edge on an edge, an edge where the face is as near.
        (cube(0.0, 0.0), turned(0.5 + d2 / 2.0, 0.0, z, quarter), 0.0),
        (cube(0.0, 0.0), turned(0.4 + d2 / 2.0, 0.0, z, quarter), -0.1),
        (turned(0.0, 0.0, z, quarter), turned(d2, 0.0, y, quarter), 0.0),
        (turned(0.0, 0.0, z, quarter), turned(d2 - 0.1, 0.0, y, quarter), -0.1),
        (turned(0.0, 0.0, z, quarter), turned(d2 + 0.1, 0.0, y, quarter), 0.1),
        // Flat ones, lines and points.
        (cube(0.0, 0.0), Block([0.0, 0.5, 0.0], [1.0, 0.0, 1.0], STRAIGHT), 0.0),
        (cube(0.0, 0.0), Block([0.0, 0.4, 0.0], [1.0, 0.0, 1.0], STRAIGHT), -0.1),
        (cube(0.0, 0.0), Block([0.0, 1.0, 0.0], [1.0, 0.0, 0.0], STRAIGHT), 0.5),
        (cube(0.0, 0.0), Block([0.0, 1.0, 0.0], [0.0; 3], STRAIGHT), 0.5),
        (Block(O, [1.0, 0.0, 1.0], STRAIGHT), Block(O, [1.0, 0.0, 1.0], STRAIGHT), 0.0),
        (Block(O, [1.0, 0.0, 1.0], STRAIGHT), Block(O, [1.0, 1.0, 0.0], STRAIGHT), -1.0),
        // A million times as long as wide.
        (cube(0.0, 0.0), Block([0.0, 1.0, 0.0], [1e3, 1e-3, 1e-3], STRAIGHT), 0.5 - 1e-3),
        (cube(0.0, 0.0), Block([0.0, 0.5, 0.0], [1e3, 1e-3, 1e-3], STRAIGHT), -1e-3),
        (
            Block(O, [1e3, 1e-3, 1e-3], STRAIGHT),
            Block([0.0, 2e-3, 0.0], [1e-3, 1e-3, 1e3], STRAIGHT),
            0.0,
        ),
        (Def::Hull(O, [0.5; 3]), cube(0.9, 0.0), -0.1),
        (Def::Hull(O, [0.5; 3]), Def::Hull([1.0, 0.0, 0.0], [0.5; 3]), 0.0),
        (Def::Hull(O, [0.5; 3]), Def::Hull([2.0, 2.0, 0.0], [0.5; 3]), d2),
        (Def::Hull(O, [0.5; 3]), Def::Hull([0.1, 0.2, 0.3], [0.5; 3]), -0.7),
        (Def::Hull(O, [0.5; 3]), Tri([[-9.0, 0.4, -9.0], [9.0, 0.4, -9.0], [0.0, 0.4, 9.0]]), -0.1),
    ]);
    tally.end("4, boxes");
}
