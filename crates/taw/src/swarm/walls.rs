use std::ops::Range;

use cgmath::{EuclideanSpace, InnerSpace, Zero};

use super::Tier;
use super::guests::Guest;
use super::kernels::squared;
use super::lanes::{Instructions, Kernel, LANES, Lanes, Row};
use super::memory::make_room;
use super::slab::Slab;
use super::touch::Touch;
use crate::math::{Point3, Vec3};
use crate::response::Material;

/// Walls of the world, as the balls of a swarm meet them.
pub(crate) trait Surroundings: Sync {
    /// Names all half-spaces: the wall, its normal, and how far along it the surface is.
    fn planes(&self, name: &mut dyn FnMut(u32, Vec3<f32>, f32));
    /// Says if there is anything else, and if some of it may be in a box.
    fn has_shapes(&self) -> bool;
    fn near(&self, low: [f32; 3], high: [f32; 3]) -> bool;
    /// Names what else is within `reach` metres of a ball, without the seams: the wall and its
    /// part, the normal, and the distance of the center.
    fn shapes_at(&self, ball: &Row, reach: f32, name: &mut dyn FnMut([u32; 2], Vec3<f32>, f32));
    /// The part that a ball first meets on its way, likewise: with the normal where they meet, and
    /// how far the center is from the plane across that place.
    fn first_on_way(&self, ball: &Row, way: Vec3<f32>) -> Option<([u32; 2], Vec3<f32>, f32)>;
    /// In m/s, and the wall's own material.
    fn surface_velocity(&self, wall: u32, point: Point3<f32>) -> Vec3<f32>;
    fn material(&self, wall: u32) -> Option<Material<f32>>;
}

/// A half-space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HalfSpace {
    wall: u32,
    pub normal: Vec3<f32>,
    pub offset: f32,
    friction: f32,
    restitution: f32,
}

/// The columns that say which balls may come to a wall.
#[derive(Clone, Copy)]
pub(super) struct Balls<'a> {
    pub at: &'a [Row],
    pub velocity: &'a [Row],
    pub budget: &'a [f32],
    /// In seconds; none in the lab's tier, where balls have moved already, and the velocities are
    /// the places before.
    pub ahead: Option<f32>,
}

impl Balls<'_> {
    /// Way of a ball before walls are sought again: its budget, or more if it is so fast
    /// that it leaves that in a step.
    #[inline(always)]
    pub fn reach(&self, row: usize) -> f32 {
        let (velocity, at) = (self.velocity[row], self.at[row]);
        let way = match self.ahead {
            Some(ahead) => squared(velocity).sqrt() * ahead,
            None => squared([0, 1, 2, 0].map(|axis| at[axis] - velocity[axis])).sqrt(),
        };
        self.budget[row].max(way)
    }
}

/// All half-spaces.
pub(super) fn half_spaces(
    walls: &dyn Surroundings,
    material: Material<f32>,
    planes: &mut Vec<HalfSpace>,
) {
    planes.clear();
    walls.planes(&mut |wall, normal, offset| {
        let Material { friction, restitution, .. } = against(walls, wall, material);
        planes.push(HalfSpace { wall, normal, offset, friction, restitution });
    });
}

fn against(walls: &dyn Surroundings, wall: u32, material: Material<f32>) -> Material<f32> {
    walls.material(wall).map_or(material, |its| material.combined_with(its))
}

fn center(at: &Row) -> Point3<f32> {
    Point3::new(at[0], at[1], at[2])
}

impl Slab {
    /// Finds the balls at walls anew. `recall` knows what they bore.
    pub fn seek_walls(
        &mut self,
        instructions: Instructions,
        balls: Balls,
        planes: &[HalfSpace],
        recall: impl Fn(&Touch) -> Option<Touch>,
    ) {
        self.touches.clear();
        self.near_planes.clear();
        if planes.is_empty() {
            return;
        }
        let (rows, found) = (self.own_rows(), &mut self.near_planes);
        instructions.run(NearPlanes { balls, planes, rows, found });
        for row in &self.near_planes {
            let touches = &mut self.touches;
            touch_planes(*row, balls, planes, |mut touch| {
                if let Some(before) = recall(&touch) {
                    touch.recall(&before);
                }
                make_room(touches, touches.len() + 1);
                touches.push(touch);
            });
        }
    }

