//! All of a swarm, field by field: its bytes, and whether two will go on alike.

use super::lanes::Row;
use super::pairs::Search;
use super::slab::Slab;
use super::{Swarm, SwarmModel};

impl Swarm {
    /// Bytes that it has from the allocator, without those of threads.
    #[must_use]
    pub fn bytes(&self) -> usize {
        fn of<T>(column: &Vec<T>) -> usize {
            column.capacity() * size_of::<T>()
        }
        // All are named, so that none is left out.
        let Self {
            model: _,
            instructions: _,
            ids,
            at,
            velocity,
            spin,
            backing,
            budget,
            way,
            largest: _,
            mean: _,
            cap: _,
            grid,
            slabs,
            strays,
            leaving,
            ways,
            memory,
            before,
            remembers: _,
            paired: _,
            walled: _,
            gravity: _,
            planes,
            stopped,
            invited,
            hosting: _,
            pushes,
            surfaces,
            synced: _,
            guests,
            guest_rows,
            kept_guests,
            guest_slots,
            spare,
            lists,
            slab_states,
            searches,
            rebuilds: _,
            steps_since_build: _,
            spread: _,
        } = self;
        let rows = [at, velocity, spin, backing, spare].map(of);
        let numbers = [budget, way, ways].map(of);
        let names = [leaving, before, stopped, slab_states].map(of);
        rows.into_iter().chain(numbers).chain(names).sum::<usize>()
            + (of(slabs) + slabs.iter().map(Slab::bytes).sum::<usize>())
            + (of(searches) + searches.iter().map(Search::bytes).sum::<usize>())
            + (of(lists) + lists.iter().map(of).sum::<usize>())
            + (of(planes) + of(invited) + of(guests) + of(guest_rows) + of(guest_slots))
            + (of(kept_guests) + of(pushes) + surfaces.bytes())
            + (ids.bytes() + grid.bytes() + memory.bytes() + strays.bytes())
    }
}

impl PartialEq for Swarm {
    /// Equal if they will go on alike, bit by bit: what is only scribbled on does not count, nor do
    /// threads and instructions.
    fn eq(&self, other: &Self) -> bool {
        // All are named, so that none is left out.
        let Self {
            model,
            instructions: _,
            ids,
            at,
            velocity,
            spin,
            backing: _,
            budget,
            way,
            largest,
            mean,
            cap,
            grid,
            slabs,
            strays,
            leaving: _,
            ways: _,
            memory,
            before,
            remembers,
            paired,
            walled,
            gravity,
            planes,
            stopped,
            invited,
            hosting,
            pushes,
            surfaces,
            synced: _,
            guests,
            guest_rows: _,
            kept_guests: _,
            guest_slots,
            spare,
            lists: _,
            slab_states: _,
            searches: _,
            rebuilds,
            steps_since_build,
            spread,
        } = self;
        let alone = |model: SwarmModel| SwarmModel { threads: 1, ..model };
        // The fans are in it.
        let fans = |spare| bytemuck::cast_slice::<Row, u32>(spare);
        (alone(*model), ids, gravity) == (alone(other.model), &other.ids, &other.gravity)
            && (at, velocity, spin) == (&other.at, &other.velocity, &other.spin)
            && (budget, way, before) == (&other.budget, &other.way, &other.before)
            && (largest, mean, spread) == (&other.largest, &other.mean, &other.spread)
            && *cap == other.cap
            && (grid, slabs, strays) == (&other.grid, &other.slabs, &other.strays)
            && (self.rough() || fans(spare) == fans(&other.spare))
            && (remembers, paired) == (&other.remembers, &other.paired)
            && (!remembers || *memory == other.memory)
            && (walled, planes) == (&other.walled, &other.planes)
            && (invited, guests) == (&other.invited, &other.guests)
            && (hosting, pushes, surfaces) == (&other.hosting, &other.pushes, &other.surfaces)
            && (guest_slots, stopped) == (&other.guest_slots, &other.stopped)
            && (rebuilds, steps_since_build) == (&other.rebuilds, &other.steps_since_build)
    }
}
