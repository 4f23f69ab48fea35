//! The header of a part: the picture that it belongs to, and its shares.

use serde::{Deserialize, Serialize};

use std::sync::LazyLock;

use crate::error::Result as Outcome;
use crate::gpu::sources::FILES;
use crate::hash;
use crate::io::part::{Section, Values};
use crate::plan::extra::TRIANGLE_PIXEL_WORDS;
use crate::plan::{Facts, Settings, check};
use crate::scene::camera::{check_near, check_size};
use crate::scene::share::MOST_SHARES;
use crate::scene::{Camera, Maps, Samples};

/// The kind of values in a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Holds {
    /// Nearest depths.
    Depths,
    /// Sums.
    Sums,
}

impl Holds {
    pub fn name(self) -> &'static str {
        match self {
            Self::Depths => "nearest depths",
            Self::Sums => "sums",
        }
    }
}

/// Everything that a picture depends on, apart from the surfels.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Subject {
    /// The version of epsplat.
    pub version: String,
    /// Facts of the whole scene.
    pub facts: Facts,
    /// The digest of the whole scene ([`digest`](crate::passes::digest)).
    pub digest: u64,
    pub camera: Camera,
    pub settings: Settings,
    /// The maps that the user asked for.
    pub maps: Maps,
    /// The scene's axis of heights, of length 1.
    pub up: [f64; 3],
}

/// The header of a part.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Header {
    pub holds: Holds,
    /// Number of shares of the scene.
    pub of: u32,
    /// The shares that the part has, in order, from 1.
    pub shares: Vec<u32>,
    /// The digest of the surfels of these shares.
    pub own: u64,
    /// The digest of the nearest depths within which sums were made.
    pub within: Option<u64>,
    /// The adapters that drew the shares, in order, each once.
    pub adapters: Vec<String>,
    pub subject: Subject,
}

impl Subject {
    /// Rejects numbers that no picture has. They come from a file.
    fn check(&self) -> Outcome<()> {
        let Self { camera, settings, up, .. } = self;
        check_size(camera.width, camera.height)?;
        check_near(camera.near)?;
        check::options(settings, false)?;
        camera.sampled(settings.samples)?;
        let lens = [camera.fx, camera.fy, camera.cx, camera.cy];
        let pose = camera.eye.is_finite() && camera.rotation.is_finite();
        match pose && lens.iter().chain(up).all(|number| number.is_finite()) {
            true => Ok(()),
            false => Err(crate::Error::Usage("a number of the camera is not finite".into())),
        }
    }
}

/// More sums of a sample, and more renders of a picture, than any picture has.
const MOST_CHANNELS: u16 = 64;
const MOST_RENDERS: u32 = 8;

/// The version of epsplat, which a header names, with a hash of its kernels: other kernels may
/// store values in another form.
pub(super) fn version() -> &'static str {
    static VERSION: LazyLock<String> = LazyLock::new(|| {
        let kernels = hash::of(FILES.iter().flat_map(|(name, text)| name.bytes().chain(text.bytes())));
        format!("{} (kernels {:08x})", env!("CARGO_PKG_VERSION"), kernels as u32)
    });
    &VERSION
}

impl Header {
    pub fn encoded(&self) -> Vec<u8> {
        encoded(self)
    }

    /// Reads a header.
    ///
    /// # Errors
    /// A sentence if another version of epsplat wrote it.
    pub fn decoded(bytes: &[u8]) -> Result<Self, String> {
        /// The only fields that all versions have.
        #[derive(Deserialize)]
        struct Known {
            subject: Version,
        }
        #[derive(Deserialize)]
        struct Version {
            version: String,
        }
        let other = |version: &str| {
            let this = self::version();
            format!("epsplat {version} drew it, and this is {this}: draw and merge all parts by one version")
        };
        if let Ok(Known { subject: Version { version } }) = ciborium::from_reader::<Known, _>(bytes)
            && version != self::version()
        {
            return Err(other(&version));
        }
        let header: Self = ciborium::from_reader(bytes).map_err(|_| other("of another build"))?;
        let in_order = header.shares.is_sorted_by(|one, next| one < next);
        let known = header.shares.iter().all(|share| (1..=header.of).contains(share));
        let some = !header.shares.is_empty() && header.of <= MOST_SHARES;
        match in_order && known && some && header.subject.check().is_ok() {
            true => Ok(header),
            false => Err("its header describes what no picture has: draw the part again".into()),
        }
    }

    /// Whether a section has the size of a render of this picture.
    pub fn fits(&self, section: &Section) -> bool {
        let Subject { camera, settings, .. } = &self.subject;
        let each = match section.values {
            Values::Nearest => section.each == 1,
            Values::Triangles => u32::from(section.each) == TRIANGLE_PIXEL_WORDS,
            Values::Sums => section.each <= MOST_CHANNELS,
        };
        let of_render = |samples: Samples| {
            let of = camera.sampled(samples);
            of.is_ok_and(|of| section.width == of.width && section.samples().end <= of.pixels())
        };
        each && section.render < MOST_RENDERS && [Samples::ONE, settings.samples].into_iter().any(of_render)
    }

    /// Returns how the picture of this part differs from that of `other`: a subject and a verb.
    pub fn difference(&self, other: &Self) -> Option<String> {
        let (one, two) = (&self.subject, &other.subject);
        let same = |one: &dyn Fn(&Subject) -> Vec<u8>| one(&self.subject) == one(&other.subject);
        if self.of != other.of {
            return Some(format!("is one of {} parts, and there it is one of {}", self.of, other.of));
        }
        if one.digest != two.digest || !same(&|subject| encoded(&subject.facts)) || one.up != two.up {
            return Some("is of another scene".into());
        }
        if one.camera != two.camera {
            return Some("is of another camera".into());
        }
        let name = different_setting(&one.settings, &two.settings);
        let name = name.or((one.maps != two.maps).then(|| "maps".to_owned()))?;
        Some(format!("is of other options ({name})"))
    }
}

/// The name of the first setting that differs.
fn different_setting(one: &Settings, two: &Settings) -> Option<String> {
    let fields = |settings: &Settings| match ciborium::Value::serialized(settings) {
        Ok(ciborium::Value::Map(fields)) => fields,
        _ => Vec::new(),
    };
    let different = fields(one).into_iter().zip(fields(two)).find(|(one, two)| one != two);
    let name = |key: ciborium::Value| key.into_text().unwrap_or_default().replace('_', " ");
    different.map(|((key, _), _)| name(key))
}

/// The bytes of a value as CBOR.
pub(super) fn encoded(value: &impl Serialize) -> Vec<u8> {
    let mut bytes = Vec::new();
    // Writing to memory does not fail, and all types of a header have a form in CBOR.
    let written = ciborium::into_writer(value, &mut bytes);
    debug_assert!(written.is_ok());
    bytes
}
