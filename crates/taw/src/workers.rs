//! Pool of worker threads that help with a step. (Not rayon: its forks take longer than many a pass of
//! a step.)
//!
//! Workers live as long as the process, spin briefly and then sleep while idle, and run one job at a
//! time. Work is cut into jobs, and each thread takes the next one that nobody has: so a worker that the
//! system gives no time holds up nobody, and it does not matter to the result how many there are. A job
//! that panics on a worker aborts the process: others would wait for it for ever.

use std::cell::UnsafeCell;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, TryLockError};

/// Maximum number of threads of the pool.
pub(crate) const MAX_THREADS: usize = 64;
/// Spins before a thread goes to sleep: some hundredths of a millisecond, longer than between two
/// works of a step. Other threads of the process may need the core.
const SPIN_COUNT: u32 = 1 << 11;
/// Number of rows of a job.
pub(crate) const ROWS: usize = 1 << 13;

/// Work that is going on: a pointer to a closure on the caller's stack, which gets the number of a
/// worker.
#[derive(Clone, Copy)]
struct Job {
    work: *const (dyn Fn(usize) + Sync),
    /// Number of workers that there may be.
    workers: usize,
}

// SAFETY: what it points to is shared between threads, and outlives the work: see `run_on_workers`.
unsafe impl Send for Job {}

/// Slot from which the workers take their work.
#[derive(Default)]
struct JobSlot {
    /// Number of works posted so far.
    count: AtomicUsize,
    /// Number of workers that have done their part of the last one.
    done: AtomicUsize,
    current: Mutex<Current>,
    wake: Condvar,
}

#[derive(Default)]
struct Current {
    work: Option<Job>,
    /// Number of workers that have taken part.
    joined: usize,
}

/// The threads that help.
#[derive(Default)]
struct Workers {
    job_slot: Arc<JobSlot>,
    count: usize,
}

static WORKERS: Mutex<Option<Workers>> = Mutex::new(None);

/// Calls this on the current thread, as number 0, and meanwhile on up to `threads` threads in all: those that
/// come in time.
fn run_on_workers(threads: usize, work: impl Fn(usize) + Sync) {
    if threads <= 1 {
        return work(0);
    }
    let mut workers = match WORKERS.try_lock() {
        Ok(workers) => workers,
        Err(TryLockError::Poisoned(workers)) => workers.into_inner(),
        Err(TryLockError::WouldBlock) => return work(0),
    };
    let workers = workers.get_or_insert_with(Workers::default);
    let count = workers.at_least(threads.min(MAX_THREADS) - 1);
    let closure: &(dyn Fn(usize) + Sync) = &work;
    // SAFETY: only the lifetime changes. `Running` takes the work out of the slot again and waits
    // for those who took part, also if this thread panics.
    let closure: *const (dyn Fn(usize) + Sync) = unsafe { std::mem::transmute(closure) };
    workers.job_slot.post(Job { work: closure, workers: count });
    let open = Running { job_slot: &workers.job_slot };
    work(0);
    drop(open);
}

/// Work that is in the slot.
struct Running<'a> {
    job_slot: &'a JobSlot,
}

impl Drop for Running<'_> {
    fn drop(&mut self) {
        let joined = {
            let mut current = self.job_slot.lock();
            current.work = None;
            current.joined
        };
        wait_for(|| self.job_slot.done.load(Ordering::Acquire) == joined);
    }
}

impl Workers {
    /// Spawns up to `count` workers; returns how many there are.
    fn at_least(&mut self, count: usize) -> usize {
        while self.count < count {
            let job_slot = self.job_slot.clone();
            let thread = std::thread::Builder::new().name(format!("taw {}", self.count + 1));
            if thread.spawn(move || worker_main(&job_slot)).is_err() {
                break;
            }
            self.count += 1;
        }
        count
    }
}

impl JobSlot {
    fn lock(&self) -> MutexGuard<'_, Current> {
        self.current.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn post(&self, work: Job) {
        {
            let mut current = self.lock();
            self.done.store(0, Ordering::Relaxed);
            *current = Current { work: Some(work), joined: 0 };
            self.count.fetch_add(1, Ordering::Release);
        }
        self.wake.notify_all();
    }

