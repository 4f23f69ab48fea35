//! The images of a mesh: each file is decoded once, and their total size is limited.

use std::collections::HashMap;
use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::Texture;
use super::image::{self, MOST_PIXELS};
use crate::error::{Error, Result};

/// Distinct textures and their indices.
#[derive(Debug, Default)]
pub(crate) struct Numbers {
    /// The textures, by index.
    pub all: Vec<Arc<Texture>>,
    by_place: HashMap<*const Texture, u32>,
    by_content: HashMap<u64, Vec<u32>>,
}

impl Numbers {
    /// The index of a texture; textures with equal texels and address mode share one.
    pub fn of(&mut self, texture: &Arc<Texture>) -> u32 {
        let place = Arc::as_ptr(texture);
        if let Some(known) = self.by_place.get(&place) {
            return *known;
        }
        let mut hasher = DefaultHasher::new();
        (texture.size(), texture.clamps(), texture.texels()).hash(&mut hasher);
        let alike = self.by_content.entry(hasher.finish()).or_default();
        let known = alike.iter().copied().find(|known| self.all[*known as usize] == *texture);
        let number = known.unwrap_or(self.all.len() as u32);
        if known.is_none() {
            alike.push(number);
        }
        // Duplicates are recorded too. A recorded texture must outlive `by_place`: another texture
        // at the same address would get its index.
        self.by_place.insert(place, number);
        if known.is_none() {
            self.all.push(texture.clone());
        }
        number
    }
}

/// The images of one mesh while they are being read.
#[derive(Debug, Default)]
pub(super) struct Images {
    /// The outcome of reading, for each path and address mode (whether coordinates outside [0, 1]
    /// are clamped).
    known: HashMap<(PathBuf, bool), Option<Arc<Texture>>>,
    /// Paths of files by their length and a hash of their bytes.
    by_content: HashMap<(u64, u64), Vec<PathBuf>>,
    pixels: u64,
}

impl Images {
    /// Reads an image file. If this file or a copy of it was read before, returns the same image.
    ///
    /// If `clamps` is set, texture coordinates outside [0, 1] take the edge texels. Returns None
    /// for a file that cannot be read, and adds one sentence to `notes`.
    ///
    /// # Errors
    ///
    /// [`Error::Malformed`] if all images together have more than [`MOST_PIXELS`].
    pub(super) fn read(&mut self, path: &Path, clamps: bool, notes: &mut Vec<String>) -> Result<Option<Arc<Texture>>> {
        let key = (path.to_owned(), clamps);
        if let Some(known) = self.known.get(&key) {
            return Ok(known.clone());
        }
        let read = self.decoded(path, clamps)?;
        let texture = read.map_err(|error| notes.push(format!("a texture is left out: {error}"))).ok();
        self.known.insert(key, texture.clone());
        Ok(texture)
    }

    fn decoded(&mut self, path: &Path, clamps: bool) -> Result<Result<Arc<Texture>>> {
        let first = match self.first_copy(path) {
            Ok(first) => first,
            Err(error) => return Ok(Err(error)),
        };
        if let Some(Some(known)) = self.known.get(&(first, clamps)) {
            return Ok(Ok(known.clone()));
        }
        let [width, height] = match image::size(path) {
            Ok(size) => size.map(u64::from),
            Err(error) => return Ok(Err(error)),
        };
        let pixels = self.pixels.saturating_add(width * height);
        if pixels > MOST_PIXELS && self.pixels > 0 {
            let what = format!(
                "with it the images of one mesh have {pixels} pixels, more than the limit of {MOST_PIXELS}: make them smaller"
            );
            return Err(Error::malformed(path, what));
        }
        let read = Texture::read(path).map(|texture| Arc::new(texture.clamped(clamps)));
        self.pixels += if read.is_ok() { width * height } else { 0 };
        Ok(read)
    }

    /// The first file that was read and has the same bytes; `path` itself if there is none.
    fn first_copy(&mut self, path: &Path) -> Result<PathBuf> {
        let bytes = image::bytes(path)?;
        let mut hasher = DefaultHasher::new();
        bytes.hash(&mut hasher);
        let alike = self.by_content.entry((bytes.len() as u64, hasher.finish())).or_default();
        let same = alike.iter().find(|other| fs::read(other).is_ok_and(|other| other == bytes));
        let first = same.cloned().unwrap_or_else(|| path.to_owned());
        if same.is_none() {
            alike.push(first.clone());
        }
        Ok(first)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn textures_of_the_same_texels_have_one_number() {
        let of = |code: u8| Arc::new(Texture::new(1, 1, vec![[code; 4]]).unwrap());
        let (red, also_red, clamped) = (of(1), of(1), Arc::new(Texture::clone(&of(1)).clamped(true)));
        let mut numbers = Numbers::default();
        let found = [&red, &of(2), &also_red, &clamped, &red].map(|texture| numbers.of(texture));
        assert_eq!((found, numbers.all.len()), ([0, 1, 0, 2, 0], 3));
    }

    #[test]
    fn copies_of_a_file_are_one_image() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["a.png", "b.png", "c.png"].map(|name| folder.path().join(name));
        for (path, code) in paths.iter().zip([9, 9, 8]) {
            super::super::png::write_texture(path, &Texture::new(2, 1, vec![[code; 4]; 2]).unwrap()).unwrap();
        }
        let (mut images, mut notes) = (Images::default(), Vec::new());
        let mut read = |path: &Path, clamps| images.read(path, clamps, &mut notes).unwrap();
        let [a, b, c] = paths.each_ref().map(|path| read(path, false).unwrap());
        assert!(Arc::ptr_eq(&a, &b) && a != c);
        assert_ne!(read(&paths[0], true).unwrap(), a);
        let lost = folder.path().join("lost.png");
        assert!(read(&lost, false).is_none() && read(&lost, false).is_none());
        assert_eq!((notes.len(), images.pixels), (1, 6));
    }
}
