//! The one descriptor set layout, sets of buffers, and specialised compute pipelines.

use super::{
    During,
    buffer::{Buffer, BufferMemory, Location},
    c_name,
    device::{Device, Handles, lock},
};
use crate::{
    Error, Result,
    shared::{Features, Slot, Step},
};
use ash::vk;
use std::{collections::HashMap, ffi::CString, io::Cursor, sync::Arc};

/// Every slot of [`Slot::ALL`] as a storage buffer, and [`Step`] as push constants: the same for all kernels.
#[derive(Clone)]
pub struct Layout {
    pub(super) objects: Arc<LayoutObjects>,
}

pub(super) struct LayoutObjects {
    pub pipeline: vk::PipelineLayout,
    set: vk::DescriptorSetLayout,
    // Stands in the slots that a scene does not need; no kernel may mention those.
    absent: Option<Arc<BufferMemory>>,
    pub handles: Arc<Handles>,
}

impl Layout {
    /// The layout on `device`.
    ///
    /// # Errors
    /// [`Error::Vulkan`], [`Error::Memory`].
    pub fn new(device: &Device) -> Result<Layout> {
        let handles = &device.handles;
        let bindings: Vec<_> = Slot::ALL
            .iter()
            .map(|&slot| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(slot as u32)
                    .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            })
            .collect();
        let mut objects = LayoutObjects {
            pipeline: vk::PipelineLayout::null(),
            set: vk::DescriptorSetLayout::null(),
            absent: None,
            handles: handles.clone(),
        };
        let create = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: the device is alive, all pointers outlive the calls; dropping `objects` destroys what was made.
        objects.set = unsafe { handles.device.create_descriptor_set_layout(&create, None) }
            .during("create the descriptor set layout")?;
        let sets = [objects.set];
        let constants = [vk::PushConstantRange::default()
            .stage_flags(vk::ShaderStageFlags::COMPUTE)
            .size(size_of::<Step>() as u32)];
        let create = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets).push_constant_ranges(&constants);
        // SAFETY: as above.
        objects.pipeline =
            unsafe { handles.device.create_pipeline_layout(&create, None) }.during("create the pipeline layout")?;
        handles.name(objects.set, "slots");
        handles.name(objects.pipeline, "layout");
        objects.absent = Some(Buffer::with_handles(handles, "absent", 4, Location::Device)?.memory);
        Ok(Layout { objects: Arc::new(objects) })
    }
}

impl Drop for LayoutObjects {
    fn drop(&mut self) {
        // SAFETY: pipelines and sets of this layout hold it and are gone; null handles are ignored.
        unsafe {
            self.handles.device.destroy_pipeline_layout(self.pipeline, None);
            self.handles.device.destroy_descriptor_set_layout(self.set, None);
        }
    }
}

/// The buffers that kernels read and write in one dispatch. It keeps them alive.
pub struct Bindings {
    pub(super) objects: Arc<BindingsObjects>,
}

pub(super) struct BindingsObjects {
    pub set: vk::DescriptorSet,
    pool: vk::DescriptorPool,
    layout: Layout,
    _buffers: Vec<Arc<BufferMemory>>,
}

impl Bindings {
    /// Binds each buffer to its slot. A kernel must not touch a slot that is not named here.
    ///
    /// # Errors
    /// [`Error::Vulkan`].
    ///
    /// # Panics
    /// If a buffer is of another device than the layout.
    pub fn new(layout: &Layout, buffers: &[(Slot, &Buffer)]) -> Result<Bindings> {
        let handles = &layout.objects.handles;
        let absent = layout.objects.absent.as_ref().expect("a layout has it");
        let kept: Vec<Arc<BufferMemory>> = Slot::ALL
            .iter()
            .map(|&slot| {
                let found = buffers.iter().find(|(named, _)| *named == slot);
                found.map_or(absent, |(_, buffer)| &buffer.memory).clone()
            })
            .collect();
        assert!(kept.iter().all(|buffer| buffer.is_of(handles)), "buffers and layout are of one device");

        let sizes = [vk::DescriptorPoolSize::default()
            .ty(vk::DescriptorType::STORAGE_BUFFER)
            .descriptor_count(Slot::ALL.len() as u32)];
        let create = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: the device is alive and all pointers outlive the call.
        let pool =
            unsafe { handles.device.create_descriptor_pool(&create, None) }.during("create the descriptor pool")?;
        // From here on dropping it destroys the pool, and with it the set.
        let mut objects =
            BindingsObjects { set: vk::DescriptorSet::null(), pool, layout: layout.clone(), _buffers: kept };
        let sets = [layout.objects.set];
        let allocate = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&sets);
        // SAFETY: pool and layout are alive and of this device.
        objects.set =
            unsafe { handles.device.allocate_descriptor_sets(&allocate) }.during("allocate the descriptor set")?[0];
        handles.name(objects.set, "bindings");
        let ranges: Vec<_> = objects
            ._buffers
            .iter()
            .map(|buffer| [vk::DescriptorBufferInfo::default().buffer(buffer.raw).range(buffer.bytes)])
            .collect();
        let writes: Vec<_> = Slot::ALL
            .iter()
            .zip(&ranges)
            .map(|(&slot, range)| {
                vk::WriteDescriptorSet::default()
                    .dst_set(objects.set)
                    .dst_binding(slot as u32)
                    .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                    .buffer_info(range)
            })
            .collect();
        // SAFETY: the set is new, so nothing uses it; the buffers are alive and kept.
        unsafe { handles.device.update_descriptor_sets(&writes, &[]) };
        Ok(Bindings { objects: Arc::new(objects) })
    }
}

