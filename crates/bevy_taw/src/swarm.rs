//! Marbles in bulk that are no entities: one component holds them.

use bevy::ecs::world::DeferredWorld;
use bevy::math::bounding::Aabb3d;
use bevy::platform::collections::HashSet;
use bevy::prelude::*;
use taw::swarm::{Stage, SwarmModel};

use crate::components::MarbleMass;
use crate::diagnostics::StepTimes;
use crate::layers::CollisionLayers;
use crate::reflect::SwarmModelReflect;
use crate::refusal::{Refusals, report};
use crate::resources::TawWorld;
use crate::snapshot::{RowRemoved, lost_balls};

pub use crate::ball::{Ball, BallHit};
pub use taw::swarm::BallId;

/// Marbles in bulk, up to millions, which collide with each other, with walls, and with the
/// marbles that are entities. How they step is in [`TawSwarmModel`].
///
/// A [`CollisionLayers`] beside it holds for all its balls.
/// They live in world space; a `Transform` beside this component says nothing. They go when it
/// goes, and one by one by [`Swarm::remove`]. Where one is, and how fast, is read and set by
/// [`TawWorld::ball`], [`TawWorld::set_ball_position`] and [`TawWorld::set_ball_velocity`]. With the
/// feature `render`, a camera sees them.
///
/// ```
/// # use bevy::math::bounding::Aabb3d;
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// # let mut app = App::new();
/// app.add_systems(Startup, |mut commands: Commands| {
///     let region = Aabb3d::new(Vec3::Y * 10.0, Vec3::splat(8.0));
///     commands.spawn(Swarm::filling(region, 1_000, 0.1..=0.2, 1));
/// });
/// ```
///
/// Reflected is the tint alone.
#[derive(Component, Clone, Debug, Default, Reflect)]
#[reflect(Component, Debug, Default)]
pub struct Swarm {
    /// Meaning of the colour of a marble.
    pub tint: Tint,
    #[reflect(ignore)]
    coming: Vec<Ball>,
    #[reflect(ignore)]
    going: Vec<BallId>,
    #[reflect(ignore)]
    balls: Vec<BallId>,
    /// Layers that the balls have.
    #[reflect(ignore)]
    layers: CollisionLayers,
}

/// Meaning of the colour of a marble.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Debug, Default, PartialEq)]
pub enum Tint {
    /// Which one it is: each has a colour of its own.
    #[default]
    Id,
    /// Speed: from blue at rest to red at this speed, in m/s.
    Speed(f32),
    /// Radius: from blue for this one to red for that one, in metres.
    Size(f32, f32),
    /// Nothing: all have this one, as linear red, green and blue in [0, 1].
    Plain([f32; 3]),
}

