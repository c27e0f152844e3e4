//! Records dispatches, fills and copies in order, each finished before the next, submits them and waits.

use super::{
    During,
    buffer::Buffer,
    commands::{Commands, Timestamps},
    device::{Device, Handles},
    kernel::{Bindings, Kernel},
};
use crate::{Result, shared::Step};
use ash::vk;
use std::{any::Any, sync::Arc};

/// Dispatches of one recording that a profile times; later ones are not.
const TIMED: u32 = 2048;

/// One command buffer, used again and again: `begin`, commands, `submit_and_wait`.
pub struct Recorder {
    commands: Commands,
    pool: vk::CommandPool,
    fence: vk::Fence,
    profile: Option<Profile>,
    // What the recording uses, until the next begins.
    held: Vec<Arc<dyn Any + Send + Sync>>,
    recording: bool,
    // Submitted, and the wait failed.
    pending: bool,
}

struct Profile {
    queries: vk::QueryPool,
    names: Vec<&'static str>,
    seconds: Vec<f64>,
}

impl Recorder {
    /// A recorder on `device`.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`]; [`crate::Error::Device`] for a caller's device without a queue.
    pub fn new(device: &Device) -> Result<Recorder> {
        Recorder::with_handles(&device.handles, false)
    }

    /// A recorder that also times each dispatch; see [`Recorder::scopes`].
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
            pending: false,
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
            if profiled && handles.timestamp_bits > 0 {
                let create =
                    vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(2 * TIMED);
                let queries = device.create_query_pool(&create, None).during("create the timestamps")?;
                recorder.profile = Some(Profile { queries, names: Vec::new(), seconds: Vec::new() });
            }
        }
        handles.name(recorder.commands.raw, "recording");
        Ok(recorder)
    }

    /// Starts a recording; one that was not submitted is thrown away.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`].
    pub fn begin(&mut self) -> Result<()> {
        self.wait_if_pending();
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
            profile.names.clear();
            profile.seconds.clear();
            self.commands.reset_queries(Timestamps { pool: profile.queries, first: 0 }, 2 * TIMED);
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
        self.check();
        if invocations == 0 {
            return;
        }
        self.hold(&kernel.objects);
        self.hold(&bindings.objects);
        let times = self.profile.as_mut().filter(|profile| profile.names.len() < TIMED as usize).map(|profile| {
            profile.names.push(kernel.objects.stem);
            Timestamps { pool: profile.queries, first: 2 * (profile.names.len() as u32 - 1) }
        });
        self.commands.dispatch(kernel, bindings, invocations, step, times);
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
        let handles = &self.commands.handles;
        let device = &handles.device;
        self.commands.host_barrier();
        let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(self.commands.raw)];
        let submit = [vk::SubmitInfo2::default().command_buffer_infos(&commands)];
        // SAFETY: the recording is open and complete, what it uses is held; the queue is ours while locked.
        unsafe {
            device.end_command_buffer(self.commands.raw).during("end the recording")?;
            device.reset_fences(&[self.fence]).during("reset the fence")?;
            device.queue_submit2(*handles.queue()?, &submit, self.fence).during("submit the recording")?;
            self.pending = true;
            device.wait_for_fences(&[self.fence], true, u64::MAX).during("wait for the recording")?;
        }
        self.pending = false;
        self.read_profile()
    }

    /// Name and time (s) of each dispatch of the last recording, in order: the first 2,048, and none without
    /// [`Recorder::profiled`] or on a device without timestamps.
    pub fn scopes(&self) -> Vec<(&'static str, f64)> {
        self.profile.iter().flat_map(|p| p.names.iter().copied().zip(p.seconds.iter().copied())).collect()
    }

    fn read_profile(&mut self) -> Result<()> {
        let Some(profile) = self.profile.as_mut().filter(|profile| !profile.names.is_empty()) else { return Ok(()) };
        let mut ticks = vec![0u64; 2 * profile.names.len()];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the recording has run, so that many queries were written.
        unsafe { self.commands.handles.device.get_query_pool_results(profile.queries, 0, &mut ticks, flags) }
            .during("read the timestamps")?;
        let period = f64::from(self.commands.handles.limits.timestamp_period) * 1e-9;
        // The counter has this many bits and wraps.
        let mask = u64::MAX >> (64 - self.commands.handles.timestamp_bits.min(64));
        let pairs = ticks.chunks_exact(2);
        profile.seconds = pairs.map(|pair| (pair[1].wrapping_sub(pair[0]) & mask) as f64 * period).collect();
        Ok(())
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

    fn wait_if_pending(&mut self) {
        if self.pending {
            if let Ok(queue) = self.commands.handles.queue() {
                // SAFETY: the device is alive and its queue locked. If it is lost, nothing runs any more.
                let _ = unsafe { self.commands.handles.device.queue_wait_idle(*queue) };
            }
            self.pending = false;
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.wait_if_pending();
        let device = &self.commands.handles.device;
        // SAFETY: nothing of it runs any more; null handles are ignored.
        unsafe {
            if let Some(profile) = &self.profile {
                device.destroy_query_pool(profile.queries, None);
            }
            device.destroy_fence(self.fence, None);
            device.destroy_command_pool(self.pool, None);
        }
    }
}
