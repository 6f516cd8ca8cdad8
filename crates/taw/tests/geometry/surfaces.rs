//! Meshes and height fields: against each other, and against all of their triangles.

use std::sync::Arc;

use crate::things::{numbers, things};
use proptest::prelude::*;
use taw::contact::{
    ClosestPoints, TriangleResult, closest_points, closest_points_of_surface, manifolds_of_surface,
    ray_cast_on_surface, shape_cast_on_surface,
};
use taw::frame::{AxisAngle, Pose, Ray};
use taw::prelude::*;
use taw::shape::{BoundedShape, HeightField, Mesh, Surface};

const COLUMNS: u32 = 9;
const ROWS: u32 = 7;
/// Of the top, the sides and the bottom.
const TRIANGLES: u32 = 2 * (COLUMNS - 1) * (ROWS - 1) + 4 * (COLUMNS - 1 + ROWS - 1) + 2;

/// Hills, and a mesh of the same triangles with the same numbers.
fn hills(heights: &[f64]) -> (HeightField<f64>, Mesh<f64>) {
    let corner = Point3::new(-2.0, -0.5, -1.5);
    let field = HeightField::new(corner, [0.5, 0.4], COLUMNS, heights.to_vec()).unwrap();
    let count = TRIANGLES;
    let corners: Vec<_> =
        (0..count).flat_map(|number| field.triangle(number).unwrap().corners).collect();
    assert!(field.triangle(count).is_none());
    let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    (field, Mesh::new(corners, triangles).unwrap())
}

fn heights() -> impl Strategy<Value = Vec<f64>> {
    let height = prop_oneof![3 => -0.5..0.5_f64, 1 => Just(0.0)];
    prop::collection::vec(height, (COLUMNS * ROWS) as usize)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn a_height_field_is_the_mesh_of_its_triangles(
        heights in heights(), shape in numbers(), moves in [-3.0..3.0_f64, -3.0..3.0, -3.0..3.0],
    ) {
        let (field, mesh) = hills(&heights);
        prop_assert_eq!(field.bounds(), mesh.bounds());
        for thing in things::<f64>(&shape, 0.3, 0.0) {
            each!(&thing, thing => {
                let all = (0..TRIANGLES).map(|triangle| {
                    TriangleResult { triangle, result: closest_points(&field.triangle(triangle).unwrap(), thing) }
                });
                let key = |of: &TriangleResult<ClosestPoints<f64>>| (of.result.distance, of.triangle);
                let best = all.reduce(|s, t| if key(&t) < key(&s) { t } else { s });
                let near = best.filter(|best| best.result.distance <= 0.2);
                let found = closest_points_of_surface(&field, thing, 0.2);
                prop_assert_eq!(found, closest_points_of_surface(&mesh, thing, 0.2));
                prop_assert_eq!(found.is_some(), near.is_some());
                if let (Some(found), Some(near)) = (found, near) {
                    let off = (found.result.distance - near.result.distance).abs();
                    prop_assert!(off < 1e-11, "{found:?} {near:?}"); // of shapes of two metres
                }
                let touches = manifolds_of_surface(&field, thing, 0.01);
                prop_assert_eq!(&touches, &manifolds_of_surface(&mesh, thing, 0.01));
                prop_assert_eq!(
                    touches.is_empty(),
                    best.is_none_or(|best| best.result.distance > 0.01)
                );
                let moves = Vec3::from(moves);
                let first = shape_cast_on_surface(&field, thing, moves);
                prop_assert_eq!(first, shape_cast_on_surface(&mesh, thing, moves));
            });
        }
    }

    #[test]
    fn a_height_field_is_a_solid_with_sides_and_a_bottom(
        heights in heights(), at in [-4.0..4.0_f64, -9.0..2.0, -4.0..3.0],
        to in [-2.0..2.0_f64, -7.0..0.5, -1.5..0.9], turned in any::<bool>(),
    ) {
        let (field, mesh) = hills(&heights);
        let turn = AxisAngle::new(Vec3::new(1.0, 0.3, -2.0), if turned { 1.0 } else { 0.0 }).unwrap();
        let pose = Pose { rotation: turn.into(), translation: Vec3::new(0.2, -0.4, 0.1) };
        let mut world = World::<f64>::default();
        world.walls.insert(WallShape::HeightField(Arc::new(field.clone()), pose)).unwrap();
        let (at, to) = (Point3::from(at), Point3::from(to));
        // As brute force has it: as far as the nearest triangle, and inside where an odd number of
        // them is above.
        let far = |point: Point3<f64>| {
            let triangles = (0..TRIANGLES).map(|number| field.triangle(number).unwrap());
            let far = triangles.map(|it| it.project_point(point).distance).fold(f64::MAX, f64::min);
            let up = Ray { origin: point, direction: Vec3::new(1e-3, 1.0, 2e-3).normalize() };
            let mut above = 0;
            for number in 0..TRIANGLES {
                let corners = field.triangle(number).unwrap().corners.to_vec();
                let one = Mesh::new(corners, vec![[0, 1, 2]]).unwrap();
                above += u32::from(ray_cast_on_surface(&one, &up, f64::INFINITY).is_some());
            }
            if above % 2 == 1 { -far } else { far }
        };
        let wall = world.walls.get(world.walls.id(0).unwrap()).unwrap().clone();
        for point in [at, to, at + (to - at) * 0.8] {
            let near = wall.project_point(pose.transform_point(point));
            let expected = far(point);
            prop_assert!((near.distance - expected).abs() < 1e-9, "{near:?} {expected} at {point:?}");
            // Out along the normal, by the depth, the surface is.
            let out = pose.transform_point(point) - near.normal * near.distance;
            prop_assert!((out - near.point).magnitude() < 1e-9, "{near:?}");
        }
        // A ray from outside to what is inside enters where the surface is.
        if far(at) > 1e-6 && far(to) < -1e-6 {
            let origin = pose.transform_point(at);
            let ray = Ray { origin, direction: (pose.transform_point(to) - origin).normalize() };
            let mut tree = QueryTree::default();
            let hit = world.queries(&mut tree).cast_ray(&ray, f64::INFINITY, |_| true);
            let on_mesh = Ray { origin: at, direction: (to - at).normalize() };
            let expected = ray_cast_on_surface(&mesh, &on_mesh, f64::INFINITY).unwrap().result;
            let hit = hit.unwrap().result;
            prop_assert!((hit.distance - expected.distance).abs() < 1e-9, "{hit:?} {expected:?}");
            prop_assert!(hit.distance < (to - at).magnitude());
        }
    }

    #[test]
    fn a_ray_meets_the_same_of_both_and_never_slips_through(
        heights in heights(), from in [-1.9..1.9_f64, 1.0..3.0, -1.4..0.8],
        to in [-1.9..1.9_f64, -3.0..-1.1, -1.4..0.8],
        target in 0..(COLUMNS * ROWS) as usize,
    ) {
        let (field, mesh) = hills(&heights);
        // Anywhere, straight down on a corner, and through a corner from anywhere.
        let corner = field.triangle(0).unwrap().corners[0];
        let (column, row) = (target % COLUMNS as usize, target / COLUMNS as usize);
        let on = Point3::new(
            corner.x + 0.5 * column as f64,
            -0.5 + heights[target],
            corner.z + 0.4 * row as f64,
        );
        let inner = column > 0 && row > 0 && column + 1 < COLUMNS as usize && row + 1 < ROWS as usize;
        let origin = Point3::from(from);
        for (origin, toward, must) in [
            (origin, Point3::from(to), true),
            (on + Vec3::unit_y() * 3.0, on, inner),
            (origin, on, false), // it may pass over the top
        ] {
            let ray = Ray { origin, direction: (toward - origin).normalize() };
            let hit = ray_cast_on_surface(&field, &ray, f64::INFINITY);
            prop_assert_eq!(hit, ray_cast_on_surface(&mesh, &ray, f64::INFINITY));
            prop_assert!(hit.is_some() || !must, "{ray:?} slipped through");
            if let Some(TriangleResult { triangle, result }) = hit {
                let near = closest_points_of_surface(&field, &Sphere { center: result.point, radius: 0.1 }, 0.0);
                let off = near.unwrap().result.distance + 0.1;
                prop_assert!(off < 1e-12, "{result:?} on {triangle}");
                prop_assert!(result.normal.dot(ray.direction) <= 0.0);
                // Nothing comes before it.
                let step = result.distance / 100.0;
                let side = |at: Point3<f64>| {
                    let down = Ray { origin: at, direction: -Vec3::unit_y() };
                    ray_cast_on_surface(&field, &down, f64::INFINITY).is_some()
                };
                for i in 1_u8..99 {
                    let at = ray.at(step * f64::from(i));
                    let over = at.x.abs() < 1.99 && at.z > -1.49 && at.z < 0.89;
                    prop_assert!(!over || side(at), "it was under the hills at {at:?}");
                }
            }
        }
    }
}

