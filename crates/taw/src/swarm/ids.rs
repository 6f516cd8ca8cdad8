use crate::Error;

/// Names a ball for as long as it is in the swarm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BallId {
    slot: u32,
    generation: u32,
}

/// Which ball is in which row, both ways.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Ids {
    /// The slot of each row.
    slots: Vec<u32>,
    /// The row of each slot, or [`NONE`].
    rows: Vec<u32>,
    /// Number of balls that each slot had before; of slots that had none, nothing.
    generations: Vec<u32>,
    free: Vec<u32>,
    removed: u64,
}

const NONE: u32 = u32::MAX;

impl Ids {
    pub fn slots(&self) -> &[u32] {
        &self.slots
    }

    /// Number of balls that were removed.
    pub fn removed(&self) -> u64 {
        self.removed
    }

    /// The row of each slot.
    pub fn rows(&self) -> &[u32] {
        &self.rows
    }

    pub fn id(&self, row: usize) -> Option<BallId> {
        self.slots.get(row).map(|slot| self.of_slot(*slot))
    }

    fn of_slot(&self, slot: u32) -> BallId {
        let generation = self.generations.get(slot as usize).copied().unwrap_or(0);
        BallId { slot, generation }
    }

    pub fn row(&self, id: BallId) -> Option<usize> {
        let row = *self.rows.get(id.slot as usize)?;
        (row != NONE && self.of_slot(id.slot) == id).then_some(row as usize)
    }

    /// Names for so many new rows.
    pub fn push(&mut self, count: usize) -> Result<Vec<BallId>, Error> {
        let full = Error::Full(self.slots.len());
        let all = self.rows.len().checked_add(count).ok_or(full)?;
        if u32::try_from(all).is_err() || all == NONE as usize {
            return Err(full);
        }
        let first = self.slots.len() as u32;
        let again = count.min(self.free.len());
        let slots = self.free.split_off(self.free.len() - again);
        let new = self.rows.len() as u32..(self.rows.len() + count - again) as u32;
        self.rows.resize(new.end as usize, NONE);
        self.slots.extend(slots.into_iter().chain(new));
        for (row, slot) in (first..).zip(&self.slots[first as usize..]) {
            self.rows[*slot as usize] = row;
        }
        Ok(self.slots[first as usize..].iter().map(|slot| self.of_slot(*slot)).collect())
    }

    /// Checks that all of these are there, and once.
    pub fn check(&self, balls: &[BallId]) -> Result<(), Error> {
        let mut seen = vec![false; self.slots.len()];
        for ball in balls {
            let row = self.row(*ball).ok_or(Error::NoSuchBall(*ball))?;
            if std::mem::replace(&mut seen[row], true) {
                return Err(Error::NoSuchBall(*ball));
            }
        }
        Ok(())
    }

    /// Forgets what was checked, and says which rows are left; these move up.
    pub fn remove(&mut self, balls: &[BallId]) -> Vec<bool> {
        self.removed += balls.len() as u64;
        let mut kept = vec![true; self.slots.len()];
        self.generations.resize(self.rows.len(), 0);
        for ball in balls {
            let row = std::mem::replace(&mut self.rows[ball.slot as usize], NONE);
            kept[row as usize] = false;
            // A slot whose generations are used up is never given out again.
            if let Some(next) = ball.generation.checked_add(1) {
                self.generations[ball.slot as usize] = next;
                self.free.push(ball.slot);
            }
        }
        super::retain(&mut self.slots, &kept);
        for (row, slot) in (0..).zip(&self.slots) {
            self.rows[*slot as usize] = row;
        }
        kept
    }

    /// The columns by row and by slot, to be put into another order.
    pub fn columns(&mut self) -> (&mut Vec<u32>, &mut [u32]) {
        (&mut self.slots, &mut self.rows)
    }

    pub fn bytes(&self) -> usize {
        let all = [&self.slots, &self.rows, &self.generations, &self.free];
        all.iter().map(|column| column.capacity() * size_of::<u32>()).sum()
    }
}
