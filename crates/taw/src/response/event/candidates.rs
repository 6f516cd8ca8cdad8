//! Candidate walls: the walls that a ball may touch. Searched ball by ball, within the distance
//! that it can travel, so that a ball on a large mesh gets only some of its triangles; searched
//! again when it gets further.

use std::collections::BTreeMap;

use cgmath::InnerSpace;
use smallvec::SmallVec;

use super::{EventBall, EventSettings, EventSolver, SEAM_TOLERANCE, Wall};
use crate::broad::CollisionFilter;
use crate::math::Point3;

/// Search range in cells of the grid; enough for most balls.
const MAX_CELLS_AROUND: f64 = 4.0;
/// Number of sub-shapes up to which a ball searches further than that.
const FEW_PARTS: usize = 32;
/// Cost of a search, besides the sub-shapes found.
const SEARCH_COST: u64 = 64;
/// Fraction of the searched range after which a ball searches again.
const REFRESH_FRACTION: f64 = 0.9;
/// Extra range over the radius, so that a ball at rest need not search again.
const EXTRA_RANGE: f64 = 1e-3;

/// Walls of the world, as the event-driven solver reads them.
pub(crate) trait WallSource {
    /// Visits all half-spaces.
    fn planes(&self, visit: &mut dyn FnMut(u32));
    /// True if there are walls other than half-spaces.
    fn has_parts(&self) -> bool;
    /// Visits sub-shapes of other walls that may come within `range` metres of a point in this
    /// substep.
    fn near(&self, point: Point3<f64>, range: f64, visit: &mut dyn FnMut(u32, u32));
    /// Returns a sub-shape of a wall.
    fn wall(&self, row: u32, part: u32) -> Option<Wall>;
}

/// Candidate walls of all balls in a substep.
#[derive(Clone, Debug, Default)]
pub(super) struct WallCandidates {
    /// Index in the list of walls, by row and sub-shape.
    index: BTreeMap<(u32, u32), u32>,
    ids: Vec<(u32, u32)>,
    previous_ids: Vec<(u32, u32)>,
    planes: Vec<u32>,
    has_parts: bool,
    /// Candidate walls, ball after ball.
    lists: Vec<CandidateWall>,
    per_ball: Vec<BallCandidates>,
}

/// Candidate walls of one ball: all within its radius of any point at most `covered` metres from
/// `center`.
#[derive(Clone, Copy, Debug)]
struct BallCandidates {
    center: Point3<f64>,
    /// Range that was searched, in metres.
    covered: f64,
    /// Range of its walls in `lists`.
    walls: [usize; 2],
}

/// Candidate wall of a ball, in the order of distances.
#[derive(Clone, Copy, Debug)]
pub(super) struct CandidateWall {
    /// Lower bound of the distance from the center of the search, in metres; minus infinity for a
    /// wall that moves.
    distance: f64,
    wall: u32,
}

/// Range of a search for the candidate walls of a ball.
#[derive(Clone, Copy, Debug)]
struct CandidateSearch {
    center: Point3<f64>,
    /// Range to be searched, in metres.
    covered: f64,
    /// Upper bound of its travel in the rest of the substep, in metres.
    max_range: f64,
}

