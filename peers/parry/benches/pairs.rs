//! Cost of a query of two shapes, beside that of parry3d:
//! `cargo bench` in `peers/parry`.
//!
//! Every line is [`COUNT`] pairs of random shapes of about a metre, some of which overlap,
//! in `f32`; few enough to stay in the cache. `distance` is how far apart two shapes are, and where, or the way out
//! (`parry3d::query::contact`); `manifold` is all points where they touch
//! (`PersistentQueryDispatcher::contact_manifolds`, which is always asked anew here).

use divan::Bencher;
use divan::counter::ItemsCount;
use parry3d::glamx::{Pose3, Quat as ParryQuat, Vec3 as ParryVec3};
use parry3d::query::{ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher, contact};
use parry3d::shape as parry;
use taw::contact::{
    ClosestPoints, Convex, closest_points, closest_points_of_plane, closest_points_of_surface,
    manifold,
};
use taw::math::{Point3, Quat, Vec3};
use taw::shape::{Aabb3, Capsule, HeightField, Hull, Mesh, Obb, Plane, Sphere, Surface};

/// Pairs in a line.
const COUNT: usize = 100;
/// Distance up to which closest points of two shapes are sought, in metres.
const MARGIN: f32 = 100.0;

fn main() {
    divan::main();
}

/// Numbers of one shape: place, rotation, and some sizes.
struct Numbers {
    at: [f32; 3],
    turn: [f32; 4],
    sizes: [f32; 3],
    /// About the middle.
    points: Vec<[f32; 3]>,
}

fn numbers(seed: u64) -> Vec<Numbers> {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut signed = move || random.f32() * 2.0 - 1.0;
    (0..COUNT)
        .map(|_| {
            let at = [signed(), signed(), signed()].map(|x| x * 0.9);
            let turn = ParryQuat::from_xyzw(signed(), signed(), signed(), signed()).normalize();
            let sizes = [signed(), signed(), signed()].map(|x| 0.5 + 0.4 * x);
            // On a sphere, so that all are corners.
            let mut corner = || {
                let p = ParryVec3::new(signed(), signed(), signed());
                (p / p.length() * 0.7).to_array()
            };
            let points = (0..16).map(|_| corner()).collect();
            Numbers { at, turn: turn.to_array(), sizes, points }
        })
        .collect()
}

/// One kind of shape, in both libraries.
trait Kind {
    type Taw;
    type Parry: parry::Shape;
    const TURNS: bool = true;
    fn taw(of: &Numbers) -> Self::Taw;
    fn parry(of: &Numbers) -> Self::Parry;
}

fn pose(of: &Numbers, turns: bool) -> Pose3 {
    let turn = if turns { ParryQuat::from_array(of.turn) } else { ParryQuat::IDENTITY };
    Pose3::from_parts(ParryVec3::from_array(of.at), turn)
}

fn turn(of: &Numbers) -> Quat<f32> {
    let [x, y, z, w] = of.turn;
    Quat::new(w, x, y, z)
}

struct SphereKind;
struct AabbKind;
struct ObbKind;
struct CapsuleKind;
struct HullKind;
struct PlaneKind;

impl Kind for SphereKind {
    type Taw = Sphere<f32>;
    type Parry = parry::Ball;
    fn taw(of: &Numbers) -> Self::Taw {
        Sphere { center: of.at.into(), radius: of.sizes[0] }
    }
    fn parry(of: &Numbers) -> Self::Parry {
        parry::Ball::new(of.sizes[0])
    }
}

impl Kind for AabbKind {
    type Taw = Aabb3<f32>;
    type Parry = parry::Cuboid;
    const TURNS: bool = false;
    fn taw(of: &Numbers) -> Self::Taw {
        let (at, half) = (Point3::from(of.at), Vec3::from(of.sizes));
        Aabb3 { min: at - half, max: at + half }
    }
    fn parry(of: &Numbers) -> Self::Parry {
        parry::Cuboid::new(of.sizes.into())
    }
}

