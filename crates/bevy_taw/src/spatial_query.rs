//! Rays, shapes and points among marbles, walls, bodies and balls of swarms, in Bevy's types and entities.
//!
//! Positions are those after the last fixed step, up to a step ahead of what
//! [`TawInterpolationPlugin`](crate::interpolation::TawInterpolationPlugin) draws. For a ball of a swarm, the
//! entity is that of its [`Swarm`](crate::swarm::Swarm), and `ball` says which one it is.
//!
//! ```
//! # use bevy::prelude::*;
//! # use bevy_taw::prelude::*;
//! /// Grounded marbles may jump.
//! fn jump(spatial: SpatialQuery, mut marbles: Query<(Entity, &Transform, &Marble, &mut Velocity)>) {
//!     for (entity, place, marble, mut velocity) in &mut marbles {
//!         let down = Ray3d::new(place.translation, Dir3::NEG_Y);
//!         let others = SpatialQueryFilter::default().with_excluded_entities([entity]);
//!         let floor = spatial.cast_ray(down, 1.05 * marble.radius, &others);
//!         if floor.is_some_and(|hit| hit.normal.y > 0.7) {
//!             velocity.y = 5.0;
//!         }
//!     }
//! }
//! # let mut app = App::new();
//! # app.add_plugins((MinimalPlugins, TawPlugins)).add_systems(FixedUpdate, jump);
//! # app.update();
//! ```

use std::sync::{Arc, Mutex, PoisonError};

use bevy::ecs::change_detection::Tick;
use bevy::ecs::entity::EntityHashSet;
use bevy::ecs::system::SystemParam;
use bevy::math::Isometry3d;
use bevy::prelude::*;
use taw::broad::CollisionLayers as CoreLayers;
use taw::frame::Ray;
use taw::shape as core;
use taw::swarm::{BallId, BallQueries, BallQueryHit, BallTree};
use taw::world::{ColliderId, Queries, QueryHit, QueryTree};

use crate::body::BodyState;
use crate::components::{MarbleState, WallState};
use crate::convert::{from_point, from_vector, to_point, to_rotation, to_vector};
use crate::layers::LayerMask;
use crate::resources::TawWorld;

/// Spatial queries as a system parameter. Any number of systems may ask at the same time; the first
/// question after a step refits the tree.
#[derive(SystemParam)]
pub struct SpatialQuery<'w, 's> {
    world: Res<'w, TawWorld>,
    tree: Res<'w, SpatialTree>,
    marbles: Query<'w, 's, &'static MarbleState>,
    walls: Query<'w, 's, &'static WallState>,
    bodies: Query<'w, 's, &'static BodyState>,
}

/// Query trees of the world and of the swarm.
#[derive(Resource, Default)]
pub(crate) struct SpatialTree {
    colliders: Mutex<FittedTree<QueryTree<f32>>>,
    balls: Mutex<FittedTree<BallTree<f32>>>,
}

/// Tree with the change of the world that it was last fitted to.
#[derive(Default)]
struct FittedTree<T> {
    fitted_to: Option<Tick>,
    tree: Arc<T>,
}

impl<T: Clone> FittedTree<T> {
    /// The tree as it is after a change, fitted by `fit` if it is older.
    fn at(this: &Mutex<Self>, now: Tick, fit: impl FnOnce(&mut T)) -> Arc<T> {
        let mut this = this.lock().unwrap_or_else(PoisonError::into_inner);
        if this.fitted_to != Some(now) {
            fit(Arc::make_mut(&mut this.tree));
            this.fitted_to = Some(now);
        }
        Arc::clone(&this.tree)
    }
}

/// Colliders that a query looks at: by default all marbles, walls, [bodies](crate::body::Body) and balls of
/// swarms. An excluded entity may be a swarm's, and a predicate is asked about it, too.
#[derive(Clone, Default)]
pub struct SpatialQueryFilter<'a> {
    mask: Option<LayerMask>,
    kinds: Kinds,
    excluded: EntityHashSet,
    predicate: Option<&'a dyn Fn(Entity) -> bool>,
}

