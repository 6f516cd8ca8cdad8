//! Recommendation of a model for a scene from a file, or for the current state of a game.
//!
//! The reference is a run of the most accurate model (in `f64`, if the scene is from a file), in
//! steps that are halved until two runs agree. The predictability horizon is measured by two
//! references that differ in the last bit. Up to it positions are compared, marble by marble; after
//! it aggregate values: heights and speeds of all marbles, energy, and overlap.

mod text;

pub use text::{literal, quantity, read_scene};

use std::fmt::Write;
use std::future::Future;

use taw::prelude::*;
use taw::scene::{Scene, Simulation};
use web_time::Instant;

use crate::scene::{EXACT, IMPULSE};
use crate::trade::COUNTS;
use crate::trade::models::{MODELS, Preset};
use crate::trade::trace::{
    Frame, Recording, RunConfig, SAMPLE_INTERVAL, ScalarType, record, record_scene,
};

/// A replayable scene: runs repeatedly from the same initial state.
pub trait ReplayableScene: Sync {
    /// Duration, in seconds.
    fn seconds(&self) -> f64;
    /// Radius of the smallest marble, in metres.
    fn smallest(&self) -> f64;
    /// Available floating-point types, the most accurate last.
    fn numbers(&self) -> &'static [ScalarType];
    /// Models to try.
    fn models(&self) -> impl Iterator<Item = &'static Preset> + Send;
    /// Records a run with a frame every `every` seconds; if `perturbed`, after every marble was
    /// moved by one ulp. `None` if it cannot be run, or the state of a marble becomes non-finite.
    fn record(
        &self,
        setting: RunConfig,
        perturbed: bool,
        every: f64,
    ) -> impl Future<Output = Option<Recording>> + Send;
}

impl ReplayableScene for Scene {
    fn seconds(&self) -> f64 {
        self.duration
    }

    fn smallest(&self) -> f64 {
        self.all_marbles().map(|ball| ball.radius).fold(f64::MAX, f64::min)
    }

    fn numbers(&self) -> &'static [ScalarType] {
        &[ScalarType::F32, ScalarType::F64]
    }

    fn models(&self) -> impl Iterator<Item = &'static Preset> + Send {
        MODELS.iter()
    }

    async fn record(&self, setting: RunConfig, perturbed: bool, every: f64) -> Option<Recording> {
        if perturbed {
            let marbles = self.all_marbles().map(|mut ball| {
                ball.position = ball.position.map(up);
                ball
            });
            let scene = Scene { marbles: marbles.collect(), lattices: Vec::new(), ..self.clone() };
            Box::pin(record_scene(&scene, setting, every)).await
        } else {
            Box::pin(record_scene(self, setting, every)).await
        }
    }
}

/// Next representable number.
fn up(x: f64) -> f64 {
    if x == 0.0 { 1e-17 } else { x.next_up() }
}

/// Snapshot of a game's world, in which walls stand still.
#[derive(Clone, Debug)]
pub struct Snapshot {
    world: World<f32>,
    seconds: f64,
}

impl Snapshot {
    /// Creates a snapshot of a world, to be run for a duration in seconds. Swarms are left out.
    /// (The world is unchanged afterwards.)
    #[must_use]
    pub fn new(of: &mut World<f32>, seconds: f64) -> Self {
        let swarm = std::mem::take(&mut of.swarm);
        let mut world = of.clone();
        // The cost is measured without the energy audit.
        world.enable_energy_audit(false);
        of.swarm = swarm;
        for row in 0..world.walls.len() {
            if let Some(id) = world.walls.id(row) {
                // An existing wall accepts this.
                let _ = world.walls.set_motion(id, None);
            }
        }
        Self { world, seconds }
    }
}

impl ReplayableScene for Snapshot {
    fn seconds(&self) -> f64 {
        self.seconds
    }

    fn smallest(&self) -> f64 {
        self.world.marbles.radius().iter().map(|radius| f64::from(*radius)).fold(f64::MAX, f64::min)
    }

    fn numbers(&self) -> &'static [ScalarType] {
        &[ScalarType::F32]
    }

    fn models(&self) -> impl Iterator<Item = &'static Preset> + Send {
        MODELS.iter().filter(|named| named.has_contacts)
    }

    async fn record(&self, setting: RunConfig, perturbed: bool, every: f64) -> Option<Recording> {
        let mut world = self.world.clone();
        world.set_model(setting.model).ok()?;
        if perturbed {
            for row in 0..world.marbles.len() {
                let id = world.marbles.id(row)?;
                let position = world.marbles.position()[row].map(f32::next_up);
                world.marbles.set_position(id, position).ok()?;
            }
        }
        record(Simulation::from(world), [self.seconds, setting.step, every]).await
    }
}

