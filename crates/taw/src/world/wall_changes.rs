//! Log of where walls changed.

use std::collections::VecDeque;

use crate::math::Scalar;
use crate::shape::Aabb3;

/// Changes kept at most; a reader that is further behind takes all walls for changed.
const MAX_CHANGES: usize = 1024;

/// Regions in which walls changed, in order. Does not count in comparisons.
#[derive(Clone, Debug)]
pub(super) struct WallChanges<S> {
    /// Version after the change, and the region; none for one without bounds.
    log: VecDeque<(u64, Option<Aabb3<S>>)>,
    /// Version after which the log has all changes.
    complete_since: u64,
}

impl<S> Default for WallChanges<S> {
    fn default() -> Self {
        Self { log: VecDeque::new(), complete_since: 0 }
    }
}

impl<S: Scalar> WallChanges<S> {
    /// Adds the change that made this version.
    pub fn add(&mut self, version: u64, region: Option<Aabb3<S>>) {
        if self.log.len() == MAX_CHANGES
            && let Some((dropped, _)) = self.log.pop_front()
        {
            self.complete_since = dropped;
        }
        self.log.push_back((version, region));
    }

    /// Visits the regions that changed after a version. Returns false if they are not known, or
    /// without bounds.
    pub fn visit_since(&self, version: u64, now: u64, mut visit: impl FnMut(&Aabb3<S>)) -> bool {
        if version < self.complete_since || version > now {
            return false;
        }
        let new = self.log.partition_point(|(change, _)| *change <= version);
        for (_, region) in self.log.range(new..) {
            let Some(region) = region else { return false };
            visit(region);
        }
        true
    }
}
