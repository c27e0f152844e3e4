//! Hardware counters for each dispatch: VK_KHR_performance_query. Written by the specification; no device has run it
//! yet.

use super::{During, device::Handles, executables::text, instance::Instance};
use crate::Result;
use ash::{khr::performance_query, vk};

/// Dispatches whose counters one query pool holds.
const COUNTED: u32 = 1024;

/// Longest wait for other profilers (ns).
const PATIENCE: u64 = 1_000_000_000;

/// Something that a device counts while it runs a kernel.
#[derive(Clone, Debug, PartialEq)]
pub struct Counter {
    pub name: String,
    pub category: String,
    /// In the driver's words.
    pub description: String,
    /// Of one dispatch: empty for a mere number.
    pub unit: &'static str,
    index: u32,
    storage: vk::PerformanceCounterStorageKHR,
}

/// The counters of an open device, and its profiling lock.
pub(super) struct Counters {
    pub list: Vec<Counter>,
    functions: performance_query::Device,
}

impl Counters {
    /// Waits for the lock that recordings with counters need; [`Counters::release`] gives it back.
    pub fn acquire(list: Vec<Counter>, instance: &ash::Instance, device: &ash::Device) -> Result<Counters> {
        let functions = performance_query::Device::new(instance, device);
        let info = vk::AcquireProfilingLockInfoKHR::default().timeout(PATIENCE);
        // SAFETY: the extension is enabled.
        unsafe { functions.acquire_profiling_lock(&info) }.during("acquire the profiling lock")?;
        Ok(Counters { list, functions })
    }

    /// Before the device is destroyed.
    pub fn release(&self) {
        // SAFETY: the lock is held, and no recording that needs it runs any more.
        unsafe { self.functions.release_profiling_lock() };
    }
}

/// The counters of single commands that `family` can count together in one pass, in the driver's order: nothing is
/// executed twice. Empty if there are none.
pub(super) fn choose(instance: &Instance, physical: vk::PhysicalDevice, family: u32) -> Vec<Counter> {
    let mut counting = vk::PhysicalDevicePerformanceQueryFeaturesKHR::default();
    let mut features12 = vk::PhysicalDeviceVulkan12Features::default();
    let mut chain = vk::PhysicalDeviceFeatures2::default().push_next(&mut counting).push_next(&mut features12);
    // SAFETY: the device is this instance's, has the extension, and speaks Vulkan 1.3.
    unsafe { instance.raw.get_physical_device_features2(physical, &mut chain) };
    if counting.performance_counter_query_pools == vk::FALSE || features12.host_query_reset == vk::FALSE {
        return vec![];
    }
    let functions = performance_query::Instance::new(&instance.entry, &instance.raw);
    // SAFETY: as above; so for the two calls below.
    let count = unsafe {
        functions.enumerate_physical_device_queue_family_performance_query_counters_len(physical, family).unwrap_or(0)
    };
    let mut counters = vec![vk::PerformanceCounterKHR::default(); count];
    let mut words = vec![vk::PerformanceCounterDescriptionKHR::default(); count];
    // SAFETY: as above.
    let listed = unsafe {
        functions.enumerate_physical_device_queue_family_performance_query_counters(
            physical,
            family,
            &mut counters,
            &mut words,
        )
    };
    if listed.is_err() {
        return vec![];
    }
    let mut chosen: Vec<Counter> = vec![];
    let mut indices: Vec<u32> = vec![];
    for (index, (counter, words)) in (0..).zip(counters.iter().zip(&words)) {
        if counter.scope != vk::PerformanceCounterScopeKHR::COMMAND {
            continue;
        }
        indices.push(index);
        let create =
            vk::QueryPoolPerformanceCreateInfoKHR::default().queue_family_index(family).counter_indices(&indices);
        // SAFETY: as above.
        let passes = unsafe { functions.get_physical_device_queue_family_performance_query_passes(physical, &create) };
        if passes != 1 {
            indices.pop();
            continue;
        }
        chosen.push(Counter {
            name: text(words.name_as_c_str()),
            category: text(words.category_as_c_str()),
            description: text(words.description_as_c_str()),
            unit: unit(counter.unit),
            index,
            storage: counter.storage,
        });
    }
    chosen
}

