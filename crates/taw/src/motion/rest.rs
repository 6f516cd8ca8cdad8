//! Rest: when a ball counts as resting, and from when on it may sleep.

use crate::math::Scalar;

/// Speed below which a ball counts as resting, over that which it gets when it falls by half of its radius.
const SLOW: f64 = 0.05;
/// Least time of rest before a ball sleeps, in seconds, and in times that it needs to fall by half its
/// radius: the larger a ball, the longer it lingers where it turns back.
const TIME: f64 = 0.5;
const FALLS: f64 = 5.0;
/// Distance in radii that a ball at rest keeps to, unless it is slow and does not speed up: without rolling
/// resistance, a slow one on a level floor rolls on for ever. A ball that begins to roll down a slope
/// of .33° goes further in that time, and one under 10 cm down a gentler slope.
pub(crate) const PLACE: f64 = 0.05;
/// Speed over that at the beginning up to which a ball does not speed up: one that rolls down a slope
/// of .08° gains more in that time.
const STEADY: f64 = 1.1;

/// Values of the time of rest of a ball that moves, and of one that has just gone further than [`PLACE`].
pub(crate) const MOVES: f64 = -1.0;
pub(crate) const LEFT: f64 = -2.0;

/// Returns true for a ball of this radius, in metres, with this square of a speed, in m²/s², that is slow
/// enough to rest under gravity, in m/s².
#[inline]
pub(crate) fn is_slow<S: Scalar>(square: S, gravity: S, radius: S) -> bool {
    square < S::from_f64(SLOW) * S::from_f64(SLOW) * gravity * radius
}

/// Time of rest in seconds, or [`MOVES`] or [`LEFT`], `dt` seconds after it was `time`, of a ball with this
/// place (center in metres, and speed in m/s when it began to rest), center and radius, and square of its
/// speed. `rests` says if it is slow and borne.
#[inline]
pub(crate) fn time_of_rest<S: Scalar>(
    (place, time): (&mut [S; 4], S),
    at: &[S; 4],
    square: S,
    rests: bool,
    dt: S,
) -> S {
    let (zero, near, steady) = (S::zero(), S::from_f64(PLACE), S::from_f64(STEADY));
    let [x, y, z] = [at[0] - place[0], at[1] - place[1], at[2] - place[2]];
    let is_near = x * x + y * y + z * z <= near * near * at[3] * at[3];
    // What has no speed and moves all the same is moved by corrections of overlap.
    let is_steady = |first: S| first > zero && square <= steady * steady * first * first;
    if rests && time >= zero && (is_near || is_steady(place[3])) {
        time + dt
    } else if !is_near {
        *place = [at[0], at[1], at[2], square.sqrt()];
        S::from_f64(LEFT)
    } else if rests && time < zero {
        place[3] = square.sqrt();
        zero
    } else {
        S::from_f64(MOVES)
    }
}

/// Returns true if a ball of this radius, in metres, has rested for long enough to sleep under gravity, in
/// m/s².
#[inline]
pub(crate) fn lasts<S: Scalar>(time: S, radius: S, gravity: S) -> bool {
    let falls = S::from_f64(FALLS);
    time > S::from_f64(TIME) && time * time * gravity > falls * falls * radius
}

/// Speed in m/s up to which a ball counts as resting, by gravity in m/s² and its radius in metres.
pub(crate) fn sleep_speed<S: Scalar>(gravity: S, radius: S) -> S {
    S::from_f64(SLOW) * (gravity * radius).sqrt()
}
