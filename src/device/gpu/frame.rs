//! One frame on a GPU: trees are fitted, slices of the picture traced, and what came out is brought back.

use super::adapter::Gpu;
use super::arena::{Arena, Section};
use super::pipelines::{Kernel, Pipelines};
use super::records::{RefitLevel, RefitTree, Slice};
use super::resident::{Fit, Heaps};
use super::scene::Records;
use crate::device::{DeviceError, RayCounts, Stop};
use crate::film::Film;
use crate::scene::Shot;
use std::ops::Range;

/// Threads of a workgroup that traces.
const GROUP: u32 = 64;
/// Nodes that a workgroup fits.
const NODES_IN_GROUP: u32 = 32;
/// Samples of one dispatch at most: so few that the slowest GPU takes less than its driver allows, and so that a run can be
/// stopped.
const SAMPLES_MOST: u64 = 1 << 22;
/// Of those a frame has with rays that branch.
const BRANCHING: u64 = 8;
/// Rows of four words that a waiting ray takes, as `WAITING_ROWS` in shaders/parts/branch.wgsl.
pub(super) const WAITING_ROWS: u64 = 10;
/// Bytes of waiting rays at most.
const WAITING_BYTES: u64 = 1 << 29;
/// Words of a pixel's auxiliary pictures of its centre.
const CENTER_WORDS: u64 = 12;
/// Counts of rays, each in two halves.
const COUNTERS: u64 = 10;

/// Buffers that frames use one after the other.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    arena: Arena,
    frame: Option<wgpu::Buffer>,
    film: Option<wgpu::Buffer>,
    center: Option<wgpu::Buffer>,
    waiting: Option<wgpu::Buffer>,
    counters: Option<wgpu::Buffer>,
    boxes: Option<wgpu::Buffer>,
    back: Option<wgpu::Buffer>,
}

/// What a frame's dispatches are made with.
pub(super) struct Ground<'a> {
    pub(super) gpu: &'a Gpu,
    pub(super) pipelines: &'a mut Pipelines,
    pub(super) heaps: &'a Heaps,
    pub(super) buffers: &'a mut Buffers,
}

/// The pixels of a workgroup: a tile of so many columns and rows.
fn tile(lanes: u32) -> [u32; 2] {
    let bits = (GROUP / lanes).ilog2();
    [1 << bits.div_ceil(2), 1 << (bits / 2)]
}

/// Rows of the picture that one dispatch traces.
struct Cut {
    rows: Range<u32>,
    groups: [u32; 2],
}

fn cuts(size: [u32; 2], tile: [u32; 2], rows_most: u64) -> Vec<Cut> {
    let [width, height] = size;
    let step = (rows_most.min(u64::from(height)) as u32 / tile[1]).max(1) * tile[1];
    let cut = |first: u32| {
        let end = height.min(first.saturating_add(step));
        Cut { rows: first..end, groups: [width.div_ceil(tile[0]), (end - first).div_ceil(tile[1])] }
    };
    (0..height).step_by(step as usize).map(cut).collect()
}

/// Where a frame's lists are in the arena.
struct Sections {
    uniforms: [Section; 2],
    lists: [Section; 7],
    center_slices: Section,
    refit_trees: Section,
    refit_levels: Section,
}

