//! `acm doctor`: what this machine has of what ACM needs.

use crate::cli::Exit;
use std::path::Path;

/// Prints what was found; fails if something that every run needs is missing.
pub fn run() -> anyhow::Result<Exit> {
    println!("acm {}", env!("CARGO_PKG_VERSION"));
    for adapter in acm_render::adapters() {
        println!("adapter   {adapter}");
    }
    let renderer = acm_render::Renderer::new();
    match &renderer {
        Ok(renderer) => println!("renderer  {}", renderer.adapter()),
        Err(error) => println!("renderer  MISSING: {error}"),
    }
    match acm_memory::default_library() {
        Ok(library) => println!("library   {} templates", library.iter().count()),
        Err(error) => println!("library   BROKEN: {error}"),
    }
    println!("scenarios {}", acm_sim::Scenario::names().join(", "));
    match std::env::var_os("ACM_DATA") {
        Some(dir) if Path::new(&dir).is_dir() => println!("data      ACM_DATA={}", Path::new(&dir).display()),
        Some(dir) => println!("data      ACM_DATA={} is no folder", Path::new(&dir).display()),
        None => println!("data      ACM_DATA is not set: tests on outside data are skipped"),
    }
    Ok(if renderer.is_ok() { Exit::Success } else { Exit::Failed })
}
