//! Scene descriptions as plain values: bodies, kinematic motions, and changes over time.
//!
//! A scene is independent of the solver: it becomes a world of any [`Scalar`](crate::math::Scalar)
//! and [`Model`](crate::world::Model), which makes models comparable. With the feature `serde` it
//! is read from files, such as `scenes/*.ron` of the lab. Numbers out of range are rejected with
//! line and field (see [`Scene`] for an example).

mod check;
mod simulation;
mod structure;
#[cfg(feature = "serde")]
mod validate;

pub use simulation::Simulation;
pub use structure::{Build, Structure};

/// Scene description; see the [module](self). All in `f64`; metres, seconds, kilograms.
///
/// ```
/// # #[cfg(feature = "serde")] {
/// use taw::scene::Scene;
///
/// let text = "(
///     duration: 2,
///     walls: [(shape: HalfSpace(normal: (0, 1, 0)))],
///     marbles: [(position: (0, 3, 0), radius: 0.5, material: Some((restitution: 0.8)))],
/// )";
/// let scene: Scene = ron::from_str(text)?;
/// assert_eq!(scene.marbles[0].radius, 0.5);
///
/// let error = ron::from_str::<Scene>(&text.replace("0.5", "-1")).unwrap_err();
/// assert!(error.to_string().contains("above zero, but is -1"));
/// # }
/// # Ok::<(), ron::error::SpannedError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Scene {
    /// Human-readable description.
    #[cfg_attr(feature = "serde", serde(default))]
    pub description: String,
    /// Simulated time in seconds, above zero.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::positive"))]
    pub duration: f64,
    /// Gravity, in m/s².
    #[cfg_attr(feature = "serde", serde(default = "earth", deserialize_with = "validate::vector"))]
    pub gravity: [f64; 3],
    /// Gravity over time, if it changes: as seen in the frame of a tilted scene.
    #[cfg_attr(feature = "serde", serde(default))]
    pub gravity_keyframes: Vec<GravityKeyframe>,
    /// Force fields besides gravity.
    #[cfg_attr(feature = "serde", serde(default))]
    pub force_fields: Vec<ForceFieldDesc>,
    /// Default material of marbles and walls.
    #[cfg_attr(feature = "serde", serde(default))]
    pub material: MaterialDesc,
    /// Walls (static or kinematic colliders) of one simple shape.
    #[cfg_attr(feature = "serde", serde(default))]
    pub walls: Vec<WallDesc>,
    /// Walls of composite shapes.
    #[cfg_attr(feature = "serde", serde(default))]
    pub structures: Vec<Structure>,
    /// Sensor planes, behind which marbles are counted.
    #[cfg_attr(feature = "serde", serde(default))]
    pub sensor_planes: Vec<SensorPlane>,
    /// Single marbles.
    #[cfg_attr(feature = "serde", serde(default))]
    pub marbles: Vec<MarbleDesc>,
    /// Lattices of marbles.
    #[cfg_attr(feature = "serde", serde(default))]
    pub lattices: Vec<Lattice>,
}

/// Keyframe of gravity. Linear interpolation between keyframes; constant before the first and after
/// the last one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct GravityKeyframe {
    /// Time, in seconds.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::not_negative"))]
    pub time: f64,
    /// Gravity, in m/s².
    #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::vector"))]
    pub gravity: [f64; 3],
}

/// Sensor plane: it has no contacts; an observer counts the marbles behind it. At the outlet of a
/// hopper, that is its throughput.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct SensorPlane {
    /// Normal toward the side that marbles come from; of any length but zero.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::direction"))]
    pub normal: [f64; 3],
    /// A point of the plane.
    #[cfg_attr(feature = "serde", serde(default, deserialize_with = "validate::vector"))]
    pub point: [f64; 3],
}

/// Description of a [force field](crate::motion::ForceField).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub enum ForceFieldDesc {
    /// Drag of a medium at rest or in motion.
    Drag {
        /// Velocity of the medium, in m/s.
        #[cfg_attr(feature = "serde", serde(default, deserialize_with = "validate::vector"))]
        velocity: [f64; 3],
        /// Linear drag in N s/m, at least zero.
        #[cfg_attr(feature = "serde", serde(default, deserialize_with = "validate::not_negative"))]
        linear: f64,
        /// Quadratic drag in N s²/m², at least zero.
        #[cfg_attr(feature = "serde", serde(default, deserialize_with = "validate::not_negative"))]
        quadratic: f64,
    },
    /// A spring from each marble to a fixed point.
    Spring {
        /// Anchor point, in metres.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::vector"))]
        anchor: [f64; 3],
        /// Rest length in metres, at least zero.
        #[cfg_attr(feature = "serde", serde(default, deserialize_with = "validate::not_negative"))]
        rest_length: f64,
        /// Spring constant in N/m, at least zero.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::not_negative"))]
        stiffness: f64,
    },
    /// A point that attracts with the inverse square of the distance.
    Attraction {
        /// Center, in metres.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::vector"))]
        center: [f64; 3],
        /// Strength in m³/s²; negative repels.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::any"))]
        strength: f64,
    },
}

