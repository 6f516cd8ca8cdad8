//! Limits the number of contacts per marble, however many marbles overlap in one place.

use super::marbles::Marbles;
use crate::contact::Contact;
use crate::math::{Scalar, length};

/// Maximum number of contacts of a ball with marbles of its own size or larger. Twelve can touch
/// one without overlap (Schütte and van der Waerden, *Das Problem der dreizehn Kugeln*, 1953), and
/// each contact counts for one of the two; a contact beyond the deepest 32 lies behind another one,
/// or overlaps so that the others separate the pair.
const MAX_CONTACTS: usize = 32;
/// Maximum number of contacts of the longest capsule.
const MAX_CONTACTS_OF_CAPSULE: usize = 1024;

/// Limits the contacts between marbles to a maximum per marble.
///
/// A contact counts for the smaller of the two, or for the higher index: a boulder may have
/// thousands of pebbles around it, but a pebble only few boulders.
#[derive(Clone, Debug, Default)]
pub(super) struct ContactLimit<S> {
    /// By index: the last contact that was kept when some were dropped. Later ranks are dropped
    /// too.
    last: Vec<Option<Rank<S>>>,
    /// By index: start of its contacts in the sorted list.
    start: Vec<u32>,
    order: Vec<(Rank<S>, u32)>,
    /// Number of contacts before some are dropped.
    limit: usize,
}

/// Order of contacts: smaller separation first, in metres; ties in a deterministic order.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
struct Rank<S>(S, u64, [S; 2]);

impl<S: Scalar> Rank<S> {
    fn of(contact: &Contact<S>) -> Self {
        // The choice among coincident contacts must vary between marbles (Fibonacci hashing, Knuth,
        // *The Art of Computer Programming*, vol. 3, §6.4).
        let mixed = u64::from(contact.a) << 32 | u64::from(contact.b);
        Self(contact.separation, mixed.wrapping_mul(0x9E37_79B9_7F4A_7C15), contact.along)
    }

    fn order(&self, other: &Self) -> std::cmp::Ordering {
        self.partial_cmp(other).unwrap_or(std::cmp::Ordering::Equal)
    }
}

/// Index that a contact counts for.
fn index_of<S: Scalar>(marbles: &Marbles<S>, contact: &Contact<S>) -> usize {
    let reach = |row: usize| marbles.radius()[row] + marbles.half_length(row);
    let (a, b) = (contact.a as usize, contact.b as usize);
    if reach(a) < reach(b) { a } else { b }
}

/// Maximum number of contacts of a marble.
fn max_contacts<S: Scalar>(marbles: &Marbles<S>, row: usize) -> usize {
    let longer = (marbles.half_length(row) / marbles.radius()[row]).as_f64();
    MAX_CONTACTS
        + ((MAX_CONTACTS as f64 * longer) as usize).min(MAX_CONTACTS_OF_CAPSULE - MAX_CONTACTS)
}

impl<S: Scalar> ContactLimit<S> {
    /// Starts a new list for this many marbles.
    pub fn begin(&mut self, rows: usize) {
        self.last.clear();
        // Four times the total maximum, so that dropping is rarely needed.
        self.limit = (4 * MAX_CONTACTS * rows).max(1024);
    }

    /// Tests if enough deeper contacts than that of two balls are known, before all of it is
    /// computed.
    #[inline]
    pub fn drops(&self, marbles: &Marbles<S>, [a, b]: [u32; 2]) -> bool {
        if self.last.is_empty() {
            return false;
        }
        let (first, second) = (a as usize, b as usize);
        let [r, s] = [first, second].map(|row| marbles.radius()[row]);
        let Some(last) = self.last[if r < s { first } else { second }] else { return false };
        let separation = length(marbles.apart(first, second)) - r - s;
        Rank::of(&Contact { separation, ..Contact::between_marbles(a, b) }) > last
    }

    /// Adds a contact, unless enough deeper ones are known.
    #[inline]
    pub fn add(&mut self, list: &mut Vec<Contact<S>>, marbles: &Marbles<S>, new: Contact<S>) {
        if !self.last.is_empty()
            && let Some(last) = self.last[index_of(marbles, &new)]
            && Rank::of(&new) > last
        {
            return;
        }
        list.push(new);
        if list.len() >= self.limit {
            self.drop_excess(list, marbles);
            self.limit = self.limit.max(2 * list.len());
        }
    }

    /// Counts contacts by index, shifted by one.
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

    /// Drops contacts beyond the maximum of each marble. The result depends neither on the order in
    /// which contacts were found nor on contacts elsewhere.
    pub fn drop_excess(&mut self, list: &mut Vec<Contact<S>>, marbles: &Marbles<S>) {
        let rows = marbles.len();
        if list.len() <= MAX_CONTACTS {
            return;
        }
        // A cheap test first, which suffices for ordinary scenes.
        self.count(list, rows, |counts, contact| {
            counts[contact.a as usize + 1] += 1;
            counts[contact.b as usize + 1] += 1;
        });
        if self.start.iter().all(|count| *count as usize <= MAX_CONTACTS) {
            return;
        }
        self.count(list, rows, |counts, contact| counts[index_of(marbles, contact) + 1] += 1);
        let crowded = |row: usize| self.start[row + 1] as usize > max_contacts(marbles, row);
        if !(0..rows).any(crowded) {
            return;
        }
        self.last.resize(rows, None);
        // Contacts in the order of the indices that they count for (counting sort).
        (0..rows).for_each(|row| self.start[row + 1] += self.start[row]);
        let nothing = (Rank(S::zero(), 0, [S::zero(); 2]), 0);
        self.order.clear();
        self.order.resize(list.len(), nothing);
        for (number, contact) in (0..).zip(list.iter()) {
            let place = &mut self.start[index_of(marbles, contact)];
            self.order[*place as usize] = (Rank::of(contact), number);
            *place += 1;
        }
        let mut begin = 0;
        for row in 0..rows {
            let end = self.start[row] as usize;
            let (own, most) = (&mut self.order[begin..end], max_contacts(marbles, row));
            begin = end;
            if own.len() <= most {
                continue;
            }
            own.select_nth_unstable_by(most - 1, |x, y| x.0.order(&y.0));
            self.last[row] = Some(own[most - 1].0);
            for (_, number) in &own[most..] {
                list[*number as usize].part = DROPPED;
            }
        }
        list.retain(|contact| contact.part != DROPPED);
    }
}

/// Sub-shape index that marks a dropped contact; between marbles it is zero.
const DROPPED: u32 = u32::MAX;
