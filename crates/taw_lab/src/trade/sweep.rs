//! Going through all settings, in parts and with interruptions.

use std::collections::BTreeSet;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, ErrorKind, Write};
use std::path::Path;

use cpu_time::ThreadTime;
use taw::prelude::Scalar;
use taw::swarm::SwarmModel;
use taw::world::Model;

use super::models::{MODELS, Preset};
use super::scenes::{ReferenceCase, SCENES};
use super::trace::{RunConfig, ScalarType, trace};
use super::{COUNTS, Failure, Point};

/// The steps, with their names.
pub const STEPS: [(&str, f64); 5] = [
    ("1/30", 1.0 / 30.0),
    ("1/60", 1.0 / 60.0),
    ("1/120", 1.0 / 120.0),
    ("1/240", 1.0 / 240.0),
    ("1 ms", 0.001),
];
/// Those of a quick sweep.
const QUICK_STEPS: [usize; 2] = [1, 3];
const QUICK_COUNTS: [u32; 2] = [1, 8];
/// A run that would make more substeps than this, times marbles, is left out: it would take seconds
/// (of a quick sweep, a tenth of one).
const MOST: f64 = 2e6;
const QUICK_MOST: f64 = 5e4;

/// Selection of a sweep.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// Only some settings, for a look.
    pub quick: bool,
    /// Only scenes whose name contains this.
    pub scene: String,
    /// Only models whose name contains this.
    pub model: String,
}

/// One run of a sweep.
#[derive(Clone, Copy, Debug)]
pub struct Job {
    /// Reference case.
    pub scene: &'static ReferenceCase,
    /// By what.
    pub model: Preset,
    /// With which step, substeps and iterations.
    pub setting: RunConfig,
    step: &'static str,
}

impl Plan {
    /// All runs, always in the same order.
    pub fn jobs(&self) -> Vec<Job> {
        let mut jobs = Vec::new();
        for scene in SCENES.iter().filter(|scene| scene.name.contains(&self.scene)) {
            let named = MODELS.iter().filter(|named| named.has_contacts == scene.has_contacts);
            for model in named.filter(|named| named.name.contains(&self.model)) {
                for number in [ScalarType::F32, ScalarType::F64] {
                    self.settings(scene, *model, number, &mut jobs);
                }
            }
        }
        jobs
    }

    fn settings(
        &self,
        scene: &'static ReferenceCase,
        model: Preset,
        number: ScalarType,
        jobs: &mut Vec<Job>,
    ) {
        let counts: &[u32] = if self.quick { &QUICK_COUNTS } else { &COUNTS };
        let iterations: &[u32] = if model.iterates { counts } else { &[model.model.iterations] };
        let marbles = scene.scene().all_marbles().count() as f64;
        for (i, (name, step)) in STEPS.iter().enumerate() {
            if self.quick && !QUICK_STEPS.contains(&i) {
                continue;
            }
            for substeps in counts {
                let runs = scene.scene().duration / step * f64::from(*substeps) * marbles;
                if runs > if self.quick { QUICK_MOST } else { MOST } {
                    continue;
                }
                for iterations in iterations {
                    let (substeps, iterations) = (*substeps, *iterations);
                    let model_now = Model { substeps, iterations, ..model.model };
                    let setting = RunConfig { model: model_now, number, step: *step };
                    jobs.push(Job { scene, model, setting, step: name });
                }
            }
        }
    }
}

impl Job {
    /// Unique key.
    #[must_use]
    pub fn key(&self) -> String {
        self.point().key()
    }

    fn point(&self) -> Point {
        let RunConfig { model, number, step } = self.setting;
        Point {
            engine: "taw".into(),
            scene: self.scene.name.into(),
            model: self.model.name.into(),
            number: number.to_string(),
            step: self.step.into(),
            seconds: digits(step),
            substeps: model.substeps,
            iterations: model.iterations,
            error: None,
            failure: None,
            cost: 0.0,
            real_time: 0.0,
            note: String::new(),
        }
    }

    /// Runs it, first for its error and then for its cost. `clock` says how many seconds a run
    /// took.
    pub fn run(&self, clock: impl Fn(&Job) -> f64) -> Point {
        let mut point = self.point();
        match trace(self.scene.scene(), self.setting) {
            None => point.failure = Some(Failure::Overflow),
            Some(frames) => {
                let error = self.scene.error(&frames);
                // Zero has no place on a logarithmic axis; no figure is better than its digits.
                point.error = Some(digits(error.max(1e-16)));
                if error > 1.0 {
                    point.failure = Some(Failure::Wrong);
                }
            }
        }
        let (seconds, marbles) =
            (self.scene.scene().duration, self.scene.scene().all_marbles().count());
        let taken = clock(self);
        point.cost = digits(taken * 1e9 / seconds / marbles as f64);
        point.real_time = digits(seconds / taken);
        point
    }
}

