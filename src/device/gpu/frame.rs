//! One frame on a GPU: trees are fitted, cuts of the picture traced, all handed to the queue at once; what comes out is
//! taken when it is there, while the next frames are under way.

use super::adapter::Gpu;
use super::arena::{Arena, Section};
use super::cuts::{Cut, GROUP, LANES_MOST, Pace, cuts, tile};
use super::exposed::{Exposed, FilmBuffers, Free};
use super::film::{COUNTERS, Facts, INSTANTS, Layout, facts, take_out};
use super::fits::{Fits, groups, is_top};
use super::heap::Heaps;
use super::pipelines::{Kernel, Pipelines};
use super::records::{Slice, WAITING_ROWS};
use super::resident::FitOf;
use super::scene::Records;
use crate::device::{DeviceError, Output, Stop};
use crate::film::LatentFilm;
use crate::scene::{Light, Shot};
use rayon::ThreadPool;
use std::ops::Range;
use std::sync::Arc;

/// Frames under way at most: one is read back, one traced, one prepared.
pub(super) const SLOTS: usize = 3;
/// Bytes of waiting rays at most, and no more than a quarter of what scenes may take.
const WAITING_BYTES: u64 = 1 << 29;

/// Buffers that frames use one after the other, and those of each frame under way.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    arena: Arena,
    frame: Option<wgpu::Buffer>,
    waiting: Option<wgpu::Buffer>,
    counters: Option<wgpu::Buffer>,
    boxes: Option<wgpu::Buffer>,
    costs: Option<wgpu::Buffer>,
    instants: Option<(wgpu::QuerySet, wgpu::Buffer)>,
    pub(super) pace: Pace,
    /// Where films may be written.
    pub(super) free: Free,
}

/// A frame that was handed to the queue.
#[derive(Debug)]
pub(super) struct Begun {
    film: FilmBuffers,
    layout: Layout,
    shot: Shot,
    output: Output,
    submission: wgpu::SubmissionIndex,
    /// The trees that are fitted.
    pub(super) fits: Vec<FitOf>,
}

impl Begun {
    /// Samples of the picture.
    pub(super) fn samples(&self) -> u64 {
        self.shot.size.iter().map(|&n| u64::from(n)).product::<u64>() * u64::from(self.shot.samples)
    }
}

/// What a frame's dispatches are made with.
pub(super) struct Ground<'a> {
    pub(super) gpu: &'a Gpu,
    pub(super) pipelines: &'a mut Pipelines,
    pub(super) heaps: &'a Heaps,
    pub(super) buffers: &'a mut Buffers,
}

/// Where a frame's lists are in the arena.
struct Sections {
    shot: Section,
    slices: Section,
    lists: [Section; 7],
    center_slices: Section,
    refit_trees: Section,
    refit_levels: Section,
}