impl EventSolver {
    /// Finds the candidate walls of all balls at the start of a substep.
    pub(super) fn find_candidates(&mut self, settings: &EventSettings) {
        let source = settings.source;
        let mut candidates = std::mem::take(&mut self.candidates);
        std::mem::swap(&mut candidates.ids, &mut candidates.previous_ids);
        candidates.ids.clear();
        candidates.lists.clear();
        candidates.per_ball.clear();
        candidates.has_parts = source.has_parts();
        let mut flat = Vec::new();
        source.planes(&mut |row| flat.push((row, 0)));
        flat.sort_unstable();
        candidates.ids.extend_from_slice(&flat);
        let mut searches = Vec::new();
        if candidates.has_parts {
            for row in 0..self.balls.len() {
                let search = self.search_range(row, 0.0, settings);
                let ids = self.ids_within(row, &search, settings);
                candidates.ids.extend_from_slice(&ids);
                searches.push((search, ids));
            }
        }
        candidates.ids.sort_unstable();
        candidates.ids.dedup();
        self.walls.clear();
        let walls = &mut self.walls;
        candidates
            .ids
            .retain(|(row, part)| source.wall(*row, *part).map(|wall| walls.push(wall)).is_some());
        if candidates.ids != candidates.previous_ids {
            self.impulse_cache.clear(); // its keys are indices of walls
        }
        candidates.index = candidates.ids.iter().copied().zip(0..).collect();
        candidates.planes.clear();
        candidates.planes.extend(flat.iter().filter_map(|id| candidates.index.get(id).copied()));
        self.candidates = candidates;
        for (row, (search, ids)) in searches.into_iter().enumerate() {
            let known = self.list_candidates(row, search, ids, settings);
            self.candidates.per_ball.push(known);
        }
    }

    /// Searches the candidate walls of a ball again.
    fn refresh_candidates(&mut self, row: usize, now: f64, settings: &EventSettings) {
        let search = self.search_range(row, now, settings);
        let ids = self.ids_within(row, &search, settings);
        self.candidates.per_ball[row] = self.list_candidates(row, search, ids, settings);
    }

    /// Lists the candidate walls of a ball: those found, or as far as they are few, those up to the
    /// distance that it can travel.
    fn list_candidates(
        &mut self,
        row: usize,
        mut search: CandidateSearch,
        mut ids: Vec<(u32, u32)>,
        settings: &EventSettings,
    ) -> BallCandidates {
        while ids.len() <= FEW_PARTS && search.covered < search.max_range {
            let next =
                CandidateSearch { covered: search.max_range.min(2.0 * search.covered), ..search };
            let next_ids = self.ids_within(row, &next, settings);
            if next_ids.len() > FEW_PARTS {
                break;
            }
            (search, ids) = (next, next_ids);
        }
        let CandidateSearch { center, covered, .. } = search;
        let max_distance = covered + self.margin(row);
        let Self { candidates: WallCandidates { index, lists, .. }, walls, ignored, .. } = self;
        let ignored = ignored.walls_of(row as u32);
        let filter = CollisionFilter { layers: self.balls[row].layers, ignored };
        let start = lists.len();
        lists.extend(ids.into_iter().filter_map(|(row, part)| {
            let number = index.get(&(row, part)).copied().or_else(|| {
                walls.push(settings.source.wall(row, part)?);
                let number = walls.len() as u32 - 1;
                index.insert((row, part), number);
                Some(number)
            })?;
            let wall = &walls[number as usize];
            let distance = match wall.motion_at(0.0) {
                Some(_) => f64::NEG_INFINITY,
                None => wall.distance_lower_bound(center, 0.0),
            };
            let is_candidate = distance <= max_distance && filter.meets_wall(wall.row, wall.layers);
            is_candidate.then_some(CandidateWall { distance, wall: number })
        }));
        settings.add_cost((lists.len() - start) as u64 * super::PART_COST);
        lists[start..]
            .sort_unstable_by(|x, y| x.distance.total_cmp(&y.distance).then(x.wall.cmp(&y.wall)));
        BallCandidates { center, covered, walls: [start, lists.len()] }
    }

    /// Sub-shapes of walls within the range of a search.
    fn ids_within(
        &self,
        row: usize,
        search: &CandidateSearch,
        settings: &EventSettings,
    ) -> Vec<(u32, u32)> {
        let (mut ids, range) = (Vec::new(), search.covered + self.margin(row));
        settings.source.near(search.center, range, &mut |row, part| ids.push((row, part)));
        settings.add_cost(ids.len() as u64 + SEARCH_COST);
        ids
    }

