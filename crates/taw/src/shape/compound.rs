use cgmath::InnerSpace;

use super::{Aabb3, BoundedShape, Capsule, Hull, Obb, PointProjection, Sphere};
use crate::Error;
use crate::error::{self, finite_point, finite_vector, within};
use crate::frame::Pose;
use crate::math::{Point3, Quat, Scalar, Vec3, cast_point, cast_vector};

/// Compound shape of several sub-shapes. With a single type, such as `Compound<Obb<f32>>`, queries
/// need no `match`; a mixed one is a `Compound<Shape<f32>>`.
#[derive(Clone, Debug, PartialEq)]
pub struct Compound<T> {
    parts: Vec<T>,
}

/// Any bounded convex shape, or a compound of such.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape<S> {
    /// A sphere.
    Sphere(Sphere<S>),
    /// An axis-aligned box.
    Aabb(Aabb3<S>),
    /// An oriented box.
    Obb(Obb<S>),
    /// A capsule.
    Capsule(Capsule<S>),
    /// A convex hull.
    Hull(Hull<S>),
    /// A compound.
    Compound(Compound<Shape<S>>),
}

impl<T> Compound<T> {
    /// Maximum nesting depth: recursion takes some hundred bytes of stack per level.
    pub const MAX_LEVELS: u32 = 64;

    /// Validates a compound.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for an empty list, or for more than [`MAX_LEVELS`](Self::MAX_LEVELS)
    /// nested compounds.
    pub fn new<S: Scalar>(parts: Vec<T>) -> Result<Self, Error>
    where
        T: BoundedShape<S>,
    {
        let count = u32::try_from(parts.len()).unwrap_or(u32::MAX);
        within("parts.len()", f64::from(count), 1.0, f64::from(u32::MAX - 1))?;
        let compound = Self { parts };
        let levels = f64::from(compound.levels());
        within("levels of the compound", levels, 1.0, f64::from(Self::MAX_LEVELS))?;
        Ok(compound)
    }

    /// Sub-shapes; never empty.
    #[must_use]
    pub fn parts(&self) -> &[T] {
        &self.parts
    }
}

impl<S: Scalar, T: BoundedShape<S>> BoundedShape<S> for Compound<T> {
    fn support(&self, direction: Vec3<S>) -> Point3<S> {
        let along =
            |point: Point3<S>| cgmath::dot(point - self.parts[0].support(direction), direction);
        let points = self.parts.iter().map(|part| part.support(direction));
        let first = self.parts[0].support(direction);
        points.fold(first, |best, point| if along(point) > along(best) { point } else { best })
    }

    fn bounding_box(&self) -> Aabb3<S> {
        let first = self.parts[0].bounding_box();
        self.parts.iter().fold(first, |all, part| all.union(&part.bounding_box()))
    }

    fn volume(&self) -> S {
        self.parts.iter().fold(S::zero(), |sum, part| sum + part.volume())
    }

    fn levels(&self) -> u32 {
        1 + self.parts.iter().map(T::levels).max().unwrap_or(0)
    }

    /// Projection onto the sub-shape that the point is deepest in, or nearest to.
    fn project_point(&self, point: Point3<S>) -> PointProjection<S> {
        let first = self.parts[0].project_point(point);
        self.parts[1..]
            .iter()
            .map(|part| part.project_point(point))
            .fold(first, |best, next| if next.distance < best.distance { next } else { best })
    }
}

impl<S: Scalar> Compound<Shape<S>> {
    /// Collects the simple sub-shapes, including those of nested compounds.
    fn flatten(self, simple: &mut Vec<Shape<S>>) {
        for part in self.parts {
            match part {
                Shape::Compound(inner) => inner.flatten(simple),
                other => simple.push(other),
            }
        }
    }
}

