use cgmath::{EuclideanSpace, InnerSpace, Matrix3};
use smallvec::SmallVec;

use crate::math::{Mat3, Point3, Scalar, Vec3, cast_point, cast_vector};
use crate::shape::{Aabb3, BoundedShape, Capsule, Face, Hull, Obb, Sphere, Triangle, farthest_of};

/// A convex shape as a polyhedral core with a rounding radius: all points within `radius` of a
/// polyhedron, which may also be a point, a segment, or flat. Coordinates are `f64` relative to a
/// nearby origin, so that nothing is lost far from the origin of the world.
#[derive(Clone, Copy, Debug)]
pub struct Core<'a> {
    pub(super) kind: CoreKind<'a>,
    /// Rounding radius, in metres.
    pub(super) radius: f64,
}

/// Points whose convex hull is the core.
#[derive(Clone, Copy, Debug)]
pub(super) enum CoreKind<'a> {
    Point(Vec3<f64>),
    Segment([Vec3<f64>; 2]),
    Triangle([Vec3<f64>; 3]),
    Cuboid(Cuboid),
    Hull {
        points: &'a [Point3<f64>],
        edges: &'a [[u32; 2]],
        faces: &'a [Face],
        rotation: Mat3<f64>,
        translation: Vec3<f64>,
        size: f64,
    },
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Cuboid {
    pub center: Vec3<f64>,
    pub axes: [Vec3<f64>; 3],
    pub half: [f64; 3],
}

/// Position and index of a vertex.
pub(super) type IndexedVertex = (Vec3<f64>, u32);
/// Vertices around a face, the ends of a segment, or a point.
pub(super) type Polygon = SmallVec<[IndexedVertex; 8]>;

/// A shape that has a [`Core`].
pub trait Convex<S: Scalar>: BoundedShape<S> {
    /// The core relative to an origin.
    #[must_use]
    fn core(&self, origin: Point3<f64>) -> Core<'_>;

    /// Center of the shape.
    #[must_use]
    fn center(&self) -> Point3<S>;

    /// The shape as a sphere, if it is one: spheres have closed-form answers.
    #[must_use]
    fn as_sphere(&self) -> Option<Sphere<S>> {
        None
    }
}

/// Sine below which a direction counts as parallel: about a thousandth of a turn.
pub(super) const PARALLEL_SIN: f64 = 6e-3;

/// The faces of a box by the bits of its vertices: −x, x, −y, y, −z, z.
pub(super) const BOX_FACES: [[u32; 4]; 6] =
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

impl Cuboid {
    pub fn corner(&self, number: u32) -> Vec3<f64> {
        (0..3).fold(self.center, |at, i| {
            let half = if number >> i & 1 == 0 { -self.half[i] } else { self.half[i] };
            at + self.axes[i] * half
        })
    }

    /// Index of the vertex that is farthest along a direction.
    pub fn support(&self, direction: Vec3<f64>) -> u32 {
        (0..3).fold(0, |corner, i| corner | u32::from(self.axes[i].dot(direction) > 0.0) << i)
    }

    /// Half extent along a direction.
    pub fn reach(&self, direction: Vec3<f64>) -> f64 {
        (0..3).map(|i| self.half[i] * self.axes[i].dot(direction).abs()).sum()
    }

    /// Index of the face whose normal is most aligned with a direction.
    fn facing(&self, direction: Vec3<f64>) -> usize {
        let along = self.axes.map(|axis| axis.dot(direction));
        let axis =
            (1..3).fold(0, |most, i| if along[i].abs() > along[most].abs() { i } else { most });
        2 * axis + usize::from(along[axis] > 0.0)
    }

    fn normal(&self, face: usize) -> Vec3<f64> {
        if face.is_multiple_of(2) { -self.axes[face / 2] } else { self.axes[face / 2] }
    }
}