impl Kind for ObbKind {
    type Taw = Obb<f32>;
    type Parry = parry::Cuboid;
    fn taw(of: &Numbers) -> Self::Taw {
        Obb { center: of.at.into(), rotation: turn(of), half_extents: of.sizes.into() }
    }
    fn parry(of: &Numbers) -> Self::Parry {
        parry::Cuboid::new(of.sizes.into())
    }
}

impl Kind for CapsuleKind {
    type Taw = Capsule<f32>;
    type Parry = parry::Capsule;
    fn taw(of: &Numbers) -> Self::Taw {
        let half = turn(of) * (Vec3::unit_y() * of.sizes[0]);
        let at = Point3::from(of.at);
        Capsule { a: at - half, b: at + half, radius: of.sizes[1] * 0.5 }
    }
    fn parry(of: &Numbers) -> Self::Parry {
        parry::Capsule::new_y(of.sizes[0], of.sizes[1] * 0.5)
    }
}

impl Kind for HullKind {
    type Taw = Hull<f32>;
    type Parry = parry::ConvexPolyhedron;
    fn taw(of: &Numbers) -> Self::Taw {
        let there = |p: &[f32; 3]| Point3::from(of.at) + turn(of) * Vec3::from(*p);
        let points: Vec<_> = of.points.iter().map(there).collect();
        Hull::new(&points).expect("points all around")
    }
    fn parry(of: &Numbers) -> Self::Parry {
        let points: Vec<_> = of.points.iter().map(|p| ParryVec3::from_array(*p)).collect();
        parry::ConvexPolyhedron::from_convex_hull(&points).expect("points all around")
    }
}

impl Kind for PlaneKind {
    type Taw = Plane<f32>;
    type Parry = parry::HalfSpace;
    fn taw(of: &Numbers) -> Self::Taw {
        Plane::through(of.at.into(), turn(of) * Vec3::unit_y()).expect("a direction")
    }
    fn parry(_: &Numbers) -> Self::Parry {
        parry::HalfSpace::new(ParryVec3::Y)
    }
}

/// The pairs of two kinds in taw.
fn in_taw<A: Kind, B: Kind>(bencher: Bencher, ask: impl Fn(&A::Taw, &B::Taw) -> f32) {
    let pairs: Vec<_> =
        numbers(1).iter().zip(&numbers(2)).map(|(a, b)| (A::taw(a), B::taw(b))).collect();
    bencher
        .counter(ItemsCount::new(COUNT))
        .bench_local(|| pairs.iter().map(|(a, b)| ask(a, b)).fold(0.0, f32::max));
}

/// The pairs of two kinds in parry.
fn in_parry<A: Kind, B: Kind>(
    bencher: Bencher,
    mut ask: impl FnMut(&Pose3, &A::Parry, &Pose3, &B::Parry) -> f32,
) {
    let both = |(a, b): (&Numbers, &Numbers)| {
        (pose(a, A::TURNS), A::parry(a), pose(b, B::TURNS), B::parry(b))
    };
    let pairs: Vec<_> = numbers(1).iter().zip(&numbers(2)).map(both).collect();
    bencher
        .counter(ItemsCount::new(COUNT))
        .bench_local(|| pairs.iter().map(|(p, a, q, b)| ask(p, a, q, b)).fold(0.0, f32::max));
}

/// One line for taw and one for parry.
macro_rules! pairs {
    ($($name:ident: $a:ty, $b:ty, $closest:expr;)*) => { $(
        #[divan::bench_group]
        mod $name {
            use super::*;

            #[divan::bench]
            fn distance_taw(bencher: Bencher) {
                in_taw::<$a, $b>(bencher, |a, b| {
                    let found: ClosestPoints<f32> = $closest(a, b);
                    found.distance
                });
            }

            #[divan::bench]
            fn distance_parry(bencher: Bencher) {
                in_parry::<$a, $b>(bencher, |p, a, q, b| {
                    contact(p, a, q, b, MARGIN).ok().flatten().map_or(0.0, |found| found.dist)
                });
            }
        }
    )* };
}

