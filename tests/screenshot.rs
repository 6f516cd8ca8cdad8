//! The demo is started as the README says, under Xvfb with the software Vulkan driver,
//! and its picture has to show a panel, a board, and marbles of all four colours.
//!
//! Ignored by default because it needs both (Debian: `xvfb`, `mesa-vulkan-drivers`).
//! `.ci/run` runs it:
//! `cargo test --workspace --test screenshot -- --ignored`

use std::path::Path;
use std::process::Command;

use image::{Rgb, RgbImage};

/// A part of the picture, in pixels: left, top, right, bottom.
type Region = [u32; 4];

/// Region of the panel: its title and first sliders.
const PANEL: Region = [12, 12, 278, 420];
/// Well inside the board, away from the pads in its corners.
const BOARD: Region = [500, 150, 780, 560];
/// A corner where there is nothing but the surroundings.
const OUTSIDE: Region = [1100, 600, 1270, 710];

/// Hue in degrees, saturation and value in [0, 1] (Smith, *Color gamut transform
/// pairs*, 1978).
fn hsv(Rgb(rgb): Rgb<u8>) -> (f32, f32, f32) {
    let [r, g, b] = rgb.map(|channel| f32::from(channel) / 255.0);
    let (value, least) = (r.max(g).max(b), r.min(g).min(b));
    let chroma = value - least;
    if chroma == 0.0 {
        return (0.0, 0.0, value);
    }
    let hue = if value == r {
        (g - b) / chroma
    } else if value == g {
        (b - r) / chroma + 2.0
    } else {
        (r - g) / chroma + 4.0
    };
    ((hue * 60.0).rem_euclid(360.0), chroma / value, value)
}

/// The part of a region's pixels for which `test` holds, by hue, saturation, value.
fn part(
    picture: &RgbImage,
    [left, top, right, bottom]: Region,
    test: impl Fn(f32, f32, f32) -> bool,
) -> f32 {
    let mut count = 0;
    for y in top..bottom {
        for x in left..right {
            let (h, s, v) = hsv(*picture.get_pixel(x, y));
            count += u32::from(test(h, s, v));
        }
    }
    count as f32 / ((right - left) * (bottom - top)) as f32
}

/// Faults of the picture, one line each.
fn faults(picture: &RgbImage) -> Vec<String> {
    let mut faults = Vec::new();
    let mut expect = |what: &str, part: f32, range: std::ops::Range<f32>| {
        println!("{what}: {part:.4} of its region");
        if !range.contains(&part) {
            faults.push(format!("{what} covers {part} of its region, not {range:?}"));
        }
    };
    let grey = |low, high| move |_, s, v| s < 0.2 && v >= low && v < high;
    expect("the panel's dark ground", part(picture, PANEL, grey(0.05, 0.2)), 0.6..0.98);
    expect("the panel's light text", part(picture, PANEL, grey(0.5, 1.1)), 0.01..0.2);
    let wood = |h, s, v| (20.0..45.0).contains(&h) && s > 0.3 && v > 0.25;
    expect("the board's wood", part(picture, BOARD, wood), 0.4..0.97);
    expect("wood beside the board", part(picture, OUTSIDE, wood), 0.0..0.01);
    for (name, hues) in [
        ("red", 345.0..365.0),
        ("yellow", 46.0..62.0),
        ("green", 110.0..160.0),
        ("blue", 205.0..240.0),
    ] {
        let marble = move |h: f32, s: f32, v: f32| {
            let h = if h < 5.0 { h + 360.0 } else { h };
            s > 0.5 && v > 0.3 && hues.contains(&h)
        };
        expect(&format!("{name} marbles"), part(picture, BOARD, marble), 0.002..0.2);
    }
    faults
}

fn take_picture(path: &Path) -> RgbImage {
    let drivers = Path::new("/usr/share/vulkan/icd.d");
    let software = std::fs::read_dir(drivers)
        .expect("Vulkan drivers are described here")
        .filter_map(|entry| Some(entry.ok()?.path()))
        .find(|path| path.to_string_lossy().contains("lvp_icd"))
        .expect("mesa-vulkan-drivers is installed");
    let _ = std::fs::remove_file(path);
    let status = Command::new("xvfb-run")
        .args(["--auto-servernum", "--server-args=-screen 0 1280x720x24"])
        .args([env!("CARGO"), "run", "--quiet", "--example", "marble_madness", "--"])
        .args(["--frames", "75", "--screenshot"])
        .arg(path)
        .env("VK_DRIVER_FILES", software)
        .status()
        .expect("xvfb-run is installed");
    assert!(status.success(), "the demo ended with {status}");
    image::open(path).expect("the demo wrote a picture").to_rgb8()
}

#[test]
#[ignore = "needs Xvfb and a software Vulkan driver"]
fn the_demo_shows_panel_board_and_marbles() {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("marble_madness.png");
    let picture = take_picture(&path);
    assert_eq!(picture.dimensions(), (1280, 720));
    assert_eq!(faults(&picture), [""; 0], "see {}", path.display());

    // The same picture without its parts must not pass.
    let painted = |[left, top, right, bottom]: Region, with: Rgb<u8>| {
        let mut picture = picture.clone();
        for y in top..bottom {
            (left..right).for_each(|x| picture.put_pixel(x, y, with));
        }
        picture
    };
    let wood = Rgb([176, 125, 70]);
    assert_eq!(faults(&painted(BOARD, wood)).len(), 5, "four colours gone, and too much wood");
    assert_eq!(faults(&painted(PANEL, wood)).len(), 2, "neither the panel nor its text");
    assert!(faults(&RgbImage::new(1280, 720)).len() >= 6, "blank");
}
