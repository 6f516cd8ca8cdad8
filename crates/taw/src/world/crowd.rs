//! How many marbles one can have to do with, however many are in one place.

use cgmath::Zero;

use super::marbles::Marbles;
use crate::contact::Contact;
use crate::math::{Scalar, Vec3, length};

/// How many marbles of its own size or larger a ball has contacts with at most. Twelve can touch
/// one without overlap (Schütte and van der Waerden, *Das Problem der dreizehn Kugeln*, 1953), and
/// each contact counts for one of the two; so what is beyond the deepest of so many lies behind
/// another one, or overlaps so that the others part them.
const MOST: usize = 32;
/// The same of the longest capsule, which may lie under so many.
const MOST_OF_CAPSULE: usize = 1024;

/// Lists contacts between marbles, of each marble no more than it can have.
///
/// A contact counts for the smaller of the two, or for the later row: a boulder may have
/// thousands of pebbles around it, but a pebble only few boulders.
#[derive(Clone, Debug)]
pub(super) struct Crowd<S> {
    /// By row: the last contact that it kept when some had to go. Nothing behind it is kept.
    last: Vec<Option<Rank<S>>>,
    /// By row: where its contacts begin among those in order.
    start: Vec<u32>,
    order: Vec<(Rank<S>, u32)>,
    /// How many contacts there may be before some have to go.
    limit: usize,
}

/// Which contact comes first: that with the narrower gap, in metres; of equal ones, any, but
/// always the same one.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
struct Rank<S>(S, u64, [S; 2]);

impl<S> Default for Crowd<S> {
    fn default() -> Self {
        Self { last: Vec::new(), start: Vec::new(), order: Vec::new(), limit: 0 }
    }
}

impl<S: Scalar> Rank<S> {
    fn of(contact: &Contact<S>, gap: S) -> Self {
        // Who is picked of those in one place must not be the same for all (Fibonacci hashing,
        // Knuth, *The Art of Computer Programming*, vol. 3, §6.4).
        let mixed = u64::from(contact.a) << 32 | u64::from(contact.b);
        Self(gap, mixed.wrapping_mul(0x9E37_79B9_7F4A_7C15), contact.along)
    }

    fn order(&self, other: &Self) -> std::cmp::Ordering {
        self.partial_cmp(other).unwrap_or(std::cmp::Ordering::Equal)
    }
}

/// The row that a contact counts for.
fn row_of<S: Scalar>(marbles: &Marbles<S>, contact: &Contact<S>) -> usize {
    let reach = |row: usize| marbles.radius()[row] + marbles.half_length(row);
    let (a, b) = (contact.a as usize, contact.b as usize);
    if reach(a) < reach(b) { a } else { b }
}

/// How many contacts a row may have.
fn most_of<S: Scalar>(marbles: &Marbles<S>, row: usize) -> usize {
    let longer = (marbles.half_length(row) / marbles.radius()[row]).as_f64();
    MOST + ((MOST as f64 * longer) as usize).min(MOST_OF_CAPSULE - MOST)
}

/// How far the two of a contact are apart where it is; negative for an overlap.
fn gap<S: Scalar>(marbles: &Marbles<S>, contact: &Contact<S>) -> S {
    let (a, b) = (contact.a as usize, contact.b as usize);
    let bead = |row: usize, along: S| {
        if along == S::zero() { Vec3::zero() } else { marbles.axis(row) * along }
    };
    let [first, second] = contact.along;
    let apart = length(marbles.apart(a, b) + bead(b, second) - bead(a, first));
    apart - marbles.radius()[a] - marbles.radius()[b]
}

impl<S: Scalar> Crowd<S> {
    /// A new list begins, for so many rows.
    pub fn begin(&mut self, rows: usize) {
        self.last.clear();
        // Four times what all may have; so those that have to go are seldom looked for.
        self.limit = (4 * MOST * rows).max(1024);
    }

    /// Adds a contact, unless too many better ones are known.
    #[inline]
    pub fn add(&mut self, list: &mut Vec<Contact<S>>, marbles: &Marbles<S>, new: Contact<S>) {
        if !self.last.is_empty()
            && let Some(last) = self.last[row_of(marbles, &new)]
            && Rank::of(&new, gap(marbles, &new)) > last
        {
            return;
        }
        list.push(new);
        if list.len() >= self.limit {
            self.thin(list, marbles);
            self.limit = self.limit.max(2 * list.len());
        }
    }

    /// Counts contacts by row, one place further on.
    fn count(
        &mut self,
        list: &[Contact<S>],
        rows: usize,
        mut add: impl FnMut(&mut [u32], &Contact<S>),
    ) {
        self.start.clear();
        self.start.resize(rows + 1, 0);
        for contact in list {
            add(&mut self.start, contact);
        }
    }

    /// Takes out what is more than each may have. What is left does not depend on the order in
    /// which contacts were found, nor on how many there are elsewhere.
    pub fn thin(&mut self, list: &mut Vec<Contact<S>>, marbles: &Marbles<S>) {
        let rows = marbles.len();
        if list.len() <= MOST {
            return;
        }
        // First the cheap question, which is all that an ordinary scene has to answer.
        self.count(list, rows, |counts, contact| {
            counts[contact.a as usize + 1] += 1;
            counts[contact.b as usize + 1] += 1;
        });
        if self.start.iter().all(|count| *count as usize <= MOST) {
            return;
        }
        self.count(list, rows, |counts, contact| counts[row_of(marbles, contact) + 1] += 1);
        let crowded = |row: usize| self.start[row + 1] as usize > most_of(marbles, row);
        if !(0..rows).any(crowded) {
            return;
        }
        self.last.resize(rows, None);
        // The contacts in the order of the rows that they count for (a counting sort).
        (0..rows).for_each(|row| self.start[row + 1] += self.start[row]);
        let nothing = (Rank(S::zero(), 0, [S::zero(); 2]), 0);
        self.order.clear();
        self.order.resize(list.len(), nothing);
        for (number, contact) in (0..).zip(list.iter()) {
            let place = &mut self.start[row_of(marbles, contact)];
            self.order[*place as usize] = (Rank::of(contact, gap(marbles, contact)), number);
            *place += 1;
        }
        let mut begin = 0;
        for row in 0..rows {
            let end = self.start[row] as usize;
            let (own, most) = (&mut self.order[begin..end], most_of(marbles, row));
            begin = end;
            if own.len() <= most {
                continue;
            }
            own.select_nth_unstable_by(most - 1, |x, y| x.0.order(&y.0));
            self.last[row] = Some(own[most - 1].0);
            for (_, number) in &own[most..] {
                list[*number as usize].part = GONE;
            }
        }
        list.retain(|contact| contact.part != GONE);
    }
}

/// The part of a contact that goes; between marbles it is zero.
const GONE: u32 = u32::MAX;
