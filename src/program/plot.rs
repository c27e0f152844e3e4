//! Figures as SVG: points with error bars, closed forms as lines, deviations below.

use plotters::{
    coord::{
        Shift,
        ranged1d::{AsRangedCoord, Ranged, ValueFormatter},
    },
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};
use translucent::measure::{Figure, Panel, Point, Scale, Series};

/// Units of the drawing in a pixel: plotters rounds to whole units, which would show.
const FINE: u32 = 8;
/// Size of a panel, of the part that shows deviations, of the title and of a line of the legend.
const WIDTH: u32 = 880 * FINE;
const HEIGHT: u32 = 640 * FINE;
const BELOW: u32 = 180 * FINE;
const TITLE: u32 = 40 * FINE;
const LINE: u32 = 26 * FINE;
/// Letters of titles, axes and numbers; the width of one, roughly.
const LARGE: u32 = 22 * FINE;
const MIDDLE: u32 = 20 * FINE;
const SMALL: u32 = 17 * FINE;
const LETTER: u32 = 9 * FINE;
const MARGIN: u32 = 10 * FINE;
const LEFT: u32 = 92 * FINE;
const RADIUS: u32 = 4 * FINE;
const STROKE: u32 = 2 * FINE;
/// Deviations that are drawn [standard errors].
const MOST: f64 = 5.0;
pub const FONT: &str = "Helvetica, Arial, DejaVu Sans, sans-serif";
/// M. Okabe, K. Ito, "Color Universal Design", 2008: colours that the colour-blind tell apart.
pub const COLOURS: [RGBColor; 7] = [
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(0, 114, 178),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];

pub type Failed = Box<dyn std::error::Error>;

/// Gives plotters a typeface, by which it measures texts, and draws them where it draws pixels. SVG names [`FONT`], of
/// which the reader takes what he has.
pub fn register_font() -> Result<(), Failed> {
    plotters::style::register_font(FONT, FontStyle::Normal, dejavu::sans::regular())
        .map_err(|_| "the typeface is damaged".into())
}

/// The whole figure.
pub fn svg(figure: &Figure) -> Result<String, Failed> {
    register_font()?;
    let mut text = String::new();
    let panels = figure.panels.len() as u32;
    let lines = figure.panels.iter().map(|panel| legend(panel).len() as u32).max().unwrap_or(0);
    let (width, height) = (WIDTH * panels, TITLE + lines * LINE + HEIGHT);
    {
        let root = SVGBackend::with_string(&mut text, (width, height)).into_drawing_area();
        root.fill(&WHITE)?;
        let (title, body) = root.split_vertically(TITLE);
        let centred = (FONT, LARGE).into_font().into_text_style(&title).pos(Pos::new(HPos::Center, VPos::Center));
        title.draw_text(&figure.title, &centred, ((width / 2) as i32, (TITLE / 2) as i32))?;
        for (panel, area) in figure.panels.iter().zip(body.split_evenly((1, figure.panels.len()))) {
            let (above, below) = area.split_vertically(lines * LINE);
            draw_legend(panel, &above)?;
            draw(panel, &below)?;
        }
        root.present()?;
    }
    // The same picture in pixels.
    let size = |width: u32, height: u32| format!("width=\"{width}\" height=\"{height}\"");
    Ok(text.replacen(&size(width, height), &size(width / FINE, height / FINE), 1))
}

/// What stands for the curves of all series.
const CURVES: &str = "closed form";

/// Words of the legend by lines: the place of each, and the series, none for the curves.
fn legend(panel: &Panel) -> Vec<Vec<(u32, &str, Option<usize>)>> {
    let names = panel.series.iter().enumerate().map(|(index, series)| (series.name.as_str(), Some(index)));
    let curves = panel.series.iter().any(|series| !series.curve.is_empty()).then_some((CURVES, None));
    let mut lines = vec![vec![]];
    let mut at = LEFT;
    for (name, index) in names.chain(curves) {
        let width = 5 * LETTER + LETTER * name.chars().count() as u32;
        if at + width > WIDTH && at > LEFT {
            lines.push(vec![]);
            at = LEFT;
        }
        lines.last_mut().expect("there is a line").push((at, name, index));
        at += width;
    }
    lines
}

