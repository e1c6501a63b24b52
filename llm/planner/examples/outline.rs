//! Prints how instructions are read: `cargo run -p acm-planner --example outline < instructions.txt`. With a folder as
//! its argument the lexicon is read from there, with a second one the library.
use acm_concept::template::TemplateLibrary;
use acm_planner::{Lexicon, Planner, embedded_lexicon};
use std::{fs, io::BufRead, path::Path};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut files = embedded_lexicon();
    if let Some(folder) = arguments.next() {
        for (name, text) in &mut files {
            *text = fs::read_to_string(Path::new(&folder).join(name))?;
        }
    }
    let library = match arguments.next() {
        Some(folder) => read_library(Path::new(&folder))?,
        None => acm_memory::default_library()?,
    };
    let planner = Planner::with_lexicon(Lexicon::parse(&files)?);
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        println!("{line}");
        match planner.parse(&line, &library) {
            Ok(task) => {
                println!("  {}", task.outline().join("; "));
                println!("  {task}");
            }
            Err(error) => println!("  {error}"),
        }
    }
    Ok(())
}

/// All templates of a folder and of those in it.
fn read_library(folder: &Path) -> Result<TemplateLibrary, Box<dyn std::error::Error>> {
    let mut texts = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder)? {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "toml") {
                texts.push((path.display().to_string(), fs::read_to_string(&path)?));
            }
        }
    }
    texts.sort();
    Ok(TemplateLibrary::parse(texts.iter().map(|(file, text)| (file.as_str(), text.as_str())))?)
}
