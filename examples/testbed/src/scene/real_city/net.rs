//! Reads the roads of a SUMO network, the `.net.xml` that `netconvert` writes, and the offset by which
//! `netconvert` has moved them.

use std::io::BufRead;
use std::path::Path;

use girandole::glam::{DVec2, dvec2};
use quick_xml::events::{BytesStart, Event};

use super::SceneError;
use super::xml::{XmlFile, parse_number};

/// The width of a lane that states none, in metres, as SUMO has it.
const DEFAULT_WIDTH: f32 = 3.2;

/// The most metres of all lanes together: a thousand large cities. It bounds the memory of the lines
/// on roads.
const MAX_LANES_LENGTH: f64 = 1e8;

/// Who may use a lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LaneUse {
    /// Vehicles on a road.
    Road,
    /// Pedestrians, bicycles and wheelchairs only.
    Walk,
    /// Trains and trams alone.
    Rail,
}

/// A lane of a road.
#[derive(Clone, Debug, PartialEq)]
pub struct Lane {
    /// The line in its middle, metres east and north.
    pub line: Vec<DVec2>,
    /// Metres.
    pub width: f32,
    pub usage: LaneUse,
    /// Index into [`Network::edges`]. The lanes of an edge follow each other, from its outer side to its
    /// inner side.
    pub edge: usize,
}

/// The roads of a city. All positions are those before `netconvert` moved them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Network {
    /// The offset that `netconvert` added to all positions, in metres east and north. Positions of a
    /// simulation on this network include it; positions in this struct do not.
    pub offset: DVec2,
    /// The projection of its positions, in the terms of PROJ; `!` if there is none.
    pub projection: String,
    /// Whether vehicles drive on the left, so that the inner side of an edge is its right one.
    pub is_left_hand: bool,
    /// The junctions at the start and at the end of each edge; empty names where the file has none.
    pub edges: Vec<[String; 2]>,
    /// Without the lanes within junctions.
    pub lanes: Vec<Lane>,
    /// The borders of the junctions.
    pub junctions: Vec<Vec<DVec2>>,
}

impl Network {
    /// Reads a file.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        Self::parse(XmlFile::open(path)?)
    }

    /// Reads from any source.
    pub fn parse<R: BufRead>(mut file: XmlFile<R>) -> Result<Self, SceneError> {
        let mut network = Self::default();
        let (mut buffer, mut depth, mut is_within_junction) = (Vec::new(), 0_usize, false);
        let mut has_location = false;
        loop {
            match file.next(&mut buffer)? {
                Event::Start(element) => {
                    match (depth, element.name().as_ref()) {
                        (0, "net") => {
                            let side = file.text(&element, "lefthand")?.unwrap_or_default();
                            network.is_left_hand = ["1", "true", "yes", "on"].contains(&side.as_str());
                        }
                        (0, other) => return Err(file.fail(format!("expected <net>, found <{other}>"))),
                        (1, "edge") => {
                            is_within_junction = is_internal(&file, &element)?;
                            let end = |name: &str| Ok::<_, SceneError>(file.text(&element, name)?.unwrap_or_default());
                            network.edges.push([end("from")?, end("to")?]);
                        }
                        _ => network.take(&file, &element, is_within_junction, &mut has_location)?,
                    }
                    depth += 1;
                }
                Event::Empty(element) if depth > 0 => {
                    network.take(&file, &element, is_within_junction, &mut has_location)?;
                }
                Event::End(_) => depth = depth.saturating_sub(1),
                Event::Eof if depth > 0 => return Err(file.fail("the file ends within an element")),
                Event::Eof => break,
                _ => {}
            }
        }
        if !has_location {
            return Err(file.fail("there is no <net> with a <location>"));
        }
        let length = |lane: &Lane| lane.line.windows(2).map(|ends| ends[0].distance(ends[1])).sum::<f64>();
        let all: f64 = network.lanes.iter().map(length).sum();
        if all > MAX_LANES_LENGTH {
            return Err(file.fail(format!("its lanes are {all:.0} m long; the limit is {MAX_LANES_LENGTH} m")));
        }
        let offset = network.offset;
        let lines = network.lanes.iter_mut().map(|lane| &mut lane.line).chain(&mut network.junctions);
        lines.flatten().for_each(|at| *at -= offset);
        Ok(network)
    }

    /// Takes what an element tells.
    fn take<R: BufRead>(
        &mut self,
        file: &XmlFile<R>,
        element: &BytesStart<'_>,
        is_within_junction: bool,
        has_location: &mut bool,
    ) -> Result<(), SceneError> {
        match element.name().as_ref() {
            "location" => {
                let offset = positions(file, element, "netOffset")?;
                let [offset] = offset[..] else { return Err(file.fail("\"netOffset\" is not one position")) };
                (self.offset, *has_location) = (offset, true);
                self.projection = file.text(element, "projParameter")?.unwrap_or_else(|| "!".into());
            }
            // Lanes belong to the last edge.
            "lane" if !is_within_junction && !self.edges.is_empty() => {
                let line = positions(file, element, "shape")?;
                let width = match file.text(element, "width")? {
                    Some(_) => file.number(element, "width")? as f32,
                    None => DEFAULT_WIDTH,
                };
                let usage = usage(&file.text(element, "allow")?.unwrap_or_default());
                if line.len() >= 2 && width > 0.0 {
                    let edge = self.edges.len() - 1;
                    self.lanes.push(Lane { line, width, usage, edge });
                }
            }
            // Junctions within others have no border of their own, and dead ends an empty one.
            "junction" if file.text(element, "shape")?.is_some() => {
                let border = positions(file, element, "shape")?;
                if border.len() >= 3 {
                    self.junctions.push(border);
                }
            }
            _ => {}
        }
        Ok(())
    }
}

