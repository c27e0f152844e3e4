//! Error against time as a picture, in SVG and PNG: colours are models, shapes are methods, full is on the front.

use super::About;
use crate::program::plot::{COLOURS, FONT, Failed, label, register_font};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use plotters::{
    coord::Shift,
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};
use translucent::{
    Model,
    tradeoff::{Against, Measure, Row, Variant},
};

/// Size of a panel, of the legend and of a line of it (pixels of the picture).
const WIDTH: u32 = 620;
const HEIGHT: u32 = 520;
const LINE: u32 = 26;
/// Units of the drawing in a pixel of the picture: plotters rounds to whole units.
const SVG_UNITS: u32 = 8;
const PNG_UNITS: u32 = 4;
/// Pixels of the PNG in one of the picture.
const PNG_PIXELS: u32 = 2;

pub fn svg(about: &About, measure: Measure) -> Result<String, Failed> {
    let picture = Picture::new(about, measure, SVG_UNITS);
    let (width, height) = picture.size();
    let mut text = String::new();
    picture.draw(SVGBackend::with_string(&mut text, (width * SVG_UNITS, height * SVG_UNITS)).into_drawing_area())?;
    let size = |unit: u32| format!("width=\"{}\" height=\"{}\"", width * unit, height * unit);
    Ok(text.replacen(&size(SVG_UNITS), &size(1), 1))
}

pub fn png(about: &About, measure: Measure) -> Result<Vec<u8>, Failed> {
    let picture = Picture::new(about, measure, PNG_UNITS);
    let (width, height) = picture.size();
    let fine = (width * PNG_UNITS, height * PNG_UNITS);
    let mut pixels = vec![0; (3 * fine.0 * fine.1) as usize];
    picture.draw(BitMapBackend::with_buffer(&mut pixels, fine).into_drawing_area())?;
    // The backend draws without shades; they come from the finer pixels.
    const SHARE: u32 = PNG_UNITS / PNG_PIXELS;
    let shade = |x: u32, y: u32, c: u32| {
        let finer = (0..SHARE * SHARE).map(|i| (x * SHARE + i % SHARE) + (y * SHARE + i / SHARE) * fine.0);
        let sum: u32 = finer.map(|pixel| u32::from(pixels[(3 * pixel + c) as usize])).sum();
        (sum / (SHARE * SHARE)) as u8
    };
    let (width, height) = (width * PNG_PIXELS, height * PNG_PIXELS);
    let shades = (0..height).flat_map(|y| (0..width).flat_map(move |x| [0, 1, 2].map(|c| (x, y, c))));
    let shades: Vec<u8> = shades.map(|(x, y, c)| shade(x, y, c)).collect();
    let mut file = Vec::new();
    PngEncoder::new(&mut file).write_image(&shades, width, height, ExtendedColorType::Rgb8)?;
    Ok(file)
}

/// What a shape stands for: everything but model and samples.
pub fn method(variant: &Variant) -> String {
    let Variant { integrator, directions, .. } = variant;
    let mut text = integrator.to_string();
    if variant.integrator == translucent::settings::Integrator::Sample {
        text += &format!(", {}", variant.projection());
    }
    text.extend(variant.chosen().map(|(axis, name)| format!(", {axis} {name}")));
    if *directions != 1 { format!("{text}, {directions} directions") } else { text }
}

/// In order of appearance.
pub fn distinct<T: PartialEq>(items: impl Iterator<Item = T>) -> Vec<T> {
    let mut found = Vec::new();
    for item in items {
        if !found.contains(&item) {
            found.push(item);
        }
    }
    found
}

struct Picture<'a> {
    about: &'a About<'a>,
    measure: Measure,
    unit: u32,
    models: Vec<Model>,
    methods: Vec<String>,
    panels: Vec<Against>,
}

