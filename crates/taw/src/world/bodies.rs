//! Rigid bodies of a world: in the third verb of [`SoftStep`](crate::response::Response::SoftStep), and their sleep.

use cgmath::{InnerSpace, Zero};

use super::World;
use super::body_contacts::{BodyCandidates, MARGIN, NearBall, grown};
use crate::Error;
use crate::body::{BodyContact, BodyPartner, BodyState, BodySystem, SolverBody};
use crate::contact::touch_goes_on;
use crate::handle::NO_ROW;
use crate::math::{Scalar, UnionFind, Vec3, cast_point, cast_vector};
use crate::motion::rest;
use crate::shape::{Aabb, Aabb3, Bvh};

/// Gravity and identity of the walls by which bodies fell asleep, and scratch memory.
#[derive(Clone, Debug, Default)]
pub(super) struct BodyScratch<S> {
    gravity: Option<Vec3<S>>,
    walls: u64,
    islands: UnionFind,
}

impl<S: Scalar> World<S> {
    /// Refuses bodies where the response has no method for them.
    pub(super) fn check_bodies(&self) -> Result<(), Error> {
        if self.bodies.is_empty() || self.settings.model.response.knows_bodies() {
            return Ok(());
        }
        Err(Error::Unsupported {
            response: "a response other than SoftStep",
            feature: "rigid bodies",
        })
    }

    /// Gives bodies and their contacts to the solver for a step of `dt` seconds.
    pub(super) fn give_bodies(&mut self, dt: S) {
        self.bodies.stopped.clear();
        self.wake_at_changed_bodies();
        if self.bodies.is_empty() {
            self.keep_balls_awake();
            return;
        }
        self.wake_touching();
        self.wake_bodies_beside_changes();
        for id in &self.scratch.soft_step.jointed.rigid {
            if let Ok(row) = self.bodies.row(*id) {
                self.bodies.states[row].wake(); // what is joined does not sleep
            }
        }
        let gravity: Vec3<f64> = cast_vector(self.settings.gravity);
        let step = dt.as_f64();
        for state in &mut self.bodies.states {
            let [force, torque] = std::mem::replace(&mut state.force, [Vec3::zero(); 2]);
            if !state.is_dynamic() {
                continue;
            }
            let solver = &mut state.solver;
            solver.acceleration =
                gravity * state.body.gravity_scale.as_f64() + force * solver.inverse_mass;
            solver.damping = state.body.damping.map(S::as_f64);
            solver.turn(torque * step);
        }
        let system = self.find_body_contacts(dt);
        self.swarm.set_rigid_bodies(system);
    }

    /// Takes bodies and their contacts back from the solver.
    pub(super) fn take_bodies(&mut self, dt: S) {
        if self.bodies.is_empty() {
            return;
        }
        let BodySystem { bodies, mut contacts, .. } = self.swarm.take_rigid_bodies();
        let mut stopped = Vec::new();
        for (row, (state, solver)) in self.bodies.states.iter_mut().zip(&bodies).enumerate() {
            if state.asleep {
                continue;
            }
            if solver.is_finite_in::<S>() {
                state.solver = *solver;
                continue;
            }
            state.solver.stop();
            stopped.push(row);
        }
        let lies = self.bodies_that_lie(&bodies, &contacts);
        self.bodies.stopped = stopped.into_iter().filter_map(|row| self.bodies.id(row)).collect();
        let stopped = &self.bodies.stopped;
        contacts.retain(|contact| !stopped.iter().any(|id| contact.is_of(*id)));
        self.note_touches(&mut contacts, dt.as_f64());
        self.keep_contacts(contacts);
        self.update_body_sleep(&lies, dt);
    }

    /// Wakes bodies that touch a ball or a body which does not rest, or touched a ball that is gone.
    fn wake_touching(&mut self) {
        let awake_balls = self.bodies.touching_balls().filter(|it| !self.swarm.rests(it.0));
        let mut touched: Vec<_> = awake_balls.map(|(_, row)| row).collect();
        let states = &self.bodies.states;
        for contact in self.bodies.contacts.iter().filter(|contact| contact.touches) {
            if let BodyPartner::Body(other) = contact.key.partner
                && let (Ok(a), Ok(b)) = (self.bodies.row(other), self.bodies.row(contact.key.body))
                && states[a].asleep != states[b].asleep
                && states[a].is_dynamic()
                && states[b].is_dynamic()
            {
                touched.extend([a, b]);
            }
        }
        for row in touched {
            self.bodies.wake_island(row); // no other but sleepers
        }
    }

    /// Keeps balls awake that touch a body which is: the two fall asleep together.
    pub(super) fn keep_balls_awake(&mut self) {
        let (bodies, swarm) = (&self.bodies, &mut self.swarm);
        let held = bodies.touching_balls().filter(|(_, row)| !bodies.states[*row].is_still());
        swarm.hold_awake(held.map(|(ball, _)| ball));
    }

