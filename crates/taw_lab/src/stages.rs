//! Cost of each stage of a scene's steps.

use std::time::Instant;

use taw::Error;
use taw::prelude::*;
use taw::scene::Scene;
use taw::swarm::SwarmModel;

use crate::trade::trace::{RunConfig, ScalarType};

/// Medians over all steps, in seconds a step, and what else there is to know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stages {
    /// The first verb.
    pub integrate: f64,
    /// The second verb.
    pub generate_contacts: f64,
    /// The third verb.
    pub restitute: f64,
    /// Mean number of contacts of the last substep of a step.
    pub contacts: f64,
    /// Memory allocated by the world, in bytes.
    pub bytes: usize,
}

/// Runs a scene to its end, in which nothing sleeps. `allocated` says how many bytes are.
///
/// # Errors
/// Errors of the world.
pub fn measure(
    scene: &Scene,
    setting: RunConfig,
    allocated: impl Fn() -> usize,
) -> Result<Stages, Error> {
    match setting.number {
        ScalarType::F32 => measure_in::<f32>(scene, setting, allocated),
        ScalarType::F64 => measure_in::<f64>(scene, setting, allocated),
    }
}

fn measure_in<S: Scalar>(
    scene: &Scene,
    RunConfig { model, step, .. }: RunConfig,
    allocated: impl Fn() -> usize,
) -> Result<Stages, Error> {
    let steps = (scene.duration / step).round() as usize;
    let mut times = [0; 3].map(|_| Vec::with_capacity(steps));
    let before = allocated();
    let mut running = scene.run::<S>(model)?;
    let awake = SwarmModel { sleeps: false, ..running.world.swarm.model() };
    running.world.swarm.set_model(awake)?;
    let (step, substep) = (S::from_f64(step), S::from_f64(step / f64::from(model.passes())));
    let mut contacts = 0;
    for _ in 0..steps {
        running.move_walls(step)?;
        let world = &mut running.world;
        world.begin_step();
        let mut taken = [0.0; 3];
        for after in (0..model.passes()).rev() {
            world.begin_substep(substep * S::from_f64(f64::from(after)));
            let begin = Instant::now();
            world.integrate(substep)?;
            let integrated = Instant::now();
            world.generate_contacts();
            let generated = Instant::now();
            world.restitute(substep)?;
            let restituted = Instant::now();
            taken[0] += (integrated - begin).as_secs_f64();
            taken[1] += (generated - integrated).as_secs_f64();
            taken[2] += (restituted - generated).as_secs_f64();
        }
        world.end_step();
        contacts += world.contacts.wm.len() + world.contacts.mm.len();
        for (times, taken) in times.iter_mut().zip(taken) {
            times.push(taken);
        }
    }
    let bytes = allocated().saturating_sub(before);
    let [integrate, generate_contacts, restitute] = times.map(|mut times: Vec<f64>| {
        times.sort_unstable_by(f64::total_cmp);
        times.get(times.len() / 2).copied().unwrap_or(0.0)
    });
    let contacts = contacts as f64 / steps.max(1) as f64;
    Ok(Stages { integrate, generate_contacts, restitute, contacts, bytes })
}
