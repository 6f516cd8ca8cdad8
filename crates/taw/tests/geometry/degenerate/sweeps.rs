//! Sweeps and rays.

use taw::contact::{RayCast, RayHit, shape_cast};
use taw::frame::Ray;
use taw::math::cast_vector;
use taw::prelude::*;

use super::cases::Def::{self, Ball, Block, Rod, Tri};
use super::cases::{O, Place, STRAIGHT, Tally};
use crate::things::Thing;
/// Expected result of a sweep: a time, none, or, where rounding decides, either.
#[derive(Clone, Copy, Debug)]
enum When {
    At(f64),
    Never,
    Either,
}

impl Tally {
    fn sweep<S: Scalar>(
        &mut self,
        (a, a_moves): (Def, [f64; 3]),
        (b, b_moves): (Def, [f64; 3]),
        when: When,
        place: &Place,
    ) {
        let (x, y) = (a.thing::<S>(place), b.thing::<S>(place));
        let moves = |v: [f64; 3]| cast_vector::<f64, S>(place.vector(v));
        let (p, q) = (moves(a_moves), moves(b_moves));
        let one = each!(&x, x => each!(&y, y => shape_cast(x, p, y, q)));
        let other = each!(&x, x => each!(&y, y => shape_cast(y, q, x, p)));
        let apart = place.vector(b_moves) - place.vector(a_moves);
        let speed = one
            .map_or(apart.magnitude(), |touch| apart.dot(touch.normal.map(Scalar::as_f64)).abs());
        let size = a.size() + b.size() + Vec3::from(a_moves).magnitude();
        // A way of rounding takes a time of rounding.
        let tolerance = 64.0 * place.tolerance::<S>(size) / speed.max(f64::MIN_POSITIVE) + 1e-9;
        let right = match (when, one) {
            (When::At(time), Some(touch)) => (touch.time.as_f64() - time).abs() <= tolerance,
            // Rounding may let it pass, or touch too early.
            (When::At(time), None) => time > 1.0 - tolerance || time < tolerance,
            (When::Never, found) => found.is_none() || tolerance > 0.1,
            (When::Either, _) => true,
        };
        let what = |why: &str| format!("{a:?} and {b:?}, {place:?}: {why}: {one:?} {other:?}");
        self.check(right, || what("at another time"));
        let sane = one.is_none_or(|touch| touch.time >= S::zero() && touch.time <= S::one());
        self.check(sane, || what("no part of the way"));
        let both = match (one, other) {
            (Some(one), Some(other)) => {
                (one.time - other.time).abs().as_f64() <= tolerance.min(1.0)
            }
            (None, None) => true,
            _ => !matches!(when, When::At(time) if time > tolerance && time < 1.0 - tolerance),
        };
        self.check(both, || what("depends on the order"));
    }
}

/// Two shapes with their displacements, and when they touch.
type Sweep = ((Def, [f64; 3]), (Def, [f64; 3]), When);

