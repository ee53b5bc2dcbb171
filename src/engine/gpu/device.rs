//! Adapters, and an open device: errors typed, waiting that survives a lost device.

use std::ops::Range;
use std::panic::AssertUnwindSafe;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use super::disk_cache::DiskCache;
use super::dispatch::SliceLimits;
use crate::engine::Traffic;
use crate::error::{Error, Result};

/// What kind of hardware an adapter is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum AdapterKind {
    /// A graphics card with memory of its own.
    Discrete,
    /// A GPU that shares the processor's memory.
    Integrated,
    /// A GPU of the host, lent to a virtual machine.
    Virtual,
    /// A program on the processor that plays a GPU.
    Software,
    /// None of these, or not known.
    Other,
}

impl AdapterKind {
    /// Whether the adapter is a GPU in hardware.
    pub fn is_real(self) -> bool {
        matches!(self, AdapterKind::Discrete | AdapterKind::Integrated | AdapterKind::Virtual)
    }

    /// Order in which adapters are tried: most likely the fastest first.
    pub(crate) fn rank(self) -> u32 {
        match self {
            AdapterKind::Discrete => 0,
            AdapterKind::Integrated => 1,
            AdapterKind::Virtual => 2,
            AdapterKind::Software => 3,
            AdapterKind::Other => 4,
        }
    }
}

impl From<wgpu::DeviceType> for AdapterKind {
    fn from(kind: wgpu::DeviceType) -> Self {
        match kind {
            wgpu::DeviceType::DiscreteGpu => AdapterKind::Discrete,
            wgpu::DeviceType::IntegratedGpu => AdapterKind::Integrated,
            wgpu::DeviceType::VirtualGpu => AdapterKind::Virtual,
            wgpu::DeviceType::Cpu => AdapterKind::Software,
            wgpu::DeviceType::Other => AdapterKind::Other,
        }
    }
}

impl std::fmt::Display for AdapterKind {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            AdapterKind::Discrete => "discrete GPU",
            AdapterKind::Integrated => "integrated GPU",
            AdapterKind::Virtual => "virtual GPU",
            AdapterKind::Software => "software adapter",
            AdapterKind::Other => "adapter of unknown kind",
        })
    }
}

/// The adapters of all native back ends, in the order in which they are numbered.
pub(crate) async fn adapters() -> Vec<wgpu::Adapter> {
    // One for the whole process: each loads the drivers anew, and with NVIDIA's (580.159) the thirtieth finds no adapter any more.
    static INSTANCE: OnceLock<wgpu::Instance> = OnceLock::new();
    INSTANCE.get_or_init(instance).enumerate_adapters(wgpu::Backends::all()).await
}

fn instance() -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    // No debug layers: they are for the development of wgpu itself and several times slower.
    descriptor.flags = wgpu::InstanceFlags::empty();
    // An allocation beyond what the driver says is free is refused at once, not when the memory is touched.
    descriptor.memory_budget_thresholds.for_resource_creation = Some(MEMORY_BUDGET_PERCENT);
    wgpu::Instance::new(descriptor)
}

/// Share of the driver's memory budget that may be taken: the rest is for what else is on the screen.
const MEMORY_BUDGET_PERCENT: u8 = 95;

/// Features that kernels, the probe or what is kept of a device use where the adapter has them.
const USED_FEATURES: wgpu::Features =
    wgpu::Features::SHADER_F64.union(wgpu::Features::SHADER_INT64).union(wgpu::Features::PIPELINE_CACHE);

/// Why the driver refused to make something.
pub(crate) enum Refusal {
    /// No memory left.
    OutOfMemory,
    /// Anything else, in the driver's words.
    Other(String),
}

/// What has passed between host and device, counted.
#[derive(Debug, Default)]
struct Counters {
    waits: AtomicU64,
    dispatches: AtomicU64,
    bytes_written: AtomicU64,
    bytes_read: AtomicU64,
    pipelines: AtomicU64,
    nanoseconds_waited: AtomicU64,
}

/// Commands that the device has been given.
pub(crate) struct Submission {
    index: wgpu::SubmissionIndex,
    /// Whether the device has said that they are done.
    done: Arc<AtomicBool>,
}

/// Bytes on their way to the host.
pub(crate) struct Request {
    submission: Submission,
    mapped: Receiver<Result<(), wgpu::BufferAsyncError>>,
    staging: wgpu::Buffer,
    range: Range<u64>,
}

impl Request {
    /// Gives the buffer back; what was on its way is lost.
    pub fn cancel(self) {
        self.staging.unmap();
    }
}

