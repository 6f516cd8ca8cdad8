//! Surfaces and collision layers of balls that differ, and the numbers that two of them make of a contact.

use super::batches::Batch;
use super::bit_set::BitSet;
use crate::broad::{CollisionFilter, CollisionLayers, IgnoredPairs};
use crate::math::{LANES, Scalar};
use crate::motion::{BALL_INVERSE_INERTIA, LockedAxes};
use crate::response::Material;
use crate::uncompared::Uncompared;

/// Surface of a ball: its material, and how contacts can move it and set it spinning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BallSurface<S> {
    pub material: Material<S>,
    pub rotation_locked: bool,
    /// Axes of the world that it neither moves along nor turns about.
    pub locked_axes: LockedAxes,
}

impl<S: Scalar> BallSurface<S> {
    /// Surface of a ball that contacts move and spin.
    pub fn free(material: Material<S>) -> Self {
        Self { material, rotation_locked: false, locked_axes: LockedAxes::NONE }
    }

    /// Mass times radius squared over the moment of inertia; zero where the rotation is locked.
    fn inertia_factor(self) -> S {
        if self.rotation_locked { S::zero() } else { S::from_f64(BALL_INVERSE_INERTIA) }
    }
}

/// Surfaces and layers of all balls. Most have the surface of the swarm's model and all layers, which
/// takes no memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Surfaces<S> {
    /// Different ones, in the order in which they came.
    list: Vec<BallSurface<S>>,
    /// Number of slots of each.
    counts: Vec<u32>,
    /// One more than the place in the list, by slot; zero for the model's surface.
    of_slot: Vec<u32>,
    /// Layers, by slot; all beyond the end.
    layers: Vec<CollisionLayers>,
    /// Pairs of marbles' slots, and of those with walls, that pass through each other.
    pub ignored: Uncompared<IgnoredPairs>,
    /// Slots of marbles with locked axes.
    locked: BitSet,
    /// Slots of kinematic marbles, whose mass is infinite: they pass through walls and each other.
    kinematic: BitSet,
}

impl<S: Scalar> Surfaces<S> {
    /// Changes the layers of a slot. Returns whether it had others.
    pub fn set_layers(&mut self, slot: u32, layers: CollisionLayers) -> bool {
        let slot = slot as usize;
        if self.layers.len() <= slot {
            if layers == CollisionLayers::ALL {
                return false;
            }
            self.layers.resize(slot + 1, CollisionLayers::ALL);
        }
        std::mem::replace(&mut self.layers[slot], layers) != layers
    }

    /// Makes a slot kinematic or not. Returns whether it was otherwise.
    pub fn set_kinematic(&mut self, slot: u32, is_kinematic: bool) -> bool {
        if is_kinematic { self.kinematic.insert(slot) } else { self.kinematic.remove(slot) }
    }

