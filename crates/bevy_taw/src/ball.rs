//! Single balls of swarms: what they are when they come, and reading and setting those in the world.

use bevy::prelude::*;
use taw::swarm::BallId;

use crate::components::MarbleMass;
use crate::convert::{from_point, from_vector, to_point, to_vector};
use crate::resources::TawWorld;

/// Ball of a [`Swarm`](crate::swarm::Swarm).
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// let shot = Ball { velocity: Vec3::X * 5.0, ..Ball::new(Vec3::Y, 0.1) };
/// let swarm = Swarm::new(vec![shot]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Center, in metres in world space; each coordinate at most 1e12.
    pub position: Vec3,
    /// Radius in metres, from 1e-9 to 1e9.
    pub radius: f32,
    /// Velocity, in m/s; each component at most 1e12.
    pub velocity: Vec3,
    /// Mass, which is not infinite.
    pub mass: MarbleMass,
}

impl Ball {
    /// Ball of glass at rest.
    #[must_use]
    pub fn new(position: Vec3, radius: f32) -> Self {
        Self { position, radius, velocity: Vec3::ZERO, mass: MarbleMass::default() }
    }
}

impl From<Ball> for taw::swarm::Ball {
    fn from(Ball { position, radius, velocity, mass }: Ball) -> Self {
        let (position, velocity) = (to_point(position), to_vector(velocity));
        Self { position, radius, velocity, mass: mass.into() }
    }
}

impl From<taw::swarm::Ball> for Ball {
    fn from(ball: taw::swarm::Ball) -> Self {
        let taw::swarm::Ball { position, radius, velocity, mass } = ball;
        let (position, velocity) = (from_point(position), from_vector(velocity));
        Self { position, radius, velocity, mass: mass.into() }
    }
}

/// Hit of a ray on a ball of a swarm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BallHit {
    /// The ball.
    pub ball: BallId,
    /// Distance from the origin of the ray, in metres; zero if that is inside.
    pub distance: f32,
    /// Point on the surface, or the origin, in metres in world space.
    pub point: Vec3,
}

/// State of balls is in the world alone, so it may be set in any schedule.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// /// Balls that fell off the table are gone, others are kicked.
/// fn kick(mut swarm: Single<&mut Swarm>, mut world: ResMut<TawWorld>) -> Result {
///     swarm.retain(|ball| world.ball(ball).is_ok_and(|it| it.position.y > 0.0));
///     for ball in swarm.balls() {
///         world.set_ball_velocity(*ball, Vec3::Y * 2.0)?;
///     }
///     Ok(())
/// }
/// ```
impl TawWorld {
    /// Ball of a swarm as it is after the last step.
    ///
    /// # Errors
    /// [`NoSuchBall`](taw::Error::NoSuchBall).
    pub fn ball(&self, ball: BallId) -> Result<Ball, taw::Error> {
        self.world.swarm.get(ball).map(Ball::from)
    }

    /// Puts a ball of a swarm elsewhere, in metres, and wakes it.
    ///
    /// # Errors
    /// [`NoSuchBall`](taw::Error::NoSuchBall), [`NotFinite`](taw::Error::NotFinite),
    /// [`OutOfRange`](taw::Error::OutOfRange) for a coordinate of more than 1e12.
    pub fn set_ball_position(&mut self, ball: BallId, position: Vec3) -> Result<(), taw::Error> {
        self.world.swarm.set_position(ball, to_point(position))
    }

    /// Sets the velocity of a ball of a swarm, in m/s, and wakes it.
    ///
    /// # Errors
    /// [`NoSuchBall`](taw::Error::NoSuchBall), [`NotFinite`](taw::Error::NotFinite),
    /// [`OutOfRange`](taw::Error::OutOfRange) for a component of more than 1e12.
    pub fn set_ball_velocity(&mut self, ball: BallId, velocity: Vec3) -> Result<(), taw::Error> {
        self.world.swarm.set_velocity(ball, to_vector(velocity))
    }

    /// First ball of a swarm on a ray, after the last step, within a distance in metres, which may be
    /// infinite: to pick one. It looks at each ball, some ten microseconds for ten thousand.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_taw::prelude::*;
    /// fn shoot(gun: Single<&GlobalTransform>, world: Res<TawWorld>, mut swarm: Single<&mut Swarm>) {
    ///     let ray = Ray3d::new(gun.translation(), gun.forward());
    ///     if let Some(hit) = world.cast_ray_on_balls(ray, 100.0) {
    ///         swarm.remove(hit.ball);
    ///     }
    /// }
    /// ```
    #[must_use]
    pub fn cast_ray_on_balls(&self, ray: Ray3d, max_distance: f32) -> Option<BallHit> {
        let swarm = &self.world.swarm;
        let hit = |(row, [x, y, z, radius]): (usize, &[f32; 4])| {
            let to_center = Vec3::new(*x, *y, *z) - ray.origin;
            let along = to_center.dot(*ray.direction);
            let beside = (to_center - along * *ray.direction).length_squared();
            let half_chord = (radius * radius - beside).sqrt(); // NaN if the line passes by
            let distance = (along - half_chord).max(0.0);
            let is_hit = along + half_chord >= 0.0 && distance <= max_distance;
            (is_hit && !swarm.is_marble(row)).then_some((row, distance))
        };
        let hits = swarm.balls().iter().enumerate().filter_map(hit);
        let (row, distance) = hits.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let point = ray.get_point(distance);
        Some(BallHit { ball: swarm.id(row)?, distance, point })
    }
}
