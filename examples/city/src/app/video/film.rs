//! A film: one file with all frames.
//!
//! This program writes `.y4m` files itself. For every other extension it starts ffmpeg, which
//! encodes what it reads from a pipe. Either way the file has a temporary name until it is complete.

use super::files::{Draft, cannot_write, temporary};
use super::y4m::Y4m;
use std::ffi::{OsStr, OsString};
use std::fs;
use std::io::{self, BufRead, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, Command, Stdio};
use std::thread::{self, JoinHandle};
use testbed::scene::SceneError;

/// The program that encodes films.
pub const FFMPEG: &str = "ffmpeg";

/// What ffmpeg does with the frames: it learns their colours, since the stream does not name them,
/// and adds a black column or row to odd sizes, which most players cannot show.
const FILTER: &str = "setparams=range=tv:colorspace=bt709:color_primaries=bt709:color_trc=iec61966-2-1,\
                      pad=ceil(iw/2)*2:ceil(ih/2)*2";

/// A film that is being written. If it is dropped before [`Film::finish`], no file remains.
pub struct Film {
    path: PathBuf,
    /// `None` until the encoder has started.
    draft: Option<Draft>,
    /// `None` once the stream has ended.
    stream: Option<Y4m<BufWriter<Box<dyn Write>>>>,
    encoder: Option<Encoder>,
}

/// A running ffmpeg.
struct Encoder {
    process: Child,
    /// Returns the last line that ffmpeg writes to stderr.
    last_line: Option<JoinHandle<String>>,
}

/// Whether the path names a file with an extension, which determines the format of a film.
pub fn has_format(path: &Path) -> bool {
    path.extension().is_some_and(|extension| !extension.is_empty())
}

impl Film {
    /// Starts a film of this size in pixels, and creates its folder if it does not exist. `ffmpeg` is
    /// the program that encodes it, unless the extension is `.y4m`. Fails if the file cannot be
    /// created or the program is not found.
    pub fn new(path: &Path, size: (u32, u32), fps: f64, ffmpeg: &OsStr) -> Result<Self, SceneError> {
        let is_y4m = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("y4m"));
        let mut film = Self { path: path.into(), draft: None, stream: None, encoder: None };
        // ffmpeg opens its file once it has read the first frame, so nothing is left if there is no
        // ffmpeg.
        let pipe = if is_y4m { None } else { Some(film.start_encoder(ffmpeg)?) };
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|e| cannot_write(path, e))?;
        }
        let (draft, file) = Draft::create(path).map_err(|e| cannot_write(path, e))?;
        film.draft = Some(draft);
        let out = pipe.unwrap_or_else(|| Box::new(file));
        let stream = Y4m::new(BufWriter::new(out), size, fps);
        film.stream = Some(stream.map_err(|e| film.failure(e))?);
        Ok(film)
    }

    /// Adds a frame: three bytes of sRGB per pixel, row by row from the top.
    pub fn add(&mut self, rgb: &[u8]) -> Result<(), SceneError> {
        match self.stream.as_mut().map(|stream| stream.add(rgb)) {
            None | Some(Ok(())) => Ok(()),
            Some(Err(error)) => Err(self.failure(error)),
        }
    }

    /// Completes the film and gives the file its name.
    pub fn finish(mut self) -> Result<(), SceneError> {
        let ended = self.stream.take().map_or(Ok(()), |stream| stream.finish().map(drop));
        ended.map_err(|e| self.failure(e))?;
        if let Some(mut encoder) = self.encoder.take()
            && let Err(reason) = encoder.wait()
        {
            return Err(cannot_write(&self.path, reason));
        }
        self.draft.take().map_or(Ok(()), Draft::complete).map_err(|e| cannot_write(&self.path, e))
    }

    /// Starts ffmpeg and returns its end of the pipe.
    fn start_encoder(&mut self, ffmpeg: &OsStr) -> Result<Box<dyn Write>, SceneError> {
        // The prefix keeps a colon in the path from naming a protocol.
        let mut draft = OsString::from("file:");
        draft.push(temporary(&self.path));
        let started = Command::new(ffmpeg)
            .args(["-hide_banner", "-loglevel", "error", "-y", "-f", "yuv4mpegpipe", "-i", "pipe:0"])
            .args(["-vf", FILTER, "-pix_fmt", "yuv420p"])
            .arg(draft)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn();
        let mut process = started.map_err(|e| {
            let ffmpeg = ffmpeg.to_string_lossy();
            let reason = match e.kind() {
                io::ErrorKind::NotFound => format!("{ffmpeg} was not found; install it, or name a .y4m file"),
                _ => format!("{ffmpeg} does not start: {e}"),
            };
            cannot_write(&self.path, reason)
        })?;
        let pipe = process.stdin.take();
        let last_line = process.stderr.take().map(|stderr| thread::spawn(|| last_line(stderr)));
        self.encoder = Some(Encoder { process, last_line });
        pipe.map(|pipe| Box::new(pipe) as Box<dyn Write>)
            .ok_or_else(|| cannot_write(&self.path, "the encoder has no input"))
    }

    /// The error for a stream that could not be written: ffmpeg knows the reason better.
    fn failure(&mut self, error: io::Error) -> SceneError {
        self.stream = None;
        let told = self.encoder.take().and_then(|mut encoder| encoder.wait().err());
        cannot_write(&self.path, told.unwrap_or_else(|| error.to_string()))
    }
}

impl Drop for Film {
    fn drop(&mut self) {
        // The end of the stream makes ffmpeg finish.
        self.stream = None;
        if let Some(mut encoder) = self.encoder.take() {
            let _ = encoder.process.kill();
            let _ = encoder.process.wait();
        }
    }
}

impl Encoder {
    /// Waits for the end of ffmpeg. An error is the reason in one line.
    fn wait(&mut self) -> Result<(), String> {
        let status = self.process.wait().map_err(|e| e.to_string())?;
        let line = self.last_line.take().and_then(|reader| reader.join().ok()).unwrap_or_default();
        match status.success() {
            true => Ok(()),
            false if line.is_empty() => Err(format!("ffmpeg ended with {status}")),
            false => Err(format!("ffmpeg failed: {line}")),
        }
    }
}

/// Reads everything, so that ffmpeg never waits for a reader, and keeps the last line with a text.
fn last_line(stderr: ChildStderr) -> String {
    let mut last = String::new();
    for line in BufReader::new(stderr).split(b'\n').map_while(Result::ok) {
        let line = String::from_utf8_lossy(&line).trim().to_owned();
        if !line.is_empty() {
            last = line;
        }
    }
    last
}
