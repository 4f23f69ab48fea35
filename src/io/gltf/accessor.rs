//! Accessors: typed views of buffers, with sparse replacements.

use ::gltf::json::accessor::{ComponentType, Type, sparse};
use ::gltf::json::validation::Checked;
use ::gltf::json::{Accessor as Described, Index};

use super::buffers::Buffers;
use super::document::{Document, malformed};
use crate::io::fault::Fault;

/// An accessor whose elements all lie inside its buffers.
pub(super) struct Accessor<'a> {
    /// The number of elements.
    pub(super) count: usize,
    /// The number of components of an element.
    pub(super) width: usize,
    kind: ComponentType,
    is_normalized: bool,
    /// The elements; None if they are zero.
    stored: Option<Elements<'a>>,
    sparse: Option<Sparse<'a>>,
}

/// Elements at equal distances.
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
}

/// Elements that replace others.
struct Sparse<'a> {
    /// The number of each element, in ascending order.
    numbers: Elements<'a>,
    kind: ComponentType,
    values: Elements<'a>,
    count: usize,
}

impl<'a> Accessor<'a> {
    /// The accessor with this index, whose elements have a number of components out of `widths`.
    pub(super) fn of(
        document: &Document,
        buffers: &'a Buffers<'_>,
        index: Index<Described>,
        widths: &[usize],
    ) -> Result<Self, Fault> {
        let number = index.value();
        let own = described(document, index)?;
        let (Checked::Valid(kind), Checked::Valid(shape)) = (&own.component_type, &own.type_) else {
            return Err(malformed(format!("the accessor {number} has an unknown type")));
        };
        if matches!(shape, Type::Mat2 | Type::Mat3 | Type::Mat4) {
            return Err(malformed(format!("the accessor {number} has matrices, which do not fit")));
        }
        let (kind, width) = (kind.0, shape.multiplicity());
        if !widths.contains(&width) {
            return Err(malformed(format!("the accessor {number} has elements of {width} numbers, which do not fit")));
        }
        let beyond = || malformed(format!("the accessor {number} goes beyond the end of its buffer view"));
        let count = usize::try_from(own.count.0).map_err(|_| beyond())?;
        let size = width * kind.size();
        let elements = |view, offset: u64, (count, size): (usize, usize)| {
            let (bytes, stride) = buffers.view(view)?;
            Elements::of(bytes, offset, (count, size, stride.unwrap_or(size))).ok_or_else(beyond)
        };
        let offset = own.byte_offset.map_or(0, |offset| offset.0);
        let stored = own.buffer_view.map(|view| elements(view, offset, (count, size))).transpose()?;
        let of_sparse = |sparse: &sparse::Sparse| {
            let Checked::Valid(kind) = sparse.indices.component_type else { return Err(beyond()) };
            let replaced = usize::try_from(sparse.count.0).map_err(|_| beyond())?;
            let (numbers, values) = (&sparse.indices, &sparse.values);
            Ok(Sparse {
                numbers: elements(numbers.buffer_view, numbers.byte_offset.0, (replaced, kind.0.size()))?,
                kind: kind.0,
                values: elements(values.buffer_view, values.byte_offset.0, (replaced, size))?,
                count: replaced,
            })
        };
        let sparse = own.sparse.as_ref().map(of_sparse).transpose()?;
        Ok(Self { count, width, kind, is_normalized: own.normalized, stored, sparse })
    }

    /// Whether elements come from a buffer, at least in part.
    pub(super) fn is_stored(&self) -> bool {
        self.stored.is_some() || self.sparse.is_some()
    }

    /// Whether the elements can be indices of vertices.
    pub(super) fn is_index(&self) -> bool {
        matches!(self.kind, ComponentType::U8 | ComponentType::U16 | ComponentType::U32) && !self.is_normalized
    }

    /// The first `N` components of an element below [`Self::count`]; 0 where it has fewer.
    pub(super) fn get<const N: usize>(&self, index: usize) -> [f64; N] {
        let replaced = self.sparse.as_ref().and_then(|sparse| sparse.at(index));
        let Some(element) = replaced.or_else(|| Some(self.stored.as_ref()?.at(index))) else { return [0.0; N] };
        std::array::from_fn(|k| if k < self.width { self.component(element, k) } else { 0.0 })
    }

    fn component(&self, element: &[u8], k: usize) -> f64 {
        let value = number(element, k, self.kind);
        match self.kind {
            _ if !self.is_normalized => value,
            ComponentType::U8 => value / 255.0,
            ComponentType::I8 => (value / 127.0).max(-1.0),
            ComponentType::U16 => value / 65535.0,
            ComponentType::I16 => (value / 32767.0).max(-1.0),
            ComponentType::U32 | ComponentType::F32 => value,
        }
    }
}

/// The description of the accessor with this index.
pub(super) fn described(document: &Document, index: Index<Described>) -> Result<&Described, Fault> {
    let missing = || malformed(format!("it names the accessor {}, which does not exist", index.value()));
    document.root.accessors.get(index.value()).ok_or_else(missing)
}

/// The number with index `k` among those of a kind.
fn number(bytes: &[u8], k: usize, kind: ComponentType) -> f64 {
    fn chunk<const N: usize>(bytes: &[u8], k: usize) -> [u8; N] {
        bytes.get(N * k..).and_then(|rest| rest.first_chunk().copied()).unwrap_or([0; N])
    }
    match kind {
        ComponentType::U8 => chunk::<1>(bytes, k)[0].into(),
        ComponentType::I8 => i8::from_le_bytes(chunk(bytes, k)).into(),
        ComponentType::U16 => u16::from_le_bytes(chunk(bytes, k)).into(),
        ComponentType::I16 => i16::from_le_bytes(chunk(bytes, k)).into(),
        ComponentType::U32 => u32::from_le_bytes(chunk(bytes, k)).into(),
        ComponentType::F32 => f32::from_le_bytes(chunk(bytes, k)).into(),
    }
}

impl<'a> Elements<'a> {
    /// `count` elements of `size` bytes from `offset`; None if they are not all there.
    fn of(bytes: &'a [u8], offset: u64, (count, size, stride): (usize, usize, usize)) -> Option<Self> {
        let bytes = bytes.get(usize::try_from(offset).ok()?..)?;
        let end = count.checked_sub(1).map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(size))?;
        (end <= bytes.len() && stride >= size).then_some(Self { bytes, stride })
    }

    /// The bytes from the start of an element.
    fn at(&self, index: usize) -> &'a [u8] {
        self.bytes.get(index.saturating_mul(self.stride)..).unwrap_or_default()
    }
}

impl<'a> Sparse<'a> {
    /// The element that replaces the one with this index.
    fn at(&self, index: usize) -> Option<&'a [u8]> {
        let numbered = |k: usize| number(self.numbers.at(k), 0, self.kind) as usize;
        let (mut low, mut high) = (0, self.count);
        while low < high {
            let middle = low + (high - low) / 2;
            if numbered(middle) < index { low = middle + 1 } else { high = middle }
        }
        (low < self.count && numbered(low) == index).then(|| self.values.at(low))
    }
}
