//! Threads that help with a step.
//!
//! They live as long as the process, wait for work without a pause for a moment and then asleep,
//! and help with one thing at a time. Work is cut into jobs, and each thread takes the next one
//! that nobody has: so a helper that the system gives no time holds up nobody, and it does not
//! matter to the result how many there are.

use std::cell::UnsafeCell;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, TryLockError};

/// The most threads of a team.
pub(super) const MOST_THREADS: usize = 64;
/// Looks for work before a thread goes to sleep: some tenths of a millisecond.
const PATIENCE: u32 = 1 << 14;
/// Number of rows of a job.
pub(super) const ROWS: usize = 1 << 13;

/// Work that is going on: a reference to a closure on the stack of the one who asked for it,
/// which is told the number of a helper.
#[derive(Clone, Copy)]
struct Work {
    work: *const (dyn Fn(usize) + Sync),
    /// Number of helpers that there may be.
    helpers: usize,
}

// SAFETY: what it points to is shared between threads, and outlives the work: see `together`.
unsafe impl Send for Work {}

/// Where the helpers find their work.
#[derive(Default)]
struct Board {
    /// Number of works put up so far.
    count: AtomicUsize,
    /// Number of helpers that have done their part of the last one.
    done: AtomicUsize,
    now: Mutex<Now>,
    wake: Condvar,
}

#[derive(Default)]
struct Now {
    work: Option<Work>,
    /// Number of helpers that have taken part.
    joined: usize,
}

/// The threads that help.
#[derive(Default)]
struct Helpers {
    board: Arc<Board>,
    count: usize,
}

static HELPERS: Mutex<Option<Helpers>> = Mutex::new(None);

/// Calls this on the current thread, as number 0, and meanwhile on up to so many in all: the ones
/// that come in time.
fn together(threads: usize, work: impl Fn(usize) + Sync) {
    if threads <= 1 {
        return work(0);
    }
    let mut helpers = match HELPERS.try_lock() {
        Ok(helpers) => helpers,
        Err(TryLockError::Poisoned(helpers)) => helpers.into_inner(),
        Err(TryLockError::WouldBlock) => return work(0),
    };
    let helpers = helpers.get_or_insert_with(Helpers::default);
    let count = helpers.at_least(threads.min(MOST_THREADS) - 1);
    let closure: &(dyn Fn(usize) + Sync) = &work;
    // SAFETY: only the lifetime changes. `Open` takes the work off the board again and waits for
    // those who took part, also if this thread panics.
    let closure: *const (dyn Fn(usize) + Sync) = unsafe { std::mem::transmute(closure) };
    helpers.board.put_up(Work { work: closure, helpers: count });
    let open = Open { board: &helpers.board };
    work(0);
    drop(open);
}

/// Work that is on the board.
struct Open<'a> {
    board: &'a Board,
}

impl Drop for Open<'_> {
    fn drop(&mut self) {
        let joined = {
            let mut now = self.board.lock();
            now.work = None;
            now.joined
        };
        wait_for(|| self.board.done.load(Ordering::Acquire) == joined);
    }
}

impl Helpers {
    /// Makes so many, if the system gives them; says how many may take part.
    fn at_least(&mut self, count: usize) -> usize {
        while self.count < count {
            let board = self.board.clone();
            let thread = std::thread::Builder::new().name(format!("taw {}", self.count + 1));
            if thread.spawn(move || help(&board)).is_err() {
                break;
            }
            self.count += 1;
        }
        count
    }
}

impl Board {
    fn lock(&self) -> MutexGuard<'_, Now> {
        self.now.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn put_up(&self, work: Work) {
        {
            let mut now = self.lock();
            self.done.store(0, Ordering::Relaxed);
            *now = Now { work: Some(work), joined: 0 };
            self.count.fetch_add(1, Ordering::Release);
        }
        self.wake.notify_all();
    }

    /// Waits for work that is not yet seen, and joins it if there is room.
    fn next(&self, seen: &mut usize) -> Option<(Work, usize)> {
        let news = |seen: usize| self.count.load(Ordering::Acquire) != seen;
        let mut looked = 0;
        while !news(*seen) && looked < PATIENCE {
            std::hint::spin_loop();
            looked += 1;
        }
        let mut now = self.lock();
        while !news(*seen) {
            now = self.wake.wait(now).unwrap_or_else(PoisonError::into_inner);
        }
        *seen = self.count.load(Ordering::Acquire);
        let work = now.work.filter(|work| now.joined < work.helpers)?;
        now.joined += 1;
        Some((work, now.joined))
    }
}

/// The life of a helper.
fn help(board: &Board) {
    let mut seen = 0;
    loop {
        let Some((work, number)) = board.next(&mut seen) else { continue };
        let guard = AbortOnPanic;
        // SAFETY: whoever put it up waits for those who joined.
        unsafe { (*work.work)(number) };
        board.done.fetch_add(1, Ordering::Release);
        std::mem::forget(guard);
    }
}

/// Others would wait for ever for a job that nobody ends.
struct AbortOnPanic;

impl Drop for AbortOnPanic {
    fn drop(&mut self) {
        std::process::abort();
    }
}

/// Does so many jobs, in any order. Each is told the number of its thread, which is less than
/// `threads`, and its own.
pub(super) fn each(threads: usize, count: usize, job: impl Fn(usize, usize) + Sync) {
    let size = threads.clamp(1, MOST_THREADS).min(count);
    // Everybody has a share, so that memory stays with the same threads, and helps with the next
    // one then.
    let begin = |share: usize| count * share / size;
    let taken = [const { AtomicUsize::new(0) }; MOST_THREADS];
    together(size, |number| {
        for share in (number..size).chain(0..number) {
            loop {
                let at = begin(share) + taken[share].fetch_add(1, Ordering::Relaxed);
                if at >= begin(share + 1) {
                    break;
                }
                job(number, at);
            }
        }
    });
}

