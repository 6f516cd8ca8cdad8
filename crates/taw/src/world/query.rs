//! Questions about a world, through a tree of all that is in it.

use std::borrow::Cow;

use cgmath::InnerSpace;

use super::walls::Part;
use super::{MarbleId, WallId, WallShape, World};
use crate::contact::{
    Convex, RayCast, RayHit, ShapeCastHit, TriangleResult, closest_points_of_plane,
    closest_points_of_shapes, closest_points_of_surface, ray_cast_on_surface, shape_cast_of_shapes,
    shape_cast_on_surface, sub_shapes,
};
use crate::frame::{Pose, Ray};
use crate::math::{Point3, Scalar, Vec3, is_finite, is_finite_point, length};
use crate::shape::{Aabb, Aabb3, BoundedShape, Bvh, Plane, PointProjection, Shape, Surface};

/// Something in a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ColliderId {
    /// A marble.
    Marble(MarbleId),
    /// A wall.
    Wall(WallId),
}

/// What a query found, and where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QueryHit<T> {
    /// In or on what.
    pub collider: ColliderId,
    /// The result.
    pub result: T,
}

/// Where all that is in a world is, for [`World::queries`]. Kept from one time to the next, it
/// is only refitted to what moved.
#[derive(Clone, Debug)]
pub struct QueryTree<S> {
    tree: Bvh<S>,
    items: Vec<Item>,
    boxes: Vec<Aabb3<S>>,
}

/// What is in one box of the tree.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Item {
    /// By its row.
    Marble(u32),
    Wall(Part),
}

impl<S> Default for QueryTree<S> {
    fn default() -> Self {
        Self { tree: Bvh::default(), items: Vec::new(), boxes: Vec::new() }
    }
}

impl<S: Scalar> QueryTree<S> {
    fn update(&mut self, world: &World<S>) {
        let before = std::mem::take(&mut self.items);
        self.boxes.clear();
        for row in 0..world.marbles.len() {
            self.items.push(Item::Marble(row as u32));
            self.boxes.push(world.marbles.shape_of_row(row).bounding_box());
        }
        for (wall, shape) in (0..).zip(world.walls.shapes()) {
            shape.boxes(|part, bounds| {
                self.items.push(Item::Wall(Part { wall, part }));
                self.boxes.push(bounds);
            });
        }
        if self.items == before {
            self.tree.refit(&self.boxes);
        } else {
            self.tree = Bvh::new(&self.boxes);
        }
    }
}

/// Asks a world as it is now; from [`World::queries`]. Every question takes a filter, which
/// says of each collider whether it counts; `|_| true` leaves none out.
///
/// Of meshes and height fields, rays and shapes meet the surface, from either side; only
/// [`Queries::project_point`] counts what is below a height field as inside.
#[derive(Debug)]
pub struct Queries<'a, S> {
    world: &'a World<S>,
    tree: &'a QueryTree<S>,
}

impl<S: Scalar> World<S> {
    /// Readies the tree for questions about the world as it is now. What lies far from where
    /// it was slows the questions down, and never makes them wrong.
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
        Queries { world: self, tree }
    }
}

/// Turns an result in the frame of a surface into one of the world.
trait Placed<S> {
    fn placed(self, pose: Pose<S>) -> Self;
}

impl<S: Scalar> Placed<S> for RayHit<S> {
    fn placed(self, pose: Pose<S>) -> Self {
        Self {
            point: pose.transform_point(self.point),
            normal: pose.transform_vector(self.normal),
            ..self
        }
    }
}

impl<S: Scalar> Placed<S> for ShapeCastHit<S> {
    fn placed(self, pose: Pose<S>) -> Self {
        Self {
            point: pose.transform_point(self.point),
            normal: pose.transform_vector(self.normal),
            ..self
        }
    }
}