    /// Waits for work that is not yet seen, and joins it if there is room.
    fn next(&self, seen: &mut usize) -> Option<(Job, usize)> {
        let news = |seen: usize| self.count.load(Ordering::Acquire) != seen;
        let mut looked = 0;
        while !news(*seen) && looked < SPIN_COUNT {
            std::hint::spin_loop();
            looked += 1;
        }
        let mut current = self.lock();
        while !news(*seen) {
            current = self.wake.wait(current).unwrap_or_else(PoisonError::into_inner);
        }
        *seen = self.count.load(Ordering::Acquire);
        let work = current.work.filter(|work| current.joined < work.workers)?;
        current.joined += 1;
        Some((work, current.joined))
    }
}

/// Main loop of a worker.
fn worker_main(job_slot: &JobSlot) {
    let mut seen = 0;
    loop {
        let Some((work, number)) = job_slot.next(&mut seen) else { continue };
        let guard = AbortOnPanic;
        // SAFETY: the caller that posted it waits for those who joined.
        unsafe { (*work.work)(number) };
        job_slot.done.fetch_add(1, Ordering::Release);
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

/// Runs `count` jobs, in any order. Each is told the number of its thread, which is less than
/// `threads`, and its own.
pub(crate) fn parallel_for(threads: usize, count: usize, job: impl Fn(usize, usize) + Sync) {
    let size = threads.clamp(1, MAX_THREADS).min(count);
    // Everybody has a share, so that memory stays with the same threads, and helps with the next
    // one then.
    let begin = |share: usize| count * share / size;
    let taken = [const { AtomicUsize::new(0) }; MAX_THREADS];
    run_on_workers(size, |number| {
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

/// Runs a job over `count` rows, some at a time.
pub(crate) fn parallel_for_rows(threads: usize, rows: usize, job: impl Fn(Range<usize>) + Sync) {
    parallel_for(threads, rows.div_ceil(ROWS), |_, part| {
        job(part * ROWS..rows.min((part + 1) * ROWS));
    });
}

/// Works on parts of rows, and lists the rows that each part adds, in their order. `lists` is
/// scratch.
pub(crate) fn parallel_filter(
    threads: usize,
    rows: usize,
    lists: &mut Vec<Vec<u32>>,
    listed: &mut Vec<u32>,
    job: impl Fn(Range<usize>, &mut Vec<u32>) + Sync,
) {
    lists.resize_with(rows.div_ceil(ROWS), Vec::new);
    let lists = DisjointSlice::new(lists);
    parallel_for_rows(threads, rows, |rows| {
        // SAFETY: one for each part.
        let list = unsafe { &mut *lists.row(rows.start / ROWS) };
        list.clear();
        job(rows, list);
    });
    // SAFETY: nobody works any more.
    unsafe { lists.read(0..lists.len()) }.iter().for_each(|list| listed.extend(list));
}

/// Appends lists to one, in their order.
pub(crate) fn append_all<'a, T: Copy + Send + Sync + 'a>(
    threads: usize,
    lists: impl Iterator<Item = &'a [T]>,
    to: &mut Vec<T>,
) {
    let mut end = 0;
    let lists: Vec<_> = lists
        .map(|list| {
            let begin = end;
            end += list.len();
            (begin..end, list)
        })
        .collect();
    to.reserve(end);
    let room = DisjointSlice::new(&mut to.spare_capacity_mut()[..end]);
    let threads = if end * size_of::<T>() < SHARED_COPY { 1 } else { threads };
    parallel_for(threads, lists.len(), |_, list| {
        let (rows, list) = &lists[list];
        // SAFETY: each list has its own rows.
        unsafe { room.part(rows.clone()) }.write_copy_of_slice(list);
    });
    // SAFETY: all of them are written.
    unsafe { to.set_len(to.len() + end) };
}

/// Bytes from which on it pays to copy on more than one thread.
const SHARED_COPY: usize = 1 << 16;

/// Progress of each of a row of neighbours; see [`parallel_for_odd_even`].
const CLAIMED: u32 = 1;
const FINISHED: u32 = 2;

/// Runs `count` jobs, of which neighbours must not run at the same time: even ones come before the
/// odd ones beside them. `state` is scratch.
pub(crate) fn parallel_for_odd_even(
    threads: usize,
    count: usize,
    state: &mut Vec<u32>,
    job: impl Fn(usize) + Sync,
) {
    state.clear();
    state.resize(count, 0);
    let state = DisjointSlice::new(state);
    // SAFETY: while they are shared they are only used as atomics.
    let state = |at: usize| unsafe { AtomicU32::from_ptr(state.row(at)) };
    let claim = |at: usize| {
        state(at).load(Ordering::Relaxed) == 0
            && state(at).compare_exchange(0, CLAIMED, Ordering::Relaxed, Ordering::Relaxed).is_ok()
    };
    let one = |at: usize| {
        let guard = AbortOnPanic;
        job(at);
        std::mem::forget(guard);
        state(at).store(FINISHED, Ordering::Release);
    };
    let free = |odd: usize| {
        let done = |at: usize| state(at).load(Ordering::Acquire) == FINISHED;
        done(odd - 1) && (odd + 1 == count || done(odd + 1))
    };
    let (evens, size) = (count.div_ceil(2), threads.clamp(1, MAX_THREADS).min(count));
    run_on_workers(size, |number| {
        let begin = evens * number / size;
        let order = || (begin..evens).chain(0..begin).map(|half| 2 * half);
        for even in order() {
            if claim(even) {
                one(even);
            }
            // The one before it, while its balls are at hand.
            if even > 0 && free(even - 1) && claim(even - 1) {
                one(even - 1);
            }
        }
        for odd in order().map(|even| even + 1).filter(|odd| *odd < count) {
            if state(odd).load(Ordering::Relaxed) == 0 {
                wait_for(|| free(odd));
                if claim(odd) {
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
pub(crate) struct DisjointSlice<'a, T>(&'a [UnsafeCell<T>]);

impl<T> Clone for DisjointSlice<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for DisjointSlice<'_, T> {}

// SAFETY: what is written where is up to those who call the unsafe methods.
unsafe impl<T: Send + Sync> Sync for DisjointSlice<'_, T> {}
unsafe impl<T: Send + Sync> Send for DisjointSlice<'_, T> {}

impl<'a, T> DisjointSlice<'a, T> {
    pub fn new(column: &'a mut [T]) -> Self {
        // SAFETY: a cell has the layout of what is in it, and nobody else has the column.
        Self(unsafe { &*(std::ptr::from_mut(column) as *const [UnsafeCell<T>]) })
    }

    pub fn len(self) -> usize {
        self.0.len()
    }

    /// Pointer to a row. The caller must not race with what other threads do to it.
    #[inline(always)]
    #[expect(
        clippy::inline_always,
        reason = "kernels are compiled for the instructions of their caller"
    )]
    pub fn row(self, row: usize) -> *mut T {
        self.0.as_ptr().wrapping_add(row).cast_mut().cast()
    }

    /// Some rows for one thread alone.
    ///
    /// # Safety
    /// No other thread touches them as long as the slice lives.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks it against the plain loop, with empty lists and with enough numbers that threads share
    /// the copy.
    #[test]
    fn lists_are_appended_in_their_order_by_any_number_of_threads() {
        for length in [0_u32, 1, 7, 30_000] {
            let lists: Vec<Vec<u32>> = (0..9)
                .map(|list| (0..length * (list % 3)).map(|i| i * 9 + list).collect())
                .collect();
            let mut expected = vec![42];
            for list in &lists {
                expected.extend_from_slice(list);
            }
            for threads in [0, 1, 2, 5] {
                let mut all = vec![42];
                append_all(threads, lists.iter().map(|list| &list[..]), &mut all);
                assert_eq!(all, expected, "{length}, {threads} threads");
            }
        }
    }
}