/// Requirements on a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Requirements {
    /// Maximum position error, in metres.
    pub max_error: Option<f64>,
    /// Maximum cost of a step, in seconds.
    pub max_cost: Option<f64>,
    /// Floating-point type; all available ones by default.
    pub number: Option<ScalarType>,
    /// Time step of the game, in seconds.
    pub step: f64,
    /// Time limit in seconds: a model that takes longer for the scene is not tried with more
    /// substeps; a reference that takes thirty times as long is not refined further.
    pub time_limit: f64,
}

impl Default for Requirements {
    /// No limits, at 60 steps per second and with a time limit of a second.
    fn default() -> Self {
        Self { max_error: None, max_cost: None, number: None, step: 1.0 / 60.0, time_limit: 1.0 }
    }
}

/// A candidate: a run configuration with its errors and cost.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Name of the model.
    pub name: &'static str,
    /// Run configuration.
    pub setting: RunConfig,
    /// Largest position error up to the predictability horizon, in metres.
    pub error: f64,
    /// Aggregate error, meaningful at any time.
    pub whole: AggregateError,
    /// Cost of a step, in seconds.
    pub cost: f64,
}

/// Aggregate difference of all marbles from the reference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AggregateError {
    /// Mean difference of the sorted heights, in metres.
    pub heights: f64,
    /// Mean difference of the sorted speeds, in m/s.
    pub speeds: f64,
    /// Mean overlap per marble beyond that of the reference, in metres.
    pub overlap: f64,
    /// Mean difference of the energies, in joules.
    pub energy: f64,
    /// Mean difference of the momenta, in kg m/s.
    pub momentum: f64,
    /// Mean difference of the numbers of marbles behind sensor planes.
    pub passed: f64,
}

/// Result of the recommendation.
#[derive(Clone, Debug, Default)]
pub struct Advice {
    /// Predictability horizon in seconds; the scene's duration if not chaotic.
    pub horizon: f64,
    /// Simulated duration, in seconds.
    pub seconds: f64,
    /// Reference uncertainty: largest difference of the references up to the horizon, in metres.
    pub sure: f64,
    /// Run configuration of the reference, if it could be run.
    pub reference: Option<RunConfig>,
    /// All candidates, the cheapest first.
    pub candidates: Vec<Candidate>,
}

/// Refinement ladder: steps of the reference as fractions of the game's, the longest first.
const REFINEMENT_STEPS: [f64; 4] = [1.0 / 4.0, 1.0 / 8.0, 1.0 / 16.0, 1.0 / 32.0];
/// Time limit of a reference, in multiples of that of a model.
const REFERENCE_TIME_FACTOR: f64 = 30.0;
/// Distance that counts as the same position, as a fraction of the smallest radius.
const SAME_PLACE: f64 = 0.01;