/// Description of a [`Material`](crate::response::Material).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields, default))]
pub struct MaterialDesc {
    /// Coefficient of restitution, in `[0, 1]`.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::part"))]
    pub restitution: f64,
    /// Coefficient of friction, at least zero.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::not_negative"))]
    pub friction: f64,
    /// Tangential coefficient of restitution, in `[-1, 1]`.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::signed_part"))]
    pub tangential_restitution: f64,
    /// Coefficient of rolling resistance, at least zero.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::not_negative"))]
    pub rolling_resistance: f64,
    /// Coefficient of torsional (spinning) resistance, at least zero.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::not_negative"))]
    pub spinning_resistance: f64,
    /// Young's modulus in pascals, above zero.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::positive"))]
    pub youngs_modulus: f64,
    /// Poisson's ratio, in `[0, 0.5]`.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::half"))]
    pub poissons_ratio: f64,
}

/// Description of a wall of a simple shape.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct WallDesc {
    /// Shape and initial pose.
    pub shape: ShapeDesc,
    /// Own material instead of the scene's.
    #[cfg_attr(feature = "serde", serde(default))]
    pub material: Option<MaterialDesc>,
    /// Kinematic motion, if any.
    #[cfg_attr(feature = "serde", serde(default))]
    pub motion: Option<KinematicMotion>,
}

/// Description of a simple shape.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub enum ShapeDesc {
    /// A half-space behind a plane.
    HalfSpace {
        /// Normal toward the free side; of any length but zero.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::direction"))]
        normal: [f64; 3],
        /// A point of the plane.
        #[cfg_attr(feature = "serde", serde(default, deserialize_with = "validate::vector"))]
        point: [f64; 3],
    },
    /// A box.
    Box {
        /// Center, in metres.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::vector"))]
        center: [f64; 3],
        /// Side lengths in metres, above zero.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::sides"))]
        size: [f64; 3],
        /// Rotation about the center.
        #[cfg_attr(feature = "serde", serde(default))]
        rotation: RotationDesc,
    },
    /// A ball.
    Ball {
        /// Center, in metres.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::vector"))]
        center: [f64; 3],
        /// Radius in metres, above zero.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::positive"))]
        radius: f64,
    },
    /// A capsule.
    Capsule {
        /// First end of the segment, in metres.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::vector"))]
        from: [f64; 3],
        /// Second end of the segment, in metres.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::vector"))]
        to: [f64; 3],
        /// Radius in metres, above zero.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::positive"))]
        radius: f64,
    },
}

/// Rotation by an angle about an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct RotationDesc {
    /// Axis of any length but zero.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::direction"))]
    pub axis: [f64; 3],
    /// Angle in degrees, by the right hand.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::any"))]
    pub degrees: f64,
}

/// Kinematic motion of a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub enum KinematicMotion {
    /// Conveyor belt: the wall stays in place, and its surface moves.
    Conveyor {
        /// Surface velocity, in m/s.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::vector"))]
        velocity: [f64; 3],
    },
    /// Constant rotation.
    Rotate {
        /// A point of the axis.
        #[cfg_attr(feature = "serde", serde(default, deserialize_with = "validate::vector"))]
        pivot: [f64; 3],
        /// Axis of any length but zero.
        #[cfg_attr(
            feature = "serde",
            serde(default = "up", deserialize_with = "validate::direction")
        )]
        axis: [f64; 3],
        /// Angular speed in degrees per second.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::any"))]
        degrees_per_second: f64,
    },
    /// Harmonic oscillation.
    Oscillate {
        /// Amplitude of the translation, in metres.
        #[cfg_attr(feature = "serde", serde(default, deserialize_with = "validate::vector"))]
        amplitude: [f64; 3],
        /// A point of the axis.
        #[cfg_attr(feature = "serde", serde(default, deserialize_with = "validate::vector"))]
        pivot: [f64; 3],
        /// Axis of any length but zero.
        #[cfg_attr(
            feature = "serde",
            serde(default = "up", deserialize_with = "validate::direction")
        )]
        axis: [f64; 3],
        /// Amplitude of the rotation about the axis, in degrees.
        #[cfg_attr(feature = "serde", serde(default, deserialize_with = "validate::any"))]
        degrees: f64,
        /// Period in seconds, above zero.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::positive"))]
        period: f64,
    },
}