/// Kinds of colliders, a bit each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Kinds(u8);

impl Kinds {
    const MARBLES: Self = Self(1);
    const WALLS: Self = Self(2);
    const BODIES: Self = Self(4);
    const BALLS: Self = Self(8);
    /// All that are in the tree of colliders.
    const COLLIDERS: Self = Self(1 | 2 | 4);

    fn has_any(self, of: Self) -> bool {
        self.0 & of.0 != 0
    }

    fn without(self, these: Self) -> Self {
        Self(self.0 & !these.0)
    }
}

impl Default for Kinds {
    fn default() -> Self {
        Self(Self::COLLIDERS.0 | Self::BALLS.0)
    }
}

impl std::fmt::Debug for SpatialQueryFilter<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SpatialQueryFilter")
            .field("mask", &self.mask)
            .field("kinds", &self.kinds)
            .field("excluded", &self.excluded)
            .field("predicate", &self.predicate.is_some())
            .finish()
    }
}

impl<'a> SpatialQueryFilter<'a> {
    /// Marbles only.
    #[must_use]
    pub fn marbles() -> Self {
        Self { kinds: Kinds::MARBLES, ..Self::default() }
    }

    /// Walls only.
    #[must_use]
    pub fn walls() -> Self {
        Self { kinds: Kinds::WALLS, ..Self::default() }
    }

    /// [Bodies](crate::body::Body) only.
    #[must_use]
    pub fn bodies() -> Self {
        Self { kinds: Kinds::BODIES, ..Self::default() }
    }

    /// Balls of swarms only.
    #[must_use]
    pub fn balls() -> Self {
        Self { kinds: Kinds::BALLS, ..Self::default() }
    }

    /// Leaves out the balls of swarms. The first question that does not fits a tree to them after each
    /// step, which takes some nanoseconds for each.
    #[must_use]
    pub fn without_balls(self) -> Self {
        Self { kinds: self.kinds.without(Kinds::BALLS), ..self }
    }

    /// Restricts to those in one of these layers: a [`PhysicsLayer`](crate::layers::PhysicsLayer), an
    /// array of them, or bits.
    #[must_use]
    pub fn with_mask(self, layers: impl Into<LayerMask>) -> Self {
        Self { mask: Some(layers.into()), ..self }
    }

    /// Excludes these entities.
    #[must_use]
    pub fn with_excluded_entities(mut self, entities: impl IntoIterator<Item = Entity>) -> Self {
        self.excluded.extend(entities);
        self
    }

    /// Restricts to entities for which this returns true.
    #[must_use]
    pub fn with_predicate(self, predicate: &'a dyn Fn(Entity) -> bool) -> Self {
        Self { predicate: Some(predicate), ..self }
    }

    fn admits(&self, world: &TawWorld, collider: ColliderId) -> bool {
        let kind = match collider {
            ColliderId::Marble(_) => Kinds::MARBLES,
            ColliderId::Wall(_) => Kinds::WALLS,
            ColliderId::Body(_) => Kinds::BODIES,
        };
        self.kinds.has_any(kind)
            && self.admits_layers(|| world.layers(collider))
            && self.admits_entity(world.collider_entity(collider))
    }

    fn admits_ball(&self, world: &TawWorld, ball: BallId) -> bool {
        self.admits_layers(|| world.swarm.layers(ball)) && self.admits_entity(world.swarm_of(ball))
    }

    fn admits_layers(&self, layers: impl FnOnce() -> Result<CoreLayers, taw::Error>) -> bool {
        self.mask.is_none_or(|mask| layers().is_ok_and(|it| it.memberships & mask.0 != 0))
    }

    fn admits_entity(&self, entity: Option<Entity>) -> bool {
        entity.is_some_and(|entity| {
            !self.excluded.contains(&entity) && self.predicate.is_none_or(|is| is(entity))
        })
    }
}

/// Hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// The marble, wall, body or swarm.
    pub entity: Entity,
    /// Which ball it is, if it is one of a swarm.
    pub ball: Option<BallId>,
    /// Distance from the origin of the ray, in metres; zero if that is inside.
    pub distance: f32,
    /// Point on the surface, or the origin, in metres in world space.
    pub point: Vec3,
    /// Outward unit normal; from inside, that of the nearest surface.
    pub normal: Vec3,
}

impl RayHit {
    fn new(entity: Entity, ball: Option<BallId>, hit: taw::contact::RayHit<f32>) -> Self {
        let (point, normal) = (from_point(hit.point), from_vector(hit.normal));
        Self { entity, ball, distance: hit.distance, point, normal }
    }
}

/// Hit of a moving shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeHit {
    /// The marble, wall, body or swarm.
    pub entity: Entity,
    /// Which ball it is, if it is one of a swarm.
    pub ball: Option<BallId>,
    /// Time of impact as a fraction of the translation, in [0, 1].
    pub fraction: f32,
    /// Contact point at that time, in metres.
    pub point: Vec3,
    /// Unit normal of what was hit, toward the shape.
    pub normal: Vec3,
}

impl ShapeHit {
    fn new(entity: Entity, ball: Option<BallId>, hit: taw::contact::ShapeCastHit<f32>) -> Self {
        let (point, normal) = (from_point(hit.point), from_vector(hit.normal));
        Self { entity, ball, fraction: hit.time, point, normal }
    }
}

/// Point on the surface nearest to another point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProjectedPoint {
    /// The marble, wall, body or swarm.
    pub entity: Entity,
    /// Which ball it is, if it is one of a swarm.
    pub ball: Option<BallId>,
    /// Point on its surface, in metres in world space.
    pub point: Vec3,
    /// Outward unit normal there.
    pub normal: Vec3,
    /// Distance to the surface in metres; negative inside.
    pub distance: f32,
}

impl ProjectedPoint {
    fn new(entity: Entity, ball: Option<BallId>, hit: core::PointProjection<f32>) -> Self {
        let (point, normal) = (from_point(hit.point), from_vector(hit.normal));
        Self { entity, ball, point, normal, distance: hit.distance }
    }
}

/// Shape of a query: a [`Sphere`], a [`Cuboid`] or a [`Capsule3d`] of Bevy's.
pub trait QueryShape {
    /// The shape at a place.
    ///
    /// # Errors
    /// A size or a place out of range.
    fn placed(&self, at: Isometry3d) -> Result<core::Shape<f32>, taw::Error>;
}

impl QueryShape for Sphere {
    fn placed(&self, at: Isometry3d) -> Result<core::Shape<f32>, taw::Error> {
        let center = to_point(at.translation.into());
        Ok(core::Shape::Sphere(core::Sphere::new(center, self.radius)?))
    }
}

impl QueryShape for Cuboid {
    fn placed(&self, at: Isometry3d) -> Result<core::Shape<f32>, taw::Error> {
        let (center, half) = (to_point(at.translation.into()), to_vector(self.half_size));
        Ok(core::Shape::Obb(core::Obb::new(center, to_rotation(at.rotation), half)?))
    }
}

impl QueryShape for Capsule3d {
    fn placed(&self, at: Isometry3d) -> Result<core::Shape<f32>, taw::Error> {
        let end = |y: f32| to_point(at.transform_point(Vec3::Y * y).into());
        let (from, to) = (end(-self.half_length), end(self.half_length));
        Ok(core::Shape::Capsule(core::Capsule::new(from, to, self.radius)?))
    }
}

impl SpatialQuery<'_, '_> {
    /// First hit of a ray within a distance in metres, which may be infinite.
    #[must_use]
    pub fn cast_ray(
        &self,
        ray: Ray3d,
        max_distance: f32,
        filter: &SpatialQueryFilter,
    ) -> Option<RayHit> {
        self.cast_ray_all(ray, max_distance, filter).into_iter().next()
    }