impl Ground<'_> {
    /// Fits trees that wait for it, without tracing.
    pub(super) fn fit_only(&mut self, fits: Vec<Fit>) -> Result<(), DeviceError> {
        if fits.is_empty() {
            return Ok(());
        }
        let fits = Fits::new(fits);
        self.buffers.arena.clear();
        let trees = self.buffers.arena.add(&fits.records());
        let levels = self.buffers.arena.add_apart(&fits.levels);
        self.write_arena()?;
        let mut encoder = self.encoder();
        self.fit(&mut encoder, &fits, &trees, &levels)?;
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.check()
    }

    /// Fits trees, traces a frame, and waits for its film.
    pub(super) fn trace(
        &mut self,
        fits: Vec<Fit>,
        records: &Records,
        shot: &Shot,
        stop: &Stop,
    ) -> Result<(Film, RayCounts), DeviceError> {
        let mut film = Film::new(shot.size, shot.alpha, shot.aovs);
        let pixels = u64::from(shot.size[0]) * u64::from(shot.size[1]);
        let aovs = &film.aovs;
        let wants_center = aovs.depth.is_some()
            || aovs.normal.is_some()
            || aovs.position.is_some()
            || aovs.id.is_some()
            || aovs.material.is_some()
            || aovs.uv.is_some();
        let film_words = pixels * if records.has.albedo { 7 } else { 4 };
        let center_words = if wants_center { pixels * CENTER_WORDS } else { 1 };
        let lanes = shot.samples.next_power_of_two().min(16);
        let waiting_each = if records.has.branches { shot.depth.max(1) } else { 0 };
        let (slices, waiting_words) = self.slices(records, shot, lanes, waiting_each);
        let center_slices = if wants_center {
            cuts(shot.size, tile(1), SAMPLES_MOST / u64::from(shot.size[0]))
        } else {
            Vec::new()
        };

        let storage =
            wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let back = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let back_words = film_words + COUNTERS + if wants_center { center_words } else { 0 };
        let Self { gpu, buffers, .. } = self;
        room(gpu, "film", &mut buffers.film, film_words, storage)?;
        room(gpu, "center", &mut buffers.center, center_words, storage)?;
        room(gpu, "waiting", &mut buffers.waiting, waiting_words.max(4), storage)?;
        room(gpu, "counters", &mut buffers.counters, COUNTERS, storage)?;
        room(gpu, "read back", &mut buffers.back, back_words, back)?;

        let fits = Fits::new(fits);
        let sections = self.write_frame(records, &fits, &slices, &center_slices, lanes, waiting_each)?;
        let mut encoder = self.encoder();
        self.fit(&mut encoder, &fits, &sections.refit_trees, &sections.refit_levels)?;
        encoder.clear_buffer(held(&self.buffers.counters), 0, None);
        for (kernel, cuts, section) in [
            (Kernel::Trace, &slices, &sections.uniforms[1]),
            (Kernel::Center, &center_slices, &sections.center_slices),
        ] {
            if cuts.is_empty() {
                continue;
            }
            let group = self.bindings(&sections, section, kernel);
            let pipeline = self.pipelines.tracing(self.gpu, kernel, records.has).clone();
            for (i, cut) in cuts.iter().enumerate() {
                if stop.asked() {
                    self.gpu.queue.submit([encoder.finish()]);
                    self.gpu.wait()?;
                    return Err(DeviceError::Stopped);
                }
                {
                    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                    pass.set_pipeline(&pipeline);
                    pass.set_bind_group(0, &group, &[i as u32 * Arena::STEP]);
                    pass.dispatch_workgroups(cut.groups[0], cut.groups[1], 1);
                }
                if i + 1 < cuts.len() {
                    let next = self.encoder();
                    self.gpu.queue.submit([std::mem::replace(&mut encoder, next).finish()]);
                    // one is under way while the next is prepared, no more: so a run can be stopped
                    self.gpu.wait()?;
                }
            }
        }
        let back = held(&self.buffers.back);
        encoder.copy_buffer_to_buffer(held(&self.buffers.film), 0, back, 0, 4 * film_words);
        encoder.copy_buffer_to_buffer(held(&self.buffers.counters), 0, back, 4 * film_words, 4 * COUNTERS);
        if wants_center {
            let at = 4 * (film_words + COUNTERS);
            encoder.copy_buffer_to_buffer(held(&self.buffers.center), 0, back, at, 4 * center_words);
        }
        self.gpu.queue.submit([encoder.finish()]);
        let bytes = back.slice(..4 * back_words);
        bytes.map_async(wgpu::MapMode::Read, |_| {});
        self.gpu.wait()?;
        let counts = {
            let lost = |e: wgpu::MapRangeError| DeviceError::Lost {
                device: self.gpu.name.clone(),
                why: e.to_string(),
            };
            let view = bytes.get_mapped_range().map_err(lost)?;
            let words: &[u32] = bytemuck::cast_slice(&view);
            let (picture, rest) = words.split_at(film_words as usize);
            let (counters, center) = rest.split_at(COUNTERS as usize);
            fill_picture(&mut film, picture, pixels as usize);
            fill_center(&mut film, center);
            ray_counts(counters)
        };
        back.unmap();
        self.gpu.check()?;
        Ok((film, counts))
    }

    /// How the picture is cut, and the words that waiting rays take in one cut.
    fn slices(&self, records: &Records, shot: &Shot, lanes: u32, waiting_each: u32) -> (Vec<Cut>, u64) {
        let [columns, rows] = tile(lanes);
        let samples = if records.has.branches { SAMPLES_MOST / BRANCHING } else { SAMPLES_MOST };
        let mut rows_most = samples / (u64::from(shot.size[0]) * u64::from(shot.samples)).max(1);
        let threads_of_row = u64::from(shot.size[0].div_ceil(columns) * GROUP);
        let words_each = u64::from(waiting_each) * WAITING_ROWS * 4;
        if words_each > 0 {
            let most = self.gpu.binding_bytes.min(WAITING_BYTES) / 4;
            rows_most = rows_most.min(most / (threads_of_row * words_each) * u64::from(rows));
        }
        rows_most = rows_most.min(u64::from(self.gpu.groups_most) * u64::from(rows));
        let cuts = cuts(shot.size, [columns, rows], rows_most);
        let threads =
            cuts.first().map_or(0, |c| u64::from(c.groups[0]) * u64::from(c.groups[1]) * u64::from(GROUP));
        (cuts, threads * words_each)
    }

    fn write_frame(
        &mut self,
        records: &Records,
        fits: &Fits,
        slices: &[Cut],
        center_slices: &[Cut],
        lanes: u32,
        waiting_each: u32,
    ) -> Result<Sections, DeviceError> {
        let slice = |lanes: u32| {
            move |cut: &Cut| Slice { first_row: cut.rows.start, end_row: cut.rows.end, lanes, waiting_each }
        };
        let arena = &mut self.buffers.arena;
        arena.clear();
        let slices: Vec<Slice> = slices.iter().map(slice(lanes)).collect();
        let center: Vec<Slice> = center_slices.iter().map(slice(1)).collect();
        let sections = Sections {
            uniforms: [arena.add(&[records.shot]), arena.add_apart(&slices)],
            lists: [
                arena.add(&records.lights),
                arena.add(&records.emitters),
                arena.add(&records.materials),
                arena.add(&records.material_maps),
                arena.add(&records.maps),
                arena.add(&records.objects),
                arena.add(&records.tables),
            ],
            center_slices: arena.add_apart(&center),
            refit_trees: arena.add(&fits.records()),
            refit_levels: arena.add_apart(&fits.levels),
        };
        self.write_arena()?;
        Ok(sections)
    }

    fn write_arena(&mut self) -> Result<(), DeviceError> {
        let Buffers { arena, frame, .. } = &mut *self.buffers;
        if arena.write(self.gpu, frame).is_none() {
            return Err(DeviceError::OutOfMemory {
                device: self.gpu.name.clone(),
                needed_bytes: arena.bytes(),
                budget_bytes: self.gpu.binding_bytes,
            });
        }
        Ok(())
    }

    fn encoder(&self) -> wgpu::CommandEncoder {
        self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// A section of the arena as a binding.
    fn section(&self, section: &Section) -> wgpu::BindingResource<'_> {
        binding(held(&self.buffers.frame), section)
    }

    fn bindings(&self, sections: &Sections, slices: &Section, kernel: Kernel) -> wgpu::BindGroup {
        let Buffers { film, center, waiting, counters, .. } = &*self.buffers;
        let film = if kernel == Kernel::Trace { film } else { center };
        let mut resources = vec![self.section(&sections.uniforms[0]), self.section(slices)];
        resources.extend(sections.lists.iter().map(|list| self.section(list)));
        let Heaps { nodes, triangles, words, texels } = self.heaps;
        resources.extend([nodes, triangles, words, texels].map(|heap| heap.buffer().as_entire_binding()));
        resources.extend([film, waiting, counters].map(|buffer| held(buffer).as_entire_binding()));
        bind_group(self.gpu, &self.pipelines.trace_layout, resources)
    }

    /// Fits trees, from below.
    fn fit(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        fits: &Fits,
        trees: &Section,
        levels: &Section,
    ) -> Result<(), DeviceError> {
        if fits.fits.is_empty() {
            return Ok(());
        }
        let Heaps { nodes, triangles, words, .. } = self.heaps;
        let resources = vec![
            self.section(levels),
            self.section(trees),
            words.buffer().as_entire_binding(),
            nodes.buffer().as_entire_binding(),
            triangles.buffer().as_entire_binding(),
            held(&self.buffers.boxes).as_entire_binding(),
        ];
        let group = bind_group(self.gpu, &self.pipelines.refit_layout, resources);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        for (i, level) in fits.levels.iter().enumerate() {
            let is_top = level.count == 0;
            pass.set_pipeline(if is_top { &self.pipelines.refit_top } else { &self.pipelines.refit_level });
            pass.set_bind_group(0, &group, &[i as u32 * Arena::STEP]);
            let groups = if is_top { level.trees } else { level.count.div_ceil(NODES_IN_GROUP) };
            let columns = groups.min(self.gpu.groups_most);
            pass.dispatch_workgroups(columns, groups.div_ceil(columns), 1);
        }
        Ok(())
    }
}

