//! **`bevy_taw`**: marble physics for Bevy, on the core of [`taw`].
//!
//! A marble is one component, a wall is another:
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_taw::prelude::*;
//!
//! fn main() {
//!     let mut app = App::new();
//!     # app.add_plugins(MinimalPlugins);
//!     # #[cfg(any())]
//!     app.add_plugins(DefaultPlugins);
//!     app.add_plugins(TawPlugins);
//!     app.add_systems(Startup, |mut commands: Commands| {
//!         commands.spawn(Wall::default()); // a floor: solid below its +Y
//!         commands.spawn((Marble::new(0.5), Transform::from_xyz(0.0, 3.0, 0.0)));
//!     });
//!     # for _ in 0..10 { app.update(); }
//!     # #[cfg(any())]
//!     app.run();
//! }
//! ```
//!
//! # What a step does
//! Once per [`FixedUpdate`] (or another schedule: [`TawPlugins::in_schedule`]), in the sets of
//! [`TawSystems`]:
//!
//! 1. **Gather**: what changed in components and resources goes into the
//!    [`TawWorld`]. A `Transform` that somebody else wrote teleports its marble.
//! 2. **Step**: the schedule [`Substep`] runs [`Model::substeps`] times:
//!    *integrate*, *generate contacts*, *restitute*.
//! 3. **Scatter**: what moved goes back to `Transform` and [`Velocity`].
//!
//! Your own systems go before, after or between any of them.
//!
//! # The rooms
//! | module | what for |
//! |---|---|
//! | [`components`] | marbles, walls, and what they may have |
//! | [`resources`] | the model, gravity, the world |
//! | [`body`] | rigid bodies: boxes, capsules, hulls, compounds |
//! | [`joint`] | hinges, sliders, rods, springs, wheels between marbles and bodies |
//! | [`locked_axes`] | axes along which marbles do not move |
//! | [`swarm`] | marbles in bulk that are no entities |
//! | [`messages`] | contacts that start, go on and end, and each contact of a pair |
//! | [`contact_force`] | loads of marbles and walls |
//! | [`layers`] | who collides with whom |
//! | [`sensor`] | shapes that report which marbles, bodies and balls enter and leave |
//! | [`grounded`] | the ground under marbles |
//! | [`controller`] | marbles that a player rolls |
//! | [`zones`] | gravity and wind of their own in places |
//! | [`spatial_query`] | rays, shapes and points among marbles, walls, bodies and balls of swarms |
//! | [`snapshot`] | back in time, and rows without entities |
//! | [`preview`] | paths that marbles would take, and shots |
//! | [`ignore`] | marbles that pass through others, one-way walls |
//! | [`pair_filter`] | a system of the game that decides which pairs collide |
//! | [`ignored`] | components that the model does not read |
//! | [`refusal`] | input that was refused, marbles that had to be stopped |
//! | [`diagnostics`] | step time and counts |
//! | [`wall_motion`] | speed of walls that move |
//! | [`interpolation`] | smooth motion between fixed steps, of marbles and of walls that move |
//! | `picking` (feature `picking`) | pointers on marbles, walls and bodies |
//! | `mesh_walls` (feature `mesh`) | walls of meshes, meshes of walls |
//! | `gizmos` (feature `render`) | contacts, normals, velocities, sensors and the grid, drawn |
//! | `swarm_render` (feature `render`) | swarms on the screen |
//! | `debug_ui` (feature `debug_ui`) | egui panels for any game |
//! | `trade` (feature `trade`) | what every model would cost and buy, measured beside the game |
//! | `governor` (feature `trade`) | keeps steps within a budget |
//!
//! # Tests without a window
//! A frame that is as long as a fixed step makes exactly one step, on every machine:
//!
//! ```
//! use bevy::prelude::*;
//! use bevy::time::TimeUpdateStrategy;
//! use bevy_taw::prelude::*;
//!
//! let mut app = App::new();
//! // Not `TawPlugins`, which draw between steps: a `Transform` is that of the last step.
//! app.add_plugins((MinimalPlugins, TransformPlugin, TawPlugin));
//! app.insert_resource(Time::<Fixed>::from_hz(64.0));
//! let step = app.world().resource::<Time<Fixed>>().timestep();
//! app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
//! app.update(); // Bevy's first frame takes no time
//!
//! let ball = app.world_mut().spawn((Marble::new(0.5), Transform::from_xyz(0.0, 10.0, 0.0))).id();
//! for _ in 0..64 {
//!     app.update();
//! }
//! let fallen = 10.0 - app.world().get::<Transform>(ball).unwrap().translation.y;
//! assert!((fallen - 9.81 / 2.0).abs() < 0.01); // in a second
//! ```
//!
//! A longer frame makes as many steps as fit in; of one of more than 250 ms, Bevy passes over the rest
//! ([`Time::<Virtual>::max_delta`](bevy::time::Time::max_delta)).
//!
//! # Several worlds
//! Another world, of its own gravity and model, as for a split screen or a game within the game, is a Bevy
//! [`World`] with the plugin. The app keeps it as a resource and steps it; its marbles and walls are entities
//! there, of which entities of the app show the places. Messages, [`SpatialQuery`] and snapshots are those
//! of their world.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy::time::TimeUpdateStrategy;
//! use bevy_taw::prelude::*;
//!
//! #[derive(Resource)]
//! struct Moon(World);
//!
//! /// Entity on the moon that is drawn at the place of this one.
//! #[derive(Component)]
//! struct Shows(Entity);
//!
//! fn moon(app: &App) -> Moon {
//!     let mut moon = App::new();
//!     moon.add_plugins((MinimalPlugins, TransformPlugin, TawPlugin));
//!     let step = app.world().resource::<Time<Fixed>>().timestep();
//!     moon.insert_resource(Time::<Fixed>::from_duration(step))
//!         .insert_resource(TimeUpdateStrategy::ManualDuration(step)) // a frame is a step
//!         .insert_resource(Gravity(Vec3::NEG_Y * 1.62));
//!     moon.finish();
//!     moon.cleanup();
//!     moon.update(); // Bevy's first frame takes no time
//!     Moon(std::mem::take(moon.world_mut()))
//! }
//!
//! /// Exclusive, since one schedule does not run in a thread of another.
//! fn step(app: &mut World) {
//!     let moon = &mut app.resource_mut::<Moon>().into_inner().0;
//!     moon.run_schedule(Main);
//!     moon.clear_trackers();
//! }
//!
//! fn show(moon: Res<Moon>, mut shown: Query<(&Shows, &mut Transform)>) {
//!     for (Shows(entity), mut drawn) in &mut shown {
//!         if let Some(place) = moon.0.get::<Transform>(*entity) {
//!             *drawn = *place;
//!         }
//!     }
//! }
//!
//! # let mut app = App::new();
//! # app.add_plugins((MinimalPlugins, TransformPlugin));
//! app.add_plugins(TawPlugin);
//! let mut moon = moon(&app);
//! let rock = moon.0.spawn(Marble::new(0.5)).id();
//! app.world_mut().spawn((Shows(rock), Transform::default()));
//! app.insert_resource(moon).add_systems(FixedUpdate, (step, show).chain());
//! # app.update();
//! ```
//!
//! # Units
//! Metres, seconds. `Transform::scale` does not change a marble's radius.
//!
//! [`FixedUpdate`]: bevy::app::FixedUpdate
//! [`Model::substeps`]: taw::world::Model::substeps
//! [`TawSystems`]: crate::TawSystems
//! [`SpatialQuery`]: crate::spatial_query::SpatialQuery
//! [`Velocity`]: crate::components::Velocity
//! [`World`]: bevy::ecs::world::World
//! [`TawWorld`]: crate::resources::TawWorld