/// An open device with its queue.
#[derive(Debug)]
pub(crate) struct Device {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub info: wgpu::AdapterInfo,
    /// How long a wait for the device may take.
    pub longest_wait: Duration,
    /// What was said when the device was lost, or when an error came outside of any scope.
    fault: Arc<Mutex<Option<String>>>,
    counters: Counters,
    /// What is kept between runs, and the driver's part of it where the back end has such a cache.
    disk_cache: Option<DiskCache>,
    pipeline_cache: Option<wgpu::PipelineCache>,
}

impl Device {
    /// Opens an adapter with its own limits; `cache`: the folder of what is kept between runs.
    pub async fn open(adapter: &wgpu::Adapter, cache: Option<&Path>) -> Result<Self> {
        let info = adapter.get_info();
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("polhode"),
            required_features: adapter.features() & USED_FEATURES,
            required_limits: adapter.limits(),
            // Small blocks: an ensemble is a few large buffers, which get memory of their own anyhow.
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            ..Default::default()
        };
        let (device, queue) = adapter
            .request_device(&descriptor)
            .await
            .map_err(|error| Error::Device { adapter: info.name.clone(), reason: error.to_string() })?;
        let mut opened = Self::new(device, queue, info);
        opened.cache_in(cache);
        let fault = Arc::clone(&opened.fault);
        opened.device.set_device_lost_callback(move |reason, message| {
            remember(&fault, format!("lost ({reason:?}): {message}"));
        });
        let fault = Arc::clone(&opened.fault);
        // The default handler panics; whatever comes past the scopes is reported by the next wait instead.
        opened.device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| remember(&fault, error.to_string())));
        Ok(opened)
    }

    /// Takes a device of the caller's, whose callbacks are left alone.
    pub fn borrowed(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let info = device.adapter_info();
        Self::new(device, queue, info)
    }

    fn new(device: wgpu::Device, queue: wgpu::Queue, info: wgpu::AdapterInfo) -> Self {
        let longest_wait = SliceLimits::default().longest_wait;
        let (fault, counters) = (Arc::default(), Counters::default());
        Self { device, queue, info, longest_wait, fault, counters, disk_cache: None, pipeline_cache: None }
    }

    /// Takes what is kept of this device in a folder, and keeps there what is new when the device is dropped.
    pub fn cache_in(&mut self, folder: Option<&Path>) {
        self.disk_cache = folder.map(|folder| DiskCache::read(folder, &self.info));
        if let Some(kept) = self.disk_cache.as_ref().filter(|_| self.has(wgpu::Features::PIPELINE_CACHE)) {
            // A cache that cannot be made is one that keeps nothing.
            self.pipeline_cache = self.scoped(|| kept.pipelines(&self.device)).ok();
        }
    }

    /// What is kept between runs.
    pub fn disk_cache(&self) -> Option<&DiskCache> {
        self.disk_cache.as_ref()
    }

    /// What the driver has compiled so far.
    pub fn pipeline_cache(&self) -> Option<&wgpu::PipelineCache> {
        self.pipeline_cache.as_ref()
    }

    /// Counts the time of a wait for the compiler.
    pub fn waiting_for_kernels<T>(&self, wait: impl FnOnce() -> T) -> T {
        let clock = Instant::now();
        let waited = wait();
        self.counters.nanoseconds_waited.fetch_add(clock.elapsed().as_nanos() as u64, Ordering::Relaxed);
        waited
    }

    /// Counts a pipeline that was compiled.
    pub fn count_pipeline(&self) {
        self.counters.pipelines.fetch_add(1, Ordering::Relaxed);
    }

    pub fn has(&self, feature: wgpu::Features) -> bool {
        self.device.features().contains(feature)
    }

    pub fn kind(&self) -> AdapterKind {
        self.info.device_type.into()
    }

    /// Driver and version, as far as the driver gives them.
    pub fn driver(&self) -> String {
        driver_of(&self.info)
    }

    /// What has passed between host and device so far.
    pub fn traffic(&self) -> Traffic {
        let Counters { waits, dispatches, bytes_written, bytes_read, pipelines, nanoseconds_waited } = &self.counters;
        let load = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Traffic {
            waits: load(waits),
            dispatches: load(dispatches),
            bytes_written: load(bytes_written),
            bytes_read: load(bytes_read),
            pipelines: load(pipelines),
            waited_for_pipelines: Duration::from_nanos(load(nanoseconds_waited)),
        }
    }

    /// Writes to a buffer before the next submission.
    pub fn write(&self, buffer: &wgpu::Buffer, offset: u64, bytes: &[u8]) {
        self.counters.bytes_written.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        self.queue.write_buffer(buffer, offset, bytes);
    }

    /// Adds a dispatch of so many workgroups to a pass.
    pub fn dispatch(&self, pass: &mut wgpu::ComputePass<'_>, workgroups: u32) {
        self.counters.dispatches.fetch_add(1, Ordering::Relaxed);
        pass.dispatch_workgroups(workgroups, 1, 1);
    }

    /// Adds a dispatch of as many workgroups as a buffer says at a place.
    pub fn dispatch_indirect(&self, pass: &mut wgpu::ComputePass<'_>, buffer: &wgpu::Buffer, offset: u64) {
        self.counters.dispatches.fetch_add(1, Ordering::Relaxed);
        pass.dispatch_workgroups_indirect(buffer, offset);
    }

    /// A typed error about this device.
    pub fn error(&self, reason: impl ToString) -> Error {
        let fault = self.fault.lock().unwrap_or_else(PoisonError::into_inner).clone();
        Error::Device { adapter: self.info.name.clone(), reason: fault.unwrap_or_else(|| reason.to_string()) }
    }

    /// Runs `work` and gives back what the driver refused in it.
    pub fn scoped<T>(&self, work: impl FnOnce() -> T) -> Result<T, Refusal> {
        let internal = self.device.push_error_scope(wgpu::ErrorFilter::Internal);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let done = work();
        // The futures are ready at once on native back ends.
        let memory = pollster::block_on(memory.pop());
        let errors = [pollster::block_on(validation.pop()), pollster::block_on(internal.pop())];
        if memory.is_some() {
            return Err(Refusal::OutOfMemory);
        }
        match errors.into_iter().flatten().next() {
            Some(error) => Err(Refusal::Other(error.to_string())),
            None => Ok(done),
        }
    }

    /// Runs `work` in which no buffers are asked for.
    pub fn checked<T>(&self, work: impl FnOnce() -> T) -> Result<T> {
        self.scoped(work).map_err(|refusal| self.refused(refusal))
    }

    /// The commands that `encode` adds to an encoder.
    pub fn encoded(&self, label: &str, encode: impl FnOnce(&mut wgpu::CommandEncoder)) -> Result<wgpu::CommandBuffer> {
        self.checked(|| {
            let descriptor = wgpu::CommandEncoderDescriptor { label: Some(label) };
            let mut encoder = self.device.create_command_encoder(&descriptor);
            encode(&mut encoder);
            encoder.finish()
        })
    }

    /// Submits commands (or, with none, the writes so far) and waits until they are done.
    pub fn submit(&self, commands: Option<wgpu::CommandBuffer>) -> Result<()> {
        self.wait(self.submit_only(commands)?)
    }

    /// Submits commands or the writes so far.
    pub fn submit_only(&self, commands: Option<wgpu::CommandBuffer>) -> Result<Submission> {
        self.checked(|| self.submission(commands))
    }

    fn submission(&self, commands: Option<wgpu::CommandBuffer>) -> Submission {
        let (index, done) = (self.queue.submit(commands), Arc::new(AtomicBool::new(false)));
        let told = Arc::clone(&done);
        self.queue.on_submitted_work_done(move || told.store(true, Ordering::Release));
        Submission { index, done }
    }

    /// Submits commands that fill a range of `staging`, waits, and shows the bytes to `look`.
    pub fn read<T>(
        &self,
        commands: wgpu::CommandBuffer,
        staging: &wgpu::Buffer,
        range: Range<u64>,
        look: impl FnOnce(&[u8]) -> T,
    ) -> Result<T> {
        let request = self.request(commands, staging, range)?;
        self.fulfil(request, look)
    }

    /// Submits commands that fill a range of `staging`, which is the request's until it is fulfilled or cancelled.
    pub fn request(&self, commands: wgpu::CommandBuffer, staging: &wgpu::Buffer, range: Range<u64>) -> Result<Request> {
        let (sender, mapped) = std::sync::mpsc::channel();
        let submission = self.checked(|| {
            let submission = self.submission(Some(commands));
            staging.map_async(wgpu::MapMode::Read, range.clone(), move |result| {
                // The receiver is gone only where the wait has failed, and then nobody asks.
                let _ = sender.send(result);
            });
            submission
        })?;
        Ok(Request { submission, mapped, staging: staging.clone(), range })
    }

    /// Waits until a request is there and shows its bytes to `look`.
    pub fn fulfil<T>(&self, request: Request, look: impl FnOnce(&[u8]) -> T) -> Result<T> {
        let Request { submission, mapped, staging, range } = request;
        self.wait(submission)?;
        // Another thread's wait for the device may be the one that gives the answer, a little later.
        match mapped.recv_timeout(LONGEST_ANSWER) {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return Err(self.error(error)),
            Err(_) => return Err(self.error("gave no answer to a request to read")),
        }
        self.counters.bytes_read.fetch_add(range.end - range.start, Ordering::Relaxed);
        let view = staging.get_mapped_range(range).map_err(|error| self.error(error))?;
        let seen = look(&view);
        drop(view);
        staging.unmap();
        Ok(seen)
    }

    /// Frees what was dropped and is no longer in use.
    pub fn release(&self) {
        // A lost device has nothing left to free.
        let _ = self.poll(wgpu::PollType::Poll);
    }

    /// Waits until a submission is done.
    pub fn wait(&self, Submission { index, done }: Submission) -> Result<()> {
        // What is done already is no wait. Not asked by a wait that may take no time: where another thread's wait ends meanwhile,
        // wgpu 30 panics, and what it had yet to tell is lost.
        self.poll(wgpu::PollType::Poll)?;
        if !done.load(Ordering::Acquire) {
            self.counters.waits.fetch_add(1, Ordering::Relaxed);
        }
        // Also of what is done, as a refused submission is told to be.
        self.poll(wgpu::PollType::Wait { submission_index: Some(index), timeout: Some(self.longest_wait) })
    }

    fn poll(&self, poll_type: wgpu::PollType) -> Result<()> {
        // wgpu panics where the device is lost during a wait, and a refused submission shows only in the wait for it.
        match std::panic::catch_unwind(AssertUnwindSafe(|| self.device.poll(poll_type))) {
            Ok(Ok(_)) => Ok(()),
            Ok(Err(wgpu::PollError::Timeout)) => {
                Err(self.error(format!("hangs: it gave no answer in {:?}", self.longest_wait)))
            }
            Ok(Err(error)) => Err(self.error(error)),
            Err(_) => Err(self.error("lost while waiting")),
        }
    }

    /// The error for a refusal where no buffers were asked for.
    pub fn refused(&self, refusal: Refusal) -> Error {
        match refusal {
            Refusal::OutOfMemory => self.error("out of memory"),
            Refusal::Other(reason) => self.error(reason),
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        let Some(kept) = &self.disk_cache else { return };
        // The driver's cache of a device that is lost is not asked for.
        if self.fault.lock().unwrap_or_else(PoisonError::into_inner).is_none() {
            kept.write(self.pipeline_cache.as_ref().and_then(wgpu::PipelineCache::get_data));
        }
    }
}

