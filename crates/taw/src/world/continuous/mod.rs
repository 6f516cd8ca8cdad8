//! Continuous collision detection: marbles that would tunnel within a substep stop at the time of
//! impact with the velocity of that moment; resting and sliding ones continue along the surface.
//! Slower ones that only graze each other within the substep are listed as contacts.

mod bounces;
mod capsules;
mod marbles;
mod moving_walls;
mod swept_marble;
mod walls;

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashSet};

use cgmath::Zero;

use super::{Detection, Model, World};
use crate::contact::Contact;
use crate::math::{Mat3, Point3, Scalar, Vec3, length};
use crate::response::penalty::WallStop;
use marbles::{Meeting, Partners, Path};
pub(super) use moving_walls::{Frame, MovingWall, RelativePath};
pub(super) use swept_marble::Turn;
use walls::Bend;
pub(super) use walls::WallImpact;

/// Penetration of marbles that are stopped at each other, relative to the sum of their radii: a
/// merely touching pair would be missed by a response that needs overlap.
const OVERLAP: f64 = 1e-5;

/// Relative motion beyond this fraction of the smaller radius may tunnel, or be resolved to the
/// wrong side, because the end of a step no longer tells where they met. Such marbles are stopped.
pub(super) const MAX_FREE_MOTION: f64 = 0.5;

/// Maximum number of bends of a path in a substep: two surfaces hold a marble to an edge, three to
/// a corner, and a bowl of triangles has one after the other.
const MAX_BENDS: u32 = 4;

/// State and scratch memory of continuous collision detection in a substep.
#[derive(Clone, Debug, Default)]
pub(super) struct Continuous<S> {
    /// Positions before the substep in metres, and velocities in m/s.
    pub start: Vec<Point3<S>>,
    pub velocity: Vec<Vec3<S>>,
    /// Stops of this substep; and by index, if stopped, the projection by which a position still
    /// follows a velocity: the free directions, times the remaining fraction of the substep.
    stops: Vec<StoppedMarble<S>>,
    pub projections: Vec<Option<Mat3<S>>>,
    /// By row, rotations of the capsules that walls stopped; empty if they stopped none.
    pub turns: Vec<Turn<S>>,
    /// Pairs that meet within the substep, stopped or not.
    pub grazes: Vec<(u32, u32)>,
    middle: Vec<Point3<S>>,
    reach: Vec<S>,
    /// Rows that move so far that they may meet others on the way.
    fast: Vec<bool>,
    /// Candidate pairs, the lower row first.
    candidates: Vec<(u32, u32)>,
    partners: Partners,
    meetings: BinaryHeap<Reverse<Meeting<S>>>,
    paths: Vec<Path<S>>,
    /// Bends at walls by marble, in the order of time.
    bends: Vec<Bend<S>>,
    /// Walls that move within the substep.
    moving_walls: Vec<MovingWall<S>>,
    /// Marbles that were half inside of a wall, sorted.
    deep: Vec<u32>,
    /// By row, who would bounce off a half-space within reach of others; empty if nobody.
    crowded: Vec<bool>,
    near: Vec<bool>,
    /// Positions before they follow the velocity changes of contacts, in metres.
    bounced_from: Vec<Point3<S>>,
}

/// A marble that was stopped.
#[derive(Clone, Copy, Debug)]
pub(super) struct StoppedMarble<S> {
    pub row: u32,
    /// Index of the wall or marble that stopped it.
    obstacle: Obstacle,
    /// Lost displacement in metres, and lost velocity change by forces in m/s.
    displacement: Vec3<S>,
    change: Vec3<S>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Obstacle {
    Wall(u32),
    Marble(u32),
}

impl<S: Scalar> World<S> {
    /// Stores the positions before marbles move, if the model has continuous detection.
    pub(super) fn begin_continuous(&mut self) {
        if self.settings.model.detection == Detection::Swept {
            self.scratch.continuous.start.extend_from_slice(&self.marbles.position);
            self.scratch.continuous.velocity.extend_from_slice(&self.marbles.velocity);
        }
    }

    /// Drops stops of marbles that have slid off: their lost motion stays lost.
    pub(super) fn drop_separated_stops(&mut self) {
        if !self.scratch.continuous.stops.is_empty() {
            let touches = self.touches();
            self.scratch.continuous.stops.retain(touches);
        }
    }