    /// Slots of kinematic marbles, in order.
    pub fn kinematic(&self) -> impl Iterator<Item = u32> + '_ {
        self.kinematic.iter()
    }

    /// Returns true for a kinematic marble.
    #[inline]
    pub fn is_kinematic(&self, slot: u32) -> bool {
        self.kinematic.contains(slot)
    }

    /// Slots of marbles with locked axes, in order, and these.
    pub fn locked(&self) -> impl Iterator<Item = (u32, LockedAxes)> + '_ {
        self.locked.iter().filter_map(|slot| Some((slot, self.get(slot)?.locked_axes)))
    }

    /// Layers of a slot.
    #[inline]
    pub fn layers(&self, slot: u32) -> CollisionLayers {
        self.layers.get(slot as usize).copied().unwrap_or_default()
    }

    /// Gives a slot a surface of its own, or that of the model. Returns whether it had another.
    pub fn set(&mut self, slot: u32, surface: Option<BallSurface<S>>) -> bool {
        let index = surface.map_or(0, |surface| {
            let known = self.list.iter().rposition(|known| *known == surface);
            let index = known.unwrap_or_else(|| {
                let unused = self.counts.iter().position(|count| *count == 0);
                let index = unused.unwrap_or(self.list.len());
                self.list.resize(self.list.len().max(index + 1), surface);
                self.counts.resize(self.list.len(), 0);
                self.list[index] = surface;
                index
            });
            index as u32 + 1
        });
        if surface.is_some_and(|surface| !surface.locked_axes.is_empty()) {
            self.locked.insert(slot);
        } else {
            self.locked.remove(slot);
        }
        let slot = slot as usize;
        if index == 0 && slot >= self.of_slot.len() {
            return false;
        }
        if self.of_slot.len() <= slot {
            self.of_slot.resize(slot + 1, 0);
        }
        let before = std::mem::replace(&mut self.of_slot[slot], index);
        for (index, more) in [(before, false), (index, true)] {
            if let Some(count) =
                (index as usize).checked_sub(1).and_then(|i| self.counts.get_mut(i))
            {
                *count = if more { *count + 1 } else { *count - 1 };
            }
        }
        before != index
    }

    /// Surface of a slot; none for that of the model.
    pub fn get(&self, slot: u32) -> Option<BallSurface<S>> {
        let index = *self.of_slot.get(slot as usize)?;
        self.list.get((index as usize).checked_sub(1)?).copied()
    }

    /// Material of all balls, where they have one in common, and nobody's rotation or axes are
    /// locked.
    pub fn common(&self, model: Material<S>, balls: usize) -> Option<Material<S>> {
        let used = || self.counts.iter().zip(&self.list).filter(|(count, _)| **count > 0);
        match used().next() {
            None => Some(model),
            Some((count, surface)) => {
                let is_plain = !surface.rotation_locked && surface.locked_axes.is_empty();
                let all = *count as usize == balls && is_plain;
                all.then_some(surface.material)
            }
        }
    }

    pub fn bytes(&self) -> usize {
        self.list.capacity() * size_of::<BallSurface<S>>()
            + (self.counts.capacity() + self.of_slot.capacity()) * size_of::<u32>()
            + self.layers.capacity() * size_of::<CollisionLayers>()
            + (self.ignored.bytes() + self.kinematic.bytes() + self.locked.bytes())
    }
}

/// Lookup of surfaces by row.
#[derive(Clone, Copy)]
pub(super) struct SurfaceOf<'a, S> {
    pub model: Material<S>,
    pub surfaces: &'a Surfaces<S>,
    /// Slot of each row.
    pub slots: &'a [u32],
}

