//! Dispatches written to files, for a driver's developer: all that was given to the device, what it made of it, and a
//! script that does it again.

use super::{Bound, Dispatch, Verdict, amber, generator, protocol::Outcome};
use crate::{
    error::{Error, Result},
    gpu::Device,
    image::write_whole,
    shared::Slot,
};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::{env, fs, path::Path};

/// Environment variables that change what a driver does start so.
const DRIVERS: [&str; 8] = ["LP_", "GALLIVM_", "MESA_", "LIBGL_", "RADV_", "ANV_", "INTEL_", "VK_"];

impl Dispatch {
    /// (id, value) of every specialization constant, with number 0, the workgroup.
    pub fn constants(&self) -> Vec<(u32, u32)> {
        [(0, self.workgroup)].into_iter().chain(self.features.constants()).collect()
    }

    /// The buffers that hold something else afterwards.
    pub fn written(&self) -> impl Iterator<Item = (Slot, &[u8])> {
        let pairs = self.before.iter().zip(&self.after);
        pairs.filter(|(before, after)| before != after).map(|(_, (slot, after))| (*slot, after.as_slice()))
    }
}

/// Hex SHA-256.
pub(super) fn hash(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Writes every dispatch of a test to `folder`/test/number-stem/:
/// - `kernel.spv`, `push_constants.bin`, and of each buffer `<slot>.before.bin` and `<slot>.after.bin`;
/// - `specialization.json`, `dispatch.json` and `device.json`;
/// - `case.amber`, which runs the same in Amber.
///
/// Numbers count from 000. [`super::replay`] reads such a folder.
///
/// # Errors
/// [`Error::File`], [`Error::Setting`] if a file cannot be written.
pub fn write(folder: &Path, device: &Device, outcome: &Outcome, dispatches: &[Dispatch]) -> Result<()> {
    if dispatches.is_empty() {
        log::warn!("{}: nothing to dump: its dispatches are a renderer's, or it had none", outcome.name);
        return Ok(());
    }
    for (number, dispatch) in dispatches.iter().enumerate() {
        let folder = folder.join(outcome.name).join(format!("{number:03}-{}", dispatch.stem));
        fs::create_dir_all(&folder).map_err(|error| Error::file(&folder, error))?;
        write_one(&folder, device, outcome, dispatch)?;
    }
    log::info!("{}: {} dispatches in {}", outcome.name, dispatches.len(), folder.join(outcome.name).display());
    Ok(())
}

fn write_one(folder: &Path, device: &Device, outcome: &Outcome, dispatch: &Dispatch) -> Result<()> {
    let file = |name: &str, content: &[u8]| write_whole(folder.join(name), content);
    let json = |name: &str, value: &Value| file(name, format!("{value:#}\n").as_bytes());
    file("kernel.spv", &dispatch.spirv)?;
    file("push_constants.bin", bytemuck::bytes_of(&dispatch.step))?;
    for (when, buffers) in [("before", &dispatch.before), ("after", &dispatch.after)] {
        buffers.iter().try_for_each(|(slot, data)| file(&format!("{}.{when}.bin", slot.name()), data))?;
    }

    let workgroup = json!({ "id": 0, "name": "gl_WorkGroupSize.x", "value": dispatch.workgroup });
    let named = dispatch.features.named().into_iter();
    let named = named.map(|constant| json!({ "id": constant.id, "name": constant.name, "value": constant.value }));
    json("specialization.json", &[workgroup].into_iter().chain(named).collect())?;

    let groups = device.groups(dispatch.step.pixel_count, dispatch.workgroup);
    let written: Vec<Slot> = dispatch.written().map(|(slot, _)| slot).collect();
    let slots = dispatch.before.iter().map(|(slot, data)| {
        json!({
            "name": slot.name(), "binding": *slot as u32, "bytes": data.len(), "stride": slot.stride(),
            "written": written.contains(slot), "about": slot.about(),
        })
    });
    let sha256 = hash(&dispatch.spirv);
    let about = json!({
        "test": outcome.name,
        "status": outcome.status.name(),
        "verdict": outcome.message,
        "stem": dispatch.stem,
        "entryPoint": "main",
        "workgroup": dispatch.workgroup,
        "groups": [groups[0], groups[1], 1],
        "invocations": dispatch.step.pixel_count,
        "slots": slots.collect::<Value>(),
        "spirvSha256": sha256,
        "compiler": generator(&dispatch.spirv),
        "version": env!("CARGO_PKG_VERSION"),
    });
    json("dispatch.json", &about)?;
    json("device.json", &describe(device))?;

    let bits = outcome.verdict.as_ref().is_some_and(|verdict| verdict.bound == Bound::Exact);
    let (info, status) = (device.info(), outcome.status.name());
    let meaning = match (bits, outcome.verdict.as_ref().is_some_and(Verdict::passed)) {
        (true, true) => "The test passed, and where it compares bits every sound device leaves the same.",
        (true, false) => {
            "The test asks for bits, and some are wrong, here or in its other dispatches. The expectations are what this \
             device\nleft: they hold where a device has the same fault."
        }
        (false, _) => {
            "The test does not ask for bits, and a sound device may leave others: the expectations, which are what this \
             device left,\nare comments."
        }
    };
    let comment = format!(
        "translucent {} verify, test {}, kernel `{}`: {status}\n{}\nRecorded on {}, {}, Vulkan {}.\n\
         SPIR-V: {}, SHA-256 {sha256}\n{meaning}\n\
         Buffers are scalar blocks, for which Amber's validator has no setting:\n\
         amber -v 1.3 -t vulkan1.3 --disable-spirv-val case.amber",
        env!("CARGO_PKG_VERSION"),
        outcome.name,
        dispatch.stem,
        outcome.message,
        info.name,
        info.driver,
        info.api_version,
        generator(&dispatch.spirv),
    );
    file("case.amber", amber::script(dispatch, groups, &comment, bits).as_bytes())
}

/// What a driver's developer asks of the machine.
fn describe(device: &Device) -> Value {
    let (info, limits) = (device.info(), device.limits());
    let variables = env::vars_os().filter_map(|(name, value)| Some((name.into_string().ok()?, value)));
    let variables = variables.filter(|(name, _)| DRIVERS.iter().any(|prefix| name.starts_with(prefix)));
    let text = |(name, value): (String, std::ffi::OsString)| (name, Value::from(value.to_string_lossy()));
    json!({
        "name": info.name,
        "driver": info.driver,
        "kind": info.kind.to_string(),
        "uuid": info.uuid,
        "apiVersion": info.api_version,
        "subgroupSize": device.subgroup_size(),
        "limits": {
            "maxComputeWorkGroupCount": limits.max_compute_work_group_count,
            "maxComputeWorkGroupInvocations": limits.max_compute_work_group_invocations,
            "maxComputeWorkGroupSize": limits.max_compute_work_group_size,
            "maxPerStageDescriptorStorageBuffers": limits.max_per_stage_descriptor_storage_buffers,
            "maxPushConstantsSize": limits.max_push_constants_size,
            "maxStorageBufferRange": limits.max_storage_buffer_range,
            "minStorageBufferOffsetAlignment": limits.min_storage_buffer_offset_alignment,
        },
        "maxBufferBytes": device.max_storage_buffer_range(),
        "threads": std::thread::available_parallelism().map_or(1, usize::from),
        "environment": variables.map(text).collect::<serde_json::Map<_, _>>(),
    })
}
