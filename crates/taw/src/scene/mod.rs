//! A scene as a plain value: what is there, what moves by itself, and what happens over time.
//!
//! It says nothing about how it is stepped: the same scene becomes a world of any
//! [`Scalar`](crate::math::Scalar) and [`Model`](crate::world::Model), which is what makes models
//! comparable. With the feature `serde` it is read from files; `scenes/*.ron` of the lab are such.
//! Numbers out of their range are refused where they stand, with line and field (see [`Scene`] for
//! an example).

mod check;
#[cfg(feature = "serde")]
mod number;
mod running;
mod structure;

pub use running::Running;
pub use structure::{Build, Structure};

/// See the [module](self). All in `f64`; metres, seconds, kilograms.
///
/// ```
/// # #[cfg(feature = "serde")] {
/// use taw::scene::Scene;
///
/// let text = "(
///     seconds: 2,
///     walls: [(shape: HalfSpace(normal: (0, 1, 0)))],
///     marbles: [(position: (0, 3, 0), radius: 0.5, surface: Some((restitution: 0.8)))],
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
    /// What it shows, for people.
    #[cfg_attr(feature = "serde", serde(default))]
    pub about: String,
    /// For how long it is looked at, in seconds, above zero.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "number::positive"))]
    pub seconds: f64,
    /// In m/s².
    #[cfg_attr(feature = "serde", serde(default = "earth", deserialize_with = "number::vector"))]
    pub gravity: [f64; 3],
    /// How gravity changes, if it does: as one who tilts the whole scene sees it.
    #[cfg_attr(feature = "serde", serde(default))]
    pub tilts: Vec<Tilt>,
    /// What pulls and pushes besides.
    #[cfg_attr(feature = "serde", serde(default))]
    pub fields: Vec<Field>,
    /// What marbles and walls are made of that say nothing else.
    #[cfg_attr(feature = "serde", serde(default))]
    pub surface: Surface,
    /// What nothing can move.
    #[cfg_attr(feature = "serde", serde(default))]
    pub walls: Vec<Wall>,
    /// Walls of many parts.
    #[cfg_attr(feature = "serde", serde(default))]
    pub structures: Vec<Structure>,
    /// Where marbles are counted.
    #[cfg_attr(feature = "serde", serde(default))]
    pub gates: Vec<Gate>,
    /// Marbles one by one.
    #[cfg_attr(feature = "serde", serde(default))]
    pub marbles: Vec<Ball>,
    /// Marbles by the dozen.
    #[cfg_attr(feature = "serde", serde(default))]
    pub lattices: Vec<Lattice>,
}

/// Gravity at a moment. In between it goes over evenly; before the first moment and after the
/// last one it is as in these.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Tilt {
    /// When, in seconds.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "number::not_negative"))]
    pub at: f64,
    /// In m/s².
    #[cfg_attr(feature = "serde", serde(deserialize_with = "number::vector"))]
    pub gravity: [f64; 3],
}

/// A plane that marbles pass: it stops nothing, and whoever looks at a scene counts those behind
/// it. At the mouth of a hopper, that is its throughput.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Gate {
    /// Toward the side that they come from; of any length but zero.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "number::direction"))]
    pub normal: [f64; 3],
    /// A point of the plane.
    #[cfg_attr(feature = "serde", serde(default, deserialize_with = "number::vector"))]
    pub through: [f64; 3],
}

/// A [force field](crate::motion::Force).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub enum Field {
    /// The resistance of a medium that moves or not.
    Drag {
        /// How the medium moves, in m/s.
        #[cfg_attr(feature = "serde", serde(default, deserialize_with = "number::vector"))]
        velocity: [f64; 3],
        /// In N s/m, at least zero.
        #[cfg_attr(feature = "serde", serde(default, deserialize_with = "number::not_negative"))]
        linear: f64,
        /// In N s²/m², at least zero.
        #[cfg_attr(feature = "serde", serde(default, deserialize_with = "number::not_negative"))]
        quadratic: f64,
    },
    /// A spring from each marble to a point.
    Spring {
        /// Where it is fastened.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "number::vector"))]
        anchor: [f64; 3],
        /// In metres, at least zero.
        #[cfg_attr(feature = "serde", serde(default, deserialize_with = "number::not_negative"))]
        rest_length: f64,
        /// In N/m, at least zero.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "number::not_negative"))]
        stiffness: f64,
    },
    /// A point that attracts with the inverse square of the distance.
    Attraction {
        /// Where it is.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "number::vector"))]
        center: [f64; 3],
        /// In m³/s²; negative repels.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "number::any"))]
        strength: f64,
    },
}

