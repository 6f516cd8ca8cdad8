//! Sleep by methods that list contacts: who falls asleep, and who wakes.

use cgmath::{InnerSpace, Zero};

use super::World;
use super::method::{SleepUnit, method_of};
use super::sleep_columns::SleepGroup;
use crate::Error;
use crate::contact::Contact;
use crate::handle::MarbleId;
use crate::math::{Point3, Scalar, UnionFind, Vec3, length};
use crate::motion::Mass;
use crate::motion::rest::{self, is_slow};
use crate::response::KeyedByContact;
use crate::shape::Aabb3;

/// Substeps after which islands are searched, if anybody has rested for long enough.
const SEARCH_INTERVAL: u32 = 8;

/// Scratch memory of sleep.
#[derive(Clone, Debug, Default)]
pub(super) struct SleepScratch {
    /// Identity of the walls at the end of the last step.
    pub walls: u64,
    /// Version of the sleepers whose impulses are out of the cache.
    set_aside_at: u64,
    woken: Vec<u32>,
    support: Vec<Support>,
    islands: UnionFind,
    /// By island.
    restless: Vec<bool>,
    is_borne: Vec<bool>,
}

/// Support of a marble in a substep; of several, the last one of these counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
enum Support {
    #[default]
    Nothing,
    Marble,
    Wall,
    MovingWall,
}

impl<S: Scalar> World<S> {
    /// Returns true if a marble sleeps: once its island has rested, that is, the marble, those that
    /// it touches, those that these touch, and so on. (By [`SoftStep`](crate::response::Response::SoftStep), in a large heap
    /// only those of some 500 neighbours in memory, so that it sleeps part by part; by
    /// [`EventDriven`](crate::response::Response::EventDriven), only once all marbles have rested, and until any wakes.)
    ///
    /// A marble rests if for half a second, and longer if its radius is over 10 cm (five times √(r/g)), it was
    /// borne by something and either went no further than 5 % of its radius, or was slower than
    /// .05 √(g r) and did not speed up.
    ///
    /// A sleeping marble costs next to nothing, and has no velocity. It wakes when it or one
    /// beside it is set or removed, when gravity, a force field, a force that is applied to it or a wall near it
    /// changes, when one that is awake comes so near that it may touch it within the substep, and
    /// when one wakes that fell asleep with it. Without gravity, none sleeps, nor one that a torque acts on. (By
    /// `SoftStep`, only a ball of over twice that speed wakes it, or one of infinite mass, or one that leaves its
    /// place beside it. By other responses, one that balls of a [swarm](Self::swarm) press does not sleep.)
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn is_asleep(&self, id: MarbleId) -> Result<bool, Error> {
        let row = self.marbles.row(id)?;
        Ok(if self.settings.model.response.uses_swarm_rows() {
            self.is_soft_asleep(id, row)
        } else {
            self.marbles.sleep.is_asleep(row)
        })
    }

    /// Number that changes whenever a marble or a ball falls asleep, wakes, comes or goes; to look
    /// only then who sleeps.
    #[must_use]
    pub fn sleep_version(&self) -> u64 {
        self.swarm.sleep_version() + self.marbles.sleep.version()
    }

    /// Who sleeps with whom in columns of the world.
    fn sleep_unit(&self) -> SleepUnit {
        if self.swarm.model().sleeps {
            method_of::<S>(self.settings.model.response).sleep_unit()
        } else {
            SleepUnit::None
        }
    }

    /// Returns true if there are marbles and all sleep.
    pub(super) fn are_all_asleep(&self) -> bool {
        let sleepers = self.marbles.sleep.sleepers();
        sleepers > 0 && sleepers == self.marbles.len()
    }

    /// Wakes marbles that were set, those beside them, and those near walls that changed. Each verb begins
    /// with it.
    pub(super) fn wake_changed(&mut self) {
        match self.sleep_unit() {
            SleepUnit::None => self.marbles.sleep.clear(),
            _ => self.marbles.sleep.resize(self.marbles.len()),
        }
        let disturbed = self.marbles.sleep.take_disturbed();
        self.walls.mark_seen();
        if self.marbles.sleep.sleepers() == 0 {
            return self.restore_impulses();
        }
        self.wake_groups(disturbed.iter().map(|it| it.group).collect());
        let mut groups = Vec::new();
        for sleeper in &disturbed {
            self.find_sleepers(&mut groups, |center, reach| {
                length(center - sleeper.center) <= reach + sleeper.reach
            });
        }
        self.find_sleepers_at_walls(&mut groups);
        let someone_woke = !groups.is_empty() || !self.are_all_asleep();
        if self.sleep_unit() == SleepUnit::World && someone_woke {
            self.find_sleepers(&mut groups, |_, _| true);
        }
        self.wake_groups(groups);
    }

