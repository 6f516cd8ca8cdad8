use cgmath::{EuclideanSpace, InnerSpace};

use crate::frame::Ray;
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector, normalize_and_length};
use crate::shape::{Aabb3, BoundedShape, Capsule, Compound, Hull, Obb, Plane, Shape, Sphere};

/// Hit of a ray on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit<S> {
    /// Distance from the origin of the ray, in metres; zero if that is inside.
    pub distance: S,
    /// Point on the surface, or the origin.
    pub point: Point3<S>,
    /// Outward unit normal; from inside, that of the nearest surface.
    pub normal: Vec3<S>,
}

/// Ray casting. Computed in `f64` relative to the center of the shape, so that far from the origin
/// of the world only the result is rounded.
pub trait RayCast<S: Scalar> {
    /// First hit of a ray within a distance, which may be infinite.
    #[must_use]
    fn cast_ray(&self, ray: &Ray<S>, max_distance: S) -> Option<RayHit<S>>;
}

/// A ray relative to an origin.
struct LocalRay {
    from: Vec3<f64>,
    along: Vec3<f64>,
    /// Depth by which a ray that starts on a surface may be inside by rounding, in metres.
    rounding: f64,
}

impl LocalRay {
    fn new<S: Scalar>(ray: &Ray<S>, origin: Point3<f64>) -> Option<Self> {
        // Normalized in `f64`.
        let (along, _) = normalize_and_length(cast_vector::<S, f64>(ray.direction))?;
        let start = cast_point::<S, f64>(ray.origin);
        let from = start - origin;
        let largest = start.to_vec().map(f64::abs) + from.map(f64::abs);
        let rounding = S::epsilon().as_f64() * 8.0 * (largest.x + largest.y + largest.z);
        Some(Self { from, along, rounding })
    }

    /// The hit at a distance, unless it is behind the origin or too far.
    fn hit<S: Scalar>(
        &self,
        origin: Point3<f64>,
        max_distance: S,
        (distance, normal): (f64, Vec3<f64>),
    ) -> Option<RayHit<S>> {
        let ahead = distance >= -self.rounding;
        let distance = distance.max(0.0);
        (ahead && distance <= max_distance.as_f64()).then(|| RayHit {
            distance: S::from_f64(distance),
            point: cast_point(origin + self.from + self.along * distance),
            normal: cast_vector(normal),
        })
    }

    /// Entry point into a sphere, possibly behind the origin.
    fn enter_sphere(&self, center: Vec3<f64>, radius: f64) -> Option<(f64, Vec3<f64>)> {
        let from = self.from - center;
        // From the point nearest to the center, however far that is.
        let nearest = -from.dot(self.along);
        let aside = from + self.along * nearest;
        let half = radius * radius - aside.magnitude2();
        let distance = nearest - half.sqrt();
        (half >= 0.0).then(|| (distance, (from + self.along * distance) / radius))
    }

