use cgmath::{InnerSpace, Zero};

use crate::contact::Contacts;
use crate::math::{Scalar, Vec3, cast_vector, direction_and_length, is_finite};
use crate::response::impact::at_most;
use crate::response::impulse::First;
use crate::response::material::Compliance;
use crate::response::{Columns, Material, Mobility, Push, Walls, Work};

/// How a penalty force grows with the overlap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ContactLaw {
    /// A spring and a dashpot (Cundall and Strack 1979), as stiff as the step can bear: a
    /// collision takes [16](ContactLaw::STEPS) substeps, whatever the masses.
    #[default]
    SpringDashpot,
    /// That of elastic balls: Hertz (1882) along the normal, Mindlin (1949) across it,
    /// with the damping of Tsuji, Tanaka and Ishida (1992). The materials'
    /// [`Elasticity`](super::Elasticity) says how stiff they are; substeps must be a small part of the
    /// Rayleigh time, or the forces throw marbles about.
    HertzMindlin,
}

impl ContactLaw {
    /// How many substeps a collision takes by [`ContactLaw::SpringDashpot`].
    pub const STEPS: u32 = 16;
}

/// What a contact remembers: how far its two points were displaced against each other
/// across the normal while they held, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shear<S> {
    key: Key,
    stretch: Vec3<S>,
}

impl<S> Shear<S> {
    /// The rows of its marbles.
    pub fn rows(&self) -> [Option<usize>; 2] {
        let (two_marbles, a, b, ..) = self.key;
        [two_marbles.then_some(a as usize), Some(b as usize)]
    }
}

/// Names a contact: whether of two marbles, who, which part of a wall, which ends of capsules.
type Key = (bool, u32, u32, u32, [i8; 2]);

/// One touch: who, where, and how the two give way.
struct Touch<S> {
    /// None for a wall.
    a: Option<usize>,
    b: usize,
    /// How far along the axis of each.
    along: [S; 2],
    /// From a to b.
    normal: Vec3<S>,
    overlap: S,
    /// Of b's point relative to a's, and of the wall's surface, in m/s.
    closing: Vec3<S>,
    surface: Vec3<S>,
    mobility: Mobility<S>,
    /// The sum of the curvatures, in 1/m.
    curvature: S,
    material: Material<S>,
    /// How much the surfaces give way together.
    compliance: Compliance<S>,
}

/// Stiffness and damping of a touch, along the normal and across it: N/m, N s/m.
struct Springs<S> {
    /// The elastic force of the overlap, in newtons.
    push: S,
    normal_damping: S,
    stiffness: S,
    damping: S,
}

