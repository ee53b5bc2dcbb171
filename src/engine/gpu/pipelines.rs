//! Kernels, each compiled once on a thread of its own: meanwhile bodies are prepared and other kernels run.

use std::collections::HashMap;
use std::panic::AssertUnwindSafe;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use super::device::Device;
use super::shader::Key;
use crate::error::Result;

/// A kernel that is compiled, or is being compiled; copies share it.
#[derive(Clone, Debug)]
pub(super) struct Kernel(Arc<Place>);

/// Where the compiling thread leaves a kernel.
#[derive(Debug)]
struct Place {
    device: Arc<Device>,
    made: Mutex<Option<Result<wgpu::ComputePipeline>>>,
    is_made: Condvar,
}

/// Kernels by the keys of their sources.
#[derive(Debug, Default)]
pub(super) struct Pipelines {
    kernels: Mutex<HashMap<Key, Kernel>>,
    threads: Mutex<Vec<JoinHandle<()>>>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Kernel {
    /// The pipeline, once it is compiled.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Shader`] with the original file and line; [`crate::Error::Device`] where the device is lost.
    pub fn pipeline(&self) -> Result<wgpu::ComputePipeline> {
        let Place { device, made, is_made } = &*self.0;
        if let Some(made) = &*lock(made) {
            return made.clone();
        }
        device.waiting_for_kernels(|| {
            let mut made = lock(made);
            loop {
                if let Some(made) = &*made {
                    return made.clone();
                }
                made = is_made.wait(made).unwrap_or_else(PoisonError::into_inner);
            }
        })
    }

    /// Compiles it and notifies waiting threads.
    fn make(&self, compile: impl FnOnce(&Device) -> Result<wgpu::ComputePipeline>) {
        let device = &self.0.device;
        // wgpu panics if the device is lost, and waiting threads must receive an error.
        let compiled = std::panic::catch_unwind(AssertUnwindSafe(|| compile(device)));
        self.leave(compiled.unwrap_or_else(|_| Err(device.error("lost while compiling"))));
    }

    fn leave(&self, made: Result<wgpu::ComputePipeline>) {
        *lock(&self.0.made) = Some(made);
        self.0.is_made.notify_all();
    }
}

impl Pipelines {
    /// The kernel of a key, which `compile` makes if there is none yet.
    pub fn get(
        &self,
        device: &Arc<Device>,
        key: Key,
        compile: impl FnOnce(&Device) -> Result<wgpu::ComputePipeline> + Send + 'static,
    ) -> Kernel {
        let mut kernels = lock(&self.kernels);
        if let Some(kernel) = kernels.get(&key) {
            return kernel.clone();
        }
        let place = Place { device: Arc::clone(device), made: Mutex::default(), is_made: Condvar::new() };
        let kernel = Kernel(Arc::new(place));
        kernels.insert(key, kernel.clone());
        drop(kernels);
        let theirs = kernel.clone();
        match std::thread::Builder::new().name("compile".to_owned()).spawn(move || theirs.make(compile)) {
            Ok(thread) => lock(&self.threads).push(thread),
            Err(error) => kernel.leave(Err(device.error(format!("no thread to compile with: {error}")))),
        }
        kernel
    }
}

impl Drop for Pipelines {
    /// Waits for all compilations: a process must not end, and so unload the drivers, while they compile.
    fn drop(&mut self) {
        for thread in lock(&self.threads).drain(..) {
            // The thread itself has caught panics.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::super::shader::{Patch, Source};
    use super::super::{Gpu, GpuOptions};
    use super::*;
    use crate::engine::batch::{AnyBatch, Batch};
    use crate::engine::{Backend as _, End};
    use crate::error::Error;
    use crate::kernel::method::Method;
    use crate::math::Precision;

    fn opened(patches: Vec<Patch>) -> Gpu {
        let options = GpuOptions { software: true, patches, ..GpuOptions::default() };
        pollster::block_on(Gpu::open(options)).expect("tests need a Vulkan driver")
    }

    fn key(name: &str) -> Key {
        (name.to_owned(), Vec::new())
    }

    #[test]
    fn one_kernel_is_asked_for_while_another_is_compiled() {
        let gpu = opened(Vec::new());
        let pipelines = Pipelines::default();
        let source = Source::advance(Precision::F32, Method::Rk4);
        let compiled = gpu.kernel(source).and_then(|kernel| kernel.pipeline()).expect("compiled");
        let (go_on, held) = channel::<()>();
        let slow = {
            let pipeline = compiled.clone();
            pipelines.get(&gpu.device, key("slow"), move |_| {
                held.recv().expect("told to go on");
                Ok(pipeline)
            })
        };
        // Neither waits for the slow one.
        let quick = pipelines.get(&gpu.device, key("quick"), move |_| Ok(compiled));
        assert!(quick.pipeline().is_ok());
        let same = pipelines.get(&gpu.device, key("slow"), |_| unreachable!("it is being compiled"));
        assert!(lock(&slow.0.made).is_none() && lock(&same.0.made).is_none());
        go_on.send(()).expect("it waits");
        assert_eq!(same.pipeline().expect("compiled"), slow.pipeline().expect("compiled"));
    }

    #[test]
    fn a_compiler_that_panics_is_an_error_to_all_who_wait() {
        let gpu = opened(Vec::new());
        let pipelines = Pipelines::default();
        let kernel = pipelines.get(&gpu.device, key("lost"), |_| panic!("as wgpu does where a device is lost"));
        for _ in 0..2 {
            assert!(matches!(kernel.pipeline(), Err(Error::Device { .. })));
        }
    }

    #[test]
    fn a_kernel_is_compiled_once_and_its_faults_are_told_by_whoever_needs_it() {
        let gpu = opened(Vec::new());
        let before = gpu.traffic().pipelines;
        let start = |gpu: &Gpu| gpu.start(AnyBatch::F32(Batch::at_rest(3)), Method::Rk4).expect("started");
        let mut sessions = [start(&gpu), start(&gpu), start(&gpu)];
        for session in &mut sessions {
            session.advance_to(End::of_steps(0.1, 2), &mut |_| std::ops::ControlFlow::Continue(())).expect("advanced");
        }
        assert_eq!(gpu.traffic().pipelines - before, 1);

        let patch = Patch { file: "method/rk4.wgsl".into(), from: "fn ".into(), to: "fn fn ".into() };
        let gpu = opened(vec![patch]);
        let mut session = start(&gpu);
        for _ in 0..2 {
            assert!(matches!(session.ready(), Err(Error::Shader { file: "method/rk4.wgsl", .. })));
        }
    }
}