fn unit(unit: vk::PerformanceCounterUnitKHR) -> &'static str {
    use vk::PerformanceCounterUnitKHR as Unit;
    match unit {
        Unit::PERCENTAGE => "%",
        Unit::NANOSECONDS => "ns",
        Unit::BYTES => "bytes",
        Unit::BYTES_PER_SECOND => "bytes/s",
        Unit::KELVIN => "K",
        Unit::WATTS => "W",
        Unit::VOLTS => "V",
        Unit::AMPS => "A",
        Unit::HERTZ => "Hz",
        Unit::CYCLES => "cycles",
        _ => "",
    }
}

/// The queries of one recorder.
#[derive(Default)]
pub(super) struct Queries {
    pools: Vec<vk::QueryPool>,
}

impl Queries {
    /// Pool and query for the dispatch of that number in the recording, none where nothing is counted. No recording may
    /// be running.
    pub fn query(&mut self, handles: &Handles, number: usize) -> Result<Option<(vk::QueryPool, u32)>> {
        let Some(counters) = &handles.profiling.counters else { return Ok(None) };
        let (index, query) = (number / COUNTED as usize, number as u32 % COUNTED);
        if index == self.pools.len() {
            let indices: Vec<u32> = counters.list.iter().map(|counter| counter.index).collect();
            let mut of = vk::QueryPoolPerformanceCreateInfoKHR::default()
                .queue_family_index(handles.family)
                .counter_indices(&indices);
            let create = vk::QueryPoolCreateInfo::default()
                .query_type(vk::QueryType::PERFORMANCE_QUERY_KHR)
                .query_count(COUNTED)
                .push_next(&mut of);
            // SAFETY: the features are enabled, and the counters are the family's.
            let pool = unsafe { handles.device.create_query_pool(&create, None) }.during("create the counters")?;
            self.pools.push(pool);
        }
        let pool = self.pools[index];
        if query == 0 {
            // SAFETY: hostQueryReset is enabled; no recording that uses the pool is running. A command could not reset
            // it: the same command buffer begins its queries.
            unsafe { handles.device.reset_query_pool(pool, 0, COUNTED) };
        }
        Ok(Some((pool, query)))
    }

    /// The counters of `count` dispatches, all of one before those of the next.
    pub fn read(&self, handles: &Handles, count: usize) -> Result<Vec<f64>> {
        let Some(counters) = &handles.profiling.counters else { return Ok(vec![]) };
        let width = counters.list.len();
        let mut results = vec![vk::PerformanceCounterResultKHR::default(); width * count];
        for (pool, results) in self.pools.iter().zip(results.chunks_mut(width * COUNTED as usize)) {
            // Vulkan counts queries, of which each has `width` results. Neither of the flags 64 and PARTIAL is allowed.
            // SAFETY: the recording has run, so that many queries were written; the slice has room for them.
            unsafe {
                (handles.device.fp_v1_0().get_query_pool_results)(
                    handles.device.handle(),
                    *pool,
                    0,
                    (results.len() / width) as u32,
                    size_of_val(results),
                    results.as_mut_ptr().cast(),
                    (width * size_of::<vk::PerformanceCounterResultKHR>()) as u64,
                    vk::QueryResultFlags::WAIT,
                )
                .result()
                .during("read the counters")?;
            }
        }
        let counters = counters.list.iter().cycle();
        Ok(results.iter().zip(counters).map(|(result, counter)| number(result, counter.storage)).collect())
    }

    /// No recording that uses them may be running.
    pub fn destroy(&self, device: &ash::Device) {
        for pool in &self.pools {
            // SAFETY: as the caller promises.
            unsafe { device.destroy_query_pool(*pool, None) };
        }
    }
}

fn number(result: &vk::PerformanceCounterResultKHR, storage: vk::PerformanceCounterStorageKHR) -> f64 {
    use vk::PerformanceCounterStorageKHR as Storage;
    // SAFETY: the storage says which member the driver wrote, and every bit pattern is a number.
    unsafe {
        match storage {
            Storage::INT32 => f64::from(result.int32),
            Storage::INT64 => result.int64 as f64,
            Storage::UINT32 => f64::from(result.uint32),
            Storage::UINT64 => result.uint64 as f64,
            Storage::FLOAT32 => f64::from(result.float32),
            _ => result.float64,
        }
    }
}
