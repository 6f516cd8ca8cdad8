//! The iterations of the impulse method: velocities that all contacts agree on.

use cgmath::{InnerSpace, Zero};

use super::islands::{DIRECTIONS, Go, Island, Islands};
use super::{Constraint, Settings};
use crate::math::{Scalar, Vec3, is_finite, length};
use crate::response::Columns;
use crate::response::impact::at_most;

/// Sweeps over the contacts until they agree, or as often as the settings allow, in those
/// islands that do not agree yet.
///
/// Sweep by sweep alone (Gauss and Seidel), a heavy marble on a light one would take as
/// many sweeps as it is times as heavy. So after each sweep the solver looks, of all impulses that
/// are some of this sweep and some of the ways that it went before, for the best ones: sweeps as
/// preconditioner of a search in a small subspace, as in Anderson's mixing (*Iterative procedures
/// for nonlinear integral equations*, 1965) and, for contacts, Silcowitz, Niebe and Erleben, *A
/// nonsmooth nonlinear conjugate gradient method for interactive contact force problems*, 2010.
///
/// With `f` the impulses, `A f` the change of velocity that they make at the contacts and `w`
/// the change that the contacts ask for, sweeps and searches lower `½ f·A f − f·w`, the
/// energy of what is still wanted. Sweeps end the iterations, never a search.
pub(super) fn solve<S: Scalar>(
    marbles: &mut Columns<S>,
    constraints: &mut [Constraint<S>],
    islands: &mut Islands<S>,
    settings: &Settings<S>,
) {
    for sweep in 0..settings.iterations {
        for c in constraints.iter_mut() {
            if islands.of(c).agrees {
                continue;
            }
            islands.solved += 1;
            let before = c.impulse();
            let change = marbles.solve(c);
            c.ways[0] = c.impulse() - before;
            let island = islands.of_mut(c);
            if change > island.change && change > marbles.rounding(c) {
                island.change = change;
            }
        }
        let last = sweep + 1 == settings.iterations;
        if islands.end_sweep(settings.bounce_speed, settings.enough) || last {
            break;
        }
        marbles.go_on(constraints, islands);
    }
}

impl<S: Scalar> Constraint<S> {
    /// The impulse along the normal and across it that is next to this one and that a contact
    /// can bear: nothing pulls, and friction is bounded by Coulomb's cone.
    fn within_cone(&self, impulse: Vec3<S>) -> (S, Vec3<S>) {
        let along = impulse.dot(self.normal);
        let pressure = along.max(self.least);
        (pressure, at_most(impulse - self.normal * along, self.hold(pressure)))
    }

    /// As much of a change of its impulse as it can bear.
    fn way_within_cone(&self, way: Vec3<S>) -> Vec3<S> {
        let (pressure, grip) = self.within_cone(self.impulse() + way);
        self.normal * (pressure - self.pressure) + (grip - self.grip)
    }

    /// Up to which part of a change of its impulse it still pushes.
    fn bears_until(&self, way: Vec3<S>) -> S {
        let along = way.dot(self.normal);
        if along < S::zero() { (self.least - self.pressure) / along } else { S::infinity() }
    }

    /// What friction can be at most beside this pressure.
    fn hold(&self, pressure: S) -> S {
        self.friction * pressure + self.bound
    }
}