impl Drop for BindingsObjects {
    fn drop(&mut self) {
        // SAFETY: recordings that use the set hold it and are gone.
        unsafe { self.layout.objects.handles.device.destroy_descriptor_pool(self.pool, None) };
    }
}

/// The kernels of [`Kernel::shared`], by SPIR-V, features and workgroup.
pub(super) type Compiled = HashMap<(&'static [u8], Features, u32), Kernel>;

/// A compute pipeline, specialised to a scene's features; clones share it.
#[derive(Clone)]
pub struct Kernel {
    pub(super) objects: Arc<KernelObjects>,
}

pub(super) struct KernelObjects {
    pub pipeline: vk::Pipeline,
    pub stem: &'static str,
    pub label: CString,
    pub workgroup: u32,
    pub layout: Layout,
}

impl Kernel {
    /// Compiles `spirv`, the module that build.rs made of `glsl/<stem>.comp`, for `features`. Constant 0 is the
    /// workgroup size. A dispatch may be two-dimensional, so a kernel's index is
    /// `gl_WorkGroupID.y * gl_NumWorkGroups.x * gl_WorkGroupSize.x + gl_GlobalInvocationID.x`, and it returns at
    /// once beyond its last item.
    ///
    /// # Errors
    /// [`Error::Setting`] for a workgroup size that the device cannot do; [`Error::Vulkan`].
    pub fn new(
        layout: &Layout,
        stem: &'static str,
        spirv: &[u8],
        features: &Features,
        workgroup: u32,
    ) -> Result<Kernel> {
        let handles = &layout.objects.handles;
        let limits = &handles.limits;
        let most = limits.max_compute_work_group_invocations.min(limits.max_compute_work_group_size[0]);
        if workgroup == 0 || workgroup > most {
            return Err(Error::setting("workgroup", format!("is {workgroup}, must be 1 to {most} on this device")));
        }
        let step = format!("compile kernel `{stem}`");
        let code = ash::util::read_spv(&mut Cursor::new(spirv))
            .map_err(|_| vk::Result::ERROR_INVALID_SHADER_NV)
            .during(&step)?;

        let mut constants = vec![(0, workgroup)];
        constants.extend(features.constants());
        let values: Vec<u32> = constants.iter().map(|&(_, value)| value).collect();
        let entries: Vec<_> = constants
            .iter()
            .enumerate()
            .map(|(i, &(id, _))| vk::SpecializationMapEntry::default().constant_id(id).offset(4 * i as u32).size(4))
            .collect();
        let specialization =
            vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(&values));
        let create = vk::ShaderModuleCreateInfo::default().code(&code);
        // SAFETY: the module was made by our build script, which compiles for Vulkan 1.3.
        let module = unsafe { handles.device.create_shader_module(&create, None) }.during(&step)?;
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module)
            .name(c"main")
            .specialization_info(&specialization);
        let flags = match handles.profiling.executables {
            Some(_) => vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR,
            None => vk::PipelineCreateFlags::empty(),
        };
        let layout_handle = layout.objects.pipeline;
        let create = [vk::ComputePipelineCreateInfo::default().flags(flags).stage(stage).layout(layout_handle)];
        // SAFETY: module and layout are alive, all pointers outlive the call. A pipeline needs its module no longer.
        let pipeline = unsafe {
            let made = handles.device.create_compute_pipelines(handles.pipeline_cache, &create, None);
            handles.device.destroy_shader_module(module, None);
            made.map_err(|(_, result)| result).during(&step)?[0]
        };
        handles.name(pipeline, stem);
        let objects = KernelObjects { pipeline, stem, label: c_name(stem), workgroup, layout: layout.clone() };
        Ok(Kernel { objects: Arc::new(objects) })
    }

    /// As [`Kernel::new`], once for each device: whoever asks for the same again shares what was compiled. A device
    /// keeps all that it compiled, some two megabytes each on lavapipe, as long as it lives.
    ///
    /// # Errors
    /// As [`Kernel::new`].
    pub fn shared(
        device: &Device,
        stem: &'static str,
        spirv: &'static [u8],
        features: &Features,
        workgroup: u32,
    ) -> Result<Kernel> {
        let key = (spirv, *features, workgroup);
        if let Some(kernel) = lock(&device.kernels).get(&key) {
            return Ok(kernel.clone());
        }
        // Not locked meanwhile: kernels compile side by side.
        let kernel = Kernel::new(&Layout::new(device)?, stem, spirv, features, workgroup)?;
        Ok(lock(&device.kernels).entry(key).or_insert(kernel).clone())
    }

    /// The name that it shares with its GLSL file and its twin.
    pub fn stem(&self) -> &'static str {
        self.objects.stem
    }
}

impl Drop for KernelObjects {
    fn drop(&mut self) {
        // SAFETY: recordings that use the pipeline hold it and are gone.
        unsafe { self.layout.objects.handles.device.destroy_pipeline(self.pipeline, None) };
    }
}

impl LayoutObjects {
    /// Whether it was made on this device.
    pub fn is_of(&self, handles: &Arc<Handles>) -> bool {
        Arc::ptr_eq(&self.handles, handles)
    }
}

impl BindingsObjects {
    /// Whether it was made on this device.
    pub fn is_of(&self, handles: &Arc<Handles>) -> bool {
        self.layout.objects.is_of(handles)
    }
}
