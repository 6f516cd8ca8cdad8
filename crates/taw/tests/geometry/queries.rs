//! Rays and sweeps, against walking along them.

use crate::things::{Numbers, Thing, numbers, things};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use taw::contact::{
    ClosestPoints, Convex, RayCast, RayHit, ShapeCastHit, Sweep, closest_points, shape_cast,
    time_of_impact,
};
use taw::frame::{AxisAngle, Pose, Ray};
use taw::math::{cast_point, normalize_and_length};
use taw::prelude::*;
use taw::shape::{BoundedShape, Capsule, Obb};

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

fn middle(thing: &Thing<f64>) -> Point3<f64> {
    each!(thing, it => it.center())
}

fn distance(thing: &Thing<f64>, point: Point3<f64>) -> f64 {
    each!(thing, it => it.project_point(point)).distance
}

fn moved(thing: &Thing<f64>, by: Vec3<f64>) -> Thing<f64> {
    thing.transformed(Pose { translation: by, ..Pose::identity() })
}

fn turned(thing: &Thing<f64>, sweep: &Sweep<f64>, time: f64) -> Thing<f64> {
    let (axis, angle) = normalize_and_length(sweep.rotation).unwrap_or((Vec3::unit_x(), 0.0));
    let rotation = AxisAngle::new(axis, angle * time).unwrap().into();
    let pivot = sweep.center.to_vec();
    let turn = Pose { rotation, translation: pivot + sweep.translation * time - rotation * pivot };
    thing.transformed(turn)
}

fn near(a: &Thing<f64>, b: &Thing<f64>) -> ClosestPoints<f64> {
    each!(a, a => each!(b, b => closest_points(a, b)))
}

fn swept(
    a: &Thing<f64>,
    by: Vec3<f64>,
    b: &Thing<f64>,
    other: Vec3<f64>,
) -> Option<ShapeCastHit<f64>> {
    each!(a, a => each!(b, b => shape_cast(a, by, b, other)))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn a_ray_ends_on_the_surface_and_nowhere_before(
        shape in numbers(),
        from in [-6.0..6.0_f64, -6.0..6.0, -6.0..6.0],
        to in [-2.0..2.0_f64, -2.0..2.0, -2.0..2.0],
    ) {
        let (origin, to) = (Point3::from(from), Point3::from(to));
        let direction = (to - origin).normalize();
        let ray = Ray { origin, direction };
        for thing in things::<f64>(&shape, 1.0, 0.0) {
            if matches!(thing, Thing::Triangle(_)) {
                continue; // these are met as parts of surfaces
            }
            let hit = cast(&thing, &ray, f64::INFINITY);
            let end = hit.map_or(20.0, |hit| hit.distance);
            for part in 0..50 {
                let at = ray.at(end * f64::from(part) / 50.0);
                let inside = distance(&thing, at);
                prop_assert!(inside > -1e-9 || end == 0.0, "{thing:?} {ray:?} {hit:?}");
            }
            if let Some(RayHit { distance: far, point, normal }) = hit {
                prop_assert!(far == 0.0 || distance(&thing, point).abs() < 1e-12, "{hit:?}");
                prop_assert!((normal.magnitude() - 1.0).abs() < 1e-12);
                prop_assert!(far == 0.0 || normal.dot(direction) <= 1e-12, "{hit:?}");
                prop_assert_eq!(cast(&thing, &ray, far * 0.999).is_some(), far == 0.0);
            }
        }
    }
}

/// Where two things go, and how they turn: `a` about a point beside it, `b` about its middle.
#[derive(Clone, Debug)]
struct Courses {
    moves: [[f64; 3]; 2],
    turns: [[f64; 3]; 2],
    pivot: [f64; 3],
}

fn courses() -> impl Strategy<Value = Courses> {
    let way = || [-6.0..6.0_f64, -6.0..6.0, -6.0..6.0];
    let turns = ([-4.0..4.0_f64, -4.0..4.0, -4.0..4.0], [-4.0..4.0_f64, 0.0..0.1, 0.0..0.1]);
    let pivot = [-1.0..1.0_f64, -1.0..1.0, -1.0..1.0];
    (way(), way(), turns, pivot).prop_map(|(first, second, turns, pivot)| Courses {
        moves: [first, second],
        turns: [turns.0, turns.1],
        pivot,
    })
}

