use cgmath::InnerSpace;

use super::{Box3, Capsule, Hull, Nearest, Obb, Solid, Sphere};
use crate::Error;
use crate::error::{self, finite_point, finite_vector, within};
use crate::frame::Pose;
use crate::math::{Point3, Quat, Scalar, Vec3, cast_point, cast_vector};

/// Several parts that are one thing. Of one kind, `Compound<Obb<f32>>` say, nothing needs
/// to be matched; of mixed kinds it is a `Compound<Shape<f32>>`.
#[derive(Clone, Debug, PartialEq)]
pub struct Compound<T> {
    parts: Vec<T>,
}

/// Any bounded convex shape, or a compound of such.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape<S> {
    /// All points near one.
    Sphere(Sphere<S>),
    /// A box along the axes.
    Aabb(Box3<S>),
    /// A box.
    Obb(Obb<S>),
    /// All points near a line.
    Capsule(Capsule<S>),
    /// What is around some points.
    Hull(Hull<S>),
    /// Several of these.
    Compound(Compound<Shape<S>>),
}

impl<T> Compound<T> {
    /// How many compounds may be inside each other: what walks through them takes some hundred
    /// bytes of the stack for each.
    pub const MAX_LEVELS: u32 = 64;

    /// A compound, checked.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for no parts at all, or for more than
    /// [`MAX_LEVELS`](Self::MAX_LEVELS) compounds inside each other.
    pub fn new<S: Scalar>(parts: Vec<T>) -> Result<Self, Error>
    where
        T: Solid<S>,
    {
        let count = u32::try_from(parts.len()).unwrap_or(u32::MAX);
        within("parts.len()", f64::from(count), 1.0, f64::from(u32::MAX - 1))?;
        let compound = Self { parts };
        let levels = f64::from(compound.levels());
        within("levels of the compound", levels, 1.0, f64::from(Self::MAX_LEVELS))?;
        Ok(compound)
    }

    /// What it is made of; never nothing.
    #[must_use]
    pub fn parts(&self) -> &[T] {
        &self.parts
    }
}

impl<S: Scalar, T: Solid<S>> Solid<S> for Compound<T> {
    fn support(&self, direction: Vec3<S>) -> Point3<S> {
        let along =
            |point: Point3<S>| cgmath::dot(point - self.parts[0].support(direction), direction);
        let points = self.parts.iter().map(|part| part.support(direction));
        let first = self.parts[0].support(direction);
        points.fold(first, |best, point| if along(point) > along(best) { point } else { best })
    }

    fn bounding_box(&self) -> Box3<S> {
        let first = self.parts[0].bounding_box();
        self.parts.iter().fold(first, |all, part| all.union(&part.bounding_box()))
    }

    fn volume(&self) -> S {
        self.parts.iter().fold(S::zero(), |sum, part| sum + part.volume())
    }

    fn levels(&self) -> u32 {
        1 + self.parts.iter().map(T::levels).max().unwrap_or(0)
    }

    /// That of the part that the point is deepest in, or nearest to.
    fn nearest(&self, point: Point3<S>) -> Nearest<S> {
        let first = self.parts[0].nearest(point);
        self.parts[1..]
            .iter()
            .map(|part| part.nearest(point))
            .fold(first, |best, next| if next.distance < best.distance { next } else { best })
    }
}

impl<S: Scalar> Compound<Shape<S>> {
    /// Its simple parts, and those of the compounds in it.
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
    /// The same shape elsewhere. A box along the axes becomes one that may be turned.
    #[must_use]
    pub fn moved(&self, pose: Pose<S>) -> Self {
        match self {
            Self::Sphere(sphere) => {
                Self::Sphere(Sphere { center: pose.point(sphere.center), ..*sphere })
            }
            Self::Aabb(aabb) => Self::Obb(aabb.obb().moved(pose)),
            Self::Obb(obb) => Self::Obb(obb.moved(pose)),
            Self::Capsule(capsule) => Self::Capsule(capsule.moved(pose)),
            Self::Hull(hull) => Self::Hull(hull.moved(pose)),
            Self::Compound(compound) => {
                let parts = compound.parts.iter().map(|part| part.moved(pose)).collect();
                Self::Compound(Compound { parts })
            }
        }
    }

    /// The same in another scalar.
    pub(crate) fn in_scalar<T: Scalar>(&self) -> Shape<T> {
        match self {
            Self::Sphere(Sphere { center, radius }) => Shape::Sphere(Sphere {
                center: cast_point(*center),
                radius: T::constant(radius.as_f64()),
            }),
            Self::Aabb(Box3 { min, max }) => {
                Shape::Aabb(Box3 { min: cast_point(*min), max: cast_point(*max) })
            }
            Self::Obb(Obb { center, rotation, half_widths }) => {
                let (s, v) = (T::constant(rotation.s.as_f64()), cast_vector(rotation.v));
                Shape::Obb(Obb {
                    center: cast_point(*center),
                    // As long as it should be in that scalar.
                    rotation: Quat::from_sv(s, v).normalize(),
                    half_widths: cast_vector(*half_widths),
                })
            }
            Self::Capsule(Capsule { a, b, radius }) => Shape::Capsule(Capsule {
                a: cast_point(*a),
                b: cast_point(*b),
                radius: T::constant(radius.as_f64()),
            }),
            Self::Hull(hull) => Shape::Hull(hull.in_scalar()),
            Self::Compound(compound) => {
                let parts = compound.parts.iter().map(Self::in_scalar).collect();
                Shape::Compound(Compound { parts })
            }
        }
    }

    /// This shape, if it can be one, whoever put its numbers together; with the compounds in
    /// compounds laid out flat.
    pub(crate) fn checked(self) -> Result<Self, Error> {
        let shape = match self {
            Self::Sphere(Sphere { center, radius }) => Self::Sphere(Sphere::new(center, radius)?),
            Self::Aabb(Box3 { min, max }) => Self::Aabb(Box3::new(min, max)?),
            Self::Obb(Obb { center, rotation, half_widths }) => {
                Self::Obb(Obb::new(center, error::rotation("rotation", rotation)?, half_widths)?)
            }
            Self::Capsule(Capsule { a, b, radius }) => Self::Capsule(Capsule::new(a, b, radius)?),
            Self::Hull(hull) => Self::Hull(hull.checked()?),
            Self::Compound(compound) => {
                let mut parts = Vec::new();
                compound.flatten(&mut parts);
                let parts = parts.into_iter().map(Self::checked).collect::<Result<_, _>>()?;
                Self::Compound(Compound::new(parts)?)
            }
        };
        // Numbers that are right one by one may overflow together.
        let Box3 { min, max } = shape.bounding_box();
        for corner in [min, max] {
            finite_point(["shape.x", "shape.y", "shape.z"], corner)?;
        }
        finite_vector(["size.x", "size.y", "size.z"], max - min)?;
        Ok(shape)
    }

    fn solid(&self) -> &dyn Solid<S> {
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

impl<S: Scalar> Solid<S> for Shape<S> {
    fn support(&self, direction: Vec3<S>) -> Point3<S> {
        self.solid().support(direction)
    }

    fn bounding_box(&self) -> Box3<S> {
        self.solid().bounding_box()
    }

    fn volume(&self) -> S {
        self.solid().volume()
    }

    fn levels(&self) -> u32 {
        self.solid().levels()
    }

    fn nearest(&self, point: Point3<S>) -> Nearest<S> {
        self.solid().nearest(point)
    }
}
