//! Spatial queries on the balls of a swarm, through a bounding volume hierarchy.

use cgmath::Zero;

use super::{BallId, Swarm};
use crate::contact::{
    RayCast, RayHit, ShapeCastHit, closest_points_of_shapes, shape_cast_of_shapes,
};
use crate::frame::Ray;
use crate::math::{Point3, Scalar, Vec3, is_finite, is_finite_point, length};
use crate::shape::{Aabb, Aabb3, BoundedShape, Bvh, PointProjection, Shape, Sphere};

/// Number of balls to an item of the tree: neighbours in memory are mostly neighbours in space.
const BLOCK: usize = 16;

/// Query acceleration structure of the balls of a swarm, for [`Swarm::queries`]. Kept between queries, it
/// is only refitted, unless the swarm has ordered its balls anew.
#[derive(Clone, Debug, Default)]
pub struct BallTree<S> {
    tree: Bvh<S>,
    /// First row of each item.
    blocks: Vec<u32>,
    boxes: Vec<Aabb3<S>>,
    /// Searches for pairs by the swarm when the tree was built.
    rebuilds: u64,
}

/// Hit of a query on a ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BallQueryHit<T> {
    /// The ball that was hit.
    pub ball: BallId,
    /// Result of the query.
    pub result: T,
}

impl<S: Scalar> BallTree<S> {
    /// Brings the tree up to date with a swarm. It takes some nanoseconds for each ball.
    pub fn update(&mut self, swarm: &Swarm<S>) {
        let before = std::mem::take(&mut self.blocks);
        self.boxes.clear();
        if swarm.len() > swarm.body_balls.len() {
            for first in (0..swarm.len()).step_by(BLOCK) {
                let own = swarm.own_spheres(first).map(|(_, ball)| ball.bounding_box());
                if let Some(bounds) = own.reduce(|all, next| all.union(&next)) {
                    self.blocks.push(first as u32);
                    self.boxes.push(bounds);
                }
            }
        }
        if self.blocks == before && self.rebuilds == swarm.rebuilds() {
            self.tree.refit(&self.boxes);
        } else {
            self.tree = Bvh::new(&self.boxes);
            self.rebuilds = swarm.rebuilds();
        }
    }
}

/// Spatial queries of the balls as they are, created by [`Swarm::queries`]. Every query takes a filter that
/// selects balls; `|_| true` selects all. Balls of marbles are none of them.
#[derive(Debug)]
pub struct BallQueries<'a, S: Scalar> {
    swarm: &'a Swarm<S>,
    tree: &'a BallTree<S>,
}

impl<S: Scalar> Swarm<S> {
    /// Queries through a tree that is up to date ([`BallTree::update`]), so that many share it. Of one that
    /// is older, hits are true, but some may be missed.
    ///
    /// ```
    /// use taw::frame::Ray;
    /// use taw::prelude::*;
    /// use taw::swarm::{Ball, BallTree, Swarm};
    ///
    /// # fn main() -> Result<(), taw::Error> {
    /// let mut swarm = Swarm::<f32>::default();
    /// let balls = swarm.insert(&[Ball::new(Point3::new(3.0, 0.0, 0.0), 0.5)])?;
    /// let mut tree = BallTree::default();
    /// tree.update(&swarm);
    /// let ray = Ray { origin: Point3::new(0.0, 0.0, 0.0), direction: Vec3::unit_x() };
    /// let hits = swarm.queries(&tree).cast_ray_all(&ray, 10.0, |_| true);
    /// assert_eq!((hits.len(), hits[0].ball, hits[0].result.distance), (1, balls[0], 2.5));
    /// # Ok(())
    /// # }
    /// ```
    #[must_use]
    pub fn queries<'a>(&'a self, tree: &'a BallTree<S>) -> BallQueries<'a, S> {
        BallQueries { swarm: self, tree }
    }

    /// Rows and shapes of the balls of a block that are no marbles.
    fn own_spheres(&self, first: usize) -> impl Iterator<Item = (usize, Sphere<S>)> {
        let last = self.len().min(first + BLOCK);
        (first..last).filter(|row| !self.is_marble(*row)).map(|row| {
            let [x, y, z, radius] = self.at[row];
            (row, Sphere { center: Point3::new(x, y, z), radius })
        })
    }
}

