//! Log of where walls changed.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::math::Scalar;
use crate::shape::Aabb3;

/// Changes kept at most; a reader that is further behind takes all walls for changed.
const MAX_CHANGES: usize = 1024;

/// Regions in which walls changed, in order. Two are equal if the swarm knows of all changes, or has
/// some to learn of, in both.
#[derive(Clone, Debug)]
pub(super) struct WallChanges<S> {
    /// Identity of the walls before the first change of the log.
    base: u64,
    /// Identity of the walls after the change, and the region; none for one without bounds.
    log: VecDeque<(u64, Option<Aabb3<S>>)>,
    /// Identity of the walls when the swarm last looked at them.
    seen: u64,
}

impl<S: Scalar> PartialEq for WallChanges<S> {
    fn eq(&self, other: &Self) -> bool {
        (self.identity() == self.seen) == (other.identity() == other.seen)
    }
}

impl<S> Default for WallChanges<S> {
    fn default() -> Self {
        Self { base: 0, log: VecDeque::new(), seen: 0 }
    }
}

impl<S: Scalar> WallChanges<S> {
    /// Adds a change.
    pub fn add(&mut self, region: Option<Aabb3<S>>) {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        if self.log.len() == MAX_CHANGES
            && let Some((dropped, _)) = self.log.pop_front()
        {
            self.base = dropped;
        }
        self.log.push_back((NEXT.fetch_add(1, Ordering::Relaxed), region));
    }

    /// Identity of the walls as they are: that of their clones until one of them changes, and of no
    /// others.
    pub fn identity(&self) -> u64 {
        self.log.back().map_or(self.base, |(identity, _)| *identity)
    }

    /// Notes that the swarm knows of all changes.
    pub fn mark_seen(&mut self) {
        self.seen = self.identity();
    }

    /// Visits the regions that changed since the walls had this identity. Returns false if they are
    /// not known, or without bounds.
    pub fn visit_since(&self, identity: u64, mut visit: impl FnMut(&Aabb3<S>)) -> bool {
        let known = self.log.iter().rposition(|(known, _)| *known == identity);
        let Some(new) = known.map(|at| at + 1).or((identity == self.base).then_some(0)) else {
            return false;
        };
        for (_, region) in self.log.range(new..) {
            let Some(region) = region else { return false };
            visit(region);
        }
        true
    }
}
