//! `measure`: numeric experiments as a table, CSV and SVG.

use super::{
    Failure, arguments, plot, print,
    tables::{aligned, quoted, row, significant},
};
use serde_json::{Value, json};
use std::{
    fmt::Write,
    path::{Path, PathBuf},
    process::ExitCode,
};
use translucent::{
    Device, DeviceOptions, Model,
    image::{check_writable, write_whole},
    measure::{self, Figure, Matter, Point, Setup},
};

#[derive(clap::Args)]
pub struct Measure {
    /// What is measured: profile (radii that the sampler draws), searchlight (a thin beam on a plane, and a random walk),
    /// furnace (uniform light on a plane, by angle), sphere (in uniform light), edge (the 90-degree edge of a block), mtf
    /// (a plane behind a grating).
    #[arg(value_name = "EXPERIMENT")]
    experiment: Experiment,
    /// Matter by name (see `presets`); without any matter marble, in the furnace matter that absorbs nothing.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["sigma_s_prime", "sigma_a", "albedo", "mean_free_path"])]
    preset: Option<String>,
    /// Reduced scattering coefficients, with --sigma-a and --unit.
    #[arg(long, value_name = "R,G,B", value_parser = arguments::triple, requires = "sigma_a", conflicts_with = "albedo")]
    sigma_s_prime: Option<[f64; 3]>,
    /// Absorption coefficients.
    #[arg(long, value_name = "R,G,B", value_parser = arguments::triple, requires = "sigma_s_prime")]
    sigma_a: Option<[f64; 3]>,
    /// Total reflectance of a plane, with --mean-free-path and --unit.
    #[arg(long, value_name = "R,G,B", value_parser = arguments::triple, requires = "mean_free_path")]
    albedo: Option<[f64; 3]>,
    /// Mean free paths 1/sigma_t'.
    #[arg(long, value_name = "R,G,B", value_parser = arguments::triple, requires = "albedo")]
    mean_free_path: Option<[f64; 3]>,
    /// Unit of the coefficients (1/mm, 1/cm, 1/m) or lengths (mm, cm, m); without it 1/mm or mm.
    #[arg(long, value_name = "UNIT")]
    unit: Option<String>,
    /// Index of refraction; without it the preset's, or 1.3.
    #[arg(long, value_name = "N")]
    ior: Option<f64>,
    /// Mean cosine of the phase function.
    #[arg(long, value_name = "G", allow_negative_numbers = true)]
    g: Option<f64>,
    /// Models to compare, separated by commas; with several, the green channel is shown.
    #[arg(long, value_name = "MODEL,...", default_value = "standard", value_delimiter = ',', value_parser = super::scene::models())]
    model: Vec<Model>,
    /// Factor on the number of samples; standard errors fall with its square root.
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = arguments::positive)]
    effort: f64,
    /// Key of all random numbers.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u32,
    /// Stem of the CSV and SVG files, or a folder for them; without it the experiment's name, in the current folder.
    #[arg(short, long, value_name = "STEM|DIR")]
    output: Option<PathBuf>,
    /// Vulkan device by index, part of the name, or UUID (see `devices`); without it the best.
    #[arg(long, value_name = "INDEX|NAME|UUID")]
    device: Option<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Experiment {
    Profile,
    Searchlight,
    Furnace,
    Sphere,
    Edge,
    Mtf,
}

impl Experiment {
    fn name(self) -> &'static str {
        match self {
            Experiment::Profile => "profile",
            Experiment::Searchlight => "searchlight",
            Experiment::Furnace => "furnace",
            Experiment::Sphere => "sphere",
            Experiment::Edge => "edge",
            Experiment::Mtf => "mtf",
        }
    }
}

impl Measure {
    pub fn run(self) -> Result<ExitCode, Failure> {
        let [csv, svg] = self.outputs()?;
        let matters = self.model.iter().map(|model| self.matter(*model)).collect::<Result<Vec<_>, _>>()?;
        let device = Device::open(&DeviceOptions { device: self.device.clone(), ..DeviceOptions::default() })?;
        let setup = Setup { device: &device, matters: &matters, effort: self.effort, seed: self.seed };
        let figure = match self.experiment {
            Experiment::Profile => measure::profile(&setup),
            Experiment::Searchlight => measure::searchlight(&setup),
            Experiment::Furnace => measure::furnace(&setup),
            Experiment::Sphere => measure::sphere(&setup),
            Experiment::Edge => measure::edge(&setup),
            Experiment::Mtf => measure::mtf(&setup),
        }?;
        write_whole(&csv, self::csv(&figure).as_bytes())?;
        let drawing = plot::svg(&figure)
            .map_err(|error| Failure { message: format!("{}: {error}", svg.display()), code: ExitCode::from(1) })?;
        write_whole(&svg, drawing.as_bytes())?;
        print(&table(&figure))?;
        print(&format!("{}, {}\n", csv.display(), svg.display()))?;
        Ok(ExitCode::SUCCESS)
    }

