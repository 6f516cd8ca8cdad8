//! **Drop**: a marble falls on a floor and comes to rest, without Bevy: `cargo run -p taw --example drop`.

use taw::prelude::*;

fn main() -> Result<(), taw::Error> {
    let mut world = World::<f64>::default();
    world.set_model(Model { response: Response::Impulse, ..Model::default() })?;
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0)?)?; // solid below it
    let material = Material { restitution: 0.6, ..Material::default() };
    let marble = Marble::new(Point3::new(0.0, 2.0, 0.0), 0.5);
    let id = world.marbles.insert(Marble { material: Some(material), ..marble })?;
    for step in 0..=180 {
        if step % 10 == 0 {
            let Marble { position, velocity, .. } = world.marbles.get(id)?;
            let time = f64::from(step) / 60.0;
            println!("{time:4.2} s: {:.3} m high, {:+.2} m/s", position.y, velocity.y);
        }
        world.step(1.0 / 60.0)?;
    }
    Ok(())
}
