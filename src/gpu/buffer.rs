//! A buffer that owns its memory, and the way of bytes to the device and back.

use super::{
    During, Recorder,
    device::{Device, Handles, lock},
    memory::{Allocation, MemoryRequest},
};
use crate::{Error, Result};
use ash::vk;
use bytemuck::Pod;
use std::{cell::Cell, marker::PhantomData, ptr::NonNull, sync::Arc};

/// Bytes of a staging buffer; larger transfers go in pieces.
const STAGING_BYTES: u64 = 8 << 20;

/// Where a buffer's memory is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Location {
    /// On the device; filled by [`upload`], read by [`download`]. On a device without a queue, which cannot fill it
    /// otherwise, where the host reaches it.
    Device,
    /// On the device; kernels alone write it.
    Scratch,
    /// Where both reach it, for [`Buffer::write`].
    Upload,
    /// On the host, for [`Buffer::read`].
    Readback,
}

/// A storage buffer, freed when it and all bindings and recordings that use it are dropped.
///
/// It may move to another thread but not be shared between threads, so its content is touched by one at a time.
pub struct Buffer {
    pub(super) memory: Arc<BufferMemory>,
    one_thread: PhantomData<Cell<()>>,
}

/// What bindings and recordings keep alive of a buffer. Only the one [`Buffer`] reads and writes through `mapped`.
pub(super) struct BufferMemory {
    pub raw: vk::Buffer,
    pub bytes: u64,
    handles: Arc<Handles>,
    origin: Origin,
    mapped: Option<NonNull<u8>>,
}

/// Where a buffer and its memory come from, and so what is destroyed with it.
enum Origin {
    /// Both are ours. None only while making and dropping.
    Own(Option<Allocation>),
    /// The buffer and the handle of its memory are ours, the bytes the caller's.
    HostImport(vk::DeviceMemory),
    /// Both are the caller's.
    Caller,
}

// SAFETY: `mapped` points into memory that this value owns; only the one `Buffer` follows it, which is not `Sync`.
unsafe impl Send for BufferMemory {}
// SAFETY: as above.
unsafe impl Sync for BufferMemory {}

impl Buffer {
    /// A buffer of `bytes` (at least 4), for kernels and copies. Its content is undefined.
    ///
    /// # Errors
    /// [`Error::Memory`] beyond [`Device::max_storage_buffer_range`] or if the memory cannot be had;
    /// [`Error::Vulkan`] if the buffer cannot be made.
    pub fn new(device: &Device, name: &str, bytes: u64, location: Location) -> Result<Buffer> {
        let limit = device.max_storage_buffer_range();
        if bytes > limit {
            let problem = format!("{bytes} bytes; the device's buffers hold at most {limit}");
            return Err(Error::Memory { step: format!("create buffer `{name}`"), problem });
        }
        Buffer::with_handles(&device.handles, name, bytes, location)
    }

    pub(super) fn with_handles(handles: &Arc<Handles>, name: &str, bytes: u64, location: Location) -> Result<Buffer> {
        let step = format!("create buffer `{name}`");
        // What cannot be staged is written where it is.
        let location = match location {
            Location::Device if handles.queue.is_none() => Location::Upload,
            other => other,
        };
        let bytes = bytes.max(4);
        let device = &handles.device;
        // SAFETY: the device is alive and the size is within its limits.
        let raw = unsafe { device.create_buffer(&create_info(bytes), None) }.during(&step)?;
        handles.name(raw, name);
        // From here on dropping it destroys the buffer.
        let mut owner = BufferMemory { raw, bytes, handles: handles.clone(), origin: Origin::Own(None), mapped: None };
        // SAFETY: the buffer is of this device.
        let requirements = unsafe { device.get_buffer_memory_requirements(raw) };
        let request = MemoryRequest { name, requirements, location };
        let allocation = handles.allocate(&request).map_err(|problem| Error::Memory { step: step.clone(), problem })?;
        // SAFETY: the allocation is alive and owned by the same value as the buffer; its offset is within it.
        let bound = unsafe { device.bind_buffer_memory(raw, allocation.memory, allocation.offset) };
        let flags = allocation.properties;
        // The device's memory is touched directly only where the host caches it: over a bus, reads would crawl.
        let direct = match location {
            Location::Device | Location::Scratch => {
                flags.contains(vk::MemoryPropertyFlags::HOST_COHERENT | vk::MemoryPropertyFlags::HOST_CACHED)
                    && !handles.force_staging
            }
            Location::Upload | Location::Readback => true,
        };
        owner.mapped = allocation.mapped.filter(|_| direct);
        owner.origin = Origin::Own(Some(allocation));
        bound.during(&step)?;
        if matches!(location, Location::Upload | Location::Readback) && owner.mapped.is_none() {
            return Err(Error::Memory { step, problem: "the allocator's memory is not mapped".into() });
        }
        Ok(Buffer { memory: Arc::new(owner), one_thread: PhantomData })
    }

