//! Commands into a command buffer that is being recorded, a [`Recorder`](super::Recorder)'s or a caller's.

use super::{Bindings, Buffer, Device, Kernel, device::Handles};
use crate::shared::Step;
use ash::vk;
use std::{ffi::CStr, sync::Arc};

/// Where the times of a recording go: the dispatch number i writes query `first + 2 i` before it starts and the next
/// one when it has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timestamps {
    /// A pool of VK_QUERY_TYPE_TIMESTAMP.
    pub pool: vk::QueryPool,
    pub first: u32,
}

/// How many invocations a dispatch has.
#[derive(Clone, Copy)]
pub enum Extent<'a> {
    /// At least as many, in as many workgroups as that needs; in two dimensions where one is not enough (see
    /// [`Kernel::new`]).
    Invocations(u32),
    /// Those of the workgroups that a VkDispatchIndirectCommand says, so many bytes from the start of the buffer.
    Indirect(&'a Buffer, u64),
}

/// A command buffer in the recording state. Nothing here submits or waits.
pub struct Commands {
    pub(super) handles: Arc<Handles>,
    pub(super) raw: vk::CommandBuffer,
}

impl Commands {
    /// A caller's command buffer.
    ///
    /// # Safety
    /// Until the last use of this value, `raw` is a command buffer of this device and its queue family, in the
    /// recording state, outside of a render pass, and used by no other thread. Until every execution of it has ended,
    /// all kernels, bindings, buffers, images and queries that are given to its methods are alive.
    pub unsafe fn of(device: &Device, raw: vk::CommandBuffer) -> Commands {
        Commands { handles: device.handles.clone(), raw }
    }

    /// What comes after sees and may overwrite all that came before. Passes are strictly sequential, so nothing finer
    /// would gain.
    pub fn barrier(&self) {
        let stages = vk::PipelineStageFlags2::COMPUTE_SHADER | vk::PipelineStageFlags2::ALL_TRANSFER;
        let barrier = vk::MemoryBarrier2::default()
            .src_stage_mask(stages)
            .src_access_mask(vk::AccessFlags2::SHADER_STORAGE_WRITE | vk::AccessFlags2::TRANSFER_WRITE)
            .dst_stage_mask(stages | vk::PipelineStageFlags2::DRAW_INDIRECT)
            .dst_access_mask(
                vk::AccessFlags2::INDIRECT_COMMAND_READ
                    | vk::AccessFlags2::SHADER_STORAGE_READ
                    | vk::AccessFlags2::SHADER_STORAGE_WRITE
                    | vk::AccessFlags2::TRANSFER_READ
                    | vk::AccessFlags2::TRANSFER_WRITE,
            );
        self.memory_barrier(barrier);
    }

