//! What a device must have, stated once: a host can query it beforehand, `info` prints it, and a device is chosen or
//! rejected by it.

use ash::vk;
use std::ffi::CStr;

/// The Vulkan version that instance and device must offer.
pub const API_VERSION: u32 = vk::API_VERSION_1_3;

/// A feature, extension or limit that stillray asks of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Need {
    /// Its name in Vulkan.
    pub name: &'static str,
    /// What it is for.
    pub why: &'static str,
}

/// Features and limits without which nothing works. A host that lends its device must have enabled the features.
pub const REQUIRED: &[Need] = &[
    Need { name: "apiVersion >= 1.3", why: "the version that stillray is written against" },
    Need { name: "queue family with VK_QUEUE_COMPUTE_BIT", why: "everything is a compute dispatch" },
    Need { name: "synchronization2", why: "barriers between phases" },
    Need { name: "shaderStorageImageExtendedFormats", why: "motion vectors are written as R32G32_SFLOAT" },
    Need { name: "maxComputeWorkGroupInvocations >= 256", why: "the prefix sum uses groups of 256" },
    Need { name: "maxComputeWorkGroupSize[0] >= 256", why: "the prefix sum uses groups of 256 in a row" },
    Need { name: "maxComputeSharedMemorySize >= 4096", why: "prefix sums and counters" },
    Need { name: "maxPerStageDescriptorStorageBuffers >= 24", why: "shading binds this many" },
    Need { name: "maxPushConstantsSize >= 64", why: "parameters of a dispatch" },
];

/// What is used when it is there.
pub const PREFERRED: &[Need] = &[
    Need { name: "timestampValidBits > 0", why: "without it, phases are not timed" },
    Need {
        name: "maxStorageBufferRange >= 1 GiB",
        why: "smaller limits bound the triangles, and the pixels, of a frame",
    },
];

/// What was found out about a device.
#[derive(Debug, Clone, Default)]
pub struct Fit {
    /// The device.
    pub physical: vk::PhysicalDevice,
    /// Its properties.
    pub properties: vk::PhysicalDeviceProperties,
    /// Driver name and version as the driver says them.
    pub driver: String,
    /// Most bytes of one buffer (`maxBufferSize`).
    pub max_buffer: u64,
    /// Most bytes of one allocation: the smaller of `maxMemoryAllocationSize` and the largest heap.
    pub max_allocation: u64,
    /// The first queue family that computes; of an adopted device, the host's.
    pub queue_family: Option<u32>,
    /// Valid bits of that family's timestamps.
    pub timestamp_bits: u32,
    /// Reasons against it; empty if it fits.
    pub rejected: Vec<String>,
}

impl Fit {
    /// Name given by the driver.
    pub fn name(&self) -> String {
        c_string(&self.properties.device_name)
    }

    /// `discrete`, `integrated`, `virtual`, `cpu` or `other`.
    pub fn kind(&self) -> &'static str {
        match self.properties.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => "discrete",
            vk::PhysicalDeviceType::INTEGRATED_GPU => "integrated",
            vk::PhysicalDeviceType::VIRTUAL_GPU => "virtual",
            vk::PhysicalDeviceType::CPU => "cpu",
            _ => "other",
        }
    }

    /// Vulkan version as `major.minor.patch`.
    pub fn api(&self) -> String {
        let v = self.properties.api_version;
        format!("{}.{}.{}", vk::api_version_major(v), vk::api_version_minor(v), vk::api_version_patch(v))
    }

    /// Devices are preferred in this order: discrete, integrated, virtual, CPU, other.
    pub fn rank(&self) -> u32 {
        ["discrete", "integrated", "virtual", "cpu", "other"].iter().position(|k| *k == self.kind()).unwrap_or(4) as u32
    }
}

