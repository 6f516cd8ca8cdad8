//! The core knows nothing of Bevy; these mirrors lend its types `Reflect`. The
//! compiler checks that they have the same fields.

#![expect(clippy::transmute_ptr_to_ptr, reason = "Bevy's macro casts to a transparent wrapper")]

use bevy::reflect::reflect_remote;

/// Mirrors [`taw::motion::Integrator`].
#[reflect_remote(taw::motion::Integrator)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[reflect(Debug, PartialEq)]
pub enum IntegratorReflect {
    ExplicitEuler,
    SemiImplicitEuler,
    VelocityVerlet,
    Leapfrog,
    Rk4,
}

/// Mirrors [`taw::motion::Rotation`].
#[reflect_remote(taw::motion::Rotation)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[reflect(Debug, PartialEq)]
pub enum RotationReflect {
    None,
    Rolling,
    Dynamic,
}

/// Mirrors [`taw::response::Response`].
#[reflect_remote(taw::response::Response)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[reflect(Debug, PartialEq)]
pub enum ResponseReflect {
    Displacement,
    Impulse,
    SoftStep,
    Penalty(#[reflect(remote = ContactLawReflect)] taw::response::ContactLaw),
    EventDriven,
}

/// Mirrors [`taw::response::ContactLaw`].
#[reflect_remote(taw::response::ContactLaw)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[reflect(Debug, PartialEq)]
pub enum ContactLawReflect {
    SpringDashpot,
    HertzMindlin,
}

/// Mirrors [`taw::response::Combine`].
#[reflect_remote(taw::response::Combine)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[reflect(Debug, PartialEq)]
pub enum CombineReflect {
    Average,
    Min,
    Multiply,
    Max,
}

/// Mirrors [`taw::world::Detection`].
#[reflect_remote(taw::world::Detection)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[reflect(Debug, PartialEq)]
pub enum DetectionReflect {
    Discrete,
    Swept,
}

/// Mirrors [`taw::world::Precision`].
#[reflect_remote(taw::world::Precision)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[reflect(Debug, PartialEq)]
pub enum PrecisionReflect {
    Plain,
    Compensated,
}

/// Mirrors [`taw::world::StopReason`].
#[reflect_remote(taw::world::StopReason)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[reflect(Debug, PartialEq)]
pub enum StopReasonReflect {
    NotFinite,
    EventBudget,
}

/// Mirrors [`taw::swarm::Tier`].
#[reflect_remote(taw::swarm::Tier)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[reflect(Debug, PartialEq)]
pub enum TierReflect {
    Lab,
    Full,
}

/// Mirrors [`taw::response::Elasticity`].
#[reflect_remote(taw::response::Elasticity<f32>)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[reflect(Debug, PartialEq)]
pub struct ElasticityReflect {
    pub youngs_modulus: f32,
    pub poissons_ratio: f32,
}

/// Mirrors [`taw::response::Material`].
#[reflect_remote(taw::response::Material<f32>)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[reflect(Debug, PartialEq)]
pub struct MaterialReflect {
    pub restitution: f32,
    pub friction: f32,
    pub tangential_restitution: f32,
    pub rolling_resistance: f32,
    pub spinning_resistance: f32,
    #[reflect(remote = ElasticityReflect)]
    pub elasticity: taw::response::Elasticity<f32>,
    #[reflect(remote = CombineReflect)]
    pub combine: taw::response::Combine,
}

/// Mirrors [`taw::swarm::SwarmModel`].
#[reflect_remote(taw::swarm::SwarmModel)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[reflect(Debug, PartialEq)]
pub struct SwarmModelReflect {
    #[reflect(remote = TierReflect)]
    pub tier: taw::swarm::Tier,
    pub substeps: u32,
    pub threads: u32,
    #[reflect(remote = MaterialReflect)]
    pub material: taw::response::Material<f32>,
    pub sleeps: bool,
}

/// Mirrors [`taw::world::Model`].
#[reflect_remote(taw::world::Model)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[reflect(Debug, PartialEq)]
pub struct ModelReflect {
    #[reflect(remote = IntegratorReflect)]
    pub integrator: taw::motion::Integrator,
    #[reflect(remote = ResponseReflect)]
    pub response: taw::response::Response,
    #[reflect(remote = RotationReflect)]
    pub rotation: taw::motion::Rotation,
    #[reflect(remote = PrecisionReflect)]
    pub precision: taw::world::Precision,
    #[reflect(remote = DetectionReflect)]
    pub detection: taw::world::Detection,
    pub substeps: u32,
    pub iterations: u32,
}
