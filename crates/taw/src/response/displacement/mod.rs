//! The lab's method, which [`Response::Displacement`](super::Response::Displacement) is: what a
//! substep moved into each other is moved back, and velocities change by that way per substep;
//! what overlapped before is moved apart afterwards, and no velocity changes.

#[cfg(test)]
mod tests;

use cgmath::{InnerSpace, Zero};

use super::impulse::{Around, First, Groups, Warm, key_of};
use super::{Columns, Material, Walls};
use crate::contact::Contacts;
use crate::math::{Scalar, Vec3, is_finite, is_finite_point};

/// Scratch buffers, kept for their memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch<S> {
    touches: Vec<Touch<S>>,
    before: Vec<Vec3<S>>,
    groups: Groups,
    starts: Vec<Start<S>>,
}

/// Sums that scale the warm start of one group of marbles that touch each other, in m²/s².
#[derive(Clone, Copy, Debug)]
struct Start<S> {
    /// Cached change times the change that is wanted, and times the change that it makes.
    wanted: S,
    made: S,
}

impl<S: Scalar> Start<S> {
    /// Part of the changes that brings all nearest to what is asked for.
    fn part(self) -> S {
        let part = self.wanted / self.made;
        if self.made > S::zero() {
            part.max(S::zero()).min(S::one())
        } else if self.made.is_nan() {
            S::zero() // energies overflowed
        } else {
            S::one()
        }
    }
}

/// A contact while it is solved.
#[derive(Clone, Copy, Debug)]
struct Touch<S> {
    a: First,
    b: usize,
    /// Index of its group of marbles that touch each other. Groups do not change each other, to the
    /// bit.
    group: u32,
    along: [S; 2],
    /// From a to b.
    normal: Vec3<S>,
    /// Speed of the wall's surface along the normal, in m/s; zero between marbles.
    surface: S,
    /// The least speed of parting that is asked for, in m/s: zero, or negative for two that
    /// still have a way to go.
    least: S,
    /// By how much the contact has changed that speed, in m/s.
    change: S,
}

/// The lecture's restitution, contact by contact, the deepest first, each tested again: a wall
/// stays, marbles take half each. The lecture takes all overlap for motion of this frame, so that
/// what was there before becomes speed; here only approach ends. Changes are accumulated, so that
/// a contact can take back what another one made superfluous, and begin with those of the last
/// substep (Catto, *Iterative dynamics with temporal coherence*, 2005). What overlaps then is
/// moved apart without a change of velocity, as Macklin et al. do (*Unified particle physics for
/// real-time applications*, 2014, §4.4).
///
/// The contacts' rows exist. A row that would become infinite or NaN keeps its place,
/// loses its velocity, and is added to `stopped`. `by_walls` hears by how much a wall changed a
/// velocity.
pub(crate) fn displacement<S: Scalar>(
    marbles: &mut Columns<S>,
    contacts: &mut Contacts<S>,
    around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    scratch: &mut Scratch<S>,
    warm: &mut Vec<Warm<S>>,
    stopped: &mut Vec<u32>,
    mut by_walls: impl FnMut(u32, Vec3<S>),
) {
    contacts.sort();
    let Scratch { touches, before, groups, starts } = scratch;
    before.clear();
    before.extend_from_slice(marbles.velocity);
    touches.clear();
    touches.extend(
        First::of_each(contacts)
            .filter_map(|(a, c)| marbles.look(a, c.b as usize, c.along, around)),
    );
    groups.find(touches.iter().map(|t| (t.a.marble(), t.b)), marbles.velocity.len());
    for touch in touches.iter_mut() {
        touch.group = groups.of(touch.b);
    }
    marbles.begin_as_last_time(touches, warm, starts);
    let rounding = around.settings.bounce_speed * S::epsilon();
    for _ in 0..around.settings.iterations {
        let end = |changed: bool, touch| marbles.end_approach(touch, rounding) || changed;
        if !touches.iter_mut().fold(false, end) {
            break;
        }
    }
    for touch in touches.iter().filter(|touch| touch.a.marble().is_none()) {
        by_walls(touch.b as u32, touch.normal * touch.change);
    }
    marbles.move_back(before, around, stopped);
    for _ in 0..around.settings.iterations {
        let apart = |moved: bool, touch| marbles.move_apart(touch, around) || moved;
        if !touches.iter().fold(false, apart) {
            break;
        }
    }
    // Walls have the last word: through the floor nothing goes.
    for touch in touches.iter().filter(|touch| touch.a.marble().is_none()) {
        marbles.move_apart(touch, around);
    }
    warm.clear();
    warm.extend(touches.iter().map(|t| Warm::of_pressure(key_of(t.a, t.b, t.along), t.change)));
    warm.sort_unstable_by_key(Warm::key);
}