impl<S: Scalar> Columns<'_, S> {
    /// The relative velocity of a contact's two points, in m/s.
    pub(super) fn closing_of(&self, c: &Constraint<S>) -> Vec3<S> {
        self.closing(c.a, c.b, c.along, c.normal, c.surface)
    }

    /// Rounding of the velocities that a contact sees, in m/s. Below it, sweeps would only push
    /// what is fast to one side.
    pub(super) fn rounding(&self, c: &Constraint<S>) -> S {
        let speed = |row: usize| self.velocity[row].magnitude();
        (speed(c.b) + c.a.marble().map_or_else(S::zero, speed)) * S::epsilon()
    }

    /// The change of relative velocity that a contact still asks for, in m/s.
    fn wanted(&self, c: &Constraint<S>) -> Vec3<S> {
        c.normal * c.rebound + c.slide - self.closing_of(c)
    }

    /// One step toward what a contact asks for. Gives the change of velocity.
    fn solve(&mut self, c: &mut Constraint<S>) -> S {
        let wanted = self.wanted(c);
        let along = wanted.dot(c.normal);
        let pressure = (c.pressure + along).max(c.least);
        let across = (wanted - c.normal * along) * (c.mobility.normal / c.mobility.tangent);
        let grip = at_most(c.grip + across, c.hold(pressure));
        let change = c.normal * (pressure - c.pressure) + (grip - c.grip);
        if !is_finite(change) {
            return S::zero(); // an overflow here must not reach the other one
        }
        (c.pressure, c.grip) = (pressure, grip);
        self.hit_both(c, change);
        self.resist(c);
        change.magnitude()
    }

    /// Goes on from a sweep: along it and the ways before, as far along each as brings the contacts
    /// of each island nearest to what they ask for.
    fn go_on(&mut self, constraints: &mut [Constraint<S>], islands: &mut Islands<S>) {
        islands.list.iter_mut().for_each(Island::begin_search);
        for c in constraints.iter_mut() {
            let Some(island) = islands.searching(c) else { continue };
            if c.pressure <= S::zero() {
                c.ways = [Vec3::zero(); DIRECTIONS]; // it parts, and bears nothing
            } else if island.bounces
                || length(c.grip) >= c.hold(c.pressure) * (S::one() - S::epsilon())
            {
                // It slides, whichever way it does. Or rebounds ask for what friction in a
                // corner cannot give, and both would grow against each other without end.
                c.ways = c.ways.map(|way| c.normal * way.dot(c.normal));
            }
            c.wanted = self.wanted(c);
        }
        for c in constraints.iter().filter(|c| islands.of(c).searches) {
            self.hit_both(c, c.ways[0]);
        }
        for c in constraints.iter_mut() {
            let Some(island) = islands.searching(c) else { continue };
            c.given[0] = c.wanted - self.wanted(c);
            island.count_directions(c, self.rounding(c));
        }
        islands.list.iter_mut().for_each(Island::choose_parts);
        // Within the cones: what a contact cannot bear would throw others about.
        for c in constraints.iter_mut() {
            let Some(island) = islands.searching(c) else { continue };
            let (far, given) = (island.combine(&c.ways), island.combine(&c.given));
            let way = c.way_within_cone(far);
            let bend = way - far;
            let across = bend - c.normal * bend.dot(c.normal);
            let rounding = (c.pressure + length(far)) * S::epsilon();
            island.count_cone(c.bears_until(far), length(across) > rounding);
            self.hit_both(c, way - c.ways[0]);
            // The oldest way makes room.
            (c.ways, c.given) = ([far, way, c.ways[1]], [given, Vec3::zero(), c.given[1]]);
        }
        for c in constraints.iter_mut() {
            let Some(island) = islands.searching(c) else { continue };
            c.given[1] = c.wanted - self.wanted(c);
            island.count_bent(c, c.ways[1], c.given[1]);
        }
        for c in constraints.iter_mut() {
            let Some(island) = islands.searching(c) else { continue };
            let (way, given) = match island.go() {
                Go::Bent(part) => (c.ways[1] * part, c.given[1] * part),
                Go::Straight(part) => (c.ways[0] * part, c.given[0] * part),
            };
            self.hit_both(c, way - c.ways[1]);
            // Between two points of a cone lies nothing outside of it, but for rounding.
            (c.pressure, c.grip) = c.within_cone(c.impulse() + way);
            (c.ways[1], c.given[1]) = (way, given);
        }
    }

    /// One step toward no relative spin, as far as the resistances can.
    fn resist(&mut self, c: &mut Constraint<S>) {
        let Some(resistance) = c.resistance else { return };
        let wanted = resistance.twist - self.turning(c) / resistance.give;
        let force = c.pressure / c.mobility.normal;
        let about = c.normal * wanted.dot(c.normal);
        let twist = at_most(wanted - about, resistance.rolling * force)
            + at_most(about, resistance.spinning * force);
        let change = twist - resistance.twist;
        if is_finite(change) {
            c.resistance = Some(super::Resistance { twist, ..resistance });
            self.twist_both(c, change);
        }
    }

    /// How the second of a contact turns against the first, in rad/s.
    pub(super) fn turning(&self, c: &Constraint<S>) -> Vec3<S> {
        let first = c.a.marble().map_or_else(Vec3::zero, |a| self.felt_spin(a));
        self.felt_spin(c.b) - first
    }
}