/// Transforms a vertex of a hull.
fn placed(rotation: &Mat3<f64>, translation: Vec3<f64>, point: Point3<f64>) -> Vec3<f64> {
    rotation.x * point.x + rotation.y * point.y + rotation.z * point.z + translation
}

/// The unit normal of a triangle; none if it is degenerate.
fn normal_of(corners: [Vec3<f64>; 3]) -> Option<Vec3<f64>> {
    Triangle { corners: corners.map(Point3::from_vec) }.normal()
}

impl Core<'_> {
    /// Rounding radius around the polyhedron, in metres.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Support point: position and index of the vertex that is farthest along a direction.
    pub(super) fn support(&self, direction: Vec3<f64>) -> IndexedVertex {
        let support = |corners: &[Vec3<f64>]| {
            let mut best = (corners[0], 0);
            for (i, corner) in (1..).zip(&corners[1..]) {
                if (corner - best.0).dot(direction) > 0.0 {
                    best = (*corner, i);
                }
            }
            best
        };
        match &self.kind {
            CoreKind::Point(point) => (*point, 0),
            CoreKind::Segment(ends) => support(ends),
            CoreKind::Triangle(corners) => support(corners),
            CoreKind::Cuboid(cuboid) => {
                let corner = cuboid.support(direction);
                (cuboid.corner(corner), corner)
            }
            CoreKind::Hull { points, rotation, translation, .. } => {
                let local = Vec3::new(
                    rotation.x.dot(direction),
                    rotation.y.dot(direction),
                    rotation.z.dot(direction),
                );
                let best = farthest_of(points, local);
                (placed(rotation, *translation, points[best]), best as u32)
            }
        }
    }

    /// Approximate extent of the core, at least the radius, in metres.
    pub(super) fn size(&self) -> f64 {
        let largest = |v: Vec3<f64>| v.x.abs().max(v.y.abs()).max(v.z.abs());
        let far = match &self.kind {
            CoreKind::Point(_) => 0.0,
            CoreKind::Segment([a, b]) => largest(b - a),
            CoreKind::Triangle([a, b, c]) => largest(b - a).max(largest(c - a)),
            CoreKind::Cuboid(cuboid) => 2.0 * largest(cuboid.half.into()),
            CoreKind::Hull { size, .. } => *size,
        };
        far.max(self.radius)
    }

    /// Returns true for a triangle that is not degenerate.
    pub(super) fn is_nondegenerate_triangle(&self) -> bool {
        matches!(&self.kind, CoreKind::Triangle(corners) if normal_of(*corners).is_some())
    }

    /// A point inside the core.
    pub(super) fn inside(&self) -> Vec3<f64> {
        match &self.kind {
            CoreKind::Point(point) => *point,
            CoreKind::Segment([a, b]) => (a + b) * 0.5,
            CoreKind::Triangle([a, b, c]) => (a + b + c) / 3.0,
            CoreKind::Cuboid(cuboid) => cuboid.center,
            CoreKind::Hull { translation, .. } => *translation,
        }
    }

    /// Translates the core.
    pub(super) fn translated(mut self, by: Vec3<f64>) -> Self {
        match &mut self.kind {
            CoreKind::Point(point) => *point += by,
            CoreKind::Segment(ends) => ends.iter_mut().for_each(|end| *end += by),
            CoreKind::Triangle(corners) => corners.iter_mut().for_each(|corner| *corner += by),
            CoreKind::Cuboid(cuboid) => cuboid.center += by,
            CoreKind::Hull { translation, .. } => *translation += by,
        }
        self
    }

    /// Rotates the core about the origin.
    pub(super) fn rotated(mut self, by: Mat3<f64>) -> Self {
        match &mut self.kind {
            CoreKind::Point(point) => *point = by * *point,
            CoreKind::Segment(ends) => ends.iter_mut().for_each(|end| *end = by * *end),
            CoreKind::Triangle(corners) => {
                for corner in corners {
                    *corner = by * *corner;
                }
            }
            CoreKind::Cuboid(cuboid) => {
                cuboid.center = by * cuboid.center;
                cuboid.axes.iter_mut().for_each(|axis| *axis = by * *axis);
            }
            CoreKind::Hull { rotation, translation, .. } => {
                (*rotation, *translation) = (by * *rotation, by * *translation);
            }
        }
        self
    }

    /// Index of the face whose normal is within [`PARALLEL_SIN`] of a direction.
    pub(super) fn face_along(&self, direction: Vec3<f64>) -> Option<usize> {
        let face = match &self.kind {
            CoreKind::Point(_) | CoreKind::Segment(_) => None,
            CoreKind::Triangle(corners) => {
                normal_of(*corners).map(|normal| usize::from(normal.dot(direction) < 0.0))
            }
            CoreKind::Cuboid(cuboid) => Some(cuboid.facing(direction)),
            CoreKind::Hull { faces, rotation, .. } => {
                let local = Vec3::new(
                    rotation.x.dot(direction),
                    rotation.y.dot(direction),
                    rotation.z.dot(direction),
                );
                let (mut best, mut most) = (0, f64::NEG_INFINITY);
                for (i, face) in faces.iter().enumerate() {
                    let next = face.normal.dot(local);
                    if next > most {
                        (best, most) = (i, next);
                    }
                }
                Some(best)
            }
        }?;
        (self.normal(face).cross(direction).magnitude2() < PARALLEL_SIN * PARALLEL_SIN)
            .then_some(face)
    }

    /// The normal of a face.
    pub(super) fn normal(&self, face: usize) -> Vec3<f64> {
        match &self.kind {
            CoreKind::Cuboid(cuboid) => cuboid.normal(face),
            CoreKind::Hull { faces, rotation, .. } => rotation * faces[face].normal,
            CoreKind::Triangle(corners) => {
                let normal = normal_of(*corners).unwrap_or_else(Vec3::unit_x);
                if face == 0 { normal } else { -normal }
            }
            CoreKind::Point(_) | CoreKind::Segment(_) => Vec3::unit_x(),
        }
    }

    /// The vertices of a face, counterclockwise.
    pub(super) fn face(&self, face: usize) -> Polygon {
        match &self.kind {
            CoreKind::Cuboid(cuboid) => {
                BOX_FACES[face].iter().map(|corner| (cuboid.corner(*corner), *corner)).collect()
            }
            CoreKind::Hull { points, faces, rotation, translation, .. } => {
                let corner = |i: &u32| (placed(rotation, *translation, points[*i as usize]), *i);
                faces[face].corners.iter().map(corner).collect()
            }
            CoreKind::Triangle([a, b, c]) => {
                let corners = if face == 0 {
                    [(*a, 0), (*b, 1), (*c, 2)]
                } else {
                    [(*c, 2), (*b, 1), (*a, 0)]
                };
                corners.into_iter().collect()
            }
            CoreKind::Point(point) => std::iter::once((*point, 0)).collect(),
            CoreKind::Segment([a, b]) => [(*a, 0), (*b, 1)].into_iter().collect(),
        }
    }

    /// The face with the most support vertices along a direction, and of several the one most
    /// aligned with it; else the segment or the point.
    pub(super) fn facing(&self, direction: Vec3<f64>) -> Polygon {
        let face = match &self.kind {
            CoreKind::Point(_) | CoreKind::Segment(_) => 0,
            CoreKind::Triangle(corners) => {
                usize::from(normal_of(*corners).is_some_and(|normal| normal.dot(direction) < 0.0))
            }
            CoreKind::Cuboid(cuboid) => cuboid.facing(direction),
            CoreKind::Hull { points, faces, rotation, size, .. } => {
                let local = Vec3::new(
                    rotation.x.dot(direction),
                    rotation.y.dot(direction),
                    rotation.z.dot(direction),
                );
                let along: SmallVec<[f64; 32]> =
                    points.iter().map(|point| point.to_vec().dot(local)).collect();
                let reach = along.iter().copied().fold(f64::NEG_INFINITY, f64::max) - 1e-12 * size;
                let mut best = (0, 0, f64::NEG_INFINITY);
                for (i, face) in faces.iter().enumerate() {
                    let out = face.corners.iter().filter(|i| along[**i as usize] >= reach).count();
                    let looks = face.normal.dot(local);
                    if (out, looks) > (best.1, best.2) {
                        best = (i, out, looks);
                    }
                }
                best.0
            }
        };
        self.face(face)
    }
}

