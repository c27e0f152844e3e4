//! What the driver tells of a compiled kernel: VK_KHR_pipeline_executable_properties.

use super::{During, Kernel};
use crate::Result;
use ash::vk;
use std::ffi::CStr;

/// What a driver made of a kernel; most make one of each.
#[derive(Clone, Debug, PartialEq)]
pub struct Executable {
    pub name: String,
    /// In the driver's words.
    pub description: String,
    /// Lanes of a subgroup.
    pub subgroup: u32,
    /// Registers, spills, occupancy: whatever the driver counts.
    pub statistics: Vec<Statistic>,
}

/// A number about an executable.
#[derive(Clone, Debug, PartialEq)]
pub struct Statistic {
    pub name: String,
    /// In the driver's words.
    pub description: String,
    /// 0 or 1 for a flag. Counts are exact up to 2^53.
    pub value: f64,
}

impl Kernel {
    /// What the driver tells about it; nothing on a device that was opened without
    /// [`DeviceOptions::profiling`](super::DeviceOptions::profiling) or lacks the extension.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`].
    pub fn executables(&self) -> Result<Vec<Executable>> {
        let Some(functions) = &self.objects.layout.objects.handles.profiling.executables else { return Ok(vec![]) };
        let step = format!("ask about kernel `{}`", self.stem());
        let pipeline = self.objects.pipeline;
        let info = vk::PipelineInfoKHR::default().pipeline(pipeline);
        // SAFETY: the feature is enabled and the pipeline alive.
        let found = unsafe { functions.get_pipeline_executable_properties(&info) }.during(&step)?;
        let executable = |(index, found): (usize, &vk::PipelineExecutablePropertiesKHR)| {
            let info = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline).executable_index(index as u32);
            // SAFETY: as above; the pipeline was made with the flag CAPTURE_STATISTICS and has this executable.
            let statistics = unsafe { functions.get_pipeline_executable_statistics(&info) }.during(&step)?;
            Ok(Executable {
                name: text(found.name_as_c_str()),
                description: text(found.description_as_c_str()),
                subgroup: found.subgroup_size,
                statistics: statistics.iter().map(statistic).collect(),
            })
        };
        found.iter().enumerate().map(executable).collect()
    }
}

fn statistic(found: &vk::PipelineExecutableStatisticKHR) -> Statistic {
    use vk::PipelineExecutableStatisticFormatKHR as Format;
    // SAFETY: the format says which member the driver wrote.
    let value = unsafe {
        match found.format {
            Format::BOOL32 => f64::from(u8::from(found.value.b32 != vk::FALSE)),
            Format::INT64 => found.value.i64 as f64,
            Format::UINT64 => found.value.u64 as f64,
            Format::FLOAT64 => found.value.f64,
            _ => f64::NAN,
        }
    };
    Statistic { name: text(found.name_as_c_str()), description: text(found.description_as_c_str()), value }
}

/// A driver's text, empty where it is none.
pub(super) fn text<E>(text: std::result::Result<&CStr, E>) -> String {
    text.map_or(String::new(), |text| text.to_string_lossy().into_owned())
}
