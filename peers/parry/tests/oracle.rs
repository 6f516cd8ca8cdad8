//! taw and parry3d asked for the distance of the same random pairs, in `f32`. Where they
//! differ by more than rounding, a search in `f64` that knows nothing but support functions
//! decides, and it must decide for taw.
//!
//! `cargo test --release -- --nocapture` prints how often, and by how much.

use cgmath::{EuclideanSpace, InnerSpace};
use parry3d::glamx::{Pose3, Quat as ParryQuat, Vec3 as ParryVec3};
use parry3d::query::contact;
use parry3d::shape as parry;
use taw::contact::{ClosestPoints, closest_points};
use taw::math::{Point3, Quat, Vec3};
use taw::shape::{BoundedShape, Capsule, Hull, Obb, Sphere};

/// Pairs of each two kinds.
const PAIRS: u32 = 4_000;
/// Rounding to `f32` of shapes of about four metres, and of both libraries.
const ROUNDING: f64 = 4e-6;

/// A shape in both libraries; in taw in both scalars.
struct Both {
    single: Taw<f32>,
    /// Shape with the numbers of the `f32`.
    double: Taw<f64>,
    parry: Box<dyn parry::Shape>,
    pose: Pose3,
}

enum Taw<S> {
    Sphere(Sphere<S>),
    Obb(Obb<S>),
    Capsule(Capsule<S>),
    Hull(Hull<S>),
}

macro_rules! each {
    ($thing:expr, $name:ident => $value:expr) => {
        match $thing {
            Taw::Sphere($name) => $value,
            Taw::Obb($name) => $value,
            Taw::Capsule($name) => $value,
            Taw::Hull($name) => $value,
        }
    };
}

const KINDS: [&str; 4] = ["sphere", "box", "capsule", "hull"];

fn random(kind: usize, random: &mut fastrand::Rng) -> Both {
    let mut signed = || random.f32() * 2.0 - 1.0;
    let at = [signed(), signed(), signed()];
    let turn = ParryQuat::from_xyzw(signed(), signed(), signed(), signed()).normalize();
    let sizes = [signed(), signed(), signed()].map(|x| 0.5 + 0.45 * x);
    let mut corners: Vec<[f32; 3]> = Vec::new();
    while corners.len() < 12 {
        corners.push([signed(), signed(), signed()]);
    }
    let pose = Pose3::from_parts(ParryVec3::from_array(at), turn);
    let [x, y, z, w] = turn.to_array();
    let (rotation, exact) = (
        Quat::new(w, x, y, z),
        Quat::new(f64::from(w), f64::from(x), f64::from(y), f64::from(z)).normalize(),
    );
    let center = Point3::from(at);
    let wide = |p: [f32; 3]| Vec3::from(p.map(f64::from));
    let middle = Point3::from_vec(wide(at));
    let (single, double, parry): (_, _, Box<dyn parry::Shape>) = match kind {
        0 => (
            Taw::Sphere(Sphere { center, radius: sizes[0] }),
            Taw::Sphere(Sphere { center: middle, radius: f64::from(sizes[0]) }),
            Box::new(parry::Ball::new(sizes[0])),
        ),
        1 => (
            Taw::Obb(Obb { center, rotation, half_extents: sizes.into() }),
            Taw::Obb(Obb { center: middle, rotation: exact, half_extents: wide(sizes) }),
            Box::new(parry::Cuboid::new(sizes.into())),
        ),
        2 => {
            let half = rotation * (Vec3::unit_y() * sizes[0]);
            let single = Capsule { a: center - half, b: center + half, radius: sizes[1] };
            let exact = exact * (Vec3::unit_y() * f64::from(sizes[0]));
            let (a, b, radius) = (middle - exact, middle + exact, f64::from(sizes[1]));
            let double = Capsule { a, b, radius };
            let parry = parry::Capsule::new_y(sizes[0], sizes[1]);
            (Taw::Capsule(single), Taw::Capsule(double), Box::new(parry))
        }
        _ => {
            let there: Vec<_> =
                corners.iter().map(|p| center + rotation * Vec3::from(*p)).collect();
            let exactly: Vec<_> = corners.iter().map(|p| middle + exact * wide(*p)).collect();
            let points: Vec<_> = corners.iter().map(|p| ParryVec3::from_array(*p)).collect();
            let parry = parry::ConvexPolyhedron::from_convex_hull(&points).expect("points around");
            let single = Taw::Hull(Hull::new(&there).expect("points around"));
            let double = Taw::Hull(Hull::new(&exactly).expect("points around"));
            (single, double, Box::new(parry))
        }
    };
    Both { single, double, parry, pose }
}

