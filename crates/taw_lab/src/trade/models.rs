//! The models that are compared.

use taw::prelude::*;
use taw::response::ContactLaw;

/// A model with a name: substeps and iterations are still open.
#[derive(Clone, Copy, Debug)]
pub struct Named {
    /// What it is called in reports.
    pub name: &'static str,
    /// The model.
    pub model: Model,
    /// Whether iterations change anything.
    pub iterates: bool,
    /// Whether it is compared where marbles touch, or else where nothing does.
    pub touches: bool,
}

const PLAIN: Model = Model {
    integrator: Integrator::VelocityVerlet,
    response: Response::Displacement,
    rotation: Rotation::None,
    precision: Precision::Plain,
    detection: Detection::Discrete,
    substeps: 1,
    iterations: 8,
};
const IMPULSE: Model = Model { response: Response::Impulse, rotation: Rotation::Dynamic, ..PLAIN };

const fn flies(name: &'static str, integrator: Integrator) -> Named {
    let model = Model { integrator, ..PLAIN };
    Named { name, model, iterates: false, touches: false }
}

const fn meets(name: &'static str, model: Model, iterates: bool) -> Named {
    Named { name, model, iterates, touches: true }
}

/// All of them: the integrators where nothing touches, the responses where something does.
pub static MODELS: [Named; 15] = [
    flies("explicit Euler", Integrator::ExplicitEuler),
    flies("semi-implicit Euler", Integrator::SemiImplicitEuler),
    flies("velocity Verlet", Integrator::VelocityVerlet),
    flies("leapfrog", Integrator::Leapfrog),
    flies("Runge-Kutta 4", Integrator::Rk4),
    meets("displacement", Model { integrator: Integrator::SemiImplicitEuler, ..PLAIN }, false),
    meets("displacement, Verlet", PLAIN, false),
    meets("displacement, rolling", Model { rotation: Rotation::Rolling, ..PLAIN }, false),
    meets("displacement, swept", Model { detection: Detection::Swept, ..PLAIN }, false),
    meets("impulse", IMPULSE, true),
    meets("impulse, swept", Model { detection: Detection::Swept, ..IMPULSE }, true),
    meets("soft step", Model { response: Response::SoftStep, ..IMPULSE }, false),
    meets(
        "spring and dashpot",
        Model { response: Response::Penalty(ContactLaw::SpringDashpot), ..IMPULSE },
        false,
    ),
    meets(
        "Hertz and Mindlin",
        Model { response: Response::Penalty(ContactLaw::HertzMindlin), ..IMPULSE },
        false,
    ),
    meets(
        "event-driven",
        Model { response: Response::EventDriven, iterations: 50, ..IMPULSE },
        false,
    ),
];