/// Compares a sweep with marching along it in so many steps.
fn check_sweep(
    a: &Thing<f64>,
    b: &Thing<f64>,
    courses: &Courses,
    steps: u32,
) -> Result<(), TestCaseError> {
    let [by, other] = courses.moves.map(Vec3::from);
    let touch = swept(a, by, b, other);
    let apart = |time: f64| near(&moved(a, by * time), &moved(b, other * time));
    let end = touch.map_or(1.0, |touch| touch.time);
    if apart(0.0).distance > 0.0 {
        for part in 0..steps {
            let before = apart(end * f64::from(part) / f64::from(steps)).distance;
            prop_assert!(before > -1e-8, "{a:?} {b:?} {touch:?} {before}");
        }
    }
    if let Some(ShapeCastHit { time, normal, point }) = touch {
        let there = apart(time);
        prop_assert!(there.distance < 1e-8, "{touch:?} {there:?}");
        prop_assert!((other - by).dot(normal) < 0.0, "they come together");
        let off = distance(&moved(a, by * time), point).abs();
        prop_assert!(time == 0.0 || off < 1e-8, "{touch:?} {off}");
    }
    let back = swept(b, other, a, by);
    prop_assert_eq!(back.is_some(), touch.is_some(), "{:?} {:?} {:?}", a, b, apart(end));
    if let (Some(back), Some(touch)) = (back, touch) {
        prop_assert!((back.time - touch.time).abs() < 1e-8);
    }
    Ok(())
}

/// Checks a sweep with rotation; and that one without agrees with a plain sweep.
fn check_turning_sweep(
    a: &Thing<f64>,
    b: &Thing<f64>,
    courses: &Courses,
    steps: u32,
) -> Result<(), TestCaseError> {
    let sweep_of = |i: usize, pivot| Sweep {
        translation: Vec3::from(courses.moves[i]),
        rotation: Vec3::from(courses.turns[i]),
        center: pivot,
    };
    let (x, y) = (sweep_of(0, Point3::from(courses.pivot)), sweep_of(1, middle(b)));
    let touch = each!(a, a => each!(b, b => time_of_impact(a, &x, b, &y)));
    let apart = |time: f64| near(&turned(a, &x, time), &turned(b, &y, time));
    let end = touch.map_or(1.0, |touch| touch.time);
    if apart(0.0).distance > 0.0 {
        for part in 0..steps {
            let before = apart(end * f64::from(part) / f64::from(steps)).distance;
            prop_assert!(before > -1e-8, "{a:?} {b:?} {touch:?} {before}");
        }
        if let Some(ShapeCastHit { time, .. }) = touch {
            let there = apart(time);
            prop_assert!(there.distance < 6e-6, "{touch:?} {there:?}"); // of six metres
        }
    }
    let still = Sweep { rotation: Vec3::new(0.0, 0.0, 0.0), ..x };
    let straight = Sweep { rotation: Vec3::new(0.0, 0.0, 0.0), ..y };
    let one = each!(a, a => each!(b, b => time_of_impact(a, &still, b, &straight)));
    let other = swept(a, x.translation, b, y.translation);
    // Out of each other, two ways may be as short; one of them may be where they go.
    let overlap = apart(0.0).distance <= 0.0;
    prop_assert!(overlap || one.is_some() == other.is_some(), "{a:?} {b:?}");
    if let (Some(one), Some(other)) = (one, other) {
        prop_assert!((one.time - other.time).abs() < 1e-7, "{one:?} {other:?}");
    }
    Ok(())
}

fn check_sweeps(
    first: &Numbers,
    second: &Numbers,
    courses: &Courses,
    steps: u32,
) -> Result<(), TestCaseError> {
    for a in things::<f64>(first, 1.0, 0.0) {
        for b in things::<f64>(second, 1.0, 0.0) {
            let b = moved(&b, Vec3::new(3.0, 0.0, 0.0));
            check_sweep(&a, &b, courses, steps)?;
            check_turning_sweep(&a, &b, courses, steps)?;
        }
    }
    Ok(())
}

/// Repeats the next test, against marching in a thousand steps: `.ci/run` does it.
#[test]
#[ignore = "takes minutes"]
fn sweeps_agree_with_marching_in_a_thousand_steps() {
    const CASES: u32 = 3_000;
    let mut runner = TestRunner::new(ProptestConfig::with_cases(CASES));
    let check = |(first, second, courses)| check_sweeps(&first, &second, &courses, 1_000);
    runner.run(&(numbers(), numbers(), courses()), check).unwrap();
    println!("{CASES} cases of up to 36 pairs, straight and turning, 1,000 steps each");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn sweeps_end_at_the_first_touch(
        first in numbers(), second in numbers(), courses in courses(),
    ) {
        check_sweeps(&first, &second, &courses, 20)?;
    }
}