impl<'a> Picture<'a> {
    fn new(about: &'a About<'a>, measure: Measure, unit: u32) -> Picture<'a> {
        let rows = || about.outcome.rows.iter().filter(|row| row.outcome.is_ok());
        let mut panels = vec![Against::Sampling];
        panels.extend(about.outcome.yardstick().map(|_| Against::Total));
        let models = distinct(rows().map(|row| row.variant.model));
        let methods = distinct(rows().map(|row| method(&row.variant)));
        Picture { about, measure, unit, models, methods, panels }
    }

    fn size(&self) -> (u32, u32) {
        (WIDTH * self.panels.len() as u32, HEIGHT + LINE * self.legend().len() as u32)
    }

    fn draw<B: DrawingBackend>(&self, root: DrawingArea<B, Shift>) -> Result<(), Failed>
    where
        B::ErrorType: 'static,
    {
        register_font()?;
        root.fill(&WHITE)?;
        let lines = self.legend();
        let (above, below) = root.clone().split_vertically(LINE * self.unit * lines.len() as u32);
        self.draw_legend(&above, &lines)?;
        for (area, against) in below.split_evenly((1, self.panels.len())).iter().zip(&self.panels) {
            self.panel(&root, area, *against)?;
        }
        Ok(root.present()?)
    }

    /// Lines of (place, text, colour, shape).
    fn legend(&self) -> Vec<Vec<(u32, String, RGBColor, usize)>> {
        let models =
            self.models.iter().enumerate().map(|(i, model)| (model.to_string(), COLOURS[i % COLOURS.len()], CIRCLE));
        let methods = self.methods.iter().enumerate().map(|(i, method)| (method.clone(), BLACK, i));
        let width = WIDTH * self.panels.len() as u32;
        let mut lines = Vec::new();
        for list in [models.collect::<Vec<_>>(), methods.collect()] {
            let (mut at, mut line) = (70, Vec::new());
            for (text, colour, shape) in list {
                let wide = 34 + 8 * text.chars().count() as u32;
                if at + wide > width && !line.is_empty() {
                    lines.push(std::mem::take(&mut line));
                    at = 70;
                }
                line.push((at, text, colour, shape));
                at += wide;
            }
            lines.push(line);
        }
        lines
    }

    fn draw_legend<B: DrawingBackend>(
        &self,
        area: &DrawingArea<B, Shift>,
        lines: &[Vec<(u32, String, RGBColor, usize)>],
    ) -> Result<(), Failed>
    where
        B::ErrorType: 'static,
    {
        let style = (FONT, 15 * self.unit).into_font().into_text_style(area).pos(Pos::new(HPos::Left, VPos::Center));
        for (y, line) in lines.iter().enumerate() {
            let y = ((y as u32 * LINE + LINE / 2 + 4) * self.unit) as i32;
            for (x, text, colour, shape) in line {
                let x = (x * self.unit) as i32;
                mark(area, (x, y), *shape, self.unit, *colour, true)?;
                area.draw_text(text, &style, (x + (10 * self.unit) as i32, y))?;
            }
        }
        Ok(())
    }

    /// Shown in the picture.
    fn value(&self, error: f64) -> f64 {
        if self.measure == Measure::Relative { 100.0 * error } else { error }
    }

    fn panel<B: DrawingBackend>(
        &self,
        root: &DrawingArea<B, Shift>,
        area: &DrawingArea<B, Shift>,
        against: Against,
    ) -> Result<(), Failed>
    where
        B::ErrorType: 'static,
    {
        let outcome = self.about.outcome;
        let unit = self.unit;
        let point = |row: &Row| row.point(self.measure, against).map(|(time, error)| (time, self.value(error)));
        let all = outcome.rows.iter().zip(outcome.front(self.measure, against));
        // A logarithmic axis has no place for an error of 0.
        let points: Vec<(&Row, (f64, f64), bool)> = all
            .filter_map(|(row, on)| Some((row, point(row)?, on)))
            .filter(|(_, (time, error), _)| *time > 0.0 && *error > 0.0)
            .collect();
        if points.is_empty() {
            return Ok(());
        }
        let x = range(points.iter().map(|(_, (time, _), _)| *time));
        let y = range(points.iter().map(|(_, (_, error), _)| *error));
        let title = match against {
            Against::Sampling => "sampling error: to the model's own converged image".to_string(),
            Against::Total => {
                let model = outcome.against.map_or(String::new(), |model| model.to_string());
                format!("total error: to the converged image of {model}")
            }
        };
        let name = match self.measure {
            Measure::Relative => "relative RMSE [%]",
            Measure::Flip => "FLIP",
        };
        let mut chart = ChartBuilder::on(area)
            .margin(10 * unit)
            .margin_right(20 * unit)
            .caption(title, (FONT, 16 * unit))
            .x_label_area_size(44 * unit)
            .y_label_area_size(56 * unit)
            .build_cartesian_2d(
                (x.0..x.1).log_scale().with_key_points(ticks(x)),
                (y.0..y.1).log_scale().with_key_points(ticks(y)),
            )?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.12).stroke_width(unit))
            .axis_style(BLACK.stroke_width(unit))
            .set_all_tick_mark_size(5 * unit)
            .x_desc("time to prepare and render [s]")
            .y_desc(name)
            .axis_desc_style((FONT, 15 * unit))
            .label_style((FONT, 13 * unit))
            .x_label_formatter(&|value| label(*value))
            .y_label_formatter(&|value| label(*value))
            .draw()?;
        let colour = |model: Model| {
            let index = self.models.iter().position(|known| *known == model).unwrap_or(0);
            COLOURS[index % COLOURS.len()]
        };
        // One front for each model, or for all.
        let fronts = match against {
            Against::Sampling => self.models.iter().map(|model| (Some(*model), colour(*model))).collect(),
            Against::Total => vec![(None, BLACK)],
        };
        for (model, colour) in fronts {
            let on = points.iter().filter(|(row, _, on)| *on && model.is_none_or(|model| row.variant.model == model));
            let mut line: Vec<(f64, f64)> = on.map(|(_, point, _)| *point).collect();
            line.sort_by(|a, b| a.0.total_cmp(&b.0));
            let style = colour.mix(if model.is_some() { 0.55 } else { 0.35 }).stroke_width(2 * unit);
            chart.draw_series(LineSeries::new(line, style))?;
        }
        for (row, point, on) in &points {
            let shape = self.methods.iter().position(|known| *known == method(&row.variant)).unwrap_or(0);
            mark(root, chart.backend_coord(point), shape, unit, colour(row.variant.model), *on)?;
        }
        Ok(())
    }
}