    /// Takes over what the balls near other shapes than half-spaces bore there. Which parts they
    /// touch now is looked at before the next pass.
    pub fn recall_shapes<T: Iterator<Item = Touch>>(&mut self, recall: impl Fn(u32) -> T) {
        let planes = self.touches.len();
        for touch in self.near_shapes.iter().flat_map(|row| recall(*row)) {
            let touches = &mut self.touches;
            make_room(touches, touches.len() + 1);
            touches.push(touch);
        }
        if self.touches.len() > planes {
            self.touches.sort_unstable_by_key(Touch::key);
        }
    }

    /// Finds the half-spaces near some more balls of the slab.
    pub fn seek_walls_for(&mut self, rows: &[u32], balls: Balls, planes: &[HalfSpace]) {
        std::mem::swap(&mut self.touches, &mut self.old_touches);
        self.touches.clear();
        let old = &self.old_touches;
        // Which parts of other shapes are touched is looked at before the next pass, which needs to
        // know what they bore.
        let kept = |touch: &&Touch| !touch.is_plane || rows.binary_search(&touch.row).is_err();
        self.touches.extend(old.iter().filter(kept));
        for row in rows {
            let touches = &mut self.touches;
            touch_planes(*row, balls, planes, |touch| {
                touches.push(find(old, &touch).copied().unwrap_or(touch));
            });
        }
        self.touches.sort_unstable_by_key(Touch::key);
    }

    /// Brings the balls at walls up to date: how walls move, and which part of a shape is
    /// touched. That of fast balls only, where others know it already.
    pub fn look_at_walls(&mut self, walls: &dyn Surroundings, look: &Look, only_fast: bool) {
        if !self.near_shapes.is_empty() {
            self.touch_shapes(walls, look, only_fast);
        }
        for touch in &mut self.touches {
            let ball = &look.at[touch.row as usize];
            let point = center(ball) - touch.normal * ball[3];
            touch.bears_guest = false;
            touch.surface = walls.surface_velocity(touch.wall, point);
            touch.offset = touch.offset_at_end;
            touch.drift(-look.before);
        }
    }

    fn touch_shapes(&mut self, walls: &dyn Surroundings, look: &Look, only_fast: bool) {
        std::mem::swap(&mut self.touches, &mut self.old_touches);
        self.touches.clear();
        let old = &self.old_touches;
        let kept = |touch: &&Touch| touch.is_plane || only_fast && look.way(touch.row).is_none();
        self.touches.extend(old.iter().filter(kept));
        self.has_fast = false;
        for row in &self.near_shapes {
            let way = look.way(*row);
            let ball = &look.ball(*row, way);
            if only_fast && way.is_none() {
                continue;
            }
            let first = self.touches.len();
            let touches = &mut self.touches;
            let mut name = |ball: &Row, [wall, part]: [u32; 2], normal: Vec3<f32>, distance| {
                let named = touches[first..].iter();
                if named.into_iter().any(|touch| [touch.wall, touch.part] == [wall, part]) {
                    return;
                }
                let Material { friction, restitution, .. } = against(walls, wall, look.material);
                let offset = normal.dot(center(ball).to_vec()) - distance;
                let mut touch =
                    Touch::new(*row, [wall, part], normal, offset, [friction, restitution]);
                touch.is_plane = false;
                if let Some(same) = find(old, &touch) {
                    touch.recall(same);
                }
                touches.push(touch);
            };
            let mut reach = look.budget[*row as usize].max(0.0);
            if let Some(way) = way {
                self.has_fast = true;
                reach = way.magnitude().min(FAST * ball[3]);
                on_way(walls, ball, way, &mut name);
            }
            walls.shapes_at(ball, reach, &mut |part, normal, distance| {
                name(ball, part, normal, distance);
            });
        }
        self.touches.sort_unstable_by_key(Touch::key);
    }
}

