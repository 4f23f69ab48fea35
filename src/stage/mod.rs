//! Makes pictures from files and options, for the command line, studies and callers of the library.
//!
//! ```text
//! Scene::open    lists the files; nothing is read yet
//! Renderer::new  settles the options, opens the device, and reads what all views share
//! frame(view)    reads what else the view needs, and renders
//! ```

mod ahead;
mod coloring;
mod drawn;
mod encode;
mod extent;
mod files;
mod given;
mod heights;
mod in_part;
mod lens;
mod levels;
#[cfg(feature = "parts")]
mod machines;
mod map;
mod memory;
mod meshes;
mod octrees;
mod overdraw;
mod picture;
mod refined;
mod renderer;
mod settings;
mod shares;
mod tiles;
mod tree;
mod turntable;
mod view;
mod visible;
mod whole;

use std::borrow::Cow;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

pub use self::files::Files;
pub use self::given::Given;
pub use self::in_part::ReadReport;
#[cfg(feature = "parts")]
pub use self::machines::{Merged, Part, Ranked, merge, merge_files};
pub use self::map::Survey;
pub use self::picture::Picture;
pub use self::renderer::Renderer;
pub use self::view::{View, ViewReport};
pub use self::visible::Visible;

use self::coloring::Coloring;
use self::whole::{Making, Whole};
use crate::address;
use crate::error::{Error, Result};
use crate::io::Points;
use crate::network::Network;
use crate::options::{DeviceOptions, RenderOptions, SceneOptions, SurfelOptions, TriangleOptions};
use crate::plan::BackendName;
use crate::progress::Progress;
use crate::scene::ColorKey;

/// Files, or points in memory, that [`Renderer`]s draw.
///
/// A clone shares all data. Surfels that were made for one renderer are reused for the next, unless
/// the next one's options need different surfels.
#[derive(Clone)]
pub struct Scene(Arc<Inputs>);

/// The content of a [`Scene`].
#[derive(Default)]
struct Inputs {
    files: Files,
    /// Points that are in memory, in place of files.
    given: Option<Box<dyn Given>>,
    options: SceneOptions,
    /// The surfels and triangles that were made last, and the choices that they depend on.
    made: Mutex<Option<(Making, Arc<Whole>)>>,
    /// Standard input was read to its end.
    pipe_read: AtomicBool,
}

/// Forwards progress and stores the notes.
struct Noted<'a> {
    progress: &'a dyn Progress,
    notes: Mutex<Vec<String>>,
}

impl Progress for Noted<'_> {
    fn begin(&self, what: &str, units: u64) {
        self.progress.begin(what, units);
    }

    fn advance(&self, units: u64) {
        self.progress.advance(units);
    }

    fn end(&self) {
        self.progress.end();
    }

    fn note(&self, line: &str) {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner).push(line.to_owned());
        self.progress.note(line);
    }
}

impl Scene {
    /// Opens files and folders, which together make one scene. The path `-` is standard input.
    ///
    /// The files are read when a [`Renderer`] needs them. Files with levels of detail are read only
    /// as far as a view needs them.
    ///
    /// # Errors
    ///
    /// [`Error::Read`] for a missing file, [`Error::Usage`] for a folder without readable files.
    pub fn open(paths: impl IntoIterator<Item = impl Into<PathBuf>>, options: &SceneOptions) -> Result<Self> {
        Self::of_files(Files::new(paths, &options.input)?, options)
    }

    /// Makes a scene of files that are listed already, with the options for reading them.
    ///
    /// # Errors
    ///
    /// [`Error::Read`] for a missing file.
    pub fn of_files(files: Files, options: &SceneOptions) -> Result<Self> {
        let here = |path: &&PathBuf| path.as_os_str() != "-" && !address::is_remote(path) && !files.is_tile(path);
        for path in files.paths().iter().filter(here) {
            path.metadata().map_err(|error| Error::read(path, error))?;
        }
        Ok(Self(Arc::new(Inputs { files, options: options.clone(), ..Inputs::default() })))
    }

    /// Makes a scene of points in memory. The points stay in memory in addition to the surfels made
    /// of them.
    pub fn from_points(points: Vec<Points>, options: &SceneOptions) -> Self {
        Self::from_given(points, options)
    }

    /// Makes a scene of points that are taken from `given` whenever surfels are made of them.
    pub fn from_given(given: impl Given + 'static, options: &SceneOptions) -> Self {
        Self(Arc::new(Inputs { given: Some(Box::new(given)), options: options.clone(), ..Inputs::default() }))
    }

    /// Returns the points in memory, one entry for each input; empty for a scene of files.
    ///
    /// # Errors
    ///
    /// The errors of [`Given::points`].
    pub fn points(&self, progress: &dyn Progress) -> Result<Cow<'_, [Points]>> {
        self.0.given.as_ref().map_or(Ok(Cow::Borrowed(&[])), |given| given.points(progress))
    }

    /// The files of the scene, including those found in folders.
    pub fn files(&self) -> &Files {
        &self.0.files
    }
}

