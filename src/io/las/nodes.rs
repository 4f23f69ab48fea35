//! Reads nodes of a COPC file: the needed layers of many chunks in the order of the file, which all
//! threads then decode.

use super::chunks::{CHUNK_LIMIT, malformed};
use super::copc::Copc;
use super::layers::Layers;
use super::{Kept, Looks, deep, early, of_las};
use crate::io::fault::{self, Fault, Unread, reserve, surviving};
use crate::io::{Points, ReadOptions};
use crate::scene::octree::OctreeNode;
use crate::{Progress, Result};
use las::{PointData, PointDataBuilder};
use laz::LazVlr;
use laz::record::{LayeredPointRecordDecompressor, RecordDecompressor};
use rayon::prelude::*;
use std::io::Cursor;

/// Limits of a batch of nodes: bytes that are read, and bytes of decoded records. A node that
/// exceeds a limit is a batch of its own.
const MOST_READ: u64 = 1 << 25;
const MOST_DECODED: u64 = 1 << 27;

impl Copc {
    /// Reads the points of `nodes`, given by their indices in the octree, as [`read`](super::read)
    /// reads a whole file. Points are in the order of the file. The first nodes that are read
    /// decide what 16-bit colours and intensities mean in all later nodes.
    ///
    /// Points have their indices in the file if it has fewer than 2^32 points; otherwise they are
    /// numbered in the order in which they are kept. A node that cannot be decoded is left out and
    /// named in [`Points::unread`], if another one can be decoded and [`ReadOptions::strict`] is
    /// not set.
    ///
    /// # Errors
    ///
    /// [`Error::Read`](crate::Error::Read) if the system cannot read,
    /// [`Error::Malformed`](crate::Error::Malformed) if nodes cannot be decoded.
    pub fn read(&mut self, nodes: &[usize], options: &ReadOptions, progress: &dyn Progress) -> Result<Points> {
        let mut points = self.read_raw(nodes, options, progress)?;
        self.rules.settle(std::slice::from_mut(&mut points));
        Ok(points)
    }

