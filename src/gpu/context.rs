//! The device that everything runs on: made here, or adopted from a host.

use super::fit::{self, Fit};
use super::memory::Memory;
use super::{check, submit};
use crate::{Error, Result};
use ash::{ext, vk};
use std::collections::BTreeMap;
use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// How to make a context of one's own.
#[derive(Debug, Clone, Default)]
pub struct ContextOptions {
    /// Index of the device in the loader's list, or else part of its name (case does not matter). Without it the best
    /// device is taken: discrete, integrated, virtual, CPU.
    pub device: Option<String>,
    /// Turns on the Khronos validation layer with synchronisation validation; its messages are kept in
    /// [`Context::validation_messages`]. Costs a lot of time.
    pub validation: bool,
}

/// What a host lends. All handles stay the host's and are never destroyed here.
#[derive(Clone, Copy)]
pub struct HostHandles {
    /// The loader's entry point.
    pub get_instance_proc_addr: vk::PFN_vkGetInstanceProcAddr,
    /// Made with `apiVersion` 1.3 or later.
    pub instance: vk::Instance,
    /// A device that [`fit::examine`] finds no fault with.
    pub physical_device: vk::PhysicalDevice,
    /// Made with the features of [`fit::REQUIRED`] enabled; no extension is needed.
    pub device: vk::Device,
    /// Used for uploads while something is created, under the host's external synchronisation.
    pub queue: vk::Queue,
    /// The family of `queue`; it computes.
    pub queue_family: u32,
}

impl std::fmt::Debug for HostHandles {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("HostHandles").field("device", &self.device).finish_non_exhaustive()
    }
}

/// A device to run on. Cheap to clone; the last clone closes what it owns.
#[derive(Clone, Debug)]
pub struct Context {
    pub(crate) inner: Arc<Inner>,
}

/// What buffers, images and pipelines hold on to.
pub(crate) struct Inner {
    pub(crate) device: ash::Device,
    pub(crate) memory: Memory,
    pub(crate) fit: Fit,
    queue: Mutex<vk::Queue>,
    pub(crate) queue_family: u32,
    pub(crate) debug: Option<ext::debug_utils::Device>,
    pub(crate) cache: vk::PipelineCache,
    // What was adopted is not in here. Dropped after `Inner::drop` has let go of the device.
    owned: Option<Owned>,
    // Keeps the loader library open; dropped last.
    _entry: ash::Entry,
}

impl std::fmt::Debug for Inner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Context").field("device", &self.fit.name()).finish_non_exhaustive()
    }
}

type Messages = Mutex<Vec<String>>;

struct Messenger {
    loader: ext::debug_utils::Instance,
    raw: vk::DebugUtilsMessengerEXT,
    // Boxed: the layer holds its address.
    messages: Box<Messages>,
}

impl Context {
    /// Makes an instance and a device.
    ///
    /// # Errors
    /// [`Error::NoLoader`] without a Vulkan loader, [`Error::NoDevice`] if none fits (each with its reason).
    pub fn new(options: &ContextOptions) -> Result<Self> {
        let entry = load()?;
        let mut owned = make_instance(&entry, options.validation)?;
        let fits = examine_all(&owned.instance)?;
        let fit = choose(&fits, options.device.as_deref())?.clone();
        let queue_family = fit.queue_family.unwrap_or_default();
        let device = make_device(&owned.instance, &fit, queue_family)?;
        owned.device = Some(device.clone());
        // SAFETY: the device was made with one queue of this family.
        let queue = unsafe { device.get_device_queue(queue_family, 0) };
        let instance = owned.instance.clone();
        Self::assemble(Parts { entry, owned: Some(owned), instance, device, fit, queue, queue_family })
    }