    /// Remembers contacts, those of sleepers too, which were not looked for.
    fn keep_contacts(&mut self, contacts: Vec<BodyContact>) {
        let before = std::mem::replace(&mut self.bodies.contacts, contacts);
        let is_still = |id| self.bodies.row(id).is_ok_and(|row| self.bodies.states[row].is_still());
        let slept = |contact: &BodyContact| {
            is_still(contact.key.body)
                && match contact.key.partner {
                    BodyPartner::Body(other) => is_still(other),
                    BodyPartner::Ball(ball) => self.swarm.is_asleep(ball),
                    BodyPartner::Wall(wall) => self.walls.row(wall).is_ok(),
                }
        };
        let mut kept: Vec<_> = before.into_iter().filter(slept).collect();
        if !kept.is_empty() {
            for point in kept.iter_mut().flat_map(|contact| &mut contact.points) {
                point.fastest = [0.0; 2]; // nothing moves
            }
            self.bodies.contacts.extend(kept);
            self.bodies.contacts.sort_by_key(|contact| contact.key);
            self.bodies.contacts.dedup_by_key(|contact| contact.key);
        }
    }

    /// Wakes all bodies if gravity changed, and those near walls that did.
    fn wake_bodies_beside_changes(&mut self) {
        let gravity = Some(self.settings.gravity);
        let walls = self.walls.identity();
        let all = std::mem::replace(&mut self.scratch.bodies.gravity, gravity) != gravity;
        let since = std::mem::replace(&mut self.scratch.bodies.walls, walls);
        if all {
            self.bodies.states.iter_mut().for_each(BodyState::wake);
        } else if since != walls {
            self.wake_bodies_at_walls(since);
        }
    }

    /// Wakes the bodies near walls that changed since these had this identity.
    fn wake_bodies_at_walls(&mut self, since: u64) {
        let mut regions: Vec<Aabb3<f64>> = Vec::new();
        let cast =
            |region: &Aabb3<S>| Aabb { min: cast_point(region.min), max: cast_point(region.max) };
        let are_known =
            self.walls.changes().visit_since(since, |region| regions.push(cast(region)));
        regions.extend(self.walls.turning_regions().map(|region| cast(&region)));
        for row in 0..self.bodies.states.len() {
            let state = &self.bodies.states[row];
            if !state.asleep {
                continue;
            }
            let bounds = grown(&state.bounds(), MARGIN * state.reach);
            if !are_known || regions.iter().any(|region| region.overlaps(&bounds)) {
                self.bodies.wake_island(row);
            }
        }
    }

    /// Wakes bodies that others come near to, and balls that bodies do. Returns true if a body woke.
    pub(super) fn wake_disturbed_bodies(&mut self, candidates: &BodyCandidates<S>) -> bool {
        let states = &self.bodies.states;
        let gravity = cast_vector::<S, f64>(self.settings.gravity).magnitude();
        let is_fast = |speed: f64, reach: f64| speed > rest::sleep_speed(gravity, reach);
        let is_driven = |state: &BodyState<S>| !state.is_dynamic() && state.speed() > 0.0;
        // What is heavy stirs what is light also where it is slow.
        let stirs = |state: &BodyState<S>, inverse_mass: f64, reach: f64| {
            let share = (inverse_mass / state.solver.inverse_mass).max(1.0);
            is_driven(state) || !state.asleep && is_fast(state.speed() * share, reach)
        };
        let mut bodies = Vec::new();
        if states.iter().any(|state| state.asleep) {
            for near in candidates.list.iter().filter(|it| states[it.row].speed() > 0.0) {
                let state = &states[near.row];
                candidates.for_each_in_box(&near.bounds, |other| {
                    let BodyState { solver, reach, asleep, .. } = &states[other.row];
                    if *asleep && stirs(state, solver.inverse_mass, reach.min(state.reach)) {
                        bodies.push(other.row);
                    }
                });
            }
        }
        let mut balls = Vec::new();
        for NearBall { ball, row, .. } in &candidates.balls {
            let state = &states[*row];
            let radius = ball.radius();
            if ball.is_asleep {
                if stirs(state, ball.inverse_mass, radius) {
                    balls.push(ball.row);
                }
            } else if state.asleep {
                let speed = cast_vector::<S, f64>(ball.velocity).magnitude();
                let share = (state.solver.inverse_mass / ball.inverse_mass).max(1.0);
                if is_fast(speed * share, radius) {
                    bodies.push(*row);
                }
            }
        }
        for row in balls {
            self.swarm.wake_row(row);
        }
        let any = !bodies.is_empty();
        for row in bodies {
            self.bodies.wake_island(row);
        }
        any
    }