    /// Releases marbles whose stopping contact the user has removed.
    pub(super) fn release_separated_stops(&mut self) {
        if self.scratch.continuous.start.len() != self.marbles.len() {
            self.scratch.continuous.clear(); // rows have changed
        }
        if self.scratch.continuous.stops.is_empty() {
            return;
        }
        let touches = self.touches();
        self.scratch.continuous.stops.retain(|stop| {
            let row = stop.row as usize;
            if !touches(stop) {
                self.marbles.position[row] += stop.displacement;
                self.marbles.velocity[row] += stop.change;
                self.scratch.continuous.projections[row] = None;
            }
            touches(stop)
        });
    }

    /// Stores positions before contacts move marbles, if detection is swept: walls stop what they push.
    pub(super) fn begin_bounces(&mut self) {
        if self.scratch.continuous.start.len() == self.marbles.len() {
            self.store_positions_before_contacts();
        }
    }

    /// Stores positions before the swarm pushes marbles, unless discrete detection lets these pass walls.
    pub(super) fn begin_pushes(&mut self) {
        self.scratch.continuous.bounced_from.clear();
        let Model { detection, response, .. } = self.settings.model;
        if detection == Detection::Swept || response.never_passes_walls() {
            self.store_positions_before_contacts();
        }
    }

    /// Stores positions before contacts move marbles, so that walls stop what they push.
    pub(super) fn store_positions_before_contacts(&mut self) {
        let bounced_from = &mut self.scratch.continuous.bounced_from;
        bounced_from.clear();
        bounced_from.extend_from_slice(&self.marbles.position);
    }

    /// Predicate: the two bodies of a stop have a contact.
    fn touches(&self) -> impl Fn(&StoppedMarble<S>) -> bool + use<S> {
        let mut stopped: Vec<_> =
            self.scratch.continuous.stops.iter().map(|stop| stop.row).collect();
        stopped.sort_unstable();
        let walls = self.contacts.wm.iter().map(|c| (Obstacle::Wall(c.a), c.b));
        let both = |c: &Contact<S>| [(Obstacle::Marble(c.a), c.b), (Obstacle::Marble(c.b), c.a)];
        let contacts = walls.chain(self.contacts.mm.iter().flat_map(both));
        let its = contacts.filter(|(_, row)| stopped.binary_search(row).is_ok());
        let touches: HashSet<_> = its.collect();
        move |stop| touches.contains(&(stop.obstacle, stop.row))
    }

    /// Largest approach in metres per substep of a resting contact: that of gravity in two
    /// substeps.
    pub(super) fn resting_approach(&self, dt: S) -> S {
        length(self.settings.gravity) * dt * dt * S::from_f64(2.0)
    }
}

impl<S: Scalar> Continuous<S> {
    /// Lists by row how walls stopped it; nothing if they stopped none.
    pub fn list_wall_stops(&self, stops: &mut Vec<Option<WallStop<S>>>) {
        stops.clear();
        if !self.bends.is_empty() {
            stops.resize(self.start.len(), None);
        }
        for Bend { stop, displacement, carried, left, .. } in &self.bends {
            let Obstacle::Wall(wall) = stop.obstacle else { continue };
            let its = &mut stops[stop.row as usize];
            let before = its.map_or_else(Vec3::zero, |stop| stop.lost);
            let lost = before + stop.displacement;
            *its = Some(WallStop { wall, lost, since: *displacement - *carried, fraction: *left });
        }
    }

    /// Records a stop and the remaining freedom of the marble.
    fn stop(&mut self, stopped: StoppedMarble<S>, along: Mat3<S>) {
        self.projections.resize(self.start.len(), None);
        let free = &mut self.projections[stopped.row as usize];
        *free = Some(free.map_or(along, |free| along * free));
        self.stops.push(stopped);
    }

    /// Sets the rotation of a capsule.
    fn set_turn(&mut self, row: usize, turn: Turn<S>) {
        self.turns.resize(self.start.len(), Turn::default());
        self.turns[row] = turn;
    }

    /// Clears the state of the last substep.
    pub fn clear(&mut self) {
        self.start.clear();
        self.velocity.clear();
        self.stops.clear();
        self.projections.clear();
        self.turns.clear();
        self.grazes.clear();
        self.bends.clear();
        self.moving_walls.clear();
        self.deep.clear();
        self.bounced_from.clear();
        self.crowded.clear();
    }
}

/// Outer product: projection onto a unit vector.
fn outer<S: Scalar>(v: Vec3<S>) -> Mat3<S> {
    Mat3::from_cols(v * v.x, v * v.y, v * v.z)
}