    /// First hit of a ray on each marble, wall, body and ball of a swarm within a distance in metres,
    /// nearest first.
    #[must_use]
    pub fn cast_ray_all(
        &self,
        ray: Ray3d,
        max_distance: f32,
        filter: &SpatialQueryFilter,
    ) -> Vec<RayHit> {
        let direction = to_vector(ray.direction.into());
        let ray = Ray { origin: to_point(ray.origin), direction };
        let admits = |collider| filter.admits(&self.world, collider);
        let hits = self.ask(filter, |queries| queries.cast_ray_all(&ray, max_distance, admits));
        let hits = hits.into_iter().flatten().filter_map(|QueryHit { collider, result }| {
            Some(RayHit::new(self.world.collider_entity(collider)?, None, result))
        });
        let mut hits: Vec<_> = hits.collect();
        let admits = |ball| filter.admits_ball(&self.world, ball);
        let balls = self.ask_balls(filter, |it| it.cast_ray_all(&ray, max_distance, admits));
        if let Some(balls) = balls.filter(|balls| !balls.is_empty()) {
            hits.extend(balls.into_iter().filter_map(|BallQueryHit { ball, result }| {
                Some(RayHit::new(self.world.swarm_of(ball)?, Some(ball), result))
            }));
            hits.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        }
        hits
    }

    /// First hit of a shape that moves by a translation, in metres. What it touches at the start
    /// counts if they approach, and not if they separate.
    ///
    /// # Errors
    /// A size or a place out of range.
    pub fn cast_shape(
        &self,
        shape: &impl QueryShape,
        from: Isometry3d,
        translation: Vec3,
        filter: &SpatialQueryFilter,
    ) -> Result<Option<ShapeHit>, taw::Error> {
        let (shape, translation) = (shape.placed(from)?, to_vector(translation));
        let admits = |collider| filter.admits(&self.world, collider);
        let hit = self.ask(filter, |queries| queries.cast_shape(&shape, translation, admits));
        let hit = hit.flatten().and_then(|QueryHit { collider, result }| {
            Some(ShapeHit::new(self.world.collider_entity(collider)?, None, result))
        });
        let admits = |ball| filter.admits_ball(&self.world, ball);
        let ball = self.ask_balls(filter, |it| it.cast_shape(&shape, translation, admits));
        let ball = ball.flatten().and_then(|BallQueryHit { ball, result }| {
            Some(ShapeHit::new(self.world.swarm_of(ball)?, Some(ball), result))
        });
        Ok(first(hit, ball, |it| it.fraction))
    }

    /// All marbles, walls, bodies and swarms that overlap a shape: a swarm if one of its balls does, once.
    /// Which of them, [`overlapping_balls`](Self::overlapping_balls) says.
    ///
    /// # Errors
    /// A size or a place out of range.
    pub fn overlaps(
        &self,
        shape: &impl QueryShape,
        at: Isometry3d,
        filter: &SpatialQueryFilter,
    ) -> Result<Vec<Entity>, taw::Error> {
        let placed = shape.placed(at)?;
        let admits = |collider| filter.admits(&self.world, collider);
        let found = self.ask(filter, |queries| queries.overlaps(&placed, admits));
        let found = found.into_iter().flatten();
        let mut found: Vec<_> = found.filter_map(|it| self.world.collider_entity(it)).collect();
        let balls = self.overlapping_balls(shape, at, filter)?;
        let mut swarms: Vec<_> =
            balls.into_iter().filter_map(|ball| self.world.swarm_of(ball)).collect();
        swarms.sort_unstable();
        swarms.dedup();
        found.append(&mut swarms);
        Ok(found)
    }

