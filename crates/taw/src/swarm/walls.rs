use std::ops::Range;

use cgmath::{EuclideanSpace, InnerSpace, Zero};

use super::chunk::Chunk;
use super::impulse_cache::reserve_slack;
use super::kernels::squared;
use super::proxies::Proxy;
use super::surfaces::{SurfaceOf, WallNumbers};
use super::wall_contact::WallContact;
use super::wall_paths::WallQuery;
use crate::broad::{CollisionFilter, CollisionLayers};
use crate::constraint::ContactImpulse;
use crate::math::{Kernel, LANES, Point3, Row, Scalar, Simd, SimdLevel, Vec3, is_finite};
use crate::response::Material;

/// Static and kinematic colliders of the world, as the balls of a swarm meet them.
pub(crate) trait StaticGeometry<S>: Sync {
    /// Visits all half-spaces: the wall, its normal, and the offset of the surface along it, in
    /// metres.
    fn planes(&self, visit: &mut dyn FnMut(u32, Vec3<S>, S));
    /// Visits the boxes in which walls changed since they had this identity. Returns false if all may
    /// have.
    fn visit_changes_since(&self, identity: u64, visit: &mut dyn FnMut([[S; 3]; 2])) -> bool;
    /// Visits the removals of walls since they had this identity, in order: the row of the wall, and
    /// that whose wall moved there. Returns false if they are not known.
    fn visit_removals_since(&self, identity: u64, visit: &mut dyn FnMut([u32; 2])) -> bool;
    /// Tests if there are shapes other than half-spaces.
    fn has_shapes(&self) -> bool;
    /// Tests if one of these may be in a box.
    fn near(&self, low: [S; 3], high: [S; 3]) -> bool;
    /// Visits what else is within `reach` metres of a ball and collides with it by this filter, without
    /// ghost collisions: the wall and its part, the normal, and the distance of the center.
    fn shapes_at(
        &self,
        ball: &Row<S>,
        filter: CollisionFilter,
        reach: S,
        visit: &mut dyn FnMut([u32; 2], Vec3<S>, S),
    );
    /// The part that a ball first meets on its way, likewise: with the normal where they meet, and
    /// how far the center is from the plane across that place.
    fn first_hit_on_path(
        &self,
        ball: &Row<S>,
        filter: CollisionFilter,
        displacement: Vec3<S>,
    ) -> Option<([u32; 2], Vec3<S>, S)>;
    /// Returns true if a wall may pass a ball within the step of which it goes `way` metres: one that goes
    /// further itself than the ball is wide.
    fn is_outrun(&self, ball: &Row<S>, way: S, filter: CollisionFilter) -> bool;
    /// Visits the parts of such walls, which the other visits leave out: what the ball touches, and what
    /// it meets on its way. The distance is that from the plane as it will be at the end of the step. The
    /// times are what is left of the step and what the way takes, in seconds.
    fn outrunning_at(
        &self,
        ball: &Row<S>,
        filter: CollisionFilter,
        displacement: Vec3<S>,
        times: [S; 2],
        visit: &mut dyn FnMut([u32; 2], Vec3<S>, S),
    );
    /// Plane that a part is like where a ball first touches it on its way, or else where that ends: its
    /// normal, and the distance of the center, where it is now, from that plane as it is at the end of the
    /// step. Where another part covers it, the plane of that; none if half-spaces do. The way is a displacement in
    /// metres; the times are what is left of the step and what the way takes, in seconds.
    fn plane_on_way(
        &self,
        part: [u32; 2],
        ball: &Row<S>,
        filter: CollisionFilter,
        way: (Vec3<S>, [S; 2]),
    ) -> Option<(Vec3<S>, S)>;
    /// Part that a ball first touches on its way, and the plane that it is like there, likewise.
    fn first_touch(
        &self,
        ball: &Row<S>,
        filter: CollisionFilter,
        way: (Vec3<S>, [S; 2]),
    ) -> Option<([u32; 2], Vec3<S>, S)>;
    /// Center, in metres, at which a ball ends that surfaces stop on its way between two places; none if
    /// none stops it. `before_end` holds the times of both places, in seconds before the end of the step.
    fn stop_passage(
        &self,
        places: [&Row<S>; 2],
        filter: CollisionFilter,
        before_end: [S; 2],
    ) -> Option<[S; 3]>;
    /// Layers of a wall.
    fn layers(&self, wall: u32) -> CollisionLayers;
    /// Velocity of the surface at a point with this normal, in m/s.
    fn surface_velocity(&self, wall: u32, point: Point3<S>, normal: Vec3<S>) -> Vec3<S>;
    /// The wall's own material.
    fn material(&self, wall: u32) -> Option<Material<S>>;
}

