//! Records dispatches, fills and copies in order, each finished before the next, submits them and waits.

use super::{
    During,
    buffer::Buffer,
    clock::Clock,
    commands::{Commands, Extent, Timestamps},
    counters::Queries,
    device::{Device, Handles},
    kernel::{Bindings, Kernel},
    profiling::nanoseconds,
};
use crate::{Error, Result, shared::Step};
use ash::vk;
use std::{any::Any, sync::Arc, time::Instant};

/// Dispatches whose times one query pool holds; a recording of more gets another.
const TIMED: u32 = 1024;

/// One command buffer, used again and again: `begin`, commands, `submit_and_wait`.
pub struct Recorder {
    commands: Commands,
    pool: vk::CommandPool,
    fence: vk::Fence,
    profile: Option<Profile>,
    // What the recording uses, until the next begins.
    held: Vec<Arc<dyn Any + Send + Sync>>,
    recording: bool,
}

struct Profile {
    clock: Clock,
    pools: Vec<vk::QueryPool>,
    counters: Queries,
    // What was dispatched since `begin`, and why the times of the rest have no place.
    dispatched: Vec<(&'static str, Step)>,
    failure: Option<Error>,
    timing: Timing,
}

/// When a recording ran.
#[derive(Clone, Debug, PartialEq)]
pub struct Timing {
    pub submitted: Instant,
    /// Nanoseconds from there until the host saw its end.
    pub ended: f64,
    /// Nanoseconds by which the dispatches may be early or late as a whole; their durations are not affected.
    pub deviation: f64,
    /// Each dispatch in order; none on a device without timestamps.
    pub scopes: Vec<Scope>,
    /// What [`Device::counters`] names, for each of the scopes one after the other.
    pub counters: Vec<f64>,
}

/// When a dispatch ran: nanoseconds since [`Timing::submitted`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scope {
    /// [`Kernel::stem`].
    pub kernel: &'static str,
    pub step: Step,
    pub begin: f64,
    pub end: f64,
}

impl Timing {
    fn new(submitted: Instant, ended: f64) -> Timing {
        Timing { submitted, ended, deviation: 0.0, scopes: Vec::new(), counters: Vec::new() }
    }
}

impl Recorder {
    /// A recorder on `device`.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`]; [`crate::Error::Device`] for a caller's device without a queue.
    pub fn new(device: &Device) -> Result<Recorder> {
        Recorder::with_handles(&device.handles, false)
    }

    /// A recorder that also times each dispatch; see [`Recorder::timing`].
    ///
    /// # Errors
    /// As [`Recorder::new`].
    pub fn profiled(device: &Device) -> Result<Recorder> {
        Recorder::with_handles(&device.handles, true)
    }

    pub(super) fn with_handles(handles: &Arc<Handles>, profiled: bool) -> Result<Recorder> {
        drop(handles.queue()?);
        let mut recorder = Recorder {
            commands: Commands { handles: handles.clone(), raw: vk::CommandBuffer::null() },
            pool: vk::CommandPool::null(),
            fence: vk::Fence::null(),
            profile: None,
            held: Vec::new(),
            recording: false,
        };
        let device = &handles.device;
        let create = vk::CommandPoolCreateInfo::default().queue_family_index(handles.family);
        // SAFETY: the device is alive and pointers outlive the calls; dropping the recorder
        // destroys what was made so far, null handles are ignored.
        unsafe {
            recorder.pool = device.create_command_pool(&create, None).during("create the command pool")?;
            let allocate = vk::CommandBufferAllocateInfo::default().command_pool(recorder.pool).command_buffer_count(1);
            recorder.commands.raw =
                device.allocate_command_buffers(&allocate).during("allocate the command buffer")?[0];
            recorder.fence = device.create_fence(&vk::FenceCreateInfo::default(), None).during("create the fence")?;
        }
        if profiled {
            recorder.profile = Some(Profile::new(handles));
        }
        handles.name(recorder.commands.raw, "recording");
        Ok(recorder)
    }

    /// Starts a recording; one that was not submitted is thrown away.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`].
    pub fn begin(&mut self) -> Result<()> {
        self.held.clear();
        self.recording = false;
        let device = &self.commands.handles.device;
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the command buffer is not in use: every submission was waited for.
        unsafe {
            device.reset_command_pool(self.pool, vk::CommandPoolResetFlags::empty()).during("reset the recording")?;
            device.begin_command_buffer(self.commands.raw, &begin).during("begin the recording")?;
        }
        self.recording = true;
        if let Some(profile) = &mut self.profile {
            profile.dispatched.clear();
            profile.failure = None;
        }
        // Buffers persist, so what earlier recordings wrote must be seen here.
        self.commands.barrier();
        Ok(())
    }

