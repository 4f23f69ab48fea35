//! The functions of an MPI library (MPI 3.0, chapters 5 and 8), which is loaded at run time.
//!
//! Both families have the same functions and differ in their handles: addresses of variables in
//! Open MPI (`mpi.h`), fixed integers in MPICH (the MPICH ABI compatibility initiative).

// The library is C. Each call says why it is sound.
#![allow(unsafe_code)]

use std::ffi::{c_char, c_int, c_void};
use std::time::Duration;

use super::job::{Family, Job};
use crate::error::{Error, Result};

/// The variable by which users name a library.
pub const VARIABLE: &str = "EPSPLAT_MPI";

/// The names of the libraries of each family, in the order in which they are tried.
const OPEN_MPI: [&str; 3] = ["libmpi.so.40", "libmpi.so.80", "libmpi.so"];
const MPICH: [&str; 4] = ["libmpich.so.12", "libmpi.so.12", "libmpi_cray.so.12", "libmpi_gnu.so.12"];

/// `MPI_COMM_WORLD` and `MPI_BYTE` of MPICH.
const MPICH_WORLD: c_int = 0x4400_0000;
const MPICH_BYTE: c_int = 0x4c00_010d;

/// `MPI_STATUS_IGNORE`, as an address, and `MPI_ANY_SOURCE` of both families.
const OPEN: (usize, c_int) = (0, -1);
const MPICH_OWN: (usize, c_int) = (1, -2);

/// The longest time between two looks at whether all processes have come.
const LONGEST_WAIT: Duration = Duration::from_millis(1);

/// `MPI_THREAD_FUNNELED`: there are other threads, and only the one that initialises calls.
const FUNNELED: c_int = 1;

/// `MPI_MAX_LIBRARY_VERSION_STRING`, of both families at most.
const MOST_VERSION: usize = 8192;

type InitThread = unsafe extern "C" fn(*mut c_int, *mut *mut *mut c_char, c_int, *mut c_int) -> c_int;
type Number<H> = unsafe extern "C" fn(H, *mut c_int) -> c_int;
type AllToAll<H> = unsafe extern "C" fn(*const c_void, c_int, H, *mut c_void, c_int, H, H) -> c_int;
type AllToAllV<H> = unsafe extern "C" fn(
    *const c_void,
    *const c_int,
    *const c_int,
    H,
    *mut c_void,
    *const c_int,
    *const c_int,
    H,
    H,
) -> c_int;

type Send<H> = unsafe extern "C" fn(*const c_void, c_int, H, c_int, c_int, H) -> c_int;
type Receive<H> = unsafe extern "C" fn(*mut c_void, c_int, H, c_int, c_int, H, *mut c_void) -> c_int;
type Probe<H> = unsafe extern "C" fn(c_int, c_int, H, *mut c_int, *mut c_void) -> c_int;

/// The tag of messages between two processes.
const TAG: c_int = 1;

/// A process in [`Library::receive`].
#[derive(Clone, Copy)]
pub enum From {
    /// The process of this number.
    Rank(c_int),
    /// Any process.
    Any,
}

/// The functions with handles of the type `H`.
struct Functions<H> {
    world: H,
    byte: H,
    rank: Number<H>,
    size: Number<H>,
    all_to_all: AllToAll<H>,
    all_to_all_v: AllToAllV<H>,
    barrier: unsafe extern "C" fn(H, *mut H) -> c_int,
    test: unsafe extern "C" fn(*mut H, *mut c_int, *mut c_void) -> c_int,
    send: Send<H>,
    receive: Receive<H>,
    probe: Probe<H>,
    abort: unsafe extern "C" fn(H, c_int) -> c_int,
    /// `MPI_STATUS_IGNORE`.
    no_status: usize,
    /// `MPI_ANY_SOURCE`.
    any: c_int,
}

/// The functions of either family. Addresses are passed as integers of their size.
enum Either {
    Open(Functions<usize>),
    Mpich(Functions<c_int>),
}

/// Evaluates `$call` with the functions of either family as `$own`.
macro_rules! call {
    ($library:expr, |$own:ident| $call:expr) => {
        match &$library.functions {
            Either::Open($own) => $call,
            Either::Mpich($own) => $call,
        }
    };
}

/// A loaded library, which the process has initialised.
pub struct Library {
    functions: Either,
    finalize: unsafe extern "C" fn() -> c_int,
    version: String,
}

impl Library {
    /// Loads the library that `given` names, or else one of the job's family, and initialises it.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is none, or if it does not start.
    pub fn load(job: &Job, given: Option<String>) -> Result<Self> {
        let names: Vec<String> = match given {
            Some(name) => vec![name],
            None => {
                let likely =
                    if job.family == Family::OpenMpi { [&OPEN_MPI[..], &MPICH] } else { [&MPICH[..], &OPEN_MPI] };
                likely.concat().into_iter().map(str::to_owned).collect()
            }
        };
        let loaded = names.iter().find_map(|name| opened(name));
        let Some(library) = loaded else {
            return Err(Error::Usage(format!(
                "this is one of {} processes of an MPI job, and no MPI library could be loaded ({}): name it, as in \
                 {VARIABLE}=/path/libmpi.so",
                job.size,
                names.join(", ")
            )));
        };
        Self::of(library)
    }