/// Trees that are fitted together.
struct Fits {
    fits: Vec<Fit>,
    /// The dispatches in order; of the last, which fits the tops, the count is 0.
    levels: Vec<RefitLevel>,
}

impl Fits {
    fn new(mut fits: Vec<Fit>) -> Self {
        let mut nodes = 0;
        for fit in &mut fits {
            fit.record.first_box = nodes;
            nodes += fit.nodes;
        }
        let heights = fits.iter().map(|f| f.below_top.len()).max().unwrap_or(0);
        let mut levels = Vec::new();
        for height in 0..heights {
            for (tree, fit) in (0..).zip(&fits) {
                if let Some(range) = fit.below_top.get(height) {
                    let count = range.end - range.start;
                    levels.push(RefitLevel { tree, first: range.start, count, trees: 1 });
                }
            }
        }
        levels.push(RefitLevel { tree: 0, first: 0, count: 0, trees: fits.len() as u32 });
        Self { fits, levels }
    }

    fn records(&self) -> Vec<RefitTree> {
        self.fits.iter().map(|f| f.record).collect()
    }
}

/// Makes a buffer of so many words at least.
fn room(
    gpu: &Gpu,
    label: &str,
    buffer: &mut Option<wgpu::Buffer>,
    words: u64,
    usage: wgpu::BufferUsages,
) -> Result<(), DeviceError> {
    let bytes = (4 * words).next_multiple_of(16);
    if buffer.as_ref().is_some_and(|b| b.size() >= bytes) {
        return Ok(());
    }
    let refused = || DeviceError::OutOfMemory {
        device: gpu.name.clone(),
        needed_bytes: bytes,
        budget_bytes: gpu.binding_bytes,
    };
    if bytes > gpu.binding_bytes {
        return Err(refused());
    }
    *buffer = None;
    *buffer = Some(gpu.buffer(label, bytes, usage).ok_or_else(refused)?);
    Ok(())
}

