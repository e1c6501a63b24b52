//! The devices that a renderer can run on.

use serde::Serialize;
use std::fmt;
use wgpu::{Backend, Backends, DeviceType};

/// A device that can render, as `acm doctor` prints it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct AdapterReport {
    /// The interface it is reached by: `vulkan` or `gl`.
    pub backend: String,
    /// What it calls itself.
    pub name: String,
    /// The driver and its version, as far as it tells.
    pub driver: String,
    /// Whether the processor does the drawing.
    pub is_software: bool,
}

impl fmt::Display for AdapterReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let on = if self.is_software { "on the processor" } else { "on a graphics card" };
        write!(f, "{} by {} ({on})", self.name, self.backend)
    }
}

/// The devices of this machine, in the order in which a renderer tries them. Empty if no driver is installed.
///
/// The environment variable `WGPU_BACKEND` (`vulkan` or `gl`) limits the choice.
pub fn adapters() -> Vec<AdapterReport> {
    candidates().iter().map(|adapter| report(&adapter.get_info())).collect()
}

/// The adapters that we can use, best first: graphics cards before processors, Vulkan before GL.
pub(crate) fn candidates() -> Vec<wgpu::Adapter> {
    let wanted = Backends::from_env().unwrap_or(Backends::VULKAN | Backends::GL) & (Backends::VULKAN | Backends::GL);
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wanted;
    let instance = wgpu::Instance::new(descriptor);
    let mut found = pollster::block_on(instance.enumerate_adapters(wanted));
    found.sort_by_key(|adapter| rank(&adapter.get_info()));
    found
}

pub(crate) fn report(info: &wgpu::AdapterInfo) -> AdapterReport {
    AdapterReport {
        backend: info.backend.to_str().to_owned(),
        name: info.name.clone(),
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        is_software: is_software(info),
    }
}

fn rank(info: &wgpu::AdapterInfo) -> (u8, u8) {
    let kind = match info.device_type {
        DeviceType::DiscreteGpu => 0,
        DeviceType::IntegratedGpu => 1,
        DeviceType::VirtualGpu => 2,
        DeviceType::Other if !is_software(info) => 3,
        DeviceType::Other | DeviceType::Cpu => 4,
    };
    (kind, u8::from(info.backend != Backend::Vulkan))
}

fn is_software(info: &wgpu::AdapterInfo) -> bool {
    let name = info.name.to_lowercase();
    info.device_type == DeviceType::Cpu || ["llvmpipe", "softpipe", "swiftshader"].iter().any(|s| name.contains(s))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_adapter_names_its_backend_and_itself() {
        for adapter in adapters() {
            assert!(["vulkan", "gl"].contains(&adapter.backend.as_str()), "{adapter:?}");
            assert!(!adapter.name.is_empty(), "{adapter:?}");
        }
    }
}