    /// Time until a ball may leave the range of its candidates, in seconds from now; none within
    /// this substep. Searches first if needed.
    pub(super) fn candidates_expiry(
        &mut self,
        row: usize,
        now: f64,
        settings: &EventSettings,
    ) -> Option<f64> {
        self.ensure_candidates(row, now, settings);
        let ball = &self.balls[row];
        let (at, remaining) = (ball.position_at(now), settings.dt - now);
        let BallCandidates { center, covered, .. } = *self.candidates.per_ball.get(row)?;
        let travelled = (at - center).magnitude();
        // Between refresh and end of the range, so that each search makes progress.
        let distance = 0.5 * (1.0 + REFRESH_FRACTION) * covered - travelled;
        let speed = ball.velocity_at(now).magnitude();
        // Lower bound of the travel time at this speed and the largest acceleration.
        let time = 2.0 * distance
            / (speed + (speed * speed + 2.0 * max_acceleration(ball) * distance).sqrt());
        // Non-finite balls keep their candidates.
        (time > 0.0 && time < remaining).then_some(time)
    }

    /// Searches again if a ball is close to the end of its range.
    pub(super) fn ensure_candidates(&mut self, row: usize, now: f64, settings: &EventSettings) {
        let at = self.balls[row].position_at(now);
        let Some(BallCandidates { center, covered, .. }) = self.candidates.per_ball.get(row) else {
            return;
        };
        if (at - *center).magnitude() >= REFRESH_FRACTION * covered {
            self.refresh_candidates(row, now, settings);
        }
    }

    /// Range of a first search around a ball.
    fn search_range(&self, row: usize, now: f64, settings: &EventSettings) -> CandidateSearch {
        let ball = &self.balls[row];
        let remaining = settings.dt - now;
        let max_range =
            2.0 * max_speed(ball, now, remaining) * remaining + EXTRA_RANGE * ball.radius;
        let covered = max_range.min(MAX_CELLS_AROUND * self.cells.min_width());
        CandidateSearch { center: ball.position_at(now), covered, max_range }
    }

    fn margin(&self, row: usize) -> f64 {
        let ball = &self.balls[row];
        ball.radius * (1.0 + SEAM_TOLERANCE) + ball.position_error
    }

    /// Visits the candidate walls of a ball that move, are half-spaces, or may be within a distance
    /// of a point, in metres. Returns the cost of testing them.
    pub(super) fn for_each_wall_within(
        &self,
        row: usize,
        (point, distance): (Point3<f64>, f64),
        mut visit: impl FnMut(usize),
    ) -> u64 {
        let parts = self.parts_within(row, (point, distance));
        let mut cost = super::PART_COST * parts.len() as u64;
        for wall in self.planes_of(row) {
            cost += 1;
            visit(wall as usize);
        }
        parts.into_iter().for_each(|wall| visit(wall as usize));
        cost
    }

    /// Candidate walls other than half-spaces that move or may be within a distance of a point, in
    /// metres, in the order of their indices.
    pub(super) fn parts_within(
        &self,
        row: usize,
        (point, distance): (Point3<f64>, f64),
    ) -> SmallVec<[u32; 32]> {
        let parts = self.parts_of(row);
        let (Some(known), Some(first)) = (self.candidates.per_ball.get(row), parts.first()) else {
            return SmallVec::new();
        };
        let travel = (point - known.center).magnitude();
        // A shorter way crosses no surface, so that no distance falls by more than that.
        let travel = if travel < first.distance { travel } else { f64::INFINITY };
        let may_be_near = |candidate: &&CandidateWall| candidate.distance - travel <= distance;
        let is_near = |number: &u32| {
            let wall = &self.walls[*number as usize];
            wall.motion_at(0.0).is_some() || wall.distance_lower_bound(point, 0.0) <= distance
        };
        let near = parts.iter().take_while(may_be_near).map(|candidate| candidate.wall);
        let mut near: SmallVec<_> = near.filter(is_near).collect();
        near.sort_unstable();
        near
    }