fn draw_legend(panel: &Panel, area: &DrawingArea<SVGBackend, Shift>) -> Result<(), Failed> {
    let style = (FONT, SMALL).into_font().into_text_style(area).pos(Pos::new(HPos::Left, VPos::Center));
    for (row, line) in legend(panel).into_iter().enumerate() {
        let y = (row as u32 * LINE + LINE / 2) as i32;
        for (x, name, index) in line {
            let (x, width) = (x as i32, 3 * LETTER as i32);
            match index {
                None => {
                    area.draw(&PathElement::new([(x, y), (x + width, y)], BLACK.mix(0.5).stroke_width(STROKE)))?;
                }
                Some(index) => {
                    let style = marker(&panel.series[index], COLOURS[index % COLOURS.len()]);
                    area.draw(&Circle::new((x + width / 2, y), RADIUS, style))?;
                }
            }
            area.draw_text(name, &style, (x + width + LETTER as i32 / 2, y))?;
        }
    }
    Ok(())
}

/// Full where there is a closed form, open where there is none.
fn marker(series: &Series, colour: RGBColor) -> ShapeStyle {
    if series.curve.is_empty() { colour.stroke_width(STROKE) } else { colour.filled() }
}

fn draw(panel: &Panel, area: &DrawingArea<SVGBackend, Shift>) -> Result<(), Failed> {
    let (above, below) = area.split_vertically(HEIGHT - BELOW);
    let points = || panel.series.iter().flat_map(|series| &series.points);
    let x = range(points().map(|p| p.x).chain(curves(panel).map(|(x, _)| x)), panel.x.scale, 0.0);
    // Error bars of points that vanish in noise do not stretch a logarithmic axis.
    let values = points().flat_map(|p| match panel.y.scale {
        Scale::Linear => vec![p.measured - p.error, p.measured + p.error],
        Scale::Logarithmic => vec![p.measured],
    });
    let values = values.filter(|value| panel.y.scale == Scale::Linear || *value > 0.0);
    let values = values.chain(curves(panel).filter(|(at, _)| *at >= x.0 && *at <= x.1).map(|(_, y)| y));
    let y = range(values, panel.y.scale, 0.05);
    match (panel.x.scale, panel.y.scale) {
        (Scale::Linear, Scale::Linear) => main(panel, &above, x.0..x.1, y.0..y.1)?,
        (Scale::Linear, Scale::Logarithmic) => main(panel, &above, x.0..x.1, (y.0..y.1).log_scale())?,
        (Scale::Logarithmic, Scale::Linear) => main(panel, &above, (x.0..x.1).log_scale(), y.0..y.1)?,
        (Scale::Logarithmic, Scale::Logarithmic) => {
            main(panel, &above, (x.0..x.1).log_scale(), (y.0..y.1).log_scale())?;
        }
    }
    match panel.x.scale {
        Scale::Linear => deviations(panel, &below, x.0..x.1),
        Scale::Logarithmic => deviations(panel, &below, (x.0..x.1).log_scale()),
    }
}

fn curves(panel: &Panel) -> impl Iterator<Item = (f64, f64)> {
    panel.series.iter().flat_map(|series| series.curve.iter().copied())
}

