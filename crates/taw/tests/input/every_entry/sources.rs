//! Public entries, as the sources say: functions that may refuse, and fields of what they take.

use std::collections::BTreeSet;
use std::path::Path;

/// Arguments that say whom, or choose among a few: there is no number in them.
const NAMES: &[&str] = &[
    "&self",
    "&mut self",
    "MarbleId",
    "WallId",
    "SensorId",
    "ColliderId",
    "NodeId",
    "BallId",
    "&[BallId]",
    "&[ColliderId]",
    "Option<NodeId>",
    "Option<Integrator>",
    "Option<Rotation>",
];

/// Types of which all numbers come in through functions, and where they are written down.
const TAKEN: &[(&str, &[&str])] = &[
    ("world/marble.rs", &["Marble", "Damping"]),
    ("world/limits.rs", &["SpeedLimits"]),
    ("world/model.rs", &["Model"]),
    ("motion/mass.rs", &["Mass"]),
    ("motion/wall_motion.rs", &["WallMotion"]),
    ("motion/force_field.rs", &["ForceField", "Medium"]),
    ("contact/material.rs", &["Material", "Elasticity"]),
    ("frame/pose.rs", &["Pose"]),
    ("shape/ball.rs", &["NBall"]),
    ("shape/aabb.rs", &["Aabb"]),
    ("shape/obb.rs", &["Obb"]),
    ("shape/capsule.rs", &["Capsule"]),
    (
        "scene/mod.rs",
        &[
            "Scene",
            "GravityKeyframe",
            "SensorPlane",
            "ForceFieldDesc",
            "MaterialDesc",
            "WallDesc",
            "ShapeDesc",
            "RotationDesc",
            "KinematicMotion",
            "MarbleDesc",
            "Lattice",
        ],
    ),
];

/// All of them: functions as `Type::name`, fields as `Type.name`, those of variants as
/// `Type::Variant.name`.
pub fn entries() -> BTreeSet<String> {
    let root = Path::new("src");
    let mut entries = BTreeSet::new();
    functions_in(root, &mut entries);
    for (file, types) in TAKEN {
        let source = std::fs::read_to_string(root.join(file)).unwrap();
        let scene = if file.starts_with("scene") { "scene::" } else { "" };
        for name in *types {
            let fields = fields_of(&source, name);
            assert!(!fields.is_empty(), "{name} is not in {file}");
            entries.extend(fields.into_iter().map(|field| format!("{scene}{field}")));
        }
    }
    entries
}

fn functions_in(folder: &Path, entries: &mut BTreeSet<String>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            functions_in(&path, entries);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let source = std::fs::read_to_string(&path).unwrap();
            functions_of(&source, entries);
        }
    }
}

/// The public functions of public types in a file that may refuse a number.
fn functions_of(source: &str, entries: &mut BTreeSet<String>) {
    let code = source.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    let mut owner = String::new();
    let mut lines = code.lines();
    while let Some(line) = lines.next() {
        if line.starts_with("impl") {
            owner = type_of_impl(line);
        }
        let Some(rest) = line.strip_prefix("    pub fn ") else { continue };
        let mut signature = rest.to_string();
        while !signature.contains('{') && !signature.ends_with("where") {
            signature += " ";
            signature += lines.next().unwrap().trim();
        }
        let hidden = code.contains(&format!("pub(super) struct {owner}"))
            || code.contains(&format!("pub(crate) struct {owner}"));
        let refuses = signature.contains("-> Result<") && signature.contains(", Error>");
        if refuses && !hidden && takes_a_number(&signature) {
            let name = signature.split(['(', '<']).next().unwrap();
            entries.insert(format!("{owner}::{name}"));
        }
    }
}

