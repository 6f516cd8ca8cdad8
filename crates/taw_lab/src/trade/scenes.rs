//! Reference cases: scenes with a known outcome and an error metric.

use std::f64::consts::PI;
use std::sync::OnceLock;

use futures_lite::future::block_on;
use taw::prelude::*;
use taw::scene::Scene;

use super::trace::{Frame, RunConfig, SAMPLE_INTERVAL, ScalarType};
use crate::advise::ReplayableScene;
use crate::scene::{EXACT, G};

/// A reference case: a scene with an error metric.
#[derive(Debug)]
pub struct ReferenceCase {
    /// Name, that of its file.
    pub name: &'static str,
    /// Description of the error metric.
    pub metric: &'static str,
    /// The scene has contacts.
    pub has_contacts: bool,
    text: &'static str,
    comparison: Metric,
    scene: OnceLock<Scene>,
    reference: OnceLock<Vec<Frame>>,
    noise_floor: OnceLock<f64>,
}

/// Error metric, relative to the size of the scene.
#[derive(Clone, Copy, Debug)]
enum Metric {
    /// Analytic solution: root mean square distance from it, over this length in metres.
    Analytic(fn(f64) -> Vec<Vec3<f64>>, f64),
    /// Comparison with a reference recording of the most accurate model in fine steps.
    Reference(fn(&[Frame], &[Frame]) -> f64),
}

/// All reference cases.
pub static SCENES: [ReferenceCase; 12] = [
    case(
        "throw",
        "place, over 4 m",
        include_str!("../../scenes/throw.ron"),
        false,
        Metric::Analytic(thrown, 4.0),
    ),
    case(
        "orbit",
        "place, over the larger half axis",
        include_str!("../../scenes/orbit.ron"),
        false,
        Metric::Analytic(orbited, 1.0),
    ),
    case(
        "bounce",
        "place, over the height of the fall",
        include_str!("../../scenes/bounce.ron"),
        true,
        Metric::Analytic(bounced, 1.0),
    ),
    case(
        "skid",
        "place, over 2 m",
        include_str!("../../scenes/skid.ron"),
        true,
        Metric::Analytic(skidded, 2.0),
    ),
    case(
        "ramp",
        "place, over 2 m",
        include_str!("../../scenes/ramp.ron"),
        true,
        Metric::Analytic(rolled, 2.0),
    ),
    case(
        "turntable",
        "place, over the radius of the circle",
        include_str!("../../scenes/turntable.ron"),
        true,
        Metric::Analytic(circled, 0.7 / PI),
    ),
    case(
        "carom",
        "place, over 1 m",
        include_str!("../../scenes/carom.ron"),
        true,
        Metric::Analytic(parted, 1.0),
    ),
    case(
        "cradle",
        "place, over 0.3 m",
        include_str!("../../scenes/cradle.ron"),
        true,
        Metric::Analytic(passed_on, 0.3),
    ),
    case(
        "tower",
        "place, over the radius",
        include_str!("../../scenes/tower.ron"),
        true,
        Metric::Analytic(stood, 0.05),
    ),
    case(
        "maze",
        "place, over the side of the box",
        include_str!("../../scenes/maze.ron"),
        true,
        Metric::Reference(places_in_maze),
    ),
    case(
        "pachinko",
        "mean height over time, over 0.3 m",
        include_str!("../../scenes/pachinko.ron"),
        true,
        Metric::Reference(fall),
    ),
    case(
        "pit",
        "mean height and mean overlap, over the radius",
        include_str!("../../scenes/pit.ron"),
        true,
        Metric::Reference(heap),
    ),
];

const fn case(
    name: &'static str,
    metric: &'static str,
    text: &'static str,
    has_contacts: bool,
    comparison: Metric,
) -> ReferenceCase {
    ReferenceCase {
        name,
        metric,
        has_contacts,
        text,
        comparison,
        scene: OnceLock::new(),
        reference: OnceLock::new(),
        noise_floor: OnceLock::new(),
    }
}