/// Measures all models on a scene. `report` is called with the number of finished groups, the
/// number of all groups, and the result so far.
pub async fn advise(
    source: &impl ReplayableScene,
    wish: Requirements,
    mut report: impl FnMut(usize, usize, &Advice),
) -> Advice {
    let seconds = source.seconds();
    let same =
        wish.max_error.map_or(f64::MAX, |most| 0.25 * most).min(SAME_PLACE * source.smallest());
    // Frames of all steps are at common times.
    let every = (SAMPLE_INTERVAL / wish.step).round().max(1.0) * wish.step;
    let number = source.numbers().last().copied().unwrap_or(ScalarType::F32);
    let mut advice = Advice { seconds, ..Advice::default() };
    let mut reference = Vec::new();
    // Not every scene suits the event-driven response.
    for model in [EXACT, Model { detection: Detection::Swept, substeps: 4, ..IMPULSE }] {
        for part in REFINEMENT_STEPS {
            let setting = RunConfig { model, number, step: part * wish.step };
            let begin = Instant::now();
            let Some(finer) = source.record(setting, false, every).await else { break };
            let before = advice.horizon;
            if !reference.is_empty() {
                (advice.horizon, advice.sure) =
                    predictability_horizon(&reference, &finer.frames, same);
            }
            (reference, advice.reference) = (finer.frames, Some(setting));
            // Chaos does not vanish by refinement.
            let horizon = advice.horizon;
            let long = begin.elapsed().as_secs_f64() > REFERENCE_TIME_FACTOR * wish.time_limit;
            if long || horizon >= seconds || horizon > 0.0 && horizon < 1.2 * before {
                break;
            }
        }
        if let Some(setting) = advice.reference {
            let perturbed = source.record(setting, true, every).await.unwrap_or_default();
            advice.horizon =
                advice.horizon.min(predictability_horizon(&reference, &perturbed.frames, same).0);
            break;
        }
    }
    let groups = settings(source, wish);
    let count = groups.len();
    for (i, (name, settings)) in groups.into_iter().enumerate() {
        report(i, count, &advice);
        for setting in settings {
            let begin = Instant::now();
            let Some(Recording { frames, cost }) = source.record(setting, false, every).await
            else {
                continue;
            };
            let until =
                frames.iter().take_while(|frame| frame.time <= advice.horizon + 1e-9).count();
            let error = distances(&frames[..until], &reference).fold(0.0, f64::max);
            let whole = AggregateError::between(&frames, &reference);
            advice.candidates.push(Candidate { name, setting, error, whole, cost });
            if begin.elapsed().as_secs_f64() > wish.time_limit {
                break;
            }
        }
    }
    advice.sort();
    advice
}

/// Run configurations per model, floating-point type and iteration count, from the cheapest on.
fn settings(
    source: &impl ReplayableScene,
    wish: Requirements,
) -> Vec<(&'static str, Vec<RunConfig>)> {
    let mut groups = Vec::new();
    for named in source.models() {
        let iterations: &[u32] =
            if named.iterates { &[1, 2, 4, 8, 32] } else { &[named.model.iterations] };
        let wanted = |number: &&ScalarType| wish.number.is_none_or(|wish| wish == **number);
        for number in source.numbers().iter().filter(wanted) {
            for iterations in iterations {
                let setting = |substeps| {
                    let model = Model { substeps, iterations: *iterations, ..named.model };
                    RunConfig { model, number: *number, step: wish.step }
                };
                groups.push((named.name, COUNTS.map(setting).to_vec()));
            }
        }
    }
    groups
}

/// Time up to which two runs agree, and their largest difference until then.
fn predictability_horizon(a: &[Frame], b: &[Frame], same: f64) -> (f64, f64) {
    let (mut horizon, mut sure) = (0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let apart = distances(std::slice::from_ref(a), std::slice::from_ref(b)).fold(0.0, f64::max);
        if apart > same {
            break;
        }
        (horizon, sure) = (a.time, f64::max(sure, apart));
    }
    (horizon, sure)
}

fn distances<'a>(a: &'a [Frame], b: &'a [Frame]) -> impl Iterator<Item = f64> + 'a {
    a.iter().zip(b).flat_map(|(a, b)| a.at.iter().zip(&b.at).map(|(a, b)| a.distance(*b)))
}

impl AggregateError {
    fn between(a: &[Frame], b: &[Frame]) -> Self {
        let frames = a.len().min(b.len()).max(1) as f64;
        let mut whole = Self::default();
        for (a, b) in a.iter().zip(b) {
            let heights = |frame: &Frame| frame.at.iter().map(|at| at.y).collect();
            let speeds = |frame: &Frame| frame.velocity.iter().map(|v| v.magnitude()).collect();
            whole.heights += wasserstein_distance(heights(a), heights(b)) / frames;
            whole.speeds += wasserstein_distance(speeds(a), speeds(b)) / frames;
            whole.overlap += (a.overlap - b.overlap) / a.at.len().max(1) as f64 / frames;
            whole.energy += (a.energy - b.energy).abs() / frames;
            whole.momentum += Vec3::from(a.momentum).distance(b.momentum.into()) / frames;
            whole.passed += a.passed.abs_diff(b.passed) as f64 / frames;
        }
        whole.overlap = whole.overlap.max(0.0);
        whole
    }
}

/// Wasserstein distance of two distributions.
fn wasserstein_distance(mut a: Vec<f64>, mut b: Vec<f64>) -> f64 {
    a.sort_unstable_by(f64::total_cmp);
    b.sort_unstable_by(f64::total_cmp);
    a.iter().zip(&b).map(|(a, b)| (a - b).abs()).sum::<f64>() / a.len().max(1) as f64
}

