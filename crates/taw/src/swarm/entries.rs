//! Entries to the solver: functions that are compiled in this crate, for each scalar, and not again in
//! each crate that has a world.

use super::contact_list::ChunkPairs;
use super::kernels::NearLimits;
use super::{Stage, StaticGeometry, Swarm};
use crate::contact::Contacts;
use crate::math::{PerScalar, Scalar, Vec3};

/// Functions of the solver.
struct Entries<S: Scalar> {
    step: fn(&mut Swarm<S>, S, Vec3<S>, &dyn StaticGeometry<S>, u64, &mut dyn FnMut(Stage)),
    prepare: fn(&mut Swarm<S>, S, Vec3<S>, &dyn StaticGeometry<S>, u64),
    finish: fn(&mut Swarm<S>, S, u32, &dyn StaticGeometry<S>),
    list_contacts:
        fn(&Swarm<S>, ChunkPairs<S>, &[u32], NearLimits<S>, (&mut Contacts<S>, &mut Vec<u32>)),
}

impl<S: Scalar> Entries<S> {
    const ALL: Self = Self {
        step: Swarm::step_here,
        prepare: Swarm::prepare_here,
        finish: Swarm::finish_here,
        list_contacts: Swarm::list_contacts_here,
    };
}

/// Compiled here, once for each scalar: other crates read pointers.
static OF_F32: Entries<f32> = Entries::ALL;
static OF_F64: Entries<f64> = Entries::ALL;

struct Reference;

impl PerScalar for Reference {
    type Of<S: Scalar> = &'static Entries<S>;
}

fn entries<S: Scalar>() -> &'static Entries<S> {
    S::choose::<Reference>(&OF_F32, &OF_F64)
}

impl<S: Scalar> Swarm<S> {
    /// Moves the balls on by `dt` seconds. `walls_identity` is another whenever a wall changed.
    pub(crate) fn step(
        &mut self,
        dt: S,
        gravity: Vec3<S>,
        walls: &dyn StaticGeometry<S>,
        walls_identity: u64,
        observe: &mut dyn FnMut(Stage),
    ) {
        (entries().step)(self, dt, gravity, walls, walls_identity, observe);
    }

    /// Begins a step of bodies and balls: finds who may touch within it.
    pub(crate) fn prepare(
        &mut self,
        dt: S,
        gravity: Vec3<S>,
        walls: &dyn StaticGeometry<S>,
        walls_identity: u64,
    ) {
        (entries().prepare)(self, dt, gravity, walls, walls_identity);
    }

    /// Ends it: moves all on in substeps, and solves the contacts.
    pub(crate) fn finish(&mut self, dt: S, substeps: u32, walls: &dyn StaticGeometry<S>) {
        (entries().finish)(self, dt, substeps, walls);
    }

    /// Lists the contacts of bodies that are awake and near a wall or each other, and which of those
    /// between bodies may come together, by index.
    pub(crate) fn list_contacts(
        &self,
        pairs: ChunkPairs<S>,
        marble_of_slot: &[u32],
        limits: NearLimits<S>,
        lists: (&mut Contacts<S>, &mut Vec<u32>),
    ) {
        (entries().list_contacts)(self, pairs, marble_of_slot, limits, lists);
    }
}
