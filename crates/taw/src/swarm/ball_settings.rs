//! State and settings of single balls: material, layers and gravity scale; and what accelerates them.

use cgmath::Zero;

use super::bodies::VelocityChange;
use super::state::of;
use super::surfaces::BallSurface;
use super::{Ball, BallId, Swarm};
use crate::Error;
use crate::broad::{CollisionLayers, IgnoredPairs};
use crate::error::{finite, finite_vector};
use crate::handle::NO_ROW;
use crate::math::{Point3, Scalar, Vec3};
use crate::motion::{Mass, Motion};
use crate::response::Material;
use crate::workers::{DisjointSlice, parallel_for_rows};

/// Forces on single balls.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct BallForces<S> {
    /// Factors on gravity, by slot; one beyond the end.
    gravity_scales: Vec<S>,
    /// Accelerations in the next step, in m/s².
    accelerations: Vec<(BallId, Vec3<S>)>,
}

impl<S: Scalar> BallForces<S> {
    pub fn bytes(&self) -> usize {
        of(&self.gravity_scales) + of(&self.accelerations)
    }
}

impl<S: Scalar> Swarm<S> {
    /// State of a ball: what to insert to have another one like it.
    ///
    /// # Errors
    /// [`Error::NoSuchBall`].
    pub fn get(&self, ball: BallId) -> Result<Ball<S>, Error> {
        let row = self.row(ball)?;
        let ([x, y, z, radius], [u, v, w, inverse_mass]) = (self.at[row], self.velocity[row]);
        Ok(Ball {
            position: Point3::new(x, y, z),
            radius,
            velocity: Vec3::new(u, v, w),
            mass: Mass::Kilograms(inverse_mass.abs().recip()),
        })
    }

    /// Material of a ball.
    ///
    /// # Errors
    /// [`Error::NoSuchBall`], also for a marble's.
    pub fn material(&self, ball: BallId) -> Result<Material<S>, Error> {
        let slot = self.own_slot(ball)?;
        Ok(self.surfaces.get(slot).map_or(self.model.material, |surface| surface.material))
    }

    /// Gives a ball a material of its own, or with none that of the [model](Self::model), and wakes
    /// it. Balls may share materials: each different one is stored once. In the lab's tier it has
    /// no effect.
    ///
    /// # Errors
    /// [`Error::NoSuchBall`], also for a marble's; [`Error::OutOfRange`] for a number of it.
    pub fn set_material(
        &mut self,
        ball: BallId,
        material: Option<Material<S>>,
    ) -> Result<(), Error> {
        let slot = self.own_slot(ball)?;
        let material = material.map(Material::validated).transpose()?;
        let surface = material.map(BallSurface::free);
        if self.surfaces.set(slot, surface) {
            self.wake(self.row(ball)?);
            self.forget_contacts();
        }
        Ok(())
    }

    /// Layers of a ball.
    ///
    /// # Errors
    /// [`Error::NoSuchBall`], also for a marble's.
    pub fn layers(&self, ball: BallId) -> Result<CollisionLayers, Error> {
        self.own_slot(ball).map(|slot| self.surfaces.layers(slot))
    }

    /// Layers of the ball in a row, if that is no marble.
    pub(crate) fn layers_of_own_row(&self, row: usize) -> Option<CollisionLayers> {
        let slot = self.ids.slots().get(row).copied()?;
        (!self.body_slots.contains(slot)).then(|| self.surfaces.layers(slot))
    }

    /// Changes the layers of balls, all or none: which walls, marbles and other balls they collide
    /// with. Wakes those that had others, and balls beside them.
    ///
    /// # Errors
    /// [`Error::NoSuchBall`], also for a marble's.
    pub fn set_layers(&mut self, balls: &[BallId], layers: CollisionLayers) -> Result<(), Error> {
        let slots: Result<Vec<_>, _> = balls.iter().map(|ball| self.own_slot(*ball)).collect();
        self.set_layers_of_slots(slots?.into_iter().map(|slot| (slot, layers)));
        Ok(())
    }

    /// Changes the layers of slots.
    pub(crate) fn set_layers_of_slots(
        &mut self,
        all: impl Iterator<Item = (u32, CollisionLayers)>,
    ) {
        for (slot, layers) in all {
            if self.surfaces.set_layers(slot, layers) {
                self.wake(self.ids.rows()[slot as usize] as usize);
                self.forget_contacts();
            }
        }
    }

    /// Sets which slots pass through each other and through which walls, and wakes those for which that
    /// is new.
    pub(crate) fn set_ignored(&mut self, ignored: IgnoredPairs) {
        let slots = self.surfaces.ignored.differences(&ignored);
        if slots.is_empty() {
            return;
        }
        for slot in slots {
            // The ball may be gone.
            if let Some(row) = self.ids.rows().get(slot as usize).filter(|row| **row != NO_ROW) {
                self.wake(*row as usize);
            }
        }
        *self.surfaces.ignored = ignored;
        self.cache_impulses();
        self.scratch.filters_changed = true;
    }

    /// Has pairs and balls at walls searched again, with the impulses that they have.
    pub(super) fn forget_contacts(&mut self) {
        self.cache_impulses();
        (self.pairs_valid, self.scratch.contacts_forgotten) = (false, true);
    }

