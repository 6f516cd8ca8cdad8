//! Sleep by the other methods: sequential impulses, penalty forces, projection.

use super::*;
use taw::response::ContactLaw;

const RESPONSES: [Response; 4] = [
    Response::Impulse,
    Response::Displacement,
    Response::Penalty(ContactLaw::SpringDashpot),
    Response::Penalty(ContactLaw::HertzMindlin),
];

/// Runs a test by each of these methods.
fn by(responses: &[Response], test: fn()) {
    for response in responses {
        RESPONSE.set(*response);
        println!("{response:?}");
        test();
    }
}

#[test]
fn whatever_changes_wakes() {
    by(&RESPONSES, whatever_changes_about_a_marble_wakes_its_island);
    by(&RESPONSES, whatever_changes_about_a_heap_wakes_it);
    by(&RESPONSES, walls_of_another_history_wake_all);
    // Springs overlap so far that the heap is one island.
    by(&RESPONSES[..2], a_lift_wakes_only_what_it_comes_to);
}

/// By projection, a heap comes to rest later than they look.
#[test]
fn heaps_fall_asleep_about_what_must_not_or_does_not_move() {
    let but_displacement = [RESPONSES[0], RESPONSES[2], RESPONSES[3]];
    by(&but_displacement, marbles_of_infinite_mass_that_do_not_move_let_others_sleep);
    by(&but_displacement, nothing_falls_asleep_about_a_marble_that_must_not);
}

#[test]
fn nothing_sleeps_in_mid_air_by_any_method() {
    by(&RESPONSES, nothing_sleeps_in_mid_air);
    by(&RESPONSES, spawn::one_whose_support_goes_falls_whenever_it_goes);
}

#[test]
fn random_changes_wake_and_who_sleeps_does_not_move() {
    by(&RESPONSES, random::who_must_wake_wakes_and_who_sleeps_does_not_move);
}

#[test]
fn one_that_comes_or_goes_wakes_no_other_one_by_any_method() {
    by(&RESPONSES, spawn::one_that_comes_goes_or_changes_wakes_no_other_one);
    by(&RESPONSES, spawn::a_block_that_goes_with_its_marble_wakes_no_other_one);
}