/// Error of a hit, in f32, of a ball, a capsule and a box of one metre, for rays
/// from this far: half of what `Box3D` measures (references §6.1).
#[test]
fn rays_from_afar_hit_where_they_should() {
    let box3d =
        [(1e1, 9.5e-7), (1e2, 5.4e-6), (1e3, 1.2e-4), (1e4, 1.1e-3), (1e5, 7.8e-3), (1e6, 0.15)];
    for (far, error) in box3d {
        let mut worst: f64 = 0.0;
        let mut random = 12_345_u64;
        let mut next = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            f64::from((random >> 40) as u32) / f64::from(1 << 24) - 0.5
        };
        for _ in 0..2_000 {
            let center = Point3::new(0.0_f32, 0.0, 0.0);
            let toward = Vec3::new(next(), next(), next());
            if toward.magnitude() < 0.1 {
                continue;
            }
            let from = (toward.normalize() * far).map(|x| x as f32);
            let origin = Point3::from_vec(from);
            let aim = Vec3::new(next(), next(), next()).map(|x| x as f32);
            let ray = Ray { origin, direction: (aim - from).normalize() };
            let shapes = [
                Thing::Sphere(Sphere { center, radius: 1.0 }),
                Thing::Capsule(
                    Capsule::new(center - Vec3::unit_y(), center + Vec3::unit_y(), 1.0).unwrap(),
                ),
            ];
            for shape in shapes {
                let hit = cast(&shape, &ray, f32::INFINITY);
                let Some(hit) = hit else { panic!("missed from {far} m: {ray:?}") };
                // What the ray as given meets, in f64.
                let exact: Point3<f64> = cast_point(hit.point);
                let off = each!(&shape, it => it.project_point(cast_point(exact))).distance.abs();
                worst = worst.max(f64::from(off));
            }
        }
        println!("{far:e} m: {worst:.1e} of {:.1e} allowed", 0.5 * error);
        assert!(worst <= 0.5 * error, "{worst} from {far} m");
    }
}

#[test]
fn rays_at_the_edge_of_sense() {
    let center = Point3::new(1.0, 2.0, 3.0);
    let obb = Obb::from_aabb(&taw::shape::Aabb {
        min: center - Vec3::new(1.0, 1.0, 1.0),
        max: center + Vec3::new(1.0, 1.0, 1.0),
    });
    let sphere = Sphere { center, radius: 1.0_f64 };
    let capsule = Capsule::new(center, center + Vec3::unit_y() * 2.0, 1.0).unwrap();
    let all = [Thing::Sphere(sphere), Thing::Obb(obb), Thing::Capsule(capsule)];
    for thing in &all {
        let meets = |origin: [f64; 3], direction: [f64; 3], longest: f64| {
            let ray = Ray { origin: Point3::from(origin), direction: Vec3::from(direction) };
            cast(thing, &ray, longest).map(|hit| hit.distance)
        };
        // From inside, from the surface, and away from it.
        assert_eq!(meets([1.0, 2.0, 3.0], [0.0, 1.0, 0.0], 1.0), Some(0.0), "{thing:?}");
        assert_eq!(meets([0.0, 2.0, 3.0], [-1.0, 0.0, 0.0], 1.0), Some(0.0), "{thing:?}");
        assert_eq!(meets([-0.1, 2.0, 3.0], [-1.0, 0.0, 0.0], 9.0), None, "{thing:?}");
        // Along an axis, just long enough and not; with no direction at all.
        assert_eq!(meets([-4.0, 2.0, 3.0], [1.0, 0.0, 0.0], 4.0), Some(4.0), "{thing:?}");
        assert_eq!(meets([-4.0, 2.0, 3.0], [1.0, 0.0, 0.0], 3.9), None, "{thing:?}");
        assert_eq!(meets([-4.0, 2.0, 3.0], [0.0, 0.0, 0.0], f64::INFINITY), None, "{thing:?}");
        assert_eq!(meets([-4.0, 2.0, 3.0], [f64::NAN, 0.0, 0.0], 9.0), None, "{thing:?}");
        // Past it, parallel to a face or the axis.
        assert_eq!(meets([2.1, -9.0, 3.0], [0.0, 1.0, 0.0], f64::INFINITY), None, "{thing:?}");
        let touching = meets([2.0, -9.0, 3.0], [0.0, 1.0, 0.0], f64::INFINITY);
        assert!(touching.is_some(), "what grazes exactly, touches: {thing:?}");
    }
    let floor = Plane::new(Vec3::unit_y(), 1.0).unwrap();
    let down = Ray { origin: Point3::new(5.0, 4.0, 5.0), direction: -Vec3::unit_y() };
    assert_eq!(floor.cast_ray(&down, 9.0).map(|hit| hit.distance), Some(3.0));
    assert_eq!(floor.cast_ray(&Ray { direction: Vec3::unit_x(), ..down }, 9.0), None);
}

