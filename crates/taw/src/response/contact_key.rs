//! Identity of a contact from one substep to the next, and its impulses meanwhile.

use crate::contact::Contact;

/// Identity of a contact across substeps; sorts walls first, then by rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct ContactKey {
    /// Two marbles, or a wall and a marble.
    is_pair: bool,
    /// Row of the first marble or of the wall.
    a: u32,
    /// Row of the marble; the higher one of a pair.
    b: u32,
    /// Sub-shape of the wall.
    part: u32,
    /// [Feature id](Contact::feature).
    feature: u32,
}

impl ContactKey {
    /// Lowest key of the same two.
    pub fn first_of_both(self) -> Self {
        Self { part: 0, feature: 0, ..self }
    }

    /// Returns true if both keys are of the same two, whatever parts of them touch.
    pub fn has_bodies_of(self, other: Self) -> bool {
        self.first_of_both() == other.first_of_both()
    }

    /// Rows of both, or wall and row, if no capsule is one of them.
    pub fn balls(&self) -> Option<(u32, u32)> {
        (self.feature == 0).then_some((self.a, self.b))
    }

    /// Returns true for two marbles.
    pub fn is_pair(&self) -> bool {
        self.is_pair
    }

    /// Rows of two marbles.
    pub fn pair(&self) -> Option<(u32, u32)> {
        self.is_pair.then_some((self.a, self.b))
    }

    /// Rows of its marbles.
    pub fn marbles(&self) -> impl Iterator<Item = usize> + use<> {
        let first = self.is_pair.then_some(self.a as usize);
        first.into_iter().chain([self.b as usize])
    }

    /// Sub-shape of the wall.
    pub fn part(&self) -> u32 {
        self.part
    }

    /// Row of the marble, if it touches a wall.
    pub fn marble_at_wall(&self) -> Option<usize> {
        (!self.is_pair).then_some(self.b as usize)
    }

    /// Key of a contact with a wall.
    pub fn with_wall<S>(contact: &Contact<S>) -> Self {
        Self { is_pair: false, ..Self::between_marbles(contact) }
    }

    /// Key of a contact between two marbles.
    pub fn between_marbles<S>(contact: &Contact<S>) -> Self {
        let Contact { a, b, part, feature, .. } = *contact;
        Self { is_pair: true, a, b, part, feature }
    }

    /// Key after rows have moved; none if one of them is gone.
    pub fn remap(
        self,
        marble: impl Fn(usize) -> Option<usize>,
        wall: impl Fn(usize) -> Option<usize>,
    ) -> Option<Self> {
        let a = if self.is_pair { marble(self.a as usize) } else { wall(self.a as usize) };
        let (a, b) = (a? as u32, marble(self.b as usize)? as u32);
        Some(Self { a, b, ..self })
    }

    /// Key with the lower row of a pair first, and whether the two had to be swapped.
    pub fn in_order(self) -> (Self, bool) {
        let swap = self.is_pair && self.a > self.b;
        let feature = self.feature.rotate_left(16);
        let swapped = Self { a: self.b, b: self.a, feature, ..self };
        (if swap { swapped } else { self }, swap)
    }
}

/// Memory of a contact.
pub(crate) trait KeyedByContact {
    fn key(&self) -> ContactKey;
    fn set_key(&mut self, key: ContactKey);
    /// Turns round what acts on the second body.
    fn reverse(&mut self);
}

/// Renames the rows of marbles, and forgets contacts of those that have no new name.
pub(crate) fn rename_rows<T: KeyedByContact>(
    memory: &mut Vec<T>,
    marble: impl Fn(usize) -> Option<usize>,
) {
    memory.retain_mut(|entry| {
        let key = entry.key().remap(&marble, Some);
        key.inspect(|key| entry.set_key(*key)).is_some()
    });
}

/// Follows rows that have moved, and forgets contacts of rows that are gone.
pub(crate) fn follow_rows<T: KeyedByContact>(
    memory: &mut Vec<T>,
    marble: impl Fn(usize) -> Option<usize>,
    wall: impl Fn(usize) -> Option<usize>,
) {
    memory.retain_mut(|entry| {
        let Some(key) = entry.key().remap(&marble, &wall) else { return false };
        let (key, swapped) = key.in_order();
        entry.set_key(key);
        if swapped {
            entry.reverse();
        }
        true
    });
    memory.sort_unstable_by_key(T::key);
}