/// A request for pictures of a scene: everything except the view.
#[derive(Clone, Copy)]
struct Request<'a> {
    scene: &'a Inputs,
    options: &'a RenderOptions,
    device: &'a DeviceOptions,
    /// The picture is one of many views, from one to the next of which levels of detail fade.
    views: bool,
    /// Gets the points of the inputs once they are read.
    read: Option<&'a ahead::Read<'a>>,
    /// The processes that draw the picture together, and the view; None if this one draws alone.
    among: Option<(&'a dyn Network, &'a View)>,
}

impl Inputs {
    /// The number of files, or of inputs in memory.
    fn count(&self) -> usize {
        self.given.as_ref().map_or(self.files.paths().len(), |given| given.inputs())
    }
}

impl Request<'_> {
    fn files(&self) -> &Files {
        &self.scene.files
    }

    fn surfels(&self) -> &SurfelOptions {
        &self.scene.options.surfels
    }

    fn triangles(&self) -> &TriangleOptions {
        &self.scene.options.triangles
    }

    /// The backend, or None for the best available one.
    fn backend(&self) -> Option<BackendName> {
        self.device.backend.0
    }

    /// Whether the f64 reference was chosen as the backend.
    fn is_reference(&self) -> bool {
        self.backend() == Some(BackendName::Reference)
    }

    /// Reads the points of all inputs, and colours them by the attribute of the options.
    fn points(&self, progress: &dyn Progress) -> Result<(Vec<Points>, Option<ColorKey>)> {
        let mut points = self.uncolored(progress)?;
        let key = Coloring::of(&self.scene.options.colors, None).settle(&mut points)?;
        Ok((points, key))
    }

    fn uncolored(&self, progress: &dyn Progress) -> Result<Vec<Points>> {
        if let Some(given) = &self.scene.given {
            return given.points(progress).map(Cow::into_owned);
        }
        let pipe = self.files().paths().iter().any(|path| path.as_os_str() == "-");
        if pipe && self.scene.pipe_read.swap(true, Ordering::Relaxed) {
            return Err(Error::Usage("standard input was read before and cannot be read again: open a file".into()));
        }
        // Sizes that are estimated anew, and points that face the camera, are those of surfels.
        let solid = self.surfels().size.is_none() && self.options.points.facing.is_none();
        self.files().read_with(self.scene.options.colors.column(), solid, progress)
    }

    /// Fails for options of triangles if the scene has none.
    fn check_triangles(&self, exist: bool) -> Result<()> {
        if !exist && (self.options.surface.join.is_some() || self.triangles().texture.is_some()) {
            let what = "--join and --triangle-texture need triangles, and there are none: name a mesh by --triangles";
            return Err(Error::Usage(what.into()));
        }
        Ok(())
    }

    /// Returns the surfels and triangles of all inputs. Those that were made last are returned
    /// again if the choices are the same. Other renderers of the scene wait meanwhile.
    fn whole(&self, progress: &dyn Progress) -> Result<Arc<Whole>> {
        let making = Making::of(self);
        let mut made = self.scene.made.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((known, whole)) = &*made
            && *known == making
        {
            self.check_triangles(!whole.scene.triangles.is_empty())?;
            whole.notes.iter().for_each(|line| progress.note(line));
            return Ok(whole.clone());
        }
        // Frees the previous surfels first, as making new ones needs the memory.
        *made = None;
        let noted = Noted { progress, notes: Mutex::default() };
        let ((scene, preparation), key) = whole::scene(self, &noted)?;
        let notes = noted.notes.into_inner().unwrap_or_else(PoisonError::into_inner);
        let whole = Arc::new(Whole { scene: Arc::new(scene), preparation, notes, key });
        *made = Some((making, whole.clone()));
        Ok(whole)
    }

    /// Builds levels of detail for `whole`, and keeps the result for later renderers.
    fn with_levels(&self, whole: Arc<Whole>, progress: &dyn Progress) -> Result<Arc<Whole>> {
        let making = Making::of(self);
        let mut made = self.scene.made.lock().unwrap_or_else(PoisonError::into_inner);
        // Another thread may have built them meanwhile.
        if let Some((known, whole)) = &*made
            && *known == making
            && whole.scene.hierarchy.is_some()
        {
            return Ok(whole.clone());
        }
        // Without this reference, surfels that no other renderer uses are moved instead of copied.
        *made = None;
        let Whole { scene, preparation, notes, key } = Arc::unwrap_or_clone(whole);
        let scene = levels::made(Arc::unwrap_or_clone(scene), progress)?;
        let whole = Arc::new(Whole { scene: Arc::new(scene), preparation, notes, key });
        *made = Some((making, whole.clone()));
        Ok(whole)
    }
}
