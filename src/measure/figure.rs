//! What an experiment returns: numbers with errors, ready to be printed and plotted.

/// A measured number beside its closed form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    pub x: f64,
    pub measured: f64,
    /// Standard error of `measured`.
    pub error: f64,
    /// What the closed form says; not a number where there is none.
    pub expected: f64,
}

impl Point {
    /// Measured minus expected in standard errors.
    pub fn deviation(&self) -> f64 {
        (self.measured - self.expected) / self.error
    }
}

/// Points of one kind, with the closed form as a curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    pub name: String,
    pub points: Vec<Point>,
    /// (x, y) of the closed form; empty where there is none.
    pub curve: Vec<(f64, f64)>,
}

/// How an axis is divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    Linear,
    Logarithmic,
}

/// What an axis shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// With its unit in brackets.
    pub label: String,
    pub scale: Scale,
}

impl Axis {
    pub fn linear(label: &str) -> Axis {
        Axis { label: label.into(), scale: Scale::Linear }
    }

    pub fn logarithmic(label: &str) -> Axis {
        Axis { label: label.into(), scale: Scale::Logarithmic }
    }
}

/// One diagram.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Short, for columns and legends.
    pub name: String,
    pub x: Axis,
    pub y: Axis,
    pub series: Vec<Series>,
}

/// The result of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    pub title: String,
    pub panels: Vec<Panel>,
    /// What else is to be said: other numbers, known errors of the set-up.
    pub notes: Vec<String>,
}

impl Figure {
    /// Every point.
    pub fn points(&self) -> impl Iterator<Item = &Point> {
        self.panels.iter().flat_map(|panel| &panel.series).flat_map(|series| &series.points)
    }

    /// Sum of squared deviations, and how many there are.
    pub fn chi_squared(&self) -> (f64, usize) {
        let deviations = self.points().map(Point::deviation).filter(|deviation| deviation.is_finite());
        deviations.fold((0.0, 0), |(sum, count), deviation| (sum + deviation * deviation, count + 1))
    }
}

/// `count` values from `low` to `high`, each the same factor above the last.
pub(super) fn geometric(low: f64, high: f64, count: usize) -> Vec<f64> {
    let step = (high / low).ln() / (count - 1) as f64;
    (0..count).map(|i| low * (step * i as f64).exp()).collect()
}

/// `count` values from `low` to `high`, evenly.
pub(super) fn even(low: f64, high: f64, count: usize) -> Vec<f64> {
    (0..count).map(|i| low + (high - low) * i as f64 / (count - 1) as f64).collect()
}