/// A half-space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HalfSpace<S> {
    pub wall: u32,
    pub normal: Vec3<S>,
    pub offset: S,
    /// Of the wall itself, if it has one.
    material: Option<Material<S>>,
    pub layers: CollisionLayers,
}

/// The columns that say which balls may come to a wall.
#[derive(Clone, Copy)]
pub(super) struct Balls<'a, S> {
    pub at: &'a [Row<S>],
    pub velocity: &'a [Row<S>],
    pub skin_left: &'a [S],
    /// In seconds; none in the lab's tier, where balls have moved already, and the velocities are
    /// the places before.
    pub ahead: Option<S>,
    pub surfaces: SurfaceOf<'a, S>,
}

impl<S: Scalar> Balls<'_, S> {
    /// Displacement of a ball before walls are searched again: its remaining skin, or more if it is
    /// so fast that it leaves that in a step.
    #[inline(always)]
    pub fn reach(&self, row: usize) -> S {
        let (velocity, at) = (self.velocity[row], self.at[row]);
        let displacement = match self.ahead {
            Some(ahead) => squared(velocity).sqrt() * ahead,
            None => squared([0, 1, 2, 0].map(|axis| at[axis] - velocity[axis])).sqrt(),
        };
        self.skin_left[row].max(displacement)
    }
}

/// All half-spaces.
pub(super) fn half_spaces<S: Scalar>(
    walls: &dyn StaticGeometry<S>,
    planes: &mut Vec<HalfSpace<S>>,
) {
    planes.clear();
    walls.planes(&mut |wall, normal, offset| {
        let (material, layers) = (walls.material(wall), walls.layers(wall));
        planes.push(HalfSpace { wall, normal, offset, material, layers });
    });
}

pub(super) fn center<S: Scalar>(at: &Row<S>) -> Point3<S> {
    Point3::new(at[0], at[1], at[2])
}

impl<S: Scalar> Chunk<S> {
    /// Finds the balls at walls. `restore` looks up their cached contacts.
    pub fn find_wall_contacts(
        &mut self,
        simd_level: SimdLevel,
        balls: Balls<S>,
        planes: &[HalfSpace<S>],
        restore: impl Fn(&WallContact<S>) -> Option<WallContact<S>>,
    ) {
        self.wall_contacts.clear();
        self.near_planes.clear();
        if planes.is_empty() {
            return;
        }
        let (rows, found) = (self.own_rows(), &mut self.near_planes);
        simd_level.run(NearPlanes { balls, planes, rows, found });
        for row in &self.near_planes {
            let wall_contacts = &mut self.wall_contacts;
            find_plane_contacts(*row, balls, planes, |mut contact| {
                if let Some(before) = restore(&contact) {
                    contact.restore(&before);
                }
                reserve_slack(wall_contacts, wall_contacts.len() + 1);
                wall_contacts.push(contact);
            });
        }
    }

    /// Takes over the impulses of balls near shapes other than half-spaces. Which parts they
    /// touch now is looked at before the next pass.
    pub fn restore_shape_contacts<T: Iterator<Item = WallContact<S>>>(
        &mut self,
        restore: impl Fn(u32) -> T,
    ) {
        let planes = self.wall_contacts.len();
        for contact in self.near_shapes.iter().flat_map(|row| restore(*row)) {
            let wall_contacts = &mut self.wall_contacts;
            reserve_slack(wall_contacts, wall_contacts.len() + 1);
            wall_contacts.push(contact);
        }
        if self.wall_contacts.len() > planes {
            self.wall_contacts.sort_unstable_by_key(WallContact::key);
        }
    }

    /// Finds the half-spaces near some more balls of the chunk.
    pub fn find_wall_contacts_of(
        &mut self,
        rows: &[u32],
        balls: Balls<S>,
        planes: &[HalfSpace<S>],
    ) {
        std::mem::swap(&mut self.wall_contacts, &mut self.old_wall_contacts);
        self.wall_contacts.clear();
        let old = &self.old_wall_contacts;
        // Which parts of other shapes are touched is looked at before the next pass, which needs to
        // know their impulses.
        let kept = |contact: &&WallContact<S>| {
            !contact.is_plane || rows.binary_search(&contact.row).is_err()
        };
        self.wall_contacts.extend(old.iter().filter(kept));
        for row in rows {
            let wall_contacts = &mut self.wall_contacts;
            find_plane_contacts(*row, balls, planes, |contact| {
                wall_contacts.push(find(old, &contact).copied().unwrap_or(contact));
            });
        }
        self.wall_contacts.sort_unstable_by_key(WallContact::key);
    }

