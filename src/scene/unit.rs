//! Lengths as text: `29.2mm`, `cm`, `2 m`.

use crate::{Error, Result};

/// Metres of a unit's name: m, cm or mm.
pub(super) fn metres(unit: &str) -> Option<f64> {
    Some(match unit {
        "m" => 1.0,
        "cm" => 1e-2,
        "mm" => 1e-3,
        _ => return None,
    })
}

/// Metres of a length such as `29.2mm`, `cm` (one centimetre) or `2 m`.
///
/// # Errors
/// [`Error::Setting`] for text that is no length in m, cm or mm, or no positive and finite one.
pub fn parse_unit(text: &str) -> Result<f64> {
    let text = text.trim();
    let split = text.find(|c: char| c.is_ascii_alphabetic() && !matches!(c, 'e' | 'E')).unwrap_or(text.len());
    let (number, unit) = text.split_at(split);
    let wrong = || Error::setting("unit", format!("`{text}` is not a length such as mm, 29.2mm, 2cm or 0.5m"));
    let unit = metres(unit.trim()).ok_or_else(wrong)?;
    let number = if number.trim().is_empty() { 1.0 } else { number.trim().parse::<f64>().map_err(|_| wrong())? };
    // Division by a whole number rounds once; multiplication by 1e-3 would round twice.
    let length = number / (1.0 / unit).round();
    if length.is_finite() && length > 0.0 {
        Ok(length)
    } else {
        Err(Error::setting("unit", format!("`{text}` must be above 0 and finite")))
    }
}
