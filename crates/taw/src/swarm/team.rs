//! Threads that walk through a step together.
//!
//! They live as long as the process, wait for work without a pause for a moment and then asleep,
//! and serve one step at a time: whoever finds them busy works alone, to the same bits.

use std::cell::UnsafeCell;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, TryLockError};

/// The most threads of a team.
pub(super) const MOST_THREADS: usize = 64;
/// How often a thread looks for work before it goes to sleep: some tenths of a millisecond.
const PATIENCE: u32 = 1 << 14;

/// What the members of a team have in common while they work.
#[derive(Debug, Default)]
struct Common {
    /// How many came to the barrier, and how many are done.
    arrived: AtomicUsize,
    done: AtomicUsize,
}

/// One thread of a team.
#[derive(Debug)]
pub(super) struct Member<'a> {
    common: &'a Common,
    /// Which one it is, and of how many.
    pub number: usize,
    pub size: usize,
    barriers: usize,
}

/// The work of a team: a reference to a closure on the stack of the one who asked for it.
#[derive(Clone, Copy)]
struct Job {
    work: *const (dyn Fn(&mut Member) + Sync),
    common: *const Common,
    size: usize,
}

// SAFETY: what it points to is shared between threads, and outlives the work: see `Team::work`.
unsafe impl Send for Job {}

/// Where the helpers find their work.
#[derive(Default)]
struct Board {
    /// How many jobs were put up so far.
    count: AtomicUsize,
    job: Mutex<Option<Job>>,
    wake: Condvar,
}

/// The threads that help.
#[derive(Default)]
struct Helpers {
    board: Arc<Board>,
    count: usize,
}

static HELPERS: Mutex<Option<Helpers>> = Mutex::new(None);

/// Does the work on as many threads as asked for, or on as many as can be had: the work must
/// come out the same.
pub(super) fn work(threads: usize, work: impl Fn(&mut Member) + Sync) {
    let common = Common::default();
    let alone = || work(&mut Member { common: &common, number: 0, size: 1, barriers: 0 });
    if threads <= 1 {
        return alone();
    }
    let mut helpers = match HELPERS.try_lock() {
        Ok(helpers) => helpers,
        Err(TryLockError::Poisoned(helpers)) => helpers.into_inner(),
        Err(TryLockError::WouldBlock) => return alone(),
    };
    let helpers = helpers.get_or_insert_with(Helpers::default);
    let size = 1 + helpers.at_least(threads.min(MOST_THREADS) - 1);
    if size == 1 {
        return alone();
    }
    let closure: &(dyn Fn(&mut Member) + Sync) = &work;
    // SAFETY: only the lifetime changes. Below, this thread waits until all helpers are done,
    // also if its own part panics; nobody looks at a job after that.
    let closure: *const (dyn Fn(&mut Member) + Sync) = unsafe { std::mem::transmute(closure) };
    helpers.board.put_up(Job { work: closure, common: &raw const common, size });
    let wait = WaitForAll { common: &common, helpers: size - 1 };
    work(&mut Member { common: &common, number: 0, size, barriers: 0 });
    drop(wait);
}

/// Waits until the helpers have done their part.
struct WaitForAll<'a> {
    common: &'a Common,
    helpers: usize,
}

impl Drop for WaitForAll<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            // The others may wait at a barrier for what will never come.
            std::process::abort();
        }
        wait_for(|| self.common.done.load(Ordering::Acquire) == self.helpers);
    }
}

impl Helpers {
    /// Makes so many, if the system gives them; says how many take part.
    fn at_least(&mut self, count: usize) -> usize {
        while self.count < count {
            let (board, number) = (self.board.clone(), self.count + 1);
            let seen = board.count.load(Ordering::Acquire);
            let thread = std::thread::Builder::new().name(format!("taw {number}"));
            if thread.spawn(move || help(&board, number, seen)).is_err() {
                break;
            }
            self.count += 1;
        }
        self.count.min(count)
    }
}

impl Board {
    fn lock(&self) -> MutexGuard<'_, Option<Job>> {
        self.job.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn put_up(&self, job: Job) {
        *self.lock() = Some(job);
        self.count.fetch_add(1, Ordering::Release);
        self.wake.notify_all();
    }

    /// Waits for a job that is not yet seen.
    fn next(&self, seen: &mut usize) -> Option<Job> {
        let news = |seen: usize| self.count.load(Ordering::Acquire) != seen;
        let mut looked = 0;
        while !news(*seen) && looked < PATIENCE {
            std::hint::spin_loop();
            looked += 1;
        }
        let mut job = self.lock();
        while !news(*seen) {
            job = self.wake.wait(job).unwrap_or_else(PoisonError::into_inner);
        }
        *seen = self.count.load(Ordering::Acquire);
        *job
    }
}

/// The life of a helper.
fn help(board: &Board, number: usize, mut seen: usize) {
    loop {
        let Some(job) = board.next(&mut seen) else { continue };
        if number >= job.size {
            continue;
        }
        let guard = AbortOnPanic;
        // SAFETY: whoever put up the job waits until this part of it is done.
        let (work, common) = unsafe { (&*job.work, &*job.common) };
        work(&mut Member { common, number, size: job.size, barriers: 0 });
        common.done.fetch_add(1, Ordering::Release);
        std::mem::forget(guard);
    }
}

/// The others would wait for ever for one that is no more.
struct AbortOnPanic;

impl Drop for AbortOnPanic {
    fn drop(&mut self) {
        std::process::abort();
    }
}

impl Member<'_> {
    /// Waits until all have come here; what they wrote before, all can read after.
    pub fn barrier(&mut self) {
        if self.size == 1 {
            return;
        }
        self.barriers += 1;
        self.common.arrived.fetch_add(1, Ordering::AcqRel);
        let all = self.barriers * self.size;
        wait_for(|| self.common.arrived.load(Ordering::Acquire) >= all);
    }

    /// Its share of so many things.
    pub fn share(&self, count: usize) -> Range<usize> {
        count * self.number / self.size..count * (self.number + 1) / self.size
    }
}

/// Waits for what takes long to come only if another thread was put to sleep.
pub(super) fn wait_for(ready: impl Fn() -> bool) {
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
