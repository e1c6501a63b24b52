//! One episode of a scenario, with the agent put together by hand.

use acm_actors::{Agent, agent::Interrupt};
use acm_sim::{Scenario, SimOptions, Simulation};
use std::sync::{Arc, Mutex};

#[tokio::main(flavor = "multi_thread", worker_threads = 2)]
async fn main() -> anyhow::Result<()> {
    let scenario = Scenario::open("put-back-block")?;
    let renderer = Arc::new(Mutex::new(acm_render::Renderer::new()?));
    let world = Simulation::new(&scenario, &SimOptions { seed: 3, motion: true, ..SimOptions::default() }, renderer)?;

    let library = Arc::new(acm_memory::default_library()?);
    let memory = Box::new(acm_memory::AcmMemory::in_memory(Arc::clone(&library)));
    let agent = Agent::builder(library, memory).build()?;
    let run = agent.run(world.task(), world.embodiment(), world.camera(), world.clock(), &Interrupt::default()).await?;

    println!("told:  {}", world.task().instruction);
    for step in &run.report.steps {
        println!("did:   {} {} -> {:?} at {}", step.skill, step.object, step.outcome, step.ended);
    }
    println!("ended: {:?}", run.report.ending);
    println!("judge: {}", world.verdict().explanation);
    Ok(())
}
