//! Rows of the table for rigid bodies.

use taw::Error;
use taw::body::{Body, BodyMass};
use taw::frame::Pose;
use taw::prelude::*;
use taw::shape::{MassProperties, Shape};

use super::{Place, Row, Scope};

pub fn bodies<S: Scalar>() -> Vec<Row<S>> {
    table! {
        World 6 "Bodies::insert Bodies::set Bodies::get Bodies::remove Bodies::pose Bodies::motion": |p, x| {
            let body = body();
            let at = |x: S| Point3::new(x, S::from_f64(300.0), S::zero());
            with_body(p, match p.case {
                0 => Body { position: at(x), ..body },
                1 => Body { velocity: Vec3::new(S::zero(), x, S::zero()), ..body },
                2 => Body { angular_velocity: Vec3::new(S::zero(), x, S::zero()), ..body },
                3 => Body { gravity_scale: x, ..body },
                4 => Body { damping: [x, S::one()], ..body },
                _ => Body { damping: [S::one(), x], ..body },
            })
        };
        World 2 "MassProperties::of_shape MassProperties::of_hollow_ball MassProperties::validated Bodies::mass_properties": |p, x| {
            let mass = if p.case == 0 {
                MassProperties::of_hollow_ball(x, S::one())?
            } else {
                MassProperties::of_shape(&Shape::Sphere(Sphere::new(Point3::new(S::zero(), S::zero(), S::zero()), S::one())?), x)?
            };
            let mass = mass.validated()?;
            with_body(p, Body { mass: BodyMass::Given(mass), ..body() })
        };
        World 5 "Bodies::apply_force Bodies::apply_impulse Bodies::apply_central_force Bodies::apply_central_impulse Bodies::set_velocity Bodies::set_pose Bodies::kinetic_energy Bodies::is_asleep Bodies::wake Bodies::reach Bodies::velocity_at": |p, x| {
            // On a copy, so that a refusal after the insertion leaves the world as it was.
            let mut bodies = p.world.bodies.clone();
            let id = bodies.insert(body())?;
            let (push, none) = (Vec3::new(S::zero(), x, S::zero()), Vec3::new(S::zero(), S::zero(), S::zero()));
            let at = Point3::new(S::zero(), S::from_f64(300.0), S::zero());
            match p.case {
                0 => bodies.apply_force(id, push, at).and_then(|()| bodies.apply_central_force(id, push, none)),
                1 => bodies.apply_impulse(id, push, at).and_then(|()| bodies.apply_central_impulse(id, none, push)),
                2 => bodies.set_velocity(id, push, none),
                3 => bodies.set_velocity(id, none, push),
                _ => bodies.set_pose(id, Pose { translation: push, ..Pose::identity() }),
            }?;
            bodies.kinetic_energy(id)?;
            bodies.is_asleep(id)?;
            bodies.reach(id)?;
            bodies.velocity_at(id, at)?;
            bodies.wake(id)?;
            if p.world.model().response == Response::SoftStep {
                p.world.bodies = bodies;
            }
            Ok(())
        };
    }
}

fn body<S: Scalar>() -> Body<S> {
    let half = S::from_f64(0.5);
    let at = Point3::new(S::zero(), S::from_f64(300.0), S::zero());
    Body { layers: CollisionLayers::NONE, ..Body::cuboid(Vec3::new(half, half, half), at) }
}

/// Adds a body, reads and sets it, and takes it out again where the response knows none.
fn with_body<S: Scalar>(p: &mut Place<S>, body: Body<S>) -> Result<(), Error> {
    let id = p.world.bodies.insert(body.clone())?;
    p.world.bodies.set(id, body)?;
    p.world.bodies.get(id)?;
    p.world.bodies.pose(id)?;
    p.world.bodies.motion(id)?;
    p.world.bodies.mass_properties(id)?;
    if p.world.model().response != Response::SoftStep {
        p.world.bodies.remove(id)?;
    }
    Ok(())
}