pairs! {
    sphere_sphere: SphereKind, SphereKind, closest_points;
    plane_sphere: PlaneKind, SphereKind, closest_points_of_plane;
    sphere_aabb: SphereKind, AabbKind, closest_points;
    sphere_obb: SphereKind, ObbKind, closest_points;
    sphere_capsule: SphereKind, CapsuleKind, closest_points;
    sphere_hull: SphereKind, HullKind, closest_points;
    plane_obb: PlaneKind, ObbKind, closest_points_of_plane;
    plane_capsule: PlaneKind, CapsuleKind, closest_points_of_plane;
    plane_hull: PlaneKind, HullKind, closest_points_of_plane;
    aabb_aabb: AabbKind, AabbKind, closest_points;
    obb_obb: ObbKind, ObbKind, closest_points;
    obb_capsule: ObbKind, CapsuleKind, closest_points;
    obb_hull: ObbKind, HullKind, closest_points;
    capsule_capsule: CapsuleKind, CapsuleKind, closest_points;
    capsule_hull: CapsuleKind, HullKind, closest_points;
    hull_hull: HullKind, HullKind, closest_points;
}

/// Where they touch, in taw and in parry.
macro_rules! manifolds {
    ($($name:ident: $a:ty, $b:ty;)*) => { $(
        #[divan::bench_group]
        mod $name {
            use super::*;

            #[divan::bench]
            fn manifold_taw(bencher: Bencher) {
                in_taw::<$a, $b>(bencher, |a, b| manifold(a, b, 0.01).points.len() as f32);
            }

            #[divan::bench]
            fn manifold_parry(bencher: Bencher) {
                let mut found: Vec<ContactManifold<(), ()>> = Vec::new();
                in_parry::<$a, $b>(bencher, |p, a, q, b| {
                    found.clear();
                    let apart = p.inv_mul(q);
                    DefaultQueryDispatcher
                        .contact_manifolds(&apart, a, b, 0.01, &mut found, &mut None)
                        .expect("a pair that parry knows");
                    found.iter().map(|found| found.points.len()).sum::<usize>() as f32
                });
            }
        }
    )* };
}

manifolds! {
    touch_sphere_sphere: SphereKind, SphereKind;
    touch_sphere_obb: SphereKind, ObbKind;
    touch_sphere_capsule: SphereKind, CapsuleKind;
    touch_obb_obb: ObbKind, ObbKind;
    touch_obb_capsule: ObbKind, CapsuleKind;
    touch_capsule_capsule: CapsuleKind, CapsuleKind;
    touch_hull_hull: HullKind, HullKind;
}

/// Points along each side of the hills, and how wide these are, in metres.
const POINTS: usize = 33;
const WIDE: f32 = 8.0;

fn height(column: usize, row: usize) -> f32 {
    (column as f32 * 0.7).sin() * (row as f32 * 0.5).cos() * 0.3
}

/// Hills as a height field and as a mesh, in both libraries.
struct Hills {
    field: HeightField<f32>,
    mesh: Mesh<f32>,
    parry_field: parry::HeightField,
    parry_mesh: parry::TriMesh,
}