/// What a thing is made of; see [`Material`](crate::response::Material).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields, default))]
pub struct Surface {
    /// In `[0, 1]`.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "number::part"))]
    pub restitution: f64,
    /// At least zero.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "number::not_negative"))]
    pub friction: f64,
    /// In `[-1, 1]`.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "number::signed_part"))]
    pub tangential_restitution: f64,
    /// At least zero.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "number::not_negative"))]
    pub rolling_resistance: f64,
    /// At least zero.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "number::not_negative"))]
    pub spinning_resistance: f64,
    /// In pascals, above zero.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "number::positive"))]
    pub youngs_modulus: f64,
    /// In `[0, 0.5]`.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "number::half"))]
    pub poissons_ratio: f64,
}

/// A wall.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Wall {
    /// Where it is at the beginning.
    pub shape: Form,
    /// What it is made of, if not the scene's surface.
    #[cfg_attr(feature = "serde", serde(default))]
    pub surface: Option<Surface>,
    /// How it moves, if it does.
    #[cfg_attr(feature = "serde", serde(default))]
    pub moves: Option<Movement>,
}

/// What a wall may be.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub enum Form {
    /// All that is behind a plane.
    HalfSpace {
        /// Toward the free side; of any length but zero.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "number::direction"))]
        normal: [f64; 3],
        /// A point of the plane.
        #[cfg_attr(feature = "serde", serde(default, deserialize_with = "number::vector"))]
        through: [f64; 3],
    },
    /// A box.
    Box {
        /// In metres.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "number::vector"))]
        center: [f64; 3],
        /// Its sides, in metres, above zero.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "number::sides"))]
        size: [f64; 3],
        /// How it is turned.
        #[cfg_attr(feature = "serde", serde(default))]
        turned: Turn,
    },
    /// A ball.
    Ball {
        /// In metres.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "number::vector"))]
        center: [f64; 3],
        /// In metres, above zero.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "number::positive"))]
        radius: f64,
    },
    /// All points so near to a line.
    Capsule {
        /// Where the line begins.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "number::vector"))]
        from: [f64; 3],
        /// Where it ends.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "number::vector"))]
        to: [f64; 3],
        /// In metres, above zero.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "number::positive"))]
        radius: f64,
    },
}

/// A turn about an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Turn {
    /// Of any length but zero.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "number::direction"))]
    pub axis: [f64; 3],
    /// Counter-clockwise where the axis points to the one who looks.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "number::any"))]
    pub degrees: f64,
}

/// How a wall moves.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub enum Movement {
    /// It stays, and its surface carries along what lies on it.
    Conveys {
        /// In m/s.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "number::vector"))]
        velocity: [f64; 3],
    },
    /// It turns for ever.
    Turns {
        /// A point of the axis.
        #[cfg_attr(feature = "serde", serde(default, deserialize_with = "number::vector"))]
        pivot: [f64; 3],
        /// Of any length but zero.
        #[cfg_attr(
            feature = "serde",
            serde(default = "up", deserialize_with = "number::direction")
        )]
        axis: [f64; 3],
        /// How fast.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "number::any"))]
        degrees_per_second: f64,
    },
    /// It goes there and back, as a sine does.
    Swings {
        /// From the middle to where it turns back, in metres.
        #[cfg_attr(feature = "serde", serde(default, deserialize_with = "number::vector"))]
        way: [f64; 3],
        /// A point of the axis.
        #[cfg_attr(feature = "serde", serde(default, deserialize_with = "number::vector"))]
        pivot: [f64; 3],
        /// Of any length but zero.
        #[cfg_attr(
            feature = "serde",
            serde(default = "up", deserialize_with = "number::direction")
        )]
        axis: [f64; 3],
        /// How far it turns about the axis.
        #[cfg_attr(feature = "serde", serde(default, deserialize_with = "number::any"))]
        degrees: f64,
        /// For there and back, in seconds, above zero.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "number::positive"))]
        period: f64,
    },
}