    /// The files, and that they can be written.
    fn outputs(&self) -> Result<[PathBuf; 2], Failure> {
        let stem = match &self.output {
            None => PathBuf::from(self.experiment.name()),
            Some(folder) if folder.is_dir() => folder.join(self.experiment.name()),
            Some(stem) => stem.clone(),
        };
        let with = |extension: &str| -> Result<PathBuf, Failure> {
            // Not `with_extension`, which would cut a stem at its last dot.
            let mut path = stem.clone().into_os_string();
            path.push(extension);
            check_writable(Path::new(&path))?;
            Ok(path.into())
        };
        Ok([with(".csv")?, with(".svg")?])
    }

    fn matter(&self, model: Model) -> Result<Matter, Failure> {
        let mut bssrdf = json!({});
        let mut name = "given coefficients".to_string();
        let unit = |default: &str| Value::from(self.unit.as_deref().unwrap_or(default));
        let ior = self.ior.unwrap_or(1.3);
        if let (Some(scattering), Some(absorption)) = (self.sigma_s_prime, self.sigma_a) {
            bssrdf = json!({"sigma_s_prime": scattering, "sigma_a": absorption, "unit": unit("1/mm"), "ior": ior});
        } else if let (Some(albedo), Some(length)) = (self.albedo, self.mean_free_path) {
            bssrdf = json!({"albedo": albedo, "mean_free_path": length, "unit": unit("mm"), "ior": ior});
        } else if self.preset.is_none() && self.experiment == Experiment::Furnace {
            name = "no absorption".into();
            bssrdf = json!({"sigma_s_prime": [1, 1, 1], "sigma_a": [0, 0, 0], "unit": "1/mm", "ior": ior});
        } else {
            name = self.preset.clone().unwrap_or_else(|| "marble".into());
            bssrdf["preset"] = name.clone().into();
            if let Some(ior) = self.ior {
                bssrdf["ior"] = ior.into();
            }
            if self.unit.is_some() {
                return Err(Failure::input("--unit: a preset has its own"));
            }
        }
        if let Some(g) = self.g {
            bssrdf["g"] = g.into();
        }
        Ok(Matter::new(&name, bssrdf, model)?)
    }
}

/// One line a point, with the closed form and the deviation in standard errors.
fn csv(figure: &Figure) -> String {
    let mut text = String::from("panel,series,x_label,x,y_label,measured,standard_error,closed_form,deviation\n");
    for panel in &figure.panels {
        for series in &panel.series {
            for point in &series.points {
                let words = [&panel.name, &series.name, &panel.x.label].map(|word| quoted(word)).join(",");
                let Point { x, measured, error, expected } = point;
                let numbers = [*measured, *error, *expected, point.deviation()].map(number).join(",");
                // Text that cannot be written to a string does not exist.
                let _ = writeln!(text, "{words},{x},{},{numbers}", quoted(&panel.y.label));
            }
        }
    }
    text
}

/// A number, or nothing where there is none.
fn number(value: f64) -> String {
    if value.is_finite() { value.to_string() } else { String::new() }
}

/// For reading: the same numbers with few digits, and how well they agree.
fn table(figure: &Figure) -> String {
    let mut text = format!("{}\n", figure.title);
    for panel in &figure.panels {
        let mut rows = vec![row(["SERIES", &panel.x.label, &panel.y.label, "+-", "CLOSED FORM", "DEVIATION [s.e.]"])];
        for series in &panel.series {
            for point in &series.points {
                let Point { x, measured, error, expected } = *point;
                let deviation = point.deviation();
                rows.push(row([
                    &series.name,
                    &short(x),
                    &short(measured),
                    &short(error),
                    &short(expected),
                    &if deviation.is_finite() { format!("{deviation:+.1}") } else { "-".into() },
                ]));
            }
        }
        text.push('\n');
        text.push_str(&aligned(&rows));
    }
    let (sum, count) = figure.chi_squared();
    if count > 0 {
        let most = figure.points().map(|p| p.deviation().abs()).filter(|d| d.is_finite()).fold(0.0, f64::max);
        let _ = writeln!(
            text,
            "\n{count} points: root mean square deviation {:.2} s.e., largest {most:.1} s.e.",
            (sum / count as f64).sqrt()
        );
    }
    for note in &figure.notes {
        let _ = writeln!(text, "{note}");
    }
    text
}

/// Four digits, small numbers with an exponent.
fn short(value: f64) -> String {
    match value.abs() {
        v if !value.is_finite() || v == 0.0 => {
            if v == 0.0 {
                "0".into()
            } else {
                "-".into()
            }
        }
        v if v < 1e-3 => format!("{value:.3e}"),
        _ => significant(value),
    }
}