#![cfg_attr(not(test), warn(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod ball;
mod ball_sensor;
pub mod body;
mod body_touches;
pub mod components;
pub mod contact_force;
mod contact_points;
pub mod controller;
mod convert;
#[cfg(feature = "debug_ui")]
pub mod debug_ui;
pub mod diagnostics;
mod forget;
mod gap;
mod gather;
mod gather_bodies;
mod gather_walls;
#[cfg(feature = "render")]
pub mod gizmos;
#[cfg(feature = "trade")]
pub mod governor;
pub mod grounded;
pub mod ignore;
pub mod ignored;
pub mod interpolation;
pub mod joint;
pub mod layers;
pub mod locked_axes;
#[cfg(feature = "mesh")]
pub mod mesh_walls;
pub mod messages;
#[cfg(feature = "render")]
mod outline;
pub mod pair_filter;
#[cfg(feature = "picking")]
pub mod picking;
mod placed;
mod plugin;
pub mod preview;
mod reflect;
pub mod refusal;
pub mod resources;
mod scatter;
mod schedule;
pub mod sensor;
mod sleep;
pub mod snapshot;
pub mod spatial_query;
pub mod swarm;
#[cfg(feature = "render")]
pub mod swarm_render;
mod touches;
#[cfg(feature = "trade")]
pub mod trade;
pub mod wall;
mod wall_drawing;
pub mod wall_motion;
pub mod zones;

