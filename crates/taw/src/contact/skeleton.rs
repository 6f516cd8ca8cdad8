use cgmath::{EuclideanSpace, InnerSpace};

use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector, direction_and_length};
use crate::shape::{Box3, Capsule, Hull, Obb, Solid, Sphere, Triangle};

/// A convex shape as all points within `radius` of a polyhedron, which may also be a
/// point, a line, or flat. All in `f64`, about some origin that is near, so that nothing
/// is lost far from that of the world.
#[derive(Clone, Debug, PartialEq)]
pub struct Skeleton {
    /// The corners, in metres.
    pub points: Vec<Vec3<f64>>,
    /// Pairs of corners.
    pub edges: Vec<[u32; 2]>,
    /// The directions that edges have, as unit vectors, each of them once.
    pub directions: Vec<Vec3<f64>>,
    /// The normals of faces, as unit vectors, with their corners, counterclockwise.
    pub faces: Vec<(Vec3<f64>, Vec<u32>)>,
    /// In metres.
    pub radius: f64,
}

impl Skeleton {
    /// The greatest distance of a corner from the first one, and the radius.
    pub(super) fn size(&self) -> f64 {
        let far = self.points.iter().map(|point| (point - self.points[0]).magnitude());
        far.fold(self.radius, f64::max)
    }

    /// Its corner that is farthest along a direction; of several, the first.
    pub(super) fn farthest(&self, direction: Vec3<f64>) -> Vec3<f64> {
        self.points.iter().fold(self.points[0], |best, point| {
            if point.dot(direction) > best.dot(direction) { *point } else { best }
        })
    }

    /// How far it reaches along a direction, from its origin.
    pub(super) fn reach(&self, direction: Vec3<f64>) -> f64 {
        self.points.iter().map(|point| point.dot(direction)).fold(f64::NEG_INFINITY, f64::max)
    }
}

/// What has a [`Skeleton`].
pub trait Convex<S: Scalar>: Solid<S> {
    /// The skeleton about an origin.
    #[must_use]
    fn skeleton(&self, origin: Point3<f64>) -> Skeleton;

    /// A point in the middle of it.
    #[must_use]
    fn middle(&self) -> Point3<S>;

    /// Itself, if it is nothing but a sphere, for which all questions have short answers.
    #[must_use]
    fn as_sphere(&self) -> Option<Sphere<S>> {
        None
    }
}

fn local<S: Scalar>(point: Point3<S>, origin: Point3<f64>) -> Vec3<f64> {
    cast_point::<S, f64>(point) - origin
}

impl<S: Scalar> Convex<S> for Sphere<S> {
    fn skeleton(&self, origin: Point3<f64>) -> Skeleton {
        Skeleton {
            points: vec![local(self.center, origin)],
            edges: Vec::new(),
            directions: Vec::new(),
            faces: Vec::new(),
            radius: self.radius.as_f64(),
        }
    }

    fn middle(&self) -> Point3<S> {
        self.center
    }

    fn as_sphere(&self) -> Option<Sphere<S>> {
        Some(*self)
    }
}

impl<S: Scalar> Convex<S> for Capsule<S> {
    fn skeleton(&self, origin: Point3<f64>) -> Skeleton {
        let points = vec![local(self.a, origin), local(self.b, origin)];
        let direction = direction_and_length(points[1] - points[0]);
        Skeleton {
            points,
            edges: vec![[0, 1]],
            directions: direction.map(|(unit, _)| unit).into_iter().collect(),
            faces: Vec::new(),
            radius: self.radius.as_f64(),
        }
    }

    fn middle(&self) -> Point3<S> {
        self.a + (self.b - self.a) * S::constant(0.5)
    }

    fn as_sphere(&self) -> Option<Sphere<S>> {
        (self.a == self.b).then_some(Sphere { center: self.a, radius: self.radius })
    }
}

