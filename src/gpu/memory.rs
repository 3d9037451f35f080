//! Device memory through gpu-allocator, with a table of what is allocated for what.

use super::fit::Fit;
use crate::{Error, Result};
use ash::vk;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc};
use gpu_allocator::{AllocationError, MemoryLocation};
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// The allocator of a context. Interior mutability, since buffers free their memory when dropped.
pub(crate) struct Memory {
    allocator: Mutex<Option<Allocator>>,
    most: u64,
}

impl std::fmt::Debug for Memory {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Memory").finish_non_exhaustive()
    }
}

impl Memory {
    pub(crate) fn new(instance: &ash::Instance, device: &ash::Device, fit: &Fit) -> Result<Self> {
        let desc = AllocatorCreateDesc {
            instance: instance.clone(),
            device: device.clone(),
            physical_device: fit.physical,
            debug_settings: gpu_allocator::AllocatorDebugSettings::default(),
            buffer_device_address: false,
            allocation_sizes: gpu_allocator::AllocationSizes::default(),
        };
        let allocator = Allocator::new(&desc).map_err(|e| lost(&e, "the allocator", 0))?;
        Ok(Self { allocator: Mutex::new(Some(allocator)), most: fit.max_allocation })
    }

    pub(crate) fn allocate(
        &self,
        purpose: &str,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
        linear: bool,
    ) -> Result<Allocation> {
        // Drivers may promise what a heap cannot hold, and are not to be asked for it.
        if requirements.size > self.most {
            return Err(lost(&AllocationError::OutOfMemory, purpose, requirements.size));
        }
        let mut guard = self.allocator.lock().unwrap_or_else(PoisonError::into_inner);
        let desc = AllocationCreateDesc {
            name: purpose,
            requirements,
            location,
            linear,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        };
        let allocator = guard.as_mut().ok_or_else(|| Error::Vulkan {
            during: "allocating after the context was closed".to_owned(),
            result: vk::Result::ERROR_UNKNOWN,
        })?;
        allocator.allocate(&desc).map_err(|e| lost(&e, purpose, requirements.size))
    }

    pub(crate) fn free(&self, allocation: Allocation) {
        if let Some(allocator) = self.allocator.lock().unwrap_or_else(PoisonError::into_inner).as_mut() {
            // Freeing fails only for an allocation of another allocator, which the types exclude.
            allocator.free(allocation).ok();
        }
    }

    /// Bytes in use by purpose.
    pub(crate) fn table(&self) -> BTreeMap<String, u64> {
        let mut table = BTreeMap::new();
        if let Some(allocator) = self.allocator.lock().unwrap_or_else(PoisonError::into_inner).as_ref() {
            for allocation in allocator.generate_report().allocations {
                *table.entry(allocation.name).or_insert(0) += allocation.size;
            }
        }
        table
    }

    /// Gives all memory back. Must come before the device is destroyed.
    pub(crate) fn close(&self) {
        self.allocator.lock().unwrap_or_else(PoisonError::into_inner).take();
    }
}

fn lost(error: &AllocationError, purpose: &str, bytes: u64) -> Error {
    match error {
        AllocationError::OutOfMemory => Error::OutOfMemory {
            bytes,
            purpose: purpose.to_owned(),
            advice: "lower --size or --density, or choose a device with more memory".to_owned(),
        },
        other => Error::Vulkan {
            during: format!("allocating {bytes} bytes for {purpose} ({other})"),
            result: vk::Result::ERROR_INITIALIZATION_FAILED,
        },
    }
}
