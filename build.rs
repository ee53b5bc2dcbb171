//! Tells the library by which kind of profile it is built, for the rows of its benchmarks.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rustc-env=POLHODE_PROFILE={}", std::env::var("PROFILE").unwrap_or_default());
}
