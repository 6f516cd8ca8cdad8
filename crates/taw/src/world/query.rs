//! Spatial queries through a bounding volume hierarchy.

use super::query_walls::{
    cast_ray_on_wall, cast_shape_on_half_space, cast_shape_on_wall, overlaps_half_space,
    overlaps_on_wall,
};
use super::walls::SubShape;
use super::{MarbleId, WallId, WallShape, World};
use crate::Error;
use crate::body::BodyId;
use crate::broad::CollisionLayers;
use crate::contact::{
    RayCast, RayHit, ShapeCastHit, closest_points_of_shapes, shape_cast_of_shapes,
};
use crate::frame::Ray;
use crate::math::{Point3, Scalar, Vec3, is_finite, is_finite_point, length};
use crate::shape::{Aabb, Aabb3, BoundedShape, Bvh, Plane, PointProjection, Shape};

/// A collider: a marble, a wall or a rigid body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ColliderId {
    /// A marble.
    Marble(MarbleId),
    /// A wall.
    Wall(WallId),
    /// A rigid body.
    Body(BodyId),
}

impl From<MarbleId> for ColliderId {
    fn from(id: MarbleId) -> Self {
        Self::Marble(id)
    }
}

impl From<WallId> for ColliderId {
    fn from(id: WallId) -> Self {
        Self::Wall(id)
    }
}

impl From<BodyId> for ColliderId {
    fn from(id: BodyId) -> Self {
        Self::Body(id)
    }
}

/// Hit of a query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QueryHit<T> {
    /// The collider that was hit.
    pub collider: ColliderId,
    /// Result of the query.
    pub result: T,
}

/// Query acceleration structure of a world for [`World::queries`]. Kept between queries, it is only
/// refitted.
#[derive(Clone, Debug, Default)]
pub struct QueryTree<S> {
    tree: Bvh<S>,
    items: Vec<Item>,
    boxes: Vec<Aabb3<S>>,
}

/// Item of a leaf.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Item {
    Marble(MarbleId),
    Wall(SubShape),
    /// Convex part of a body.
    Body(BodyId, u32),
}

impl<S: Scalar> QueryTree<S> {
    /// Brings the tree up to date with a world, for [`World::queries_of`].
    pub fn update(&mut self, world: &World<S>) {
        let before = std::mem::take(&mut self.items);
        self.boxes.clear();
        for (row, id) in
            (0..world.marbles.len()).filter_map(|row| Some((row, world.marbles.id(row)?)))
        {
            self.items.push(Item::Marble(id));
            self.boxes.push(world.marbles.shape_of_row(row).bounding_box());
        }
        for (wall, shape) in (0..).zip(world.walls.shapes()) {
            shape.for_each_box(|part, bounds| {
                self.items.push(Item::Wall(SubShape { wall, index: part }));
                self.boxes.push(bounds);
            });
        }
        for (id, state) in world.bodies.ids().zip(&world.bodies.states) {
            for (part, shape) in (0..).zip(state.world_parts()) {
                self.items.push(Item::Body(id, part));
                self.boxes.push(shape.bounding_box());
            }
        }
        if self.items == before {
            self.tree.refit(&self.boxes);
        } else {
            self.tree = Bvh::new(&self.boxes);
        }
    }
}

/// Spatial queries of the current state, created by [`World::queries`] or [`World::queries_of`]. Every
/// query takes a filter that selects colliders; `|_| true` selects all.
///
/// Rays and shapes hit meshes on their surface, from either side. All convex parts of a wall or a body count,
/// and each collider is found once.
#[derive(Debug)]
pub struct Queries<'a, S: Scalar> {
    world: &'a World<S>,
    tree: &'a QueryTree<S>,
}

impl<S: Scalar> World<S> {
    /// Updates the tree to the current state. Large translation since the last build slow queries
    /// down, and never make them wrong.
    ///
    /// ```
    /// use taw::frame::Ray;
    /// use taw::prelude::*;
    ///
    /// # fn main() -> Result<(), taw::Error> {
    /// let mut world = World::<f32>::default();
    /// let floor = world.walls.insert(Plane::new(Vec3::unit_y(), 0.0)?)?;
    /// let down = Ray { origin: Point3::new(0.0, 2.0, 0.0), direction: -Vec3::unit_y() };
    /// let mut tree = QueryTree::default();
    /// let found = world.queries(&mut tree).cast_ray(&down, 10.0, |_| true);
    /// let found = found.ok_or(taw::Error::NoSuchWall(floor))?;
    /// assert_eq!((found.collider, found.result.distance), (ColliderId::Wall(floor), 2.0));
    /// # Ok(())
    /// # }
    /// ```
    pub fn queries<'a>(&'a self, tree: &'a mut QueryTree<S>) -> Queries<'a, S> {
        tree.update(self);
        self.queries_of(tree)
    }

