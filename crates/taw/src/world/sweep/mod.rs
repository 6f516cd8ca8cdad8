//! Swept detection: what would pass through each other within a substep is stopped
//! where it first touches, with the velocity that it has there, and what only lies or slides there
//! goes on along the surface. Slower ones, which only graze each other on the way, are named as
//! contacts.

mod meet;
mod walls;

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashSet};

use super::{Detection, World};
use crate::contact::Contact;
use crate::math::{Mat3, Point3, Scalar, Vec3, length};
use meet::{Hit, Way};
use walls::Bend;

/// How far into each other marbles are put that meet, over the sum of their radii: what
/// only just touches would not be held by a response that looks at overlap.
const INTO: f64 = 1e-5;

/// Whose way past each other is longer than this part of the smaller radius may pass through
/// each other, or be turned back by the wrong side: the end of a step no longer tells where they
/// met. So they are stopped.
const FAST: f64 = 0.5;

/// Bends of a way in a substep, at most, before it ends: two surfaces hold a marble to an
/// edge, three to a corner, and a bowl of triangles has one after the other.
const MOST_BENDS: u32 = 4;

/// State of the sweep of a substep, and scratch memory of it.
#[derive(Clone, Debug, Default)]
pub(super) struct Sweep<S> {
    /// Positions before the substep, in metres, and velocities, in m/s.
    pub start: Vec<Point3<S>>,
    pub velocity: Vec<Vec3<S>>,
    /// Stops of this substep; and for every row, if there is one, the projection by which a position
    /// still follows a velocity: the directions that are left, times the part of the substep.
    stops: Vec<Stopped<S>>,
    pub stands: Vec<Option<Mat3<S>>>,
    /// Pairs that meet on the way, whether or not one was stopped.
    pub grazes: Vec<(u32, u32)>,
    middle: Vec<Point3<S>>,
    reach: Vec<S>,
    /// Candidate pairs, both ways round, in order.
    near: Vec<(u32, u32)>,
    hits: BinaryHeap<Reverse<Hit<S>>>,
    ways: Vec<Way<S>>,
    /// Bends at walls, row by row, in the order of time.
    bends: Vec<Bend<S>>,
    /// Positions before they follow what contacts change, in metres.
    bounced_from: Vec<Point3<S>>,
}

/// A marble that was stopped.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stopped<S> {
    pub row: u32,
    /// By what: the row of a wall or of a marble.
    by: By,
    /// Way that it lost, in metres, and change of its velocity by forces that it lost, in m/s.
    way: Vec3<S>,
    change: Vec3<S>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum By {
    Wall(u32),
    Marble(u32),
}

impl<S: Scalar> World<S> {
    /// Remembers where marbles are before they move, if this model sweeps.
    pub(super) fn begin_sweep(&mut self) {
        self.sweep.clear();
        if self.model.detection == Detection::Swept {
            self.sweep.start.extend_from_slice(&self.marbles.position);
            self.sweep.velocity.extend_from_slice(&self.marbles.velocity);
        }
    }

    /// Forgets who has slid off what had stopped it: what was lost there stays lost.
    pub(super) fn keep_stops_that_touch(&mut self) {
        if !self.sweep.stops.is_empty() {
            let touches = self.touches();
            self.sweep.stops.retain(touches);
        }
    }

    /// Lets marbles go on that were stopped by what the user took out of the contacts.
    pub(super) fn release_what_touches_nothing(&mut self) {
        if self.sweep.start.len() != self.marbles.len() {
            self.sweep.clear(); // rows have changed
        }
        if self.sweep.stops.is_empty() {
            return;
        }
        let touches = self.touches();
        self.sweep.stops.retain(|stop| {
            let row = stop.row as usize;
            if !touches(stop) {
                self.marbles.position[row] += stop.way;
                self.marbles.velocity[row] += stop.change;
                self.sweep.stands[row] = None;
            }
            touches(stop)
        });
    }

    /// True for a stop whose two have a contact.
    fn touches(&self) -> impl Fn(&Stopped<S>) -> bool + use<S> {
        let walls = self.contacts.wm.iter().map(|c| (By::Wall(c.a), c.b));
        let both = |c: &Contact<S>| [(By::Marble(c.a), c.b), (By::Marble(c.b), c.a)];
        let touches: HashSet<_> = walls.chain(self.contacts.mm.iter().flat_map(both)).collect();
        move |stop| touches.contains(&(stop.by, stop.row))
    }

    /// The largest approach, in metres per substep, of what lies: what gravity does in two substeps.
    fn slow(&self, dt: S) -> S {
        length(self.gravity) * dt * dt * S::constant(2.0)
    }
}

impl<S: Scalar> Sweep<S> {
    /// Notes that a row was stopped, and what is left to it.
    fn stop(&mut self, stopped: Stopped<S>, along: Mat3<S>) {
        self.stands.resize(self.start.len(), None);
        let free = &mut self.stands[stopped.row as usize];
        *free = Some(free.map_or(along, |free| along * free));
        self.stops.push(stopped);
    }

    /// Remembers where marbles are before they follow what contacts change of their velocities.
    pub fn begin_bounces(&mut self, position: &[Point3<S>]) {
        if self.start.len() == position.len() {
            self.bounced_from.extend_from_slice(position);
        }
    }

    /// Forgets the last substep.
    fn clear(&mut self) {
        self.start.clear();
        self.velocity.clear();
        self.stops.clear();
        self.stands.clear();
        self.grazes.clear();
        self.bends.clear();
        self.bounced_from.clear();
    }
}

/// The matrix that keeps of a vector the part along a unit vector.
fn outer<S: Scalar>(v: Vec3<S>) -> Mat3<S> {
    Mat3::from_cols(v * v.x, v * v.y, v * v.z)
}