/// Names the walls that a ball meets on its way, and along those that it met.
fn on_way(
    walls: &dyn Surroundings,
    ball: &Row,
    way: Vec3<f32>,
    name: &mut impl FnMut(&Row, [u32; 2], Vec3<f32>, f32),
) {
    let (mut ball, mut way) = (*ball, way);
    // In a corner, it meets three.
    for _ in 0..3 {
        if way.magnitude() <= FAST * ball[3] {
            return;
        }
        let Some((part, normal, distance)) = walls.first_on_way(&ball, way) else { return };
        name(&ball, part, normal, distance);
        let closing = -way.dot(normal);
        if closing.is_nan() || closing <= 0.0 {
            return;
        }
        let time = ((distance - ball[3]) / closing).clamp(0.0, 1.0);
        for (x, way) in ball.iter_mut().zip::<[f32; 3]>(way.into()) {
            *x += way * time;
        }
        way = (way + normal * closing) * (1.0 - time);
    }
}

/// A ball that goes further than this in a step, in radii, is fast: the plane across the nearest
/// point of a wall says little about where it meets it, so it is looked where that is, and again
/// in each substep.
const FAST: f32 = 0.5;

/// Facts that a look at walls needs.
#[derive(Clone, Copy)]
pub(super) struct Look<'a> {
    pub tier: Tier,
    pub at: &'a [Row],
    /// In the lab's tier, where they were: there, they have moved already.
    pub velocity: &'a [Row],
    pub budget: &'a [f32],
    pub material: Material<f32>,
    /// Walls are where they will be at the end of the step; so long before, in seconds, they were
    /// elsewhere.
    pub before: f32,
    /// Lengths of a step and of a substep, in seconds.
    pub times: [f32; 2],
    pub gravity: Vec3<f32>,
}

impl Look<'_> {
    /// Way of a fast ball in a substep, in metres; none for slow ones.
    fn way(&self, row: u32) -> Option<Vec3<f32>> {
        let (at, [u, v, w, _]) = (&self.at[row as usize], self.velocity[row as usize]);
        let [step, substep] = match self.tier {
            Tier::Lab => [Vec3::new(at[0] - u, at[1] - v, at[2] - w); 2],
            Tier::Full => {
                self.times.map(|time| Vec3::new(u, v, w) * time + self.gravity * (time * time))
            }
        };
        (step.magnitude2() > FAST * FAST * at[3] * at[3]).then_some(substep)
    }

    /// A ball where its way begins.
    fn ball(&self, row: u32, way: Option<Vec3<f32>>) -> Row {
        let at = self.at[row as usize];
        match (self.tier, way) {
            (Tier::Lab, Some(way)) => [at[0] - way.x, at[1] - way.y, at[2] - way.z, at[3]],
            _ => at,
        }
    }
}

impl HalfSpace {
    /// Moves a guest out, but for how deep it was inside.
    pub fn bear(&self, guest: &Guest, at: &mut Row) {
        let gap = |ball: &Row| self.normal.dot(center(ball).to_vec()) - self.offset - ball[3];
        let by = (gap(&guest.at).min(0.0) - gap(at)).max(0.0);
        for (x, normal) in at.iter_mut().zip::<[f32; 3]>(self.normal.into()) {
            *x += normal * by;
        }
    }
}

/// Names the half-spaces as far as to which a ball may go.
fn touch_planes(row: u32, balls: Balls, planes: &[HalfSpace], mut name: impl FnMut(Touch)) {
    let (ball, reach) = (&balls.at[row as usize], balls.reach(row as usize));
    for plane in planes {
        let HalfSpace { wall, normal, offset, friction, restitution } = *plane;
        let gap = normal.dot(center(ball).to_vec()) - offset - ball[3];
        // A wall may also come nearer; who moves it seeks again.
        if gap < reach {
            name(Touch::new(row, [wall, 0], normal, offset, [friction, restitution]));
        }
    }
}