/// How long after a submission is done a request to read it may go without an answer.
const LONGEST_ANSWER: Duration = Duration::from_secs(10);

/// Driver and version of an adapter, as far as the driver gives them.
pub(crate) fn driver_of(info: &wgpu::AdapterInfo) -> String {
    format!("{} {}", info.driver, info.driver_info).trim().to_owned()
}

/// Keeps the first fault: what follows is its consequence.
fn remember(fault: &Mutex<Option<String>>, message: String) {
    fault.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(message);
}

#[cfg(test)]
mod tests {
    use super::super::opened_for_a_test;

    /// Each thread reads back what it wrote itself, whichever thread's wait gives the answer.
    #[test]
    fn threads_that_wait_at_once_get_their_own_answers() {
        let gpu = opened_for_a_test();
        let device = &gpu.device;
        let read_back = |thread: u32| {
            let made = |usage| {
                let descriptor = wgpu::BufferDescriptor { label: None, size: 4096, usage, mapped_at_creation: false };
                device.device.create_buffer(&descriptor)
            };
            let source = made(wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST);
            let staging = made(wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ);
            for round in 0..1500 {
                let written = [thread << 16 | round; 1024];
                device.write(&source, 0, bytemuck::cast_slice(&written));
                let copy = |encoder: &mut wgpu::CommandEncoder| {
                    encoder.copy_buffer_to_buffer(&source, 0, &staging, 0, 4096);
                };
                let commands = device.encoded("copy", copy).expect("encoded");
                let read = device
                    .read(commands, &staging, 0..4096, |bytes| bytes == bytemuck::cast_slice::<u32, u8>(&written));
                assert!(read.expect("an answer"), "thread {thread}, round {round}");
            }
        };
        std::thread::scope(|scope| {
            for thread in 0..8 {
                scope.spawn(move || read_back(thread));
            }
        });
    }
}
