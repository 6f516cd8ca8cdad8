//! Presets of compared models.

use taw::prelude::*;
use taw::response::ContactLaw;

/// A named model preset with open substeps and iterations.
#[derive(Clone, Copy, Debug)]
pub struct Preset {
    /// Name in reports.
    pub name: &'static str,
    /// The model.
    pub model: Model,
    /// Iterations affect the result.
    pub iterates: bool,
    /// Compared on scenes with contacts, or else on contact-free ones.
    pub has_contacts: bool,
}

const BASELINE: Model = Model {
    integrator: Integrator::VelocityVerlet,
    response: Response::Displacement,
    rotation: Rotation::None,
    precision: Precision::Plain,
    detection: Detection::Discrete,
    substeps: 1,
    iterations: 8,
};
const IMPULSE: Model =
    Model { response: Response::Impulse, rotation: Rotation::Dynamic, ..BASELINE };

const fn contact_free(name: &'static str, integrator: Integrator) -> Preset {
    let model = Model { integrator, ..BASELINE };
    Preset { name, model, iterates: false, has_contacts: false }
}

const fn with_contacts(name: &'static str, model: Model, iterates: bool) -> Preset {
    Preset { name, model, iterates, has_contacts: true }
}

/// All presets: integrators for contact-free scenes, responses for scenes with contacts.
pub static MODELS: [Preset; 15] = [
    contact_free("explicit Euler", Integrator::ExplicitEuler),
    contact_free("semi-implicit Euler", Integrator::SemiImplicitEuler),
    contact_free("velocity Verlet", Integrator::VelocityVerlet),
    contact_free("leapfrog", Integrator::Leapfrog),
    contact_free("Runge-Kutta 4", Integrator::Rk4),
    with_contacts(
        "displacement",
        Model { integrator: Integrator::SemiImplicitEuler, ..BASELINE },
        false,
    ),
    with_contacts("displacement, Verlet", BASELINE, false),
    with_contacts(
        "displacement, rolling",
        Model { rotation: Rotation::Rolling, ..BASELINE },
        false,
    ),
    with_contacts("displacement, swept", Model { detection: Detection::Swept, ..BASELINE }, false),
    with_contacts("impulse", IMPULSE, true),
    with_contacts("impulse, swept", Model { detection: Detection::Swept, ..IMPULSE }, true),
    with_contacts("soft step", Model { response: Response::SoftStep, ..IMPULSE }, false),
    with_contacts(
        "spring and dashpot",
        Model { response: Response::Penalty(ContactLaw::SpringDashpot), ..IMPULSE },
        false,
    ),
    with_contacts(
        "Hertz and Mindlin",
        Model { response: Response::Penalty(ContactLaw::HertzMindlin), ..IMPULSE },
        false,
    ),
    with_contacts(
        "event-driven",
        Model { response: Response::EventDriven, iterations: 50, ..IMPULSE },
        false,
    ),
];
