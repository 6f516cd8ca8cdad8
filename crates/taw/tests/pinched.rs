//! Light balls that one of a billion times their mass, or more, pinches in a corner: what holds it
//! back is an impulse a billion times their own momentum, of which nothing may be left to hasten them.

use taw::prelude::*;
use taw::shape::Aabb;

/// Seconds of a step.
const STEP: f64 = 1.0 / 60.0;

struct Ball {
    at: [f64; 3],
    radius: f64,
    velocity: [f64; 3],
    kilograms: f64,
}

struct Pinch {
    response: Response,
    /// Substeps and iterations.
    counts: [u32; 2],
    gravity: f64,
    friction: f64,
    restitution: f64,
    /// Floor and walls, 1.5 m from the center: axis and side. Plates of ten centimetres, or half-spaces.
    walls: &'static [(usize, f64)],
    plates: bool,
    balls: &'static [Ball],
}

/// Finds of random searches, with the speed of a light ball that each led to, in m/s.
const PINCHES: [Pinch; 6] = [
    // 1,034 by f32
    Pinch {
        response: Response::Impulse,
        counts: [3, 16],
        gravity: 9.81,
        friction: 0.3,
        restitution: 0.5,
        walls: &[(1, -1.0), (0, 1.0)],
        plates: true,
        balls: &[
            Ball {
                at: [0.750_750_818_729_400_6, -0.906_287_55, 0.761_060_83],
                radius: 0.176_963_72,
                velocity: [0.353, 0.236, -0.332],
                kilograms: 2.3e14,
            },
            Ball {
                at: [1.127_382_28, -0.055_938_24, 0.828_030_59],
                radius: 0.103_707_13,
                velocity: [0.292, -0.081, -0.341],
                kilograms: 11.680_253_420_340_94,
            },
            Ball {
                at: [1.143_300_06, -0.260_942_16, 0.216_369_15],
                radius: 0.114_755_42,
                velocity: [-0.212, -0.011, 0.032],
                kilograms: 15.825_224_475_869_386,
            },
        ],
    },
    // 517 by f32
    Pinch {
        response: Response::Impulse,
        counts: [4, 8],
        gravity: 9.81,
        friction: 0.978_385_686_874_389_6,
        restitution: 0.0,
        walls: &[(1, -1.0), (0, 1.0)],
        plates: false,
        balls: &[
            Ball {
                at: [0.338_381_052_017_211_9, -1.397_562_023_997_306_8, 0.061_555_051_803_588_89],
                radius: 0.102_437_976_002_693_18,
                velocity: [1.300_048_685_073_852_6, 0.0, 0.070_072_889_328_002_93],
                kilograms: 6_624_784_576_911_600.0,
            },
            Ball {
                at: [1.313_317_574_503_447, -1.211_301_028_280_155, 0.166_461_968_421_936],
                radius: 0.119_915_348_291_397_09,
                velocity: [-0.001_456_141_471_862_793, 0.0, -0.057_110_631_465_911_87],
                kilograms: 18.057_304_279_605_525,
            },
        ],
    },
    // 10,300 by f64
    Pinch {
        response: Response::Impulse,
        counts: [4, 8],
        gravity: 9.81,
        friction: 0.823_972_702_026_367_2,
        restitution: 0.0,
        walls: &[(1, -1.0), (0, 1.0), (2, 1.0)],
        plates: false,
        balls: &[
            Ball {
                at: [0.556_053_352_355_957, -1.189_626_374_840_736_3, -0.163_778_185_844_421_4],
                radius: 0.210_373_625_159_263_6,
                velocity: [2.108_610_963_821_410_8, 0.0, 0.576_415_479_183_197],
                kilograms: 761_284_476_643_522.6,
            },
            Ball {
                at: [1.378_229_463_100_433_3, -1.378_229_463_100_433_3, 0.127_936_398_983_001_7],
                radius: 0.121_770_536_899_566_64,
                velocity: [0.028_891_229_629_516_596, 0.0, -0.026_586_723_327_636_716],
                kilograms: 18.908_420_826_874_178,
            },
        ],
    },
    // 1,300,000 by f64
    Pinch {
        response: Response::Impulse,
        counts: [2, 8],
        gravity: 9.81,
        friction: 0.9,
        restitution: 0.0,
        walls: &[(0, 1.0), (1, -1.0), (2, 1.0)],
        plates: false,
        balls: &[
            Ball {
                at: [1.367_762_496_471_405, 1.367_762_496_471_405, -0.855_412_530_899_047_9],
                radius: 0.122_237_503_528_594_97,
                velocity: [0.0, -4.464_188_814_163_208, 4.674_108_028_411_865],
                kilograms: 19.126_786_571_200_128,
            },
            Ball {
                at: [1.259_471_166_133_880_7, 1.191_669_559_478_759_6, -1.259_471_166_133_880_7],
                radius: 0.240_528_833_866_119_4,
                velocity: [0.0, 3.907_738_327_980_041_5, 4.199_052_453_041_077],
                kilograms: 7.713_629_376_097_307e16,
            },
        ],
    },
    // 15
    Pinch {
        response: Response::SoftStep,
        counts: [2, 8],
        gravity: 0.0,
        friction: 0.865_159_988_403_320_3,
        restitution: 0.0,
        walls: &[(1, -1.0), (0, 1.0)],
        plates: false,
        balls: &[
            Ball {
                at: [0.487_690_448_760_986_33, -1.296_715_721_487_999, 0.011_471_486_091_613_747],
                radius: 0.203_284_278_512_001_04,
                velocity: [0.487_645_816_802_978_6, 0.0, -0.036_767_810_583_114_624],
                kilograms: 31_816_482_802_469.83,
            },
            Ball {
                at: [1.396_831_136_941_909_7, -1.396_831_136_941_909_7, -0.272_864_091_396_331_8],
                radius: 0.103_168_863_058_090_2,
                velocity: [0.035_838_198_661_804_21, 0.0, -0.012_195_920_944_213_873],
                kilograms: 11.499_382_775_453_714,
            },
        ],
    },
    // 989
    Pinch {
        response: Response::SoftStep,
        counts: [1, 8],
        gravity: 0.0,
        friction: 0.879_239_737_987_518_3,
        restitution: 0.0,
        walls: &[(1, -1.0), (0, 1.0)],
        plates: false,
        balls: &[
            Ball {
                at: [0.310_244_488_716_125_5, -1.365_820_673_108_100_8, -0.103_858_494_758_605_96],
                radius: 0.134_179_326_891_899_1,
                velocity: [2.685_145_998_001_099, 0.0, 0.0],
                kilograms: 9.691_288_689_345_435e16,
            },
            Ball {
                at: [1.423_848_241_567_611_7, -1.423_848_241_567_611_7, -0.019_960_033_893_585_194],
                radius: 0.076_151_758_432_388_3,
                velocity: [-9.996_891_021_728_238e-5, 0.0, -0.053_348_100_185_394_29],
                kilograms: 4.624_538_562_067_779,
            },
            Ball {
                at: [1.397_842_645_645_141_6, -1.397_842_645_645_141_6, 0.211_884_784_698_486_32],
                radius: 0.102_157_354_354_858_4,
                velocity: [0.065_033_733_844_757_08, 0.0, 0.059_369_385_242_462_16],
                kilograms: 11.164_454_502_287_92,
            },
        ],
    },
];

