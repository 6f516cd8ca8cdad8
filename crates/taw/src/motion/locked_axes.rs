//! Axes that a marble neither moves along nor turns about.

use std::ops::{BitOr, BitOrAssign};

use cgmath::InnerSpace;

use crate::Error;
use crate::error::within;
use crate::math::{Point3, Scalar, Vec3, normalize_and_length};

/// Axes of the world that a marble does not move along or does not turn about, a bit each: 2D worlds,
/// rails, figures that stay upright. By default none.
///
/// A lock is an ideal constraint of its velocity (Lanczos, *The Variational Principles of Mechanics*,
/// 1949): it does no work on what the marble does along the free axes. So coordinates along locked axes
/// keep their bits whatever pushes, forces along them do nothing, and a marble on a rail that meets an
/// inclined wall bounces along the rail. A velocity along a locked axis is set to zero in the next step;
/// [teleports](crate::world::Marbles::set_position) move a marble along any axis.
///
/// # Accuracy
/// - [`Response::Impulse`](crate::response::Response::Impulse),
///   [`Penalty`](crate::response::Response::Penalty) and
///   [`Displacement`](crate::response::Response::Displacement), and
///   [`SoftStep`](crate::response::Response::SoftStep), solve each contact by the inverse mass that is
///   left along its normal `n`: `n·L n / m`, with `L` the projection to the free axes. A bounce keeps its
///   restitution to rounding, however normals are inclined to the axes. A marble locked along all three
///   axes is as one of infinite mass that turns by its own.
/// - Friction along an axis about or along which the marble is locked is found in some passes instead of
///   one: its effective mass is that of a free marble.
/// - A normal within a thousandth of a radian of the locked directions presses on the lock alone.
/// - No lock adds energy. Momentum along free axes is conserved as without locks. Of `SoftStep`, a ball that a
///   locked one wedges against a wall, with friction of nearly one, may be thrown out, as one that walls
///   squeeze: of 3,000 random scenes of a few marbles in a room, six gain over 1.5e-3 of their energy, and
///   none 4 % (`cargo test -p taw --test response wedged`).
/// - A capsule about two free axes keeps its angular momentum about these in each substep, and loses the
///   energy that this would add.
/// - [`EventDriven`](crate::response::Response::EventDriven) refuses worlds with locked axes.
///
/// ```
/// use taw::motion::LockedAxes;
///
/// let pinball = LockedAxes::PLANE_XY;
/// assert_eq!(pinball, LockedAxes::TRANSLATION_Z | LockedAxes::ROTATION_X | LockedAxes::ROTATION_Y);
/// assert!(pinball.contains(LockedAxes::TRANSLATION_Z) && !pinball.contains(LockedAxes::ROTATION));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "u8", into = "u8"))]
pub struct LockedAxes(u8);

/// Least square of the part of a unit normal along free axes with which a contact moves the marble: a
/// sine of a thousandth. As a wedge, a smaller one would hold nothing
/// (see `MAX_LEVERAGE` of sequential impulses).
pub(crate) const LEAST_SHARE: f64 = 1e-6;
/// Largest reciprocal of such a square by which positions are corrected, so that they go no farther than
/// four times the overlap.
pub(crate) const MAX_ESCAPE: f64 = 16.0;

impl LockedAxes {
    /// No axis.
    pub const NONE: Self = Self(0);
    /// No motion along x.
    pub const TRANSLATION_X: Self = Self(1);
    /// No motion along y.
    pub const TRANSLATION_Y: Self = Self(1 << 1);
    /// No motion along z.
    pub const TRANSLATION_Z: Self = Self(1 << 2);
    /// No rotation about x.
    pub const ROTATION_X: Self = Self(1 << 3);
    /// No rotation about y.
    pub const ROTATION_Y: Self = Self(1 << 4);
    /// No rotation about z.
    pub const ROTATION_Z: Self = Self(1 << 5);
    /// No motion.
    pub const TRANSLATION: Self = Self(0b111);
    /// No rotation.
    pub const ROTATION: Self = Self(0b111 << 3);
    /// Neither motion nor rotation.
    pub const ALL: Self = Self(0b11_1111);
    /// A plane world of x and y: no motion along z, rotation about z only.
    pub const PLANE_XY: Self = Self::TRANSLATION_Z.with(Self::ROTATION_X).with(Self::ROTATION_Y);
    /// A plane world of y and z, likewise.
    pub const PLANE_YZ: Self = Self::TRANSLATION_X.with(Self::ROTATION_Y).with(Self::ROTATION_Z);
    /// A plane world of z and x, likewise.
    pub const PLANE_ZX: Self = Self::TRANSLATION_Y.with(Self::ROTATION_Z).with(Self::ROTATION_X);

    /// These axes and others. Const, unlike `|`.
    #[must_use]
    pub const fn with(self, others: Self) -> Self {
        Self(self.0 | others.0)
    }

    /// These axes without others.
    #[must_use]
    pub const fn without(self, others: Self) -> Self {
        Self(self.0 & !others.0)
    }

    /// Returns true if all of these others are locked.
    #[must_use]
    #[inline]
    pub const fn contains(self, others: Self) -> bool {
        self.0 & others.0 == others.0
    }

