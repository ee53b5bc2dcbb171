//! A caller's pool of threads is the one that works.

mod common;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use polhode::{Engine, Method, Precision};

/// Once all work went to the global pool, whatever pool it was started in: a benchmark found one thread as fast as two.
#[test]
fn work_stays_in_the_callers_pool_of_threads() {
    static RELEASED: AtomicBool = AtomicBool::new(false);
    let batch = common::asymmetric_batch(203, 21, Precision::F32);
    // No thread of the global pool is free while this lasts.
    rayon::spawn_broadcast(|_| {
        while !RELEASED.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_millis(1));
        }
    });
    let (sender, receiver) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| common::advanced(&Engine::cpu(), &batch, Method::Rk4, 1.0 / 64.0, 40));
        }
        let _ = sender.send(());
    });
    let finished = receiver.recv_timeout(Duration::from_secs(60));
    RELEASED.store(true, Ordering::Relaxed);
    assert!(finished.is_ok(), "the work waits for the global pool");
}
