//! Collision layers: who meets whom.

use bevy::prelude::*;
/// Makes layers of an enum's variants, the first of which is bit 0: up to 32, without fields.
pub use bevy_taw_derive::PhysicsLayer;

/// Collision layers: those that a marble, a wall or a [`Swarm`](crate::swarm::Swarm) is in, and those
/// that it collides with. Two collide if each is in a layer that the other collides with. Without
/// this component, something is in all layers and collides with all. May change at any time.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// #[derive(PhysicsLayer)]
/// enum Layer {
///     Floor,
///     Player,
///     Ghost,
/// }
///
/// fn spawn(mut commands: Commands) {
///     // Meets the floor, and no other ghost.
///     let ghost = CollisionLayers::new(Layer::Ghost, Layer::Floor);
///     commands.spawn((Marble::new(0.5), ghost));
///     let player = CollisionLayers::new(Layer::Player, [Layer::Floor, Layer::Player]);
///     commands.spawn((Marble::new(0.5), player));
///     // Everything in it meets everything.
///     commands.spawn((Wall::default(), CollisionLayers::new(Layer::Floor, LayerMask::ALL)));
/// }
/// ```
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct CollisionLayers {
    /// Layers that it is in.
    pub memberships: LayerMask,
    /// Layers that it collides with.
    pub filters: LayerMask,
}

impl CollisionLayers {
    /// In no layer, and collides with none.
    pub const NONE: Self = Self { memberships: LayerMask::NONE, filters: LayerMask::NONE };

    /// Layers that it is in, and layers that it collides with: a [`PhysicsLayer`], an array of them,
    /// or bits.
    #[must_use]
    pub fn new(memberships: impl Into<LayerMask>, filters: impl Into<LayerMask>) -> Self {
        Self { memberships: memberships.into(), filters: filters.into() }
    }

    /// Returns true if two such colliders collide.
    #[must_use]
    pub fn interacts_with(self, other: Self) -> bool {
        taw::broad::CollisionLayers::from(self).interacts_with(other.into())
    }
}

impl Default for CollisionLayers {
    /// In all layers, and collides with all.
    fn default() -> Self {
        Self { memberships: LayerMask::ALL, filters: LayerMask::ALL }
    }
}

impl From<CollisionLayers> for taw::broad::CollisionLayers {
    fn from(CollisionLayers { memberships, filters }: CollisionLayers) -> Self {
        Self::new(memberships.0, filters.0)
    }
}

/// Set of layers, a bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Debug, Default, PartialEq)]
pub struct LayerMask(pub u32);

impl LayerMask {
    /// All 32 layers.
    pub const ALL: Self = Self(u32::MAX);
    /// No layer.
    pub const NONE: Self = Self(0);
}

/// Layer of a game: one of at most 32. Derive it for an enum.
pub trait PhysicsLayer {
    /// Mask with the bit of the layer.
    fn to_bits(&self) -> u32;
}

impl From<u32> for LayerMask {
    fn from(bits: u32) -> Self {
        Self(bits)
    }
}

impl<L: PhysicsLayer> From<L> for LayerMask {
    fn from(layer: L) -> Self {
        Self(layer.to_bits())
    }
}

impl<L: PhysicsLayer, const N: usize> From<[L; N]> for LayerMask {
    fn from(layers: [L; N]) -> Self {
        layers.as_slice().into()
    }
}

impl<L: PhysicsLayer> From<&[L]> for LayerMask {
    fn from(layers: &[L]) -> Self {
        Self(layers.iter().fold(0, |bits, layer| bits | layer.to_bits()))
    }
}

impl std::ops::BitOr for LayerMask {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl std::ops::Not for LayerMask {
    type Output = Self;

    fn not(self) -> Self {
        Self(!self.0)
    }
}