impl<S: Scalar> Columns<'_, S> {
    /// Finds what a contact asks for: no approach, but for the way that was still free when the
    /// substep began.
    fn look(
        &self,
        a: First,
        b: usize,
        along: [S; 2],
        around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    ) -> Option<Touch<S>> {
        let (normal, gap) = self.normal_and_gap(self.position, a, b, along, around.walls)?;
        let surface = match a {
            First::Wall(wall, _) => {
                let arm = self.offset(b, along[1]) - normal * self.radius[b];
                around.walls.surface_velocity(wall as usize, self.position[b] + arm).dot(normal)
            }
            First::Marble(_) => S::zero(),
        };
        let zero = S::zero();
        let mut touch = Touch { a, b, group: 0, along, normal, surface, least: zero, change: zero };
        let follows = around.follows(a, b);
        // What was stopped on its way touches, whatever rounding says.
        let stands = around.stands(b) || a.marble().is_some_and(|a| around.stands(a));
        if follows > S::zero() && !stands {
            touch.least = (self.parting(&touch) - gap / follows).min(S::zero());
        }
        Some(touch)
    }

    /// Separating speed of the two of a contact along its normal, in m/s.
    fn parting(&self, touch: &Touch<S>) -> S {
        let first = touch.a.marble().map_or_else(Vec3::zero, |a| self.velocity[a]);
        (self.velocity[touch.b] - first).dot(touch.normal) - touch.surface
    }

    /// Overlap that stays, in metres, so that what rests keeps touching where positions do not
    /// follow a change of velocity within the substep; none where they do.
    fn slop(
        &self,
        touch: &Touch<S>,
        around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    ) -> S {
        if around.follows(touch.a, touch.b) > S::zero() {
            return S::zero();
        }
        let second = self.radius[touch.b];
        let smaller = touch.a.marble().map_or(second, |a| self.radius[a].min(second));
        around.settings.slop.min(smaller * around.settings.largest_slop)
    }

    /// Changes the speed at which the two of a contact part.
    fn change_parting(&mut self, touch: &Touch<S>, change: S) {
        let change = touch.normal * change;
        match touch.a {
            First::Wall(..) => self.velocity[touch.b] += change,
            First::Marble(a) => {
                let half = change * S::constant(0.5);
                self.velocity[a as usize] -= half;
                self.velocity[touch.b] += half;
            }
        }
    }

    /// Begins with the changes of the last substep, or with that part of them which brings those
    /// that touch each other nearest to what is asked for: so they give no energy. What the sweeps
    /// do afterwards takes some only, as each of them lowers `½ f·A f − f·w`, with `f` the changes,
    /// `A f` what they make of the speeds, and `w` what is wanted of these.
    fn begin_as_last_time(
        &mut self,
        touches: &mut [Touch<S>],
        warm: &[Warm<S>],
        starts: &mut Vec<Start<S>>,
    ) {
        starts.clear();
        starts.resize(touches.len(), Start { wanted: S::zero(), made: S::zero() });
        for touch in touches.iter_mut() {
            let Ok(at) =
                warm.binary_search_by_key(&key_of(touch.a, touch.b, touch.along), Warm::key)
            else {
                continue;
            };
            touch.change = warm[at].pressure();
            let (push, parting) = (touch.change * touch.share(), self.parting(touch));
            let start = &mut starts[touch.group as usize];
            start.wanted += push * (touch.least - parting);
            start.made -= push * parting;
        }
        for touch in touches.iter() {
            self.change_parting(touch, touch.change);
        }
        for touch in touches.iter() {
            starts[touch.group as usize].made += touch.change * touch.share() * self.parting(touch);
        }
        for touch in touches.iter_mut() {
            let part = starts[touch.group as usize].part();
            self.change_parting(touch, touch.change * (part - S::one()));
            touch.change *= part;
        }
    }

    /// Ends the approach of two, or takes back what did so and is no longer needed. False if that
    /// is less than `rounding`, in m/s.
    fn end_approach(&mut self, touch: &mut Touch<S>, rounding: S) -> bool {
        let wanted = touch.least - self.parting(touch);
        let change = (touch.change + wanted).max(S::zero()) - touch.change;
        if !change.is_finite() || change.abs() <= rounding {
            return false; // an overflow here must not reach the other one
        }
        touch.change += change;
        self.change_parting(touch, change);
        true
    }

    /// Moves marbles by what changed of their velocities.
    fn move_back(
        &mut self,
        before: &[Vec3<S>],
        around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
        stopped: &mut Vec<u32>,
    ) {
        for (row, before) in before.iter().enumerate() {
            let velocity = self.velocity[row];
            let position = self.position[row] + (velocity - before) * around.follows_row(row);
            if is_finite_point(position) && is_finite(velocity) {
                self.position[row] = position;
            } else {
                self.velocity[row] = Vec3::zero();
                stopped.push(row as u32);
            }
        }
    }

    /// Moves the two of a contact apart. False if they do not overlap any more.
    fn move_apart(
        &mut self,
        touch: &Touch<S>,
        around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    ) -> bool {
        let Touch { a, b, along, .. } = *touch;
        let now = self.normal_and_gap(self.position, a, b, along, around.walls);
        let Some((normal, gap)) = now else { return false };
        let excess = -gap - self.slop(touch, around);
        if excess <= S::zero() {
            return false;
        }
        let by = normal * (excess * touch.share());
        for (row, by) in [(Some(b), by), (a.marble(), -by)] {
            let Some(row) = row else { continue };
            let position = self.position[row] + by;
            if is_finite_point(position) {
                self.position[row] = position;
            }
        }
        true
    }
}

impl<S: Scalar> Touch<S> {
    /// The part that the second takes.
    fn share(&self) -> S {
        if self.a.marble().is_none() { S::one() } else { S::constant(0.5) }
    }
}
