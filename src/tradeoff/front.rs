//! The Pareto front.

/// Which of the points (time, error) no other beats: none is as good in both and better in one. A point with a part
/// that is not a number is never among them.
pub fn front(points: &[(f64, f64)]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..points.len()).filter(|&i| !points[i].0.is_nan() && !points[i].1.is_nan()).collect();
    order.sort_by(|&a, &b| points[a].0.total_cmp(&points[b].0).then(points[a].1.total_cmp(&points[b].1)));
    let mut on = vec![false; points.len()];
    let mut last: Option<(f64, f64)> = None;
    for i in order {
        // Slower than the last, or as fast: on the front if better, or the same point.
        if last.is_none_or(|last| points[i].1 < last.1 || points[i] == last) {
            on[i] = true;
            last = Some(points[i]);
        }
    }
    on
}
