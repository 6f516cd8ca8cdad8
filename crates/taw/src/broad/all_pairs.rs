/// Names every pair of `count` rows once, the lower row first: the reference
/// that the [`Grid`](super::Grid) is tested against.
pub fn all_pairs(count: u32, mut pair: impl FnMut(u32, u32)) {
    for a in 0..count {
        for b in a + 1..count {
            pair(a, b);
        }
    }
}