/// Description of a marble.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct MarbleDesc {
    /// Center, in metres.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::vector"))]
    pub position: [f64; 3],
    /// Radius in metres, above zero.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::positive"))]
    pub radius: f64,
    /// Velocity, in m/s.
    #[cfg_attr(feature = "serde", serde(default, deserialize_with = "validate::vector"))]
    pub velocity: [f64; 3],
    /// Angular velocity, in rad/s.
    #[cfg_attr(feature = "serde", serde(default, deserialize_with = "validate::vector"))]
    pub angular_velocity: [f64; 3],
    /// Density in kg/m³, above zero.
    #[cfg_attr(
        feature = "serde",
        serde(default = "glass", deserialize_with = "validate::positive")
    )]
    pub density: f64,
    /// Half length of a capsule's segment along its own y axis, in metres; zero for a ball.
    #[cfg_attr(feature = "serde", serde(default, deserialize_with = "validate::not_negative"))]
    pub half_length: f64,
    /// Initial rotation.
    #[cfg_attr(feature = "serde", serde(default))]
    pub rotation: RotationDesc,
    /// Own material instead of the scene's.
    #[cfg_attr(feature = "serde", serde(default))]
    pub material: Option<MaterialDesc>,
}

/// Marbles at the points of a lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Lattice {
    /// The first marble, of which the others are copies.
    pub first: MarbleDesc,
    /// Number of marbles along each axis.
    pub count: [u16; 3],
    /// Spacing along each axis, in metres.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "validate::vector"))]
    pub pitch: [f64; 3],
    /// Random displacement of each marble up to this fraction of the pitch, and shrinking up to
    /// this fraction of the radius; deterministic.
    #[cfg_attr(feature = "serde", serde(default, deserialize_with = "validate::part"))]
    pub jitter: f64,
}

#[cfg(feature = "serde")]
fn earth() -> [f64; 3] {
    Scene::default().gravity
}

#[cfg(feature = "serde")]
fn up() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

#[cfg(feature = "serde")]
fn glass() -> f64 {
    MarbleDesc::default().density
}

impl Default for Scene {
    /// An empty scene of one second with Earth's gravity.
    fn default() -> Self {
        Self {
            description: String::new(),
            duration: 1.0,
            gravity: [0.0, -9.81, 0.0],
            gravity_keyframes: Vec::new(),
            force_fields: Vec::new(),
            material: MaterialDesc::default(),
            walls: Vec::new(),
            structures: Vec::new(),
            sensor_planes: Vec::new(),
            marbles: Vec::new(),
            lattices: Vec::new(),
        }
    }
}

impl Default for MaterialDesc {
    /// The default [`Material`](crate::response::Material).
    fn default() -> Self {
        let material = crate::response::Material::<f64>::default();
        Self {
            restitution: material.restitution,
            friction: material.friction,
            tangential_restitution: material.tangential_restitution,
            rolling_resistance: material.rolling_resistance,
            spinning_resistance: material.spinning_resistance,
            youngs_modulus: material.elasticity.youngs_modulus,
            poissons_ratio: material.elasticity.poissons_ratio,
        }
    }
}

impl Default for RotationDesc {
    /// No rotation.
    fn default() -> Self {
        Self { axis: [0.0, 1.0, 0.0], degrees: 0.0 }
    }
}

impl Default for MarbleDesc {
    /// A marble of glass at the origin, a centimetre across, at rest.
    fn default() -> Self {
        Self {
            position: [0.0; 3],
            radius: 0.005,
            velocity: [0.0; 3],
            angular_velocity: [0.0; 3],
            density: 2500.0,
            half_length: 0.0,
            rotation: RotationDesc::default(),
            material: None,
        }
    }
}

impl Lattice {
    /// Lists the marbles.
    pub fn marbles(&self) -> impl Iterator<Item = MarbleDesc> + use<> {
        let Self { first, count, pitch, jitter } = *self;
        let [nx, ny, nz] = count.map(u64::from);
        (0..nx * ny * nz).map(move |i| {
            let cell = [i % nx, i / nx / nz, i / nx % nz].map(|n| n as f64);
            // Low-discrepancy sequence: fractional parts of multiples of such numbers spread evenly
            // (Roberts 2018, R4).
            let random = |n: usize| {
                let step =
                    [0.856_674_883_854_503, 0.733_891_856_627_126, 0.628_706_721_009_064][n % 3];
                ((i + 1) as f64 * (step + n as f64 * 0.1)).fract()
            };
            let mut ball = first;
            for axis in 0..3 {
                let aside = (random(axis) - 0.5) * jitter;
                ball.position[axis] += (cell[axis] + aside) * pitch[axis];
            }
            ball.radius *= 1.0 - jitter * random(3);
            ball
        })
    }
}