fn hills() -> Hills {
    let cell = WIDE / (POINTS - 1) as f32;
    let corner = Point3::new(-WIDE / 2.0, 0.0, -WIDE / 2.0);
    let places = || (0..POINTS).flat_map(|row| (0..POINTS).map(move |column| (column, row)));
    let heights = places().map(|(column, row)| height(column, row)).collect();
    let field = HeightField::new(corner, [cell; 2], POINTS as u32, heights).expect("a grid");
    let points: Vec<_> = places()
        .map(|(x, z)| corner + Vec3::new(x as f32 * cell, height(x, z), z as f32 * cell))
        .collect();
    let number = |column: usize, row: usize| (row * POINTS + column) as u32;
    let triangles: Vec<_> = places()
        .filter(|(column, row)| column + 1 < POINTS && row + 1 < POINTS)
        .flat_map(|(x, z)| {
            let (near, far) = (number(x, z), number(x + 1, z + 1));
            [[near, far, number(x + 1, z)], [near, number(x, z + 1), far]]
        })
        .collect();
    let along_columns = (0..POINTS).flat_map(|x| (0..POINTS).map(move |z| height(x, z)));
    let heights = parry3d::utils::Array2::new(POINTS, POINTS, along_columns.collect());
    let theirs = points.iter().map(|p| ParryVec3::new(p.x, p.y, p.z)).collect();
    Hills {
        field,
        mesh: Mesh::new(points, triangles.clone()).expect("a grid"),
        parry_field: parry::HeightField::new(heights, ParryVec3::new(WIDE, 1.0, WIDE)),
        parry_mesh: parry::TriMesh::new(theirs, triangles).expect("a grid"),
    }
}

/// Distance up to which closest points of a shape and a surface are sought, in metres.
const NEAR: f32 = 0.1;

/// Shapes half as large, at about the height of the hills.
fn over_hills() -> Vec<Numbers> {
    let lifted = |mut numbers: Numbers| {
        let [x, y, z] = numbers.at;
        numbers.at = [x * 3.5, 0.4 + y * 0.4, z * 3.5];
        numbers.sizes = numbers.sizes.map(|size| size * 0.5);
        numbers.points.iter_mut().for_each(|point| *point = point.map(|x| x * 0.5));
        numbers
    };
    numbers(3).into_iter().map(lifted).collect()
}

fn on_taw<A: Kind>(bencher: Bencher, surface: &impl Surface<f32>)
where
    A::Taw: Convex<f32>,
{
    let shapes: Vec<_> = over_hills().iter().map(A::taw).collect();
    let ask = |shape: &A::Taw| {
        closest_points_of_surface(surface, shape, NEAR).map_or(0.0, |found| found.result.distance)
    };
    bencher
        .counter(ItemsCount::new(COUNT))
        .bench_local(|| shapes.iter().map(ask).fold(0.0, f32::max));
}

fn on_parry<A: Kind>(bencher: Bencher, surface: &impl parry::Shape) {
    let shapes: Vec<_> = over_hills().iter().map(|of| (pose(of, A::TURNS), A::parry(of))).collect();
    let ask = |(place, shape): &(Pose3, A::Parry)| {
        let found = contact(&Pose3::IDENTITY, surface, place, shape, NEAR);
        found.ok().flatten().map_or(0.0, |found| found.dist)
    };
    bencher
        .counter(ItemsCount::new(COUNT))
        .bench_local(|| shapes.iter().map(ask).fold(0.0, f32::max));
}

/// A shape on a mesh and on a height field, in taw and in parry.
macro_rules! surfaces {
    ($($name:ident: $a:ty, $taw:ident, $parry:ident;)*) => { $(
        #[divan::bench_group]
        mod $name {
            use super::*;

            #[divan::bench]
            fn distance_taw(bencher: Bencher) {
                on_taw::<$a>(bencher, &hills().$taw);
            }

            #[divan::bench]
            fn distance_parry(bencher: Bencher) {
                on_parry::<$a>(bencher, &hills().$parry);
            }
        }
    )* };
}

surfaces! {
    mesh_sphere: SphereKind, mesh, parry_mesh;
    mesh_obb: ObbKind, mesh, parry_mesh;
    mesh_capsule: CapsuleKind, mesh, parry_mesh;
    mesh_hull: HullKind, mesh, parry_mesh;
    field_sphere: SphereKind, field, parry_field;
    field_obb: ObbKind, field, parry_field;
    field_capsule: CapsuleKind, field, parry_field;
    field_hull: HullKind, field, parry_field;
}