    /// All balls of swarms that overlap a shape, sorted; [`TawWorld::swarm_of`] says which swarm one is of.
    ///
    /// # Errors
    /// A size or a place out of range.
    pub fn overlapping_balls(
        &self,
        shape: &impl QueryShape,
        at: Isometry3d,
        filter: &SpatialQueryFilter,
    ) -> Result<Vec<BallId>, taw::Error> {
        let shape = shape.placed(at)?;
        let admits = |ball| filter.admits_ball(&self.world, ball);
        Ok(self.ask_balls(filter, |it| it.overlaps(&shape, admits)).unwrap_or_default())
    }

    /// Point on the nearest surface within a distance in metres, which may be infinite. Inside of
    /// several shapes, that of the one whose surface is farthest.
    #[must_use]
    pub fn project_point(
        &self,
        point: Vec3,
        max_distance: f32,
        filter: &SpatialQueryFilter,
    ) -> Option<ProjectedPoint> {
        let at = to_point(point);
        let admits = |collider| filter.admits(&self.world, collider);
        let hit = self.ask(filter, |queries| queries.project_point(at, max_distance, admits));
        let hit = hit.flatten().and_then(|QueryHit { collider, result }| {
            Some(ProjectedPoint::new(self.world.collider_entity(collider)?, None, result))
        });
        let admits = |ball| filter.admits_ball(&self.world, ball);
        let ball = self.ask_balls(filter, |it| it.project_point(at, max_distance, admits));
        let ball = ball.flatten().and_then(|BallQueryHit { ball, result }| {
            Some(ProjectedPoint::new(self.world.swarm_of(ball)?, Some(ball), result))
        });
        first(hit, ball, |it| it.distance)
    }

    /// Collider of a marble, wall or body in the [`TawWorld`], once a step has gathered it.
    #[must_use]
    pub fn collider(&self, entity: Entity) -> Option<ColliderId> {
        let marble = || Some(ColliderId::Marble(self.marbles.get(entity).ok()?.id?));
        let wall = || Some(ColliderId::Wall(self.walls.get(entity).ok()?.id?));
        let body = || Some(ColliderId::Body(self.bodies.get(entity).ok()?.id?));
        marble().or_else(wall).or_else(body)
    }

    /// Runs a query of marbles, walls and bodies on a tree that is up to date, if the filter has any. It may run
    /// others.
    fn ask<R>(
        &self,
        filter: &SpatialQueryFilter,
        question: impl FnOnce(&Queries<f32>) -> R,
    ) -> Option<R> {
        if !filter.kinds.has_any(Kinds::COLLIDERS) {
            return None;
        }
        let now = self.world.last_changed();
        let tree = FittedTree::at(&self.tree.colliders, now, |tree| tree.update(&self.world));
        Some(question(&self.world.queries_of(&tree)))
    }

    /// Runs a query of balls of swarms, likewise.
    fn ask_balls<R>(
        &self,
        filter: &SpatialQueryFilter,
        question: impl FnOnce(&BallQueries<f32>) -> R,
    ) -> Option<R> {
        if !filter.kinds.has_any(Kinds::BALLS) || self.world.swarm.is_empty() {
            return None;
        }
        let now = self.world.last_changed();
        let tree = FittedTree::at(&self.tree.balls, now, |tree| tree.update(&self.world.swarm));
        Some(question(&self.world.swarm.queries(&tree)))
    }
}

/// The one of two hits that comes first.
fn first<T>(a: Option<T>, b: Option<T>, key: impl Fn(&T) -> f32) -> Option<T> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if key(&b) < key(&a) { b } else { a }),
        (a, b) => a.or(b),
    }
}

impl TawWorld {
    /// The entity of a marble, wall or body, if there is one.
    #[must_use]
    pub fn collider_entity(&self, collider: ColliderId) -> Option<Entity> {
        match collider {
            ColliderId::Marble(id) => self.marble_entities.get(&id).copied(),
            ColliderId::Wall(id) => self.wall_entities.get(&id).copied(),
            ColliderId::Body(id) => self.body_entities.get(&id).copied(),
        }
    }
}