    /// Runs `kernel`; see [`Commands::dispatch`].
    ///
    /// # Panics
    /// Outside a recording, or with objects of another device.
    pub fn dispatch(&mut self, kernel: &Kernel, bindings: &Bindings, invocations: u32, step: &Step) {
        self.dispatch_extent(kernel, bindings, Extent::Invocations(invocations), step);
    }

    /// As [`Recorder::dispatch`], of any extent.
    ///
    /// # Panics
    /// Outside a recording, or as [`Commands::dispatch`].
    pub fn dispatch_extent(&mut self, kernel: &Kernel, bindings: &Bindings, extent: Extent, step: &Step) {
        self.check();
        match extent {
            Extent::Invocations(0) => return,
            Extent::Invocations(_) => (),
            Extent::Indirect(buffer, _) => self.hold(&buffer.memory),
        }
        self.hold(&kernel.objects);
        self.hold(&bindings.objects);
        let queries = self.profile.as_mut().and_then(|profile| profile.next(&self.commands, kernel, step));
        let (times, counters) = queries.map_or((None, None), |(times, counters)| (Some(times), counters));
        let (device, raw) = (&self.commands.handles.device, self.commands.raw);
        if let Some((pool, query)) = counters {
            // SAFETY: the recording is open; the profiling lock is held since before it began, and the query was reset.
            unsafe { device.cmd_begin_query(raw, pool, query, vk::QueryControlFlags::empty()) };
        }
        self.commands.dispatch(kernel, bindings, extent, step, times);
        if let Some((pool, query)) = counters {
            // SAFETY: the query was begun just above.
            unsafe { device.cmd_end_query(raw, pool, query) };
        }
    }

    /// Sets every whole word of `buffer` to `word`.
    ///
    /// # Panics
    /// Outside a recording, or with a buffer of another device.
    pub fn fill(&mut self, buffer: &Buffer, word: u32) {
        self.check();
        self.hold(&buffer.memory);
        self.commands.fill(buffer, word);
    }

    /// Writes `words` into `buffer`, `offset` bytes from its start.
    ///
    /// # Panics
    /// Outside a recording, or as [`Commands::update`].
    pub fn update(&mut self, buffer: &Buffer, offset: u64, words: &[u32]) {
        self.check();
        self.hold(&buffer.memory);
        self.commands.update(buffer, offset, words);
    }

    /// Copies the first `bytes` of `source` to the start of `target`, another buffer.
    ///
    /// # Panics
    /// Outside a recording, beyond either buffer's end, or with buffers of another device.
    pub fn copy(&mut self, source: &Buffer, target: &Buffer, bytes: u64) {
        self.copy_at(source, 0, target, 0, bytes);
    }

    pub(super) fn copy_at(&mut self, source: &Buffer, from: u64, target: &Buffer, to: u64, bytes: u64) {
        self.check();
        if bytes == 0 {
            return;
        }
        self.hold(&source.memory);
        self.hold(&target.memory);
        self.commands.copy(source, from, target, to, bytes);
    }

    /// Submits what was recorded and waits until the host can read all of it.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`], a lost device among them.
    ///
    /// # Panics
    /// Outside a recording.
    pub fn submit_and_wait(&mut self) -> Result<()> {
        self.check();
        self.recording = false;
        if let Some(error) = self.profile.as_mut().and_then(|profile| profile.failure.take()) {
            return Err(error);
        }
        let handles = &self.commands.handles;
        let device = &handles.device;
        self.commands.host_barrier();
        let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(self.commands.raw)];
        let mut pass = vk::PerformanceQuerySubmitInfoKHR::default();
        let mut submit = vk::SubmitInfo2::default().command_buffer_infos(&commands);
        if self.profile.is_some() && handles.profiling.counters.is_some() {
            submit = submit.push_next(&mut pass);
        }
        let submit = [submit];
        let submitted = Instant::now();
        // SAFETY: the recording is open and complete, what it uses is held; the queue is ours while locked.
        unsafe {
            device.end_command_buffer(self.commands.raw).during("end the recording")?;
            device.reset_fences(&[self.fence]).during("reset the fence")?;
            device.queue_submit2(*handles.queue()?, &submit, self.fence).during("submit the recording")?;
            let waited = device.wait_for_fences(&[self.fence], true, u64::MAX).during("wait for the recording");
            if waited.is_err() {
                // What it uses may be dropped from here on. Of a lost device nothing runs any more.
                let _ = device.queue_wait_idle(*handles.queue()?);
            }
            waited?;
        }
        self.profile.as_mut().map_or(Ok(()), |profile| profile.read(handles, submitted))
    }

    /// When the last recording ran, and each of its dispatches; none without [`Recorder::profiled`].
    ///
    /// On a device that was opened with [`DeviceOptions::profiling`](super::DeviceOptions::profiling) and has
    /// VK_EXT_calibrated_timestamps, dispatches are where the device's clock says; elsewhere in the middle of where
    /// they can be between submission and end.
    pub fn timing(&self) -> Option<&Timing> {
        self.profile.as_ref().map(|profile| &profile.timing)
    }

    fn check(&self) {
        assert!(self.recording, "commands come between begin and submit_and_wait");
    }

    /// Keeps an object alive until the recording has run.
    fn hold<T: Any + Send + Sync>(&mut self, object: &Arc<T>) {
        let address = Arc::as_ptr(object).cast::<()>();
        if !self.held.iter().rev().any(|held| Arc::as_ptr(held).cast::<()>() == address) {
            self.held.push(object.clone());
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        let device = &self.commands.handles.device;
        // SAFETY: nothing of it runs any more: every submission was waited for. Null handles are ignored.
        unsafe {
            for pool in self.profile.iter().flat_map(|profile| &profile.pools) {
                device.destroy_query_pool(*pool, None);
            }
            self.profile.iter().for_each(|profile| profile.counters.destroy(device));
            device.destroy_fence(self.fence, None);
            device.destroy_command_pool(self.pool, None);
        }
    }
}

