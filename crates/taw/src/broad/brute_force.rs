/// Visits every pair of `count` indices once, the lower one first: the brute-force reference for
/// the [`Grid`](super::Grid).
pub fn brute_force_pairs(count: u32, mut pair: impl FnMut(u32, u32)) {
    for a in 0..count {
        for b in a + 1..count {
            pair(a, b);
        }
    }
}