impl<S: Scalar> BallQueries<'_, S> {
    /// Balls of an item that a filter selects.
    fn balls(
        &self,
        item: u32,
        filter: &impl Fn(BallId) -> bool,
    ) -> impl Iterator<Item = (BallId, Sphere<S>)> {
        let first = self.tree.blocks.get(item as usize).map(|first| *first as usize);
        let all = first.into_iter().flat_map(|first| self.swarm.own_spheres(first));
        all.filter_map(|(row, ball)| Some((self.swarm.id(row)?, ball)))
            .filter(|(id, _)| filter(*id))
    }

    /// Hits of a ray on balls within a distance, which may be infinite, nearest first.
    pub fn cast_ray_all(
        &self,
        ray: &Ray<S>,
        max_distance: S,
        filter: impl Fn(BallId) -> bool,
    ) -> Vec<BallQueryHit<RayHit<S>>> {
        let mut hits = Vec::new();
        let bounds = self.tree.tree.bounds();
        let Some(bounds) =
            bounds.filter(|_| is_finite_point(ray.origin) && is_finite(ray.direction))
        else {
            return hits;
        };
        // The ray ends beyond the bounds.
        let reach = length(bounds.center() - ray.origin) + length(bounds.max - bounds.min);
        let motion = ray.direction * reach.min(max_distance);
        self.tree.tree.for_each_on_segment(ray.origin, motion, |item| {
            hits.extend(self.balls(item, &filter).filter_map(|(ball, sphere)| {
                let result = sphere.cast_ray(ray, max_distance)?;
                Some(BallQueryHit { ball, result })
            }));
        });
        hits.sort_by(|x, y| order(x.result.distance, y.result.distance).then(x.ball.cmp(&y.ball)));
        hits
    }

    /// First hit of a shape that translates along a line. A ball that it touches at the start counts if
    /// they approach, and not if they separate.
    pub fn cast_shape(
        &self,
        shape: &Shape<S>,
        translation: Vec3<S>,
        filter: impl Fn(BallId) -> bool,
    ) -> Option<BallQueryHit<ShapeCastHit<S>>> {
        let mut best: Option<BallQueryHit<ShapeCastHit<S>>> = None;
        if !is_finite(translation) {
            return best;
        }
        let start = shape.bounding_box();
        let end = Aabb { min: start.min + translation, max: start.max + translation };
        let path = start.union(&end);
        self.tree.tree.for_each_in_box(&path, |item| {
            let near = |(_, ball): &(BallId, Sphere<S>)| ball.bounding_box().overlaps(&path);
            for (ball, sphere) in self.balls(item, &filter).filter(near) {
                let sphere = Shape::Sphere(sphere);
                let hit = shape_cast_of_shapes(&sphere, Vec3::zero(), shape, translation);
                let Some(result) = hit.map(|hit| hit.result) else { continue };
                let next = BallQueryHit { ball, result };
                let key = |it: &BallQueryHit<ShapeCastHit<S>>| (it.result.time, it.ball);
                if best.as_ref().is_none_or(|best| key(&next) < key(best)) {
                    best = Some(next);
                }
            }
        });
        best
    }

    /// All balls that overlap a shape, sorted.
    pub fn overlaps(&self, shape: &Shape<S>, filter: impl Fn(BallId) -> bool) -> Vec<BallId> {
        let bounds = shape.bounding_box();
        let mut found = Vec::new();
        self.tree.tree.for_each_in_box(&bounds, |item| {
            let near = |(_, ball): &(BallId, Sphere<S>)| ball.bounding_box().overlaps(&bounds);
            let overlaps = |(_, ball): &(BallId, Sphere<S>)| {
                let near = closest_points_of_shapes(&Shape::Sphere(*ball), shape);
                near.is_some_and(|near| near.result.touching())
            };
            let balls = self.balls(item, &filter).filter(near).filter(overlaps);
            found.extend(balls.map(|(ball, _)| ball));
        });
        found.sort_unstable();
        found
    }

    /// Projects a point onto the surface of the nearest ball within a distance, which may be infinite. If the
    /// point is inside of several, onto that of the one it penetrates deepest.
    pub fn project_point(
        &self,
        point: Point3<S>,
        within: S,
        filter: impl Fn(BallId) -> bool,
    ) -> Option<BallQueryHit<PointProjection<S>>> {
        let mut best: Option<BallQueryHit<PointProjection<S>>> = None;
        let mut reach = within;
        self.tree.tree.for_each_near(point, within, |item| {
            for (ball, sphere) in self.balls(item, &filter) {
                let next = BallQueryHit { ball, result: sphere.project_point(point) };
                let key = |it: &BallQueryHit<PointProjection<S>>| (it.result.distance, it.ball);
                let is_near = next.result.distance <= within;
                if is_near && best.as_ref().is_none_or(|best| key(&next) < key(best)) {
                    best = Some(next);
                    reach = next.result.distance.max(S::zero());
                }
            }
            reach
        });
        best
    }
}

fn order<S: Scalar>(x: S, y: S) -> std::cmp::Ordering {
    x.partial_cmp(&y).unwrap_or(std::cmp::Ordering::Equal)
}
