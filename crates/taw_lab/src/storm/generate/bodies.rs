//! Random bodies.

use taw::math::{Point3, Vec3};
use taw::prelude::*;
use taw::scene::{MarbleDesc, RotationDesc};

use super::{Dice, surface};
use crate::storm::case::{Case, Kind};

/// Number, kind and placement of bodies.
pub struct Crowd {
    pub kind: Kind,
    /// True where contacts feel spins.
    pub spins: bool,
    pub size: f64,
    pub floor: bool,
    pub low: [f64; 3],
    pub high: [f64; 3],
}

/// Initial state of bodies.
#[derive(Clone, Copy, PartialEq)]
enum Start {
    /// At rest, apart.
    Dropped,
    /// With a velocity, apart.
    Thrown,
    /// In columns, each just on the one below.
    Stacked,
    /// Anywhere, in each other and in walls.
    Squeezed,
    /// Several at one point.
    Coincident,
}

impl Crowd {
    /// Puts bodies into a case.
    pub fn fill(&self, case: &mut Case, dice: &mut Dice) {
        let count = match dice.below(20) {
            0..6 => 1,
            6..10 => 2,
            10..16 => 3 + dice.below(8),
            16..19 => 10 + dice.below(50),
            _ => 60 + dice.below(240),
        };
        let mut starts = vec![Start::Dropped, Start::Dropped, Start::Thrown, Start::Thrown];
        if self.floor {
            starts.push(Start::Stacked);
        }
        // Overlap of springs is energy, as documented.
        if !self.springs() && dice.chance(0.3) {
            starts.extend([Start::Squeezed, Start::Coincident]);
        }
        let start = dice.pick(&starts);
        let walls = distances(case);
        let mut balls = self.balls(count, start, dice, &walls);
        self.alike(&mut balls, dice);
        match &mut case.swarm {
            Some(swarm) => {
                // A few of them are marbles beside it.
                let marbles = if dice.chance(0.5) { 0 } else { 1 + dice.below(3) };
                let marbles = marbles.min(balls.len() / 2);
                swarm.balls = balls.split_off(marbles);
                for ball in &mut swarm.balls {
                    (ball.half_length, ball.angular_velocity) = (0.0, [0.0; 3]);
                }
                case.scene.marbles = balls;
            }
            None => case.scene.marbles = balls,
        }
    }

    fn springs(&self) -> bool {
        self.kind.law().is_some()
    }

    /// Makes masses and shapes such as the kind knows.
    fn alike(&self, balls: &mut [MarbleDesc], dice: &mut Dice) {
        let massless =
            matches!(self.kind, Kind::Displacement | Kind::DisplacementSwept | Kind::SwarmLab);
        if massless {
            // It moves both by half whatever they weigh; so all weigh a kilogram.
            for ball in balls.iter_mut() {
                ball.density = 3.0 / (4.0 * std::f64::consts::PI * ball.radius.powi(3));
                ball.half_length = 0.0;
            }
            return;
        }
        // A spin that nobody feels would turn capsules into what they lie on.
        if !self.spins {
            for ball in balls.iter_mut().filter(|ball| ball.half_length > 0.0) {
                ball.angular_velocity = [0.0; 3];
            }
        }
        let knows_balls_only = matches!(
            self.kind,
            Kind::EventDriven | Kind::SoftStep | Kind::SwarmLab | Kind::SwarmFull
        );
        if knows_balls_only || dice.chance(0.8) {
            for ball in balls.iter_mut() {
                ball.half_length = 0.0;
            }
        }
    }

    fn balls(
        &self,
        count: usize,
        start: Start,
        dice: &mut Dice,
        walls: &dyn Fn([f64; 3]) -> f64,
    ) -> Vec<MarbleDesc> {
        // As many as there are, they have room to fall.
        let room = (0..3).map(|i| self.high[i] - self.low[i]).fold(f64::INFINITY, f64::min);
        let room = room.max(0.2 * self.size);
        let largest = (0.35 * room / (count as f64).cbrt()).min(0.35 * self.size);
        let ratio = if dice.chance(0.5) { 1.0 } else { dice.magnitude(1.0, 30.0) };
        let density = if dice.chance(0.5) { dice.magnitude(100.0, 10_000.0) } else { 0.0 };
        let one_radius = largest * dice.magnitude(0.2, 1.0);
        let own_surfaces = dice.chance(0.3);
        let together = dice.inside(self.low, self.high);
        let mut balls: Vec<MarbleDesc> = Vec::new();
        let mut top = 0.0;
        for number in 0..count {
            let radius = one_radius * dice.magnitude(1.0 / ratio, 1.0);
            let mut ball = MarbleDesc { radius, ..MarbleDesc::default() };
            ball.density = if density > 0.0 { density } else { dice.magnitude(1.0, 10_000.0) };
            let position = match start {
                Start::Stacked => {
                    if number % 8 == 0 {
                        top = 0.0;
                    }
                    let at = top + radius;
                    top += 2.0 * radius;
                    let column = (number / 8) as f64 * 2.5 * largest;
                    Some([column - 0.5 * self.size, at, 0.0])
                }
                Start::Squeezed => Some(dice.inside(self.low, self.high.map(|x| 0.5 * x))),
                Start::Coincident => Some(together),
                Start::Dropped | Start::Thrown => self.free(&balls, radius, dice, walls),
            };
            let Some(position) = position else { continue };
            if self.springs() && walls(position) < radius {
                continue; // overlap of springs is energy, as documented
            }
            ball.position = position;
            if start == Start::Thrown {
                let fast = if dice.chance(0.1) { 50.0 } else { dice.between(0.0, 8.0) };
                // Springs are not tested beyond their limits.
                let speed = if self.springs() { fast.min(4.0 * self.size) } else { fast };
                ball.velocity = (dice.direction() * speed).into();
            }
            if dice.chance(0.3) {
                ball.angular_velocity = (dice.direction() * dice.between(0.0, 50.0)).into();
            }
            if own_surfaces {
                ball.material = Some(surface(dice));
            }
            if start != Start::Stacked {
                ball.half_length = radius * dice.between(0.1, 1.0);
                // So that a line goes no further than the ball that was placed.
                ball.radius = radius - 0.5 * ball.half_length;
                ball.half_length *= 0.5;
                let axis = Vec3::from(dice.direction());
                ball.rotation =
                    RotationDesc { axis: axis.into(), degrees: dice.between(0.0, 180.0) };
            }
            balls.push(ball);
        }
        balls
    }

    /// A place where nothing is.
    fn free(
        &self,
        balls: &[MarbleDesc],
        radius: f64,
        dice: &mut Dice,
        walls: &dyn Fn([f64; 3]) -> f64,
    ) -> Option<[f64; 3]> {
        for _ in 0..60 {
            let at = dice.inside(self.low, self.high);
            let apart = |ball: &MarbleDesc| {
                let way = Vec3::from(ball.position) - Vec3::from(at);
                way.magnitude() > ball.radius + ball.half_length + radius
            };
            if balls.iter().all(apart) && walls(at) > radius {
                return Some(at);
            }
        }
        None
    }
}

/// Signed distance of a point from the nearest wall, in metres; negative inside.
fn distances(case: &Case) -> impl Fn([f64; 3]) -> f64 + use<> {
    let running = case.scene.run::<f64>(Model::default());
    let shapes = running.map(|running| running.world.walls.shapes().to_vec()).unwrap_or_default();
    move |at| {
        let point = Point3::from(at);
        let far = shapes.iter().map(|shape| shape.project_point(point).distance);
        far.fold(f64::INFINITY, f64::min)
    }
}