/// Does something with so many rows, some at a time.
pub(super) fn each_rows(threads: usize, rows: usize, job: impl Fn(Range<usize>) + Sync) {
    each(threads, rows.div_ceil(ROWS), |_, part| job(part * ROWS..rows.min((part + 1) * ROWS)));
}

/// Works on parts of rows, and lists rows: those that each part names, in their order. `lists` is
/// only scribbled on.
pub(super) fn list_rows(
    threads: usize,
    rows: usize,
    lists: &mut Vec<Vec<u32>>,
    listed: &mut Vec<u32>,
    job: impl Fn(Range<usize>, &mut Vec<u32>) + Sync,
) {
    lists.resize_with(rows.div_ceil(ROWS), Vec::new);
    let lists = Shared::new(lists);
    each_rows(threads, rows, |rows| {
        // SAFETY: one for each part.
        let list = unsafe { &mut *lists.row(rows.start / ROWS) };
        list.clear();
        job(rows, list);
    });
    // SAFETY: nobody works any more.
    unsafe { lists.read(0..lists.len()) }.iter().for_each(|list| listed.extend(list));
}

/// Progress of each of a row of neighbours; see [`each_beside`].
const TAKEN: u32 = 1;
const DONE: u32 = 2;

/// Does so many jobs, of which neighbours must not be done at a time: even ones come before the
/// odd ones beside them. `state` is only scribbled on.
pub(super) fn each_beside(
    threads: usize,
    count: usize,
    state: &mut Vec<u32>,
    job: impl Fn(usize) + Sync,
) {
    state.clear();
    state.resize(count, 0);
    let state = Shared::new(state);
    // SAFETY: while they are shared they are only used as atomics.
    let state = |at: usize| unsafe { AtomicU32::from_ptr(state.row(at)) };
    let take = |at: usize| {
        state(at).load(Ordering::Relaxed) == 0
            && state(at).compare_exchange(0, TAKEN, Ordering::Relaxed, Ordering::Relaxed).is_ok()
    };
    let one = |at: usize| {
        let guard = AbortOnPanic;
        job(at);
        std::mem::forget(guard);
        state(at).store(DONE, Ordering::Release);
    };
    let free = |odd: usize| {
        let done = |at: usize| state(at).load(Ordering::Acquire) == DONE;
        done(odd - 1) && (odd + 1 == count || done(odd + 1))
    };
    let (evens, size) = (count.div_ceil(2), threads.clamp(1, MOST_THREADS).min(count));
    together(size, |number| {
        let begin = evens * number / size;
        let order = || (begin..evens).chain(0..begin).map(|half| 2 * half);
        for even in order() {
            if take(even) {
                one(even);
            }
            // The one before it, while its balls are at hand.
            if even > 0 && free(even - 1) && take(even - 1) {
                one(even - 1);
            }
        }
        for odd in order().map(|even| even + 1).filter(|odd| *odd < count) {
            if state(odd).load(Ordering::Relaxed) == 0 {
                wait_for(|| free(odd));
                if take(odd) {
                    one(odd);
                }
            }
        }
    });
}

/// Waits for what takes long to come only if another thread was put to sleep.
fn wait_for(ready: impl Fn() -> bool) {
    let mut looked = 0_u32;
    while !ready() {
        looked += 1;
        if looked.is_multiple_of(1 << 6) {
            std::thread::yield_now();
        } else {
            std::hint::spin_loop();
        }
    }
}

/// A column that several threads write, each elsewhere.
pub(super) struct Shared<'a, T>(&'a [UnsafeCell<T>]);

impl<T> Clone for Shared<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Shared<'_, T> {}

// SAFETY: what is written where is up to those who call the unsafe methods.
unsafe impl<T: Send + Sync> Sync for Shared<'_, T> {}
unsafe impl<T: Send + Sync> Send for Shared<'_, T> {}

impl<'a, T> Shared<'a, T> {
    pub fn new(column: &'a mut [T]) -> Self {
        // SAFETY: a cell has the layout of what is in it, and nobody else has the column.
        Self(unsafe { &*(std::ptr::from_mut(column) as *const [UnsafeCell<T>]) })
    }

    pub fn len(self) -> usize {
        self.0.len()
    }

    /// Where a row is. What is done with it must not be at odds with what others do meanwhile.
    #[inline(always)]
    pub fn row(self, row: usize) -> *mut T {
        self.0.as_ptr().wrapping_add(row).cast_mut().cast()
    }

    /// Some rows for one thread alone.
    ///
    /// # Safety
    /// Nobody else touches them as long as the slice lives.
    pub unsafe fn part(self, rows: Range<usize>) -> &'a mut [T] {
        let cells = &self.0[rows];
        // SAFETY: as the caller promises.
        unsafe { std::slice::from_raw_parts_mut(cells.as_ptr() as *mut T, cells.len()) }
    }

    /// Some rows to read.
    ///
    /// # Safety
    /// Nobody writes them as long as the slice lives.
    pub unsafe fn read(self, rows: Range<usize>) -> &'a [T] {
        let cells = &self.0[rows];
        // SAFETY: as the caller promises.
        unsafe { std::slice::from_raw_parts(cells.as_ptr().cast(), cells.len()) }
    }
}
