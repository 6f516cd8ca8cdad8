use cgmath::{EuclideanSpace, InnerSpace};

use crate::frame::Ray;
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector, direction_and_length};
use crate::shape::{Box3, Capsule, Compound, Hull, Obb, Plane, Shape, Solid, Sphere};

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit<S> {
    /// From the origin of the ray, in metres; zero if that is inside.
    pub distance: S,
    /// On the surface, or the origin.
    pub point: Point3<S>,
    /// Out of the surface, a unit vector. From inside, of the nearest surface.
    pub normal: Vec3<S>,
}

/// What a ray can meet. Counted in `f64` about the middle of the shape, so far from the
/// origin of the world nothing is lost but what the answer itself rounds.
pub trait Cast<S: Scalar> {
    /// Where a ray first meets it within a distance, which may be infinite.
    #[must_use]
    fn cast(&self, ray: &Ray<S>, longest: S) -> Option<RayHit<S>>;
}

/// A ray about some origin.
struct Local {
    from: Vec3<f64>,
    along: Vec3<f64>,
    /// What begins on a surface may be this far inside by rounding, in metres.
    rounding: f64,
}

impl Local {
    fn about<S: Scalar>(ray: &Ray<S>, origin: Point3<f64>) -> Option<Self> {
        // As long as it should be.
        let (along, _) = direction_and_length(cast_vector::<S, f64>(ray.direction))?;
        let start = cast_point::<S, f64>(ray.origin);
        let from = start - origin;
        let largest = start.to_vec().map(f64::abs) + from.map(f64::abs);
        let rounding = S::epsilon().as_f64() * 8.0 * (largest.x + largest.y + largest.z);
        Some(Self { from, along, rounding })
    }

    /// The hit at a distance, if it is neither behind nor too far.
    fn hit<S: Scalar>(
        &self,
        origin: Point3<f64>,
        longest: S,
        (distance, normal): (f64, Vec3<f64>),
    ) -> Option<RayHit<S>> {
        let ahead = distance >= -self.rounding;
        let distance = distance.max(0.0);
        (ahead && distance <= longest.as_f64()).then(|| RayHit {
            distance: S::constant(distance),
            point: cast_point(origin + self.from + self.along * distance),
            normal: cast_vector(normal),
        })
    }

    /// Where it comes into a ball, or has come into it before.
    fn enter_ball(&self, center: Vec3<f64>, radius: f64) -> Option<(f64, Vec3<f64>)> {
        let from = self.from - center;
        // From where it is nearest to the center, however far that is.
        let nearest = -from.dot(self.along);
        let aside = from + self.along * nearest;
        let half = radius * radius - aside.magnitude2();
        let distance = nearest - half.sqrt();
        (half >= 0.0).then(|| (distance, (from + self.along * distance) / radius))
    }

    /// Where it comes into a space behind planes (normal, height above the origin): the last
    /// of those that it comes in by, if that is before it goes out by one (Cyrus and Beck
    /// 1978).
    fn enter_planes(
        &self,
        planes: impl Iterator<Item = (Vec3<f64>, f64)>,
    ) -> Option<(f64, Vec3<f64>)> {
        let (mut into, mut out) = ((f64::NEG_INFINITY, -self.along), f64::INFINITY);
        for (normal, height) in planes {
            let (above, speed) = (self.from.dot(normal) - height, self.along.dot(normal));
            if speed == 0.0 {
                if above > 0.0 {
                    return None; // it runs along outside
                }
            } else {
                let distance = -above / speed;
                if speed > 0.0 {
                    out = out.min(distance);
                } else if distance > into.0 {
                    into = (distance, normal);
                }
            }
        }
        (into.0 <= out).then_some(into)
    }
}

/// The answer from inside, or by the rest if the origin is outside.
fn from_outside<S: Scalar>(
    solid: &impl Solid<S>,
    ray: &Ray<S>,
    cast: impl FnOnce() -> Option<RayHit<S>>,
) -> Option<RayHit<S>> {
    let near = solid.nearest(ray.origin);
    if near.distance <= S::zero() {
        return Some(RayHit { distance: S::zero(), point: ray.origin, normal: near.normal });
    }
    cast()
}

impl<S: Scalar> Cast<S> for Plane<S> {
    fn cast(&self, ray: &Ray<S>, longest: S) -> Option<RayHit<S>> {
        let (normal, length) = direction_and_length(cast_vector::<S, f64>(self.normal()))?;
        let local = Local::about(ray, Point3::origin())?;
        let height = self.offset().as_f64() / length;
        let above = local.from.dot(normal) - height;
        if above <= 0.0 {
            return Some(RayHit { distance: S::zero(), point: ray.origin, normal: self.normal() });
        }
        let hit = local.enter_planes(std::iter::once((normal, height)))?;
        local.hit(Point3::origin(), longest, hit)
    }
}