/// The signed distance by search: it is the most that any direction keeps two convex things
/// apart. Directions all around, then nearer and nearer to the best of them; and to what
/// both libraries say.
fn searched(a: &Taw<f64>, b: &Taw<f64>, hints: [Vec3<f64>; 2]) -> f64 {
    let apart = |direction: Vec3<f64>| {
        let support = |of: &Taw<f64>, d: Vec3<f64>| each!(of, it => it.support(d));
        (support(b, -direction) - support(a, direction)).dot(direction)
    };
    let mut best = (f64::NEG_INFINITY, Vec3::unit_x());
    let mut candidates = Vec::new();
    for i in 0..4_000 {
        let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 4_000.0;
        let around = f64::from(i) * 2.399_963_229_728_653;
        let r = (1.0_f64 - z * z).sqrt();
        let direction = Vec3::new(r * around.cos(), r * around.sin(), z);
        candidates.push((apart(direction), direction));
    }
    candidates.sort_by(|x, y| y.0.total_cmp(&x.0));
    candidates.truncate(16);
    candidates.extend(hints.map(|hint| (apart(hint), hint)));
    let mut random = fastrand::Rng::with_seed(7);
    for start in &candidates {
        let (mut here, mut wide) = (*start, 0.05);
        while wide > 1e-12 {
            let mut better = false;
            for _ in 0..48 {
                let mut signed = || random.f64() * 2.0 - 1.0;
                let step = Vec3::new(signed(), signed(), signed()) * wide;
                let direction = (here.1 + step).normalize();
                let there = apart(direction);
                if there > here.0 {
                    (here, better) = ((there, direction), true);
                }
            }
            if !better {
                wide *= 0.5;
            }
        }
        if here.0 > best.0 {
            best = here;
        }
    }
    best.0
}

#[test]
fn where_taw_and_parry_differ_taw_is_right() {
    let mut generator = fastrand::Rng::with_seed(42);
    println!(
        "| pair | parry differs by more than {ROUNDING:.0e} m | worst of parry | worst of taw there |"
    );
    println!("|---|---|---|---|");
    for first in 0..KINDS.len() {
        for second in first..KINDS.len() {
            let (mut differ, mut theirs, mut ours) = (0, 0.0_f64, 0.0_f64);
            for _ in 0..PAIRS {
                let (a, b) = (random(first, &mut generator), random(second, &mut generator));
                let found: ClosestPoints<f32> =
                    each!(&a.single, x => each!(&b.single, y => closest_points(x, y)));
                let parry = contact(&a.pose, &*a.parry, &b.pose, &*b.parry, 100.0);
                let parry = parry.ok().flatten().expect("an answer at any distance");
                let hint = Vec3::from(parry.normal1.to_array().map(f64::from)).normalize();
                let hints = [hint, found.normal.map(f64::from).normalize()];
                let parry = f64::from(parry.dist);
                let taw = f64::from(found.distance);
                if (taw - parry).abs() <= ROUNDING {
                    continue;
                }
                differ += 1;
                let exact = searched(&a.double, &b.double, hints);
                let off = (taw - exact).abs();
                assert!(
                    off <= ROUNDING,
                    "{} and {}: {taw} by taw, {parry} by parry, {exact} by search",
                    KINDS[first],
                    KINDS[second]
                );
                (theirs, ours) = (theirs.max((parry - exact).abs()), ours.max(off));
            }
            let [x, y] = [first, second].map(|kind| KINDS[kind]);
            println!("| {x}, {y} | {differ} of {PAIRS} | {theirs:.1e} m | {ours:.1e} m |");
        }
    }
}