/// Least and largest value, with a margin.
fn range(values: impl Iterator<Item = f64>, scale: Scale, margin: f64) -> (f64, f64) {
    let finite = values.filter(|value| value.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    match scale {
        Scale::Linear => {
            let pad = if high > low { (high - low) * margin } else { 0.01 * high.abs().max(1e-9) };
            (low - pad, high + pad)
        }
        Scale::Logarithmic => {
            let factor = (high / low).powf(margin).max(1.0 + margin);
            (low / factor, high * factor)
        }
    }
}

fn main<X, Y>(panel: &Panel, area: &DrawingArea<SVGBackend, Shift>, x: X, y: Y) -> Result<(), Failed>
where
    X: AsRangedCoord<Value = f64>,
    X::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: AsRangedCoord<Value = f64>,
    Y::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    let mut chart = ChartBuilder::on(area)
        .margin(MARGIN)
        .margin_right(2 * MARGIN)
        .x_label_area_size(MARGIN)
        .y_label_area_size(LEFT)
        .build_cartesian_2d(x, y)?;
    let y_range = chart.as_coord_spec().y_spec().range();
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.12).stroke_width(FINE))
        .axis_style(BLACK.stroke_width(FINE))
        .set_all_tick_mark_size(MARGIN / 2)
        .y_desc(&panel.y.label)
        .axis_desc_style((FONT, MIDDLE))
        .label_style((FONT, SMALL))
        .x_label_formatter(&|_| String::new())
        .y_label_formatter(&|value| label(*value))
        .draw()?;
    let shown = |y: f64| y >= y_range.start && y <= y_range.end;
    let clip = |y: f64| y.clamp(y_range.start, y_range.end);
    for (series, colour) in panel.series.iter().zip(COLOURS.iter().cycle()) {
        let curve = series.curve.iter().filter(|(_, y)| shown(*y)).copied();
        chart.draw_series(LineSeries::new(curve, colour.stroke_width(STROKE)))?;
        let seen = || series.points.iter().filter(|point| shown(point.measured));
        chart.draw_series(seen().map(|p| {
            let ends = [(p.x, clip(p.measured - p.error)), (p.x, clip(p.measured + p.error))];
            PathElement::new(ends, colour.stroke_width(STROKE))
        }))?;
        chart.draw_series(seen().map(|p| Circle::new((p.x, p.measured), RADIUS, marker(series, *colour))))?;
    }
    Ok(())
}

/// Measured minus closed form in standard errors, with a band of two.
fn deviations<X>(panel: &Panel, area: &DrawingArea<SVGBackend, Shift>, x: X) -> Result<(), Failed>
where
    X: AsRangedCoord<Value = f64>,
    X::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    let mut chart = ChartBuilder::on(area)
        .margin(MARGIN)
        .margin_top(0)
        .margin_right(2 * MARGIN)
        .x_label_area_size(6 * MARGIN)
        .y_label_area_size(LEFT)
        .build_cartesian_2d(x, -MOST..MOST)?;
    let x_range = chart.as_coord_spec().x_spec().range();
    chart.draw_series([Rectangle::new([(x_range.start, -2.0), (x_range.end, 2.0)], BLACK.mix(0.08).filled())])?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.12).stroke_width(FINE))
        .axis_style(BLACK.stroke_width(FINE))
        .set_all_tick_mark_size(MARGIN / 2)
        .y_labels(3)
        .y_desc("dev. [s.e.]")
        .x_desc(&panel.x.label)
        .axis_desc_style((FONT, MIDDLE))
        .label_style((FONT, SMALL))
        .x_label_formatter(&|value| label(*value))
        .y_label_formatter(&|value| format!("{value:.0}"))
        .draw()?;
    for (series, colour) in panel.series.iter().zip(COLOURS.iter().cycle()) {
        let shown = series.points.iter().filter(|point| point.deviation().is_finite());
        let at = |p: &Point| (p.x, p.deviation().clamp(-MOST, MOST));
        chart.draw_series(shown.map(|p| Circle::new(at(p), RADIUS, colour.filled())))?;
    }
    Ok(())
}

/// A short number: powers of ten as such where they are far from 1.
pub fn label(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude == 0.0 || (1e-2..1e4).contains(&magnitude) {
        let text = format!("{value:.4}");
        let text = text.trim_end_matches('0').trim_end_matches('.');
        return if text == "-0" { "0".into() } else { text.into() };
    }
    let exponent = magnitude.log10().floor();
    let mantissa = value / 10f64.powf(exponent);
    let superscript: String = format!("{exponent:.0}")
        .chars()
        .map(|digit| match digit {
            '-' => '\u{207b}',
            '1' => '\u{b9}',
            '2' => '\u{b2}',
            '3' => '\u{b3}',
            '0' => '\u{2070}',
            digit => char::from_u32('\u{2070}' as u32 + digit as u32 - '0' as u32).unwrap_or(digit),
        })
        .collect();
    match format!("{mantissa:.3}").trim_end_matches('0').trim_end_matches('.') {
        "1" => format!("10{superscript}"),
        mantissa => format!("{mantissa}\u{b7}10{superscript}"),
    }
}