impl<S: Scalar> Shape<S> {
    /// Transforms the shape by a pose. An axis-aligned box becomes an oriented one.
    #[must_use]
    pub fn transformed(&self, pose: Pose<S>) -> Self {
        match self {
            Self::Sphere(sphere) => {
                Self::Sphere(Sphere { center: pose.transform_point(sphere.center), ..*sphere })
            }
            Self::Aabb(aabb) => Self::Obb(aabb.obb().transformed(pose)),
            Self::Obb(obb) => Self::Obb(obb.transformed(pose)),
            Self::Capsule(capsule) => Self::Capsule(capsule.transformed(pose)),
            Self::Hull(hull) => Self::Hull(hull.transformed(pose)),
            Self::Compound(compound) => {
                let parts = compound.parts.iter().map(|part| part.transformed(pose)).collect();
                Self::Compound(Compound { parts })
            }
        }
    }

    /// Converts to another scalar.
    pub(crate) fn cast<T: Scalar>(&self) -> Shape<T> {
        match self {
            Self::Sphere(Sphere { center, radius }) => Shape::Sphere(Sphere {
                center: cast_point(*center),
                radius: T::from_f64(radius.as_f64()),
            }),
            Self::Aabb(Aabb3 { min, max }) => {
                Shape::Aabb(Aabb3 { min: cast_point(*min), max: cast_point(*max) })
            }
            Self::Obb(Obb { center, rotation, half_extents }) => {
                let (s, v) = (T::from_f64(rotation.s.as_f64()), cast_vector(rotation.v));
                Shape::Obb(Obb {
                    center: cast_point(*center),
                    // Normalized in that scalar.
                    rotation: Quat::from_sv(s, v).normalize(),
                    half_extents: cast_vector(*half_extents),
                })
            }
            Self::Capsule(Capsule { a, b, radius }) => Shape::Capsule(Capsule {
                a: cast_point(*a),
                b: cast_point(*b),
                radius: T::from_f64(radius.as_f64()),
            }),
            Self::Hull(hull) => Shape::Hull(hull.cast()),
            Self::Compound(compound) => {
                let parts = compound.parts.iter().map(Self::cast).collect();
                Shape::Compound(Compound { parts })
            }
        }
    }

    /// Validates the shape and flattens nested compounds.
    pub(crate) fn validated(self) -> Result<Self, Error> {
        let shape = match self {
            Self::Sphere(Sphere { center, radius }) => Self::Sphere(Sphere::new(center, radius)?),
            Self::Aabb(Aabb3 { min, max }) => Self::Aabb(Aabb3::new(min, max)?),
            Self::Obb(Obb { center, rotation, half_extents }) => {
                Self::Obb(Obb::new(center, error::rotation("rotation", rotation)?, half_extents)?)
            }
            Self::Capsule(Capsule { a, b, radius }) => Self::Capsule(Capsule::new(a, b, radius)?),
            Self::Hull(hull) => Self::Hull(hull.validated()?),
            Self::Compound(compound) => {
                let mut parts = Vec::new();
                compound.flatten(&mut parts);
                let parts = parts.into_iter().map(Self::validated).collect::<Result<_, _>>()?;
                Self::Compound(Compound::new(parts)?)
            }
        };
        // Individually valid numbers may overflow together.
        let Aabb3 { min, max } = shape.bounding_box();
        for corner in [min, max] {
            finite_point(["shape.x", "shape.y", "shape.z"], corner)?;
        }
        finite_vector(["size.x", "size.y", "size.z"], max - min)?;
        Ok(shape)
    }

    fn solid(&self) -> &dyn BoundedShape<S> {
        match self {
            Self::Sphere(sphere) => sphere,
            Self::Aabb(aabb) => aabb,
            Self::Obb(obb) => obb,
            Self::Capsule(capsule) => capsule,
            Self::Hull(hull) => hull,
            Self::Compound(compound) => compound,
        }
    }
}

impl<S: Scalar> BoundedShape<S> for Shape<S> {
    fn support(&self, direction: Vec3<S>) -> Point3<S> {
        self.solid().support(direction)
    }

    fn bounding_box(&self) -> Aabb3<S> {
        self.solid().bounding_box()
    }

    fn volume(&self) -> S {
        self.solid().volume()
    }

    fn levels(&self) -> u32 {
        self.solid().levels()
    }

    fn project_point(&self, point: Point3<S>) -> PointProjection<S> {
        self.solid().project_point(point)
    }
}
