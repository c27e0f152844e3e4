//! Records dispatches, fills and copies in order, each finished before the next, submits them and waits.

use super::{
    During,
    buffer::Buffer,
    device::{Device, Handles, lock},
    kernel::{Bindings, Kernel},
};
use crate::{Result, shared::Step};
use ash::vk;
use std::{any::Any, sync::Arc};

/// Dispatches of one recording that a profile times; later ones are not.
const TIMED: u32 = 2048;

/// One command buffer, used again and again: `begin`, commands, `submit_and_wait`.
pub struct Recorder {
    handles: Arc<Handles>,
    pool: vk::CommandPool,
    commands: vk::CommandBuffer,
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
    /// [`crate::Error::Vulkan`].
    pub fn new(device: &Device) -> Result<Recorder> {
        Recorder::with_handles(&device.handles, false)
    }

    /// A recorder that also times each dispatch; see [`Recorder::scopes`].
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`].
    pub fn profiled(device: &Device) -> Result<Recorder> {
        Recorder::with_handles(&device.handles, true)
    }

    pub(super) fn with_handles(handles: &Arc<Handles>, profiled: bool) -> Result<Recorder> {
        let mut recorder = Recorder {
            handles: handles.clone(),
            pool: vk::CommandPool::null(),
            commands: vk::CommandBuffer::null(),
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
            recorder.commands = device.allocate_command_buffers(&allocate).during("allocate the command buffer")?[0];
            recorder.fence = device.create_fence(&vk::FenceCreateInfo::default(), None).during("create the fence")?;
            if profiled && handles.timestamp_bits > 0 {
                let create =
                    vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(2 * TIMED);
                let queries = device.create_query_pool(&create, None).during("create the timestamps")?;
                recorder.profile = Some(Profile { queries, names: Vec::new(), seconds: Vec::new() });
            }
        }
        handles.name(recorder.commands, "recording");
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
        let device = &self.handles.device;
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the command buffer is not in use: every submission was waited for.
        unsafe {
            device.reset_command_pool(self.pool, vk::CommandPoolResetFlags::empty()).during("reset the recording")?;
            device.begin_command_buffer(self.commands, &begin).during("begin the recording")?;
        }
        self.recording = true;
        if let Some(profile) = &mut self.profile {
            profile.names.clear();
            profile.seconds.clear();
            // SAFETY: the recording is open and the queries are of this device.
            unsafe { device.cmd_reset_query_pool(self.commands, profile.queries, 0, 2 * TIMED) };
        }
        // Buffers persist, so what earlier recordings wrote must be seen here.
        self.barrier();
        Ok(())
    }

    /// Runs `kernel` with at least `invocations` invocations, as many workgroups as that needs; in two dimensions where
    /// one is not enough (see [`Kernel::new`]).
    ///
    /// # Panics
    /// Outside a recording, or with objects of another device.
    pub fn dispatch(&mut self, kernel: &Kernel, bindings: &Bindings, invocations: u32, step: &Step) {
        self.check();
        assert!(kernel.objects.layout.objects.is_of(&self.handles) && bindings.objects.is_of(&self.handles));
        if invocations == 0 {
            return;
        }
        self.hold(&kernel.objects);
        self.hold(&bindings.objects);
        let groups = invocations.div_ceil(kernel.objects.workgroup);
        let rows = groups.div_ceil(self.handles.limits.max_compute_work_group_count[0]);
        let layout = kernel.objects.layout.objects.pipeline;
        let (device, commands) = (&self.handles.device, self.commands);
        // SAFETY: the recording is open; kernel and bindings have layouts of one definition, are of this device and held.
        unsafe {
            if let Some(functions) = &self.handles.debug_utils {
                let label = vk::DebugUtilsLabelEXT::default().label_name(&kernel.objects.label);
                functions.cmd_begin_debug_utils_label(commands, &label);
            }
            device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, kernel.objects.pipeline);
            let sets = [bindings.objects.set];
            device.cmd_bind_descriptor_sets(commands, vk::PipelineBindPoint::COMPUTE, layout, 0, &sets, &[]);
            let constants = bytemuck::bytes_of(step);
            device.cmd_push_constants(commands, layout, vk::ShaderStageFlags::COMPUTE, 0, constants);
            let query = self.profile.as_mut().filter(|profile| profile.names.len() < TIMED as usize).map(|profile| {
                profile.names.push(kernel.objects.stem);
                (profile.queries, 2 * (profile.names.len() as u32 - 1))
            });
            if let Some((queries, first)) = query {
                device.cmd_write_timestamp2(commands, vk::PipelineStageFlags2::COMPUTE_SHADER, queries, first);
            }
            device.cmd_dispatch(commands, groups.div_ceil(rows), rows, 1);
            if let Some((queries, first)) = query {
                device.cmd_write_timestamp2(commands, vk::PipelineStageFlags2::COMPUTE_SHADER, queries, first + 1);
            }
        }
        self.barrier();
        if let Some(functions) = &self.handles.debug_utils {
            // SAFETY: closes the label opened above.
            unsafe { functions.cmd_end_debug_utils_label(commands) };
        }
    }

    /// Sets every whole word of `buffer` to `word`.
    ///
    /// # Panics
    /// Outside a recording, or with a buffer of another device.
    pub fn fill(&mut self, buffer: &Buffer, word: u32) {
        self.check();
        assert!(buffer.memory.is_of(&self.handles));
        self.hold(&buffer.memory);
        // SAFETY: the recording is open, the buffer is of this device and held.
        unsafe { self.handles.device.cmd_fill_buffer(self.commands, buffer.memory.raw, 0, vk::WHOLE_SIZE, word) };
        self.barrier();
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
        assert!(source.memory.is_of(&self.handles) && target.memory.is_of(&self.handles));
        assert!(from + bytes <= source.bytes() && to + bytes <= target.bytes(), "a copy stays within its buffers");
        assert!(!Arc::ptr_eq(&source.memory, &target.memory), "a copy goes to another buffer");
        if bytes == 0 {
            return;
        }
        self.hold(&source.memory);
        self.hold(&target.memory);
        let regions = [vk::BufferCopy::default().src_offset(from).dst_offset(to).size(bytes)];
        let (source, target) = (source.memory.raw, target.memory.raw);
        // SAFETY: the recording is open; the buffers are two, of this device, held, and the region is within both.
        unsafe { self.handles.device.cmd_copy_buffer(self.commands, source, target, &regions) };
        self.barrier();
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
        let device = &self.handles.device;
        let visible = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::COMPUTE_SHADER | vk::PipelineStageFlags2::ALL_TRANSFER)
            .src_access_mask(vk::AccessFlags2::SHADER_STORAGE_WRITE | vk::AccessFlags2::TRANSFER_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST)
            .dst_access_mask(vk::AccessFlags2::HOST_READ)];
        let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(self.commands)];
        let submit = [vk::SubmitInfo2::default().command_buffer_infos(&commands)];
        // SAFETY: the recording is open and complete, what it uses is held; the queue is ours while locked.
        unsafe {
            device.cmd_pipeline_barrier2(self.commands, &vk::DependencyInfo::default().memory_barriers(&visible));
            device.end_command_buffer(self.commands).during("end the recording")?;
            device.reset_fences(&[self.fence]).during("reset the fence")?;
            device.queue_submit2(*lock(&self.handles.queue), &submit, self.fence).during("submit the recording")?;
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
        unsafe { self.handles.device.get_query_pool_results(profile.queries, 0, &mut ticks, flags) }
            .during("read the timestamps")?;
        let period = f64::from(self.handles.limits.timestamp_period) * 1e-9;
        // The counter has this many bits and wraps.
        let mask = u64::MAX >> (64 - self.handles.timestamp_bits.min(64));
        let pairs = ticks.chunks_exact(2);
        profile.seconds = pairs.map(|pair| (pair[1].wrapping_sub(pair[0]) & mask) as f64 * period).collect();
        Ok(())
    }

    /// What comes after sees and may overwrite all that came before. Passes are strictly sequential, so nothing finer
    /// would gain.
    fn barrier(&self) {
        let stages = vk::PipelineStageFlags2::COMPUTE_SHADER | vk::PipelineStageFlags2::ALL_TRANSFER;
        let barrier = [vk::MemoryBarrier2::default()
            .src_stage_mask(stages)
            .src_access_mask(vk::AccessFlags2::SHADER_STORAGE_WRITE | vk::AccessFlags2::TRANSFER_WRITE)
            .dst_stage_mask(stages)
            .dst_access_mask(
                vk::AccessFlags2::SHADER_STORAGE_READ
                    | vk::AccessFlags2::SHADER_STORAGE_WRITE
                    | vk::AccessFlags2::TRANSFER_READ
                    | vk::AccessFlags2::TRANSFER_WRITE,
            )];
        let dependency = vk::DependencyInfo::default().memory_barriers(&barrier);
        // SAFETY: the recording is open.
        unsafe { self.handles.device.cmd_pipeline_barrier2(self.commands, &dependency) };
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
            let _queue = lock(&self.handles.queue);
            // SAFETY: the device is alive and its queue locked. If it is lost, nothing runs any more.
            let _ = unsafe { self.handles.device.device_wait_idle() };
            self.pending = false;
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.wait_if_pending();
        let device = &self.handles.device;
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
