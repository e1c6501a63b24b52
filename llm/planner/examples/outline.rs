//! Prints how instructions are read: `cargo run -p acm-planner --example outline < instructions.txt`.
use acm_concept::template::TemplateLibrary;
use acm_planner::Planner;
use std::io::BufRead;

const LIBRARY: [(&str, &str); 4] = [
    ("box.toml", include_str!("../../../memory/library/box.toml")),
    ("button.toml", include_str!("../../../memory/library/button.toml")),
    ("cylinder.toml", include_str!("../../../memory/library/cylinder.toml")),
    ("mat.toml", include_str!("../../../memory/library/mat.toml")),
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let library = TemplateLibrary::parse(LIBRARY)?;
    let planner = Planner::new()?;
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
