//! The table as CSV.

use crate::program::tables::quoted;
use std::fmt::Write;
use translucent::tradeoff::{Against, Errors, Measure, Outcome};

/// Every column: what was rendered; seconds, in all and by parts (`seconds` = prepare + render); errors as shares of 1,
/// relative and FLIP: sampling, model, total, and the converged image's own; whether the variant is on the front (of
/// its model by sampling error, of all by the total); and what came of it: rendered, kept, or why it was refused.
pub const COLUMNS: &str = "model,integrator,projection,reproject,irradiance,reuse,precision,directions,samples,\
seconds,prepare_seconds,render_seconds,kernel_seconds,start_up_seconds,\
sampling_error,sampling_flip,model_error,model_flip,total_error,total_flip,reference_error,reference_flip,\
front_sampling_error,front_sampling_flip,front_total_error,front_total_flip,status";

pub fn text(outcome: &Outcome) -> String {
    let front = |against, measure| outcome.front(measure, against);
    let fronts = [
        front(Against::Sampling, Measure::Relative),
        front(Against::Sampling, Measure::Flip),
        front(Against::Total, Measure::Relative),
        front(Against::Total, Measure::Flip),
    ];
    let mut text = format!("{COLUMNS}\n");
    for (index, row) in outcome.rows.iter().enumerate() {
        let variant = &row.variant;
        let mut cells = vec![variant.model.to_string(), variant.integrator.to_string(), variant.projection()];
        cells.extend(variant.choices.map(|(name, _)| name.into()));
        cells.extend([variant.directions, variant.samples].map(|number| number.to_string()));
        let converged = outcome.converged(variant.model);
        let model = converged.and_then(|converged| converged.error);
        let own = converged.map(|converged| converged.own);
        let measured = row.outcome.as_ref().ok();
        let times = measured.map(|measured| measured.times);
        cells.extend(
            [
                times.map(|times| times.total()),
                times.map(|times| times.prepare),
                times.map(|times| times.render),
                times.and_then(|times| times.kernels),
                times.map(|times| times.start_up),
            ]
            .map(number),
        );
        let sampling = measured.map(|measured| measured.sampling);
        for errors in [sampling, model, measured.and_then(|measured| measured.total), own] {
            cells.extend(both(errors));
        }
        cells.extend(fronts.iter().map(|front| u8::from(front[index]).to_string()));
        cells.push(match &row.outcome {
            Ok(measured) if measured.kept => "kept".into(),
            Ok(_) => "rendered".into(),
            Err(why) => quoted(&format!("refused: {why}")),
        });
        // Text that cannot be written to a string does not exist.
        let _ = writeln!(text, "{}", cells.join(","));
    }
    text
}

fn both(errors: Option<Errors>) -> [String; 2] {
    [number(errors.map(|errors| errors.relative)), number(errors.map(|errors| errors.flip))]
}

/// A number, or nothing where there is none.
fn number(value: Option<f64>) -> String {
    value.filter(|value| value.is_finite()).map_or(String::new(), |value| value.to_string())
}
