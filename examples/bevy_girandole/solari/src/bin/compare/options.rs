//! The options of the command line.

use crate::scene::SceneName;

pub const USAGE: &str = "Options:
  --scene spheres|interior     what is drawn (spheres)
  --path-tracer                draws with the path tracer in place of the real-time renderer
  --restir                     the real-time renderer keeps reservoirs
  --uniform                    lights are drawn by Solari, uniformly
  --bounces N                  bounces of the real-time renderer (1)
  --samples N                  draws of lights for each pixel in real time (8)
  --frames N                   frames whose mean is taken (64)
  --size WxH                   size of the picture (320x180)
  --raw FILE                   writes the mean as 32-bit floats
  --reference FILE             compares the mean with such a file
  --out FILE.png               writes the mean as a picture";

#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    pub scene: SceneName,
    pub path_tracer: bool,
    pub restir: bool,
    pub uniform: bool,
    pub bounces: u32,
    pub samples: u32,
    pub frames: u32,
    pub size: [u32; 2],
    pub raw: Option<String>,
    pub reference: Option<String>,
    pub out: Option<String>,
}

impl Options {
    /// Reads the options; returns a message if they make no sense.
    pub fn parse(mut words: impl Iterator<Item = String>) -> Result<Self, String> {
        let mut options = Self {
            scene: SceneName::Spheres,
            path_tracer: false,
            restir: false,
            uniform: false,
            bounces: 1,
            samples: 8,
            frames: 64,
            size: [320, 180],
            raw: None,
            reference: None,
            out: None,
        };
        while let Some(word) = words.next() {
            let mut value = || words.next().ok_or_else(|| format!("{word} needs a value.\n{USAGE}"));
            match word.as_str() {
                "--scene" => {
                    options.scene = match value()?.as_str() {
                        "spheres" => SceneName::Spheres,
                        "interior" => SceneName::Interior,
                        other => return Err(format!("{other} is not a scene.\n{USAGE}")),
                    }
                }
                "--path-tracer" => options.path_tracer = true,
                "--restir" => options.restir = true,
                "--uniform" => options.uniform = true,
                "--bounces" => options.bounces = number(&value()?)?,
                "--samples" => options.samples = number(&value()?)?,
                "--frames" => options.frames = number(&value()?)?,
                "--size" => options.size = size(&value()?)?,
                "--raw" => options.raw = Some(value()?),
                "--reference" => options.reference = Some(value()?),
                "--out" => options.out = Some(value()?),
                _ => return Err(format!("{word} is not an option.\n{USAGE}")),
            }
        }
        Ok(options)
    }
}

/// A number that is not 0.
fn number(word: &str) -> Result<u32, String> {
    word.parse().ok().filter(|number| *number > 0).ok_or_else(|| format!("{word} is not a number above 0.\n{USAGE}"))
}

fn size(word: &str) -> Result<[u32; 2], String> {
    let (width, height) = word.split_once('x').ok_or_else(|| format!("{word} is not WxH.\n{USAGE}"))?;
    Ok([number(width)?, number(height)?])
}
