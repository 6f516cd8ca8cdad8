//! Balls that the last solve of a step made too fast: the next step would stop them, but until then
//! their velocities and what is remembered of their contacts are no numbers.

use std::sync::atomic::{AtomicBool, Ordering};

use super::super::Swarm;
use super::super::kernels::{MAX_MAGNITUDE, largest};
use super::super::wall_contact::WallContact;
use crate::math::Scalar;
use crate::workers::{DisjointSlice, parallel_for};

impl<S: Scalar> Swarm<S> {
    /// Stops balls that the last solve of a step gave a velocity or a spin that is no number, or too
    /// large a one, and forgets impulses that are no numbers.
    pub(super) fn stop_what_overflowed(&mut self) {
        let [velocity, spin] =
            [&mut self.velocity, &mut self.spin].map(|it| DisjointSlice::new(it));
        let (chunks, any) = (DisjointSlice::new(&mut self.chunks), AtomicBool::new(false));
        parallel_for(self.scratch.threads, chunks.len(), |_, chunk| {
            // SAFETY: each thread has its own chunks.
            let chunk = unsafe { &mut *chunks.row(chunk) };
            if chunk.asleep {
                return;
            }
            // SAFETY: each chunk has its own rows.
            let [velocity, spin] = [velocity, spin].map(|it| unsafe { it.part(chunk.own_rows()) });
            for (row, (velocity, spin)) in (chunk.rows[0]..).zip(velocity.iter_mut().zip(spin)) {
                if !(largest(*velocity) < S::from_f64(MAX_MAGNITUDE)
                    && largest(*spin) < S::from_f64(MAX_MAGNITUDE))
                {
                    *velocity = [S::zero(), S::zero(), S::zero(), velocity[3]];
                    *spin = [S::zero(), S::zero(), S::zero(), spin[3]];
                    chunk.stopped.push(row);
                    any.store(true, Ordering::Relaxed);
                }
            }
        });
        if any.into_inner() {
            for chunk in &mut self.chunks {
                chunk.impulses.forget_non_finite();
                chunk.wall_contacts.iter_mut().for_each(WallContact::forget_non_finite);
            }
        }
    }
}