    fn of(library: &'static libloading::Library) -> Result<Self> {
        // SAFETY: the types are those of the MPI standard's C functions.
        let (init, version, finalize) = unsafe {
            (
                symbol::<InitThread>(library, "MPI_Init_thread")?,
                symbol::<unsafe extern "C" fn(*mut c_char, *mut c_int) -> c_int>(library, "MPI_Get_library_version")?,
                symbol::<unsafe extern "C" fn() -> c_int>(library, "MPI_Finalize")?,
            )
        };
        // SAFETY: Open MPI exports the variables whose addresses are its handles.
        let handles =
            unsafe { (symbol::<usize>(library, "ompi_mpi_comm_world"), symbol::<usize>(library, "ompi_mpi_byte")) };
        let functions = match handles {
            (Ok(world), Ok(byte)) => Either::Open(Functions::of(library, [world, byte], OPEN)?),
            _ => Either::Mpich(Functions::of(library, [MPICH_WORLD, MPICH_BYTE], MPICH_OWN)?),
        };
        let mut text = vec![0u8; MOST_VERSION];
        let mut length = 0;
        // SAFETY: this function may be called before the library is initialised; the buffer is as
        // long as the standard's constant.
        unsafe { version(text.as_mut_ptr().cast(), &raw mut length) };
        text.truncate(usize::try_from(length).unwrap_or(0).min(MOST_VERSION));
        let text = String::from_utf8_lossy(&text).replace(char::is_control, " ");
        let mut provided = 0;
        // SAFETY: MPI 2 and later take null pointers for the arguments of main.
        checked("MPI_Init_thread", unsafe {
            init(std::ptr::null_mut(), std::ptr::null_mut(), FUNNELED, &raw mut provided)
        })?;
        Ok(Self { functions, finalize, version: text.trim().to_owned() })
    }

    /// The name and version of the library.
    pub fn version(&self) -> &str {
        &self.version
    }

    /// The number of this process and the number of processes.
    ///
    /// # Errors
    /// [`Error::Usage`] with the library's code.
    pub fn started(&self) -> Result<[c_int; 2]> {
        let (mut rank, mut size) = (0, 0);
        // SAFETY: the library is initialised, and the pointers are those of integers.
        let codes =
            unsafe { call!(self, |own| [(own.rank)(own.world, &raw mut rank), (own.size)(own.world, &raw mut size)]) };
        checked("MPI_Comm_rank", codes[0])?;
        checked("MPI_Comm_size", codes[1])?;
        Ok([rank, size])
    }

    /// Waits until all processes have called this. The libraries wait at full speed of a processor
    /// core, which other processes of the machine may need to come here, so this one sleeps.
    ///
    /// # Errors
    /// [`Error::Usage`] with the library's code.
    pub fn meet(&self) -> Result<()> {
        call!(self, |own| own.meet())
    }

    /// Sends the same number of words to each process, in the order of processes, and returns those
    /// of each.
    ///
    /// # Errors
    /// [`Error::Usage`] with the library's code.
    pub fn all_to_all(&self, words: &[u64]) -> Result<Vec<u64>> {
        let size = usize::try_from(self.started()?[1]).unwrap_or(1).max(1);
        let each = (words.len() / size * size_of::<u64>()) as c_int;
        let mut into = vec![0u64; words.len()];
        // SAFETY: both buffers hold `each` bytes for each process of the job.
        let code = unsafe {
            call!(self, |own| (own.all_to_all)(
                words.as_ptr().cast(),
                each,
                own.byte,
                into.as_mut_ptr().cast(),
                each,
                own.byte,
                own.world
            ))
        };
        checked("MPI_Alltoall", code)?;
        Ok(into)
    }

    /// Sends bytes to each process and takes those of each, with their numbers and places in the
    /// buffers.
    ///
    /// # Errors
    /// [`Error::Usage`] with the library's code.
    pub fn all_to_all_v(
        &self,
        (out, sent): (&[u8], &[Vec<c_int>; 2]),
        (into, got): (&mut [u8], &[Vec<c_int>; 2]),
    ) -> Result<()> {
        // SAFETY: there is a count and a place for each process of the job, and the buffers are as
        // long as the counts together.
        let code = unsafe {
            call!(self, |own| (own.all_to_all_v)(
                out.as_ptr().cast(),
                sent[0].as_ptr(),
                sent[1].as_ptr(),
                own.byte,
                into.as_mut_ptr().cast(),
                got[0].as_ptr(),
                got[1].as_ptr(),
                own.byte,
                own.world
            ))
        };
        checked("MPI_Alltoallv", code)
    }

    /// Sends a number to a process, which receives it by [`Library::receive`].
    ///
    /// # Errors
    /// [`Error::Usage`] with the library's code.
    pub fn send(&self, number: u64, to: c_int) -> Result<()> {
        let bytes = number.to_le_bytes();
        let count = bytes.len() as c_int;
        // SAFETY: the buffer has `count` bytes.
        let code = unsafe { call!(self, |own| (own.send)(bytes.as_ptr().cast(), count, own.byte, to, TAG, own.world)) };
        checked("MPI_Send", code)
    }

