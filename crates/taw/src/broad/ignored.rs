//! Pairs that pass through each other, and what that and layers leave for a ball to collide with.

use super::CollisionLayers;

/// Pairs that pass through each other, by row or by slot. They follow from other state, so that any two
/// compare equal.
#[derive(Clone, Debug, Default)]
pub(crate) struct IgnoredPairs {
    /// Two balls, the lower one first; sorted.
    pub balls: Vec<[u32; 2]>,
    /// A ball and a wall; sorted.
    pub walls: Vec<[u32; 2]>,
    /// Number of marbles and of walls, and of removals of both, when they were found; none while others
    /// are named.
    pub found_at: Option<([u64; 2], [u64; 3])>,
}

impl IgnoredPairs {
    /// Pairs of balls, and pairs of a ball and a wall, in any order.
    pub fn new(mut balls: Vec<[u32; 2]>, mut walls: Vec<[u32; 2]>) -> Self {
        for [a, b] in &mut balls {
            (*a, *b) = ((*a).min(*b), (*a).max(*b));
        }
        for pairs in [&mut balls, &mut walls] {
            pairs.sort_unstable();
            pairs.dedup();
        }
        Self { balls, walls, found_at: None }
    }

    /// Returns true without any pair.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.balls.is_empty() && self.walls.is_empty()
    }

    /// Returns true for two balls that pass through each other.
    #[inline]
    pub fn has_balls(&self, a: u32, b: u32) -> bool {
        !self.balls.is_empty() && self.balls.binary_search(&[a.min(b), a.max(b)]).is_ok()
    }

    /// Pairs of a ball with walls.
    #[inline]
    pub fn walls_of(&self, ball: u32) -> &[[u32; 2]] {
        if self.walls.is_empty() {
            return &[];
        }
        let first = self.walls.partition_point(|[other, _]| *other < ball);
        let count = self.walls[first..].iter().take_while(|[other, _]| *other == ball).count();
        &self.walls[first..first + count]
    }

    pub fn bytes(&self) -> usize {
        (self.balls.capacity() + self.walls.capacity()) * size_of::<[u32; 2]>()
    }

    /// Balls of which a pair is in one of the two only.
    pub fn differences(&self, other: &Self) -> Vec<u32> {
        let only = |these: &[[u32; 2]], those: &[[u32; 2]]| -> Vec<[u32; 2]> {
            these.iter().filter(|pair| those.binary_search(pair).is_err()).copied().collect()
        };
        let of = |a: &Self, b: &Self| {
            let walls = only(&a.walls, &b.walls).into_iter().map(|[ball, _]| ball);
            only(&a.balls, &b.balls).into_iter().flatten().chain(walls).collect::<Vec<_>>()
        };
        let mut balls = of(self, other);
        balls.extend(of(other, self));
        balls.sort_unstable();
        balls.dedup();
        balls
    }
}

/// Collision filter of a ball.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CollisionFilter<'a> {
    pub layers: CollisionLayers,
    /// Pairs of the ball with walls that it passes through, sorted.
    pub ignored: &'a [[u32; 2]],
}

impl CollisionFilter<'_> {
    /// Collides with all.
    pub const ALL: CollisionFilter<'static> =
        CollisionFilter { layers: CollisionLayers::ALL, ignored: &[] };

    /// Returns true if the ball collides with the wall in a row, which has these layers.
    #[inline]
    pub fn meets_wall(self, wall: u32, layers: CollisionLayers) -> bool {
        let is_ignored = || self.ignored.binary_search_by_key(&wall, |[_, wall]| *wall).is_ok();
        layers.interacts_with(self.layers) && !is_ignored()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_found_in_either_order_and_differences_by_ball() {
        let pairs = IgnoredPairs::new(vec![[5, 2], [2, 5], [1, 3]], vec![[7, 0], [2, 9], [2, 4]]);
        assert!(pairs.has_balls(2, 5) && pairs.has_balls(5, 2) && pairs.has_balls(3, 1));
        assert!(!pairs.has_balls(1, 2));
        let filter = CollisionFilter { ignored: pairs.walls_of(2), ..CollisionFilter::ALL };
        let meets = [4, 5, 9].map(|wall| filter.meets_wall(wall, CollisionLayers::ALL));
        assert_eq!(meets, [false, true, false]);
        assert!(!filter.meets_wall(5, CollisionLayers::NONE));
        let fewer = IgnoredPairs::new(vec![[1, 3]], vec![[7, 0], [2, 9]]);
        assert_eq!(pairs.differences(&fewer), [2, 5]);
        assert_eq!(fewer.differences(&pairs), [2, 5]);
        assert!(pairs.differences(&pairs.clone()).is_empty());
    }
}
