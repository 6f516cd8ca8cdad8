//! Collision layers: who meets whom.

/// Layers of a collider: those that it is in, and those that it collides with, a bit each.
///
/// Two colliders collide if each is in a layer that the other collides with. By default, all are in
/// all layers and collide with all. Known elsewhere as collision groups, or category and mask bits.
///
/// ```
/// use taw::prelude::*;
///
/// let [player, coin] = [1 << 0, 1 << 1];
/// let players = CollisionLayers::new(player, player | coin);
/// let coins = CollisionLayers::new(coin, player);
/// assert!(players.interacts_with(coins) && !coins.interacts_with(coins));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields, default))]
pub struct CollisionLayers {
    /// Layers that it is in.
    pub memberships: u32,
    /// Layers that it collides with.
    pub filters: u32,
}

impl CollisionLayers {
    /// In all layers, and collides with all.
    pub const ALL: Self = Self::new(u32::MAX, u32::MAX);
    /// In no layer, and collides with none.
    pub const NONE: Self = Self::new(0, 0);

    /// Layers that it is in, and layers that it collides with.
    #[must_use]
    pub const fn new(memberships: u32, filters: u32) -> Self {
        Self { memberships, filters }
    }

    /// Returns true if two such colliders collide.
    #[must_use]
    #[inline]
    pub const fn interacts_with(self, other: Self) -> bool {
        self.memberships & other.filters != 0 && other.memberships & self.filters != 0
    }
}

impl Default for CollisionLayers {
    /// [`Self::ALL`].
    fn default() -> Self {
        Self::ALL
    }
}
