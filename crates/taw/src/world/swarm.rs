//! The swarm of a world.

use cgmath::EuclideanSpace;

use super::MarbleId;
use super::World;
use super::soft_step::inverse_mass;
use super::swept_walls::SweptWalls;
use crate::Error;
use crate::math::{Scalar, Vec3, cast_vector};
use crate::motion::{Mass, Motion, acceleration_in_step};
use crate::swarm::{BallId, MAX_COORDINATE, Proxy, Stage, VelocityChange};

impl<S: Scalar> World<S> {
    /// Moves the [swarm](Self::swarm) on, which a step does after the marbles, before it
    /// [ends](Self::end_step). `observe` is told what it goes about, as often as that changes.
    ///
    /// Marbles and the swarm push each other; the swarm takes a capsule for the ball in its
    /// middle.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for `dt`, [`Error::OutOfRange`] if it is not in [`World::TIMES`],
    /// [`Error::TooManyPairs`] if more than [`World::MAX_PAIRS`] overlap, [`Error::Full`] at 2³² − 1
    /// balls.
    pub fn step_swarm(&mut self, dt: S, observe: &mut dyn FnMut(Stage)) -> Result<(), Error> {
        if !self.settings.model.response.uses_swarm_rows() {
            self.check_crowding()?;
        }
        self.move_swarm(dt, observe)
    }

    /// Moves the swarm on, of which pairs are not too many.
    pub(super) fn move_swarm(
        &mut self,
        dt: S,
        observe: &mut dyn FnMut(Stage),
    ) -> Result<(), Error> {
        let dt = Self::validated_dt(dt)?;
        if self.settings.model.response.uses_swarm_rows() {
            return Ok(()); // it moved with the marbles
        }
        self.swarm.set_bodies_are_rows(false);
        self.remove_stale_bodies()?;
        if self.swarm.len() == self.swarm.body_balls.len() {
            return Ok(());
        }
        self.sync_proxies(dt)?;
        self.sync_ignored_pairs();
        self.walls.update_tree();
        let (gravity, changes) = (self.settings.gravity, self.field_changes_of_swarm(dt));
        self.swarm.set_velocity_changes(changes);
        self.audit_rows_before();
        let walls = SweptWalls::new(&self.walls, dt);
        self.swarm.step(dt, gravity, &walls, self.walls.identity(), observe);
        self.audit_rows_after();
        self.walls.mark_seen();
        self.write_back_proxies();
        Ok(())
    }

    /// Changes of velocity by force fields, gravity scales and applied accelerations of the swarm's own
    /// balls in a step of `dt` seconds.
    pub(super) fn field_changes_of_swarm(&self, dt: S) -> Vec<VelocityChange<S>> {
        let acceleration = |motion: Motion<S>, mass: S| {
            cast_vector(acceleration_in_step(&self.settings.forces, motion, mass, dt))
        };
        let acceleration = (!self.settings.forces.is_empty()).then_some(acceleration);
        let mut changes = self.swarm.field_changes(acceleration, self.settings.gravity, dt);
        changes.extend(self.swarm.applied_changes(dt));
        changes
    }

    /// Forgets proxies of which the world lost the marble or the swarm the ball, whoever took
    /// them out.
    pub(super) fn remove_stale_bodies(&mut self) -> Result<(), Error> {
        let (marbles, swarm) = (&self.marbles, &mut self.swarm);
        let stays = |(marble, _): &(MarbleId, BallId)| marbles.row(*marble).is_ok();
        let is_there = |(_, ball): &(MarbleId, BallId)| swarm.row(*ball).is_ok();
        if swarm.body_balls.iter().all(|proxy| stays(proxy) && is_there(proxy)) {
            return Ok(());
        }
        let (there, _): (Vec<_>, Vec<_>) = swarm.body_balls.iter().copied().partition(is_there);
        let (stay, gone): (Vec<_>, Vec<_>) = there.into_iter().partition(stays);
        swarm.body_balls = stay;
        swarm.take_out(&gone.into_iter().map(|(_, ball)| ball).collect::<Vec<_>>())
    }

    /// Gives every marble a ball in the swarm.
    pub(super) fn insert_missing_bodies(&mut self) -> Result<(), Error> {
        if self.swarm.body_balls.len() != self.marbles.len() {
            let (marbles, swarm) = (&self.marbles, &mut self.swarm);
            let known =
                |id: &MarbleId| swarm.body_balls.binary_search_by_key(id, |(id, _)| *id).is_ok();
            let ids = (0..marbles.len()).filter_map(|row| marbles.id(row));
            let new: Vec<_> = ids.filter(|id| !known(id)).collect();
            let balls = swarm.insert_bodies(new.len())?;
            swarm.body_balls.extend(new.into_iter().zip(balls));
            swarm.body_balls.sort_unstable();
        }
        Ok(())
    }

    /// Brings the proxies of the swarm up to date with the marbles.
    fn sync_proxies(&mut self, dt: S) -> Result<(), Error> {
        self.insert_missing_bodies()?;
        let (marbles, body_balls) = (&self.marbles, std::mem::take(&mut self.swarm.body_balls));
        let slots = &self.swarm;
        let layers = body_balls.iter().filter_map(|(marble, ball)| {
            Some((slots.slot_of(*ball)?, marbles.layers_of_row(marbles.row(*marble).ok()?)))
        });
        let layers: Vec<_> = layers.collect();
        self.swarm.set_layers_of_slots(layers.into_iter());
        let proxies = body_balls.iter().filter_map(|(marble, ball)| {
            let row = marbles.row(*marble).ok()?;
            let radius = marbles.radius()[row];
            let spin = marbles
                .angular_velocity()
                .get(row)
                .map_or([S::zero(); 4], |spin| clamped_row(*spin * radius, S::zero()));
            let inverse_mass = inverse_mass(marbles.mass(row));
            let most = S::from_f64(MAX_COORDINATE);
            let at = clamped_row(marbles.position()[row].to_vec(), radius.min(most));
            let velocity = clamped_row(marbles.velocity()[row], inverse_mass);
            Some(Proxy::new(*ball, at, velocity, spin))
        });
        self.swarm.set_proxies(proxies, dt, self.settings.gravity);
        self.swarm.body_balls = body_balls;
        Ok(())
    }

    /// Gives the marbles what the swarm did to them, and stops those at walls that it pushed through one. Those
    /// of infinite mass go as they are told.
    fn write_back_proxies(&mut self) {
        self.begin_pushes();
        for ((marble, _), (before, after)) in
            self.swarm.body_balls.iter().zip(self.swarm.proxies_and_results())
        {
            let row = self.marbles.row(*marble);
            if row.is_ok_and(|row| self.marbles.own_mass(row) == Mass::Infinite) {
                continue;
            }
            let change = |before: &[S; 4], after: &[S; 4]| {
                Vec3::from([0, 1, 2].map(|i| after[i] - before[i]))
            };
            let moved = change(&before.at, &after.at);
            let faster = change(&before.velocity, &after.velocity);
            let turned = change(&before.spin_velocity, &after.spin_velocity);
            self.marbles.apply_delta(*marble, moved, faster, turned);
        }
        self.wake_changed();
        self.stop_bounces_at_walls();
    }
}

/// Row of a vector whose components are within the limits, and a fourth number.
pub(super) fn clamped_row<S: Scalar>(v: Vec3<S>, last: S) -> [S; 4] {
    let most = S::from_f64(MAX_COORDINATE);
    let [x, y, z] = v.map(|x| x.clamp(-most, most)).into();
    [x, y, z, last]
}
