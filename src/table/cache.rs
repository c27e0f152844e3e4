//! Tables in the user's cache folder, by content: a file's name is the hash of all that determines its bytes.
//!
//! A file appears whole or not at all, so that several programs may write at once. A file that is not what this version
//! writes is made anew. Nothing here fails: without a folder, tables are simulated again.

use super::store::{VERSION, decode, encode};
use super::white::White;
use sha2::{Digest, Sha256};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// Names another folder than the user's; empty for none.
pub const VARIABLE: &str = "TRANSLUCENT_CACHE";

/// The folder of the cache: that of [`VARIABLE`], else `translucent` in the user's.
pub fn folder() -> Option<PathBuf> {
    match std::env::var_os(VARIABLE) {
        Some(folder) if folder.is_empty() => None,
        Some(folder) => Some(folder.into()),
        None => Some(dirs::cache_dir()?.join("translucent")),
    }
}

/// File of a table.
pub fn file(folder: &Path, ior: f64, g: f64, walks: u64) -> PathBuf {
    let content = format!("table {VERSION} ior {ior} g {g} walks {walks}");
    let name: String = Sha256::digest(content).iter().map(|byte| format!("{byte:02x}")).collect();
    folder.join(format!("{name}.table"))
}

/// The table of a half-space from the folder, or simulated and left there.
pub fn table(folder: Option<&Path>, ior: f64, g: f64, walks: u64) -> White {
    let file = folder.map(|folder| file(folder, ior, g, walks));
    let known = file.as_ref().and_then(|file| decode(&fs::read(file).ok()?));
    if let Some(table) = known.filter(|table| table.ior == ior && table.g == g) {
        return table;
    }
    let place = folder.map_or("not kept".into(), |folder| format!("kept in {}", folder.display()));
    log::info!("simulating light in matter of index {ior}, g {g}: a minute or less on two cores, {place}");
    let bytes = encode(&White::simulate(ior, g, &[f64::INFINITY], |_| walks));
    if let Some(file) = file
        && let Err(error) = write(&file, &bytes)
    {
        log::warn!("{}: the table is not kept: {error}", file.display());
    }
    // What is stored is what is used, so that the first render equals all later ones.
    decode(&bytes).expect("a table that was just encoded")
}

/// Writes a file whole or not at all.
fn write(file: &Path, bytes: &[u8]) -> std::io::Result<()> {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    if let Some(folder) = file.parent() {
        fs::create_dir_all(folder)?;
    }
    let part = file.with_extension(format!("{}-{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed)));
    let done = fs::write(&part, bytes).and_then(|()| fs::rename(&part, file));
    if done.is_err() {
        let _ = fs::remove_file(&part);
    }
    done
}
