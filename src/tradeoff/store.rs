//! Images that are kept between runs, each with its times and the key of what made it.

use super::Times;
use crate::{
    Error, Image, Result,
    image::{Attribute, write_whole},
    settings::Settings,
};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::{
    fs,
    path::{Path, PathBuf},
};

/// Where an image holds its key.
const KEY: &str = "translucent.tradeoff";

/// A folder of images.
pub struct Store {
    folder: PathBuf,
    /// What all images have in common: scene, kernels, version and device.
    common: String,
}

/// An image that is there.
pub struct Kept {
    pub image: Image,
    pub times: Times,
}

impl Store {
    pub fn new(folder: &Path, common: String) -> Store {
        Store { folder: folder.into(), common }
    }

    /// The key of an image: equal keys give equal images.
    pub fn key(&self, settings: &Settings, samples: u32) -> String {
        let settings = Settings { timeline: None, ..settings.clone() };
        let text = format!("{}\n{settings:?}\n{samples}", self.common);
        Sha256::digest(text.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect()
    }

    pub fn file(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{name}.exr"))
    }

    fn note(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{name}.json"))
    }

    /// The image called `name`, if it was made with `key`. Anything else that is there is rendered anew.
    pub fn find(&self, name: &str, key: &str) -> Option<Kept> {
        let note: Value = serde_json::from_str(&fs::read_to_string(self.note(name)).ok()?).ok()?;
        if note["key"] != key {
            return None;
        }
        let image = Image::read(self.file(name)).ok()?;
        let same = matches!(image.attributes.get(KEY), Some(Attribute::Text(found)) if found == key);
        Some(Kept { times: Times::from_json(&note["seconds"])?, image }).filter(|_| same)
    }

    /// Keeps R, G, B and A. The times are written last: without them the image does not count as there.
    ///
    /// # Errors
    /// [`Error::File`] if it cannot be written.
    pub fn keep(&self, name: &str, key: &str, image: &mut Image, times: Times) -> Result<()> {
        let file = self.file(name);
        if let Some(folder) = file.parent() {
            fs::create_dir_all(folder).map_err(|error| Error::file(folder, error))?;
        }
        image.channels.retain(|channel| ["R", "G", "B", "A"].contains(&channel.name.as_str()));
        image.attributes.insert(KEY.into(), Attribute::Text(key.into()));
        image.write(&file)?;
        let note = json!({"key": key, "seconds": times.json()});
        write_whole(self.note(name), format!("{note:#}\n").as_bytes())
    }
}