impl<S: Scalar> Cast<S> for Sphere<S> {
    fn cast(&self, ray: &Ray<S>, longest: S) -> Option<RayHit<S>> {
        from_outside(self, ray, || {
            let origin = cast_point(self.center);
            let local = Local::about(ray, origin)?;
            let hit = local.enter_ball(Vec3::new(0.0, 0.0, 0.0), self.radius.as_f64())?;
            local.hit(origin, longest, hit)
        })
    }
}

impl<S: Scalar> Cast<S> for Capsule<S> {
    fn cast(&self, ray: &Ray<S>, longest: S) -> Option<RayHit<S>> {
        from_outside(self, ray, || {
            let origin = cast_point(self.a);
            let local = Local::about(ray, origin)?;
            let (end, radius) = (cast_point::<S, f64>(self.b) - origin, self.radius.as_f64());
            let ends = [Vec3::new(0.0, 0.0, 0.0), end].map(|end| local.enter_ball(end, radius));
            let side = direction_and_length(end)
                .and_then(|(axis, long)| enter_side(&local, axis, long, radius));
            let ahead =
                ends.into_iter().chain([side]).flatten().filter(|(t, _)| *t >= -local.rounding);
            let first = ahead.min_by(|x, y| x.0.total_cmp(&y.0))?;
            local.hit(origin, longest, first)
        })
    }
}

/// Where a ray comes into the round side of a cylinder.
fn enter_side(ray: &Local, axis: Vec3<f64>, long: f64, radius: f64) -> Option<(f64, Vec3<f64>)> {
    let across = |v: Vec3<f64>| v - axis * v.dot(axis);
    let (from, along) = (across(ray.from), across(ray.along));
    let speed = along.magnitude2();
    let nearest = -from.dot(along) / speed;
    let aside = from + along * nearest;
    let half = radius * radius - aside.magnitude2();
    let distance = nearest - (half / speed).sqrt();
    let at = ray.from + ray.along * distance;
    let height = at.dot(axis);
    // Along the axis, the speed is zero and none of these comparisons holds.
    (half >= 0.0 && height >= 0.0 && height <= long).then(|| (distance, across(at) / radius))
}

impl<S: Scalar> Cast<S> for Obb<S> {
    fn cast(&self, ray: &Ray<S>, longest: S) -> Option<RayHit<S>> {
        from_outside(self, ray, || {
            let origin = cast_point(self.center);
            let local = Local::about(ray, origin)?;
            let axes = self.exact_axes();
            let half = cast_vector::<S, f64>(self.half_widths);
            let planes = (0..3).flat_map(|i| [(axes[i], half[i]), (-axes[i], half[i])]);
            let hit = local.enter_planes(planes)?;
            local.hit(origin, longest, hit)
        })
    }
}

impl<S: Scalar> Cast<S> for Box3<S> {
    fn cast(&self, ray: &Ray<S>, longest: S) -> Option<RayHit<S>> {
        from_outside(self, ray, || {
            let local = Local::about(ray, cast_point(self.min))?;
            let size = cast_point::<S, f64>(self.max) - cast_point(self.min);
            let axes = [Vec3::unit_x(), Vec3::unit_y(), Vec3::unit_z()];
            let planes = (0..3).flat_map(|i| [(axes[i], size[i]), (-axes[i], 0.0)]);
            let hit = local.enter_planes(planes)?;
            local.hit(cast_point(self.min), longest, hit)
        })
    }
}

impl<S: Scalar> Cast<S> for Hull<S> {
    fn cast(&self, ray: &Ray<S>, longest: S) -> Option<RayHit<S>> {
        from_outside(self, ray, || {
            let pose = self.exact_pose();
            let origin = Point3::from_vec(pose.translation);
            let local = Local::about(ray, origin)?;
            let points = self.local_points();
            let hit = local.enter_planes(self.faces().iter().map(|face| {
                let corner = points[face.corners[0] as usize].to_vec();
                (pose.vector(face.normal), face.normal.dot(corner))
            }))?;
            local.hit(origin, longest, hit)
        })
    }
}

impl<S: Scalar, T: Cast<S>> Cast<S> for Compound<T> {
    fn cast(&self, ray: &Ray<S>, longest: S) -> Option<RayHit<S>> {
        let hits = self.parts().iter().filter_map(|part| part.cast(ray, longest));
        hits.reduce(|first, next| if next.distance < first.distance { next } else { first })
    }
}

impl<S: Scalar> Cast<S> for Shape<S> {
    fn cast(&self, ray: &Ray<S>, longest: S) -> Option<RayHit<S>> {
        match self {
            Self::Sphere(sphere) => sphere.cast(ray, longest),
            Self::Aabb(aabb) => aabb.cast(ray, longest),
            Self::Obb(obb) => obb.cast(ray, longest),
            Self::Capsule(capsule) => capsule.cast(ray, longest),
            Self::Hull(hull) => hull.cast(ray, longest),
            Self::Compound(compound) => compound.cast(ray, longest),
        }
    }
}