/// Corners of the shapes, in pixels; the first is a circle, and more methods than shapes begin anew.
const CIRCLE: usize = 0;
const SHAPES: [&[(f64, f64)]; 6] = [
    &[],
    &[(0.0, -5.5), (5.0, 4.0), (-5.0, 4.0)],
    &[(-4.0, -4.0), (4.0, -4.0), (4.0, 4.0), (-4.0, 4.0)],
    &[(0.0, -6.0), (5.0, 0.0), (0.0, 6.0), (-5.0, 0.0)],
    &[(0.0, 5.5), (5.0, -4.0), (-5.0, -4.0)],
    &[(-5.0, -2.0), (0.0, -5.0), (5.0, -2.0), (3.0, 4.0), (-3.0, 4.0)],
];
const RADIUS: f64 = 4.5;

/// Draws a shape around `centre`.
fn mark<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    centre: (i32, i32),
    shape: usize,
    unit: u32,
    colour: RGBColor,
    full: bool,
) -> Result<(), Failed>
where
    B::ErrorType: 'static,
{
    let units = |pixels: f64| (pixels * f64::from(unit)).round() as i32;
    let corners = |size: f64| {
        let corner = |(x, y): &(f64, f64)| (centre.0 + units(size * x), centre.1 + units(size * y));
        SHAPES[shape % SHAPES.len()].iter().map(corner).collect::<Vec<_>>()
    };
    // The open ones are full ones with a hole: the bitmap backend does not close lines well.
    let mut layers = vec![(1.0, colour.filled())];
    layers.extend((!full).then_some((0.6, WHITE.filled())));
    for (size, style) in layers {
        match corners(size) {
            none if none.is_empty() => area.draw(&Circle::new(centre, units(size * RADIUS), style))?,
            corners => area.draw(&Polygon::new(corners, style))?,
        }
    }
    Ok(())
}

/// Least and largest value, with a margin.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, 0.0f64), |(low, high), value| (low.min(value), high.max(value)));
    let factor = (high / low).powf(0.05).max(1.1);
    (low / factor, high * factor)
}

/// 1, 2 and 5 times powers of ten; powers alone over many.
fn ticks((low, high): (f64, f64)) -> Vec<f64> {
    let steps: &[f64] = if high / low > 1e4 { &[1.0] } else { &[1.0, 2.0, 5.0] };
    let powers = low.log10().floor() as i32..=high.log10().ceil() as i32;
    let all = powers.flat_map(|power| steps.iter().map(move |step| step * 10f64.powi(power)));
    all.filter(|tick| (low..=high).contains(tick)).collect()
}