    /// Brings the balls at walls up to date: how walls move, and which part of a shape is
    /// touched. That of fast balls only, where others know it already.
    pub fn update_wall_contacts(
        &mut self,
        walls: &dyn StaticGeometry<S>,
        query: &WallQuery<S>,
        only_fast: bool,
    ) {
        if !self.near_shapes.is_empty() {
            self.find_shape_contacts(walls, query, only_fast);
        }
        let mut fastest = S::zero();
        for contact in &mut self.wall_contacts {
            let ball = &query.at[contact.row as usize];
            contact.bears_proxy = false;
            contact.set_time(walls, ball, query.before);
            fastest = fastest.max(contact.surface.magnitude2());
        }
        self.wall_speed = fastest.sqrt();
    }

    fn find_shape_contacts(
        &mut self,
        walls: &dyn StaticGeometry<S>,
        query: &WallQuery<S>,
        only_fast: bool,
    ) {
        std::mem::swap(&mut self.wall_contacts, &mut self.old_wall_contacts);
        self.wall_contacts.clear();
        let old = &self.old_wall_contacts;
        let is_fast = |row| query.displacement(row).is_some() || query.is_outrun(walls, row);
        let sleeps = |row: u32| query.velocity[row as usize][3].is_sign_negative();
        let kept = |contact: &&WallContact<S>| {
            contact.is_plane || sleeps(contact.row) || only_fast && !is_fast(contact.row)
        };
        self.wall_contacts.extend(old.iter().filter(kept));
        self.has_fast = false;
        // Of slow balls that came near a shape, the contacts that are not known yet.
        let adds_new = std::mem::take(&mut self.shapes_are_new) && only_fast;
        for row in self.near_shapes.iter().filter(|row| !sleeps(**row)) {
            let (displacement, filter) = (query.displacement(*row), query.surfaces.filter(*row));
            let ball = &query.ball(*row, displacement);
            let is_outrun = query.is_outrun(walls, *row);
            let is_slow = displacement.is_none() && !is_outrun;
            if only_fast && is_slow && !adds_new {
                continue;
            }
            self.has_fast |= is_outrun || displacement.is_some();
            let (first, wall_contacts) = (self.wall_contacts.len(), &mut self.wall_contacts);
            let mut visit = |ball: &Row<S>, [wall, part]: [u32; 2], normal: Vec3<S>, distance| {
                if wall_contacts[first..].iter().any(|it| [it.wall, it.part] == [wall, part]) {
                    return;
                }
                let numbers = WallNumbers::new(query.surfaces.row(*row), walls.material(wall));
                let offset = normal.dot(center(ball).to_vec()) - distance;
                let mut contact = WallContact::new(*row, [wall, part], normal, offset, numbers);
                contact.is_plane = false;
                if let Some(same) = find(old, &contact) {
                    if only_fast && is_slow {
                        return; // it is kept
                    }
                    contact.restore(same);
                }
                wall_contacts.push(contact);
            };
            if is_outrun {
                let (ball, way, times) = query.path(*row);
                walls.outrunning_at(&ball, filter, way, times, &mut |part, normal, distance| {
                    visit(&ball, part, normal, distance);
                });
            }
            let mut reach = query.skin_left[*row as usize].max(S::zero());
            if let Some(displacement) = displacement {
                reach = query.reach(ball[3], displacement);
                let of_ball = (filter, query.surfaces.locked_axes(*row));
                query.visit_way(walls, (ball, of_ball), displacement, &mut visit);
            }
            walls.shapes_at(ball, filter, reach, &mut |part, normal, distance| {
                visit(ball, part, normal, distance);
            });
        }
        self.wall_contacts.sort_unstable_by_key(WallContact::key);
    }
}

impl<S: Scalar> HalfSpace<S> {
    /// Moves a proxy out, except by how deep it was inside.
    pub fn bear(&self, proxy: &Proxy<S>, at: &mut Row<S>) {
        let separation =
            |ball: &Row<S>| self.normal.dot(center(ball).to_vec()) - self.offset - ball[3];
        let by = (separation(&proxy.at).min(S::zero()) - separation(at)).max(S::zero());
        for (x, normal) in at.iter_mut().zip::<[S; 3]>(self.normal.into()) {
            *x += normal * by;
        }
    }
}

/// Visits the half-spaces that a ball may reach.
fn find_plane_contacts<S: Scalar>(
    row: u32,
    balls: Balls<S>,
    planes: &[HalfSpace<S>],
    visit: impl FnMut(WallContact<S>),
) {
    let reach = balls.reach(row as usize);
    plane_contacts_within(reach, row, &balls.at[row as usize], balls.surfaces, planes, visit);
}