    /// Layers of a collider.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::NoSuchWall`], [`Error::NoSuchBody`].
    pub fn layers(&self, collider: ColliderId) -> Result<CollisionLayers, Error> {
        match collider {
            ColliderId::Marble(id) => {
                self.marbles.row(id).map(|row| self.marbles.layers_of_row(row))
            }
            ColliderId::Wall(id) => self.walls.layers(id),
            ColliderId::Body(id) => {
                self.bodies.row(id).map(|row| self.bodies.states[row].body.layers)
            }
        }
    }

    /// Queries through a tree that is up to date ([`QueryTree::update`]), so that many share it. It still is
    /// after marbles were removed. Of one that is older, hits are true, but some may be missed: of what came
    /// or moved since, and after a wall was removed, of any.
    #[must_use]
    pub fn queries_of<'a>(&'a self, tree: &'a QueryTree<S>) -> Queries<'a, S> {
        Queries { world: self, tree }
    }
}

impl<S: Scalar> Queries<'_, S> {
    fn collider(&self, item: Item) -> Option<ColliderId> {
        match item {
            Item::Marble(id) => self.world.marbles.row(id).ok().map(|_| ColliderId::Marble(id)),
            Item::Wall(part) => self.world.walls.id(part.wall as usize).map(ColliderId::Wall),
            Item::Body(id, _) => self.world.bodies.row(id).ok().map(|_| ColliderId::Body(id)),
        }
    }

    /// Shape of a marble, or of a part of a body.
    fn shape(&self, item: Item) -> Option<Shape<S>> {
        let world = self.world;
        match item {
            Item::Marble(id) => world.marbles.shape(id).ok(),
            Item::Body(id, part) => {
                world.bodies.states[world.bodies.row(id).ok()?].world_part(part)
            }
            Item::Wall(_) => None,
        }
    }

    fn planes(&self) -> impl Iterator<Item = (Item, &Plane<S>)> {
        let item = |wall| Item::Wall(SubShape { wall, index: 0 });
        self.world.walls.planes().map(move |(row, plane)| (item(row), plane))
    }

    /// First hit of a ray within a distance, which may be infinite.
    pub fn cast_ray(
        &self,
        ray: &Ray<S>,
        max_distance: S,
        filter: impl Fn(ColliderId) -> bool,
    ) -> Option<QueryHit<RayHit<S>>> {
        let hits = self.cast_ray_all(ray, max_distance, filter);
        hits.into_iter().next()
    }

    /// First hit of a ray on each collider within a distance, nearest first.
    pub fn cast_ray_all(
        &self,
        ray: &Ray<S>,
        max_distance: S,
        filter: impl Fn(ColliderId) -> bool,
    ) -> Vec<QueryHit<RayHit<S>>> {
        let mut hits = Hits { queries: self, filter, found: Vec::new() };
        if !is_finite_point(ray.origin) || !is_finite(ray.direction) {
            return hits.found;
        }
        for (item, plane) in self.planes() {
            hits.add(item, || plane.cast_ray(ray, max_distance));
        }
        // The ray ends beyond the bounds.
        let Some(bounds) = self.tree.tree.bounds() else { return hits.dedup_by_collider() };
        let reach = length(bounds.center() - ray.origin) + length(bounds.max - bounds.min);
        let motion = ray.direction * reach.min(max_distance);
        self.tree.tree.for_each_on_segment(ray.origin, motion, |number| {
            let item = self.tree.items[number as usize];
            hits.add(item, || match item {
                Item::Marble(_) | Item::Body(..) => self.shape(item)?.cast_ray(ray, max_distance),
                Item::Wall(part) => cast_ray_on_wall(
                    &self.world.walls.shapes()[part.wall as usize],
                    part,
                    ray,
                    max_distance,
                ),
            });
        });
        hits.dedup_by_collider()
    }

    /// First hit of a shape that translates along a line. A collider that it touches at the start
    /// counts if they approach, and not if they separate.
    pub fn cast_shape(
        &self,
        shape: &Shape<S>,
        translation: Vec3<S>,
        filter: impl Fn(ColliderId) -> bool,
    ) -> Option<QueryHit<ShapeCastHit<S>>> {
        let mut best: Option<QueryHit<ShapeCastHit<S>>> = None;
        if !is_finite(translation) {
            return best;
        }
        let mut offer = |item: Item, query: &dyn Fn() -> Option<ShapeCastHit<S>>| {
            let Some(collider) = self.collider(item).filter(|collider| filter(*collider)) else {
                return;
            };
            let Some(result) = query() else { return };
            let next = QueryHit { collider, result };
            let key = |found: &QueryHit<ShapeCastHit<S>>| (found.result.time, found.collider);
            if best.as_ref().is_none_or(|best| key(&next) < key(best)) {
                best = Some(next);
            }
        };
        let still = Vec3::new(S::zero(), S::zero(), S::zero());
        for (item, plane) in self.planes() {
            offer(item, &|| cast_shape_on_half_space(plane, shape, translation));
        }
        let start = shape.bounding_box();
        let end = Aabb { min: start.min + translation, max: start.max + translation };
        self.tree.tree.for_each_in_box(&start.union(&end), |number| {
            let item = self.tree.items[number as usize];
            match item {
                Item::Marble(_) | Item::Body(..) => offer(item, &|| {
                    let other = self.shape(item)?;
                    Some(shape_cast_of_shapes(&other, still, shape, translation)?.result)
                }),
                Item::Wall(SubShape { wall, index: part }) => {
                    let Some(wall) = self.world.walls.shapes().get(wall as usize) else { return };
                    offer(item, &|| cast_shape_on_wall(wall, part, shape, translation));
                }
            }
        });
        best
    }

    /// All colliders that overlap a shape, in order.
    pub fn overlaps(
        &self,
        shape: &Shape<S>,
        filter: impl Fn(ColliderId) -> bool,
    ) -> Vec<ColliderId> {
        let mut found = Vec::new();
        let mut offer = |item: Item, touches: &dyn Fn() -> bool| {
            let collider = self.collider(item).filter(|collider| filter(*collider));
            found.extend(collider.filter(|_| touches()));
        };
        for (item, plane) in self.planes() {
            offer(item, &|| overlaps_half_space(plane, shape));
        }
        self.tree.tree.for_each_in_box(&shape.bounding_box(), |number| {
            let item = self.tree.items[number as usize];
            match item {
                Item::Marble(_) | Item::Body(..) => {
                    let near = || closest_points_of_shapes(&self.shape(item)?, shape);
                    offer(item, &|| near().is_some_and(|near| near.result.touching()));
                }
                Item::Wall(SubShape { wall, index: number }) => {
                    let Some(wall) = self.world.walls.shapes().get(wall as usize) else { return };
                    offer(item, &|| overlaps_on_wall(wall, number, shape));
                }
            }
        });
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Projects a point onto the nearest surface within a distance, which may be infinite. If the
    /// point is inside several shapes, the one it penetrates deepest.
    pub fn project_point(
        &self,
        point: Point3<S>,
        within: S,
        filter: impl Fn(ColliderId) -> bool,
    ) -> Option<QueryHit<PointProjection<S>>> {
        let mut best: Option<QueryHit<PointProjection<S>>> = None;
        let mut reach = within;
        let mut offer = |item: Item, query: &dyn Fn() -> Option<PointProjection<S>>| {
            let collider = self.collider(item).filter(|collider| filter(*collider));
            let Some((collider, result)) = collider.and_then(|it| Some((it, query()?))) else {
                return reach;
            };
            let next = QueryHit { collider, result };
            let key =
                |found: &QueryHit<PointProjection<S>>| (found.result.distance, found.collider);
            let near = next.result.distance <= within;
            if near && best.as_ref().is_none_or(|best| key(&next) < key(best)) {
                best = Some(next);
                reach = next.result.distance.max(S::zero());
            }
            reach
        };
        let walls = self.world.walls.shapes();
        for (item, plane) in self.planes() {
            offer(item, &|| Some(WallShape::Plane(*plane).project_point(point)));
        }
        self.tree.tree.for_each_near(point, within, |number| {
            let item = self.tree.items[number as usize];
            offer(item, &|| match item {
                Item::Marble(_) | Item::Body(..) => Some(self.shape(item)?.project_point(point)),
                Item::Wall(SubShape { wall, index: part }) => match walls.get(wall as usize)? {
                    solid @ WallShape::Solid(_) => Some(solid.project_point_on(part, point)),
                    other => Some(other.project_point(point)),
                },
            })
        });
        best
    }
}

/// Collector of ray hits.
struct Hits<'a, S: Scalar, F> {
    queries: &'a Queries<'a, S>,
    filter: F,
    found: Vec<QueryHit<RayHit<S>>>,
}

impl<S: Scalar, F: Fn(ColliderId) -> bool> Hits<'_, S, F> {
    fn add(&mut self, item: Item, query: impl FnOnce() -> Option<RayHit<S>>) {
        let collider = self.queries.collider(item).filter(|collider| (self.filter)(*collider));
        if let Some(collider) = collider
            && let Some(result) = query()
        {
            self.found.push(QueryHit { collider, result });
        }
    }

    fn dedup_by_collider(mut self) -> Vec<QueryHit<RayHit<S>>> {
        let order = |x: S, y: S| x.partial_cmp(&y).unwrap_or(std::cmp::Ordering::Equal);
        let by_distance = |x: &QueryHit<RayHit<S>>, y: &QueryHit<RayHit<S>>| {
            order(x.result.distance, y.result.distance)
        };
        self.found.sort_by(|x, y| x.collider.cmp(&y.collider).then(by_distance(x, y)));
        self.found.dedup_by_key(|found| found.collider);
        self.found.sort_by(by_distance);
        self.found
    }
}
