//! Balls of swarms that enter and leave sensors.

use std::cmp::Ordering;

use bevy::ecs::message::Messages;
use bevy::prelude::*;
use taw::swarm::BallId;

use crate::resources::TawWorld;
use crate::touches::{is_read, observers};

/// Message, and event of the sensor's entity: after a step, a ball of a swarm is inside of a sensor in which
/// it was not before. One that passes through within a step is not noticed.
///
/// Sent if somebody reads or observes it: `app.add_message::<BallEntered>()`, or an observer. While nobody
/// does, nothing is compared; who is inside when somebody begins to listen enters then.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// #[derive(Component, Default)]
/// struct Score(u32);
///
/// /// A hole swallows the ball, and counts it.
/// fn swallow(
///     ball: On<BallEntered>,
///     mut scores: Query<&mut Score>,
///     mut swarms: Query<&mut Swarm>,
/// ) -> Result {
///     scores.get_mut(ball.sensor)?.0 += 1;
///     swarms.get_mut(ball.swarm)?.remove(ball.ball);
///     Ok(())
/// }
///
/// fn spawn(mut commands: Commands) {
///     let hole = (Wall::from(Cuboid::new(1.0, 0.2, 1.0)), Sensor, Score::default());
///     commands.spawn(hole).observe(swallow);
/// }
/// # let mut app = App::new();
/// # app.add_plugins((MinimalPlugins, TawPlugins)).add_systems(Startup, spawn).update();
/// ```
#[derive(Message, EntityEvent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct BallEntered {
    /// The sensor.
    #[event_target]
    pub sensor: Entity,
    /// The swarm.
    pub swarm: Entity,
    /// The ball.
    pub ball: BallId,
}

/// Message, and event of the sensor's entity: after a step, a ball of a swarm is no longer inside of a
/// sensor, or either is gone. Sent as [`BallEntered`] is.
#[derive(Message, EntityEvent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct BallLeft {
    /// The sensor, which may be gone.
    #[event_target]
    pub sensor: Entity,
    /// The swarm, which may be gone.
    pub swarm: Entity,
    /// The ball, which may be gone.
    pub ball: BallId,
}

/// Ball inside of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SensedBall {
    sensor: Entity,
    ball: BallId,
    swarm: Entity,
}

impl SensedBall {
    fn key(&self) -> (Entity, BallId) {
        (self.sensor, self.ball)
    }
}

/// Run condition: somebody reads or observes balls in sensors.
pub(crate) fn are_read(world: &World) -> bool {
    is_read::<BallEntered>(world)
        || is_read::<BallLeft>(world)
        || observers::<BallEntered>(world).is_some()
        || observers::<BallLeft>(world).is_some()
}

/// Forgets who was inside while nobody listens.
pub(crate) fn forget(mut world: ResMut<TawWorld>) {
    if !world.sensed_balls.is_empty() {
        world.sensed_balls.clear();
    }
}

/// Compares who is inside with who was, and sends the difference.
pub(crate) fn write(
    mut world: ResMut<TawWorld>,
    mut entered: Option<ResMut<Messages<BallEntered>>>,
    mut left: Option<ResMut<Messages<BallLeft>>>,
    mut commands: Commands,
) {
    let mut now = Vec::new();
    for (id, sensor) in &world.sensor_entities {
        let balls = world.sensors.balls_inside(*id).unwrap_or_default().iter();
        now.extend(balls.filter_map(|ball| {
            Some(SensedBall { sensor: *sensor, ball: *ball, swarm: world.swarm_of(*ball)? })
        }));
    }
    now.sort_unstable_by_key(SensedBall::key);
    if now == world.sensed_balls {
        return;
    }
    let mut before = world.sensed_balls.iter().peekable();
    let mut after = now.iter().peekable();
    loop {
        let order = match (before.peek(), after.peek()) {
            (None, None) => break,
            (Some(_), None) => Ordering::Less,
            (None, Some(_)) => Ordering::Greater,
            (Some(was), Some(is)) => was.key().cmp(&is.key()),
        };
        let was = if order.is_le() { before.next() } else { None };
        let is = if order.is_ge() { after.next() } else { None };
        match (was, is) {
            (Some(&SensedBall { sensor, ball, swarm }), None) => {
                let event = BallLeft { sensor, swarm, ball };
                if let Some(left) = &mut left {
                    left.write(event);
                }
                commands.trigger(event);
            }
            (None, Some(&SensedBall { sensor, ball, swarm })) => {
                let event = BallEntered { sensor, swarm, ball };
                if let Some(entered) = &mut entered {
                    entered.write(event);
                }
                commands.trigger(event);
            }
            _ => {}
        }
    }
    world.sensed_balls = now;
}
