//! Contact constraints: the impulse of one contact point, written once for every method that solves
//! contacts by impulses, and for one number or eight at a time.
//!
//! # Derivation
//! An impulse `p` on the second body of a contact, and `−p` on the first, changes the velocity `v`
//! of the second contact point relative to the first by `K p` (Catto, *Iterative dynamics with
//! temporal coherence*, 2005). For two balls `K` is diagonal: `1/m₁ + 1/m₂` along the normal, which
//! passes through the centers, and that times `1 + m r² / I` across it, which is 7/2 for solid balls,
//! since balls also turn. Its inverse are the effective masses `m` along the normal and across it.
//!
//! - **Normal.** Bodies do not approach each other faster than a target, and contacts do not pull:
//!   `λ ≥ 0`, `v·n ≥ v*`, and one of the two holds with equality (Signorini). One step of projected
//!   Gauss–Seidel adds the impulse `m (v* − v·n)` that alone would reach the target, and clamps the
//!   sum: `λ ← max(0, λ + m (v* − v·n))`.
//! - **Friction.** The tangent impulse stops the slip as far as the cone allows (Coulomb):
//!   `λₜ ← λₜ − mₜ vₜ`, clamped to the length `µ λ`, with the `λ` of this step. It is the round
//!   cone, not a pyramid.
//! - **Rolling and torsional friction.** The angular impulse stops the relative spin, clamped to
//!   `λ` times a lever: one about the tangents, one about the normal.
//! - **Softness.** A spring and damper, integrated implicitly, apply only a part of the impulse and
//!   give back a part of what has accumulated: `λ ← max(0, λ + a m (v* − v·n) − b λ)` (Catto, *Soft
//!   contacts*, in `Solver2D`, 2024).
//!
//! Methods differ in the order of the contacts, the targets and the units of the impulses. The units
//! are the caller's: N s, or m/s after multiplication by an inverse mass.

#![allow(
    clippy::inline_always,
    reason = "kernels are compiled for the instructions of their caller"
)]

mod contact_impulse;
mod softness;
mod tipping;

pub(crate) use contact_impulse::{ContactImpulse, FrictionCone, solve_rolling};
pub(crate) use softness::{ContactSoftness, Softness};
pub(crate) use tipping::{TIPPING, tipped, tipping_speed};