    /// The host sees, once the submission has ended, all that came before.
    pub fn host_barrier(&self) {
        let barrier = vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::COMPUTE_SHADER | vk::PipelineStageFlags2::ALL_TRANSFER)
            .src_access_mask(vk::AccessFlags2::SHADER_STORAGE_WRITE | vk::AccessFlags2::TRANSFER_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST)
            .dst_access_mask(vk::AccessFlags2::HOST_READ);
        self.memory_barrier(barrier);
    }

    fn memory_barrier(&self, barrier: vk::MemoryBarrier2) {
        let barriers = [barrier];
        let dependency = vk::DependencyInfo::default().memory_barriers(&barriers);
        // SAFETY: the recording is open.
        unsafe { self.handles.device.cmd_pipeline_barrier2(self.raw, &dependency) };
    }

    /// Opens a label that debuggers show around what follows.
    pub fn begin_label(&self, name: &CStr) {
        if let Some(functions) = &self.handles.debug_utils {
            let label = vk::DebugUtilsLabelEXT::default().label_name(name);
            // SAFETY: the recording is open.
            unsafe { functions.cmd_begin_debug_utils_label(self.raw, &label) };
        }
    }

    /// Closes the label that was opened last.
    pub fn end_label(&self) {
        if let Some(functions) = &self.handles.debug_utils {
            // SAFETY: the recording is open, and so is the label.
            unsafe { functions.cmd_end_debug_utils_label(self.raw) };
        }
    }

    /// Makes `count` queries ready to be written.
    pub fn reset_queries(&self, times: Timestamps, count: u32) {
        // SAFETY: the recording is open; whoever gave the pool sees to its size.
        unsafe { self.handles.device.cmd_reset_query_pool(self.raw, times.pool, times.first, count) };
    }

    /// Runs `kernel`. `times` gets the times before and after.
    ///
    /// # Panics
    /// With objects of another device, or where indirect arguments are not within their buffer.
    pub fn dispatch(
        &self,
        kernel: &Kernel,
        bindings: &Bindings,
        extent: Extent,
        step: &Step,
        times: Option<Timestamps>,
    ) {
        assert!(kernel.objects.layout.objects.is_of(&self.handles) && bindings.objects.is_of(&self.handles));
        if let Extent::Indirect(buffer, offset) = extent {
            assert!(buffer.memory.is_of(&self.handles));
            let end = offset + size_of::<vk::DispatchIndirectCommand>() as u64;
            assert!(offset.is_multiple_of(4) && end <= buffer.bytes(), "arguments are within their buffer");
        }
        let layout = kernel.objects.layout.objects.pipeline;
        let (device, commands) = (&self.handles.device, self.raw);
        self.begin_label(&kernel.objects.label);
        // SAFETY: the recording is open; kernel and bindings have layouts of one definition, are of this device and
        // outlive it.
        unsafe {
            device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, kernel.objects.pipeline);
            let sets = [bindings.objects.set];
            device.cmd_bind_descriptor_sets(commands, vk::PipelineBindPoint::COMPUTE, layout, 0, &sets, &[]);
            let constants = bytemuck::bytes_of(step);
            device.cmd_push_constants(commands, layout, vk::ShaderStageFlags::COMPUTE, 0, constants);
            let stage = vk::PipelineStageFlags2::COMPUTE_SHADER;
            if let Some(Timestamps { pool, first }) = times {
                device.cmd_write_timestamp2(commands, stage, pool, first);
            }
            match extent {
                Extent::Invocations(count) => {
                    let [columns, rows] = self.handles.groups(count, kernel.objects.workgroup);
                    device.cmd_dispatch(commands, columns, rows, 1);
                }
                Extent::Indirect(buffer, offset) => device.cmd_dispatch_indirect(commands, buffer.memory.raw, offset),
            }
            if let Some(Timestamps { pool, first }) = times {
                device.cmd_write_timestamp2(commands, stage, pool, first + 1);
            }
        }
        self.barrier();
        self.end_label();
    }

    /// Sets every whole word of `buffer` to `word`.
    ///
    /// # Panics
    /// With a buffer of another device.
    pub fn fill(&self, buffer: &Buffer, word: u32) {
        assert!(buffer.memory.is_of(&self.handles));
        // SAFETY: the recording is open, the buffer is of this device and outlives it.
        unsafe { self.handles.device.cmd_fill_buffer(self.raw, buffer.memory.raw, 0, vk::WHOLE_SIZE, word) };
        self.barrier();
    }

    /// Writes `words` into `buffer`, `offset` bytes from its start.
    ///
    /// # Panics
    /// Beyond the buffer's end, or with a buffer of another device.
    pub fn update(&self, buffer: &Buffer, offset: u64, words: &[u32]) {
        assert!(buffer.memory.is_of(&self.handles));
        let data: &[u8] = bytemuck::cast_slice(words);
        assert!(
            data.len() <= 1 << 16 && offset + data.len() as u64 <= buffer.bytes(),
            "an update stays within its buffer"
        );
        // SAFETY: the recording is open, the buffer is of this device and outlives it, and the range is within it.
        unsafe { self.handles.device.cmd_update_buffer(self.raw, buffer.memory.raw, offset, data) };
        self.barrier();
    }

    /// Copies `bytes` of `source`, `from` its start, to another buffer, `to` its start.
    ///
    /// # Panics
    /// Beyond either buffer's end, or with buffers of another device.
    pub fn copy(&self, source: &Buffer, from: u64, target: &Buffer, to: u64, bytes: u64) {
        assert!(source.memory.is_of(&self.handles) && target.memory.is_of(&self.handles));
        assert!(from + bytes <= source.bytes() && to + bytes <= target.bytes(), "a copy stays within its buffers");
        assert!(!Arc::ptr_eq(&source.memory, &target.memory), "a copy goes to another buffer");
        let regions = [vk::BufferCopy::default().src_offset(from).dst_offset(to).size(bytes)];
        let (source, target) = (source.memory.raw, target.memory.raw);
        // SAFETY: the recording is open; the buffers are two, of this device, and the region is within both.
        unsafe { self.handles.device.cmd_copy_buffer(self.raw, source, target, &regions) };
        self.barrier();
    }

    /// Copies the start of `source`, tightly packed texels, to the upper left `width` x `height` texels of the first
    /// level and layer of a colour image in `layout`.
    ///
    /// # Panics
    /// If the buffer is shorter than texels of `texel_bytes` bytes need, or of another device.
    pub fn copy_to_image(
        &self,
        source: &Buffer,
        texel_bytes: u64,
        image: vk::Image,
        layout: vk::ImageLayout,
        [width, height]: [u32; 2],
    ) {
        assert!(source.memory.is_of(&self.handles));
        assert!(u64::from(width) * u64::from(height) * texel_bytes <= source.bytes(), "a copy stays within its buffer");
        let layers = vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR).layer_count(1);
        let regions = [vk::BufferImageCopy::default().image_subresource(layers).image_extent(vk::Extent3D {
            width,
            height,
            depth: 1,
        })];
        // SAFETY: the recording is open; whoever gave the image sees to its size, format and layout.
        unsafe { self.handles.device.cmd_copy_buffer_to_image(self.raw, source.memory.raw, image, layout, &regions) };
        self.barrier();
    }
}