#[test]
fn sweeps_at_the_edge_of_sense() {
    let ball = |x: f64, y: f64| Sphere { center: Point3::new(x, y, 0.0), radius: 0.5 };
    let still = Vec3::new(0.0, 0.0, 0.0);
    let right = |v: f64| Vec3::new(v, 0.0, 0.0);
    let time = |b: &Sphere<f64>, a_moves, b_moves| {
        shape_cast(&ball(0.0, 0.0), a_moves, b, b_moves).map(|touch| touch.time)
    };
    assert_eq!(time(&ball(3.0, 0.0), still, still), None, "at rest");
    assert_eq!(time(&ball(1.0, 0.0), still, still), None, "touching, at rest");
    assert_eq!(time(&ball(0.5, 0.0), still, still), None, "overlapping, at rest");
    assert_eq!(time(&ball(1.0, 0.0), still, right(1.0)), None, "parting");
    assert_eq!(time(&ball(1.0, 0.0), right(1.0), still), Some(0.0), "at once");
    assert_eq!(time(&ball(0.3, 0.0), right(1.0), still), Some(0.0), "deep inside");
    assert_eq!(time(&ball(3.0, 0.0), right(1e6), right(1e6)), None, "side by side");
    let last = time(&ball(3.0, 0.0), right(2.0), still).unwrap();
    assert!((last - 1.0).abs() < 1e-9, "just so: {last}");
    assert!(time(&ball(3.0, 0.0), right(1.999_999), still).is_none());
    for (aside, hits) in [(1.0 - 1e-6, true), (1.0 - 1e-4, true), (1.0 + 1e-6, false)] {
        assert_eq!(time(&ball(50.0, aside), right(100.0), still).is_some(), hits, "graze {aside}");
    }
    let fast = time(&ball(3.0, 0.0), right(1e6), still).unwrap();
    assert!((fast - 2e-6).abs() < 1e-15, "{fast}");
}

/// A ball that turns past the corner of a triangle takes few steps, however near it comes.
#[test]
fn a_turning_sweep_does_not_stop_early_at_a_near_miss() {
    let first = ([0.062_849_615_166_568_37, 0.931_734_602_345_066, 0.0], 1.371_672_842_647_492_2);
    let second = ([0.047_344_571_810_325_566, 1.0, 0.0], 1.220_442_099_926_677);
    let points = |size: f64| {
        let mut points = vec![[0.0; 3]; 6];
        points[0] = [1.0, 1.0, size];
        points
    };
    let courses = Courses {
        moves: [
            [0.157_160_394_896_738_4, -2.548_595_453_142_648_5, 5.174_957_536_475_833],
            [-1.808_584_566_839_184_4, 4.289_997_643_630_825, -3.398_023_582_068_339],
        ],
        turns: [
            [-3.294_774_391_058_371_8, 3.528_767_866_438_555_3, -3.372_604_895_491_321_3],
            [1.977_239_126_542_775, 0.088_411_517_056_638_76, 0.012_368_226_891_132_475],
        ],
        pivot: [0.080_604_868_671_631_81, -0.248_943_740_676_897_45, 0.065_974_495_555_546_34],
    };
    let mut other = points(0.0);
    other[0] = [-second.1, 1.244_749_211_420_166, 0.0];
    let first: Numbers = (first.0, [0.0, 0.0, 0.1], 0.0, points(first.1));
    let second: Numbers = (second.0, [0.0, 0.0, 0.1], 0.0, other);
    check_sweeps(&first, &second, &courses, 1_000).unwrap();
}
