//! Dispatches that [`super::dump`] wrote, run again.

use super::{Census, Dispatch, FUNCTIONS, dump};
use crate::{
    error::{Error, Result},
    render::SPIRV,
    shared::{Features, Slot, Step},
};
use serde_json::Value;
use std::{
    fmt, fs,
    path::{Path, PathBuf},
};

/// A JSON file of a dump.
struct Json {
    file: PathBuf,
    value: Value,
}

impl Json {
    fn read(file: PathBuf) -> Result<Json> {
        let value = serde_json::from_slice(&read_file(&file)?).map_err(|error| Error::file(&file, error))?;
        Ok(Json { file, value })
    }

    fn wrong(&self, problem: impl fmt::Display) -> Error {
        Error::file(&self.file, problem)
    }

    fn array(&self, name: &str) -> Result<&[Value]> {
        let found = if name.is_empty() { Some(&self.value) } else { self.value.get(name) };
        let array = found.and_then(Value::as_array);
        array.map(Vec::as_slice).ok_or_else(|| self.wrong(format!("{name} is no array")))
    }

    fn number(&self, object: &Value, name: &str) -> Result<u32> {
        let number = object.get(name).and_then(Value::as_u64).and_then(|number| u32::try_from(number).ok());
        number.ok_or_else(|| self.wrong(format!("{name} is no 32-bit number")))
    }

    fn text<'a>(&self, object: &'a Value, name: &str) -> Result<&'a str> {
        object.get(name).and_then(Value::as_str).ok_or_else(|| self.wrong(format!("{name} is no text")))
    }
}

fn read_file(file: &Path) -> Result<Vec<u8>> {
    fs::read(file).map_err(|error| Error::file(file, error))
}

/// Reads the folder of one dispatch. Its SPIR-V must be what was dumped, which its hash shows; the rest is trusted like
/// SPIR-V that is given to a [`super::Bench`].
///
/// # Errors
/// [`Error::File`] for a file that is missing, has other bytes than `dispatch.json` says, or is of another version.
pub fn read(folder: &Path) -> Result<Dispatch> {
    let about = Json::read(folder.join("dispatch.json"))?;
    let stem = about.text(&about.value, "stem")?;
    let known = SPIRV.iter().chain([&("functions", FUNCTIONS)]).find(|(known, _)| *known == stem);
    let (stem, _) = *known.ok_or_else(|| about.wrong(format!("stem: there is no kernel called `{stem}`")))?;

    let file = folder.join("kernel.spv");
    let spirv = read_file(&file)?;
    let (found, recorded) = (dump::hash(&spirv), about.text(&about.value, "spirvSha256")?);
    if found != recorded {
        return Err(Error::file(file, format!("its SHA-256 is {found}, but dispatch.json says {recorded}")));
    }

    let constants = Json::read(folder.join("specialization.json"))?;
    let pairs = constants.array("")?.iter();
    let pairs = pairs.map(|constant| Ok((constants.number(constant, "id")?, constants.number(constant, "value")?)));
    let pairs: Vec<(u32, u32)> = pairs.collect::<Result<_>>()?;
    let value = |id: u32| pairs.iter().find(|(known, _)| *known == id).map(|(_, value)| *value);
    let lacks = |id: u32| constants.wrong(format!("has no constant {id}"));
    let workgroup = value(0).ok_or_else(|| lacks(0))?;
    let features = Features::with(value).map_err(lacks)?;

    let step = bytes(folder, "push_constants.bin", size_of::<Step>())?;
    let step = bytemuck::pod_read_unaligned(&step);
    let (mut before, mut after) = (vec![], vec![]);
    for entry in about.array("slots")? {
        let name = about.text(entry, "name")?;
        let slot = Slot::ALL.iter().copied().find(|slot| slot.name() == name);
        let slot = slot.ok_or_else(|| about.wrong(format!("slots: there is none called `{name}`")))?;
        if about.number(entry, "binding")? != slot as u32 {
            return Err(about.wrong(format!("slots: {name} has the binding {} in this version", slot as u32)));
        }
        let size = about.number(entry, "bytes")? as usize;
        if size == 0 || !size.is_multiple_of(4) {
            return Err(about.wrong(format!("slots: {name} has {size} bytes, must have whole words")));
        }
        if before.iter().any(|(other, _)| *other == slot) {
            return Err(about.wrong(format!("slots: {name} is there twice")));
        }
        before.push((slot, bytes(folder, &format!("{name}.before.bin"), size)?));
        after.push((slot, bytes(folder, &format!("{name}.after.bin"), size)?));
    }
    Ok(Dispatch { stem, spirv, features, workgroup, step, before, after })
}

/// A file of so many bytes.
fn bytes(folder: &Path, name: &str, size: usize) -> Result<Vec<u8>> {
    let file = folder.join(name);
    let content = read_file(&file)?;
    match content.len() {
        length if length == size => Ok(content),
        length => Err(Error::file(file, format!("has {length} bytes, must have {size}"))),
    }
}

/// How a buffer differs from what was recorded, bit for bit.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    pub slot: Slot,
    /// Words compared.
    pub words: usize,
    /// Words that differ, by what they are as floats.
    pub census: Census,
    /// The first that differs: what the device gave, and what was recorded.
    pub first: Option<(u32, u32)>,
}

/// Compares the buffers that a dispatch left, each with what was recorded.
pub fn compare(found: &[(Slot, Vec<u8>)], recorded: &[(Slot, Vec<u8>)]) -> Vec<Difference> {
    let words = |data: &[u8]| bytemuck::pod_collect_to_vec::<u8, u32>(data);
    let difference = |((slot, found), (_, recorded)): (&(Slot, Vec<u8>), &(Slot, Vec<u8>))| {
        let (found, recorded) = (words(found), words(recorded));
        let mut difference = Difference { slot: *slot, words: found.len(), census: Census::default(), first: None };
        for (i, (&found, &recorded)) in found.iter().zip(&recorded).enumerate() {
            if found != recorded {
                difference.census.add(i, f32::from_bits(found), f32::from_bits(recorded));
                difference.first.get_or_insert((found, recorded));
            }
        }
        difference
    };
    found.iter().zip(recorded).map(difference).collect()
}

impl fmt::Display for Difference {
    /// One line.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Difference { slot, words, census, first } = self;
        let equal = words - census.total();
        write!(f, "{}: {words} words, {equal} equal, different {census}", slot.name())?;
        match first {
            Some((found, recorded)) => write!(f, ": {found:#010x}, recorded {recorded:#010x}"),
            None => Ok(()),
        }
    }
}