fn c_string(bytes: &[std::ffi::c_char]) -> String {
    let bytes: Vec<u8> = bytes.iter().map(|c| c.to_ne_bytes()[0]).collect();
    CStr::from_bytes_until_nul(&bytes).map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Looks at one device of an instance, which must be alive.
pub fn examine(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Fit {
    examine_with(instance, physical, None)
}

/// Looks at one device and at one of its queue families, instead of the first that computes.
pub fn examine_family(instance: &ash::Instance, physical: vk::PhysicalDevice, family: u32) -> Fit {
    examine_with(instance, physical, Some(family))
}

fn examine_with(instance: &ash::Instance, physical: vk::PhysicalDevice, family: Option<u32>) -> Fit {
    // SAFETY: `physical` was enumerated from `instance`, which is alive.
    let properties = unsafe { instance.get_physical_device_properties(physical) };
    // SAFETY: as above.
    let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
    let computes = |f: &vk::QueueFamilyProperties| f.queue_flags.contains(vk::QueueFlags::COMPUTE) && f.queue_count > 0;
    let wanted = |i: usize| family.is_none_or(|wanted| wanted as usize == i);
    let found = families.iter().enumerate().find(|(i, f)| wanted(*i) && computes(f));
    let mut fit = Fit {
        physical,
        properties,
        queue_family: found.map(|(i, _)| i as u32),
        timestamp_bits: found.map_or(0, |(_, f)| f.timestamp_valid_bits),
        ..Fit::default()
    };
    if properties.api_version < API_VERSION {
        // Structures of later versions may not be queried from such a device.
        fit.rejected.push(format!("Vulkan {} is older than 1.3", fit.api()));
        return fit;
    }
    fit.driver = driver(instance, physical);
    (fit.max_buffer, fit.max_allocation) = most_memory(instance, physical);
    if fit.queue_family.is_none() {
        fit.rejected.push(family.map_or_else(
            || "no queue family computes".to_owned(),
            |family| format!("queue family {family} does not compute"),
        ));
    }
    fit.rejected.extend(missing_features(instance, physical));
    fit.rejected.extend(missed_limits(&properties.limits));
    fit
}

fn driver(instance: &ash::Instance, physical: vk::PhysicalDevice) -> String {
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
    // SAFETY: the device offers Vulkan 1.3 (checked by the caller), so the chained structure is known to it.
    unsafe { instance.get_physical_device_properties2(physical, &mut properties) };
    format!("{} {}", c_string(&driver.driver_name), c_string(&driver.driver_info)).trim().to_owned()
}

/// Most bytes of a buffer, and of an allocation.
fn most_memory(instance: &ash::Instance, physical: vk::PhysicalDevice) -> (u64, u64) {
    let (mut v11, mut v13) =
        (vk::PhysicalDeviceVulkan11Properties::default(), vk::PhysicalDeviceVulkan13Properties::default());
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut v11).push_next(&mut v13);
    // SAFETY: the device offers Vulkan 1.3 (checked by the caller), so the chained structures are known to it.
    let memory = unsafe {
        instance.get_physical_device_properties2(physical, &mut properties);
        instance.get_physical_device_memory_properties(physical)
    };
    let largest = memory.memory_heaps_as_slice().iter().map(|h| h.size).max().unwrap_or(0);
    (v13.max_buffer_size, v11.max_memory_allocation_size.min(largest))
}

fn missing_features(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Vec<String> {
    let mut v13 = vk::PhysicalDeviceVulkan13Features::default();
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut v13);
    // SAFETY: the device offers Vulkan 1.3 (checked by the caller), so the chained structure is known to it.
    unsafe { instance.get_physical_device_features2(physical, &mut features) };
    let extended_formats = features.features.shader_storage_image_extended_formats;
    [("synchronization2", v13.synchronization2), ("shaderStorageImageExtendedFormats", extended_formats)]
        .iter()
        .filter(|(_, there)| *there == vk::FALSE)
        .map(|(name, _)| format!("feature {name} is missing"))
        .collect()
}

fn missed_limits(limits: &vk::PhysicalDeviceLimits) -> Vec<String> {
    [
        ("maxComputeWorkGroupInvocations", limits.max_compute_work_group_invocations, 256),
        ("maxComputeWorkGroupSize[0]", limits.max_compute_work_group_size[0], 256),
        ("maxComputeSharedMemorySize", limits.max_compute_shared_memory_size, 4096),
        ("maxPerStageDescriptorStorageBuffers", limits.max_per_stage_descriptor_storage_buffers, 24),
        ("maxPushConstantsSize", limits.max_push_constants_size, 64),
    ]
    .iter()
    .filter(|(_, has, needs)| has < needs)
    .map(|(name, has, needs)| format!("{name} is {has}, {needs} needed"))
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn enough() -> vk::PhysicalDeviceLimits {
        vk::PhysicalDeviceLimits {
            max_compute_work_group_invocations: 256,
            max_compute_work_group_size: [256, 64, 64],
            max_compute_shared_memory_size: 4096,
            max_per_stage_descriptor_storage_buffers: 24,
            max_push_constants_size: 64,
            ..Default::default()
        }
    }

    #[test]
    fn each_limit_that_is_missed_is_named_with_what_there_is_and_what_is_needed() {
        assert!(missed_limits(&enough()).is_empty());
        let push = vk::PhysicalDeviceLimits { max_push_constants_size: 60, ..enough() };
        assert_eq!(missed_limits(&push), ["maxPushConstantsSize is 60, 64 needed"]);
        assert_eq!(missed_limits(&Default::default()).len(), 5);
    }

    #[test]
    fn every_limit_that_is_checked_is_one_that_hosts_are_told_of() {
        for missed in missed_limits(&Default::default()) {
            let (name, needed) = (missed.split(' ').next(), missed.rsplit(' ').nth(1));
            let told = |n: &Need| n.name.split(" >= ").next() == name && n.name.split(" >= ").nth(1) == needed;
            assert!(REQUIRED.iter().any(told), "{missed}");
        }
    }
}
