//! `report.html`: one page with everything in it. What it shows is JSON in its middle; the rest does not change.

use super::{About, picture};
use base64::{Engine, engine::general_purpose::STANDARD};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use serde_json::{Value, json};
use translucent::{
    Error, Image, Result,
    image::Difference,
    tradeoff::{Against, Converged, Errors, Measure, Measured, Row},
};

const PAGE: &str = include_str!("report.html");
/// Where the JSON goes.
const DATA: &str = "/*DATA*/";

/// Most pixels of all variants' images together; with more, only those on a front are embedded.
const MOST_PIXELS: u64 = 16 << 20;

pub fn html(about: &About) -> Result<String> {
    // No tag can end the script before its time.
    let data = data(about)?.to_string().replace('<', "\\u003c");
    Ok(PAGE.replacen(DATA, &data, 1))
}

fn data(about: &About) -> Result<Value> {
    let outcome = about.outcome;
    let yardstick = outcome.yardstick();
    let size = yardstick.or(outcome.converged.first()).map_or((0, 0), |one| (one.image.width, one.image.height));
    let images = outcome.rows.iter().filter(|row| row.outcome.is_ok()).count() as u64;
    let all = images * u64::from(size.0) * u64::from(size.1) <= MOST_PIXELS;
    let fronts = [Against::Sampling, Against::Total]
        .map(|against| [Measure::Relative, Measure::Flip].map(|measure| outcome.front(measure, against)));
    let on_front = |index: usize| fronts.iter().flatten().any(|front| front[index]);
    let mut rows = Vec::new();
    let mut refused: Vec<(&str, Vec<String>)> = Vec::new();
    for (index, row) in outcome.rows.iter().enumerate() {
        match (&row.outcome, outcome.converged(row.variant.model)) {
            (Ok(measured), Some(converged)) => {
                rows.push(variant(about, row, measured, converged, all || on_front(index))?);
            }
            (Err(why), _) => match refused.iter_mut().find(|(known, _)| known == why) {
                Some((_, names)) => names.push(row.variant.name()),
                None => refused.push((why, vec![row.variant.name()])),
            },
            (Ok(_), None) => {}
        }
    }
    let models = outcome.converged.iter().map(|converged| {
        let maps = match yardstick {
            Some(yardstick) if yardstick.model != converged.model => {
                Some(maps(&converged.image, &yardstick.image, about.exposure)?)
            }
            _ => None,
        };
        Ok(json!({
            "name": converged.model.to_string(),
            "samples": converged.samples,
            "own": errors(Some(converged.own)),
            "error": errors(converged.error),
            "image": picture(&converged.image, about.exposure)?,
            "maps": maps,
        }))
    });
    Ok(json!({
        "scene": about.scene,
        "device": about.device,
        "version": env!("CARGO_PKG_VERSION"),
        "size": [about.size.0, about.size.1],
        "shown": [size.0, size.1],
        "against": yardstick.map(|yardstick| yardstick.model.to_string()),
        "finished": outcome.finished,
        "models": models.collect::<Result<Vec<Value>>>()?,
        "rows": rows,
        "refused": refused,
    }))
}

fn variant(about: &About, row: &Row, measured: &Measured, converged: &Converged, embed: bool) -> Result<Value> {
    let times = &measured.times;
    let mut value = json!({
        "model": row.variant.model.to_string(),
        "method": picture::method(&row.variant),
        "samples": row.variant.samples,
        "total": errors(measured.total),
        "sampling": errors(Some(measured.sampling)),
        "prepare": times.prepare,
        "render": times.render,
        "kernels": times.kernels,
        "startUp": times.start_up,
        "both": times.total(),
        "command": about.command(&row.variant),
        "file": measured.file.display().to_string(),
    });
    if embed {
        let image = Image::read(&measured.file)?;
        value["image"] = picture(&image, about.exposure)?.into();
        value["maps"] = maps(&image, &converged.image, about.exposure)?;
    }
    Ok(value)
}

fn errors(errors: Option<Errors>) -> Value {
    errors.map_or(Value::Null, |errors| json!({"relative": errors.relative, "flip": errors.flip}))
}

fn picture(image: &Image, exposure: f64) -> Result<String> {
    png(&image.encoded(exposure)?, image, ExtendedColorType::Rgb8)
}

/// Errors of the pixels from 0 to 1, as grey.
fn maps(image: &Image, reference: &Image, exposure: f64) -> Result<Value> {
    let grey = |difference: &Difference, root: bool| {
        let byte = |value: &f32| (255.0 * if root { value.sqrt() } else { *value }).round() as u8;
        png(&difference.map.iter().map(byte).collect::<Vec<u8>>(), image, ExtendedColorType::L8)
    };
    let relative = grey(&image.relative_mse(reference)?, true)?;
    Ok(json!({"relative": relative, "flip": grey(&image.flip(reference, exposure)?, false)?}))
}

/// A PNG as an address.
fn png(pixels: &[u8], size: &Image, colour: ExtendedColorType) -> Result<String> {
    let mut file = Vec::new();
    PngEncoder::new(&mut file)
        .write_image(pixels, size.width, size.height, colour)
        .map_err(|error| Error::Setting { setting: "report".into(), problem: error.to_string() })?;
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(file)))
}
