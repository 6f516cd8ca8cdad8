//! Charts of error against real-time factor, on which the upper right wins.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;
use std::sync::Once;

use plotters::coord::{CoordTranslate, Shift};
use plotters::drawing::DrawingAreaErrorKind;
use plotters::prelude::*;

use super::report::front;
use super::scenes::SCENES;
use super::sweep::STEPS;
use super::{Curve, Point};

const SIZE: (u32, u32) = (1200, 760);
/// The part on the right that names curves and steps.
const LEGEND: u32 = 330;
const FONT: &str = "sans-serif";

/// Draws a scene's chart as SVG and as PNG.
pub fn draw(scene: &str, curves: &[Curve], folder: &Path) -> Result<(), Box<dyn Error>> {
    static FONTS: Once = Once::new();
    let bytes = epaint_default_fonts::UBUNTU_LIGHT;
    FONTS.call_once(|| {
        // Without it there are no letters, and the first text reports that.
        let _ = plotters::style::register_font(FONT, FontStyle::Normal, bytes);
    });
    let file = |ending: &str| folder.join(format!("{scene}.{ending}"));
    let svg = file("svg");
    draw_on(scene, curves, SVGBackend::new(&svg, SIZE).into_drawing_area())?;
    let (width, height) = SIZE;
    let mut pixels = vec![0; 3 * (width * height) as usize];
    draw_on(scene, curves, BitMapBackend::with_buffer(&mut pixels, SIZE).into_drawing_area())?;
    image::save_buffer(file("png"), &pixels, width, height, image::ColorType::Rgb8)?;
    Ok(())
}

/// Position of a point in the chart: by powers of ten, better to the right and up.
fn place(point: &Point) -> Option<(f64, f64)> {
    let error = point.error.filter(|_| point.failure.is_none())?.max(1e-16);
    let place = (point.real_time.log10(), -error.log10());
    (place.0.is_finite() && place.1.is_finite()).then_some(place)
}

fn draw_on<B: DrawingBackend>(
    scene: &str,
    curves: &[Curve],
    area: DrawingArea<B, Shift>,
) -> Result<(), Box<dyn Error>>
where
    B::ErrorType: 'static,
{
    area.fill(&WHITE)?;
    let (plot, legend) = area.split_horizontally(SIZE.0 - LEGEND);
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let marbles = points().next().map_or(1.0, |p| 1e9 / (p.cost * p.real_time));
    let speeds = || points().map(|point| point.real_time.log10()).filter(|x| x.is_finite());
    let (left, right) = (speeds().fold(6.0, f64::min), speeds().fold(0.0, f64::max));
    let top = points().filter_map(place).map(|(_, y)| y).fold(1.0, f64::max);
    // Below an error of one there is the strip of failures.
    let strip = -0.05 * (top + 1.0);
    let about = SCENES.iter().find(|judged| judged.name == scene);
    let about = about.map_or(String::new(), |judged| format!(": {}", judged.scene().description));
    let mut chart = ChartBuilder::on(&plot)
        .caption(format!("{scene}{about}"), (FONT, 24))
        .margin(14)
        .x_label_area_size(64)
        .y_label_area_size(70)
        .build_cartesian_2d(left - 0.1..right + 0.1, 2.0 * strip..top + 0.3)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.12))
        .label_style((FONT, 15))
        .axis_desc_style((FONT, 17))
        .x_labels(5)
        .x_label_formatter(&|x| speed_label(*x, marbles))
        .y_label_formatter(&|y| match *y {
            0.0 => "1".into(),
            y if y.fract() == 0.0 => format!("10^{:.0}", -y),
            _ => String::new(),
        })
        .x_desc("times real time, and cost of a marble and simulated second")
        .y_desc("error")
        .draw()?;
    chart.draw_series(std::iter::once(Rectangle::new(
        [(left - 0.1, 2.0 * strip), (right + 0.1, strip)],
        RED.mix(0.08).filled(),
    )))?;
    let colors = colors(curves);
    for curve in curves {
        let color = colors[base(&curve.name)];
        let line: Vec<_> = front(&curve.points).into_iter().filter_map(place).collect();
        if curve.name.ends_with("f32") {
            chart.draw_series(DashedLineSeries::new(line, 5, 4, color.stroke_width(1)))?;
        } else {
            chart.draw_series(LineSeries::new(line, color.stroke_width(2)))?;
        }
        for point in front(&curve.points) {
            if let Some(at) = place(point) {
                mark(chart.plotting_area(), at, &point.step, color)?;
            }
        }
        for point in curve.points.iter().filter(|point| place(point).is_none()) {
            let at = (point.real_time.log10().clamp(left, right), 1.5 * strip);
            chart.draw_series(std::iter::once(Cross::new(at, 3, color.mix(0.5))))?;
        }
    }
    let best: Vec<_> = front(points()).into_iter().filter_map(place).collect();
    chart.draw_series(LineSeries::new(best, BLACK.mix(0.25).stroke_width(7)))?;
    draw_legend::<B>(&legend, curves, &colors)?;
    area.present()?;
    Ok(())
}