/// The faces of a box, by the bits of its corners: along −x, x, −y, y, −z, z.
const BOX_FACES: [[u32; 4]; 6] =
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
/// Its edges: four along each axis.
const BOX_EDGES: [[u32; 2]; 12] = [
    [0, 1],
    [2, 3],
    [4, 5],
    [6, 7],
    [0, 2],
    [1, 3],
    [4, 6],
    [5, 7],
    [0, 4],
    [1, 5],
    [2, 6],
    [3, 7],
];

impl<S: Scalar> Convex<S> for Obb<S> {
    fn skeleton(&self, origin: Point3<f64>) -> Skeleton {
        // In f64 from the start, or the corners would be rounded.
        let exact = Obb {
            center: Point3::from_vec(local(self.center, origin)),
            rotation: cgmath::Quaternion::from_sv(
                self.rotation.s.as_f64(),
                cast_vector(self.rotation.v),
            )
            .normalize(),
            half_widths: cast_vector(self.half_widths),
        };
        let axes = exact.axes();
        let normal = |face: usize| axes[face / 2] * if face.is_multiple_of(2) { -1.0 } else { 1.0 };
        let faces = BOX_FACES.iter().enumerate();
        Skeleton {
            points: exact.corners().map(EuclideanSpace::to_vec).to_vec(),
            edges: BOX_EDGES.to_vec(),
            directions: axes.to_vec(),
            faces: faces.map(|(face, corners)| (normal(face), corners.to_vec())).collect(),
            radius: 0.0,
        }
    }

    fn middle(&self) -> Point3<S> {
        self.center
    }
}

impl<S: Scalar> Convex<S> for Box3<S> {
    fn skeleton(&self, origin: Point3<f64>) -> Skeleton {
        Box3 { min: cast_point::<S, f64>(self.min), max: cast_point(self.max) }
            .obb()
            .skeleton(origin)
    }

    fn middle(&self) -> Point3<S> {
        self.center()
    }
}

impl<S: Scalar> Convex<S> for Triangle<S> {
    fn skeleton(&self, origin: Point3<f64>) -> Skeleton {
        let points = self.corners.map(|corner| local(corner, origin)).to_vec();
        let exact = Triangle { corners: [0, 1, 2].map(|i| Point3::from_vec(points[i])) };
        let edges = vec![[0, 1], [1, 2], [2, 0]];
        let side = |[a, b]: &[u32; 2]| points[*b as usize] - points[*a as usize];
        let directions = edges.iter().filter_map(|edge| direction_and_length(side(edge)));
        let directions = directions.map(|(unit, _)| unit).collect();
        // A line has none. Both sides are alike.
        let both = |normal: Vec3<f64>| vec![(normal, vec![0, 1, 2]), (-normal, vec![2, 1, 0])];
        let faces = exact.normal().map_or_else(Vec::new, both);
        Skeleton { points, edges, directions, faces, radius: 0.0 }
    }

    fn middle(&self) -> Point3<S> {
        let [a, b, c] = self.corners;
        a + ((b - a) + (c - a)) / S::constant(3.0)
    }
}

impl<S: Scalar> Convex<S> for Hull<S> {
    fn skeleton(&self, origin: Point3<f64>) -> Skeleton {
        let pose = self.exact_pose();
        let there = |point: &Point3<f64>| pose.point(*point) - origin;
        let points: Vec<_> = self.local_points().iter().map(there).collect();
        let mut directions: Vec<Vec3<f64>> = Vec::new();
        for [a, b] in self.edges() {
            let along = direction_and_length(points[*b as usize] - points[*a as usize]);
            if let Some((unit, _)) = along
                && !directions.iter().any(|other| other.cross(unit).magnitude2() < 1e-20)
            {
                directions.push(unit);
            }
        }
        let faces = self.faces().iter();
        Skeleton {
            edges: self.edges().to_vec(),
            directions,
            faces: faces.map(|face| (pose.vector(face.normal), face.corners.clone())).collect(),
            points,
            radius: 0.0,
        }
    }

    fn middle(&self) -> Point3<S> {
        Point3::from_vec(self.pose().translation)
    }
}