/// Whether an edge lies within a junction, or is a path of pedestrians across roads.
fn is_internal<R: BufRead>(file: &XmlFile<R>, element: &BytesStart<'_>) -> Result<bool, SceneError> {
    let function = file.text(element, "function")?.unwrap_or_default();
    Ok(["internal", "crossing", "walkingarea", "connector"].contains(&function.as_str()))
}

/// The use of a lane, from the classes of vehicles in its attribute `allow`. An empty list allows all
/// classes.
fn usage(allowed: &str) -> LaneUse {
    let mut classes = allowed.split_whitespace().peekable();
    if classes.peek().is_none() {
        return LaneUse::Road;
    }
    let classes: Vec<&str> = classes.collect();
    let all_of = |group: &[&str]| classes.iter().all(|class| group.contains(class));
    match () {
        () if all_of(&["pedestrian", "bicycle", "wheelchair"]) => LaneUse::Walk,
        () if all_of(&["rail", "rail_urban", "rail_electric", "rail_fast", "tram", "subway"]) => LaneUse::Rail,
        () => LaneUse::Road,
    }
}

/// The positions of an attribute: `x,y` or `x,y,z`, with spaces between them.
fn positions<R: BufRead>(file: &XmlFile<R>, element: &BytesStart<'_>, name: &str) -> Result<Vec<DVec2>, SceneError> {
    let tag = element.name();
    let fail = |what: &str| file.fail(format!("\"{name}\" of <{}> {what}", tag.as_ref()));
    let text = file.text(element, name)?.ok_or_else(|| fail("is missing"))?;
    text.split_whitespace()
        .map(|position| {
            let mut numbers = position.split(',').map(parse_number);
            match (numbers.next().flatten(), numbers.next().flatten()) {
                (Some(east), Some(north)) => Ok(dvec2(east, north)),
                _ => Err(fail(&format!("has {position:?}, which is no position"))),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn network(text: &str) -> Result<Network, SceneError> {
        Network::parse(XmlFile::new(text.as_bytes(), "test.net.xml".into()))
    }

    const SMALL: &str = r#"<?xml version="1.0"?><net version="1.20">
        <location netOffset="-500.00,100.00" convBoundary="0,0,9,9" origBoundary="0,0,9,9" projParameter="!"/>
        <edge id=":a_0" function="internal"><lane id=":a_0_0" index="0" shape="1,1 2,2"/></edge>
        <edge id="e" from="a" to="b" priority="1">
            <lane id="e_0" index="0" allow="pedestrian" width="2.00" shape="0.00,5.00 10.00,5.00"/>
            <lane id="e_1" index="1" disallow="pedestrian" shape="0.00,8.00,1.5 10.00,8.00,1.5"/>
            <lane id="e_2" index="2" allow="tram" shape="0,9 10,9"/>
        </edge>
        <junction id="a" type="priority" x="0" y="0" shape="0,0 1,0 1,1 0,1"/>
        <junction id="b" type="dead_end" x="0" y="0" shape=""/>
        <junction id=":a_1" type="internal" x="0" y="0"/>
    </net>"#;

    #[test]
    fn positions_are_those_before_netconvert_moved_them() {
        let network = network(SMALL).unwrap();
        assert_eq!((network.offset, network.projection.as_str()), (dvec2(-500.0, 100.0), "!"));
        let lanes: Vec<_> = network.lanes.iter().map(|lane| (lane.line[0], lane.width, lane.usage)).collect();
        let expected = [
            (dvec2(500.0, -95.0), 2.0, LaneUse::Walk),
            (dvec2(500.0, -92.0), DEFAULT_WIDTH, LaneUse::Road),
            (dvec2(500.0, -91.0), DEFAULT_WIDTH, LaneUse::Rail),
        ];
        assert_eq!(lanes, expected);
        assert!(!network.is_left_hand && network.lanes.iter().all(|lane| network.edges[lane.edge] == ["a", "b"]));
        assert_eq!(
            network.junctions,
            [[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| dvec2(x + 500.0, y - 100.0)).to_vec()]
        );
    }

    #[test]
    fn malformed_networks_are_refused_with_one_line() {
        for (text, expected) in [
            (SMALL.replace("0,9 10,9", "-9e7,9 9e7,9").as_str(), "the limit is 100000000 m"),
            ("", "no <net>"),
            ("<net></net>", "<location>"),
            ("<routes></routes>", "found <routes>"),
            ("<net><location netOffset=\"0,0\"/>", "ends within"),
            ("<net><location/></net>", "\"netOffset\" of <location> is missing"),
            ("<net>\n\n<location netOffset=\"0,x\"/></net>", "line 3: \"netOffset\" of <location> has \"0,x\""),
            ("<net><location netOffset=\"0,0 1,1\"/></net>", "not one position"),
            ("<net><location netOffset=\"0,0\"/><edge><lane shape=\"1,NaN 2,3\"/></edge></net>", "NaN"),
            ("<net><location netOffset=\"0,0\"/><edge><lane/></edge></net>", "\"shape\" of <lane> is missing"),
            ("<net><location netOffset=\"0,0\"/><edge><lane shape=\"0,0 1,1\" width=\"w\"/></edge></net>", "\"width\""),
        ] {
            let SceneError(message) = network(text).expect_err(text);
            assert!(message.contains(expected) && !message.contains('\n'), "{text}: {message}");
        }
    }
}