impl ReferenceCase {
    /// The scene.
    ///
    /// # Panics
    /// If its file is wrong, which a test rules out.
    pub fn scene(&self) -> &Scene {
        self.scene.get_or_init(|| crate::advise::read_scene(self.text).expect("a shipped scene"))
    }

    /// Relative error of a recording: 0 is exact, 1 is as wrong as the scene is large.
    pub fn error(&self, frames: &[Frame]) -> f64 {
        match self.comparison {
            Metric::Analytic(known, size) => {
                let squares = frames.iter().flat_map(|frame| {
                    let should = known(frame.time).into_iter();
                    frame.at.iter().zip(should).map(|(at, should)| (at - should).magnitude2())
                });
                mean(squares).sqrt() / size
            }
            Metric::Reference(compare) => compare(frames, self.reference()).max(self.noise_floor()),
        }
    }

    /// Noise floor: error of the reference against itself with every marble perturbed by one ulp.
    /// Smaller errors are meaningless. Zero for an analytic solution.
    pub fn noise_floor(&self) -> f64 {
        *self.noise_floor.get_or_init(|| match self.comparison {
            Metric::Analytic(..) => 0.0,
            Metric::Reference(compare) => compare(&exact(self.scene(), true), self.reference()),
        })
    }

    /// Initial gravity, in m/s².
    pub fn scene_gravity(&self) -> Vec3<f64> {
        Vec3::from(self.scene().gravity)
    }

    fn reference(&self) -> &[Frame] {
        self.reference.get_or_init(|| exact(self.scene(), false))
    }
}

fn exact(scene: &Scene, perturbed: bool) -> Vec<Frame> {
    let setting = RunConfig { model: EXACT, number: ScalarType::F64, step: 1.0 / 480.0 };
    block_on(scene.record(setting, perturbed, SAMPLE_INTERVAL)).unwrap_or_default().frames
}

fn mean(numbers: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = numbers.fold((0.0, 0_u32), |(sum, count), x| (sum + x, count + 1));
    sum / f64::from(count.max(1))
}

/// Linear drag: the speed relative to the terminal one falls exponentially.
fn thrown(time: f64) -> Vec<Vec3<f64>> {
    let mass = 2500.0 * 4.0 / 3.0 * PI * 0.008_f64.powi(3);
    let rate = 0.004 / mass;
    let terminal = Vec3::new(0.0, -G / rate, 0.0);
    let way = (Vec3::new(3.0, 4.0, 0.0) - terminal) * (-(-rate * time).exp_m1() / rate);
    vec![Vec3::new(0.0, 1.0, 0.0) + terminal * time + way]
}

/// Kepler's equation for eccentricity 0.5 and a period of 2π, by Newton's method.
fn orbited(time: f64) -> Vec<Vec3<f64>> {
    let eccentricity = 0.5_f64;
    let mut anomaly = time;
    for _ in 0..50 {
        let miss = anomaly - eccentricity * anomaly.sin() - time;
        anomaly -= miss / (1.0 - eccentricity * anomaly.cos());
    }
    let across = (1.0 - eccentricity * eccentricity).sqrt();
    vec![Vec3::new(anomaly.cos() - eccentricity, across * anomaly.sin(), 0.0)]
}

/// A fall of a metre, then bounces of 0.8 times the speed.
fn bounced(time: f64) -> Vec<Vec3<f64>> {
    let mut speed = (2.0 * G).sqrt();
    let fall = speed / G;
    let mut left = time - fall;
    let height = if left < 0.0 {
        1.0 - 0.5 * G * time * time
    } else {
        loop {
            speed *= 0.8;
            let flight = 2.0 * speed / G;
            if left < flight || flight < 1e-12 {
                break speed * left.min(flight) - 0.5 * G * left.min(flight).powi(2);
            }
            left -= flight;
        }
    };
    vec![Vec3::new(0.0, 0.05 + height, 0.0)]
}

