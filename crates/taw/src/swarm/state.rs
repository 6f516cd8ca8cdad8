//! All of a swarm, field by field: its bytes, and whether two will go on alike.

use super::chunk::Chunk;
use super::{Swarm, SwarmModel};
use crate::math::{Row, Scalar};

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
        let rows = [at, velocity, spin, neighbours].map(of);
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

/// Bytes of a column.
pub(super) fn of<T>(column: &Vec<T>) -> usize {
    column.capacity() * size_of::<T>()
}

impl<S: Scalar> PartialEq for Swarm<S> {
    /// Equal if they will go on alike, bit by bit: scratch does not count, nor do
    /// threads and instructions.
    fn eq(&self, other: &Self) -> bool {
        // All are named, so that none is left out.
        let Self {
            model,
            simd_level: _,
            ids,
            at,
            velocity,
            spin,
            skin_left,
            displacement,
            max_radius,
            mean_radius,
            skin,
            grid,
            chunks,
            fast_movers,
            impulse_cache,
            old_rows,
            cache_valid,
            pairs_valid,
            walls_identity,
            rows_of_walls: _,
            gravity,
            planes,
            stopped,
            body_balls,
            bodies_are_rows,
            velocity_changes,
            surfaces,
            ball_forces,
            synced: _,
            proxies,
            body_slots,
            sleep,
            sleep_version: _,
            neighbours,
            scratch: _,
            rebuilds,
            steps_since_build,
            skin_scale,
        } = self;
        let alone = |model: SwarmModel<S>| SwarmModel { threads: 1, ..model };
        // As bits: most are no numbers.
        let bits = |neighbours| bytemuck::cast_slice::<Row<S>, u32>(neighbours);
        (alone(*model), ids, gravity) == (alone(other.model), &other.ids, &other.gravity)
            && (at, velocity, spin) == (&other.at, &other.velocity, &other.spin)
            && (skin_left, displacement, old_rows)
                == (&other.skin_left, &other.displacement, &other.old_rows)
            && (max_radius, mean_radius, skin_scale)
                == (&other.max_radius, &other.mean_radius, &other.skin_scale)
            && (skin, rebuilds) == (&other.skin, &other.rebuilds)
            && (grid, chunks, fast_movers) == (&other.grid, &other.chunks, &other.fast_movers)
            && (self.has_friction() || bits(neighbours) == bits(&other.neighbours))
            && (cache_valid, pairs_valid) == (&other.cache_valid, &other.pairs_valid)
            && (!cache_valid || *impulse_cache == other.impulse_cache)
            && (planes, body_balls, proxies) == (&other.planes, &other.body_balls, &other.proxies)
            && (bodies_are_rows, velocity_changes, surfaces)
                == (&other.bodies_are_rows, &other.velocity_changes, &other.surfaces)
            && (ball_forces, stopped) == (&other.ball_forces, &other.stopped)
            && (body_slots, sleep) == (&other.body_slots, &other.sleep)
            && walls_identity.is_some() == other.walls_identity.is_some()
            && *steps_since_build == other.steps_since_build
    }
}
