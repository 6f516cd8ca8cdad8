//! Properties of shapes: volume, inertia, bounds, rays.

use cgmath::MetricSpace;
use proptest::prelude::*;
use taw::frame::{AxisAngle, Pose};
use taw::prelude::*;
use taw::shape::{Aabb, BoundedShape, Capsule, Compound, Hull, Obb, Shape};

fn point() -> impl Strategy<Value = Point3<f64>> {
    [-2.0..2.0_f64, -2.0..2.0, -2.0..2.0].prop_map(Point3::from)
}

fn pose() -> impl Strategy<Value = Pose<f64>> {
    let axis = [-1.0..1.0_f64, -1.0..1.0, 0.1..1.0];
    (axis, -4.0..4.0_f64, point()).prop_map(|(axis, angle, at)| Pose {
        rotation: AxisAngle::new(Vec3::from(axis), angle).unwrap().into(),
        translation: at.to_vec(),
    })
}

/// One of each kind, somewhere.
fn shapes() -> impl Strategy<Value = Vec<Shape<f64>>> {
    (prop::collection::vec(point(), 8..20), pose(), 0.1..1.0_f64).prop_map(|(points, pose, r)| {
        let sphere = Shape::Sphere(Sphere::new(points[0], r).unwrap());
        let aabb =
            Aabb { min: points[1], max: points[1] }.union(&Aabb { min: points[2], max: points[2] });
        let obb = Obb::from_aabb(&aabb).transformed(pose);
        let capsule = Capsule::new(points[3], points[4], r).unwrap();
        let hull = Hull::new(&points).unwrap().transformed(pose);
        let parts = vec![sphere.clone(), Shape::Obb(obb), Shape::Hull(hull.clone())];
        vec![
            sphere,
            Shape::Aabb(aabb),
            Shape::Obb(obb),
            Shape::Capsule(capsule),
            Shape::Hull(hull),
            Shape::Compound(Compound::new(parts).unwrap()),
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1_000))]

    #[test]
    fn all_that_a_shape_says_of_itself_agrees(
        shapes in shapes(), points in prop::collection::vec(point(), 40), pose in pose(),
    ) {
        for shape in shapes {
            let bounds = shape.bounding_box();
            for axis in [Vec3::unit_x(), Vec3::unit_y(), Vec3::unit_z()] {
                let high = shape.support(axis).to_vec().dot(axis);
                let low = shape.support(-axis).to_vec().dot(axis);
                prop_assert!((high - bounds.max.to_vec().dot(axis)).abs() < 1e-13, "{shape:?}");
                prop_assert!((low - bounds.min.to_vec().dot(axis)).abs() < 1e-13, "{shape:?}");
            }
            let moved = shape.transformed(pose);
            prop_assert!((moved.volume() - shape.volume()).abs() < 1e-12);
            for point in &points {
                let near = shape.project_point(*point);
                let (out, normal) = (*point - near.point, near.normal);
                prop_assert!((normal.magnitude() - 1.0).abs() < 1e-14, "{near:?}");
                prop_assert!((out - normal * near.distance).magnitude() < 1e-12, "{near:?}");
                let surface = shape.project_point(near.point);
                if !matches!(shape, Shape::Compound(_)) {
                    prop_assert!(surface.distance.abs() < 1e-12, "{shape:?}: {surface:?}");
                    // Nothing of a convex shape is in front of the plane where it is nearest.
                    if near.distance > 0.0 {
                        let farthest = shape.support(normal);
                        let ahead = (farthest - near.point).dot(normal);
                        // The normal is a difference, over the distance.
                        let rounding = 1e-12 + 4e-15 / near.distance;
                        prop_assert!(ahead < rounding, "{shape:?} {point:?}: {near:?}");
                    }
                }
                prop_assert_eq!(shape.contains(*point), near.distance <= 0.0);
                let closest = shape.closest_point(*point);
                prop_assert!((closest.distance(*point) - near.distance.max(0.0)).abs() < 1e-12);
                let there = moved.project_point(pose.transform_point(*point));
                prop_assert!((there.distance - near.distance).abs() < 1e-12, "moved along");
                prop_assert!(bounds.contains_point(closest) || near.distance > -1e-12);
            }
        }
    }

    #[test]
    fn a_hull_has_all_its_points_and_as_many_faces_as_euler_says(
        points in prop::collection::vec(point(), 4..60), scale in prop::sample::select(vec![1e-30, 1e-3, 1.0, 1e6, 1e30]),
    ) {
        let points: Vec<_> = points.iter().map(|p| *p * scale).collect();
        let Ok(hull) = Hull::new(&points) else { return Ok(()) };
        let (corners, edges, faces) = (hull.points().len(), hull.edges().len(), hull.faces().len());
        prop_assert_eq!(corners + faces, edges + 2, "{} corners, {} faces", corners, faces);
        for point in &points {
            prop_assert!(hull.project_point(*point).distance <= 1e-9 * scale);
        }
        for corner in hull.points() {
            prop_assert!(points.iter().any(|point| point.distance(corner) <= 1e-9 * scale));
        }
    }

    /// Points on a lattice: many of them in one plane, on one line, and in one spot.
    #[test]
    fn a_hull_of_lattice_points_is_a_hull_or_refused(
        points in prop::collection::vec([0..4_i32, 0..4, 0..4], 4..40), pose in pose(),
    ) {
        let points: Vec<_> = points
            .iter()
            .map(|[x, y, z]| pose.transform_point(Point3::new(f64::from(*x), f64::from(*y), f64::from(*z))))
            .collect();
        if let Ok(hull) = Hull::new(&points) {
            prop_assert_eq!(hull.points().len() + hull.faces().len(), hull.edges().len() + 2);
            prop_assert!(hull.volume() > 0.1, "a sixth is the least that four of them have");
            for point in &points {
                prop_assert!(hull.project_point(*point).distance <= 1e-9);
            }
        }
    }

    #[test]
    fn a_turned_box_is_six_faces_of_four_corners(pose in pose()) {
        let obb = Obb::new(Point3::origin(), pose.rotation, Vec3::new(1.0, 0.01, 30.0)).unwrap();
        // With points in the middle of faces and edges, and some twice.
        let corners = obb.corners();
        let middle = |a: usize, b: usize| corners[a] + (corners[b] - corners[a]) * 0.5;
        let more = [middle(0, 1), middle(0, 3), middle(0, 7), corners[4], middle(4, 7)];
        let hull = Hull::new(&[&corners[..], &more[..]].concat()).unwrap();
        prop_assert_eq!((hull.points().len(), hull.edges().len(), hull.faces().len()), (8, 12, 6));
        for face in hull.faces() {
            prop_assert_eq!(face.corners.len(), 4);
            let along = obb.axes().map(|axis| axis.dot(face.normal).abs());
            prop_assert!(along.iter().any(|cos| (cos - 1.0).abs() < 1e-9), "{along:?}");
        }
        prop_assert!((hull.volume() / obb.volume() - 1.0).abs() < 1e-9);
    }
}

#[test]
fn hulls_of_nothing_solid_are_refused() {
    let refused = |points: &[[f64; 3]]| {
        let points: Vec<_> = points.iter().map(|p| Point3::from(*p)).collect();
        Hull::new(&points).unwrap_err().to_string()
    };
    let few = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    assert_eq!(refused(&few), "points.len() must be in [4, 4294967294], but is 3");
    let flat = [few[0], few[1], few[2], [1.0, 1.0, 0.0], [0.3, 0.2, 1e-12]];
    assert_eq!(refused(&flat), "points lie in a plane");
    assert_eq!(refused(&[few[1]; 7]), "points lie in a plane");
    assert_eq!(
        refused(&[few[0], few[1], [2.0, 0.0, 0.0], [5.0, 0.0, 0.0]]),
        "points lie in a plane"
    );
    let nan = [few[0], few[1], few[2], [0.0, f64::NAN, 1.0]];
    assert_eq!(refused(&nan), "points.y must be finite, but is NaN");
    assert!(Compound::<Obb<f64>>::new(vec![]).is_err());
}