impl<S: Scalar> Queries<'_, S> {
    fn collider(&self, item: Item) -> Option<ColliderId> {
        match item {
            Item::Marble(row) => self.world.marbles.id(row as usize).map(ColliderId::Marble),
            Item::Wall(part) => self.world.walls.id(part.wall as usize).map(ColliderId::Wall),
        }
    }

    fn planes(&self) -> impl Iterator<Item = (Item, &Plane<S>)> {
        let item = |wall| Item::Wall(Part { wall, part: 0 });
        self.world.walls.planes().map(move |(row, plane)| (item(row), plane))
    }

    /// Where a ray first meets anything within a distance, which may be infinite.
    pub fn cast_ray(
        &self,
        ray: &Ray<S>,
        longest: S,
        filter: impl Fn(ColliderId) -> bool,
    ) -> Option<QueryHit<RayHit<S>>> {
        let hits = self.cast_ray_all(ray, longest, filter);
        hits.into_iter().next()
    }

    /// Where a ray first meets each of all that it meets within a distance, the nearest first.
    pub fn cast_ray_all(
        &self,
        ray: &Ray<S>,
        longest: S,
        filter: impl Fn(ColliderId) -> bool,
    ) -> Vec<QueryHit<RayHit<S>>> {
        let mut hits = Hits { queries: self, filter, found: Vec::new() };
        if !is_finite_point(ray.origin) || !is_finite(ray.direction) {
            return hits.found;
        }
        for (item, plane) in self.planes() {
            hits.add(item, || plane.cast_ray(ray, longest));
        }
        // Beyond the tree there is nothing.
        let Some(bounds) = self.tree.tree.bounds() else { return hits.first_of_each() };
        let reach = length(bounds.center() - ray.origin) + length(bounds.max - bounds.min);
        let motion = ray.direction * reach.min(longest);
        self.tree.tree.for_each_on_segment(ray.origin, motion, |number| {
            let item = self.tree.items[number as usize];
            hits.add(item, || match item {
                Item::Marble(row) => {
                    self.world.marbles.shape_of_row(row as usize).cast_ray(ray, longest)
                }
                Item::Wall(part) => {
                    cast_on_wall(&self.world.walls.shapes()[part.wall as usize], part, ray, longest)
                }
            });
        });
        hits.first_of_each()
    }

    /// What a shape first touches that moves along a line without turning. What it touches
    /// from the start counts if it comes closer, and not if it parts.
    pub fn cast_shape(
        &self,
        shape: &Shape<S>,
        moves: Vec3<S>,
        filter: impl Fn(ColliderId) -> bool,
    ) -> Option<QueryHit<ShapeCastHit<S>>> {
        let mut best: Option<QueryHit<ShapeCastHit<S>>> = None;
        let mut offer = |item: Item, ask: &dyn Fn() -> Option<ShapeCastHit<S>>| {
            let Some(collider) = self.collider(item).filter(|collider| filter(*collider)) else {
                return;
            };
            let Some(result) = ask() else { return };
            let next = QueryHit { collider, result };
            let key = |found: &QueryHit<ShapeCastHit<S>>| (found.result.time, found.collider);
            if best.as_ref().is_none_or(|best| key(&next) < key(best)) {
                best = Some(next);
            }
        };
        let still = Vec3::new(S::zero(), S::zero(), S::zero());
        for (item, plane) in self.planes() {
            offer(item, &|| earliest(shape, |part| sweep_plane(plane, part, moves)));
        }
        let start = shape.bounding_box();
        let end = Aabb { min: start.min + moves, max: start.max + moves };
        self.tree.tree.for_each_in_box(&start.union(&end), |number| {
            let item = self.tree.items[number as usize];
            match item {
                Item::Marble(row) => {
                    let marble = self.world.marbles.shape_of_row(row as usize);
                    offer(item, &|| {
                        Some(shape_cast_of_shapes(&marble, still, shape, moves)?.result)
                    });
                }
                Item::Wall(Part { wall, part: number }) => {
                    match &self.world.walls.shapes()[wall as usize] {
                        WallShape::Plane(_) => {}
                        solid @ WallShape::Solid(_) => offer(item, &|| {
                            let touch =
                                shape_cast_of_shapes(solid.part(number)?, still, shape, moves)?;
                            Some(touch.result)
                        }),
                        WallShape::Mesh(mesh, pose) => {
                            offer(item, &|| sweep_placed(&**mesh, *pose, shape, moves));
                        }
                        WallShape::HeightField(field, pose) => {
                            offer(item, &|| sweep_placed(&**field, *pose, shape, moves));
                        }
                    }
                }
            }
        });
        best
    }

    /// All that a shape has a point in common with, in order.
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
            offer(item, &|| closest_points_of_plane(plane, shape).touching());
        }
        self.tree.tree.for_each_in_box(&shape.bounding_box(), |number| {
            let item = self.tree.items[number as usize];
            match item {
                Item::Marble(row) => {
                    let marble = self.world.marbles.shape_of_row(row as usize);
                    let near = || closest_points_of_shapes(&marble, shape);
                    offer(item, &|| near().is_some_and(|near| near.result.touching()));
                }
                Item::Wall(Part { wall, part: number }) => {
                    match &self.world.walls.shapes()[wall as usize] {
                        WallShape::Plane(_) => {}
                        solid @ WallShape::Solid(_) => offer(item, &|| {
                            let near = solid
                                .part(number)
                                .and_then(|wall| closest_points_of_shapes(wall, shape));
                            near.is_some_and(|near| near.result.touching())
                        }),
                        WallShape::Mesh(mesh, pose) => {
                            offer(item, &|| touches_placed(&**mesh, *pose, shape));
                        }
                        WallShape::HeightField(field, pose) => {
                            offer(item, &|| touches_placed(&**field, *pose, shape));
                        }
                    }
                }
            }
        });
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Where the nearest surface is, within a distance of a point, which may be infinite. Of
    /// what the point is inside of, that out of which the way is longest.
    pub fn project_point(
        &self,
        point: Point3<S>,
        within: S,
        filter: impl Fn(ColliderId) -> bool,
    ) -> Option<QueryHit<PointProjection<S>>> {
        let mut best: Option<QueryHit<PointProjection<S>>> = None;
        let mut reach = within;
        let mut offer = |item: Item, ask: &dyn Fn() -> PointProjection<S>| {
            let Some(collider) = self.collider(item).filter(|collider| filter(*collider)) else {
                return reach;
            };
            let next = QueryHit { collider, result: ask() };
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
            offer(item, &|| WallShape::Plane(*plane).project_point(point));
        }
        self.tree.tree.for_each_near(point, within, |number| {
            let item = self.tree.items[number as usize];
            offer(item, &|| match item {
                Item::Marble(row) => {
                    self.world.marbles.shape_of_row(row as usize).project_point(point)
                }
                Item::Wall(Part { wall, part }) => match &walls[wall as usize] {
                    solid @ WallShape::Solid(_) => solid.project_point_on(part, point),
                    other => other.project_point(point),
                },
            })
        });
        best
    }
}

