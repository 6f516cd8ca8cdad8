//! Impulse cache: the impulses of the last substep, for the warm start of the next one.

use cgmath::Zero;

use super::Constraint;
use crate::constraint::ContactImpulse;
use crate::contact::Contacts;
use crate::math::{RealVector, Scalar, Vec3};
use crate::response::{ContactKey, KeyedByContact, SolverBodies};

/// Impulse cache entry: the impulses of a contact in the last substep, for the warm start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CachedImpulse<S> {
    key: ContactKey,
    impulse: ContactImpulse<S>,
    angular_impulse: Vec3<S>,
}

impl<S: Scalar> CachedImpulse<S> {
    /// Entry without friction, from a normal impulse as a change of speed, in m/s.
    pub(in crate::response) fn of_normal_impulse(key: ContactKey, normal_impulse: S) -> Self {
        let impulse = ContactImpulse { normal: normal_impulse, tangent: Vec3::zero() };
        Self { key, impulse, angular_impulse: Vec3::zero() }
    }

    pub(in crate::response) fn normal_impulse(&self) -> S {
        self.impulse.normal
    }
}

impl<S: Scalar> KeyedByContact for CachedImpulse<S> {
    fn key(&self) -> ContactKey {
        self.key
    }

    fn set_key(&mut self, key: ContactKey) {
        self.key = key;
    }

    fn reverse(&mut self) {
        self.impulse.tangent = -self.impulse.tangent;
        self.angular_impulse = -self.angular_impulse;
    }
}

/// Stores the impulses in the contacts, and for the next substep's warm start.
pub(super) fn store_impulses<S: Scalar>(
    constraints: &[Constraint<S>],
    contacts: &mut Contacts<S>,
    cache: &mut Vec<CachedImpulse<S>>,
) {
    for c in constraints {
        let Some(contact) = contacts.get_mut(c.index) else { continue };
        let inverse_mass = c.inverse_effective_mass.normal;
        contact.set_impulse(c.impulse.normal / inverse_mass, c.impulse.tangent / inverse_mass);
    }
    cache.clear();
    // What bears nothing begins from nothing.
    let bearing = constraints.iter().filter(|c| c.impulse.normal > S::zero());
    cache.extend(bearing.map(|c| CachedImpulse {
        key: c.key,
        impulse: c.impulse,
        angular_impulse: c.angular_impulse(),
    }));
    cache.sort_unstable_by_key(|entry| entry.key);
}

impl<S: Scalar> SolverBodies<'_, S> {
    /// Warm start: applies the impulses of the last substep. Bouncing contacts are new and have
    /// none.
    pub(super) fn warm_start(
        &mut self,
        constraints: &mut [Constraint<S>],
        cache: &[CachedImpulse<S>],
    ) {
        for c in constraints.iter_mut().filter(|c| !c.bounces) {
            let Ok(at) = cache.binary_search_by_key(&c.key, |entry| entry.key) else { continue };
            let CachedImpulse { impulse, angular_impulse, .. } = cache[at];
            let tangent = impulse.tangent.reject_from(c.normal);
            c.impulse = c.saturate(ContactImpulse { tangent, ..impulse });
            self.apply_impulse_pair(c, c.impulse());
            if let Some(rolling) = &mut c.rolling {
                rolling.angular_impulse = angular_impulse;
                self.apply_angular_impulse_pair(c, angular_impulse);
            }
        }
    }
}