    /// Adopts a host's device. Nothing of the host's is ever destroyed.
    ///
    /// # Safety
    /// The handles must be valid, belong together, satisfy [`fit::REQUIRED`], and outlive the context and all that is
    /// made from it. `queue` must not be used by another thread while a function that takes the context runs.
    ///
    /// # Errors
    /// [`Error::NoDevice`] with the reasons if the physical device does not fit, or if the queue family is not one that
    /// computes. Whether the device was made with the features enabled cannot be asked of Vulkan.
    pub unsafe fn adopt(host: &HostHandles) -> Result<Self> {
        let functions = ash::StaticFn { get_instance_proc_addr: host.get_instance_proc_addr };
        // SAFETY: the caller vouches for the entry point and for the instance that it belongs to.
        let (entry, instance) =
            unsafe { (ash::Entry::from_static_fn(functions.clone()), ash::Instance::load(&functions, host.instance)) };
        let fit = fit::examine_family(&instance, host.physical_device, host.queue_family);
        if !fit.rejected.is_empty() {
            let rejected = vec![(fit.name(), fit.rejected.join(", "))];
            return Err(Error::NoDevice { selector: None, rejected });
        }
        // SAFETY: the caller vouches for the device.
        let device = unsafe { ash::Device::load(instance.fp_v1_0(), host.device) };
        let (queue, queue_family) = (host.queue, host.queue_family);
        Self::assemble(Parts { entry, owned: None, instance, device, fit, queue, queue_family })
    }

    /// Every device that the loader lists, whether it fits or not.
    ///
    /// # Errors
    /// [`Error::NoLoader`] without a Vulkan loader.
    pub fn devices() -> Result<Vec<Fit>> {
        let entry = load()?;
        let owned = make_instance(&entry, false)?;
        examine_all(&owned.instance)
    }

    /// What is known about the device.
    pub fn fit(&self) -> &Fit {
        &self.inner.fit
    }

    /// Bytes of device memory in use by purpose.
    pub fn memory_table(&self) -> BTreeMap<String, u64> {
        self.inner.memory.table()
    }

    /// What the validation layer said so far; empty without [`ContextOptions::validation`].
    pub fn validation_messages(&self) -> Vec<String> {
        let messages = self.inner.messenger().map(|m| &m.messages);
        messages.map_or_else(Vec::new, |m| m.lock().unwrap_or_else(PoisonError::into_inner).clone())
    }

    fn assemble(parts: Parts) -> Result<Self> {
        // Where something fails, these are dropped in reverse: memory, device, instance, loader.
        let Parts { entry, owned, instance, device, fit, queue, queue_family } = parts;
        let memory = Memory::new(&instance, &device, &fit)?;
        let messenger = owned.as_ref().and_then(|o| o.messenger.as_ref());
        let debug = messenger.map(|_| ext::debug_utils::Device::new(&instance, &device));
        let cache = super::cache::open(&device, &fit)?;
        let queue = Mutex::new(queue);
        let inner = Inner { device, memory, fit, queue, queue_family, debug, cache, owned, _entry: entry };
        Ok(Self { inner: Arc::new(inner) })
    }

    /// Runs commands once and waits: for uploads and read-back, not for frames.
    pub(crate) fn run_once(&self, label: &str, record: impl FnOnce(vk::CommandBuffer)) -> Result<()> {
        submit::run_once(&self.inner, label, record)
    }
}

struct Parts {
    entry: ash::Entry,
    owned: Option<Owned>,
    instance: ash::Instance,
    device: ash::Device,
    fit: Fit,
    queue: vk::Queue,
    queue_family: u32,
}

impl Inner {
    /// The queue, which Vulkan lets one thread at a time submit to: clones of a context share it.
    pub(crate) fn queue(&self) -> MutexGuard<'_, vk::Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn messenger(&self) -> Option<&Messenger> {
        self.owned.as_ref().and_then(|o| o.messenger.as_ref())
    }
}

impl Drop for Inner {
    fn drop(&mut self) {
        super::cache::save(&self.device, self.cache, &self.fit);
        // SAFETY: this is the last reference, so every object made from the device is gone and none of our work is
        // pending; the cache is ours in any case.
        unsafe { self.device.destroy_pipeline_cache(self.cache, None) };
        self.memory.close();
    }
}

/// What a context makes itself, destroyed in reverse order whether a context comes of it or not.
struct Owned {
    instance: ash::Instance,
    messenger: Option<Messenger>,
    device: Option<ash::Device>,
}

