//! Kernels made ready: layouts of bindings, and a pipeline for each set of what frames have.

use super::adapter::Gpu;
use super::cache::Compiled;
use super::records::NODES_IN_GROUP;
use super::scene::Has;
use super::shaders::{self, Access};
use crate::store::Store;
use std::collections::HashMap;
use std::sync::Arc;

/// The binding of kernels that trace which is bound at an offset given with each dispatch.
const SLICE: usize = 1;
/// That of kernels that fit trees.
const LEVEL: usize = 0;

/// All that was made ready yet.
#[derive(Debug)]
pub(super) struct Pipelines {
    pub(super) trace_layout: wgpu::BindGroupLayout,
    pub(super) refit_layout: wgpu::BindGroupLayout,
    tracing_layout: wgpu::PipelineLayout,
    modules: HashMap<(Kernel, u32), wgpu::ShaderModule>,
    pub(super) refit_level: wgpu::ComputePipeline,
    pub(super) refit_top: wgpu::ComputePipeline,
    made: HashMap<(Kernel, Has), wgpu::ComputePipeline>,
    compiled: Option<Compiled>,
}

/// A kernel that traces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Kernel {
    /// The picture.
    Trace,
    /// Auxiliary pictures of the rays through the pixels' centres.
    Center,
}

impl Pipelines {
    pub(super) fn new(gpu: &Gpu, store: Option<&Arc<Store>>) -> Self {
        let compiled = Compiled::new(gpu, store);
        let cache = compiled.as_ref().map(Compiled::cache);
        let trace_layout = layout(gpu, "trace", &shaders::TRACE_BINDINGS, SLICE);
        let refit_layout = layout(gpu, "refit", &shaders::REFIT_BINDINGS, LEVEL);
        let pipelines = |label: &str, layout: &wgpu::BindGroupLayout| {
            gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(label),
                bind_group_layouts: &[Some(layout)],
                immediate_size: 0,
            })
        };
        let tracing_layout = pipelines("trace", &trace_layout);
        let refit_pipelines = pipelines("refit", &refit_layout);
        let refit = module(gpu, "refit", &shaders::refit());
        let fit = |entry: &str, threads: u32| {
            pipeline(gpu, cache, &refit_pipelines, &refit, entry, &[(shaders::GROUP, f64::from(threads))])
        };
        Self {
            refit_level: fit("refit_level", 8 * NODES_IN_GROUP),
            refit_top: fit("refit_top", gpu.top_threads),
            modules: HashMap::new(),
            trace_layout,
            refit_layout,
            tracing_layout,
            made: HashMap::new(),
            compiled,
        }
    }

    /// The pipeline for frames that have this.
    pub(super) fn tracing(&mut self, gpu: &Gpu, kernel: Kernel, has: Has) -> &wgpu::ComputePipeline {
        let Self { tracing_layout, modules, made, compiled, .. } = self;
        made.entry((kernel, has)).or_insert_with(|| {
            let (entry, text): (_, fn(u32) -> String) = match kernel {
                Kernel::Trace => ("trace", shaders::trace),
                Kernel::Center => ("center", shaders::center),
            };
            let module =
                modules.entry((kernel, has.far)).or_insert_with(|| module(gpu, entry, &text(has.far)));
            let cache = compiled.as_ref().map(Compiled::cache);
            let made = pipeline(gpu, cache, tracing_layout, module, entry, &constants(has));
            // at once: a run may be killed
            if let Some(compiled) = compiled {
                compiled.keep();
            }
            made
        })
    }
}

fn constants(has: Has) -> [(&'static str, f64); 10] {
    let flags = [
        has.single_tree,
        has.branches,
        has.textures,
        has.area_light,
        has.transparency,
        has.goes_on,
        has.albedo,
        has.one_light,
        has.one_ray,
    ];
    let mut constants = [(shaders::FILM_WORDS, f64::from(has.film_words)); 10];
    for ((constant, name), is_set) in constants.iter_mut().zip(shaders::FLAGS).zip(flags) {
        *constant = (name, f64::from(u8::from(is_set)));
    }
    constants
}

/// The layout of a kernel's bindings, of which one is bound at an offset given with each dispatch.
fn layout(gpu: &Gpu, label: &str, bindings: &[Access], with_offset: usize) -> wgpu::BindGroupLayout {
    let entry = |(binding, access): (usize, &Access)| {
        let ty = match access {
            Access::Read => wgpu::BufferBindingType::Storage { read_only: true },
            Access::Write => wgpu::BufferBindingType::Storage { read_only: false },
        };
        let has_dynamic_offset = binding == with_offset;
        wgpu::BindGroupLayoutEntry {
            binding: binding as u32,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset, min_binding_size: None },
            count: None,
        }
    };
    let entries: Vec<_> = bindings.iter().enumerate().map(entry).collect();
    gpu.device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

/// A kernel's text, compiled without checks at run time: they cost a tenth of the rays.
fn module(gpu: &Gpu, label: &str, text: &str) -> wgpu::ShaderModule {
    let descriptor =
        wgpu::ShaderModuleDescriptor { label: Some(label), source: wgpu::ShaderSource::Wgsl(text.into()) };
    // SAFETY: the texts are this crate's own. What they index by was made here: places in heaps and tables by `resident` and
    // `scene`, links of nodes by `PackedTree`, indices of vertices by the readers, which let none out of range through;
    // threads, pixels and waiting rays are compared with their bounds in the kernels, the depth of stacks is bounded by
    // `MAX_DEPTH`. Every loop ends: over counts of records, over levels of trees, over surfaces up to `SURFACES_MAX`.
    unsafe { gpu.device.create_shader_module_trusted(descriptor, wgpu::ShaderRuntimeChecks::unchecked()) }
}

fn pipeline(
    gpu: &Gpu,
    cache: Option<&wgpu::PipelineCache>,
    layout: &wgpu::PipelineLayout,
    module: &wgpu::ShaderModule,
    entry: &str,
    constants: &[(&str, f64)],
) -> wgpu::ComputePipeline {
    gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(entry),
        layout: Some(layout),
        module,
        entry_point: Some(entry),
        compilation_options: wgpu::PipelineCompilationOptions {
            constants,
            zero_initialize_workgroup_memory: false,
        },
        cache,
    })
}
