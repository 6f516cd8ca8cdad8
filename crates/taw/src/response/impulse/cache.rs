//! Impulse cache: the impulses of the last substep, for the warm start of the next one.

use cgmath::{InnerSpace, Zero};

use super::Constraint;
use crate::math::{Scalar, Vec3};
use crate::response::{ContactKey, KeyedByContact, SolverBodies};

/// Impulse cache entry: the impulses of a contact in the last substep, for the warm start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CachedImpulse<S> {
    key: ContactKey,
    normal_impulse: S,
    tangent_impulse: Vec3<S>,
    angular_impulse: Vec3<S>,
}

impl<S: Scalar> CachedImpulse<S> {
    /// Entry without friction, from a normal impulse as a change of speed, in m/s.
    pub(in crate::response) fn of_normal_impulse(key: ContactKey, normal_impulse: S) -> Self {
        Self { key, normal_impulse, tangent_impulse: Vec3::zero(), angular_impulse: Vec3::zero() }
    }

    pub(in crate::response) fn normal_impulse(&self) -> S {
        self.normal_impulse
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
        self.tangent_impulse = -self.tangent_impulse;
        self.angular_impulse = -self.angular_impulse;
    }
}

/// Stores the impulses for the next substep's warm start.
pub(super) fn store_impulses<S: Scalar>(
    constraints: &[Constraint<S>],
    cache: &mut Vec<CachedImpulse<S>>,
) {
    cache.clear();
    cache.extend(constraints.iter().map(|c| CachedImpulse {
        key: c.key(),
        normal_impulse: c.normal_impulse,
        tangent_impulse: c.tangent_impulse,
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
            let Ok(at) = cache.binary_search_by_key(&c.key(), |entry| entry.key) else { continue };
            let CachedImpulse { normal_impulse, tangent_impulse, angular_impulse, .. } = cache[at];
            c.normal_impulse = normal_impulse;
            c.tangent_impulse = tangent_impulse - c.normal * tangent_impulse.dot(c.normal);
            self.apply_impulse_pair(c, c.impulse());
            if let Some(rolling) = &mut c.rolling {
                rolling.angular_impulse = angular_impulse;
                self.apply_angular_impulse_pair(c, angular_impulse);
            }
        }
    }
}
