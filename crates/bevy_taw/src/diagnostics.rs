//! Bevy diagnostics of a step: its time, its contents, its energy.

use std::time::Duration;

use bevy::diagnostic::{
    Diagnostic, DiagnosticPath, Diagnostics, DiagnosticsStore, RegisterDiagnostic,
};
use bevy::platform::time::Instant;
use bevy::prelude::*;

use taw::swarm::Stage;
use taw::world::EnergyAudit;

use crate::convert::from_vector;
use crate::resources::TawWorld;

/// A whole step, from gather to scatter, in milliseconds.
pub const STEP_TIME: DiagnosticPath = DiagnosticPath::const_new("taw/step");
/// Components into the world, in milliseconds.
pub const GATHER_TIME: DiagnosticPath = DiagnosticPath::const_new("taw/gather");
/// The first verb, all substeps together, in milliseconds.
pub const INTEGRATE_TIME: DiagnosticPath = DiagnosticPath::const_new("taw/integrate");
/// The second verb, all substeps together, in milliseconds.
pub const CONTACTS_TIME: DiagnosticPath = DiagnosticPath::const_new("taw/generate_contacts");
/// The third verb, all substeps together, in milliseconds.
pub const RESTITUTE_TIME: DiagnosticPath = DiagnosticPath::const_new("taw/restitute");
/// The world back to components, in milliseconds.
pub const SCATTER_TIME: DiagnosticPath = DiagnosticPath::const_new("taw/scatter");
/// The swarm's step, in milliseconds, and its parts: see [`Stage`].
pub const SWARM_TIME: DiagnosticPath = DiagnosticPath::const_new("taw/swarm");
/// Its velocities and places, in milliseconds.
pub const SWARM_INTEGRATE_TIME: DiagnosticPath = DiagnosticPath::const_new("taw/swarm/integrate");
/// Putting its rows in order, in milliseconds.
pub const SWARM_ORDER_TIME: DiagnosticPath = DiagnosticPath::const_new("taw/swarm/order");
/// Seeking its pairs, in milliseconds.
pub const SWARM_PAIRS_TIME: DiagnosticPath = DiagnosticPath::const_new("taw/swarm/pairs");
/// Its contacts, in milliseconds.
pub const SWARM_RESTITUTE_TIME: DiagnosticPath = DiagnosticPath::const_new("taw/swarm/restitute");
/// The number of marbles in swarms, with guests.
pub const SWARM_MARBLES: DiagnosticPath = DiagnosticPath::const_new("taw/swarm/marbles");
/// Number of them that sleep.
pub const SWARM_ASLEEP: DiagnosticPath = DiagnosticPath::const_new("taw/swarm/asleep");
/// The number of marbles.
pub const MARBLES: DiagnosticPath = DiagnosticPath::const_new("taw/marbles");
/// The wall–marble contacts of the last substep.
pub const WALL_CONTACTS: DiagnosticPath = DiagnosticPath::const_new("taw/wall_contacts");
/// The marble–marble contacts of the last substep.
pub const MARBLE_CONTACTS: DiagnosticPath = DiagnosticPath::const_new("taw/marble_contacts");

/// The energy of the marbles' velocities, in joules. This and the next three are off
/// until [`enable_energy`].
pub const KINETIC_ENERGY: DiagnosticPath = DiagnosticPath::const_new("taw/energy/kinetic");
/// The energy of their spins, in joules.
pub const ROTATIONAL_ENERGY: DiagnosticPath = DiagnosticPath::const_new("taw/energy/rotational");
/// Their energy in gravity, against the origin, in joules.
pub const POTENTIAL_ENERGY: DiagnosticPath = DiagnosticPath::const_new("taw/energy/potential");
/// Magnitude of their total momentum, in kg m/s.
pub const MOMENTUM: DiagnosticPath = DiagnosticPath::const_new("taw/momentum");

/// Energy that sliding took in a step, in joules. This and the next eight are off until
/// [`enable_energy_audit`]; each is the field of an [`EnergyAudit`] by that name. Marbles count,
/// swarms do not.
pub const FRICTION_LOSS: DiagnosticPath = DiagnosticPath::const_new("taw/energy_audit/friction");
/// Energy that collisions took along their normals, in joules.
pub const RESTITUTION_LOSS: DiagnosticPath =
    DiagnosticPath::const_new("taw/energy_audit/restitution");
/// Energy that rolling and spinning resistance took, in joules.
pub const RESISTANCE_LOSS: DiagnosticPath =
    DiagnosticPath::const_new("taw/energy_audit/resistance");