/// A marble.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Ball {
    /// Of its center, in metres.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "number::vector"))]
    pub position: [f64; 3],
    /// In metres, above zero.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "number::positive"))]
    pub radius: f64,
    /// In m/s.
    #[cfg_attr(feature = "serde", serde(default, deserialize_with = "number::vector"))]
    pub velocity: [f64; 3],
    /// In rad/s.
    #[cfg_attr(feature = "serde", serde(default, deserialize_with = "number::vector"))]
    pub spin: [f64; 3],
    /// In kg/m³, above zero.
    #[cfg_attr(feature = "serde", serde(default = "glass", deserialize_with = "number::positive"))]
    pub density: f64,
    /// Above zero, it is a capsule: its line goes this far both ways from the center along its
    /// own y axis, in metres.
    #[cfg_attr(feature = "serde", serde(default, deserialize_with = "number::not_negative"))]
    pub half_length: f64,
    /// How it is turned.
    #[cfg_attr(feature = "serde", serde(default))]
    pub turned: Turn,
    /// What it is made of, if not the scene's surface.
    #[cfg_attr(feature = "serde", serde(default))]
    pub surface: Option<Surface>,
}

/// Marbles at the points of a lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Lattice {
    /// The first one: the marble of which the others are copies.
    pub first: Ball,
    /// How many along each side.
    pub count: [u16; 3],
    /// From one to the next, in metres.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "number::vector"))]
    pub pitch: [f64; 3],
    /// Up to which part of the pitch each is put aside, and of the radius each is smaller: always
    /// the same for the same lattice.
    #[cfg_attr(feature = "serde", serde(default, deserialize_with = "number::part"))]
    pub disorder: f64,
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
    Ball::default().density
}

impl Default for Scene {
    /// Nothing, for a second, on Earth.
    fn default() -> Self {
        Self {
            about: String::new(),
            seconds: 1.0,
            gravity: [0.0, -9.81, 0.0],
            tilts: Vec::new(),
            fields: Vec::new(),
            surface: Surface::default(),
            walls: Vec::new(),
            structures: Vec::new(),
            gates: Vec::new(),
            marbles: Vec::new(),
            lattices: Vec::new(),
        }
    }
}

impl Default for Surface {
    /// That of a default [`Material`](crate::response::Material).
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

impl Default for Turn {
    /// Not turned.
    fn default() -> Self {
        Self { axis: [0.0, 1.0, 0.0], degrees: 0.0 }
    }
}

impl Default for Ball {
    /// A marble of glass in the origin, a centimetre across, at rest.
    fn default() -> Self {
        Self {
            position: [0.0; 3],
            radius: 0.005,
            velocity: [0.0; 3],
            spin: [0.0; 3],
            density: 2500.0,
            half_length: 0.0,
            turned: Turn::default(),
            surface: None,
        }
    }
}

impl Lattice {
    /// The marbles.
    pub fn balls(&self) -> impl Iterator<Item = Ball> + use<> {
        let Self { first, count, pitch, disorder } = *self;
        let [nx, ny, nz] = count.map(u64::from);
        (0..nx * ny * nz).map(move |i| {
            let cell = [i % nx, i / nx / nz, i / nx % nz].map(|n| n as f64);
            // The fractional parts of multiples of such numbers spread evenly (Roberts 2018, R4).
            let random = |n: usize| {
                let step =
                    [0.856_674_883_854_503, 0.733_891_856_627_126, 0.628_706_721_009_064][n % 3];
                ((i + 1) as f64 * (step + n as f64 * 0.1)).fract()
            };
            let mut ball = first;
            for axis in 0..3 {
                let aside = (random(axis) - 0.5) * disorder;
                ball.position[axis] += (cell[axis] + aside) * pitch[axis];
            }
            ball.radius *= 1.0 - disorder * random(3);
            ball
        })
    }
}