    /// The first `bytes` of a caller's buffer, which is not destroyed with this value.
    ///
    /// # Safety
    /// The buffer is of this device, bound to memory, was made with the usages STORAGE_BUFFER, TRANSFER_SRC and
    /// TRANSFER_DST and at least that many bytes, and outlives this value and all bindings and recordings that use it.
    pub unsafe fn of_caller(device: &Device, raw: vk::Buffer, bytes: u64) -> Buffer {
        let handles = device.handles.clone();
        Buffer {
            memory: Arc::new(BufferMemory { raw, bytes, handles, origin: Origin::Caller, mapped: None }),
            one_thread: PhantomData,
        }
    }

    /// A buffer whose memory is the caller's own: the device reads and writes it in place.
    ///
    /// # Errors
    /// [`Error::Device`] where VK_EXT_external_memory_host is not enabled; [`Error::Memory`] for an address or size
    /// that is no multiple of [`Device::host_import_alignment`], or memory that the device cannot import;
    /// [`Error::Vulkan`].
    ///
    /// # Safety
    /// The memory is valid for reads and writes and outlives this value and all bindings and recordings that use it.
    /// While one of those executes, and while a method of this value runs, nobody else touches it.
    pub unsafe fn import_host(device: &Device, name: &str, start: NonNull<u8>, bytes: u64) -> Result<Buffer> {
        let handles = &device.handles;
        let step = format!("import host memory as buffer `{name}`");
        let Some(host) = &handles.host_memory else {
            return Err(Error::Device(format!("{step}: VK_EXT_external_memory_host is not enabled")));
        };
        let memory = |problem: String| Error::Memory { step: step.clone(), problem };
        let address = start.as_ptr() as u64;
        if bytes == 0 || !bytes.is_multiple_of(host.alignment) || !address.is_multiple_of(host.alignment) {
            let problem = format!("{bytes} bytes at {address:#x} are not a multiple of {}", host.alignment);
            return Err(memory(problem));
        }
        let limit = device.max_storage_buffer_range();
        if bytes > limit {
            return Err(memory(format!("{bytes} bytes; the device's buffers hold at most {limit}")));
        }
        let kind = vk::ExternalMemoryHandleTypeFlags::HOST_ALLOCATION_EXT;
        let mut external = vk::ExternalMemoryBufferCreateInfo::default().handle_types(kind);
        let create = create_info(bytes).push_next(&mut external);
        // SAFETY: the device is alive and the size within its limits.
        let raw = unsafe { handles.device.create_buffer(&create, None) }.during(&step)?;
        handles.name(raw, name);
        // From here on dropping it destroys the buffer.
        let mut owner =
            BufferMemory { raw, bytes, handles: handles.clone(), origin: Origin::Own(None), mapped: Some(start) };
        let mut properties = vk::MemoryHostPointerPropertiesEXT::default();
        // SAFETY: the buffer is of this device; the extension is enabled and the caller's memory is valid.
        let requirements = unsafe {
            let requirements = handles.device.get_buffer_memory_requirements(raw);
            (host.functions.fp().get_memory_host_pointer_properties_ext)(
                handles.device.handle(),
                kind,
                start.as_ptr().cast(),
                &mut properties,
            )
            .result()
            .during(&step)?;
            requirements
        };
        let wanted = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        let allowed = requirements.memory_type_bits & properties.memory_type_bits;
        let types = host.types.memory_types_as_slice();
        let index = (0..types.len()).find(|&i| allowed & (1 << i) != 0 && types[i].property_flags.contains(wanted));
        let Some(index) = index.filter(|_| requirements.size <= bytes) else {
            return Err(memory("the device has no memory type for it".into()));
        };
        let mut import = vk::ImportMemoryHostPointerInfoEXT::default().handle_type(kind);
        import.p_host_pointer = start.as_ptr().cast();
        let allocate = vk::MemoryAllocateInfo::default()
            .allocation_size(bytes)
            .memory_type_index(index as u32)
            .push_next(&mut import);
        // SAFETY: address and size are aligned and the memory is valid, as the caller promises.
        unsafe {
            let imported = handles.device.allocate_memory(&allocate, None).during(&step)?;
            owner.origin = Origin::HostImport(imported);
            handles.device.bind_buffer_memory(raw, imported, 0).during(&step)?;
        }
        Ok(Buffer { memory: Arc::new(owner), one_thread: PhantomData })
    }

