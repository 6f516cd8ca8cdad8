use super::*;
use crate::broad::Period;
use crate::contact::Contact;
use crate::math::Point3;
use crate::response::impulse::{SolverSettings, SubstepStart};
use crate::response::{Elasticity, Material};

/// Settings of a substep, of which springs only use its length.
fn solver_settings(dt: f64) -> SolverSettings<f64> {
    SolverSettings {
        iterations: 1,
        dt,
        restitution_threshold: 0.0,
        tolerance: 0.0,
        slop: 0.0,
        max_relative_slop: 0.0,
        max_relative_push: 0.0,
        gravity: Vec3::zero(),
        threads: 1,
        resolve_jams: false,
    }
}

/// Head-on collision of two balls at `speed` each, without gravity: contact time, maximum
/// penetration, maximum force (by the velocity change).
fn head_on(elasticity: Elasticity<f64>, density: f64, radius: f64, speed: f64) -> [f64; 3] {
    let mass = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3) * density;
    let shear_modulus = elasticity.youngs_modulus / (2.0 + 2.0 * elasticity.poissons_ratio);
    let rayleigh = std::f64::consts::PI * radius * (density / shear_modulus).sqrt()
        / (0.1631 * elasticity.poissons_ratio + 0.8766);
    let dt = 0.01 * rayleigh;
    let mut position = [Point3::new(-radius, 0.0, 0.0), Point3::new(radius, 0.0, 0.0)];
    let mut velocity = [Vec3::new(speed, 0.0, 0.0), Vec3::new(-speed, 0.0, 0.0)];
    let own = Material { restitution: 1.0, elasticity, ..Material::default() };
    let material = own.combined_with(own);
    let (mut time, mut penetration, mut force) = (0.0_f64, 0.0_f64, 0.0_f64);
    let mut histories = Vec::new();
    let walls: Vec<crate::shape::Plane<f64>> = Vec::new();
    loop {
        for (position, velocity) in position.iter_mut().zip(velocity) {
            *position += velocity * dt;
        }
        let separation = position[1].x - position[0].x - 2.0 * radius;
        if separation > 0.0 {
            // They separated within this step.
            time += dt - separation / (velocity[1].x - velocity[0].x);
            return [time, penetration, force];
        }
        let mut contacts = Contacts::default();
        contacts.mm.push(Contact { material, ..Contact::between_marbles(0, 1) });
        let before = velocity[1].x;
        let mut columns = SolverBodies {
            period: Period::default(),
            position: &mut position,
            velocity: &mut velocity,
            radius: &[radius, radius],
            inverse_mass: &[1.0 / mass, 1.0 / mass],
            spin: &mut [],
            rotation_locked: &[],
            locked_axes: &[],
            capsules: &[],
        };
        let law = ContactLaw::HertzMindlin;
        let settings = PenaltySettings {
            law,
            wall_stops: &[],
            context: Context {
                walls: &walls,
                position_weight: |_| 0.0,
                start: SubstepStart { position: &[], velocity: &[], ccd_stops: &[] },
                settings: &solver_settings(dt),
            },
        };
        columns.place_contacts(&mut contacts, &walls);
        let mut quarantined = vec![];
        settings.apply(
            &mut columns,
            &mut contacts,
            &mut histories,
            &mut PenaltyScratch::default(),
            &mut quarantined,
            None,
        );
        time += dt;
        penetration = penetration.max(-separation);
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
        // The end of the contact shows only at the end of a step, of 1 %.
        for ((found, exact), tolerance) in found.into_iter().zip(exact).zip([1e-2, 1e-3, 1e-3]) {
            assert!((found / exact - 1.0).abs() < tolerance, "{found}, not {exact}");
        }
    }
}
