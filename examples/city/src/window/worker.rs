//! Runs a viewer on a thread of its own.

use super::app::options::Options;
use super::controls::Controls;
use super::viewer::{Shown, Viewer, Wish};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::{self, JoinHandle};
use testbed::scene::{Camera, SceneError};

/// What the window sends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Request {
    /// Render pictures of this from now on.
    Show(Wish),
    /// Let the scene's time go on by one frame.
    Step,
    /// Go back to the start.
    Rewind,
    /// Render nothing until the next wish.
    Hide,
    /// Destroy the device that renders, as a driver that crashed would.
    LoseDevice,
}

/// What the thread sends.
pub enum Reply {
    /// The scene is loaded. The camera is that of the scene.
    Ready {
        /// Where frames are rendered, for the user.
        backend: String,
        /// The scene's camera.
        camera: Camera,
        /// What the user should know about the files.
        warnings: Vec<String>,
    },
    /// A picture.
    Picture(Box<Shown>),
    /// Nothing more will come.
    Failed(SceneError),
}

/// A thread that renders. It ends when this is dropped.
pub struct Worker {
    requests: Option<Sender<Request>>,
    replies: Receiver<Reply>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    /// Starts to load the scene. `wake` is called after each reply, on the worker's thread.
    pub fn start(options: &Options, controls: Controls, wake: impl Fn() + Send + 'static) -> Self {
        let (requests, inbox) = channel();
        let (outbox, replies) = channel();
        let options = options.clone();
        let thread = thread::spawn(move || {
            let send = |reply| {
                let is_heard = outbox.send(reply).is_ok();
                wake();
                is_heard
            };
            let worked = catch_unwind(AssertUnwindSafe(|| work(&options, &controls, &inbox, &send)));
            let panicked = || SceneError("the thread that renders has panicked".into());
            if let Err(error) = worked.unwrap_or_else(|_| Err(panicked())) {
                send(Reply::Failed(error));
            }
        });
        Self { requests: Some(requests), replies, thread: Some(thread) }
    }

    /// Sends a request. A thread that has ended ignores it; its last reply says why.
    pub fn send(&self, request: Request) {
        if let Some(requests) = &self.requests {
            // The reply `Failed` was sent before the thread ended.
            let _ = requests.send(request);
        }
    }

    /// The replies so far.
    pub fn replies(&self) -> impl Iterator<Item = Reply> {
        self.replies.try_iter()
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.requests = None;
        if let Some(thread) = self.thread.take() {
            // A thread that panicked has printed its message.
            let _ = thread.join();
        }
    }
}

/// Renders until the window closes.
fn work(
    options: &Options,
    controls: &Controls,
    inbox: &Receiver<Request>,
    send: &dyn Fn(Reply) -> bool,
) -> Result<(), SceneError> {
    let mut viewer = Viewer::new(options, controls)?;
    send(Reply::Ready { backend: viewer.backend().into(), camera: viewer.camera(), warnings: viewer.warnings() });
    let mut wish: Option<Wish> = None;
    let (mut steps, mut rewinds) = (0, false);
    loop {
        // Without a wish there is nothing to render.
        let mut next =
            if wish.is_none() { inbox.recv().map_err(|_| TryRecvError::Disconnected) } else { inbox.try_recv() };
        loop {
            match next {
                Ok(Request::Show(new)) => wish = Some(new),
                Ok(Request::Step) => steps += 1,
                Ok(Request::Rewind) => (rewinds, steps) = (true, 0),
                Ok(Request::Hide) => wish = None,
                Ok(Request::LoseDevice) => viewer.lose_device(),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return Ok(()),
            }
            next = inbox.try_recv();
        }
        let Some(wish) = &wish else { continue };
        let mut notice = None;
        if std::mem::take(&mut rewinds) {
            // A scene that cannot be loaded again goes on as it is.
            notice = viewer.rewind(&wish.controls).err().map(|error| error.to_string());
        }
        let steps = std::mem::take(&mut steps);
        for _ in 1..steps {
            notice = viewer.frame(wish, true)?.notice.or(notice);
        }
        let shown = viewer.frame(wish, steps > 0)?;
        let notice = shown.notice.clone().or(notice);
        if !send(Reply::Picture(Box::new(Shown { notice, ..shown }))) {
            return Ok(());
        }
    }
}
