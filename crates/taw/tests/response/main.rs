//! Tests in one program, since each program compiles the core anew.

#[path = "../common/draw.rs"]
mod draw;

mod capsules;
mod closed_boxes;
mod displacement;
mod energy;
mod energy_audit;
mod impulse;
mod islands;
mod jammed;
mod locked_axes;
mod parting;
mod penalty;
mod rotation;
mod scale;
mod squeezed;
mod tops;