    /// Vulkan's handle, for commands of the caller's; valid as long as this value.
    pub fn raw(&self) -> vk::Buffer {
        self.memory.raw
    }

    /// Size in bytes.
    pub fn bytes(&self) -> u64 {
        self.memory.bytes
    }

    /// Copies `data` to the start of the buffer. No submitted recording may be using it.
    ///
    /// # Panics
    /// If the host cannot reach the buffer's memory, or `data` does not fit.
    pub fn write<T: Pod>(&self, data: &[T]) {
        self.write_at(0, bytemuck::cast_slice(data));
    }

    /// The content, as many whole `T` as it holds.
    ///
    /// # Panics
    /// If the host cannot reach the buffer's memory.
    pub fn read<T: Pod>(&self) -> Vec<T> {
        let mut data = vec![T::zeroed(); self.bytes() as usize / size_of::<T>()];
        self.read_at(0, bytemuck::cast_slice_mut(&mut data));
        data
    }

    /// Whether the host reads its content in place.
    pub fn is_mapped(&self) -> bool {
        self.memory.mapped.is_some()
    }

    /// The `T` at `index`. No submitted recording may be writing it.
    ///
    /// # Panics
    /// If the host cannot reach the buffer's memory, or it ends before.
    pub fn read_one<T: Pod>(&self, index: usize) -> T {
        let mut one = T::zeroed();
        self.read_at((index * size_of::<T>()) as u64, bytemuck::bytes_of_mut(&mut one));
        one
    }

    fn write_at(&self, offset: u64, data: &[u8]) {
        let start = self.mapped(offset, data.len());
        // SAFETY: `mapped` checked the range; no reference points into it and no other thread is here.
        unsafe { start.copy_from_nonoverlapping(NonNull::from(data).cast(), data.len()) };
    }

    fn read_at(&self, offset: u64, data: &mut [u8]) {
        let start = self.mapped(offset, data.len());
        // SAFETY: as above.
        unsafe { start.copy_to_nonoverlapping(NonNull::from(&mut *data).cast(), data.len()) };
    }

    /// Address of `len` bytes at `offset`.
    fn mapped(&self, offset: u64, len: usize) -> NonNull<u8> {
        assert!(offset + len as u64 <= self.bytes(), "{len} bytes at {offset} of a buffer of {}", self.bytes());
        let start = self.memory.mapped.expect("the buffer is on the host");
        // SAFETY: the offset is within the mapped range.
        unsafe { start.add(offset as usize) }
    }
}

impl BufferMemory {
    /// Whether it was made on this device.
    pub fn is_of(&self, handles: &Arc<Handles>) -> bool {
        Arc::ptr_eq(&self.handles, handles)
    }
}