#[test]
fn bad_surfaces_are_refused_by_name() {
    let corner = Point3::new(0.0, 0.0, 0.0);
    let field = |cell, columns, heights: &[f64]| {
        HeightField::new(corner, cell, columns, heights.to_vec()).unwrap_err().to_string()
    };
    assert_eq!(field([1.0, 0.0], 2, &[0.0; 4]), "cell[1] must be finite and above zero, but is 0");
    assert!(field([1.0, 1.0], 1, &[0.0; 4]).starts_with("columns must be in [2"));
    assert_eq!(field([1.0, 1.0], 2, &[0.0; 5]), "heights.len() must be 4, but is 5");
    assert_eq!(field([1.0, 1.0], 3, &[0.0; 3]), "heights.len() must be 6, but is 3");
    assert_eq!(
        field([1.0, 1.0], 2, &[0.0, f64::NAN, 0.0, 0.0]),
        "heights must be finite, but is NaN"
    );
    let mesh = |triangles: Vec<[u32; 3]>| Mesh::new(vec![corner; 3], triangles);
    assert_eq!(
        mesh(vec![[0, 1, 3]]).unwrap_err().to_string(),
        "triangles must be in [0, 2], but is 3"
    );
    assert!(mesh(vec![]).is_err());
    // No more than a point, and yet it is touched where it is.
    let dot = mesh(vec![[0, 1, 2]]).unwrap();
    let ball = Sphere { center: Point3::new(0.0, 0.5, 0.0), radius: 1.0 };
    let touch = closest_points_of_surface(&dot, &ball, 0.0).unwrap().result;
    assert_eq!((touch.distance, touch.normal), (-0.5, Vec3::unit_y()));
    let down = Ray { origin: Point3::new(0.0, 2.0, 0.0), direction: -Vec3::unit_y() };
    assert_eq!(ray_cast_on_surface(&dot, &down, 9.0), None, "a ray meets areas only");
}
