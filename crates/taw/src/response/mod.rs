//! What a touch does to those who touch. One method a file; all of them take the
//! same columns and the same contacts.

pub(crate) mod displacement;
pub(crate) mod event;
mod impact;
pub(crate) mod impulse;
mod material;
pub(crate) mod penalty;
mod work;

pub use event::Impact;
pub use impact::{BallSpin, Mobility, impact};
pub(crate) use impulse::Walls;
pub use material::{Combine, Elasticity, Material};
pub use penalty::ContactLaw;
pub(crate) use penalty::Shear;
pub(crate) use work::{Push, Work};

use cgmath::{InnerSpace, Zero};

use crate::broad::Period;
use crate::math::{Point3, Scalar, Vec3};

/// The method that restitutes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Response {
    /// The lab's method: what moved into each other is moved back (a wall stays, marbles take
    /// half each), the largest displacement first, and velocities change by that displacement
    /// per step. What overlapped before (spawned, grown, put there) is moved apart afterwards,
    /// and no velocity changes: overlap is no energy.
    ///
    /// The bottom of the ladder. The same push whatever the masses, so momentum is kept only
    /// where they are equal; no friction, no restitution, no spin. Changes begin with those of
    /// the last substep and go over all contacts [`Model::iterations`] times at most, so that
    /// what lies reports no speed; tall heaps sag until they agree.
    ///
    /// [`Model::iterations`]: crate::world::Model::iterations
    #[default]
    Displacement,
    /// Impulses, contact by contact and round after round
    /// ([`Model::iterations`](crate::world::Model::iterations)): masses, restitution
    /// and friction as the [`Material`] says, spin if the model's rotation is dynamic,
    /// walls that carry along what lies on them; rolling and spinning resistance. Sweeps
    /// that go on along their way until the contacts agree
    /// ([`World::residual`](crate::world::World::residual)).
    ///
    /// A bounce happens at the end of the substep in which it falls due, so its height
    /// is right only to the first order in the substep; slower than what gravity does
    /// in two substeps nothing bounces. What overlaps is pushed apart by the masses
    /// without a change of velocity.
    Impulse,
    /// Soft contacts in small steps (Catto, 2024, `Solver2D`): masses, restitution, friction,
    /// rolling and spinning resistance, and spin if the model's rotation is dynamic. The one for
    /// games: made for thousands of balls, on all threads, and nothing tunnels through walls.
    ///
    /// Marbles and the balls of the [swarm](crate::world::World::swarm) are solved as one, with
    /// the threads and the sleep of its [model](crate::swarm::SwarmModel) and the
    /// [substeps](crate::world::Model::substeps) of the world's, which are parts of the third verb.
    /// Contacts give way a little: each bears by sinking in, by about a thousandth of the radius
    /// for three balls on it. What lies still for half a second sleeps.
    ///
    /// Knows balls only, by semi-implicit steps of `f32` in any world, and no periods; marbles may
    /// have their own mass, material, gravity scale, damping, forces and rotation model, not their
    /// own integrator. It finds contacts by itself, so taking some out of the world's lists does not
    /// keep marbles apart.
    SoftStep,
    /// Forces that grow with the overlap: touches take time, many marbles can push at
    /// once, and what a contact bears is a force in newtons.
    ///
    /// For engineers (with [`ContactLaw::HertzMindlin`]), and to see why games do without:
    /// a marble sinks in by what the stiffness gives, and a stiffer contact needs shorter
    /// substeps: what bears m times its own weight by [`ContactLaw::SpringDashpot`] sinks in by
    /// 26 m g dt², for substeps of dt. No contact gives more energy than it took, and what
    /// overlaps from the start parts at a radius a second at most.
    Penalty(ContactLaw),
    /// Collision after collision in the order of time: each with its own normal, at its
    /// own moment, thousands in one substep if need be. Nothing tunnels at any speed, and
    /// bounces lose no height that restitution does not take.
    ///
    /// In between marbles fly along parabolas, with the mean acceleration of the substep
    /// by the integrator; exact for gravity. What lies on one wall of whatever form rests,
    /// rolls or slides as the equations of a rolling ball say, and changes over at its moment.
    /// On half-spaces and flat faces they are solved in closed form. On what bends (spheres,
    /// capsules, edges and corners) and on walls that tilt they are integrated in steps by
    /// which the normal turns by 0.02 rad at most, and a marble leaves where nothing presses it
    /// any more. What touches several walls, or other marbles, is held as by
    /// [`Response::Impulse`], in as many iterations as it takes, for 4,000 contacts altogether;
    /// only in heaps of more do the [iterations](crate::world::Model::iterations) count. Give it
    /// 50 or more there: a contact that they leave undecided is one more event, which costs
    /// more. Bounces end when the rest of them would take less than
    /// a few thousandths of a substep.
    ///
    /// A wall that was [set](crate::world::Walls::set) to another place since the last step,
    /// and has a [motion](crate::world::WallMotion), goes through the step by that motion, and
    /// is at its end where it was set to. One that only has a motion stays, and carries along
    /// its surface what lies on it.
    ///
    /// A substep has a budget: 32 million looks at one wall or one other marble, and 20,000 for
    /// each marble besides, about a second for a few hundred. What is not at the end of the
    /// substep then stays where it is, loses its velocity, and is named by
    /// [`World::stopped`](crate::world::World::stopped).
    ///
    /// Counts in `f64` also in a world of `f32`; see
    /// [`Precision`](crate::world::Precision) for what such a world remembers of it. It
    /// finds its collisions by itself, so taking contacts out of the world's lists does
    /// not keep marbles apart.
    EventDriven,
}

