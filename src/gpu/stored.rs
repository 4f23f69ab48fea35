//! Compiled kernels on disk, for Vulkan drivers that keep none themselves.
//!
//! A driver hands out what it compiled as one block of data, which wgpu wraps
//! ([`wgpu::PipelineCache`]). A file for each adapter and version of its driver holds it from run
//! to run. The file only saves time: a missing, broken or foreign one is ignored, and so is a
//! folder that cannot be written.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::adapter::AdapterDescription;
use super::loops::hash;
use crate::io::atomic::write_whole;

/// A driver that keeps compiled kernels on disk itself.
struct Keeper {
    /// A word of [`AdapterDescription::driver`].
    driver: &'static str,
    /// Whether it does so for root too, as whom programs in containers often run.
    for_root: bool,
}

/// The Vulkan drivers that are known to keep compiled kernels on disk.
const KEEPERS: [Keeper; 2] = [
    // "MESA_SHADER_CACHE_DIR" in https://docs.mesa3d.org/envvars.html. All of Mesa's drivers name
    // Mesa in their version, and llvmpipe keeps its machine code there too.
    Keeper { driver: "Mesa", for_root: true },
    // "__GL_SHADER_DISK_CACHE" in the README of NVIDIA's driver for Linux: off by default for root.
    Keeper { driver: "NVIDIA", for_root: false },
];

/// Largest content of a file, bytes. A cache that outgrows it is begun anew.
const MOST_BYTES: u64 = 64 << 20;

/// First bytes of a file; the hash of the rest and of the file's name follows them.
const MAGIC: [u8; 8] = *b"epsplat1";

/// Bytes before the content.
const HEAD: usize = 16;

/// Whether the driver of an adapter keeps compiled kernels on disk itself.
fn keeps(adapter: &AdapterDescription, root: bool) -> bool {
    KEEPERS.iter().any(|keeper| adapter.driver.contains(keeper.driver) && (keeper.for_root || !root))
}

/// The number of the user who owns a file; `None` where users have none.
fn owner(path: &Path) -> Option<u32> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        fs::metadata(path).ok().map(|of| of.uid())
    }
    #[cfg(not(unix))]
    {
        let _ = path;
        None
    }
}

/// The user that the process runs as; `None` where the system does not tell.
fn own_user() -> Option<u32> {
    owner(Path::new("/proc/self"))
}

/// Whether the process runs as root.
fn is_root() -> bool {
    own_user() == Some(0)
}

/// The user's folder for caches of this program.
fn usual_folder() -> Option<PathBuf> {
    let absolute = |name| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let caches = if cfg!(windows) {
        absolute("LOCALAPPDATA")
    } else if cfg!(target_vendor = "apple") {
        absolute("HOME").map(|home| home.join("Library/Caches"))
    } else {
        absolute("XDG_CACHE_HOME").or_else(|| absolute("HOME").map(|home| home.join(".cache")))
    };
    caches.map(|caches| caches.join("epsplat"))
}

/// Returns the folder of the files: none for `off`, else the one that `asked` names, else the
/// `usual` one if the driver keeps nothing itself.
fn folder(asked: Option<&OsStr>, usual: Option<PathBuf>, keeps: bool) -> Option<PathBuf> {
    match asked {
        Some(asked) if asked == "off" => None,
        Some(asked) if !asked.is_empty() => Some(asked.into()),
        _ => usual.filter(|_| !keeps),
    }
}

/// Returns the file of compiled kernels of an adapter; `None` if there should be none.
///
/// The environment variable `EPSPLAT_CACHE` is `off` or names a folder, which is then used for
/// every driver.
pub(super) fn file_of(adapter: &AdapterDescription, handle: &wgpu::Adapter) -> Option<PathBuf> {
    let name = wgpu::util::pipeline_cache_key(&handle.get_info())?;
    let asked = std::env::var_os("EPSPLAT_CACHE");
    let folder = folder(asked.as_deref(), usual_folder(), keeps(adapter, is_root()))?;
    // Drivers should tell versions apart by Vulkan's pipelineCacheUUID, but that of Mesa 22.3.6's
    // lavapipe is the same text in every build: "val-%s".
    let name = format!("{name}_{:016x}", hash(adapter.driver.bytes()));
    handle.features().contains(wgpu::Features::PIPELINE_CACHE).then(|| folder.join(name))
}

/// The hash of a file's name and its content.
fn sum(path: &Path, content: &[u8]) -> u64 {
    let name = path.file_name().map(OsStr::as_encoded_bytes).unwrap_or_default();
    hash(name.iter().chain(content).copied())
}

/// Returns the content of a file, and its hash. `None` for a file that is missing, too large, of
/// another user, or not as it was written under its name.
fn read(path: &Path) -> Option<(Vec<u8>, u64)> {
    if own_user().is_some_and(|user| owner(path) != Some(user)) {
        return None;
    }
    let mut bytes = Vec::new();
    let file = File::open(path).ok().filter(|file| file.metadata().is_ok_and(|about| about.is_file()))?;
    file.take(MOST_BYTES + HEAD as u64 + 1).read_to_end(&mut bytes).ok()?;
    let (head, content) = bytes.split_at_checked(HEAD)?;
    let sum = sum(path, content);
    let whole = content.len() as u64 <= MOST_BYTES && head[..8] == MAGIC && head[8..] == sum.to_le_bytes();
    whole.then(|| (bytes.split_off(HEAD), sum))
}