/// [`Response::Penalty`](super::Response::Penalty): forces that grow with the overlap
/// change velocities, and nothing else does. `shear` is what contacts remember.
///
/// The contacts' rows exist. Rows that end up infinite or NaN lose their velocity and are
/// added to `stopped`.
pub(crate) fn penalty<S: Scalar>(
    law: ContactLaw,
    marbles: &mut Columns<S>,
    contacts: &mut Contacts<S>,
    walls: &impl Walls<S>,
    material: impl Fn(usize) -> Material<S>,
    dt: S,
    shear: &mut Vec<Shear<S>>,
    stopped: &mut Vec<u32>,
    mut work: Option<&mut Work>,
) {
    contacts.sort();
    let before = std::mem::take(shear);
    let mut pushes = Vec::with_capacity(contacts.len());
    let wm = contacts.wm.iter().map(|c| ((false, c.a, c.b, c.part), c.along));
    let mm = contacts.mm.iter().map(|c| ((true, c.a, c.b, 0), c.along));
    // All forces are those of the same moment, whatever the order.
    for (key, along) in wm.chain(mm) {
        let Some(touch) = touch(marbles, walls, &material, key, along) else { continue };
        let (two_marbles, a, b, part) = key;
        // Which ends of capsules.
        let side = along.map(|x| if x > S::zero() { 2 } else { i8::from(x < S::zero()) });
        let key = (two_marbles, a, b, part, side);
        let springs = springs(law, &touch, dt);
        let normal = touch.normal;
        let approach = -touch.closing.dot(normal);
        let pressure = (springs.push + springs.normal_damping * approach).max(S::zero());
        let sliding = touch.closing + normal * approach;
        let held = before.binary_search_by_key(&key, |shear| shear.key);
        let held = held.map_or_else(|_| Vec3::zero(), |at| before[at].stretch);
        // The plane of touch has turned since; the stretch turns along.
        let mut stretch = held - normal * held.dot(normal) + sliding * dt;
        let grip = -(stretch * springs.stiffness + sliding * springs.damping);
        let limit = touch.material.friction * pressure;
        let held = at_most(grip, limit);
        if held != grip && springs.stiffness > S::zero() {
            // It slides: the spring stretches no further than friction holds.
            stretch = -(held + sliding * springs.damping) / springs.stiffness;
            stretch = at_most(stretch, limit / springs.stiffness);
        }
        // A memory that is no number would be one for ever.
        if is_finite(stretch) {
            shear.push(Shear { key, stretch });
        }
        pushes.push((touch, normal * pressure + held, pressure));
    }
    for (touch, force, pressure) in &pushes {
        let impulse = *force * dt;
        let [first, second] = touch.along;
        for (row, impulse, normal, along) in [
            (Some(touch.b), impulse, touch.normal, second),
            (touch.a, -impulse, -touch.normal, first),
        ] {
            let Some(row) = row else { continue };
            marbles.hit(row, impulse * marbles.inverse_mass[row], normal, along);
        }
        resist(marbles, touch, *pressure * dt, work.as_deref_mut());
    }
    if let Some(work) = work {
        for (touch, force, _) in pushes {
            touch.count(marbles, force * dt, work);
        }
    }
    shear.sort_unstable_by_key(|shear| shear.key);
    for contact in contacts.wm.iter().chain(&contacts.mm) {
        stop_if_infinite(marbles, contact.b, stopped);
    }
    contacts.mm.iter().for_each(|contact| stop_if_infinite(marbles, contact.a, stopped));
}

fn stop_if_infinite<S: Scalar>(marbles: &mut Columns<S>, row: u32, stopped: &mut Vec<u32>) {
    let velocity = &mut marbles.velocity[row as usize];
    if !is_finite(*velocity) {
        *velocity = Vec3::zero();
        stopped.push(row);
    }
}

fn touch<S: Scalar>(
    marbles: &Columns<S>,
    walls: &impl Walls<S>,
    material: &impl Fn(usize) -> Material<S>,
    (two_marbles, a, b, part): (bool, u32, u32, u32),
    along: [S; 2],
) -> Option<Touch<S>> {
    let (a, b) = (a as usize, b as usize);
    let own = material(b);
    let mut closing = marbles.velocity[b] + marbles.swing(b, along[1]);
    let mut rim = marbles.rim(b);
    let center = marbles.position[b] + marbles.offset(b, along[1]);
    let mut curvature = S::one() / marbles.radius[b];
    let mut compliance = own.elasticity.compliance();
    let mut surface = Vec3::zero();
    let (normal, distance, both);
    if two_marbles {
        let other = material(a);
        let apart =
            direction_and_length(center - marbles.position[a] - marbles.offset(a, along[0]));
        let (direction, centers) = apart.unwrap_or((Vec3::unit_x(), S::zero()));
        (normal, distance) = (direction, centers - marbles.radius[a]);
        closing -= marbles.velocity[a] + marbles.swing(a, along[0]);
        rim += marbles.rim(a);
        curvature += S::one() / marbles.radius[a];
        compliance = compliance.and(other.elasticity.compliance());
        both = own.against(other);
    } else {
        (normal, distance) = walls.normal_and_distance(a, part, center);
        surface = walls.surface_velocity(a, center - normal * marbles.radius[b]);
        closing -= surface;
        let its = walls.material(a);
        both = its.map_or(own, |its| own.against(its));
        // A wall without a material of its own is rigid.
        if let Some(its) = its {
            compliance = compliance.and(its.elasticity.compliance());
        }
    }
    let overlap = marbles.radius[b] - distance;
    let mut mobility = marbles.mobility(b, along[1], normal);
    if two_marbles {
        mobility = mobility.and(marbles.mobility(a, along[0], -normal));
    }
    let touches = overlap > S::zero() && overlap.is_finite() && mobility.normal > S::zero();
    touches.then(|| Touch {
        a: two_marbles.then_some(a),
        b,
        along,
        normal,
        overlap,
        closing: closing + normal.cross(rim),
        surface,
        mobility,
        curvature,
        material: both,
        compliance,
    })
}