impl Response {
    /// False if it knows balls only.
    #[must_use]
    pub fn knows_capsules(self) -> bool {
        !matches!(self, Self::EventDriven | Self::SoftStep)
    }

    /// Whether it acts only on what overlaps.
    pub(crate) fn needs_overlap(self) -> bool {
        matches!(self, Self::Penalty(_))
    }
}

/// The columns that a response works on; all of one length.
#[derive(Debug)]
pub(crate) struct Columns<'a, S> {
    pub period: Period<S>,
    /// Centers, in metres.
    pub position: &'a mut [Point3<S>],
    /// In metres per second.
    pub velocity: &'a mut [Vec3<S>],
    /// In metres.
    pub radius: &'a [S],
    /// In 1/kg; zero for what cannot be moved. Empty for a response that has no use
    /// for it.
    pub inverse_mass: &'a [S],
    /// In rad/s; empty where contacts neither feel nor change it.
    pub spin: &'a mut [Vec3<S>],
    /// Which rows contacts cannot set spinning; empty if there are none.
    pub held: &'a [bool],
    /// What is long about each row; empty if all are balls.
    pub rods: &'a [Rod<S>],
}

/// What makes a capsule of a ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rod<S> {
    /// A unit vector in world space, and half the length of the line, in metres; zero for a
    /// ball.
    pub axis: Vec3<S>,
    pub half: S,
    /// The mass over the moments of inertia along the axis and across it, in 1/m²; nothing for
    /// what contacts cannot set spinning.
    pub whirl: [S; 2],
}

impl<S: Scalar> Rod<S> {
    /// The moments of inertia along the axis and across it over the mass, in m²: of a
    /// cylinder with half a ball at each end, of even density.
    pub fn moments(radius: S, half: S) -> [S; 2] {
        let number = S::constant;
        let squared = radius * radius;
        // As parts of all: the cylinder has π r² 2 h, the two halves 4/3 π r³.
        let cylinder = half / (half + radius * number(2.0 / 3.0));
        let ends = S::one() - cylinder;
        let along = cylinder * squared * number(0.5) + ends * squared * number(0.4);
        // The middle of half a ball is 3/8 r from its flat side (Steiner).
        let cylinder_across = squared * number(0.25) + half * half / number(3.0);
        let ends_across = squared * number(0.4) + half * half + half * radius * number(0.75);
        [along, cylinder * cylinder_across + ends * ends_across]
    }

    /// A torque about its middle over the mass, as the change of spin that it makes.
    pub fn whirl_of(&self, torque: Vec3<S>) -> Vec3<S> {
        let [along, across] = self.whirl;
        let part = self.axis * torque.dot(self.axis);
        part * along + (torque - part) * across
    }
}