impl Profile {
    fn new(handles: &Handles) -> Profile {
        let period = f64::from(handles.limits.timestamp_period);
        Profile {
            clock: Clock { period, bits: handles.timestamp_bits },
            pools: Vec::new(),
            counters: Queries::default(),
            dispatched: Vec::new(),
            failure: None,
            timing: Timing::new(Instant::now(), 0.0),
        }
    }

    /// Where the times of the next dispatch go, and what is counted of it. That there is no place is told when the
    /// recording is submitted.
    fn next(
        &mut self,
        commands: &Commands,
        kernel: &Kernel,
        step: &Step,
    ) -> Option<(Timestamps, Option<(vk::QueryPool, u32)>)> {
        if self.clock.bits == 0 || self.failure.is_some() {
            return None;
        }
        match self.places(commands) {
            Ok(places) => {
                self.dispatched.push((kernel.objects.stem, *step));
                Some(places)
            }
            Err(error) => {
                self.failure = Some(error);
                None
            }
        }
    }

    fn places(&mut self, commands: &Commands) -> Result<(Timestamps, Option<(vk::QueryPool, u32)>)> {
        let counters = self.counters.query(&commands.handles, self.dispatched.len())?;
        let (index, first) = (self.dispatched.len() / TIMED as usize, self.dispatched.len() as u32 % TIMED);
        if index == self.pools.len() {
            let create = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(2 * TIMED);
            // SAFETY: the device is alive; dropping the recorder destroys the pool.
            let pool = unsafe { commands.handles.device.create_query_pool(&create, None) };
            self.pools.push(pool.during("create the timestamps")?);
        }
        let pool = self.pools[index];
        if first == 0 {
            commands.reset_queries(Timestamps { pool, first: 0 }, 2 * TIMED);
        }
        Ok((Timestamps { pool, first: 2 * first }, counters))
    }

    /// Fetches the times of a recording that has just ended.
    fn read(&mut self, handles: &Handles, submitted: Instant) -> Result<()> {
        let ended = nanoseconds(submitted);
        self.timing = Timing::new(submitted, ended);
        let mut ticks = vec![0u64; 2 * self.dispatched.len()];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        for (pool, ticks) in self.pools.iter().zip(ticks.chunks_mut(2 * TIMED as usize)) {
            // SAFETY: the recording has run, so that many queries were written.
            unsafe { handles.device.get_query_pool_results(*pool, 0, ticks, flags) }.during("read the timestamps")?;
        }
        let (Some(&first), Some(&last)) = (ticks.first(), ticks.last()) else { return Ok(()) };
        let clock = self.clock;
        let anchor = clock.place([first, last], [0.0, ended], handles.moment(submitted));
        self.timing.deviation = anchor.deviation;
        let pairs = self.dispatched.iter().zip(ticks.chunks_exact(2));
        self.timing.scopes.extend(pairs.map(|(&(kernel, step), pair)| {
            let [begin, end] = [pair[0], pair[1]].map(|ticks| clock.host(anchor, ticks));
            Scope { kernel, step, begin, end }
        }));
        self.timing.counters = self.counters.read(handles, self.dispatched.len())?;
        Ok(())
    }
}
