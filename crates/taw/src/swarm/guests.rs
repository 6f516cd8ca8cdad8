//! Balls that belong to somebody else, who moves them: the marbles of the world.

use super::{BallId, Row, Swarm};

/// A ball that the swarm pushes but does not move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Guest {
    pub ball: BallId,
    /// Center and radius in metres; velocity in m/s and inverse mass in 1/kg; radius times spin.
    pub at: Row,
    pub velocity: Row,
    pub rim: Row,
}

impl Swarm {
    /// What became of the guests in the last step, in the order of [`host`](Self::host).
    pub(crate) fn hosted(&self) -> impl Iterator<Item = (&Guest, Guest)> {
        self.guests.iter().map(|guest| {
            let Some(row) = self.ids.row(guest.ball) else { return (guest, *guest) };
            let rim = self.spin.get(row).copied().unwrap_or([0.0; 4]);
            let after = Guest { at: self.at[row], velocity: self.velocity[row], rim, ..*guest };
            (guest, after)
        })
    }

    /// Says where the guests are now. Each of them is a ball of the swarm.
    pub(crate) fn host(&mut self, guests: impl IntoIterator<Item = Guest>) {
        self.guests.clear();
        self.guests.extend(guests);
        self.guest_slots.clear();
        self.guest_slots.resize(self.ids.slots().len().div_ceil(64), 0);
        let guests = std::mem::take(&mut self.guests);
        for guest in &guests {
            let Some(row) = self.ids.row(guest.ball) else { continue };
            let slot = self.ids.slots()[row] as usize;
            if self.guest_slots.len() <= slot / 64 {
                self.guest_slots.resize(slot / 64 + 1, 0);
            }
            self.guest_slots[slot / 64] |= 1 << (slot % 64);
            let [x, y, z, _] = self.at[row];
            let [a, b, c, _] = guest.at;
            let way = super::kernels::squared([a - x, b - y, c - z, 0.0]).sqrt();
            self.budget[row] -= way;
            if way > 0.0 && self.velocity[row][3] < 0.0 {
                self.wake(row);
            }
            let awake = self.velocity[row][3] >= 0.0;
            self.at[row] = guest.at;
            self.largest = self.largest.max(guest.at[3]);
            self.velocity[row] = guest.velocity;
            if !awake {
                self.velocity[row][3] = -guest.velocity[3];
            }
            if let Some(spin) = self.spin.get_mut(row) {
                *spin = guest.rim;
            }
        }
        self.guests = guests;
    }

    /// Lists the rows of the guests, in order.
    pub(super) fn find_guests(&mut self) {
        self.guest_rows.clear();
        let rows = self.guests.iter().zip(0..);
        let rows = rows.filter_map(|(guest, i)| Some((self.ids.row(guest.ball)? as u32, i)));
        self.guest_rows.extend(rows);
        self.guest_rows.sort_unstable();
    }

    /// The guest in a row, among those that were listed.
    pub(super) fn guest_at<'a>(
        guests: &'a [Guest],
        guest_rows: &[(u32, u32)],
        row: u32,
    ) -> Option<&'a Guest> {
        let at = guest_rows.binary_search_by_key(&row, |(row, _)| *row).ok()?;
        guests.get(guest_rows[at].1 as usize)
    }

    pub(super) fn has_guest_slot(slot: u32, guest_slots: &[u64]) -> bool {
        let bits = guest_slots.get(slot as usize / 64);
        bits.is_some_and(|bits| bits >> (slot % 64) & 1 == 1)
    }

    /// Names new guests.
    pub(crate) fn invite(&mut self, count: usize) -> Result<Vec<BallId>, crate::Error> {
        let position = crate::math::Point3::new(0.0, 0.0, 0.0);
        self.add(&vec![super::Ball::new(position, super::RADII[0]); count])
    }

    /// Undoes what a drift did to the guests: a change of velocity, and that they moved by the
    /// velocity that they came with. By what the swarm has changed of it they move as its balls do,
    /// so that a push moves no center of mass.
    pub(super) fn hold_guests(&mut self, change: Row, time: f32) {
        for guest in &self.guests {
            let Some(row) = self.ids.row(guest.ball) else { continue };
            let rows = self.velocity[row].iter_mut().zip(&mut self.at[row]);
            for ((velocity, at), (change, own)) in
                rows.zip(change.iter().zip(guest.velocity)).take(3)
            {
                *velocity -= change;
                *at -= own * time;
            }
        }
    }

    /// The same for the lab's tier, where the velocity is the place before.
    pub(super) fn hold_guests_in_lab(&mut self) {
        for guest in &self.guests {
            let Some(row) = self.ids.row(guest.ball) else { continue };
            self.at[row] = guest.at;
            let [x, y, z, _] = guest.at;
            self.velocity[row] = [x, y, z, guest.velocity[3]];
            self.way[row] = 0.0;
        }
    }

    /// Gives the guests their velocities back, but for what is against the way that they were
    /// pushed.
    pub(super) fn part_with_guests_in_lab(&mut self, dt: f32) {
        for guest in &self.guests {
            let Some(row) = self.ids.row(guest.ball) else { continue };
            let ([x, y, z, _], [a, b, c, _]) = (self.at[row], guest.at);
            let push = [x - a, y - b, z - c];
            let [u, v, w, mass] = guest.velocity;
            let against = -(u * push[0] + v * push[1] + w * push[2]);
            let squared = push[0] * push[0] + push[1] * push[1] + push[2] * push[2];
            let part = if squared > 0.0 { (against / squared).clamp(0.0, 1.0 / dt) } else { 0.0 };
            self.velocity[row] = [u + push[0] * part, v + push[1] * part, w + push[2] * part, mass];
        }
    }
}
