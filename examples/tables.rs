//! Makes the tables that the crate ships: `cargo run --release --example tables [FOLDER]` (assets/tables by default).
//!
//! Some seven minutes of one core. The same bytes result on every machine with the same elementary functions.

use translucent::table::{SHIPPED_IORS, SPHERES, store::encode, white::White};

fn main() -> std::io::Result<()> {
    let folder = std::path::PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "assets/tables".into()));
    std::fs::create_dir_all(&folder)?;
    let radii: Vec<f64> = SPHERES.iter().map(|&exponent| 2f64.powf(f64::from(exponent) / 2.0 - 1.0)).collect();
    for ior in SHIPPED_IORS {
        let radii = [&radii[..], &[f64::INFINITY]].concat();
        let table = White::simulate(ior, 0.0, &radii, |radius| if radius.is_finite() { 1 << 17 } else { 1 << 21 });
        let file = folder.join(format!("{ior}.table"));
        std::fs::write(&file, encode(&table))?;
        println!("{}", file.display());
    }
    Ok(())
}