/// Six digits of a number: more are noise, and these come back from a file as they were.
#[must_use]
pub fn digits(number: f64) -> f64 {
    format!("{number:.5e}").parse().unwrap_or(number)
}

/// Median processor time of some runs of one thread, in seconds: three, or as many as fit into a
/// hundredth of a second. What else runs on the machine is not counted.
///
/// # Panics
/// If the scene cannot be run.
#[must_use]
pub fn by_the_clock(job: &Job) -> f64 {
    let mut times = Vec::new();
    while times.len() < 3 || times.len() < 101 && times.iter().sum::<f64>() < 0.01 {
        times.push(match job.setting.number {
            ScalarType::F32 => processor_time::<f32>(job),
            ScalarType::F64 => processor_time::<f64>(job),
        });
        if times[0] > 1.0 {
            break;
        }
    }
    times.sort_unstable_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Processor time of a run, in seconds, from its first step to its last.
fn processor_time<S: Scalar>(job: &Job) -> f64 {
    let (scene, RunConfig { model, step, .. }) = (job.scene.scene(), job.setting);
    let mut running = scene.run::<S>(model).expect("scenes are checked before");
    let one_thread = SwarmModel { threads: 1, ..running.world.swarm.model() };
    running.world.swarm.set_model(one_thread).expect("one thread can be had");
    let begin = ThreadTime::now();
    for _ in 0..(scene.duration / step).round() as u64 {
        running.step(S::from_f64(step)).expect("steps are above zero");
    }
    begin.elapsed().as_secs_f64()
}

/// The points of a file, one to a line. A last line that was cut off is left out; a missing file
/// has none.
///
/// # Errors
/// Errors of reading, and malformed lines.
pub fn read_points(file: &Path) -> std::io::Result<Vec<Point>> {
    let reader = match File::open(file) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        other => BufReader::new(other?),
    };
    let lines: Vec<String> = reader.lines().collect::<Result<_, _>>()?;
    let mut points = Vec::new();
    for (i, line) in lines.iter().enumerate() {
        match serde_json::from_str(line) {
            Ok(point) => points.push(point),
            Err(_) if i + 1 == lines.len() => {}
            Err(error) => {
                let what = format!("{}:{}: {error}", file.display(), i + 1);
                return Err(std::io::Error::new(ErrorKind::InvalidData, what));
            }
        }
    }
    Ok(points)
}

/// Writes points, one to a line.
///
/// # Errors
/// Errors of writing.
pub fn write_points(file: &Path, points: &[Point]) -> std::io::Result<()> {
    let mut to = std::io::BufWriter::new(File::create(file)?);
    for point in points {
        serde_json::to_writer(&mut to, point)?;
        to.write_all(b"\n")?;
    }
    to.flush()
}

/// Part `number` of `of`, counted from 1, goes through its jobs, and leaves out those that the
/// file has already. Every point is in the file as soon as it is measured.
///
/// # Errors
/// Errors of reading and writing.
pub fn sweep(
    plan: &Plan,
    [number, of]: [usize; 2],
    file: &Path,
    clock: impl Fn(&Job) -> f64,
    mut tell: impl FnMut(usize, usize, &Job),
) -> std::io::Result<Vec<Point>> {
    let mut points = read_points(file)?;
    // A line that was cut off must not run into the next one.
    write_points(file, &points)?;
    let done: BTreeSet<String> = points.iter().map(Point::key).collect();
    let jobs = plan.jobs();
    let mine = || jobs.iter().skip(number - 1).step_by(of);
    let (all, left) = (mine().count(), mine().filter(|job| !done.contains(&job.key())));
    let mut to = OpenOptions::new().append(true).open(file)?;
    let left: Vec<_> = left.collect();
    let before = all - left.len();
    for (i, job) in left.iter().enumerate() {
        tell(before + i, all, job);
        let point = job.run(&clock);
        let mut line = serde_json::to_string(&point)?;
        line.push('\n');
        to.write_all(line.as_bytes())?;
        points.push(point);
    }
    Ok(in_order(points))
}

/// The points in the order of their keys, each once.
#[must_use]
pub fn in_order(mut points: Vec<Point>) -> Vec<Point> {
    points.sort_by(|a, b| {
        let name = |point: &Point| {
            (point.scene.clone(), point.engine.clone(), point.model.clone(), point.number.clone())
        };
        name(a)
            .cmp(&name(b))
            .then(b.seconds.total_cmp(&a.seconds))
            .then(a.substeps.cmp(&b.substeps))
            .then(a.iterations.cmp(&b.iterations))
    });
    points.dedup_by_key(|point| point.key());
    points
}
