//! Locked axes of marbles.

use std::ops::BitOr;

use bevy::math::BVec3;
use bevy::prelude::*;
use taw::motion::LockedAxes as CoreAxes;

/// Axes of the world that a marble neither moves along nor turns about: for 2D games, rails, figures that stay
/// upright. May change at any time.
///
/// A lock is an ideal constraint: coordinates along locked axes keep their bits whatever pushes, forces
/// along them do nothing, and no lock adds energy; how accurate each response is, the docs of
/// [`taw::motion::LockedAxes`] have. A [`Velocity`](crate::components::Velocity) along a locked axis is
/// set to zero in the next step; a [`Transform`] that you write moves the marble along any axis. By
/// [`EventDriven`](taw::response::Response::EventDriven), marbles with locked axes are refused, and left out of
/// the world until the model changes.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// fn spawn(mut commands: Commands) {
///     // A pinball table with one wall and no glass.
///     commands.spawn((Marble::new(0.1), LockedAxes::PLANE_XY));
///     // A bead on a wire along x.
///     commands.spawn((Marble::new(0.1), LockedAxes::TRANSLATION_Y | LockedAxes::TRANSLATION_Z));
/// }
/// ```
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct LockedAxes {
    /// Axes along which it does not move.
    pub translation: BVec3,
    /// Axes about which it does not turn.
    pub rotation: BVec3,
}

impl LockedAxes {
    /// No axis.
    pub const NONE: Self = Self::new([false; 3], [false; 3]);
    /// No motion along x.
    pub const TRANSLATION_X: Self = Self::new([true, false, false], [false; 3]);
    /// No motion along y.
    pub const TRANSLATION_Y: Self = Self::new([false, true, false], [false; 3]);
    /// No motion along z.
    pub const TRANSLATION_Z: Self = Self::new([false, false, true], [false; 3]);
    /// No rotation about x.
    pub const ROTATION_X: Self = Self::new([false; 3], [true, false, false]);
    /// No rotation about y.
    pub const ROTATION_Y: Self = Self::new([false; 3], [false, true, false]);
    /// No rotation about z.
    pub const ROTATION_Z: Self = Self::new([false; 3], [false, false, true]);
    /// No motion.
    pub const TRANSLATION: Self = Self::new([true; 3], [false; 3]);
    /// No rotation.
    pub const ROTATION: Self = Self::new([false; 3], [true; 3]);
    /// Neither motion nor rotation.
    pub const ALL: Self = Self::new([true; 3], [true; 3]);
    /// A plane world of x and y: no motion along z, rotation about z only.
    pub const PLANE_XY: Self = Self::new([false, false, true], [true, true, false]);
    /// A plane world of y and z, likewise.
    pub const PLANE_YZ: Self = Self::new([true, false, false], [false, true, true]);
    /// A plane world of z and x, likewise.
    pub const PLANE_ZX: Self = Self::new([false, true, false], [true, false, true]);

    const fn new([x, y, z]: [bool; 3], [u, v, w]: [bool; 3]) -> Self {
        Self { translation: BVec3::new(x, y, z), rotation: BVec3::new(u, v, w) }
    }
}

impl BitOr for LockedAxes {
    type Output = Self;

    fn bitor(self, others: Self) -> Self {
        Self {
            translation: self.translation | others.translation,
            rotation: self.rotation | others.rotation,
        }
    }
}

impl From<LockedAxes> for CoreAxes {
    fn from(LockedAxes { translation, rotation }: LockedAxes) -> Self {
        let all = [
            (translation.x, Self::TRANSLATION_X),
            (translation.y, Self::TRANSLATION_Y),
            (translation.z, Self::TRANSLATION_Z),
            (rotation.x, Self::ROTATION_X),
            (rotation.y, Self::ROTATION_Y),
            (rotation.z, Self::ROTATION_Z),
        ];
        let locked = all.into_iter().filter(|(is_locked, _)| *is_locked);
        locked.fold(Self::NONE, |axes, (_, axis)| axes | axis)
    }
}