    /// Entry point into an intersection of half-spaces (normal, offset): the last entered, if that
    /// is before the first one left (Cyrus and Beck 1978).
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

/// Hit at distance zero if the origin is inside; else the given cast.
fn cast_from_outside<S: Scalar>(
    solid: &impl BoundedShape<S>,
    ray: &Ray<S>,
    cast: impl FnOnce() -> Option<RayHit<S>>,
) -> Option<RayHit<S>> {
    let near = solid.project_point(ray.origin);
    if near.distance <= S::zero() {
        return Some(RayHit { distance: S::zero(), point: ray.origin, normal: near.normal });
    }
    cast()
}

impl<S: Scalar> RayCast<S> for Plane<S> {
    fn cast_ray(&self, ray: &Ray<S>, max_distance: S) -> Option<RayHit<S>> {
        let (normal, length) = normalize_and_length(cast_vector::<S, f64>(self.normal()))?;
        let local = LocalRay::new(ray, Point3::origin())?;
        let height = self.offset().as_f64() / length;
        let above = local.from.dot(normal) - height;
        if above <= 0.0 {
            return Some(RayHit { distance: S::zero(), point: ray.origin, normal: self.normal() });
        }
        let hit = local.enter_planes(std::iter::once((normal, height)))?;
        local.hit(Point3::origin(), max_distance, hit)
    }
}

impl<S: Scalar> RayCast<S> for Sphere<S> {
    fn cast_ray(&self, ray: &Ray<S>, max_distance: S) -> Option<RayHit<S>> {
        cast_from_outside(self, ray, || {
            let origin = cast_point(self.center);
            let local = LocalRay::new(ray, origin)?;
            let hit = local.enter_sphere(Vec3::new(0.0, 0.0, 0.0), self.radius.as_f64())?;
            local.hit(origin, max_distance, hit)
        })
    }
}

impl<S: Scalar> RayCast<S> for Capsule<S> {
    fn cast_ray(&self, ray: &Ray<S>, max_distance: S) -> Option<RayHit<S>> {
        cast_from_outside(self, ray, || {
            let origin = cast_point(self.a);
            let local = LocalRay::new(ray, origin)?;
            let (end, radius) = (cast_point::<S, f64>(self.b) - origin, self.radius.as_f64());
            let ends = [Vec3::new(0.0, 0.0, 0.0), end].map(|end| local.enter_sphere(end, radius));
            let side = normalize_and_length(end)
                .and_then(|(axis, long)| enter_side(&local, axis, long, radius));
            let ahead =
                ends.into_iter().chain([side]).flatten().filter(|(t, _)| *t >= -local.rounding);
            let first = ahead.min_by(|x, y| x.0.total_cmp(&y.0))?;
            local.hit(origin, max_distance, first)
        })
    }
}

/// Entry point into the lateral surface of a cylinder.
fn enter_side(ray: &LocalRay, axis: Vec3<f64>, long: f64, radius: f64) -> Option<(f64, Vec3<f64>)> {
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

impl<S: Scalar> RayCast<S> for Obb<S> {
    fn cast_ray(&self, ray: &Ray<S>, max_distance: S) -> Option<RayHit<S>> {
        cast_from_outside(self, ray, || {
            let origin = cast_point(self.center);
            let local = LocalRay::new(ray, origin)?;
            let axes = self.axes_f64();
            let half = cast_vector::<S, f64>(self.half_extents);
            let planes = (0..3).flat_map(|i| [(axes[i], half[i]), (-axes[i], half[i])]);
            let hit = local.enter_planes(planes)?;
            local.hit(origin, max_distance, hit)
        })
    }
}

impl<S: Scalar> RayCast<S> for Aabb3<S> {
    fn cast_ray(&self, ray: &Ray<S>, max_distance: S) -> Option<RayHit<S>> {
        cast_from_outside(self, ray, || {
            let local = LocalRay::new(ray, cast_point(self.min))?;
            let size = cast_point::<S, f64>(self.max) - cast_point(self.min);
            let axes = [Vec3::unit_x(), Vec3::unit_y(), Vec3::unit_z()];
            let planes = (0..3).flat_map(|i| [(axes[i], size[i]), (-axes[i], 0.0)]);
            let hit = local.enter_planes(planes)?;
            local.hit(cast_point(self.min), max_distance, hit)
        })
    }
}

impl<S: Scalar> RayCast<S> for Hull<S> {
    fn cast_ray(&self, ray: &Ray<S>, max_distance: S) -> Option<RayHit<S>> {
        cast_from_outside(self, ray, || {
            let pose = self.pose_f64();
            let origin = Point3::from_vec(pose.translation);
            let local = LocalRay::new(ray, origin)?;
            let points = self.local_points();
            let hit = local.enter_planes(self.faces().iter().map(|face| {
                let corner = points[face.corners[0] as usize].to_vec();
                (pose.transform_vector(face.normal), face.normal.dot(corner))
            }))?;
            local.hit(origin, max_distance, hit)
        })
    }
}

impl<S: Scalar, T: RayCast<S>> RayCast<S> for Compound<T> {
    fn cast_ray(&self, ray: &Ray<S>, max_distance: S) -> Option<RayHit<S>> {
        let hits = self.parts().iter().filter_map(|part| part.cast_ray(ray, max_distance));
        hits.reduce(|first, next| if next.distance < first.distance { next } else { first })
    }
}

impl<S: Scalar> RayCast<S> for Shape<S> {
    fn cast_ray(&self, ray: &Ray<S>, max_distance: S) -> Option<RayHit<S>> {
        match self {
            Self::Sphere(sphere) => sphere.cast_ray(ray, max_distance),
            Self::Aabb(aabb) => aabb.cast_ray(ray, max_distance),
            Self::Obb(obb) => obb.cast_ray(ray, max_distance),
            Self::Capsule(capsule) => capsule.cast_ray(ray, max_distance),
            Self::Hull(hull) => hull.cast_ray(ray, max_distance),
            Self::Compound(compound) => compound.cast_ray(ray, max_distance),
        }
    }
}