    /// Wakes sleepers to which another force is applied than when they fell asleep.
    pub(super) fn wake_pulled(&mut self) {
        let marbles = &self.marbles;
        let force = |row: usize| marbles.own.force.get(row).unwrap_or_else(Vec3::zero);
        let is_pulled =
            |row: &usize| force(*row) != marbles.sleep.force(*row) || marbles.is_twisted(*row);
        let pulled: Vec<_> = marbles.sleep.asleep().filter(is_pulled).collect();
        if !pulled.is_empty() {
            for row in pulled {
                self.marbles.disturb(row);
            }
            self.wake_changed();
        }
    }

    /// Adds the groups of sleepers whose center and reach, in metres, fulfil a condition.
    fn find_sleepers(&self, groups: &mut Vec<SleepGroup>, is_meant: impl Fn(Point3<S>, S) -> bool) {
        let wider = S::from_f64(1.0 + rest::PLACE);
        let asleep = self.marbles.sleep.asleep().filter(|row| {
            is_meant(self.marbles.position[*row], self.marbles.reach_of_row(*row) * wider)
        });
        groups.extend(asleep.filter_map(|row| self.marbles.sleep.group_of(row)));
    }

    /// Adds the groups of sleepers near walls that changed since the last step: those may be on their way
    /// throughout this one.
    fn find_sleepers_at_walls(&self, groups: &mut Vec<SleepGroup>) {
        let since = self.scratch.sleep.walls;
        if since == self.walls.identity() {
            return;
        }
        let mut regions = Vec::new();
        if self.walls.changes().visit_since(since, |region| regions.push(*region)) {
            regions.extend(self.walls.turning_regions());
            for region in &regions {
                self.find_sleepers(groups, |center, reach| is_within(region, center, reach));
            }
        } else {
            self.find_sleepers(groups, |_, _| true);
        }
    }

    /// Wakes groups, and lists their rows as woken.
    fn wake_groups(&mut self, mut groups: Vec<SleepGroup>) {
        self.scratch.sleep.woken.clear();
        if !groups.is_empty() {
            groups.sort_unstable();
            groups.dedup();
            self.marbles.sleep.wake(&groups, &mut self.scratch.sleep.woken);
        }
        self.restore_impulses();
    }

    /// Wakes those that one that is awake may touch, and makes up for the first verb, which they missed.
    /// Returns true if there were any.
    pub(super) fn wake_touched(&mut self) -> bool {
        let sleep = &self.marbles.sleep;
        if sleep.sleepers() == 0 {
            return false;
        }
        let touched = self
            .contacts
            .mm
            .iter()
            .flat_map(|contact| [contact.a, contact.b].map(|row| sleep.group_of(row as usize)));
        let groups: Vec<_> = touched.flatten().collect();
        if groups.is_empty() {
            return false;
        }
        self.wake_groups(groups);
        let context = self.settings.step_context(self.scratch.substep);
        if context.dt > S::zero() {
            let woken = &self.scratch.sleep.woken;
            let is_woken = |row: usize| woken.binary_search(&(row as u32)).is_ok();
            self.marbles.integrate_rows(context, &mut self.scratch.stopped, is_woken);
            self.audit_forces();
        }
        true
    }

    /// Lets marbles rest for another `dt` seconds, and fall asleep.
    pub(super) fn update_sleep(&mut self, dt: S) {
        let gravity = length(self.settings.gravity);
        if self.sleep_unit() == SleepUnit::None || gravity == S::zero() {
            return;
        }
        self.find_support();
        let mut someone_lasts = false;
        for row in 0..self.marbles.len() {
            if self.marbles.sleep.is_asleep(row) {
                continue;
            }
            let (center, radius) = (self.marbles.position[row], self.marbles.radius[row]);
            let square = self.marbles.velocity[row].magnitude2();
            let rests = match self.scratch.sleep.support[row] {
                _ if self.marbles.own_mass(row) == Mass::Infinite => self.marbles.is_still(row),
                Support::Marble | Support::Wall => is_slow(square, gravity, radius),
                Support::Nothing | Support::MovingWall => false,
            };
            let at = [center.x, center.y, center.z, radius];
            self.marbles.sleep.update(row, &at, square, rests, dt);
            someone_lasts |= self.marbles.sleep.lasts(row, radius, gravity);
        }
        let clock = self.marbles.sleep.clock.saturating_add(1);
        let searches = someone_lasts && clock >= SEARCH_INTERVAL;
        self.marbles.sleep.clock = if searches { 0 } else { clock.min(SEARCH_INTERVAL) };
        if searches {
            self.fall_asleep(gravity);
        }
    }

    /// Finds by what each marble is borne.
    fn find_support(&mut self) {
        let support = &mut self.scratch.sleep.support;
        support.clear();
        support.resize(self.marbles.len(), Support::Nothing);
        let bears =
            |contact: &Contact<S>| contact.normal_impulse > S::zero() || contact.is_touching();
        for contact in self.contacts.wm.iter().filter(|contact| bears(contact)) {
            let motion = self.walls.motion_of_row(contact.a as usize);
            let moves = motion.is_some_and(|motion| !motion.is_zero());
            let by = if moves { Support::MovingWall } else { Support::Wall };
            let its = &mut support[contact.b as usize];
            *its = by.max(*its);
        }
        for contact in self.contacts.mm.iter().filter(|contact| bears(contact)) {
            for row in [contact.a, contact.b] {
                let its = &mut support[row as usize];
                *its = Support::Marble.max(*its);
            }
        }
    }