/// Finds the balls that may go as far as to a half-space.
struct NearPlanes<'a> {
    balls: Balls<'a>,
    planes: &'a [HalfSpace],
    rows: Range<usize>,
    found: &'a mut Vec<u32>,
}

impl Kernel for NearPlanes<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { balls, planes, rows, found } = self;
        let mut first = rows.start;
        while first + LANES <= rows.end {
            // SAFETY: there are eight.
            let [x, y, z, radius] =
                unsafe { L::gather(balls.at[first..].as_ptr(), &[0, 1, 2, 3, 4, 5, 6, 7]) };
            let mut budget = [0.0; LANES];
            for (lane, budget) in budget.iter_mut().enumerate() {
                *budget = balls.reach(first + lane);
            }
            let budget = L::load(&budget);
            let reach = radius + budget;
            let mut near = 0;
            for HalfSpace { normal, offset, .. } in planes {
                let along =
                    L::splat(normal.x) * x + L::splat(normal.y) * y + L::splat(normal.z) * z;
                // Rather one too many: the caller looks more closely.
                near |= (L::splat(*offset) + reach * L::splat(1.001)).above(along);
            }
            while near != 0 {
                found.push(first as u32 + near.trailing_zeros());
                near &= near - 1;
            }
            first += LANES;
        }
        found.extend(first as u32..rows.end as u32);
    }
}

/// The one of the same ball and wall, among many in order.
pub(super) fn find<'a>(touches: &'a [Touch], touch: &Touch) -> Option<&'a Touch> {
    let at = touches.binary_search_by_key(&touch.key(), Touch::key).ok()?;
    touches.get(at)
}

/// The touches of a ball with other shapes than half-spaces, among many in order.
pub(super) fn shapes_of(touches: &[Touch], row: u32) -> impl Iterator<Item = &Touch> {
    let first = touches.partition_point(|touch| touch.row < row);
    let of_row = touches[first..].iter().take_while(move |touch| touch.row == row);
    of_row.filter(|touch| !touch.is_plane)
}

/// The rows among these that are near anything but half-spaces, found by ever smaller boxes.
pub(super) fn near_shapes(
    walls: &dyn Surroundings,
    balls: Balls,
    rows: Range<usize>,
    found: &mut Vec<u32>,
) {
    let (mut low, mut high) = ([f32::MAX; 3], [f32::MIN; 3]);
    for row in rows.clone() {
        let (ball, reach) = (&balls.at[row], balls.at[row][3] + balls.reach(row));
        for axis in 0..3 {
            low[axis] = low[axis].min(ball[axis] - reach);
            high[axis] = high[axis].max(ball[axis] + reach);
        }
    }
    if rows.is_empty() || !walls.near(low, high) {
        return;
    }
    if rows.len() == 1 {
        found.push(rows.start as u32);
        return;
    }
    // Neighbours in the order are neighbours in space.
    let middle = rows.start + rows.len() / 2;
    near_shapes(walls, balls, rows.start..middle, found);
    near_shapes(walls, balls, middle..rows.end, found);
}

impl Touch {
    fn new(
        row: u32,
        [wall, part]: [u32; 2],
        normal: Vec3<f32>,
        offset: f32,
        [friction, restitution]: [f32; 2],
    ) -> Self {
        Self {
            row,
            wall,
            part,
            is_plane: true,
            bears_guest: false,
            normal,
            offset,
            offset_at_end: offset,
            surface: Vec3::zero(),
            friction,
            restitution,
            borne_for_others: 0.0,
            pressure: 0.0,
            grip: Vec3::zero(),
        }
    }

    /// Key of their order.
    pub fn key(&self) -> (u32, u32, u32) {
        (self.row, self.wall, self.part)
    }
}