impl<S: Scalar> SurfaceOf<'_, S> {
    /// Surface of the ball in a row.
    #[inline]
    pub fn row(&self, row: u32) -> BallSurface<S> {
        let own = || self.surfaces.get(self.slots[row as usize]);
        let plain = BallSurface::free(self.model);
        if self.surfaces.list.is_empty() { plain } else { own().unwrap_or(plain) }
    }

    /// Locked axes of the ball in a row.
    #[inline]
    pub fn locked_axes(&self, row: u32) -> LockedAxes {
        if self.surfaces.locked.is_empty() { LockedAxes::NONE } else { self.row(row).locked_axes }
    }

    /// True if some balls may not collide with all others.
    #[inline]
    pub fn have_filters(&self) -> bool {
        self.has_layers()
            || !self.surfaces.ignored.is_empty()
            || !self.surfaces.kinematic.is_empty()
    }

    #[inline]
    fn is_kinematic(&self, row: u32) -> bool {
        self.surfaces.is_kinematic(self.slots[row as usize])
    }

    /// True if a ball may have layers other than all.
    #[inline]
    pub fn has_layers(&self) -> bool {
        !self.surfaces.layers.is_empty()
    }

    /// Layers of the ball in a row.
    #[inline]
    pub fn layers(&self, row: u32) -> CollisionLayers {
        if self.has_layers() {
            self.surfaces.layers(self.slots[row as usize])
        } else {
            CollisionLayers::ALL
        }
    }

    /// Collision filter of the ball in a row, for walls.
    #[inline]
    pub fn filter(&self, row: u32) -> CollisionFilter<'_> {
        let ignored = &self.surfaces.ignored;
        let ignored =
            if ignored.is_empty() { &[] } else { ignored.walls_of(self.slots[row as usize]) };
        let layers = if self.is_kinematic(row) { CollisionLayers::NONE } else { self.layers(row) };
        CollisionFilter { layers, ignored }
    }

    /// Returns true if the balls in two rows collide with each other.
    #[inline]
    pub fn may_collide(&self, a: u32, b: u32) -> bool {
        let is_ignored = || {
            let ignored = &self.surfaces.ignored;
            let slot = |row: u32| self.slots[row as usize];
            !ignored.is_empty() && ignored.has_balls(slot(a), slot(b))
        };
        let both_kinematic = || self.is_kinematic(a) && self.is_kinematic(b);
        let meet = !self.has_layers() || self.layers(a).interacts_with(self.layers(b));
        meet && !is_ignored() && !both_kinematic()
    }

    /// True if pairs need numbers of their own.
    pub fn differ(&self) -> bool {
        self.surfaces.common(self.model, self.slots.len()).is_none_or(|common| {
            common.rolling_resistance > S::zero()
                || common.spinning_resistance > S::zero()
                || common.tangential_restitution != S::zero()
        })
    }

    /// Fills in the numbers of the pairs of some batches; none, if all balls have one surface that
    /// resists neither rolling nor spinning and has no tangential restitution.
    pub fn of_pairs(&self, batches: &[Batch], numbers: &mut Vec<PairNumbers<S>>) {
        numbers.clear();
        if !self.differ() {
            return;
        }
        numbers.extend(batches.iter().map(|batch| {
            let mut numbers = PairNumbers::default();
            for lane in 0..batch.count as usize {
                numbers.set(lane, batch.pair(lane).map(|row| self.row(row)));
            }
            numbers
        }));
    }
}

/// Numbers of the contacts of a batch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PairNumbers<S> {
    pub friction: [S; LANES],
    pub restitution: [S; LANES],
    pub tangential_restitution: [S; LANES],
    pub rolling_resistance: [S; LANES],
    pub spinning_resistance: [S; LANES],
    /// Mass times radius squared over the moment of inertia of both; zero where locked.
    pub inertia_factors: [[S; LANES]; 2],
}

impl<S: Scalar> PairNumbers<S> {
    fn set(&mut self, lane: usize, [a, b]: [BallSurface<S>; 2]) {
        let material = a.material.combined_with(b.material);
        self.friction[lane] = material.friction;
        self.restitution[lane] = material.restitution;
        self.tangential_restitution[lane] = material.tangential_restitution;
        self.rolling_resistance[lane] = material.rolling_resistance;
        self.spinning_resistance[lane] = material.spinning_resistance;
        let factors = [a, b].map(BallSurface::inertia_factor);
        for (lanes, factor) in self.inertia_factors.iter_mut().zip(factors) {
            lanes[lane] = factor;
        }
    }
}

/// Numbers of the contact of a ball with a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WallNumbers<S> {
    pub friction: S,
    pub restitution: S,
    pub tangential_restitution: S,
    pub rolling_resistance: S,
    pub spinning_resistance: S,
    /// Mass times radius squared over the moment of inertia of the ball; zero where locked.
    pub inertia_factor: S,
    /// Locked axes of the ball.
    pub locked_axes: LockedAxes,
}

impl<S: Scalar> WallNumbers<S> {
    /// Numbers of a ball on a wall, which may have a material of its own.
    pub fn new(ball: BallSurface<S>, wall: Option<Material<S>>) -> Self {
        let material = ball.material.on_wall(wall);
        Self {
            friction: material.friction,
            restitution: material.restitution,
            tangential_restitution: material.tangential_restitution,
            rolling_resistance: material.rolling_resistance,
            spinning_resistance: material.spinning_resistance,
            inertia_factor: ball.inertia_factor(),
            locked_axes: ball.locked_axes,
        }
    }
}