fn sweeps_of_spheres() -> Vec<Sweep> {
    use When::{At, Either, Never};
    let ball = |x: f64, y: f64| Ball([x, y, 0.0], 0.5);
    let right = |v: f64| [v, 0.0, 0.0];
    let far = [1e6, 1e6, -1e6];
    let further = [1e6 + 4.0, 1e6, -1e6];
    let graze = (50.0 - (1.0 - (1.0 - 1e-4_f64).powi(2)).sqrt()) / 100.0;
    vec![
        ((ball(0.0, 0.0), O), (ball(3.0, 0.0), O), Never),
        ((ball(0.0, 0.0), O), (ball(1.0, 0.0), O), Never),
        ((ball(0.0, 0.0), O), (ball(0.5, 0.0), O), Never),
        ((ball(0.0, 0.0), O), (ball(0.0, 0.0), O), Never),
        ((ball(0.0, 0.0), O), (ball(0.5, 0.0), right(1.0)), Never),
        ((ball(0.0, 0.0), O), (ball(1.0, 0.0), right(1.0)), Never),
        ((ball(0.0, 0.0), right(1.0)), (ball(0.5, 0.0), O), At(0.0)),
        ((ball(0.0, 0.0), right(4.0)), (ball(3.0, 0.0), O), At(0.5)),
        ((ball(0.0, 0.0), right(2.0)), (ball(3.0, 0.0), O), At(1.0)),
        ((ball(0.0, 0.0), right(1.9)), (ball(3.0, 0.0), O), Never),
        ((ball(0.0, 0.0), right(1.0)), (ball(1.0, 0.0), O), At(0.0)),
        ((ball(0.0, 0.0), right(1e6)), (ball(3.0, 0.0), O), At(2e-6)),
        ((ball(0.0, 0.0), right(1e-310)), (ball(3.0, 0.0), O), Never),
        ((ball(0.0, 0.0), far), (ball(3.0, 0.0), far), Never),
        ((ball(0.0, 0.0), further), (ball(3.0, 0.0), far), Either),
        ((ball(0.0, 0.0), right(100.0)), (ball(50.0, 1.0 - 1e-4), O), At(graze)),
        ((ball(0.0, 0.0), right(100.0)), (ball(50.0, 1.0 + 1e-4), O), Never),
        ((ball(0.0, 0.0), right(100.0)), (ball(50.0, 1.0 - 1e-6), O), Either),
        ((ball(0.0, 0.0), right(100.0)), (ball(50.0, 1.0 + 1e-6), O), Never),
        ((ball(0.0, 0.0), right(100.0)), (ball(50.0, 1.0 + 1e-7), O), Either),
        ((ball(0.0, 0.0), right(100.0)), (ball(50.0, 1.0 - 1e-7), O), Either),
        ((ball(0.0, 0.0), right(4.0)), (Block([3.0, 0.0, 0.0], [0.5; 3], STRAIGHT), O), At(0.5)),
        ((ball(0.0, 0.0), O), (Block([0.5, 0.0, 0.0], [0.5; 3], STRAIGHT), right(1.0)), Never),
        ((ball(0.0, 0.0), right(4.0)), (Def::Hull([3.0, 0.0, 0.0], [0.5; 3]), O), At(0.5)),
        (
            (ball(0.0, 0.0), right(4.0)),
            (Tri([[2.5, -9.0, -9.0], [2.5, 9.0, -9.0], [2.5, 0.0, 9.0]]), O),
            At(0.5),
        ),
    ]
}

fn sweeps_of_others() -> Vec<Sweep> {
    use When::{At, Either};
    let right = |v: f64| [v, 0.0, 0.0];
    vec![
        (
            (Block(O, [0.5; 3], STRAIGHT), right(4.0)),
            (Block([3.0, 0.0, 0.0], [0.5; 3], STRAIGHT), O),
            At(0.5),
        ),
        // Along a face that it lies on.
        (
            (Block(O, [5.0, 0.5, 5.0], STRAIGHT), O),
            (Block([0.0, 1.0, 0.0], [0.5; 3], STRAIGHT), right(2.0)),
            Either,
        ),
        (
            (Rod([0.0, -1.0, 0.0], [0.0, 1.0, 0.0], 0.5), right(4.0)),
            (Rod([3.0, 0.0, -1.0], [3.0, 0.0, 1.0], 0.5), O),
            At(0.5),
        ),
        (
            (Rod([0.0, -1.0, 0.0], [0.0, 1.0, 0.0], 0.5), right(4.0)),
            (Rod([3.0, -1.0, 0.0], [3.0, 1.0, 0.0], 0.5), O),
            At(0.5),
        ),
    ]
}

#[test]
fn sweeps() {
    let mut tally = Tally::default();
    let cases = [sweeps_of_spheres(), sweeps_of_others()].concat();
    for place in Place::all() {
        for (a, b, when) in cases.iter().copied() {
            tally.sweep::<f32>(a, b, when, &place);
            tally.sweep::<f64>(a, b, when, &place);
        }
    }
    tally.end("5, sweeps");
}