impl Drop for Owned {
    fn drop(&mut self) {
        let _making = one_at_a_time();
        // SAFETY: we made all three, whatever was made from them is gone, and they are not used after.
        unsafe {
            if let Some(device) = self.device.take() {
                device.destroy_device(None);
            }
            if let Some(m) = self.messenger.take() {
                m.loader.destroy_debug_utils_messenger(m.raw, None);
            }
            self.instance.destroy_instance(None);
        }
    }
}

fn load() -> Result<ash::Entry> {
    // SAFETY: loading the Vulkan loader runs its initialisers, which are trusted like any system library's.
    unsafe { ash::Entry::load() }.map_err(|e| Error::NoLoader { cause: e.to_string() })
}

/// Held while an instance or a device is made or destroyed. Vulkan lets several threads do that at once, but the validation layer (1.3.239)
/// keeps them in a table that it does not guard, and has crashed where they did.
static MAKING: Mutex<()> = Mutex::new(());

fn one_at_a_time() -> MutexGuard<'static, ()> {
    MAKING.lock().unwrap_or_else(PoisonError::into_inner)
}

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

fn make_instance(entry: &ash::Entry, validation: bool) -> Result<Owned> {
    let app = vk::ApplicationInfo::default().application_name(c"stillray").api_version(fit::API_VERSION);
    let mut layers = Vec::new();
    let mut extensions = Vec::new();
    if validation {
        require_validation_layer(entry)?;
        layers.push(VALIDATION_LAYER.as_ptr());
        extensions.push(ext::debug_utils::NAME.as_ptr());
        extensions.push(ext::validation_features::NAME.as_ptr());
    }
    let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
    let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
    let mut info = vk::InstanceCreateInfo::default()
        .application_info(&app)
        .enabled_layer_names(&layers)
        .enabled_extension_names(&extensions);
    if validation {
        info = info.push_next(&mut features);
    }
    let making = one_at_a_time();
    // SAFETY: all names are static C strings and the chained structures live until the call returns.
    let made = unsafe { entry.create_instance(&info, None) };
    drop(making);
    if made.as_ref().err() == Some(&vk::Result::ERROR_INCOMPATIBLE_DRIVER) {
        // The loader's way of saying that no driver is installed.
        return Err(Error::NoDevice { selector: None, rejected: Vec::new() });
    }
    let instance = check(made, "making an instance")?;
    let mut owned = Owned { instance, messenger: None, device: None };
    if validation {
        owned.messenger = Some(make_messenger(entry, &owned.instance)?);
    }
    Ok(owned)
}

fn require_validation_layer(entry: &ash::Entry) -> Result<()> {
    // SAFETY: no preconditions.
    let layers = check(unsafe { entry.enumerate_instance_layer_properties() }, "listing layers")?;
    if layers.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) {
        return Ok(());
    }
    Err(Error::Setting {
        name: "validation",
        value: "on".to_owned(),
        expected: "VK_LAYER_KHRONOS_validation is not installed: install vulkan-validationlayers".to_owned(),
    })
}

fn make_messenger(entry: &ash::Entry, instance: &ash::Instance) -> Result<Messenger> {
    let loader = ext::debug_utils::Instance::new(entry, instance);
    let messages: Box<Messages> = Box::default();
    let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING)
        .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE)
        .pfn_user_callback(Some(keep_message))
        .user_data(std::ptr::from_ref(&*messages).cast_mut().cast::<c_void>());
    // SAFETY: the user data outlives the messenger: both are in `Messenger`, destroyed together.
    let raw = check(unsafe { loader.create_debug_utils_messenger(&info, None) }, "making a debug messenger")?;
    Ok(Messenger { loader, raw, messages })
}

/// The layer calls this on any thread.
unsafe extern "system" fn keep_message(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the specification makes `data` valid during the call; `user` is the boxed list given at creation.
    unsafe {
        let text = (*data).message_as_c_str().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        if let Some(messages) = user.cast::<Messages>().as_ref() {
            messages.lock().unwrap_or_else(PoisonError::into_inner).push(text);
        }
    }
    vk::FALSE
}

fn examine_all(instance: &ash::Instance) -> Result<Vec<Fit>> {
    // SAFETY: the instance is alive.
    let physical = check(unsafe { instance.enumerate_physical_devices() }, "listing devices")?;
    Ok(physical.into_iter().map(|p| fit::examine(instance, p)).collect())
}