impl<S: Scalar> Columns<'_, S> {
    /// Whether an impulse can set the marble in a row spinning.
    #[inline]
    fn ball_spin(&self, row: usize) -> BallSpin {
        let held = self.held.get(row).copied().unwrap_or(false);
        if held || self.spin.is_empty() { BallSpin::Ignored } else { BallSpin::Free }
    }

    /// The spin in a row, in rad/s, as far as contacts feel it.
    #[inline]
    fn felt_spin(&self, row: usize) -> Vec3<S> {
        match self.ball_spin(row) {
            BallSpin::Free => self.spin[row],
            BallSpin::Ignored => Vec3::zero(),
        }
    }

    /// Radius times spin, in m/s.
    #[inline]
    fn rim(&self, row: usize) -> Vec3<S> {
        self.felt_spin(row) * self.radius[row]
    }

    /// In 1/(kg m²), of a capsule the greatest; zero for what cannot be turned.
    fn inverse_inertia(&self, row: usize) -> S {
        if let Some(Rod { whirl: [along, across], .. }) = self.rod(row) {
            return along.max(*across) * self.inverse_mass[row];
        }
        let whirl = self.ball_spin(row).of_solid_ball::<S>();
        whirl * self.inverse_mass[row] / (self.radius[row] * self.radius[row])
    }

    /// From the middle of a row to the point of its axis that a contact is about.
    #[inline]
    fn offset(&self, row: usize, along: S) -> Vec3<S> {
        self.rods.get(row).map_or_else(Vec3::zero, |rod| rod.axis * along)
    }

    /// What is long about a row that can be set spinning, if anything is.
    #[inline]
    fn rod(&self, row: usize) -> Option<&Rod<S>> {
        self.rods.get(row).filter(|rod| rod.half > S::zero())
    }

    /// How easily a row gives way where it is touched, with its center that way; in 1/kg.
    fn mobility(&self, row: usize, along: S, normal: Vec3<S>) -> Mobility<S> {
        let inverse_mass = self.inverse_mass[row];
        let Some(rod) = self.rod(row) else {
            return Mobility::of([
                (S::zero(), BallSpin::Ignored),
                (inverse_mass, self.ball_spin(row)),
            ]);
        };
        let arm = rod.axis * along - normal * self.radius[row];
        let lever = arm.cross(normal);
        let [most, across] = rod.whirl;
        let most = most.max(across);
        Mobility {
            normal: inverse_mass * (S::one() + lever.dot(rod.whirl_of(lever))),
            // At most; so a step across never goes too far.
            tangent: inverse_mass * (S::one() + most * arm.magnitude2()),
        }
    }

    /// The velocity that its spin gives to the point of a row's axis that a contact is about.
    #[inline]
    fn swing(&self, row: usize, along: S) -> Vec3<S> {
        match self.rod(row) {
            Some(rod) => self.felt_spin(row).cross(rod.axis * along),
            None => Vec3::zero(),
        }
    }

    /// Changes a velocity by a hit where a marble is touched, and its spin with it;
    /// `normal` points to its center, or to the point `along` its axis.
    #[inline]
    fn hit(&mut self, row: usize, change: Vec3<S>, normal: Vec3<S>, along: S) {
        self.velocity[row] += change;
        if !self.rods.is_empty() && self.hit_rod(row, change, normal, along) {
            return;
        }
        let whirl = self.ball_spin(row).of_solid_ball::<S>();
        if let Some(spin) = self.spin.get_mut(row) {
            *spin -= normal.cross(change) * (whirl / self.radius[row]);
        }
    }

    /// Changes the spin of what is long, if it is.
    fn hit_rod(&mut self, row: usize, change: Vec3<S>, normal: Vec3<S>, along: S) -> bool {
        let Some(rod) = self.rod(row).copied() else { return false };
        let arm = rod.axis * along - normal * self.radius[row];
        if let Some(spin) = self.spin.get_mut(row) {
            *spin += rod.whirl_of(arm.cross(change));
        }
        true
    }

    /// Changes a spin by an angular impulse, in kg m²/s.
    fn twist(&mut self, row: usize, twist: Vec3<S>) {
        let inverse = self.inverse_inertia(row);
        if let Some(rod) = self.rod(row).copied() {
            let inverse_mass = self.inverse_mass[row];
            if let Some(spin) = self.spin.get_mut(row) {
                *spin += rod.whirl_of(twist * inverse_mass);
            }
            return;
        }
        if let Some(spin) = self.spin.get_mut(row) {
            *spin += twist * inverse;
        }
    }
}
