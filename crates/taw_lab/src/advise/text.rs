//! Scenes, models and quantities as text.

use taw::prelude::*;
use taw::scene::Scene;

/// Reads a scene from RON text.
///
/// # Errors
/// Line, column, field and reason, as text.
pub fn read_scene(text: &str) -> Result<Scene, String> {
    let options =
        ron::Options::default().with_default_extension(ron::extensions::Extensions::IMPLICIT_SOME);
    let mut reader =
        ron::Deserializer::from_str_with_options(text, &options).map_err(|e| e.to_string())?;
    let scene: Scene = serde_path_to_error::deserialize(&mut reader).map_err(|error| {
        let field = error.path().to_string();
        let spanned = reader.span_error(error.into_inner());
        let ron::error::Position { line, col } = spanned.span.end;
        format!("{line}:{col}: {field}: {}", spanned.code)
    })?;
    reader.end().map_err(|error| reader.span_error(error).to_string())?;
    // Errors across fields show when a world is built.
    scene.run::<f64>(Model::default()).map_err(|error| error.to_string())?;
    Ok(scene)
}

/// A model as one writes it in Rust.
#[must_use]
pub fn literal(model: Model) -> String {
    let Model { integrator, response, rotation, precision, detection, substeps, iterations } =
        model;
    let response = match response {
        Response::Penalty(law) => format!("Penalty(ContactLaw::{law:?})"),
        other => format!("{other:?}"),
    };
    format!(
        "Model {{\n    integrator: Integrator::{integrator:?},\n    response: \
         Response::{response},\n    rotation: Rotation::{rotation:?},\n    precision: \
         Precision::{precision:?},\n    detection: Detection::{detection:?},\n    substeps: \
         {substeps},\n    iterations: {iterations},\n}}"
    )
}

/// A number with a unit, of those that are given with what each is worth.
///
/// # Errors
/// Why it is none, as text.
pub fn quantity(text: &str, units: &[(&str, f64)]) -> Result<f64, String> {
    let begin =
        text.find(|c: char| c.is_alphabetic() && c != 'e' && c != 'E').unwrap_or(text.len());
    let (number, unit) = text.split_at(begin);
    let names = || units.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
    let worth = units.iter().find(|(name, _)| *name == unit.trim()).map(|(_, worth)| *worth);
    match (number.trim().parse::<f64>(), worth) {
        (Ok(number), Some(worth)) if number > 0.0 && number.is_finite() => Ok(number * worth),
        _ => Err(format!("{text:?} is not a number above zero with one of the units {}", names())),
    }
}