impl Drop for BufferMemory {
    fn drop(&mut self) {
        if matches!(self.origin, Origin::Caller) {
            return;
        }
        let device = &self.handles.device;
        // SAFETY: no bindings or recordings hold it any more, and it is of this device.
        unsafe { device.destroy_buffer(self.raw, None) };
        match &mut self.origin {
            Origin::Own(allocation) => allocation.take().into_iter().for_each(|given| self.handles.free(given)),
            // SAFETY: only that buffer used it.
            Origin::HostImport(memory) => unsafe { device.free_memory(*memory, None) },
            Origin::Caller => {}
        }
    }
}

/// How every buffer is made: usable in every way that kernels and copies need.
pub(super) fn create_info(bytes: u64) -> vk::BufferCreateInfo<'static> {
    vk::BufferCreateInfo::default().size(bytes).usage(
        vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::INDIRECT_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST,
    )
}

/// Host buffers and a recorder for transfers, kept by the device from the first use on.
pub(super) struct Staging {
    recorder: Recorder,
    upload: Buffer,
    readback: Buffer,
}

impl Staging {
    fn new(handles: &Arc<Handles>) -> Result<Staging> {
        Ok(Staging {
            recorder: Recorder::with_handles(handles, false)?,
            upload: Buffer::with_handles(handles, "staging (upload)", STAGING_BYTES, Location::Upload)?,
            readback: Buffer::with_handles(handles, "staging (readback)", STAGING_BYTES, Location::Readback)?,
        })
    }
}

/// Calls `transfer` with the device's staging buffers, made on the first use.
fn with_staging(device: &Device, transfer: impl FnOnce(&mut Staging) -> Result<()>) -> Result<()> {
    let mut guard = lock(&device.staging);
    if guard.is_none() {
        *guard = Some(Staging::new(&device.handles)?);
    }
    transfer(guard.as_mut().expect("made just above"))
}

/// Copies `data` to the start of `buffer`, wherever it is, and waits. No submitted recording may be using it.
///
/// # Errors
/// [`Error::Vulkan`] or [`Error::Memory`] if the staged copy fails.
///
/// # Panics
/// If `data` does not fit.
pub fn upload(device: &Device, buffer: &Buffer, data: &[u8]) -> Result<()> {
    if buffer.memory.mapped.is_some() {
        buffer.write(data);
        return Ok(());
    }
    assert!(data.len() as u64 <= buffer.bytes(), "{} bytes into a buffer of {}", data.len(), buffer.bytes());
    with_staging(device, |staging| {
        for (i, piece) in data.chunks(STAGING_BYTES as usize).enumerate() {
            staging.upload.write(piece);
            staging.recorder.begin()?;
            let offset = i as u64 * STAGING_BYTES;
            staging.recorder.copy_at(&staging.upload, 0, buffer, offset, piece.len() as u64);
            staging.recorder.submit_and_wait()?;
        }
        Ok(())
    })
}

/// The first `bytes` of `buffer`, wherever it is.
///
/// # Errors
/// [`Error::Vulkan`] or [`Error::Memory`] if the staged copy fails.
///
/// # Panics
/// If the buffer is shorter.
pub fn download(device: &Device, buffer: &Buffer, bytes: u64) -> Result<Vec<u8>> {
    let mut data = vec![0; bytes as usize];
    download_to(device, buffer, &mut data)?;
    Ok(data)
}

/// Fills `data` from the start of `buffer`, wherever it is. Errors and panics as [`download`].
pub fn download_to(device: &Device, buffer: &Buffer, data: &mut [u8]) -> Result<()> {
    if buffer.memory.mapped.is_some() {
        buffer.read_at(0, data);
        return Ok(());
    }
    with_staging(device, |staging| {
        for (i, piece) in data.chunks_mut(STAGING_BYTES as usize).enumerate() {
            staging.recorder.begin()?;
            let offset = i as u64 * STAGING_BYTES;
            staging.recorder.copy_at(buffer, offset, &staging.readback, 0, piece.len() as u64);
            staging.recorder.submit_and_wait()?;
            staging.readback.read_at(0, piece);
        }
        Ok(())
    })
}