fn cast<S: Scalar>(thing: &Thing<S>, ray: &Ray<S>, longest: S) -> Option<RayHit<S>> {
    match thing {
        Thing::Sphere(it) => it.cast_ray(ray, longest),
        Thing::Aabb(it) => it.cast_ray(ray, longest),
        Thing::Obb(it) => it.cast_ray(ray, longest),
        Thing::Capsule(it) => it.cast_ray(ray, longest),
        Thing::Hull(it) => it.cast_ray(ray, longest),
        Thing::Triangle(_) => None,
    }
}

impl Tally {
    fn ray<S: Scalar>(
        &mut self,
        def: Def,
        (from, along): ([f64; 3], [f64; 3]),
        longest: f64,
        when: When,
        place: &Place,
    ) {
        let thing = def.thing::<S>(place);
        let direction = place.pose.transform_vector(Vec3::from(along)).map(S::from_f64);
        let ray = Ray { origin: place.point(from), direction };
        let found = cast(&thing, &ray, S::from_f64(longest * place.scale));
        let far = Vec3::from(from).magnitude() + def.size();
        // A ray at a slant comes to the surface later than it is off.
        let tolerance = 64.0 * place.tolerance::<S>(far);
        let right = match (when, found) {
            (When::At(distance), Some(hit)) => {
                (hit.distance.as_f64() - distance * place.scale).abs() <= tolerance
            }
            (When::At(distance), None) => {
                distance * place.scale > longest * place.scale - tolerance
            }
            (When::Never, found) => found.is_none() || tolerance > 0.05 * place.scale,
            (When::Either, _) => true,
        };
        let what = || format!("{def:?} {ray:?} {place:?}: {found:?}, not {when:?}");
        self.check(right || tolerance > place.scale, what);
        let sane = found.is_none_or(|hit| {
            let length = hit.normal.map(Scalar::as_f64).magnitude();
            hit.distance >= S::zero() && hit.distance.is_finite() && (length - 1.0).abs() < 1e-5
        });
        self.check(sane, what);
    }
}

#[test]
fn rays() {
    use When::{At, Either, Never};
    let mut tally = Tally::default();
    let inf = f64::INFINITY;
    let (x, y) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    let ball = Ball(O, 1.0);
    let cube = Block(O, [1.0; 3], STRAIGHT);
    let hull = Def::Hull(O, [1.0; 3]);
    let rod = Rod([0.0, -1.0, 0.0], [0.0, 1.0, 0.0], 1.0);
    for place in Place::all() {
        for def in [ball, cube, hull, rod] {
            for (ray, longest, when) in [
                (([-4.0, 0.0, 0.0], x), inf, At(3.0)),
                (([-4.0, 0.0, 0.0], x), 3.0 + 1e-3, At(3.0)),
                (([-4.0, 0.0, 0.0], x), 2.9, Never),
                (([-4.0, 0.0, 0.0], [-1.0, 0.0, 0.0]), inf, Never),
                (([-4.0, 0.0, 0.0], O), inf, Never),
                (([-1.0, 0.0, 0.0], x), inf, At(0.0)),
                ((O, x), inf, At(0.0)),
                ((O, O), 1.0, Either),
                (([0.3, 0.2, 0.1], y), 1e-3, At(0.0)),
                (([-1e7, 0.0, 0.0], x), inf, At(1e7 - 1.0)),
                (([0.0, 1e7, 1e7], [0.0, -0.5_f64.sqrt(), -0.5_f64.sqrt()]), inf, Either),
                // Tangent: touched or just missed.
                (([-4.0, 0.0, 1.0], x), inf, Either),
                (([-4.0, 0.0, 1.0 + 1e-3], x), inf, Never),
                (([-4.0, 0.0, 1.0 - 1e-3], x), inf, Either),
                // Along the axis of the rod and the sides of the box.
                (([0.0, -9.0, 0.0], y), inf, Either),
                (([1.0, -9.0, 0.0], y), inf, Either),
                (([1.01, -9.0, 0.0], y), inf, Never),
            ] {
                tally.ray::<f32>(def, ray, longest, when, &place);
                tally.ray::<f64>(def, ray, longest, when, &place);
            }
        }
    }
    tally.end("6, rays");
}