fn local<S: Scalar>(point: Point3<S>, origin: Point3<f64>) -> Vec3<f64> {
    cast_point::<S, f64>(point) - origin
}

impl<S: Scalar> Convex<S> for Sphere<S> {
    fn core(&self, origin: Point3<f64>) -> Core<'_> {
        Core { kind: CoreKind::Point(local(self.center, origin)), radius: self.radius.as_f64() }
    }

    fn center(&self) -> Point3<S> {
        self.center
    }

    fn as_sphere(&self) -> Option<Sphere<S>> {
        Some(*self)
    }
}

impl<S: Scalar> Convex<S> for Capsule<S> {
    fn core(&self, origin: Point3<f64>) -> Core<'_> {
        let ends = [self.a, self.b].map(|end| local(end, origin));
        Core { kind: CoreKind::Segment(ends), radius: self.radius.as_f64() }
    }

    fn center(&self) -> Point3<S> {
        self.a + (self.b - self.a) * S::from_f64(0.5)
    }

    fn as_sphere(&self) -> Option<Sphere<S>> {
        (self.a == self.b).then_some(Sphere { center: self.a, radius: self.radius })
    }
}

impl<S: Scalar> Convex<S> for Obb<S> {
    fn core(&self, origin: Point3<f64>) -> Core<'_> {
        let cuboid = Cuboid {
            center: local(self.center, origin),
            // In f64 from the start, or the vertices would be rounded.
            axes: self.axes_f64(),
            half: cast_vector(self.half_extents).into(),
        };
        Core { kind: CoreKind::Cuboid(cuboid), radius: 0.0 }
    }

    fn center(&self) -> Point3<S> {
        self.center
    }
}