    /// Wakes the bodies and balls where bodies came, went or changed.
    fn wake_at_changed_bodies(&mut self) {
        let regions = std::mem::take(&mut self.bodies.changed_regions);
        if regions.is_empty() {
            return;
        }
        let tree = Bvh::new(&regions);
        let is_near = |bounds: &Aabb3<f64>| {
            let mut any = false;
            tree.for_each_in_box(bounds, |at| any |= regions[at as usize].overlaps(bounds));
            any
        };
        let balls = self.swarm.ball_views().filter(|ball| {
            let center = Aabb { min: ball.center(), max: ball.center() };
            ball.is_asleep && is_near(&grown(&center, ball.radius() * (1.0 + MARGIN)))
        });
        let balls: Vec<_> = balls.map(|ball| ball.row).collect();
        for row in balls {
            self.swarm.wake_row(row);
        }
        for row in 0..self.bodies.states.len() {
            let state = &self.bodies.states[row];
            if state.asleep && is_near(&grown(&state.bounds(), MARGIN * state.reach)) {
                self.bodies.wake_island(row);
            }
        }
    }

    /// Notes which contacts touch, from when they first bear something until a gap opens, and with which points.
    fn note_touches(&self, contacts: &mut [BodyContact], dt: f64) {
        let h = dt / f64::from(self.settings.model.substeps.max(1));
        let fall = cast_vector::<S, f64>(self.settings.gravity).magnitude() * h * h;
        let reach = |row: u32| self.bodies.states.get(row as usize).map(|state| state.reach);
        for contact in contacts {
            let [partner, body] = contact.bodies.map(reach);
            let partner = match contact.key.partner {
                BodyPartner::Ball(_) => Some(contact.radii[0]),
                _ => partner, // walls are larger than bodies
            };
            let smaller = partner.into_iter().chain(body).fold(f64::INFINITY, f64::min);
            let goes_on = |separation| touch_goes_on(separation, smaller, fall);
            contact.touches = contact.bore() || contact.touches && goes_on(contact.separation());
            for point in &mut contact.points {
                let is_near = point.total.normal > 0.0 || goes_on(point.separation);
                point.touches = contact.touches && is_near;
            }
        }
    }

    /// True for each body that lies on something, and on nothing that drives it: a wall or a kinematic body that
    /// moves, or a surface that does.
    fn bodies_that_lie(&self, solver: &[SolverBody], contacts: &[BodyContact]) -> Vec<bool> {
        let mut lies = vec![false; self.bodies.len()];
        let mut is_driven = vec![false; self.bodies.len()];
        for contact in contacts.iter().filter(|contact| contact.bore()) {
            let ends = contact.bodies.map(|body| body as usize);
            for (body, other) in [(ends[0], ends[1]), (ends[1], ends[0])] {
                if body < lies.len() {
                    let other = &solver[other];
                    let moves = !other.velocity.is_zero() || !other.spin.is_zero();
                    lies[body] = true;
                    is_driven[body] |= other.slot == NO_ROW && other.inverse_mass == 0.0 && moves;
                }
            }
        }
        lies.iter().zip(is_driven).map(|(lies, is_driven)| *lies && !is_driven).collect()
    }

    /// Lets islands of bodies that have all rested long enough fall asleep. `lies` says which lie on something.
    fn update_body_sleep(&mut self, lies: &[bool], dt: S) {
        let gravity = cast_vector::<S, f64>(self.settings.gravity).magnitude();
        let sleeps = self.swarm.model().sleeps;
        for (state, lies) in self.bodies.states.iter_mut().zip(lies) {
            let may = sleeps && !state.body.sleeping_disabled && state.is_dynamic();
            if !state.asleep {
                state.pass_rest(gravity, *lies && may, dt.as_f64());
            }
        }
        let (states, islands) = (&self.bodies.states, &mut self.scratch.bodies.islands);
        islands.reset(states.len());
        for contact in self.bodies.contacts.iter().filter(|contact| contact.touches) {
            let BodyPartner::Body(other) = contact.key.partner else { continue };
            let (Ok(a), Ok(b)) = (self.bodies.row(other), self.bodies.row(contact.key.body)) else {
                continue;
            };
            if states[a].is_dynamic() && states[b].is_dynamic() {
                islands.join(a, b);
            }
        }
        let mut restless = vec![false; states.len()];
        let of_row: Vec<_> = (0..states.len()).map(|row| islands.set_of(row) as usize).collect();
        for (state, island) in states.iter().zip(&of_row) {
            restless[*island] |= !state.asleep && !state.may_sleep(gravity);
        }
        for (ball, row) in self.bodies.touching_balls() {
            restless[of_row[row]] |= !self.swarm.rests(ball);
        }
        for (state, island) in self.bodies.states.iter_mut().zip(&of_row) {
            if state.is_dynamic() && !restless[*island] && !state.asleep {
                state.fall_asleep();
            }
        }
    }
}