impl<S: Scalar> Touch<S> {
    /// Counts what an impulse did, after all have.
    fn count(&self, marbles: &Columns<S>, impulse: Vec3<S>, work: &mut Work) {
        let Self { b, along, normal, closing, surface, .. } = *self;
        let first = self.a.map_or(First::Wall(0, 0), |a| First::Marble(a as u32));
        let after = marbles.closing(first, b, along, normal, surface);
        work.push(Push {
            impulse: cast_vector(impulse),
            normal: cast_vector(normal),
            mean: cast_vector::<S, f64>(closing + after) * 0.5,
            fixed: [
                self.a.map_or(Some(cast_vector(surface)), |a| marbles.fixed(a)),
                marbles.fixed(b),
            ],
        });
        work.collisions += 1;
    }
}

fn springs<S: Scalar>(law: ContactLaw, touch: &Touch<S>, dt: S) -> Springs<S> {
    let mass = touch.mobility.normal.recip();
    let rim_mass = touch.mobility.tangent.recip();
    let number = S::constant;
    // What is lost in a collision, as a part of critical damping. Nothing at all would
    // take endless damping to lose; a thousandth of the speed is as good.
    let log = touch.material.restitution.max(number(1e-3)).ln_portable();
    let pi = number(std::f64::consts::PI);
    let loss = -log / (log * log + pi * pi).sqrt();
    match law {
        ContactLaw::SpringDashpot => {
            let time = dt * number(f64::from(ContactLaw::STEPS));
            let frequency = (log * log + pi * pi).sqrt() / time;
            let stiffness = mass * frequency * frequency;
            let damping = number(2.0) * loss * frequency;
            Springs {
                push: stiffness * touch.overlap,
                normal_damping: damping * mass,
                // As fast across the normal as along it.
                stiffness: rim_mass * frequency * frequency,
                damping: damping * rim_mass,
            }
        }
        ContactLaw::HertzMindlin => {
            let contact_radius = (touch.overlap / touch.curvature).sqrt();
            let stiffness = number(2.0) * contact_radius / touch.compliance.normal;
            let across = number(8.0) * contact_radius / touch.compliance.tangent;
            let tsuji = number(2.0 * (5.0_f64 / 6.0).sqrt()) * loss;
            Springs {
                push: stiffness * touch.overlap * number(2.0 / 3.0),
                normal_damping: tsuji * (stiffness * mass).sqrt(),
                stiffness: across,
                damping: tsuji * (across * mass).sqrt(),
            }
        }
    }
}