    /// Reads nodes as [`read`](Self::read) does, but keeps colours as they are in the file
    /// ([`Points::raw`]). Their meaning can then be decided together with other files.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn read_raw(&mut self, nodes: &[usize], options: &ReadOptions, progress: &dyn Progress) -> Result<Points> {
        self.need(options).map_err(|fault| self.fault(fault))?;
        let mut nodes: Vec<usize> = nodes.iter().copied().filter(|&node| self.octree.nodes[node].points > 0).collect();
        nodes.sort_unstable_by_key(|&node| self.chunks[node].offset);
        progress.begin(&format!("looking at {} nodes of {}", nodes.len(), fault::name(&self.path)), nodes.len() as u64);
        let mut unread = Unread::default();
        let all = nodes.len() as u64;
        let looked = self.look(&mut nodes, (&mut unread, options.strict), progress);
        progress.end();
        looked.map_err(|fault| self.fault(fault))?;
        let bytes = self.bytes_read(&nodes);
        progress.begin(&format!("reading {} MB of {}", bytes.div_ceil(1_000_000), fault::name(&self.path)), bytes);
        let points = deep(|| self.decoded(&nodes, (unread, all), options, progress));
        progress.end();
        let mut points = points.map_err(|fault| self.fault(fault))?;
        points.notes.extend(self.notes.iter().cloned());
        Ok(points)
    }

    /// Adds the layers of the wanted attributes to those that are read.
    fn need(&mut self, options: &ReadOptions) -> Result<(), Fault> {
        let wants = self.dimensions.collector(&options.wanted)?;
        if wants.is_some_and(|wants| wants.need(&mut self.scheme)) {
            self.layers.fill(None);
        }
        Ok(())
    }

    fn decoded(
        &mut self,
        nodes: &[usize],
        (mut unread, all): (Unread, u64),
        options: &ReadOptions,
        progress: &dyn Progress,
    ) -> Result<Points, Fault> {
        let vlr = LazVlr::from_buffer(&self.laszip).map_err(|error| of_las(error.into()))?;
        let count = self.octree.points(nodes);
        let normals = self.normals.clone();
        let (mut kept, mut read) = (Kept::of(self.looks, normals.as_ref()), Vec::new());
        // The promised number may be wrong, so the number of bytes caps the reservation.
        kept.wants = self.dimensions.collector(&options.wanted)?;
        reserve(&mut kept.positions, count.min(self.bytes_read(nodes)))?;
        for together in self.batches(nodes) {
            let ranges = |&node: &usize| {
                let offset = self.chunks[node].offset;
                self.layers[node].iter().flat_map(move |layers| layers.ranges(offset))
            };
            self.source.expect(together.iter().flat_map(ranges))?;
            let compressed = |&node: &usize| {
                let layers = self.layers[node].as_ref();
                layers.map_or_else(|| Ok(Vec::new()), |layers| layers.read(&self.source, self.chunks[node].offset))
            };
            let compressed = together.iter().map(compressed).collect::<Result<Vec<_>, _>>()?;
            let decode = |(&node, bytes): (&usize, Vec<u8>)| surviving(|| self.decode(node, &bytes, &vlr));
            let decoded: Vec<Result<PointData, Fault>> = together.par_iter().zip(compressed).map(decode).collect();
            for (&node, block) in together.iter().zip(decoded) {
                let (first, points) = (self.chunks[node].first, self.octree.nodes[node].points);
                match block {
                    Ok(block) => {
                        kept.take(&block, first, options);
                        read.push(first..first + points);
                    }
                    Err(fault) => {
                        let name = self.octree.nodes[node].name();
                        unread.add(|what| format!("node {name}: {what}"), points, fault, options.strict)?;
                    }
                }
            }
            progress.advance(self.bytes_read(together));
        }
        let unread = unread.told(&self.path, ("nodes", all), !read.is_empty())?;
        self.decide(&kept);
        let mut points = kept.numbered(&read, self.count, options)?;
        points.raw.iter_mut().for_each(|raw| raw.name = fault::name(&self.path));
        Ok(Points { unread, ..points })
    }

    /// Decides from the first nodes that are read whether colours or intensities are drawn, for all
    /// nodes. If colours are drawn, intensities are no longer read.
    fn decide(&mut self, kept: &Kept) {
        if self.looks.is_none() && !kept.positions.is_empty() {
            self.looks = Some(kept.looks.unwrap_or(Looks::Intensities));
            self.scheme.need_intensities(self.looks == Some(Looks::Intensities));
        }
    }

    /// Splits nodes into batches that are read together.
    fn batches<'a>(&self, nodes: &'a [usize]) -> Vec<&'a [usize]> {
        let size = |&node: &usize| (self.chunks[node].bytes, self.octree.nodes[node].points * self.scheme.record);
        let (mut batches, mut rest) = (Vec::new(), nodes);
        while !rest.is_empty() {
            let mut sum = (0, 0);
            let fits = |node: &&usize| {
                let (bytes, records) = size(node);
                sum = (sum.0 + bytes, sum.1 + records);
                sum.0 <= MOST_READ && sum.1 <= MOST_DECODED
            };
            let (batch, after) = rest.split_at(rest.iter().take_while(fits).count().max(1));
            batches.push(batch);
            rest = after;
        }
        batches
    }

    /// Reads the heads of the chunks of nodes whose layers are not known yet. Nodes whose chunk is
    /// invalid are removed from `nodes`.
    fn look(
        &mut self,
        nodes: &mut Vec<usize>,
        (unread, strict): (&mut Unread, bool),
        progress: &dyn Progress,
    ) -> Result<(), Fault> {
        let unknown = nodes.iter().filter(|node| self.layers[**node].is_none()).map(|&node| self.chunks[node]);
        self.source.expect(unknown.map(|chunk| chunk.offset..chunk.offset + self.scheme.start().min(chunk.bytes)))?;
        for node in std::mem::take(nodes) {
            if self.layers[node].is_none() {
                match self.layers_of(node) {
                    Ok(layers) => self.layers[node] = Some(layers),
                    Err(fault) => {
                        let OctreeNode { points, .. } = self.octree.nodes[node];
                        let name = self.octree.nodes[node].name();
                        unread.add(|what| format!("node {name}: {what}"), points, fault, strict)?;
                    }
                }
            }
            nodes.extend(self.layers[node].is_some().then_some(node));
            progress.advance(1);
        }
        Ok(())
    }

    fn layers_of(&self, node: usize) -> Result<Layers, Fault> {
        let (chunk, points) = (self.chunks[node], self.octree.nodes[node].points);
        if points * self.scheme.record > CHUNK_LIMIT {
            return malformed(format!(
                "a node of its octree has {points} points, more than can be decoded at once: omit --lod to read the whole file"
            ));
        }
        let mut start = Vec::new();
        self.source.read_at(chunk.offset, self.scheme.start(), &mut start)?;
        match self.scheme.points_in(&start, chunk.bytes) {
            Some(count) if count == points => Ok(Layers::of(start, &self.scheme)),
            Some(count) => {
                malformed(format!("a node of its octree has {count} points, not the {points} that it promises"))
            }
            None => malformed("the layers of a node of its octree do not fit in it"),
        }
    }

    fn decode(&self, node: usize, bytes: &[u8], vlr: &LazVlr) -> Result<PointData, Fault> {
        let failed = |error: laz::LasZipError| early(of_las(error.into()));
        let mut decompressor = LayeredPointRecordDecompressor::new(Cursor::new(bytes));
        decompressor.set_fields_from(vlr.items()).map_err(failed)?;
        let size = self.octree.nodes[node].points * self.scheme.record;
        let mut records = Vec::new();
        reserve(&mut records, size)?;
        records.resize(size as usize, 0);
        decompressor.decompress_many(&mut records).map_err(|error| early(Fault::Io(error)))?;
        let builder = PointDataBuilder::new().with_format(self.format).with_transforms(self.transforms);
        builder.build_from_bytes(records).map_err(of_las)
    }
}
