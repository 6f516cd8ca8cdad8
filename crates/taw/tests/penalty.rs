//! Forces that grow with the overlap: what they give back, what they bear, and that they make
//! nothing from nothing.

use taw::prelude::*;
use taw::response::Elasticity;

const BOTH: [ContactLaw; 2] = [ContactLaw::SpringDashpot, ContactLaw::HertzMindlin];
const INTEGRATORS: [Integrator; 3] =
    [Integrator::ExplicitEuler, Integrator::SemiImplicitEuler, Integrator::VelocityVerlet];

fn world<S: Scalar>(law: ContactLaw, integrator: Integrator) -> World<S> {
    let response = Response::Penalty(law);
    let rotation = Rotation::Dynamic;
    let mut world = World::default();
    let model = Model { response, rotation, integrator, ..Model::default() };
    world.set_model(model).unwrap();
    world
}

/// A material so stiff that a head-on collision takes 16 substeps of 1 ms by Hertz's law too.
fn material(restitution: f64, friction: f64) -> Material<f64> {
    let elasticity = Elasticity { youngs_modulus: 1e7, poissons_ratio: 0.25 };
    Material { restitution, friction, elasticity, ..Material::default() }
}

#[test]
fn a_collision_gives_back_the_restitution_that_is_asked_for() {
    for law in BOTH {
        for integrator in INTEGRATORS {
            for asked in [0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9, 1.0] {
                for (with_wall, ratio) in [(true, 1.0), (false, 1.0), (false, 1e-4), (false, 50.0)]
                {
                    for phase in 0..7 {
                        let mut world = world::<f64>(law, integrator);
                        world.set_gravity(Vec3::zero()).unwrap();
                        let radius = 0.1;
                        let own = material(asked, 0.3);
                        let ball = |x: f64, v: f64, mass: f64| Marble {
                            velocity: Vec3::new(v, 0.0, 0.0),
                            mass: Mass::Kilograms(mass),
                            material: Some(own),
                            ..Marble::new(Point3::new(x, 0.0, 0.0), radius)
                        };
                        let speed = 1.0;
                        // Not always at the same moment of a substep.
                        let apart = 0.01 + f64::from(phase) / 7.0 * 1e-3;
                        if with_wall {
                            let wall = Plane::new(-Vec3::unit_x(), 0.0).unwrap();
                            world.walls.insert(wall).unwrap();
                        } else {
                            world.marbles.insert(ball(radius, 0.0, 2.0)).unwrap();
                        }
                        let mass = 2.0 * ratio;
                        let id = world.marbles.insert(ball(-radius - apart, speed, mass)).unwrap();
                        // The stiffest that 16 substeps bear, if that is not enough.
                        let shared = if with_wall { mass } else { mass * 2.0 / (mass + 2.0) };
                        let _ = shared;
                        let dt = match law {
                            ContactLaw::SpringDashpot => 1e-3,
                            ContactLaw::HertzMindlin => {
                                let longest =
                                    own.elasticity.longest_substep(2.0 * shared, radius, speed);
                                longest.min(1e-3)
                            }
                        };
                        for _ in 0..(0.2 / dt) as u32 {
                            world.step(dt).unwrap();
                        }
                        let first = if with_wall { 0.0 } else { world.marbles.velocity()[0].x };
                        let second = world.marbles.get(id).unwrap().velocity.x;
                        let found = first - second;
                        // Which moment of a substep it begins decides the rest.
                        let tolerance = if asked == 0.0 { 0.02 } else { 0.01 };
                        assert!(
                            (found - asked).abs() < tolerance,
                            "{law:?}, {integrator:?}, wall {with_wall}, masses 1 : {ratio}, phase \
                             {phase}: {found}, not {asked}"
                        );
                    }
                }
            }
        }
    }
}