    /// Returns true if no axis is locked.
    #[must_use]
    #[inline]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Bits: translation along x, y, z, rotation about x, y, z, from the lowest one.
    #[must_use]
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// Returns true if no motion along any axis is locked.
    #[inline]
    pub(crate) const fn moves_freely(self) -> bool {
        self.0 & Self::TRANSLATION.0 == 0
    }

    /// Returns true if no rotation about any axis is locked.
    #[inline]
    pub(crate) const fn turns_freely(self) -> bool {
        self.0 & Self::ROTATION.0 == 0
    }

    /// Point with the coordinates of another one along locked axes.
    pub(crate) fn held<S: Scalar>(self, point: Point3<S>, at: Point3<S>) -> Point3<S> {
        let held = |axis: u8, x: S, at: S| if self.0 >> axis & 1 == 0 { x } else { at };
        Point3::new(held(0, point.x, at.x), held(1, point.y, at.y), held(2, point.z, at.z))
    }

    /// Returns true for an axis, counted from x, about which it does not turn.
    #[inline]
    pub(crate) const fn locks_rotation(self, axis: usize) -> bool {
        self.0 >> (axis + 3) & 1 != 0
    }

    /// Part of a vector along the axes of free motion.
    #[inline]
    pub(crate) fn free_translation<S: Scalar>(self, v: Vec3<S>) -> Vec3<S> {
        project(self.0, v)
    }

    /// Part of an axial vector along the axes of free rotation.
    #[inline]
    pub(crate) fn free_rotation<S: Scalar>(self, v: Vec3<S>) -> Vec3<S> {
        project(self.0 >> 3, v)
    }

    /// Inverse mass along a unit normal, over that of the free marble: the square of the normal's part
    /// along free axes. Zero where that is too small for a contact to move the marble.
    #[inline]
    pub(crate) fn share<S: Scalar>(self, normal: Vec3<S>) -> S {
        if self.moves_freely() {
            return S::one();
        }
        let share = self.free_translation(normal).magnitude2();
        if share < S::from_f64(LEAST_SHARE) { S::zero() } else { share }
    }

    /// Displacement along free axes by which a marble leaves a surface with this unit normal, over that
    /// along the normal, and no more than four times as far.
    pub(crate) fn escape<S: Scalar>(self, normal: Vec3<S>) -> Vec3<S> {
        if self.moves_freely() {
            return normal;
        }
        let along = self.free_translation(normal);
        along * along.magnitude2().recip().min(S::from_f64(MAX_ESCAPE))
    }

    /// Unit vector of the part of a normal along free axes, by which paths of the marble end and bend; the
    /// normal itself where there is none.
    pub(crate) fn free_normal<S: Scalar>(self, normal: Vec3<S>) -> Vec3<S> {
        if self.moves_freely() {
            return normal;
        }
        normalize_and_length(self.free_translation(normal)).map_or(normal, |(along, _)| along)
    }
}

/// Vector without the components of which the bits are set.
#[inline]
fn project<S: Scalar>(locked: u8, v: Vec3<S>) -> Vec3<S> {
    let free = |axis: u8, x: S| if locked >> axis & 1 == 0 { x } else { S::zero() };
    Vec3::new(free(0, v.x), free(1, v.y), free(2, v.z))
}

impl BitOr for LockedAxes {
    type Output = Self;

    fn bitor(self, others: Self) -> Self {
        self.with(others)
    }
}

impl BitOrAssign for LockedAxes {
    fn bitor_assign(&mut self, others: Self) {
        *self = self.with(others);
    }
}

impl TryFrom<u8> for LockedAxes {
    type Error = Error;

    /// Axes by their [bits](LockedAxes::bits).
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for more than six bits.
    fn try_from(bits: u8) -> Result<Self, Error> {
        within("locked_axes", f64::from(bits), 0.0, f64::from(Self::ALL.0))?;
        Ok(Self(bits))
    }
}

impl From<LockedAxes> for u8 {
    fn from(axes: LockedAxes) -> Self {
        axes.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_normal_keeps_its_part_along_free_axes() {
        let v = Vec3::new(1.0, 2.0, 3.0);
        assert_eq!(LockedAxes::TRANSLATION_Y.free_translation(v), Vec3::new(1.0, 0.0, 3.0));
        assert_eq!(LockedAxes::TRANSLATION_Y.free_rotation(v), v);
        assert_eq!(LockedAxes::PLANE_XY.free_rotation(v), Vec3::new(0.0, 0.0, 3.0));
        let normal = Vec3::new(0.6, 0.8, 0.0);
        let rail = LockedAxes::TRANSLATION_Y | LockedAxes::TRANSLATION_Z;
        assert_eq!(LockedAxes::ROTATION.share(normal), 1.0);
        assert!((rail.share(normal) - 0.36_f64).abs() < 1e-15);
        assert!((rail.escape(normal).dot(normal) - 1.0).abs() < 1e-15, "all of the overlap");
        assert_eq!(rail.share(Vec3::new(5e-4, 0.0, 1.0)), 0.0);
        assert_eq!(rail.free_normal(normal), Vec3::unit_x());
        assert_eq!(LockedAxes::ALL.escape(normal), Vec3::new(0.0, 0.0, 0.0));
    }

    #[test]
    fn six_bits_are_all() {
        let bits = |bits: u8| LockedAxes::try_from(bits).map(u8::from);
        assert_eq!(bits(63), Ok(63));
        assert!(matches!(bits(64), Err(Error::OutOfRange { field: "locked_axes", .. })));
    }
}