/// The device that the selector means: an index first, then part of a name (`4090` is both); else the best that fits.
fn choose<'a>(fits: &'a [Fit], selector: Option<&str>) -> Result<&'a Fit> {
    let index = selector.and_then(|s| s.parse::<usize>().ok()).filter(|i| *i < fits.len());
    let asked = |i: usize, f: &Fit| match (index, selector) {
        (Some(index), _) => index == i,
        (None, Some(part)) => contains(&f.name(), part),
        (None, None) => true,
    };
    let candidates: Vec<&Fit> = fits.iter().enumerate().filter(|(i, f)| asked(*i, f)).map(|(_, f)| f).collect();
    let best = candidates.iter().filter(|f| f.rejected.is_empty()).min_by_key(|f| f.rank());
    best.copied().ok_or_else(|| {
        let reason = |f: &Fit| {
            let not_asked = || "not the one asked for".to_owned();
            if f.rejected.is_empty() { not_asked() } else { f.rejected.join(", ") }
        };
        let rejected = fits.iter().map(|f| (f.name(), reason(f))).collect();
        Error::NoDevice { selector: selector.map(str::to_owned), rejected }
    })
}

fn contains(name: &str, part: &str) -> bool {
    name.to_lowercase().contains(&part.to_lowercase())
}

fn make_device(instance: &ash::Instance, fit: &Fit, family: u32) -> Result<ash::Device> {
    let priorities = [1.0];
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&priorities)];
    let mut v13 = vk::PhysicalDeviceVulkan13Features::default().synchronization2(true);
    let features = vk::PhysicalDeviceFeatures::default().shader_storage_image_extended_formats(true);
    let info =
        vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_features(&features).push_next(&mut v13);
    let _making = one_at_a_time();
    // SAFETY: the device was enumerated from this instance, and `fit` says that it has the features asked for.
    check(unsafe { instance.create_device(fit.physical, &info, None) }, "making a device")
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // a panic is a failing test
mod tests {
    use super::*;

    fn fit(name: &str, kind: vk::PhysicalDeviceType, rejected: &[&str]) -> Fit {
        let mut properties = vk::PhysicalDeviceProperties { device_type: kind, ..Default::default() };
        for (to, from) in properties.device_name.iter_mut().zip(name.bytes()) {
            *to = from as std::ffi::c_char;
        }
        let rejected = rejected.iter().map(|r| (*r).to_owned()).collect();
        Fit { properties, rejected, ..Fit::default() }
    }

    fn machine() -> Vec<Fit> {
        vec![
            fit("llvmpipe (LLVM 15)", vk::PhysicalDeviceType::CPU, &[]),
            fit("Radeon Old", vk::PhysicalDeviceType::DISCRETE_GPU, &["Vulkan 1.2 is older than 1.3", "no compute"]),
            fit("GeForce RTX 4090", vk::PhysicalDeviceType::DISCRETE_GPU, &[]),
            fit("Intel UHD", vk::PhysicalDeviceType::INTEGRATED_GPU, &[]),
        ]
    }

    #[test]
    fn a_device_is_chosen_by_index_by_name_or_as_the_best_that_fits() {
        let machine = machine();
        let chosen = |selector| choose(&machine, selector).map(Fit::name).unwrap();
        assert_eq!(chosen(None), "GeForce RTX 4090");
        assert_eq!(chosen(Some("3")), "Intel UHD");
        assert_eq!(chosen(Some("LLVM")), "llvmpipe (LLVM 15)");
        assert_eq!(chosen(Some("4090")), "GeForce RTX 4090", "a number that is no index is part of a name");
    }

    #[test]
    fn where_none_fits_every_device_is_named_with_its_reason() {
        let machine = machine();
        for selector in ["1", "radeon", "voodoo", "17"] {
            let error = choose(&machine, Some(selector)).unwrap_err().to_string();
            assert!(error.contains(&format!("'{selector}'")), "{error}");
            assert!(error.contains("Radeon Old: Vulkan 1.2 is older than 1.3, no compute"), "{error}");
            assert!(machine.iter().all(|f| error.contains(&f.name())), "{error}");
        }
        assert!(choose(&[], None).unwrap_err().to_string().contains("install a driver"));
    }
}