/// A buffer that was made before.
fn held(buffer: &Option<wgpu::Buffer>) -> &wgpu::Buffer {
    // every caller has asked for room before
    buffer.as_ref().expect("room was made")
}

fn binding<'a>(buffer: &'a wgpu::Buffer, section: &Section) -> wgpu::BindingResource<'a> {
    wgpu::BindingResource::Buffer(wgpu::BufferBinding {
        buffer,
        offset: section.start,
        size: std::num::NonZero::new(section.end - section.start),
    })
}

fn bind_group(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    resources: Vec<wgpu::BindingResource<'_>>,
) -> wgpu::BindGroup {
    let entries: Vec<_> =
        (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}

fn fill_picture(film: &mut Film, words: &[u32], pixels: usize) {
    let floats: &[f32] = bytemuck::cast_slice(words);
    let (rows, albedo) = floats.split_at(4 * pixels);
    let rows = rows.as_chunks::<4>().0;
    for (to, [r, g, b, _]) in film.rgb.iter_mut().zip(rows) {
        *to = [*r, *g, *b];
    }
    for share in [&mut film.alpha, &mut film.aovs.coverage].into_iter().flatten() {
        for (to, [.., through]) in share.iter_mut().zip(rows) {
            *to = 1.0 - through;
        }
    }
    if let Some(to) = &mut film.aovs.albedo {
        to.copy_from_slice(albedo.as_chunks::<3>().0);
    }
}

fn fill_center(film: &mut Film, words: &[u32]) {
    let pixels = words.as_chunks::<{ CENTER_WORDS as usize }>().0;
    let aovs = &mut film.aovs;
    let f = f32::from_bits;
    fn each<T>(to: &mut Option<Vec<T>>, pixels: &[[u32; 12]], of: impl Fn(&[u32; 12]) -> T) {
        for (to, pixel) in to.iter_mut().flatten().zip(pixels) {
            *to = of(pixel);
        }
    }
    each(&mut aovs.depth, pixels, |p| f(p[0]));
    each(&mut aovs.normal, pixels, |p| [f(p[1]), f(p[2]), f(p[3])]);
    each(&mut aovs.position, pixels, |p| [f(p[4]), f(p[5]), f(p[6])]);
    each(&mut aovs.id, pixels, |p| [p[7], p[8]]);
    each(&mut aovs.material, pixels, |p| p[9]);
    each(&mut aovs.uv, pixels, |p| [f(p[10]), f(p[11])]);
}

fn ray_counts(words: &[u32]) -> RayCounts {
    let count = |i: usize| u64::from(words[2 * i]) | u64::from(words[2 * i + 1]) << 32;
    RayCounts {
        camera: count(0),
        shadow: count(1),
        mirrored: count(2),
        refracted: count(3),
        media_ignored: count(4),
    }
}

impl Buffers {
    /// Room for the boxes of nodes that are fitted.
    pub(super) fn make_boxes(&mut self, gpu: &Gpu, fits: &[Fit]) -> Result<(), DeviceError> {
        let nodes: u64 = fits.iter().map(|f| u64::from(f.nodes)).sum();
        room(gpu, "boxes", &mut self.boxes, 8 * nodes.max(1), wgpu::BufferUsages::STORAGE)
    }
}
