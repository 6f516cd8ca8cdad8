//! Rays, shapes and points among marbles and walls, in Bevy's types and entities.
//!
//! Positions are those after the last fixed step, up to a step ahead of what
//! [`TawInterpolationPlugin`](crate::interpolation::TawInterpolationPlugin) draws. Balls of swarms are
//! not found: a ray on them is [`TawWorld::cast_ray_on_balls`].
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
use taw::frame::Ray;
use taw::shape as core;
use taw::world::{ColliderId, Queries, QueryHit, QueryTree};

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
}

/// Query tree of the world, with the change of the world that it was last fitted to.
#[derive(Resource, Default)]
pub(crate) struct SpatialTree(Mutex<FittedTree>);

#[derive(Default)]
struct FittedTree {
    fitted_to: Option<Tick>,
    tree: Arc<QueryTree<f32>>,
}

/// Colliders that a query looks at: by default all marbles and walls.
#[derive(Clone, Default)]
pub struct SpatialQueryFilter<'a> {
    mask: Option<LayerMask>,
    kind: Option<Kind>,
    excluded: EntityHashSet,
    predicate: Option<&'a dyn Fn(Entity) -> bool>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Marbles,
    Walls,
}

impl std::fmt::Debug for SpatialQueryFilter<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SpatialQueryFilter")
            .field("mask", &self.mask)
            .field("kind", &self.kind)
            .field("excluded", &self.excluded)
            .field("predicate", &self.predicate.is_some())
            .finish()
    }
}

impl<'a> SpatialQueryFilter<'a> {
    /// Marbles only.
    #[must_use]
    pub fn marbles() -> Self {
        Self { kind: Some(Kind::Marbles), ..Self::default() }
    }

    /// Walls only.
    #[must_use]
    pub fn walls() -> Self {
        Self { kind: Some(Kind::Walls), ..Self::default() }
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
        let right_kind = match collider {
            ColliderId::Marble(_) => self.kind != Some(Kind::Walls),
            ColliderId::Wall(_) => self.kind != Some(Kind::Marbles),
        };
        let in_mask = |mask: LayerMask| {
            world.layers(collider).is_ok_and(|layers| layers.memberships & mask.0 != 0)
        };
        right_kind
            && self.mask.is_none_or(in_mask)
            && world.collider_entity(collider).is_some_and(|entity| {
                !self.excluded.contains(&entity) && self.predicate.is_none_or(|is| is(entity))
            })
    }
}

/// Hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// The marble or wall.
    pub entity: Entity,
    /// Distance from the origin of the ray, in metres; zero if that is inside.
    pub distance: f32,
    /// Point on the surface, or the origin, in metres in world space.
    pub point: Vec3,
    /// Outward unit normal; from inside, that of the nearest surface.
    pub normal: Vec3,
}

/// Hit of a moving shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeHit {
    /// The marble or wall.
    pub entity: Entity,
    /// Time of impact as a fraction of the translation, in [0, 1].
    pub fraction: f32,
    /// Contact point at that time, in metres.
    pub point: Vec3,
    /// Unit normal of what was hit, toward the shape.
    pub normal: Vec3,
}

/// Point on the surface nearest to another point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProjectedPoint {
    /// The marble or wall.
    pub entity: Entity,
    /// Point on its surface, in metres in world space.
    pub point: Vec3,
    /// Outward unit normal there.
    pub normal: Vec3,
    /// Distance to the surface in metres; negative inside.
    pub distance: f32,
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

    /// First hit of a ray on each marble and wall within a distance in metres, nearest first.
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
        let hits = self.ask(|queries| queries.cast_ray_all(&ray, max_distance, admits));
        let hit = |QueryHit { collider, result }: QueryHit<taw::contact::RayHit<f32>>| {
            Some(RayHit {
                entity: self.world.collider_entity(collider)?,
                distance: result.distance,
                point: from_point(result.point),
                normal: from_vector(result.normal),
            })
        };
        hits.into_iter().filter_map(hit).collect()
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
        let shape = shape.placed(from)?;
        let admits = |collider| filter.admits(&self.world, collider);
        let hit = self.ask(|queries| queries.cast_shape(&shape, to_vector(translation), admits));
        Ok(hit.and_then(|QueryHit { collider, result }| {
            Some(ShapeHit {
                entity: self.world.collider_entity(collider)?,
                fraction: result.time,
                point: from_point(result.point),
                normal: from_vector(result.normal),
            })
        }))
    }

    /// All marbles and walls that overlap a shape.
    ///
    /// # Errors
    /// A size or a place out of range.
    pub fn overlaps(
        &self,
        shape: &impl QueryShape,
        at: Isometry3d,
        filter: &SpatialQueryFilter,
    ) -> Result<Vec<Entity>, taw::Error> {
        let shape = shape.placed(at)?;
        let admits = |collider| filter.admits(&self.world, collider);
        let found = self.ask(|queries| queries.overlaps(&shape, admits));
        Ok(found.into_iter().filter_map(|it| self.world.collider_entity(it)).collect())
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
        let admits = |collider| filter.admits(&self.world, collider);
        let hit =
            self.ask(|queries| queries.project_point(to_point(point), max_distance, admits))?;
        Some(ProjectedPoint {
            entity: self.world.collider_entity(hit.collider)?,
            point: from_point(hit.result.point),
            normal: from_vector(hit.result.normal),
            distance: hit.result.distance,
        })
    }

    /// Collider of a marble or wall in the [`TawWorld`], once a step has gathered it.
    #[must_use]
    pub fn collider(&self, entity: Entity) -> Option<ColliderId> {
        let marble = || Some(ColliderId::Marble(self.marbles.get(entity).ok()?.id?));
        let wall = || Some(ColliderId::Wall(self.walls.get(entity).ok()?.id?));
        marble().or_else(wall)
    }

    /// Runs a query on a tree that is up to date. It may run others.
    fn ask<R>(&self, question: impl FnOnce(&Queries<f32>) -> R) -> R {
        let now = Some(self.world.last_changed());
        let tree = {
            let mut fitted = self.tree.0.lock().unwrap_or_else(PoisonError::into_inner);
            if fitted.fitted_to != now {
                Arc::make_mut(&mut fitted.tree).update(&self.world);
                fitted.fitted_to = now;
            }
            Arc::clone(&fitted.tree)
        };
        question(&self.world.queries_of(&tree))
    }
}

impl TawWorld {
    /// The entity of a marble or wall, if there is one.
    #[must_use]
    pub fn collider_entity(&self, collider: ColliderId) -> Option<Entity> {
        match collider {
            ColliderId::Marble(id) => self.marble_entities.get(&id).copied(),
            ColliderId::Wall(id) => self.wall_entities.get(&id).copied(),
        }
    }
}
