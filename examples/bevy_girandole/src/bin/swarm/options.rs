//! The options of the command line.

use bevy::prelude::Resource;
use girandole::plan::HeatMap;

pub const USAGE: &str = "Options:
  --lamps N        number of lamps (100000)
  --rooms          a hundred rooms with 1000 lamps in place of the field; --lamps may follow
  --candidates N   candidates for each sample (1)
  --reuse N        frames that a kept light stands for (8)
  --samples N      samples for each pixel and frame (1)
  --mean N         frames whose mean is taken while lamps move (12)
  --heat-map NAME  noise, cuts, misses or lights in place of the picture
  --size WxH       size of the picture (960x540)
  --no-shadows     nothing casts shadows
  --no-ray-queries traces shadow rays in software, without a window
  --no-learning    shadows teach nothing
  --bevy-lights    leaves the lamps to Bevy
  --headless       draws without a window
  --frames N       frames to draw without a window (24)
  --settle N       frames after which the lamps stand still (never)
  --out FILE.png   the file of the last frame without a window
  --film FOLDER    a folder for files of all frames before the last
  --dump FILE      a file with the lights of the last frame without a window, for the city";

#[derive(Resource, Clone, Debug, PartialEq)]
pub struct Options {
    pub lamps: u32,
    pub rooms: bool,
    pub no_shadows: bool,
    pub no_ray_queries: bool,
    pub no_learning: bool,
    pub candidates: u32,
    pub reused_frames: u32,
    pub samples: u32,
    pub moving_frames: u32,
    pub heat_map: Option<HeatMap>,
    pub size: [u32; 2],
    pub bevy_lights: bool,
    pub headless: bool,
    pub frames: u32,
    pub settle: u32,
    pub out: Option<String>,
    pub film: Option<String>,
    pub dump: Option<String>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            lamps: 100_000,
            rooms: false,
            no_shadows: false,
            no_ray_queries: false,
            no_learning: false,
            candidates: 1,
            reused_frames: 8,
            samples: 1,
            moving_frames: 12,
            heat_map: None,
            size: [960, 540],
            bevy_lights: false,
            headless: false,
            frames: 24,
            settle: u32::MAX,
            out: None,
            film: None,
            dump: None,
        }
    }
}

impl Options {
    /// Reads the options; returns a message if they make no sense.
    pub fn parse(mut words: impl Iterator<Item = String>) -> Result<Self, String> {
        let mut options = Self::default();
        while let Some(word) = words.next() {
            let mut value = || words.next().ok_or_else(|| format!("{word} needs a value.\n{USAGE}"));
            match word.as_str() {
                "--lamps" => options.lamps = number(&value()?)?,
                "--candidates" => options.candidates = number(&value()?)?,
                "--reuse" => options.reused_frames = number(&value()?)?,
                "--samples" => options.samples = number(&value()?)?,
                "--mean" => options.moving_frames = number(&value()?)?,
                "--heat-map" => options.heat_map = Some(heat_map(&value()?)?),
                "--frames" => options.frames = number(&value()?)?,
                "--settle" => options.settle = number(&value()?)?,
                "--size" => options.size = size(&value()?)?,
                "--out" => options.out = Some(value()?),
                "--film" => options.film = Some(value()?),
                "--dump" => options.dump = Some(value()?),
                "--rooms" => (options.rooms, options.lamps) = (true, 1000),
                "--no-shadows" => options.no_shadows = true,
                "--no-ray-queries" => options.no_ray_queries = true,
                "--no-learning" => options.no_learning = true,
                "--bevy-lights" => options.bevy_lights = true,
                "--headless" => options.headless = true,
                _ => return Err(format!("{word} is not an option.\n{USAGE}")),
            }
        }
        Ok(options)
    }
}

fn number(word: &str) -> Result<u32, String> {
    word.parse().map_err(|_| format!("{word} is not a number.\n{USAGE}"))
}

fn size(word: &str) -> Result<[u32; 2], String> {
    let Some((width, height)) = word.split_once('x') else { return Err(format!("{word} is not WxH.\n{USAGE}")) };
    let size = [number(width)?, number(height)?];
    if size.contains(&0) {
        return Err(format!("{word} has no pixels.\n{USAGE}"));
    }
    Ok(size)
}

fn heat_map(word: &str) -> Result<HeatMap, String> {
    match word {
        "noise" => Ok(HeatMap::Noise),
        "cuts" => Ok(HeatMap::Cuts),
        "misses" => Ok(HeatMap::Misses),
        "lights" => Ok(HeatMap::Lights),
        _ => Err(format!("{word} is no heat map.\n{USAGE}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(line: &str) -> Result<Options, String> {
        Options::parse(line.split_whitespace().map(String::from))
    }

    #[test]
    fn options_are_read_or_refused() {
        let options = parse("--headless --size 64x48 --frames 3 --out a.png").unwrap();
        assert_eq!((options.size, options.frames, options.out.as_deref()), ([64, 48], 3, Some("a.png")));
        let [few, many] = ["--rooms", "--rooms --lamps 7"].map(|line| parse(line).unwrap());
        assert_eq!((few.lamps, many.lamps, few.rooms), (1000, 7, true));
        for line in ["--size 64", "--size 0x3", "--frames", "--frames many", "--nothing", "--heat-map heat"] {
            assert!(parse(line).is_err_and(|message| message.contains(USAGE)), "{line}");
        }
    }
}