    /// Candidate walls of a ball other than half-spaces.
    pub(super) fn parts_of(&self, row: usize) -> &[CandidateWall] {
        let [start, end] = self.candidates.per_ball.get(row).map_or([0; 2], |known| known.walls);
        &self.candidates.lists[start..end]
    }

    /// Half-spaces that a ball collides with.
    pub(super) fn planes_of(&self, row: usize) -> impl Iterator<Item = u32> {
        let filter = self.filter(row);
        let collides = move |wall: &u32| {
            let wall = &self.walls[*wall as usize];
            filter.meets_wall(wall.row, wall.layers)
        };
        self.candidates.planes.iter().copied().filter(collides)
    }
}

/// Upper bound of a ball's speed over the next `remaining` seconds without an event, in m/s.
fn max_speed(ball: &EventBall, now: f64, remaining: f64) -> f64 {
    ball.velocity_at(now).magnitude() + max_acceleration(ball) * remaining
}

/// Upper bound of a ball's acceleration without contacts, in m/s².
fn max_acceleration(ball: &EventBall) -> f64 {
    ball.external_acceleration.magnitude().max(ball.trajectory.acceleration.magnitude())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::broad::CollisionLayers;
    use crate::math::Vec3;
    use crate::response::event::{Trajectory, WallCollider};
    use crate::response::{BallRotation, Material};
    use crate::shape::{Shape, Sphere};
    use cgmath::Zero;

    /// Ten thousand sub-shapes, all at the same distance in metres.
    struct Crowd(f64);

    impl WallSource for Crowd {
        fn planes(&self, _: &mut dyn FnMut(u32)) {}

        fn has_parts(&self) -> bool {
            true
        }

        fn near(&self, _: Point3<f64>, range: f64, visit: &mut dyn FnMut(u32, u32)) {
            (0..10_000).filter(|_| range >= self.0).for_each(|part| visit(0, part));
        }

        fn wall(&self, row: u32, _: u32) -> Option<Wall> {
            let sphere = Sphere::new(Point3::new(self.0, 0.0, 0.0), 1e-3).ok()?;
            let collider = WallCollider::Solid(Shape::Sphere(sphere));
            let bounds = collider.bounds();
            let (motion, arrival_time, material) = (None, None, None);
            Some(Wall {
                collider,
                bounds,
                row,
                part: 0,
                motion,
                arrival_time,
                material,
                layers: CollisionLayers::ALL,
                relative_rounding: 0.0,
            })
        }
    }

    #[test]
    fn a_fast_ball_looks_as_far_as_walls_are_few_and_no_farther() {
        let ball = EventBall {
            position: Point3::new(0.0, 0.0, 0.0),
            velocity: Vec3::unit_x() * 1e6,
            spin: Vec3::zero(),
            external_acceleration: Vec3::zero(),
            radius: 0.1,
            inverse_mass: 1.0,
            material: Material::default(),
            layers: CollisionLayers::ALL,
            rotation: BallRotation::Free,
            position_error: 0.0,
            rotation_increment: Vec3::zero(),
            trajectory: Trajectory::default(),
        };
        for (distance, covered) in [(10.0, 5.0..10.0), (1e9, 2e4..1e9)] {
            let mut method = EventSolver { balls: vec![ball], ..EventSolver::default() };
            let source = &Crowd(distance);
            let settings = EventSettings {
                threads: 1,
                dt: 0.01,
                iterations: 8,
                gravity: Vec3::new(0.0, 0.0, 0.0),
                source,
                budget_fraction: 1.0,
                cost: 0.into(),
            };
            method.assign_cells(settings.dt);
            method.find_candidates(&settings);
            assert!(
                covered.contains(&method.candidates.per_ball[0].covered),
                "{:?}",
                method.candidates.per_ball
            );
            assert_eq!(method.parts_of(0).len(), 0);
        }
    }
}
