//! Rest: what all balls of a chunk are at before they fall asleep.

use cgmath::Zero;

use super::INFINITE_MASS;
use super::chunk::Chunk;
use super::kernels::squared;
use super::simd::Row;
use super::step::sleep_speed;
use super::wall_contact::WallContact;
use crate::math::{Vec3, length};

/// Least time of rest before a chunk sleeps, in seconds, and in times that a ball needs to fall by
/// half its radius: the larger a ball, the longer it lingers where it turns back.
const TIME: f32 = 0.5;
const FALLS: f32 = 5.0;
/// Distance in radii that a ball at rest keeps to, unless it is slow and does not speed up: without rolling
/// resistance, a slow one on a level floor rolls on for ever. A ball that begins to roll down a slope
/// of .33° goes further in that time, and one under 10 cm down a gentler slope.
const PLACE: f32 = 0.05;
/// Speed over that at the beginning up to which a ball does not speed up: one that rolls down a slope
/// of .08° gains more in that time.
const STEADY: f32 = 1.1;

/// Time for which all balls of a chunk have stayed where they are.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Rest {
    /// Centers and speeds at the beginning; none while any ball moves.
    places: Vec<Row>,
    /// In seconds.
    time: f32,
}

impl Rest {
    pub fn end(&mut self) {
        self.places.clear();
        self.time = 0.0;
    }

    /// Returns true while they rest.
    pub fn began(&self) -> bool {
        !self.places.is_empty()
    }

    pub fn bytes(&self) -> usize {
        self.places.capacity() * size_of::<Row>()
    }

    /// Tests if the balls have rested for long enough to sleep under such a gravity, in m/s²: each
    /// has no velocity, or is borne by something and stays where it is.
    fn lasts(&self, largest: f32, gravity: f32) -> bool {
        self.time > TIME.max(FALLS * (largest / gravity).sqrt())
    }
}

impl Chunk {
    /// Looks, `dt` seconds after the last time, whether its balls rest. Returns true if they have
    /// for long enough to sleep. Proxies are moved by others, and do not count.
    pub fn rests(
        &mut self,
        [at, velocity, spin]: [&[Row]; 3],
        is_proxy: impl Fn(usize) -> bool,
        gravity: Vec3<f32>,
        dt: f32,
    ) -> bool {
        // A wall that bears a proxy moves as the proxy does.
        let is_carried = |contact: &WallContact| {
            contact.impulse.normal > 0.0 && !contact.surface.is_zero() && !contact.bears_proxy
        };
        // The mark is that of the last step.
        let is_held = |row: usize| {
            let borne = velocity[row][3] > INFINITE_MASS && spin[row][3] > 0.0;
            borne || !moves(&at[row], &velocity[row], dt) || is_proxy(row)
        };
        if !(0..at.len()).all(is_held) || self.wall_contacts.iter().any(is_carried) {
            self.rest.end();
            return false;
        }
        let stays = |(row, (at, place)): (usize, (&Row, &Row))| {
            let away = [at[0] - place[0], at[1] - place[1], at[2] - place[2], 0.0];
            let speed = squared(velocity[row]).sqrt();
            squared(away).sqrt() <= PLACE * at[3]
                || speed <= (STEADY * place[3]).min(sleep_speed(gravity, at[3]))
                || is_proxy(row)
        };
        let places = &mut self.rest.places;
        if places.len() == at.len() && at.iter().zip(&*places).enumerate().all(stays) {
            self.rest.time += dt;
        } else {
            places.clear();
            let speeds = velocity.iter().map(|velocity| squared(*velocity).sqrt());
            places.extend(at.iter().zip(speeds).map(|([x, y, z, _], speed)| [*x, *y, *z, speed]));
            self.rest.time = 0.0;
        }
        self.rest.lasts(self.radii[1], length(gravity))
    }
}

/// Returns true if a ball moves on in `dt` seconds by more than its coordinates are rounded: what has
/// infinite mass is borne by nothing, but the solver leaves it that much.
fn moves(at: &Row, velocity: &Row, dt: f32) -> bool {
    let size = at.iter().fold(0.0_f32, |most, x| most.max(x.abs()));
    let rounding = if velocity[3] > INFINITE_MASS { 0.0 } else { f32::EPSILON * size };
    squared(*velocity).sqrt() * dt > rounding
}