/// Lets rolling and spinning resistance act with this normal impulse, at most so that the
/// two no longer turn against each other.
fn resist<S: Scalar>(
    marbles: &mut Columns<S>,
    touch: &Touch<S>,
    pressure: S,
    work: Option<&mut Work>,
) {
    let Material { rolling_resistance, spinning_resistance, .. } = touch.material;
    if rolling_resistance == S::zero() && spinning_resistance == S::zero() {
        return;
    }
    let give = |row: usize| marbles.inverse_inertia(row);
    let (b, a) = (touch.b, touch.a);
    let relative = marbles.felt_spin(b) - a.map_or_else(Vec3::zero, |a| marbles.felt_spin(a));
    let give = give(b) + a.map_or(S::zero(), give);
    if give <= S::zero() {
        return;
    }
    let about = touch.normal * relative.dot(touch.normal);
    let lever = pressure / touch.curvature;
    let twist = at_most((relative - about) / give, rolling_resistance * lever)
        + at_most(about / give, spinning_resistance * lever);
    marbles.twist(b, -twist);
    if let Some(a) = a {
        marbles.twist(a, twist);
    }
    if let Some(work) = work {
        let after = relative - twist * give;
        work.twist(cast_vector(-twist), cast_vector(relative), cast_vector(after));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Point3;
    use crate::response::Elasticity;

    /// Two balls of this elasticity meet head-on at `speed` each, with gravity off:
    /// contact time, largest overlap, largest force (by the change of velocity).
    fn head_on(elasticity: Elasticity<f64>, density: f64, radius: f64, speed: f64) -> [f64; 3] {
        let mass = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3) * density;
        let shear = elasticity.youngs_modulus / (2.0 + 2.0 * elasticity.poissons_ratio);
        let rayleigh = std::f64::consts::PI * radius * (density / shear).sqrt()
            / (0.1631 * elasticity.poissons_ratio + 0.8766);
        let dt = 0.01 * rayleigh;
        let mut position = [Point3::new(-radius, 0.0, 0.0), Point3::new(radius, 0.0, 0.0)];
        let mut velocity = [Vec3::new(speed, 0.0, 0.0), Vec3::new(-speed, 0.0, 0.0)];
        let own = Material { restitution: 1.0, elasticity, ..Material::default() };
        let (mut time, mut overlap, mut force) = (0.0_f64, 0.0_f64, 0.0_f64);
        let mut shear = Vec::new();
        let walls: Vec<crate::response::event::Wall> = Vec::new();
        loop {
            for (position, velocity) in position.iter_mut().zip(velocity) {
                *position += velocity * dt;
            }
            let apart = position[1].x - position[0].x - 2.0 * radius;
            if apart > 0.0 {
                // They parted within this step.
                time += dt - apart / (velocity[1].x - velocity[0].x);
                return [time, overlap, force];
            }
            let mut contacts = Contacts::default();
            contacts.mm.push(crate::contact::Contact {
                a: 0,
                b: 1,
                part: 0,
                along: [0.0; 2],
                mtv: Vec3::zero(),
            });
            let before = velocity[1].x;
            let mut columns = Columns {
                position: &mut position,
                velocity: &mut velocity,
                radius: &[radius, radius],
                inverse_mass: &[1.0 / mass, 1.0 / mass],
                spin: &mut [],
                held: &[],
                rods: &[],
            };
            let law = ContactLaw::HertzMindlin;
            let mut stopped = vec![];
            penalty(
                law,
                &mut columns,
                &mut contacts,
                &walls,
                |_| own,
                dt,
                &mut shear,
                &mut stopped,
                None,
            );
            time += dt;
            overlap = overlap.max(-apart);
            force = force.max((velocity[1].x - before) * mass / dt);
        }
    }

    #[test]
    fn elastic_balls_collide_as_hertz_says() {
        // Chung and Ooi (2011), test 1: glass and limestone; recomputed by their formulas.
        for (modulus, ratio, density, exact) in [
            (4.8e10, 0.2, 2800.0, [40.336e-6, 274.11e-6, 10_696.9]),
            (2.0e10, 0.25, 2500.0, [54.196e-6, 368.30e-6, 7108.2]),
        ] {
            let elasticity = Elasticity { youngs_modulus: modulus, poissons_ratio: ratio };
            let found = head_on(elasticity, density, 0.01, 10.0);
            // The end of the contact is seen only at the end of a step, of 1 %.
            for ((found, exact), tolerance) in found.into_iter().zip(exact).zip([1e-2, 1e-3, 1e-3])
            {
                assert!((found / exact - 1.0).abs() < tolerance, "{found}, not {exact}");
            }
        }
    }
}