fn vector<S: Scalar>(v: [f64; 3]) -> Vec3<S> {
    Vec3::from(v.map(S::from_f64))
}

fn world<S: Scalar>(pinch: &Pinch) -> World<S> {
    let mut world = World::default();
    let Pinch { response, counts: [substeps, iterations], .. } = *pinch;
    let rotation = Rotation::Dynamic;
    world
        .set_model(Model { response, substeps, iterations, rotation, ..Model::default() })
        .unwrap();
    world.set_gravity(vector([0.0, -pinch.gravity, 0.0])).unwrap();
    for (axis, side) in pinch.walls {
        let (mut normal, mut min, mut max) = ([0.0; 3], [-1.6; 3], [1.6; 3]);
        normal[*axis] = -side;
        *if *side > 0.0 { &mut min[*axis] } else { &mut max[*axis] } = 1.5 * side;
        if pinch.plates {
            let [min, max] = [min, max].map(|corner| Point3::from_vec(vector(corner)));
            world.walls.insert(Aabb { min, max }).unwrap();
        } else {
            world.walls.insert(Plane::new(vector(normal), S::from_f64(-1.5)).unwrap()).unwrap();
        }
    }
    let [friction, restitution] = [pinch.friction, pinch.restitution].map(S::from_f64);
    let material = Some(Material { friction, restitution, ..Material::default() });
    for ball in pinch.balls {
        let marble = Marble::new(Point3::from_vec(vector(ball.at)), S::from_f64(ball.radius));
        let mass = Mass::Kilograms(S::from_f64(ball.kilograms));
        let velocity = vector(ball.velocity);
        world.marbles.insert(Marble { velocity, mass, material, ..marble }).unwrap();
    }
    world
}

fn top_speed<S: Scalar>(world: &World<S>) -> f64 {
    let speeds = world.marbles.velocity().iter().map(|velocity| velocity.magnitude().as_f64());
    speeds.fold(0.0, f64::max)
}

/// Largest speed within a hundred and twenty steps, over that of the fastest at the start and of a fall
/// from wall to wall.
fn hastens<S: Scalar>(pinch: &Pinch) -> f64 {
    let mut world = world::<S>(pinch);
    let known = top_speed(&world) + (2.0 * pinch.gravity * 3.0).sqrt();
    let mut most = 0.0_f64;
    for _ in 0..120 {
        world.step(S::from_f64(STEP)).unwrap();
        most = most.max(top_speed(&world));
    }
    most / known
}

/// A heavy ball makes a light one up to twice as fast as it is itself, and in a wedge that friction does
/// not hold, it leaves faster by one over its slope.
#[test]
fn a_light_ball_between_a_heavy_one_and_a_corner_is_not_shot_away() {
    for (number, pinch) in PINCHES.iter().enumerate() {
        let [single, double] = [hastens::<f32>(pinch), hastens::<f64>(pinch)];
        assert!(single < 4.0 && double < 4.0, "pinch {number}: {single}, {double} times as fast");
    }
}