/// Collects hits.
struct Hits<'a, S, F> {
    queries: &'a Queries<'a, S>,
    filter: F,
    found: Vec<QueryHit<RayHit<S>>>,
}

impl<S: Scalar, F: Fn(ColliderId) -> bool> Hits<'_, S, F> {
    fn add(&mut self, item: Item, ask: impl FnOnce() -> Option<RayHit<S>>) {
        let collider = self.queries.collider(item).filter(|collider| (self.filter)(*collider));
        if let Some(collider) = collider
            && let Some(result) = ask()
        {
            self.found.push(QueryHit { collider, result });
        }
    }

    fn first_of_each(mut self) -> Vec<QueryHit<RayHit<S>>> {
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

fn cast_on_wall<S: Scalar>(
    wall: &WallShape<S>,
    Part { part, .. }: Part,
    ray: &Ray<S>,
    longest: S,
) -> Option<RayHit<S>> {
    let local = |pose: &Pose<S>| Ray {
        origin: pose.inverse_transform_point(ray.origin),
        direction: pose.inverse_transform_vector(ray.direction),
    };
    let placed = |hit: Option<TriangleResult<RayHit<S>>>, pose: &Pose<S>| {
        hit.map(|hit| hit.result.placed(*pose))
    };
    match wall {
        WallShape::Plane(plane) => plane.cast_ray(ray, longest),
        WallShape::Solid(_) => wall.part(part)?.cast_ray(ray, longest),
        WallShape::Mesh(mesh, pose) => {
            placed(ray_cast_on_surface(&**mesh, &local(pose), longest), pose)
        }
        WallShape::HeightField(field, pose) => {
            placed(ray_cast_on_surface(&**field, &local(pose), longest), pose)
        }
    }
}

/// What the part says of a shape that touches something first.
fn earliest<S: Scalar>(
    shape: &Shape<S>,
    ask: impl Fn(&dyn Convex<S>) -> Option<ShapeCastHit<S>>,
) -> Option<ShapeCastHit<S>> {
    let touches = sub_shapes(shape).into_iter().filter_map(ask);
    touches.reduce(|x, y| if y.time < x.time { y } else { x })
}

/// A shape as seen from a frame.
fn in_frame<S: Scalar>(shape: &Shape<S>, pose: Pose<S>) -> Cow<'_, Shape<S>> {
    if pose == Pose::identity() {
        Cow::Borrowed(shape)
    } else {
        Cow::Owned(shape.transformed(pose.inverse()))
    }
}

fn sweep_placed<S: Scalar>(
    surface: &impl Surface<S>,
    pose: Pose<S>,
    shape: &Shape<S>,
    moves: Vec3<S>,
) -> Option<ShapeCastHit<S>> {
    let moves = pose.inverse_transform_vector(moves);
    let touch = |part: &dyn Convex<S>| Some(shape_cast_on_surface(surface, part, moves)?.result);
    Some(earliest(&in_frame(shape, pose), touch)?.placed(pose))
}

fn touches_placed<S: Scalar>(surface: &impl Surface<S>, pose: Pose<S>, shape: &Shape<S>) -> bool {
    let touches = |part| closest_points_of_surface(surface, part, S::zero()).is_some();
    sub_shapes(&in_frame(shape, pose)).into_iter().any(touches)
}

/// When a convex shape that moves along a line first touches a half-space.
fn sweep_plane<S: Scalar>(
    plane: &Plane<S>,
    shape: &dyn Convex<S>,
    moves: Vec3<S>,
) -> Option<ShapeCastHit<S>> {
    let normal = plane.normal();
    let lowest = shape.support(-normal);
    let (gap, closing) = (plane.signed_distance(lowest), -moves.dot(normal));
    let time = (gap / closing).max(S::zero());
    let meets = closing > S::zero() && time <= S::one();
    meets.then(|| ShapeCastHit { time, normal, point: lowest + moves * time })
}
