//! Values that do not count in comparisons, so that what contains them can derive its own.

use std::ops::{Deref, DerefMut};

/// Value that any other one equals: scratch memory, settings that change no bit, counters of changes, and
/// what follows from compared values.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Uncompared<T>(pub T);

impl<T> PartialEq for Uncompared<T> {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl<T> Deref for Uncompared<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.0
    }
}

impl<T> DerefMut for Uncompared<T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.0
    }
}