    /// Lets islands of which all have rested for long enough fall asleep, if a wall or a marble of infinite mass
    /// bears them: others fall, however slowly.
    fn fall_asleep(&mut self, gravity: S) {
        let (unit, rows) = (self.sleep_unit(), self.marbles.len());
        let SleepScratch { islands, is_borne, restless, support, .. } = &mut self.scratch.sleep;
        islands.reset(rows);
        let listed = self.contacts.mm.iter().map(|contact| (contact.a, contact.b));
        // Those that pressed each other and have opened since are not listed.
        let pressed = self.memory.impulses.iter().filter_map(|entry| entry.key().pair());
        for (a, b) in listed.chain(pressed) {
            islands.join(a as usize, b as usize);
        }
        restless.clear();
        restless.resize(rows, false);
        is_borne.clear();
        is_borne.resize(rows, false);
        let marbles = &mut self.marbles;
        for row in marbles.sleep.awake() {
            let rests = marbles.sleep.lasts(row, marbles.radius[row], gravity)
                && marbles.own.sleeping_disabled.get(row).is_none()
                && !marbles.is_twisted(row);
            let island = islands.set_of(row) as usize;
            restless[island] |= !rests;
            is_borne[island] |=
                support[row] >= Support::Wall || marbles.own_mass(row) == Mass::Infinite;
        }
        for (restless, is_borne) in restless.iter_mut().zip(is_borne) {
            *restless |= !*is_borne;
        }
        if unit == SleepUnit::World
            && marbles.sleep.awake().any(|row| restless[islands.set_of(row) as usize])
        {
            return;
        }
        let mut groups = vec![None; rows];
        let asleep_before = marbles.sleep.sleepers();
        for row in 0..rows {
            if marbles.sleep.is_asleep(row) {
                continue;
            }
            let island = islands.set_of(row) as usize;
            if !restless[island] {
                let group = *groups[island].get_or_insert_with(|| marbles.sleep.new_group());
                let force = marbles.own.force.get(row).unwrap_or_else(Vec3::zero);
                marbles.sleep.fall_asleep(row, group, marbles.position[row], force);
                marbles.clear_motion(row);
            }
        }
        if marbles.sleep.sleepers() > asleep_before {
            self.marbles.sleep.mark_changed();
            self.set_impulses_aside();
            let sleep = &self.marbles.sleep;
            self.contacts.wm.retain(|contact| !sleep.is_asleep(contact.b as usize));
            self.contacts.mm.retain(|contact| !sleep.is_asleep(contact.b as usize));
        }
    }

    /// Takes the impulses of sleepers out of the cache, which has those of the listed contacts.
    fn set_impulses_aside(&mut self) {
        let (memory, sleep) = (&mut self.memory, &self.marbles.sleep);
        let is_asleep = |row: usize| sleep.is_asleep(row);
        move_entries(&mut memory.impulses, &mut memory.sleeping_impulses, is_asleep);
        move_entries(&mut memory.springs, &mut memory.sleeping_springs, is_asleep);
        self.scratch.sleep.set_aside_at = self.marbles.sleep.version();
    }

    /// Gives the impulses of those that woke back to the cache.
    fn restore_impulses(&mut self) {
        let version = self.marbles.sleep.version();
        if std::mem::replace(&mut self.scratch.sleep.set_aside_at, version) == version {
            return;
        }
        self.follow_contacts();
        let (memory, sleep) = (&mut self.memory, &self.marbles.sleep);
        let is_awake = |row: usize| !sleep.is_asleep(row);
        move_entries(&mut memory.sleeping_impulses, &mut memory.impulses, is_awake);
        move_entries(&mut memory.sleeping_springs, &mut memory.springs, is_awake);
    }
}

/// Moves the entries of contacts of which each marble is meant from one sorted list to another.
fn move_entries<T: KeyedByContact + Copy>(
    from: &mut Vec<T>,
    to: &mut Vec<T>,
    is_meant: impl Fn(usize) -> bool,
) {
    let before = to.len();
    from.retain(|entry| {
        let stays = !entry.key().marbles().all(&is_meant);
        if !stays {
            to.push(*entry);
        }
        stays
    });
    if to.len() > before {
        to.sort_unstable_by_key(T::key);
    }
}

/// Returns true if a ball reaches into a box, or may by rounding.
fn is_within<S: Scalar>(region: &Aabb3<S>, center: Point3<S>, reach: S) -> bool {
    (0..3).all(|axis| {
        let (x, few) = (center[axis], S::from_f64(4.0));
        let reach = reach + few * S::epsilon() * (x.abs() + reach);
        x + reach >= region.min[axis] && x - reach <= region.max[axis]
    })
}
