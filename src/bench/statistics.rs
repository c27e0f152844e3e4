//! Medians of few measurements, and ratios of two such sets, without assuming a distribution. Measurements are taken as
//! independent of one another.

/// A value with an interval that holds the true one with at least the stated confidence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    pub value: f64,
    pub low: f64,
    pub high: f64,
    /// Of the interval, 0 to 1.
    pub confidence: f64,
}

/// The median, between two order statistics: the k-th smallest and the k-th largest of n enclose the true median unless
/// fewer than k values fall on one side of it, which has the probability 2 P(B(n, 1/2) < k) (H. A. David, H. N.
/// Nagaraja, Order Statistics, 2003, section 7.1). k is the largest that keeps `confidence`; fewer than 6 values do not
/// reach .95, and then the extremes stand with the confidence that they have. None without values.
pub fn median(values: &[f64], confidence: f64) -> Option<Estimate> {
    let sorted = sorted(values.iter().copied());
    let count = sorted.len();
    let value = middle(&sorted)?;
    // P(B(n, 1/2) = i) for i below k, summed.
    let mut logarithm = count as f64 * 0.5f64.ln();
    let mut below = logarithm.exp();
    let (mut k, mut reached) = (1, 1.0 - 2.0 * below);
    for i in 1..count / 2 {
        logarithm += ((count - i + 1) as f64 / i as f64).ln();
        below += logarithm.exp();
        if 1.0 - 2.0 * below < confidence {
            break;
        }
        (k, reached) = (i + 1, 1.0 - 2.0 * below);
    }
    Some(Estimate { value, low: sorted[k - 1], high: sorted[count - k], confidence: reached.max(0.0) })
}

/// By which factor values of `b` exceed those of `a`, both positive: the median of all ratios b/a (J. L. Hodges, E. L.
/// Lehmann 1963, on logarithms). The interval inverts the test of Mann and Whitney (D. F. Bauer, JASA 67, 687 (1972)):
/// it leaves 1 out exactly when that exact two-sided test tells the two apart at 1 - `confidence`. With equal values it
/// is wider than it need be. None where there are too few values for such a confidence.
pub fn ratio(a: &[f64], b: &[f64], confidence: f64) -> Option<Estimate> {
    let ratios = sorted(a.iter().flat_map(|a| b.iter().map(move |b| b / a)));
    let value = middle(&ratios)?;
    let mut tail = 0.0;
    let mut inside = None;
    // U < rank in each tail.
    for (index, probability) in mann_whitney(a.len(), b.len()).into_iter().enumerate().take(ratios.len() / 2) {
        tail += probability;
        if 1.0 - 2.0 * tail < confidence {
            break;
        }
        inside = Some((index, 1.0 - 2.0 * tail));
    }
    inside.map(|(k, confidence)| {
        let (low, high) = (ratios[k], ratios[ratios.len() - 1 - k]);
        Estimate { value, low, high, confidence }
    })
}

/// P(U = u) of n and m values from one distribution: the largest of all n + m is of the first set with the probability
/// n / (n + m), and then exceeds all m of the other.
fn mann_whitney(n: usize, m: usize) -> Vec<f64> {
    // row[i] is the distribution for i and j values.
    let mut row = vec![vec![1.0]; n + 1];
    for j in 1..=m {
        row[0] = vec![1.0];
        for i in 1..=n {
            let (first, second) = (i as f64 / (i + j) as f64, j as f64 / (i + j) as f64);
            let mut next = vec![0.0; i * j + 1];
            for (u, probability) in row[i - 1].iter().enumerate() {
                next[u + j] += first * probability;
            }
            for (u, probability) in row[i].iter().enumerate() {
                next[u] += second * probability;
            }
            row[i] = next;
        }
    }
    row.swap_remove(n)
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

fn middle(sorted: &[f64]) -> Option<f64> {
    let count = sorted.len();
    (count > 0).then(|| (sorted[(count - 1) / 2] + sorted[count / 2]) / 2.0)
}
