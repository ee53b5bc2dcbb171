//! A source's way through the compiler, and where in which file it finds an error.

use std::error::Error as _;

use wgpu::naga;

use super::{Chunk, SEPARATED, Source};
use crate::engine::gpu::device::Device;
use crate::error::{Error, Result};

/// The line (from 1) of the first place that a compiler error names; some of its labels have no place.
fn line_of(text: &str, mut spans: impl Iterator<Item = naga::Span>) -> Option<usize> {
    spans.find(naga::Span::is_defined).map(|span| span.location(text).line_number as usize)
}

impl Source {
    /// File and line (from 1) of a line of the whole text (from 1).
    pub fn locate(&self, line: usize) -> (&'static str, usize) {
        let mut left = line.max(1);
        for chunk in &self.chunks {
            let lines = chunk.text.lines().count();
            if left <= lines {
                return (chunk.file, left);
            }
            left -= lines;
        }
        // A line past the end, where the compiler reports an unclosed brace: the last line.
        let last = self.last();
        (last.file, last.text.lines().count())
    }

    /// Checks the text without a device.
    ///
    /// # Errors
    ///
    /// [`Error::Shader`] with the original file and line.
    pub fn validate(&self) -> Result<()> {
        let text = self.text();
        let module = naga::front::wgsl::parse_str(&text).map_err(|error| {
            self.error(line_of(&text, error.labels().map(|(span, _)| span)), error.message().to_owned())
        })?;
        let mut validator =
            naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::all());
        validator.validate(&module).map_err(|error| {
            let line = line_of(&text, error.spans().map(|&(span, _)| span));
            let mut message = error.as_inner().to_string();
            let mut cause = error.as_inner().source();
            while let Some(error) = cause {
                message = format!("{message}: {error}");
                cause = error.source();
            }
            self.error(line, message)
        })?;
        Ok(())
    }

    /// The compiled pipeline; `workgroup_size`, if given, sets the override of that name.
    ///
    /// It has the checks of bounds and loops that wgpu inserts: without them `rk4` and adaptive `rk8` took between 0 and 5 % less on lavapipe and
    /// between 1 % more and 2 % less on an H100, which is within the scatter, and leaving them out would need unsafe code.
    pub(in crate::engine::gpu) fn compile(
        &self,
        device: &Device,
        layout: &wgpu::PipelineLayout,
        workgroup_size: Option<u32>,
    ) -> Result<wgpu::ComputePipeline> {
        if !device.has(wgpu::Features::SHADER_INT64) && self.chunks.iter().any(|chunk| chunk.file == SEPARATED) {
            return self.clone().without_int64().compile(device, layout, workgroup_size);
        }
        let cache = device.pipeline_cache();
        let opened = &device.device;
        let scope = opened.push_error_scope(wgpu::ErrorFilter::Validation);
        let internal = opened.push_error_scope(wgpu::ErrorFilter::Internal);
        let module = opened.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(self.entry_point),
            source: wgpu::ShaderSource::Wgsl(self.text().into()),
        });
        let own = self.constants.iter().map(|(name, value)| (name.as_str(), f64::from(*value)));
        let constants: Vec<_> = own.chain(workgroup_size.map(|size| ("workgroup_size", f64::from(size)))).collect();
        let pipeline = opened.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(self.entry_point),
            layout: Some(layout),
            module: &module,
            entry_point: Some(self.entry_point),
            compilation_options: wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() },
            cache,
        });
        // Both futures are ready at once on native back ends.
        let errors = [pollster::block_on(internal.pop()), pollster::block_on(scope.pop())];
        match errors.into_iter().flatten().next() {
            None => {
                device.count_pipeline();
                Ok(pipeline)
            }
            Some(error) => {
                self.validate()?;
                Err(self.error(None, error.to_string()))
            }
        }
    }

    pub(super) fn last(&self) -> &Chunk {
        self.chunks.last().expect("a source has chunks")
    }

    /// An error at a line of the whole text, or at the entry point if the compiler names no line.
    pub(super) fn error(&self, line: Option<usize>, message: String) -> Error {
        let (file, line) = match line {
            Some(line) => self.locate(line),
            None => {
                let last = self.last();
                let entry_point = format!("fn {}(", self.entry_point);
                let line = last.text.lines().position(|line| line.contains(&entry_point)).unwrap_or(0) + 1;
                (last.file, line)
            }
        };
        Error::Shader { file, line, message }
    }
}
