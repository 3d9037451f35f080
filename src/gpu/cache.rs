//! The pipeline cache on disk: `$XDG_CACHE_HOME/stillray/<pipeline cache UUID>.bin`, or below `~/.cache`.
//!
//! Drivers need not survive a damaged cache, so that ours ends with a checksum: what does not have it, or was written by
//! another device or driver, is not handed over and costs no more than the time to compile anew.

use super::check;
use super::fit::Fit;
use crate::Result;
use ash::vk;
use std::io::Write;
use std::path::{Path, PathBuf};

/// A cache with what the last run left of it.
pub(crate) fn open(device: &ash::Device, fit: &Fit) -> Result<vk::PipelineCache> {
    let data = path(fit).and_then(|p| load(&p, fit)).unwrap_or_default();
    let info = vk::PipelineCacheCreateInfo::default().initial_data(&data);
    // SAFETY: the device is alive; the data is as this device and driver wrote it.
    check(unsafe { device.create_pipeline_cache(&info, None) }, "opening the pipeline cache")
}

/// Leaves the cache for the next run.
pub(crate) fn save(device: &ash::Device, cache: vk::PipelineCache, fit: &Fit) {
    // SAFETY: the cache was made from this device and is alive.
    let data = unsafe { device.get_pipeline_cache_data(cache) };
    if let (Some(path), Ok(data)) = (path(fit), data) {
        // Losing the cache is harmless and not worth a message.
        store(&path, &data).ok();
    }
}

fn path(fit: &Fit) -> Option<PathBuf> {
    // The XDG specification ignores relative paths.
    let folder = |variable| std::env::var_os(variable).map(PathBuf::from).filter(|p| p.is_absolute());
    let base = folder("XDG_CACHE_HOME").or_else(|| folder("HOME").map(|home| home.join(".cache")))?;
    let uuid: String = fit.properties.pipeline_cache_uuid.iter().map(|b| format!("{b:02x}")).collect();
    Some(base.join("stillray").join(format!("{uuid}.bin")))
}

/// The driver's data, if the file is whole and this driver's.
fn load(path: &Path, fit: &Fit) -> Option<Vec<u8>> {
    let mut data = std::fs::read(path).ok()?;
    let sum = data.split_off(data.len().checked_sub(8)?);
    (sum == checksum(&data) && belongs(&data, fit)).then_some(data)
}

/// Writes beside the file and renames, so that no run ever reads half of it.
fn store(path: &Path, data: &[u8]) -> std::io::Result<()> {
    let folder = path.parent().unwrap_or(path);
    std::fs::create_dir_all(folder)?;
    let mut file = tempfile::NamedTempFile::new_in(folder)?;
    file.write_all(data)?;
    file.write_all(&checksum(data))?;
    file.persist(path)?;
    Ok(())
}

/// FNV-1a, 64 bits: finds every changed byte, since each step is a bijection.
fn checksum(data: &[u8]) -> [u8; 8] {
    let step = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
    data.iter().fold(0xcbf2_9ce4_8422_2325, step).to_le_bytes()
}

/// The header that drivers must write (specification, "Pipeline Cache Header").
fn belongs(data: &[u8], fit: &Fit) -> bool {
    let word = |i: usize| data.get(4 * i..4 * i + 4).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    word(1) == Some(1)
        && word(2) == Some(fit.properties.vendor_id)
        && word(3) == Some(fit.properties.device_id)
        && data.get(16..32) == Some(&fit.properties.pipeline_cache_uuid[..])
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // a panic is a failing test
mod tests {
    use super::*;

    fn fit(vendor_id: u32) -> Fit {
        let properties = vk::PhysicalDeviceProperties {
            vendor_id,
            device_id: 7,
            pipeline_cache_uuid: [9; 16],
            ..Default::default()
        };
        Fit { properties, ..Fit::default() }
    }

    fn data(fit: &Fit) -> Vec<u8> {
        let words = [32, 1, fit.properties.vendor_id, fit.properties.device_id];
        let header = words.iter().flat_map(|w: &u32| w.to_le_bytes()).chain(fit.properties.pipeline_cache_uuid);
        header.chain(*b"what the driver compiled").collect()
    }

    #[test]
    fn what_was_stored_is_loaded() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stillray").join("a.bin");
        let fit = fit(5);
        assert_eq!(load(&path, &fit), None, "there is none yet");
        for _ in 0..2 {
            store(&path, &data(&fit)).unwrap();
            assert_eq!(load(&path, &fit), Some(data(&fit)));
        }
        assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 1, "no temporary file is left");
    }

    #[test]
    fn a_file_of_another_device_is_ignored() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        store(&path, &data(&fit(5))).unwrap();
        assert_eq!(load(&path, &fit(6)), None);
    }

    #[test]
    fn a_file_with_any_bit_changed_or_any_tail_missing_is_ignored() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        let fit = fit(5);
        store(&path, &data(&fit)).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for bit in 0..8 * whole.len() {
            let mut damaged = whole.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            std::fs::write(&path, &damaged).unwrap();
            assert_eq!(load(&path, &fit), None, "bit {bit}");
        }
        for length in 0..whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert_eq!(load(&path, &fit), None, "{length} bytes");
        }
    }
}