/// Energy that the method took and no law of physics asked for, in joules; negative if it gave.
pub const SOLVER_LOSS: DiagnosticPath = DiagnosticPath::const_new("taw/energy_audit/solver");
/// Work of moving walls, in joules.
pub const WALL_WORK: DiagnosticPath = DiagnosticPath::const_new("taw/energy_audit/walls");
/// Work of force fields, pushes and damping, in joules.
pub const FORCE_WORK: DiagnosticPath = DiagnosticPath::const_new("taw/energy_audit/forces");
/// The momentum that came from nowhere, in kg m/s.
pub const MOMENTUM_RESIDUAL: DiagnosticPath =
    DiagnosticPath::const_new("taw/energy_audit/momentum");
/// Largest penetration of a contact when it was found, in metres.
pub const MAX_PENETRATION: DiagnosticPath =
    DiagnosticPath::const_new("taw/energy_audit/max_penetration");
/// Number of collisions in a step.
pub const COLLISIONS: DiagnosticPath = DiagnosticPath::const_new("taw/energy_audit/collisions");

/// A metric of the energy audit: diagnostic path, unit, accessor.
type Metric = (DiagnosticPath, &'static str, fn(&EnergyAudit) -> f64);

/// All of them.
fn audit_metrics() -> [Metric; 9] {
    [
        (FRICTION_LOSS, " J", |audit| audit.friction),
        (RESTITUTION_LOSS, " J", |audit| audit.restitution),
        (RESISTANCE_LOSS, " J", |audit| audit.resistance),
        (SOLVER_LOSS, " J", |audit| audit.solver),
        (WALL_WORK, " J", |audit| audit.walls),
        (FORCE_WORK, " J", |audit| audit.forces),
        (MOMENTUM_RESIDUAL, " kg m/s", |audit| audit.momentum),
        (MAX_PENETRATION, " m", |audit| audit.max_penetration),
        (COLLISIONS, "", |audit| audit.collisions.into()),
    ]
}

/// Switches the energy audit of every step on or off. Off, it is free; on, it costs a few passes
/// over all marbles and contacts.
pub fn enable_energy_audit(store: &mut DiagnosticsStore, enabled: bool) {
    for (path, ..) in audit_metrics() {
        if let Some(diagnostic) = store.get_mut(&path) {
            diagnostic.is_enabled = enabled;
        }
    }
}

/// Enables the energy audit of the world while one of its diagnostics is enabled.
pub(crate) fn update_energy_audit(
    mut world: ResMut<TawWorld>,
    store: Option<Res<DiagnosticsStore>>,
) {
    let asked = |path: &DiagnosticPath| {
        store.as_ref().and_then(|store| store.get(path)).is_some_and(|figure| figure.is_enabled)
    };
    let keep = audit_metrics().iter().any(|(path, ..)| asked(path));
    world.bypass_change_detection().enable_energy_audit(keep);
}

/// Has energy and momentum measured in every step, or no longer. Off, they cost nothing.
pub fn enable_energy(store: &mut DiagnosticsStore, enabled: bool) {
    for path in [&KINETIC_ENERGY, &ROTATIONAL_ENERGY, &POTENTIAL_ENERGY, &MOMENTUM] {
        if let Some(diagnostic) = store.get_mut(path) {
            diagnostic.is_enabled = enabled;
        }
    }
}

pub(crate) fn register(app: &mut App) {
    let times =
        [STEP_TIME, GATHER_TIME, INTEGRATE_TIME, CONTACTS_TIME, RESTITUTE_TIME, SCATTER_TIME];
    for path in times.into_iter().chain(swarm_times().map(|(path, _)| path)).chain([SWARM_TIME]) {
        app.register_diagnostic(Diagnostic::new(path).with_suffix(" ms"));
    }
    for path in [MARBLES, WALL_CONTACTS, MARBLE_CONTACTS, SWARM_MARBLES, SWARM_ASLEEP] {
        app.register_diagnostic(Diagnostic::new(path).with_smoothing_factor(0.0));
    }
    for (path, unit) in [
        (KINETIC_ENERGY, " J"),
        (ROTATIONAL_ENERGY, " J"),
        (POTENTIAL_ENERGY, " J"),
        (MOMENTUM, " kg m/s"),
    ] {
        let mut diagnostic = Diagnostic::new(path).with_suffix(unit).with_max_history_length(600);
        diagnostic.is_enabled = false;
        app.register_diagnostic(diagnostic);
    }
    for (path, unit, _) in audit_metrics() {
        let mut diagnostic = Diagnostic::new(path).with_suffix(unit).with_max_history_length(600);
        diagnostic.is_enabled = false;
        app.register_diagnostic(diagnostic);
    }
}

/// The parts of a swarm's step.
fn swarm_times() -> impl Iterator<Item = (DiagnosticPath, Stage)> {
    [
        (SWARM_INTEGRATE_TIME, Stage::Integrate),
        (SWARM_ORDER_TIME, Stage::Order),
        (SWARM_PAIRS_TIME, Stage::Pairs),
        (SWARM_RESTITUTE_TIME, Stage::Restitute),
    ]
    .into_iter()
}

/// Times of the parts of a step.
#[derive(Resource, Default)]
pub(crate) struct StepTimes {
    began: Option<Instant>,
    gather: Duration,
    stepped: Duration,
    whole: Duration,
    pub integrate: Stopwatch,
    pub generate_contacts: Stopwatch,
    pub restitute: Stopwatch,
    pub swarm: Stages,
}

/// Adds up, each stage by itself.
#[derive(Default)]
pub(crate) struct Stages {
    now: Option<(Stage, Instant)>,
    sums: Vec<(Stage, Duration)>,
}

impl Stages {
    /// From now on it is this one.
    pub fn go_on(&mut self, stage: Stage) {
        self.stop();
        self.now = Some((stage, Instant::now()));
    }

    pub fn stop(&mut self) {
        let Some((stage, since)) = self.now.take() else { return };
        match self.sums.iter_mut().find(|(of, _)| *of == stage) {
            Some((_, sum)) => *sum += since.elapsed(),
            None => self.sums.push((stage, since.elapsed())),
        }
    }

    fn sum(&self, stage: Stage) -> Duration {
        self.sums.iter().filter(|(of, _)| *of == stage).map(|(_, sum)| *sum).sum()
    }
}

/// Adds up.
#[derive(Default)]
pub(crate) struct Stopwatch(Duration);

impl Stopwatch {
    /// Runs `work` and adds the time that it took.
    pub fn time<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        self.0 += start.elapsed();
        result
    }
}