impl Ground<'_> {
    /// Fits trees that wait for it, without tracing.
    pub(super) fn fit_only(&mut self, fits: &Fits) -> Result<(), DeviceError> {
        if fits.is_empty() {
            return Ok(());
        }
        self.room_for_fits(fits)?;
        self.buffers.arena.clear();
        let trees = self.buffers.arena.add(&fits.trees);
        let levels = self.buffers.arena.add_apart(&fits.levels);
        self.write_arena()?;
        let mut encoder = self.encoder();
        self.fit(&mut encoder, fits, &trees, &levels, None);
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.check()
    }

    /// Fits trees and traces a frame; does not wait for it, but for what it is cut into.
    pub(super) fn begin(
        &mut self,
        fits: &Fits,
        records: &Records,
        shot: &Shot,
        output: Output,
        stop: &Stop,
    ) -> Result<Begun, DeviceError> {
        let layout = Layout::new(shot, output, records.has.albedo, fits.trees.len() as u64);
        let lanes = shot.samples.next_power_of_two().min(LANES_MOST);
        // shaders/parts/branch.wgsl says why these are enough
        let waiting_each = if records.has.branches { shot.depth.max(1) } else { 0 };
        let (slices, waiting_bytes) = self.slices(records, shot, lanes, waiting_each);
        let center_slices = if layout.center.is_empty() {
            Vec::new()
        } else {
            let samples = self.buffers.pace.samples_most(records.has.branches, 1);
            cuts(shot.size, tile(1), samples / u64::from(GROUP), self.gpu.groups_most)
        };
        self.room_for_fits(fits)?;
        let buffers = self.room_for_frame(&layout, waiting_bytes)?;
        let sections = self.write_frame(records, fits, &slices, &center_slices, lanes, waiting_each)?;
        let film = &buffers.film;

        let mut encoder = self.encoder();
        let instants = self.buffers.instants.clone();
        let set = instants.as_ref().map(|(set, _)| set);
        self.fit(&mut encoder, fits, &sections.refit_trees, &sections.refit_levels, set);
        encoder.clear_buffer(held(self.buffers.counters.as_ref()), 0, None);
        for (kernel, cuts, slices, range) in [
            (Kernel::Trace, &slices, &sections.slices, &layout.film),
            (Kernel::Center, &center_slices, &sections.center_slices, &layout.center),
        ] {
            if cuts.is_empty() {
                continue;
            }
            let group = self.bindings(&sections, slices, film, range);
            let pipeline = self.pipelines.tracing(self.gpu, kernel, records.has).clone();
            for (i, cut) in cuts.iter().enumerate() {
                if stop.asked() {
                    self.gpu.queue.submit([encoder.finish()]);
                    return Err(DeviceError::Stopped);
                }
                let timed = set.filter(|_| kernel == Kernel::Trace);
                Self::dispatch(&mut encoder, &pipeline, &group, i, cut, timed, [i == 0, i + 1 == cuts.len()]);
                if i + 1 < cuts.len() {
                    let next = self.encoder();
                    self.gpu.queue.submit([std::mem::replace(&mut encoder, next).finish()]);
                    // what was handed over cannot be taken back: no more than this
                    self.gpu.wait()?;
                }
            }
        }
        let counters = held(self.buffers.counters.as_ref());
        encoder.copy_buffer_to_buffer(counters, 0, film, layout.counters.start, 4 * COUNTERS);
        if let Some((set, resolved)) = &instants {
            encoder.resolve_query_set(set, 0..INSTANTS as u32, resolved, 0);
            encoder.copy_buffer_to_buffer(resolved, 0, film, layout.instants.start, 8 * INSTANTS);
        }
        if !fits.is_empty() {
            let bytes = 4 * fits.trees.len() as u64;
            encoder.copy_buffer_to_buffer(
                held(self.buffers.costs.as_ref()),
                0,
                film,
                layout.costs.start,
                bytes,
            );
        }
        if let Some(back) = &buffers.back {
            encoder.copy_buffer_to_buffer(film, 0, back, 0, layout.bytes());
        }
        let submission = self.gpu.queue.submit([encoder.finish()]);
        buffers.read_by_host().slice(..layout.bytes()).map_async(wgpu::MapMode::Read, |_| {});
        self.gpu.check()?;
        let fits = fits.of.clone();
        Ok(Begun { film: buffers, layout, shot: shot.clone(), output, submission, fits })
    }

    /// Waits for a frame; its film lies in its buffer until it is asked for, and stays there where it is nothing but pixels.
    pub(super) fn finish(
        &mut self,
        begun: Begun,
        pool: &Arc<ThreadPool>,
    ) -> Result<(LatentFilm, Facts), DeviceError> {
        let Begun { film, layout, shot, output, submission, .. } = begun;
        self.gpu.wait_for(submission)?;
        let lost =
            |e: wgpu::MapRangeError| DeviceError::Lost { device: self.gpu.name.clone(), why: e.to_string() };
        let view = film.read_by_host().slice(..layout.bytes()).get_mapped_range().map_err(lost)?;
        let exposed = Exposed::new(view, film, &self.buffers.free);
        let facts = facts(exposed.as_ref(), &layout);
        self.gpu.check()?;
        let pool = Arc::clone(pool);
        Ok((LatentFilm::new(move || take_out(exposed, &layout, &shot, output, &pool)), facts))
    }

    #[allow(clippy::too_many_arguments, reason = "what a dispatch is")]
    fn dispatch(
        encoder: &mut wgpu::CommandEncoder,
        pipeline: &wgpu::ComputePipeline,
        group: &wgpu::BindGroup,
        slice: usize,
        cut: &Cut,
        timed: Option<&wgpu::QuerySet>,
        [is_first, is_last]: [bool; 2],
    ) {
        let timestamp_writes =
            timed.filter(|_| is_first || is_last).map(|query_set| wgpu::ComputePassTimestampWrites {
                query_set,
                beginning_of_pass_write_index: is_first.then_some(2),
                end_of_pass_write_index: is_last.then_some(3),
            });
        let mut pass =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group, &[slice as u32 * Arena::STEP]);
        pass.dispatch_workgroups(cut.groups[0], cut.groups[1], 1);
    }

    /// How the picture is cut, and the bytes that waiting rays take in one cut.
    fn slices(&self, records: &Records, shot: &Shot, lanes: u32, waiting_each: u32) -> (Vec<Cut>, u64) {
        let tile = tile(lanes);
        let points =
            |light: &Light| if let Light::Area { samples } = light { u64::from(*samples) } else { 1 };
        let shadows = shot.lights.iter().map(points).sum();
        let samples = self.buffers.pace.samples_most(records.has.branches, shadows);
        // a row of them at least: fewer would leave most of a GPU idle
        let across = u64::from(shot.size[0].div_ceil(tile[0]));
        let mut tiles_most = across.max(samples / (u64::from(tile[0] * tile[1]) * u64::from(shot.samples)));
        let bytes_each = u64::from(GROUP) * u64::from(waiting_each) * WAITING_ROWS * 16;
        let waiting_most = WAITING_BYTES.min(self.gpu.binding_bytes).min(self.gpu.budget_bytes / 4);
        if let Some(most) = waiting_most.checked_div(bytes_each) {
            tiles_most = tiles_most.min(most);
        }
        let cuts = cuts(shot.size, tile, tiles_most, self.gpu.groups_most);
        let tiles = cuts.first().map_or(0, |c| u64::from(c.groups[0]) * u64::from(c.groups[1]));
        (cuts, tiles * bytes_each)
    }

    fn room_for_fits(&mut self, fits: &Fits) -> Result<(), DeviceError> {
        let Self { gpu, buffers, .. } = self;
        let storage = wgpu::BufferUsages::STORAGE;
        room(gpu, "boxes", &mut buffers.boxes, 32 * fits.nodes.max(1), storage)?;
        let usage = storage | wgpu::BufferUsages::COPY_SRC;
        room(gpu, "costs", &mut buffers.costs, 4 * fits.trees.len().max(1) as u64, usage)
    }

    /// Makes room for a frame; gives where its film goes.
    fn room_for_frame(&mut self, layout: &Layout, waiting_bytes: u64) -> Result<FilmBuffers, DeviceError> {
        let Self { gpu, buffers, .. } = self;
        let storage = wgpu::BufferUsages::STORAGE;
        let (source, target) = (wgpu::BufferUsages::COPY_SRC, wgpu::BufferUsages::COPY_DST);
        room(gpu, "waiting rays", &mut buffers.waiting, waiting_bytes.max(16), storage)?;
        room(gpu, "counters", &mut buffers.counters, 4 * COUNTERS, storage | source | target)?;
        if gpu.features.contains(wgpu::Features::TIMESTAMP_QUERY) && buffers.instants.is_none() {
            let set = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("instants"),
                ty: wgpu::QueryType::Timestamp,
                count: INSTANTS as u32,
            });
            let mut resolved = None;
            let usage = wgpu::BufferUsages::QUERY_RESOLVE | source;
            room(gpu, "instants", &mut resolved, 256, usage)?;
            buffers.instants = resolved.map(|resolved| (set, resolved));
        }
        let bytes = layout.bytes().next_multiple_of(16);
        if let Some(film) = buffers.free.take(bytes) {
            return Ok(film);
        }
        gpu.allows("the picture", bytes)?;
        let buffer = |usage| gpu.buffer("the picture", bytes, usage);
        if gpu.features.contains(wgpu::Features::MAPPABLE_PRIMARY_BUFFERS) {
            // kernels write straight into what the host reads
            let film = buffer(storage | target | wgpu::BufferUsages::MAP_READ)?;
            return Ok(FilmBuffers { film, back: None });
        }
        let film = buffer(storage | source | target)?;
        Ok(FilmBuffers { film, back: Some(buffer(target | wgpu::BufferUsages::MAP_READ)?) })
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
            move |cut: &Cut| Slice {
                first_row: cut.rows.start,
                end_row: cut.rows.end,
                first_tile: cut.first_tile,
                lanes,
                waiting_each,
            }
        };
        let arena = &mut self.buffers.arena;
        arena.clear();
        let slices: Vec<Slice> = slices.iter().map(slice(lanes)).collect();
        let center: Vec<Slice> = center_slices.iter().map(slice(1)).collect();
        let sections = Sections {
            shot: arena.add(&[records.shot]),
            slices: arena.add_apart(&slices),
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
            refit_trees: arena.add(&fits.trees),
            refit_levels: arena.add_apart(&fits.levels),
        };
        self.write_arena()?;
        Ok(sections)
    }

    fn write_arena(&mut self) -> Result<(), DeviceError> {
        let Buffers { arena, frame, .. } = &mut *self.buffers;
        arena.write(self.gpu, frame)
    }

    fn encoder(&self) -> wgpu::CommandEncoder {
        self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// A section of the arena as a binding.
    fn section(&self, section: &Section) -> wgpu::BindingResource<'_> {
        binding(held(self.buffers.frame.as_ref()), section)
    }

    fn bindings(
        &self,
        sections: &Sections,
        slices: &Section,
        film: &wgpu::Buffer,
        range: &Range<u64>,
    ) -> wgpu::BindGroup {
        let Buffers { waiting, counters, .. } = &*self.buffers;
        let mut resources = vec![self.section(&sections.shot), self.section(slices)];
        resources.extend(sections.lists.iter().map(|list| self.section(list)));
        let Heaps { nodes, triangles, words, texels } = self.heaps;
        resources.extend([nodes, triangles, words, texels].map(|heap| heap.buffer().as_entire_binding()));
        resources.push(binding(film, range));
        resources.extend([waiting, counters].map(|buffer| held(buffer.as_ref()).as_entire_binding()));
        bind_group(self.gpu, &self.pipelines.trace_layout, resources)
    }

    /// Fits trees, from below.
    fn fit(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        fits: &Fits,
        trees: &Section,
        levels: &Section,
        timed: Option<&wgpu::QuerySet>,
    ) {
        if fits.is_empty() {
            return;
        }
        let Heaps { nodes, triangles, words, .. } = self.heaps;
        let resources = vec![
            self.section(levels),
            self.section(trees),
            words.buffer().as_entire_binding(),
            nodes.buffer().as_entire_binding(),
            triangles.buffer().as_entire_binding(),
            held(self.buffers.boxes.as_ref()).as_entire_binding(),
            held(self.buffers.costs.as_ref()).as_entire_binding(),
            words.buffer().as_entire_binding(),
        ];
        let group = bind_group(self.gpu, &self.pipelines.refit_layout, resources);
        let timestamp_writes = timed.map(|query_set| wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        });
        let mut pass =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes });
        for (i, level) in fits.levels.iter().enumerate() {
            let pipeline =
                if is_top(level) { &self.pipelines.refit_top } else { &self.pipelines.refit_level };
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &group, &[i as u32 * Arena::STEP]);
            let [columns, rows] = groups(level, self.gpu.groups_most);
            pass.dispatch_workgroups(columns, rows, 1);
        }
    }
}

/// Makes a buffer of so many bytes at least.
fn room(
    gpu: &Gpu,
    what: &str,
    buffer: &mut Option<wgpu::Buffer>,
    bytes: u64,
    usage: wgpu::BufferUsages,
) -> Result<(), DeviceError> {
    let bytes = bytes.next_multiple_of(16);
    if buffer.as_ref().is_some_and(|b| b.size() >= bytes) {
        return Ok(());
    }
    gpu.allows(what, bytes)?;
    // the old one first, so that both need not have room
    *buffer = None;
    *buffer = Some(gpu.buffer(what, bytes, usage)?);
    Ok(())
}

/// A buffer for which there is room.
fn held(buffer: Option<&wgpu::Buffer>) -> &wgpu::Buffer {
    // whoever asks has made room before
    buffer.expect("room was made")
}

fn binding<'a>(buffer: &'a wgpu::Buffer, section: &Range<u64>) -> wgpu::BindingResource<'a> {
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