/// Visits the half-spaces that are nearer to a ball than `reach` metres.
pub(super) fn plane_contacts_within<S: Scalar>(
    reach: S,
    row: u32,
    ball: &Row<S>,
    surfaces: SurfaceOf<S>,
    planes: &[HalfSpace<S>],
    mut visit: impl FnMut(WallContact<S>),
) {
    for plane in planes {
        let HalfSpace { wall, normal, offset, material, layers } = *plane;
        let separation = normal.dot(center(ball).to_vec()) - offset - ball[3];
        // A wall may also come nearer; a move of it starts another search.
        if separation < reach && surfaces.filter(row).meets_wall(wall, layers) {
            let numbers = WallNumbers::new(surfaces.row(row), material);
            visit(WallContact::new(row, [wall, 0], normal, offset, numbers));
        }
    }
}

/// Finds the balls that may go as far as to a half-space.
struct NearPlanes<'a, S> {
    balls: Balls<'a, S>,
    planes: &'a [HalfSpace<S>],
    rows: Range<usize>,
    found: &'a mut Vec<u32>,
}

impl<S: Scalar> Kernel<S> for NearPlanes<'_, S> {
    #[inline(always)]
    fn run<L: Simd<Scalar = S>>(self) {
        let Self { balls, planes, rows, found } = self;
        let mut first = rows.start;
        while first + LANES <= rows.end {
            // SAFETY: there are eight.
            let [x, y, z, radius] =
                unsafe { L::gather(balls.at[first..].as_ptr(), &[0, 1, 2, 3, 4, 5, 6, 7]) };
            let mut skin_left = [S::zero(); LANES];
            for (lane, skin_left) in skin_left.iter_mut().enumerate() {
                *skin_left = balls.reach(first + lane);
            }
            let skin_left = L::load(&skin_left);
            let reach = radius + skin_left;
            let mut near = 0;
            for HalfSpace { normal, offset, .. } in planes {
                let along =
                    L::splat(normal.x) * x + L::splat(normal.y) * y + L::splat(normal.z) * z;
                // Rather one too many: the caller looks more closely.
                near |= (L::splat(*offset) + reach * L::constant(1.001)).gt_mask(along);
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
pub(super) fn find<'a, S: Scalar>(
    wall_contacts: &'a [WallContact<S>],
    contact: &WallContact<S>,
) -> Option<&'a WallContact<S>> {
    let at = wall_contacts.binary_search_by_key(&contact.key(), WallContact::key).ok()?;
    wall_contacts.get(at)
}

/// The contacts of a ball with other shapes than half-spaces, among many in order.
pub(super) fn shapes_of<S: Scalar>(
    wall_contacts: &[WallContact<S>],
    row: u32,
) -> impl Iterator<Item = &WallContact<S>> {
    let first = wall_contacts.partition_point(|contact| contact.row < row);
    let of_row = wall_contacts[first..].iter().take_while(move |contact| contact.row == row);
    of_row.filter(|contact| !contact.is_plane)
}

/// The rows among these that are near anything but half-spaces, found by ever smaller boxes.
pub(super) fn near_shapes<S: Scalar>(
    walls: &dyn StaticGeometry<S>,
    balls: Balls<S>,
    rows: Range<usize>,
    found: &mut Vec<u32>,
) {
    let (mut low, mut high) = ([S::max_value(); 3], [S::min_value(); 3]);
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

impl<S: Scalar> WallContact<S> {
    pub(super) fn new(
        row: u32,
        [wall, part]: [u32; 2],
        normal: Vec3<S>,
        offset: S,
        numbers: WallNumbers<S>,
    ) -> Self {
        Self {
            row,
            wall,
            part,
            is_plane: true,
            bears_proxy: false,
            normal,
            offset,
            offset_at_end: offset,
            surface: Vec3::zero(),
            numbers,
            borne_for_others: S::zero(),
            impulse: ContactImpulse::zero(),
            load: None,
            torque: Vec3::zero(),
        }
    }

    /// Forgets impulses, unless all of them are finite.
    pub fn forget_non_finite(&mut self) {
        let [tangent, torque] = [self.impulse.tangent, self.torque];
        let all = [self.borne_for_others, self.impulse.normal, self.load.unwrap_or(S::zero())];
        if !(all.iter().all(|x| x.is_finite()) && is_finite(tangent) && is_finite(torque)) {
            self.borne_for_others = S::zero();
            self.impulse = ContactImpulse::zero();
            self.load = None;
            self.torque = Vec3::zero();
        }
    }

    /// Key of their order.
    pub fn key(&self) -> (u32, u32, u32) {
        (self.row, self.wall, self.part)
    }
}
