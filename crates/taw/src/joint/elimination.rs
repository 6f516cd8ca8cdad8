//! Order of elimination.

use std::collections::BTreeSet;

/// Order in which joints are eliminated: the one with the fewest partners first (minimum degree; Tinney and
/// Walker, 1967), whose partners then are partners of each other.
pub(super) fn elimination_order(mut partners: Vec<BTreeSet<u32>>) -> Vec<u32> {
    let degrees = partners.iter().zip(0..).map(|(partners, joint)| (partners.len(), joint));
    let mut queue: BTreeSet<(usize, u32)> = degrees.collect();
    let mut order = Vec::with_capacity(partners.len());
    while let Some((_, joint)) = queue.pop_first() {
        order.push(joint);
        let neighbours = std::mem::take(&mut partners[joint as usize]);
        for neighbour in &neighbours {
            let own = &mut partners[*neighbour as usize];
            queue.remove(&(own.len(), *neighbour));
            own.extend(neighbours.iter().filter(|other| *other != neighbour));
            own.remove(&joint);
            queue.insert((own.len(), *neighbour));
        }
    }
    order
}
