//! Which walls a ball can come to. Found ball by ball, by how far it can go, so that one on a
//! large mesh knows some of its triangles only; looked for again when it gets farther.

use std::collections::BTreeMap;

use cgmath::InnerSpace;

use super::{Ball, EventDriven, FLUSH, Settings, Wall};
use crate::math::Point3;

/// A ball that knows the walls this many cells around needs to know no more yet.
const MOST_CELLS: f64 = 4.0;
/// A ball looks farther than that for as long as it finds no more parts of walls.
const FEW_PARTS: usize = 32;
/// A ball that looks around counts as so many looks, besides the parts that it finds.
const LOOK_AROUND: u64 = 64;
/// After this part of how far it may go, a ball looks around anew.
const NEAR_THE_END: f64 = 0.9;
/// A part of a radius that is added to how far a ball can go, so that one at rest need not
/// look again.
const MORE: f64 = 1e-3;

/// Where walls come from.
pub(crate) trait Source {
    /// Names all half-spaces.
    fn planes(&self, name: &mut dyn FnMut(u32));
    /// Tests for walls other than half-spaces.
    fn has_parts(&self) -> bool;
    /// Names the parts of other walls that may come within `reach` metres of a point in this
    /// substep.
    fn near(&self, point: Point3<f64>, reach: f64, name: &mut dyn FnMut(u32, u32));
    /// A part of a wall.
    fn wall(&self, row: u32, part: u32) -> Option<Wall>;
}

/// Candidate walls of all balls in a substep.
#[derive(Clone, Debug, Default)]
pub(super) struct Reach {
    /// The places in the list of walls of all that are known, by row and part.
    index: BTreeMap<(u32, u32), u32>,
    names: Vec<(u32, u32)>,
    before: Vec<(u32, u32)>,
    planes: Vec<u32>,
    has_parts: bool,
    /// Indices of candidate walls, ball after ball.
    lists: Vec<u32>,
    known: Vec<Known>,
}

/// Candidate walls of a ball: all within its radius of any point at most `far` metres from `center`.
#[derive(Clone, Copy, Debug)]
struct Known {
    center: Point3<f64>,
    /// Distance of that place from the center, at most, in metres.
    far: f64,
    /// Where its walls are in the lists.
    walls: [usize; 2],
}

impl EventDriven {
    /// Finds the walls that balls may come to.
    pub(super) fn find_walls(&mut self, settings: &Settings) {
        let source = settings.source;
        let mut reach = std::mem::take(&mut self.reach);
        std::mem::swap(&mut reach.names, &mut reach.before);
        reach.names.clear();
        reach.lists.clear();
        reach.known.clear();
        reach.has_parts = source.has_parts();
        source.planes(&mut |row| reach.names.push((row, 0)));
        let planes = reach.names.len();
        if reach.has_parts {
            for row in 0..self.balls.len() {
                let (center, far) = self.place(row, 0.0, settings);
                let name = &mut |row, part| reach.names.push((row, part));
                let far = far.min(MOST_CELLS * self.cells.least_width());
                source.near(center, far + self.margin(row), name);
            }
        }
        let mut flat = reach.names[..planes].to_vec();
        flat.sort_unstable();
        reach.names.sort_unstable();
        reach.names.dedup();
        self.walls.clear();
        let walls = &mut self.walls;
        reach
            .names
            .retain(|(row, part)| source.wall(*row, *part).map(|wall| walls.push(wall)).is_some());
        if reach.names != reach.before {
            self.warm.clear(); // it knows walls by their places
        }
        reach.index.clear();
        reach.index.extend(reach.names.iter().copied().zip(0..));
        reach.planes.clear();
        reach.planes.extend(flat.iter().filter_map(|name| reach.index.get(name).copied()));
        self.reach = reach;
        if self.reach.has_parts {
            for row in 0..self.balls.len() {
                let nothing = Known { center: self.balls[row].position, far: -1.0, walls: [0; 2] };
                self.reach.known.push(nothing);
                self.look_around(row, 0.0, settings);
            }
        }
    }

    /// Has a ball know all walls that it may come to from now on, or as far as those are few.
    pub(super) fn look_around(&mut self, row: usize, now: f64, settings: &Settings) {
        let (center, farthest) = self.place(row, now, settings);
        let margin = self.margin(row);
        let mut far = farthest.min(MOST_CELLS * self.cells.least_width());
        let names_near = |far: f64| {
            let mut names = Vec::new();
            settings.source.near(center, far + margin, &mut |row, part| names.push((row, part)));
            settings.count(names.len() as u64 + LOOK_AROUND);
            names
        };
        let mut names = names_near(far);
        while names.len() <= FEW_PARTS && far < farthest {
            let farther = farthest.min(2.0 * far);
            let more = names_near(farther);
            if more.len() > FEW_PARTS {
                break;
            }
            (far, names) = (farther, more);
        }
        let Self { reach: Reach { index, lists, known, .. }, walls, .. } = self;
        let from = lists.len();
        lists.extend(names.into_iter().filter_map(|(row, part)| {
            index.get(&(row, part)).copied().or_else(|| {
                walls.push(settings.source.wall(row, part)?);
                let place = walls.len() as u32 - 1;
                index.insert((row, part), place);
                Some(place)
            })
        }));
        settings.count((lists.len() - from) as u64 * super::PART_LOOKS);
        lists[from..].sort_unstable();
        known[row] = Known { center, far, walls: [from, lists.len()] };
    }

