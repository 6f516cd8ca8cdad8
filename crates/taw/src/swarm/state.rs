//! Memory of a swarm, field by field, the threads of a step, and the walls that a swarm knows.

use super::Swarm;
use super::chunk::Chunk;
use crate::math::Scalar;

impl<S: Scalar> Swarm<S> {
    /// Number of threads that work on this step: of the last model until the first step begins.
    pub(crate) fn threads(&self) -> usize {
        self.scratch.threads.max(1)
    }

    /// Bytes that it has from the allocator, without those of threads.
    #[must_use]
    pub fn bytes(&self) -> usize {
        // All are named, so that none is left out.
        let Self {
            model: _,
            threads_of_model: _,
            simd_level: _,
            ids,
            at,
            velocity,
            spin,
            skin_left,
            displacement,
            max_radius: _,
            mean_radius: _,
            skin: _,
            grid,
            chunks,
            fast_movers,
            impulse_cache,
            old_rows,
            cache_valid: _,
            pairs_valid: _,
            walls_identity: _,
            rows_of_walls: _,
            gravity: _,
            planes,
            stopped,
            body_balls,
            bodies_are_rows: _,
            velocity_changes,
            surfaces,
            ball_forces,
            synced: _,
            proxies,
            body_slots,
            sleep,
            sleep_version: _,
            neighbours,
            scratch,
            rebuilds: _,
            steps_since_build: _,
            skin_scale: _,
        } = self;
        let rows = [at, velocity, spin, &neighbours.0].map(of);
        let numbers = [skin_left, displacement].map(of);
        let names = [old_rows, stopped].map(of);
        rows.into_iter().chain(numbers).chain(names).sum::<usize>()
            + (of(chunks) + chunks.iter().map(Chunk::bytes).sum::<usize>())
            + (of(planes) + of(body_balls) + of(proxies))
            + (body_slots.bytes() + sleep.bytes())
            + (of(velocity_changes) + surfaces.bytes() + ball_forces.bytes())
            + (ids.bytes() + grid.bytes() + impulse_cache.bytes() + fast_movers.bytes())
            + scratch.bytes()
    }
}

/// Identity of the walls that a swarm knows, if it knows them. Two are equal if both know theirs:
/// identities tell changes of one world apart.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct KnownIdentity(pub Option<u64>);

impl PartialEq for KnownIdentity {
    fn eq(&self, other: &Self) -> bool {
        self.0.is_some() == other.0.is_some()
    }
}

/// Bytes of a column.
pub(super) fn of<T>(column: &Vec<T>) -> usize {
    column.capacity() * size_of::<T>()
}
