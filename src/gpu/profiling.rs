//! What a profile asks of a device beyond timestamps, where the device has it: see
//! [`DeviceOptions::profiling`](super::DeviceOptions::profiling).

use super::{
    DeviceOptions,
    clock::Moment,
    counters::{self, Counter, Counters},
    device::Handles,
    instance::Instance,
};
use crate::Result;
use ash::{
    ext::calibrated_timestamps,
    khr::{performance_query, pipeline_executable_properties},
    vk,
};
use std::{ffi::CStr, time::Instant};

/// How often the clocks are compared at a time; the comparison that took least counts.
const COMPARISONS: u32 = 4;

/// Which of the extensions that are asked for a physical device has.
#[derive(Clone, Debug, Default)]
pub(super) struct Available {
    calibrated: bool,
    executables: bool,
    counters: Vec<Counter>,
}

/// The features that they need.
#[derive(Default)]
pub(super) struct Features {
    executables: vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR<'static>,
    counters: vk::PhysicalDevicePerformanceQueryFeaturesKHR<'static>,
}

impl Available {
    /// What there is of what `options` ask for on a physical device of `instance`.
    pub fn of(instance: &Instance, physical: vk::PhysicalDevice, family: u32, options: &DeviceOptions) -> Available {
        if !options.profiling && !options.counters {
            return Available::default();
        }
        // SAFETY: the device belongs to this instance; so for the other calls.
        let extensions = unsafe { instance.raw.enumerate_device_extension_properties(physical) }.unwrap_or_default();
        let named = |name| extensions.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name));
        let ticks = || {
            let functions = calibrated_timestamps::Instance::new(&instance.entry, &instance.raw);
            // SAFETY: the device has the extension.
            let domains = unsafe { functions.get_physical_device_calibrateable_time_domains(physical) };
            domains.unwrap_or_default().contains(&vk::TimeDomainEXT::DEVICE)
        };
        let info = || {
            let mut executables = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default();
            let mut chain = vk::PhysicalDeviceFeatures2::default().push_next(&mut executables);
            // SAFETY: the device has the extension, and speaks Vulkan 1.3.
            unsafe { instance.raw.get_physical_device_features2(physical, &mut chain) };
            executables.pipeline_executable_info != vk::FALSE
        };
        Available {
            calibrated: options.profiling && named(calibrated_timestamps::NAME) && ticks(),
            executables: options.profiling && named(pipeline_executable_properties::NAME) && info(),
            counters: match options.counters && named(performance_query::NAME) {
                true => counters::choose(instance, physical, family),
                false => vec![],
            },
        }
    }

    /// The names to enable.
    pub fn names(&self) -> Vec<&'static CStr> {
        let extensions = [
            (self.calibrated, calibrated_timestamps::NAME),
            (self.executables, pipeline_executable_properties::NAME),
            (self.counters(), performance_query::NAME),
        ];
        extensions.into_iter().filter_map(|(there, name)| there.then_some(name)).collect()
    }

    /// `create` with the features to enable chained to it, but for hostQueryReset of Vulkan 1.2, which counters need.
    pub fn chain<'a>(
        &self,
        mut create: vk::DeviceCreateInfo<'a>,
        features: &'a mut Features,
    ) -> vk::DeviceCreateInfo<'a> {
        features.executables.pipeline_executable_info = vk::TRUE;
        features.counters.performance_counter_query_pools = vk::TRUE;
        if self.executables {
            create = create.push_next(&mut features.executables);
        }
        if self.counters() {
            create = create.push_next(&mut features.counters);
        }
        create
    }

    /// Whether there is anything to count.
    pub fn counters(&self) -> bool {
        !self.counters.is_empty()
    }
}

/// The functions of those that are enabled.
#[derive(Default)]
pub(super) struct Profiling {
    calibrated: Option<calibrated_timestamps::Device>,
    pub executables: Option<pipeline_executable_properties::Device>,
    pub counters: Option<Counters>,
}

impl Profiling {
    pub fn new(available: Available, instance: &ash::Instance, device: &ash::Device) -> Result<Profiling> {
        Ok(Profiling {
            counters: match available.counters() {
                true => Some(Counters::acquire(available.counters, instance, device)?),
                false => None,
            },
            calibrated: available.calibrated.then(|| calibrated_timestamps::Device::new(instance, device)),
            executables: available.executables.then(|| pipeline_executable_properties::Device::new(instance, device)),
        })
    }
}

impl Handles {
    /// A moment on the device's clock and on the host's, in nanoseconds since `epoch`; none where the device cannot
    /// tell.
    ///
    /// The device's clock is read between two readings of the host's, so no knowledge is needed of which of the
    /// system's clocks `Instant` is; they are a microsecond or less apart.
    pub fn moment(&self, epoch: Instant) -> Option<Moment> {
        let functions = self.profiling.calibrated.as_ref()?;
        let domains = [vk::CalibratedTimestampInfoEXT::default().time_domain(vk::TimeDomainEXT::DEVICE)];
        let compare = |_| {
            let before = nanoseconds(epoch);
            // SAFETY: the extension is enabled, and the device has this time domain.
            let (ticks, deviation) = unsafe { functions.get_calibrated_timestamps(&domains) }.ok()?;
            let after = nanoseconds(epoch);
            let deviation = (after - before) / 2.0 + deviation as f64;
            Some(Moment { ticks: ticks[0], host: (before + after) / 2.0, deviation })
        };
        (0..COMPARISONS).filter_map(compare).min_by(|a, b| a.deviation.total_cmp(&b.deviation))
    }
}

/// Since `epoch`.
pub(super) fn nanoseconds(epoch: Instant) -> f64 {
    epoch.elapsed().as_nanos() as f64
}
