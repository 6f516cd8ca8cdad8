//! The scene, in plain numbers: two lanes of the same slope side by side, one of boxes and
//! one of half-spaces, and who goes down them.

use bevy_taw::taw::prelude::*;
use bevy_taw::taw::shape::Aabb;

/// Steps, and how high and how deep each of them is, in metres.
pub const STEPS: u32 = 12;
pub const RISE: f32 = 0.2;
pub const RUN: f32 = 0.5;
/// Half of the width of a lane, in metres.
pub const HALF_WIDTH: f32 = 1.2;
/// Whoever is so far, in metres along x, has arrived: one step beyond the last.
pub const END: f32 = RUN * (STEPS + 1) as f32;
/// The push of the keys, over the mass, in m/s².
pub const PUSH: f32 = 3.0;

/// Of all who go down.
pub const RADIUS: f32 = 0.2;
pub const HALF_LENGTH: f32 = 0.2;

/// One that goes down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Runner {
    pub capsule: bool,
    pub stairs: bool,
}

/// All four, in the order of their tracks.
pub const RUNNERS: [Runner; 4] = [
    Runner { capsule: false, stairs: true },
    Runner { capsule: true, stairs: true },
    Runner { capsule: false, stairs: false },
    Runner { capsule: true, stairs: false },
];

impl Runner {
    pub fn name(self) -> &'static str {
        match (self.capsule, self.stairs) {
            (false, true) => "sphere, stairs",
            (true, true) => "capsule, stairs",
            (false, false) => "sphere, ramp",
            (true, false) => "capsule, ramp",
        }
    }

    /// Place at the start: on the landing at the top, where the ramp begins to fall.
    pub fn start(self) -> [f32; 3] {
        let lane = if self.stairs { HALF_WIDTH } else { -HALF_WIDTH };
        let beside = if self.capsule { 0.6 } else { -0.6 };
        [-0.5, top() + RADIUS + 0.01, lane + beside]
    }

    /// A capsule lies across its lane, so that it rolls.
    pub fn half_length(self) -> f32 {
        if self.capsule { HALF_LENGTH } else { 0.0 }
    }
}

/// The height of the landing, in metres.
pub fn top() -> f32 {
    RISE * STEPS as f32
}

/// The boxes of the stairs and of the landing: corners with the least and the greatest
/// coordinates.
pub fn boxes() -> Vec<[[f32; 3]; 2]> {
    let landing = [[-3.0, -1.0, -2.0 * HALF_WIDTH], [0.0, top(), 2.0 * HALF_WIDTH]];
    let step = |i: u32| {
        let (x, y) = (RUN * i as f32, top() - RISE * (i + 1) as f32);
        [[x, -1.0, 0.0], [x + RUN, y, 2.0 * HALF_WIDTH]]
    };
    // The last step is the floor.
    std::iter::once(landing).chain((0..STEPS - 1).map(step)).collect()
}

/// The half-spaces of the ramp and the floor: a point and the direction that is free. The
/// ramp runs through the inner edges of the steps, so these stand out of it.
pub fn half_spaces() -> [([f32; 3], [f32; 3]); 2] {
    [([0.0, top() - RISE, 0.0], [RISE, RUN, 0.0]), ([0.0; 3], [0.0, 1.0, 0.0])]
}

/// Model of the table and of the example.
pub fn model(response: Response) -> Model {
    let rotation = Rotation::Dynamic;
    Model { response, rotation, detection: Detection::Swept, substeps: 4, ..Model::default() }
}

/// Of the runners: no rebound, and friction enough to roll.
pub fn material() -> Material<f32> {
    Material { restitution: 0.3, friction: 0.6, ..Material::default() }
}

/// Results of a run down the lanes.
#[derive(Clone, Copy, Debug)]
pub struct Run {
    /// When it arrived, in seconds, and how fast it was, in m/s.
    pub arrival: Option<(f32, f32)>,
    /// Largest height above the slope, in metres, and the number of touchdowns.
    pub highest: f32,
    pub hops: u32,
}

/// Lets one runner go down alone, without a window.
pub fn run(runner: Runner, response: Response) -> Result<Run, bevy_taw::taw::Error> {
    let mut world = World::<f32>::default();
    world.set_model(model(response))?;
    for [min, max] in boxes() {
        world.walls.insert(Aabb::new(Point3::from(min), Point3::from(max))?)?;
    }
    for (point, normal) in half_spaces() {
        world.walls.insert(Plane::through(Point3::from(point), Vec3::from(normal))?)?;
    }
    let mut marble = Marble::new(Point3::from(runner.start()), RADIUS);
    marble.half_length = runner.half_length();
    let quarter = std::f32::consts::FRAC_PI_2;
    marble.rotation = bevy_taw::taw::frame::AxisAngle::new(Vec3::unit_x(), quarter)?.into();
    marble.material = Some(material());
    let id = world.marbles.insert(marble)?;
    let (mut found, mut in_air) = (Run { arrival: None, highest: 0.0, hops: 0 }, false);
    for step in 0..3_600_u16 {
        let marble = world.marbles.get(id)?;
        // Pushed until it is over the edge.
        if marble.position.x < 0.2 {
            let kilograms = marble.mass.of_capsule(RADIUS, marble.half_length);
            world.marbles.apply_force(id, Vec3::unit_x() * (PUSH * kilograms))?;
        }
        world.step(1.0 / 60.0)?;
        let marble = world.marbles.get(id)?;
        let touches =
            world.contacts.wm.iter().any(|c| c.separation < 0.0) || !world.impacts().is_empty();
        found.hops += u32::from(in_air && touches);
        in_air = !touches;
        let slope = (top() - RISE - marble.position.x * RISE / RUN).max(0.0);
        let over = (marble.position.y - RADIUS - slope) * RUN / RISE.hypot(RUN);
        if marble.position.x > 0.0 {
            found.highest = found.highest.max(over);
        }
        if marble.position.x >= END {
            found.arrival = Some((f32::from(step) / 60.0, marble.velocity.magnitude()));
            break;
        }
    }
    Ok(found)
}
