//! Log of where walls changed.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::math::Scalar;
use crate::shape::Aabb3;

/// Changes kept at most; of more than that since a solver looked, the last one stands for the rest.
/// A reader that is further behind takes all walls for changed.
const MAX_CHANGES: usize = 1024;

/// Regions in which walls changed, in order. Two are equal if a solver knows of all changes, or has
/// some to learn of, in both.
#[derive(Clone, Debug, Default)]
pub(super) struct WallChanges<S> {
    /// Identity of the walls before the first change of the log.
    base: u64,
    log: VecDeque<Change<S>>,
    /// Identity of the walls when a solver last looked at them.
    seen: u64,
}

/// Change of a wall.
#[derive(Clone, Copy, Debug)]
struct Change<S> {
    /// Identity of the walls after the change.
    identity: u64,
    /// None for one without bounds.
    region: Option<Aabb3<S>>,
    /// Row of a wall that was removed, and the row whose wall moved there.
    removed: Option<[u32; 2]>,
}

impl<S: PartialEq> PartialEq for WallChanges<S> {
    /// Equal if what changed since a solver looked is.
    fn eq(&self, other: &Self) -> bool {
        match (self.unseen(), other.unseen()) {
            (Some(own), Some(others)) => own.eq(others),
            (own, others) => own.is_none() == others.is_none(),
        }
    }
}

impl<S> WallChanges<S> {
    /// Identity of the walls as they are: that of their clones until one of them changes, and of no
    /// others.
    pub fn identity(&self) -> u64 {
        self.log.back().map_or(self.base, |change| change.identity)
    }

    /// Changes since the walls had this identity; none if that is not known.
    fn since(&self, identity: u64) -> Option<impl Iterator<Item = &Change<S>>> {
        let known = self.log.iter().rposition(|change| change.identity == identity);
        let new = known.map(|at| at + 1).or((identity == self.base).then_some(0))?;
        Some(self.log.range(new..))
    }

    /// Regions and removals that no solver has seen yet; none if they are not known.
    fn unseen(&self) -> Option<impl Iterator<Item = (&Option<Aabb3<S>>, Option<[u32; 2]>)>> {
        Some(self.since(self.seen)?.map(|change| (&change.region, change.removed)))
    }
}

impl<S: Scalar> WallChanges<S> {
    /// Adds a change.
    pub fn add(&mut self, region: Option<Aabb3<S>>, removed: Option<[u32; 2]>) {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        let identity = NEXT.fetch_add(1, Ordering::Relaxed);
        let full = self.log.len() >= MAX_CHANGES;
        if full
            && self.base == self.seen
            && let Some(last) = self.log.back_mut()
            && last.removed.and(removed).is_none()
        {
            last.identity = identity;
            last.region = last.region.zip(region).map(|(one, other)| one.union(&other));
            last.removed = last.removed.or(removed);
            return;
        }
        if full && let Some(dropped) = self.log.pop_front() {
            self.base = dropped.identity;
        }
        self.log.push_back(Change { identity, region, removed });
    }

    /// Notes that a solver knows of all changes.
    pub fn mark_seen(&mut self) {
        self.seen = self.identity();
    }

    /// Visits the regions that changed since the walls had this identity. Returns false if they are
    /// not known, or without bounds.
    pub fn visit_since(&self, identity: u64, mut visit: impl FnMut(&Aabb3<S>)) -> bool {
        let Some(changes) = self.since(identity) else { return false };
        for change in changes {
            let Some(region) = &change.region else { return false };
            visit(region);
        }
        true
    }

    /// Visits the removals since the walls had this identity, in order: the row of the wall, and that
    /// whose wall moved there. Returns false if they are not known.
    pub fn visit_removals_since(&self, identity: u64, visit: impl FnMut([u32; 2])) -> bool {
        let Some(changes) = self.since(identity) else { return false };
        changes.filter_map(|change| change.removed).for_each(visit);
        true
    }
}