/// Writes a file; it appears whole or not at all.
fn write(path: &Path, content: &[u8], sum: u64) -> crate::Result<()> {
    if let Some(folder) = path.parent() {
        let mut builder = fs::DirBuilder::new();
        builder.recursive(true);
        // Drivers trust the content, so nobody else may write it.
        #[cfg(unix)]
        std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
        builder.create(folder).map_err(|error| crate::Error::write(folder, error))?;
    }
    write_whole(path, |file| {
        file.write_all(&MAGIC)?;
        file.write_all(&sum.to_le_bytes())?;
        file.write_all(content)
    })
}

/// The cache of a device, and the file that keeps it.
pub(super) struct Stored {
    /// The driver's cache, which pipelines are made with.
    pub cache: wgpu::PipelineCache,
    path: PathBuf,
    /// The hash of the content as it was last read or written; `None` after a failure, which is not
    /// tried again.
    last: Mutex<Option<u64>>,
}

impl Stored {
    /// Creates the cache of `device` from the file at `path`. `None` if the device refuses.
    pub fn open(device: &wgpu::Device, path: PathBuf) -> Option<Self> {
        let (data, last) = read(&path).unzip();
        let descriptor =
            wgpu::PipelineCacheDescriptor { label: Some("epsplat"), data: data.as_deref(), fallback: true };
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
        // SAFETY: the data are those that `get_data` gave for an adapter of the same key
        // (`wgpu::util::pipeline_cache_key`) and the same driver: the file's name is made of both,
        // and the file has the hash of its name and its bytes. wgpu then compares vendor, device,
        // size of pointers, and the identity of driver and version (Vulkan's `pipelineCacheUUID`),
        // and drops data that differ. The driver checks its own header once more. The hash keeps
        // out accidents, not forgers: files of other users are not read (`read`).
        #[allow(unsafe_code)]
        let cache = unsafe { device.create_pipeline_cache(&descriptor) };
        if let Some(error) = pollster::block_on(scope.pop()) {
            log::debug!("there is no cache of compiled kernels: {error}");
            return None;
        }
        Some(Self { cache, path, last: Mutex::new(Some(last.unwrap_or_default())) })
    }

    /// Writes the file if the driver's cache has changed.
    pub fn save(&self) {
        let Some(data) = self.cache.get_data() else { return };
        let sum = sum(&self.path, &data);
        // A poisoned lock means that another thread panicked; the number is intact.
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if last.is_none_or(|last| last == sum) {
            return;
        }
        *last = Some(sum);
        if data.len() as u64 > MOST_BYTES {
            // The next run begins with an empty cache.
            let _ = fs::remove_file(&self.path);
        } else if let Err(error) = write(&self.path, &data, sum) {
            log::debug!("compiled kernels are not kept: {error}");
            *last = None;
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn drivers_that_keep_their_own_get_no_folder_unless_it_is_asked_for() {
        let of = |driver: &str| AdapterDescription { driver: driver.to_owned(), ..AdapterDescription::core() };
        let (mesa, nvidia) = (of("radv Mesa 24.1.0"), of("NVIDIA 550.54.14"));
        let other = of("Qualcomm Technologies Inc. Adreno Vulkan Driver 512.762");
        assert_eq!([&mesa, &nvidia, &other].map(|adapter| keeps(adapter, false)), [true, true, false]);
        assert_eq!([&mesa, &nvidia, &other].map(|adapter| keeps(adapter, true)), [true, false, false]);
        let chosen = |asked: &str, keeps| folder(Some(OsStr::new(asked)), Some("usual".into()), keeps);
        assert_eq!(["off", "", "named"].map(|asked| chosen(asked, true)), [None, None, Some("named".into())]);
        assert_eq!(["off", ""].map(|asked| chosen(asked, false)), [None, Some("usual".into())]);
        assert_eq!(folder(None, Some("usual".into()), false), Some("usual".into()));
        assert_eq!(folder(None, Some("usual".into()), true), None);
    }

    /// A file is read as it was written, under its own name only.
    #[test]
    fn a_file_that_is_not_whole_is_ignored() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/folder/key");
        let content = b"what a driver compiled";
        write(&path, content, sum(&path, content)).unwrap();
        assert_eq!(read(&path).unwrap().0, content);
        let bytes = fs::read(&path).unwrap();
        let other = path.with_file_name("other");
        fs::copy(&path, &other).unwrap();
        assert!(read(&other).is_none());
        for length in 0..bytes.len() {
            fs::write(&path, &bytes[..length]).unwrap();
            assert!(read(&path).is_none(), "{length}");
        }
        for place in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[place] ^= 1;
            fs::write(&path, changed).unwrap();
            assert!(read(&path).is_none(), "{place}");
        }
        fs::write(&path, [&bytes[..], b"more"].concat()).unwrap();
        assert!(read(&path).is_none() && read(folder.path()).is_none());
    }

    #[test]
    fn a_file_has_a_largest_size() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("key");
        let long = vec![0; MOST_BYTES as usize + 1];
        write(&path, &long, sum(&path, &long)).unwrap();
        assert!(read(&path).is_none());
        write(&path, &long[1..], sum(&path, &long[1..])).unwrap();
        assert_eq!(read(&path).unwrap().0.len() as u64, MOST_BYTES);
    }
}