    /// Factor on gravity for a ball.
    ///
    /// # Errors
    /// [`Error::NoSuchBall`], also for a marble's.
    pub fn gravity_scale(&self, ball: BallId) -> Result<S, Error> {
        let slot = self.own_slot(ball)?;
        Ok(self.ball_forces.gravity_scales.get(slot as usize).copied().unwrap_or(S::one()))
    }

    /// Changes the factor on gravity for a ball: zero for one that floats, negative for one that
    /// rises. Wakes it in the next step.
    ///
    /// # Errors
    /// [`Error::NoSuchBall`], also for a marble's; [`Error::NotFinite`].
    pub fn set_gravity_scale(&mut self, ball: BallId, gravity_scale: S) -> Result<(), Error> {
        let slot = self.own_slot(ball)? as usize;
        let gravity_scale = finite("gravity_scale", gravity_scale)?;
        if gravity_scale != S::one() && self.ball_forces.gravity_scales.len() <= slot {
            self.ball_forces.gravity_scales.resize(slot + 1, S::one());
        }
        if let Some(scale) = self.ball_forces.gravity_scales.get_mut(slot) {
            *scale = gravity_scale;
        }
        Ok(())
    }

    /// Accelerates a ball in m/s² throughout the next [`World::step`](crate::world::World::step), besides
    /// gravity. Accelerations of one ball add up. Wakes it in that step if it is accelerated in another
    /// way than in the last one.
    ///
    /// # Errors
    /// [`Error::NoSuchBall`], also for a marble's; [`Error::NotFinite`].
    pub fn apply_acceleration(&mut self, ball: BallId, acceleration: Vec3<S>) -> Result<(), Error> {
        self.own_slot(ball)?;
        let names = ["acceleration.x", "acceleration.y", "acceleration.z"];
        self.ball_forces.accelerations.push((ball, finite_vector(names, acceleration)?));
        Ok(())
    }

    /// Clears all applied accelerations.
    pub(crate) fn clear_accelerations(&mut self) {
        self.ball_forces.accelerations.clear();
    }

    /// Changes of velocity by applied accelerations in a step of `dt` seconds.
    pub(crate) fn applied_changes(&self, dt: S) -> impl Iterator<Item = VelocityChange<S>> + '_ {
        self.ball_forces.accelerations.iter().filter_map(move |(ball, acceleration)| {
            Some(VelocityChange { slot: self.slot_of(*ball)?, change: (acceleration * dt).into() })
        })
    }

    /// Drops the settings of a slot, as its ball goes.
    pub(super) fn forget_settings(&mut self, slot: u32) {
        self.surfaces.set(slot, None);
        self.surfaces.set_layers(slot, CollisionLayers::ALL);
        self.surfaces.set_kinematic(slot, false);
        self.sleep.sleepless.remove(slot);
        if let Some(scale) = self.ball_forces.gravity_scales.get_mut(slot as usize) {
            *scale = S::one();
        }
    }

    /// Slot of a ball that is no marble.
    pub(super) fn own_slot(&self, ball: BallId) -> Result<u32, Error> {
        let slot = self.slot_of(ball).ok_or(Error::NoSuchBall(ball))?;
        if self.body_slots.contains(slot) { Err(Error::NoSuchBall(ball)) } else { Ok(slot) }
    }

    /// Changes of velocity by force fields, of which the acceleration is given for a motion and a
    /// mass, and by gravity scales, in a step of `dt` seconds, for all balls that are no marbles.
    /// None where there are neither.
    pub(crate) fn field_changes(
        &self,
        acceleration: Option<impl Fn(Motion<S>, S) -> Vec3<S> + Sync>,
        gravity: Vec3<S>,
        dt: S,
    ) -> Vec<VelocityChange<S>> {
        if acceleration.is_none() && self.ball_forces.gravity_scales.is_empty() {
            return Vec::new();
        }
        let rows = self.ids.rows();
        let none = VelocityChange { slot: 0, change: [S::zero(); 3] };
        let mut changes = vec![none; rows.len()];
        let parts = DisjointSlice::new(&mut changes);
        parallel_for_rows(self.scratch.threads, rows.len(), |slots| {
            // SAFETY: each job has its own slots.
            let part = unsafe { parts.part(slots.clone()) };
            for (slot, change) in slots.zip(part) {
                let (row, slot) = (rows[slot] as usize, slot as u32);
                let (Some(&[x, y, z, _]), Some(&[u, v, w, inverse_mass])) =
                    (self.at.get(row), self.velocity.get(row))
                else {
                    continue; // nobody has the slot
                };
                let motion =
                    Motion { position: Point3::new(x, y, z), velocity: Vec3::new(u, v, w) };
                let scale =
                    self.ball_forces.gravity_scales.get(slot as usize).copied().unwrap_or(S::one());
                let fields = acceleration.as_ref().map_or_else(Vec3::zero, |acceleration| {
                    acceleration(motion, inverse_mass.abs().recip())
                });
                if !self.body_slots.contains(slot) {
                    let numbers = ((gravity * (scale - S::one()) + fields) * dt).into();
                    *change = VelocityChange { slot, change: numbers };
                }
            }
        });
        changes.retain(|change| change.change != [S::zero(); 3]);
        changes
    }
}