impl Candidate {
    /// Total error in metres: of positions up to the horizon, of heights and overlaps always.
    #[must_use]
    pub fn total_error(&self) -> f64 {
        self.error.max(self.whole.heights).max(self.whole.overlap)
    }
}

impl Advice {
    /// The cheapest candidate within the error limit, or the most accurate within the cost limit.
    #[must_use]
    pub fn best(&self, wish: Requirements) -> Option<&Candidate> {
        let affordable = self
            .candidates
            .iter()
            .filter(|choice| wish.max_cost.is_none_or(|most| choice.cost <= most));
        let right = affordable
            .filter(|choice| wish.max_error.is_none_or(|most| choice.total_error() <= most));
        match wish.max_error {
            Some(_) => right.min_by(|a, b| a.cost.total_cmp(&b.cost)),
            None => right.min_by(|a, b| a.total_error().total_cmp(&b.total_error())),
        }
    }

    /// Sorts the candidates by cost; of equal costs, that with the smallest error comes first.
    pub fn sort(&mut self) {
        self.candidates.sort_by(|a, b| {
            a.cost.total_cmp(&b.cost).then(a.total_error().total_cmp(&b.total_error()))
        });
    }

    /// Pareto front of error and cost.
    #[must_use]
    pub fn front(&self) -> Vec<&Candidate> {
        let mut best = f64::MAX;
        let better = |choice: &&Candidate| {
            let better = choice.total_error() < 0.99 * best;
            if better {
                best = choice.total_error();
            }
            better
        };
        self.candidates.iter().filter(better).collect()
    }

    /// Report as text.
    #[must_use]
    pub fn text(&self, wish: Requirements) -> String {
        let mut text = String::new();
        let _ = self.write(&mut text, wish);
        text
    }

    fn write(&self, text: &mut String, wish: Requirements) -> std::fmt::Result {
        let Self { horizon, seconds, sure, reference, candidates } = self;
        let Some(RunConfig { model, number, step }) = reference else {
            return writeln!(text, "no reference: the scene runs out of all numbers");
        };
        let by = if model.response == EXACT.response { "event-driven" } else { "impulse, swept" };
        writeln!(text, "reference: {by}, {number}, {:.2} ms a step", step * 1e3)?;
        if *horizon >= seconds - 1e-9 {
            writeln!(text, "places can be told to the end; references agree to {sure:.1e} m")?;
        } else {
            writeln!(
                text,
                "chaotic: places can be told for {horizon:.1} of {seconds:.1} s (to {sure:.1e} m); \
                 after that heights, speeds and overlaps of all marbles are compared"
            )?;
        }
        writeln!(
            text,
            "\n| model | number | substeps × iterations | µs a step | place, m | heights, m | \
             overlap, m | speeds, m/s | energy, J | momentum, kg m/s | passed |"
        )?;
        writeln!(text, "|---|---|---|---|---|---|---|---|---|---|---|")?;
        for choice in self.front() {
            let Candidate { name, setting, error, whole, cost } = choice;
            let Model { substeps, iterations, .. } = setting.model;
            let AggregateError { heights, overlap, speeds, energy, momentum, passed } = whole;
            write!(text, "| {name} | {} | {substeps} × {iterations} |", setting.number)?;
            write!(text, " {:.1} | {error:.1e} | {heights:.1e} | {overlap:.1e} |", cost * 1e6)?;
            writeln!(text, " {speeds:.1e} | {energy:.1e} | {momentum:.1e} | {passed:.1} |")?;
        }
        if wish.max_error.is_none() && wish.max_cost.is_none() {
            return Ok(());
        }
        match self.best(wish) {
            Some(choice) => {
                let Candidate { name, setting, cost, .. } = choice;
                writeln!(
                    text,
                    "\n{name} in {}: {:.1e} m for {:.1} µs a step of {:.2} ms\n\n{}",
                    setting.number,
                    choice.total_error(),
                    cost * 1e6,
                    wish.step * 1e3,
                    literal(setting.model)
                )
            }
            None => {
                writeln!(text, "\nnone of {} settings does what was asked for", candidates.len())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_snapshot_keeps_no_account() {
        let mut world = World::default();
        world.enable_energy_audit(true);
        assert_eq!(Snapshot::new(&mut world, 1.0).world.energy_audit(), None);
        assert!(world.energy_audit().is_some());
    }
}
