//! Time of each stage, on a scene of which some of it is known.

use std::cell::Cell;

use taw::prelude::*;
use taw_lab::advise::read_scene;
use taw_lab::stages::measure;
use taw_lab::trade::trace::{RunConfig, ScalarType};

const TOWER: &str = include_str!("../scenes/tower.ron");

fn setting(model: Model, number: ScalarType) -> RunConfig {
    RunConfig { model, number, step: 1.0 / 60.0 }
}

#[test]
fn a_tower_of_six_has_six_contacts_and_all_stages_take_time() {
    let scene = read_scene(TOWER).unwrap();
    let response = Response::Impulse;
    for substeps in [1, 4] {
        let model = Model { response, substeps, ..Model::default() };
        // As if a thousand bytes were taken between the two looks.
        let looks = Cell::new(0);
        let allocated = || {
            looks.set(looks.get() + 1000);
            looks.get()
        };
        let stages = measure(&scene, setting(model, ScalarType::F64), allocated).unwrap();
        assert_eq!((stages.contacts, stages.bytes), (6.0, 1000));
        assert!(stages.integrate > 0.0 && stages.generate_contacts > 0.0);
        assert!(stages.restitute > 0.0);
    }
}

#[test]
fn what_a_world_refuses_is_refused() {
    let scene = read_scene(TOWER).unwrap();
    let model = Model { substeps: 0, ..Model::default() };
    let error = measure(&scene, setting(model, ScalarType::F32), || 0).unwrap_err();
    assert!(matches!(error, taw::Error::OutOfRange { field: "substeps", .. }), "{error}");
}