impl<S: Scalar> Convex<S> for Aabb3<S> {
    fn core(&self, origin: Point3<f64>) -> Core<'_> {
        let (low, high) = (local(self.min, origin), local(self.max, origin));
        let half = (high - low) * 0.5;
        let axes = [Vec3::unit_x(), Vec3::unit_y(), Vec3::unit_z()];
        let cuboid = Cuboid { center: low + half, axes, half: half.into() };
        Core { kind: CoreKind::Cuboid(cuboid), radius: 0.0 }
    }

    fn center(&self) -> Point3<S> {
        self.center()
    }
}

impl<S: Scalar> Convex<S> for Triangle<S> {
    fn core(&self, origin: Point3<f64>) -> Core<'_> {
        let corners = self.corners.map(|corner| local(corner, origin));
        Core { kind: CoreKind::Triangle(corners), radius: 0.0 }
    }

    fn center(&self) -> Point3<S> {
        let [a, b, c] = self.corners;
        a + ((b - a) + (c - a)) / S::from_f64(3.0)
    }
}

impl<S: Scalar> Convex<S> for Hull<S> {
    fn core(&self, origin: Point3<f64>) -> Core<'_> {
        let pose = self.pose_f64();
        let kind = CoreKind::Hull {
            points: self.local_points(),
            edges: self.edges(),
            faces: self.faces(),
            rotation: Matrix3::from(pose.rotation),
            translation: pose.translation - origin.to_vec(),
            size: self.size(),
        };
        Core { kind, radius: 0.0 }
    }

    fn center(&self) -> Point3<S> {
        Point3::from_vec(cast_vector(self.pose_f64().translation))
    }
}