/// Model of all swarms. May change at any time; what cannot be right is refused with an
/// [`InputRefused`](crate::refusal::InputRefused), and the last good one stays.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Deref, DerefMut, Reflect)]
#[reflect(Resource, Debug, Default, PartialEq)]
pub struct TawSwarmModel(#[reflect(remote = SwarmModelReflect)] pub SwarmModel);

impl Swarm {
    /// These marbles.
    #[must_use]
    pub fn new(balls: Vec<Ball>) -> Self {
        Self { coming: balls, ..default() }
    }

    /// So many marbles of glass on a lattice that fills a region from below, with radii drawn
    /// evenly from a range, in metres. What does not fit is stacked above.
    ///
    /// Equal seeds give equal marbles.
    #[must_use]
    pub fn filling(
        region: Aabb3d,
        count: usize,
        radii: std::ops::RangeInclusive<f32>,
        seed: u64,
    ) -> Self {
        let (low, high) = (Vec3::from(region.min), Vec3::from(region.max));
        let pitch = 2.1 * radii.end();
        let cells = ((high - low) / pitch).floor().max(Vec3::ONE).as_uvec3();
        let room = (high - low - pitch * cells.as_vec3()) * 0.5;
        let layer = (cells.x * cells.z) as usize;
        let balls = (0..count).map(|i| {
            let (x, z) = (i % layer % cells.x as usize, i % layer / cells.x as usize);
            let cell = Vec3::new(x as f32, (i / layer) as f32, z as f32) + 0.5;
            let place = low + room * Vec3::new(1.0, 0.0, 1.0) + cell * pitch;
            let random = |n| draw(seed, 4 * i as u64 + n);
            let radius = radii.start() + (radii.end() - radii.start()) * random(0);
            // Or they would stand on each other's heads for a while.
            let aside = Vec3::new(random(1) - 0.5, 0.0, random(2) - 0.5) * 0.05 * pitch;
            Ball::new(place + aside, radius)
        });
        Self::new(balls.collect())
    }

    /// Another tint.
    #[must_use]
    pub fn with_tint(self, tint: Tint) -> Self {
        Self { tint, ..self }
    }

    /// Another mass for all that are not in the world yet.
    #[must_use]
    pub fn with_mass(mut self, mass: impl Into<MarbleMass>) -> Self {
        let mass = mass.into();
        self.coming.iter_mut().for_each(|ball| ball.mass = mass);
        self
    }

    /// Puts more marbles in with the next step.
    pub fn extend(&mut self, balls: impl IntoIterator<Item = Ball>) {
        self.coming.extend(balls);
    }

    /// Takes marbles out with the next step, the last ones first, until `count` are left.
    pub fn truncate(&mut self, count: usize) {
        let all = self.len();
        self.coming.truncate(count.saturating_sub(self.balls.len()));
        if count < all.min(self.balls.len()) {
            self.going.extend(self.balls.drain(count..));
        }
    }

    /// Takes one ball out with the next step. Returns false if it is none of these. Takes longer the more
    /// there are: [`retain`](Self::retain) takes out many at once.
    pub fn remove(&mut self, ball: BallId) -> bool {
        let found = self.balls.iter().position(|it| *it == ball);
        self.going.extend(found.map(|i| self.balls.remove(i)));
        found.is_some()
    }

    /// Takes balls out with the next step: those for which this returns false. Balls that are not in the
    /// world yet have no name, and stay.
    pub fn retain(&mut self, mut stays: impl FnMut(BallId) -> bool) {
        self.going.extend(self.balls.extract_if(.., |ball| !stays(*ball)));
    }

    /// Number of marbles, with those that come with the next step.
    #[must_use]
    pub fn len(&self) -> usize {
        self.balls.len() + self.coming.len()
    }

    /// Tests if there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Those that come with the next step.
    #[must_use]
    pub fn coming(&self) -> &[Ball] {
        &self.coming
    }

    /// Those that are in the world, in the order in which they came: names for [`TawWorld::ball`], and for
    /// `TawWorld::swarm`, which has all else about them. One that is removed there goes from here with
    /// the next step.
    #[must_use]
    pub fn balls(&self) -> &[BallId] {
        &self.balls
    }

    /// Positions in metres, in the same order.
    pub fn positions<'a>(&'a self, world: &'a TawWorld) -> impl Iterator<Item = Vec3> + 'a {
        let rows = self.balls.iter().filter_map(|ball| world.swarm.row(*ball).ok());
        rows.map(|row| Vec3::from_slice(&world.swarm.balls()[row][..3]))
    }
}

/// Numbers in [0, 1) that look random (Steele, Lea and Flood 2014, `SplitMix64`).
fn draw(seed: u64, n: u64) -> f32 {
    let mut bits = seed.wrapping_add((n + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    (bits >> 40) as f32 / (1_u32 << 24) as f32
}

/// Puts new marbles in, and takes those out that go.
pub(crate) fn gather(
    mut world: ResMut<TawWorld>,
    mut swarms: Query<(Entity, &mut Swarm, Option<&CollisionLayers>)>,
    model: Res<TawSwarmModel>,
    mut refusals: Refusals,
    mut removed: MessageWriter<RowRemoved>,
    mut removals: Local<u64>,
) {
    if **model != world.swarm.model() {
        refusals.check(None, world.swarm.set_model(**model));
    }
    if world.just_restored {
        let named = swarms.iter_mut().map(|(entity, swarm, _)| (entity, swarm));
        name_balls(&mut world, named, &mut removed);
    }
    let any_gone = world.swarm.removals() != *removals;
    for (entity, mut swarm, layers) in &mut swarms {
        if any_gone {
            forget_gone(&world, &mut swarm);
        }
        let layers = layers.copied().unwrap_or_default();
        let moved = swarm.layers != layers || world.just_restored;
        if swarm.coming.is_empty() && swarm.going.is_empty() && !moved {
            continue;
        }
        let swarm = &mut *swarm;
        let going = std::mem::take(&mut swarm.going);
        refusals.check(Some(entity), world.swarm.remove(&going));
        let coming: Vec<_> = swarm.coming.drain(..).map(taw::swarm::Ball::from).collect();
        let old = if moved { 0 } else { swarm.balls.len() };
        let inserted = world.swarm.insert(&coming).map(|balls| {
            world.note_balls(entity, &balls);
            swarm.balls.extend(balls);
        });
        refusals.check(Some(entity), inserted);
        swarm.layers = layers;
        refusals.check(Some(entity), world.swarm.set_layers(&swarm.balls[old..], layers.into()));
    }
    *removals = world.swarm.removals();
}

/// Forgets the balls of a swarm that somebody else removed.
fn forget_gone(world: &TawWorld, swarm: &mut Mut<Swarm>) {
    let is_there = |ball: &BallId| world.swarm.row(*ball).is_ok();
    if !swarm.balls.iter().chain(&swarm.going).all(is_there) {
        swarm.balls.retain(is_there);
        swarm.going.retain(is_there);
    }
}

/// Gives swarms the balls that they have in a restored world, and takes out what is nobody's.
fn name_balls<'a>(
    world: &mut TawWorld,
    swarms: impl Iterator<Item = (Entity, Mut<'a, Swarm>)>,
    removed: &mut MessageWriter<RowRemoved>,
) {
    world.ball_entities.clear();
    let mut owned = HashSet::default();
    for (entity, mut swarm) in swarms {
        let Swarm { balls, going, .. } = &mut *swarm;
        balls.retain(|ball| world.swarm.row(*ball).is_ok());
        going.retain(|ball| world.swarm.row(*ball).is_ok());
        world.note_balls(entity, balls);
        owned.extend(balls.iter().chain(&*going).copied());
    }
    let lost = lost_balls(world, &owned);
    if !lost.is_empty() {
        log::warn!("taw took out {} balls that no swarm has", lost.len());
        report("take out balls", world.swarm.remove(&lost));
        removed.write_batch(lost.into_iter().map(RowRemoved::Ball));
    }
}

/// The marbles of a swarm go when it goes, or another one takes its place.
pub(crate) fn forget(removed: On<Discard, Swarm>, mut app: DeferredWorld) {
    let Some(swarm) = app.get::<Swarm>(removed.entity) else { return };
    let balls: Vec<_> = swarm.balls.iter().chain(&swarm.going).copied().collect();
    let mut world = app.resource_mut::<TawWorld>();
    // Those that somebody else took out are gone already.
    let balls: Vec<_> = balls.into_iter().filter(|ball| world.swarm.row(*ball).is_ok()).collect();
    report("take out a swarm", world.swarm.remove(&balls));
}

/// Moves the swarms on, after the marbles.
pub(crate) fn step(mut world: ResMut<TawWorld>, time: Res<Time>, mut times: ResMut<StepTimes>) {
    let mut clock = |stage: Stage| times.swarm.go_on(stage);
    report("step the swarm", world.step_swarm(time.delta_secs(), &mut clock));
    times.swarm.stop();
    times.end_step();
}

/// Reports the marbles that were stopped in this step, and once for as long as it lasts that more
/// pairs are inside of each other than are looked at.
pub(crate) fn report_stopped(world: Res<TawWorld>, mut waits: Local<bool>) {
    for ball in world.swarm.stopped() {
        log::warn!("taw stopped {ball:?}: its motion is no longer finite");
    }
    let pairs = world.swarm.check_pairs();
    if let Err(error) = pairs
        && !*waits
    {
        log::warn!("balls of swarms overlap until others have parted: {error}");
    }
    *waits = pairs.is_err();
}

/// A colour for what lies between least (0) and most (1): blue, green, yellow, red.
#[must_use]
pub fn heat(part: f32) -> [f32; 3] {
    let part = part.clamp(0.0, 1.0) * 3.0;
    let colors = [[0.10, 0.20, 0.65], [0.10, 0.60, 0.35], [0.95, 0.75, 0.15], [0.85, 0.12, 0.08]];
    let first = (part as usize).min(2);
    let rest = part - first as f32;
    [0, 1, 2].map(|i| colors[first][i] + (colors[first + 1][i] - colors[first][i]) * rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fills_a_region_lies_in_it_and_apart() {
        let region = Aabb3d::new(Vec3::ZERO, Vec3::splat(2.0));
        let swarm = Swarm::filling(region, 500, 0.1..=0.2, 3);
        assert_eq!(swarm.len(), 500);
        for (i, a) in swarm.coming.iter().enumerate() {
            assert!(a.radius >= 0.1 && a.radius <= 0.2);
            assert!(a.position.abs().max_element() < 2.0 - 0.9 * a.radius);
            for b in &swarm.coming[..i] {
                assert!(a.position.distance(b.position) > a.radius + b.radius);
            }
        }
    }

    #[test]
    fn heat_goes_from_blue_to_red() {
        assert!(heat(0.0)[2] > heat(0.0)[0] && heat(1.0)[0] > heat(1.0)[2]);
        assert_eq!((heat(-1.0), heat(9.0)), (heat(0.0), heat(1.0)));
        assert_eq!(heat(f32::NAN).map(f32::is_nan), [true; 3]);
    }
}