pub use plugin::{Substep, SubstepDelta, TawPlugin, TawPlugins, TawSystems};
pub use schedule::TawSchedule;
pub use taw;

/// Items that nearly every game needs.
pub mod prelude {
    pub use crate::body::{Body, BodyPart, BodyShape};
    pub use crate::components::{
        AngularVelocity, ExternalForce, ExternalImpulse, GravityScale, HalfLength, Kinematic,
        Marble, MarbleDamping, MarbleIntegrator, MarbleMass, MarbleRotation, Sleeping,
        SleepingDisabled, SurfaceMaterial, SurfaceVelocity, Teleport, Velocity,
    };
    pub use crate::contact_force::ContactForce;
    pub use crate::controller::{Drive, MarbleController};
    #[cfg(feature = "render")]
    pub use crate::gizmos::TawGizmos;
    pub use crate::grounded::{Ground, Grounded};
    pub use crate::ignore::{ColliderDisabled, IgnoreCollisions, OneWay};
    pub use crate::ignored::IgnoredComponents;
    pub use crate::joint::{
        Joint, JointBroken, JointDrive, JointEnd, JointKind, JointMotor, JointSpring,
    };
    pub use crate::layers::{CollisionLayers, LayerMask, PhysicsLayer};
    pub use crate::locked_axes::LockedAxes;
    #[cfg(feature = "mesh")]
    pub use crate::mesh_walls::{MeshShape, MeshWalls};
    pub use crate::messages::{
        ContactEnded, ContactHit, ContactOngoing, ContactPair, ContactPoint, ContactStarted,
    };
    pub use crate::pair_filter::{CandidatePairs, FilterPairs, PairFilter};
    #[cfg(feature = "picking")]
    pub use crate::picking::TawPickingPlugin;
    pub use crate::preview::Preview;
    pub use crate::refusal::{InputRefused, MarbleStopped, Refusal};
    pub use crate::resources::{Forces, Gravity, TawModel, TawWorld};
    pub use crate::sensor::{
        BallEntered, BallLeft, CollidingBalls, CollidingEntities, Sensor, SensorEntered, SensorLeft,
    };
    pub use crate::spatial_query::{SpatialQuery, SpatialQueryFilter};
    pub use crate::swarm::{Ball, BallId, Swarm, TawSwarmModel, Tint};
    pub use crate::wall::Wall;
    pub use crate::zones::{GravityZone, WindZone};
    pub use crate::{Substep, TawPlugin, TawPlugins, TawSchedule, TawSystems};
    pub use taw::motion::{ForceField, Integrator, Medium, Rotation};
    pub use taw::response::{Combine, ContactLaw, Response};
    pub use taw::swarm::{SwarmModel, Tier};
    pub use taw::world::{Detection, Model, Precision, StopReason};
}

/// Compiles what the README shows.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