    /// When a ball may come to walls that it does not know, in seconds from now; none if it
    /// cannot in this substep. It looks around before.
    pub(super) fn end_of_reach(
        &mut self,
        row: usize,
        now: f64,
        settings: &Settings,
    ) -> Option<f64> {
        self.look_where_it_is(row, now, settings);
        let ball = &self.balls[row];
        let (at, left) = (ball.position_at(now), settings.dt - now);
        let Known { center, far, .. } = *self.reach.known.get(row)?;
        let gone = (at - center).magnitude();
        // Between the two, so that each look brings it on.
        let way = 0.5 * (1.0 + NEAR_THE_END) * far - gone;
        let speed = ball.velocity_at(now).magnitude();
        // The earliest end of a way at that speed and strongest acceleration.
        let time = 2.0 * way / (speed + (speed * speed + 2.0 * strongest(ball) * way).sqrt());
        // What is not finite knows what it knows.
        (time > 0.0 && time < left).then_some(time)
    }

    /// Has a ball look around that came to where walls may be that it does not know.
    pub(super) fn look_where_it_is(&mut self, row: usize, now: f64, settings: &Settings) {
        let at = self.balls[row].position_at(now);
        let Some(Known { center, far, .. }) = self.reach.known.get(row) else { return };
        if (at - *center).magnitude() >= NEAR_THE_END * far {
            self.look_around(row, now, settings);
        }
    }

    /// Position of a ball, and the farthest that it can go in the rest of the substep, in metres.
    fn place(&self, row: usize, now: f64, settings: &Settings) -> (Point3<f64>, f64) {
        let ball = &self.balls[row];
        let left = settings.dt - now;
        let far = 2.0 * fastest(ball, now, left) * left + MORE * ball.radius;
        (ball.position_at(now), far)
    }

    fn margin(&self, row: usize) -> f64 {
        let ball = &self.balls[row];
        ball.radius * (1.0 + FLUSH) + ball.rounding
    }

    /// Names the walls that a ball may touch before its reach ends.
    pub(super) fn name_walls(&self, row: usize, mut name: impl FnMut(usize)) {
        self.reach.planes.iter().for_each(|wall| name(*wall as usize));
        self.parts_of(row).iter().for_each(|wall| name(*wall as usize));
    }

    /// Candidate walls of a ball, but for half-spaces.
    pub(super) fn parts_of(&self, row: usize) -> &[u32] {
        let [from, to] = self.reach.known.get(row).map_or([0; 2], |known| known.walls);
        &self.reach.lists[from..to]
    }

    /// Indices of all half-spaces.
    pub(super) fn half_spaces(&self) -> &[u32] {
        &self.reach.planes
    }

    /// Cost of testing a ball against all its candidate walls, in looks.
    pub(super) fn looks_at_walls(&self, row: usize) -> u64 {
        self.reach.planes.len() as u64 + super::PART_LOOKS * self.parts_of(row).len() as u64
    }
}

/// Upper bound of a ball's speed over the next `left` seconds without an event, in m/s.
fn fastest(ball: &Ball, now: f64, left: f64) -> f64 {
    ball.velocity_at(now).magnitude() + strongest(ball) * left
}

/// Acceleration of a ball that nothing hits, at most, in m/s².
fn strongest(ball: &Ball) -> f64 {
    ball.pull.magnitude().max(ball.path.acceleration.magnitude())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::response::event::{Form, Path};
    use crate::response::{BallSpin, Material};
    use crate::shape::{Shape, Sphere};
    use cgmath::Zero;

    /// Ten thousand parts, all of them so many metres away.
    struct Crowd(f64);

    impl Source for Crowd {
        fn planes(&self, _: &mut dyn FnMut(u32)) {}

        fn has_parts(&self) -> bool {
            true
        }

        fn near(&self, _: Point3<f64>, reach: f64, name: &mut dyn FnMut(u32, u32)) {
            (0..10_000).filter(|_| reach >= self.0).for_each(|part| name(0, part));
        }

        fn wall(&self, row: u32, _: u32) -> Option<Wall> {
            let sphere = Sphere::new(Point3::new(self.0, 0.0, 0.0), 1e-3).ok()?;
            let form = Form::Solid(Shape::Sphere(sphere));
            let bounds = form.bounds();
            let (motion, there, material) = (None, None, None);
            Some(Wall { form, bounds, row, motion, there, material, digit: 0.0 })
        }
    }

    #[test]
    fn a_fast_ball_looks_as_far_as_walls_are_few_and_no_farther() {
        let ball = Ball {
            position: Point3::new(0.0, 0.0, 0.0),
            velocity: Vec3::unit_x() * 1e6,
            spin: Vec3::zero(),
            pull: Vec3::zero(),
            radius: 0.1,
            inverse_mass: 1.0,
            material: Material::default(),
            spins: BallSpin::Free,
            rounding: 0.0,
            turned: Vec3::zero(),
            path: Path::default(),
        };
        for (away, far) in [(10.0, 5.0..10.0), (1e9, 2e4..1e9)] {
            let mut method = EventDriven { balls: vec![ball], ..EventDriven::default() };
            let source = &Crowd(away);
            let settings = Settings { dt: 0.01, iterations: 8, source, looks: 0.into() };
            method.find_homes(settings.dt);
            method.find_walls(&settings);
            assert!(far.contains(&method.reach.known[0].far), "{:?}", method.reach.known);
            assert_eq!(method.parts_of(0).len(), 0);
        }
    }
}
