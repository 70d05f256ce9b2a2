//! The loader thread: it fills regions, and frees those that have left the world.

use super::blocks::{Block, Builder};
use girandole::{LightTree, Region, WorldError};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

/// A job for the thread.
#[derive(Debug)]
enum Job {
    Fill(Block),
    Free(Vec<LightTree>),
}

/// A handle of the thread, which ends when it is dropped.
#[derive(Debug)]
pub struct Loader {
    jobs: Option<Sender<Job>>,
    filled: Receiver<Result<Region, WorldError>>,
    thread: Option<JoinHandle<()>>,
}

/// The message of a panic if the thread is gone.
const GONE: &str = "the loader lives as long as its handle";

impl Loader {
    pub fn start(builder: Builder) -> Result<Self, String> {
        // A pool of its own, so that it takes no thread from the world's pool.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(|error| error.to_string())?;
        let (jobs, asked) = channel();
        let (sender, filled) = channel();
        let run = move || {
            for job in asked {
                match job {
                    Job::Fill(block) => {
                        if sender.send(pool.install(|| builder.fill(block))).is_err() {
                            break;
                        }
                    }
                    Job::Free(removed) => drop(removed),
                }
            }
        };
        let thread = std::thread::spawn(run);
        Ok(Self { jobs: Some(jobs), filled, thread: Some(thread) })
    }

    fn ask(&self, job: Job) {
        self.jobs.as_ref().and_then(|jobs| jobs.send(job).ok()).expect(GONE);
    }

    /// Requests a block.
    pub fn fill(&self, block: Block) {
        self.ask(Job::Fill(block));
    }

    /// Hands over what has left the world.
    pub fn free(&self, removed: Vec<LightTree>) {
        self.ask(Job::Free(removed));
    }

    /// Waits for the next block, in the order of the requests.
    pub fn take(&self) -> Result<Region, WorldError> {
        self.filled.recv().expect(GONE)
    }
}

impl Drop for Loader {
    fn drop(&mut self) {
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            // `take` has reported a panic of the thread.
            drop(thread.join());
        }
    }
}
