//! The quick rows of the reference suite, as tests.

use taw_lab::suite::{CostClass, Report, measure, rows};

/// Quick rows that are known to be missed, as name and model, with what stops each.
const MISSED: &[(&str, &str)] = &[
    // A marble that goes less than half its radius in a step is not swept, and bounces by the normal where it is
    // in the wall at the end of the step.
    ("glancing/pin", "impulse, swept"),
];

#[test]
fn quick_rows_are_reached_but_those_that_are_known_not_to_be() {
    let mut wrong = Vec::new();
    for row in rows().filter(|row| row.effort == CostClass::Quick) {
        if row.is_time() {
            continue; // how fast this machine is, is not for a test to say
        }
        let outcome = row.run();
        if outcome.reached == MISSED.contains(&(row.name, row.model)) {
            wrong.push(format!("{} by {}: {:e}", row.name, row.model, outcome.figure));
        }
    }
    assert!(wrong.is_empty(), "reached and missed are not as they were: {wrong:#?}");
}

#[test]
fn every_row_says_what_it_is() {
    let mut seen = std::collections::BTreeSet::new();
    for row in rows() {
        assert!(seen.insert((row.name, row.model)), "{} by {} is there twice", row.name, row.model);
        for text in [row.name, row.setup, row.metric, row.model, row.best, row.source] {
            assert!(!text.is_empty(), "{}", row.name);
        }
        assert!(row.target >= 0.0, "{}", row.name);
    }
}

#[test]
fn rows_measured_at_a_time_come_in_order_and_are_the_same() {
    let some: Vec<_> =
        rows().filter(|row| row.effort == CostClass::Quick && !row.is_time()).take(7).collect();
    let figures = |jobs| {
        let mut reports = Vec::new();
        measure(&some, jobs, |row, outcome| reports.push(Report::new(row, &outcome)));
        reports.iter().map(|report| (report.name, report.figure)).collect::<Vec<_>>()
    };
    let one = figures(1);
    assert_eq!(one.len(), 7);
    assert!(some.iter().zip(&one).all(|(row, (name, _))| row.name == *name));
    assert_eq!(figures(3), one);
}