/// Friction takes 0.2 g until five sevenths of the speed are left (Coriolis 1835).
fn skidded(time: f64) -> Vec<Vec3<f64>> {
    let (speed, slowing) = (2.0, 0.2 * G);
    let slides = 2.0 / 7.0 * speed / slowing;
    let sliding = time.min(slides);
    let x =
        speed * sliding - 0.5 * slowing * sliding * sliding + 5.0 / 7.0 * speed * (time - sliding);
    vec![Vec3::new(x, 0.0286, 0.0)]
}

/// Five sevenths of what a frictionless slide would gain.
fn rolled(time: f64) -> Vec<Vec3<f64>> {
    let way = 0.5 * 5.0 / 7.0 * G * 0.6 * time * time;
    vec![Vec3::new(0.006 + 0.8 * way, 0.008 - 0.6 * way, 0.0)]
}

/// A velocity that turns by two sevenths of what the disc does (Weltner 1979, Am. J. Phys. 47).
fn circled(time: f64) -> Vec<Vec3<f64>> {
    let rate = 2.0 / 7.0 * PI;
    let (sin, cos) = (rate * time).sin_cos();
    vec![Vec3::new(0.3 + 0.2 / rate * sin, 0.02, -0.2 / rate * (1.0 - cos))]
}

/// At the touch, the resting ball takes what is along the normal, and the other one the rest.
fn parted(time: f64) -> Vec<Vec3<f64>> {
    let (start, velocity) = (Vec3::new(-0.6, 0.05, 0.0), Vec3::new(1.5, 0.0, 0.0));
    let touch = (0.6 - (0.1_f64.powi(2) - 0.05_f64.powi(2)).sqrt()) / 1.5;
    let there = start + velocity * touch;
    let normal = -there / 0.1;
    let taken = normal * velocity.dot(normal);
    let after = (time - touch).max(0.0);
    vec![start + velocity * time.min(touch) + (velocity - taken) * after, taken * after]
}

/// The first one stops where it touches, and the last one goes on with its speed.
fn passed_on(time: f64) -> Vec<Vec3<f64>> {
    let touch = 0.2;
    let x = [-0.3 + time.min(touch), 0.0, 0.1, 0.2, 0.3 + (time - touch).max(0.0)];
    x.map(|x| Vec3::new(x, 0.0, 0.0)).to_vec()
}

fn stood(_: f64) -> Vec<Vec3<f64>> {
    (0..6).map(|i| Vec3::new(0.0, 0.05 + 0.1 * f64::from(i), 0.0)).collect()
}

fn places_in_maze(frames: &[Frame], should: &[Frame]) -> f64 {
    let squares = frames.iter().zip(should).flat_map(|(frame, should)| {
        frame.at.iter().zip(&should.at).map(|(at, should)| (at - should).magnitude2())
    });
    mean(squares).sqrt() / 0.4
}

/// Which way a marble takes is chance; how fast they all come down is less so.
fn fall(frames: &[Frame], should: &[Frame]) -> f64 {
    let height = |frame: &Frame| mean(frame.at.iter().map(|at| at.y));
    let apart = frames.iter().zip(should).map(|(a, b)| (height(a) - height(b)).powi(2));
    mean(apart).sqrt() / 0.3
}

/// Which marble lies where is chance; how high the heap is and how deep they overlap is not.
fn heap(frames: &[Frame], should: &[Frame]) -> f64 {
    let end = |frames: &[Frame]| {
        let last: Vec<_> = frames.iter().rev().take(5).collect();
        let heights = last.iter().flat_map(|frame| frame.at.iter().map(|at| at.y));
        let overlap = last.iter().map(|frame| frame.overlap / frame.at.len().max(1) as f64);
        (mean(heights), mean(overlap))
    };
    let ((height, overlap), (right, _)) = (end(frames), end(should));
    ((height - right).abs() + overlap) / 0.01
}