impl StepTimes {
    pub fn begin_step(&mut self) {
        *self = Self { began: Some(Instant::now()), ..Self::default() };
    }

    pub fn end_gather(&mut self) {
        self.gather = self.elapsed();
    }

    pub fn end_step(&mut self) {
        self.stepped = self.elapsed();
    }

    fn elapsed(&self) -> Duration {
        self.began.map_or(Duration::ZERO, |began| began.elapsed())
    }
}

#[cfg(feature = "trade")]
impl StepTimes {
    /// From gather to scatter.
    pub fn whole(&self) -> Duration {
        self.whole
    }

    /// The three verbs together.
    pub fn verbs(&self) -> Duration {
        self.integrate.0 + self.generate_contacts.0 + self.restitute.0
    }
}

pub(crate) fn measure(
    mut times: ResMut<StepTimes>,
    world: Res<TawWorld>,
    mut diagnostics: Diagnostics,
) {
    let ms = |duration: Duration| duration.as_secs_f64() * 1e3;
    times.whole = times.elapsed();
    diagnostics.add_measurement(&STEP_TIME, || ms(times.whole));
    diagnostics.add_measurement(&GATHER_TIME, || ms(times.gather));
    diagnostics.add_measurement(&SCATTER_TIME, || ms(times.whole.saturating_sub(times.stepped)));
    diagnostics.add_measurement(&INTEGRATE_TIME, || ms(times.integrate.0));
    diagnostics.add_measurement(&CONTACTS_TIME, || ms(times.generate_contacts.0));
    diagnostics.add_measurement(&RESTITUTE_TIME, || ms(times.restitute.0));
    diagnostics
        .add_measurement(&SWARM_TIME, || ms(times.swarm.sums.iter().map(|(_, sum)| *sum).sum()));
    for (path, stage) in swarm_times() {
        diagnostics.add_measurement(&path, || ms(times.swarm.sum(stage)));
    }
    diagnostics.add_measurement(&SWARM_MARBLES, || world.swarm.len() as f64);
    diagnostics.add_measurement(&SWARM_ASLEEP, || world.swarm.asleep() as f64);
    diagnostics.add_measurement(&MARBLES, || world.marbles.len() as f64);
    diagnostics.add_measurement(&WALL_CONTACTS, || world.contacts.wm.len() as f64);
    diagnostics.add_measurement(&MARBLE_CONTACTS, || world.contacts.mm.len() as f64);
    diagnostics.add_measurement(&KINETIC_ENERGY, || world.energy().kinetic);
    diagnostics.add_measurement(&ROTATIONAL_ENERGY, || world.energy().rotational);
    diagnostics.add_measurement(&POTENTIAL_ENERGY, || world.energy().potential);
    if let Some(audit) = world.energy_audit() {
        for (path, _, read) in audit_metrics() {
            diagnostics.add_measurement(&path, || read(&audit));
        }
    }
    diagnostics.add_measurement(&MOMENTUM, || {
        from_vector(world.momentum().map(|p| p as f32)).length().into()
    });
}
