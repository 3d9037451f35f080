//! A host as an engine would be: it makes instance, device, queue and command buffers itself, lends them, and listens to
//! the validation layer until the last of them is destroyed, so that whatever leaks is heard of.

use ash::{ext, vk};
use std::ffi::c_void;
use std::sync::Mutex;
use stillray::gpu::{Context, HostHandles, fit};

type Messages = Mutex<Vec<String>>;

pub struct Host {
    pub entry: ash::Entry,
    pub instance: ash::Instance,
    pub physical: vk::PhysicalDevice,
    pub device: ash::Device,
    pub queue: vk::Queue,
    pub family: u32,
    pub pool: vk::CommandPool,
    messenger: (ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT),
    messages: Box<Messages>,
}

unsafe extern "system" fn keep(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes valid data; `user` is the boxed list, which outlives the messenger.
    unsafe {
        let text = (*data).message_as_c_str().unwrap().to_string_lossy().into_owned();
        user.cast::<Messages>().as_ref().unwrap().lock().unwrap().push(text);
    }
    vk::FALSE
}

impl Host {
    pub fn new() -> Self {
        // SAFETY: every handle is made in order from those before it and described completely; `close` destroys them.
        unsafe {
            let entry = ash::Entry::load().expect("a Vulkan loader");
            let app = vk::ApplicationInfo::default().api_version(fit::API_VERSION);
            let layers = [c"VK_LAYER_KHRONOS_validation".as_ptr()];
            let extensions = [ext::debug_utils::NAME.as_ptr(), ext::validation_features::NAME.as_ptr()];
            let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
            let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
            let info = vk::InstanceCreateInfo::default()
                .application_info(&app)
                .enabled_layer_names(&layers)
                .enabled_extension_names(&extensions)
                .push_next(&mut features);
            let instance = entry.create_instance(&info, None).expect("an instance with the validation layer");
            let messages: Box<Messages> = Box::default();
            let loader = ext::debug_utils::Instance::new(&entry, &instance);
            let severity =
                vk::DebugUtilsMessageSeverityFlagsEXT::ERROR | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING;
            let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
                .message_severity(severity)
                .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
                .pfn_user_callback(Some(keep))
                .user_data(std::ptr::from_ref(&*messages).cast_mut().cast());
            let messenger = loader.create_debug_utils_messenger(&info, None).unwrap();

            let all: Vec<fit::Fit> = instance
                .enumerate_physical_devices()
                .unwrap()
                .into_iter()
                .map(|physical| fit::examine(&instance, physical))
                .collect();
            let best =
                all.iter().filter(|f| f.rejected.is_empty()).min_by_key(|f| f.rank()).expect("a device that fits");
            let (physical, family) = (best.physical, best.queue_family.unwrap());
            let priorities = [1.0];
            let queues =
                [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&priorities)];
            let mut v13 = vk::PhysicalDeviceVulkan13Features::default().synchronization2(true);
            let features = vk::PhysicalDeviceFeatures::default().shader_storage_image_extended_formats(true);
            let info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_features(&features)
                .push_next(&mut v13);
            let device = instance.create_device(physical, &info, None).unwrap();
            let queue = device.get_device_queue(family, 0);
            let info = vk::CommandPoolCreateInfo::default()
                .queue_family_index(family)
                .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
            let pool = device.create_command_pool(&info, None).unwrap();
            Self { entry, instance, physical, device, queue, family, pool, messenger: (loader, messenger), messages }
        }
    }

    pub fn handles(&self) -> HostHandles {
        HostHandles {
            get_instance_proc_addr: self.entry.static_fn().get_instance_proc_addr,
            instance: self.instance.handle(),
            physical_device: self.physical,
            device: self.device.handle(),
            queue: self.queue,
            queue_family: self.family,
        }
    }

    pub fn adopted(&self) -> Context {
        // SAFETY: the handles belong together and were made with what `fit` asks for; tests drop contexts before `close`.
        unsafe { Context::adopt(&self.handles()) }.unwrap()
    }

    /// A command buffer that is being recorded.
    pub fn begin(&self) -> vk::CommandBuffer {
        let info = vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
        // SAFETY: the pool is the device's, and used by one thread.
        unsafe {
            let commands = self.device.allocate_command_buffers(&info).unwrap()[0];
            self.device.begin_command_buffer(commands, &vk::CommandBufferBeginInfo::default()).unwrap();
            commands
        }
    }

    /// Ends recording and submits; the fence tells when it has run.
    pub fn submit(&self, commands: vk::CommandBuffer) -> vk::Fence {
        // SAFETY: `begin` made the command buffer, and it is submitted once.
        unsafe {
            self.device.end_command_buffer(commands).unwrap();
            let fence = self.device.create_fence(&vk::FenceCreateInfo::default(), None).unwrap();
            let buffers = [commands];
            let submit = [vk::SubmitInfo::default().command_buffers(&buffers)];
            self.device.queue_submit(self.queue, &submit, fence).unwrap();
            fence
        }
    }

    /// Waits for a submission.
    pub fn wait(&self, fence: vk::Fence) {
        // SAFETY: the fence was submitted, and is not used after.
        unsafe {
            self.device.wait_for_fences(&[fence], true, u64::MAX).unwrap();
            self.device.destroy_fence(fence, None);
        }
    }

    /// What the layer has said so far.
    pub fn messages(&self) -> Vec<String> {
        self.messages.lock().unwrap().clone()
    }

    /// Destroys everything and returns all that the layer said, to the very end.
    pub fn close(self) -> Vec<String> {
        // SAFETY: all were made in `new`, nothing of the device's is pending, and nothing is used after.
        unsafe {
            self.device.device_wait_idle().unwrap();
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_device(None);
            self.messenger.0.destroy_debug_utils_messenger(self.messenger.1, None);
            self.instance.destroy_instance(None);
        }
        self.messages()
    }

    /// Closes, and fails if the layer said anything.
    pub fn close_clean(self) {
        let messages = self.close();
        assert!(messages.is_empty(), "validation messages:\n{}", messages.join("\n"));
    }
}