/// `Walls` of `impl<S: Scalar> Walls<S> {`.
fn type_of_impl(line: &str) -> String {
    let after = match line.strip_prefix("impl<") {
        Some(generic) => {
            let mut depth = 1;
            let end = generic.find(|c| {
                depth += i32::from(c == '<') - i32::from(c == '>');
                depth == 0
            });
            &generic[end.unwrap_or(0) + 1..]
        }
        None => &line["impl".len()..],
    };
    let of = after.rsplit(" for ").next().unwrap_or(after).trim();
    of.split(['<', ' ', '{']).next().unwrap_or_default().to_string()
}

fn takes_a_number(signature: &str) -> bool {
    let begin = signature.find('(').unwrap() + 1;
    let end = signature.find("-> Result<").unwrap();
    let arguments = signature[begin..end].trim().trim_end_matches([')', ',', ' ']);
    let types = arguments.split(", ").map(|argument| {
        argument.split_once(": ").map_or(argument, |(_, of)| of).trim_end_matches(',').trim()
    });
    types.into_iter().any(|of| !of.is_empty() && !NAMES.contains(&of))
}

/// The public fields of a type, and of its variants, that are not things with a row of their own.
fn fields_of(source: &str, name: &str) -> Vec<String> {
    let heads = [format!("pub struct {name}"), format!("pub enum {name}")];
    let is_head = |line: &str| {
        heads.iter().any(|head| {
            line.strip_prefix(head.as_str())
                .is_some_and(|rest| rest.starts_with(['<', ' ', ';', '(']))
        })
    };
    let mut fields = Vec::new();
    let mut variant = None;
    let body =
        source.lines().skip_while(|line| !is_head(line)).skip(1).take_while(|line| *line != "}");
    for line in body {
        let (indent, text) = (line.len() - line.trim_start().len(), line.trim());
        if text.starts_with("//") || text.starts_with("#[") {
            continue;
        }
        let begins = text.chars().next().is_some_and(char::is_uppercase);
        match text.split_once(": ") {
            Some((field, _)) if indent == 4 && text.starts_with("pub ") => {
                fields.push(format!("{name}.{}", field.trim_start_matches("pub ")));
            }
            Some((field, _)) if indent == 8 && !begins && variant.is_some() => {
                let of: &str = variant.unwrap_or_default();
                fields.push(format!("{name}::{of}.{field}"));
            }
            _ if indent == 4 && begins => {
                let of = text.split(['(', ' ', ',', '{']).next().unwrap_or_default();
                // What has no fields has no number; `Density(S)` has one.
                if text.contains('(') {
                    fields.push(format!("{name}::{of}"));
                }
                variant = Some(of);
            }
            _ => {}
        }
    }
    fields
}

#[test]
fn sources_are_read_as_they_are_written() {
    let source = "\
impl<S: Scalar> Things<S> {
    pub fn get(&self, id: MarbleId) -> Result<Thing<S>, Error> {
    pub fn set(
        &mut self,
        id: MarbleId,
        size: S,
    ) -> Result<(), Error> {
    pub(crate) fn own(&self, size: S) -> Result<(), Error> {
    pub fn size(&self, at: S) -> S {
impl<P, S: Scalar> Ball<P, S>
    pub fn new<T>(center: P, radius: S) -> Result<Self, Error>
    where
#[cfg(test)]
mod tests {
    pub fn never(size: S) -> Result<(), Error> {
";
    let mut entries = BTreeSet::new();
    functions_of(source, &mut entries);
    assert_eq!(entries.into_iter().collect::<Vec<_>>(), ["Ball::new", "Things::set"]);
    let source = "\
pub enum Form {
    /// A ball: this.
    Ball {
        /// In metres.
        #[serde(default)]
        radius: f64,
    },
    Kind(S),
    None,
}
pub struct Former {
    pub height: f64,
    own: f64,
}";
    assert_eq!(fields_of(source, "Form"), ["Form::Ball.radius", "Form::Kind"]);
    assert_eq!(fields_of(source, "Former"), ["Former.height"]);
}
