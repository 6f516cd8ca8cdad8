//! Tests in one program, since each program compiles the core anew.

mod bad_input;
mod every_entry;
mod nasty_sequences;