    /// The number that a process has sent, if it has arrived.
    ///
    /// # Errors
    /// [`Error::Usage`] with the library's code.
    pub fn receive(&self, from: From) -> Result<Option<u64>> {
        call!(self, |own| own.received(from))
    }

    /// Ends all processes of the job with this exit code.
    pub fn abort(&self, code: u8) {
        // SAFETY: the library is initialised.
        unsafe { call!(self, |own| (own.abort)(own.world, code.into())) };
    }

    /// Leaves the job. No other function is called after it.
    pub fn finalize(&self) {
        // SAFETY: the library is initialised, and all processes of the job call this.
        unsafe { (self.finalize)() };
    }
}

impl<H: Copy> Functions<H> {
    /// As [`Library::receive`].
    fn received(&self, from: From) -> Result<Option<u64>> {
        let source = if let From::Rank(rank) = from { rank } else { self.any };
        let (mut arrived, no_status) = (0, self.no_status as *mut c_void);
        // SAFETY: the pointer is that of an integer, and a status is not asked for.
        let code = unsafe { (self.probe)(source, TAG, self.world, &raw mut arrived, no_status) };
        checked("MPI_Iprobe", code)?;
        if arrived == 0 {
            return Ok(None);
        }
        let mut bytes = [0u8; 8];
        let count = bytes.len() as c_int;
        // SAFETY: the buffer has `count` bytes, as many as each message of this tag.
        let code =
            unsafe { (self.receive)(bytes.as_mut_ptr().cast(), count, self.byte, source, TAG, self.world, no_status) };
        checked("MPI_Recv", code)?;
        Ok(Some(u64::from_le_bytes(bytes)))
    }

    /// As [`Library::meet`].
    fn meet(&self) -> Result<()> {
        let mut request = self.world;
        // SAFETY: the library writes the request before it is read.
        checked("MPI_Ibarrier", unsafe { (self.barrier)(self.world, &raw mut request) })?;
        let mut pause = Duration::from_micros(10);
        loop {
            let mut done = 0;
            // SAFETY: the request is that of the barrier, and is not used after it is done.
            let code = unsafe { (self.test)(&raw mut request, &raw mut done, self.no_status as *mut c_void) };
            checked("MPI_Test", code)?;
            if done != 0 {
                return Ok(());
            }
            std::thread::sleep(pause);
            pause = (2 * pause).min(LONGEST_WAIT);
        }
    }

    fn of(
        library: &'static libloading::Library,
        [world, byte]: [H; 2],
        (no_status, any): (usize, c_int),
    ) -> Result<Self> {
        // SAFETY: the types are those of the MPI standard's C functions, with the handles of the
        // library's family.
        unsafe {
            Ok(Self {
                world,
                byte,
                rank: symbol(library, "MPI_Comm_rank")?,
                size: symbol(library, "MPI_Comm_size")?,
                all_to_all: symbol(library, "MPI_Alltoall")?,
                all_to_all_v: symbol(library, "MPI_Alltoallv")?,
                barrier: symbol(library, "MPI_Ibarrier")?,
                test: symbol(library, "MPI_Test")?,
                send: symbol(library, "MPI_Send")?,
                receive: symbol(library, "MPI_Recv")?,
                probe: symbol(library, "MPI_Iprobe")?,
                abort: symbol(library, "MPI_Abort")?,
                no_status,
                any,
            })
        }
    }
}

/// Loads a library for the rest of the process, with its symbols for its own plugins; `None` if it
/// cannot be loaded.
fn opened(name: &str) -> Option<&'static libloading::Library> {
    #[cfg(unix)]
    let opened = {
        use libloading::os::unix::{Library, RTLD_GLOBAL, RTLD_NOW};
        // SAFETY: loading runs the library's initialisers; it is the MPI library of the system or
        // the one that the user named.
        unsafe { Library::open(Some(name), RTLD_NOW | RTLD_GLOBAL) }.map(libloading::Library::from)
    };
    #[cfg(not(unix))]
    // SAFETY: as above.
    let opened = unsafe { libloading::Library::new(name) };
    // It stays loaded: the library's threads may outlive its last call.
    opened.ok().map(|library| &*Box::leak(Box::new(library)))
}

/// The address of a function or a variable, as `T`.
///
/// # Safety
/// `T` has the type of the symbol, or is an integer of the size of an address.
unsafe fn symbol<T: Copy>(library: &'static libloading::Library, name: &str) -> Result<T> {
    // SAFETY: the caller's promise.
    let found = unsafe { library.get::<T>(name.as_bytes()) };
    found.map(|symbol| *symbol).map_err(|_| {
        Error::Usage(format!(
            "the MPI library has no function {name}: name another one, as in {VARIABLE}=/path/libmpi.so"
        ))
    })
}

fn checked(name: &str, code: c_int) -> Result<()> {
    match code {
        0 => Ok(()),
        code => Err(Error::Usage(format!("{name} failed with the code {code}"))),
    }
}