/// Speed at a power of ten of real time, and what a marble and simulated second cost then. The
/// lines between powers have no label.
fn speed_label(power: f64, marbles: f64) -> String {
    if power.fract() != 0.0 {
        return String::new();
    }
    let seconds = 10_f64.powf(-power - marbles.log10());
    let (unit, name) = match seconds {
        0.999.. => (1.0, "s"),
        0.999e-3.. => (1e-3, "ms"),
        0.999e-6.. => (1e-6, "µs"),
        _ => (1e-9, "ns"),
    };
    format!("{} ×, {} {name}", digits(10_f64.powf(power)), digits(seconds / unit))
}

/// Two digits or more, as people write them.
fn digits(x: f64) -> String {
    let tenths = (x * 10.0).round() / 10.0;
    if x < 10.0 { tenths.to_string() } else { format!("{x:.0}") }
}

/// The name of a curve without its scalar.
fn base(name: &str) -> &str {
    name.rsplit_once(", ").map_or(name, |(base, _)| base)
}

/// One color for each model.
fn colors(curves: &[Curve]) -> BTreeMap<&str, RGBAColor> {
    let mut colors = BTreeMap::new();
    for curve in curves {
        let next = colors.len();
        colors.entry(base(&curve.name)).or_insert_with(|| Palette99::pick(next).to_rgba());
    }
    colors
}

/// Draws the sign of a step.
fn mark<B: DrawingBackend, C: CoordTranslate>(
    area: &DrawingArea<B, C>,
    at: C::From,
    step: &str,
    color: RGBAColor,
) -> Result<(), DrawingAreaErrorKind<B::ErrorType>>
where
    C::From: Clone,
{
    let (middle, here) = ((0, 0), EmptyElement::at(at));
    match STEPS.iter().position(|(name, _)| *name == step) {
        Some(0) => area.draw(&(here + Circle::new(middle, 5, color.stroke_width(2)))),
        Some(1) => area.draw(&(here + Circle::new(middle, 4, color.filled()))),
        Some(2) => area.draw(&(here + TriangleMarker::new(middle, 6, color.filled()))),
        Some(3) => area.draw(&(here + Rectangle::new([(-3, -3), (4, 4)], color.filled()))),
        _ => area.draw(&(here + Cross::new(middle, 4, color.stroke_width(2)))),
    }
}

fn draw_legend<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    curves: &[Curve],
    colors: &BTreeMap<&str, RGBAColor>,
) -> Result<(), Box<dyn Error>>
where
    B::ErrorType: 'static,
{
    let mut y = 60;
    let text = |what: &str, y: i32| area.draw(&Text::new(what.to_owned(), (40, y - 8), (FONT, 16)));
    let mut known = Vec::new();
    for curve in curves {
        let name = base(&curve.name);
        if known.contains(&name) {
            continue;
        }
        known.push(name);
        area.draw(&PathElement::new([(6, y), (34, y)], colors[name].stroke_width(3)))?;
        text(name, y)?;
        y += 24;
    }
    y += 16;
    area.draw(&PathElement::new([(6, y), (34, y)], BLACK.stroke_width(2)))?;
    text("f64", y)?;
    y += 24;
    for dash in 0..4 {
        area.draw(&PathElement::new([(6 + 8 * dash, y), (10 + 8 * dash, y)], BLACK))?;
    }
    text("f32", y)?;
    y += 24;
    area.draw(&PathElement::new([(6, y), (34, y)], BLACK.mix(0.25).stroke_width(7)))?;
    text("the front", y)?;
    y += 40;
    for (step, _) in STEPS {
        mark(area, (20, y), step, BLACK.to_rgba())?;
        text(&format!("step {step} s").replace("ms s", "ms"), y)?;
        y += 24;
    }
    y += 16;
    area.draw(&Cross::new((20, y), 3, BLACK))?;
    text("failed (strip at the bottom)", y)?;
    Ok(())
}
