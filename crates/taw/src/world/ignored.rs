//! Pairs that pass through each other.

use super::one_way::OneWayState;
use super::{ColliderId, MarbleId, Marbles, World};
use crate::Error;
use crate::broad::{CollisionFilter, IgnoredPairs};
use crate::math::Scalar;
use crate::swarm::Swarm;

impl<S: Scalar> Marbles<S> {
    /// Sets the marbles and walls that a marble passes through, whatever their layers: a pair passes
    /// if one of the two names the other. Handles that are not there, or not yet, do no harm. An empty
    /// list is the default.
    ///
    /// Rigid bodies, balls of the [swarm](World::swarm), sensors and queries do not go by it. The steps look at all
    /// pairs that are named.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn set_ignored(&mut self, id: MarbleId, ignored: &[ColliderId]) -> Result<(), Error> {
        let row = self.row(id)?;
        if ignored.is_empty() {
            self.ignored.remove(&id);
        } else {
            self.ignored.insert(id, ignored.to_vec());
        }
        self.ignored_rows.found_at = None;
        self.disturb(row);
        Ok(())
    }

    /// Marbles and walls that a marble passes through, as they were set.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn ignored(&self, id: MarbleId) -> Result<&[ColliderId], Error> {
        self.row(id)?;
        Ok(self.ignored.get(&id).map_or(&[], Vec::as_slice))
    }

    /// Marbles that name others to pass through, sorted.
    pub fn ignoring(&self) -> impl Iterator<Item = MarbleId> + '_ {
        self.ignored.keys().copied()
    }

    /// Collision filter of a marble.
    #[inline]
    pub(super) fn filter_of_row(&self, row: usize) -> CollisionFilter<'_> {
        let ignored = self.ignored_rows.walls_of(row as u32);
        CollisionFilter { layers: self.layers_of_row(row), ignored }
    }

    /// Returns true if two marbles collide with each other.
    #[inline]
    pub(super) fn may_collide(&self, a: u32, b: u32) -> bool {
        let layers = |row: u32| self.layers_of_row(row as usize);
        (self.own.layers.is_empty() || layers(a).interacts_with(layers(b)))
            && !self.ignored_rows.has_balls(a, b)
    }
}

impl<S: Scalar> World<S> {
    /// Returns true if a marble collides with another marble, a wall or a body where they meet: their layers
    /// interact, none of the two [names the other](Marbles::set_ignored), no joint keeps them apart, and it is no
    /// [one-way wall](super::Walls::set_one_way) that let the marble pass in the last substep. A marble
    /// does not collide with itself.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::NoSuchWall`], [`Error::NoSuchBody`].
    pub fn may_collide(&self, marble: MarbleId, other: ColliderId) -> Result<bool, Error> {
        let own = ColliderId::Marble(marble);
        let interact = self.layers(own)?.interacts_with(self.layers(other)?);
        let names = |id, other| self.marbles.ignored(id).is_ok_and(|them| them.contains(&other));
        let passes = match other {
            ColliderId::Marble(id) => id == marble || names(id, own) || names(marble, other),
            ColliderId::Wall(wall) => self.lets_pass(wall, marble) || names(marble, other),
            ColliderId::Body(_) => false,
        };
        Ok(interact && !passes && !self.joints.ignores(marble, other))
    }

    /// Finds the rows of the pairs that pass through each other: those that are named, and those of
    /// one-way walls and what these let through. Each verb begins with it: the user may have named others
    /// before, or taken some out.
    pub(super) fn find_ignored_rows(&mut self) {
        let (marbles, walls) = (&self.marbles, &self.walls);
        let counts = [marbles.len() as u64, walls.len() as u64];
        let versions = [marbles.removals(), walls.removals(), *self.joints.version];
        let now = Some((counts, versions));
        if self.marbles.ignored_rows.found_at == now {
            return;
        }
        let (mut of_marbles, mut of_walls) = (Vec::new(), Vec::new());
        for (id, ignored) in &self.marbles.ignored {
            let Ok(row) = self.marbles.row(*id) else { continue };
            for other in ignored {
                let (pairs, other) = match *other {
                    ColliderId::Marble(other) => (&mut of_marbles, self.marbles.row(other)),
                    ColliderId::Wall(wall) => (&mut of_walls, self.walls.row(wall)),
                    ColliderId::Body(_) => continue,
                };
                pairs.extend(other.map(|other| [row as u32, other as u32]));
            }
        }
        for pair in self.joints.ignored_pairs() {
            if let [Ok(a), Ok(b)] = pair.map(|id| self.marbles.row(id)) {
                of_marbles.push([a as u32, b as u32]);
            }
        }
        for OneWayState { wall, marble, .. } in self.memory.one_way.iter().filter(|it| !it.held) {
            if let (Ok(marble), Ok(wall)) = (self.marbles.row(*marble), self.walls.row(*wall)) {
                of_walls.push([marble as u32, wall as u32]);
            }
        }
        let found = IgnoredPairs::new(of_marbles, of_walls);
        *self.marbles.ignored_rows = IgnoredPairs { found_at: now, ..found };
    }

    /// Gives the swarm the pairs that pass through each other.
    pub(super) fn sync_ignored_pairs(&mut self) {
        self.find_ignored_rows();
        let (marbles, swarm) = (&self.marbles, &self.swarm);
        let slot = |row: u32| slot_of(marbles, swarm, row);
        let IgnoredPairs { balls, walls, .. } = &*marbles.ignored_rows;
        let balls = balls.iter().filter_map(|[a, b]| Some([slot(*a)?, slot(*b)?])).collect();
        let walls = walls.iter().filter_map(|[row, wall]| Some([slot(*row)?, *wall])).collect();
        self.swarm.set_ignored(IgnoredPairs::new(balls, walls));
    }
}

/// Slot of the ball of a marble.
fn slot_of<S: Scalar>(marbles: &Marbles<S>, swarm: &Swarm<S>, row: u32) -> Option<u32> {
    let id = marbles.id(row as usize)?;
    let body = swarm.body_balls.binary_search_by_key(&id, |(marble, _)| *marble).ok()?;
    swarm.slot_of(swarm.body_balls[body].1)
}
