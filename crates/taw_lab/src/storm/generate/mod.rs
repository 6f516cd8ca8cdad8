//! Ordinary scenes that nobody chose.

mod bodies;
mod dice;
mod walls;

use taw::prelude::*;
use taw::scene::{MaterialDesc, Scene};

use super::case::{Case, Kind, Name, SwarmPart};
use crate::trade::trace::ScalarType;
use bodies::Crowd;
use dice::Dice;

/// Maximum number of body-substeps of a scene, so that many scenes run.
const MOST_WORK: f64 = 60_000.0;
/// In seconds: long enough to fall, bounce and come to rest.
const LONGEST: f64 = 5.0;

/// The scene of a name: always the same one.
#[must_use]
pub fn generate(name: Name) -> Case {
    let mut dice = Dice::of(name);
    let mut case = setting(name.kind, &mut dice);
    let arena = walls::arena(name.number, &mut dice);
    case.scene = arena.scene;
    case.closed = arena.closed;
    case.differenced = arena.differenced;
    case.scene.material = surface(&mut dice);
    let crowd = Crowd {
        kind: name.kind,
        spins: case.model.rotation == Rotation::Dynamic,
        size: arena.size,
        floor: arena.floor,
        low: arena.low,
        high: arena.high,
    };
    crowd.fill(&mut case, &mut dice);
    soften(&mut case);
    let count = case.bodies().max(1) as f64 * f64::from(case.model.substeps);
    let steps = (LONGEST / case.step).min(MOST_WORK / count).max(20.0);
    case.steps = (steps * dice.between(0.3, 1.0)).max(10.0) as u32;
    case.scene.duration = case.step * f64::from(case.steps);
    case.scene.description = format!("{name}: {}", arena.about);
    case
}

/// All but the scene.
fn setting(kind: Kind, dice: &mut Dice) -> Case {
    let (response, detection) = match kind {
        Kind::Displacement | Kind::SwarmLab => (Response::Displacement, Detection::Discrete),
        Kind::DisplacementSwept => (Response::Displacement, Detection::Swept),
        Kind::Impulse | Kind::SwarmFull => (Response::Impulse, Detection::Discrete),
        Kind::ImpulseSwept => (Response::Impulse, Detection::Swept),
        Kind::SpringDashpot => (Response::Penalty(ContactLaw::SpringDashpot), Detection::Discrete),
        Kind::SpringDashpotSwept => {
            (Response::Penalty(ContactLaw::SpringDashpot), Detection::Swept)
        }
        Kind::HertzMindlin => (Response::Penalty(ContactLaw::HertzMindlin), Detection::Discrete),
        Kind::HertzMindlinSwept => (Response::Penalty(ContactLaw::HertzMindlin), Detection::Swept),
        Kind::EventDriven => (Response::EventDriven, Detection::Discrete),
        Kind::SoftStep => (Response::SoftStep, Detection::Swept),
    };
    let dynamic = Rotation::Dynamic;
    let plain = Integrator::SemiImplicitEuler;
    let integrator = if dice.chance(0.6) { plain } else { dice.pick(&Integrator::ALL) };
    let model = Model {
        integrator,
        response,
        detection,
        rotation: dice.pick(&[Rotation::None, Rotation::Rolling, dynamic, dynamic, dynamic]),
        precision: if dice.chance(0.2) { Precision::Compensated } else { Precision::Plain },
        substeps: dice.pick(&[1, 1, 1, 2, 3, 4, 8]),
        iterations: dice.pick(&[1, 2, 4, 8, 8, 8, 10, 20, 50]),
    };
    // Springs are as soft as their substeps are long: those who choose them choose short ones.
    let springs = kind.law().is_some();
    let substeps = if springs { dice.pick(&[2, 4, 8, 8]) } else { model.substeps };
    let model = Model { substeps, ..model };
    let steps: &[f64] =
        if springs { &[240.0, 120.0] } else { &[240.0, 120.0, 64.0, 60.0, 60.0, 30.0] };
    let soft_step = kind == Kind::SoftStep;
    let full = kind == Kind::SwarmFull || soft_step;
    let has_swarm = if soft_step { dice.chance(0.4) } else { full || kind == Kind::SwarmLab };
    let swarm = has_swarm.then(|| SwarmPart {
        full,
        substeps: dice.pick(&[1, 2, 2, 4, 8]),
        sleeps: dice.chance(0.7),
        material: surface(dice),
        balls: Vec::new(),
    });
    Case {
        broke: None,
        model,
        number: if dice.chance(0.6) { ScalarType::F32 } else { ScalarType::F64 },
        step: 1.0 / dice.pick(steps),
        steps: 1,
        differenced: false,
        closed: None,
        swarm,
        scene: Scene::default(),
    }
}

/// Random material.
fn surface(dice: &mut Dice) -> MaterialDesc {
    let restitution = match dice.below(4) {
        0 => 0.0,
        1 => 1.0,
        _ => dice.between(0.0, 1.0),
    };
    let friction = if dice.chance(0.2) { 0.0 } else { dice.between(0.0, 1.5) };
    let mut surface = MaterialDesc { restitution, friction, ..MaterialDesc::default() };
    if dice.chance(0.2) {
        surface.rolling_resistance = dice.between(0.0, 0.2);
    }
    if dice.chance(0.1) {
        surface.spinning_resistance = dice.between(0.0, 0.2);
    }
    if dice.chance(0.1) {
        surface.tangential_restitution = dice.between(-1.0, 1.0);
    }
    surface
}

/// Gives all surfaces the elasticity that `HertzMindlin` can step: substeps must be a small part
/// of the Rayleigh time, `π R √(ρ/G) / (0.163 ν + 0.877)`, here an eighth for the smallest and
/// lightest.
fn soften(case: &mut Case) {
    if case.model.response != Response::Penalty(ContactLaw::HertzMindlin) {
        return;
    }
    let radius = case.scene.all_marbles().map(|ball| ball.radius).fold(f64::INFINITY, f64::min);
    let density = case.scene.all_marbles().map(|ball| ball.density).fold(f64::INFINITY, f64::min);
    if !radius.is_finite() {
        return;
    }
    let poissons_ratio = case.scene.material.poissons_ratio;
    let time = 8.0 * case.substep();
    let root = std::f64::consts::PI * radius / (time * (0.163 * poissons_ratio + 0.877));
    let youngs_modulus = 2.0 * (1.0 + poissons_ratio) * density * root * root;
    let surfaces = case.scene.walls.iter_mut().filter_map(|wall| wall.material.as_mut());
    let structures = case.scene.structures.iter_mut().filter_map(|wall| wall.material.as_mut());
    let balls = case.scene.marbles.iter_mut().filter_map(|ball| ball.material.as_mut());
    for surface in surfaces.chain(structures).chain(balls).chain([&mut case.scene.material]) {
        surface.youngs_modulus = youngs_modulus;
    }
}
